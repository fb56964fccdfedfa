/* The thermal model of thermal.h. The code calls no library function except memcpy and memset, allocates no memory and
 * has no global state. */
#include "thermal.h"

#define R(x) ((mrd_real)(x))

/* Temperature coefficient of the coil resistance [1/K], and its reference temperature [K]. */
static const mrd_real thermal_copper = R(0.00393), thermal_zero = R(293.15);

/* Return u limited to [low, high]; low if u is NaN. */
static inline mrd_real thermal_limited(mrd_real u, mrd_real low, mrd_real high)
{
    return u > low ? (u < high ? u : high) : low;
}

/* Return true if a reading is inside its range; false for NaN. */
static inline bool thermal_within(mrd_real u, mrd_real low, mrd_real high) { return (u >= low) && (u <= high); }

static mrd_real thermal_dot(const mrd_real *a, const mrd_real *b, int32_t count)
{
    mrd_real sum = R(0.0);
    for (int32_t i = 0; i < count; i++) sum += a[i] * b[i];
    return sum;
}

/* Return the index of the cell of u between increasing knots. *share receives the position in the cell, 0 to 1. */
static int32_t thermal_place(const mrd_real *knot, int32_t knots, mrd_real u, mrd_real *share)
{
    int32_t cell = 0;
    while ((cell < (knots - 2)) && (u >= knot[cell + 1])) cell++;
    *share = thermal_limited((u - knot[cell]) / (knot[cell + 1] - knot[cell]), R(0.0), R(1.0));
    return cell;
}

/* Return the temperature of a row of the model [K], including the feedthrough of the heat sources. */
static mrd_real thermal_row(const mrd_thermal *c, const mrd_real *z, const mrd_thermal_load *load, int32_t row)
{
    const mrd_real *through = &c->through[2 * row];
    return c->reference + thermal_dot(&c->row[row * c->states], z, c->states) + (through[0] * load->power) +
           (through[1] * load->coil_W);
}

/* Return the temperature of the hottest point of a part [K]. */
static mrd_real thermal_hottest(const mrd_thermal *c, const mrd_real *z, const mrd_thermal_load *load, int32_t part)
{
    const int32_t first = 2 + (part * MRD_THERMAL_POINTS);
    mrd_real most = thermal_row(c, z, load, first);
    for (int32_t i = 1; i < MRD_THERMAL_POINTS; i++) {
        const mrd_real here = thermal_row(c, z, load, first + i);
        if (here > most) most = here;
    }
    return most;
}

/* Return the smallest margin to the limits of all parts [K]; negative above a limit. */
static mrd_real thermal_margin(const mrd_thermal *c, const mrd_real *z, const mrd_thermal_load *load)
{
    const mrd_real gap = c->limit_gap - thermal_hottest(c, z, load, 0);
    const mrd_real coil = c->limit_coil - thermal_hottest(c, z, load, 1);
    const mrd_real seal = c->limit_seal - thermal_hottest(c, z, load, 2);
    const mrd_real least = gap < coil ? gap : coil;
    return seal < least ? seal : least;
}

/* Return the heat-transfer coefficient of a kind of surface [W/(m^2 K)]: convection (table), radiation, mounting. */
static mrd_real thermal_film(const mrd_thermal *c, int32_t kind, mrd_real surface, const mrd_thermal_load *load)
{
    const int32_t sheet = c->speeds * c->differences;
    const mrd_real ambient = load->ambient, u = (ambient - c->film_ambient) / c->film_width;
    const mrd_real x = thermal_limited(u, R(-1.5), R(1.5));
    const mrd_real weight[3] = {R(0.5) * x * (x - R(1.0)), R(1.0) - (x * x), R(0.5) * x * (x + R(1.0))};
    mrd_real in_speed, in_above, convection = R(0.0);
    const int32_t speed = thermal_place(c->speed, c->speeds, load->air_speed, &in_speed);
    const int32_t above = thermal_place(c->above, c->differences, surface - ambient, &in_above);
    const mrd_real *at = &c->film[((int32_t)c->law[kind] * 3 * sheet) + (speed * c->differences) + above];
    for (int32_t k = 0; k < 3; k++) {
        const mrd_real *slow = &at[k * sheet], *fast = &slow[c->differences];
        const mrd_real low = slow[0] + (in_above * (slow[1] - slow[0]));
        const mrd_real high = fast[0] + (in_above * (fast[1] - fast[0]));
        convection += weight[k] * (low + (in_speed * (high - low)));
    }
    const mrd_real both = surface + ambient;
    return thermal_limited(convection, R(0.0), R(1e6)) +
           (c->radiation[kind] * both * ((surface * surface) + (ambient * ambient))) + c->mount[kind];
}

