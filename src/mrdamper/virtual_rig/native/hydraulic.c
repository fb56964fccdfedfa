/* Piston, chambers, valve, seal and joint of the hydraulic damper, and its time step.
 *
 * Alexander's two-stage implicit Runge-Kutta method of second order (L-stable, stiffly accurate): each stage solves
 * Y = C + l f(Y) with l = g h. The electric states are solved first because they do not depend on the mechanical
 * states. Newton's method then solves for piston speed, content of chamber 1 and wall stress of the valve. The other
 * states have closed forms.
 */
#include "hydraulic.h"

#include <math.h>

static const double pi = 3.14159265358979323846;
static const double room = 293.15, zero = 273.15, atmosphere = 101325.0;
static const double stage = 0.29289321881345247560; /* g = 1 - 1/sqrt(2) */
static const double packed = 0.64;                  /* max volume fraction of particles */
static const double seal_share[SEALS] = {0.4, 0.3, 0.2, 0.1}, seal_part[SEALS] = {0.1, 0.2, 0.3, 0.4};
enum { MOST = 60, FINER = 8 };

/* Return the relative volume of the liquid with its bubbles. */
static double relative_volume(const hydraulic_climate *at, double pressure)
{
    return at->liquid - at->compliance * pressure + at->bubbles / pressure;
}

/* Return the positive root of a p^2 + b p - c for positive a and c, without cancellation. */
static double positive_root(double a, double b, double c)
{
    const double root = sqrt(b * b + 4.0 * a * c);
    return b > 0.0 ? 2.0 * c / (root + b) : (root - b) / (2.0 * a);
}

static void settle_mixture(const hydraulic_parameters *p, double kelvin, hydraulic_climate *at)
{
    const double expanded = 1.0 + p->expansion_per_K * (kelvin - room);
    const double bulk = p->bulk_Pa * exp(-p->bulk_per_K * (kelvin - room)), liquid = (1.0 - p->air) * expanded;
    at->compliance = liquid / bulk;
    at->liquid = liquid * (1.0 + atmosphere / bulk);
    at->bubbles = p->air * atmosphere * kelvin / room;
}

static double bloch(double kelvin) { return 1.0 - 3.4e-6 * kelvin * sqrt(kelvin); }

static double magnetic_share(const hydraulic_parameters *p, double degrees)
{
    return 1.0 / (1.0 + exp((degrees - p->fade_degC) / p->fade_K));
}

static void settle_valve(const hydraulic_parameters *p, double kelvin, hydraulic_climate *at)
{
    const double expanded = 1.0 + p->expansion_per_K * (kelvin - room), share = p->particle_share / expanded;
    const double mm2_s = pow(10.0, pow(10.0, p->walther_a - p->walther_b * log10(kelvin))) - 0.7;
    const double eta = p->viscosity_scale * p->carrier_kg_m3 / expanded * mm2_s * 1e-6 * pow(1.0 - share / packed, -1.6);
    const double width = pi * p->slot_diameter_m, n = p->flow_index, consistency = eta * pow(p->flow_rate_1_s, 1.0 - n);
    at->flow_m = n / (n + 1.0);
    at->flow_k = n / (2.0 * n + 1.0);
    at->yielded = 0.5 * width * p->gap_m * p->gap_m * at->flow_m * pow(consistency, -1.0 / n);
    at->creeping = width * p->gap_m * p->gap_m / (6.0 * p->creep * eta);
    at->passive = 12.0 * p->passive_m * eta / (width * p->gap_m * p->gap_m * p->gap_m);
    at->passive_rate = p->passive_s * 6.0 / (width * p->gap_m * p->gap_m);
    at->loss = 0.5 * p->entrance_loss * p->density_kg_m3 / (width * p->gap_m * width * p->gap_m);
    at->inertance = p->density_kg_m3 * (p->active_m + p->passive_m) / (width * p->gap_m);
    at->bypass = p->bypass_m2 * sqrt(2.0 / p->density_kg_m3);
    const double cooler = bloch(kelvin) / bloch(room);
    at->yield_Pa = p->yield_Pa * pow(share / p->particle_share, 1.52) * cooler * cooler * magnetic_share(p, kelvin - zero)
                   / magnetic_share(p, 20.0);
}

