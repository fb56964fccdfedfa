/* Predictive control: the law of the card is stepped through the horizon in which a command given now acts. One
 * iteration per prediction improves the moves (command values in the horizon), so that the force approaches the wanted
 * force.
 *
 *     minimise  sum_k (g^k) (F(t_k) - F*(t_k))^2 + r^2 [(u0 - u_last)^2 + (u1 - u0)^2 + (u2 - u1)^2],  0 <= u <= largest
 *
 * While the hysteresis builds up after a reversal, a fraction `settled` of the remaining build-up is assumed to be
 * complete. When the current rises, a real damper builds up its force faster than a Bouc-Wen model.
 *
 * u0 is the command in the first step of the horizon, u1 in the next two steps, u2 in all later steps. The controller
 * uses u0. An iteration is a Gauss-Newton step; the derivatives are integrated with the state. A prediction starts with
 * the moves of the previous prediction, so that one iteration is sufficient after they have settled.
 */
#ifndef MRD_TRACK_PREDICT_H
#define MRD_TRACK_PREDICT_H

#include "track_estimate.h"

enum { MOVE_ITERATIONS = 5 }; /* number of rounds of the coordinate descent for the three bounded moves */

/* The law at the present temperature. */
typedef struct {
    axis_point warm;
    const valve_chain *chain;
    mrd_real factor[MRD_TRACK_TERMS];
} horizon_law;

/* Return the index of the move that acts in a step of the horizon. */
static inline int move_of(int32_t k) { return k < 1 ? 0 : (k < 3 ? 1 : 2); }

/* Predict the motion after the time h. */
static inline void predict_horizon_motion(const mrd_track_state *s, mrd_prediction *w, mrd_real h)
{
    predict_harmonic_motion(&w->x, &w->v, &w->a, s->omega_squared, h);
}

/* Step a dead band and its derivatives with respect to `moves` moves. While its output is constant, its derivatives are
 * constant, too. */
static inline void step_horizon_hysteresis(const mrd_moved *flux, mrd_real width, mrd_real share, mrd_moved *band, int moves, mrd_moved *felt)
{
    const mrd_real before = band->at;
    felt->at += share * hysteresis_excess(flux->at, width, &band->at);
    if (band->at < before || band->at > before) {
        for (int m = 0; m < moves; m++) band->by[m] = flux->by[m];
    } else {
        for (int m = 0; m < moves; m++) felt->by[m] += share * (band->by[m] - flux->by[m]);
    }
}

/* Compute the effective current from the lagged flux by magnetic hysteresis, and its derivatives for `moves` moves. */
static void horizon_current(const mrd_track *c, mrd_prediction *w, int moves, mrd_moved *felt)
{
    const mrd_config_actuation *a = &c->actuation;
    *felt = w->second_lag_flux;
    if (a->inverse_saturation_flux > R(0.0)) {
        const mrd_real opened = R(1.0) / (R(1.0) - a->inverse_saturation_flux * felt->at);
        felt->at *= opened;
        for (int m = 0; m < moves; m++) felt->by[m] *= opened * opened;
    }
    if (a->hysteresis_width > R(0.0)) step_horizon_hysteresis(&w->second_lag_flux, a->hysteresis_width, a->hysteresis_weight, &w->hysteresis_output[0], moves, felt);
    if (a->wide_hysteresis_width > R(0.0)) step_horizon_hysteresis(&w->second_lag_flux, a->wide_hysteresis_width, a->wide_hysteresis_weight, &w->hysteresis_output[1], moves, felt);
}

/* Step both lags with the flux of the move `m` as input, and the slope of this flux with respect to the move. A
 * free-wheeling current does not follow a decreasing move, but it would follow an increasing one. The derivative for an
 * increase is used, because with a zero derivative the move would never be raised again. */
