/* What a car asks of its damper: an observer of its states from what a vehicle measures, and the wanted force.
 *
 * States: rattle space [m], speed of the body [m/s], tyre deflection [m], speed of the wheel [m/s], bias of the body's
 * accelerometer [m/s^2], and that of the wheel's where there is one: n is 5 or 6. The force between body and wheel is known from the body's acceleration, whatever damper, spring
 * and stops make of it: the observer needs no model of the damper. Its gains are constant.
 * The wanted force is linear in the states, and zero where a damper cannot give it. Extension is positive.
 */
#ifndef MRD_VEHICLE_H
#define MRD_VEHICLE_H

#include "controller.h"

#ifndef MRD_VEHICLE_API
#define MRD_VEHICLE_API /* linkage of the public functions */
#endif

#define MRD_VEHICLE_STATES 6 /* at most */

/* Modes that the code may be compiled without (controller_config.h). */
#ifndef MRD_WITH_WHEEL_ACCELEROMETER
#define MRD_WITH_WHEEL_ACCELEROMETER MRD_ASKED /* the wheel's acceleration is measured */
#endif
#ifndef MRD_WITH_ACCELERATION_DRIVEN
#define MRD_WITH_ACCELERATION_DRIVEN MRD_ASKED /* a demand while it opposes the body's acceleration */
#endif

typedef struct {
    bool wheel_accelerometer; /* there is one */
    bool acceleration_driven; /* the force is wanted only while it opposes the body's acceleration */
    int32_t coast_samples;    /* without a reading before nothing is wanted */
    mrd_real body, spring;    /* [kg], [N/m] */
    mrd_real by_rattle, by_body, by_tyre, by_wheel; /* wanted force of a state [N/m], [N s/m], [N/m], [N s/m] */
    mrd_real predict[MRD_VEHICLE_STATES * MRD_VEHICLE_STATES]; /* [n][n], what a period makes of the states */
    mrd_real before[MRD_VEHICLE_STATES];     /* [n], ... of the body's acceleration at its begin */
    mrd_real present[MRD_VEHICLE_STATES];    /* [n], ... at its end */
    mrd_real stroke[MRD_VEHICLE_STATES + 1]; /* [n + 1], stroke of the damper, of states and of the body's acceleration */
    mrd_real wheel[MRD_VEHICLE_STATES + 1];  /* [n + 1], acceleration of the wheel, the same */
    mrd_real gain[MRD_VEHICLE_STATES * 2];   /* [n][2], of the differences in stroke and in the wheel's acceleration */
    mrd_real ahead[16]; /* [4][4], the states at the preview, of those now: the car moves on freely */
} mrd_vehicle; /* a plain struct without pointers: a copy of it is another car */

/* Flags of the last step. */
enum {
    MRD_VEHICLE_NO_BODY = 1,   /* acceleration of the body: not a number, or far outside; the last good one is used */
    MRD_VEHICLE_NO_WHEEL = 2,  /* acceleration of the wheel: the same; the states are not corrected */
    MRD_VEHICLE_NO_STROKE = 4, /* the same of the stroke */
    MRD_VEHICLE_UNKNOWN = 8,   /* for too long: nothing is wanted, and the states begin anew */
    MRD_VEHICLE_FAULT = 16     /* the state held what cannot be: it begins anew */
};

/* Readings of a step; not-a-number for what is not known. */
typedef struct {
    mrd_real body_acceleration;  /* upwards, without gravity [m/s^2] */
    mrd_real wheel_acceleration; /* the same; not read without an accelerometer there */
    mrd_real stroke;             /* of the damper, extension positive, from where it stands at rest [m] */
} mrd_vehicle_inputs;

typedef struct {
    mrd_real wanted;       /* force [N] */
    mrd_real wanted_ahead; /* the same at the preview */
} mrd_vehicle_outputs;

typedef struct {
    mrd_real z[MRD_VEHICLE_STATES];
    mrd_real body_acceleration; /* the last one that was believed */
    int32_t missing;            /* samples in a row without a reading */
    int32_t started;
    int32_t flags;
} mrd_vehicle_state;

MRD_VEHICLE_API void mrd_vehicle_start(mrd_vehicle_state *s);
/* One step of the control period. */
MRD_VEHICLE_API void mrd_vehicle_step(const mrd_vehicle *c, mrd_vehicle_state *s, const mrd_vehicle_inputs *in,
                                      mrd_vehicle_outputs *out);
/* The wanted force of states z [4]: `off` is added to the damper's speed [m/s], `pushed` is the force of damper and end
 * stops [N]. */
MRD_VEHICLE_API void mrd_vehicle_demand(const mrd_vehicle *c, const mrd_real *z, mrd_real off, mrd_real pushed,
                                        mrd_vehicle_outputs *out);

#endif
