/* Compute force and tangent columns of any law along a record, and squared errors of many candidates. */

static int coefficient_count(int law)
{
    switch (law) {
    case MRD_BOUC_WEN: return BW_N + 1;
    case MRD_DAHL: return BW_RHO + 1;
    case MRD_SATURATING: return SAT_N + 1;
    case MRD_BINGHAM: return BH_VELOCITY + 1;
    case MRD_TANH: return TH_SHIFT + 1;
    case MRD_LUGRE: return LG_DAMPING + 1;
    case MRD_SPENCER: return SP_N + 1;
    case MRD_SERIES_VALVE: return SV_COUNT;
    case MRD_DOUBLE: return DB_N + 1;
    case MRD_CHAIN_LAW: return CH_COUNT;
    default: return 0;
    }
}

/* Indices of the coefficients in the laws of the Bouc-Wen family; -1 if a law has no such coefficient. */
typedef struct {
    int elements;      /* number of hysteretic elements in parallel, with the same curve */
    int yield[2], rho[2];
    int kappa, n;
    double kappa_value, n_value;
} shape_of_law;

static int has_state_w(mrd_law law)
{
    return law == MRD_BOUC_WEN || law == MRD_DAHL || law == MRD_SATURATING || law == MRD_DOUBLE;
}

static shape_of_law shape_at(const mrd_model *m)
{
    shape_of_law s = {1, {BW_YIELD, -1}, {BW_RHO, -1}, -1, -1, -1.0, 1.0};
    if (m->law == MRD_BOUC_WEN) {
        s.kappa = BW_KAPPA;
        s.n = BW_N;
    } else if (m->law == MRD_SATURATING) {
        s.rho[0] = SAT_RHO;
        s.kappa = SAT_KAPPA;
        s.n = SAT_N;
    } else if (m->law == MRD_DOUBLE) {
        s.elements = 2;
        s.yield[1] = DB_SECOND;
        s.rho[0] = DB_RHO;
        s.rho[1] = DB_SECOND_RHO;
        s.kappa = DB_KAPPA;
        s.n = DB_N;
    }
    if (m->law == MRD_SPENCER) {
        s.kappa = SP_KAPPA;
        s.n = SP_N;
    }
    if (s.kappa >= 0) {
        s.kappa_value = coefficient_at(m, s.kappa, 0);
        s.n_value = coefficient_at(m, s.n, 0);
    }
    return s;
}

/* Return the fraction of the rate force that the saturating law has at a speed. */
static inline double speed_share(const mrd_model *m, double v, size_t i)
{
    const double speed = fabs(v);
    return speed / (speed + coefficient_at(m, SAT_VELOCITY, i));
}

/* Return the force of a hysteretic element at w = 1. */
static inline double amplitude_at(const mrd_model *m, const shape_of_law *s, int element, double v, size_t i)
{
    const double yield = coefficient_at(m, s->yield[element], i);
    return m->law == MRD_SATURATING ? yield + coefficient_at(m, SAT_RATE, i) * speed_share(m, v, i) : yield;
}

static inline double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

/* Replace a row by its tanh = -m / (2 + m), with m = exp(-2 |u|) - 1 = 2^k (exp(s) - 1) + 2^k - 1 and |s| <= ln 2 / 2.
 * exp is its series up to s^13. The error is below 4e-16. There is no conditional jump, so that the compiler can
 * vectorise the loop with bitwise equal results. */
static void tanh_row(double *u, size_t n)
{
    static const double whole = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer, kept in the low bits */
    static const double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;
    for (size_t i = 0; i < n; i++) {
        const double size = fabs(u[i]), x = size >= 20.0 ? -40.0 : -2.0 * size;
        const double shifted = x * 1.44269504088896340736 + whole, k = shifted - whole;
        const double s = x - k * ln2_high - k * ln2_low;
        double p = 1.0 / 6227020800.0, power;
        p = p * s + 1.0 / 479001600.0;
        p = p * s + 1.0 / 39916800.0;
        p = p * s + 1.0 / 3628800.0;
        p = p * s + 1.0 / 362880.0;
        p = p * s + 1.0 / 40320.0;
        p = p * s + 1.0 / 5040.0;
        p = p * s + 1.0 / 720.0;
        p = p * s + 1.0 / 120.0;
        p = p * s + 1.0 / 24.0;
        p = p * s + 1.0 / 6.0;
        p = p * s + 0.5;
        p = (p * s) * s + s;
        uint64_t bits;
        memcpy(&bits, &shifted, sizeof bits);
        bits = (bits + 1023u) << 52; /* 2^k */
        memcpy(&power, &bits, sizeof power);
        const double m = power * p + (power - 1.0);
        u[i] = copysign(m / (2.0 + m), u[i]);
    }
}