/* Solve the symmetric positive definite system a x = b in place by a = L D L^T. Only the lower half of a is used. */
static void thermal_solve(mrd_real a[MRD_THERMAL_STATES][MRD_THERMAL_STATES], mrd_real *b, int32_t n)
{
    for (int32_t j = 0; j < n; j++) {
        const mrd_real inverse = R(1.0) / a[j][j];
        for (int32_t i = j + 1; i < n; i++) {
            const mrd_real factor = a[i][j] * inverse;
            for (int32_t k = j + 1; k <= i; k++) a[i][k] -= factor * a[k][j];
            b[i] -= factor * b[j];
        }
    }
    for (int32_t j = n - 1; j >= 0; j--) {
        for (int32_t i = j + 1; i < n; i++) b[j] -= a[i][j] * b[i];
        b[j] /= a[j][j];
    }
}

/* Advance the states by a time [s] in one implicit step. Heat-transfer coefficients and coil resistance are constant
 * during the step. */
static void thermal_advance(const mrd_thermal *c, mrd_real *z, mrd_thermal_load *load, mrd_real excess, mrd_real time)
{
    const int32_t n = c->states;
    const mrd_real air = load->ambient - c->reference, rate = R(1.0) / time;
    const mrd_real coil = c->reference + thermal_dot(&c->row[n], z, n);
    mrd_real a[MRD_THERMAL_STATES][MRD_THERMAL_STATES], move[MRD_THERMAL_STATES];
    load->coil_W = c->coil_heat * load->square *
                   thermal_limited(R(1.0) + (thermal_copper * (coil - thermal_zero)), R(0.2), R(3.0));
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j < i; j++) a[i][j] = R(0.0);
        a[i][i] = c->conductance[i];
        move[i] = (c->mechanical[i] * (load->power + excess)) + (c->electrical[i] * load->coil_W);
    }
    for (int32_t k = 0; k < c->kinds; k++) {
        const mrd_real *area = &c->area[k * n * n];
        const mrd_real h = thermal_film(c, k, c->reference + thermal_dot(&c->mean[k * n], z, n), load);
        for (int32_t i = 0; i < n; i++) {
            for (int32_t j = 0; j <= i; j++) a[i][j] += h * area[(i * n) + j];
            move[i] += h * area[i * n] * air; /* column 0 is used because the first state is the uniform temperature */
        }
    }
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j <= i; j++) move[i] -= a[i][j] * z[j];
        for (int32_t j = i + 1; j < n; j++) move[i] -= a[j][i] * z[j];
    }
    for (int32_t i = 0; i < n; i++) a[i][i] += c->capacity[i] * rate;
    thermal_solve(a, move, n);
    for (int32_t i = 0; i < n; i++) z[i] += move[i];
}

/* Correct states and missing heat flow; `more` is reading minus model temperature [K]. */
static void thermal_correct(const mrd_thermal *c, mrd_thermal_state *s, int32_t sensor, mrd_real more)
{
    const int32_t n = c->states;
    const mrd_real *gain = &c->gain[sensor * (n + 1)];
    for (int32_t i = 0; i < n; i++) s->z[i] += gain[i] * more;
    s->corrected += thermal_dot(c->row, gain, n) * more;
    s->excess = thermal_limited(s->excess + (gain[n] * more), -c->most_excess, c->most_excess);
}

/* Check the thermometer. It is frozen if it is constant while the uncorrected model warms or cools. */
static void thermal_read(const mrd_thermal *c, mrd_thermal_state *s, mrd_real reading)
{
    const mrd_real model = thermal_row(c, s->z, &s->load, 0), more = reading - model;
    const mrd_real moved = reading - s->still_reading, change = model - s->corrected - s->still_model;
    if (!thermal_within(moved, -c->still, c->still)) {
        s->still_reading = reading;
        s->still_model = model;
        s->still_excess = s->excess;
        s->corrected = R(0.0);
        s->frozen = 0;
    } else if ((s->frozen == 0) && !thermal_within(change, -c->frozen_change, c->frozen_change)) {
        s->frozen = 1; /* The corrections since the reading became constant were wrong and are removed. */
        s->z[0] -= s->corrected;
        s->excess = s->still_excess;
    } else {
        /* The reading may be constant because the damper is in thermal equilibrium with its surroundings. */
    }
    if (s->frozen != 0) {
        s->flags |= MRD_THERMAL_FROZEN;
    } else if (!thermal_within(more, -c->wrong, c->wrong)) {
        s->flags |= MRD_THERMAL_WRONG;
    } else {
        thermal_correct(c, s, 0, more);
    }
}