void hydraulic_settle(const hydraulic_parameters *p, double kelvin, hydraulic_climate *at)
{
    const double warmer = kelvin - room, rod = p->rod_m * p->rod_m, bore = p->bore_m * p->bore_m;
    at->kelvin = kelvin;
    at->ohm = p->coil_ohm * (1.0 + p->copper_per_K * warmer);
    const double shell_S[SHELLS] = {p->shell_1_siemens, p->shell_2_siemens, p->shell_3_siemens};
    for (int k = 0; k < SHELLS; k++) at->shell_S[k] = shell_S[k] / (1.0 + p->steel_per_K * warmer);
    at->area_1 = 0.25 * pi * (bore - rod);
    at->area_2 = 0.25 * pi * (bore - p->through_rod * rod);
    at->volume_1 = at->area_1 * p->chamber_1_m;
    at->volume_2 = at->area_2 * p->chamber_2_m;
    at->friction_N = p->friction_N * exp(-p->friction_per_K * warmer);
    settle_valve(p, kelvin, at);
    /* A damper with gas was filled at 20 C. Without gas, a slow compensator sets a pressure that rises with temperature. */
    const int gas = p->gas_m3 > 0.0;
    settle_mixture(p, gas ? room : kelvin, at);
    at->start_Pa = p->rest_Pa + p->rest_Pa_K * warmer;
    at->content = (at->volume_1 + at->volume_2) / relative_volume(at, gas ? p->gas_Pa : at->start_Pa);
    at->gas_constant = p->gas_Pa * p->gas_m3 / room;
    if (gas) settle_mixture(p, kelvin, at);
}

/* Set the state of rest at a displacement: no current, equal pressures in both chambers. */
static void begin(const hydraulic_parameters *p, const hydraulic_climate *at, double x, double v, hydraulic_state *s)
{
    static const hydraulic_state virgin = {0};
    const double filled = at->volume_1 + at->volume_2 + p->gas_m3 + (at->area_2 - at->area_1) * x;
    const double warmth = p->gas_m3 > 0.0 ? at->gas_constant * at->kelvin : 0.0; /* product p Vg of the gas */
    const double pressure = positive_root(at->content * at->compliance, filled - at->content * at->liquid,
                                          at->content * at->bubbles + warmth);
    *s = virgin;
    s->piston_m = s->rod_m = x;
    s->piston_m_s = s->rod_m_s = v;
    for (int n = 0; n < SEALS; n++) s->seal_m[n] = x;
    s->content_m3 = (at->volume_1 - at->area_1 * x) / relative_volume(at, pressure);
    s->gas = warmth > 0.0 ? pressure * pow(warmth / pressure, p->gas_exponent) : 0.0;
    s->pressure_1_Pa = s->pressure_2_Pa = pressure;
    s->begun = 1.0;
}

/* A force, pressure or flow, and its derivatives with respect to piston speed and content of chamber 1. */
typedef struct {
    double value, by_speed, by_content;
} slopes;

/* Return the pressure of chamber 1 from its content and the piston position. */
static slopes pressure_1(const hydraulic_climate *at, double l, double piston, double content)
{
    const double volume = (at->volume_1 - at->area_1 * piston) / content;
    const double p = positive_root(at->compliance, volume - at->liquid, at->bubbles);
    const double soft = content * (at->compliance + at->bubbles / (p * p));
    return (slopes){p, l * at->area_1 / soft, volume / soft};
}

/* Return the pressure of chamber 2, which may contain gas behind a floating piston; update the state of the gas. */
static slopes pressure_2(const hydraulic_parameters *p, const hydraulic_climate *at, double l, double piston,
                         double content_1, double gas_was, double guess, double *gas)
{
    const double content = at->content - content_1, filled = at->volume_2 + at->area_2 * piston + p->gas_m3;
    double pressure = guess, volume = 0.0;
    if (p->gas_m3 > 0.0) {
        double moved = 1.0;
        for (int turn = 0; turn < MOST && fabs(moved) > 1e-11 * pressure; turn++) {
            volume = pow(*gas / pressure, 1.0 / p->gas_exponent);
            const double warmth = pressure * volume / at->gas_constant; /* the gas's temperature [K] */
            const double kept = gas_was / (1.0 + l * (1.0 - at->kelvin / warmth) / p->gas_exchange_s);
            volume *= 1.0 + (kept / *gas - 1.0) / p->gas_exponent; /* first order, because the change is small */
            *gas = kept;
            const double excess = content * relative_volume(at, pressure) + volume - filled;
            moved = excess
                    / (content * (at->compliance + at->bubbles / (pressure * pressure))
                       + volume / (p->gas_exponent * pressure));
            pressure = fmax(pressure + moved, 0.5 * pressure);
        }
    } else {
        pressure = positive_root(at->compliance, filled / content - at->liquid, at->bubbles);
    }
    const double soft =
        content * (at->compliance + at->bubbles / (pressure * pressure)) + volume / (p->gas_exponent * pressure);
    return (slopes){pressure, -l * at->area_2 / soft, -relative_volume(at, pressure) / soft};
}

