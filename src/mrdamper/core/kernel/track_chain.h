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

enum { CHAIN_ROUNDS = 5,       /* of a solve for the valve's velocity */
       CHAIN_AHEAD_ROUNDS = 2, /* ... on the way ahead */
       CHAIN_PRE_YIELD = 3, CHAIN_FRICTION = 3, CHAIN_MEMORY = 4 };

/* A value, and its derivatives by the moves of the command that are not decided yet. */
typedef struct {
    mrd_real at, by[MRD_TRACK_MOVES];
} mrd_moved;

/* Derivatives of a chain's state by those moves; all but the first `moves` are zero, and left alone. */
typedef struct {
    int moves;
    mrd_real e[MRD_TRACK_MOVES], cavity[MRD_TRACK_MOVES], bristle[MRD_TRACK_BRISTLES][MRD_TRACK_MOVES], level[2][MRD_TRACK_MOVES];
} link_moves;

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
    mrd_real level[MRD_TRACK_BRISTLES], stiffness[MRD_TRACK_BRISTLES], before[MRD_TRACK_BRISTLES];
} link_step;

/* The equation at one y. */
typedef struct {
    mrd_real y, side, side_slope, power, force, force_slope, slope, spring_slope, leak_slope;
    mrd_real cavity, cavity_slope, length, by_cavity; /* z, its slope over y, l + z, the slope of its equation */
    mrd_real bristle[MRD_TRACK_BRISTLES], kept[MRD_TRACK_BRISTLES], bristle_slope[MRD_TRACK_BRISTLES];
} link_point;

/* The forces that follow the current. */
static link_levels levels_at(const mrd_track *c, const mrd_track_state *s, axis_point warm, mrd_real current)
{
    const mrd_series *t = c->series;
    const int32_t spaces = t->currents - 1;
    const mrd_real cells = (mrd_real)spaces;
    const bool single = !(c->axes.warmest > c->axes.coldest);
    const int32_t planes = mrd_has_chain(&c->law) ? (int32_t)MRD_PLANES : 1, sheet = single ? 0 : t->currents;
    const int32_t plane = t->currents * (single ? 1 : c->pieces + 1);
    const mrd_real gain[MRD_PLANES] = {s->gain[0], s->gain[1], R(1.0), s->gain[0]};
    const axis_point at = series_axis(current, c->axes.largest, t->currents);
    link_levels out = {{R(0.0)}, {R(0.0)}};
    for (int32_t p = 0; p < planes; p++) {
        const mrd_real *cold = &t->yield[p * plane + warm.index * t->currents + at.index], *hot = &cold[sheet];
        const mrd_real low = gain[p] * (cold[0] + warm.share * (hot[0] - cold[0]));
        const mrd_real high = gain[p] * (cold[1] + warm.share * (hot[1] - cold[1]));
        out.at[p] = low + at.share * (high - low);
        out.slope[p] = (high - low) * cells / c->axes.largest;
    }
    return out;
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

/* The step of h from a state, the spring's travel having become `e` if the valve rested; travel: q, or x of the series
 * valve. */
static void link_prepare(link_step *s, const mrd_chain_state *w, const link_levels *now, mrd_real q, mrd_real travel)
{
    static const mrd_real share_of[CHAIN_PRE_YIELD] = {R(0.5), R(0.25), R(0.25)}, floor_of_gain = R(0.02);
    const mrd_real *k = s->k->at;
    const mrd_real gain = R(1.0) + travel * (k[MRD_CHAIN_POSITION] + travel * k[MRD_CHAIN_CURVATURE]);
    const mrd_real apart = k[MRD_CHAIN_APART], speed = w->y * k[MRD_CHAIN_FADING], yield = now->at[MRD_PLANE_YIELD];
    const mrd_real stiff[CHAIN_PRE_YIELD] = {R(1.0), apart, apart > R(0.0) ? R(1.0) / apart : R(0.0)};
    const bool moves = gain > floor_of_gain;
    s->gain = moves ? gain : floor_of_gain;
    s->gain_slope = moves ? k[MRD_CHAIN_POSITION] + R(2.0) * travel * k[MRD_CHAIN_CURVATURE] : R(0.0);
    link_rest(s, q);
    s->viscoplastic = s->gain * yield * (R(1.0) - k[MRD_CHAIN_SHARE]);
    s->slowness = k[MRD_CHAIN_SLOWNESS] / (R(1.0) + k[MRD_CHAIN_SLOWNESS] * k[MRD_CHAIN_CREEP] * yield);
    s->bypass = s->slowness * k[MRD_CHAIN_BYPASS];
    if (s->bypass > R(0.0)) s->bypass *= square_root(yield);
    s->thinning = s->gain * (k[MRD_CHAIN_THINNING] * yield + now->at[MRD_PLANE_THINNING]);
    for (int j = 0; j < CHAIN_PRE_YIELD; j++) {
        s->level[j] = share_of[j] * s->gain * yield * k[MRD_CHAIN_SHARE];
        s->stiffness[j] = share_of[j] * stiff[j] * now->at[MRD_PLANE_BRISTLE];
    }
    s->level[CHAIN_FRICTION] = k[MRD_CHAIN_FRICTION];
    if (k[MRD_CHAIN_EXCESS] > R(0.0))
        s->level[CHAIN_FRICTION] *= R(1.0) + k[MRD_CHAIN_EXCESS] * lookup_at(&s->t->fade, magnitude(speed));
    s->stiffness[CHAIN_FRICTION] = k[MRD_CHAIN_FRICTION_STIFFNESS];
    s->level[CHAIN_MEMORY] = now->at[MRD_PLANE_MEMORY];
    s->stiffness[CHAIN_MEMORY] = k[MRD_CHAIN_MEMORY_STIFFNESS];
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) s->before[j] = w->bristle[j];
}

