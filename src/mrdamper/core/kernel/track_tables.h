/* Tables of a controller: functions of one positive argument, the universal curve, and force and rho as functions of
 * current and temperature. For NaN, a function returns the value at an end of its table.
 */
#ifndef MRD_TRACK_TABLES_H
#define MRD_TRACK_TABLES_H

#include "controller.h"

#define R(x) ((mrd_real)(x))

/* Return true if the configuration uses the law or the prediction, and the code contains it. */
static inline bool has_series(const mrd_track *c) { return MRD_WITH_SERIES != 0 && c->law.series; }
static inline bool has_chain(const mrd_track *c) { return MRD_WITH_CHAIN != 0 && c->law.chain; }
static inline bool has_prediction(const mrd_track *c)
{
    return MRD_WITH_PREDICTION != 0 && c->inverse.method == MRD_INVERSE_PREDICTIVE;
}

#if defined(__GNUC__) && defined(MRD_SINGLE)
static inline mrd_real magnitude(mrd_real u) { return __builtin_fabsf(u); } /* one instruction, no library */
#elif defined(__GNUC__)
static inline mrd_real magnitude(mrd_real u) { return __builtin_fabs(u); }
#else
static inline mrd_real magnitude(mrd_real u) { return u < R(0.0) ? -u : u; }
#endif

/* Return u limited to [low, high]; low for NaN. */
static inline mrd_real clamp(mrd_real u, mrd_real low, mrd_real high) { return u > low ? (u < high ? u : high) : low; }

static inline mrd_pattern pattern_of(mrd_real t)
{
    mrd_pattern p;
    (void)memcpy(&p, &t, sizeof p);
    return p;
}

static inline mrd_real of_pattern(mrd_pattern p)
{
    mrd_real t;
    (void)memcpy(&t, &p, sizeof t);
    return t;
}

/* Return the inverse square root of a positive number. The bit pattern gives the start value, and Newton iterations
 * without division improve it. */
static inline mrd_real inverse_root(mrd_real square)
{
    const mrd_real half = R(0.5) * square;
    mrd_real inverse = of_pattern(MRD_PATTERN_OF_ROOT - (pattern_of(square) >> 1));
    for (int i = 0; i < MRD_ROOT_ROUNDS; i++) inverse *= R(1.5) - half * inverse * inverse;
    return inverse;
}

static inline mrd_real square_root(mrd_real square) { return square > R(1e-30) ? square * inverse_root(square) : R(0.0); }

static mrd_real lookup_at(const mrd_lookup *o, mrd_real size)
{
    const mrd_pattern one = 1u, mask = (one << MRD_DIGITS) - one;
    const uint32_t bits = (uint32_t)o->bits, beside = MRD_DIGITS - bits;
    const mrd_real sum = size + o->offset, t = sum < o->top ? sum : o->top;
    const mrd_pattern p = pattern_of(t);
    /* The leading bits of the pattern, minus the bits of the offset, are the index of the cell. */
    const mrd_real *c = &o->cell[4u * (size_t)((p >> beside) - (pattern_of(o->offset) >> beside))];
    const mrd_real l = of_pattern(((p << bits) & mask) | MRD_PATTERN_OF_ONE) - R(1.0);
    return c[0] + l * (c[1] + l * (c[2] + l * c[3]));
}

/* Return the hysteresis variable w on the universal curve. The position u is the scaled travel from w = 0, negative
 * during unloading. Motion increases the position. A reversal changes position and direction.
 */
static mrd_real hysteresis_at(const mrd_track *c, mrd_real u)
{
    return u < R(0.0) ? -lookup_at(&c->unloading, -u) : lookup_at(&c->loading, u);
}

static mrd_real position_after_turn(const mrd_track *c, mrd_real u)
{
    const mrd_real left = c->law.unloaded + u;
    if (u >= R(0.0)) return -lookup_at(&c->unload_map, u);
    return left > -u ? lookup_at(&c->reload_map, -u) : -lookup_at(&c->reload_map_rest, magnitude(left));
}

/* A point on an axis: index of the entry below, and fraction of the distance to the next. */
typedef struct {
    int32_t index;
    mrd_real share;
} axis_point;

static axis_point on_currents(const mrd_track *c, mrd_real u)
{
    axis_point at = {0, R(0.0)};
    int32_t count = c->currents - 1; /* number of cells from the index on that the bisection has not excluded */
    while (count > 1) {
        const int32_t half = count / 2;
        if (u >= c->current[at.index + half]) {
            at.index += half;
            count -= half;
        } else {
            count = half;
        }
    }
    const mrd_real low = c->current[at.index], high = c->current[at.index + 1];
    at.share = clamp((u - low) / (high - low), R(0.0), R(1.0));
    return at;
}

static inline axis_point on_temperatures(const mrd_track *c, mrd_real kelvin)
{
    axis_point at = {0, R(0.0)};
    if (c->axes.warmest > c->axes.coldest) {
        const mrd_real low = c->axes.coldest, high = c->axes.warmest;
        const mrd_real where = (clamp(kelvin, low, high) - low) / (high - low) * (mrd_real)c->pieces;
        at.index = (int32_t)where;
        if (at.index > c->pieces - 1) at.index = c->pieces - 1;
        at.share = where - (mrd_real)at.index;
    }
    return at;
}