/* Return the flow in the active slot at a wall stress, and its derivative by wall stress. The fluid is a
 * Herschel-Bulkley fluid with creep between parallel plates. */
static double slot_flow(const hydraulic_parameters *p, const hydraulic_climate *at, double wall, double yield, double *slope)
{
    const double stress = fabs(wall), over = stress - yield;
    double flow = at->creeping * stress;
    *slope = at->creeping;
    if (over > 0.0) {
        const double part = over / stress, root = at->yielded * pow(over, 1.0 / p->flow_index);
        const double shape = 1.0 - at->flow_k * part;
        flow += root * part * shape;
        *slope += root * ((1.0 + 1.0 / p->flow_index) * shape - part - at->flow_k * (1.0 - 2.0 * part) * part) / stress;
    }
    return copysign(flow, wall);
}

/* Return the pressure drop of the valve at a wall stress and flow, and its derivative with respect to wall stress. */
static double valve_drop(const hydraulic_parameters *p, const hydraulic_climate *at, double wall, double flow, double rise,
                         double *slope)
{
    const double speed = fabs(flow), thin = 1.0 / (1.0 + at->passive_rate * speed);
    *slope = 2.0 * p->active_m / p->gap_m
             + rise * (at->passive * (p->passive_least + p->passive_thinning * thin * thin) + 2.0 * at->loss * speed);
    return 2.0 * p->active_m / p->gap_m * wall
           + flow * (at->passive * (p->passive_least + p->passive_thinning * thin) + at->loss * speed);
}

static double bypass_flow(const hydraulic_parameters *p, const hydraulic_climate *at, double drop, double *slope)
{
    const double square = drop * drop + p->bypass_Pa * p->bypass_Pa, root = at->bypass / sqrt(sqrt(square));
    *slope = root * (1.0 - 0.5 * drop * drop / square);
    return root * drop;
}

/* Return the force of the joint between rod and piston, and its derivatives by deflection and deflection rate. */
static double joint_force(const hydraulic_parameters *p, double deflection, double rate, double *by_deflection, double *by_rate)
{
    const double e = deflection, beyond = fabs(e) - p->joint_gap_m;
    double force = p->joint_N_m * e + p->joint_N_m3 * e * e * e + p->joint_N_s_m * rate;
    *by_deflection = p->joint_N_m + 3.0 * p->joint_N_m3 * e * e;
    *by_rate = p->joint_N_s_m;
    if (beyond > 0.0 && p->pin_N > 0.0) {
        const double side = copysign(1.0, e), root = sqrt(beyond), damped = 1.0 + p->pin_s_m * side * rate;
        if (damped > 0.0) {
            force += side * p->pin_N * beyond * root * damped;
            *by_deflection += 1.5 * p->pin_N * root * damped;
            *by_rate += p->pin_N * beyond * root * p->pin_s_m;
        }
    }
    return force;
}

/* Return the friction of the seal: elements with viscous sliders at a sliding force `level` [N]. Also return the
 * derivatives by piston position and level, and the anchors at the end of the stage. */
static double seal_force(const hydraulic_parameters *p, double l, double piston, double level, const double was[SEALS],
                         double now[SEALS], double *by_place, double *by_level)
{
    double force = *by_place = *by_level = 0.0;
    for (int n = 0; n < SEALS; n++) {
        const double stiff = seal_part[n] * p->friction_N_m, lag = l * stiff / (p->friction_N_s_m * seal_share[n]);
        const double width = seal_share[n] * level / stiff, tried = piston - was[n];
        double stretch = tried;
        if (fabs(tried) > width) {
            stretch = (tried + copysign(lag * width, tried)) / (1.0 + lag);
            *by_place += stiff / (1.0 + lag);
            *by_level += copysign(seal_share[n] * lag / (1.0 + lag), tried);
        } else {
            *by_place += stiff;
        }
        now[n] = piston - stretch;
        force += stiff * stretch;
    }
    return force;
}

