/* The series valve in lanes: each lane another candidate or run, at constant coefficients. Same equations, same steps and
 * same search as series_valve.c has for one; here with exp and ln of lanes.h, and masks where that has branches. */

typedef struct {
    pack f0, k0, fy, thinning, m, velocity, inverse_velocity, position, spring, gap, corner2, corner, leak, mb;
} valve_pack;

typedef struct {
    pack q, force, y, shape, tanh_q, power, slope, shape_slope, spring_slope, e, rate, log_q;
} stage_pack;

/* State of PACK lanes; `by` is the derivative of the valve travel by each partial. */
typedef struct {
    valve_pack c;
    pack step, y, q, q_rate;
    pack by[PARTIALS];
} valve_lanes;

/* As valve_residual(); `amplitude` is the yield force at this displacement. */
IN_LANES pack pack_residual(const valve_pack *c, pack x, pack v, pack amplitude, pack base, pack h, pack q, stage_pack *s)
{
    const pack size = size_of(q), least = greater_of(size, pack_of(1e-300)), inverse = 1.0 / least;
    const pack_mask moves = (pack_mask)(size > 0.0) & (pack_mask)(c->thinning > 0.0);
    s->q = q;
    s->y = base + h * q;
    s->e = x - s->y;
    s->rate = v - q;
    const pack decay = exp_of(-2.0 * c->inverse_velocity * size), th = (1.0 - decay) / (1.0 + decay);
    s->log_q = only((pack_mask)(size > 0.0), log_of(least));
    const pack power = only(moves, exp_of(c->m * s->log_q));
    s->tanh_q = signed_as(th, q);
    s->power = signed_as(power, q);
    s->shape_slope = (1.0 - th * th) * c->inverse_velocity + c->thinning * c->m * power * inverse;
    s->shape = s->tanh_q + c->thinning * s->power;

    const pack u = s->e - c->gap, w = s->e + c->gap;
    const pack su = root_of(u * u + c->corner2), sv = root_of(w * w + c->corner2);
    s->spring_slope = 0.5 * c->spring * (2.0 + u / su - w / sv);
    const pack spring = 0.5 * c->spring * (2.0 * s->e + su - sv);
    const pack speed = size_of(s->rate), bend = choose((pack_mask)(speed > 1e-6), c->mb, pack_of(1.0));
    const pack leak = c->leak * exp_of((c->mb - 1.0) * log_of(greater_of(speed, pack_of(1e-6)))), leak_slope = bend * leak;

    s->force = c->f0 + c->k0 * s->y + amplitude * s->shape;
    s->slope = amplitude * s->shape_slope + h * (c->k0 + s->spring_slope) + leak_slope;
    return s->force - spring - leak * s->rate;
}

/* As valve_solve(). */
static void pack_solve(const valve_pack *c, pack x, pack v, pack base, pack h, pack guess, stage_pack *s)
{
    const pack amplitude = c->fy * (1.0 + c->position * x);
    lane_search find;
    pack_mask ask;
    search_begin(guess, 0.01 * c->velocity, &find);
    for (int i = 0; i < 80; i++) {
        const pack residual = pack_residual(c, x, v, amplitude, base, h, find.sign * find.p, s);
        if (!search_on(&find, residual, s->slope, 1e-7 * (c->fy + size_of(s->force)), &ask)) break;
        if (!any_of(ask)) continue;
        stage_pack rest;
        search_turn(&find, ask, pack_residual(c, x, v, amplitude, base, h, pack_of(0.0), &rest));
    }
    /* One more Newton step without a new evaluation: the error is the square of this one. */
    const pack last = find.last, shape = s->shape_slope * last;
    s->q += last;
    s->y += h * last;
    s->e -= h * last;
    s->rate -= last;
    s->shape += shape;
    s->force += c->k0 * h * last + amplitude * shape;
}

/* As valve_partials(). */
IN_LANES void pack_partials(const valve_pack *c, const stage_pack *s, pack x, pack *force, pack *residual)
{
    const pack gain = 1.0 + c->position * x, amplitude = c->fy * gain, zero = pack_of(0.0);
    const pack u = s->e - c->gap, v = s->e + c->gap;
    const pack su = 1.0 / root_of(u * u + c->corner2), sv = 1.0 / root_of(v * v + c->corner2);
    force[P_OFFSET] = pack_of(1.0);
    force[P_STIFFNESS] = s->y;
    force[P_YIELD] = gain * s->shape;
    force[P_THINNING] = amplitude * s->power;
    force[P_EXPONENT] = amplitude * c->thinning * s->power * s->log_q;
    force[P_VELOCITY] = -amplitude * (1.0 - s->tanh_q * s->tanh_q) * s->q * (c->inverse_velocity * c->inverse_velocity);
    force[P_POSITION] = c->fy * x * s->shape;
    for (int k = 0; k <= P_POSITION; k++) residual[k] = force[k];
    for (int k = P_POSITION + 1; k < PARTIALS; k++) force[k] = zero;
    residual[P_SPRING] = -0.5 * (2.0 * s->e + 1.0 / su - 1.0 / sv);
    residual[P_GAP] = 0.5 * c->spring * (u * su + v * sv);
    residual[P_CORNER] = -0.5 * c->spring * c->corner * (su - sv);
    const pack log_rate = log_of(greater_of(size_of(s->rate), pack_of(1e-6)));
    residual[P_LEAK] = -exp_of((c->mb - 1.0) * log_rate) * s->rate;
    residual[P_LEAK_EXPONENT] = c->leak * residual[P_LEAK] * log_rate;
}

