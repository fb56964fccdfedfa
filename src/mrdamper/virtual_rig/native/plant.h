/* Physics of the lumped virtual damper: parameters, state, and one time step.
 *
 * Plain C99 without memory of its own: the caller keeps the state. It shares no code with the identification kernel.
 * SI and kelvin; extension positive.
 */
#ifndef RIG_PLANT_H
#define RIG_PLANT_H

/* Names and order of the parameters, which lumped.py describes. Python reads this order from the extension. */
#define RIG_PARAMETERS(X)                                                                                         \
    X(coil_ohm) X(copper_per_K) X(coil_henry) X(inductance_fall) X(supply_V) X(driver_V_A) X(driver_V_A_s)        \
    X(eddy_rise_s) X(eddy_fall_s) X(eddy_per_K) X(fluid_lag_s) X(play_share) X(play_A) X(full_current_A)          \
    X(field_current_A) X(field_exponent) X(yield_N) X(yield_field_N) X(yield_loss_per_K) X(low_field_loss)        \
    X(stiffness_N_m) X(stiffness_field_N_m) X(spread) X(asymmetry) X(position) X(viscous_N) X(viscous_m_s)        \
    X(viscous_exponent) X(viscous_field) X(viscosity_K) X(viscosity_pole_K) X(friction_N) X(friction_static)      \
    X(stribeck_m_s) X(friction_N_m) X(friction_loss_per_K) X(spring_N_m) X(offset_N) X(leak_N_s_m)

typedef struct {
#define X(name) double name;
    RIG_PARAMETERS(X)
#undef X
} rig_parameters;

/* State of the damper. */
#define RIG_STATE(X)                                                                                          \
    X(coil_A)       /* current of the coil */                                                                 \
    X(integral_V)   /* integral of the current controller */                                                  \
    X(flux_A)       /* flux behind the eddy currents, stated as a current */                                  \
    X(fluid_A)      /* field behind the fluid structure, stated as a current */                               \
    X(play_at_A)    /* output of the magnetic play */                                                         \
    X(bristle_N)    /* three bristles of the yield force: bristle_N, soft_N, stiff_N */                       \
    X(soft_N)                                                                                                 \
    X(stiff_N)                                                                                                \
    X(friction_N)   /* the friction bristle */                                                                \
    X(chain_N)      /* yield and viscous force at the end of the last step */

typedef struct {
#define X(name) double name;
    RIG_STATE(X)
#undef X
} rig_state;

/* Values that depend only on the temperature and the step. */
typedef struct {
    double siemens, coil_decay, rise, fall, fluid, per_field_A, full_log, viscous, viscous_log, loss, friction, per_stribeck,
        per_leak;
} rig_climate;

void rig_settle(const rig_parameters *p, double step, double kelvin, rig_climate *at);

/* Advance a damper by one step; return the force [N]. Displacement [m], velocity [m/s] and commanded current [A] are
 * values at the end of the step. `field` receives the effective current behind all lags [A]. */
double rig_step(const rig_parameters *p, const rig_climate *at, double step, double x, double v, double command,
                rig_state *s, double *field);

#endif
