/* The observer and demand in one precision behind doubles; included once per precision, behind the kernel's vehicle.c.
 * Numbers and readings are rounded on the way in. */
#include "vehicle_face.h"

static const double *vehicle_take(mrd_real *to, const double *from, int count)
{
    for (int k = 0; k < count; k++) to[k] = (mrd_real)from[k];
    return from + count;
}

static void vehicle_load(void *into, const vehicle_parts *parts)
{
    mrd_vehicle *c = into;
    const double *at = parts->number;
    const int n = parts->wheel_accelerometer ? 6 : 5;
    c->wheel_accelerometer = parts->wheel_accelerometer != 0;
    c->acceleration_driven = parts->acceleration_driven != 0;
    c->coast_samples = parts->coast_samples;
    at = vehicle_take(&c->body, at, 1);
    at = vehicle_take(&c->spring, at, 1);
    at = vehicle_take(&c->by_rattle, at, 1);
    at = vehicle_take(&c->by_body, at, 1);
    at = vehicle_take(&c->by_tyre, at, 1);
    at = vehicle_take(&c->by_wheel, at, 1);
    at = vehicle_take(c->predict, at, n * n);
    at = vehicle_take(c->before, at, n);
    at = vehicle_take(c->present, at, n);
    at = vehicle_take(c->stroke, at, n + 1);
    at = vehicle_take(c->wheel, at, n + 1);
    at = vehicle_take(c->gain, at, 2 * n);
    (void)vehicle_take(c->ahead, at, 16);
}

static void vehicle_face_start(void *state) { mrd_vehicle_start(state); }

static void vehicle_face_step(const void *vehicle, void *state, const double *inputs, double *outputs)
{
    const mrd_vehicle_inputs in = {(mrd_real)inputs[0], (mrd_real)inputs[1], (mrd_real)inputs[2]};
    mrd_vehicle_outputs out;
    mrd_vehicle_step(vehicle, state, &in, &out);
    outputs[0] = (double)out.wanted;
    outputs[1] = (double)out.wanted_ahead;
}

static void vehicle_face_demand(const void *vehicle, const double *z, double off, double pushed, double *outputs)
{
    const mrd_real at[4] = {(mrd_real)z[0], (mrd_real)z[1], (mrd_real)z[2], (mrd_real)z[3]};
    mrd_vehicle_outputs out;
    mrd_vehicle_demand(vehicle, at, (mrd_real)off, (mrd_real)pushed, &out);
    outputs[0] = (double)out.wanted;
    outputs[1] = (double)out.wanted_ahead;
}

static int32_t vehicle_face_flags(const void *state) { return ((const mrd_vehicle_state *)state)->flags; }

static void vehicle_face_read(const void *state, double *out)
{
    for (int k = 0; k < VEHICLE_READ; k++) out[k] = (double)((const mrd_vehicle_state *)state)->z[k];
}

static const vehicle_face vehicle_of_precision = {sizeof(mrd_vehicle), sizeof(mrd_vehicle_state), vehicle_load,
                                                  vehicle_face_start, vehicle_face_step, vehicle_face_demand,
                                                  vehicle_face_flags, vehicle_face_read};
