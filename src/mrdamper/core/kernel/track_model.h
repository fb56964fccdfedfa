/* One step of the damper's model on a target: displacement, current and temperature in, force out.
 *
 * The same tables, the same observer of current and hysteresis and the same looks at every reading as the
 * controller has. A velocity may be given; without one it is estimated from the displacement.
 */
#ifndef MRD_TRACK_MODEL_H
#define MRD_TRACK_MODEL_H

#include "track_estimate.h"

/* Displacement and velocity in; the motion of now. */
static void follow_driven_motion(const mrd_track *c, mrd_track_state *s, mrd_real displacement, mrd_real velocity)
{
    if (!(magnitude(velocity) <= c->faults.far_v)) {
        if (velocity == velocity) s->flags |= MRD_NO_VELOCITY;
        s->velocity_known = 0;
        (void)follow_motion(c, s, displacement);
        return;
    }
    const bool there = magnitude(displacement) <= c->faults.far_x;
    const int32_t enough = c->faults.frozen_samples;
    if (!(there && s->started != 0 && displacement == s->last_x)) s->repeated = 0;
    else if (s->repeated < enough) s->repeated = magnitude(velocity) > c->faults.frozen_speed ? s->repeated + 1 : 0;
    const bool frozen = s->repeated >= enough;
    if (!there) s->flags |= MRD_NO_DISPLACEMENT;
    if (frozen) s->flags |= MRD_FROZEN;
    if (there && !frozen) {
        s->x = displacement;
        s->started = 1;
        s->lost = 0;
        s->back = 0;
    } else { /* the velocity carries it on */
        s->x = limited(s->x + R(0.5) * c->axes.period * (s->v + velocity), -c->faults.far_x, c->faults.far_x);
        if (s->lost < INT32_MAX) s->lost++;
        if (s->lost > c->faults.coast_samples) s->flags |= MRD_MOTION_UNKNOWN;
    }
    if (there) s->last_x = displacement;
    s->a = s->velocity_known != 0 ? (velocity - s->v) / c->axes.period : R(0.0);
    s->v = velocity;
    s->velocity_known = 1;
    check_motion(c, s);
}

/* Current in: into the delay line, as a controller's own command. */
static void follow_current(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    mrd_real current = s->command;
    if (magnitude(reading) <= R(2.0) * c->axes.largest) {
        s->unpowered = 0;
        current = limited(reading, R(0.0), c->axes.largest);
        if (current != reading) s->flags |= MRD_SATURATED;
    } else {
        s->flags |= MRD_NO_CURRENT;
        if (s->unpowered < INT32_MAX) s->unpowered++;
        if (s->unpowered > c->faults.back_samples) current = R(0.0);
    }
    give(s, current);
}

MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_model_inputs *inputs)
{
    begin_step(c, s);
    const bool first = s->started == 0 && s->velocity_known == 0; /* nothing has been travelled before */
    const mrd_real v_before = s->v;
    follow_driven_motion(c, s, inputs->displacement, inputs->velocity);
    follow_temperature(c, s, inputs->temperature);
    follow_current(c, s, inputs->current);
    const axis_point warm = on_temperatures(c, s->temperature);
    const mrd_real applied = follow_applied(c, s);
    valve_chain room;
    const valve_chain *k = NULL;
    if (steps_implicitly(c)) {
        chain_at(c, warm, &room);
        k = &room;
    }
    if (!first) (void)follow_hysteresis(c, s, k, warm, v_before, applied);
    if (first && has_chain(c)) start_chain(c, s, warm);
    if (first && has_series(c)) start_series(c, s, warm);

    const mrd_real force = steps_implicitly(c) ? stepped_force(c, s, warm) : travel_force(c, s, warm);
    if (c->heating.capacity > R(0.0)) follow_heat(c, s, force * s->v);
    return force;
}

#endif