/* Level of a bristle on the way it goes. */
static inline mrd_real level_along(const link_step *s, int j, mrd_real y)
{
    const mrd_real asymmetry = j < (int)CHAIN_PRE_YIELD ? s->k->at[MRD_CHAIN_ASYMMETRY] : R(0.0);
    return s->level[j] * (y < R(0.0) ? R(1.0) - asymmetry : R(1.0) + asymmetry);
}

/* The yield's share that is reached at the speed, and its slope: tanh, or partly a straight line with a corner at 1. */
static mrd_real yield_side(const link_step *s, mrd_real speed, mrd_real *slope)
{
    static const mrd_real rounding = R(0.05);
    mrd_real rise, pulled, pushed;
    const mrd_real u = risen_at(s, speed, &rise), knee = s->k->at[MRD_CHAIN_KNEE];
    mrd_real side = lookup_at(&s->t->side, u);
    *slope = (R(1.0) - side * side) * rise;
    if (knee > R(0.0)) {
        mrd_real line = rounding * corner_at(&s->t->corner, (u + R(1.0)) / rounding, &pulled) - R(1.0);
        line -= rounding * corner_at(&s->t->corner, (u - R(1.0)) / rounding, &pushed);
        side += knee * (line - side);
        *slope += knee * ((pulled - pushed) * rise - *slope);
    }
    return side;
}

/* Valve less compliance at y; rises with y. */
static mrd_real link_balance(const link_step *s, mrd_real y, link_point *p)
{
    const mrd_real *k = s->k->at;
    const mrd_real size = magnitude(y), sign = y < R(0.0) ? R(-1.0) : R(1.0), as = k[MRD_CHAIN_ASYMMETRY];
    mrd_real power_slope;
    const mrd_real t = sign * yield_side(s, size, &p->side_slope);
    p->y = y;
    p->side = t;
    p->power = sign * power_at(&s->t->thinning, size, &power_slope);
    mrd_real force = s->rest + s->rest_slope * s->h * y + s->viscoplastic * (R(1.0) + as * t) * t
                   + s->thinning * p->power + k[MRD_CHAIN_ORIFICE] * size * y;
    mrd_real slope = s->rest_slope * s->h + s->thinning * power_slope + R(2.0) * k[MRD_CHAIN_ORIFICE] * size
                   + s->viscoplastic * (R(1.0) + R(2.0) * as * t) * p->side_slope;
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) {
        const mrd_real level = level_along(s, j, y);
        p->bristle[j] = R(0.0);
        p->kept[j] = R(0.0);
        p->bristle_slope[j] = R(0.0);
        if (!(level > R(0.0))) continue;
        const mrd_real rate = s->stiffness[j] * s->h / level, u = rate * size;
        const mrd_real kept = R(1.0) / (R(1.0) + u + R(0.5) * u * u), away = s->before[j] - sign * level;
        p->kept[j] = kept;
        p->bristle[j] = sign * level + away * kept;
        p->bristle_slope[j] = -away * (R(1.0) + u) * kept * kept * rate * sign;
        force += p->bristle[j];
        slope += p->bristle_slope[j];
    }
    p->force = force;
    p->force_slope = slope;
    link_cavity(s, p);
    const mrd_real opened = p->cavity - s->cavity;
    const mrd_real spring = spring_at(s->t, s->k, s->e - s->h * y + opened, &p->spring_slope);
    const mrd_real leak = leak_at(s->t, s->k, s->v - y + s->per_h * opened, &p->leak_slope);
    p->slope = slope + p->spring_slope * (s->h - p->cavity_slope) + p->leak_slope * (R(1.0) - s->per_h * p->cavity_slope);
    return force - spring - leak;
}

