/* State estimation of the controller: motion, applied current, hysteresis, temperature, disturbance.
 *
 * Every reading is checked before it is used. An invalid reading leaves the estimate unchanged and sets a flag.
 */
#ifndef MRD_TRACK_ESTIMATE_H
#define MRD_TRACK_ESTIMATE_H

#include "track_chain.h"

/* Replace displacement and velocity by their values after the time h at constant acceleration. */
static inline void predict_constant_acceleration(mrd_real *x, mrd_real *v, mrd_real a, mrd_real h)
{
    *x += h * (*v + R(0.5) * h * a);
    *v += h * a;
}

/* Replace a motion by the harmonic motion after the time h. The jerk is -omega_squared v. */
static inline void predict_harmonic_motion(mrd_real *x, mrd_real *v, mrd_real *a, mrd_real swing, mrd_real h)
{
    const mrd_real gained = -swing * *v * h; /* change of the acceleration */
    predict_constant_acceleration(x, v, *a, h);
    *x += gained * h * h * R(1.0 / 6.0);
    *v += R(0.5) * gained * h;
    *a += gained;
}

/* Predict the motion one period ahead. */
static void predict_motion(const mrd_track *c, mrd_track_state *s)
{
    if (c->motion.frequency_filter_gain > R(0.0)) predict_harmonic_motion(&s->x, &s->v, &s->a, s->omega_squared, c->axes.period);
    else predict_constant_acceleration(&s->x, &s->v, s->a, c->axes.period);
}

/* Estimate the squared angular frequency of the motion: omega^2 = mean a^2 / mean v^2. For a stationary motion,
 * -omega^2 v is the best prediction of the jerk from the velocity. The sensor noise in a^2 is subtracted. The estimate
 * starts when the motion filter has settled. */
static void update_motion_frequency(const mrd_track *c, mrd_track_state *s)
{
    const mrd_config_motion *m = &c->motion;
    if (!(m->frequency_filter_gain > R(0.0))) return;
    if (s->settled_samples < m->settle_samples) {
        s->settled_samples++;
        return;
    }
    s->velocity_mean_square += m->frequency_filter_gain * (s->v * s->v - s->velocity_mean_square);
    s->acceleration_mean_square += m->frequency_filter_gain * (s->a * s->a - m->acceleration_noise_variance - s->acceleration_mean_square);
    const mrd_real speed = s->velocity_mean_square > m->velocity_noise_variance ? s->velocity_mean_square : m->velocity_noise_variance;
    s->omega_squared = clamp(s->acceleration_mean_square / speed, R(0.0), m->omega_squared_max);
}

/* Set a flag if the motion is outside the range of the data. */
static inline void check_motion_envelope(const mrd_track *c, mrd_track_state *s)
{
    const bool inside = s->x >= c->envelope.displacement_min && s->x <= c->envelope.displacement_max;
    if (!(inside && magnitude(s->v) <= c->envelope.speed_max)) s->flags |= MRD_OUTSIDE_MOTION;
}

/* Return true if the state is finite. */
static bool is_finite(const mrd_track_state *s)
{
    const mrd_real value[] = {s->x, s->v, s->a, s->target, s->target_rate, s->target_second_derivative, s->first_lag_flux, s->second_lag_flux,
                              s->hysteresis_output[0], s->hysteresis_output[1], s->applied_current, s->direction, s->command, s->force_integral, s->disturbance,
                              s->temperature, s->last_temperature, s->expected_rise, s->min_rise, s->min_temperature, s->predicted_warming,
                              s->velocity_mean_square, s->acceleration_mean_square, s->omega_squared, s->chain.e, s->chain.y, s->chain.play,
                              s->chain.cavity, s->chain.level[0], s->chain.level[1], s->planned_moves[0], s->planned_moves[1], s->planned_moves[2]};
    mrd_real sum = R(0.0); /* The sum becomes NaN because zero times a value that is not finite is NaN. */
    for (size_t i = 0; i < sizeof value / sizeof value[0]; i++) sum += R(0.0) * value[i];
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) sum += R(0.0) * s->chain.bristle[j];
    for (int b = 0; b < MRD_TRACK_BANK; b++) sum += R(0.0) * (s->curve_position[b][0] + s->curve_position[b][1]);
    return sum == R(0.0);
}

