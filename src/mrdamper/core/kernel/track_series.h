/* The series valve in real time: step and force.
 *
 *     F = S(e) + cB |e'|^mB sgn e'  =  f0 + k0 y + A [tanh(y'/vr) + rK |y'|^m sgn y'],   e + y = x
 *     S(e) = k/2 [2 e + sqrt((e-d)^2 + r^2) - sqrt((e+d)^2 + r^2)],   A = fy(I, T) (1 + bx x)
 *
 * with viscosity, friction and mass in parallel. series_valve.c contains the exact law. Here tanh, powers and square
 * roots are tabulated, and every solution has a fixed number of iterations. The state is the travel e of the spring,
 * and the velocity y' of the valve as start value of the next solution. Steps are implicit and unconditionally stable.
 */
#ifndef MRD_TRACK_SERIES_H
#define MRD_TRACK_SERIES_H

#include "track_tables.h"

enum { SERIES_ROUNDS = 5 }; /* number of iterations for the velocity of the valve */

/* Maximum velocity of the valve [m/s]. The limit lets the state recover after an invalid reading. */
static const mrd_real series_fastest = R(8.0);

/* Return the position of a current on an axis with `count` evenly spaced currents from 0 to `largest`. */
static inline axis_point series_axis(mrd_real current, mrd_real largest, int32_t count)
{
    const int32_t cells = count - 1;
    const mrd_real scaled = clamp(current / largest, R(0.0), R(1.0)) * (mrd_real)cells;
    axis_point at = {(int32_t)scaled, R(0.0)};
    if (at.index > cells - 1) at.index = cells - 1;
    at.share = scaled - (mrd_real)at.index;
    return at;
}

/* Return u^m from a table for u = `size`. *slope receives its derivative. */
static inline mrd_real power_at(const mrd_power *o, mrd_real size, mrd_real *slope)
{
    const mrd_pattern one = 1u, mask = (one << MRD_DIGITS) - one;
    const uint32_t bits = (uint32_t)o->bits, beside = MRD_DIGITS - bits;
    const mrd_real t = clamp(size, o->lowest, o->top);
    const mrd_pattern p = pattern_of(t), octave = (p >> MRD_DIGITS) - (pattern_of(o->lowest) >> MRD_DIGITS);
    const mrd_pattern cell = (p & mask) >> beside;
    const mrd_real *c = &o->cell[4u * (size_t)cell];
    const mrd_real l = of_pattern(((p << bits) & mask) | MRD_PATTERN_OF_ONE) - R(1.0);
    const mrd_real value = o->scale[octave] * (c[0] + l * (c[1] + l * (c[2] + l * c[3])));
    const mrd_real per = value / t;
    if (!(size >= o->lowest)) {
        *slope = per;
        return per * size;
    }
    *slope = o->exponent * per;
    return value;
}

/* Coefficients of the chain at a temperature, including the gains, and constants that follow from them. */
typedef struct {
    mrd_real at[MRD_CHAIN_ALL];
    mrd_real apart[3];              /* relative stiffness of the bristles before yield */
    mrd_real along[2], per_along[2]; /* level of these bristles in retraction and extension, and its inverse */
    mrd_real bypass[2];             /* flow past the valve / force^1/2 in retraction and extension */
    mrd_real far;                   /* maximum travel of the spring */
} valve_chain;

