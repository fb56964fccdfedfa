/* One step of the virtual damper: driver, coil, eddy currents, fluid; yield, viscous and friction force.
 *
 * Every relaxation is solved exactly over the step for inputs held over it; what is nonlinear in a state is
 * evaluated at the step's begin. The rest of the meaning is in rig/plant.py.
 */
#include "plant.h"

#include <math.h>

static const double room = 293.15;   /* 20 C, where the parameters hold [K] */
static const double stroke = 5e-3;   /* scale of the yield force's dependence on position [m] */

static double above_zero(double value) { return value > 0.0 ? value : 0.0; }

/* tanh of what is not below zero, to 1e-16 of its largest: half the time of the library's. */
static double saturated(double x) { return x > 1e-5 ? 1.0 - 2.0 / (exp(2.0 * x) + 1.0) : x; }

/* (base / exp(log_unit))^exponent of a base that is not below zero. */
static double power(double base, double exponent, double log_unit)
{
    return base > 0.0 ? exp(exponent * (log(base) - log_unit)) : 0.0;
}

void rig_settle(const rig_parameters *p, double step, double kelvin, rig_climate *at)
{
    const double warmer = kelvin - room;
    const double quicker = 1.0 + p->eddy_per_K * warmer;
    at->kelvin = kelvin;
    at->ohm = p->coil_ohm * (1.0 + p->copper_per_K * warmer);
    at->rise = exp(-step * quicker / p->eddy_rise_s);
    at->fall = exp(-step * quicker / p->eddy_fall_s);
    at->fluid = exp(-step / p->fluid_lag_s);
    at->viscous = p->viscous_N
                  * exp(p->viscosity_K * (1.0 / (kelvin - p->viscosity_pole_K) - 1.0 / (room - p->viscosity_pole_K)));
    at->loss = p->yield_loss_per_K * warmer;
    at->friction = p->friction_N * above_zero(1.0 - p->friction_loss_per_K * warmer);
    at->full_log = log(tanh(p->full_current_A / p->field_current_A));
}

/* Move the currents on by a step; returns the effective current behind all lags. */
static double energise(const rig_parameters *p, const rig_climate *at, double step, double command, rig_state *s)
{
    const double error = command - s->coil_A;
    const double asked = p->coil_ohm * command + p->driver_V_A * error + s->integral_V;
    const double voltage = fmin(fmax(asked, -p->supply_V), p->supply_V);
    if (voltage == asked) s->integral_V += step * p->driver_V_A_s * error;
    const double inductance = p->coil_henry / (1.0 + p->inductance_fall * s->coil_A * s->coil_A);
    const double towards = voltage / at->ohm;
    s->coil_A = towards + (s->coil_A - towards) * exp(-step * at->ohm / inductance);
    s->flux_A = s->coil_A + (s->flux_A - s->coil_A) * (s->coil_A > s->flux_A ? at->rise : at->fall);
    s->fluid_A = s->flux_A + (s->fluid_A - s->flux_A) * at->fluid;
    s->play_at_A = fmin(fmax(s->play_at_A, s->fluid_A - p->play_A), s->fluid_A + p->play_A);
    return fabs((1.0 - p->play_share) * s->fluid_A + p->play_share * s->play_at_A);
}

double rig_step(const rig_parameters *p, const rig_climate *at, double step, double x, double v, double command,
                rig_state *s, double *field)
{
    *field = energise(p, at, step, command, s);
    const double g = power(above_zero(saturated(*field / p->field_current_A)), p->field_exponent, at->full_log);
    const double w = v - s->chain_N / p->leak_N_s_m;
    const double speed = fabs(w), sign = (double)((w > 0.0) - (w < 0.0));

    /* the field's share of the yield force and of the stiffness, as heat leaves it */
    const double warm = g * above_zero(1.0 - at->loss * (1.0 + p->low_field_loss * (1.0 - g)));
    const double level = p->yield_N + p->yield_field_N * warm;
    const double stiffness = p->stiffness_N_m + p->stiffness_field_N_m * warm;
    const double shape = 1.0 + p->position * (x / stroke) * (x / stroke);
    const double target = sign * level * (1.0 + sign * p->asymmetry) * shape;
    const double soft = exp(-0.25 * step * stiffness * speed / level); /* rates 1/4, 1, 4: powers of one number */
    const double plain = soft * soft * soft * soft;
    const double stiff = plain * plain * plain * plain;
    s->bristle_N = target + (s->bristle_N - target) * plain;
    s->soft_N = target + (s->soft_N - target) * soft;
    s->stiff_N = target + (s->stiff_N - target) * stiff;
    const double yield = (1.0 - 2.0 * p->spread) * s->bristle_N + p->spread * (s->soft_N + s->stiff_N);

    const double viscous =
        sign * at->viscous * power(speed / p->viscous_m_s, p->viscous_exponent, 0.0) * (1.0 + p->viscous_field * g);
    s->chain_N = yield + viscous;

    const double slow = w / p->stribeck_m_s;
    const double still = slow * slow < 40.0 ? exp(-slow * slow) : 0.0; /* nothing beside 1 */
    const double slides = at->friction * (1.0 + (p->friction_static - 1.0) * still);
    s->friction_N = slides > 0.0
                        ? sign * slides + (s->friction_N - sign * slides) * exp(-step * p->friction_N_m * speed / slides)
                        : 0.0;
    return yield + viscous + s->friction_N + p->spring_N_m * x + p->offset_N;
}
