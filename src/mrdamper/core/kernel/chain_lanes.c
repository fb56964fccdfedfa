/* The chain in SIMD lanes: each lane is a candidate or run with constant coefficients. Equation and steps are those of
 * chain.c, with exp and ln of lanes.h. The coefficients of a disabled term are zero, so that few masks are needed. A
 * term that is disabled in all lanes is skipped.
 */

/* Partial derivatives as in chain_partials; zero but where a step writes. */
typedef struct {
    pack valve[CH_COUNT], compliance[CH_COUNT], bristle[BRISTLES][CH_COUNT];
    pack by_travel, bristle_by_travel[BRISTLES], friction_by_speed;
    pack charge[CH_COUNT], charge_slope[CH_COUNT];
} chain_pack_partials;

/* State of PACK lanes. A disabled bristle has a level but no stiffness, hence no force. */
typedef struct {
    pack c[CH_COUNT], per[CH_COUNT]; /* coefficients, and one over each, 0 of next to nothing */
    pack step, yield_velocity, per_velocity, bypass, level[BRISTLES], stiffness[BRISTLES];
    pack_mask plastic, cavity_on, bypass_on, gas_on;
    int some_plastic, some_cavity, some_bypass, some_gas, thinning, knee, fades, bent, bristle_on[BRISTLES];
    pack q, y, y_rate, play, cavity, bristle[BRISTLES];
    pack play_by; /* derivative of `play` by its half width; the others are zero */
    pack q_by[CH_COUNT], y_by[CH_COUNT], cavity_by[CH_COUNT], bristle_by[BRISTLES][CH_COUNT];
    chain_pack_partials partials;
} chain_lanes;

/* As chain_step; `rate` is the relaxation of a bristle divided by |y|. Retracting, extending. */
typedef struct {
    pack h, v, e, per_h, charge, charge_slope, charge_curvature;
    pack gain, gain_slope, rest, rest_slope, gas_curvature, gas_unit, gas_per, viscoplastic, thinning, fade;
    pack level[2][BRISTLES], rate[2][BRISTLES];
    int cavity;
} chain_pack_step;

/* As chain_point. */
typedef struct {
    pack y, force, slope, force_slope, u, u_slope, t, t_slope, sharper, power, log_size, rate;
    pack e, spring_slope, leak_slope, cavity, length, cavity_slope, by_cavity;
    pack bristle[BRISTLES], bristle_slope[BRISTLES], kept[BRISTLES];
} chain_pack_point;

static int some_lane(pack x) { return any_of((pack_mask)(x != 0.0)); }

static void chain_lanes_begin(chain_lanes *l, const mrd_model *const *model, const mrd_record *const *record)
{
    memset(l, 0, sizeof *l);
    pack *c = l->c, apart = pack_of(1.0);
    for (int i = 0; i < PACK; i++) {
        for (int k = 0; k < CH_COUNT; k++) c[k][i] = model[i]->coefficient[k];
        if (c[CH_SPREAD][i] != 0.0) apart[i] = exp(c[CH_SPREAD][i]);
        l->step[i] = record[i]->step;
    }
    for (int k = 0; k < CH_COUNT; k++) l->per[k] = only((pack_mask)(size_of(c[k]) > CHAIN_LEAST), 1.0 / c[k]);
    l->plastic = (pack_mask)(c[CH_YIELD] * (1.0 - c[CH_SHARE]) > 0.0);
    l->cavity_on = (pack_mask)(c[CH_CAVITY_LENGTH] > 0.0);
    l->bypass_on = (pack_mask)(c[CH_BYPASS] > 0.0);
    l->gas_on = (pack_mask)(c[CH_GAS] != 0.0);
    l->some_plastic = any_of(l->plastic);
    l->some_cavity = any_of(l->cavity_on);
    l->some_bypass = any_of(l->bypass_on);
    l->some_gas = any_of(l->gas_on);
    l->thinning = some_lane(c[CH_THINNING]) || some_lane(c[CH_OWN]);
    l->knee = some_lane(c[CH_KNEE]);
    l->fades = some_lane(c[CH_EXCESS]);
    l->bent = some_lane(c[CH_LEAK_EXPONENT] - 1.0);
    l->yield_velocity = c[CH_VELOCITY] + c[CH_CREEP] * c[CH_YIELD];
    l->per_velocity = only((pack_mask)(l->yield_velocity > CHAIN_LEAST), 1.0 / l->yield_velocity);
    l->bypass = only(l->bypass_on, c[CH_BYPASS] * root_of(c[CH_YIELD]));
    const pack stiff[PRE_YIELD] = {c[CH_BRISTLE], c[CH_BRISTLE] * apart, c[CH_BRISTLE] / apart};
    for (int j = 0; j < PRE_YIELD; j++) {
        l->level[j] = CHAIN_SHARE[j] * c[CH_YIELD] * c[CH_SHARE];
        l->stiffness[j] = CHAIN_SHARE[j] * stiff[j];
    }
    l->level[FRICTION_BRISTLE] = c[CH_FRICTION];
    l->stiffness[FRICTION_BRISTLE] = c[CH_FRICTION_STIFFNESS];
    l->level[MEMORY_BRISTLE] = c[CH_MEMORY];
    l->stiffness[MEMORY_BRISTLE] = c[CH_MEMORY_STIFFNESS];
    for (int j = 0; j < BRISTLES; j++) {
        const pack_mask on = (pack_mask)(CHAIN_FLOOR * l->level[j] > CHAIN_LEAST);
        l->bristle_on[j] = any_of(on);
        l->level[j] = choose(on, l->level[j], pack_of(1.0));
        l->stiffness[j] = only(on, l->stiffness[j]);
    }
}

