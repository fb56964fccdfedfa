/* Runge-Kutta in time for the Bouc-Wen law, written by hand: what one does without a library.
 *
 * Classical RK4 of w' = rho v (1 - k |w|^n), k = 1 where w and v have one sign and kappa elsewhere, `sub` steps a
 * sample; the velocity at the ends and the middle of each step is given. Candidates are the inner loop, so that the
 * compiler turns it into vectors (-O3 -march=native -ffast-math calls the vector pow of the mathematics library).
 */
#include <math.h>
#include <stddef.h>

static inline double slope(double w, double v, double rho, double kappa, double n)
{
    const double k = w * v >= 0.0 ? 1.0 : kappa;
    return rho * v * (1.0 - k * pow(fabs(w) + 1e-300, n));
}

/* velocity[2 sub (samples - 1) + 1]; rows of candidates: yield[c], rho[c], kappa[c], n[c]; w[c] is room to work.
 * errors[candidate] = sum of squared errors [N^2]; force takes the first candidate's, NULL: nobody's. */
void rk4_errors(size_t samples, size_t sub, double step, const double *restrict velocity, const double *restrict measured,
                size_t candidates, const double *restrict yield, const double *restrict rho,
                const double *restrict kappa, const double *restrict n, double *restrict w, double *restrict errors,
                double *force)
{
    const double h = step / (double)sub;
    for (size_t j = 0; j < candidates; j++) w[j] = errors[j] = 0.0;
    for (size_t i = 0; i < samples; i++) {
        for (size_t s = 0; i && s < sub; s++) {
            const double *at = velocity + 2 * ((i - 1) * sub + s), v0 = at[0], v1 = at[1], v2 = at[2];
            for (size_t j = 0; j < candidates; j++) {
                const double u = w[j], r = rho[j], k = kappa[j], e = n[j];
                const double a = slope(u, v0, r, k, e), b = slope(u + 0.5 * h * a, v1, r, k, e);
                const double c = slope(u + 0.5 * h * b, v1, r, k, e), d = slope(u + h * c, v2, r, k, e);
                w[j] = u + h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
        }
        if (force) force[i] = yield[0] * w[0];
        for (size_t j = 0; j < candidates; j++) {
            const double e = measured[i] - yield[j] * w[j];
            errors[j] += e * e;
        }
    }
}