/* Clear the flags. Reset a state that is not finite. */
static void begin_step(const mrd_track *c, mrd_track_state *s)
{
    s->flags = 0;
    if (!is_finite(s)) {
        mrd_track_start(c, s);
        s->flags = MRD_INTERNAL_FAULT;
    }
}

/* Update the estimated motion by a displacement reading. Return true if the motion is known. */
static bool update_motion(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    const bool there = magnitude(reading) <= c->faults.displacement_limit; /* false for NaN */
    if (there && s->started != 0 && reading == s->last_displacement) {
        if (s->repeated_readings == 0) s->speed_before_repeat = magnitude(s->v);
        if (s->repeated_readings < INT32_MAX) s->repeated_readings++;
    } else {
        s->repeated_readings = 0;
    }
    const bool frozen = s->repeated_readings >= c->faults.frozen_samples && s->speed_before_repeat > c->faults.frozen_speed_min;
    if (!there) s->flags |= MRD_NO_DISPLACEMENT;
    if (frozen) s->flags |= MRD_FROZEN;
    if (there) s->last_displacement = reading;

    if (there && !frozen) {
        if (s->started == 0 || s->missing_samples > c->faults.coast_samples) { /* Restart the motion filter. */
            s->x = reading;
            s->v = R(0.0);
            s->a = R(0.0);
            s->chain.play = reading;
            s->settled_samples = 0;
            s->recovery_countdown = s->started != 0 ? c->faults.recovery_samples : 0;
            s->started = 1;
        } else {
            predict_motion(c, s);
            const mrd_real gap = c->motion.holds_readings && s->repeated_readings > 0 ? R(0.0) : reading - s->x;
            s->x += c->motion.gain_x * gap;
            s->v += c->motion.gain_v * gap;
            s->a += c->motion.gain_a * gap;
            update_motion_frequency(c, s);
        }
        s->missing_samples = 0;
    } else {
        if (s->missing_samples < INT32_MAX) s->missing_samples++;
        if (s->missing_samples <= c->faults.coast_samples) {
            predict_motion(c, s);
            s->x = clamp(s->x, -c->faults.displacement_limit, c->faults.displacement_limit);
        } else {
            s->v = R(0.0);
            s->a = R(0.0);
        }
    }
    if (s->recovery_countdown > 0) s->recovery_countdown--;
    const bool known = s->started != 0 && s->missing_samples <= c->faults.coast_samples && s->recovery_countdown == 0;
    if (!known) s->flags |= MRD_MOTION_UNKNOWN;
    check_motion_envelope(c, s);
    return known;
}

/* Return true if the temperature reading is constant although the supplied energy must have warmed the damper. The
 * result remains true until the reading changes. */
static bool detect_frozen_temperature(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    if (reading != s->last_temperature) {
        s->last_temperature = reading;
        s->expected_rise = R(0.0);
        s->min_rise = R(0.0);
        s->temperature_frozen = 0;
    }
    if (c->heating.heat_capacity > R(0.0) && s->min_rise > c->heating.frozen_rise_max) s->temperature_frozen = 1;
    return s->temperature_frozen != 0;
}

/* Update the warming since the temperature reading changed: heat input minus loss, divided by the heat capacity. The
 * minimum warming uses the largest loss to the coldest possible surroundings. Only this minimum indicates a frozen
 * sensor, because the reading of a damper in thermal equilibrium is constant. `work` is the mechanical power [W]. */
static void update_heat_balance(const mrd_track *c, mrd_track_state *s, mrd_real work)
{
    static const mrd_real most = R(1000.0);
    const mrd_config_heating *damper = &c->heating;
    const mrd_real done = magnitude(s->v) <= c->faults.speed_limit ? work : R(0.0); /* 0 if the speed is impossible */
    const mrd_real heat = done + damper->coil_heat * s->applied_current * s->applied_current, part = c->axes.period / damper->heat_capacity;
    const mrd_real cold = s->min_temperature < damper->ambient ? s->min_temperature : damper->ambient;
    const mrd_real above = clamp(s->last_temperature + s->min_rise - cold, R(0.0), most);
    const mrd_real lost = damper->loss_conductance * (s->last_temperature + s->expected_rise - damper->ambient);
    s->expected_rise = clamp(s->expected_rise + part * (heat - lost), -most, most);
    s->predicted_warming = clamp(part * (heat - damper->loss_conductance * (s->temperature - damper->ambient)), -most, most);
    s->min_rise = clamp(s->min_rise + part * (heat - damper->loss_ratio_max * damper->loss_conductance * above), R(0.0), most);
}

