/* What a controller believes: motion, applied current, hysteresis, temperature, learnt gains.
 *
 * Every reading is looked at before it is used; one that cannot be true leaves the belief as it was and raises
 * a flag.
 */
#include "controller.h"

/* Constant-acceleration prediction over h, and its correction by a reading. */
static inline void predict(mrd_real *x, mrd_real *v, mrd_real a, mrd_real h)
{
    *x += h * (*v + R(0.5) * h * a);
    *v += h * a;
}

/* Says whether the motion is one that the data have. */
static inline void look_at_motion(const mrd_track *c, mrd_track_state *s)
{
    if (!(s->x >= c->low_x && s->x <= c->high_x && magnitude(s->v) <= c->high_v)) s->flags |= MRD_OUTSIDE_MOTION;
}

/* Displacement in; estimated motion one period on. Returns whether the motion is known. */
static bool follow_motion(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    const bool there = magnitude(reading) <= c->far_x; /* false where it is not a number */
    if (there && s->started != 0 && reading == s->last_x) {
        if (s->repeated == 0) s->speed_before = magnitude(s->v);
        if (s->repeated < INT32_MAX) s->repeated++;
    } else {
        s->repeated = 0;
    }
    const bool frozen = s->repeated >= (int32_t)c->frozen_samples && s->speed_before > c->frozen_speed;
    if (!there) s->flags |= MRD_NO_DISPLACEMENT;
    if (frozen) s->flags |= MRD_FROZEN;
    if (there) s->last_x = reading;

    if (there && !frozen) {
        if (s->started == 0 || s->lost > (int32_t)c->coast_samples) { /* anew */
            s->x = reading;
            s->v = R(0.0);
            s->a = R(0.0);
            s->back = s->started != 0 ? (int32_t)c->coast_samples : 0;
            s->started = 1;
        } else {
            predict(&s->x, &s->v, s->a, c->period);
            const mrd_real gap = reading - s->x;
            s->x += c->filter_x * gap;
            s->v += c->filter_v * gap;
            s->a += c->filter_a * gap;
        }
        s->lost = 0;
    } else {
        if (s->lost < INT32_MAX) s->lost++;
        if (s->lost <= (int32_t)c->coast_samples) {
            predict(&s->x, &s->v, s->a, c->period);
            s->x = limited(s->x, -c->far_x, c->far_x);
        } else {
            s->v = R(0.0);
            s->a = R(0.0);
        }
    }
    if (s->back > 0) s->back--;
    const bool known = s->started != 0 && s->lost <= (int32_t)c->coast_samples && s->back == 0;
    if (!known) s->flags |= MRD_MOTION_UNKNOWN;
    look_at_motion(c, s);
    return known;
}

/* Whether a temperature stands still though the energy put in should have moved it; for good, until it changes. */
static bool is_stuck(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    if (reading != s->read) {
        s->read = reading;
        s->warmed = R(0.0);
        s->warmed_least = R(0.0);
        s->stuck = 0;
    }
    if (c->capacity > R(0.0) && s->warmed_least > c->frozen_warming) s->stuck = 1;
    return s->stuck != 0;
}

/* The energy account of a reading that stands still: heat put in [W] less what is lost, over the capacity. The
 * least warming has the loss at its most, to the coldest surroundings that there may be; only that accuses a
 * sensor, so that a damper whose losses balance its heat does not. */
static void follow_heat(const mrd_track *c, mrd_track_state *s, mrd_real work)
{
    static const mrd_real most = R(1000.0);
    const mrd_real heat = work + c->coil_heat * s->applied * s->applied, part = c->period / c->capacity;
    const mrd_real cold = s->coolest < c->ambient ? s->coolest : c->ambient;
    const mrd_real above = limited(s->read + s->warmed_least - cold, R(0.0), most);
    s->warmed = limited(s->warmed + part * (heat - c->loss * (s->read + s->warmed - c->ambient)), -most, most);
    s->warmed_least = limited(s->warmed_least + part * (heat - c->loss_margin * c->loss * above), R(0.0), most);
}

