/* The lumped virtual damper: driver, coil, eddy currents and fluid; yield, viscous and friction force.
 *
 * Every relaxation is solved exactly over a step because its inputs are held over the step. Nonlinear functions of a
 * state use the state at the beginning of the step. The equations are in virtual_rig/plant.py.
 */
#include "plant.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

static const double reference_K = 293.15; /* 20 C; the parameters are values at this temperature */
static const double stroke_m = 5e-3;      /* position at which the yield force has increased by the parameter `position` */

/* The C library's exp and ln differ between machines in the last bit. These two give the same bits everywhere, so that a
 * seed gives the same campaign on every machine. */

/* Return exp(x) within 3e-16 of its value: 2^k exp(s) with |s| <= ln 2 / 2, by the Taylor series to s^13. */
static double portable_exp(double x)
{
    const double round_up = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer, kept in the low bits */
    x = x > -708.0 ? x : -708.0;
    x = x < 709.0 ? x : 709.0;
    const double shifted = x * 1.44269504088896340736 + round_up, k = shifted - round_up;
    const double s = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    const double s2 = s * s, s4 = s2 * s2, s8 = s4 * s4;
    const double a = 0.5 + s * (1.0 / 6.0), b = 1.0 / 24.0 + s * (1.0 / 120.0);
    const double c = 1.0 / 720.0 + s * (1.0 / 5040.0), d = 1.0 / 40320.0 + s * (1.0 / 362880.0);
    const double e = 1.0 / 3628800.0 + s * (1.0 / 39916800.0), f = 1.0 / 479001600.0 + s * (1.0 / 6227020800.0);
    const double tail = ((a + s2 * b) + s4 * (c + s2 * d)) + s8 * (e + s2 * f);
    uint64_t bits;
    double power;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 1023u) << 52; /* 2^k */
    memcpy(&power, &bits, sizeof power);
    return power + power * (s + s2 * tail);
}

/* Return ln(x) of a positive normal number: k ln 2 + ln m with sqrt(1/2) <= m < sqrt(2), by the polynomial in
 * s = (m - 1) / (m + 1) of fdlibm's e_log.c (Sun Microsystems, 1993). */
static double portable_log(double x)
{
    const uint64_t half_root = UINT64_C(0x3fe6a09e667f3bcd); /* sqrt(1/2) */
    uint64_t bits, mantissa;
    double m;
    memcpy(&bits, &x, sizeof bits);
    bits += UINT64_C(0x3ff0000000000000) - half_root;
    const double k = (double)(bits >> 52) - 1023.0;
    mantissa = (bits & UINT64_C(0x000fffffffffffff)) + half_root;
    memcpy(&m, &mantissa, sizeof m);
    const double f = m - 1.0, s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    const double odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01
                     + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    const double even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    return k * 6.93147180369123816490e-01 - ((half - (s * (half + (odd + even)) + k * 1.90821492927058770002e-10)) - f);
}

/* Return (base / exp(log_unit))^exponent of a base that is zero or positive. */
static double power_of(double base, double exponent, double log_unit)
{
    return base > 1e-300 ? portable_exp(exponent * (portable_log(base) - log_unit)) : 0.0;
}

/* Return tanh(x) of x >= 0 with an error below 1e-16. */
static double portable_tanh(double x) { return x > 1e-5 ? 1.0 - 2.0 / (portable_exp(2.0 * x) + 1.0) : x; }

static double clamped(double x, double low, double high)
{
    const double above = x > low ? x : low;
    return above < high ? above : high;
}

void rig_settle(const rig_parameters *p, double step, double kelvin, rig_climate *at)
{
    const double warmer = kelvin - reference_K;
    const double quicker = 1.0 + p->eddy_per_K * warmer, ohm = p->coil_ohm * (1.0 + p->copper_per_K * warmer);
    const double friction = p->friction_N * (1.0 - p->friction_loss_per_K * warmer);
    at->siemens = 1.0 / ohm;
    at->coil_decay = -step * ohm / p->coil_henry;
    at->rise = exp(-step * quicker / p->eddy_rise_s);
    at->fall = exp(-step * quicker / p->eddy_fall_s);
    at->fluid = exp(-step / p->fluid_lag_s);
    at->per_field_A = 1.0 / p->field_current_A;
    at->full_log = log(tanh(p->full_current_A / p->field_current_A));
    at->viscous = p->viscous_N
                  * exp(p->viscosity_K
                        * (1.0 / (kelvin - p->viscosity_pole_K) - 1.0 / (reference_K - p->viscosity_pole_K)));
    at->viscous_log = log(p->viscous_m_s);
    at->loss = p->yield_loss_per_K * warmer;
    at->friction = friction > 0.0 ? friction : 0.0;
    at->per_stribeck = 1.0 / p->stribeck_m_s;
    at->per_leak = 1.0 / p->leak_N_s_m;
}

