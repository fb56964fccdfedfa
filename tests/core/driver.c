/* Every law over random motions, extremes among them, for the sanitizers: any report of theirs ends the program.
 *
 * It includes the kernel's one translation unit, so that it reaches what the kernel keeps to itself.
 */
#include "kernel.c"

#include <stdio.h>

#define SAMPLES 400

static uint64_t state = UINT64_C(0x9e3779b97f4a7c15);

static double uniform(double low, double high)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return low + (high - low) * ((double)(state >> 11) / 9007199254740992.0);
}

static double decades(double low, double high) { return exp(uniform(log(low), log(high))); }

/* A run in batches of a few samples is the run: 0 when the forces are the same to the bit. */
static int in_batches(const mrd_api *api, const mrd_model *m, size_t n, double step, const double *x, const double *v,
                      const double *a, double dead_band, const double *whole)
{
    mrd_motion motion;
    mrd_state carried;
    mrd_workspace *workspace = api->workspace_open();
    memset(&motion, 0, sizeof motion);
    memset(&carried, 0, sizeof carried);
    int off = !workspace;
    for (size_t begin = 0, end = 0; end < n && !off;) {
        end = end + 1 + (size_t)uniform(0.0, 60.0) < n ? end + 1 + (size_t)uniform(0.0, 60.0) : n;
        if (end > n) end = n;
        const size_t known = end - begin;
        mrd_record batch;
        double *force = malloc(known * sizeof *force);
        if (!force || api->batch_open(&batch, known, step, x + begin, v + begin, a + begin, dead_band, 2.5e-3, SAMPLES,
                                      end == n, &motion) != MRD_OK) {
            free(force);
            off = 1;
            break;
        }
        off = api->carry(m, &batch, &carried, force, workspace) != MRD_OK;
        if (batch.n > batch.behind)
            off |= memcmp(force + batch.behind, whole + begin + batch.behind, (batch.n - batch.behind) * sizeof *force) != 0;
        begin += batch.n ? batch.n - 1 : 0;
        api->record_close(&batch);
        free(force);
    }
    api->workspace_close(workspace);
    return off;
}

static double one_of(const double *values, size_t count) { return values[(size_t)uniform(0.0, (double)count) % count]; }

/* Coefficients over the whole of each law's admissible range, its ends included. */
static void draw(mrd_law law, double *c)
{
    static const double kappas[] = {-1.0, -0.99, 0.0, 0.5, 1.0}, exponents[] = {0.2, 0.3, 1.0, 2.0, 12.0, 20.0};
    const double kappa = uniform(0.0, 1.0) < 0.5 ? one_of(kappas, 5) : uniform(-1.0, 1.0);
    const double n = uniform(0.0, 1.0) < 0.5 ? one_of(exponents, 6) : uniform(0.2, 20.0);
    const double rho = decades(1e-2, 1e8), yield = uniform(0.0, 1.0) < 0.2 ? 0.0 : decades(1.0, 1e4);
    c[C_VISCOSITY] = uniform(0.0, 1e3);
    c[C_VISCOUS_EXPONENT] = uniform(0.3, 1.5);
    c[C_STIFFNESS] = uniform(0.0, 1e3);
    c[C_OFFSET] = uniform(-100.0, 100.0);
    c[C_MASS] = uniform(0.0, 5.0);
    c[C_COULOMB] = uniform(0.0, 1.0) < 0.5 ? 0.0 : 20.0;
    c[C_BREAKAWAY] = uniform(0.0, 20.0);
    c[C_STRIBECK] = decades(1e-6, 10.0);
    c[C_TRANSITION] = decades(1e-7, 10.0);
    c[BW_YIELD] = yield;
    switch (law) {
    case MRD_BOUC_WEN:
        c[BW_RHO] = rho;
        c[BW_KAPPA] = kappa;
        c[BW_N] = n;
        break;
    case MRD_DAHL: c[BW_RHO] = rho; break;
    case MRD_SATURATING:
        c[SAT_RATE] = uniform(0.0, 1e3);
        c[SAT_VELOCITY] = decades(1e-6, 1e2);
        c[SAT_RHO] = rho;
        c[SAT_KAPPA] = kappa;
        c[SAT_N] = n;
        break;
    case MRD_BINGHAM: c[BH_VELOCITY] = decades(1e-7, 10.0); break;
    case MRD_TANH:
        c[TH_SLOPE] = decades(1e-3, 1e6);
        c[TH_SHIFT] = uniform(-20.0, 20.0);
        break;
    case MRD_LUGRE:
        c[LG_RHO] = rho;
        c[LG_EXCESS] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1e-3, 1e2);
        c[LG_FADE] = decades(1e-6, 10.0);
        c[LG_DAMPING] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1.0, 1e6);
        break;
    case MRD_SPENCER:
        c[SP_SERIES] = decades(1e-3, 1e12);
        c[SP_VISCOSITY] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1.0, 1e12);
        c[SP_STIFFNESS] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1.0, 1e12);
        c[SP_RHO] = rho;
        c[SP_KAPPA] = kappa;
        c[SP_N] = n;
        break;
    default:
        c[SV_THINNING] = uniform(0.0, 1.0) < 0.2 ? 0.0 : decades(1e-3, 1e4);
        c[SV_EXPONENT] = uniform(0.05, 1.5);
        c[SV_VELOCITY] = decades(1e-5, 10.0);
        c[SV_POSITION] = uniform(-2.0, 2.0);
        c[SV_SPRING] = decades(1.0, 1e12);
        c[SV_GAP] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1e-9, 1.0);
        c[SV_CORNER] = decades(1e-9, 1.0);
        c[SV_LEAK] = uniform(0.0, 1.0) < 0.3 ? 0.0 : decades(1.0, 1e12);
        c[SV_LEAK_EXPONENT] = uniform(0.0, 1.0) < 0.3 ? 1.0 : uniform(0.2, 2.0);
    }
}

