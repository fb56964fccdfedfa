/* The Bouc-Wen family with tangents along a whole record at constant coefficients, for fits. Force and columns are
 * written block by block, while the values of the curve are in the first-level cache. */

/* Samples of a block on one branch: w and its derivatives, travel since the turning point, force at w = 1. */
typedef struct {
    double w[BLOCK], by_tau[BLOCK], by_n[BLOCK], by_kappa[BLOCK], path[BLOCK], amplitude[BLOCK];
} block_points;

/* Return true if the coefficients are constant during a whole record and no direction has a seed. */
static int is_steady(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction)
{
    for (size_t d = 0; d < directions; d++)
        if (direction[d].seed) return 0;
    return !m->stride && !r->behind;
}

static void points_of(const curve *c, const mrd_record *r, size_t p, size_t i, size_t n, double start, double rho,
                      int rising, block_points *restrict out)
{
    const branch *b = rising ? &c->rise : &c->fall;
    const double offset = rising ? b->offset + start : b->offset - start, rate = rising ? rho : -rho;
    const double side = r->side[p], sign = rising ? side : -side;
    double t[BLOCK], point[POINT * BLOCK];
    places_of(r, p, i, n, offset, rate, b, t);
    points_at(b, n, t, point);
    for (size_t k = 0; k < n; k++) {
        out->w[k] = sign * point[POINT * k + BY_NOTHING];
        out->by_tau[k] = side * point[POINT * k + BY_TAU];
        out->by_n[k] = sign * point[POINT * k + BY_N];
        out->by_kappa[k] = sign * point[POINT * k + BY_KAPPA];
    }
    for (size_t k = 0; k < n; k++) out->path[k] = path_at(r, p, i + k);
}

/* Compute the points of samples beyond the end of the table, where w is constant. */
static void points_at_top(const curve *c, double side, size_t n, block_points *out)
{
    const curve_point top = branch_point(c, 1, c->rise.top);
    for (size_t k = 0; k < n; k++) {
        out->w[k] = side * top.w;
        out->by_n[k] = side * top.by_n;
        out->by_tau[k] = out->by_kappa[k] = out->path[k] = 0.0;
    }
}

/* Write force and columns of the first element at n samples from sample i on, or add force and columns of the second
 * element. The samples from n to `wide` get values that the next block overwrites, or zeros are added to them. */
static void block_columns(const mrd_model *m, const mrd_record *r, const shape_of_law *shape, int e, size_t i, size_t n,
                          size_t wide, const start_tangents *s, size_t directions, const mrd_direction *direction, double *force,
                          double *columns, block_points *restrict b)
{
    for (size_t k = 0; k < wide; k++) b->amplitude[k] = amplitude_at(m, shape, e, r->v[i + k], 0);
    for (size_t k = n; k < wide; k++) b->amplitude[k] = 0.0;
    double *restrict f = force + i;
    for (size_t k = 0; k < wide; k++) f[k] = (e ? f[k] : 0.0) + b->amplitude[k] * b->w[k];
    for (size_t d = 0; d < directions; d++) {
        const int coefficient = direction[d].coefficient;
        double *restrict column = columns + d * r->n + i;
        if (coefficient < MRD_COMMON) continue;
        if (coefficient == shape->yield[e]) {
            for (size_t k = 0; k < wide; k++) column[k] = b->w[k];
        } else if (coefficient == shape->rho[e]) {
            for (size_t k = 0; k < wide; k++) column[k] = b->amplitude[k] * (b->by_tau[k] * (s->rho[0] + b->path[k]));
        } else if (coefficient == shape->n || coefficient == shape->kappa) {
            const double *restrict by = coefficient == shape->n ? b->by_n : b->by_kappa;
            const double start = coefficient == shape->n ? s->n : s->kappa;
            if (e)
                for (size_t k = 0; k < wide; k++) column[k] += b->amplitude[k] * (by[k] + b->by_tau[k] * start);
            else
                for (size_t k = 0; k < wide; k++) column[k] = b->amplitude[k] * (by[k] + b->by_tau[k] * start);
        } else if (m->law == MRD_SATURATING && coefficient == SAT_RATE) {
            for (size_t k = 0; k < wide; k++) column[k] = speed_share(m, r->v[i + k], 0) * b->w[k];
        } else if (m->law == MRD_SATURATING && coefficient == SAT_VELOCITY) {
            const double rate = coefficient_at(m, SAT_RATE, 0), velocity = coefficient_at(m, SAT_VELOCITY, 0);
            for (size_t k = 0; k < wide; k++) {
                const double v = r->v[i + k];
                column[k] = -rate * speed_share(m, v, 0) / (fabs(v) + velocity) * b->w[k];
            }
        }
    }
}

static mrd_status run_steady_bouc_wen(const mrd_model *m, const mrd_record *r, const shape_of_law *shape,
                                      size_t directions, const mrd_direction *direction, double *force, double *columns,
                                      const curve *c)
{
    block_points b;
    for (int e = 0; e < shape->elements; e++) {
        const double rho = m->coefficient[shape->rho[e]];
        double start = 0.0;
        start_tangents s = {{0.0}, 0.0, 0.0};
        for (size_t p = 0; p < r->pieces; p++) {
            const size_t to = r->first[p + 1];
            const spans at = spans_of(c, r, p, r->first[p], to, start, rho);
            for (size_t i = r->first[p], n; i < to; i += n) {
                const size_t end = i < at.fall ? at.fall : i < at.rise ? at.rise : to;
                n = end - i < BLOCK ? end - i : BLOCK;
                /* Compute whole packs if the record is long enough, because a loop over the last few samples is as
                 * slow as a pack. */
                const size_t packs = (n + 7) / 8 * 8, wide = i + packs <= r->n ? packs : n;
                if (i < at.rise) points_of(c, r, p, i, wide, start, rho, i >= at.fall, &b);
                else points_at_top(c, r->side[p], wide, &b);
                block_columns(m, r, shape, e, i, n, wide, &s, directions, direction, force, columns, &b);
            }
            if (p + 1 == r->pieces) break;
            const double length = piece_length(r, p);
            const curve_point turn = curve_at(c, start + rho * length);
            start = curve_inverse(c, -turn.w);
            turn_tangents(turn, curve_at(c, start), 1, &length, &s);
        }
    }
    common_rows rows;
    const mrd_status opened = common_open(m, r, directions, direction, &rows);
    if (opened != MRD_OK) return opened;
    common_add(m, r, &rows, force);
    for (size_t d = 0; d < directions; d++)
        if (direction[d].coefficient < MRD_COMMON) common_column(m, r, &rows, direction + d, columns + d * r->n);
    common_close(&rows);
    return MRD_OK;
}
