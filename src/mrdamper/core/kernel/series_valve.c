/* The series valve law: an MR valve in series with a compliance (free play, spring and dashpot).
 *
 * e + y = x. Both elements have the same force:
 *
 *     F = S(e) + cB |e'|^(mB-1) e'                                              compliance.c, v0 = 1 m/s
 *     F = f0 + k0 y + fy (1 + bx x) [tanh(y'/vr) + rK |y'|^m sgn y']            valve
 *
 * The only state is the valve travel y. A step is the two-stage, L-stable SDIRK method of order two. Each stage is one
 * scalar equation R(q) = 0 for the valve velocity q. R increases strictly, and Newton's method in a bracket solves the
 * equation.
 */

#define SDIRK_FIRST 0.29289321881345247560 /* 1 - sqrt(1/2), length of both stages divided by the step */

/* Coefficients and state of PACK lanes. The start value of a stage extrapolates the elastic velocity, which changes
 * less than the valve velocity. It uses the same stage of previous steps, because the stages have different errors. */
typedef struct {
    pack c[SV_COUNT], per_velocity;
    compliance compliance;
    int thins;
    pack y, lag[2], change[2]; /* valve travel; elastic velocity at both stages, and its change from step to step */
    pack by[WAYS_MAX];         /* derivatives of the valve travel */
} valve_lanes;

/* Constants of a stage: displacement, velocity and yield force at its end, valve travel at its start, length. */
typedef struct {
    pack x, v, amplitude, base, h;
} valve_stage;

/* Terms of the equation at one valve velocity. */
typedef struct {
    pack q, y, force, slope;       /* [m/s], [m], [N]; slope of R(q) */
    pack tanh_q, power, log_q;     /* power: |q|^m sgn q; log_q: ln |q|, 0 at rest */
    pack shape, shape_slope;       /* tanh and thinning */
    compliance_point k;
} valve_point;

static void valve_set(valve_lanes *l)
{
    l->per_velocity = 1.0 / l->c[SV_VELOCITY];
    l->compliance = compliance_of(l->c + SV_SPRING, pack_of(1.0));
    l->thins = any_of(is_positive(l->c[SV_THINNING]));
}

IN_LANES valve_stage valve_stage_at(const valve_lanes *l, pack x, pack v, pack base, pack h)
{
    const valve_stage out = {x, v, l->c[SV_YIELD] * (1.0 + l->c[SV_POSITION] * x), base, h};
    return out;
}

/* Compute all terms at the valve velocity q, and return R(q). */
IN_LANES pack valve_residual(const valve_lanes *l, const valve_stage *s, pack q, valve_point *p)
{
    const pack *c = l->c, size = size_of(q), zero = pack_of(0.0);
    const pack decay = exp_of(-2.0 * l->per_velocity * size), t = (1.0 - decay) / (1.0 + decay);
    p->q = q;
    p->y = s->base + s->h * q;
    p->tanh_q = signed_as(t, q);
    p->shape_slope = (1.0 - t * t) * l->per_velocity;
    p->power = p->log_q = zero;
    if (l->thins) {
        const pack size_min = greater_of(size, pack_of(1e-300)), per_size = 1.0 / size_min;
        p->log_q = only(is_positive(size), log_of(size_min));
        const pack power = only(both(is_positive(size), is_positive(c[SV_THINNING])), exp_of(c[SV_EXPONENT] * p->log_q));
        p->power = signed_as(power, q);
        p->shape_slope += c[SV_THINNING] * c[SV_EXPONENT] * power * per_size;
    }
    p->shape = p->tanh_q + c[SV_THINNING] * p->power;
    p->force = c[C_OFFSET] + c[C_STIFFNESS] * p->y + s->amplitude * p->shape;
    p->k.e = s->x - p->y;
    p->k.rate = s->v - q;
    const pack elastic = compliance_force(&l->compliance, &p->k);
    p->slope = s->amplitude * p->shape_slope + s->h * (c[C_STIFFNESS] + p->k.spring_slope) + p->k.leak_slope;
    return p->force - elastic;
}

/* Solve the equation of a stage for the valve velocity. `guess` is the start value. */
static void valve_solve(const valve_lanes *l, const valve_stage *s, pack guess, valve_point *solved)
{
    valve_point p; /* A local structure stays in registers. */
    lane_search find;
    pack_mask ask;
    search_begin(guess, 0.01 * l->c[SV_VELOCITY], &find);
    for (int i = 0; i < SEARCH_STEPS_MAX; i++) {
        const pack residual = valve_residual(l, s, find.sign * find.p, &p);
        if (!search_on(&find, residual, p.slope, SEARCH_TOLERANCE * (l->c[SV_YIELD] + size_of(p.force)), &ask)) break;
        if (!any_of(ask)) continue;
        valve_point rest;
        search_turn(&find, ask, valve_residual(l, s, pack_of(0.0), &rest));
    }
    /* Take one more Newton step without a new evaluation. The remaining error is the square of this step. */
    const pack last = find.last, shape = p.shape_slope * last;
    p.q += last;
    p.y += s->h * last;
    p.k.e -= s->h * last;
    p.k.rate -= last;
    p.shape += shape;
    p.force += l->c[C_STIFFNESS] * s->h * last + s->amplitude * shape;
    *solved = p;
}

