/* The implicit laws along one record: coefficients may vary, directions may have seeds, and a run may come in batches.
 *
 * This separate translation unit is compiled only once, because wider registers do not accelerate a single lane.
 */
#define MRD_ONE_LANE
#include "kernel.h"
#include "lanes.h"

#include "coefficients.c"
#include "implicit.c"

void mrd_implicit_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way, double *force,
                      double *const *column, mrd_state *state);

static void state_read(mrd_law law, const mrd_state *state, law_lanes *l)
{
    if (law != MRD_CHAIN_LAW) {
        l->valve.y = state->y;
        memcpy(l->valve.lag, state->lag, sizeof state->lag);
        memcpy(l->valve.change, state->change, sizeof state->change);
        return;
    }
    chain_state *at = &l->chain.at;
    at->q = state->y;
    at->y = state->q;
    at->lag = state->lag[0];
    at->change = state->change[0];
    at->bend = state->change[1];
    at->play = state->play;
    at->cavity = state->cavity;
    memcpy(at->bristle, state->bristle, sizeof at->bristle);
    memcpy(at->followed, state->level, sizeof at->followed);
}

static void state_write(mrd_law law, const law_lanes *l, mrd_state *state)
{
    if (law != MRD_CHAIN_LAW) {
        state->y = l->valve.y;
        memcpy(state->lag, l->valve.lag, sizeof state->lag);
        memcpy(state->change, l->valve.change, sizeof state->change);
        return;
    }
    const chain_state *at = &l->chain.at;
    state->y = at->q;
    state->q = at->y;
    state->lag[0] = at->lag;
    state->change[0] = at->change;
    state->change[1] = at->bend;
    state->play = at->play;
    state->cavity = at->cavity;
    memcpy(state->bristle, at->bristle, sizeof at->bristle);
    memcpy(state->level, at->followed, sizeof at->followed);
}

/* Compute the force of the law along a record, and its derivatives along `ways` directions of its coefficients. */
void mrd_implicit_run(const mrd_model *m, const mrd_record *r, size_t ways, const mrd_direction *const *way, double *force,
                      double *const *column, mrd_state *state)
{
    const int count = m->law == MRD_CHAIN_LAW ? CH_COUNT : SV_COUNT;
    double x[2] = {0.0, 0.0}, v[2] = {0.0, 0.0}, c[2][CH_COUNT], seed[2][MRD_DIRECTIONS], *by[MRD_DIRECTIONS];
    int coefficient[MRD_DIRECTIONS];
    law_lanes l;
    lane_samples t = {r->step, substeps_of(m->law, r), x, v, NULL, NULL, ways, coefficient, NULL, NULL};
    lanes_begin(m->law, &m, &l);
    if (r->behind) state_read(m->law, state, &l);
    for (size_t d = 0; d < ways; d++) {
        coefficient[d] = way[d]->coefficient;
        if (!way[d]->seed) continue;
        t.seed_from = seed[0];
        t.seed_to = seed[1];
    }
    if (m->stride) {
        t.from = c[0];
        t.to = c[1];
    }
    for (size_t i = 0; i < r->n; i++) {
        x[0] = x[1];
        v[0] = v[1];
        x[1] = r->x[i];
        v[1] = r->v[i];
        if (t.to) {
            memcpy(c[0], c[1], sizeof c[0]);
            for (int k = 0; k < count; k++) c[1][k] = coefficient_at(m, k, i);
        }
        if (t.seed_to) {
            memcpy(seed[0], seed[1], ways * sizeof *seed[0]);
            for (size_t d = 0; d < ways; d++) seed[1][d] = seed_at(way[d], i);
        }
        if (!i && r->behind) continue;
        for (size_t d = 0; d < ways; d++) by[d] = column[d] + i;
        lanes_step(m->law, &l, !i, &t, force + i, by);
    }
    if (state) state_write(m->law, &l, state);
}
