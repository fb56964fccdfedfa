/* The series valve law: an MR valve in series with free play, a spring behind it and a dashpot across it.
 *
 * e + y = x. The same force in both:
 *
 *     F = S(e) + cB |e'|^(mB-1) e'                                              compliance
 *     F = f0 + k0 y + fy (1 + bx x) [tanh(y'/vr) + rK |y'|^m sgn y']            valve
 *     S(e) = k/2 [2 e + sqrt((e-d)^2 + r^2) - sqrt((e+d)^2 + r^2)]
 *
 * One state, the valve travel y. A step is the two-stage L-stable SDIRK of order two; each stage is one
 * scalar equation R(q) = 0 for the valve velocity q, strictly increasing, solved by Newton steps kept
 * inside a bracket. Its sign is known from R(0) before any power is taken.
 */

/* A search halves its bracket with every other step after so many: about a root where the slope has no limit (a dashpot's
 * exponent of a half at rest) Newton's method swings from side to side. */
#define SEARCH_PATIENCE 16
static inline int search_halves(int step, double high) { return step > SEARCH_PATIENCE && step % 2 && high < HUGE_VAL; }

typedef struct {
    double f0, k0, fy, thinning, m, velocity, position, spring, gap, corner, leak, mb;
} valve;

typedef struct {
    double q;        /* valve velocity [m/s] */
    double force;    /* [N] */
    double y;        /* valve travel at the stage [m] */
    double shape;    /* tanh + thinning part [-] */
    double tanh_q;
    double power;    /* |q|^m sgn q */
    double slope;    /* dR/dq [N s/m] */
    double shape_slope;
    double spring_slope; /* S'(e) [N/m] */
    double leak_slope;   /* d/de' of the dashpot [N s/m] */
    double e, rate;
    double log_q;        /* ln |q|, 0 at rest */
} valve_stage;

/* The chain's coefficients in the order of their partial derivatives. */
enum { P_OFFSET, P_STIFFNESS, P_YIELD, P_THINNING, P_EXPONENT, P_VELOCITY, P_POSITION, P_SPRING, P_GAP, P_CORNER, P_LEAK,
       P_LEAK_EXPONENT, PARTIALS };

static int partial_of(int coefficient)
{
    return coefficient == C_OFFSET ? P_OFFSET : coefficient == C_STIFFNESS ? P_STIFFNESS : coefficient - SV_YIELD + P_YIELD;
}

static inline double spring_force(const valve *c, double e, double *slope)
{
    const double u = e - c->gap, v = e + c->gap, rr = c->corner * c->corner;
    const double su = sqrt(u * u + rr), sv = sqrt(v * v + rr);
    *slope = 0.5 * c->spring * (2.0 + u / su - v / sv);
    return 0.5 * c->spring * (2.0 * e + su - sv);
}

static inline double leak_force(const valve *c, double rate, double *slope)
{
    if (c->mb == 1.0) {
        *slope = c->leak;
        return c->leak * rate;
    }
    /* Regular at rest: |rate| is not let below 1 um/s in the slope. */
    const double size = fabs(rate) > 1e-6 ? fabs(rate) : 1e-6;
    const double power = c->leak * exp((c->mb - 1.0) * log(size));
    *slope = fabs(rate) > 1e-6 ? c->mb * power : power;
    return power * rate;
}

/* Everything at valve velocity q; returns R(q). `base` is the travel that the stage starts from, `h` its step. */
static inline double valve_residual(const valve *c, double x, double v, double base, double h, double q,
                                    valve_stage *s)
{
    const double amplitude = c->fy * (1.0 + c->position * x);
    const double size = fabs(q);
    s->q = q;
    s->y = base + h * q;
    s->e = x - s->y;
    s->rate = v - q;
    if (size > 0.0) {
        const double decay = exp(-2.0 * size / c->velocity);
        s->log_q = log(size);
        const double power = c->thinning > 0.0 ? exp(c->m * s->log_q) : 0.0;
        const double th = (1.0 - decay) / (1.0 + decay);
        s->tanh_q = q > 0.0 ? th : -th;
        s->power = q > 0.0 ? power : -power;
        s->shape_slope = (1.0 - th * th) / c->velocity + c->thinning * c->m * power / size;
    } else {
        s->tanh_q = s->power = s->log_q = 0.0;
        s->shape_slope = 1.0 / c->velocity;
    }
    s->shape = s->tanh_q + c->thinning * s->power;
    const double spring = spring_force(c, s->e, &s->spring_slope);
    const double leak = leak_force(c, s->rate, &s->leak_slope);
    s->force = c->f0 + c->k0 * s->y + amplitude * s->shape;
    s->slope = amplitude * s->shape_slope + h * (c->k0 + s->spring_slope) + s->leak_slope;
    return s->force - spring - leak;
}