/* The valve's velocity after the step: Newton's rounds in a bracket on the side that the balance at rest tells, and a
 * last one without a new look: its error is the square of the one before. */
static void link_solve(const link_step *s, mrd_real guess, int rounds, link_point *p)
{
    static const mrd_real slowest = R(1e-9);
    mrd_real by_spring, by_leak, at_rest = s->rest;
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++)
        if (s->level[j] > R(0.0)) at_rest += s->before[j];
    p->force = at_rest;
    p->force_slope = R(0.0);
    link_cavity(s, p);
    const mrd_real opened = p->cavity - s->cavity;
    at_rest -= spring_at(s->t, s->k, s->e + opened, &by_spring) + leak_at(s->t, s->k, s->v + s->per_h * opened, &by_leak);
    const mrd_real sign = at_rest > R(0.0) ? R(-1.0) : R(1.0);
    mrd_real low = R(0.0), high = series_fastest, size = limited(sign * guess, R(0.0), series_fastest), moved = R(0.0);
    if (!(size > slowest)) size = R(0.1) / s->slowness;
    for (int i = 0; i < rounds; i++) {
        const mrd_real balance = sign * link_balance(s, sign * size, p);
        mrd_real next = size - balance / p->slope;
        if (balance > R(0.0)) high = size;
        else low = size;
        if (!(next > low)) next = low > R(0.0) ? R(0.5) * (low + size) : R(0.0625) * size;
        next = next < high ? next : R(0.5) * (size + limited(R(8.0) * size, size, high));
        moved = next - size;
        size = next;
    }
    moved *= sign;
    p->y += moved;
    p->force += p->force_slope * moved;
    p->cavity += p->cavity_slope * moved;
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) p->bristle[j] += p->bristle_slope[j] * moved;
}

/* Bristles follow a level that the current has moved, as far as they follow at once. */
static void link_follow(const valve_chain *k, mrd_chain_state *w, const link_levels *now, link_moves *d,
                         const mrd_moved *current)
{
    const mrd_real follow = k->at[MRD_CHAIN_FOLLOW];
    static const int plane[2] = {MRD_PLANE_YIELD, MRD_PLANE_MEMORY}, from[2] = {0, CHAIN_MEMORY};
    static const int to[2] = {CHAIN_PRE_YIELD, MRD_TRACK_BRISTLES};
    const int moves = (d != NULL) ? d->moves : 0;
    for (int n = 0; n < 2; n++) {
        const mrd_real level = now->at[plane[n]], before = w->level[n];
        const mrd_real ratio = before > R(0.0) ? level / before : R(1.0), factor = R(1.0) + follow * (ratio - R(1.0));
        for (int j = from[n]; j < to[n]; j++) {
            for (int m = 0; m < moves; m++) {
                mrd_real by = factor * d->bristle[j][m];
                if (before > R(0.0))
                    by += w->bristle[j] * follow * (now->slope[plane[n]] * current->by[m] - ratio * d->level[n][m]) / before;
                d->bristle[j][m] = by;
            }
            w->bristle[j] *= factor;
        }
        w->level[n] = level;
        for (int m = 0; m < moves; m++) d->level[n][m] = now->slope[plane[n]] * current->by[m];
    }
}