static void chain_at(const mrd_track *c, axis_point warm, valve_chain *k)
{
    static const mrd_real strongest = R(1e6); /* [N] maximum spring force */
    const int32_t rows = has_chain(c) ? (int32_t)MRD_CHAIN_ALL : (int32_t)MRD_CHAIN;
    const mrd_real *cold = c->series->chain + warm.index * rows;
    const mrd_real *hot = cold + (c->axes.warmest > c->axes.coldest ? rows : 0);
    for (int i = 0; i < rows; i++) k->at[i] = cold[i] + warm.share * (hot[i] - cold[i]);
    for (int i = rows; i < (int)MRD_CHAIN_ALL; i++) k->at[i] = R(0.0);
    k->at[MRD_CHAIN_THINNING] *= c->gains.viscous_force / c->gains.yield_force; /* relative to the yield force, which has its own gain */
    k->at[MRD_CHAIN_VISCOSITY] *= c->gains.viscous_force;
    k->at[MRD_CHAIN_SLIDING] *= c->gains.friction_force;
    k->at[MRD_CHAIN_BREAKAWAY] *= c->gains.friction_force;
    k->at[MRD_CHAIN_FRICTION] *= c->gains.friction_force;
    const mrd_real apart = k->at[MRD_CHAIN_APART], lopsided = k->at[MRD_CHAIN_ASYMMETRY];
    k->apart[0] = R(1.0);
    k->apart[1] = apart;
    k->apart[2] = apart > R(0.0) ? R(1.0) / apart : R(0.0);
    k->along[0] = R(1.0) - lopsided;
    k->along[1] = R(1.0) + lopsided;
    for (int i = 0; i < 2; i++) k->per_along[i] = k->along[i] > R(0.0) ? R(1.0) / k->along[i] : R(0.0);
    k->bypass[0] = k->bypass[1] = k->at[MRD_CHAIN_BYPASS];
    if (k->bypass[0] > R(0.0)) {
        k->bypass[0] /= square_root(R(1.0) - k->at[MRD_CHAIN_FLOW_ASYMMETRY]);
        k->bypass[1] /= square_root(R(1.0) + k->at[MRD_CHAIN_FLOW_ASYMMETRY]);
    }
    k->far = k->at[MRD_CHAIN_GAP] + R(1.0) / k->at[MRD_CHAIN_SHARPNESS] + strongest / k->at[MRD_CHAIN_SPRING];
}

/* Return the number of coefficients that depend on the current: one for the series valve. */
static inline int32_t planes_of(const mrd_track *c) { return has_chain(c) ? (int32_t)MRD_PLANES : 1; }

/* Return the yield force at an index of the current table. */
static inline mrd_real yield_of(const mrd_track *c, axis_point warm, int32_t current)
{
    const mrd_real *cold = &c->series->yield[planes_of(c) * (warm.index * c->series->currents + current)];
    return cold[0] + warm.share * (cold[c->axes.warmest > c->axes.coldest ? planes_of(c) * c->series->currents : 0] - cold[0]);
}

static inline mrd_real yield_at(const mrd_track *c, axis_point warm, mrd_real current)
{
    const axis_point at = series_axis(current, c->axes.largest, c->series->currents);
    const mrd_real below = yield_of(c, warm, at.index);
    return below + at.share * (yield_of(c, warm, at.index + 1) - below);
}

/* Return the rounded corner (u + sqrt(u^2 + 1)) / 2. *slope receives its derivative. */
static inline mrd_real corner_at(mrd_real u, mrd_real *slope)
{
    const mrd_real square = u * u + R(1.0), inverse = inverse_root(square);
    *slope = R(0.5) + R(0.5) * u * inverse;
    return R(0.5) * (u + square * inverse);
}

/* Return the spring force S(e). *slope receives dS/de. */
static inline mrd_real spring_at(const valve_chain *k, mrd_real e, mrd_real *slope)
{
    const mrd_real sharp = k->at[MRD_CHAIN_SHARPNESS], gap = k->at[MRD_CHAIN_GAP], spring = k->at[MRD_CHAIN_SPRING];
    mrd_real pulled_slope, pushed_slope;
    const mrd_real pulled = corner_at(sharp * (e - gap), &pulled_slope);
    const mrd_real pushed = corner_at(-sharp * (e + gap), &pushed_slope);
    *slope = spring * (pulled_slope + pushed_slope);
    return spring / sharp * (pulled - pushed);
}

/* Return the force of the dashpot parallel to the free play. *slope receives its derivative. */
static inline mrd_real leak_at(const mrd_series *t, const valve_chain *k, mrd_real rate, mrd_real *slope)
{
    const mrd_real leak = k->at[MRD_CHAIN_LEAK], size = power_at(&t->leak, magnitude(rate), slope);
    *slope *= leak;
    return rate < R(0.0) ? -leak * size : leak * size;
}

