/* The chain in real time: step, force, and derivatives of both with respect to a future current.
 *
 *     F = S(e) + cB |e'|^mB sgn e'  =  C l/(l + z) - C (1 - z/L)^-1.3  =  f0 + k0 q + Fg (1 + q/Lg)^-1.3
 *         + G Y (1 - phi) (1 + as t) t + G (rK Y + K) |y|^m sgn y + cq |y| y + bristles,   e + q - z = xb,  y = q'
 *
 * chain.c contains the exact law and describes the terms. Here tanh, powers and square roots are tabulated, and a
 * solution has a fixed number of iterations. A step is backward Euler in y. A rational function with two terms replaces
 * the exponential of the bristles. The state is the travel e of the spring and not q, because e = xb - q + z would lose
 * digits. The cavity z is zero if there is no cavity. The series valve has fewer terms, and its valve force depends on
 * x instead of q.
 */
#ifndef MRD_TRACK_CHAIN_H
#define MRD_TRACK_CHAIN_H

#include "track_series.h"

static const mrd_real floor_of_volume = R(0.02);

enum { CHAIN_ROUNDS = 3,       /* number of iterations for the velocity of the valve */
       CHAIN_AHEAD_ROUNDS = 1, /* number of iterations in a prediction */
       CHAIN_PRE_YIELD = 3, CHAIN_FRICTION = 3, CHAIN_MEMORY = 4 };
enum { LINK_PRE_YIELD, LINK_FRICTION, LINK_MEMORY, LINK_GROUPS }; /* groups of bristles with a common level */

/* Coefficients that depend on the current, and their slopes. */
typedef struct {
    mrd_real at[MRD_PLANES], slope[MRD_PLANES];
} link_levels;

/* Constants of the equation of a step. */
typedef struct {
    const mrd_series *t;
    const valve_chain *k;
    mrd_real h, v, e;              /* step, velocity behind the free play, travel of the spring for a valve at rest */
    mrd_real cavity, per_h;        /* z before the step; inverse step, zero without a cavity */
    mrd_real charge, charge_slope, charge_curvature; /* force H of the gas on the piston, dH/dz, d2H/dz2 */
    mrd_real gain, gain_slope;     /* factor G on the valve force, dG/dq */
    mrd_real rest, rest_slope;     /* force of offset, spring and gas, and d force / dq */
    mrd_real viscoplastic, thinning, slowness; /* factors of these two valve terms; inverse yield velocity */
    mrd_real bypass[2];            /* bypass term of the yield, scaled by slowness, in retraction and extension */
    mrd_real level[LINK_GROUPS], rate[LINK_GROUPS]; /* levels of bristles; travel in a step at 1 m/s / yield travel */
    mrd_real before[MRD_TRACK_BRISTLES];
    mrd_real factor[2], follows[2], ratio[2]; /* immediate change of bristle forces with their level */
} link_step;

/* Terms of the equation at one y. */
typedef struct {
    mrd_real y, side, side_slope, risen, power, force, force_slope, slope, spring_slope, leak_slope;
    mrd_real tried; /* y of the last evaluation; `y`, forces and cavity can be extrapolated from it */
    mrd_real cavity, cavity_slope, length, by_cavity; /* z, dz/dy, l + z, d/dz of the equation of z */
    mrd_real held[MRD_TRACK_BRISTLES], bristle[MRD_TRACK_BRISTLES], kept[MRD_TRACK_BRISTLES], bristle_slope[MRD_TRACK_BRISTLES];
} link_point;

