/* A controller and its tables in one file, so that the compiler can use their values as constants. */
#define MRD_TRACK_API static inline
#include "tables.c"

#include "controller.c"

#include "one.h"

mrd_real one_largest(void) { return track.axes.largest; }
void one_start(mrd_track_state *s) { mrd_track_start(&track, s); }
mrd_real one_step(mrd_track_state *s, const mrd_inputs *told) { return mrd_track_step(&track, s, told); }
