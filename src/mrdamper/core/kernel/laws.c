/* The laws put together: force and tangent columns of a model along a record, Gram sums, ensembles. */

static int coefficient_count(int law)
{
    switch (law) {
    case MRD_BOUC_WEN: return BW_N + 1;
    case MRD_DAHL: return BW_RHO + 1;
    case MRD_SATURATING: return SAT_N + 1;
    case MRD_BINGHAM: return BH_VELOCITY + 1;
    case MRD_TANH: return TH_SHIFT + 1;
    case MRD_SERIES_VALVE: return SV_LEAK_EXPONENT + 1;
    default: return 0;
    }
}

/* How the Bouc-Wen family's three laws read their coefficients. */
typedef struct {
    int rho, kappa, n;
    double kappa_value, n_value;
} shape_of_law;

static int has_state_w(mrd_law law) { return law == MRD_BOUC_WEN || law == MRD_DAHL || law == MRD_SATURATING; }

static double coefficient_at(const mrd_model *m, int k, size_t i)
{
    return m->stride ? m->coefficient[(size_t)k * m->stride + i] : m->coefficient[k];
}

static int varies(const mrd_model *m, int k, size_t n)
{
    if (!m->stride) return 0;
    const double *row = m->coefficient + (size_t)k * m->stride;
    for (size_t i = 1; i < n; i++)
        if (row[i] != row[0]) return 1;
    return 0;
}

static shape_of_law shape_at(const mrd_model *m)
{
    shape_of_law s = {BW_RHO, -1, -1, -1.0, 1.0};
    if (m->law == MRD_BOUC_WEN) {
        s.kappa = BW_KAPPA;
        s.n = BW_N;
    } else if (m->law == MRD_SATURATING) {
        s.rho = SAT_RHO;
        s.kappa = SAT_KAPPA;
        s.n = SAT_N;
    }
    if (s.kappa >= 0) {
        s.kappa_value = coefficient_at(m, s.kappa, 0);
        s.n_value = coefficient_at(m, s.n, 0);
    }
    return s;
}

/* Terms common to all laws at one sample: viscous, spring, offset, inertia, Stribeck friction. */
static inline double common_force(const mrd_model *m, const mrd_record *r, size_t i)
{
    const int chain = m->law == MRD_SERIES_VALVE;
    const double v = r->v[i];
    double f = coefficient_at(m, C_VISCOSITY, i) * v + coefficient_at(m, C_MASS, i) * r->a[i];
    if (!chain) f += coefficient_at(m, C_STIFFNESS, i) * r->x[i] + coefficient_at(m, C_OFFSET, i);
    const double coulomb = coefficient_at(m, C_COULOMB, i), breakaway = coefficient_at(m, C_BREAKAWAY, i);
    if (coulomb != 0.0 || breakaway != 0.0) {
        const double ratio = v / coefficient_at(m, C_STRIBECK, i);
        f += (coulomb + breakaway * exp(-ratio * ratio)) * tanh(v / coefficient_at(m, C_TRANSITION, i));
    }
    return f;
}

static inline double common_partial(const mrd_model *m, const mrd_record *r, int k, size_t i)
{
    const double v = r->v[i];
    if (k == C_VISCOSITY) return v;
    if (k == C_MASS) return r->a[i];
    if (k == C_STIFFNESS) return r->x[i];
    if (k == C_OFFSET) return 1.0;
    const double vs = coefficient_at(m, C_STRIBECK, i), vt = coefficient_at(m, C_TRANSITION, i);
    const double th = tanh(v / vt), fade = exp(-(v / vs) * (v / vs));
    if (k == C_COULOMB) return th;
    if (k == C_BREAKAWAY) return fade * th;
    const double breakaway = coefficient_at(m, C_BREAKAWAY, i);
    if (k == C_STRIBECK) return breakaway * fade * th * 2.0 * v * v / (vs * vs * vs);
    return -(coefficient_at(m, C_COULOMB, i) + breakaway * fade) * (1.0 - th * th) * v / (vt * vt);
}

static inline double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

/* Laws without memory: their own force and its partial derivatives. */
static inline double algebraic_force(const mrd_model *m, const mrd_record *r, size_t i)
{
    const double v = r->v[i], yield = coefficient_at(m, BH_YIELD, i);
    if (m->law == MRD_BINGHAM) return yield * tanh(v / coefficient_at(m, BH_VELOCITY, i));
    return yield * tanh(coefficient_at(m, TH_SLOPE, i) * v + coefficient_at(m, TH_SHIFT, i) * sign_of(r->x[i]));
}

