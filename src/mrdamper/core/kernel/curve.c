/* The universal curve of the Bouc-Wen law.
 *
 * On a monotone piece of motion, with w counted positive in the direction of motion and
 * tau = rho |x - x_turn|,
 *
 *     dw/dtau = 1 - w^n             w >= 0   (the "rise")
 *     dw/dtau = 1 - kappa |w|^n     w <  0   (the "fall" towards zero)
 *
 * One curve Y(tau) through Y(0) = 0 therefore describes a whole record. Both branches satisfy
 * u' = 1 - k u^n, u(0) = 0, with u = |w|, k = 1 or kappa, and |tau| instead of tau. They are tabulated
 * as cubics on cells whose width doubles with every octave of |tau| + offset: narrow cells where u^n
 * bends, wide cells where the curve is flat. The floating-point bits of |tau| + offset contain the index
 * of the cell.
 *
 * The knots are computed by Taylor series, without a call of pow for each knot. The derivatives with
 * respect to n and kappa are computed at the same knots by the derivative of the same series. Therefore,
 * the tangents are the exact derivatives of the tabulated curve.
 */
#include <math.h>
#include <string.h>

#define ORDER 6      /* order of the Taylor step between knots */
#define SERIES 6     /* number of terms of the series in tau^n near zero */

/* Parts of the data of one cell in a table with tangents. */
enum { BY_NOTHING, BY_TAU, BY_N, BY_KAPPA, POINT };

typedef struct {
    double offset;      /* power of two added to tau before the look-up */
    double top;         /* largest tau + offset inside the table */
    double last;        /* u at and beyond `top` */
    double step_scale;  /* 2^bits: a cell of the octave [2^e, 2^(e+1)) is 2^e / step_scale wide */
    uint64_t base;      /* bits of offset, shifted */
    int shift;          /* 52 - log2(cells per octave) */
    size_t cells;
    double cell[4 * MRD_CELLS];
    double *all;        /* cubics of u, du/dtau, du/dn, du/dk, ordered by power; a cell fills two cache lines */
    double room[4 * POINT * MRD_CELLS + 8];
} branch;


typedef struct {
    double kappa, n;
    int tangents;
    branch rise, fall;
} curve;

static inline uint64_t bits_of(double t)
{
    uint64_t u;
    memcpy(&u, &t, sizeof u);
    return u;
}

static inline double from_bits(uint64_t u)
{
    double t;
    memcpy(&t, &u, sizeof t);
    return t;
}

/* Return the position of t = tau + offset inside its cell, 0 to 1. */
static inline double local_of(uint64_t bits, int shift)
{
    return from_bits(((bits << (52 - shift)) & UINT64_C(0x000fffffffffffff)) | UINT64_C(0x3ff0000000000000)) - 1.0;
}

static inline double cubic_at(const double *restrict cell, uint64_t base, int shift, double t)
{
    const uint64_t bits = bits_of(t);
    const double *c = cell + 4 * ((bits >> shift) - base);
    const double l = local_of(bits, shift);
    return c[0] + l * (c[1] + l * (c[2] + l * c[3]));
}

/* Evaluate the cubics of a branch at n arguments. */
static inline void cubics_at(const branch *b, size_t n, const double *restrict t, double *restrict u)
{
    const double *restrict cell = b->cell;
    const uint64_t base = b->base;
    const int shift = b->shift;
    for (size_t i = 0; i < n; i++) u[i] = cubic_at(cell, base, shift, t[i]);
}

#define BLOCK 256

/* Evaluate the cubics of a branch and their derivatives at n <= BLOCK arguments; write POINT numbers per argument. */
static inline void points_at(const branch *b, size_t n, const double *restrict t, double *restrict out)
{
    const uint64_t base = b->base;
    const int shift = b->shift;
    uint64_t cell[BLOCK];
    double local[BLOCK];
    for (size_t i = 0; i < n; i++) {
        const uint64_t bits = bits_of(t[i]);
        cell[i] = (bits >> shift) - base;
        local[i] = local_of(bits, shift);
    }
    for (size_t i = 0; i < n; i++) {
        const double *restrict c = b->all + 4 * POINT * cell[i];
        const double l = local[i];
        for (size_t k = 0; k < POINT; k++)
            out[POINT * i + k] = c[k] + l * (c[POINT + k] + l * (c[2 * POINT + k] + l * c[3 * POINT + k]));
    }
}

