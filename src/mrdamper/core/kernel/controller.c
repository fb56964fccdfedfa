#include "controller.h"

#define R(x) ((mrd_real)(x))

static inline mrd_real size_of(mrd_real u) { return u < R(0.0) ? -u : u; }

static inline mrd_pattern pattern_of(mrd_real t)
{
    mrd_pattern p;
    memcpy(&p, &t, sizeof p);
    return p;
}

static inline mrd_real from_pattern(mrd_pattern p)
{
    mrd_real t;
    memcpy(&t, &p, sizeof t);
    return t;
}

static inline mrd_real octaves_at(const mrd_octaves *o, mrd_real size)
{
    const mrd_real sum = size + o->offset, t = sum < o->top ? sum : o->top;
    const int shift = MRD_REAL_DIGITS - o->bits;
    const mrd_pattern p = pattern_of(t), one = 1, mask = (one << MRD_REAL_DIGITS) - 1;
    const mrd_real *c = o->cell + 4 * (size_t)((p >> shift) - (pattern_of(o->offset) >> shift));
    const mrd_real l = from_pattern(((p << o->bits) & mask) | MRD_PATTERN_ONE) - R(1.0);
    return c[0] + l * (c[1] + l * (c[2] + l * c[3]));
}

static mrd_real octaves_inverse(const mrd_octaves *o, mrd_real value)
{
    int low = 0, high = o->cells;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (o->cell[4 * middle] <= value) low = middle;
        else high = middle;
    }
    const mrd_real *c = o->cell + 4 * low;
    const mrd_real chord = c[1] + c[2] + c[3];
    mrd_real l = chord > R(0.0) ? (value - c[0]) / chord : R(0.0);
    for (int i = 0; i < 4; i++) {
        l = l > R(0.0) ? (l < R(1.0) ? l : R(1.0)) : R(0.0);
        const mrd_real slope = c[1] + l * (R(2.0) * c[2] + l * R(3.0) * c[3]);
        if (!(slope > R(0.0))) break;
        l -= (c[0] + l * (c[1] + l * (c[2] + l * c[3])) - value) / slope;
    }
    l = l > R(0.0) ? (l < R(1.0) ? l : R(1.0)) : R(0.0);
    const int shift = MRD_REAL_DIGITS - o->bits;
    const mrd_pattern start = ((pattern_of(o->offset) >> shift) + (mrd_pattern)low) << shift;
    const mrd_pattern next = ((pattern_of(o->offset) >> shift) + (mrd_pattern)low + 1) << shift;
    const mrd_real t = from_pattern(start);
    return t + l * (from_pattern(next) - t) - o->offset;
}

static inline mrd_real curve_value(const mrd_track *c, mrd_real tau)
{
    return tau < R(0.0) ? -octaves_at(&c->fall_curve, -tau) : octaves_at(&c->rise_curve, tau);
}

static inline mrd_real curve_turned(const mrd_track *c, mrd_real tau)
{
    return tau < R(0.0) ? octaves_inverse(&c->rise_curve, octaves_at(&c->fall_curve, -tau))
                        : -octaves_inverse(&c->fall_curve, octaves_at(&c->rise_curve, tau));
}

static inline mrd_real limited(mrd_real u, mrd_real low, mrd_real high) { return u > low ? (u < high ? u : high) : low; }

/* sheet below and share of the next */
typedef struct { int index; mrd_real share; } place;

static inline place place_at(mrd_real u, mrd_real low, mrd_real high, int count)
{
    place p = {0, R(0.0)};
    if (count < 2) return p;
    const mrd_real scaled = limited((u - low) / (high - low), R(0.0), R(1.0)) * (mrd_real)(count - 1);
    p.index = (int)scaled;
    if (p.index > count - 2) p.index = count - 2;
    p.share = scaled - (mrd_real)p.index;
    return p;
}

static mrd_real rho_at(const mrd_track *c, place warm, int element, mrd_real current)
{
    const int columns = (int)c->currents;
    const place at = place_at(current, R(0.0), c->largest, columns);
    const mrd_real *cold = c->rho + (warm.index * 2 + element) * columns + at.index;
    const mrd_real *hot = cold + ((int)c->temperatures > 1 ? 2 * columns : 0);
    const mrd_real low = cold[0] + at.share * (cold[1] - cold[0]);
    const mrd_real high = hot[0] + at.share * (hot[1] - hot[0]);
    return low + warm.share * (high - low);
}