static inline double algebraic_partial(const mrd_model *m, const mrd_record *r, int k, size_t i)
{
    const double v = r->v[i], yield = coefficient_at(m, BH_YIELD, i);
    if (m->law == MRD_BINGHAM) {
        const double vr = coefficient_at(m, BH_VELOCITY, i), th = tanh(v / vr);
        return k == BH_YIELD ? th : -yield * (1.0 - th * th) * v / (vr * vr);
    }
    const double side = sign_of(r->x[i]);
    const double th = tanh(coefficient_at(m, TH_SLOPE, i) * v + coefficient_at(m, TH_SHIFT, i) * side);
    if (k == TH_YIELD) return th;
    return yield * (1.0 - th * th) * (k == TH_SLOPE ? v : side);
}

static double seed_at(const mrd_direction *d, size_t i) { return d->seed ? d->seed[d->stride * i] : 1.0; }

static mrd_status run_bouc_wen(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                               double *force, double *columns)
{
    const shape_of_law shape = shape_at(m);
    if ((shape.kappa >= 0 && varies(m, shape.kappa, r->n)) || (shape.n >= 0 && varies(m, shape.n, r->n)))
        return MRD_SHAPE_VARIES;
    curve *c = malloc(sizeof *c);
    double *store = malloc(3 * (r->n + 1) * sizeof *store);
    if (!c || !store) {
        free(c);
        free(store);
        return MRD_NO_MEMORY;
    }
    double *w = store, *by_n = NULL, *by_kappa = NULL, *by_rho[MRD_DIRECTIONS] = {NULL};
    const mrd_direction *way[MRD_DIRECTIONS] = {NULL};
    size_t ways = 0;
    for (size_t d = 0; d < directions; d++) {
        if (direction[d].coefficient == shape.rho) {
            way[ways] = direction + d;
            by_rho[ways++] = columns + d * r->n;
        } else if (direction[d].coefficient == shape.n && shape.n >= 0) by_n = store + r->n;
        else if (direction[d].coefficient == shape.kappa && shape.kappa >= 0) by_kappa = store + 2 * r->n;
    }
    const int tangents = ways > 0 || by_n || by_kappa;
    curve_build(c, shape.kappa_value, shape.n_value, tangents);
    const double *rho = m->coefficient + (m->stride ? (size_t)shape.rho * m->stride : (size_t)shape.rho);
    if (tangents || varies(m, shape.rho, r->n))
        bouc_wen_tangents(c, r, rho, m->stride ? 1 : 0, ways, way, w, by_rho, by_n, by_kappa);
    else
        bouc_wen_state(c, r, *rho, w);

    const int saturating = m->law == MRD_SATURATING;
    for (size_t i = 0; i < r->n; i++) {
        double amplitude = coefficient_at(m, BW_YIELD, i);
        if (saturating) {
            const double speed = fabs(r->v[i]);
            amplitude += coefficient_at(m, SAT_RATE, i) * speed / (speed + coefficient_at(m, SAT_VELOCITY, i));
        }
        if (force) force[i] = common_force(m, r, i) + amplitude * w[i];
    }
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        double *column = columns + d * r->n;
        for (size_t i = 0; i < r->n; i++) {
            if (k < MRD_COMMON) {
                column[i] = common_partial(m, r, k, i) * seed_at(direction + d, i);
                continue;
            }
            if (k == BW_YIELD) {
                column[i] = w[i] * seed_at(direction + d, i);
                continue;
            }
            double amplitude = coefficient_at(m, BW_YIELD, i);
            if (saturating) {
                const double speed = fabs(r->v[i]), v0 = coefficient_at(m, SAT_VELOCITY, i), rate = coefficient_at(m, SAT_RATE, i);
                amplitude += rate * speed / (speed + v0);
                if (k == SAT_RATE) {
                    column[i] = speed / (speed + v0) * w[i] * seed_at(direction + d, i);
                    continue;
                }
                if (k == SAT_VELOCITY) {
                    column[i] = -rate * speed / ((speed + v0) * (speed + v0)) * w[i] * seed_at(direction + d, i);
                    continue;
                }
            }
            if (k == shape.rho) column[i] *= amplitude;
            else if (k == shape.n) column[i] = amplitude * by_n[i] * seed_at(direction + d, i);
            else column[i] = amplitude * by_kappa[i] * seed_at(direction + d, i);
        }
    }
    free(store);
    free(c);
    return MRD_OK;
}