/* Correct the model by the readings of thermometer and coil resistance, if they are valid. */
static void thermal_observe(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in)
{
    const bool read = thermal_within(in->thermometer, R(200.0), R(600.0));
    if (read) {
        thermal_read(c, s, in->thermometer);
    } else {
        s->flags |= MRD_THERMAL_NO_THERMOMETER;
    }
    const mrd_real ratio = c->resistance > R(0.0) ? in->resistance / c->resistance : R(0.0);
    const bool fed = (s->load.square >= (c->least_command * c->least_command)) && thermal_within(ratio, R(0.5), R(2.0));
    if (fed) {
        const mrd_real kelvin = thermal_zero + ((ratio - R(1.0)) / thermal_copper);
        thermal_correct(c, s, 1, kelvin - thermal_row(c, s->z, &s->load, 1));
    } else {
        s->flags |= MRD_THERMAL_NO_RESISTANCE;
    }
    if ((!read || ((s->flags & (MRD_THERMAL_FROZEN | MRD_THERMAL_WRONG)) != 0)) && !fed) s->excess *= c->fading;
}

/* Make one step of the prediction to the first limit at the smoothed power. Store the result when it ends. */
static void thermal_look_ahead(const mrd_thermal *c, mrd_thermal_state *s)
{
    const mrd_real horizon = R(MRD_THERMAL_HORIZON);
    mrd_thermal_load load = s->load;
    load.power = s->slow_power;
    load.square = s->slow_square;
    s->begun += c->update;
    s->time_left = s->time_left < horizon ? thermal_limited(s->time_left - c->update, R(0.0), horizon) : horizon;
    if (s->way == 0) {
        s->way = 1;
        (void)memcpy(s->ahead, s->z, sizeof s->ahead);
        s->ahead_time = R(0.0);
        s->ahead_step = R(4.0);
        s->ahead_hottest = thermal_margin(c, s->z, &load);
        s->begun = R(0.0);
    }
    thermal_advance(c, s->ahead, &load, s->excess, s->ahead_step); /* below 1e4 K: the prediction ends at a limit */
    const mrd_real before = s->ahead_hottest, margin = thermal_margin(c, s->ahead, &load);
    if (!(margin > R(0.0))) {
        const mrd_real share = before > R(0.0) ? before / (before - margin) : R(0.0);
        s->time_left = thermal_limited(s->ahead_time + (share * s->ahead_step) - s->begun, R(0.0), horizon);
        s->way = 0;
    }
    s->ahead_hottest = margin;
    s->ahead_time += s->ahead_step;
    s->ahead_step = thermal_limited(R(1.2) * s->ahead_step, R(4.0), R(30.0));
    if ((s->way != 0) && (s->ahead_time >= horizon)) {
        s->time_left = horizon;
        s->way = 0;
    }
}

/* Set the mean load of the last `every` steps and the present surroundings; unknown values are unchanged. */
static void thermal_take_load(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in)
{
    s->flags = 0;
    if (s->powers > 0) s->load.power = s->work / (mrd_real)s->powers;
    if (s->squares > 0) s->load.square = s->square / (mrd_real)s->squares;
    if (s->missed != 0) s->flags |= MRD_THERMAL_NO_POWER;
    if (thermal_within(in->ambient, R(200.0), R(400.0))) {
        s->load.ambient = in->ambient;
    } else {
        s->flags |= MRD_THERMAL_NO_AMBIENT;
    }
    if (thermal_within(in->air_speed, R(0.0), R(200.0))) {
        s->load.air_speed = in->air_speed;
    } else {
        s->flags |= MRD_THERMAL_NO_AIR_SPEED;
    }
    const mrd_real off = (s->load.ambient - c->film_ambient) / c->film_width;
    if (!thermal_within(off, R(-1.5), R(1.5)) || (s->load.air_speed > c->speed[c->speeds - 1]))
        s->flags |= MRD_THERMAL_OUTSIDE;
    s->work = R(0.0);
    s->square = R(0.0);
    s->count = 0;
    s->powers = 0;
    s->squares = 0;
    s->missed = 0;
}

/* Set all states to one temperature [K]. */
static void thermal_fill(const mrd_thermal *c, mrd_thermal_state *s, mrd_real kelvin)
{
    for (int32_t i = 0; i < MRD_THERMAL_STATES; i++) s->z[i] = R(0.0);
    s->z[0] = kelvin - c->reference;
    s->excess = R(0.0);
    s->still_reading = R(0.0);
    s->corrected = R(0.0);
    s->way = 0;
    s->frozen = 0;
    s->started = 1;
}

