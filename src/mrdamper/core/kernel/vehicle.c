/* The steps of vehicle.h. No library function, no allocation, no state outside the caller's. */
#include "vehicle.h"

#define R(x) ((mrd_real)(x))

static const mrd_real vehicle_fastest = R(1000.0), vehicle_longest = R(10.0); /* a reading beyond is a fault [m/s^2], [m] */
static const mrd_real vehicle_most = R(1e6); /* a state beyond is none */

static inline bool vehicle_has_wheel(const mrd_vehicle *c)
{
    (void)c;
    return (MRD_WITH_WHEEL_ACCELEROMETER == MRD_ASKED) ? c->wheel_accelerometer : (MRD_WITH_WHEEL_ACCELEROMETER == MRD_ALWAYS);
}

static inline bool vehicle_is_driven(const mrd_vehicle *c)
{
    (void)c;
    return (MRD_WITH_ACCELERATION_DRIVEN == MRD_ASKED) ? c->acceleration_driven : (MRD_WITH_ACCELERATION_DRIVEN == MRD_ALWAYS);
}

/* How many states there are. */
static inline int32_t vehicle_states(const mrd_vehicle *c) { return vehicle_has_wheel(c) ? 6 : 5; }

/* Whether a value is one, and no further out than it can be. */
static inline bool vehicle_within(mrd_real u, mrd_real most) { return (u >= -most) && (u <= most); }

static inline mrd_real vehicle_dot(const mrd_real *row, const mrd_real *z, int32_t count)
{
    mrd_real sum = row[0] * z[0];
    for (int32_t i = 1; i < count; i++) sum += row[i] * z[i];
    return sum;
}

static mrd_real vehicle_wanted(const mrd_vehicle *c, const mrd_real *z, mrd_real off, mrd_real pushed)
{
    const mrd_real wanted = (((c->by_rattle * z[0]) + (c->by_body * z[1])) + (c->by_tyre * z[2])) + (c->by_wheel * z[3]);
    const mrd_real speed = (z[1] - z[3]) + off;
    if (!((wanted * speed) > R(0.0))) return R(0.0);
    if (vehicle_is_driven(c) && ((((c->spring * z[0]) + pushed) * speed) > R(0.0))) return R(0.0);
    return wanted;
}

MRD_VEHICLE_API void mrd_vehicle_demand(const mrd_vehicle *c, const mrd_real *z, mrd_real off, mrd_real pushed,
                                        mrd_vehicle_outputs *out)
{
    mrd_real later[4];
    for (int32_t i = 0; i < 4; i++) later[i] = vehicle_dot(&c->ahead[4 * i], z, 4);
    out->wanted = vehicle_wanted(c, z, off, pushed);
    out->wanted_ahead = vehicle_wanted(c, later, off, pushed);
}

MRD_VEHICLE_API void mrd_vehicle_start(mrd_vehicle_state *s) { (void)memset(s, 0, sizeof *s); }

static bool vehicle_is_sane(const mrd_vehicle_state *s)
{
    bool sane = vehicle_within(s->body_acceleration, vehicle_fastest) && (s->missing >= 0);
    for (int32_t i = 0; i < MRD_VEHICLE_STATES; i++) sane = vehicle_within(s->z[i], vehicle_most) && sane;
    return sane;
}

/* Carries the states on by a period, through which the body's acceleration went straight from the last to this one. */
static void vehicle_predict(const mrd_vehicle *c, mrd_vehicle_state *s, mrd_real acceleration)
{
    const int32_t n = vehicle_states(c);
    mrd_real next[MRD_VEHICLE_STATES];
    for (int32_t i = 0; i < n; i++) {
        next[i] = vehicle_dot(&c->predict[n * i], s->z, n) + (c->before[i] * s->body_acceleration) +
                  (c->present[i] * acceleration);
    }
    for (int32_t i = 0; i < n; i++) s->z[i] = next[i];
    s->body_acceleration = acceleration;
}

/* A reading as the states have it; row [n + 1]. */
static mrd_real vehicle_expected(const mrd_vehicle_state *s, const mrd_real *row, int32_t n)
{
    return vehicle_dot(row, s->z, n) + (row[n] * s->body_acceleration);
}

/* Corrects the states by the readings. */
static void vehicle_correct(const mrd_vehicle *c, mrd_vehicle_state *s, const mrd_vehicle_inputs *in)
{
    const int32_t n = vehicle_states(c);
    const mrd_real stroke = in->stroke - vehicle_expected(s, c->stroke, n);
    const mrd_real wheel = vehicle_has_wheel(c) ? in->wheel_acceleration - vehicle_expected(s, c->wheel, n) : R(0.0);
    for (int32_t i = 0; i < n; i++) {
        s->z[i] += c->gain[2 * i] * stroke;
        if (vehicle_has_wheel(c)) s->z[i] += c->gain[(2 * i) + 1] * wheel;
    }
}

MRD_VEHICLE_API void mrd_vehicle_step(const mrd_vehicle *c, mrd_vehicle_state *s, const mrd_vehicle_inputs *in,
                                      mrd_vehicle_outputs *out)
{
    int32_t flags = 0;
    if (!vehicle_is_sane(s)) {
        mrd_vehicle_start(s);
        flags = MRD_VEHICLE_FAULT;
    }
    const bool body = vehicle_within(in->body_acceleration, vehicle_fastest);
    const bool stroke = vehicle_within(in->stroke, vehicle_longest);
    const bool wheel = !vehicle_has_wheel(c) || vehicle_within(in->wheel_acceleration, vehicle_fastest);
    if (!body) flags |= MRD_VEHICLE_NO_BODY;
    if (!stroke) flags |= MRD_VEHICLE_NO_STROKE;
    if (!wheel) flags |= MRD_VEHICLE_NO_WHEEL;
    const bool known = body && stroke && wheel;
    if (known) {
        s->missing = 0;
    } else if (s->missing <= c->coast_samples) {
        s->missing++;
    }
    if (s->missing > c->coast_samples) mrd_vehicle_start(s);
    if (s->started != 0) {
        vehicle_predict(c, s, body ? in->body_acceleration : s->body_acceleration);
        if (known) vehicle_correct(c, s, in);
    } else if (known) {
        s->started = 1;
        s->z[0] = in->stroke;
        s->body_acceleration = in->body_acceleration;
    } else {
        flags |= MRD_VEHICLE_UNKNOWN;
    }
    s->flags = flags;
    const mrd_real pushed = -(c->body * (s->body_acceleration - s->z[4])) - (c->spring * s->z[0]);
    mrd_vehicle_demand(c, s->z, R(0.0), pushed, out);
}

#undef R
