/* Physics of the hydraulic damper: pressures, flows, flux and mass; parameters, state, and one time step.
 *
 * Plain C99 without memory of its own. It shares nothing with the identification kernel, nor with the lumped damper
 * of plant.c. SI and kelvin; extension positive. Equations: docs/hydraulic_rig.md.
 */
#ifndef RIG_HYDRAULIC_H
#define RIG_HYDRAULIC_H

/* Names and order of the parameters, which hydraulic.py describes. Python reads this order from the extension. */
#define HYDRAULIC_PARAMETERS(X)                                                                                   \
    X(bore_m) X(rod_m) X(through_rod) X(chamber_1_m) X(chamber_2_m) X(gas_m3) X(gas_Pa) X(gas_exponent)           \
    X(gas_exchange_s) X(rest_Pa) X(rest_Pa_K) X(air) X(bulk_Pa) X(bulk_per_K) X(expansion_per_K)                  \
    X(slot_diameter_m) X(gap_m) X(active_m) X(passive_m) X(entrance_loss) X(bypass_m2) X(bypass_Pa)               \
    X(density_kg_m3) X(carrier_kg_m3) X(particle_share) X(walther_a) X(walther_b) X(viscosity_scale)              \
    X(flow_index) X(flow_rate_1_s) X(creep) X(passive_least) X(passive_thinning) X(passive_s) X(yield_Pa)         \
    X(yield_A_m) X(yield_least_Pa) X(fade_degC) X(fade_K) X(fluid_T) X(fluid_A_m) X(fluid_lag_s) X(turns)         \
    X(coil_ohm) X(copper_per_K) X(leakage_henry) X(shell_1_siemens) X(shell_2_siemens) X(shell_3_siemens)         \
    X(steel_per_K) X(core_m2) X(pole_m2) X(core_m) X(permeability) X(knee_T) X(knee_exponent) X(stop_1_T)         \
    X(stop_2_T) X(stop_1_A_m) X(stop_2_A_m) X(stop_lag_s) X(driver_V_A) X(driver_V_A_s) X(driver_release_1_s)     \
    X(supply_low_V) X(supply_V) X(highest_A) X(command_lag_s) X(piston_kg) X(pin_N) X(pin_s_m) X(joint_gap_m)     \
    X(joint_N_m) X(joint_N_m3) X(joint_N_s_m) X(friction_N) X(friction_static) X(stribeck_m_s) X(friction_1_Pa)   \
    X(friction_share) X(friction_N_m) X(friction_N_s_m) X(friction_per_K)

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