/* Return du/dtau from the cubic. */
static inline double slope_at(const double *restrict cell, uint64_t base, int shift, double t)
{
    const uint64_t bits = bits_of(t);
    const double *c = cell + 4 * ((bits >> shift) - base);
    const double l = local_of(bits, shift);
    const double width = from_bits(bits & UINT64_C(0x7ff0000000000000)) * from_bits((uint64_t)(1023 + shift - 52) << 52);
    return (c[1] + l * (2.0 * c[2] + l * 3.0 * c[3])) / width;
}

static void hermite(double *c, double f0, double d0, double f1, double d1, double width)
{
    const double rise = f1 - f0;
    c[0] = f0;
    c[1] = d0 * width;
    c[2] = 3.0 * rise - (2.0 * d0 + d1) * width;
    c[3] = (d0 + d1) * width - 2.0 * rise;
}

/* Compute a monotone cubic for a curve that rises. Slopes are limited to three times the slope of the chord (Fritsch &
 * Carlson), so that the cubic stays between its knots. The curve then never falls and never exceeds 1. */
static void hermite_rising(double *c, double f0, double d0, double f1, double d1, double width)
{
    const double steepest = 3.0 * (f1 > f0 ? f1 - f0 : 0.0) / width;
    hermite(c, f0, d0 < steepest ? d0 : steepest, f1, d1 < steepest ? d1 : steepest, width);
}

/* A knot of the table: u, p = u^n, du/dn, dp/dn, du/dk, dp/dk. */
typedef struct {
    double u, p, un, pn, uk, pk;
} knot;

/* Return the knot at a small tau by the series u = tau sum b_j q^j, q = k tau^n, p = tau^n sum c_j q^j. */
static knot knot_near_zero(double tau, double k, double n, int tangents)
{
    double b[SERIES + 1], c[SERIES], bn[SERIES + 1], cn[SERIES];
    knot out = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    if (tau <= 0.0) return out;
    b[0] = 1.0;
    bn[0] = 0.0;
    for (int j = 0; j < SERIES; j++) {
        double sum = 0.0, sum_n = 0.0;
        for (int i = 1; i <= j; i++) {
            const double g = n * i - (j - i);
            sum += g * b[i] * c[j - i];
            sum_n += i * b[i] * c[j - i] + g * (bn[i] * c[j - i] + b[i] * cn[j - i]);
        }
        c[j] = j ? sum / j : 1.0;
        cn[j] = j ? sum_n / j : 0.0;
        const double d = (j + 1) * n + 1.0;
        b[j + 1] = -c[j] / d;
        bn[j + 1] = -cn[j] / d + c[j] * (j + 1) / (d * d);
    }
    const double power = pow(tau, n), log_tau = log(tau);
    double q = 1.0;
    for (int j = 0; j <= SERIES; j++) {
        out.u += tau * b[j] * q;
        if (tangents) {
            out.un += tau * q * (bn[j] + b[j] * j * log_tau);
            if (j) out.uk += tau * b[j] * j * pow(k, j - 1) * pow(power, j);
        }
        q *= k * power;
    }
    out.p = pow(out.u, n);
    if (tangents) {
        out.pn = out.p * (log(out.u) + n * out.un / out.u);
        out.pk = out.p * n * out.uk / out.u;
    }
    return out;
}

