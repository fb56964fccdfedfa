/* The controller in single precision: the files that a target gets, as one translation unit of the extension. */
#define MRD_SINGLE
#define MRD_TRACK_API static
#include "../kernel/controller.c"

#include "tracker.h"

#define TRACK(name) mrd_track_##name
#define TRACK_MODEL mrd_model_step
#include "tracker_face.c"

const tracker_face *mrd_tracker_single(void) { return &face; }