/* Move the temperature estimate towards a valid reading [K]: first-order low-pass filter with a rate limit. */
static inline void update_temperature_estimate(const mrd_config_thermometer *of, mrd_track_state *s, mrd_real kelvin)
{
    s->temperature += clamp((R(1.0) - of->filter_decay) * (kelvin - s->temperature), -of->change_max, of->change_max);
    s->samples_without_temperature = 0;
    s->candidate_samples = 0;
}

/* Continue without a valid reading: extrapolate with the supplied energy or hold the estimate, later use the nominal
 * temperature. A reading that has jumped is accepted when it has been steady for more than `recover_samples` and for
 * longer than the readings before the jump were valid. */
static void bridge_missing_temperature(const mrd_track *c, mrd_track_state *s, mrd_real reading, bool there, bool moves)
{
    const mrd_config_thermometer *of = &c->thermometer;
    if (s->samples_without_temperature < INT32_MAX) s->samples_without_temperature++;
    if (!(s->temperature > R(0.0))) { /* There has been no valid temperature yet. */
        s->temperature = of->nominal;
        s->samples_without_temperature = of->hold_samples + 1;
    }
    if (s->samples_without_temperature > of->hold_samples) {
        s->flags |= MRD_NOMINAL_TEMPERATURE;
        s->temperature += clamp(of->nominal - s->temperature, -of->change_max, of->change_max);
    } else if (c->heating.extrapolate) {
        s->temperature = clamp(s->temperature + s->predicted_warming, of->cold_limit, of->hot_limit);
    } else {
        /* The estimate is held. */
    }
    if (moves && s->candidate_samples > 0 && magnitude(reading - s->candidate) <= of->jump) {
        if (++s->candidate_samples > of->recover_samples && s->candidate_samples > s->valid_temperature_samples) {
            s->temperature = s->candidate;
            s->samples_without_temperature = 0;
            s->candidate_samples = 0;
            s->valid_temperature_samples = 0;
        }
    } else {
        s->candidate = reading;
        s->candidate_samples = 0;
        if (there) s->candidate_samples = 1;
    }
}

/* Update the temperature estimate by a reading [K]. */
static void update_temperature(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    const mrd_config_thermometer *of = &c->thermometer;
    if (of->fixed > R(0.0)) {
        s->temperature = of->fixed;
        return;
    }
    const bool there = reading >= of->cold_limit && reading <= of->hot_limit;
    const bool frozen = there && detect_frozen_temperature(c, s, reading);
    if (!there) s->flags |= MRD_NO_TEMPERATURE;
    if (frozen) s->flags |= MRD_FROZEN_TEMPERATURE;
    if (!(s->temperature > R(0.0)) && there) s->temperature = reading; /* the first reading */

    const mrd_real gap = there ? reading - s->temperature : R(0.0), risen = reading + s->expected_rise;
    const bool near = there && magnitude(gap) <= of->jump;
    if (frozen && c->heating.extrapolate && magnitude(risen - s->temperature) <= of->jump) {
        update_temperature_estimate(of, s, clamp(risen, of->cold_limit, of->hot_limit));
        s->valid_temperature_samples = 0;
    } else if (near) {
        update_temperature_estimate(of, s, reading);
        if (s->valid_temperature_samples < of->hold_samples) s->valid_temperature_samples++;
    } else {
        if (there) s->flags |= MRD_TEMPERATURE_JUMP;
        bridge_missing_temperature(c, s, reading, there, there && !frozen);
    }
    if (!(s->min_temperature > R(0.0)) || s->temperature < s->min_temperature) s->min_temperature = s->temperature;
    if (!(s->temperature >= c->axes.coldest && s->temperature <= c->axes.warmest)) s->flags |= MRD_OUTSIDE_TEMPERATURE;
}

