/* State estimation of the controller: motion, applied current, hysteresis, temperature, disturbance.
 *
 * Every reading is checked before it is used. An invalid reading leaves the estimate unchanged and sets a flag.
 */
#ifndef MRD_TRACK_ESTIMATE_H
#define MRD_TRACK_ESTIMATE_H

#include "track_chain.h"

enum { BAND_ROUNDS = 4 }; /* of the command before two dead bands; a round leaves a third of the error */

/* Constant-acceleration prediction over h, and its correction by a reading. */
static inline void predict(mrd_real *x, mrd_real *v, mrd_real a, mrd_real h)
{
    *x += h * (*v + R(0.5) * h * a);
    *v += h * a;
}

/* The same for a motion that swings: its jerk is -swing v. */
static inline void swing_on(mrd_real *x, mrd_real *v, mrd_real *a, mrd_real swing, mrd_real h)
{
    const mrd_real gained = -swing * *v * h; /* by the acceleration */
    predict(x, v, *a, h);
    *x += gained * h * h * R(1.0 / 6.0);
    *v += R(0.5) * gained * h;
    *a += gained;
}

/* A period on. */
static void move_on(const mrd_track *c, mrd_track_state *s)
{
    if (c->motion.swing_share > R(0.0)) swing_on(&s->x, &s->v, &s->a, s->swing, c->axes.period);
    else predict(&s->x, &s->v, s->a, c->axes.period);
}

/* How the motion swings: the jerk of a steady motion is, in the mean, -(mean a^2 / mean v^2) v, since none of x, v
 * and a goes with its own rate of change. What the sensor's noise adds to a^2 is taken off. Learnt once the
 * filter has found the motion. */
static void follow_swing(const mrd_track *c, mrd_track_state *s)
{
    const mrd_config_motion *m = &c->motion;
    if (!(m->swing_share > R(0.0))) return;
    if (s->followed < m->settle_samples) {
        s->followed++;
        return;
    }
    s->speed_square += m->swing_share * (s->v * s->v - s->speed_square);
    s->bend_square += m->swing_share * (s->a * s->a - m->bend_noise - s->bend_square);
    const mrd_real speed = s->speed_square > m->speed_noise ? s->speed_square : m->speed_noise;
    s->swing = limited(s->bend_square / speed, R(0.0), m->most_swing);
}

/* Says whether the motion is one that the data have. */
static inline void check_motion(const mrd_track *c, mrd_track_state *s)
{
    const bool inside = s->x >= c->envelope.low_x && s->x <= c->envelope.high_x;
    if (!(inside && magnitude(s->v) <= c->envelope.high_v)) s->flags |= MRD_OUTSIDE_MOTION;
}

