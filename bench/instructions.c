/* A small fixed program whose instructions are counted: simulate, the inner loop of a fit, a controller's steps.
 *
 * Each part is a function of its own, so that callgrind can be told to count what happens inside it. The controller
 * is an exported one, guard.h, which instructions.py writes.
 */
#include "kernel.c"

#include "guard.h"

#include <stdio.h>

#define SAMPLES 4000
#define CANDIDATES 8
#define COUNT (MRD_COMMON + 4)

void part_simulate(const mrd_api *api, const double *x, const double *v, const double *a, double *out);
void part_fit(const mrd_api *api, const double *x, const double *v, const double *a, double *out);
void part_controller(const double *x, double *out);

static void bouc_wen(double *c)
{
    for (int k = 0; k < MRD_COEFFICIENTS; k++) c[k] = 0.0;
    c[C_VISCOSITY] = 800.0;
    c[C_VISCOUS_EXPONENT] = 1.0;
    c[C_STIFFNESS] = 700.0;
    c[C_STRIBECK] = 0.014;
    c[C_TRANSITION] = 8e-4;
    c[BW_YIELD] = 500.0;
    c[BW_RHO] = 1500.0;
    c[BW_KAPPA] = -0.4;
    c[BW_N] = 1.6;
}

/* A record, an ensemble's squared errors, and one run each of two laws that take more. */
__attribute__((noinline)) void part_simulate(const mrd_api *api, const double *x, const double *v, const double *a,
                                             double *out)
{
    static double force[SAMPLES], table[CANDIDATES * COUNT], c[MRD_COEFFICIENTS];
    mrd_record record;
    if (api->record_open(&record, SAMPLES, 1e-3, x, v, a, 0.0, 2.5e-3) != MRD_OK) return;
    bouc_wen(c);
    for (int j = 0; j < CANDIDATES; j++) {
        for (int k = 0; k < COUNT; k++) table[j * COUNT + k] = c[k];
        table[j * COUNT + BW_RHO] *= 1.0 + 0.1 * j;
        table[j * COUNT + BW_N] += 0.05 * j;
    }
    const mrd_record *const records[] = {&record};
    const double *const measured[] = {x};
    const size_t from[] = {100};
    api->squared_errors(MRD_BOUC_WEN, 1, records, measured, from, CANDIDATES, table, out);
    c[C_COULOMB] = 5.0;
    c[C_BREAKAWAY] = 6.0;
    c[C_VISCOUS_EXPONENT] = 0.9;
    c[DB_SECOND] = 50.0;
    c[DB_RHO] = 16e3;
    c[DB_SECOND_RHO] = 5e3;
    c[DB_KAPPA] = -0.42;
    c[DB_N] = 0.57;
    const mrd_model twice = {MRD_DOUBLE, c, 0};
    if (api->run(&twice, &record, 0, NULL, force, NULL, NULL) == MRD_OK) out[0] += force[SAMPLES - 1];
    bouc_wen(c);
    c[LG_EXCESS] = 0.4;
    c[LG_FADE] = 0.01;
    c[LG_DAMPING] = 600.0;
    const mrd_model bristles = {MRD_LUGRE, c, 0};
    if (api->run(&bristles, &record, 0, NULL, force, NULL, NULL) == MRD_OK) out[0] += force[SAMPLES - 1];
    api->record_close(&record);
}

/* What variable projection does at each step of a run: columns of force and tangents, and their sums of products. */
__attribute__((noinline)) void part_fit(const mrd_api *api, const double *x, const double *v, const double *a, double *out)
{
    static const int by[] = {C_VISCOSITY, C_STIFFNESS, C_OFFSET, BW_YIELD, BW_RHO, BW_KAPPA, BW_N};
    enum { WAYS = sizeof by / sizeof *by };
    static double columns[(WAYS + 1) * SAMPLES], sums[(WAYS + 1) * (WAYS + 1)], c[MRD_COEFFICIENTS];
    mrd_direction direction[WAYS];
    mrd_record record;
    mrd_workspace *workspace = api->workspace_open();
    if (!workspace || api->record_open(&record, SAMPLES, 1e-3, x, v, a, 0.0, 2.5e-3) != MRD_OK) return;
    bouc_wen(c);
    const mrd_model model = {MRD_BOUC_WEN, c, 0};
    for (int d = 0; d < WAYS; d++) {
        direction[d].coefficient = by[d];
        direction[d].seed = NULL;
        direction[d].stride = 0;
    }
    for (int step = 0; step < 4; step++) {
        c[BW_KAPPA] += 0.02;
        if (api->run(&model, &record, WAYS, direction, columns, columns + SAMPLES, workspace) != MRD_OK) return;
        api->gram(WAYS + 1, SAMPLES, columns, 100, sums);
        out[0] += sums[0];
    }
    api->record_close(&record);
    api->workspace_close(workspace);
}

__attribute__((noinline)) void part_controller(const double *x, double *out)
{
    guard_controller_state state;
    guard_controller_start(&state);
    for (int i = 0; i < SAMPLES; i++) {
        guard_controller_output given;
        guard_controller_input asked;
        asked.wanted = (mrd_real)(6e4 * x[i]);
        asked.wanted_ahead = (mrd_real)(6e4 * x[i + 8 < SAMPLES ? i + 8 : i]);
        asked.displacement = (mrd_real)x[i];
        asked.temperature = (mrd_real)333.15;
        asked.force = (mrd_real)NAN;
        guard_controller_step(&state, &asked, &given);
        out[0] += (double)given.current;
    }
}

int main(void)
{
    static double x[SAMPLES], v[SAMPLES], a[SAMPLES], out[CANDIDATES];
    for (int i = 0; i < SAMPLES; i++) {
        const double t = 1e-3 * i;
        x[i] = 0.010 * sin(11.0 * t) + 0.002 * sin(37.0 * t);
        v[i] = 0.110 * cos(11.0 * t) + 0.074 * cos(37.0 * t);
        a[i] = -1.21 * sin(11.0 * t) - 2.738 * sin(37.0 * t);
    }
    part_simulate(MRD_API(), x, v, a, out);
    part_fit(MRD_API(), x, v, a, out);
    part_controller(x, out);
    printf("%.17g\n", out[0]);
    return out[0] == out[0] ? 0 : 1;
}