/* Compute the yield force divided by its maximum at every sample, for laws without memory. Force and partial
 * derivatives are computed from this ratio. */
static void algebraic_rise(const mrd_model *m, const mrd_record *r, double *rise)
{
    for (size_t i = 0; i < r->n; i++)
        rise[i] = m->law == MRD_BINGHAM ? r->v[i] / coefficient_at(m, BH_VELOCITY, i)
                                        : coefficient_at(m, TH_SLOPE, i) * r->v[i] + coefficient_at(m, TH_SHIFT, i) * sign_of(r->x[i]);
    tanh_row(rise, r->n);
}

static inline double algebraic_partial(const mrd_model *m, const mrd_record *r, int k, size_t i, double rise)
{
    const double v = r->v[i], yield = coefficient_at(m, BH_YIELD, i);
    if (m->law == MRD_BINGHAM) {
        const double vr = coefficient_at(m, BH_VELOCITY, i);
        return k == BH_YIELD ? rise : -yield * (1.0 - rise * rise) * v / (vr * vr);
    }
    if (k == TH_YIELD) return rise;
    return yield * (1.0 - rise * rise) * (k == TH_SLOPE ? v : sign_of(r->x[i]));
}

struct mrd_workspace {
    int built;
    curve last;
};

static mrd_workspace *workspace_open(void)
{
    mrd_workspace *workspace = malloc(sizeof *workspace);
    if (workspace) workspace->built = 0;
    return workspace;
}

static void workspace_close(mrd_workspace *workspace) { free(workspace); }

/* Return the curve of a shape; it is tabulated only if the shape has changed. */
static const curve *curve_in(mrd_workspace *workspace, double kappa, double n, int tangents)
{
    curve *c = &workspace->last;
    if (!workspace->built || c->kappa != kappa || c->n != n || (tangents && !c->tangents)) {
        curve_build(c, kappa, n, tangents);
        workspace->built = 1;
    }
    return c;
}

/* Return true if kappa and n are constant in a record and equal to kappa and n of earlier batches. */
static int one_shape(const mrd_model *m, const mrd_record *r, const shape_of_law *shape, const mrd_state *state)
{
    if (shape->kappa < 0) return 1;
    if (varies(m, shape->kappa, r->n) || varies(m, shape->n, r->n)) return 0;
    return !r->behind || !state || (state->kappa == shape->kappa_value && state->n == shape->n_value);
}

/* Return true if kappa and n are in the tabulated range and rho is not negative. A negative rho would cause a negative
 * travel, which the table does not have. */
static int has_curve(const mrd_model *m, const shape_of_law *s, size_t samples)
{
    for (size_t i = 0; i < (m->stride ? samples : 1); i++) {
        for (int e = 0; e < s->elements; e++)
            if (coefficient_at(m, s->rho[e], i) < 0.0) return 0;
        if (s->n >= 0 && !is_tabulated(coefficient_at(m, s->kappa, i), coefficient_at(m, s->n, i))) return 0;
    }
    return 1;
}

#include "steady.c"

