/* The chain: free play, elasticity and dashpot in series with a valve. Every term is disabled at its default.
 *
 * xb follows x with a free play of half width b; e + q - z = xb, y = q', z is the cavity. All elements have the
 * same force:
 *
 *     F = S(e) + cB |e'/v0|^(mB-1) e'                                            compliance.c
 *     F = C l/(l + z) - H, H = C (1 - z/L)^-1.3                                   cavity
 *     F = f0 + k0 q + Fg (1 + q/Lg)^-1.3                                         offset, spring, gas
 *       + G Y (1 - phi) (1 + as t) t                                             viscoplastic yield
 *       + (1 + af sgn y) (G (rK Y + K) |y/v0|^m sgn y + cq |y| y)                shear thinning, orifice
 *       + f1 + f2 + f3 + f4 + f5                                                 bristles: pre-yield, friction, memory
 *     G = 1 + b1 q + b2 q^2;  t = (1 - w) tanh u + w C(u), C a straight line to a corner at 1
 *     y = (v1 + mu Y) u + bp (Y u / (1 + af sgn y))^1/2                           creep, and flow through a bypass
 *
 * The cavity (L > 0; otherwise z = 0): H is the force of the gas charge of length L on the piston. The chamber
 * that the valve fills during retraction contains free gas, which has the length l at the pressure of the charge.
 * The free gas keeps the force above zero. If the valve is too slow, the cavity z opens at the force of the
 * charge, and it closes before the force builds up again. Charge and free gas are springs in z with the stored
 * energy C L (1 - z/L)^-0.3 / 0.3 - C l ln(l + z), hence the cavity is passive.
 *
 * A bristle is a force f with f' = sigma (y - |y| f / level). Its stiffness sigma does not depend on position or
 * speed, so that f^2 / (2 sigma) is stored and the rest is dissipated. A bristle is therefore passive for any
 * change of the level. The levels of the three pre-yield bristles are phi G Y (1 + as sgn y) times 1/2, 1/4, 1/4
 * (with the relative stiffness 1, e^spread, e^-spread). The level of the friction bristle is the friction force
 * times 1 + excess exp(-(y/fade)^2), and the level of the memory bristle is the memory force. If the current
 * changes Y, the fraction `follow` of the bristle force changes immediately. Travel builds up the rest.
 *
 * A step is backward Euler in y. A rational function with two terms replaces the exponential of a bristle. G and the
 * Stribeck level have their values before the step, the gas force is linearised, and z solves a quadratic equation.
 * The residual increases with y.
 *
 * The coefficients of a disabled term are zero, so that few masks are needed. A term that is disabled in all lanes is
 * skipped.
 */

#define CHAIN_STEP_RATIO 0.68 /* longest step / longest step of other laws; backward Euler needs shorter steps */
#define CHAIN_FLOOR 0.02  /* minimum of G, and of the gas volume divided by its volume at q = 0 */
#define GAS_EXPONENT 1.3
#define CORNER 0.05 /* rounding of the corner of C */
#define CHAIN_RATE_MAX 1e25 /* maximum relaxation in a step, so that a product of inverses does not overflow */
#define CHAIN_LEAST 1e-100 /* minimum level of a bristle [N]; the rate of a smaller level would overflow */

enum { PRE_YIELD = 3, FRICTION_BRISTLE = 3, MEMORY_BRISTLE = 4, BRISTLES = 5 };

static const double CHAIN_SHARE[PRE_YIELD] = {0.5, 0.25, 0.25}, CHAIN_APART[PRE_YIELD] = {0.0, 1.0, -1.0};

/* Coefficients and state of PACK lanes. A disabled bristle has a level but no stiffness, hence no force. */
typedef struct {
    pack c[CH_COUNT], per[CH_COUNT]; /* coefficients and their inverses; 0 is the inverse of a value near zero */
    pack yield_velocity, per_velocity, level[BRISTLES], per_level[BRISTLES], stiffness[BRISTLES];
    pack per_side[2], bypass[2]; /* 1 / (1 + as sgn y), bp (Y / (1 + af sgn y))^1/2; for retraction and extension */
    compliance compliance;
    pack_mask plastic, cavity_on, bypass_on, gas_on;
    int some_plastic, some_cavity, some_bypass, some_gas, thins, knee, fades, bristle_on[BRISTLES];
    pack q, y;                /* valve travel and velocity */
    pack lag, change, bend;   /* v - y after the last step, its first and second difference, for the next start value */
    pack play, cavity;        /* displacement behind the free play, cavity z */
    pack bristle[BRISTLES];
    pack followed[2];         /* yield and memory force at the last step */
} chain_state;

