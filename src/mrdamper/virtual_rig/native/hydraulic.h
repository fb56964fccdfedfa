/* Physics of the hydraulic damper: pressures, flows, flux and mass; parameters, state, and one time step.
 *
 * Plain C99 without memory of its own. It shares nothing with the identification kernel, nor with the lumped damper
 * of plant.c. SI and kelvin; extension positive. Equations: docs/hydraulic_rig.md.
 */
#ifndef RIG_HYDRAULIC_H
#define RIG_HYDRAULIC_H

#define HYDRAULIC_PARAMETERS(X)                                                                               \
    X(bore_m)                                                                                                 \
    X(rod_m)                                                                                                  \
    X(through_rod)            /* 1: the rod passes through both chambers */                                   \
    X(chamber_1_m)            /* length of the rod's chamber at x = 0 */                                      \
    X(chamber_2_m)                                                                                            \
    X(gas_m3)                 /* Vg0 at 20 C and x = 0; zero: no gas */                                       \
    X(gas_Pa)                 /* pg0, gas charge */                                                           \
    X(gas_exponent)           /* gam */                                                                       \
    X(gas_exchange_s)         /* taug, gas to wall */                                                         \
    X(rest_Pa)                /* p00, without gas */                                                          \
    X(rest_Pa_K)              /* kp0 */                                                                       \
    X(air)                    /* volume fraction of bubbles at 1 atm */                                       \
    X(bulk_Pa)                /* El0, of the liquid */                                                        \
    X(bulk_per_K)             /* kE */                                                                        \
    X(expansion_per_K)        /* alT */                                                                       \
    X(slot_diameter_m)        /* mean; the slot's width wv is pi times this */                                \
    X(gap_m)                  /* hg */                                                                        \
    X(active_m)               /* La */                                                                        \
    X(passive_m)              /* Lp */                                                                        \
    X(entrance_loss)          /* zeta */                                                                      \
    X(bypass_m2)              /* CdAb */                                                                      \
    X(bypass_Pa)              /* dp0: the flow is laminar below it */                                         \
    X(density_kg_m3)          /* rho */                                                                       \
    X(carrier_kg_m3)          /* rhoc */                                                                      \
    X(particle_share)         /* phi20 */                                                                     \
    X(walther_a)              /* Aw */                                                                        \
    X(walther_b)              /* Bw */                                                                        \
    X(viscosity_scale)        /* of the fluid */                                                              \
    X(flow_index)             /* nhb */                                                                       \
    X(flow_rate_1_s)          /* gref */                                                                      \
    X(creep)                  /* viscosity ratio, before to after yield */                                    \
    X(passive_least)          /* cinf */                                                                      \
    X(passive_thinning)       /* cv */                                                                        \
    X(passive_s)              /* lam */                                                                       \
    X(yield_Pa)               /* ts */                                                                        \
    X(yield_A_m)              /* Ha */                                                                        \
    X(yield_least_Pa)         /* t00 */                                                                       \
    X(fade_degC)              /* Tm */                                                                        \
    X(fade_K)                 /* wm */                                                                        \
    X(fluid_T)                /* Js */                                                                        \
    X(fluid_A_m)              /* Hsf */                                                                       \
    X(fluid_lag_s)            /* tauf */                                                                      \
    X(turns)                  /* Nt */                                                                        \
    X(coil_ohm)               /* R20 */                                                                       \
    X(copper_per_K)                                                                                           \
    X(leakage_henry)              /* Ls */                                                                    \
    X(shell_1_siemens)              /* G1 */                                                                  \
    X(shell_2_siemens)                                                                                        \
    X(shell_3_siemens)                                                                                        \
    X(steel_per_K)            /* of the shells' resistivity */                                                \
    X(core_m2)                /* Ac */                                                                        \
    X(pole_m2)                /* Ag */                                                                        \
    X(core_m)                 /* lc */                                                                        \
    X(permeability)           /* mur */                                                                       \
    X(knee_T)                 /* Bk */                                                                        \
    X(knee_exponent)          /* ns */                                                                        \
    X(stop_1_T)               /* r1 */                                                                        \
    X(stop_2_T)               /* r2 */                                                                        \
    X(stop_1_A_m)             /* a1 */                                                                        \
    X(stop_2_A_m)             /* a2 */                                                                        \
    X(stop_lag_s)             /* taum */                                                                      \
    X(driver_V_A)             /* Kp */                                                                        \
    X(driver_V_A_s)           /* Ki */                                                                        \
    X(driver_release_1_s)     /* Kaw */                                                                       \
    X(supply_low_V)           /* Vlo */                                                                       \
    X(supply_V)               /* Vhi */                                                                       \
    X(highest_A)              /* Imax */                                                                      \
    X(command_lag_s)          /* tauc */                                                                      \
    X(piston_kg)              /* ms */                                                                        \
    X(pin_N)              /* kH */                                                                            \
    X(pin_s_m)                /* alh */                                                                       \
    X(joint_gap_m)            /* gapj */                                                                      \
    X(joint_N_m)              /* kb */                                                                        \
    X(joint_N_m3)             /* k3 */                                                                        \
    X(joint_N_s_m)            /* cb */                                                                        \
    X(friction_N)             /* Fc */                                                                        \
    X(friction_static)        /* sr */                                                                        \
    X(stribeck_m_s)           /* vs */                                                                        \
    X(friction_1_Pa)          /* kps */                                                                       \
    X(friction_share)         /* wps, of chamber 1 */                                                         \
    X(friction_N_m)           /* kf */                                                                        \
    X(friction_N_s_m)         /* cf */                                                                        \
    X(friction_per_K)         /* fT */