static mrd_status run_bouc_wen(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                               double *force, double *columns, mrd_workspace *workspace, mrd_state *state)
{
    const shape_of_law shape = shape_at(m);
    if (!one_shape(m, r, &shape, state)) return MRD_SHAPE_VARIES;
    if (!has_curve(m, &shape, r->n)) return MRD_NOT_TABULATED;
    const size_t n = r->n;
    int by_shape = 0, by_travel = 0;
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        by_shape |= k >= MRD_COMMON && (k == shape.kappa || k == shape.n);
        by_travel |= k >= MRD_COMMON && (k == shape.rho[0] || k == shape.rho[1]);
    }
    if ((by_shape || by_travel) && force && is_steady(m, r, directions, direction))
        return run_steady_bouc_wen(m, r, &shape, directions, direction, force, columns,
                                   curve_in(workspace, shape.kappa_value, shape.n_value, 1));
    double *store = malloc((by_shape ? 3 : 1) * (n + 1) * sizeof *store);
    common_rows rows;
    const mrd_status opened = common_open(m, r, directions, direction, &rows);
    if (!store || opened != MRD_OK) {
        free(store);
        if (opened == MRD_OK) common_close(&rows);
        return MRD_NO_MEMORY;
    }
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        double *column = columns + d * n;
        if (k < MRD_COMMON) common_column(m, r, &rows, direction + d, column);
        else for (size_t i = 0; i < n; i++) column[i] = 0.0;
    }
    if (force)
        for (size_t i = 0; i < n; i++) force[i] = 0.0;
    const curve *c = curve_in(workspace, shape.kappa_value, shape.n_value, by_shape || by_travel);

    double *w = store, *by_n = by_shape ? store + n : NULL, *by_kappa = by_shape ? store + 2 * n : NULL;
    if (r->behind) w[0] = 0.0;
    for (int e = 0; e < shape.elements; e++) {
        double *by_rho[MRD_DIRECTIONS] = {NULL};
        const mrd_direction *way[MRD_DIRECTIONS] = {NULL};
        size_t ways = 0;
        for (size_t d = 0; d < directions; d++) {
            if (direction[d].coefficient == shape.rho[e]) {
                way[ways] = direction + d;
                by_rho[ways++] = columns + d * n;
            }
        }
        const double *rho = m->coefficient + (m->stride ? (size_t)shape.rho[e] * m->stride : (size_t)shape.rho[e]);
        double start = r->behind ? state->tau[e] : 0.0;
        weighted_travel gone = {0.0, 0.0, *rho};
        if (r->behind) gone = (weighted_travel){state->base[e], state->from[e], state->rho[e]};
        if (ways || by_shape || varies(m, shape.rho[e], r->known) || gone.rho != *rho || gone.from != 0.0)
            bouc_wen_tangents(c, r, rho, m->stride ? 1 : 0, ways, way, w, by_rho, by_n, by_kappa, &start, &gone);
        else
            start = bouc_wen_state(c, r, *rho, start, w);
        if (state) {
            state->tau[e] = start;
            state->base[e] = gone.base;
            state->from[e] = gone.from;
            state->rho[e] = gone.rho;
        }

        for (size_t i = 0; force && i < n; i++) force[i] += amplitude_at(m, &shape, e, r->v[i], i) * w[i];
        for (size_t d = 0; d < directions; d++) {
            const int k = direction[d].coefficient;
            double *column = columns + d * n;
            if (k < MRD_COMMON) continue;
            if (k == shape.yield[e]) {
                for (size_t i = 0; i < n; i++) column[i] = w[i] * seed_at(direction + d, i);
            } else if (k == shape.rho[e]) {
                for (size_t i = 0; i < n; i++) column[i] *= amplitude_at(m, &shape, e, r->v[i], i);
            } else if (k == shape.n || k == shape.kappa) {
                const double *by = k == shape.n ? by_n : by_kappa;
                for (size_t i = 0; i < n; i++)
                    column[i] += amplitude_at(m, &shape, e, r->v[i], i) * by[i] * seed_at(direction + d, i);
            } else if (m->law == MRD_SATURATING && k == SAT_RATE) {
                for (size_t i = 0; i < n; i++) column[i] = speed_share(m, r->v[i], i) * w[i] * seed_at(direction + d, i);
            } else if (m->law == MRD_SATURATING && k == SAT_VELOCITY) {
                for (size_t i = 0; i < n; i++) {
                    const double share = speed_share(m, r->v[i], i), sum = fabs(r->v[i]) + coefficient_at(m, SAT_VELOCITY, i);
                    column[i] = -coefficient_at(m, SAT_RATE, i) * share / sum * w[i] * seed_at(direction + d, i);
                }
            }
        }
    }
    if (force) common_add(m, r, &rows, force);
    common_close(&rows);
    free(store);
    return MRD_OK;
}

/* Return true for laws that are integrated in steps along the record. */
static int is_stepped(mrd_law law)
{
    return law == MRD_LUGRE || law == MRD_SPENCER || law == MRD_SERIES_VALVE || law == MRD_CHAIN_LAW;
}

