/* Fuzzing target for the laws of the kernel: records, forces, tangents, Gram matrices and the curve, computed from any
 * motion and any coefficients.
 *
 * If the coefficients are in their ranges and the motion is finite, then the force must be finite. For all other input,
 * the sanitizers must find no fault. This file includes kernel.c; implicit_run.c is compiled separately.
 */
#include "kernel.c"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SAMPLES_MAX 40

typedef struct {
    const uint8_t *at;
    size_t left;
} bytes;

static uint8_t next(bytes *b)
{
    if (!b->left) return 0;
    b->left--;
    return *b->at++;
}

/* Return a number from 0 to 1, including both ends, from the next two bytes. */
static double fraction(bytes *b)
{
    const unsigned high = next(b), low = next(b);
    return (double)(high * 256u + low) / 65535.0;
}

static double between(bytes *b, double low, double high) { return low + (high - low) * fraction(b); }

static double over_decades(bytes *b, double low, double high) { return exp(between(b, log(low), log(high))); }

/* Return an arbitrary double: eight raw bytes, a plain decimal number, or a value at which the arithmetic changes. */
static double any(bytes *b)
{
    static const double odd[] = {0.0, -0.0, 1.0, -1.0, 4.9e-324, 2.2e-308, 1e-30, 1e-9, 1e9, 2147483648.0, 9.3e18, 1e30,
                                 1.7e308, -1.7e308, HUGE_VAL, -HUGE_VAL, NAN, 0.5, 273.15, 1e-3};
    const uint8_t kind = next(b);
    if (kind < 64) return odd[kind % (sizeof odd / sizeof *odd)];
    if (kind < 192) return ((int)next(b) - 128) * pow(10.0, (int)(kind % 16) - 10);
    uint8_t raw[8];
    double value;
    for (int k = 0; k < 8; k++) raw[k] = next(b);
    memcpy(&value, raw, sizeof value);
    return value;
}

static void require(int condition, const char *fault, double value)
{
    if (condition) return;
    fprintf(stderr, "fault: %s (%.17g)\n", fault, value);
    abort();
}

typedef struct {
    double low, high;
    int decades;
} range;

/* Ranges in which the curve is tabulated. The kernel tolerates rounding at their ends. */
#define KAPPA {-1 - 5e-10, 1 + 5e-10, 0}
#define N {0.2 - 5e-10, 20 + 5e-10, 0}

/* Return the valid range of a coefficient, the same as in models/laws.py. */
static range range_of(int law, int k)
{
    static const range common[MRD_COMMON] = {{0, 1e3, 0}, {0, 1e3, 0}, {-100, 100, 0}, {0, 5, 0}, {0, 20, 0},
                                             {0, 20, 0}, {1e-6, 10, 1}, {1e-7, 10, 1}, {0.3, 1.5, 0}};
    static const range yield = {0, 1e4, 0}, rho = {1e-2, 1e8, 1};
    static const range bouc_wen[] = {{0, 1e4, 0}, {1e-2, 1e8, 1}, KAPPA, N};
    static const range saturating[] = {{0, 1e4, 0}, {0, 1e3, 0}, {1e-6, 1e2, 1}, {1e-2, 1e8, 1}, KAPPA, N};
    static const range twice[] = {{0, 1e4, 0}, {0, 1e4, 0}, {1e-2, 1e8, 1}, {1e-2, 1e8, 1}, KAPPA, N};
    static const range tanh_law[] = {{0, 1e4, 0}, {1e-3, 1e6, 1}, {-20, 20, 0}};
    static const range lugre_law[] = {{0, 1e4, 0}, {1e-2, 1e8, 1}, {0, 1e2, 0}, {1e-6, 10, 1}, {0, 1e6, 0}};
    static const range spencer_law[] = {{0, 1e4, 0}, {1e-3, 1e12, 1}, {0, 1e12, 0}, {0, 1e12, 0}, {1e-2, 1e8, 1}, KAPPA,
                                        N};
    static const range valve[] = {{0, 1e4, 0}, {0, 1e4, 0}, {0.05, 1.5, 0}, {1e-5, 10, 1}, {-2, 2, 0}, {1, 1e12, 1},
                                  {0, 1e-2, 0}, {1e-3, 1, 1}, {0, 1e8, 0}, {0.3, 2, 0}};
    static const range chain_law[] = {{0, 1e4, 0}, {1e-9, 10, 1}, {0, 1e3, 0}, {0, 1e4, 0}, {0.05, 2, 0}, {1e-9, 1e3, 1},
                                      {0, 1e5, 0}, {-0.5, 0.5, 0}, {-0.9, 0.9, 0}, {-1e3, 1e3, 0}, {-1e3, 1e3, 0}, {1e-6, 1e12, 1},
                                      {0, 1e-2, 0}, {1e-12, 1, 1}, {0, 1e8, 0}, {0.2, 2, 0}, {0, 1, 0}, {1e-3, 1e12, 1},
                                      {0, 10, 0}, {0, 1e4, 0}, {1e-3, 1e12, 1}, {0, 1e2, 0}, {1e-9, 10, 1}, {0, 1e4, 0},
                                      {1e-3, 1e12, 1}, {-1e4, 1e4, 0}, {1e-9, 1e3, 1}, {0, 1, 0}, {0, 1, 0}, {0, 1e-3, 0},
                                      {0, 1, 0}, {0, 10, 0}, {1e-6, 1e4, 1}, {1e-12, 1, 1}, {0, 1e-2, 0}};
    _Static_assert(sizeof chain_law / sizeof *chain_law == CH_COUNT - MRD_COMMON, "one range for each coefficient");
    if (k < MRD_COMMON) return common[k];
    k -= MRD_COMMON;
    switch (law) {
    case MRD_BOUC_WEN: return bouc_wen[k];
    case MRD_DAHL: return k ? rho : yield;
    case MRD_SATURATING: return saturating[k];
    case MRD_DOUBLE: return twice[k];
    case MRD_BINGHAM: return k ? (range){1e-7, 10, 1} : yield;
    case MRD_TANH: return tanh_law[k];
    case MRD_LUGRE: return lugre_law[k];
    case MRD_SPENCER: return spencer_law[k];
    case MRD_CHAIN_LAW: return chain_law[k];
    default: return valve[k];
    }
}