/* Compute the coefficients that depend on the current, and their derivatives with respect to it. */
static void levels_at(const mrd_track *c, axis_point warm, mrd_real current, link_levels *out)
{
    const mrd_series *t = c->series;
    const int32_t spaces = t->currents - 1, planes = planes_of(c);
    const mrd_real per = (mrd_real)spaces / c->axes.largest;
    const mrd_real gain[MRD_PLANES] = {c->gains.yield_force, c->gains.viscous_force, R(1.0), c->gains.yield_force};
    const axis_point at = series_axis(current, c->axes.largest, t->currents);
    const mrd_real *cold = &t->yield[planes * (warm.index * t->currents + at.index)];
    const mrd_real *hot = &cold[c->axes.warmest > c->axes.coldest ? planes * t->currents : 0];
    for (int32_t p = planes; p < (int32_t)MRD_PLANES; p++) {
        out->at[p] = R(0.0);
        out->slope[p] = R(0.0);
    }
    for (int32_t p = 0; p < planes; p++) {
        const mrd_real low = cold[p] + warm.share * (hot[p] - cold[p]);
        const mrd_real high = cold[planes + p] + warm.share * (hot[planes + p] - cold[planes + p]);
        const mrd_real rise = gain[p] * (high - low);
        out->at[p] = gain[p] * low + at.share * rise;
        out->slope[p] = rise * per;
    }
}

/* Compute offset, spring and gas force at the travel q. */
static void link_rest(link_step *s, mrd_real q)
{
    const mrd_real *k = s->k->at;
    s->rest = k[MRD_CHAIN_OFFSET] + k[MRD_CHAIN_STIFFNESS] * q;
    s->rest_slope = k[MRD_CHAIN_STIFFNESS];
    if (k[MRD_CHAIN_GAS] < R(0.0) || k[MRD_CHAIN_GAS] > R(0.0)) {
        const mrd_real volume = R(1.0) + q * k[MRD_CHAIN_GAS_PER];
        const mrd_real room = volume > floor_of_volume ? volume : floor_of_volume;
        mrd_real slope;
        s->rest += k[MRD_CHAIN_GAS] * power_at(&s->t->gas, room, &slope);
        s->rest_slope += k[MRD_CHAIN_GAS] * slope * k[MRD_CHAIN_GAS_PER];
    }
}

/* Store the cavity before the step, and compute the gas force of the charge and its derivatives. */
static void link_charge(link_step *s, mrd_real z)
{
    static const mrd_real gas_exponent = R(1.3);
    const mrd_real *k = s->k->at;
    s->cavity = z;
    s->per_h = R(0.0);
    if (!(k[MRD_CHAIN_CAVITY_PER] > R(0.0)) || !(s->h > R(0.0))) return;
    const mrd_real volume = R(1.0) - z * k[MRD_CHAIN_CAVITY_PER];
    const mrd_real room = volume > floor_of_volume ? volume : floor_of_volume, per = k[MRD_CHAIN_CAVITY_PER] / room;
    mrd_real slope;
    s->per_h = R(1.0) / s->h;
    s->charge = k[MRD_CHAIN_CAVITY] * power_at(&s->t->gas, room, &slope);
    s->charge_slope = gas_exponent * s->charge * per;
    s->charge_curvature = (gas_exponent + R(1.0)) * s->charge_slope * per;
}

/* Compute the cavity from the force of the valve, by the quadratic equation in l + z. */
static void link_cavity(const link_step *s, link_point *p)
{
    p->cavity = s->cavity;
    p->cavity_slope = R(0.0);
    if (!(s->per_h > R(0.0))) return;
    const mrd_real bubble = s->k->at[MRD_CHAIN_BUBBLE], gas = s->k->at[MRD_CHAIN_CAVITY] * bubble;
    const mrd_real sum = p->force + s->charge - s->charge_slope * (s->cavity + bubble);
    p->by_cavity = square_root(sum * sum + R(4.0) * s->charge_slope * gas);
    p->length = sum > R(0.0) ? R(2.0) * gas / (p->by_cavity + sum) : R(0.5) * (p->by_cavity - sum) / s->charge_slope;
    p->cavity = p->length - bubble;
    p->cavity_slope = -p->length / p->by_cavity * p->force_slope;
}