/* Advance a knot by h with the Taylor series of u' = 1 - k p, u p' = n p u'. */
static knot knot_step(knot a, double h, double k, double n, int tangents)
{
    static const double inverse[] = {0.0, 1.0, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5, 1.0 / 6, 1.0 / 7};
    double u[ORDER + 1], p[ORDER + 1];
    const double reciprocal = 1.0 / a.u;
    u[0] = a.u;
    p[0] = a.p;
    u[1] = 1.0 - k * a.p;
    for (int j = 1; j <= ORDER; j++) {
        double sum = 0.0;
        for (int i = 1; i <= j; i++) sum += (n * i - (j - i)) * u[i] * p[j - i];
        p[j] = sum * inverse[j] * reciprocal;
        if (j < ORDER) u[j + 1] = -k * p[j] * inverse[j + 1];
    }
    knot out = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (int j = ORDER; j >= 0; j--) {
        out.u = out.u * h + u[j];
        out.p = out.p * h + p[j];
    }
    if (!tangents) return out;

    double un[ORDER + 1], pn[ORDER + 1], uk[ORDER + 1], pk[ORDER + 1];
    un[0] = a.un;
    pn[0] = a.pn;
    uk[0] = a.uk;
    pk[0] = a.pk;
    un[1] = -k * a.pn;
    uk[1] = -a.p - k * a.pk;
    for (int j = 1; j <= ORDER; j++) {
        double sum_n = 0.0, sum_k = 0.0;
        for (int i = 1; i <= j; i++) {
            const double g = n * i - (j - i);
            sum_n += i * u[i] * p[j - i] + g * (un[i] * p[j - i] + u[i] * pn[j - i]);
            sum_k += g * (uk[i] * p[j - i] + u[i] * pk[j - i]);
        }
        pn[j] = (sum_n * inverse[j] - a.un * p[j]) * reciprocal;
        pk[j] = (sum_k * inverse[j] - a.uk * p[j]) * reciprocal;
        if (j < ORDER) {
            un[j + 1] = -k * pn[j] * inverse[j + 1];
            uk[j + 1] = (-p[j] - k * pk[j]) * inverse[j + 1];
        }
    }
    for (int j = ORDER; j >= 0; j--) {
        out.un = out.un * h + un[j];
        out.pn = out.pn * h + pn[j];
        out.uk = out.uk * h + uk[j];
        out.pk = out.pk * h + pk[j];
    }
    return out;
}

/* Store a cell with tangents. Only the fall branch (`to_one`) depends on kappa. */
static void cell_with_tangents(double *all, const double *cell, const double *by_n, const double *by_k, double width,
                               int to_one)
{
    for (int power = 0; power < 4; power++) {
        all[POINT * power + BY_NOTHING] = cell[power];
        all[POINT * power + BY_TAU] = power < 3 ? (power + 1) * cell[power + 1] / width : 0.0;
        all[POINT * power + BY_N] = by_n[power];
        all[POINT * power + BY_KAPPA] = to_one ? by_k[power] : 0.0;
    }
}

static void branch_build(branch *b, double k, double n, int tangents, int to_one)
{
    /* These numbers of cells per octave, and the first octave, limit the error of every cubic to 5e-7. */
    const int rise_bits = n <= 1.5 ? 4 : n < 6.0 ? 5 : n < 12.0 ? 6 : 7;
    const int bits = rise_bits + (to_one ? (n >= 12.0 ? 1 : n > 3.5 ? 2 : n > 2.0 ? 1 : 0) : 0);
    const double per_octave = (double)(1 << bits);
    const double smallest = per_octave * pow(4e-8, 1.0 / (n + 1.0));
    int exponent;
    (void)frexp(smallest, &exponent);
    exponent = exponent < -1 ? exponent : -1;
    b->offset = ldexp(1.0, exponent - 1);
    b->shift = 52 - bits;
    b->base = bits_of(b->offset) >> b->shift;
    b->step_scale = per_octave;
    b->all = b->room + (64 - (uintptr_t)b->room % 64) / sizeof(double);

    const double end = 26.0 / n + 2.0;
    double octave = b->offset, tau = 0.0;
    knot here = knot_near_zero(0.0, k, n, tangents), next;
    size_t cells = 0;
    int done = 0;
    while (!done && cells + (size_t)per_octave <= MRD_CELLS) {
        const double width = octave / per_octave;
        for (int i = 0; i < (int)per_octave; i++) {
            const double tau_next = tau + width;
            next = tau_next <= b->offset ? knot_near_zero(tau_next, k, n, tangents)
                                         : knot_step(here, width, k, n, tangents);
            if (!(next.u < 1.0) && k >= 1.0) { next.u = 1.0; next.p = 1.0; }
            hermite_rising(b->cell + 4 * cells, here.u, 1.0 - k * here.p, next.u, 1.0 - k * next.p, width);
            if (tangents) {
                double by_n[4], by_k[4];
                hermite(by_n, here.un, -k * here.pn, next.un, -k * next.pn, width);
                hermite(by_k, here.uk, -here.p - k * here.pk, next.uk, -next.p - k * next.pk, width);
                cell_with_tangents(b->all + 4 * POINT * cells, b->cell + 4 * cells, by_n, by_k, width, to_one);
            }
            cells++;
            tau = tau_next;
            here = next;
            if ((to_one && here.u >= 1.0) || tau >= end) { done = 1; break; }
        }
        octave *= 2.0;
    }
    b->cells = cells;
    b->top = (tau + b->offset) * (1.0 - 1e-15);
    b->last = cubic_at(b->cell, b->base, b->shift, b->top);
}