/* Return the friction of the seal at the present speed and chamber pressures. */
static slopes friction(const hydraulic_parameters *p, const hydraulic_climate *at, double l, slopes one, slopes two,
                       const hydraulic_state *was, hydraulic_state *now)
{
    const double pressed = p->friction_share * one.value + (1.0 - p->friction_share) * two.value - atmosphere;
    const double slow = now->piston_m_s / p->stribeck_m_s, fallen = 1.0 / (1.0 + slow * slow);
    const double static_part = 1.0 + (p->friction_static - 1.0) * fallen;
    const double by_pressure = pressed > 0.0 ? at->friction_N * static_part * p->friction_1_Pa : 0.0;
    const double load = 1.0 + p->friction_1_Pa * fmax(pressed, 0.0);
    const double level = at->friction_N * static_part * load;
    const double by_speed =
        -at->friction_N * load * (p->friction_static - 1.0) * fallen * fallen * 2.0 * slow / p->stribeck_m_s;
    double by_place, by_level;
    const double force = seal_force(p, l, now->piston_m, level, was->seal_m, now->seal_m, &by_place, &by_level);
    const double more_speed = p->friction_share * one.by_speed + (1.0 - p->friction_share) * two.by_speed;
    const double more_content = p->friction_share * one.by_content + (1.0 - p->friction_share) * two.by_content;
    return (slopes){force, by_place * l + by_level * (by_speed + by_pressure * more_speed),
                    by_level * by_pressure * more_content};
}

/* Make one Newton step of the mechanical stage; return true if the step is within tolerance. */
static int newton_step(const hydraulic_parameters *p, const hydraulic_climate *at, double l, double x, double v, double yield,
                       double damped, const hydraulic_state *was, hydraulic_state *now, double *force)
{
    now->piston_m = was->piston_m + l * now->piston_m_s;
    const slopes one = pressure_1(at, l, now->piston_m, now->content_m3);
    const slopes two = pressure_2(p, at, l, now->piston_m, now->content_m3, was->gas, now->pressure_2_Pa, &now->gas);
    now->pressure_1_Pa = one.value;
    now->pressure_2_Pa = two.value;
    const double drop = one.value - two.value;
    const double drop_speed = one.by_speed - two.by_speed, drop_content = one.by_content - two.by_content;
    double flow_rise, valve_rise, bypass_rise, joint_e, joint_rate;
    now->flow_m3_s = slot_flow(p, at, now->wall_Pa, yield, &flow_rise);
    const double lost = valve_drop(p, at, now->wall_Pa, now->flow_m3_s, flow_rise, &valve_rise);
    const double beside = bypass_flow(p, at, drop, &bypass_rise);
    const slopes rubs = friction(p, at, l, one, two, was, now);
    *force = joint_force(p, x - now->piston_m, v - now->piston_m_s, &joint_e, &joint_rate);

    const double pushed = one.value * at->area_1 - two.value * at->area_2 + atmosphere * (at->area_2 - at->area_1);
    const double r1 = p->piston_kg * (now->piston_m_s - was->piston_m_s) - l * (*force - pushed - rubs.value);
    const double r2 = now->content_m3 - was->content_m3 + l * (now->flow_m3_s + beside);
    const double r3 = at->inertance * (now->flow_m3_s - was->flow_m3_s) - l * (drop - lost);
    double a11 = p->piston_kg
                 + l * (joint_e * l + joint_rate + one.by_speed * at->area_1 - two.by_speed * at->area_2 + rubs.by_speed);
    double a12 = l * (one.by_content * at->area_1 - two.by_content * at->area_2 + rubs.by_content);
    double a21 = l * bypass_rise * drop_speed, a22 = 1.0 + l * bypass_rise * drop_content;
    /* Eliminate the wall stress first because only the second and third equation contain it. */
    const double a33 = at->inertance * flow_rise + l * valve_rise, share = l * flow_rise / a33;
    a21 += share * l * drop_speed;
    a22 += share * l * drop_content;
    const double e2 = r2 - share * r3, det = a11 * a22 - a12 * a21;
    const double speed = (r1 * a22 - a12 * e2) / det, content = (a11 * e2 - a21 * r1) / det;
    const double wall = (r3 + l * (drop_speed * speed + drop_content * content)) / a33;
    now->piston_m_s -= damped * speed;
    now->content_m3 -= damped * content;
    now->wall_Pa -= damped * wall;
    return fabs(speed) < 3e-11 && fabs(content) < 1e-10 * at->volume_1
           && fabs(wall) < 1e-7 * fmax(fabs(now->wall_Pa), p->yield_least_Pa);
}