/* As chain_prepare(). */
static void chain_pack_prepare(const chain_lanes *l, pack h, pack v, int first, chain_pack_step *s)
{
    const pack *c = l->c, q = l->q, floor = pack_of(CHAIN_FLOOR), none = pack_of(0.0);
    const pack gain = 1.0 + q * (c[CH_POSITION] + q * c[CH_CURVATURE]);
    const pack_mask open = (pack_mask)(gain > CHAIN_FLOOR);
    s->h = h;
    s->v = v;
    s->e = l->play - q;
    s->cavity = l->some_cavity && !first;
    s->per_h = s->charge = s->charge_slope = s->charge_curvature = none;
    if (s->cavity) {
        const pack left = greater_of(1.0 - l->cavity * l->per[CH_CAVITY_LENGTH], floor), per = l->per[CH_CAVITY_LENGTH] / left;
        s->per_h = only(l->cavity_on, 1.0 / h);
        s->charge = c[CH_CAVITY] * exp_of(-GAS_EXPONENT * log_of(left));
        s->charge_slope = GAS_EXPONENT * s->charge * per;
        s->charge_curvature = (GAS_EXPONENT + 1.0) * s->charge_slope * per;
    }
    s->gain = choose(open, gain, floor);
    s->gain_slope = only(open, c[CH_POSITION] + 2.0 * q * c[CH_CURVATURE]);
    s->rest = c[C_OFFSET] + c[C_STIFFNESS] * q;
    s->rest_slope = c[C_STIFFNESS];
    s->gas_curvature = s->gas_unit = s->gas_per = none;
    if (l->some_gas) {
        const pack room = greater_of(1.0 + q * l->per[CH_GAS_LENGTH], floor);
        s->gas_unit = exp_of(-GAS_EXPONENT * log_of(room));
        s->gas_per = l->per[CH_GAS_LENGTH] / room;
        const pack gas = c[CH_GAS] * s->gas_unit, slope = GAS_EXPONENT * gas * s->gas_per;
        s->rest += gas;
        s->rest_slope -= slope;
        s->gas_curvature = (GAS_EXPONENT + 1.0) * slope * s->gas_per;
    }
    s->viscoplastic = s->gain * c[CH_YIELD] * (1.0 - c[CH_SHARE]);
    s->thinning = s->gain * (c[CH_THINNING] * c[CH_YIELD] + c[CH_OWN]);
    const pack ratio = l->y * l->per[CH_FADE];
    s->fade = l->fades ? only((pack_mask)(c[CH_EXCESS] > 0.0), exp_of(-ratio * ratio)) : none;
    for (int j = 0; j < BRISTLES; j++) {
        if (!l->bristle_on[j]) continue;
        pack level = l->level[j], asymmetry = none;
        if (j < PRE_YIELD) {
            level *= s->gain;
            asymmetry = c[CH_ASYMMETRY];
        } else if (j == FRICTION_BRISTLE) level *= 1.0 + c[CH_EXCESS] * s->fade;
        s->level[0][j] = level * (1.0 - asymmetry);
        s->level[1][j] = level * (1.0 + asymmetry);
        for (int side = 0; side < 2; side++) s->rate[side][j] = l->stiffness[j] * h / s->level[side][j];
    }
}