/* Return true if kappa and n are in the tabulated range, with a tolerance for the rounding of a logarithm. */
static int is_tabulated(double kappa, double n)
{
    return fabs(kappa) <= 1.0 + 1e-9 && n >= 0.2 - 1e-9 && n <= 20.0 + 1e-9;
}

static void curve_build(curve *c, double kappa, double n, int tangents)
{
    c->kappa = kappa;
    c->n = n;
    c->tangents = tangents;
    branch_build(&c->rise, 1.0, n, tangents, 0);
    branch_build(&c->fall, kappa, n, tangents, 1);
}

/* Return |tau| for u on one branch. Bisection of the knots finds the cell. Newton's method finds the position in it. */
static double branch_inverse(const branch *b, double u)
{
    size_t low = 0;
    for (size_t left = b->cells; left > 1;) { /* bisection without conditional jumps */
        const size_t half = left / 2;
        low += b->cell[4 * (low + half)] <= u ? half : 0;
        left -= half;
    }
    const double *c = b->cell + 4 * low;
    double l = (u - c[0]) / (c[1] + c[2] + c[3]);
    if (!(l >= 0.0 && l <= 1.0)) l = 0.5;
    for (int i = 0; i < 60; i++) {
        const double slope = c[1] + l * (2.0 * c[2] + l * 3.0 * c[3]);
        const double excess = c[0] + l * (c[1] + l * (c[2] + l * c[3])) - u;
        if (!(slope > 0.0)) break;
        double moved = l - excess / slope;
        if (moved < 0.0) moved = 0.0;
        if (moved > 1.0) moved = 1.0;
        const double change = fabs(moved - l);
        l = moved;
        if (change < 1e-15) break;
    }
    const uint64_t start = (b->base + low) << b->shift;
    const double t = from_bits(start);
    const double width = from_bits(start & UINT64_C(0x7ff0000000000000)) / b->step_scale;
    return t + l * width - b->offset;
}

typedef struct {
    double w, slope, by_n, by_kappa;
} curve_point;

static inline curve_point branch_point(const curve *c, int rising, double t)
{
    curve_point out = {0.0, 0.0, 0.0, 0.0};
    const branch *b = rising ? &c->rise : &c->fall;
    const double at = t < b->top ? t : b->top, sign = rising ? 1.0 : -1.0;
    if (!c->tangents) {
        out.w = sign * cubic_at(b->cell, b->base, b->shift, at);
        return out;
    }
    double point[POINT];
    points_at(b, 1, &at, point);
    out.w = sign * point[BY_NOTHING];
    out.slope = t < b->top ? point[BY_TAU] : 0.0;
    out.by_n = sign * point[BY_N];
    out.by_kappa = sign * point[BY_KAPPA];
    return out;
}

static curve_point curve_at(const curve *c, double tau)
{
    const int rising = tau >= 0.0;
    return branch_point(c, rising, fabs(tau) + (rising ? c->rise.offset : c->fall.offset));
}

/* Return the point of the curve at start + travel. The order of operations is the same as in hysteresis.c, where many
 * samples are computed, so that the results are bitwise equal. */
static curve_point curve_along(const curve *c, double start, double travel)
{
    const int rising = start + travel >= 0.0;
    return branch_point(c, rising, rising ? c->rise.offset + start + travel : c->fall.offset - start - travel);
}

/* Return tau for w, which is positive in the direction of motion. */
static double curve_inverse(const curve *c, double w)
{
    return w >= 0.0 ? branch_inverse(&c->rise, w) : -branch_inverse(&c->fall, -w);
}
