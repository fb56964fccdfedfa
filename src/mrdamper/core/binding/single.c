/* The controller in single precision: the files that a target gets, as one translation unit of the extension. */
#define MRD_SINGLE
#define MRD_TRACK_API static
#define MRD_VEHICLE_API static
#include "../kernel/controller.c"
#include "../kernel/vehicle.c"

#include "tracker.h"

#define TRACK(name) mrd_track_##name
#define TRACK_MODEL mrd_model_step
#include "tracker_face.c"

#include "vehicle_face.c"

const tracker_face *mrd_tracker_single(void) { return &face; }
const vehicle_face *mrd_vehicle_single(void) { return &vehicle_of_precision; }