/* As chain_rise() and chain_yield(). */
IN_LANES void chain_pack_yield(const chain_lanes *l, pack size, pack side, chain_pack_point *p)
{
    p->u = size * l->per_velocity;
    p->u_slope = l->per_velocity;
    if (l->some_bypass) {
        const pack yield = l->yield_velocity, b = l->bypass;
        const pack root = 2.0 * size / (b + root_of(b * b + 4.0 * yield * size));
        p->u = choose(l->bypass_on, root * root, p->u);
        p->u_slope = choose(l->bypass_on, 2.0 * root / (2.0 * yield * root + b), p->u_slope);
    }
    const pack u = p->u, decay = exp_of(-2.0 * u), t = (1.0 - decay) / (1.0 + decay);
    p->t = side * t;
    p->t_slope = 1.0 - t * t;
    if (l->knee) {
        const pack above = root_of((u + 1.0) * (u + 1.0) + CORNER * CORNER);
        const pack below = root_of((u - 1.0) * (u - 1.0) + CORNER * CORNER);
        p->sharper = side * (0.5 * (above - below) - t);
        p->t += l->c[CH_KNEE] * p->sharper;
        p->t_slope += l->c[CH_KNEE] * (0.5 * ((u + 1.0) / above - (u - 1.0) / below) - p->t_slope);
    }
    p->t = only(l->plastic, p->t);
    p->t_slope = only(l->plastic, p->t_slope);
}

/* As chain_cavity(). */
IN_LANES void chain_pack_cavity(const chain_lanes *l, const chain_pack_step *s, chain_pack_point *p)
{
    const pack bubble = l->c[CH_BUBBLE], gas = l->c[CH_CAVITY] * bubble, slope = s->charge_slope;
    const pack a = p->force + s->charge - slope * (l->cavity + bubble);
    p->by_cavity = root_of(a * a + 4.0 * slope * gas);
    p->length = choose((pack_mask)(a > 0.0), 2.0 * gas / (p->by_cavity + a), 0.5 * (p->by_cavity - a) / slope);
    p->cavity = only(l->cavity_on, p->length - bubble);
    p->cavity_slope = only(l->cavity_on, -p->length / p->by_cavity * p->force_slope);
}

/* As chain_spring() and chain_leak(); returns the sum of both. */
IN_LANES pack chain_pack_compliance(const chain_lanes *l, chain_pack_point *p)
{
    const pack *c = l->c, u = p->e - c[CH_GAP], v = p->e + c[CH_GAP], rr = c[CH_CORNER] * c[CH_CORNER];
    const pack su = root_of(u * u + rr), sv = root_of(v * v + rr);
    p->spring_slope = 0.5 * c[CH_SPRING] * (2.0 + u / su - v / sv);
    const pack spring = 0.5 * c[CH_SPRING] * (2.0 * p->e + su - sv);
    pack power = p->leak_slope = c[CH_LEAK];
    if (l->bent) {
        const pack size = size_of(p->rate) * l->per[CH_SPEED], bend = c[CH_LEAK_EXPONENT] - 1.0;
        power *= exp_of(bend * log_of(greater_of(size, pack_of(1e-6))));
        p->leak_slope = choose((pack_mask)(size > 1e-6), c[CH_LEAK_EXPONENT] * power, power);
    }
    return spring + power * p->rate;
}

