/* Dampers of another extension for closed loops. A Python capsule passes this structure between the extensions. */
#ifndef MRD_LOOP_PLANT_H
#define MRD_LOOP_PLANT_H

#include <stddef.h>

#define MRD_LOOP_PLANT "mrdamper.loop_plant" /* the capsule's name */

typedef struct loop_plant loop_plant;
struct loop_plant {
    size_t count; /* number of equal dampers that have one motion and individual currents */
    /* Advance all dampers by `steps` samples of displacement [m] and velocity [m/s] at constant currents [A]. Write
     * the force [N] of each damper. Return 0 if a sample is rejected. The function needs no GIL, and runs in one
     * thread at a time. */
    int (*advance)(loop_plant *self, const double *displacement, const double *velocity, size_t steps,
                   const double *current, double *const *force);
};

#endif