/* Return true if every value that a step carries on is finite. */
static bool is_finite(const mrd_track_state *s)
{
    const mrd_real value[] = {s->x, s->v, s->a, s->reference, s->reference_rate, s->reference_bend, s->first, s->second,
                              s->play[0], s->play[1], s->applied, s->side, s->command, s->integral, s->disturbance,
                              s->temperature, s->read, s->temperature_rise, s->least_rise, s->coolest, s->warming,
                              s->speed_square, s->bend_square, s->swing, s->chain.e, s->chain.y, s->chain.play,
                              s->chain.cavity, s->chain.level[0], s->chain.level[1], s->move[0], s->move[1], s->move[2]};
    mrd_real sum = R(0.0); /* zero times a value that is not finite is not a number */
    for (size_t i = 0; i < sizeof value / sizeof value[0]; i++) sum += R(0.0) * value[i];
    for (int j = 0; j < MRD_TRACK_BRISTLES; j++) sum += R(0.0) * s->chain.bristle[j];
    for (int b = 0; b < MRD_TRACK_BANK; b++) sum += R(0.0) * (s->place[b][0] + s->place[b][1]);
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

/* Displacement in; estimated motion one period on. Returns whether the motion is known. */
static bool follow_motion(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    const bool there = magnitude(reading) <= c->faults.far_x; /* false where it is not a number */
    if (there && s->started != 0 && reading == s->last_x) {
        if (s->repeated == 0) s->speed_before = magnitude(s->v);
        if (s->repeated < INT32_MAX) s->repeated++;
    } else {
        s->repeated = 0;
    }
    const bool frozen = s->repeated >= c->faults.frozen_samples && s->speed_before > c->faults.frozen_speed;
    if (!there) s->flags |= MRD_NO_DISPLACEMENT;
    if (frozen) s->flags |= MRD_FROZEN;
    if (there) s->last_x = reading;

    if (there && !frozen) {
        if (s->started == 0 || s->lost > c->faults.coast_samples) { /* anew */
            s->x = reading;
            s->v = R(0.0);
            s->a = R(0.0);
            s->chain.play = reading;
            s->followed = 0;
            s->back = s->started != 0 ? c->faults.back_samples : 0;
            s->started = 1;
        } else {
            move_on(c, s);
            const mrd_real gap = c->motion.held && s->repeated > 0 ? R(0.0) : reading - s->x;
            s->x += c->motion.gain_x * gap;
            s->v += c->motion.gain_v * gap;
            s->a += c->motion.gain_a * gap;
            follow_swing(c, s);
        }
        s->lost = 0;
    } else {
        if (s->lost < INT32_MAX) s->lost++;
        if (s->lost <= c->faults.coast_samples) {
            move_on(c, s);
            s->x = limited(s->x, -c->faults.far_x, c->faults.far_x);
        } else {
            s->v = R(0.0);
            s->a = R(0.0);
        }
    }
    if (s->back > 0) s->back--;
    const bool known = s->started != 0 && s->lost <= c->faults.coast_samples && s->back == 0;
    if (!known) s->flags |= MRD_MOTION_UNKNOWN;
    check_motion(c, s);
    return known;
}

/* Whether a temperature stands still though the energy put in should have moved it; for good, until it changes. */
static bool is_frozen(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    if (reading != s->read) {
        s->read = reading;
        s->temperature_rise = R(0.0);
        s->least_rise = R(0.0);
        s->temperature_frozen = 0;
    }
    if (c->heating.capacity > R(0.0) && s->least_rise > c->heating.frozen_rise) s->temperature_frozen = 1;
    return s->temperature_frozen != 0;
}

/* The energy account of a reading that stands still: heat put in [W] less what is lost, over the capacity. The
 * least warming has the loss at its most, to the coldest surroundings that there may be; only that accuses a
 * sensor, so that a damper whose losses balance its heat does not. */
static void follow_heat(const mrd_track *c, mrd_track_state *s, mrd_real work)
{
    static const mrd_real most = R(1000.0);
    const mrd_config_heating *damper = &c->heating;
    const mrd_real done = magnitude(s->v) <= c->faults.far_v ? work : R(0.0); /* a speed that cannot be is a sensor's */
    const mrd_real heat = done + damper->coil_heat * s->applied * s->applied, part = c->axes.period / damper->capacity;
    const mrd_real cold = s->coolest < damper->ambient ? s->coolest : damper->ambient;
    const mrd_real above = limited(s->read + s->least_rise - cold, R(0.0), most);
    const mrd_real lost = damper->loss * (s->read + s->temperature_rise - damper->ambient);
    s->temperature_rise = limited(s->temperature_rise + part * (heat - lost), -most, most);
    s->warming = limited(part * (heat - damper->loss * (s->temperature - damper->ambient)), -most, most);
    s->least_rise = limited(s->least_rise + part * (heat - damper->loss_margin * damper->loss * above), R(0.0), most);
}

/* Move the temperature estimate towards a valid reading [K]: first-order low-pass filter with a rate limit. */
static inline void update_temperature_estimate(const mrd_config_thermometer *of, mrd_track_state *s, mrd_real kelvin)
{
    s->temperature += limited((R(1.0) - of->keep) * (kelvin - s->temperature), -of->slew, of->slew);
    s->cold = 0;
    s->steady = 0;
}

/* Continue without a valid reading: extrapolate by the energy put in, or hold the estimate, then use the nominal
 * temperature. A reading that has jumped is accepted when it has been steady as long as the estimate before it was valid. */
static void go_without(const mrd_track *c, mrd_track_state *s, mrd_real reading, bool there, bool moves)
{
    const mrd_config_thermometer *of = &c->thermometer;
    if (s->cold < INT32_MAX) s->cold++;
    if (!(s->temperature > R(0.0))) { /* none has been known: there is nothing to carry on */
        s->temperature = of->nominal;
        s->cold = of->hold_samples + 1;
    }
    if (s->cold > of->hold_samples) {
        s->flags |= MRD_NOMINAL_TEMPERATURE;
        s->temperature += limited(of->nominal - s->temperature, -of->slew, of->slew);
    } else if (c->heating.extrapolate) {
        s->temperature = limited(s->temperature + s->warming, of->cold_limit, of->hot_limit);
    } else {
        /* The estimate is held. */
    }
    if (moves && s->steady > 0 && magnitude(reading - s->candidate) <= of->jump) {
        if (++s->steady > of->recover_samples && s->steady > s->good) {
            s->temperature = s->candidate;
            s->cold = 0;
            s->steady = 0;
            s->good = 0;
        }
    } else {
        s->candidate = reading;
        s->steady = 0;
        if (there) s->steady = 1;
    }
}

/* Update the temperature estimate by a reading [K]. */
static void follow_temperature(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    const mrd_config_thermometer *of = &c->thermometer;
    if (of->held > R(0.0)) {
        s->temperature = of->held;
        return;
    }
    const bool there = reading >= of->cold_limit && reading <= of->hot_limit;
    const bool frozen = there && is_frozen(c, s, reading);
    if (!there) s->flags |= MRD_NO_TEMPERATURE;
    if (frozen) s->flags |= MRD_FROZEN_TEMPERATURE;
    if (!(s->temperature > R(0.0)) && there) s->temperature = reading; /* the first reading */

    const mrd_real gap = there ? reading - s->temperature : R(0.0), risen = reading + s->temperature_rise;
    const bool near = there && magnitude(gap) <= of->jump;
    if (frozen && c->heating.extrapolate && magnitude(risen - s->temperature) <= of->jump) {
        update_temperature_estimate(of, s, limited(risen, of->cold_limit, of->hot_limit));
        s->good = 0;
    } else if (near) {
        update_temperature_estimate(of, s, reading);
        if (s->good < of->hold_samples) s->good++;
    } else {
        if (there) s->flags |= MRD_TEMPERATURE_JUMP;
        go_without(c, s, reading, there, there && !frozen);
    }
    if (!(s->coolest > R(0.0)) || s->temperature < s->coolest) s->coolest = s->temperature;
    if (!(s->temperature >= c->axes.coldest && s->temperature <= c->axes.warmest)) s->flags |= MRD_OUTSIDE_TEMPERATURE;
}

/* A command on its way. */
static inline void give(mrd_track_state *s, mrd_real command)
{
    const uint32_t next = ((uint32_t)s->at + 1u) % MRD_TRACK_DELAY_LINE;
    s->at = (int32_t)next;
    s->delay_line[s->at] = command;
    s->command = command;
}

/* The command that reached the lags `ago` periods before the newest one did not; negative: is still to come. */
static mrd_real past_dead_time(const mrd_track *c, const mrd_track_state *s, int32_t ago)
{
    const int32_t n = c->actuation.dead_samples + ago, since = s->at - n;
    const uint32_t newest = (uint32_t)since;
    if (n < 0) return s->command; /* it stays */
    const mrd_real older = s->delay_line[(newest - 1u) % MRD_TRACK_DELAY_LINE];
    const mrd_real newer = s->delay_line[newest % MRD_TRACK_DELAY_LINE];
    return limited(newer + c->actuation.dead_part * (older - newer), R(0.0), c->axes.largest);
}

/* The flux of a current, in units of the current where the iron is far from saturation; lags and plays are the flux's. */
static inline mrd_real flux_of(const mrd_track *c, mrd_real current)
{
    return c->actuation.bend > R(0.0) ? current / (R(1.0) + c->actuation.bend * current) : current;
}

/* The current of a flux. */
static inline mrd_real inverse_flux(const mrd_track *c, mrd_real flux)
{
    return c->actuation.bend > R(0.0) ? flux / (R(1.0) - c->actuation.bend * flux) : flux;
}

/* The flux of a free-wheeling current after a time, `share` of its time constant: wheel flux' = -current; its slope over
 * the flux before in *slope, if asked for. Second order, and the exponential by three terms of its inverse. */
static mrd_real free_wheeled(const mrd_track *c, mrd_real flux, mrd_real share, mrd_real *slope)
{
    const mrd_real bend = c->actuation.bend > R(0.0) ? c->actuation.bend : R(0.0);
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

/* The second lag of a first that goes straight from `from` to `to` meanwhile. */
static inline mrd_real second_along(mrd_real second, mrd_real keep, mrd_real ramp, mrd_real from, mrd_real to)
{
    return keep * second + (ramp - keep) * from + (R(1.0) - ramp) * to;
}

/* Both lags one period on with a held command: exact, but for a free-wheeling current. */
static inline void pass_lags(const mrd_track *c, mrd_real command, mrd_real *first, mrd_real *second)
{
    const mrd_real input = flux_of(c, command), gap = *first - input;
    const bool rises = input > *first;
    const mrd_real couple = rises ? c->actuation.rise_couple : c->actuation.fall_couple;
    const mrd_real past = *second, before = *first;
    *second = input + c->actuation.second * (past - input) + couple * gap;
    *first = input + (rises ? c->actuation.rise : c->actuation.fall) * gap;
    if (!(c->actuation.wheel > R(0.0)) || rises) return;
    const mrd_real wheeled = free_wheeled(c, before, c->actuation.wheel, NULL);
    if (!(wheeled > *first)) return; /* else the driver cannot pull it down so fast */
    *second = second_along(past, c->actuation.second, c->actuation.second_ramp, before, wheeled);
    *first = wheeled;
}

/* What a dead band holds above the flux ahead of it; `at` is its output, less that by its half width while the flux rises. */
static inline mrd_real past_band(mrd_real flux, mrd_real width, mrd_real *at)
{
    *at = limited(*at, flux - width, flux + width);
    return *at + width - flux;
}

/* Magnetic play: a share of the field follows the lagged flux with a dead band, and another with a wider one. While the
 * command rises from rest what is felt is the command itself; when it falls, up to twice share and half width more. */
static inline mrd_real past_play(const mrd_track *c, mrd_real flux, mrd_real *play)
{
    const mrd_config_actuation *a = &c->actuation;
    mrd_real felt = inverse_flux(c, flux);
    if (a->play > R(0.0)) felt += a->play_share * past_band(flux, a->play, &play[0]);
    if (a->wide_play > R(0.0)) felt += a->wide_share * past_band(flux, a->wide_play, &play[1]);
    return felt;
}

/* The command at which so much is felt beyond one dead band, which is at `at`. */
static inline mrd_real before_band(const mrd_track *c, mrd_real felt, mrd_real width, mrd_real share, mrd_real at)
{
    const mrd_real rest = felt - share * (at + width);
    mrd_real inside = rest / (R(1.0) - share); /* I - share flux(I) is the rest */
    if (c->actuation.bend > R(0.0)) {
        const mrd_real bend = c->actuation.bend, linear = R(1.0) - share - bend * rest;
        const mrd_real root = square_root(linear * linear + R(4.0) * bend * rest);
        inside = linear > R(0.0) ? R(2.0) * rest / (linear + root) : R(0.5) * (root - linear) / bend;
    }
    const mrd_real flux = flux_of(c, inside);
    if (flux > at + width) return felt;
    if (flux < at - width) return felt - R(2.0) * share * width;
    return inside;
}

/* The command at which so much is felt, the plays being where they are; of two, one by the other in turn. */
static inline mrd_real before_play(const mrd_track *c, mrd_real felt, const mrd_real *play)
{
    const mrd_config_actuation *a = &c->actuation;
    const bool wide = a->wide_play > R(0.0);
    mrd_real command = felt;
    if (!wide) return a->play > R(0.0) ? before_band(c, felt, a->play, a->play_share, play[0]) : felt;
    for (int i = 0; i < BAND_ROUNDS; i++) {
        mrd_real narrow = play[0];
        const mrd_real held = a->play > R(0.0) ? a->play_share * past_band(flux_of(c, command), a->play, &narrow) : R(0.0);
        command = before_band(c, felt - held, a->wide_play, a->wide_share, play[1]);
    }
    return command;
}

/* What the force feels of the commands, brought up to now; returns its mean over the period. */
static mrd_real follow_applied(const mrd_track *c, mrd_track_state *s)
{
    const mrd_real applied = s->applied;
    pass_lags(c, past_dead_time(c, s, 0), &s->first, &s->second);
    s->applied = past_play(c, s->second, s->play);
    return R(0.5) * (applied + s->applied);
}

/* A segment of h in which the velocity goes straight from v0 to v1: up to where it turns, and from there. */
typedef struct {
    mrd_real to, from;          /* sizes of the travel */
    bool turns_first, turns;    /* whether the hysteresis turns before it, and in between */
    mrd_real side;              /* its way after the segment */
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

/* Place on the universal curve after a segment. */
static mrd_real place_after(const mrd_track *c, mrd_real before, mrd_real rho, const segment *s)
{
    mrd_real u = (s->turns_first ? after_turn(c, before) : before) + rho * s->to;
    if (s->turns) u = after_turn(c, u) + rho * s->from;
    return u < c->loading.top ? u : c->loading.top;
}

/* Column of the table at which a model of a bank is. */
static inline int32_t quarter_of(const mrd_track *c, int model) { return (int32_t)c->quarter[model]; }

/* Inverse yield displacement of an element in each model of a bank. */
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

/* Whether the law is one that is stepped implicitly: the chain or the series valve. */
static inline bool steps_implicitly(const mrd_track *c) { return has_chain(c) || has_series(c); }

/* Hysteresis of every model through the period that ends now, velocity having been v0 at its begin. `k` is that of a law
 * that is stepped implicitly, whose force without what lies beside the chain is returned. */
static mrd_real follow_hysteresis(const mrd_track *c, mrd_track_state *s, const valve_chain *k, axis_point warm, mrd_real v0,
                                  mrd_real applied)
{
    if (has_chain(c)) return follow_chain(c, s, k, warm, v0, applied);
    if (has_series(c)) return follow_series(c, s, k, warm, v0, applied);
    const int elements = c->law.elements;
    const segment way = segment_of(s->side, v0, s->v, c->axes.period);
    mrd_real rho[MRD_TRACK_BANK];
    s->side = way.side;
    if (c->inverse.bank) {
        for (int e = 0; e < elements; e++) {
            rho_of_models(c, warm, e, rho);
            for (int b = 0; b < MRD_TRACK_BANK; b++) s->place[b][e] = place_after(c, s->place[b][e], rho[b], &way);
        }
    } else {
        rho_at(c, warm, applied, rho);
        for (int e = 0; e < elements; e++) s->place[0][e] = place_after(c, s->place[0][e], rho[e], &way);
    }
    return R(0.0);
}

/* What the model has now: motion, hysteresis at the applied current. */
static moment present(const mrd_track *c, const mrd_track_state *s)
{
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    moment m = {s->x, s->v, s->a, {sign, sign}};
    for (int e = 0; e < c->law.elements; e++) m.w[e] = s->side * size_at(c, s->place[0][e]);
    return m;
}

/* The force now of a law that is stepped implicitly. */
static mrd_real stepped_force(const mrd_track *c, const mrd_track_state *s, axis_point warm)
{
    mrd_real parts[4];
    if (has_chain(c)) chain_parts(c, s, warm, parts);
    else series_parts(c, s, warm, parts);
    return parts[0] + parts[1] + parts[2] + parts[3];
}

/* The force now of a law that is not stepped implicitly. */
static mrd_real travel_force(const mrd_track *c, const mrd_track_state *s, axis_point warm)
{
    const moment m = present(c, s);
    mrd_real by[MRD_ROWS];
    multipliers(c, &m, by);
    return force_at(c, warm, on_currents(c, s->applied), by);
}

MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts)
{
    static const uint8_t part_of[MRD_ROWS] = {3, 3, 3, 1, 2, 2, 0, 0};
    const axis_point warm = on_temperatures(c, s->temperature), at = on_currents(c, s->applied);
    if (has_chain(c)) {
        chain_parts(c, s, warm, parts);
        return;
    }
    if (has_series(c)) {
        series_parts(c, s, warm, parts);
        return;
    }
    const moment m = present(c, s);
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

/* Update the disturbance observer by a measured force [N]: first-order filter of the force error along the motion. */
static void observe(const mrd_track *c, mrd_track_state *s, mrd_real force)
{
    mrd_real parts[4];
    mrd_track_parts(c, s, parts);
    const mrd_real error = force - (parts[0] + parts[1] + parts[2] + parts[3]);
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    s->disturbance += c->feedback.observe * (sign * error - s->disturbance);
}

#endif