/* As chain_residual(). */
IN_LANES pack chain_pack_residual(const chain_lanes *l, const chain_pack_step *s, pack y, chain_pack_point *p)
{
    const pack *c = l->c, size = size_of(y), none = pack_of(0.0);
    const pack_mask back = (pack_mask)(y < 0.0);
    const pack side = choose(back, pack_of(-1.0), pack_of(1.0)), flow = 1.0 + c[CH_FLOW_ASYMMETRY] * side;
    pack force = s->rest + s->rest_slope * s->h * y, slope = s->rest_slope * s->h;
    p->y = y;
    p->u = p->u_slope = p->t = p->t_slope = p->sharper = p->power = p->log_size = none;
    if (l->some_plastic) {
        chain_pack_yield(l, size, side, p);
        force += s->viscoplastic * (1.0 + c[CH_ASYMMETRY] * p->t) * p->t;
        slope += s->viscoplastic * (1.0 + 2.0 * c[CH_ASYMMETRY] * p->t) * p->t_slope * p->u_slope;
    }
    if (l->thinning) {
        const pack least = greater_of(size, pack_of(1e-200));
        const pack_mask thins = (pack_mask)(s->thinning > 0.0) & (pack_mask)(size > 0.0);
        p->log_size = log_of(least * l->per[CH_SPEED]);
        const pack power = only(thins, flow * exp_of(c[CH_EXPONENT] * p->log_size));
        p->power = side * power;
        force += s->thinning * p->power;
        slope += s->thinning * c[CH_EXPONENT] * power / least;
    }
    force += c[CH_ORIFICE] * flow * size * y;
    slope += 2.0 * c[CH_ORIFICE] * flow * size;
    for (int j = 0; j < BRISTLES; j++) {
        if (!l->bristle_on[j]) continue;
        const pack level = choose(back, -s->level[0][j], s->level[1][j]), rate = choose(back, s->rate[0][j], s->rate[1][j]);
        const pack u = rate * size, kept = 1.0 / (1.0 + u + 0.5 * u * u), away = l->bristle[j] - level;
        p->kept[j] = kept;
        p->bristle[j] = level + away * kept;
        p->bristle_slope[j] = -away * (1.0 + u) * kept * kept * rate * side;
        force += p->bristle[j];
        slope += p->bristle_slope[j];
    }
    p->force = force;
    p->force_slope = slope;
    p->cavity = l->cavity;
    p->cavity_slope = p->length = p->by_cavity = none;
    if (s->cavity) chain_pack_cavity(l, s, p);
    p->e = s->e - s->h * y + p->cavity;
    p->rate = s->v - y + s->per_h * (p->cavity - l->cavity);
    const pack compliance = chain_pack_compliance(l, p);
    p->slope = slope + p->spring_slope * (s->h - p->cavity_slope) + p->leak_slope * (1.0 - s->per_h * p->cavity_slope);
    return force - compliance;
}

/* Solve the step; the last Newton step as in chain_finish(). */
static void chain_pack_solve(const chain_lanes *l, const chain_pack_step *s, pack guess, chain_pack_point *p)
{
    lane_search find;
    pack_mask ask;
    search_begin(guess, 0.01 * l->yield_velocity, &find);
    for (int i = 0; i < 100; i++) {
        const pack residual = chain_pack_residual(l, s, find.sign * find.p, p);
        const pack near = 1e-7 * (s->viscoplastic + size_of(p->force) + size_of(s->rest));
        if (!search_on(&find, residual, p->slope, near, &ask)) break;
        if (!any_of(ask)) continue;
        chain_pack_point rest;
        search_turn(&find, ask, chain_pack_residual(l, s, pack_of(0.0), &rest));
    }
    const pack dy = find.last;
    p->y += dy;
    p->force += p->force_slope * dy;
    p->cavity += p->cavity_slope * dy;
    p->e -= (s->h - p->cavity_slope) * dy;
    p->rate -= (1.0 - s->per_h * p->cavity_slope) * dy;
    for (int j = 0; j < BRISTLES; j++)
        if (l->bristle_on[j]) p->bristle[j] += p->bristle_slope[j] * dy;
}