static double sample(bytes *b, range r)
{
    if (r.decades) return over_decades(b, r.low, r.high);
    return between(b, r.low, r.high);
}

static double *allocate(size_t count)
{
    double *values = malloc((count ? count : 1) * sizeof *values);
    if (!values) exit(0);
    return values;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes b = {data, size};
    const mrd_api *api = MRD_API();
    const int law = next(&b) % 10, kind = next(&b);
    const int wild_motion = kind & 1, wild_numbers = kind & 2, varying = kind & 4;
    const size_t n = 1 + next(&b) % SAMPLES_MAX, count = (size_t)api->coefficient_count(law);
    double step = over_decades(&b, 1e-5, 1.0), longest = step / between(&b, 0.5, 8.0), band = between(&b, 0.0, 1e-3);
    /* The arrays have exactly the stated lengths, so that the sanitizer detects a read past the end. */
    double *x = allocate(n), *v = allocate(n), *a = allocate(n), *c = allocate(count * (varying ? n : 1)), *force = allocate(n);
    double *columns = allocate(count * n), *seed = allocate(n), *sums = allocate(count * count);
    for (size_t i = 0; i < n; i++) {
        x[i] = wild_motion ? any(&b) : between(&b, -0.1, 0.1);
        v[i] = wild_motion ? any(&b) : between(&b, -2.0, 2.0);
        a[i] = wild_motion ? any(&b) : between(&b, -100.0, 100.0);
        seed[i] = between(&b, -1.0, 1.0);
    }
    for (size_t k = 0; k < count; k++) {
        const range r = range_of(law, (int)k);
        const double first = wild_numbers ? any(&b) : sample(&b, r);
        for (size_t i = 0; i < (varying ? n : 1); i++) c[k * (varying ? n : 1) + i] = first;
    }
    mrd_record record;
    if (api->record_open(&record, n, step, x, v, a, band, longest) == MRD_OK) {
        const mrd_model model = {(mrd_law)law, c, varying ? n : 0};
        mrd_direction direction[MRD_DIRECTIONS];
        for (size_t k = 0; k < count; k++) direction[k] = (mrd_direction){(int)k, k % 2 ? seed : NULL, k % 4 == 1};
        mrd_workspace *workspace = api->workspace_open();
        for (int round = 0; round < 2; round++) { /* The second run uses the curve that the first run has cached. */
            const mrd_status status = api->run(&model, &record, count, direction, force, columns, workspace);
            require(status == MRD_OK || status == MRD_NOT_TABULATED || status == MRD_SHAPE_VARIES, "the status", status);
            require(status == MRD_OK || wild_numbers, "sound coefficients are taken", status);
            for (size_t i = 0; status == MRD_OK && !wild_motion && !wild_numbers && i < n; i++)
                require(fabs(force[i]) < HUGE_VAL, "the force of a sound law is finite", force[i]);
        }
        api->workspace_close(workspace);
        api->gram(count, n, columns, next(&b) % (n + 1), sums);
        if (api->causal(&model, &record, force) == MRD_OK)
            for (size_t i = 0; !wild_motion && !wild_numbers && i < n; i++)
                require(fabs(force[i]) < HUGE_VAL, "the causal force of a sound law is finite", force[i]);
        if (!varying) {
            const mrd_record *const records[] = {&record};
            const double *const measured[] = {x};
            const size_t from[] = {next(&b) % (n + 2)};
            double error;
            api->squared_errors((mrd_law)law, 1, records, measured, from, 1, c, &error);
        }
        api->lag(n, step, any(&b), any(&b), any(&b), any(&b), x, force, seed, NULL);
        api->record_close(&record);
    }
    double tau[8], w[8], slope[8], by_kappa[8], by_n[8];
    for (size_t i = 0; i < 8; i++) tau[i] = any(&b);
    api->curve(sample(&b, (range)KAPPA), sample(&b, (range)N), 8, tau, w, slope, by_kappa, by_n);
    for (size_t i = 0; i < 8; i++) require(isnan(tau[i]) || fabs(w[i]) <= (tau[i] < 0.0 ? 1.2 : 1.0 + 1e-12), "w is bounded", w[i]);
    free(sums);
    free(seed);
    free(columns);
    free(force);
    free(c);
    free(a);
    free(v);
    free(x);
    return 0;
}