static void step_horizon_lags(const mrd_track *c, mrd_prediction *w, mrd_real input, mrd_real input_slope, int m)
{
    const mrd_lags *lags = &c->prediction.lags;
    const bool rises = input > w->first_lag_flux.at;
    mrd_real keep = rises ? lags->rise : lags->fall, couple = rises ? lags->rise_couple : lags->fall_couple;
    mrd_real by_second = R(1.0) - lags->second - couple, by_first = R(1.0) - keep;
    mrd_real first = input + keep * (w->first_lag_flux.at - input);
    mrd_real second = input + lags->second * (w->second_lag_flux.at - input) + couple * (w->first_lag_flux.at - input);
    if (lags->freewheel_ratio > R(0.0) && !rises) {
        mrd_real slope;
        const mrd_real wheeled = freewheel_flux(c, w->first_lag_flux.at, lags->freewheel_ratio, &slope);
        if (wheeled > first) {
            first = wheeled;
            second = second_lag_after_ramp(w->second_lag_flux.at, lags->second, lags->second_ramp, w->first_lag_flux.at, wheeled);
            keep = slope;
            couple = second_lag_after_ramp(R(0.0), lags->second, lags->second_ramp, R(1.0), slope);
            by_second = R(1.0) - lags->second - lags->rise_couple;
            by_first = R(1.0) - lags->rise;
        }
    }
    for (int n = 0; n <= m; n++) {
        w->second_lag_flux.by[n] = lags->second * w->second_lag_flux.by[n] + couple * w->first_lag_flux.by[n];
        w->first_lag_flux.by[n] *= keep;
    }
    w->second_lag_flux.by[m] += by_second * input_slope;
    w->first_lag_flux.by[m] += by_first * input_slope;
    w->second_lag_flux.at = second;
    w->first_lag_flux.at = first;
}

/* Step a law whose hysteresis depends on travel by the time h. Compute force and derivatives. The derivatives neglect
 * the dependence of rho on the current. */
static void step_travel_law(const mrd_track *c, const mrd_track_state *s, const horizon_law *law, mrd_prediction *w, mrd_real h,
                         int moves, const mrd_moved *current, mrd_moved *force)
{
    const mrd_real v0 = w->v;
    const int32_t columns = c->begin[MRD_GROUPS], terms = c->begin[MRD_GROUP_RHO];
    mrd_real rho[2], by[MRD_ROWS], level = R(0.0), slope = R(0.0);
    predict_horizon_motion(s, w, h);
    const segment way = segment_of(w->direction, v0, w->v, h);
    rho_at(c, law->warm, current->at, rho);
    w->direction = way.side;
    const mrd_real sign = w->v < R(0.0) ? R(-1.0) : R(1.0);
    moment m = {w->x, w->v, w->a, {sign, sign}};
    for (int e = 0; e < c->law.elements; e++) {
        w->curve_position[e] = position_after(c, w->curve_position[e], rho[e], &way);
        const mrd_real at = hysteresis_at(c, w->curve_position[e]);
        m.w[e] = way.side * (at + c->prediction.settled * (R(1.0) - at));
    }
    multipliers(c, &m, by);
    for (int32_t k = 0; k < c->levels; k++) level += by[c->row[k]] * law->factor[k];
    const axis_point at = on_currents(c, current->at);
    const mrd_real *here = &c->column[at.index * columns], *beyond = &here[columns];
    for (int32_t k = 0; k < terms; k++) {
        const mrd_real weight = by[c->row[c->levels + k]] * law->factor[c->levels + k], rise = beyond[k] - here[k];
        level += weight * (here[k] + at.share * rise);
        slope += weight * rise;
    }
    slope /= c->current[at.index + 1] - c->current[at.index];
    force->at = level;
    for (int n = 0; n < moves; n++) force->by[n] = slope * current->by[n];
}

/* Step any tabulated law by the time h with the current at the end of the step. Compute the force at the end and its
 * derivatives with respect to the moves. The state before the step depends only on the first `known` moves. */