/* Return the force of the valve divided by the yield force at a speed. */
static inline mrd_real valve_at_speed(const mrd_series *t, const valve_chain *k, mrd_real speed, mrd_real *slope)
{
    const mrd_real slowness = k->at[MRD_CHAIN_SLOWNESS], thinning = k->at[MRD_CHAIN_THINNING];
    const mrd_real side = lookup_at(&t->side, slowness * speed);
    mrd_real by_power;
    const mrd_real power = power_at(&t->thinning, speed, &by_power);
    *slope = (R(1.0) - side * side) * slowness + thinning * by_power;
    return side + thinning * power;
}

/* Solve for the velocity of the valve after a step h by Newton's method in a bracket. Return the force of the chain.
 * `e` is the travel of the spring for a valve at rest. In each direction, the balance of forces rises with the speed.
 */
static mrd_real solve_valve(const mrd_series *t, const valve_chain *k, mrd_real amplitude, mrd_real e, mrd_real y, mrd_real v,
                            mrd_real h, int rounds, mrd_real *velocity)
{
    static const mrd_real slowest = R(1e-9);
    const mrd_real stiffness = k->at[MRD_CHAIN_STIFFNESS], held = k->at[MRD_CHAIN_OFFSET] + stiffness * y;
    mrd_real by_spring, by_leak, by_valve = R(0.0), force = R(0.0), moved = R(0.0);
    const mrd_real spring = spring_at(k, e, &by_spring);
    const mrd_real sign = held - spring - leak_at(t, k, v, &by_leak) > R(0.0) ? R(-1.0) : R(1.0);
    mrd_real low = R(0.0), high = series_fastest, p = sign * *velocity;
    if (!(p > slowest)) p = R(0.1) / k->at[MRD_CHAIN_SLOWNESS];
    for (int i = 0; i < rounds; i++) {
        const mrd_real q = sign * p;
        force = held + h * stiffness * q + sign * amplitude * valve_at_speed(t, k, p, &by_valve);
        const mrd_real balance =
            sign * (force - spring_at(k, e - h * q, &by_spring) - leak_at(t, k, v - q, &by_leak));
        by_valve = amplitude * by_valve + h * stiffness;
        mrd_real next = p - balance / (by_valve + h * by_spring + by_leak);
        if (balance > R(0.0)) high = p;
        else low = p;
        if (!(next > low)) next = low > R(0.0) ? R(0.5) * (low + p) : R(0.0625) * p;
        next = next < high ? next : R(0.5) * (p + clamp(R(8.0) * p, p, high));
        moved = next - p;
        p = next;
    }
    *velocity = sign * p;
    return force + sign * by_valve * moved;
}

/* Step by the time h to the displacement x with two implicit stages (Alexander's SDIRK, order two, L-stable). The
 * velocity changes linearly from v0 to v1, the yield amplitude from a0 to a1. w is the state. Return the force of the
 * chain. */
static mrd_real series_step(const mrd_series *t, const valve_chain *k, mrd_real *w, mrd_real x, mrd_real v0, mrd_real v1,
                            mrd_real h, mrd_real a0, mrd_real a1)
{
    static const mrd_real part = R(0.29289321881345247560), rest = R(0.70710678118654752440);
    const mrd_real travel = R(0.5) * h * (v0 + v1), v = v0 + part * (v1 - v0), way = R(0.5) * part * h * (v0 + v);
    const mrd_real y = x - travel - w[0];
    mrd_real q = w[1] + (v - v0);
    (void)solve_valve(t, k, a0 + part * (a1 - a0), w[0] + way, y, v, part * h, SERIES_ROUNDS, &q);
    const mrd_real moved = rest * h * q;
    q += v1 - v;
    const mrd_real force = solve_valve(t, k, a1, w[0] + travel - moved, y + moved, v1, part * h, SERIES_ROUNDS, &q);
    w[0] = clamp(w[0] + travel - moved - part * h * q, -k->far, k->far);
    w[1] = clamp(q, -series_fastest, series_fastest);
    return force;
}

/* Return the factor on the valve force at a position. The limits keep it positive far outside the data. */
static inline mrd_real valve_gain(const mrd_track *c, const valve_chain *k, mrd_real x)
{
    return c->gains.yield_force * clamp(R(1.0) + k->at[MRD_CHAIN_POSITION] * x, R(0.1), R(10.0));
}