/* Solve one stage. `guess` is the valve velocity expected.
 *
 * The search runs in p = |q| on one side of rest, where R rises through zero: a root found there is the
 * root, R being monotone. The side is that of the guess; R(0) is evaluated only if Newton's method leaves it.
 */
static void valve_solve(const valve *c, double x, double v, double base, double h, double guess, valve_stage *s)
{
    double sign = guess < 0.0 ? -1.0 : 1.0, low = 0.0, high = HUGE_VAL, p = fabs(guess);
    int side_known = 0;
    if (!(p > 0.0)) p = 0.01 * c->velocity;
    for (int i = 0; i < 80; i++) {
        const double residual = sign * valve_residual(c, x, v, base, h, sign * p, s);
        const double next = p - residual / s->slope;
        if (residual > 0.0) high = p;
        else low = p;
        if (fabs(residual) <= 1e-7 * (c->fy + fabs(s->force)) && next >= low && next <= high) {
            /* One more Newton step without a new evaluation: the error is the square of this one. */
            const double dq = sign * (next - p);
            const double shape = s->shape_slope * dq;
            s->q += dq;
            s->y += h * dq;
            s->e -= h * dq;
            s->rate -= dq;
            s->shape += shape;
            s->force += c->k0 * h * dq + c->fy * (1.0 + c->position * x) * shape;
            return;
        }
        double moved = next;
        if (!(next > low)) {
            if (low == 0.0 && !side_known) {
                const double at_rest = valve_residual(c, x, v, base, h, 0.0, s);
                if (at_rest == 0.0) return;
                side_known = 1;
                if (sign * at_rest > 0.0) {
                    sign = -sign;
                    high = HUGE_VAL;
                    p = 0.01 * c->velocity;
                    continue;
                }
            }
            moved = low > 0.0 ? 0.5 * (low + p) : 0.05 * p;
        }
        if (!(next < high)) moved = high == HUGE_VAL ? 4.0 * p : 0.5 * (low + high);
        if (search_halves(i, high)) moved = 0.5 * (low + high);
        if (moved == p) return;
        p = moved;
    }
}

static valve valve_at(const mrd_model *model, size_t i)
{
    const double *c = model->coefficient;
    const size_t row = model->stride ? model->stride : 1, at = model->stride ? i : 0;
    valve out;
#define AT(k) c[(size_t)(k) * row + at]
    out.f0 = AT(C_OFFSET);
    out.k0 = AT(C_STIFFNESS);
    out.fy = AT(SV_YIELD);
    out.thinning = AT(SV_THINNING);
    out.m = AT(SV_EXPONENT);
    out.velocity = AT(SV_VELOCITY);
    out.position = AT(SV_POSITION);
    out.spring = AT(SV_SPRING);
    out.gap = AT(SV_GAP);
    out.corner = AT(SV_CORNER);
    out.leak = AT(SV_LEAK);
    out.mb = AT(SV_LEAK_EXPONENT);
#undef AT
    return out;
}

/* The chain's coefficients at a share of the way between two samples. */
static valve valve_between(const valve *a, const valve *b, double share)
{
    valve out;
#define BETWEEN(name) out.name = a->name + share * (b->name - a->name)
    BETWEEN(f0);
    BETWEEN(k0);
    BETWEEN(fy);
    BETWEEN(thinning);
    BETWEEN(m);
    BETWEEN(velocity);
    BETWEEN(position);
    BETWEEN(spring);
    BETWEEN(gap);
    BETWEEN(corner);
    BETWEEN(leak);
    BETWEEN(mb);
#undef BETWEEN
    return out;
}

/* Partial derivatives by every coefficient of the chain: of the valve's force at fixed q and y, and of R. */
static inline void valve_partials(const valve *c, const valve_stage *s, double x, double *restrict force,
                                  double *restrict residual)
{
    const double gain = 1.0 + c->position * x, amplitude = c->fy * gain;
    const double u = s->e - c->gap, v = s->e + c->gap, rr = c->corner * c->corner;
    const double su = 1.0 / sqrt(u * u + rr), sv = 1.0 / sqrt(v * v + rr);
    for (int k = 0; k < PARTIALS; k++) force[k] = 0.0;
    force[P_OFFSET] = 1.0;
    force[P_STIFFNESS] = s->y;
    force[P_YIELD] = gain * s->shape;
    force[P_THINNING] = amplitude * s->power;
    force[P_EXPONENT] = amplitude * c->thinning * s->power * s->log_q;
    force[P_VELOCITY] = -amplitude * (1.0 - s->tanh_q * s->tanh_q) * s->q / (c->velocity * c->velocity);
    force[P_POSITION] = c->fy * x * s->shape;
    for (int k = 0; k < PARTIALS; k++) residual[k] = force[k];
    residual[P_SPRING] = -0.5 * (2.0 * s->e + 1.0 / su - 1.0 / sv);
    residual[P_GAP] = 0.5 * c->spring * (u * su + v * sv);
    residual[P_CORNER] = -0.5 * c->spring * c->corner * (su - sv);
    if (c->mb == 1.0) {
        residual[P_LEAK] = -s->rate;
    } else {
        const double size = fabs(s->rate) > 1e-6 ? fabs(s->rate) : 1e-6;
        residual[P_LEAK] = -exp((c->mb - 1.0) * log(size)) * s->rate;
    }
    const double size = fabs(s->rate) > 1e-6 ? fabs(s->rate) : 1e-6;
    residual[P_LEAK_EXPONENT] = c->leak * residual[P_LEAK] * log(size);
}

