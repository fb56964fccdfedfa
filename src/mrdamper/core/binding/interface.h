/* Functions and types that Python uses in the two extensions. cmake/generate_binding.py reads these declarations.
 *
 * The extension `_kernel` has the whole kernel in double precision. The extension `_single` (MRD_SINGLE) has only the
 * controller in single precision.
 */
#ifndef MRD_INTERFACE_H
#define MRD_INTERFACE_H

#ifdef MRD_SINGLE
#include "controller.h"

/* The functions of a controller, for `_single`. The structure of this name in kernel.h has further members. */
typedef struct {
    const char *name;
    void (*track_start)(const mrd_track *controller, mrd_track_state *state);
    mrd_real (*track_step)(const mrd_track *controller, mrd_track_state *state, const mrd_inputs *inputs);
    mrd_real (*model_step)(const mrd_track *model, mrd_track_state *state, const mrd_model_inputs *inputs);
    void (*track_parts)(const mrd_track *controller, const mrd_track_state *state, mrd_real *parts);
} mrd_api;
#else
#include "kernel.h"
#include "loop_plant.h"

#define MRD_LOOPS_MAX 64

/* One controller on one damper. */
typedef struct {
    const mrd_track *track;
    mrd_track_state *state;
    size_t late;         /* number of whole samples in the delay of a command */
    int reads_force;
    double gain, offset; /* gain [-] and offset [N] of the damper force */
    double highest, current_step, force_step; /* limit of the driver [A]; resolutions of current and force, 0: exact */
    const mrd_inputs *sensed; /* [samples] readings; instead of a force, they contain the noise of the force sensor */
    const double *frozen;     /* [samples] 1 if the force sensor repeats its last reading, else 0 */
    double *force;            /* [steps] force of the damper [N] */
    double *given;            /* [late + 1 + samples] commands [A]; the first late + 1 commands are zero */
    double felt, read;        /* force of the damper and reading of its sensor [N] */
} mrd_loop;

/* Run several sampled loops with the same motion. `every` is the number of plant steps per sample; `apart` is the
 * number of plant steps in the delay of a command in addition to whole samples. Return 0 if a command is not finite or
 * the damper rejects a sample. */
int mrd_follow(const mrd_api *api, loop_plant *plant, size_t steps, const double *displacement, const double *velocity,
               size_t every, size_t apart, size_t count, mrd_loop *loops);
#endif

/* Return the functions for an instruction set level (0: the slowest). Return NULL if this machine has no such level. */
const mrd_api *mrd_level(int level);

/* Return 1 if all sizes and indices of a controller are in the range that a step requires, else 0. */
int mrd_track_is_sound(const mrd_track *track);

/* Take n steps of a controller or of the model. Write the result and the flags of each step. */
void mrd_track_run(const mrd_api *api, const mrd_track *track, mrd_track_state *state, size_t n, const mrd_inputs *inputs,
                   mrd_real *current, int32_t *flags);
void mrd_model_run(const mrd_api *api, const mrd_track *model, mrd_track_state *state, size_t n,
                   const mrd_model_inputs *inputs, mrd_real *force, int32_t *flags);

#endif