/* Solve one stage of length `l` from the history `was`; `now` contains the initial guess. Return 0 on failure. */
static int solve_stage(const hydraulic_parameters *p, const hydraulic_climate *at, double l, double x, double v,
                       double command, const hydraulic_state *was, hydraulic_state *now, double *force)
{
    if (!hydraulic_magnet(p, at, l, command, was, now)) return 0;
    double slope;
    const double ratio = hydraulic_fluid_field(p, fabs(now->field_T), &slope) / p->yield_A_m;
    const double yield = at->yield_Pa * (1.0 - exp(-ratio * sqrt(ratio))) + p->yield_least_Pa;
    now->gas = was->gas;
    for (int turn = 0; turn < MOST; turn++)
        if (newton_step(p, at, l, x, v, yield, turn < 8 ? 1.0 : turn < 25 ? 0.6 : 0.3, was, now, force))
            return isfinite(*force) != 0;
    return 0;
}

/* Return the linear interpolation (or extrapolation) from state `from` to state `to`. */
static hydraulic_state along(const hydraulic_state *from, const hydraulic_state *to, double share)
{
    hydraulic_state out;
    const double *a = (const double *)from, *b = (const double *)to;
    double *c = (double *)&out;
    for (unsigned k = 0; k < sizeof out / sizeof(double); k++) c[k] = a[k] + share * (b[k] - a[k]);
    return out;
}

/* The motion between two samples: a cubic through both displacements and both velocities. */
typedef struct {
    double x0, v0, x1, v1, step;
} motion;

static double place(const motion *m, double share, double *speed)
{
    const double rise = (m->x1 - m->x0) / m->step, bend = m->v0 + m->v1 - 2.0 * rise, turn = rise - m->v0;
    *speed = m->v0 + share * (2.0 * (turn - bend) + 3.0 * bend * share);
    return m->x0 + m->step * share * (m->v0 + share * ((turn - bend) + bend * share));
}

/* Make one substep from the fraction `share` to `share + width` of the interval between two samples. The initial guess
 * is extrapolated from the state `before` the previous substep, which has the same length. */
static int small_step(const hydraulic_parameters *p, const hydraulic_climate *at, const motion *m, double share, double width,
                      double command, const hydraulic_state *before, hydraulic_state *s, double *force)
{
    const double l = stage * width * m->step;
    double speed;
    hydraulic_state first = along(before, s, 1.0 + stage);
    double x = place(m, share + stage * width, &speed);
    if (!solve_stage(p, at, l, x, speed, command, s, &first, force)) return 0;
    const hydraulic_state history = along(s, &first, (1.0 - stage) / stage);
    hydraulic_state last = along(s, &first, 1.0 / stage);
    last.pressure_2_Pa = first.pressure_2_Pa;
    x = place(m, share + width, &speed);
    if (!solve_stage(p, at, l, x, speed, command, &history, &last, force)) return 0;
    *s = last;
    return 1;
}

int hydraulic_step(const hydraulic_parameters *p, const hydraulic_climate *at, double step, int inner, double x,
                   double v, double command, hydraulic_state *s, double *force)
{
    if (s->begun == 0.0) {
        begin(p, at, x, v, s);
        double unused, rate;
        *force = joint_force(p, 0.0, 0.0, &unused, &rate);
        return 1;
    }
    const motion m = {s->rod_m, s->rod_m_s, x, v, step};
    const double width = 1.0 / inner;
    hydraulic_state before = *s;
    for (int k = 0; k < inner; k++) {
        const hydraulic_state begun = *s;
        const int found = small_step(p, at, &m, k * width, width, command, &before, s, force);
        for (int j = 0; !found && j < FINER; j++) {
            const hydraulic_state from = *s;
            if (!small_step(p, at, &m, (k + j / (double)FINER) * width, width / FINER, command, &from, s, force)) return 0;
        }
        before = begun;
    }
    s->rod_m = x;
    s->rod_m_s = v;
    return 1;
}
