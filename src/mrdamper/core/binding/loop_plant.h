/* A damper of another extension, as the closed loop steps it: what goes through a capsule between the two. */
#ifndef MRD_LOOP_PLANT_H
#define MRD_LOOP_PLANT_H

#include <stddef.h>

#define MRD_LOOP_PLANT "mrdamper.loop_plant" /* the capsule's name */

typedef struct loop_plant loop_plant;
struct loop_plant {
    /* Moves on along `count` samples of displacement [m] and velocity [m/s], the current [A] held; fills the force [N]
     * at each. Returns 0 where a sample is refused. It needs no GIL, and runs in one thread at a time. */
    int (*advance)(loop_plant *self, const double *displacement, const double *velocity, double current, size_t count,
                   double *force);
};

#endif