typedef struct {
#define X(name) double name;
    HYDRAULIC_PARAMETERS(X)
#undef X
} hydraulic_parameters;

enum { SHELLS = 3, STOPS = 2, SEALS = 4 };

/* State of the damper: states of its equations, then the motion at the last sample and the start values of the next
 * solution. All members are doubles. */
typedef struct {
    double coil_A, command_A, integral_V, flux_Wb[SHELLS], stop_T[SHELLS][STOPS], field_T;
    double piston_m, piston_m_s, content_m3, flow_m3_s, gas, seal_m[SEALS];
    double rod_m, rod_m_s, wall_Pa, pressure_1_Pa, pressure_2_Pa, begun;
} hydraulic_state;

#define HYDRAULIC_STATE                                                                                       \
    "coil_A", "command_A", "integral_V", "flux_1_Wb", "flux_2_Wb", "flux_3_Wb", "stop_11_T", "stop_12_T",     \
        "stop_21_T", "stop_22_T", "stop_31_T", "stop_32_T", "field_T", "piston_m", "piston_m_s", "content_m3",\
        "flow_m3_s", "gas", "seal_1_m", "seal_2_m", "seal_3_m", "seal_4_m", "rod_m", "rod_m_s", "wall_Pa",    \
        "pressure_1_Pa", "pressure_2_Pa", "begun"

/* Quantities that depend only on temperature. */
typedef struct {
    double kelvin, ohm, shell_S[SHELLS];
    double area_1, area_2, volume_1, volume_2;
    double liquid, compliance, bubbles;       /* c0, a and b of the mixture's relative volume c0 - a p + b/p */
    double content, gas_constant, start_Pa;   /* Ntot, m R; pressure of rest at x = 0 */
    double yielded, creeping, flow_m, flow_k; /* coefficients of the flow in the active slot */
    double passive, passive_rate, loss, inertance, bypass;
    double yield_Pa, friction_N;
} hydraulic_climate;

void hydraulic_settle(const hydraulic_parameters *p, double kelvin, hydraulic_climate *at);

/* Advance by one step, solved in `inner` equal substeps. Displacement [m] and velocity [m/s] are values at the end of
 * the step; the motion since the last sample is a cubic. The commanded current [A] is constant over the step. At the
 * first sample the damper is at rest. `force` becomes the force of the rod [N]. Return 0 if no solution was found. */
int hydraulic_step(const hydraulic_parameters *p, const hydraulic_climate *at, double step, int inner, double x,
                   double v, double command, hydraulic_state *s, double *force);

/* Solve one implicit stage of length `l` for driver, coil and flux, which are independent of the mechanical states.
 * `was` is the history; `now` contains the initial guess. Return 0 if no solution was found. */
int hydraulic_magnet(const hydraulic_parameters *p, const hydraulic_climate *at, double l, double command,
                     const hydraulic_state *was, hydraulic_state *now);

/* Return the field strength [A/m] in the fluid at a flux density [T], and its derivative. The function is odd. */
double hydraulic_fluid_field(const hydraulic_parameters *p, double density_T, double *slope);

#endif
