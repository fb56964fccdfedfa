/* Interface of a controller with doubles, for a kernel step in double or single precision.
 *
 * tracker_face.c implements it for each precision, because mrd_real differs.
 */
#ifndef MRD_TRACKER_H
#define MRD_TRACKER_H

#include <stddef.h>
#include <stdint.h>

#define TRACK_LOOKUPS 9
#define TRACK_TABLES (3 + TRACK_LOOKUPS) /* currents, factors, columns, and the cells of every function */
#define TRACK_READ 12                    /* values of `read` */
#define SERIES_POWERS 4                  /* powers of series valve and chain: thinning, leak, viscous, gas */
#define SERIES_LOOKUPS 2                 /* ... side, fade */
#define SERIES_TABLES (2 + 2 * SERIES_POWERS + SERIES_LOOKUPS) /* yield, chain, scale and cells of each power, cells */

/* Every value of a configuration: part, name, type. */
#define MRD_CONFIG_VALUES(X) \
    X(axes, period, mrd_real) X(axes, largest, mrd_real) X(axes, coldest, mrd_real) X(axes, warmest, mrd_real) \
    X(law, series, bool) X(law, chain, bool) X(law, elements, int32_t) X(law, saturating, bool) \
    X(law, unloaded, mrd_real) X(law, substeps, int32_t) \
    X(gains, yield_force, mrd_real) X(gains, viscous_force, mrd_real) X(gains, friction_force, mrd_real) \
    X(motion, gain_x, mrd_real) X(motion, gain_v, mrd_real) X(motion, gain_a, mrd_real) X(motion, holds_readings, bool) \
    X(motion, frequency_filter_gain, mrd_real) X(motion, settle_samples, int32_t) X(motion, omega_squared_max, mrd_real) \
    X(motion, velocity_noise_variance, mrd_real) X(motion, acceleration_noise_variance, mrd_real) \
    X(reference, gain_f, mrd_real) X(reference, gain_rate, mrd_real) X(reference, gain_second_derivative, mrd_real) \
    X(actuation, dead_samples, int32_t) X(actuation, dead_part, mrd_real) X(actuation, rise, mrd_real) \
    X(actuation, fall, mrd_real) X(actuation, second, mrd_real) X(actuation, rise_couple, mrd_real) \
    X(actuation, fall_couple, mrd_real) X(actuation, second_ramp, mrd_real) X(actuation, freewheel_ratio, mrd_real) \
    X(actuation, inverse_saturation_flux, mrd_real) X(actuation, second_ahead, mrd_real) X(actuation, rise_couple_ahead, mrd_real) \
    X(actuation, fall_couple_ahead, mrd_real) X(actuation, second_ramp_ahead, mrd_real) \
    X(actuation, freewheel_ratio_ahead, mrd_real) X(actuation, rise_answer, mrd_real) X(actuation, fall_answer, mrd_real) \
    X(actuation, hysteresis_width, mrd_real) X(actuation, hysteresis_weight, mrd_real) X(actuation, wide_hysteresis_width, mrd_real) \
    X(actuation, wide_hysteresis_weight, mrd_real) \
    X(inverse, method, mrd_inverse_method) X(inverse, bank, bool) X(inverse, preview, mrd_real) \
    X(inverse, compensation, mrd_real) X(inverse, margin, mrd_real) \
    X(prediction, steps, int32_t) X(prediction, samples, int32_t) X(prediction, together, int32_t) \
    X(prediction, step, mrd_real) X(prediction, stretch, int32_t) X(prediction, dead, mrd_real) \
    X(prediction, fade, mrd_real) X(prediction, calm, mrd_real) X(prediction, rise, mrd_real) \
    X(prediction, fall, mrd_real) X(prediction, second, mrd_real) X(prediction, rise_couple, mrd_real) \
    X(prediction, fall_couple, mrd_real) X(prediction, second_ramp, mrd_real) X(prediction, freewheel_ratio, mrd_real) \
    X(feedback, kind, mrd_feedback_kind) X(feedback, gain, mrd_real) X(feedback, rate, mrd_real) \
    X(feedback, full_speed, mrd_real) X(feedback, observe, mrd_real) \
    X(envelope, displacement_min, mrd_real) X(envelope, displacement_max, mrd_real) X(envelope, speed_max, mrd_real) \
    X(faults, displacement_limit, mrd_real) X(faults, speed_limit, mrd_real) X(faults, frozen_samples, int32_t) \
    X(faults, frozen_speed_min, mrd_real) X(faults, coast_samples, int32_t) X(faults, recovery_samples, int32_t) \
    X(faults, fall_back, mrd_real) \
    X(thermometer, cold_limit, mrd_real) X(thermometer, hot_limit, mrd_real) X(thermometer, jump, mrd_real) \
    X(thermometer, change_max, mrd_real) X(thermometer, filter_decay, mrd_real) X(thermometer, hold_samples, int32_t) \
    X(thermometer, recover_samples, int32_t) X(thermometer, nominal, mrd_real) X(thermometer, fixed, mrd_real) \
    X(heating, heat_capacity, mrd_real) X(heating, loss_conductance, mrd_real) X(heating, loss_ratio_max, mrd_real) \
    X(heating, ambient, mrd_real) X(heating, coil_heat, mrd_real) X(heating, frozen_rise_max, mrd_real) \
    X(heating, extrapolate, bool)

/* Configuration and tables of a controller. */
typedef struct {
    const double *config; /* values of MRD_CONFIG_VALUES */
    int32_t currents, columns, pieces, terms;
    const uint8_t *row; /* of each term, levels first */
    const double *table[TRACK_TABLES];
    size_t length[TRACK_TABLES];
    double offset[TRACK_LOOKUPS], top[TRACK_LOOKUPS];
    int32_t bits[TRACK_LOOKUPS];
    int32_t series; /* 1: the following members are used */
    int32_t series_currents, series_sheets; /* currents of the yield force; temperatures */
    int32_t series_planes, series_rows;     /* coefficients that depend on the current; other coefficients */
    const double *series_table[SERIES_TABLES];
    size_t series_length[SERIES_TABLES];
    double exponent[SERIES_POWERS], least[SERIES_POWERS], power_top[SERIES_POWERS];
    int32_t power_bits[SERIES_POWERS];
    double series_offset[SERIES_LOOKUPS], series_top[SERIES_LOOKUPS];
    int32_t series_bits[SERIES_LOOKUPS];
} tracker_parts;

typedef struct {
    size_t track_size, state_size, real_size;
    /* Fill a controller from its parts, rounded. `store` has space for all tables. Return 0 if a value is out of
     * range. */
    int (*load)(void *track, void *store, const tracker_parts *parts);
    int (*is_sound)(const void *state); /* bytes may come from anywhere */
    void (*start)(const void *track, void *state);
    double (*step)(const void *track, void *state, const double *inputs);    /* of mrd_inputs */
    double (*model)(const void *track, void *state, const double *driven); /* of mrd_model_inputs */
    int32_t (*flags)(const void *state);
    /* motion (3), applied, command, temperature, disturbance, parts (4), energy account [K] */
    void (*read)(const void *track, const void *state, double *out);
} tracker_face;

const tracker_face *mrd_tracker_single(void);

#endif
