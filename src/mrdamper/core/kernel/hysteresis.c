/* The Bouc-Wen family along a record: exact solution from turning point to turning point.
 *
 * The samples between two reversals do not depend on one another: w = Y(tau_start + rho travel). Only the start of a
 * piece depends on the previous piece. It needs one inversion of the curve.
 */

/* Prefetch the n numbers of an array one block after sample `from`, if they exist. The next block is then loaded from
 * memory while the present block is computed; the hardware does not prefetch that far. This is a macro because GCC
 * removes calls of a function that only prefetches. */
#if defined(__GNUC__)
#define FETCH_AHEAD(array, from, n, known)                                              \
    do {                                                                                \
        if ((from) + BLOCK + (n) <= (known))                                            \
            for (size_t ask = 0; ask < (n); ask += 8)                                   \
                __builtin_prefetch((array) + (from) + BLOCK + ask);                     \
    } while (0)
#else
#define FETCH_AHEAD(array, from, n, known) ((void)0)
#endif

/* Ranges of the samples of a monotone piece by their part of the curve. The travel never decreases. Therefore the first
 * samples are on the fall branch (tau < 0), the next samples on the rise branch, and the last samples beyond the table,
 * where w is constant. */
typedef struct {
    size_t fall, rise; /* end of the range on the fall branch, end of the range on the rise branch */
} spans;

static size_t first_beyond(const mrd_record *r, size_t p, size_t low, size_t high, double offset, double rho, double limit)
{
    for (size_t left = high - low; left > 0;) { /* bisection without conditional jumps */
        const size_t half = left / 2;
        const int before = offset + rho * path_at(r, p, low + half) < limit;
        low += before ? half + 1 : 0;
        left = before ? left - half - 1 : half;
    }
    return low;
}

static spans spans_of(const curve *c, const mrd_record *r, size_t p, size_t from, size_t to, double start, double rho)
{
    spans out;
    out.fall = start < 0.0 ? first_beyond(r, p, from, to, start, rho, 0.0) : from;
    out.rise = first_beyond(r, p, out.fall, to, c->rise.offset + start, rho, c->rise.top);
    return out;
}

/* Compute the table argument t = offset + rate * travel of n samples from sample i on, limited to the table. */
static inline void places_of(const mrd_record *r, size_t p, size_t i, size_t n, double offset, double rate,
                             const branch *b, double *restrict t)
{
    const double low = b->offset, top = b->top;
    if (r->path) {
        const double *restrict path = r->path + i;
        FETCH_AHEAD(r->path, i, n, r->n);
        for (size_t k = 0; k < n; k++) {
            const double at = offset + rate * path[k];
            const double below = at < top ? at : top;
            t[k] = below > low ? below : low;
        }
    } else {
        const double *restrict x = r->x + i;
        const double side = r->side[p], turn = r->turn[p];
        FETCH_AHEAD(r->x, i, n, r->n);
        for (size_t k = 0; k < n; k++) {
            const double at = offset + rate * (side * (x[k] - turn));
            const double below = at < top ? at : top;
            t[k] = below > low ? below : low;
        }
    }
}

/* Compute |w| of n <= BLOCK samples from sample i on, all on one branch. */
static inline void block_of(const curve *c, const mrd_record *r, size_t p, size_t i, size_t n, double start, double rho,
                            int rising, double *restrict w)
{
    double t[BLOCK];
    if (rising) {
        places_of(r, p, i, n, c->rise.offset + start, rho, &c->rise, t);
        cubics_at(&c->rise, n, t, w);
    } else {
        places_of(r, p, i, n, c->fall.offset - start, -rho, &c->fall, t);
        cubics_at(&c->fall, n, t, w);
    }
}

/* Return tau at the start of the next piece, from tau at the end of this piece. */
static double turned(const curve *c, double tau_end)
{
    return curve_inverse(c, -curve_at(c, tau_end).w);
}

/* Return the travel of a whole piece [m]. */
static inline double piece_length(const mrd_record *r, size_t p) { return fabs(r->turn[p + 1] - r->turn[p]); }

/* Scaled travel since the turning point: base + rho (path - from). rho is its mean over a sample interval, which makes
 * the error second order. If rho changes, base and from are updated. For constant rho the result is bitwise equal to
 * rho * path. */
typedef struct {
    double base, from, rho;
} weighted_travel;

static inline double travel_to(weighted_travel *t, double rho, double last, double path)
{
    if (rho != t->rho) {
        t->base += t->rho * (last - t->from);
        t->from = last;
        t->rho = rho;
    }
    return t->base + rho * (path - t->from);
}