/* As chain_bristle_partials(). */
IN_LANES void chain_pack_bristle(chain_lanes *l, const chain_pack_step *s, const chain_pack_point *p, int j)
{
    const pack *c = l->c, *per = l->per, none = pack_of(0.0);
    const pack_mask back = (pack_mask)(p->y < 0.0);
    const pack side = choose(back, pack_of(-1.0), pack_of(1.0)), level = choose(back, s->level[0][j], s->level[1][j]);
    const pack u = choose(back, s->rate[0][j], s->rate[1][j]) * size_of(p->y), kept = p->kept[j];
    const pack fall = -(l->bristle[j] - side * level) * (1.0 + u) * kept * kept * u;
    const pack by_level = side * (1.0 - kept) - fall / level;
    chain_pack_partials *d = &l->partials;
    pack *by = d->bristle[j];
    d->bristle_by_travel[j] = none;
    if (j == MEMORY_BRISTLE) {
        by[CH_MEMORY] = by_level;
        by[CH_MEMORY_STIFFNESS] = fall * per[CH_MEMORY_STIFFNESS];
    } else if (j == FRICTION_BRISTLE) {
        const pack by_fade = by_level * c[CH_FRICTION] * c[CH_EXCESS] * s->fade, ratio = l->y * per[CH_FADE];
        by[CH_FRICTION] = by_level * level * per[CH_FRICTION];
        by[CH_EXCESS] = by_level * c[CH_FRICTION] * s->fade;
        by[CH_FRICTION_STIFFNESS] = fall * per[CH_FRICTION_STIFFNESS];
        by[CH_FADE] = by_fade * 2.0 * ratio * ratio * per[CH_FADE];
        d->friction_by_speed = -2.0 * by_fade * ratio * per[CH_FADE];
    } else {
        const pack_mask moving = (pack_mask)(s->gain_slope != 0.0) | (pack_mask)(s->gain > CHAIN_FLOOR);
        const pack by_gain = by_level * level / s->gain;
        by[CH_YIELD] = by_level * level * per[CH_YIELD];
        by[CH_SHARE] = by_level * level * per[CH_SHARE];
        by[CH_ASYMMETRY] = by_level * l->level[j] * s->gain * side;
        by[CH_BRISTLE] = fall * per[CH_BRISTLE];
        by[CH_SPREAD] = fall * CHAIN_APART[j];
        d->bristle_by_travel[j] = by_gain * s->gain_slope;
        by[CH_POSITION] = only(moving, by_gain * l->q);
        by[CH_CURVATURE] = by[CH_POSITION] * l->q;
    }
}

/* The valve's part of chain_partials_at(). */
static void chain_pack_valve(chain_lanes *l, const chain_pack_step *s, const chain_pack_point *p)
{
    const pack *c = l->c, *per = l->per, q = l->q, none = pack_of(0.0);
    const pack yielded = (1.0 + c[CH_ASYMMETRY] * p->t) * p->t, ahead = s->h * p->y;
    const pack shaped = (s->viscoplastic * yielded + s->thinning * p->power) / s->gain;
    const pack_mask moving = (pack_mask)(s->gain_slope != 0.0) | (pack_mask)(s->gain > CHAIN_FLOOR);
    const pack flow = 1.0 + choose((pack_mask)(p->y < 0.0), -c[CH_FLOW_ASYMMETRY], c[CH_FLOW_ASYMMETRY]);
    chain_pack_partials *d = &l->partials;
    pack *by = d->valve;
    d->by_travel = s->rest_slope + s->gas_curvature * ahead + shaped * s->gain_slope;
    by[C_OFFSET] = pack_of(1.0);
    by[C_STIFFNESS] = q + ahead;
    by[CH_SHARE] = -s->gain * c[CH_YIELD] * yielded;
    by[CH_THINNING] = s->gain * c[CH_YIELD] * p->power;
    by[CH_OWN] = s->gain * p->power;
    by[CH_EXPONENT] = s->thinning * p->power * p->log_size;
    by[CH_SPEED] = -s->thinning * p->power * c[CH_EXPONENT] * per[CH_SPEED];
    by[CH_ORIFICE] = flow * size_of(p->y) * p->y;
    by[CH_FLOW_ASYMMETRY] = s->thinning * size_of(p->power) / flow + c[CH_ORIFICE] * p->y * p->y;
    by[CH_ASYMMETRY] = s->viscoplastic * p->t * p->t;
    const pack by_rise = s->viscoplastic * (1.0 + 2.0 * c[CH_ASYMMETRY] * p->t), slow = by_rise * p->t_slope * p->u_slope * p->u;
    by[CH_KNEE] = by_rise * p->sharper;
    by[CH_VELOCITY] = choose((pack_mask)(p->y < 0.0), slow, -slow);
    by[CH_CREEP] = by[CH_VELOCITY] * c[CH_YIELD];
    by[CH_YIELD] = s->gain * ((1.0 - c[CH_SHARE]) * yielded + c[CH_THINNING] * p->power) + by[CH_VELOCITY] * c[CH_CREEP];
    const pack by_bypass = choose((pack_mask)(p->u > 0.0), by[CH_VELOCITY] / root_of(p->u), none);
    by[CH_BYPASS] = by_bypass * root_of(c[CH_YIELD]);
    by[CH_YIELD] += by_bypass * 0.5 * l->bypass * per[CH_YIELD];
    by[CH_POSITION] = only(moving, shaped * q);
    by[CH_CURVATURE] = by[CH_POSITION] * q;
    if (!l->some_gas) return;
    const pack room = per[CH_GAS_LENGTH] / s->gas_per, fall = GAS_EXPONENT * s->gas_per;
    by[CH_GAS] = only(l->gas_on, s->gas_unit * (1.0 - fall * ahead));
    by[CH_GAS_LENGTH] = only(l->gas_on, c[CH_GAS] * s->gas_unit * fall * per[CH_GAS_LENGTH]
                             * (q + ahead * (1.0 - (GAS_EXPONENT + 1.0) * q * per[CH_GAS_LENGTH] / room)));
}