/* Constants of the equation of a step. `rate` is the relaxation rate of a bristle divided by |y|. The first index of
 * `level` and `rate` is 0 for retraction and 1 for extension. */
typedef struct {
    pack h, v, e;             /* step, velocity behind the free play, elastic travel at y = z = 0 */
    pack per_h;               /* inverse of the step, 0 if there is no cavity */
    pack charge, charge_slope, charge_curvature; /* H, dH/dz, d2H/dz2 */
    pack gain, per_gain, gain_slope;
    pack rest, rest_slope;    /* force of offset, spring and gas at y = 0, and d force / d travel */
    pack gas_curvature, gas_unit, gas_per;
    pack viscoplastic, thinning; /* factors of these terms, without their functions of y */
    pack fade;
    pack level[2][BRISTLES], per_level[2][BRISTLES], rate[2][BRISTLES];
    int cavity;
} chain_step;

/* Terms of the equation at one y. */
typedef struct {
    pack y, force, slope, force_slope;
    pack u, u_slope;          /* u, du/d|y| */
    pack decay;               /* exp(-2 u) */
    pack t, t_slope, sharper; /* t (rise of the yield force), dt/du, C - tanh u */
    pack power, log_size;     /* thinning power, ln |y/v0| */
    compliance_point k;
    pack cavity, length, cavity_slope, by_cavity; /* z, l + z, dz/dy, d/dz of the equation of z */
    pack bristle[BRISTLES], bristle_slope[BRISTLES], kept[BRISTLES];
    pack relaxed[BRISTLES];   /* relaxation rate times step; 1 / kept = 1 + relaxed + relaxed^2 / 2 */
} chain_point;

/* Partial derivatives with respect to each coefficient, for fixed y and fixed states before the step. Entries that a
 * step does not write are zero. */
typedef struct {
    pack valve[CH_COUNT], compliance[CH_COUNT], bristle[BRISTLES][CH_COUNT];
    pack by_travel, bristle_by_travel[BRISTLES], friction_by_speed;
    pack charge[CH_COUNT], charge_slope[CH_COUNT]; /* partial derivatives of H and of dH/dz */
} chain_partials;

/* Derivatives of the state along each direction. */
typedef struct {
    pack q[WAYS_MAX], y[WAYS_MAX], play[WAYS_MAX], cavity[WAYS_MAX], bristle[BRISTLES][WAYS_MAX];
} chain_tangents;

typedef struct {
    chain_state at;
    chain_partials partials;
    chain_tangents by;
} chain_lanes;