/* Solve u + bypass * u^1/2 = slowness * |y| for u; *slope receives du / d|y|. */
static mrd_real risen_at(const link_step *s, mrd_real y, mrd_real *slope)
{
    const mrd_real v = s->slowness * magnitude(y), bypass = s->bypass[y < R(0.0) ? 0 : 1];
    *slope = s->slowness;
    if (!(bypass > R(0.0))) return v;
    const mrd_real root = R(2.0) * v / (bypass + square_root(bypass * bypass + R(4.0) * v));
    *slope *= R(2.0) * root / (R(2.0) * root + bypass);
    return root * root;
}

/* Prepare the immediate change of the bristle forces of a group after a change of their level. */
static inline void link_follow(link_step *s, int group, mrd_real level, mrd_real before)
{
    const bool follows = before > R(0.0) && s->k->at[MRD_CHAIN_FOLLOW] > R(0.0);
    s->follows[group] = follows ? s->k->at[MRD_CHAIN_FOLLOW] / before : R(0.0);
    s->ratio[group] = follows ? level / before : R(1.0);
    s->factor[group] = R(1.0) + s->follows[group] * (level - before);
}

/* Prepare a step of length h from a state. `travel` is q, or x for the series valve. */
static void link_prepare(const mrd_track *c, const valve_chain *chain, const mrd_chain_state *w, const link_levels *now,
                         mrd_real h, mrd_real q, mrd_real travel, link_step *s)
{
    static const mrd_real floor_of_gain = R(0.02);
    const mrd_real *k = chain->at;
    s->t = c->series;
    s->k = chain;
    s->h = h;
    const mrd_real gain = R(1.0) + travel * (k[MRD_CHAIN_POSITION] + travel * k[MRD_CHAIN_CURVATURE]);
    const mrd_real speed = w->y * k[MRD_CHAIN_FADING], yield = now->at[MRD_PLANE_YIELD];
    const bool moves = gain > floor_of_gain;
    s->gain = moves ? gain : floor_of_gain;
    s->gain_slope = moves ? k[MRD_CHAIN_POSITION] + R(2.0) * travel * k[MRD_CHAIN_CURVATURE] : R(0.0);
    link_rest(s, q);
    const mrd_real amplitude = s->gain * yield;
    s->level[LINK_PRE_YIELD] = amplitude * k[MRD_CHAIN_SHARE];
    s->viscoplastic = amplitude - s->level[LINK_PRE_YIELD];
    s->slowness = k[MRD_CHAIN_SLOWNESS] / (R(1.0) + k[MRD_CHAIN_SLOWNESS] * k[MRD_CHAIN_CREEP] * yield);
    const mrd_real scale = chain->bypass[0] > R(0.0) ? s->slowness * square_root(yield) : R(0.0);
    for (int i = 0; i < 2; i++) s->bypass[i] = scale * chain->bypass[i];
    s->thinning = s->gain * (k[MRD_CHAIN_THINNING] * yield + now->at[MRD_PLANE_THINNING]);
    s->level[LINK_FRICTION] = k[MRD_CHAIN_FRICTION];
    if (k[MRD_CHAIN_EXCESS] > R(0.0))
        s->level[LINK_FRICTION] *= R(1.0) + k[MRD_CHAIN_EXCESS] * lookup_at(&s->t->fade, magnitude(speed));
    s->level[LINK_MEMORY] = now->at[MRD_PLANE_MEMORY];
    const mrd_real stiffness[LINK_GROUPS] = {now->at[MRD_PLANE_BRISTLE], k[MRD_CHAIN_FRICTION_STIFFNESS], k[MRD_CHAIN_MEMORY_STIFFNESS]};
    for (int g = 0; g < (int)LINK_GROUPS; g++) s->rate[g] = s->level[g] > R(0.0) ? stiffness[g] * s->h / s->level[g] : R(0.0);
    link_follow(s, 0, yield, w->level[0]);
    link_follow(s, 1, now->at[MRD_PLANE_MEMORY], w->level[1]);
    for (int j = 0; j < (int)CHAIN_PRE_YIELD; j++) s->before[j] = s->factor[0] * w->bristle[j];
    s->before[CHAIN_FRICTION] = w->bristle[CHAIN_FRICTION];
    s->before[CHAIN_MEMORY] = s->factor[1] * w->bristle[CHAIN_MEMORY];
}

