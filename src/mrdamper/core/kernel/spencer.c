/* Spencer's law: a dashpot in series with a Bouc-Wen element that has a dashpot and a spring in parallel.
 *
 *     F  = c1 y'                                     series dashpot over the travel y
 *        = Fy w + c0 (v - y') + k0 (x - y)           inner part over the travel e = x - y
 *
 * w follows the universal curve along e. The state is y and a position on the curve: e, its direction, and tau.
 * While e keeps its direction, tau increases by rho |de|. The curve is inverted only when e reverses. A step is
 * the two-stage, L-stable SDIRK method of order two. Each stage is one scalar equation R(q) = 0 for the velocity q
 * of the dashpot. R increases strictly because w rises with e, and e falls with q. The condition |w| <= 1 gives
 * bounds of q. Only the last sample interval is used, so that the results for a whole record and sample by sample
 * are equal.
 */

typedef struct {
    double yield, series, viscosity, stiffness, rho;
} spencer;

/* Return the coefficients at sample i, or their means over the sample interval that ends at sample i. */
static spencer spencer_at(const mrd_model *m, size_t i, size_t n, int mean)
{
#define AT(k) (mean ? coefficient_mean(m, k, i, n) : coefficient_at(m, k, i))
    const spencer out = {AT(SP_YIELD), AT(SP_SERIES), AT(SP_VISCOSITY), AT(SP_STIFFNESS), AT(SP_RHO)};
#undef AT
    return out;
}

/* A position on the curve: w = side Y(tau) at the inner travel e. */
typedef struct {
    double e, side, tau;
    double back; /* tau after a reversal at this position */
    int back_known;
} place;

/* Return the position on the curve after the inner travel has changed to e, with or without a reversal. */
static inline place place_moved(const curve *c, place *from, double rho, double e)
{
    place to = {e, from->side, from->tau, 0.0, 0};
    double ahead = from->side * (e - from->e);
    if (ahead < 0.0) {
        if (!from->back_known) {
            from->back = turned(c, from->tau);
            from->back_known = 1;
        }
        to.side = -from->side;
        to.tau = from->back;
        ahead = -ahead;
    }
    to.tau += rho * ahead;
    return to;
}

/* Return w at a position on the curve. *slope receives dw/dtau. */
static inline double place_value(const curve *c, const place *p, double *slope)
{
    const branch *b = p->tau >= 0.0 ? &c->rise : &c->fall;
    const double t = fabs(p->tau) + b->offset, at = t < b->top ? t : b->top;
    const double u = cubic_at(b->cell, b->base, b->shift, at);
    *slope = t < b->top ? slope_at(b->cell, b->base, b->shift, at) : 0.0;
    return p->tau >= 0.0 ? p->side * u : -p->side * u;
}

typedef struct {
    double q;     /* velocity of the series dashpot [m/s] */
    double slope; /* dR/dq [N s/m] */
    double w, rise; /* hysteresis variable, dw/dtau */
    place at;
} spencer_stage;

/* Solve one stage: R(q) = (c0 + c1) q - c0 v - k0 e - Fy w(e) = 0 with e = x - base - h q. `guess` is the start
 * value. */
