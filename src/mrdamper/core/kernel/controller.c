/* One step of a force-tracking controller.
 *
 * The step updates motion, temperature and applied current. A command given now acts at the preview. The step predicts
 * the hysteresis at this time and solves for the current at which the model then has the wanted force. The reversal
 * clamp limits the current near the static answer while the hysteresis builds up. The same step contains the paper's
 * bank of models at constant currents, and force feedback.
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

/* Search for the current at which the force has the wanted value: the lowest of several solutions, or the nearest
 * current if there is none. It visits all currents of the table in descending order, so that the run time is constant. */
typedef struct {
    mrd_real before, from, to, least; /* force minus wanted force: last visited, at both ends of the cell, smallest */
    int32_t cell, nearest;
} search;

static inline search search_from(int32_t last)
{
    search q = {R(0.0), R(0.0), R(0.0), R(1e30), last, 0};
    return q;
}

static inline void visit(search *q, int32_t current, mrd_real off)
{
    if (off * q->before <= R(0.0)) { /* the first visit has no predecessor; its cell is outside the table */
        q->cell = current;
        q->from = off;
        q->to = q->before;
    }
    if (magnitude(off) <= q->least) {
        q->least = magnitude(off);
        q->nearest = current;
    }
    q->before = off;
}

static inline bool is_found(const search *q, int32_t last) { return q->cell < last; }

/* Return the current of a search, interpolated in the table or the bank. */
static mrd_real current_found(const mrd_track *c, const search *q, int32_t last, bool bank)
{
    const bool found = is_found(q, last);
    const int32_t j = found ? q->cell : q->nearest, k = found ? j + 1 : j;
    const mrd_real low = c->current[bank ? quarter_of(c, j) : j], high = c->current[bank ? quarter_of(c, k) : k];
    const mrd_real share = found && q->from != q->to ? q->from / (q->from - q->to) : R(0.0);
    return low + share * (high - low);
}

/* Return the lagged flux at the preview if the last command is held. *answer is the effect of a command given now. */
static mrd_real predict_lagged_flux(const mrd_track *c, const mrd_track_state *s, mrd_real *answer)
{
    mrd_real first = s->first_lag_flux, second = s->second_lag_flux;
    const int32_t dead = c->actuation.dead_samples;
    for (int32_t i = 1; i <= dead + (c->actuation.dead_part > R(0.0) ? 1 : 0); i++)
        step_lags(c, delayed_command(c, s, -i), &first, &second);
    const mrd_real input = flux_of(c, s->command), gap = first - input;
    const bool rises = input > first;
    *answer = rises ? c->actuation.rise_answer : c->actuation.fall_answer;
    const mrd_real couple = rises ? c->actuation.rise_couple_ahead : c->actuation.fall_couple_ahead;
    const mrd_real reached = input + c->actuation.second_ahead * (second - input) + couple * gap;
    if (!(c->actuation.freewheel_ratio > R(0.0)) || rises) return reached;
    const mrd_real to = freewheel_flux(c, first, c->actuation.freewheel_ratio_ahead, NULL);
    const mrd_real wheeled = second_lag_after_ramp(second, c->actuation.second_ahead, c->actuation.second_ramp_ahead, first, to);
    return wheeled > reached ? wheeled : reached;
}

/* Return the current at which a bank of models at constant currents has the wanted force now. `off` is the force of the
 * terms that do not depend on the current, minus the wanted force. */
static mrd_real solve_bank(const mrd_track *c, const mrd_track_state *s, const moment *m, const mrd_real *weight,
                            mrd_real off, bool *found)
{
    const int last = MRD_TRACK_BANK - 1, elements = c->law.elements;
    const int32_t yield = c->begin[MRD_GROUP_YIELD], second = c->begin[MRD_GROUP_SECOND], end = c->begin[MRD_GROUP_RHO];
    const mixture mix = mixture_of(c, m);
    search q = search_from(last);
    for (int b = last; b >= 0; b--) {
        const mrd_real *here = &c->column[quarter_of(c, b) * c->begin[MRD_GROUPS]];
        mrd_real w[2] = {m->w[0], m->w[1]};
        for (int e = 0; e < elements; e++) w[e] = s->direction * hysteresis_at(c, s->curve_position[b][e]);
        mrd_real force = off + sum_of(weight, here, yield);
        force += yield_share(&mix, w) * sum_of(&weight[yield], &here[yield], second - yield);
        if (end > second) force += second_share(&mix, w) * sum_of(&weight[second], &here[second], end - second);
        visit(&q, b, force);
    }
    *found = is_found(&q, last);
    return current_found(c, &q, last, true);
}

