/* The chain on a target: its state carried on, its force, and how both move with a current that is not decided yet.
 *
 *     F = S(e) + cB |e'|^mB sgn e'  =  C l/(l + z) - C (1 - z/L)^-1.3  =  f0 + k0 q + Fg (1 + q/Lg)^-1.3
 *         + G Y (1 - phi) (1 + as t) t + G (rK Y + K) |y|^m sgn y + cq |y| y + bristles,   e + q - z = xb,  y = q'
 *
 * chain.c has the law in full and says what the terms are; here tanh, powers and square roots are tabulated, and a
 * solve takes a fixed number of rounds. Steps are the law's own: backward Euler in y, bristles by the two-term
 * rational form of their exponential. The state is the spring's travel e, since q = xb - e + z loses nothing by rounding
 * and e would; z is the cavity's, none without one. The series valve is the same with fewer terms; its valve grows with x instead of q.
 */
#ifndef MRD_TRACK_CHAIN_H
#define MRD_TRACK_CHAIN_H

#include "track_series.h"

static const mrd_real floor_of_volume = R(0.02);

enum { CHAIN_ROUNDS = 3,       /* of a solve for the valve's velocity */
       CHAIN_AHEAD_ROUNDS = 1, /* ... on the way ahead */
       CHAIN_PRE_YIELD = 3, CHAIN_FRICTION = 3, CHAIN_MEMORY = 4 };
enum { LINK_PRE_YIELD, LINK_FRICTION, LINK_MEMORY, LINK_GROUPS }; /* bristles that have a level in common */

/* The forces that follow the current, and their slopes over it. */
typedef struct {
    mrd_real at[MRD_PLANES], slope[MRD_PLANES];
} link_levels;

/* What a step's equation holds while y is sought. */
typedef struct {
    const mrd_series *t;
    const valve_chain *k;
    mrd_real h, v, e;              /* step, velocity behind the play, spring's travel if the valve rested */
    mrd_real cavity, per_h;        /* z before the step; one over the step, nothing without a cavity */
    mrd_real charge, charge_slope, charge_curvature; /* what the gas bears on the piston with, and by z */
    mrd_real gain, gain_slope;     /* of the valve's force over q */
    mrd_real rest, rest_slope;     /* offset, spring and gas */
    mrd_real viscoplastic, thinning, slowness; /* slowness: of the yield */
    mrd_real bypass;               /* the yield's rise over the root of itself, speeds times slowness */
    mrd_real level[LINK_GROUPS], rate[LINK_GROUPS]; /* of the bristles; a step's travel at 1 m/s over that of their build-up */
    mrd_real before[MRD_TRACK_BRISTLES];
    mrd_real factor[2], follows[2], ratio[2]; /* how bristles before yield and of memory go with their level at once */
} link_step;

/* The equation at one y. */
typedef struct {
    mrd_real y, side, side_slope, risen, power, force, force_slope, slope, spring_slope, leak_slope;
    mrd_real tried; /* the y at which all this was looked at; `y`, forces and cavity may have gone a little on */
    mrd_real cavity, cavity_slope, length, by_cavity; /* z, its slope over y, l + z, the slope of its equation */
    mrd_real held[MRD_TRACK_BRISTLES], bristle[MRD_TRACK_BRISTLES], kept[MRD_TRACK_BRISTLES], bristle_slope[MRD_TRACK_BRISTLES];
} link_point;

/* The forces that follow the current. */
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

/* Offset, spring and gas at the travel q. */
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

/* The cavity before the step, and the charge that bears on it. */
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

/* The cavity opens or closes at the valve's force: a quadratic in l + z. */
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

/* How far the yield has risen at a speed: u + bypass u^1/2 = slowness times speed; its slope in *slope. */
static mrd_real risen_at(const link_step *s, mrd_real speed, mrd_real *slope)
{
    const mrd_real v = s->slowness * speed, bypass = s->bypass;
    *slope = s->slowness;
    if (!(bypass > R(0.0))) return v;
    const mrd_real root = R(2.0) * v / (bypass + square_root(bypass * bypass + R(4.0) * v));
    *slope *= R(2.0) * root / (R(2.0) * root + bypass);
    return root * root;
}