/* Derivatives of force and state over a solved step. */
static void link_differentiate(const link_step *s, const link_point *p, const link_levels *now, link_moves *d,
                                const mrd_moved *current, mrd_moved *force)
{
    static const mrd_real share_of[CHAIN_PRE_YIELD] = {R(0.5), R(0.25), R(0.25)};
    const mrd_real *k = s->k->at;
    const mrd_real sign = p->y < R(0.0) ? R(-1.0) : R(1.0), as = k[MRD_CHAIN_ASYMMETRY];
    const mrd_real yield_slope = now->slope[MRD_PLANE_YIELD], yielded = (R(1.0) + as * p->side) * p->side;
    const mrd_real shaped = s->viscoplastic * yielded + s->thinning * p->power;
    const mrd_real by_travel = s->rest_slope + shaped / s->gain * s->gain_slope;
    mrd_real by_current[MRD_TRACK_BRISTLES], by_valve = s->gain * ((R(1.0) - k[MRD_CHAIN_SHARE]) * yielded * yield_slope
        + (k[MRD_CHAIN_THINNING] * yield_slope + now->slope[MRD_PLANE_THINNING]) * p->power);
    mrd_real rise, by_yield = R(0.0);
    const mrd_real risen = risen_at(s, magnitude(p->y), &rise), at = now->at[MRD_PLANE_YIELD];
    if (s->bypass > R(0.0) && at > R(0.0)) by_yield = R(0.5) * (magnitude(p->y) - risen / s->slowness) / at;
    by_valve -= s->viscoplastic * (R(1.0) + R(2.0) * as * p->side) * p->side_slope * sign
              * (risen * k[MRD_CHAIN_CREEP] + by_yield) * yield_slope;
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) {
        const mrd_real level = level_along(s, j, p->y);
        by_current[j] = R(0.0);
        if (j == (int)CHAIN_FRICTION || !(level > R(0.0))) continue;
        const bool pre = j < (int)CHAIN_PRE_YIELD;
        const mrd_real u = s->stiffness[j] * s->h * magnitude(p->y) / level;
        const mrd_real fall = -(s->before[j] - sign * level) * (R(1.0) + u) * p->kept[j] * p->kept[j] * u;
        const mrd_real level_slope = pre ? share_of[j] * s->gain * k[MRD_CHAIN_SHARE] * (R(1.0) + sign * as) * yield_slope
                                         : now->slope[MRD_PLANE_MEMORY];
        by_current[j] = (sign * (R(1.0) - p->kept[j]) - fall / level) * level_slope;
        if (pre && now->at[MRD_PLANE_BRISTLE] > R(0.0))
            by_current[j] += fall * now->slope[MRD_PLANE_BRISTLE] / now->at[MRD_PLANE_BRISTLE];
    }
    for (int m = 0; m < d->moves; m++) {
        const mrd_real e = d->e[m], was = d->cavity[m];
        mrd_real bristle[MRD_TRACK_BRISTLES], cavity = was, f = by_valve * current->by[m] + by_travel * (was - e);
        for (int j = 0; j < MRD_TRACK_BRISTLES; j++) {
            bristle[j] = by_current[j] * current->by[m] + p->kept[j] * d->bristle[j][m];
            f += bristle[j];
        }
        if (s->per_h > R(0.0))
            cavity = -p->length * (f + s->charge_curvature * was * (p->cavity - s->cavity)) / p->by_cavity;
        const mrd_real opened = cavity - was;
        const mrd_real y = -(f - p->spring_slope * (e + opened) - p->leak_slope * s->per_h * opened) / p->slope;
        for (int j = 0; j < MRD_TRACK_BRISTLES; j++) d->bristle[j][m] = bristle[j] + p->bristle_slope[j] * y;
        d->cavity[m] = cavity + p->cavity_slope * y;
        d->e[m] = e - s->h * y + (d->cavity[m] - was);
        force->by[m] = f + p->force_slope * y;
    }
}

/* One step of h to the displacement x, in which the velocity goes from v0 to v, with the current at its end; the force
 * of the chain. `d` and the derivatives of current and force may be left out. h = 0 finds the force where the state stands. */