static mrd_status run(const mrd_model *m, const mrd_record *r, size_t directions, const mrd_direction *direction,
                      double *force, double *columns)
{
    if (!coefficient_count((int)m->law)) return MRD_NOT_A_LAW;
    if (has_state_w(m->law)) return run_bouc_wen(m, r, directions, direction, force, columns);

    if (m->law == MRD_SERIES_VALVE) {
        const mrd_direction *way[MRD_DIRECTIONS] = {NULL};
        double *column[MRD_DIRECTIONS] = {NULL};
        size_t ways = 0;
        for (size_t d = 0; d < directions; d++) {
            const int k = direction[d].coefficient;
            if (k == C_STIFFNESS || k == C_OFFSET || k >= MRD_COMMON) {
                way[ways] = direction + d;
                column[ways++] = columns + d * r->n;
            }
        }
        double *chain = malloc((r->n + 1) * sizeof *chain);
        if (!chain) return MRD_NO_MEMORY;
        series_valve_run(m, r, ways, way, chain, column);
        if (force)
            for (size_t i = 0; i < r->n; i++) force[i] = chain[i] + common_force(m, r, i);
        free(chain);
    } else if (force) {
        for (size_t i = 0; i < r->n; i++) force[i] = common_force(m, r, i) + algebraic_force(m, r, i);
    }
    for (size_t d = 0; d < directions; d++) {
        const int k = direction[d].coefficient;
        double *column = columns + d * r->n;
        if (m->law == MRD_SERIES_VALVE && (k == C_STIFFNESS || k == C_OFFSET || k >= MRD_COMMON)) continue;
        for (size_t i = 0; i < r->n; i++)
            column[i] = (k < MRD_COMMON ? common_partial(m, r, k, i) : algebraic_partial(m, r, k, i))
                      * seed_at(direction + d, i);
    }
    return MRD_OK;
}

/* w after a signed scaled travel rho dx in one direction: bounded by the curve at any travel. */
static double moved_state(const curve *c, double w, double travel)
{
    if (travel == 0.0) return w;
    const double side = travel > 0.0 ? 1.0 : -1.0;
    return side * curve_at(c, curve_inverse(c, side * w) + fabs(travel)).w;
}

/* The per-sample map, as a controller on the target runs it: no look at what comes next. */
static mrd_status causal(const mrd_model *m, const mrd_record *r, double *force)
{
    if (!coefficient_count((int)m->law)) return MRD_NOT_A_LAW;
    if (!has_state_w(m->law)) return run(m, r, 0, NULL, force, NULL);
    const shape_of_law shape = shape_at(m);
    curve *c = malloc(sizeof *c);
    if (!c) return MRD_NO_MEMORY;
    curve_build(c, shape.kappa_value, shape.n_value, 0);
    double w = 0.0;
    for (size_t i = 0; i < r->n; i++) {
        if (i > 0) {
            if (shape.n >= 0) {
                const double kappa = coefficient_at(m, shape.kappa, i), n = coefficient_at(m, shape.n, i);
                if (kappa != c->kappa || n != c->n) curve_build(c, kappa, n, 0);
            }
            const double rho = 0.5 * (coefficient_at(m, shape.rho, i - 1) + coefficient_at(m, shape.rho, i));
            double here = r->x[i - 1];
            /* A reversal inside the interval just passed: first to the turning point, then back from it. */
            if (r->v[i - 1] * r->v[i] < 0.0) {
                const double side = r->v[i] < 0.0 ? 1.0 : -1.0;
                const double turn = hermite_extremum(here, r->v[i - 1], r->x[i], r->v[i], r->step, side);
                w = moved_state(c, w, rho * (turn - here));
                here = turn;
            }
            w = moved_state(c, w, rho * (r->x[i] - here));
        }
        double amplitude = coefficient_at(m, BW_YIELD, i);
        if (m->law == MRD_SATURATING) {
            const double speed = fabs(r->v[i]);
            amplitude += coefficient_at(m, SAT_RATE, i) * speed / (speed + coefficient_at(m, SAT_VELOCITY, i));
        }
        force[i] = common_force(m, r, i) + amplitude * w;
    }
    free(c);
    return MRD_OK;
}

/* Sum of squares in eight lanes: the same order of additions at every vector width. */
static inline double sum_of_products(const double *restrict a, const double *restrict b, size_t n)
{
    double lane[8] = {0.0};
    size_t i = 0;
    for (; i + 8 <= n; i += 8)
        for (size_t j = 0; j < 8; j++) lane[j] += a[i + j] * b[i + j];
    for (; i < n; i++) lane[i & 7] += a[i] * b[i];
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

static void gram(size_t rows, size_t n, const double *columns, size_t from, double *out)
{
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double g = sum_of_products(columns + i * n + from, columns + j * n + from, n - from);
            out[i * rows + j] = g;
            out[j * rows + i] = g;
        }
    }
}