/* Return the current of one model for the wanted force, limited by the reversal clamp. */
static mrd_real solve_model(const mrd_track *c, mrd_track_state *s, const moment *m, const mrd_real *weight, mrd_real off,
                             mrd_real sign, bool *found)
{
    const bool clamped = c->inverse.margin >= R(0.0) && c->law.elements > 0;
    const int32_t last = c->currents - 1, motion = c->begin[MRD_GROUP_YIELD], end = c->begin[MRD_GROUP_RHO];
    const mrd_real yielded[2] = {sign, sign};
    const mixture mix = mixture_of(c, m);
    mrd_real pair[MRD_TRACK_TERMS][2];
    for (int32_t k = motion; k < end; k++) {
        const bool first = k < c->begin[MRD_GROUP_SECOND];
        pair[k - motion][0] = weight[k] * (first ? yield_share(&mix, m->w) : second_share(&mix, m->w));
        pair[k - motion][1] = weight[k] * (first ? yield_share(&mix, yielded) : second_share(&mix, yielded));
    }
    search exact = search_from(last), settled = search_from(last);
    for (int32_t j = last; j >= 0; j--) {
        const mrd_real *here = &c->column[j * c->begin[MRD_GROUPS]];
        mrd_real one = off + sum_of(weight, here, motion), other = one;
        for (int32_t k = motion; k < end; k++) {
            one += pair[k - motion][0] * here[k];
            other += pair[k - motion][1] * here[k];
        }
        visit(&exact, j, one);
        visit(&settled, j, other);
    }
    mrd_real current = current_found(c, &exact, last, false);
    *found = is_found(&exact, last);
    if (clamped) {
        const mrd_real most = current_found(c, &settled, last, false) + c->inverse.margin;
        if (current > most) {
            current = most;
            s->flags |= MRD_CLAMPED;
        }
    }
    return current;
}

/* Predict the hysteresis of the single model at the preview for the effective current. */
static void predict_hysteresis(const mrd_track *c, const mrd_track_state *s, axis_point warm, mrd_real felt, moment *m)
{
    const segment way = segment_of(s->direction, s->v, m->v, c->inverse.preview);
    mrd_real rho[2];
    rho_at(c, warm, felt, rho);
    for (int e = 0; e < c->law.elements; e++) m->w[e] = way.side * hysteresis_at(c, position_after(c, s->curve_position[0][e], rho[e], &way));
}

/* Return the command at which a bank of models has the wanted force now. The command is known and has no lag. */
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

/* Return the command for a wanted force at the preview. */
static mrd_real command_of_model(const mrd_track *c, mrd_track_state *s, axis_point warm, mrd_real wanted)
{
    mrd_real answer, play[2] = {s->hysteresis_output[0], s->hysteresis_output[1]}, current;
    bool found;
    moment m = {s->x, s->v, s->a, {R(0.0), R(0.0)}};
    predict_constant_acceleration(&m.x, &m.v, m.a, c->inverse.preview);
    const mrd_real sign = m.v < R(0.0) ? R(-1.0) : R(1.0);
    m.w[0] = sign; /* settled value until the prediction */
    m.w[1] = sign;
    const mrd_real lagged = predict_lagged_flux(c, s, &answer), felt = apply_hysteresis(c, lagged, play);
    if (has_series(c)) {
        current = command_of_series(c, s, warm, &m, felt, wanted, &found);
    } else {
        mrd_real by[MRD_ROWS], weight[MRD_TRACK_TERMS];
        predict_hysteresis(c, s, warm, R(0.5) * (s->applied_current + felt), &m);
        motion_multipliers(c, &m, by);
        const mrd_real off = weigh(c, warm, by, weight) - wanted;
        current = solve_model(c, s, &m, weight, off, sign, &found);
    }
    if (!found) s->flags |= MRD_INFEASIBLE;
    current = invert_hysteresis(c, current, s->hysteresis_output);
    if (c->inverse.compensation > R(0.0) && answer > R(0.05))
        current += c->inverse.compensation * (s->command + (current - inverse_flux(c, lagged)) / answer - current);
    return current;
}

/* Return the command with force feedback in the direction of motion; `forward` is the command without it. */
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
    static const mrd_real most_force = R(1e7), most_length = R(1e9);
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

    /* wanted force now and at the preview */
    mrd_real now = inputs->now, ahead = inputs->ahead;
    bool said = false;
    if (!(magnitude(now) <= most_force)) {
        s->flags |= MRD_NO_TARGET;
        now = R(0.0);
    }
    if (c->inverse.preview > R(0.0)) {
        predict_constant_acceleration(&s->target, &s->target_rate, s->target_second_derivative, c->axes.period);
        const mrd_real off = now - s->target;
        s->target += c->reference.gain_f * off;
        s->target_rate = clamp(s->target_rate + c->reference.gain_rate * off, -most_length, most_length);
        s->target_second_derivative = clamp(s->target_second_derivative + c->reference.gain_second_derivative * off, -most_length, most_length);
        said = magnitude(ahead) <= most_force;
        if (!said) {
            mrd_real rate = s->target_rate;
            ahead = now;
            predict_constant_acceleration(&ahead, &rate, s->target_second_derivative, c->inverse.preview);
        }
        if (has_prediction(c)) {
            store_target(c, s, said && s->target_known_ahead == 0, now, ahead);
            if (said) s->target_known_ahead = 1;
        }
    } else {
        ahead = now;
    }

    const bool measured = magnitude(inputs->force) <= most_force;
    const bool observes = c->feedback.observe > R(0.0);
    if (observes && measured && known) update_disturbance(c, s, inputs->force);
    if (observes) ahead -= (s->v + c->inverse.preview * s->a < R(0.0) ? R(-1.0) : R(1.0)) * s->disturbance;

    mrd_real current = R(0.0);
    if (c->inverse.method != MRD_INVERSE_NONE) {
        mrd_real asked;
        if (has_prediction(c)) asked = command_of_prediction(c, s, k, warm, said, now, observes ? s->disturbance : R(0.0));
        else if (c->inverse.bank) asked = command_of_bank(c, s, warm, ahead);
        else asked = command_of_model(c, s, warm, ahead);
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