/* As chain_partials_at(). */
static void chain_pack_partials_at(chain_lanes *l, const chain_pack_step *s, const chain_pack_point *p)
{
    const pack *c = l->c, *per = l->per;
    chain_pack_partials *d = &l->partials;
    chain_pack_valve(l, s, p);
    if (s->cavity) {
        const pack z = l->cavity;
        d->charge[CH_CAVITY] = s->charge * per[CH_CAVITY];
        d->charge_slope[CH_CAVITY] = s->charge_slope * per[CH_CAVITY];
        d->charge[CH_CAVITY_LENGTH] = -s->charge_slope * z * per[CH_CAVITY_LENGTH];
        d->charge_slope[CH_CAVITY_LENGTH] = -(s->charge_slope + s->charge_curvature * z) * per[CH_CAVITY_LENGTH];
    }
    for (int j = 0; j < BRISTLES; j++)
        if (l->bristle_on[j]) chain_pack_bristle(l, s, p, j);
    const pack u = p->e - c[CH_GAP], v = p->e + c[CH_GAP], rr = c[CH_CORNER] * c[CH_CORNER];
    const pack su = root_of(u * u + rr), sv = root_of(v * v + rr), per_u = 1.0 / su, per_v = 1.0 / sv;
    pack *by = d->compliance;
    by[CH_SPRING] = 0.5 * (2.0 * p->e + su - sv);
    by[CH_GAP] = -0.5 * c[CH_SPRING] * (u * per_u + v * per_v);
    by[CH_CORNER] = 0.5 * c[CH_SPRING] * c[CH_CORNER] * (per_u - per_v);
    const pack of = log_of(greater_of(size_of(p->rate) * per[CH_SPEED], pack_of(1e-6))), bend = c[CH_LEAK_EXPONENT] - 1.0;
    by[CH_LEAK] = l->bent ? p->rate * exp_of(bend * of) : p->rate;
    by[CH_LEAK_EXPONENT] = c[CH_LEAK] * by[CH_LEAK] * of;
    by[CH_SPEED] = -bend * c[CH_LEAK] * by[CH_LEAK] * per[CH_SPEED];
}

/* As chain_cavity_moved(). */
IN_LANES pack chain_pack_moved(const chain_lanes *l, const chain_pack_step *s, const chain_pack_point *p, int k, pack before,
                               pack force)
{
    const pack *c = l->c, none = pack_of(0.0), one = pack_of(1.0);
    const pack bubble = k == CH_BUBBLE ? one : none, limit = k == CH_CAVITY ? one : none;
    const pack slope = l->partials.charge_slope[k] + s->charge_curvature * before;
    const pack gas = c[CH_BUBBLE] * limit + c[CH_CAVITY] * bubble;
    const pack sum = force + l->partials.charge[k] - s->charge_slope * bubble + slope * (p->cavity - l->cavity);
    return only(l->cavity_on, (gas - p->length * sum) / p->by_cavity - bubble);
}