/* Force of the chain along a record, and its derivatives by `ways` directions of the chain's coefficients. */
static void series_valve_run(const mrd_model *model, const mrd_record *r, size_t ways, const mrd_direction *const *way,
                             double *force, double *const *column, mrd_state *state)
{
    const double gamma = 1.0 - sqrt(0.5);
    const double h = r->step / (double)r->substeps;
    double y = r->behind ? state->y : r->n ? r->x[0] : 0.0;
    double q_last = r->behind ? state->q : 0.0, q_rate = r->behind ? state->q_rate : 0.0;
    double by[MRD_DIRECTIONS], base_by[MRD_DIRECTIONS], df[PARTIALS], dr[PARTIALS];
    int partial[MRD_DIRECTIONS];
    for (size_t d = 0; d < ways; d++) {
        by[d] = 0.0;
        partial[d] = partial_of(way[d]->coefficient);
    }
    valve c = valve_at(model, 0), before_it = c, at_it = c;
    valve_stage s;
    s.q = q_last;
    s.force = 0.0;
    if (r->n && !r->behind) {
        valve_solve(&c, r->x[0], r->v[0], y, 0.0, r->v[0], &s);
        force[0] = s.force;
        if (ways) valve_partials(&c, &s, r->x[0], df, dr);
        for (size_t d = 0; d < ways; d++) {
            const double dq = -dr[partial[d]] / s.slope;
            column[d][0] = (df[partial[d]] + c.fy * (1.0 + c.position * r->x[0]) * s.shape_slope * dq)
                         * (way[d]->seed ? way[d]->seed[0] : 1.0);
        }
        q_last = s.q;
    }
    for (size_t i = 1; i < r->n; i++) {
        const interval between = interval_before(r, i);
        if (model->stride) {
            before_it = at_it;
            at_it = valve_at(model, i);
        }
        for (size_t j = 0; j < r->substeps; j++) {
            double base = y, q_first = 0.0;
            for (size_t d = 0; d < ways; d++) base_by[d] = by[d];
            for (int stage = 0; stage < 2; stage++) {
                const double share = ((double)j + (stage ? 1.0 : gamma)) / (double)r->substeps;
                double x, v;
                interval_at(&between, share, &x, &v);
                if (model->stride) c = valve_between(&before_it, &at_it, share);
                const double before = stage ? s.q : q_last, ahead = (stage ? 1.0 - gamma : gamma) * h;
                valve_solve(&c, x, v, base, gamma * h, before + ahead * q_rate, &s);
                q_rate = (s.q - before) / ahead;
                if (!ways) goto advance;
                valve_partials(&c, &s, x, df, dr);
                const double by_q = -1.0 / s.slope, by_y = c.k0 + s.spring_slope;
                const double shape_slope = c.fy * (1.0 + c.position * x) * s.shape_slope;
                const int last = stage == 1 && j + 1 == r->substeps;
                for (size_t d = 0; d < ways; d++) {
                    double seed = 1.0;
                    if (way[d]->seed) {
                        const double *row = way[d]->seed + way[d]->stride * (i - 1), from = row[0];
                        seed = from + share * (row[way[d]->stride] - from);
                    }
                    const double q_by = by_q * (dr[partial[d]] * seed + by_y * base_by[d]);
                    if (stage == 0) {
                        base_by[d] = by[d] + (1.0 - gamma) * h * q_by;
                    } else {
                        by[d] = base_by[d] + gamma * h * q_by;
                        if (last) column[d][i] = df[partial[d]] * seed + c.k0 * by[d] + shape_slope * q_by;
                    }
                }
            advance:
                if (stage == 0) {
                    q_first = s.q;
                    base = y + (1.0 - gamma) * h * q_first;
                } else {
                    y = s.y;
                    q_last = s.q;
                }
            }
        }
        force[i] = s.force;
    }
    if (!state) return;
    state->y = y;
    state->q = q_last;
    state->q_rate = q_rate;
}