static void valve_lanes_begin(valve_lanes *l, const mrd_model *const *model, const mrd_record *const *record)
{
    memset(l, 0, sizeof *l);
    for (int k = 0; k < PACK; k++) {
        const valve c = valve_at(model[k], 0);
        l->c.f0[k] = c.f0;
        l->c.k0[k] = c.k0;
        l->c.fy[k] = c.fy;
        l->c.thinning[k] = c.thinning;
        l->c.m[k] = c.m;
        l->c.velocity[k] = c.velocity;
        l->c.inverse_velocity[k] = 1.0 / c.velocity;
        l->c.position[k] = c.position;
        l->c.spring[k] = c.spring;
        l->c.gap[k] = c.gap;
        l->c.corner[k] = c.corner;
        l->c.corner2[k] = c.corner * c.corner;
        l->c.leak[k] = c.leak;
        l->c.mb[k] = c.mb;
        l->step[k] = record[k]->step;
    }
}

/* One stage: its tangents follow by the implicit function theorem. `base_by` is the derivative of `base`. */
typedef struct {
    stage_pack s;
    pack force_by[PARTIALS], q_by[PARTIALS];
} stage_tangents;

IN_LANES void pack_stage(const valve_pack *c, pack x, pack v, pack base, pack h, pack guess, const pack *base_by,
                         size_t ways, const int *partial, stage_tangents *out)
{
    pack dr[PARTIALS];
    pack_solve(c, x, v, base, h, guess, &out->s);
    if (!ways) return;
    pack_partials(c, &out->s, x, out->force_by, dr);
    const pack by_q = -1.0 / out->s.slope, by_y = c->k0 + out->s.spring_slope;
    for (size_t d = 0; d < ways; d++) out->q_by[d] = by_q * (dr[partial[d]] + by_y * base_by[d]);
}

/* The first sample: the valve at rest in the middle of its travel. */
static void valve_lanes_first(valve_lanes *l, pack x, pack v, size_t ways, const int *partial, double *force,
                              double *const *column)
{
    stage_tangents t;
    const pack zero = pack_of(0.0), amplitude = l->c.fy * (1.0 + l->c.position * x);
    pack none[PARTIALS];
    for (size_t d = 0; d < ways; d++) none[d] = zero;
    l->y = x;
    pack_stage(&l->c, x, v, x, zero, v, none, ways, partial, &t);
    l->q = t.s.q;
    memcpy(force, &t.s.force, sizeof t.s.force);
    for (size_t d = 0; d < ways; d++) {
        const pack by = t.force_by[partial[d]] + amplitude * t.s.shape_slope * t.q_by[d];
        memcpy(column[d], &by, sizeof by);
    }
}

/* From one sample to the next: x and v of both [m, m/s]; force and columns at the second. */
static void valve_lanes_step(valve_lanes *l, size_t substeps, const pack x[2], const pack v[2], size_t ways,
                             const int *partial, double *force, double *const *column)
{
    const double gamma = 1.0 - sqrt(0.5);
    const pack h = l->step / (double)substeps, d0 = v[0] * l->step, d1 = v[1] * l->step;
    const pack c2 = 3.0 * (x[1] - x[0]) - 2.0 * d0 - d1, c3 = d0 + d1 - 2.0 * (x[1] - x[0]);
    stage_tangents t;
    for (size_t j = 0; j < substeps; j++) {
        pack base = l->y, base_by[PARTIALS], before = l->q;
        for (size_t d = 0; d < ways; d++) base_by[d] = l->by[d];
        for (int stage = 0; stage < 2; stage++) {
            const double share = ((double)j + (stage ? 1.0 : gamma)) / (double)substeps;
            const pack at_x = x[0] + share * (d0 + share * (c2 + share * c3));
            const pack at_v = (d0 + share * (2.0 * c2 + share * 3.0 * c3)) / l->step;
            const pack ahead = (stage ? 1.0 - gamma : gamma) * h;
            const pack guess = before + ahead * l->q_rate;
            pack_stage(&l->c, at_x, at_v, base, gamma * h, guess, base_by, ways, partial, &t);
            l->q_rate = (t.s.q - before) / ahead;
            before = t.s.q;
            if (stage == 0) {
                base = l->y + (1.0 - gamma) * h * t.s.q;
                for (size_t d = 0; d < ways; d++) base_by[d] = l->by[d] + (1.0 - gamma) * h * t.q_by[d];
                continue;
            }
            l->y = t.s.y;
            l->q = t.s.q;
            for (size_t d = 0; d < ways; d++) l->by[d] = base_by[d] + gamma * h * t.q_by[d];
            if (j + 1 < substeps) continue;
            const pack shape_slope = l->c.fy * (1.0 + l->c.position * at_x) * t.s.shape_slope;
            memcpy(force, &t.s.force, sizeof t.s.force);
            for (size_t d = 0; d < ways; d++) {
                const pack by = t.force_by[partial[d]] + l->c.k0 * l->by[d] + shape_slope * t.q_by[d];
                memcpy(column[d], &by, sizeof by);
            }
        }
    }
}
