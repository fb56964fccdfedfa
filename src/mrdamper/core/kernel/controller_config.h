/* The configuration of a controller. Each struct is a member of mrd_track in controller.h.
 *
 * control/config.py has the same structs and values in Python. Units are SI and kelvin. "A" is the unit of the command;
 * if the command of the card is a voltage, the unit is "V" instead.
 */
#ifndef MRD_CONTROLLER_CONFIG_H
#define MRD_CONTROLLER_CONFIG_H

/* Compile-time options: 0 removes the code of a law or of the prediction, which the configuration must then not use. */
#ifndef MRD_WITH_SERIES
#define MRD_WITH_SERIES 1 /* series valve law */
#endif
#ifndef MRD_WITH_CHAIN
#define MRD_WITH_CHAIN 1 /* chain law */
#endif
#ifndef MRD_WITH_PREDICTION
#define MRD_WITH_PREDICTION 1 /* model-predictive controller */
#endif

/* Method that computes the command from the wanted force. */
typedef enum {
    MRD_INVERSE_NONE = 0,      /* the command is computed only by feedback */
    MRD_INVERSE_BANK = 1,      /* interpolation between five models at constant currents, without preview */
    MRD_INVERSE_PREDICTIVE = 2 /* model-predictive: several command changes in a prediction horizon */
} mrd_inverse_method;

/* Feedback law of a measured force. */
typedef enum {
    MRD_FEEDBACK_NONE = 0,
    MRD_FEEDBACK_PI = 1,
    MRD_FEEDBACK_ON_OFF = 2 /* the largest command or zero, by the sign of the force error */
} mrd_feedback_kind;

/* Sampling period, and the ranges of current and temperature in the tables. */
typedef struct {
    mrd_real period; /* sampling period [s] */
    mrd_real largest; /* current of the last column of the tables; the first column is 0 [A] */
    mrd_real coldest; /* lowest temperature of the tables [K] */
    mrd_real warmest; /* highest temperature of the tables [K] */
} mrd_config_axes;

/* The hysteresis model of the damper. */
typedef struct {
    bool series; /* series valve law */
    bool chain; /* chain law */
    int32_t elements; /* hysteretic elements: 0 (the force follows the sign of the velocity), 1 or 2 */
    bool saturating; /* the second yield force saturates with speed and uses the first element */
    mrd_real unloaded; /* travel of the universal curve from w = -1 to 0 [-] */
    int32_t substeps; /* series valve and chain: integration steps in a period */
} mrd_config_law;

/* Factors on the parts of the force: 1 for the identified damper, other values for an aged or similar damper. */
typedef struct {
    mrd_real yield_force; /* factor on the yield force [-] */
    mrd_real viscous_force; /* factor on the viscous force [-] */
    mrd_real friction_force; /* factor on the friction force [-] */
} mrd_config_gains;

/* Filter that estimates the motion from the displacement. In each period, the filter predicts displacement x, velocity v
 * and acceleration a. It then corrects each of them by a gain times the displacement error (measured minus predicted). */
typedef struct {
    mrd_real gain_x; /* correction of the displacement / displacement error [-] */
    mrd_real gain_v; /* correction of the velocity / displacement error [1/s] */
    mrd_real gain_a; /* correction of the acceleration / displacement error [1/s2] */
    bool holds_readings; /* the sensor repeats each reading for several periods; repetitions are ignored */
    mrd_real frequency_filter_gain; /* weight of a sample in the means of v^2 and a^2; 0: constant acceleration [-] */
    int32_t settle_samples; /* number of periods until the filter has settled */
    mrd_real omega_squared_max; /* maximum of mean a^2 divided by mean v^2 [1/s2] */
    mrd_real velocity_noise_variance; /* variance of v caused by sensor noise [m2/s2] */
    mrd_real acceleration_noise_variance; /* variance of a caused by sensor noise [m2/s4] */
} mrd_config_motion;

/* Filter that extrapolates the wanted force if the future wanted force is unknown. In each period, the filter predicts the
 * wanted force and its derivatives. It then corrects each of them by a gain times the force error (wanted minus predicted). */
typedef struct {
    mrd_real gain_f; /* correction of the force / force error [-] */
    mrd_real gain_rate; /* correction of the rate of the force / force error [1/s] */
    mrd_real gain_second_derivative; /* correction of the second derivative of the force / force error [1/s2] */
} mrd_config_reference;

/* Two first-order lags between command and flux, for a time interval: a period or a step of the horizon. The output of
 * the first lag is the input of the second lag. The gap of a lag is its input minus its output. */
typedef struct {
    mrd_real rise; /* fraction of the gap of the first lag that remains after the interval, current rising [-] */
    mrd_real fall; /* like `rise`, current falling [-] */
    mrd_real second; /* fraction of the gap of the second lag that remains after the interval [-] */
    mrd_real rise_couple; /* fraction of the first gap that the interval adds to the second gap, current rising [-] */
    mrd_real fall_couple; /* like `rise_couple`, current falling [-] */
    mrd_real second_ramp; /* second gap at the end of a ramp of the first lag / change in the ramp [-] */
    mrd_real freewheel_ratio; /* interval / free-wheeling time constant; 0: no free-wheeling [-] */
} mrd_lags;