static int is_inside(mrd_law law, int k)
{
    return k >= MRD_COMMON || (has_own_spring(law) && (k == C_STIFFNESS || k == C_OFFSET));
}

/* Defined in implicit_run.c. */
void mrd_implicit_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way, double *force,
                      double *const *column, mrd_state *state);

/* Compute the force of a stepped law along a record without the common terms, and its derivatives. */
static mrd_status run_stepped(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way,
                              double *force, double *const *column, mrd_workspace *workspace, mrd_state *state)
{
    if (m->law == MRD_LUGRE) {
        lugre_run(m, r, ways, way, force, column, state);
    } else if (m->law == MRD_SPENCER) {
        const shape_of_law shape = shape_at(m);
        if (!one_shape(m, r, &shape, state)) return MRD_SHAPE_VARIES;
        if (!is_tabulated(shape.kappa_value, shape.n_value)) return MRD_NOT_TABULATED;
        mrd_workspace *own = workspace ? workspace : workspace_open();
        if (!own) return MRD_NO_MEMORY;
        spencer_run(m, r, ways, way, force, column, curve_in(own, shape.kappa_value, shape.n_value, ways > 0), state);
        if (!workspace) workspace_close(own);
    } else {
        mrd_implicit_run(m, r, ways, way, force, column, state);
    }
    return MRD_OK;
}

/* Compute force and tangent columns. `state` is the state before the batch and is updated; NULL: a whole run. */
static mrd_status run_on(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                         double *force, double *columns, mrd_workspace *workspace, mrd_state *state)
{
    if (!coefficient_count((int)m->law)) return MRD_NOT_A_LAW;
    if (has_state_w(m->law)) {
        mrd_workspace *own = workspace ? workspace : workspace_open();
        if (!own) return MRD_NO_MEMORY;
        const mrd_status done = run_bouc_wen(m, r, directions, direction, force, columns, own, state);
        if (!workspace) workspace_close(own);
        return done;
    }

    common_rows rows;
    mrd_status status = common_open(m, r, directions, direction, &rows);
    if (status != MRD_OK) return status;
    double *rise = NULL;
    if (is_stepped(m->law)) {
        const mrd_direction *way[MRD_DIRECTIONS] = {NULL};
        double *column[MRD_DIRECTIONS] = {NULL};
        size_t ways = 0;
        for (size_t d = 0; d < directions; d++) {
            if (is_inside(m->law, direction[d].coefficient)) {
                way[ways] = direction + d;
                column[ways++] = columns + d * r->n;
            }
        }
        double *own = calloc(r->n + 1, sizeof *own);
        if (!own) status = MRD_NO_MEMORY;
        else status = run_stepped(m, r, ways, way, own, column, workspace, state);
        if (force && status == MRD_OK) memcpy(force, own, r->n * sizeof *own);
        free(own);
        if (status != MRD_OK) {
            common_close(&rows);
            return status;
        }
    } else {
        rise = malloc((r->n + 1) * sizeof *rise);
        if (!rise) {
            common_close(&rows);
            return MRD_NO_MEMORY;
        }
        algebraic_rise(m, r, rise);
        for (size_t i = 0; force && i < r->n; i++) force[i] = coefficient_at(m, BH_YIELD, i) * rise[i];
    }
    if (force) common_add(m, r, &rows, force);
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        double *column = columns + d * r->n;
        if (is_stepped(m->law) && is_inside(m->law, k)) continue;
        if (k < MRD_COMMON) {
            common_column(m, r, &rows, direction + d, column);
            continue;
        }
        for (size_t i = 0; i < r->n; i++) column[i] = algebraic_partial(m, r, k, i, rise[i]) * seed_at(direction + d, i);
    }
    free(rise);
    common_close(&rows);
    return MRD_OK;
}

static mrd_status run(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                      double *force, double *columns, mrd_workspace *workspace)
{
    return run_on(m, r, directions, direction, force, columns, workspace, NULL);
}