/* Temperature in; the believed one is updated. */
static void follow_temperature(const mrd_track *c, mrd_track_state *s, mrd_real reading)
{
    if (c->held_temperature > R(0.0)) {
        s->temperature = c->held_temperature;
        return;
    }
    const bool there = reading >= c->cold_limit && reading <= c->hot_limit;
    if (there && !(s->temperature > R(0.0))) s->temperature = reading; /* the first */
    const mrd_real gap = there ? reading - s->temperature : R(0.0);
    const bool stuck = there && is_stuck(c, s, reading);
    if (stuck) s->flags |= MRD_FROZEN_TEMPERATURE;
    if (stuck && c->reckon > R(0.5)) {
        const mrd_real reckoned = limited(reading + s->warmed, c->cold_limit, c->hot_limit);
        s->temperature += limited((R(1.0) - c->warm_keep) * (reckoned - s->temperature), -c->slew, c->slew);
        s->cold = 0;
        s->steady = 0;
    } else if (there && magnitude(gap) <= c->jump) {
        s->temperature += limited((R(1.0) - c->warm_keep) * gap, -c->slew, c->slew);
        s->cold = 0;
        s->steady = 0;
    } else {
        s->flags |= there ? MRD_TEMPERATURE_JUMP : MRD_NO_TEMPERATURE;
        if (s->cold < INT32_MAX) s->cold++;
        if (!(s->temperature > R(0.0))) s->temperature = c->nominal;
        if (s->cold > (int32_t)c->hold_samples) {
            s->flags |= MRD_NOMINAL_TEMPERATURE;
            s->temperature += limited(c->nominal - s->temperature, -c->slew, c->slew);
        }
        /* A reading that stays where it has jumped to is believed in the end. */
        if (there && s->steady > 0 && magnitude(reading - s->probe) <= c->jump) {
            if (++s->steady > (int32_t)c->recover_samples) {
                s->temperature = s->probe;
                s->cold = 0;
                s->steady = 0;
            }
        } else {
            s->probe = reading;
            s->steady = 0;
            if (there) s->steady = 1;
        }
    }
    if (!(s->coolest > R(0.0)) || s->temperature < s->coolest) s->coolest = s->temperature;
    if (!(s->temperature >= c->coldest && s->temperature <= c->warmest)) s->flags |= MRD_OUTSIDE_TEMPERATURE;
}

/* A command on its way. */
static inline void give(mrd_track_state *s, mrd_real command)
{
    const uint32_t next = ((uint32_t)s->at + 1u) % MRD_TRACK_LINE;
    s->at = (int32_t)next;
    s->line[s->at] = command;
    s->command = command;
}

/* The command that reached the lags `ago` periods before the newest one did not; negative: is still to come. */
static mrd_real past_dead_time(const mrd_track *c, const mrd_track_state *s, int32_t ago)
{
    const int32_t n = (int32_t)c->dead_samples + ago, since = s->at - n;
    const uint32_t newest = (uint32_t)since;
    const mrd_real older = s->line[(newest - 1u) % MRD_TRACK_LINE];
    const mrd_real newer = n < 0 ? s->command : s->line[newest % MRD_TRACK_LINE];
    return newer + c->dead_part * (older - newer);
}

/* Both lags one period on with a held input: exact. */
static inline void pass_lags(const mrd_track *c, mrd_real input, mrd_real *first, mrd_real *second)
{
    const bool rises = input > *first;
    const mrd_real gap = *first - input;
    *second = input + c->second * (*second - input) + (rises ? c->rise_couple : c->fall_couple) * gap;
    *first = input + (rises ? c->rise : c->fall) * gap;
}

/* Magnetic play: a share of the field follows the lagged command with a dead band. While the command rises from
 * rest what is felt is the command itself; when it falls, up to twice the share's half width more. */
static inline mrd_real past_play(const mrd_track *c, mrd_real lagged, mrd_real *play)
{
    if (!(c->play > R(0.0))) {
        *play = lagged;
        return lagged;
    }
    *play = limited(*play, lagged - c->play, lagged + c->play);
    return lagged + c->play_share * (*play + c->play - lagged);
}

/* The lagged command at which so much is felt, the play being where it is. */
static inline mrd_real before_play(const mrd_track *c, mrd_real felt, mrd_real play)
{
    if (!(c->play > R(0.0))) return felt;
    const mrd_real inside = (felt - c->play_share * (play + c->play)) / (R(1.0) - c->play_share);
    if (inside > play + c->play) return felt;
    if (inside < play - c->play) return felt - R(2.0) * c->play_share * c->play;
    return inside;
}