static void spencer_solve(const curve *table, const spencer *c, double x, double v, double base, double h, double guess,
                          place *from, spencer_stage *s)
{
    const double rigid = c->series + c->viscosity, least = rigid + h * c->stiffness;
    const double middle = (c->viscosity * v + c->stiffness * (x - base)) / least, half = c->yield / least;
    double low = middle - half, high = middle + half, q = guess;
    /* Velocity at which e returns to its last value. R has its only kink there, and Newton's method restarts. */
    const double kink = (x - base - from->e) / h;
    int kink_tried = 0;
    /* `unit` is the change of q that changes tau by one. `unknown` is the rounding error of R from the travel. */
    const double unit = 1.0 / (c->rho * h), unknown = 2e-16 * c->yield * c->rho * (fabs(x) + fabs(base));
    if (!(q >= low && q <= high)) q = q < low ? low : high;
    for (int i = 0; i < 200; i++) {
        const double e = x - (base + h * q);
        s->at = place_moved(table, from, c->rho, e);
        s->w = place_value(table, &s->at, &s->rise);
        s->slope = least + h * c->yield * c->rho * s->rise;
        const double residual = rigid * q - c->viscosity * v - c->stiffness * e - c->yield * s->w;
        const double size = fabs(rigid * q) + fabs(c->viscosity * v) + c->yield;
        const double next = q - residual / s->slope, ahead = next - q;
        if (fabs(residual) <= 1e-14 * size + unknown || ahead == 0.0) break;
        if (fabs(residual) <= 1e-8 * size && fabs(ahead) <= 1e-7 * unit && next > low && next < high) {
            /* Take one more Newton step without a new evaluation. The remaining error is the square of this step. */
            const place moved = place_moved(table, from, c->rho, x - (base + h * next));
            if (moved.side == s->at.side) {
                s->w -= s->rise * c->rho * h * ahead;
                s->at = moved;
                q = next;
                break;
            }
        }
        if (residual > 0.0) high = q;
        else low = q;
        double moved = next;
        if (!(next > low && next < high)) {
            if (!kink_tried && kink > low && kink < high) {
                kink_tried = 1;
                moved = kink;
            } else {
                moved = 0.5 * (low + high);
            }
            if (!(moved > low && moved < high)) break;
        }
        q = moved;
    }
    s->q = q;
}

/* Derivatives of the state along one direction. */
typedef struct {
    double y, tau; /* travel of the dashpot (the derivative of the inner travel is -y), position on the curve */
} spencer_tangent;

/* Return the derivative of tau after a reversal from the derivative of tau before it. */
static inline double turned_tangent(const curve_point *end, const curve_point *begin, double tau_by, double n_by,
                                    double kappa_by)
{
    if (!(begin->slope > 1e-9)) return 0.0;
    const double w_by = end->slope * tau_by + end->by_n * n_by + end->by_kappa * kappa_by;
    return (-w_by - begin->by_n * n_by - begin->by_kappa * kappa_by) / begin->slope;
}

/* Return the force of the law F = c1 (v - e') at sample i with the coefficients of this sample, and compute its
 * derivatives. */
static inline double spencer_force(const mrd_model *m, const mrd_record *r, size_t i, double y, const curve *table,
                                   const place *at, size_t ways, const mrd_direction *const *way,
                                   const spencer_tangent *by, double *const *column)
{
    const spencer c = spencer_at(m, i, r->n, 0);
    const double v = r->v[i], e = r->x[i] - y, rigid = c.series + c.viscosity;
    double rise;
    const double w = place_value(table, at, &rise);
    const double inner = c.viscosity * v + c.stiffness * e + c.yield * w, share = c.series / rigid;
    curve_point p = {0.0, 0.0, 0.0, 0.0};
    if (ways) p = curve_at(table, at->tau);
    for (size_t d = 0; d < ways; d++) {
        const double s = seed_at(way[d], i);
        double inner_by = -c.stiffness * by[d].y + c.yield * at->side * rise * by[d].tau, share_by = 0.0;
        switch (way[d]->coefficient) {
        case SP_YIELD: inner_by += w * s; break;
        case SP_SERIES: share_by = c.viscosity / (rigid * rigid) * s; break;
        case SP_VISCOSITY:
            inner_by += v * s;
            share_by = -c.series / (rigid * rigid) * s;
            break;
        case SP_STIFFNESS: inner_by += e * s; break;
        case SP_KAPPA: inner_by += c.yield * at->side * p.by_kappa * s; break;
        case SP_N: inner_by += c.yield * at->side * p.by_n * s; break;
        default: break;
        }
        column[d][i] = share * inner_by + share_by * inner;
    }
    return share * inner;
}

/* Compute the derivatives of the position on the curve, the dashpot travel and q after a stage. `from` is the position
 * before the stage. */