/* Return the fraction of the yield force at the speed |y|: tanh, partly blended with a straight line that has a corner
 * at 1. *slope receives the slope. */
static mrd_real yield_side(const link_step *s, mrd_real y, mrd_real *risen, mrd_real *slope)
{
    static const mrd_real sharpness = R(20.0), rounding = R(0.05);
    mrd_real rise, pulled, pushed;
    const mrd_real u = risen_at(s, y, &rise), knee = s->k->at[MRD_CHAIN_KNEE];
    mrd_real side = lookup_at(&s->t->side, u);
    *risen = u;
    *slope = (R(1.0) - side * side) * rise;
    if (knee > R(0.0)) {
        const mrd_real over = sharpness * u;
        const mrd_real line = rounding * (corner_at(over + sharpness, &pulled) - corner_at(over - sharpness, &pushed)) - R(1.0);
        side += knee * (line - side);
        *slope += knee * ((pulled - pushed) * rise - *slope);
    }
    return side;
}

/* Compute the force of a bristle after a step at y, the remaining fraction of the old force, and d force / dy. */
static inline void link_bristle(const link_step *s, link_point *p, int j, mrd_real held, mrd_real rate)
{
    const mrd_real u = rate * p->y, grown = R(1.0) + u, kept = R(1.0) / (grown + R(0.5) * u * u);
    const mrd_real loose = (s->before[j] - held) * kept;
    p->held[j] = held;
    p->kept[j] = kept;
    p->bristle[j] = held + loose;
    p->bristle_slope[j] = -loose * kept * grown * rate;
    p->force += p->bristle[j];
    p->force_slope += p->bristle_slope[j];
}

static inline void no_bristle(link_point *p, int j)
{
    p->held[j] = R(0.0);
    p->kept[j] = R(0.0);
    p->bristle[j] = R(0.0);
    p->bristle_slope[j] = R(0.0);
}

/* Compute all bristles; `sign` is the direction of the valve. */
static inline void link_bristles(const link_step *s, link_point *p, mrd_real sign)
{
    static const mrd_real share_of[CHAIN_PRE_YIELD] = {R(0.5), R(0.25), R(0.25)};
    int way = 1;
    if (sign < R(0.0)) way = 0;
    const mrd_real level = sign * s->level[LINK_PRE_YIELD] * s->k->along[way];
    const mrd_real rate = sign * s->rate[LINK_PRE_YIELD] * s->k->per_along[way];
    for (int j = 0; j < (int)CHAIN_PRE_YIELD; j++) {
        if (s->level[LINK_PRE_YIELD] > R(0.0)) link_bristle(s, p, j, share_of[j] * level, rate * s->k->apart[j]);
        else no_bristle(p, j);
    }
    for (int g = LINK_FRICTION; g < (int)LINK_GROUPS; g++) {
        const int j = (int)CHAIN_PRE_YIELD - 1 + g;
        if (s->level[g] > R(0.0)) link_bristle(s, p, j, sign * s->level[g], sign * s->rate[g]);
        else no_bristle(p, j);
    }
}