static void step_law(const mrd_track *c, const mrd_track_state *s, const horizon_law *law, mrd_prediction *w, mrd_real h,
                      int known, int moves, const mrd_moved *current, mrd_moved *force)
{
    if (!steps_implicitly(c)) {
        step_travel_law(c, s, law, w, h, moves, current, force);
        return;
    }
    mrd_real viscous, friction, inertia;
    const mrd_real v0 = w->v;
    predict_horizon_motion(s, w, h);
    link_levels now;
    levels_at(c, law->warm, current->at, &now);
    link_advance(c, law->chain, &now, &w->chain, w->chain.y + (w->v - v0), CHAIN_AHEAD_ROUNDS, h, w->x, v0, w->v,
                 w->by, known, moves, current, force);
    if (moves == 0) return; /* The force is not needed before the horizon. */
    series_parallel_forces(c->series, law->chain, w->v, w->a, &viscous, &friction, &inertia);
    force->at += viscous + friction + inertia;
}

/* Prepare the law at the estimated temperature. */
static void prepare_law(const mrd_track *c, const valve_chain *chain, axis_point warm, horizon_law *law)
{
    law->warm = warm;
    law->chain = chain;
    if (steps_implicitly(c)) return;
    const mrd_real *p = parabolas_at(c, warm);
    for (int32_t k = 0; k < c->levels + c->begin[MRD_GROUP_RHO]; k++) law->factor[k] = parabola(&p[3 * k], warm.share);
}

/* Predict the state at the end of the dead time from the commands in the delay line. */
static void predict_dead_time(const mrd_track *c, mrd_track_state *s, const horizon_law *law)
{
    mrd_prediction *w = &s->prediction;
    w->x = s->x;
    w->v = s->v;
    w->a = s->a;
    w->direction = s->direction;
    w->curve_position[0] = s->curve_position[0][0];
    w->curve_position[1] = s->curve_position[0][1];
    w->chain = s->chain;
    if (has_series(c)) {
        w->chain.e = s->curve_position[0][0];
        w->chain.y = s->curve_position[0][1];
        w->chain.play = s->x;
    }
    w->first_lag_flux.at = s->first_lag_flux;
    w->second_lag_flux.at = s->second_lag_flux;
    w->hysteresis_output[0].at = s->hysteresis_output[0];
    w->hysteresis_output[1].at = s->hysteresis_output[1];
    w->elapsed_time = c->prediction.dead;
    w->weight = R(1.0);
    const mrd_real later = (w->elapsed_time / c->axes.period) + R(0.5);
    const int32_t periods = (int32_t)later; /* `later` is already rounded. */
    mrd_moved felt, force;
    int32_t waiting = 0;
    for (int32_t i = 1; i <= periods; i++) {
        step_lags(c, delayed_command(c, s, -i), &w->first_lag_flux.at, &w->second_lag_flux.at);
        horizon_current(c, w, 0, &felt);
        waiting++;
        if (waiting < c->prediction.together && i < periods) continue;
        step_law(c, s, law, w, (mrd_real)waiting * c->axes.period, 0, 0, &felt, &force);
        waiting = 0;
    }
}

/* Return the wanted force at a later time: interpolated if the future wanted force is known, otherwise extrapolated. */
static mrd_real target_at(const mrd_track *c, const mrd_track_state *s, bool said, mrd_real now, mrd_real later)
{
    if (!said) {
        mrd_real rate = s->target_rate, ahead = now;
        predict_constant_acceleration(&ahead, &rate, s->target_second_derivative, later);
        return ahead;
    }
    const uint32_t last = MRD_TRACK_DELAY_LINE - 2u;
    const mrd_real back = clamp((c->inverse.preview - later) / c->axes.period, R(0.0), (mrd_real)last);
    const int32_t whole = (int32_t)back;
    const mrd_real share = back - (mrd_real)whole;
    const int32_t since = s->newest_command + 1 - whole;
    const uint32_t newer = (uint32_t)since;
    const mrd_real one = s->wanted_line[newer % MRD_TRACK_DELAY_LINE];
    return one + share * (s->wanted_line[(newer - 1u) % MRD_TRACK_DELAY_LINE] - one);
}