/* Compute the constants that depend only on the coefficients. */
static void chain_set(chain_state *l)
{
    const pack *c = l->c;
    for (int k = 0; k < CH_COUNT; k++) l->per[k] = only(is_less(pack_of(CHAIN_LEAST), size_of(c[k])), 1.0 / c[k]);
    l->plastic = is_positive(c[CH_YIELD] * (1.0 - c[CH_SHARE]));
    l->cavity_on = is_positive(c[CH_CAVITY_LENGTH]);
    l->bypass_on = is_positive(c[CH_BYPASS]);
    l->gas_on = not_of(is_equal(c[CH_GAS], pack_of(0.0)));
    l->some_plastic = any_of(l->plastic);
    l->some_cavity = any_of(l->cavity_on);
    l->some_bypass = any_of(l->bypass_on);
    l->some_gas = any_of(l->gas_on);
    l->thins = some_lane(c[CH_THINNING]) || some_lane(c[CH_OWN]);
    l->knee = some_lane(c[CH_KNEE]);
    l->fades = some_lane(c[CH_EXCESS]);
    l->compliance = compliance_of(c + CH_SPRING, l->per[CH_SPEED]);
    l->yield_velocity = c[CH_VELOCITY] + c[CH_CREEP] * c[CH_YIELD];
    l->per_velocity = only(is_less(pack_of(CHAIN_LEAST), l->yield_velocity), 1.0 / l->yield_velocity);
    for (int side = 0; side < 2; side++) {
        const pack flow = 1.0 + (2.0 * side - 1.0) * c[CH_FLOW_ASYMMETRY];
        l->bypass[side] = l->some_bypass ? only(l->bypass_on, c[CH_BYPASS] * root_of(c[CH_YIELD] / flow)) : pack_of(0.0);
    }
    const pack apart = some_lane(c[CH_SPREAD]) ? exp_of(c[CH_SPREAD]) : pack_of(1.0);
    const pack stiff[PRE_YIELD] = {c[CH_BRISTLE], c[CH_BRISTLE] * apart, c[CH_BRISTLE] / apart};
    for (int j = 0; j < PRE_YIELD; j++) {
        l->level[j] = CHAIN_SHARE[j] * c[CH_YIELD] * c[CH_SHARE];
        l->stiffness[j] = CHAIN_SHARE[j] * stiff[j];
    }
    for (int side = 0; side < 2; side++) l->per_side[side] = 1.0 / (1.0 + (2.0 * side - 1.0) * c[CH_ASYMMETRY]);
    l->level[FRICTION_BRISTLE] = c[CH_FRICTION];
    l->stiffness[FRICTION_BRISTLE] = c[CH_FRICTION_STIFFNESS];
    l->level[MEMORY_BRISTLE] = c[CH_MEMORY];
    l->stiffness[MEMORY_BRISTLE] = c[CH_MEMORY_STIFFNESS];
    for (int j = 0; j < BRISTLES; j++) {
        const pack_mask on = is_less(pack_of(CHAIN_LEAST), CHAIN_FLOOR * l->level[j]);
        l->bristle_on[j] = any_of(on);
        l->level[j] = choose(on, l->level[j], pack_of(1.0));
        l->per_level[j] = 1.0 / l->level[j];
        l->stiffness[j] = only(on, l->stiffness[j]);
    }
}

/* Compute the constants of a step of length h. At its end, the velocity behind the free play is v. */
static void chain_prepare(const chain_state *l, pack h, pack v, int first, chain_step *s)
{
    const pack *c = l->c, q = l->q, floor = pack_of(CHAIN_FLOOR), none = pack_of(0.0);
    const pack gain = 1.0 + q * (c[CH_POSITION] + q * c[CH_CURVATURE]);
    const pack_mask open = is_less(floor, gain);
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
    s->per_gain = 1.0 / s->gain;
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
    s->fade = none;
    if (l->fades) {
        const pack ratio = l->y * l->per[CH_FADE];
        s->fade = only(is_positive(c[CH_EXCESS]), exp_of(-ratio * ratio));
    }
    for (int j = 0; j < BRISTLES; j++) {
        if (!l->bristle_on[j]) continue;
        for (int side = 0; side < 2; side++) {
            s->level[side][j] = l->level[j];
            s->per_level[side][j] = l->per_level[j];
            if (j < PRE_YIELD) {
                s->level[side][j] *= s->gain * (1.0 + (2.0 * side - 1.0) * c[CH_ASYMMETRY]);
                s->per_level[side][j] *= s->per_gain * l->per_side[side];
            } else if (j == FRICTION_BRISTLE && l->fades) {
                const pack size = 1.0 + c[CH_EXCESS] * s->fade;
                s->level[side][j] *= size;
                s->per_level[side][j] *= 1.0 / size;
            }
            s->rate[side][j] = l->stiffness[j] * h * s->per_level[side][j];
        }
    }
}

/* Compute u(|y|). */
IN_LANES void chain_flow(const chain_state *l, pack size, pack_mask back, chain_point *p)
{
    p->u = size * l->per_velocity;
    p->u_slope = l->per_velocity;
    if (l->some_bypass) {
        const pack yield = l->yield_velocity, b = choose(back, l->bypass[0], l->bypass[1]);
        const pack root = 2.0 * size / (b + root_of(b * b + 4.0 * yield * size));
        p->u = choose(l->bypass_on, root * root, p->u);
        p->u_slope = choose(l->bypass_on, 2.0 * root / (2.0 * yield * root + b), p->u_slope);
    }
    p->decay = exp_of(-2.0 * p->u);
}

