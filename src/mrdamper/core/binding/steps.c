/* Check the tables of a controller, and compute many steps in one call. This file is compiled once per precision. */
#include "interface.h"

static int lookups_are_sound(const mrd_lookup *lookups, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        const mrd_lookup *o = lookups + k;
        if (!(o->offset > (mrd_real)0 && o->bits >= 0 && o->bits <= 10 && o->cells > 0)) return 0;
        /* The last cell that a size can select is the last cell of the table. */
        mrd_real end = o->offset;
        int32_t cells = 0;
        while (cells < o->cells && cells < (1 << 20)) {
            cells += 1 << o->bits;
            end *= (mrd_real)2;
        }
        if (cells != o->cells || !(o->top >= o->offset && o->top < end)) return 0;
    }
    return 1;
}

static int powers_are_sound(const mrd_power *powers, size_t count)
{
    const mrd_real one = 1;
    for (size_t k = 0; k < count; k++) {
        const mrd_power *p = powers + k;
        if (!(p->lowest >= (mrd_real)1e-30 && p->lowest <= one) || p->octaves < 1 || p->octaves > 100) return 0;
        if (p->bits < 0 || p->bits > 10) return 0;
        mrd_real end = one;
        while (end > p->lowest) end /= (mrd_real)2;
        if (end != p->lowest) return 0; /* `lowest` is not a power of two. */
        for (int32_t octave = 0; octave < p->octaves; octave++) end *= (mrd_real)2;
        if (!(p->top >= p->lowest && p->top < end)) return 0;
    }
    return 1;
}

static int series_is_sound(const mrd_track *t)
{
    const int32_t cells = t->series->currents - 1;
    return cells >= 1 && cells <= 1024 && !(cells & (cells - 1)) && t->law.substeps >= 1 && t->law.substeps <= 1000
        && powers_are_sound(&t->series->thinning, 4) && lookups_are_sound(&t->series->side, 2);
}

int mrd_track_is_sound(const mrd_track *t)
{
    const mrd_real zero = 0, one = 1;
    const int32_t dead = t->actuation.dead_samples;
    if (!(t->axes.period > zero && t->axes.largest > zero && t->axes.coldest > zero && t->axes.warmest >= t->axes.coldest))
        return 0;
    if (t->law.elements < 0 || t->law.elements > 2) return 0;
    if (t->inverse.method == MRD_INVERSE_BANK && (t->inverse.preview > zero || t->law.series || t->law.chain)) return 0;
    if (!(t->gains.yield_force > zero && t->gains.viscous_force > zero && t->gains.friction_force > zero)) return 0;
    if (dead < 0 || dead > (int32_t)MRD_TRACK_DELAY_LINE - 3) return 0;
    if (!(t->actuation.dead_part >= zero && t->actuation.dead_part <= one)) return 0;
    if (!(t->inverse.preview >= zero && t->faults.fall_back >= zero && t->faults.speed_limit > zero)) return 0;
    if (!(t->heating.heat_capacity >= zero && t->heating.loss_conductance >= zero && t->heating.loss_ratio_max >= zero)) return 0;
    if (t->currents < 2 || t->currents > MRD_TRACK_CURRENTS || t->pieces < 1 || !(t->law.unloaded >= zero)) return 0;
    if (t->prediction.steps < 0 || t->prediction.steps > MRD_TRACK_STEPS || t->prediction.together < 1) return 0;
    if (t->prediction.stretch < 1 || t->prediction.stretch > MRD_TRACK_STEPS) return 0;
    if (t->prediction.samples < 1 || t->prediction.samples > MRD_TRACK_STEPS) return 0;
    if (!(t->prediction.step >= zero && t->prediction.dead >= zero)) return 0;
    return lookups_are_sound(&t->loading, 9) && (t->series ? series_is_sound(t) : !t->law.series && !t->law.chain);
}

void mrd_track_run(const mrd_api *api, const mrd_track *track, mrd_track_state *state, size_t n, const mrd_inputs *inputs,
                   mrd_real *current, int32_t *flags)
{
    for (size_t k = 0; k < n; k++) {
        current[k] = api->track_step(track, state, inputs + k);
        flags[k] = state->flags;
    }
}

void mrd_model_run(const mrd_api *api, const mrd_track *model, mrd_track_state *state, size_t n,
                   const mrd_model_inputs *inputs, mrd_real *force, int32_t *flags)
{
    for (size_t k = 0; k < n; k++) {
        force[k] = api->model_step(model, state, inputs + k);
        flags[k] = state->flags;
    }
}