/* Return the parabolas of all terms at a temperature. */
static inline const mrd_real *parabolas_at(const mrd_track *c, axis_point warm)
{
    return &c->factor[3 * warm.index * (c->levels + c->begin[MRD_GROUPS])];
}

static inline mrd_real parabola(const mrd_real *p, mrd_real share) { return p[0] + share * (p[1] + share * p[2]); }

/* Compute the inverse yield displacements of the elements. */
static void rho_at(const mrd_track *c, axis_point warm, mrd_real current, mrd_real *rho)
{
    const mrd_real *p = &parabolas_at(c, warm)[3 * (c->levels + c->begin[MRD_GROUP_RHO])];
    const axis_point at = on_currents(c, current);
    const int32_t columns = c->begin[MRD_GROUPS], first = c->begin[MRD_GROUP_RHO];
    const mrd_real *here = &c->column[at.index * columns], *beyond = &here[columns];
    for (int e = 0; e < c->law.elements; e++) {
        rho[e] = R(0.0);
        for (int32_t k = c->begin[MRD_GROUP_RHO + e]; k < c->begin[MRD_GROUP_RHO + e + 1]; k++)
            rho[e] += parabola(&p[3 * (k - first)], warm.share) * (here[k] + at.share * (beyond[k] - here[k]));
    }
}

/* Motion and hysteresis at one instant. */
typedef struct {
    mrd_real x, v, a, w[2];
} moment;

/* Compute the values that multiply the rows without hysteresis. */
static void motion_multipliers(const mrd_track *c, const moment *m, mrd_real *by)
{
    const mrd_real speed = magnitude(m->v), sign = m->v < R(0.0) ? R(-1.0) : R(1.0);
    by[MRD_ROW_OFFSET] = R(1.0);
    by[MRD_ROW_STIFFNESS] = m->x;
    by[MRD_ROW_MASS] = m->a;
    by[MRD_ROW_VISCOUS] = c->gains.viscous_force * sign * lookup_at(&c->viscous, speed);
    by[MRD_ROW_SLIDING] = c->gains.friction_force * sign * lookup_at(&c->sliding, speed);
    by[MRD_ROW_BREAKAWAY] = c->gains.friction_force * sign * lookup_at(&c->breakaway, speed);
    by[MRD_ROW_YIELD] = c->gains.yield_force;
    by[MRD_ROW_SECOND] = c->gains.yield_force;
}

/* Factors on the yield forces, for hysteretic states w. The first yield force is multiplied by yield * w0, the second
 * one by second[0] * w0 + second[1] * w1. */
typedef struct {
    mrd_real yield, second[2];
} mixture;

static inline mixture mixture_of(const mrd_track *c, const moment *m)
{
    const bool settled = (c->law.elements == 0), rate = c->law.saturating;
    const mrd_real saturation = settled || rate ? lookup_at(&c->saturation, magnitude(m->v)) : R(1.0);
    const mixture mix = {settled ? saturation : R(1.0), {rate ? saturation : R(0.0), rate ? R(0.0) : R(1.0)}};
    return mix;
}

static inline mrd_real yield_share(const mixture *mix, const mrd_real *w) { return mix->yield * w[0]; }

static inline mrd_real second_share(const mixture *mix, const mrd_real *w)
{
    return mix->second[0] * w[0] + mix->second[1] * w[1];
}

static inline void multipliers(const mrd_track *c, const moment *m, mrd_real *by)
{
    const mixture mix = mixture_of(c, m);
    motion_multipliers(c, m, by);
    by[MRD_ROW_YIELD] *= yield_share(&mix, m->w);
    by[MRD_ROW_SECOND] *= second_share(&mix, m->w);
}

/* Compute the weights of the columns at a temperature. Return the force of the levels. */
static mrd_real weigh(const mrd_track *c, axis_point warm, const mrd_real *by, mrd_real *weight)
{
    const mrd_real *p = parabolas_at(c, warm);
    const uint8_t *row = c->row;
    mrd_real level = R(0.0);
    for (int32_t k = 0; k < c->levels; k++) level += by[row[k]] * parabola(&p[3 * k], warm.share);
    p = &p[3 * c->levels];
    row = &row[c->levels];
    for (int32_t k = 0; k < c->begin[MRD_GROUP_RHO]; k++) weight[k] = by[row[k]] * parabola(&p[3 * k], warm.share);
    return level;
}

static inline mrd_real sum_of(const mrd_real *weight, const mrd_real *here, int32_t count)
{
    mrd_real sum = R(0.0);
    for (int32_t k = 0; k < count; k++) sum += weight[k] * here[k];
    return sum;
}

/* Return the force at a current. */
static inline mrd_real force_at(const mrd_track *c, axis_point warm, axis_point at, const mrd_real *by)
{
    const mrd_real *here = &c->column[at.index * c->begin[MRD_GROUPS]], *beyond = &here[c->begin[MRD_GROUPS]];
    mrd_real weight[MRD_TRACK_TERMS], force = weigh(c, warm, by, weight);
    for (int32_t k = 0; k < c->begin[MRD_GROUP_RHO]; k++) force += weight[k] * (here[k] + at.share * (beyond[k] - here[k]));
    return force;
}

#endif
