/* The controller in single precision. The same files run on a target. */
#define MRD_TRACK_API static
#include "controller.c"

#include "interface.h"

const mrd_api *mrd_level(int level)
{
    static const mrd_api api = {"baseline", mrd_track_start, mrd_track_step, mrd_model_step, mrd_track_parts};
    return level == 0 ? &api : NULL;
}