static inline void spencer_tangents(const curve *table, const spencer *c, double v, double h, const place *from,
                                    const spencer_stage *s, size_t ways, const mrd_direction *const *way,
                                    const double *seed, const double *base_by, spencer_tangent *by, double *q_by)
{
    const int back = s->at.side != from->side;
    const double side = s->at.side, ahead = side * (s->at.e - from->e);
    const curve_point here = curve_at(table, s->at.tau);
    curve_point end = here, begin = here;
    if (back) {
        end = curve_at(table, from->tau);
        begin = curve_at(table, from->back);
    }
    for (size_t d = 0; d < ways; d++) {
        const int k = way[d]->coefficient;
        const double n_by = k == SP_N ? seed[d] : 0.0, kappa_by = k == SP_KAPPA ? seed[d] : 0.0;
        double tau_by = back ? turned_tangent(&end, &begin, by[d].tau, n_by, kappa_by) : by[d].tau;
        if (k == SP_RHO) tau_by += ahead * seed[d];
        /* At fixed q, the derivative of e is -base_by. */
        tau_by += c->rho * side * (by[d].y - base_by[d]);
        const double w_by = side * (s->rise * tau_by + here.by_n * n_by + here.by_kappa * kappa_by);
        double residual_by = c->stiffness * base_by[d] - c->yield * w_by;
        switch (k) {
        case SP_YIELD: residual_by -= s->w * seed[d]; break;
        case SP_SERIES: residual_by += s->q * seed[d]; break;
        case SP_VISCOSITY: residual_by += (s->q - v) * seed[d]; break;
        case SP_STIFFNESS: residual_by -= s->at.e * seed[d]; break;
        default: break;
        }
        q_by[d] = -residual_by / s->slope;
        by[d].y = base_by[d] + h * q_by[d];
        by[d].tau = tau_by - c->rho * side * h * q_by[d];
    }
}

/* Compute the force of the law along a record, and its derivatives along `ways` directions of the coefficients of this
 * law. */
static void spencer_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way,
                              double *force, double *const *column, const curve *table, mrd_state *state)
{

    const double gamma = 1.0 - sqrt(0.5), h = r->step / (double)r->substeps;
    spencer c = spencer_at(m, 0, r->n, 0);
    spencer_tangent by[MRD_DIRECTIONS];
    double seed[MRD_DIRECTIONS], base_by[MRD_DIRECTIONS], q_by[MRD_DIRECTIONS];
    for (size_t d = 0; d < ways; d++) by[d].y = by[d].tau = 0.0;
    place at = {0.0, 1.0, 0.0, 0.0, 0};
    double y = r->x[0], q_last = c.viscosity * r->v[0] / (c.series + c.viscosity), q_rate = 0.0;
    if (r->behind) {
        at = (place){state->e, state->side, state->place, 0.0, 0};
        y = state->y;
        q_last = state->q;
        q_rate = state->q_rate;
    }
    spencer_stage s;
    if (!r->behind) force[0] = spencer_force(m, r, 0, y, table, &at, ways, way, by, column);
    for (size_t i = 1; i < r->n; i++) {
        const interval between = interval_before(r, i);
        if (m->stride) c = spencer_at(m, i, r->n, 1);
        for (size_t d = 0; d < ways; d++) seed[d] = seed_mean(way[d], i, r->n);
        for (size_t j = 0; j < r->substeps; j++) {
            double base = y;
            for (size_t d = 0; d < ways; d++) base_by[d] = by[d].y;
            for (size_t stage = 0; stage < 2; stage++) {
                double x, v;
                interval_at(&between, ((double)j + (stage ? 1.0 : gamma)) / (double)r->substeps, &x, &v);
                const double ahead = (stage ? 1.0 - gamma : gamma) * h;
                spencer_solve(table, &c, x, v, base, gamma * h, q_last + ahead * q_rate, &at, &s);
                if (ways) {
                    spencer_tangents(table, &c, v, gamma * h, &at, &s, ways, way, seed, base_by, by, q_by);
                    for (size_t d = 0; d < ways && !stage; d++) base_by[d] += (1.0 - gamma) * h * q_by[d];
                }
                q_rate = (s.q - q_last) / ahead;
                q_last = s.q;
                at = s.at;
                if (stage) y = base + gamma * h * s.q;
                else base = y + (1.0 - gamma) * h * s.q;
            }
        }
        force[i] = spencer_force(m, r, i, y, table, &at, ways, way, by, column);
    }
    if (!state) return;
    state->e = at.e;
    state->side = at.side;
    state->place = at.tau;
    state->y = y;
    state->q = q_last;
    state->q_rate = q_rate;
}
