/* The LuGre law: bristles that bend, creep and break away, normalised like the Bouc-Wen family.
 *
 *     dw/dt = rho (v - |v| w / g(v)),    g(v) = 1 + fs exp(-(v/vf)^2)
 *     F     = Fy w + s1 (v - |v| w / g(v))
 *
 * While the motion keeps its direction, w approaches +-g exponentially with the travel. A step uses this exact
 * solution, with g at the mean of the velocities at its ends (order two; exact for fs = 0). A step with a reversal
 * is divided at the extremum of the Hermite cubic. |w| <= 1 + fs for any step. Only the last sample interval is
 * used, so that the results for a whole record and sample by sample are equal.
 */

typedef struct {
    double yield, rho, excess, fade, damping;
} bristles;

/* Return the coefficients at sample i, or their means over the sample interval that ends at sample i. */
static bristles bristles_at(const mrd_model *m, size_t i, size_t n, int mean)
{
#define AT(k) (mean ? coefficient_mean(m, k, i, n) : coefficient_at(m, k, i))
    const bristles out = {AT(LG_YIELD), AT(LG_RHO), AT(LG_EXCESS), AT(LG_FADE), AT(LG_DAMPING)};
#undef AT
    return out;
}

/* |w| in steady sliding at velocity v, and its derivatives with respect to two coefficients. */
typedef struct {
    double g, by_excess, by_fade;
} sliding;

static inline sliding sliding_at(const bristles *c, double v, int tangents)
{
    sliding out = {1.0, 0.0, 0.0};
    if (c->excess == 0.0 && !tangents) return out;
    const double ratio = v / c->fade;
    out.by_excess = exp(-ratio * ratio);
    out.g += c->excess * out.by_excess;
    if (tangents) out.by_fade = c->excess * out.by_excess * 2.0 * v * v / (c->fade * c->fade * c->fade);
    return out;
}

/* Update w and its derivatives for a signed travel at a mean velocity v. */
static inline void bristles_move(const bristles *c, double travel, double v, double *w, size_t ways,
                                 const mrd_direction *const *way, const double *seed, double *by)
{
    if (travel == 0.0) return;
    const sliding level = sliding_at(c, v, ways > 0);
    const double side = travel > 0.0 ? 1.0 : -1.0, length = fabs(travel);
    const double exponent = c->rho * length / level.g, decay = exp(-exponent);
    const double gap = (*w - side * level.g) * decay;
    *w = side * level.g + gap;
    const double by_rho = -gap * length / level.g, by_g = side * (1.0 - decay) + gap * exponent / level.g;
    for (size_t d = 0; d < ways; d++) {
        by[d] *= decay;
        switch (way[d]->coefficient) {
        case LG_RHO: by[d] += by_rho * seed[d]; break;
        case LG_EXCESS: by[d] += by_g * level.by_excess * seed[d]; break;
        case LG_FADE: by[d] += by_g * level.by_fade * seed[d]; break;
        default: break;
        }
    }
}

/* Return the force of the bristles at sample i, and compute its derivatives. */
static inline double bristles_force(const mrd_model *m, const mrd_record *r, size_t i, double w, size_t ways,
                                    const mrd_direction *const *way, const double *by, double *const *column)
{
    const bristles c = bristles_at(m, i, r->n, 0);
    const double v = r->v[i], speed = fabs(v);
    const sliding level = sliding_at(&c, v, ways > 0);
    const double bend = v - speed * w / level.g; /* dz/dt of the bristles [m/s] */
    const double by_w = c.yield - c.damping * speed / level.g;
    const double by_g = c.damping * speed * w / (level.g * level.g);
    for (size_t d = 0; d < ways; d++) {
        double own = 0.0;
        switch (way[d]->coefficient) {
        case LG_YIELD: own = w; break;
        case LG_DAMPING: own = bend; break;
        case LG_EXCESS: own = by_g * level.by_excess; break;
        case LG_FADE: own = by_g * level.by_fade; break;
        default: break;
        }
        column[d][i] = own * seed_at(way[d], i) + by_w * by[d];
    }
    return c.yield * w + c.damping * bend;
}

/* Compute the force of the bristles along a record, and its derivatives along `ways` directions of the coefficients of
 * this law. */
static void lugre_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way, double *force,
                      double *const *column, mrd_state *state)
{
    const double h = r->step / (double)r->substeps;
    double w = state ? state->w : 0.0, by[MRD_DIRECTIONS] = {0.0}, seed[MRD_DIRECTIONS];
    bristles c = bristles_at(m, 0, r->n, 0);
    if (!r->behind) force[0] = bristles_force(m, r, 0, w, ways, way, by, column);
    for (size_t i = 1; i < r->n; i++) {
        const interval between = interval_before(r, i);
        if (m->stride) c = bristles_at(m, i, r->n, 1);
        for (size_t d = 0; d < ways; d++) seed[d] = seed_mean(way[d], i, r->n);
        double x = r->x[i - 1], v = r->v[i - 1];
        for (size_t j = 0; j < r->substeps; j++) {
            double to, fast;
            interval_at(&between, (double)(j + 1) / (double)r->substeps, &to, &fast);
            if (v * fast < 0.0) {
                const double turn = hermite_extremum(x, v, to, fast, h, fast < 0.0 ? 1.0 : -1.0);
                bristles_move(&c, turn - x, 0.5 * v, &w, ways, way, seed, by);
                bristles_move(&c, to - turn, 0.5 * fast, &w, ways, way, seed, by);
            } else {
                bristles_move(&c, to - x, 0.5 * (v + fast), &w, ways, way, seed, by);
            }
            x = to;
            v = fast;
        }
        force[i] = bristles_force(m, r, i, w, ways, way, by, column);
    }
    if (state) state->w = w;
}