/* Squared error of a Bouc-Wen law at constant current, in blocks that stay in the first-level cache. */
static double squared_error_bouc_wen(const curve *c, const mrd_model *m, const mrd_record *r, const double *measured,
                                     size_t from, double rho)
{
    const double c0 = m->coefficient[C_VISCOSITY], k0 = m->coefficient[C_STIFFNESS], f0 = m->coefficient[C_OFFSET];
    const double mass = m->coefficient[C_MASS], yield = m->coefficient[BW_YIELD];
    double start = 0.0, lane[8] = {0.0};
    for (size_t p = 0; p < r->pieces; p++) {
        for (size_t begin = r->first[p]; begin < r->first[p + 1]; begin += BLOCK) {
            const size_t end = begin + BLOCK < r->first[p + 1] ? begin + BLOCK : r->first[p + 1];
            if (end <= from) continue;
            double w[BLOCK], e[BLOCK];
            const double *restrict x = r->x + begin, *restrict v = r->v + begin, *restrict y = measured + begin;
            const size_t n = end - begin;
            curve_stretch(c, start, rho, r->side[p], n, r->path + begin, w);
            for (size_t i = 0; i < n; i++) e[i] = y[i] - (c0 * v[i] + k0 * x[i] + f0 + yield * w[i]);
            if (mass != 0.0)
                for (size_t i = 0; i < n; i++) e[i] -= mass * r->a[begin + i];
            size_t i = begin < from ? from - begin : 0;
            for (; i + 8 <= n; i += 8)
                for (size_t j = 0; j < 8; j++) lane[j] += e[i + j] * e[i + j];
            for (; i < n; i++) lane[i & 7] += e[i] * e[i];
        }
        start = turned(c, start + rho * fabs(r->turn[p + 1] - r->turn[p]));
    }
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* errors[candidate][run] of candidates whose coefficients [candidate][run][coefficient] are constant over each run. */
static mrd_status squared_errors(mrd_law law, size_t runs, const mrd_record *const *records, const double *const *measured,
                                 const size_t *from, size_t candidates, const double *coefficients, double *errors)
{
    const size_t count = (size_t)coefficient_count((int)law);
    if (!count) return MRD_NOT_A_LAW;
    size_t longest = 1;
    for (size_t k = 0; k < runs; k++) longest = records[k]->n > longest ? records[k]->n : longest;
    double *force = malloc(longest * sizeof *force);
    curve *c = malloc(sizeof *c);
    mrd_status status = force && c ? MRD_OK : MRD_NO_MEMORY;
    if (c) c->n = -1.0;
    for (size_t j = 0; j < candidates && status == MRD_OK; j++) {
        for (size_t k = 0; k < runs && status == MRD_OK; k++) {
            const mrd_model m = {law, coefficients + (j * runs + k) * count, 0};
            const mrd_record *r = records[k];
            const int friction = m.coefficient[C_COULOMB] != 0.0 || m.coefficient[C_BREAKAWAY] != 0.0;
            if ((law == MRD_BOUC_WEN || law == MRD_DAHL) && !friction) {
                const shape_of_law shape = shape_at(&m);
                if (shape.kappa_value != c->kappa || shape.n_value != c->n || c->tangents)
                    curve_build(c, shape.kappa_value, shape.n_value, 0);
                errors[j * runs + k] = squared_error_bouc_wen(c, &m, r, measured[k], from[k], m.coefficient[BW_RHO]);
                continue;
            }
            status = run(&m, r, 0, NULL, force, NULL);
            for (size_t i = 0; i < r->n; i++) force[i] -= measured[k][i];
            errors[j * runs + k] = from[k] < r->n ? sum_of_products(force + from[k], force + from[k], r->n - from[k]) : 0.0;
        }
    }
    free(force);
    free(c);
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

/* First-order lag of a command that is linear between samples, and its derivative by the lag. */
static void first_order_lag(size_t n, double step, double lag, const double *command, double *applied, double *by_lag)
{
    if (!n) return;
    applied[0] = command[0];
    by_lag[0] = 0.0;
    if (!(lag > 0.0)) {
        for (size_t i = 1; i < n; i++) {
            applied[i] = command[i];
            by_lag[i] = -(command[i] - command[i - 1]) / step;
        }
        return;
    }
    const double decay = exp(-step / lag), decay_by = decay * step / (lag * lag);
    for (size_t i = 1; i < n; i++) {
        /* Exact for a ramp c0 + s t: response c - s lag + (a0 - c0 + s lag) decay. */
        const double slope = (command[i] - command[i - 1]) / step;
        const double gap = applied[i - 1] - command[i - 1] + slope * lag;
        applied[i] = command[i] - slope * lag + gap * decay;
        by_lag[i] = -slope + (by_lag[i - 1] + slope) * decay + gap * decay_by;
    }
}