/* As chain_differentiate(). */
static void chain_pack_differentiate(chain_lanes *l, const chain_pack_step *s, const chain_pack_point *p, size_t ways,
                                     const int *way, double *const *column)
{
    const chain_pack_partials *d = &l->partials;
    const pack by_residual = -1.0 / p->slope, none = pack_of(0.0);
    for (size_t w = 0; w < ways; w++) {
        const int k = way[w];
        const pack q = l->q_by[w], was = l->cavity_by[w], play = k == CH_PLAY ? l->play_by : none;
        pack force = d->valve[k] + d->by_travel * q, bristle[BRISTLES], cavity = was;
        for (int j = 0; j < BRISTLES; j++) {
            if (!l->bristle_on[j]) continue;
            bristle[j] = d->bristle[j][k] + p->kept[j] * l->bristle_by[j][w] + d->bristle_by_travel[j] * q;
            if (j == FRICTION_BRISTLE) bristle[j] += d->friction_by_speed * l->y_by[w];
            force += bristle[j];
        }
        if (s->cavity) cavity = chain_pack_moved(l, s, p, k, was, force);
        const pack residual = force - d->compliance[k] - p->spring_slope * (play - q + cavity)
                            - p->leak_slope * s->per_h * (cavity - was);
        const pack y = by_residual * residual, total = force + p->force_slope * y;
        for (int j = 0; j < BRISTLES; j++)
            if (l->bristle_on[j]) l->bristle_by[j][w] = bristle[j] + p->bristle_slope[j] * y;
        l->q_by[w] = q + s->h * y;
        l->cavity_by[w] = cavity + p->cavity_slope * y;
        l->y_by[w] = y;
        if (column) memcpy(column[w], &total, sizeof total);
    }
}

/* One step of length h to (x, v), of the first sample h = 0: as chain_play() and chain_advance(). */
static void chain_pack_advance(chain_lanes *l, int first, pack h, pack x, pack v, size_t ways, const int *way, double *force,
                               double *const *column)
{
    chain_pack_step s;
    chain_pack_point p;
    const pack half = l->c[CH_PLAY], ahead = x - l->play;
    const pack side = choose((pack_mask)(ahead < 0.0), pack_of(-1.0), pack_of(1.0));
    const pack_mask along = (pack_mask)(size_of(ahead) >= half);
    l->play = choose(along, x - side * half, l->play);
    l->play_by = choose(along, -side, l->play_by);
    chain_pack_prepare(l, h, only(along, v), first, &s);
    chain_pack_solve(l, &s, first ? only(along, v) : l->y + h * l->y_rate, &p);
    if (ways) {
        chain_pack_partials_at(l, &s, &p);
        chain_pack_differentiate(l, &s, &p, ways, way, column);
    }
    for (int j = 0; j < BRISTLES; j++)
        if (l->bristle_on[j]) l->bristle[j] = p.bristle[j];
    if (!first) l->y_rate = (p.y - l->y) / h;
    l->y = p.y;
    l->q += h * p.y;
    l->cavity = p.cavity;
    memcpy(force, &p.force, sizeof p.force);
}

/* The first sample: the valve in the middle of its travel. */
static void chain_lanes_first(chain_lanes *l, pack x, pack v, size_t ways, const int *way, double *force,
                              double *const *column)
{
    l->q = l->play = x;
    chain_pack_advance(l, 1, pack_of(0.0), x, v, ways, way, force, column);
}

/* From one sample to the next: x and v of both [m, m/s]; force and columns at the second. */
static void chain_lanes_step(chain_lanes *l, size_t substeps, const pack x[2], const pack v[2], size_t ways, const int *way,
                             double *force, double *const *column)
{
    const pack h = l->step / (double)substeps, d0 = v[0] * l->step, d1 = v[1] * l->step;
    const pack c2 = 3.0 * (x[1] - x[0]) - 2.0 * d0 - d1, c3 = d0 + d1 - 2.0 * (x[1] - x[0]);
    for (size_t j = 1; j <= substeps; j++) {
        const double share = (double)j / (double)substeps;
        const pack at_x = x[0] + share * (d0 + share * (c2 + share * c3));
        const pack at_v = (d0 + share * (2.0 * c2 + share * 3.0 * c3)) / l->step;
        chain_pack_advance(l, 0, h, at_x, at_v, ways, way, force, j == substeps ? column : NULL);
    }
}
