/* Steps of the virtual damper, as many dampers at once as the instruction set has numbers in a register: driver,
 * coil, eddy currents, fluid; yield, viscous and friction force.
 *
 * Compiled once per instruction set (RIG_MARCH names the build), each damper to the same bits in every build and
 * beside any others. Every relaxation is solved exactly over the step for inputs held over it; what is nonlinear in
 * a state is evaluated at the step's begin. The rest of the meaning is in rig/plant.py.
 */
#include "plant.h"

#include "lanes.h"

static const double stroke = 5e-3; /* scale of the yield force's dependence on position [m] */

typedef struct {
#define X(name) pack name;
    RIG_STATE(X)
#undef X
} pack_state;

/* (base / exp(log_unit))^exponent of a base that is not below zero. */
static inline pack power_of(pack base, double exponent, double log_unit)
{
    const pack_mask some = (pack_mask)(base > 1e-300);
    return choose(some, exp_of(exponent * (log_of(greater_of(base, pack_of(1e-300))) - log_unit)), pack_of(0.0));
}

/* tanh of what is not below zero, to 1e-16 of its largest. */
static inline pack saturated(pack x)
{
    return choose((pack_mask)(x > 1e-5), 1.0 - 2.0 / (exp_of(2.0 * x) + 1.0), x);
}

/* Move the currents on by a step; returns the effective current behind all lags. */
static inline pack energise(const rig_parameters *p, const rig_climate *at, double step, pack command, pack_state *s)
{
    const pack error = command - s->coil_A;
    const pack asked = p->coil_ohm * command + p->driver_V_A * error + s->integral_V;
    const pack voltage = lesser_of(greater_of(asked, pack_of(-p->supply_V)), pack_of(p->supply_V));
    s->integral_V = choose((pack_mask)(voltage == asked), s->integral_V + step * p->driver_V_A_s * error, s->integral_V);
    const pack decay = at->coil_decay * (1.0 + p->inductance_fall * s->coil_A * s->coil_A);
    const pack towards = voltage * at->siemens;
    s->coil_A = towards + (s->coil_A - towards) * exp_of(decay);
    const pack lag = choose((pack_mask)(s->coil_A > s->flux_A), pack_of(at->rise), pack_of(at->fall));
    s->flux_A = s->coil_A + (s->flux_A - s->coil_A) * lag;
    s->fluid_A = s->flux_A + (s->fluid_A - s->flux_A) * at->fluid;
    s->play_at_A = lesser_of(greater_of(s->play_at_A, s->fluid_A - p->play_A), s->fluid_A + p->play_A);
    return size_of((1.0 - p->play_share) * s->fluid_A + p->play_share * s->play_at_A);
}

/* Move the bristles of the yield force on by a step; returns the force. */
static inline pack yields(const rig_parameters *p, const rig_climate *at, double step, double x, pack speed, pack sign,
                          pack g, pack_state *s)
{
    /* the field's share of the yield force and of the stiffness, as heat leaves it */
    const pack left = 1.0 - at->loss * (1.0 + p->low_field_loss * (1.0 - g));
    const pack warm = g * greater_of(left, pack_of(0.0));
    const pack level = p->yield_N + p->yield_field_N * warm;
    const pack stiffness = p->stiffness_N_m + p->stiffness_field_N_m * warm;
    const double shape = 1.0 + p->position * (x / stroke) * (x / stroke);
    const pack target = sign * level * (1.0 + sign * p->asymmetry) * shape;
    const pack soft = exp_of(-0.25 * step * stiffness * speed / level); /* rates 1/4, 1, 4: powers of one number */
    const pack plain = soft * soft * soft * soft;
    const pack stiff = plain * plain * plain * plain;
    s->bristle_N = target + (s->bristle_N - target) * plain;
    s->soft_N = target + (s->soft_N - target) * soft;
    s->stiff_N = target + (s->stiff_N - target) * stiff;
    return (1.0 - 2.0 * p->spread) * s->bristle_N + p->spread * (s->soft_N + s->stiff_N);
}

/* Move the friction bristle on by a step; returns the force. */
static inline pack rubs(const rig_parameters *p, const rig_climate *at, double step, pack w, pack speed, pack sign,
                        pack_state *s)
{
    const pack slow = w * at->per_stribeck;
    const pack slides = at->friction * (1.0 + (p->friction_static - 1.0) * exp_of(-(slow * slow)));
    const pack most = sign * slides, left = exp_of(-step * p->friction_N_m * speed / slides);
    s->friction_N = choose((pack_mask)(slides > 0.0), most + (s->friction_N - most) * left, pack_of(0.0));
    return s->friction_N;
}

static inline pack step_of(const rig_parameters *p, const rig_climate *at, double step, double x, double v, pack command,
                           pack_state *s, pack *field)
{
    *field = energise(p, at, step, command, s);
    const pack g = power_of(saturated(*field * at->per_field_A), p->field_exponent, at->full_log);
    const pack w = v - s->chain_N * at->per_leak;
    const pack speed = size_of(w), sign = choose((pack_mask)(speed > 0.0), signed_as(pack_of(1.0), w), pack_of(0.0));
    const pack yield = yields(p, at, step, x, speed, sign, g, s);
    const pack viscous = sign * at->viscous * power_of(speed, p->viscous_exponent, at->viscous_log)
                         * (1.0 + p->viscous_field * g);
    s->chain_N = yield + viscous;
    return yield + viscous + rubs(p, at, step, w, speed, sign, s) + p->spring_N_m * x + p->offset_N;
}

/* Up to PACK dampers; the lanes beyond the last go with it. One alone is spread, not gathered. */
static void march_pack(const rig_parameters *p, const rig_climate *at, double step, const double *x, const double *v,
                       size_t steps, const double *command, size_t count, rig_state *const *state,
                       double *const *force, double *field)
{
    double room[PACK];
    pack_state s;
    pack given = pack_of(*command), out, last = pack_of(0.0);
#define X(name) s.name = pack_of(state[0]->name);
    RIG_STATE(X)
#undef X
    if (count > 1) {
        for (size_t lane = 0; lane < PACK; lane++) room[lane] = command[lane < count ? lane : count - 1];
        memcpy(&given, room, sizeof room);
#define X(name)                                                                                               \
    for (size_t lane = 0; lane < PACK; lane++) room[lane] = state[lane < count ? lane : count - 1]->name;     \
    memcpy(&s.name, room, sizeof room);
        RIG_STATE(X)
#undef X
    }
    for (size_t k = 0; k < steps; k++) {
        out = step_of(p, at, step, x[k], v[k], given, &s, &last);
        memcpy(room, &out, sizeof room);
        for (size_t lane = 0; lane < count; lane++) force[lane][k] = room[lane];
    }
#define X(name)                                                                                               \
    memcpy(room, &s.name, sizeof room);                                                                       \
    for (size_t lane = 0; lane < count; lane++) state[lane]->name = room[lane];
    RIG_STATE(X)
#undef X
    if (!field) return;
    memcpy(room, &last, sizeof room);
    for (size_t lane = 0; lane < count; lane++) field[lane] = room[lane];
}

void RIG_MARCH(const rig_parameters *p, const rig_climate *at, double step, const double *x, const double *v,
               size_t steps, const double *command, size_t count, rig_state *const *state, double *const *force,
               double *field)
{
    for (size_t first = 0; first < count; first += PACK)
        march_pack(p, at, step, x, v, steps, command + first, count - first < PACK ? count - first : PACK, state + first,
                   force + first, field ? field + first : NULL);
}