/* Store a future wanted force. Until the first stored time, a straight line from the present force is assumed. */
static void store_target(const mrd_track *c, mrd_track_state *s, bool first, mrd_real now, mrd_real ahead)
{
    const int32_t next = s->newest_command + 1;
    const uint32_t slot = (uint32_t)next;
    s->wanted_line[slot % MRD_TRACK_DELAY_LINE] = ahead;
    mrd_real since = R(0.0);
    for (uint32_t i = 1u; first && i < MRD_TRACK_DELAY_LINE - 1u && since < c->inverse.preview; i++) {
        since += c->axes.period;
        const mrd_real share = clamp(since / c->inverse.preview, R(0.0), R(1.0));
        s->wanted_line[(slot - i) % MRD_TRACK_DELAY_LINE] = ahead + share * (now - ahead);
    }
}

/* Update the filter that extrapolates the wanted force, and store the wanted force after the preview. */
static void update_target(const mrd_track *c, mrd_track_state *s, bool known_ahead, mrd_real now, mrd_real ahead)
{
    static const mrd_real most = R(1e9); /* [N/s], [N/s2] */
    predict_constant_acceleration(&s->target, &s->target_rate, s->target_second_derivative, c->axes.period);
    const mrd_real off = now - s->target;
    s->target += c->reference.gain_f * off;
    s->target_rate = clamp(s->target_rate + c->reference.gain_rate * off, -most, most);
    s->target_second_derivative = clamp(s->target_second_derivative + c->reference.gain_second_derivative * off, -most, most);
    if (known_ahead) {
        store_target(c, s, s->target_known_ahead == 0, now, ahead);
        s->target_known_ahead = 1;
    } else {
        store_target(c, s, false, now, target_at(c, s, false, now, c->inverse.preview));
    }
}

/* Return the number of lag steps in a step of the law. Steps of the last move are longer because the errors at these
 * steps have less weight. */
static inline int32_t lag_steps_in(const mrd_track *c, int32_t k) { return move_of(k) < MRD_TRACK_MOVES - 1 ? 1 : c->prediction.stretch; }

/* Make step k of the horizon with the present moves, `since` [s] after the prediction started. Add the cost of the
 * force error as a quadratic in the moves. `bias` is the observed force error of the model. Return the force error. */
static mrd_real horizon_step(const mrd_track *c, mrd_track_state *s, const horizon_law *law, int32_t k, mrd_real since,
                             bool said, mrd_real now, mrd_real bias)
{
    mrd_prediction *w = &s->prediction;
    mrd_move_cost *q = &w->cost;
    mrd_moved felt, force;
    const int move = move_of(k), moves = move + 1;
    const int known = k > 0 ? move_of(k - 1) + 1 : 0; /* number of moves that have had an effect before this step */
    const int32_t parts = lag_steps_in(c, k);
    const mrd_real h = (mrd_real)parts * c->prediction.step;
    for (int m = known; m < moves; m++) {
        w->first_lag_flux.by[m] = R(0.0);
        w->second_lag_flux.by[m] = R(0.0);
        w->hysteresis_output[0].by[m] = R(0.0);
        w->hysteresis_output[1].by[m] = R(0.0);
        q->slope[m] = R(0.0);
        for (int n = 0; n <= m; n++) q->curvature[m][n] = R(0.0);
    }
    const mrd_real per = c->actuation.inverse_saturation_flux > R(0.0) ? R(1.0) / (R(1.0) + c->actuation.inverse_saturation_flux * s->planned_moves[move]) : R(1.0);
    for (int32_t i = 0; i < parts; i++) step_horizon_lags(c, w, s->planned_moves[move] * per, per * per, move);
    horizon_current(c, w, moves, &felt);
    step_law(c, s, law, w, h, known, moves, &felt, &force);
    w->elapsed_time += h;
    const mrd_real wanted = target_at(c, s, said, now, w->elapsed_time - since);
    const mrd_real error = force.at - wanted + (w->v < R(0.0) ? -bias : bias);
    w->weight *= c->prediction.fade;
    for (int m = 0; m < moves; m++) {
        const mrd_real weighed = w->weight * force.by[m];
        q->slope[m] += weighed * error;
        for (int n = 0; n <= m; n++) q->curvature[m][n] += weighed * force.by[n];
    }
    return error;
}

