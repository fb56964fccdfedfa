/* A car's observer and demand behind doubles, in double or in single precision; see tracker.h. */
#ifndef MRD_VEHICLE_FACE_H
#define MRD_VEHICLE_FACE_H

#include <stddef.h>
#include <stdint.h>

/* Numbers of mrd_vehicle of n states, in the order of its members. */
#define VEHICLE_NUMBERS(n) (6 + (n) * (n) + 2 * (n) + 2 * ((n) + 1) + 2 * (n) + 16)
#define VEHICLE_INPUTS 3
#define VEHICLE_OUTPUTS 2
#define VEHICLE_READ 6

typedef struct {
    int wheel_accelerometer, acceleration_driven, coast_samples;
    double number[VEHICLE_NUMBERS(VEHICLE_READ)];
} vehicle_parts;

typedef struct {
    size_t vehicle_size, state_size;
    void (*load)(void *vehicle, const vehicle_parts *parts);
    void (*start)(void *state);
    void (*step)(const void *vehicle, void *state, const double *inputs, double *outputs);
    void (*demand)(const void *vehicle, const double *z, double off, double pushed, double *outputs);
    int32_t (*flags)(const void *state);
    void (*read)(const void *state, double *out);
} vehicle_face;

const vehicle_face *mrd_vehicle_single(void);

#endif