/* Put a command into the delay line. */
static inline void issue_command(mrd_track_state *s, mrd_real command)
{
    const uint32_t next = ((uint32_t)s->newest_command + 1u) % MRD_TRACK_DELAY_LINE;
    s->newest_command = (int32_t)next;
    s->delay_line[s->newest_command] = command;
    s->command = command;
}

/* Return the command at the input of the lags `ago` periods before now; negative: in the future. */
static mrd_real delayed_command(const mrd_track *c, const mrd_track_state *s, int32_t ago)
{
    const int32_t n = c->actuation.dead_samples + ago, since = s->newest_command - n;
    const uint32_t newest = (uint32_t)since;
    if (n < 0) return s->command; /* Future commands are assumed to equal the last command. */
    const mrd_real older = s->delay_line[(newest - 1u) % MRD_TRACK_DELAY_LINE];
    const mrd_real newer = s->delay_line[newest % MRD_TRACK_DELAY_LINE];
    return clamp(newer + c->actuation.dead_part * (older - newer), R(0.0), c->axes.largest);
}

/* Return the flux of a current, scaled to equal a small current. Lags and magnetic hysteresis act on the flux. */
static inline mrd_real flux_of(const mrd_track *c, mrd_real current)
{
    return c->actuation.inverse_saturation_flux > R(0.0) ? current / (R(1.0) + c->actuation.inverse_saturation_flux * current) : current;
}

/* Return the current that has a given flux. */
static inline mrd_real inverse_flux(const mrd_track *c, mrd_real flux)
{
    return c->actuation.inverse_saturation_flux > R(0.0) ? flux / (R(1.0) - c->actuation.inverse_saturation_flux * flux) : flux;
}

/* Return the flux of a free-wheeling current, tau flux' = -current, after the time share * tau. *slope, if not NULL,
 * receives the derivative with respect to the initial flux. The method has order two. The exponential is approximated
 * by the inverse of three terms. */
static mrd_real freewheel_flux(const mrd_track *c, mrd_real flux, mrd_real share, mrd_real *slope)
{
    const mrd_real bend = c->actuation.inverse_saturation_flux > R(0.0) ? c->actuation.inverse_saturation_flux : R(0.0);
    const mrd_real rate = R(1.0) / (R(1.0) - bend * flux);
    const mrd_real half = R(1.0) + R(0.5) * share * rate, mid = flux / half, opened = R(1.0) / (R(1.0) - bend * mid);
    const mrd_real u = share * opened;
    const mrd_real grown = R(1.0) + u * (R(1.0) + u * R(0.5)), left = R(1.0) / (grown + u * u * u * R(1.0 / 6.0));
    if (slope == NULL) return flux * left;
    const mrd_real mid_slope = (R(1.0) - R(0.5) * mid * share * bend * rate * rate) / half;
    const mrd_real decay_slope = grown * left * share * bend * opened * opened * mid_slope;
    *slope = left * (R(1.0) - flux * decay_slope);
    return flux * left;
}

/* Return the output of the second lag after a period in which its input changes linearly from `from` to `to`. */
static inline mrd_real second_lag_after_ramp(mrd_real second, mrd_real keep, mrd_real ramp, mrd_real from, mrd_real to)
{
    return keep * second + (ramp - keep) * from + (R(1.0) - ramp) * to;
}

/* Step both lags by one period with a held command. The step is exact except for a free-wheeling current. */
static inline void step_lags(const mrd_track *c, mrd_real command, mrd_real *first, mrd_real *second)
{
    const mrd_lags *lags = &c->actuation.lags;
    const mrd_real input = flux_of(c, command), gap = *first - input;
    const bool rises = input > *first;
    const mrd_real couple = rises ? lags->rise_couple : lags->fall_couple;
    const mrd_real past = *second, before = *first;
    *second = input + lags->second * (past - input) + couple * gap;
    *first = input + (rises ? lags->rise : lags->fall) * gap;
    if (!(lags->freewheel_ratio > R(0.0)) || rises) return;
    const mrd_real wheeled = freewheel_flux(c, before, lags->freewheel_ratio, NULL);
    if (!(wheeled > *first)) return; /* Free-wheeling is faster than the lag and has no effect. */
    *second = second_lag_after_ramp(past, lags->second, lags->second_ramp, before, wheeled);
    *first = wheeled;
}