/* Return the force of the valve minus the force of the compliance at y. This balance rises with y. */
static mrd_real link_balance(const link_step *s, mrd_real y, link_point *p)
{
    const mrd_real *k = s->k->at;
    const mrd_real size = magnitude(y), sign = y < R(0.0) ? R(-1.0) : R(1.0), as = k[MRD_CHAIN_ASYMMETRY];
    const mrd_real flow = sign + k[MRD_CHAIN_FLOW_ASYMMETRY], grown = flow * sign; /* sign^2 is 1 */
    const mrd_real orifice = grown * k[MRD_CHAIN_ORIFICE] * size, moved = s->rest_slope * s->h;
    mrd_real power_slope;
    const mrd_real t = sign * yield_side(s, y, &p->risen, &p->side_slope);
    p->y = y;
    p->side = t;
    p->power = flow * power_at(&s->t->thinning, size, &power_slope);
    const mrd_real apart = s->viscoplastic * as * t, level = s->viscoplastic + apart;
    p->force = s->rest + (moved + orifice) * y + level * t + s->thinning * p->power;
    p->force_slope = moved + orifice + orifice + s->thinning * grown * power_slope + (level + apart) * p->side_slope;
    link_bristles(s, p, sign);
    link_cavity(s, p);
    const mrd_real opened = p->cavity - s->cavity;
    const mrd_real spring = spring_at(s->k, s->e - s->h * y + opened, &p->spring_slope);
    const mrd_real leak = leak_at(s->t, s->k, s->v - y + s->per_h * opened, &p->leak_slope);
    p->slope = p->force_slope + p->spring_slope * (s->h - p->cavity_slope) + p->leak_slope * (R(1.0) - s->per_h * p->cavity_slope);
    return p->force - spring - leak;
}

/* Return the balance of forces for a valve at rest. Its sign is opposite to the direction of the valve. */
static mrd_real balance_at_rest(const link_step *s)
{
    link_point p;
    mrd_real by_spring, by_leak;
    p.force = s->rest;
    p.force_slope = R(0.0);
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) p.force += s->before[j];
    link_cavity(s, &p);
    const mrd_real opened = p.cavity - s->cavity;
    return p.force - spring_at(s->k, s->e + opened, &by_spring) - leak_at(s->t, s->k, s->v + s->per_h * opened, &by_leak);
}

/* Solve for the velocity of the valve after the step by Newton's method in a bracket. The last iteration extrapolates
 * without a new evaluation, because its error is the square of the previous error. If an iteration reverses the valve,
 * the balance is evaluated at rest, where it has a kink. */
static void link_solve(const link_step *s, mrd_real guess, int rounds, link_point *p)
{
    static const mrd_real slowest = R(1e-9);
    mrd_real low = -series_fastest, high = series_fastest, y = clamp(guess, low, high), moved = R(0.0);
    if (!(magnitude(y) > slowest)) {
        y = R(0.1) / s->slowness;
        if (balance_at_rest(s) > R(0.0)) {
            y = -y;
            high = R(0.0);
        } else {
            low = R(0.0);
        }
    }
    for (int i = 0; i < rounds; i++) {
        const mrd_real balance = link_balance(s, y, p);
        mrd_real next = y - balance / p->slope;
        if (balance > R(0.0)) high = y;
        else low = y;
        if (low < R(0.0) && high > R(0.0) && next * y < R(0.0)) {
            const mrd_real rest = balance_at_rest(s);
            if (rest * balance < R(0.0)) { /* The solution is between 0 and y, where the balance is like a root of y. */
                const mrd_real share = rest / (rest - balance);
                next = y * share * share;
            }
            if (rest > R(0.0)) high = R(0.0) < high ? R(0.0) : high;
            else low = R(0.0) > low ? R(0.0) : low;
        }
        if (!(next > low)) next = R(0.5) * (low + (low < R(0.0) || low > R(0.0) ? y : R(0.125) * y));
        if (!(next < high)) next = R(0.5) * (high + (high < R(0.0) || high > R(0.0) ? y : R(0.125) * y));
        moved = next - y;
        y = next;
    }
    p->tried = p->y;
    p->y = y;
    p->force += p->force_slope * moved;
    p->cavity += p->cavity_slope * moved;
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) p->bristle[j] += p->bristle_slope[j] * moved;
}

