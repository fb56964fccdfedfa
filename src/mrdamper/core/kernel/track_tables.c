/* Tables of a controller: functions of a size on octaves, the universal curve, force and rho over current and
 * temperature. Nothing here fails on a number that is not one: it reads an end of the table.
 */
#include "controller.h"

#define R(x) ((mrd_real)(x))

static inline mrd_real magnitude(mrd_real u) { return u < R(0.0) ? -u : u; }

/* u inside [low, high]; low where u is not a number. */
static inline mrd_real limited(mrd_real u, mrd_real low, mrd_real high) { return u > low ? (u < high ? u : high) : low; }

static inline mrd_pattern pattern_of(mrd_real t)
{
    mrd_pattern p;
    memcpy(&p, &t, sizeof p);
    return p;
}

static inline mrd_real of_pattern(mrd_pattern p)
{
    mrd_real t;
    memcpy(&t, &p, sizeof t);
    return t;
}

/* Number of the first cell in the patterns' own counting. */
static inline mrd_pattern first_cell(const mrd_octaves *o) { return pattern_of(o->offset) >> (MRD_DIGITS - o->bits); }

static inline mrd_real octaves_at(const mrd_octaves *o, mrd_real size)
{
    const mrd_real sum = size + o->offset, t = sum < o->top ? sum : o->top;
    const mrd_pattern p = pattern_of(t), mask = ((mrd_pattern)1 << MRD_DIGITS) - 1;
    const mrd_real *c = o->cell + 4 * (size_t)((p >> (MRD_DIGITS - o->bits)) - first_cell(o));
    const mrd_real l = of_pattern(((p << o->bits) & mask) | MRD_PATTERN_OF_ONE) - R(1.0);
    return c[0] + l * (c[1] + l * (c[2] + l * c[3]));
}

/* A hysteretic state after a signed, scaled travel rho dx in one direction. */
static inline mrd_real w_moved(const mrd_track *c, mrd_real w, mrd_real travel)
{
    const mrd_real side = travel < R(0.0) ? R(-1.0) : R(1.0), u = limited(side * w, R(-1.0), R(1.0));
    const mrd_real from = u < R(0.0) ? -octaves_at(&c->to_unload, -u) : octaves_at(&c->to_load, R(1.0) - u);
    const mrd_real tau = from + side * travel;
    return side * (tau < R(0.0) ? -octaves_at(&c->unloading, -tau) : octaves_at(&c->loading, tau));
}

/* A point on an even axis: the entry below, and the share of the way to the next. */
typedef struct {
    int32_t index;
    mrd_real share;
} axis_point;

static inline axis_point on_axis(mrd_real u, mrd_real low, mrd_real high, int32_t count)
{
    axis_point at = {0, R(0.0)};
    if (count < 2 || !(high > low)) return at;
    const mrd_real scaled = limited((u - low) / (high - low), R(0.0), R(1.0)) * (mrd_real)(count - 1);
    at.index = (int32_t)scaled;
    if (at.index > count - 2) at.index = count - 2;
    at.share = scaled - (mrd_real)at.index;
    return at;
}

static inline axis_point warmth(const mrd_track *c, mrd_real kelvin)
{
    return on_axis(kelvin, c->coldest, c->warmest, c->temperatures);
}

/* Value of one row of a table at a current and a temperature; `rows` rows to a sheet. */
static inline mrd_real row_at(const mrd_track *c, const mrd_real *table, int rows, int row, axis_point warm, axis_point at)
{
    const int n = c->currents;
    const mrd_real *cold = table + (warm.index * rows + row) * n + at.index;
    const int next = n > 1 ? 1 : 0;
    mrd_real value = cold[0] + at.share * (cold[next] - cold[0]);
    if (warm.share > R(0.0)) {
        const mrd_real *hot = cold + rows * n;
        value += warm.share * (hot[0] + at.share * (hot[next] - hot[0]) - value);
    }
    return value;
}

static inline axis_point on_currents(const mrd_track *c, mrd_real current)
{
    return on_axis(current, R(0.0), c->largest, c->currents);
}

static inline mrd_real rho_at(const mrd_track *c, axis_point warm, axis_point at, int element)
{
    return row_at(c, c->rho, 2, element, warm, at);
}

/* Motion and hysteresis of one moment, and what each row of the force table is multiplied with then. */
typedef struct {
    mrd_real x, v, a, w[2];
} moment;

static inline mrd_real multiplier(const mrd_track *c, const mrd_track_state *s, const moment *m, int row)
{
    const mrd_real speed = magnitude(m->v), sign = m->v < R(0.0) ? R(-1.0) : R(1.0);
    switch (row) {
    case MRD_ROW_STIFFNESS: return m->x;
    case MRD_ROW_MASS: return m->a;
    case MRD_ROW_VISCOUS: return s->gain[1] * sign * octaves_at(&c->viscous, speed);
    case MRD_ROW_SLIDING: return s->gain[2] * sign * octaves_at(&c->sliding, speed);
    case MRD_ROW_BREAKAWAY: return s->gain[2] * sign * octaves_at(&c->breakaway, speed);
    case MRD_ROW_YIELD:
        return s->gain[0] * (c->elements < R(0.5) ? sign * octaves_at(&c->built_up, speed) : m->w[0]);
    case MRD_ROW_SECOND:
        return s->gain[0] * (c->saturating > R(0.5) ? m->w[0] * octaves_at(&c->built_up, speed) : m->w[1]);
    default: return R(1.0); /* MRD_ROW_OFFSET */
    }
}

static void multipliers(const mrd_track *c, const mrd_track_state *s, const moment *m, mrd_real *by)
{
    for (int r = 0; r < MRD_ROWS; r++) by[r] = multiplier(c, s, m, r);
}

/* Force at every current of the table. */
static void force_row(const mrd_track *c, axis_point warm, const mrd_real *restrict by, mrd_real *restrict force)
{
    const int n = c->currents;
    const mrd_real *restrict sheet = c->force + warm.index * MRD_ROWS * n;
    for (int j = 0; j < n; j++) force[j] = R(0.0);
    for (int part = 0; part < 2; part++) {
        const mrd_real weight = part ? warm.share : R(1.0) - warm.share;
        if (!(weight > R(0.0))) continue;
        for (int r = 0; r < MRD_ROWS; r++) {
            const mrd_real factor = weight * by[r];
            const mrd_real *restrict row = sheet + (part * MRD_ROWS + r) * n;
            for (int j = 0; j < n; j++) force[j] += factor * row[j];
        }
    }
}

static mrd_real force_at(const mrd_track *c, axis_point warm, axis_point at, const mrd_real *by)
{
    mrd_real force = R(0.0);
    for (int r = 0; r < MRD_ROWS; r++)
        if (by[r] != R(0.0)) force += by[r] * row_at(c, c->force, MRD_ROWS, r, warm, at);
    return force;
}
