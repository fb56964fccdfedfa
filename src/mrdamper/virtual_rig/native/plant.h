/* Physics of the lumped virtual damper: parameters, state, and one time step.
 *
 * Plain C99 without memory of its own: the caller keeps the state. It shares no code with the identification kernel.
 * SI and kelvin; extension positive.
 */
#ifndef RIG_PLANT_H
#define RIG_PLANT_H

/* Names, order and symbols of the parameters; lumped.py describes them. Python reads the order from the extension. */
#define RIG_PARAMETERS(X)                                                                                     \
    X(coil_ohm)               /* R0, at 20 C */                                                               \
    X(copper_per_K)           /* rise of R per kelvin */                                                      \
    X(coil_henry)             /* L0, at zero current */                                                       \
    X(inductance_fall)        /* L = L0 / (1 + this i^2), per A^2 */                                          \
    X(supply_V)               /* limit of the driver */                                                       \
    X(driver_V_A)             /* Kp */                                                                        \
    X(driver_V_A_s)           /* Ki */                                                                        \
    X(eddy_rise_s)            /* lag of the flux behind a rising current, at 20 C */                          \
    X(eddy_fall_s)            /* lag of the flux behind a falling current */                                  \
    X(eddy_per_K)             /* both are divided by 1 + this (T - 20 C) */                                   \
    X(fluid_lag_s)            /* lag of the fluid structure behind the flux */                                  \
    X(play_share)             /* wp: fraction of the field with magnetic play */                              \
    X(play_A)                 /* r: half width of the play */                                                 \
    X(full_current_A)         /* current at which the field shape is 1 */                                     \
    X(field_current_A)        /* Is of tanh(m / Is) */                                                        \
    X(field_exponent)         /* p */                                                                         \
    X(yield_N)                /* Fy0, without field */                                                        \
    X(yield_field_N)          /* Fym, at full field and 20 C */                                               \
    X(yield_loss_per_K)       /* kT */                                                                        \
    X(low_field_loss)         /* kx: the loss is (1 + kx) times as large without field */                     \
    X(stiffness_N_m)          /* s0, before yield, without field */                                           \
    X(stiffness_field_N_m)    /* s1 */                                                                        \
    X(spread)                 /* weight of the softest and of the stiffest of three bristles */               \
    X(asymmetry)              /* yield (1 + this) in extension, (1 - this) in compression */                  \
    X(position)               /* yield (1 + this (x / 5 mm)^2) */                                             \
    X(viscous_N)              /* Fv0, at the reference speed and 20 C */                                      \
    X(viscous_m_s)            /* the reference speed */                                                       \
    X(viscous_exponent)       /* nv */                                                                        \
    X(viscous_field)          /* kvb: viscous force (1 + kvb g) */                                            \
    X(viscosity_K)            /* B of exp(B / (T - pole)) */                                                  \
    X(viscosity_pole_K)       /* zero kelvin: Arrhenius */                                                    \
    X(friction_N)             /* Fc, sliding, at 20 C */                                                      \
    X(friction_static)        /* static divided by sliding friction */                                              \
    X(stribeck_m_s)           /* vs, Stribeck velocity */                                   \
    X(friction_N_m)           /* stiffness of the seal before it slides */                                    \
    X(friction_loss_per_K)    /* fT */                                                                        \
    X(spring_N_m)             /* k1 */                                                                        \
    X(offset_N)               /* f0 */                                                                        \
    X(leak_N_s_m)              /* c1: oil compliance, modelled as a leak in series with yield and viscous force */

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
    X(bristle_N)    /* the three bristles of the yield force */                                               \
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