/* Compute the rise t of the yield force. `per_sum` is 1 / (1 + decay). */
IN_LANES void chain_yield(const chain_state *l, pack per_sum, pack side, chain_point *p)
{
    const pack u = p->u, t = (1.0 - p->decay) * per_sum;
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

/* Compute the cavity z from the force of the valve: F + H + H' (z - z_before) = C l / (l + z), quadratic in l + z. */
IN_LANES void chain_cavity(const chain_state *l, const chain_step *s, chain_point *p)
{
    const pack bubble = l->c[CH_BUBBLE], gas = l->c[CH_CAVITY] * bubble, slope = s->charge_slope;
    const pack a = p->force + s->charge - slope * (l->cavity + bubble);
    p->by_cavity = root_of(a * a + 4.0 * slope * gas);
    p->length = choose(is_positive(a), 2.0 * gas / (p->by_cavity + a), 0.5 * (p->by_cavity - a) / slope);
    p->cavity = only(l->cavity_on, p->length - bubble);
    p->cavity_slope = only(l->cavity_on, -p->length / p->by_cavity * p->force_slope);
}

/* Return the force of the valve minus the force of the compliance at y, which increases with y. */
IN_LANES pack chain_residual(const chain_state *l, const chain_step *s, pack y, chain_point *p)
{
    const pack *c = l->c, size = size_of(y), none = pack_of(0.0);
    const pack_mask back = is_less(y, none);
    const pack side = choose(back, pack_of(-1.0), pack_of(1.0)), flow = 1.0 + c[CH_FLOW_ASYMMETRY] * side;
    pack force = s->rest + s->rest_slope * s->h * y, slope = s->rest_slope * s->h;
    p->y = y;
    p->u = p->u_slope = p->t = p->t_slope = p->sharper = p->power = p->log_size = none;
    if (l->some_plastic) {
        chain_flow(l, size, back, p);
        chain_yield(l, 1.0 / (1.0 + p->decay), side, p);
        force += s->viscoplastic * (1.0 + c[CH_ASYMMETRY] * p->t) * p->t;
        slope += s->viscoplastic * (1.0 + 2.0 * c[CH_ASYMMETRY] * p->t) * p->t_slope * p->u_slope;
    }
    if (l->thins) {
        p->log_size = log_of(greater_of(size, pack_of(1e-200)) * l->per[CH_SPEED]);
        const pack ratio = exp_of((c[CH_EXPONENT] - 1.0) * p->log_size) * l->per[CH_SPEED]; /* |y/v0|^m / |y| */
        const pack per_size = only(both(is_positive(s->thinning), is_positive(size)), flow * ratio);
        p->power = per_size * y;
        force += s->thinning * p->power;
        slope += s->thinning * c[CH_EXPONENT] * per_size;
    }
    force += c[CH_ORIFICE] * flow * size * y;
    slope += 2.0 * c[CH_ORIFICE] * flow * size;
    for (int j = 0; j < BRISTLES; j++) {
        if (!l->bristle_on[j]) continue;
        const pack level = choose(back, -s->level[0][j], s->level[1][j]), rate = choose(back, s->rate[0][j], s->rate[1][j]);
        const pack u = rate * size, kept = 1.0 / (1.0 + u + 0.5 * u * u), away = l->bristle[j] - level;
        p->kept[j] = kept;
        p->relaxed[j] = u;
        p->bristle[j] = level + away * kept;
        p->bristle_slope[j] = -away * (1.0 + u) * kept * kept * rate * side;
        force += p->bristle[j];
        slope += p->bristle_slope[j];
    }
    p->force = force;
    p->force_slope = slope;
    p->cavity = l->cavity;
    p->cavity_slope = p->length = p->by_cavity = none;
    if (s->cavity) chain_cavity(l, s, p);
    p->k.e = s->e - s->h * y + p->cavity;
    p->k.rate = s->v - y + s->per_h * (p->cavity - l->cavity);
    const pack elastic = compliance_force(&l->compliance, &p->k);
    p->slope = slope + p->k.spring_slope * (s->h - p->cavity_slope) + p->k.leak_slope * (1.0 - s->per_h * p->cavity_slope);
    return force - elastic;
}

/* Solve the equation of the step for y. */
static void chain_solve(const chain_state *l, const chain_step *s, pack guess, chain_point *p)
{
    lane_search find;
    pack_mask ask;
    search_begin(guess, 0.01 * l->yield_velocity, &find);
    for (int i = 0; i < SEARCH_STEPS_MAX; i++) {
        const pack residual = chain_residual(l, s, find.sign * find.p, p);
        const pack near = SEARCH_TOLERANCE * (s->viscoplastic + size_of(p->force) + size_of(s->rest));
        if (!search_on(&find, residual, p->slope, near, &ask)) break;
        if (!any_of(ask)) continue;
        chain_point rest;
        search_turn(&find, ask, chain_residual(l, s, pack_of(0.0), &rest));
    }
    /* Take one more Newton step without a new evaluation. The remaining error is the square of this step. */
    const pack dy = find.last;
    p->y += dy;
    p->force += p->force_slope * dy;
    p->cavity += p->cavity_slope * dy;
    p->k.e -= (s->h - p->cavity_slope) * dy;
    p->k.rate -= (1.0 - s->per_h * p->cavity_slope) * dy;
    for (int j = 0; j < BRISTLES; j++)
        if (l->bristle_on[j]) p->bristle[j] += p->bristle_slope[j] * dy;
}

/* Compute the partial derivatives of a bristle force with respect to the coefficients of its level and stiffness. */
IN_LANES void chain_bristle_partials(const chain_state *l, const chain_step *s, const chain_point *p, int j, chain_partials *d)
{
    const pack *c = l->c, *per = l->per, none = pack_of(0.0);
    const pack_mask back = is_less(p->y, none);
    const pack side = choose(back, pack_of(-1.0), pack_of(1.0)), level = choose(back, s->level[0][j], s->level[1][j]);
    const pack per_level = choose(back, s->per_level[0][j], s->per_level[1][j]), u = p->relaxed[j], kept = p->kept[j];
    const pack fall = -(l->bristle[j] - side * level) * (1.0 + u) * kept * kept * u;
    const pack by_level = side * (1.0 - kept) - fall * per_level;
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
        const pack_mask moving = either(not_of(is_equal(s->gain_slope, none)), is_less(pack_of(CHAIN_FLOOR), s->gain));
        const pack by_gain = by_level * level * s->per_gain;
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

/* Compute the partial derivatives of the valve force without bristles. */
static void chain_valve_partials(const chain_state *l, const chain_step *s, const chain_point *p, chain_partials *d)
{
    const pack *c = l->c, *per = l->per, q = l->q, none = pack_of(0.0);
    const pack_mask back = is_less(p->y, none);
    const pack yielded = (1.0 + c[CH_ASYMMETRY] * p->t) * p->t, ahead = s->h * p->y;
    const pack shaped = (s->viscoplastic * yielded + s->thinning * p->power) * s->per_gain;
    const pack_mask moving = either(not_of(is_equal(s->gain_slope, none)), is_less(pack_of(CHAIN_FLOOR), s->gain));
    const pack flow = 1.0 + choose(back, -c[CH_FLOW_ASYMMETRY], c[CH_FLOW_ASYMMETRY]);
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
    by[CH_VELOCITY] = choose(back, slow, -slow);
    by[CH_CREEP] = by[CH_VELOCITY] * c[CH_YIELD];
    by[CH_YIELD] = s->gain * ((1.0 - c[CH_SHARE]) * yielded + c[CH_THINNING] * p->power) + by[CH_VELOCITY] * c[CH_CREEP];
    const pack by_bypass = only(is_positive(p->u), by[CH_VELOCITY] / root_of(greater_of(p->u, pack_of(1e-300))));
    const pack bypass = choose(back, l->bypass[0], l->bypass[1]);
    by[CH_BYPASS] = by_bypass * root_of(c[CH_YIELD] / flow);
    by[CH_YIELD] += by_bypass * 0.5 * bypass * per[CH_YIELD];
    const pack narrower = by_bypass * 0.5 * bypass / flow;
    by[CH_FLOW_ASYMMETRY] += choose(back, narrower, -narrower);
    by[CH_POSITION] = only(moving, shaped * q);
    by[CH_CURVATURE] = by[CH_POSITION] * q;
    if (!l->some_gas) return;
    const pack room = per[CH_GAS_LENGTH] / s->gas_per, fall = GAS_EXPONENT * s->gas_per;
    by[CH_GAS] = only(l->gas_on, s->gas_unit * (1.0 - fall * ahead));
    by[CH_GAS_LENGTH] = only(l->gas_on, c[CH_GAS] * s->gas_unit * fall * per[CH_GAS_LENGTH]
                             * (q + ahead * (1.0 - (GAS_EXPONENT + 1.0) * q * per[CH_GAS_LENGTH] / room)));
}

/* Compute the partial derivatives at the solution of a step. `l` is the state before the step. */
static void chain_partials_at(const chain_state *l, const chain_step *s, const chain_point *p, chain_partials *d)
{
    const pack *c = l->c, *per = l->per;
    chain_valve_partials(l, s, p, d);
    if (s->cavity) {
        const pack z = l->cavity;
        d->charge[CH_CAVITY] = s->charge * per[CH_CAVITY];
        d->charge_slope[CH_CAVITY] = s->charge_slope * per[CH_CAVITY];
        d->charge[CH_CAVITY_LENGTH] = -s->charge_slope * z * per[CH_CAVITY_LENGTH];
        d->charge_slope[CH_CAVITY_LENGTH] = -(s->charge_slope + s->charge_curvature * z) * per[CH_CAVITY_LENGTH];
    }
    for (int j = 0; j < BRISTLES; j++)
        if (l->bristle_on[j]) chain_bristle_partials(l, s, p, j, d);
    compliance_partials(&l->compliance, &p->k, d->compliance + CH_SPRING);
    const pack by_speed = (1.0 - c[CH_LEAK_EXPONENT]) * c[CH_LEAK] * d->compliance[CH_LEAK] * per[CH_SPEED];
    d->compliance[CH_SPEED] = only(is_bent(&l->compliance, p->k.rate), by_speed);
}

/* Return the derivative of z along a direction at fixed y. `force` is the derivative of the force, `before` is the
 * derivative of z before the step. */
IN_LANES pack chain_cavity_moved(const chain_state *l, const chain_step *s, const chain_point *p, const chain_partials *d,
                                 int k, pack seed, pack before, pack force)
{
    const pack *c = l->c, none = pack_of(0.0), bubble = k == CH_BUBBLE ? seed : none, limit = k == CH_CAVITY ? seed : none;
    const pack slope = d->charge_slope[k] * seed + s->charge_curvature * before;
    const pack gas = c[CH_BUBBLE] * limit + c[CH_CAVITY] * bubble;
    const pack sum = force + d->charge[k] * seed - s->charge_slope * bubble + slope * (p->cavity - l->cavity);
    return only(l->cavity_on, (gas - p->length * sum) / p->by_cavity - bubble);
}

/* Update the derivatives of the state after a solved step. `column` receives the derivatives of the force; it can be
 * NULL. */
static void chain_differentiate(const chain_state *l, const chain_step *s, const chain_point *p, const chain_partials *d,
                                const lane_samples *t, double fraction, chain_tangents *by, double *const *column)
{
    const pack by_residual = -1.0 / p->slope;
    for (size_t w = 0; w < t->ways; w++) {
        const int k = t->way[w];
        const pack seed = seed_between(t, w, fraction), q = by->q[w], was = by->cavity[w];
        pack force = d->valve[k] * seed + d->by_travel * q, bristle[BRISTLES], cavity = was;
        for (int j = 0; j < BRISTLES; j++) {
            if (!l->bristle_on[j]) continue;
            bristle[j] = d->bristle[j][k] * seed + p->kept[j] * by->bristle[j][w] + d->bristle_by_travel[j] * q;
            if (j == FRICTION_BRISTLE) bristle[j] += d->friction_by_speed * by->y[w];
            force += bristle[j];
        }
        if (s->cavity) cavity = chain_cavity_moved(l, s, p, d, k, seed, was, force);
        const pack residual = force - d->compliance[k] * seed - p->k.spring_slope * (by->play[w] - q + cavity)
                            - p->k.leak_slope * s->per_h * (cavity - was);
        const pack y = by_residual * residual, total = force + p->force_slope * y;
        for (int j = 0; j < BRISTLES; j++)
            if (l->bristle_on[j]) by->bristle[j][w] = bristle[j] + p->bristle_slope[j] * y;
        by->q[w] = q + s->h * y;
        by->cavity[w] = cavity + p->cavity_slope * y;
        by->y[w] = y;
        if (column) memcpy(column[w], &total, sizeof total);
    }
}

/* Change the bristle forces by the fraction that follows a change of their level immediately. */
static void chain_follow(chain_lanes *l, const lane_samples *t, double before, double fraction)
{
    const int of[2] = {CH_YIELD, CH_MEMORY}, from[2] = {0, MEMORY_BRISTLE}, to[2] = {PRE_YIELD, BRISTLES};
    chain_state *at = &l->at;
    for (int k = 0; k < 2; k++) {
        const pack now = at->c[of[k]], was = at->followed[k], ratio = now / was, excess = ratio - 1.0;
        const pack_mask moved = both(is_positive(was), not_of(is_equal(now, was)));
        at->followed[k] = now;
        if (!any_of(moved)) continue;
        const pack factor = 1.0 + at->c[CH_FOLLOW] * excess;
        for (int j = from[k]; j < to[k]; j++) {
            for (size_t w = 0; w < t->ways; w++) {
                const pack seed = seed_between(t, w, fraction), seed_was = seed_between(t, w, before);
                pack by = factor * l->by.bristle[j][w];
                if (t->way[w] == CH_FOLLOW) by += at->bristle[j] * excess * seed;
                if (t->way[w] == of[k]) by += at->bristle[j] * at->c[CH_FOLLOW] * (seed - ratio * seed_was) / was;
                l->by.bristle[j][w] = by;
            }
            at->bristle[j] *= factor;
        }
    }
}

/* Take a step of length h to (x, v) at a fraction of the sample interval. With h = 0, compute the first sample. */
static void chain_advance(chain_lanes *l, const lane_samples *t, pack h, double fraction, int first, pack x, pack v,
                          double *force, double *const *column)
{
    chain_step s;
    chain_point p;
    chain_state *at = &l->at;
    const pack half = at->c[CH_PLAY], ahead = x - at->play;
    const pack side = choose(is_less(ahead, pack_of(0.0)), pack_of(-1.0), pack_of(1.0));
    const pack_mask along = is_at_most(half, size_of(ahead));
    at->play = choose(along, x - side * half, at->play);
    v = only(along, v);
    chain_prepare(at, h, v, first, &s);
    chain_solve(at, &s, first ? v : v - (at->lag + at->change + at->bend), &p);
    if (t->ways) {
        for (size_t w = 0; w < t->ways; w++) {
            const pack moved = t->way[w] == CH_PLAY ? -side * seed_between(t, w, fraction) : pack_of(0.0);
            l->by.play[w] = choose(along, moved, l->by.play[w]);
        }
        chain_partials_at(at, &s, &p, &l->partials);
        chain_differentiate(at, &s, &p, &l->partials, t, fraction, &l->by, column);
    }
    for (int j = 0; j < BRISTLES; j++)
        if (at->bristle_on[j]) at->bristle[j] = p.bristle[j];
    if (!first) {
        const pack change = v - p.y - at->lag;
        at->bend = change - at->change;
        at->change = change;
    }
    at->lag = v - p.y;
    at->y = p.y;
    at->q += h * p.y;
    at->cavity = p.cavity;
    memcpy(force, &p.force, sizeof p.force);
}

/* Compute the first sample, with the valve in the middle of its travel. */
static void chain_lanes_first(chain_lanes *l, const lane_samples *t, double *force, double *const *column)
{
    l->at.q = l->at.play = t->x[1];
    l->at.followed[0] = l->at.c[CH_YIELD];
    l->at.followed[1] = l->at.c[CH_MEMORY];
    chain_advance(l, t, pack_of(0.0), 1.0, 1, t->x[1], t->v[1], force, column);
}

/* Step from one sample to the next. Compute force and columns at the second sample. */
static void chain_lanes_step(chain_lanes *l, const lane_samples *t, double *force, double *const *column)
{
    const pack h = t->step / (double)t->substeps;
    const lane_motion motion = motion_between(t);
    for (size_t j = 1; j <= t->substeps; j++) {
        const double fraction = (double)j / (double)t->substeps;
        pack x, v;
        motion_at(&motion, fraction, &x, &v);
        if (coefficients_between(t, fraction, CH_COUNT, l->at.c)) {
            chain_set(&l->at);
            chain_follow(l, t, (double)(j - 1) / (double)t->substeps, fraction);
        }
        chain_advance(l, t, h, fraction, 0, x, v, force, j == t->substeps ? column : NULL);
    }
}

static size_t chain_substeps(const mrd_record *r)
{
    const size_t least = (size_t)ceil(r->step / (CHAIN_STEP_RATIO * r->longest_step) - 1e-9);
    return r->substeps > least ? r->substeps : least;
}