/* A level that the current has moved, and how far the bristles that follow it go with it at once. */
static inline void link_follow(link_step *s, int group, mrd_real level, mrd_real before)
{
    const bool follows = before > R(0.0) && s->k->at[MRD_CHAIN_FOLLOW] > R(0.0);
    s->follows[group] = follows ? s->k->at[MRD_CHAIN_FOLLOW] / before : R(0.0);
    s->ratio[group] = follows ? level / before : R(1.0);
    s->factor[group] = R(1.0) + s->follows[group] * (level - before);
}

/* The step of h from a state, the spring's travel having become `e` if the valve rested; travel: q, or x of the series
 * valve. */
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
    s->bypass = s->slowness * k[MRD_CHAIN_BYPASS];
    if (s->bypass > R(0.0)) s->bypass *= square_root(yield);
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

/* The yield's share that is reached at the speed, and its slope: tanh, or partly a straight line with a corner at 1. */
static mrd_real yield_side(const link_step *s, mrd_real speed, mrd_real *risen, mrd_real *slope)
{
    static const mrd_real sharpness = R(20.0), rounding = R(0.05);
    mrd_real rise, pulled, pushed;
    const mrd_real u = risen_at(s, speed, &rise), knee = s->k->at[MRD_CHAIN_KNEE];
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

/* A bristle after the step at y: its force, what is kept of the one before and the slope over y in *p. */
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

/* All of them; `sign` is the way the valve goes. */
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

/* Valve less compliance at y; rises with y. */
static mrd_real link_balance(const link_step *s, mrd_real y, link_point *p)
{
    const mrd_real *k = s->k->at;
    const mrd_real size = magnitude(y), sign = y < R(0.0) ? R(-1.0) : R(1.0), as = k[MRD_CHAIN_ASYMMETRY];
    const mrd_real flow = sign + k[MRD_CHAIN_FLOW_ASYMMETRY], grown = flow * sign; /* sign^2 is 1 */
    const mrd_real orifice = grown * k[MRD_CHAIN_ORIFICE] * size, moved = s->rest_slope * s->h;
    mrd_real power_slope;
    const mrd_real t = sign * yield_side(s, size, &p->risen, &p->side_slope);
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

/* The same where the valve rests, whose sign tells the way it goes. */
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

/* The valve's velocity after the step: Newton's rounds in a bracket, and a last one without a new look: its error is the
 * square of the one before. What would turn the valve is looked at once at rest, where the balance has its kink. */
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
            if (rest * balance < R(0.0)) { /* between; there it goes like a root */
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

/* What the derivatives of a step have in common: of the valve's force over current and travel, of the bristles over the
 * current. */
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
                          + (s->bypass > R(0.0) ? R(0.5) * (size - p->risen / s->slowness) * grows : R(0.0));
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

/* Derivatives of force and state over a solved step by the first `count` moves, of which the state before it, `w`, does
 * not know those from `known` on. */
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

/* One step of h to the displacement x, in which the velocity goes from v0 to v, with the current at its end; the force
 * of the chain. `guess` is about what the valve's velocity will be. Derivatives by the first `count` moves, see
 * link_differentiate; with none the current may be left out. h = 0 finds the force where the state stands. */
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

/* A state that is kept is one that can be, whatever was read. */
static void link_limit(const valve_chain *k, mrd_chain_state *w)
{
    static const mrd_real strongest = R(1e6);
    w->y = clamp(w->y, -series_fastest, series_fastest);
    w->e = clamp(w->e, -k->far, k->far);
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) w->bristle[j] = clamp(w->bristle[j], -strongest, strongest);
}

/* The chain through the period that ends now, in which the current goes from what was felt to what is;
 * returns its force. */
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

/* The chain before anything has been travelled: its spring and its bristles at rest. */
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

/* Yield, viscous and friction force and the rest, now. */
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
    const mrd_real t = sign * yield_side(&at, size, &risen, &slope), flow = sign + k.at[MRD_CHAIN_FLOW_ASYMMETRY];
    parts[0] = at.viscoplastic * (R(1.0) + k.at[MRD_CHAIN_ASYMMETRY] * t) * t + s->chain.bristle[CHAIN_MEMORY];
    for (int j = 0; j < CHAIN_PRE_YIELD; j++) parts[0] += s->chain.bristle[j];
    parts[1] += flow * (at.thinning * power_at(&c->series->thinning, size, &slope) + k.at[MRD_CHAIN_ORIFICE] * size * size);
    parts[2] += s->chain.bristle[CHAIN_FRICTION];
    parts[3] = inertia + at.rest;
}

#endif
