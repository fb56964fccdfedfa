/* The implicit laws (series valve and chain) with the number type of lanes.h, for PACK models at a time. */
#include "lane_search.c"
#include "lane_samples.c"
#include "compliance.c"
#include "series_valve.c"
#include "chain.c"

/* State of PACK lanes. */
typedef union {
    valve_lanes valve;
    chain_lanes chain;
} law_lanes;

static size_t substeps_of(mrd_law law, const mrd_record *r) { return law == MRD_CHAIN_LAW ? chain_substeps(r) : r->substeps; }

/* Start one model per lane with its coefficients at the first sample. */
static void lanes_begin(mrd_law law, const mrd_model *const *model, law_lanes *l)
{
    memset(l, 0, sizeof *l);
    pack *c = law == MRD_CHAIN_LAW ? l->chain.at.c : l->valve.c;
    for (int k = 0; k < (law == MRD_CHAIN_LAW ? CH_COUNT : SV_COUNT); k++) {
        double value[PACK];
        for (int i = 0; i < PACK; i++) value[i] = coefficient_at(model[i], k, 0);
        memcpy(c + k, value, sizeof value);
    }
    if (law == MRD_CHAIN_LAW) chain_set(&l->chain.at);
    else valve_set(&l->valve);
}

/* Compute the force and its derivatives at the first sample, or at the end of a sample interval. */
static void lanes_step(mrd_law law, law_lanes *l, int first, const lane_samples *t, double *force, double *const *column)
{
    if (law == MRD_CHAIN_LAW) {
        if (first) chain_lanes_first(&l->chain, t, force, column);
        else chain_lanes_step(&l->chain, t, force, column);
    } else if (first) valve_lanes_first(&l->valve, t, force, column);
    else valve_lanes_step(&l->valve, t, force, column);
}
