/* A plain C table kernel for one law, as one would write it by hand: what the project's kernel is measured against.
 *
 * Bouc-Wen force and squared error of many candidates on one record by the exact flow: no other law, no tangents,
 * no common terms but viscosity, spring and offset. It shares the method and no line with the kernel. The universal
 * curve u' = 1 - k u^n, u(0) = 0, is a cubic Hermite table on two uniform grids, a fine one near zero where u^n
 * bends; a knot comes from the last by a Taylor step. Built with -O3 -march=native -ffast-math.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define FINE 128   /* cells up to NEAR */
#define COARSE 256 /* ... and from there to the end */
#define NEAR 0.25
#define ORDER 6

typedef struct {
    double c[FINE + COARSE][4];
    double fine, coarse, end; /* cells per unit of tau; the last tau */
    int cells;
} table;

/* The solution at a small tau: three terms of its series in tau^n. */
static double near_zero(double tau, double k, double n)
{
    const double q = k * pow(tau, n), a = 1.0 / (n + 1.0), b = n * a / (2.0 * n + 1.0);
    const double c = -(0.5 * n * (n - 1.0) * a * a + n * b) / (3.0 * n + 1.0);
    return tau * (1.0 + q * (-a + q * (b + q * c)));
}

/* u after h, from u and its power: Taylor coefficients of u and of p = u^n from u p' = n p u'. */
static double taylor(double u0, double power, double h, double k, double n)
{
    double u[ORDER + 1], p[ORDER];
    u[0] = u0;
    p[0] = power;
    u[1] = 1.0 - k * p[0];
    for (int j = 1; j < ORDER; j++) {
        double sum = 0.0;
        for (int i = 1; i <= j; i++) sum += (n * i - (j - i)) * u[i] * p[j - i];
        p[j] = sum / (j * u0);
        u[j + 1] = -k * p[j] / (j + 1);
    }
    double out = u[ORDER];
    for (int j = ORDER - 1; j >= 0; j--) out = out * h + u[j];
    return out;
}

/* The fall branch ends where it reaches 1, which is the furthest that a state is behind its motion. */
static void build(table *t, double k, double n, int to_one)
{
    double u = 0.0, power = 0.0, tau = 0.0;
    t->end = NEAR + 26.0 / n + 2.0;
    t->fine = FINE / NEAR;
    t->coarse = COARSE / (t->end - NEAR);
    int i = 0;
    for (; i < FINE + COARSE && !(to_one && u >= 1.0); i++) {
        const double h = 1.0 / (i < FINE ? t->fine : t->coarse);
        double next = i < 8 ? near_zero(tau + h, k, n) : taylor(u, power, h, k, n);
        if (!to_one && next > 1.0) next = 1.0;
        const double slope = 1.0 - k * power, rise = next - u;
        power = pow(next, n);
        const double after = 1.0 - k * power;
        t->c[i][0] = u;
        t->c[i][1] = slope * h;
        t->c[i][2] = 3.0 * rise - (2.0 * slope + after) * h;
        t->c[i][3] = (slope + after) * h - 2.0 * rise;
        u = next;
        tau += h;
    }
    t->cells = i;
}

static inline double look_up(const table *t, double tau)
{
    const double in = tau < t->end * (1.0 - 1e-12) ? tau : t->end * (1.0 - 1e-12);
    const double cell = in < NEAR ? in * t->fine : FINE + (in - NEAR) * t->coarse;
    const int32_t i = (int32_t)cell;
    const double l = cell - i, *c = t->c[i];
    return c[0] + l * (c[1] + l * (c[2] + l * c[3]));
}

static double inverse(const table *t, double u)
{
    int low = 0, high = t->cells;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (t->c[middle][0] <= u) low = middle;
        else high = middle;
    }
    const double *c = t->c[low];
    double l = 0.5;
    for (int i = 0; i < 30; i++) {
        const double slope = c[1] + l * (2.0 * c[2] + l * 3.0 * c[3]);
        if (!(slope > 0.0)) break;
        double to = l - (c[0] + l * (c[1] + l * (c[2] + l * c[3])) - u) / slope;
        to = to < 0.0 ? 0.0 : to > 1.0 ? 1.0 : to;
        const double change = fabs(to - l);
        l = to;
        if (change < 1e-14) break;
    }
    return low < FINE ? (low + l) / t->fine : NEAR + (low - FINE + l) / t->coarse;
}

/* errors[candidate] = sum of squared errors [N^2]; `force` takes the first candidate's, NULL: nobody's.
 * Pieces of motion: first[pieces + 1], turn[pieces + 1], side[pieces]. A candidate: viscosity, stiffness, offset,
 * yield force, rho, kappa, n. */
void reference_errors(size_t samples, const double *restrict x, const double *restrict v, const double *restrict measured,
                      size_t pieces, const int64_t *first, const double *turn, const double *side, size_t candidates,
                      const double *candidate, double *errors, double *force)
{
    for (size_t j = 0; j < candidates; j++) {
        const double *p = candidate + 7 * j, c0 = p[0], k0 = p[1], f0 = p[2], yield = p[3], rho = p[4];
        table rise, fall;
        build(&rise, 1.0, p[6], 0);
        build(&fall, p[5], p[6], 1);
        double start = 0.0, sum = 0.0;
        for (size_t q = 0; q < pieces; q++) {
            const double s = side[q], at = turn[q];
            size_t i = (size_t)first[q];
            const size_t end = q + 1 < pieces ? (size_t)first[q + 1] : samples;
            for (; i < end; i++) { /* falling: w < 0 in the direction of motion */
                const double tau = start + rho * s * (x[i] - at);
                if (tau >= 0.0) break;
                const double f = c0 * v[i] + k0 * x[i] + f0 - yield * s * look_up(&fall, -tau), e = measured[i] - f;
                sum += e * e;
                if (force && !j) force[i] = f;
            }
            if (force && !j)
                for (size_t l = i; l < end; l++)
                    force[l] = c0 * v[l] + k0 * x[l] + f0 + yield * s * look_up(&rise, start + rho * s * (x[l] - at));
            for (; i < end; i++) {
                const double tau = start + rho * s * (x[i] - at);
                const double f = c0 * v[i] + k0 * x[i] + f0 + yield * s * look_up(&rise, tau), e = measured[i] - f;
                sum += e * e;
            }
            const double last = start + rho * fabs(turn[q + 1] - at);
            const double w = last >= 0.0 ? look_up(&rise, last) : -look_up(&fall, -last);
            start = -w >= 0.0 ? inverse(&rise, -w) : -inverse(&fall, w);
        }
        errors[j] = sum;
    }
}