/* Derivatives that all moves share: of the valve force with respect to current and travel, of the bristles with respect
 * to the current. */
typedef struct {
    mrd_real by_valve, by_travel, by_current[MRD_TRACK_BRISTLES];
} link_slopes;

static void link_slopes_of(const link_step *s, const link_point *p, const link_levels *now, link_slopes *d)
{
    const mrd_real *k = s->k->at;
    const mrd_real as = k[MRD_CHAIN_ASYMMETRY], size = magnitude(p->tried), sign = p->tried < R(0.0) ? R(-1.0) : R(1.0);
    const mrd_real yielded = (R(1.0) + as * p->side) * p->side, yield = now->at[MRD_PLANE_YIELD], yield_slope = now->slope[MRD_PLANE_YIELD];
    const mrd_real stiffness = now->at[MRD_PLANE_BRISTLE], memory = now->at[MRD_PLANE_MEMORY];
    const mrd_real grows = yield > R(0.0) ? yield_slope / yield : R(0.0);
    const mrd_real stiffens = stiffness > R(0.0) ? now->slope[MRD_PLANE_BRISTLE] / stiffness - grows : R(0.0);
    const mrd_real slower = p->risen * k[MRD_CHAIN_CREEP] * yield_slope
                          + (k[MRD_CHAIN_BYPASS] > R(0.0) ? R(0.5) * (size - p->risen / s->slowness) * grows : R(0.0));
    d->by_travel = s->rest_slope + (s->viscoplastic * yielded + s->thinning * p->power) / s->gain * s->gain_slope;
    d->by_valve = s->viscoplastic * (yielded * grows - (R(1.0) + R(2.0) * as * p->side) * p->side_slope * sign * slower)
                + s->gain * (k[MRD_CHAIN_THINNING] * yield_slope + now->slope[MRD_PLANE_THINNING]) * p->power;
    for (int j = 0; j < (int)CHAIN_PRE_YIELD; j++)
        d->by_current[j] = p->held[j] * (R(1.0) - p->kept[j]) * grows + p->bristle_slope[j] * p->tried * stiffens;
    d->by_current[CHAIN_FRICTION] = R(0.0);
    d->by_current[CHAIN_MEMORY] = R(0.0);
    if (memory > R(0.0))
        d->by_current[CHAIN_MEMORY] = (p->held[CHAIN_MEMORY] * (R(1.0) - p->kept[CHAIN_MEMORY])
            - p->bristle_slope[CHAIN_MEMORY] * p->tried) * now->slope[MRD_PLANE_MEMORY] / memory;
}

/* Compute the derivatives of force and state after a solved step with respect to the first `count` moves. The state `w`
 * before the step depends only on the first `known` moves. */