/* Compute the force of a batch and update the state. The force of the sample before the batch is undefined. */
static mrd_status carry(const mrd_model *m, const mrd_record *r, mrd_state *state, double *force, mrd_workspace *workspace)
{
    if (r->n <= r->behind) return MRD_OK;
    const mrd_status status = run_on(m, r, 0, NULL, force, NULL, workspace, state);
    if (status != MRD_OK) return status;
    const shape_of_law shape = shape_at(m);
    state->begun = 1.0;
    state->kappa = shape.kappa_value;
    state->n = shape.n_value;
    return MRD_OK;
}

/* Return w after a signed scaled travel rho dx. The curve limits w for any travel. */
static double moved_state(const curve *c, double w, double travel)
{
    if (travel == 0.0) return w;
    const double side = travel > 0.0 ? 1.0 : -1.0;
    return side * curve_at(c, curve_inverse(c, side * w) + fabs(travel)).w;
}

/* Compute the force sample by sample like a controller on a target, without using later samples. */
static mrd_status causal(const mrd_model *m, const mrd_record *r, double *force)
{
    if (!coefficient_count((int)m->law)) return MRD_NOT_A_LAW;
    if (!has_state_w(m->law)) return run(m, r, 0, NULL, force, NULL, NULL);
    const shape_of_law shape = shape_at(m);
    if (!has_curve(m, &shape, r->n)) return MRD_NOT_TABULATED;
    curve *c = malloc(sizeof *c);
    if (!c) return MRD_NO_MEMORY;
    curve_build(c, shape.kappa_value, shape.n_value, 0);
    double w[2] = {0.0, 0.0};
    for (size_t i = 0; i < r->n; i++) {
        if (i > 0 && shape.n >= 0) {
            const double kappa = coefficient_at(m, shape.kappa, i), n = coefficient_at(m, shape.n, i);
            if (kappa != c->kappa || n != c->n) curve_build(c, kappa, n, 0);
        }
        force[i] = common_force(m, r, i);
        for (int e = 0; e < shape.elements; e++) {
            if (i > 0) {
                const double rho = coefficient_mean(m, shape.rho[e], i, r->n);
                double here = r->x[i - 1];
                /* There is a reversal inside the last interval: move to the turning point, then back. */
                if (r->v[i - 1] * r->v[i] < 0.0) {
                    const double side = r->v[i] < 0.0 ? 1.0 : -1.0;
                    const double turn = hermite_extremum(here, r->v[i - 1], r->x[i], r->v[i], r->step, side);
                    w[e] = moved_state(c, w[e], rho * (turn - here));
                    here = turn;
                }
                w[e] = moved_state(c, w[e], rho * (r->x[i] - here));
            }
            force[i] += amplitude_at(m, &shape, e, r->v[i], i) * w[e];
        }
    }
    free(c);
    return MRD_OK;
}