/* Travel in two straight pieces of velocity: from v0 to v1 over h. Moves tau of an element. */
static inline mrd_real moved_tau(const mrd_track *c, mrd_real tau, mrd_real *side, mrd_real rho, mrd_real v0, mrd_real v1,
                                 mrd_real h)
{
    const mrd_real top = c->rise_curve.top;
    mrd_real way[2], turn[2];
    int pieces = 1;
    if (v0 * v1 < R(0.0)) {
        const mrd_real share = v0 / (v0 - v1);
        way[0] = R(0.5) * v0 * share * h;
        way[1] = R(0.5) * v1 * (R(1.0) - share) * h;
        pieces = 2;
    } else {
        way[0] = R(0.5) * (v0 + v1) * h;
    }
    (void)turn;
    for (int i = 0; i < pieces; i++) {
        if (way[i] == R(0.0)) continue;
        const mrd_real now = way[i] > R(0.0) ? R(1.0) : R(-1.0);
        if (now != *side) {
            tau = curve_turned(c, tau);
            *side = now;
        }
        tau += rho * size_of(way[i]);
        tau = tau < top ? tau : top;
    }
    return tau;
}

void mrd_track_start(const mrd_track *c, mrd_track_state *s)
{
    memset(s, 0, sizeof *s);
    s->side = R(1.0);
    s->temperature = c->coldest;
}

typedef struct { mrd_real x, v, a, w[2]; } moment;

/* Force at every current of the table. */
static void forces(const mrd_track *c, place warm, const moment *m, mrd_real *restrict out)
{
    const int columns = (int)c->currents;
    const mrd_real speed = size_of(m->v), sign = m->v < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real basis[MRD_TRACK_ROWS];
    basis[MRD_ROW_OFFSET] = R(1.0);
    basis[MRD_ROW_STIFFNESS] = m->x;
    basis[MRD_ROW_MASS] = m->a;
    basis[MRD_ROW_VISCOUS] = sign * octaves_at(&c->viscous, speed);
    basis[MRD_ROW_COULOMB] = sign * octaves_at(&c->side, speed);
    basis[MRD_ROW_BREAKAWAY] = sign * octaves_at(&c->breakaway, speed);
    basis[MRD_ROW_YIELD] = m->w[0];
    basis[MRD_ROW_SECOND] = c->saturating > R(0.0) ? m->w[0] * octaves_at(&c->share, speed) : m->w[1];
    for (int j = 0; j < columns; j++) out[j] = R(0.0);
    for (int k = 0; k < 2; k++) {
        const mrd_real part = k ? warm.share : R(1.0) - warm.share;
        if (k && (int)c->temperatures < 2) break;
        const mrd_real *sheet = c->force + (warm.index + k) * MRD_TRACK_ROWS * columns;
        for (int r = 0; r < MRD_TRACK_ROWS; r++) {
            const mrd_real b = part * basis[r];
            const mrd_real *restrict row = sheet + r * columns;
            for (int j = 0; j < columns; j++) out[j] += b * row[j];
        }
    }
}

static mrd_real solved(const mrd_track *c, const mrd_real *force, mrd_real wanted)
{
    const int columns = (int)c->currents;
    const mrd_real pitch = c->largest / (mrd_real)(columns - 1);
    int best = 0;
    mrd_real least = size_of(force[0] - wanted);
    for (int j = 0; j + 1 < columns; j++) {
        const mrd_real low = force[j] - wanted, high = force[j + 1] - wanted;
        if (low == R(0.0)) return pitch * (mrd_real)j;
        if ((low < R(0.0)) != (high < R(0.0))) return pitch * ((mrd_real)j + low / (low - high));
        if (size_of(high) < least) { least = size_of(high); best = j + 1; }
    }
    return pitch * (mrd_real)best;
}

static void lag_forward(const mrd_track *c, mrd_real given, mrd_real *first, mrd_real *second)
{
    const int steps = (int)c->lag_steps;
    for (int i = 0; i < steps; i++) {
        const mrd_real before = *first;
        *first = given + (before - given) * (given > before ? c->rise : c->fall);
        const mrd_real mean = R(0.5) * (before + *first);
        *second = mean + (*second - mean) * c->second;
    }
}

static inline mrd_real delayed(const mrd_track *c, const mrd_track_state *s, int ago)
{
    /* the command as it reaches the lags `ago` periods before the newest, past the dead time */
    const int n = (int)c->delay + ago;
    const mrd_real newer = s->line[(s->at + MRD_TRACK_DELAY - n) % MRD_TRACK_DELAY];
    const mrd_real older = s->line[(s->at + MRD_TRACK_DELAY - n - 1) % MRD_TRACK_DELAY];
    return newer + c->delay_part * (older - newer);
}

mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, mrd_real now, mrd_real ahead, mrd_real displacement,
                        mrd_real temperature)
{
    const mrd_real h = c->period;
    const place warm = place_at(temperature, c->coldest, c->warmest, (int)c->temperatures);
    const int elements = (int)c->elements;

    /* motion */
    const mrd_real v_before = s->v;
    if (!s->started) {
        s->x = displacement;
        s->started = 1;
    } else {
        const mrd_real xp = s->x + h * (s->v + R(0.5) * h * s->a), vp = s->v + h * s->a;
        const mrd_real gap = displacement - xp;
        s->x = xp + c->gain_x * gap;
        s->v = vp + c->gain_v * gap;
        s->a = s->a + c->gain_a * gap;
    }

    /* hysteresis up to now, at the current that was applied over the interval */
    const mrd_real applied_before = s->second;
    lag_forward(c, delayed(c, s, 0), &s->first, &s->second);
    const mrd_real applied = R(0.5) * (applied_before + s->second);
    const int bank = (int)c->bank;
    mrd_real side = s->side;
    if (!bank) {
        for (int e = 0; e < elements; e++) {
            side = s->side;
            s->tau[e] = moved_tau(c, s->tau[e], &side, rho_at(c, warm, e, applied), v_before, s->v, h);
        }
    } else {
        for (int b = 0; b < bank; b++)
            for (int e = 0; e < elements; e++) {
                side = s->side;
                s->bank_tau[b][e] = moved_tau(c, s->bank_tau[b][e], &side,
                    rho_at(c, warm, e, c->largest * (mrd_real)b / (mrd_real)(bank - 1)), v_before, s->v, h);
            }
    }
    s->side = side;

    /* the free answer of the lags to what is under way and the last command held */
    const mrd_real p = c->preview;
    mrd_real f1 = s->first, f2 = s->second, unit1 = R(0.0), unit2 = R(0.0);
    if (p > R(0.0)) {
        const int steps = (int)(p / h + R(0.5));
        for (int i = 0; i < steps; i++) {
            const int ago = -1 - i;
            const int d = (int)c->delay;
            mrd_real u;
            if (d + ago >= 0) u = delayed(c, s, ago);
            else if (d + ago == -1) u = s->command + c->delay_part * (s->line[s->at % MRD_TRACK_DELAY] - s->command);
            else u = s->command;
            lag_forward(c, u, &f1, &f2);
            if (d + ago < 0) lag_forward(c, d + ago == -1 ? R(1.0) - c->delay_part : R(1.0), &unit1, &unit2);
        }
    }

    moment m;
    m.a = s->a;
    m.v = s->v + p * s->a;
    m.x = s->x + p * (s->v + R(0.5) * p * s->a);
    const mrd_real wanted = p > R(0.0) ? ahead : now;
    const mrd_real sign = m.v < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real force[MRD_TRACK_CURRENTS], current;
    if (bank) {
        mrd_real level[MRD_TRACK_BANK];
        for (int b = 0; b < bank; b++) {
            for (int e = 0; e < 2; e++) {
                mrd_real sd = s->side;
                const mrd_real own = c->largest * (mrd_real)b / (mrd_real)(bank - 1);
                mrd_real tau = s->bank_tau[b][e];
                if (p > R(0.0)) tau = moved_tau(c, tau, &sd, rho_at(c, warm, e, own), s->v, m.v, p);
                m.w[e] = sd * curve_value(c, tau);
            }
            forces(c, warm, &m, force);
            level[b] = force[(int)((mrd_real)b * (c->currents - R(1.0)) / (mrd_real)(bank - 1) + R(0.5))];
        }
        mrd_track small = *c;
        small.currents = c->bank;
        current = solved(&small, level, wanted);
    } else {
        for (int e = 0; e < 2; e++) {
            mrd_real sd = s->side;
            mrd_real tau = s->tau[e];
            if (p > R(0.0)) tau = moved_tau(c, tau, &sd, rho_at(c, warm, e, R(0.5) * (s->second + f2)), s->v, m.v, p);
            m.w[e] = sd * curve_value(c, tau);
        }
        if (c->is_static > R(0.0)) m.w[0] = m.w[1] = sign;
        forces(c, warm, &m, force);
        current = solved(c, force, wanted);
        if (c->margin >= R(0.0)) {
            m.w[0] = m.w[1] = sign;
            forces(c, warm, &m, force);
            const mrd_real most = solved(c, force, wanted) + c->margin;
            if (current > most) current = most;
        }
    }
    if (c->reach > R(0.0) && unit2 > R(0.0))
        current += c->reach * ((current - f2) / unit2 + s->command - current);
    current = limited(current, R(0.0), c->largest);
    s->at = (s->at + 1) % MRD_TRACK_DELAY;
    s->line[s->at] = current;
    s->command = current;
    return current;
}
