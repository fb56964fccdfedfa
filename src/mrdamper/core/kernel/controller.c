/* One step of a force-tracking controller.
 *
 * The step updates the estimated motion, temperature and applied current. Then it computes the command by one of three
 * methods: prediction with the model of the card (track_predict.h), bank of models at constant currents (reference
 * paper), or only force feedback.
 */
#include "controller.h"

#include "track_predict.h"
#include "track_model.h"

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s)
{
    (void)memset(s, 0, sizeof *s);
    s->hysteresis_output[0] = -c->actuation.hysteresis_width;
    s->hysteresis_output[1] = -c->actuation.wide_hysteresis_width;
    s->direction = R(1.0);
}

/* Return the current at which interpolation in a bank of models gives the wanted force now. If there are several
 * solutions, return the lowest one; without a solution, return the current of the model with the nearest force. `off`
 * is the force of the levels minus the wanted force. */
static mrd_real solve_bank(const mrd_track *c, const mrd_track_state *s, const moment *m, const mrd_real *weight,
                           mrd_real off, bool *found)
{
    const int last = MRD_TRACK_BANK - 1, elements = c->law.elements;
    const int32_t yield = c->begin[MRD_GROUP_YIELD], second = c->begin[MRD_GROUP_SECOND], end = c->begin[MRD_GROUP_RHO];
    const mixture mix = mixture_of(c, m);
    mrd_real above = R(0.0), least = R(1e30), current = R(0.0);
    *found = false;
    for (int b = last; b >= 0; b--) {
        const int32_t at = quarter_of(c, b);
        const mrd_real *here = &c->column[at * c->begin[MRD_GROUPS]];
        mrd_real w[2] = {m->w[0], m->w[1]};
        for (int e = 0; e < elements; e++) w[e] = s->direction * hysteresis_at(c, s->curve_position[b][e]);
        mrd_real force = off + sum_of(weight, here, yield);
        force += yield_share(&mix, w) * sum_of(&weight[yield], &here[yield], second - yield);
        if (end > second) force += second_share(&mix, w) * sum_of(&weight[second], &here[second], end - second);
        if (b < last && force * above <= R(0.0)) { /* the wanted force is between two models */
            const mrd_real low = c->current[at], high = c->current[quarter_of(c, b + 1)];
            const bool differ = force < above || force > above;
            current = differ ? low + force / (force - above) * (high - low) : low;
            *found = true;
        }
        if (!*found && magnitude(force) <= least) {
            least = magnitude(force);
            current = c->current[at];
        }
        above = force;
    }
    return current;
}

/* Return the command at which a bank of models has the wanted force now. The models assume a current without lag. */
static mrd_real command_of_bank(const mrd_track *c, mrd_track_state *s, axis_point warm, mrd_real wanted)
{
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    const moment m = {s->x, s->v, s->a, {sign, sign}};
    bool found;
    mrd_real by[MRD_ROWS], weight[MRD_TRACK_TERMS];
    motion_multipliers(c, &m, by);
    const mrd_real off = weigh(c, warm, by, weight) - wanted;
    const mrd_real current = solve_bank(c, s, &m, weight, off, &found);
    if (!found) s->flags |= MRD_INFEASIBLE;
    return current;
}

/* Return the command with force feedback in the direction of motion. `forward` is the command without feedback. */
static mrd_real apply_feedback(const mrd_track *c, mrd_track_state *s, bool measured, mrd_real wanted, mrd_real force,
                         mrd_real forward)
{
    if (!measured) {
        s->flags |= MRD_NO_FORCE;
        return c->feedback.kind == MRD_FEEDBACK_ON_OFF ? R(0.0) : forward;
    }
    if (c->feedback.kind == MRD_FEEDBACK_ON_OFF) return (wanted - force) * force > R(0.0) ? c->axes.largest : R(0.0);
    const mrd_real full = c->feedback.full_speed, share = full > R(0.0) ? clamp(s->v / full, R(-1.0), R(1.0)) : R(1.0);
    const mrd_real error = share * (wanted - force);
    s->force_integral = clamp(s->force_integral + c->feedback.rate * c->axes.period * error, -forward, c->axes.largest - forward);
    return forward + c->feedback.gain * error + s->force_integral;
}

MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_inputs *inputs)
{
    static const mrd_real most_force = R(1e7);
    begin_step(c, s);
    const mrd_real v_before = s->v;
    const bool known = update_motion(c, s, inputs->displacement);
    update_temperature(c, s, inputs->temperature);
    const axis_point warm = on_temperatures(c, s->temperature);

    const mrd_real applied = update_applied_current(c, s);
    valve_chain room;
    const valve_chain *k = NULL;
    if (steps_implicitly(c)) {
        chain_at(c, warm, &room);
        k = &room;
    }
    const mrd_real chain = update_hysteresis(c, s, k, warm, v_before, applied);
    if (c->heating.heat_capacity > R(0.0)) {
        mrd_real force;
        if (steps_implicitly(c)) {
            mrd_real viscous, friction, inertia;
            series_parallel_forces(c->series, k, s->v, s->a, &viscous, &friction, &inertia);
            force = chain + viscous + friction + inertia;
        } else {
            force = travel_force(c, s, warm);
        }
        update_heat_balance(c, s, force * s->v);
    }

    mrd_real now = inputs->now;
    if (!(magnitude(now) <= most_force)) {
        s->flags |= MRD_NO_TARGET;
        now = R(0.0);
    }
    const bool known_ahead = magnitude(inputs->ahead) <= most_force;
    if (has_prediction(c)) update_target(c, s, known_ahead, now, inputs->ahead);

    const bool measured = magnitude(inputs->force) <= most_force;
    const bool observes = c->feedback.observe > R(0.0);
    if (observes && measured && known) update_disturbance(c, s, inputs->force);

    mrd_real current = R(0.0);
    if (c->inverse.method != MRD_INVERSE_NONE) {
        mrd_real asked;
        if (has_prediction(c)) asked = command_of_prediction(c, s, k, warm, known_ahead, now, observes ? s->disturbance : R(0.0));
        else asked = command_of_bank(c, s, warm, now);
        current = clamp(asked, R(0.0), c->axes.largest);
        if (known && (current != asked)) s->flags |= MRD_SATURATED;
    }
    if (c->feedback.kind != MRD_FEEDBACK_NONE)
        current = apply_feedback(c, s, measured, now, inputs->force, current);
    if (!known) current = c->faults.fall_back;
    const mrd_real given = clamp(current, R(0.0), c->axes.largest);
    if (given != current) s->flags |= MRD_SATURATED;
    issue_command(s, given);
    return given;
}

#undef R
