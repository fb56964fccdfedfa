/* One step of a force-tracking controller.
 *
 * Motion, temperature and applied current are brought up to now; the hysteresis is carried on to the moment at
 * which a command given now will act (the preview); the current is the one at which the model has the wanted
 * force then; the reversal clamp holds it near the static answer while the hysteresis is still building up.
 * The same step is the paper's bank of models at constant currents, and feedback where a force is measured.
 */
#include "controller.h"

#include "track_tables.c"
#include "track_series.c"
#include "track_estimate.c"
#include "track_model.c"

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s)
{
    memset(s, 0, sizeof *s);
    s->play = -c->play;
    for (int i = 0; i < MRD_TRACK_GAINS; i++) {
        s->gain[i] = R(1.0);
        s->spread[i * (MRD_TRACK_GAINS + 1)] = c->gain_variance;
    }
}

/* The current at which a row of forces at evenly spaced currents has the wanted value; the lowest, if several.
 * Where none has, the nearest; *found says which. */
static mrd_real solve_row(const mrd_real *force, int count, mrd_real largest, mrd_real wanted, int *found)
{
    const mrd_real pitch = largest / (mrd_real)(count - 1);
    int nearest = 0;
    mrd_real least = magnitude(force[0] - wanted);
    *found = 1;
    for (int j = 0; j + 1 < count; j++) {
        const mrd_real low = force[j] - wanted, high = force[j + 1] - wanted;
        if (low == R(0.0)) return pitch * (mrd_real)j;
        if ((low < R(0.0)) != (high < R(0.0))) return pitch * ((mrd_real)j + low / (low - high));
        if (magnitude(high) < least) {
            least = magnitude(high);
            nearest = j + 1;
        }
    }
    *found = 0;
    return pitch * (mrd_real)nearest;
}

/* What the lags will have put through at the preview: with the last command held, and their share of a command
 * given now. */
static mrd_real lagged_ahead(const mrd_track *c, const mrd_track_state *s, mrd_real *answer)
{
    mrd_real first = s->first, second = s->second;
    const int32_t dead = (int32_t)c->dead_samples;
    for (int32_t i = 1; i <= dead + (c->dead_part > R(0.0) ? 1 : 0); i++)
        pass_lags(c, past_dead_time(c, s, -i), &first, &second);
    const mrd_real input = s->command, gap = first - input;
    const int rises = input > first;
    *answer = rises ? c->rise_answer : c->fall_answer;
    return input + c->second_ahead * (second - input) + (rises ? c->rise_couple_ahead : c->fall_couple_ahead) * gap;
}

/* The model's answer: the command for a wanted force at the preview. */
static mrd_real answer_of(const mrd_track *c, mrd_track_state *s, axis_point warm, mrd_real wanted)
{
    const mrd_real p = c->preview;
    const int elements = (int)c->elements, models = c->bank > R(1.5) ? (int)c->bank : 1;
    moment m = {s->x, s->v, s->a, {R(0.0), R(0.0)}};
    predict(&m.x, &m.v, m.a, p);
    const mrd_real sign = m.v < R(0.0) ? R(-1.0) : R(1.0);
    mrd_real by[MRD_ROWS], force[MRD_TRACK_CURRENTS], answer = R(1.0), lagged = s->second, current;
    int found;
    const int ahead = p > R(0.0) && (models == 1 || c->reach > R(0.0));
    if (ahead) lagged = lagged_ahead(c, s, &answer);
    if (c->unlagged > R(0.5)) lagged = s->command;
    mrd_real play = s->play;
    const mrd_real applied = past_play(c, lagged, &play);

    if (c->series) {
        current = series_answer(c, s, warm, &m, applied, wanted, &found);
    } else if (models > 1) {
        const stretch way = stretch_of(s->v, m.v, p);
        for (int b = 0; b < models; b++) {
            const axis_point at = on_currents(c, bank_current(c, b));
            for (int e = 0; e < elements; e++) m.w[e] = w_along(c, s->w[b][e], rho_at(c, warm, at, e), &way);
            multipliers(c, s, &m, by);
            force[b] = force_at(c, warm, at, by);
        }
        current = solve_row(force, models, c->largest, wanted, &found);
    } else {
        const stretch way = stretch_of(s->v, m.v, p);
        const axis_point at = on_currents(c, R(0.5) * (s->applied + applied));
        for (int e = 0; e < elements; e++)
            m.w[e] = c->is_static > R(0.5) ? sign : w_along(c, s->w[0][e], rho_at(c, warm, at, e), &way);
        multipliers(c, s, &m, by);
        force_row(c, warm, by, force);
        current = solve_row(force, c->currents, c->largest, wanted, &found);
        if (c->margin >= R(0.0) && elements) {
            int also;
            m.w[0] = m.w[1] = sign;
            multipliers(c, s, &m, by);
            force_row(c, warm, by, force);
            const mrd_real most = solve_row(force, c->currents, c->largest, wanted, &also) + c->margin;
            if (current > most) {
                current = most;
                s->flags |= MRD_CLAMPED;
            }
        }
    }
    if (!found) s->flags |= MRD_INFEASIBLE;
    current = before_play(c, current, s->play);
    if (c->reach > R(0.0) && ahead && answer > R(0.05))
        current += c->reach * (s->command + (current - lagged) / answer - current);
    if (c->lead > R(0.0)) {
        s->leading = current + c->lead_keep * (s->leading - current);
        current += c->lead * (current - s->leading);
    }
    return current;
}

