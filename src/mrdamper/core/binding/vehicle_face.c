/* The observer and demand in one precision behind doubles; included once per precision, behind the kernel's vehicle.c.
 * Numbers and readings are rounded on the way in. */
#include "vehicle_face.h"

typedef struct {
    mrd_vehicle vehicle;
    mrd_real number[VEHICLE_NUMBERS(VEHICLE_READ)];
} vehicle_room;

static void vehicle_load(void *into, const vehicle_parts *parts)
{
    vehicle_room *room = into;
    mrd_vehicle *c = &room->vehicle;
    const mrd_real *at = room->number;
    const int n = parts->wheel_accelerometer ? 6 : 5;
    for (int k = 0; k < VEHICLE_NUMBERS(n); k++) room->number[k] = (mrd_real)parts->number[k];
    c->wheel_accelerometer = parts->wheel_accelerometer != 0;
    c->acceleration_driven = parts->acceleration_driven != 0;
    c->coast_samples = parts->coast_samples;
    c->body = at[0];
    c->spring = at[1];
    c->by_rattle = at[2];
    c->by_body = at[3];
    c->by_tyre = at[4];
    c->by_wheel = at[5];
    c->predict = at + 6;
    c->before = c->predict + n * n;
    c->present = c->before + n;
    c->stroke = c->present + n;
    c->wheel = c->stroke + n + 1;
    c->gain = c->wheel + n + 1;
    c->ahead = c->gain + 2 * n;
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

static const vehicle_face vehicle_of_precision = {sizeof(vehicle_room), sizeof(mrd_vehicle_state), vehicle_load,
                                                  vehicle_face_start, vehicle_face_step, vehicle_face_demand,
                                                  vehicle_face_flags, vehicle_face_read};