/* What the force feels of the commands, brought up to now; returns its mean over the period. */
static mrd_real follow_applied(const mrd_track *c, mrd_track_state *s)
{
    const mrd_real applied = s->applied;
    if (c->unlagged > R(0.5)) {
        s->first = s->command;
        s->second = s->command;
    } else {
        pass_lags(c, past_dead_time(c, s, 0), &s->first, &s->second);
    }
    s->applied = past_play(c, s->second, &s->play);
    return R(0.5) * (applied + s->applied);
}

/* A stretch of h in which the velocity goes straight from v0 to v1: up to where it turns, and from there. */
typedef struct {
    mrd_real to, from;          /* sizes of the travel */
    bool turns_first, turns;    /* whether the hysteresis turns before it, and in between */
    mrd_real side;              /* its way after the stretch */
} stretch;

static stretch stretch_of(mrd_real side, mrd_real v0, mrd_real v1, mrd_real h)
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
    const stretch way = {magnitude(to), magnitude(from), turns_first, turns, turns ? -between : between};
    return way;
}

/* Place on the universal curve after a stretch. */
static mrd_real place_after(const mrd_track *c, mrd_real before, mrd_real rho, const stretch *s)
{
    mrd_real u = (s->turns_first ? after_turn(c, before) : before) + rho * s->to;
    if (s->turns) u = after_turn(c, u) + rho * s->from;
    return u < c->loading.top ? u : c->loading.top;
}

static inline int bank_of(const mrd_track *c) { return c->bank > R(1.5) ? (int)c->bank : 1; }

/* How many of its models have a hysteresis of their own. */
static inline int states_of(const mrd_track *c) { return c->shared > R(0.5) ? 1 : bank_of(c); }

/* Eighths of the largest current between one model of a bank and the next. */
static inline int bank_stride(int models) { return (MRD_TRACK_BANK - 1) / (models - 1); }

/* Inverse yield displacement of an element in each of several models. */
static void rho_of_models(const mrd_track *c, axis_point warm, int element, int models, mrd_real *rho)
{
    const int32_t columns = c->begin[MRD_GROUPS], first = c->begin[MRD_GROUP_RHO + element];
    const int stride = bank_stride(models);
    const mrd_real *p = parabolas_at(c, warm);
    for (int b = 0; b < models; b++) rho[b] = R(0.0);
    for (int32_t k = first; k < c->begin[MRD_GROUP_RHO + element + 1]; k++) {
        const mrd_real factor = parabola(&p[3 * (c->levels + k)], warm.share);
        for (int b = 0; b < models; b++) rho[b] += factor * c->column[(int32_t)c->eighth[b * stride] * columns + k];
    }
}

/* Hysteresis of every model through the period that ends now, velocity having been v0 at its begin. */
static void follow_hysteresis(const mrd_track *c, mrd_track_state *s, axis_point warm, mrd_real v0, mrd_real applied)
{
    if (is_series(c)) {
        follow_series(c, s, warm, v0, applied);
        return;
    }
    const int models = states_of(c), elements = (int)c->elements;
    const stretch way = stretch_of(s->side, v0, s->v, c->period);
    mrd_real rho[MRD_TRACK_BANK];
    s->side = way.side;
    if (models > 1) {
        for (int e = 0; e < elements; e++) {
            rho_of_models(c, warm, e, models, rho);
            for (int b = 0; b < models; b++) s->place[b][e] = place_after(c, s->place[b][e], rho[b], &way);
        }
    } else {
        rho_at(c, warm, applied, rho);
        for (int e = 0; e < elements; e++) s->place[0][e] = place_after(c, s->place[0][e], rho[e], &way);
    }
}

/* What the model has now: motion, hysteresis at the applied current. */
static moment present(const mrd_track *c, const mrd_track_state *s)
{
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    moment m = {s->x, s->v, s->a, {sign, sign}};
    for (int e = 0; e < (int)c->elements; e++) m.w[e] = s->side * size_at(c, s->place[0][e]);
    return m;
}