/* Update a dead band and return its output minus its input. `at` is the output minus the half width. */
static inline mrd_real hysteresis_excess(mrd_real flux, mrd_real width, mrd_real *at)
{
    *at = clamp(*at, flux - width, flux + width);
    return *at + width - flux;
}

/* Apply magnetic hysteresis: a fraction of the field follows the lagged flux through a dead band, another fraction
 * through a wider one. If the command rises from zero, the effective current equals the command. If the command falls,
 * the effective current is larger. The maximum difference for each dead band is 2 * weight * half width. */
static inline mrd_real apply_hysteresis(const mrd_track *c, mrd_real flux, mrd_real *play)
{
    const mrd_config_actuation *a = &c->actuation;
    mrd_real felt = inverse_flux(c, flux);
    if (a->hysteresis_width > R(0.0)) felt += a->hysteresis_weight * hysteresis_excess(flux, a->hysteresis_width, &play[0]);
    if (a->wide_hysteresis_width > R(0.0)) felt += a->wide_hysteresis_weight * hysteresis_excess(flux, a->wide_hysteresis_width, &play[1]);
    return felt;
}

/* Update the effective current, which follows the commands. Return its mean over the period. */
static mrd_real update_applied_current(const mrd_track *c, mrd_track_state *s)
{
    const mrd_real applied = s->applied_current;
    step_lags(c, delayed_command(c, s, 0), &s->first_lag_flux, &s->second_lag_flux);
    s->applied_current = apply_hysteresis(c, s->second_lag_flux, s->hysteresis_output);
    return R(0.5) * (applied + s->applied_current);
}

/* A period with linear velocity from v0 to v1, split at a change of its sign. */
typedef struct {
    mrd_real to, from;          /* travel before and after the change of sign */
    bool turns_first, turns;    /* hysteresis reverses at the start, or at the change of sign */
    mrd_real side;              /* direction after the segment */
} segment;

static segment segment_of(mrd_real side, mrd_real v0, mrd_real v1, mrd_real h)
{
    mrd_real to = R(0.5) * h * (v0 + v1), from = R(0.0);
    if ((v0 < R(0.0) && v1 > R(0.0)) || (v0 > R(0.0) && v1 < R(0.0))) {
        const mrd_real share = v0 / (v0 - v1);
        to = R(0.5) * h * share * v0;
        from = R(0.5) * h * (R(1.0) - share) * v1;
    }
    const bool turns_first = side * to < R(0.0);
    const mrd_real between = turns_first ? -side : side;
    const bool turns = between * from < R(0.0);
    const segment way = {magnitude(to), magnitude(from), turns_first, turns, turns ? -between : between};
    return way;
}

/* Return the position on the universal curve after a segment. */
static mrd_real position_after(const mrd_track *c, mrd_real before, mrd_real rho, const segment *s)
{
    mrd_real u = (s->turns_first ? position_after_turn(c, before) : before) + rho * s->to;
    if (s->turns) u = position_after_turn(c, u) + rho * s->from;
    return u < c->loading.top ? u : c->loading.top;
}

/* Return the index of the table current of a model of a bank. */
static inline int32_t quarter_of(const mrd_track *c, int model) { return (int32_t)c->quarter[model]; }

/* Compute the inverse yield displacement of an element in each model of a bank. */
static void rho_of_models(const mrd_track *c, axis_point warm, int element, mrd_real *rho)
{
    const int32_t columns = c->begin[MRD_GROUPS], first = c->begin[MRD_GROUP_RHO + element];
    const mrd_real *p = parabolas_at(c, warm);
    for (int b = 0; b < MRD_TRACK_BANK; b++) rho[b] = R(0.0);
    for (int32_t k = first; k < c->begin[MRD_GROUP_RHO + element + 1]; k++) {
        const mrd_real factor = parabola(&p[3 * (c->levels + k)], warm.share);
        for (int b = 0; b < MRD_TRACK_BANK; b++) rho[b] += factor * c->column[quarter_of(c, b) * columns + k];
    }
}