/* Compute the partial derivatives of valve force (at fixed q and y) and of R(q) with respect to every coefficient. */
IN_LANES void valve_partials(const valve_lanes *l, const valve_stage *s, const valve_point *p, pack *force, pack *residual)
{
    const pack *c = l->c, gain = 1.0 + c[SV_POSITION] * s->x;
    force[C_OFFSET] = pack_of(1.0);
    force[C_STIFFNESS] = p->y;
    force[SV_YIELD] = gain * p->shape;
    force[SV_THINNING] = s->amplitude * p->power;
    force[SV_EXPONENT] = s->amplitude * c[SV_THINNING] * p->power * p->log_q;
    force[SV_VELOCITY] = -s->amplitude * (1.0 - p->tanh_q * p->tanh_q) * p->q * (l->per_velocity * l->per_velocity);
    force[SV_POSITION] = c[SV_YIELD] * s->x * p->shape;
    residual[C_OFFSET] = force[C_OFFSET];
    residual[C_STIFFNESS] = force[C_STIFFNESS];
    for (int k = SV_YIELD; k <= SV_POSITION; k++) residual[k] = force[k];
    compliance_partials(&l->compliance, &p->k, residual + SV_SPRING);
    for (int k = SV_SPRING; k < SV_COUNT; k++) {
        force[k] = pack_of(0.0);
        residual[k] = -residual[k];
    }
}

/* Compute the first sample, with the valve at rest in the middle of its travel. */
static void valve_lanes_first(valve_lanes *l, const lane_samples *t, double *force, double *const *column)
{
    valve_point p;
    pack force_by[SV_COUNT], residual_by[SV_COUNT];
    const valve_stage s = valve_stage_at(l, t->x[1], t->v[1], t->x[1], pack_of(0.0));
    valve_solve(l, &s, s.v, &p);
    l->y = s.x;
    l->lag[0] = l->lag[1] = p.k.rate;
    memcpy(force, &p.force, sizeof p.force);
    if (!t->ways) return;
    valve_partials(l, &s, &p, force_by, residual_by);
    for (size_t d = 0; d < t->ways; d++) {
        const pack by = force_by[t->way[d]] - s.amplitude * p.shape_slope / p.slope * residual_by[t->way[d]];
        const pack seeded = by * seed_between(t, d, 1.0);
        memcpy(column[d], &seeded, sizeof seeded);
    }
}

/* Step from one sample to the next. Compute force and columns at the second sample. */
static void valve_lanes_step(valve_lanes *l, const lane_samples *t, double *force, double *const *column)
{
    const pack h = t->step / (double)t->substeps, first = SDIRK_FIRST * h, rest = (1.0 - SDIRK_FIRST) * h;
    const lane_motion motion = motion_between(t);
    valve_point p;
    for (size_t j = 0; j < t->substeps; j++) {
        pack base = l->y, base_by[WAYS_MAX];
        for (int stage = 0; stage < 2; stage++) {
            const double fraction = ((double)j + (stage ? 1.0 : SDIRK_FIRST)) / (double)t->substeps;
            const int last = stage && j + 1 == t->substeps;
            pack x, v, force_by[SV_COUNT], residual_by[SV_COUNT];
            motion_at(&motion, fraction, &x, &v);
            if (coefficients_between(t, fraction, SV_COUNT, l->c)) valve_set(l);
            const valve_stage s = valve_stage_at(l, x, v, base, first);
            valve_solve(l, &s, v - (l->lag[stage] + l->change[stage]), &p);
            l->change[stage] = p.k.rate - l->lag[stage];
            l->lag[stage] = p.k.rate;
            base = l->y + rest * p.q;
            if (!t->ways) continue;
            valve_partials(l, &s, &p, force_by, residual_by);
            const pack by_q = -1.0 / p.slope, by_y = l->c[C_STIFFNESS] + p.k.spring_slope, steep = s.amplitude * p.shape_slope;
            for (size_t d = 0; d < t->ways; d++) {
                const int k = t->way[d];
                const pack seed = seed_between(t, d, fraction), from = stage ? base_by[d] : l->by[d];
                const pack q_by = by_q * (residual_by[k] * seed + by_y * from);
                if (!stage) {
                    base_by[d] = from + rest * q_by;
                    continue;
                }
                l->by[d] = from + first * q_by;
                if (!last) continue;
                const pack by = force_by[k] * seed + l->c[C_STIFFNESS] * l->by[d] + steep * q_by;
                memcpy(column[d], &by, sizeof by);
            }
        }
        l->y = p.y;
    }
    memcpy(force, &p.force, sizeof p.force);
}