static void link_advance(const mrd_track *c, const valve_chain *k, const link_levels *now, mrd_chain_state *w,
                          link_moves *d, int rounds, mrd_real h, mrd_real x, mrd_real v0, mrd_real v,
                          const mrd_moved *current, mrd_moved *force)
{
    static const mrd_real strongest = R(1e6); /* [N] no spring carries more */
    const mrd_real half = k->at[MRD_CHAIN_PLAY];
    mrd_real travel = R(0.5) * h * (v0 + v), along = v, behind = x;
    if (half > R(0.0)) {
        behind = limited(w->play, x - half, x + half);
        travel = behind - w->play;
        if (!(behind < w->play) && !(behind > w->play)) along = R(0.0);
    }
    w->play = behind;
    link_step s = {.t = c->series, .k = k, .h = h, .v = along, .e = w->e + travel};
    link_point p;
    const mrd_real q = behind - s.e + w->cavity;
    if (mrd_has_chain(&c->law)) link_follow(k, w, now, d, current);
    link_prepare(&s, w, now, q, mrd_has_chain(&c->law) ? q : x);
    link_charge(&s, w->cavity);
    link_solve(&s, w->y + (v - v0), rounds, &p);
    if (d != NULL && d->moves > 0) link_differentiate(&s, &p, now, d, current, force);
    force->at = p.force;
    const mrd_real far = k->at[MRD_CHAIN_GAP] + R(1.0) / k->at[MRD_CHAIN_SHARPNESS] + strongest / k->at[MRD_CHAIN_SPRING];
    w->y = limited(p.y, -series_fastest, series_fastest);
    if (s.per_h > R(0.0)) w->cavity = limited(p.cavity, -k->at[MRD_CHAIN_BUBBLE], R(1.0) / k->at[MRD_CHAIN_CAVITY_PER]);
    w->e = limited(s.e - h * w->y + (w->cavity - s.cavity), -far, far);
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) w->bristle[j] = limited(p.bristle[j], -strongest, strongest);
}

/* The chain through the period that ends now, in which the current goes from what was felt to what is. */
static void follow_chain(const mrd_track *c, mrd_track_state *s, axis_point warm, mrd_real v0, mrd_real applied)
{
    const mrd_real h = c->axes.period / (mrd_real)c->law.substeps, per = (s->v - v0) / (mrd_real)c->law.substeps;
    const mrd_real started = R(2.0) * applied - s->applied, grows = (s->applied - started) / (mrd_real)c->law.substeps;
    const valve_chain k = chain_at(c, s, warm);
    mrd_real x = s->x - R(0.5) * c->axes.period * (v0 + s->v), v = v0, current = started;
    mrd_moved force;
    for (int i = 0; i < c->law.substeps; i++) {
        x += h * (v + R(0.5) * per);
        current += grows;
        const link_levels now = levels_at(c, s, warm, current);
        link_advance(c, &k, &now, &s->chain, NULL, CHAIN_ROUNDS, h, x, v, v + per, NULL, &force);
        v += per;
    }
}

/* The chain before anything has been travelled: its spring and its bristles at rest. */
static void start_chain(const mrd_track *c, mrd_track_state *s, axis_point warm)
{
    const valve_chain k = chain_at(c, s, warm);
    const link_levels now = levels_at(c, s, warm, s->applied);
    mrd_moved force;
    s->chain.play = s->x;
    s->chain.y = s->v;
    s->chain.level[0] = now.at[MRD_PLANE_YIELD];
    s->chain.level[1] = now.at[MRD_PLANE_MEMORY];
    link_advance(c, &k, &now, &s->chain, NULL, 2 * CHAIN_ROUNDS, R(0.0), s->x, s->v, s->v, NULL, &force);
}

/* Yield, viscous and friction force and the rest, now. */
static void chain_parts(const mrd_track *c, const mrd_track_state *s, axis_point warm, mrd_real *parts)
{
    const valve_chain k = chain_at(c, s, warm);
    const link_levels now = levels_at(c, s, warm, s->applied);
    const mrd_real q = s->chain.play - s->chain.e + s->chain.cavity, y = s->chain.y, size = magnitude(y), sign = y < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real slope, inertia;
    link_step at;
    at.t = c->series;
    at.k = &k;
    link_prepare(&at, &s->chain, &now, q, q);
    series_beside(c->series, &k, s->v, s->a, &parts[1], &parts[2], &inertia);
    const mrd_real t = sign * yield_side(&at, size, &slope);
    parts[0] = at.viscoplastic * (R(1.0) + k.at[MRD_CHAIN_ASYMMETRY] * t) * t + s->chain.bristle[CHAIN_MEMORY];
    for (int j = 0; j < CHAIN_PRE_YIELD; j++) parts[0] += s->chain.bristle[j];
    parts[1] += at.thinning * sign * power_at(&c->series->thinning, size, &slope) + k.at[MRD_CHAIN_ORIFICE] * size * y;
    parts[2] += s->chain.bristle[CHAIN_FRICTION];
    parts[3] = inertia + at.rest;
}

#endif
