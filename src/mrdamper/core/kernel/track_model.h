/* One step of the real-time model: displacement, current and temperature in, force out.
 *
 * Tables, estimation of current and hysteresis, and checks of readings are the same as in the controller. An unknown
 * velocity is estimated from the displacement.
 */
#ifndef MRD_TRACK_MODEL_H
#define MRD_TRACK_MODEL_H

#include "track_estimate.h"

/* Update the motion by displacement and velocity. */
static void update_driven_motion(const mrd_track *c, mrd_track_state *s, mrd_real displacement, mrd_real velocity)
{
    if (!(magnitude(velocity) <= c->faults.speed_limit)) {
        if (velocity == velocity) s->flags |= MRD_NO_VELOCITY;
        s->velocity_known = 0;
        (void)update_motion(c, s, displacement);
        return;
    }
    const bool there = magnitude(displacement) <= c->faults.displacement_limit;
    const int32_t enough = c->faults.frozen_samples;
    if (!(there && s->started != 0 && displacement == s->last_displacement)) s->repeated_readings = 0;
    else if (s->repeated_readings < enough) s->repeated_readings = magnitude(velocity) > c->faults.frozen_speed_min ? s->repeated_readings + 1 : 0;
    const bool frozen = s->repeated_readings >= enough;
    if (!there) s->flags |= MRD_NO_DISPLACEMENT;
    if (frozen) s->flags |= MRD_FROZEN;
    if (there && !frozen) {
        s->x = displacement;
        s->started = 1;
        s->missing_samples = 0;
        s->recovery_countdown = 0;
    } else { /* The displacement is invalid or frozen. It is extrapolated with the velocity. */
        s->x = clamp(s->x + R(0.5) * c->axes.period * (s->v + velocity), -c->faults.displacement_limit, c->faults.displacement_limit);
        if (s->missing_samples < INT32_MAX) s->missing_samples++;
        if (s->missing_samples > c->faults.coast_samples) s->flags |= MRD_MOTION_UNKNOWN;
    }
    if (there) s->last_displacement = displacement;
    s->a = s->velocity_known != 0 ? (velocity - s->v) / c->axes.period : R(0.0);
    s->v = velocity;
    s->velocity_known = 1;
    check_motion_envelope(c, s);
}

/* Put the current into the delay line, like a command of a controller. */
static void update_driven_current(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    mrd_real current = s->command;
    if (magnitude(reading) <= R(2.0) * c->axes.largest) {
        s->samples_without_current = 0;
        current = clamp(reading, R(0.0), c->axes.largest);
        if (current != reading) s->flags |= MRD_SATURATED;
    } else {
        s->flags |= MRD_NO_CURRENT;
        if (s->samples_without_current < INT32_MAX) s->samples_without_current++;
        if (s->samples_without_current > c->faults.recovery_samples) current = R(0.0);
    }
    issue_command(s, current);
}

MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_model_inputs *inputs)
{
    begin_step(c, s);
    const bool first = s->started == 0 && s->velocity_known == 0; /* There has been no valid motion yet. */
    const mrd_real v_before = s->v;
    update_driven_motion(c, s, inputs->displacement, inputs->velocity);
    update_temperature(c, s, inputs->temperature);
    update_driven_current(c, s, inputs->current);
    const axis_point warm = on_temperatures(c, s->temperature);
    const mrd_real applied = update_applied_current(c, s);
    valve_chain room;
    const valve_chain *k = NULL;
    if (steps_implicitly(c)) {
        chain_at(c, warm, &room);
        k = &room;
    }
    if (!first) (void)update_hysteresis(c, s, k, warm, v_before, applied);
    if (first && has_chain(c)) start_chain(c, s, warm);
    if (first && has_series(c)) start_series(c, s, warm);

    const mrd_real force = steps_implicitly(c) ? stepped_force(c, s, warm) : travel_force(c, s, warm);
    if (c->heating.heat_capacity > R(0.0)) update_heat_balance(c, s, force * s->v);
    return force;
}

#endif