/* A motion: two tones, or rest, or rest and then a jump of a stroke; `n` samples. */
static void move(int kind, double size, double step, size_t n, double *x, double *v, double *a)
{
    const double one = uniform(0.5, 8.0), two = uniform(0.5, 8.0), phase = uniform(0.0, 6.0);
    for (size_t i = 0; i < n; i++) {
        const double t = step * (double)i, p = one * t, q = two * t + phase;
        x[i] = kind == 1 ? size : kind == 2 && i < n / 2 ? 0.0 : size * (sin(p) + 0.5 * sin(q));
        v[i] = kind == 1 || (kind == 2 && i < n / 2) ? 0.0 : size * (one * cos(p) + 0.5 * two * cos(q));
        a[i] = kind ? 0.0 : -size * (one * one * sin(p) + 0.5 * two * two * sin(q));
        if (kind == 3) x[i] += 0.3 * size * uniform(-1.0, 1.0);
    }
}

int main(void)
{
    static const int laws[] = {MRD_BOUC_WEN, MRD_DAHL,  MRD_SATURATING, MRD_BINGHAM,
                               MRD_TANH,     MRD_LUGRE, MRD_SPENCER,    MRD_SERIES_VALVE};
    static const double sizes[] = {0.0, 1e-9, 1e-4, 0.01, 1.0, 1e4};
    const mrd_api *api = MRD_API();
    size_t runs = 0, unfinished = 0;
    for (int round = 0; round < 60; round++) {
        for (size_t l = 0; l < sizeof laws / sizeof *laws; l++) {
            const mrd_law law = (mrd_law)laws[l];
            const size_t count = (size_t)api->coefficient_count(laws[l]);
            const size_t n = round % 10 == 0 ? 1 : round % 10 == 1 ? 2 : SAMPLES;
            const double size = one_of(sizes, 6), step = decades(1e-4, 5e-2);
            /* Exactly as long as said: a read past the end is seen. */
            double *x = malloc(n * sizeof *x), *v = malloc(n * sizeof *v), *a = malloc(n * sizeof *a);
            double *coefficient = malloc(count * n * sizeof *coefficient), *force = malloc(n * sizeof *force);
            double *columns = malloc(count * n * sizeof *columns), *seed = malloc(n * sizeof *seed);
            double *sums = malloc(2 * (count + 2) * (count + 2) * sizeof *sums), c[MRD_COEFFICIENTS], error = 0.0;
            mrd_record record;
            if (!x || !v || !a || !coefficient || !force || !columns || !seed || !sums) return 2;
            move(round % 4, size, step, n, x, v, a);
            draw(law, c);
            /* 1 + position x stays positive over the stroke (1.8 sizes): the law's own condition. */
            if (law == MRD_SERIES_VALVE) c[SV_POSITION] *= 0.25 / (size > 1e-3 ? size : 1e-3);
            if (api->record_open(&record, n, step, x, v, a, round % 3 ? 0.0 : 0.1 * size, 2.5e-3) != MRD_OK)
                return 3;
            for (size_t i = 0; i < n; i++) seed[i] = uniform(-1.0, 1.0);

            mrd_direction direction[MRD_COEFFICIENTS];
            for (size_t k = 0; k < count; k++) {
                direction[k].coefficient = (int)k;
                direction[k].seed = NULL;
                direction[k].stride = 0;
            }
            mrd_model constant = {law, c, 0}, varying = {law, coefficient, n};
            if (api->run(&constant, &record, count, direction, force, columns, NULL) != MRD_OK) return 4;
            for (size_t i = 0; i < n; i++) unfinished += !(fabs(force[i]) < HUGE_VAL);
            const double dead_band = round % 3 ? 0.0 : 0.1 * size;
            if (api->run(&constant, &record, 0, NULL, force, NULL, NULL) != MRD_OK) return 4;
            if (in_batches(api, &constant, n, step, x, v, a, dead_band, force)) return 9;
            api->gram(count, n, columns, n / 2, sums);
            if (api->causal(&constant, &record, force) != MRD_OK) return 5;
            const mrd_record *const records[] = {&record};
            const double *const measured[] = {force};
            const size_t from[] = {n / 3};
            if (api->squared_errors(law, 1, records, measured, from, 1, c, &error) != MRD_OK) return 6;
            int by[MRD_COEFFICIENTS];
            double two[2 * MRD_COEFFICIENTS];
            for (size_t k = 0; k < count; k++) {
                by[k] = (int)k;
                two[k] = two[count + k] = c[k];
            }
            if (api->gram_sums(law, 1, records, measured, from, 2, two, count, by, 1, sums) != MRD_OK) return 9;

            for (size_t k = 0; k < count; k++) {
                const int shape = (law == MRD_BOUC_WEN && k >= BW_KAPPA) || (law == MRD_SATURATING && k >= SAT_KAPPA)
                               || (law == MRD_SPENCER && k >= SP_KAPPA);
                for (size_t i = 0; i < n; i++) coefficient[k * n + i] = c[k] * (shape ? 1.0 : 1.0 - 0.1 * fabs(seed[i]));
                direction[k].seed = seed;
                direction[k].stride = 1;
            }
            if (law == MRD_SERIES_VALVE) /* the exponents and the corner keep their range */
                for (size_t i = 0; i < n; i++) {
                    coefficient[(size_t)SV_EXPONENT * n + i] = c[SV_EXPONENT];
                    coefficient[(size_t)SV_LEAK_EXPONENT * n + i] = c[SV_LEAK_EXPONENT];
                    coefficient[(size_t)SV_CORNER * n + i] = c[SV_CORNER];
                }
            if (api->run(&varying, &record, count, direction, force, columns, NULL) != MRD_OK) return 7;
            if (api->causal(&varying, &record, force) != MRD_OK) return 8;
            api->lag(n, step, round % 2 ? 0.0 : 0.05, 0.02, seed, force, x, NULL);
            runs++;

            api->record_close(&record);
            free(sums);
            free(seed);
            free(columns);
            free(force);
            free(coefficient);
            free(a);
            free(v);
            free(x);
        }
    }
    double tau[64], w[64], slope[64], by_kappa[64], by_n[64];
    for (size_t i = 0; i < 64; i++) tau[i] = (i % 2 ? 1.0 : -1.0) * (i < 2 ? 0.0 : decades(1e-300, 1e300));
    for (int k = 0; k < 200; k++)
        api->curve(k % 5 == 0 ? -1.0 : k % 5 == 1 ? 1.0 : uniform(-1.0, 1.0), k % 7 == 0 ? 0.2 : k % 7 == 1 ? 20.0 : uniform(0.2, 20.0),
                   64, tau, w, slope, by_kappa, by_n);
    printf("%zu runs, %zu forces that are not finite\n", runs, unfinished);
    return unfinished ? 1 : 0;
}