/* Dead time, lags and magnetic hysteresis between command and force. */
typedef struct {
    int32_t dead_samples; /* whole periods of the dead time */
    mrd_real dead_part; /* rest of the dead time, as a fraction of a period [-] */
    mrd_lags lags; /* both lags in a period */
    mrd_real inverse_saturation_flux; /* b in the flux I / (1 + b I) [1/A] */
    mrd_real hysteresis_width; /* half width of the magnetic hysteresis after the lags [A] */
    mrd_real hysteresis_weight; /* fraction of the field with this hysteresis, below 1 [-] */
    mrd_real wide_hysteresis_width; /* half width of a second, wider hysteresis; 0: disabled [A] */
    mrd_real wide_hysteresis_weight; /* fraction of the field with the wide hysteresis [-] */
} mrd_config_actuation;

/* Method that computes the command from the wanted force, and preview of the wanted force. */
typedef struct {
    mrd_inverse_method method; /* method that computes the command */
    mrd_real preview; /* time from now to the future wanted force that is an input; 0 for a bank [s] */
} mrd_config_inverse;

/* Prediction horizon of the model-predictive controller, and costs of its command changes (moves). A step is a time
 * step of the horizon. */
typedef struct {
    int32_t steps; /* number of steps of the horizon, which starts after the dead time */
    int32_t samples; /* number of periods that share the computation of one prediction */
    int32_t together; /* number of periods in one integration step of the law during the dead time */
    mrd_real step; /* length of a step [s] */
    int32_t stretch; /* factor on the step length from the fourth step on */
    mrd_real dead; /* time from now to the start of the horizon [s] */
    mrd_real fade; /* error weight of a step divided by the error weight of the previous step [-] */
    mrd_real settled; /* fraction of the remaining build-up of hysteresis that is assumed to be complete [-] */
    mrd_real calm; /* cost of a command change of one ampere, expressed as a force error [N/A] */
    mrd_lags lags; /* both lags in a step */
} mrd_config_prediction;

/* Feedback of a measured force: feedback law, gains and disturbance observer. */
typedef struct {
    mrd_feedback_kind kind; /* feedback law */
    mrd_real gain; /* gain of the force error [A/N] */
    mrd_real rate; /* gain of the integral of the force error [A/(N s)] */
    mrd_real full_speed; /* speed above which the full gain is used; the gain is smaller at lower speeds [m/s] */
    mrd_real observe; /* weight of the force error in each update of the disturbance observer; 0: disabled [-] */
} mrd_config_feedback;

/* Range of the data to which the card was fitted. The controller sets a flag outside this range. */
typedef struct {
    mrd_real displacement_min; /* lowest displacement [m] */
    mrd_real displacement_max; /* highest displacement [m] */
    mrd_real speed_max; /* highest speed [m/s] */
} mrd_config_envelope;

/* Limits beyond which a displacement or a velocity is a fault. */
typedef struct {
    mrd_real displacement_limit; /* maximum absolute displacement [m] */
    mrd_real speed_limit; /* maximum absolute velocity [m/s] */
    int32_t frozen_samples; /* this number of equal consecutive readings is a fault */
    mrd_real frozen_speed_min; /* equal readings are a fault only if the previous speed was higher [m/s] */
    int32_t coast_samples; /* samples without displacement until the fall-back command is used */
    int32_t recovery_samples; /* samples with displacement until the fall-back ends */
    mrd_real fall_back; /* command that is used while the motion is unknown [A] */
} mrd_config_faults;

/* Limits beyond which a temperature is a fault. */
typedef struct {
    mrd_real cold_limit; /* minimum of a reading [K] */
    mrd_real hot_limit; /* maximum of a reading [K] */
    mrd_real jump; /* maximum difference between a reading and the estimate [K] */
    mrd_real change_max; /* maximum change of the estimate in a period [K] */
    mrd_real filter_decay; /* fraction of the gap between estimate and reading that remains after a period [-] */
    int32_t hold_samples; /* samples for which the estimate is used without a valid reading */
    int32_t recover_samples; /* steady samples after which a reading that has jumped is accepted */
    mrd_real nominal; /* temperature that is used when there is neither a valid reading nor an estimate [K] */
    mrd_real fixed; /* temperature used instead of readings; 0: readings are used [K] */
} mrd_config_thermometer;

/* Heat balance of the damper as one body, which detects a frozen thermometer (constant reading). */
typedef struct {
    mrd_real heat_capacity; /* heat capacity; 0: a frozen thermometer is not detected [J/K] */
    mrd_real loss_conductance; /* thermal conductance to the surroundings [W/K] */
    mrd_real loss_ratio_max; /* upper limit of the loss as a multiple of `loss_conductance` [-] */
    mrd_real ambient; /* temperature of the surroundings [K] */
    mrd_real coil_heat; /* heat of the coil divided by the square of the applied current [W/A2] */
    mrd_real frozen_rise_max; /* a constant reading is a fault if the expected warming is larger [K] */
    bool extrapolate; /* true: estimate the temperature from the supplied energy while the sensor is frozen */
} mrd_config_heating;

#endif
