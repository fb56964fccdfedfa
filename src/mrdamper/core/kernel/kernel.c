/* The kernel as one translation unit, which is compiled for each instruction set; see kernel.h. */
#define MRD_TRACK_API static
#include "kernel.h"
#include "lanes.h"

#include "curve.c"
#include "turns.c"
#include "record.c"
#include "coefficients.c"
#include "hysteresis.c"
#include "implicit.c"
#include "lugre.c"
#include "spencer.c"
#include "common.c"
#include "laws.c"
#include "gram.c"
#include "actuation.c"
#include "controller.c"

#ifndef MRD_ISA
#define MRD_ISA baseline
#endif
#define MRD_JOIN_(a, b) a##b
#define MRD_JOIN(a, b) MRD_JOIN_(a, b)
#define MRD_TEXT_(a) #a
#define MRD_TEXT(a) MRD_TEXT_(a)
#define MRD_API MRD_JOIN(mrd_api_, MRD_ISA)

const mrd_api *MRD_API(void);

const mrd_api *MRD_API(void)
{
    static const mrd_api api = {MRD_TEXT(MRD_ISA), workspace_open, workspace_close,
                                record_open, batch_open, record_close, coefficient_count, run, carry, causal,
                                squared_errors, gram, gram_sums, curve_values, first_order_lag,
                                turns_feed, mrd_track_start, mrd_track_step, mrd_model_step, mrd_track_parts};
    return &api;
}