/* Return the yield amplitude at a current and a position. */
static inline mrd_real valve_amplitude(const mrd_track *c, const valve_chain *k,
                                       axis_point warm, mrd_real current, mrd_real x)
{
    return yield_at(c, warm, current) * valve_gain(c, k, x);
}

/* Step the chain through the period that ends now: v0 is the velocity at its start, `applied` is the mean of the applied
 * current. Return its force. */
static mrd_real update_series(const mrd_track *c, mrd_track_state *s, const valve_chain *k, axis_point warm, mrd_real v0,
                              mrd_real applied)
{
    const mrd_real h = c->axes.period / (mrd_real)c->law.substeps, per = (s->v - v0) / (mrd_real)c->law.substeps;
    const mrd_real started = R(2.0) * applied - s->applied_current, grows = (s->applied_current - started) / (mrd_real)c->law.substeps;
    mrd_real force = R(0.0), from = started, v = v0, x = s->x - R(0.5) * c->axes.period * (v0 + s->v);
    for (int i = 0; i < c->law.substeps; i++) {
        const mrd_real to = from + grows, v1 = v + per;
        x += R(0.5) * h * (v + v1);
        force = series_step(c->series, k, s->curve_position[0], x, v, v1, h, valve_amplitude(c, k, warm, from, x),
                            valve_amplitude(c, k, warm, to, x));
        from = to;
        v = v1;
    }
    return force;
}

/* Set the initial state: the spring has no force, and the force of the valve equals the force of the dashpot. The
 * number of iterations equals the number for two stages. */
static void start_series(const mrd_track *c, mrd_track_state *s, axis_point warm)
{
    valve_chain k;
    chain_at(c, warm, &k);
    s->curve_position[0][1] = s->v;
    (void)solve_valve(c->series, &k, valve_amplitude(c, &k, warm, s->applied_current, s->x), R(0.0), s->x, s->v, R(0.0),
                      2 * SERIES_ROUNDS, &s->curve_position[0][1]);
}

/* Compute the forces parallel to the chain: viscous force, friction, inertia. */
static void series_parallel_forces(const mrd_series *t, const valve_chain *k, mrd_real v, mrd_real a, mrd_real *viscous,
                          mrd_real *friction, mrd_real *inertia)
{
    const mrd_real speed = magnitude(v), sign = v < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real slope;
    *viscous = sign * k->at[MRD_CHAIN_VISCOSITY] * power_at(&t->viscous, speed, &slope);
    *friction = sign * lookup_at(&t->side, k->at[MRD_CHAIN_TRANSITION] * speed)
              * (k->at[MRD_CHAIN_SLIDING]
                 + k->at[MRD_CHAIN_BREAKAWAY] * lookup_at(&t->fade, k->at[MRD_CHAIN_STRIBECK] * speed));
    *inertia = k->at[MRD_CHAIN_MASS] * a;
}

/* Compute the present yield, viscous, friction and remaining force of the series valve. */
static void series_parts(const mrd_track *c, const mrd_track_state *s, axis_point warm, mrd_real *parts)
{
    const mrd_series *t = c->series;
    valve_chain k;
    chain_at(c, warm, &k);
    const mrd_real e = s->curve_position[0][0], q = s->curve_position[0][1], speed = magnitude(q);
    const mrd_real amplitude = valve_amplitude(c, &k, warm, s->applied_current, s->x) * (q < R(0.0) ? R(-1.0) : R(1.0));
    mrd_real slope, inertia;
    series_parallel_forces(t, &k, s->v, s->a, &parts[1], &parts[2], &inertia);
    parts[0] = amplitude * lookup_at(&t->side, k.at[MRD_CHAIN_SLOWNESS] * speed);
    parts[1] += amplitude * k.at[MRD_CHAIN_THINNING] * power_at(&t->thinning, speed, &slope);
    parts[3] = inertia + k.at[MRD_CHAIN_OFFSET] + k.at[MRD_CHAIN_STIFFNESS] * (s->x - e);
}

#endif