static void link_differentiate(const link_step *s, const link_point *p, const link_levels *now, const mrd_chain_state *w,
                                mrd_chain_move *moves, int known, int count, const mrd_moved *current, mrd_moved *force)
{
    static const mrd_chain_move nothing = {R(0.0), R(0.0), {R(0.0)}, {R(0.0)}};
    link_slopes by;
    mrd_real kept[MRD_TRACK_BRISTLES], dragged[MRD_TRACK_BRISTLES], bristle[MRD_TRACK_BRISTLES];
    const mrd_real per_slope = R(1.0) / p->slope;
    link_slopes_of(s, p, now, &by);
    for (int j = 0; j < (int)CHAIN_PRE_YIELD; j++) {
        kept[j] = p->kept[j] * s->factor[0];
        dragged[j] = p->kept[j] * w->bristle[j];
    }
    kept[CHAIN_FRICTION] = p->kept[CHAIN_FRICTION];
    kept[CHAIN_MEMORY] = p->kept[CHAIN_MEMORY] * s->factor[1];
    for (int m = 0; m < count; m++) {
        const mrd_chain_move *was = m < known ? &moves[m] : &nothing;
        mrd_chain_move *d = &moves[m];
        const mrd_real e = was->e, z = was->cavity, moved = current->by[m];
        const mrd_real level = now->slope[MRD_PLANE_YIELD] * moved, memory = now->slope[MRD_PLANE_MEMORY] * moved;
        const mrd_real follows = s->follows[0] * (level - s->ratio[0] * was->level[0]);
        for (int j = 0; j < (int)CHAIN_PRE_YIELD; j++)
            bristle[j] = by.by_current[j] * moved + kept[j] * was->bristle[j] + dragged[j] * follows;
        bristle[CHAIN_FRICTION] = kept[CHAIN_FRICTION] * was->bristle[CHAIN_FRICTION];
        bristle[CHAIN_MEMORY] = by.by_current[CHAIN_MEMORY] * moved + kept[CHAIN_MEMORY] * was->bristle[CHAIN_MEMORY]
            + p->kept[CHAIN_MEMORY] * w->bristle[CHAIN_MEMORY] * s->follows[1] * (memory - s->ratio[1] * was->level[1]);
        mrd_real f = by.by_valve * moved + by.by_travel * (z - e), opened = R(0.0);
        for (int j = 0; j < MRD_TRACK_BRISTLES; j++) f += bristle[j];
        if (s->per_h > R(0.0))
            opened = -p->length * (f + s->charge_curvature * z * (p->cavity - s->cavity)) / p->by_cavity - z;
        const mrd_real y = (p->spring_slope * (e + opened) + p->leak_slope * s->per_h * opened - f) * per_slope;
        for (int j = 0; j < MRD_TRACK_BRISTLES; j++) d->bristle[j] = bristle[j] + p->bristle_slope[j] * y;
        opened += p->cavity_slope * y;
        d->cavity = z + opened;
        d->e = e - s->h * y + opened;
        d->level[0] = level;
        d->level[1] = memory;
        force->by[m] = f + p->force_slope * y;
    }
}

/* Step the chain by h to the displacement x, with the velocity from v0 to v and the current at the end. Compute its
 * force, and derivatives with respect to the first `count` moves (see link_differentiate). Without moves, the current
 * can be NULL. `guess` is the start value of the valve velocity. With h = 0, compute the force of the present state. */
static void link_advance(const mrd_track *c, const valve_chain *k, const link_levels *now, mrd_chain_state *w,
                          mrd_real guess, int rounds, mrd_real h, mrd_real x, mrd_real v0, mrd_real v,
                          mrd_chain_move *moves, int known, int count, const mrd_moved *current, mrd_moved *force)
{
    const mrd_real half = k->at[MRD_CHAIN_PLAY];
    mrd_real travel = R(0.5) * h * (v0 + v), along = v, behind = x;
    if (half > R(0.0)) {
        behind = clamp(w->play, x - half, x + half);
        travel = behind - w->play;
        if (!(behind < w->play) && !(behind > w->play)) along = R(0.0);
    }
    w->play = behind;
    link_step s;
    link_point p;
    const mrd_real e = w->e + travel, q = behind - e + w->cavity;
    link_prepare(c, k, w, now, h, q, has_chain(c) ? q : x, &s);
    s.v = along;
    s.e = e;
    link_charge(&s, w->cavity);
    link_solve(&s, guess, rounds, &p);
    if (count > 0) link_differentiate(&s, &p, now, w, moves, known, count, current, force);
    force->at = p.force;
    w->y = p.y;
    if (s.per_h > R(0.0)) w->cavity = clamp(p.cavity, -k->at[MRD_CHAIN_BUBBLE], R(1.0) / k->at[MRD_CHAIN_CAVITY_PER]);
    w->e = s.e - h * p.y + (w->cavity - s.cavity);
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) w->bristle[j] = p.bristle[j];
    w->level[0] = now->at[MRD_PLANE_YIELD];
    w->level[1] = now->at[MRD_PLANE_MEMORY];
}