/* Advance the currents by a step; return the effective current behind all lags [A]. */
static double advance_currents(const rig_parameters *p, const rig_climate *at, double step, double command, rig_state *s)
{
    const double error = command - s->coil_A;
    const double requested = p->coil_ohm * command + p->driver_V_A * error + s->integral_V;
    const double voltage = clamped(requested, -p->supply_V, p->supply_V);
    if (voltage == requested) s->integral_V += step * p->driver_V_A_s * error;
    const double decay = at->coil_decay * (1.0 + p->inductance_fall * s->coil_A * s->coil_A);
    const double target = voltage * at->siemens;
    s->coil_A = target + (s->coil_A - target) * portable_exp(decay);
    const double lag = s->coil_A > s->flux_A ? at->rise : at->fall;
    s->flux_A = s->coil_A + (s->flux_A - s->coil_A) * lag;
    s->fluid_A = s->flux_A + (s->fluid_A - s->flux_A) * at->fluid;
    s->play_at_A = clamped(s->play_at_A, s->fluid_A - p->play_A, s->fluid_A + p->play_A);
    return fabs((1.0 - p->play_share) * s->fluid_A + p->play_share * s->play_at_A);
}

/* Advance the bristles of the yield force by a step; return the yield force [N]. */
static double advance_yield(const rig_parameters *p, const rig_climate *at, double step, double x, double speed,
                            double sign, double g, rig_state *s)
{
    /* The field's contribution to yield force and stiffness decreases with temperature. */
    const double kept = 1.0 - at->loss * (1.0 + p->low_field_loss * (1.0 - g));
    const double warm = g * (kept > 0.0 ? kept : 0.0);
    const double level = p->yield_N + p->yield_field_N * warm;
    const double stiffness = p->stiffness_N_m + p->stiffness_field_N_m * warm;
    const double shape = 1.0 + p->position * (x / stroke_m) * (x / stroke_m);
    const double target = sign * level * (1.0 + sign * p->asymmetry) * shape;
    /* The rates of the bristles have the ratios 1/4, 1 and 4, so their decays are powers of one number. */
    const double soft = portable_exp(-0.25 * step * stiffness * speed / level);
    const double plain = soft * soft * soft * soft, stiff = plain * plain * plain * plain;
    s->bristle_N = target + (s->bristle_N - target) * plain;
    s->soft_N = target + (s->soft_N - target) * soft;
    s->stiff_N = target + (s->stiff_N - target) * stiff;
    return (1.0 - 2.0 * p->spread) * s->bristle_N + p->spread * (s->soft_N + s->stiff_N);
}

/* Advance the friction bristle by a step; return the friction force [N]. */
static double advance_friction(const rig_parameters *p, const rig_climate *at, double step, double w, double speed,
                               double sign, rig_state *s)
{
    const double slow = w * at->per_stribeck;
    const double slides = at->friction * (1.0 + (p->friction_static - 1.0) * portable_exp(-(slow * slow)));
    const double target = sign * slides;
    s->friction_N = slides > 0.0
                        ? target + (s->friction_N - target) * portable_exp(-step * p->friction_N_m * speed / slides)
                        : 0.0;
    return s->friction_N;
}

double rig_step(const rig_parameters *p, const rig_climate *at, double step, double x, double v, double command,
                rig_state *s, double *field)
{
    *field = advance_currents(p, at, step, command, s);
    const double g = power_of(portable_tanh(*field * at->per_field_A), p->field_exponent, at->full_log);
    const double w = v - s->chain_N * at->per_leak;
    const double speed = fabs(w), sign = speed > 0.0 ? copysign(1.0, w) : 0.0;
    const double yield = advance_yield(p, at, step, x, speed, sign, g, s);
    const double viscous = sign * at->viscous * power_of(speed, p->viscous_exponent, at->viscous_log)
                           * (1.0 + p->viscous_field * g);
    s->chain_N = yield + viscous;
    return yield + viscous + advance_friction(p, at, step, w, speed, sign, s) + p->spring_N_m * x + p->offset_N;
}
