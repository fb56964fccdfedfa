/* Driver, coil and magnetic circuit of the hydraulic damper: three steel shells with hysteresis, and the fluid gap. */
#include "hydraulic.h"

#include <math.h>

static const double mu0 = 1.25663706212e-6;
enum { UNKNOWNS = 1 + SHELLS, MOST = 60 };

double hydraulic_fluid_field(const hydraulic_parameters *p, double density_T, double *slope)
{
    const double b = fabs(density_T), z = mu0 * p->fluid_A_m + p->fluid_T - b;
    const double root = sqrt(z * z + 4.0 * mu0 * b * p->fluid_A_m);
    const double field = z > 0.0 ? 2.0 * b * p->fluid_A_m / (z + root) : (root - z) / (2.0 * mu0);
    const double beyond = field + p->fluid_A_m;
    *slope = 1.0 / (mu0 + p->fluid_T * p->fluid_A_m / (beyond * beyond));
    return copysign(field, density_T);
}

static double power(double base, double exponent)
{
    if (exponent != floor(exponent) || exponent > 32.0) return pow(base, exponent);
    double out = 1.0;
    for (int k = (int)exponent; k > 0; k /= 2, base *= base)
        if (k % 2) out *= base;
    return out;
}

/* Stop operator with a lag: return the distance of the flux density from its anchor at the end of a stage. */
static double stop(double distance, double width, double lag, double *slope)
{
    *slope = fabs(distance) > width ? 1.0 / (1.0 + lag) : 1.0;
    return fabs(distance) > width ? (distance + copysign(lag * width, distance)) * *slope : distance;
}

/* Return the magnetomotive force [A] required by the flux [Wb] of a shell, and its derivative by flux. */
static double needed(const hydraulic_parameters *p, double flux, double lag, const double was[STOPS], double now[STOPS],
                     double *slope)
{
    const double width[STOPS] = {p->stop_1_T, p->stop_2_T}, height[STOPS] = {p->stop_1_A_m, p->stop_2_A_m};
    const double b = SHELLS * flux / p->core_m2, bent = power(fabs(b) / p->knee_T, p->knee_exponent);
    double field = b / (mu0 * p->permeability) * (1.0 + bent);
    double rise = (1.0 + (p->knee_exponent + 1.0) * bent) / (mu0 * p->permeability);
    for (int j = 0; j < STOPS; j++) {
        double moved;
        const double s = stop(b - was[j], width[j], lag, &moved);
        now[j] = b - s;
        field += height[j] * s / width[j];
        rise += height[j] * moved / width[j];
    }
    double across_rise;
    const double across = hydraulic_fluid_field(p, SHELLS * flux / p->pole_m2, &across_rise);
    *slope = SHELLS * (p->core_m * rise / p->core_m2 + 2.0 * p->gap_m * across_rise / p->pole_m2);
    return p->core_m * field + 2.0 * p->gap_m * across;
}

/* Solve the tridiagonal system; `residual` becomes the solution. */
static void eliminate(double below[UNKNOWNS], double on[UNKNOWNS], const double above[UNKNOWNS], double residual[UNKNOWNS])
{
    for (int k = 1; k < UNKNOWNS; k++) {
        const double share = below[k] / on[k - 1];
        on[k] -= share * above[k - 1];
        residual[k] -= share * residual[k - 1];
    }
    for (int k = UNKNOWNS - 1; k >= 0; k--)
        residual[k] = (residual[k] - (k + 1 < UNKNOWNS ? above[k] * residual[k + 1] : 0.0)) / on[k];
}

/* Return the driver voltage [V] at a coil current, its derivative by current, and the new integral. */
static double drive(const hydraulic_parameters *p, double l, double command, double current, double integral,
                    double *integral_now, double *slope)
{
    const double error = command - current, forward = p->driver_V_A * error + p->coil_ohm * command;
    const double free_V = integral + l * p->driver_V_A_s * error;
    const double asked = forward + free_V;
    const double given = fmin(fmax(asked, p->supply_low_V), p->supply_V);
    *integral_now = free_V;
    *slope = -(p->driver_V_A + l * p->driver_V_A_s);
    if (given == asked) return given;
    const double released = l * p->driver_release_1_s;
    *integral_now = (free_V + released * (given - forward)) / (1.0 + released);
    *slope = 0.0;
    return given;
}

int hydraulic_magnet(const hydraulic_parameters *p, const hydraulic_climate *at, double l, double command,
                     const hydraulic_state *was, hydraulic_state *now)
{
    const double asked = fmin(fmax(command, 0.0), p->highest_A), follow = l / p->command_lag_s;
    now->command_A = (was->command_A + follow * asked) / (1.0 + follow);
    int found = 0;
    for (int turn = 0; turn < MOST && !found; turn++) {
        double below[UNKNOWNS], on[UNKNOWNS], above[UNKNOWNS], residual[UNKNOWNS], moved;
        const double volts = drive(p, l, now->command_A, now->coil_A, was->integral_V, &now->integral_V, &moved);
        residual[0] = p->leakage_henry * (now->coil_A - was->coil_A) - l * (volts - at->ohm * now->coil_A)
                      + p->turns * (now->flux_Wb[0] - was->flux_Wb[0]);
        below[0] = 0.0;
        on[0] = p->leakage_henry + l * (at->ohm - moved);
        above[0] = p->turns;
        double before = p->turns * now->coil_A, before_rise = p->turns; /* values of the next outer shell */
        for (int k = 0; k < SHELLS; k++) {
            const double inner = k + 1 < SHELLS ? now->flux_Wb[k + 1] : 0.0, share = l / at->shell_S[k];
            double rise;
            const double force = needed(p, now->flux_Wb[k] - inner, l / p->stop_lag_s, was->stop_T[k], now->stop_T[k], &rise);
            residual[k + 1] = now->flux_Wb[k] - was->flux_Wb[k] - share * (before - force);
            below[k + 1] = -share * before_rise;
            on[k + 1] = 1.0 + share * (rise + (k > 0 ? before_rise : 0.0));
            above[k + 1] = -share * rise;
            before = force;
            before_rise = rise;
        }
        eliminate(below, on, above, residual);
        const double damped = turn < 8 ? 1.0 : turn < 25 ? 0.6 : 0.3;
        now->coil_A -= damped * residual[0];
        found = fabs(residual[0]) < 1e-8;
        for (int k = 0; k < SHELLS; k++) {
            now->flux_Wb[k] -= damped * residual[k + 1];
            found = found && fabs(residual[k + 1]) < 1e-8 * p->pole_m2;
        }
    }
    const double towards = l / p->fluid_lag_s;
    now->field_T = (was->field_T + towards * now->flux_Wb[0] / p->pole_m2) / (1.0 + towards);
    return found;
}