/* Feedback of the force, in the direction of motion; `forward` is what is there without it. */
static mrd_real fed_back(const mrd_track *c, mrd_track_state *s, int measured, mrd_real wanted, mrd_real force,
                         mrd_real forward)
{
    if (!measured) {
        s->flags |= MRD_NO_FORCE;
        return c->on_off > R(0.5) ? R(0.0) : forward;
    }
    if (c->on_off > R(0.5)) return (wanted - force) * force > R(0.0) ? c->largest : R(0.0);
    const mrd_real share = c->gain_speed > R(0.0) ? limited(s->v / c->gain_speed, R(-1.0), R(1.0)) : R(1.0);
    const mrd_real error = share * (wanted - force);
    s->integral = limited(s->integral + c->rate * c->period * error, -forward, c->largest - forward);
    return forward + c->gain * error + s->integral;
}

MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_told *told)
{
    static const mrd_real most_force = R(1e7), most_length = R(1e9);
    s->flags = 0;
    const mrd_real v_before = s->v;
    const int known = follow_motion(c, s, told->displacement);
    follow_temperature(c, s, told->temperature);
    const axis_point warm = warmth(c, s->temperature);

    const mrd_real applied = follow_applied(c, s);
    follow_hysteresis(c, s, warm, v_before, applied);
    if (c->capacity > R(0.0)) follow_heat(c, s, sampled_work(c, s, warm));

    /* the wanted force, now and ahead */
    mrd_real now = told->now, ahead = told->ahead;
    if (!(magnitude(now) <= most_force)) {
        s->flags |= MRD_NO_TARGET;
        now = R(0.0);
    }
    predict(&s->wanted, &s->wanted_rate, s->wanted_bend, c->period);
    const mrd_real off = now - s->wanted;
    s->wanted += c->wanted_f * off;
    s->wanted_rate = limited(s->wanted_rate + c->wanted_v * off, -most_length, most_length);
    s->wanted_bend = limited(s->wanted_bend + c->wanted_a * off, -most_length, most_length);
    if (!(c->preview > R(0.0))) {
        ahead = now;
    } else if (!(magnitude(ahead) <= most_force)) {
        mrd_real rate = s->wanted_rate;
        ahead = now;
        predict(&ahead, &rate, s->wanted_bend, c->preview);
    }

    const int measured = magnitude(told->force) <= most_force;
    if (measured && known && (c->observe > R(0.0) || c->forget > R(0.0))) learn(c, s, told->force);
    if (c->observe > R(0.0))
        ahead -= (s->v + c->preview * s->a < R(0.0) ? R(-1.0) : R(1.0)) * s->disturbance;

    mrd_real current = R(0.0);
    if (c->feed_forward > R(0.0)) current = c->feed_forward * limited(answer_of(c, s, warm, ahead), R(0.0), c->largest);
    if (c->on_off > R(0.5) || c->gain > R(0.0) || c->rate > R(0.0))
        current = fed_back(c, s, measured, now, told->force, current);
    if (!known) current = c->fall_back;
    const mrd_real given = limited(current, R(0.0), c->largest);
    if (given != current) s->flags |= MRD_SATURATED;
    s->at = (s->at + 1) % MRD_TRACK_LINE;
    s->line[s->at] = given;
    s->command = given;
    return given;
}

#undef R