/* Return the sum of products in eight lanes, with the same order of additions for every vector width. */
static inline double sum_of_products(const double *restrict a, const double *restrict b, size_t n)
{
    double lane[8] = {0.0};
    size_t i = 0;
    for (; i + 8 <= n; i += 8)
        for (size_t j = 0; j < 8; j++) lane[j] += a[i + j] * b[i + j];
    for (; i < n; i++) lane[i & 7] += a[i] * b[i];
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* Return the squared error of a Bouc-Wen law at constant current, computed in blocks that fit in the first-level
 * cache. */
static double squared_error_bouc_wen(const curve *c, const mrd_model *m, const mrd_record *r, const double *measured,
                                     size_t from, double rho)
{
    const double c0 = m->coefficient[C_VISCOSITY], k0 = m->coefficient[C_STIFFNESS], f0 = m->coefficient[C_OFFSET];
    const double mass = m->coefficient[C_MASS], yield = m->coefficient[BW_YIELD];
    double start = 0.0, lane[8] = {0.0};
    for (size_t p = 0; p < r->pieces; p++) {
        const size_t end = r->first[p + 1], begin = r->first[p] > from ? r->first[p] : from;
        if (begin < end) {
            const spans at = spans_of(c, r, p, begin, end, start, rho);
            const double full = f0 + yield * r->side[p] * c->rise.last;
            for (size_t i = begin; i < end;) {
                const size_t limit = i < at.fall ? at.fall : i < at.rise ? at.rise : end;
                const size_t n = limit - i < BLOCK ? limit - i : BLOCK;
                const double *restrict x = r->x + i, *restrict v = r->v + i, *restrict y = measured + i;
                double e[BLOCK];
                if (r->path || i >= at.rise) FETCH_AHEAD(r->x, i, n, r->n); /* otherwise places_of() computes it */
                if (r->path && i >= at.rise) FETCH_AHEAD(r->path, i, n, r->n);
                FETCH_AHEAD(r->v, i, n, r->n);
                FETCH_AHEAD(measured, i, n, r->n);
                if (mass != 0.0) FETCH_AHEAD(r->a, i, n, r->n);
                if (i < at.rise) {
                    const int rising = i >= at.fall;
                    const double scale = rising ? yield * r->side[p] : -yield * r->side[p];
                    double u[BLOCK];
                    block_of(c, r, p, i, n, start, rho, rising, u);
                    for (size_t k = 0; k < n; k++) e[k] = y[k] - (c0 * v[k] + k0 * x[k] + f0 + scale * u[k]);
                } else {
                    for (size_t k = 0; k < n; k++) e[k] = y[k] - (c0 * v[k] + k0 * x[k] + full);
                }
                if (mass != 0.0)
                    for (size_t k = 0; k < n; k++) e[k] -= mass * r->a[i + k];
                size_t k = 0;
                for (; k + 8 <= n; k += 8)
                    for (size_t j = 0; j < 8; j++) lane[j] += e[k + j] * e[k + j];
                for (; k < n; k++) lane[k & 7] += e[k] * e[k];
                i += n;
            }
        }
        if (p + 1 < r->pieces) start = turned(c, start + rho * piece_length(r, p));
    }
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* Compute errors[candidate][run]. The coefficients [candidate][run][coefficient] are constant during each run. */
static mrd_status squared_errors(mrd_law law, size_t runs, const mrd_record *const *records, const double *const *measured,
                                 const size_t *from, size_t candidates, const double *coefficients, double *errors)
{
    const size_t count = (size_t)coefficient_count((int)law);
    if (!count) return MRD_NOT_A_LAW;
    size_t longest = 1;
    for (size_t k = 0; k < runs; k++) longest = records[k]->n > longest ? records[k]->n : longest;
    double *force = malloc(longest * sizeof *force);
    mrd_workspace *workspace = workspace_open();
    mrd_status status = force && workspace ? MRD_OK : MRD_NO_MEMORY;
    for (size_t j = 0; j < candidates && status == MRD_OK; j++) {
        for (size_t k = 0; k < runs && status == MRD_OK; k++) {
            const mrd_model m = {law, coefficients + (j * runs + k) * count, 0};
            const mrd_record *r = records[k];
            const int plain = m.coefficient[C_COULOMB] == 0.0 && m.coefficient[C_BREAKAWAY] == 0.0
                           && m.coefficient[C_VISCOUS_EXPONENT] == 1.0;
            if ((law == MRD_BOUC_WEN || law == MRD_DAHL) && plain) {
                const shape_of_law shape = shape_at(&m);
                if (!has_curve(&m, &shape, 1)) {
                    status = MRD_NOT_TABULATED;
                    break;
                }
                const curve *c = curve_in(workspace, shape.kappa_value, shape.n_value, 0);
                errors[j * runs + k] = squared_error_bouc_wen(c, &m, r, measured[k], from[k], m.coefficient[BW_RHO]);
                continue;
            }
            status = run(&m, r, 0, NULL, force, NULL, workspace);
            if (status != MRD_OK) break;
            for (size_t i = 0; i < r->n; i++) force[i] -= measured[k][i];
            errors[j * runs + k] = from[k] < r->n ? sum_of_products(force + from[k], force + from[k], r->n - from[k]) : 0.0;
        }
    }
    free(force);
    workspace_close(workspace);
    return status;
}

static void curve_values(double kappa, double n, size_t count, const double *tau, double *w, double *slope,
                         double *by_kappa, double *by_n)
{
    curve *c = malloc(sizeof *c);
    if (!c) return;
    curve_build(c, kappa, n, 1);
    for (size_t i = 0; i < count; i++) {
        const curve_point at = curve_at(c, tau[i]);
        w[i] = at.w;
        slope[i] = at.slope;
        by_kappa[i] = at.by_kappa;
        by_n[i] = at.by_n;
    }
    free(c);
}