/* Compute w along a record at constant rho. `start` is tau at the start of the first piece. Return tau at the start of
 * the last piece. */
static double bouc_wen_state(const curve *c, const mrd_record *r, double rho, double start, double *w)
{
    for (size_t p = 0; p < r->pieces; p++) {
        const size_t from = r->first[p], to = r->first[p + 1];
        const double side = r->side[p];
        const spans at = spans_of(c, r, p, from, to, start, rho);
        for (size_t i = from; i < at.rise;) {
            const int rising = i >= at.fall;
            const size_t end = rising ? at.rise : at.fall, n = end - i < BLOCK ? end - i : BLOCK;
            double u[BLOCK];
            block_of(c, r, p, i, n, start, rho, rising, u);
            const double sign = rising ? side : -side;
            for (size_t k = 0; k < n; k++) w[i + k] = sign * u[k];
            i += n;
        }
        for (size_t i = at.rise; i < to; i++) w[i] = side * c->rise.last;
        if (p + 1 < r->pieces) start = turned(c, start + rho * piece_length(r, p));
    }
    return start;
}

/* Derivatives of tau at the start of a piece with respect to rho (along each direction), n and kappa. */
typedef struct {
    double rho[MRD_DIRECTIONS], n, kappa;
} start_tangents;

/* Update the derivatives of tau at a turning point. `end` and `begin` are the curve points before and after it. */
static void turn_tangents(curve_point end, curve_point begin, size_t ways, const double *travel, start_tangents *s)
{
    const double scale = begin.slope > 1e-9 ? 1.0 / begin.slope : 0.0;
    for (size_t d = 0; d < ways; d++) s->rho[d] = -end.slope * (s->rho[d] + travel[d]) * scale;
    s->n = (-(end.by_n + end.slope * s->n) - begin.by_n) * scale;
    s->kappa = (-(end.by_kappa + end.slope * s->kappa) - begin.by_kappa) * scale;
}

/* Compute w and its derivatives along a record.
 *
 * rho may vary from sample to sample (stride 1). by_rho[d] receives the derivative of w along direction d of `ways`
 * directions of rho with seeds. by_n and by_kappa receive dw/dn and dw/dkappa. `tau` is tau at the start of the first
 * piece, and `gone` is the scaled travel in this piece before the record. Both are updated to the last piece.
 */
static void bouc_wen_tangents(const curve *c, const mrd_record *r, const double *rho, size_t stride, size_t ways,
                              const mrd_direction *const *way, double *w, double *const *by_rho, double *by_n,
                              double *by_kappa, double *tau, weighted_travel *gone)
{
    double start = *tau, travel_rho[MRD_DIRECTIONS];
    start_tangents s = {{0.0}, 0.0, 0.0};
    weighted_travel t = *gone;

    for (size_t p = 0; p < r->pieces; p++) {
        const double side = r->side[p];
        double last = p || !r->behind ? 0.0 : r->travelled;
        if (p) t.base = t.from = 0.0;
        for (size_t d = 0; d < ways; d++) travel_rho[d] = 0.0;
        size_t i = r->first[p];
        for (; i < r->first[p + 1]; i++) {
            const double path = path_at(r, p, i), moved = path - last;
            const curve_point at = curve_along(c, start, travel_to(&t, interval_mean(rho, stride, i, r->known), last, path));
            last = path;
            w[i] = side * at.w;
            for (size_t d = 0; d < ways; d++) {
                travel_rho[d] += seed_mean(way[d], i, r->known) * moved;
                by_rho[d][i] = side * at.slope * (s.rho[d] + travel_rho[d]);
            }
            if (by_n) by_n[i] = side * (at.by_n + at.slope * s.n);
            if (by_kappa) by_kappa[i] = side * (at.by_kappa + at.slope * s.kappa);
        }
        if (p + 1 == r->pieces) break;
        /* Move the remaining travel to the turning point, and reverse. */
        const double length = piece_length(r, p), rest = length - last;
        const curve_point end = curve_at(c, start + travel_to(&t, interval_mean(rho, stride, i, r->known), last, length));
        start = curve_inverse(c, -end.w);
        for (size_t d = 0; d < ways; d++) travel_rho[d] += seed_mean(way[d], i, r->known) * rest;
        turn_tangents(end, curve_at(c, start), ways, travel_rho, &s);
    }
    *tau = start;
    *gone = t;
}