/* Limit the state of the chain, because invalid readings could make it too large. */
static void link_limit(const valve_chain *k, mrd_chain_state *w)
{
    static const mrd_real strongest = R(1e6);
    w->y = clamp(w->y, -series_fastest, series_fastest);
    w->e = clamp(w->e, -k->far, k->far);
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) w->bristle[j] = clamp(w->bristle[j], -strongest, strongest);
}

/* Step the chain through the period that ends now with a linear change of the effective current. Return its force. */
static mrd_real update_chain(const mrd_track *c, mrd_track_state *s, const valve_chain *k, axis_point warm, mrd_real v0,
                             mrd_real applied)
{
    const mrd_real h = c->axes.period / (mrd_real)c->law.substeps, per = (s->v - v0) / (mrd_real)c->law.substeps;
    const mrd_real started = R(2.0) * applied - s->applied_current, grows = (s->applied_current - started) / (mrd_real)c->law.substeps;
    mrd_real x = s->x - R(0.5) * c->axes.period * (v0 + s->v), v = v0, current = started;
    mrd_moved force = {R(0.0), {R(0.0)}};
    for (int i = 0; i < c->law.substeps; i++) {
        x += h * (v + R(0.5) * per);
        current += grows;
        link_levels now;
        levels_at(c, warm, current, &now);
        link_advance(c, k, &now, &s->chain, s->chain.y + per, CHAIN_ROUNDS, h, x, v, v + per, NULL, 0, 0, NULL, &force);
        link_limit(k, &s->chain);
        v += per;
    }
    return force.at;
}

/* Set the initial state of the chain: the spring and the bristles have no force. */
static void start_chain(const mrd_track *c, mrd_track_state *s, axis_point warm)
{
    valve_chain k;
    link_levels now;
    chain_at(c, warm, &k);
    levels_at(c, warm, s->applied_current, &now);
    mrd_moved force;
    s->chain.play = s->x;
    s->chain.y = s->v;
    s->chain.level[0] = now.at[MRD_PLANE_YIELD];
    s->chain.level[1] = now.at[MRD_PLANE_MEMORY];
    link_advance(c, &k, &now, &s->chain, s->v, 2 * CHAIN_ROUNDS, R(0.0), s->x, s->v, s->v, NULL, 0, 0, NULL, &force);
    link_limit(&k, &s->chain);
}

/* Compute the present yield, viscous, friction and remaining force of the chain. */
static void chain_parts(const mrd_track *c, const mrd_track_state *s, axis_point warm, mrd_real *parts)
{
    valve_chain k;
    link_levels now;
    chain_at(c, warm, &k);
    levels_at(c, warm, s->applied_current, &now);
    const mrd_real q = s->chain.play - s->chain.e + s->chain.cavity, y = s->chain.y, size = magnitude(y), sign = y < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real slope, risen, inertia;
    link_step at;
    link_prepare(c, &k, &s->chain, &now, R(0.0), q, q, &at);
    series_parallel_forces(c->series, &k, s->v, s->a, &parts[1], &parts[2], &inertia);
    const mrd_real t = sign * yield_side(&at, y, &risen, &slope), flow = sign + k.at[MRD_CHAIN_FLOW_ASYMMETRY];
    parts[0] = at.viscoplastic * (R(1.0) + k.at[MRD_CHAIN_ASYMMETRY] * t) * t + s->chain.bristle[CHAIN_MEMORY];
    for (int j = 0; j < CHAIN_PRE_YIELD; j++) parts[0] += s->chain.bristle[j];
    parts[1] += flow * (at.thinning * power_at(&c->series->thinning, size, &slope) + k.at[MRD_CHAIN_ORIFICE] * size * size);
    parts[2] += s->chain.bristle[CHAIN_FRICTION];
    parts[3] = inertia + at.rest;
}

#endif