/* Return true if the outputs are valid. */
static bool thermal_told(const mrd_thermal_outputs *out)
{
    return thermal_within(out->fluid, R(0.0), R(1e5)) && thermal_within(out->gap, R(0.0), R(1e5)) &&
           thermal_within(out->coil, R(0.0), R(1e5)) && thermal_within(out->seal, R(0.0), R(1e5)) &&
           thermal_within(out->time_to_limit, R(0.0), R(MRD_THERMAL_HORIZON));
}

/* Return true if the state is valid. */
static bool thermal_sound(const mrd_thermal *c, const mrd_thermal_state *s)
{
    static const mrd_real most = R(1e7);
    const mrd_real all = most * (mrd_real)c->every;
    bool sound = thermal_told(&s->found) && (s->count >= 0) && (s->count < c->every) && (s->powers >= 0) &&
                 (s->powers <= s->count) && (s->squares >= 0) && (s->squares <= s->count) &&
                 thermal_within(s->work, -all, all) && thermal_within(s->square, R(0.0), all) &&
                 thermal_within(s->excess, -c->most_excess, c->most_excess) && thermal_within(s->load.power, -most, most) &&
                 thermal_within(s->load.square, R(0.0), most) && thermal_within(s->slow_power, -most, most) &&
                 thermal_within(s->slow_square, R(0.0), most) && thermal_within(s->ahead_time, R(0.0), most) &&
                 thermal_within(s->ahead_step, R(0.0), most) && thermal_within(s->load.ambient, R(200.0), R(400.0)) &&
                 thermal_within(s->load.air_speed, R(0.0), R(200.0)) && thermal_within(s->corrected, -most, most) &&
                 thermal_within(s->still_model, R(0.0), most) && thermal_within(s->still_excess, -most, most);
    for (int32_t i = 0; i < c->states; i++) {
        sound = sound && thermal_within(s->z[i], R(-1e4), R(1e4)) && thermal_within(s->ahead[i], R(-1e4), R(1e4));
    }
    return sound;
}

static void thermal_update(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in)
{
    const bool read = thermal_within(in->thermometer, R(200.0), R(600.0));
    thermal_take_load(c, s, in);
    if (s->started == 0) thermal_fill(c, s, read ? in->thermometer : s->load.ambient);
    thermal_advance(c, s->z, &s->load, s->excess, c->update);
    thermal_observe(c, s, in);
    s->slow_power += c->smoothing * (s->load.power - s->slow_power);
    s->slow_square += c->smoothing * (s->load.square - s->slow_square);
    if (!(thermal_margin(c, s->z, &s->load) > R(0.0))) {
        s->flags |= MRD_THERMAL_LIMIT;
        s->time_left = R(0.0);
    }
    s->found.fluid = thermal_row(c, s->z, &s->load, 0);
    s->found.gap = thermal_hottest(c, s->z, &s->load, 0);
    s->found.coil = thermal_hottest(c, s->z, &s->load, 1);
    s->found.seal = thermal_hottest(c, s->z, &s->load, 2);
    s->found.time_to_limit = thermal_limited(s->time_left, R(0.0), R(MRD_THERMAL_HORIZON));
}

MRD_THERMAL_API void mrd_thermal_start(const mrd_thermal *c, mrd_thermal_state *s, mrd_real kelvin)
{
    (void)memset(s, 0, sizeof *s);
    s->load.ambient = c->reference;
    s->time_left = R(MRD_THERMAL_HORIZON);
    s->load.air_speed = c->air_speed;
    s->count = c->every - 1; /* The first step then updates the states. */
    if (thermal_within(kelvin, R(200.0), R(600.0))) thermal_fill(c, s, kelvin);
}

MRD_THERMAL_API void mrd_thermal_step(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in,
                                    mrd_thermal_outputs *out)
{
    const mrd_real power = in->force * in->velocity;
    const bool is_power = thermal_within(power, R(-1e7), R(1e7)), is_command = thermal_within(in->command, R(-1e3), R(1e3));
    const bool sound = thermal_sound(c, s);
    if (!sound) mrd_thermal_start(c, s, R(0.0)); /* After this reset, the present step updates all outputs. */
    if (is_power) {
        s->work += power;
        s->powers++;
    }
    if (is_command) {
        s->square += in->command * in->command;
        s->squares++;
    }
    if (!is_power || !is_command) s->missed = 1;
    s->count++;
    if (s->count >= c->every) {
        thermal_update(c, s, in);
    } else if ((s->started != 0) && (s->count == (c->every / 2))) {
        thermal_look_ahead(c, s); /* Updates are computed in other steps, so that each step is short. */
    } else {
        /* The outputs of the last update remain valid. */
    }
    if (!sound) s->flags |= MRD_THERMAL_FAULT; /* The flag remains set until the next update. */
    *out = s->found;
}

#undef R