/* Work of the model's force [W]: one term of it in turn counts for all of them, which over some seconds is the work
 * of their sum, and costs a step a fraction; so does the straight line between two eighths of the largest current. */
static mrd_real sampled_work(const mrd_track *c, mrd_track_state *s, axis_point warm)
{
    const int32_t columns = c->begin[MRD_GROUPS], terms = c->levels + c->begin[MRD_GROUP_RHO];
    if (is_series(c)) {
        s->term = s->term + 1 < MRD_ROWS ? s->term + 1 : 0;
        return s->term == 0 ? R(MRD_ROWS) * series_force(c, s, warm) * s->v : R(0.0);
    }
    s->term = s->term + 1 < terms ? s->term + 1 : 0;
    const int32_t row = c->row[s->term];
    moment m = {s->x, s->v, s->a, {R(0.0), R(0.0)}};
    if (row >= (int32_t)MRD_ROW_YIELD) m = present(c, s);
    mrd_real force = multiplier(c, s, &m, row) * parabola(&parabolas_at(c, warm)[3 * s->term], warm.share);
    if (s->term >= c->levels) {
        const mrd_real where = limited(s->applied / c->largest, R(0.0), R(1.0)) * R(8.0);
        const int32_t eighth = where < R(7.0) ? (int32_t)where : 7, column = s->term - c->levels;
        const mrd_real low = c->column[(int32_t)c->eighth[eighth] * columns + column];
        const mrd_real high = c->column[(int32_t)c->eighth[eighth + 1] * columns + column];
        force *= low + (where - (mrd_real)eighth) * (high - low);
    }
    return (mrd_real)terms * force * s->v;
}

MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts)
{
    static const uint8_t part_of[MRD_ROWS] = {3, 3, 3, 1, 2, 2, 0, 0};
    const axis_point warm = warmth(c, s->temperature), at = on_currents(c, s->applied);
    if (is_series(c)) {
        series_parts(c, s, warm, parts);
        return;
    }
    const moment m = present(c, s);
    const mrd_real *p = parabolas_at(c, warm);
    mrd_real by[MRD_ROWS];
    multipliers(c, s, &m, by);
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

/* A measured force teaches: the gains by recursive least squares, the disturbance by a first-order filter. */
static void learn(const mrd_track *c, mrd_track_state *s, mrd_real force)
{
    mrd_real parts[4];
    mrd_track_parts(c, s, parts);
    const mrd_real error = force - (parts[0] + parts[1] + parts[2] + parts[3]);
    const mrd_real sign = s->v < R(0.0) ? R(-1.0) : R(1.0);
    if (c->observe > R(0.0)) s->disturbance += c->observe * (sign * error - s->disturbance);
    if (!(c->forget > R(0.0)) || magnitude(s->v) < c->gain_speed) return;
    mrd_real feature[MRD_TRACK_GAINS], p[MRD_TRACK_GAINS], spread = c->error_variance;
    for (int i = 0; i < MRD_TRACK_GAINS; i++) feature[i] = parts[i] / s->gain[i];
    for (int i = 0; i < MRD_TRACK_GAINS; i++) {
        p[i] = R(0.0);
        for (int j = 0; j < MRD_TRACK_GAINS; j++) p[i] += s->spread[i * MRD_TRACK_GAINS + j] * feature[j];
        spread += feature[i] * p[i];
    }
    for (int i = 0; i < MRD_TRACK_GAINS; i++)
        s->gain[i] = limited(s->gain[i] + p[i] * error / spread, R(0.4), R(2.5));
    for (int i = 0; i < MRD_TRACK_GAINS; i++)
        for (int j = 0; j < MRD_TRACK_GAINS; j++) {
            mrd_real *q = &s->spread[i * MRD_TRACK_GAINS + j];
            *q = (*q - p[i] * p[j] / spread) / c->forget;
        }
    /* Forgetting lets the covariance of what is not excited grow: it never passes where it began. */
    for (int i = 0; i < MRD_TRACK_GAINS; i++) {
        const mrd_real own = s->spread[i * (MRD_TRACK_GAINS + 1)];
        if (own > c->gain_variance) {
            for (int k = 0; k < MRD_TRACK_GAINS * MRD_TRACK_GAINS; k++) s->spread[k] *= c->gain_variance / own;
        }
    }
}