/* Return true for laws with an implicit step: chain and series valve. */
static inline bool steps_implicitly(const mrd_track *c) { return has_chain(c) || has_series(c); }

/* Step the hysteresis of every model through the period that ends now; v0 is the velocity at its start. Laws with an
 * implicit step use `k`. For these laws, return the force without the forces parallel to the chain. */
static mrd_real update_hysteresis(const mrd_track *c, mrd_track_state *s, const valve_chain *k, axis_point warm, mrd_real v0,
                                  mrd_real applied)
{
    if (has_chain(c)) return update_chain(c, s, k, warm, v0, applied);
    if (has_series(c)) return update_series(c, s, k, warm, v0, applied);
    const int elements = c->law.elements;
    const segment way = segment_of(s->direction, v0, s->v, c->axes.period);
    mrd_real rho[MRD_TRACK_BANK];
    s->direction = way.side;
    if (c->inverse.method == MRD_INVERSE_BANK) {
        for (int e = 0; e < elements; e++) {
            rho_of_models(c, warm, e, rho);
            for (int b = 0; b < MRD_TRACK_BANK; b++) s->curve_position[b][e] = position_after(c, s->curve_position[b][e], rho[b], &way);
        }
    } else {
        rho_at(c, warm, applied, rho);
        for (int e = 0; e < elements; e++) s->curve_position[0][e] = position_after(c, s->curve_position[0][e], rho[e], &way);
    }
    return R(0.0);
}

/* Return motion and hysteresis at the present instant. */
static moment estimated_moment(const mrd_track *c, const mrd_track_state *s)
{
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    moment m = {s->x, s->v, s->a, {sign, sign}};
    for (int e = 0; e < c->law.elements; e++) m.w[e] = s->direction * hysteresis_at(c, s->curve_position[0][e]);
    return m;
}

/* Return the present force of a law with an implicit step. */
static mrd_real stepped_force(const mrd_track *c, const mrd_track_state *s, axis_point warm)
{
    mrd_real parts[4];
    if (has_chain(c)) chain_parts(c, s, warm, parts);
    else series_parts(c, s, warm, parts);
    return parts[0] + parts[1] + parts[2] + parts[3];
}

/* Return the present force of a law without an implicit step. */
static mrd_real travel_force(const mrd_track *c, const mrd_track_state *s, axis_point warm)
{
    const moment m = estimated_moment(c, s);
    mrd_real by[MRD_ROWS];
    multipliers(c, &m, by);
    return force_at(c, warm, on_currents(c, s->applied_current), by);
}

MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts)
{
    static const uint8_t part_of[MRD_ROWS] = {3, 3, 3, 1, 2, 2, 0, 0};
    const axis_point warm = on_temperatures(c, s->temperature), at = on_currents(c, s->applied_current);
    if (has_chain(c)) {
        chain_parts(c, s, warm, parts);
        return;
    }
    if (has_series(c)) {
        series_parts(c, s, warm, parts);
        return;
    }
    const moment m = estimated_moment(c, s);
    const mrd_real *p = parabolas_at(c, warm);
    mrd_real by[MRD_ROWS];
    multipliers(c, &m, by);
    for (int k = 0; k < 4; k++) parts[k] = R(0.0);
    for (int32_t k = 0; k < c->levels + c->begin[MRD_GROUP_RHO]; k++) {
        mrd_real over = R(1.0);
        if (k >= c->levels) {
            const mrd_real *here = &c->column[at.index * c->begin[MRD_GROUPS] + k - c->levels];
            over = here[0] + at.share * (here[c->begin[MRD_GROUPS]] - here[0]);
        }
        parts[part_of[c->row[k]]] += by[c->row[k]] * parabola(&p[3 * k], warm.share) * over;
    }
}

/* Update the disturbance observer with a measured force [N]: filter the force error in the direction of motion. */
static void update_disturbance(const mrd_track *c, mrd_track_state *s, mrd_real force)
{
    mrd_real parts[4];
    mrd_track_parts(c, s, parts);
    const mrd_real error = force - (parts[0] + parts[1] + parts[2] + parts[3]);
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    s->disturbance += c->feedback.observe * (sign * error - s->disturbance);
}

#endif