/* Add the cost of changes between the moves. */
static void add_move_cost(const mrd_track *c, const mrd_track_state *s, mrd_move_cost *q)
{
    const mrd_real calm = c->prediction.calm * c->prediction.calm;
    mrd_real before = s->command;
    for (int m = 0; m < MRD_TRACK_MOVES; m++) {
        const mrd_real moved = calm * (s->planned_moves[m] - before);
        q->slope[m] += moved;
        q->curvature[m][m] += calm;
        if (m > 0) {
            q->slope[m - 1] -= moved;
            q->curvature[m - 1][m - 1] += calm;
            q->curvature[m][m - 1] -= calm;
        }
        before = s->planned_moves[m];
    }
}

/* Minimise the quadratic cost within the bounds of the moves by coordinate descent. */
static void solve_moves(const mrd_track *c, mrd_move_cost *q, mrd_real *u)
{
    mrd_real slope[MRD_TRACK_MOVES], per[MRD_TRACK_MOVES], trace = R(0.0);
    for (int m = 0; m < MRD_TRACK_MOVES; m++) {
        trace += q->curvature[m][m];
        slope[m] = q->slope[m];
        for (int n = 0; n < m; n++) q->curvature[n][m] = q->curvature[m][n];
    }
    for (int m = 0; m < MRD_TRACK_MOVES; m++) {
        q->curvature[m][m] += R(1e-3) * trace;
        per[m] = R(1.0) / q->curvature[m][m];
    }
    for (int i = 0; i < MOVE_ITERATIONS; i++) {
        for (int m = 0; m < MRD_TRACK_MOVES; m++) {
            const mrd_real to = clamp(u[m] - slope[m] * per[m], R(0.0), c->axes.largest), step = to - u[m];
            u[m] = to;
            for (int n = 0; n < MRD_TRACK_MOVES; n++) slope[n] += q->curvature[m][n] * step;
        }
    }
}

/* Return the command for the wanted force. A prediction can take several samples. Until it ends, the moves of the
 * previous prediction are used. */
static mrd_real command_of_prediction(const mrd_track *c, mrd_track_state *s, const valve_chain *chain, axis_point warm, bool said,
                                 mrd_real now, mrd_real bias)
{
    horizon_law law;
    const mrd_config_prediction *p = &c->prediction;
    const bool begins = s->prediction_samples == 0, ends = s->prediction_samples + 1 >= p->samples;
    const mrd_real since = (mrd_real)s->prediction_samples * c->axes.period;
    const int32_t from = p->steps * s->prediction_samples / p->samples, to = p->steps * (s->prediction_samples + 1) / p->samples;
    mrd_real last = R(0.0);
    prepare_law(c, chain, warm, &law);
    if (begins) predict_dead_time(c, s, &law);
    for (int32_t k = from; k < to; k++) last = horizon_step(c, s, &law, k, since, said, now, bias);
    s->prediction_samples = ends ? 0 : s->prediction_samples + 1;
    if (ends) {
        add_move_cost(c, s, &s->prediction.cost);
        solve_moves(c, &s->prediction.cost, s->planned_moves);
        const mrd_real end = s->planned_moves[MRD_TRACK_MOVES - 1];
        const mrd_real pushed = s->prediction.cost.slope[MRD_TRACK_MOVES - 1]; /* gradient at the solution, last move */
        const bool low = !(end > R(0.0)) && pushed > R(0.0), high = !(end < c->axes.largest) && pushed < R(0.0);
        s->infeasible = 0;
        if (magnitude(last) > p->calm && (low || high)) s->infeasible = 1;
    }
    if (s->infeasible != 0) s->flags |= MRD_INFEASIBLE;
    return s->planned_moves[0];
}

#endif
