/* Fuzzing of the laws: records, forces, tangents, sums and the curve, from any motion and coefficients.
 *
 * Of coefficients in their ranges and a finite motion the force is finite. Of anything else nothing is said but
 * that the sanitizers stay silent. The kernel's one translation unit is included.
 */
#include "kernel.c"

#include "bytes.h"

#define MOST 40 /* samples */

typedef struct {
    double low, high;
    int decades;
} range;

/* What a curve is tabulated for, its ends with half of the last digits that the kernel forgives. */
#define KAPPA {-1 - 5e-10, 1 + 5e-10, 0}
#define N {0.2 - 5e-10, 20 + 5e-10, 0}

/* Ranges of the coefficients of a law: those that models/laws.py admits. */
static range range_of(int law, int k)
{
    static const range common[MRD_COMMON] = {{0, 1e3, 0}, {0, 1e3, 0}, {-100, 100, 0}, {0, 5, 0}, {0, 20, 0},
                                             {0, 20, 0}, {1e-6, 10, 1}, {1e-7, 10, 1}, {0.3, 1.5, 0}};
    static const range yield = {0, 1e4, 0}, rho = {1e-2, 1e8, 1}, kappa = KAPPA, n = N;
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
                                      {0, 1e5, 0}, {-0.5, 0.5, 0}, {-1e3, 1e3, 0}, {-1e3, 1e3, 0}, {1e-6, 1e12, 1},
                                      {0, 1e-2, 0}, {1e-12, 1, 1}, {0, 1e8, 0}, {0.2, 2, 0}, {0, 1, 0}, {1e-3, 1e12, 1},
                                      {0, 10, 0}, {0, 1e4, 0}, {1e-3, 1e12, 1}, {0, 1e2, 0}, {1e-9, 10, 1}, {0, 1e4, 0},
                                      {1e-3, 1e12, 1}, {-1e4, 1e4, 0}, {1e-9, 1e3, 1}, {0, 1, 0}, {0, 1, 0}};
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
    default: (void)kappa; (void)n; return valve[k];
    }
}

static double drawn(bytes *b, range r)
{
    if (r.decades) return over_decades(b, r.low, r.high);
    return between(b, r.low, r.high);
}

static double *room(size_t count)
{
    double *made = malloc((count ? count : 1) * sizeof *made);
    if (!made) exit(0);
    return made;
}

/* A run in two batches has the force of the whole run, to the bit. */
static void in_two_batches(const mrd_api *api, const mrd_model *model, const mrd_record *whole, double band, double longest,
                           size_t cut, const double *force, mrd_workspace *workspace)
{
    mrd_motion motion;
    mrd_state state;
    mrd_record part;
    size_t begin = 0, answered = 0;
    double *own = room(whole->n);
    memset(&motion, 0, sizeof motion);
    memset(&state, 0, sizeof state);
    cut = cut % whole->n;
    for (int last = cut < 2; last < 2; last++) { /* the first batch, when it has two samples, then the rest */
        const size_t end = last ? whole->n : cut;
        const double *x = whole->x + begin, *v = whole->v + begin, *a = whole->a + begin;
        if (api->batch_open(&part, end - begin, whole->step, x, v, a, band, longest, 1000, last, &motion) != MRD_OK) break;
        if (api->carry(model, &part, &state, own, workspace) == MRD_OK)
            for (size_t i = part.behind; i < part.n; i++, answered++)
                promise(own[i] == force[answered], "a batch has the force of the whole run", own[i] - force[answered]);
        if (part.n) begin += part.n - 1;
        api->record_close(&part);
        if (last) break;
    }
    promise(answered == whole->n, "batches answer every sample", (double)answered);
    free(own);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes b = {data, size};
    const mrd_api *api = MRD_API();
    const int law = next(&b) % 10, kind = next(&b);
    const int wild_motion = kind & 1, wild_numbers = kind & 2, varying = kind & 4;
    const size_t n = 1 + next(&b) % MOST, count = (size_t)api->coefficient_count(law);
    double step = over_decades(&b, 1e-5, 1.0), longest = step / between(&b, 0.5, 8.0), band = between(&b, 0.0, 1e-3);
    /* exactly as long as said: a read past the end is seen */
    double *x = room(n), *v = room(n), *a = room(n), *c = room(count * (varying ? n : 1)), *force = room(n);
    double *columns = room(count * n), *seed = room(n), *sums = room(count * count);
    for (size_t i = 0; i < n; i++) {
        x[i] = wild_motion ? any(&b) : between(&b, -0.1, 0.1);
        v[i] = wild_motion ? any(&b) : between(&b, -2.0, 2.0);
        a[i] = wild_motion ? any(&b) : between(&b, -100.0, 100.0);
        seed[i] = between(&b, -1.0, 1.0);
    }
    for (size_t k = 0; k < count; k++) {
        const range r = range_of(law, (int)k);
        const double first = wild_numbers ? any(&b) : drawn(&b, r);
        for (size_t i = 0; i < (varying ? n : 1); i++) c[k * (varying ? n : 1) + i] = first;
    }
    mrd_record record;
    if (api->record_open(&record, n, step, x, v, a, band, longest) == MRD_OK) {
        const mrd_model model = {(mrd_law)law, c, varying ? n : 0};
        mrd_direction direction[MRD_DIRECTIONS];
        for (size_t k = 0; k < count; k++) direction[k] = (mrd_direction){(int)k, k % 2 ? seed : NULL, k % 4 == 1};
        mrd_workspace *workspace = api->workspace_open();
        for (int round = 0; round < 2; round++) { /* the second time with the curve of the first */
            const mrd_status status = api->run(&model, &record, count, direction, force, columns, workspace);
            promise(status == MRD_OK || status == MRD_NOT_TABULATED || status == MRD_SHAPE_VARIES, "the status", status);
            promise(status == MRD_OK || wild_numbers, "sound coefficients are taken", status);
            for (size_t i = 0; status == MRD_OK && !wild_motion && !wild_numbers && i < n; i++)
                promise(fabs(force[i]) < HUGE_VAL, "the force of a sound law is finite", force[i]);
        }
        if (!varying && !wild_motion && !wild_numbers) in_two_batches(api, &model, &record, band, longest, next(&b), force, workspace);
        api->workspace_close(workspace);
        api->gram(count, n, columns, next(&b) % (n + 1), sums);
        if (api->causal(&model, &record, force) == MRD_OK)
            for (size_t i = 0; !wild_motion && !wild_numbers && i < n; i++)
                promise(fabs(force[i]) < HUGE_VAL, "the causal force of a sound law is finite", force[i]);
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
    api->curve(drawn(&b, (range)KAPPA), drawn(&b, (range)N), 8, tau, w, slope, by_kappa, by_n);
    for (size_t i = 0; i < 8; i++) promise(isnan(tau[i]) || fabs(w[i]) <= (tau[i] < 0.0 ? 1.2 : 1.0 + 1e-12), "w is bounded", w[i]);
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
