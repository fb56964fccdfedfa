/* The configuration of a controller, by parts; members of mrd_track in controller.h.
 *
 * control/config.py has the same parts and values in Python. SI and kelvin; "A" is the unit of the command, which
 * is volts if the card has volts.
 */
#ifndef MRD_CONTROLLER_CONFIG_H
#define MRD_CONTROLLER_CONFIG_H

/* Compile-time options: 0 removes the code of a law, or of the prediction. The configuration must then not use it. */
#ifndef MRD_WITH_SERIES
#define MRD_WITH_SERIES 1 /* series valve law */
#endif
#ifndef MRD_WITH_CHAIN
#define MRD_WITH_CHAIN 1 /* chain law */
#endif
#ifndef MRD_WITH_PREDICTION
#define MRD_WITH_PREDICTION 1 /* command by prediction */
#endif

/* Source of the command. */
typedef enum {
    MRD_INVERSE_NONE = 0,      /* feedback only */
    MRD_INVERSE_BANK = 1,      /* inverse of a bank of models at constant currents at the present instant */
    MRD_INVERSE_PREDICTIVE = 2 /* moves of the command over the horizon in which it acts */
} mrd_inverse_method;

/* Feedback law of a measured force. */
typedef enum {
    MRD_FEEDBACK_NONE = 0,
    MRD_FEEDBACK_PI = 1,
    MRD_FEEDBACK_ON_OFF = 2 /* the largest command or zero, by the sign of the force error */
} mrd_feedback_kind;

/* Sampling period and range of the tables. */
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
    int32_t substeps; /* series valve and chain: steps of the law in a period */
} mrd_config_law;

/* Factors of the parts of the force: 1 as identified, others for an aged or similar damper. */
typedef struct {
    mrd_real yield_force; /* of the yield force [-] */
    mrd_real viscous_force; /* of the viscous force [-] */
    mrd_real friction_force; /* of the friction force [-] */
} mrd_config_gains;

/* Filter that estimates the motion from the displacement. */
typedef struct {
    mrd_real gain_x; /* gain of the displacement [-] */
    mrd_real gain_v; /* gain of the velocity [1/s] */
    mrd_real gain_a; /* gain of the acceleration [1/s2] */
    bool holds_readings; /* a reading is held for several periods, so a repeated reading is ignored */
    mrd_real frequency_filter_gain; /* weight of a period in the means of v^2 and a^2; 0: constant acceleration [-] */
    int32_t settle_samples; /* periods until the filter has settled */
    mrd_real omega_squared_max; /* maximum of mean a^2 divided by mean v^2 [1/s2] */
    mrd_real velocity_noise_variance; /* variance of v caused by sensor noise [m2/s2] */
    mrd_real acceleration_noise_variance; /* variance of a caused by sensor noise [m2/s4] */
} mrd_config_motion;

/* Filter that extrapolates a wanted force that is not known ahead. */
typedef struct {
    mrd_real gain_f; /* gain of the force [-] */
    mrd_real gain_rate; /* gain of its rate [1/s] */
    mrd_real gain_second_derivative; /* gain of its second derivative [1/s2] */
} mrd_config_reference;

/* Dead time, two lags and magnetic hysteresis between command and force. */
typedef struct {
    int32_t dead_samples; /* whole periods of the dead time */
    mrd_real dead_part; /* remaining fraction of a period of the dead time [-] */
    mrd_real rise; /* remaining fraction of the gap of the first lag after a period, command above the lag [-] */
    mrd_real fall; /* the same, command below the lag [-] */
    mrd_real second; /* remaining fraction of the gap of the second lag after a period [-] */
    mrd_real rise_couple; /* fraction of the first gap that is in the second after a period, command above [-] */
    mrd_real fall_couple; /* the same, command below [-] */
    mrd_real second_ramp; /* fraction of a ramp of the first lag by which the second is late [-] */
    mrd_real freewheel_ratio; /* period divided by the free-wheeling time constant; 0: no free-wheeling [-] */
    mrd_real inverse_saturation_flux; /* b in the flux I / (1 + b I) [1/A] */
    mrd_real hysteresis_width; /* half width of the magnetic hysteresis behind the lags [A] */
    mrd_real hysteresis_weight; /* weight of the field that has this hysteresis, below 1 [-] */
    mrd_real wide_hysteresis_width; /* half width of a second, wider hysteresis; 0: none [A] */
    mrd_real wide_hysteresis_weight; /* weight of the field that has the wider hysteresis [-] */
} mrd_config_actuation;

/* Method by which the command for a wanted force is found. */
typedef struct {
    mrd_inverse_method method; /* source of the command */
    mrd_real preview; /* the wanted force is known this time ahead; 0 for a bank [s] */
} mrd_config_inverse;

/* Horizon over which the law is stepped, and the moves of the command in it. */
typedef struct {
    int32_t steps; /* steps of the horizon behind the dead time */
    int32_t samples; /* periods over which a prediction is spread; its command is given in the last */
    int32_t together; /* periods of the dead time that are one step of the law */
    mrd_real step; /* length of a step of the horizon [s] */
    int32_t stretch; /* factor of the length from the fourth step on */
    mrd_real dead; /* time from now to the start of the horizon [s] */
    mrd_real fade; /* weight of the error of a step divided by the weight of the step before [-] */
    mrd_real settled; /* fraction of the unfinished hysteresis that is assumed to be complete [-] */
    mrd_real calm; /* force error that is worth a move of the command by one ampere [N/A] */
    mrd_real rise; /* remaining fraction of the gap of the first lag after a step, command above the lag [-] */
    mrd_real fall; /* the same, command below the lag [-] */
    mrd_real second; /* remaining fraction of the gap of the second lag after a step [-] */
    mrd_real rise_couple; /* fraction of the first gap that is in the second after a step, command above [-] */
    mrd_real fall_couple; /* the same, command below [-] */
    mrd_real second_ramp; /* fraction of a ramp of the first lag by which the second is late [-] */
    mrd_real freewheel_ratio; /* step divided by the free-wheeling time constant; 0: no free-wheeling [-] */
} mrd_config_prediction;

/* Use of a measured force. */
typedef struct {
    mrd_feedback_kind kind; /* feedback law */
    mrd_real gain; /* gain of the force error [A/N] */
    mrd_real rate; /* gain of the integral of the force error [A/(N s)] */
    mrd_real full_speed; /* speed above which the feedback has its full gain [m/s] */
    mrd_real observe; /* weight of the force error in the disturbance observer in a period; 0: disabled [-] */
} mrd_config_feedback;

/* Range of the data; a flag is raised outside it. */
typedef struct {
    mrd_real displacement_min; /* lowest displacement [m] */
    mrd_real displacement_max; /* highest displacement [m] */
    mrd_real speed_max; /* highest speed [m/s] */
} mrd_config_envelope;

/* Limits beyond which a displacement or a velocity is a fault. */
typedef struct {
    mrd_real displacement_limit; /* maximum size of a displacement [m] */
    mrd_real speed_limit; /* maximum size of a velocity [m/s] */
    int32_t frozen_samples; /* number of equal readings that are a fault */
    mrd_real frozen_speed_min; /* minimum speed before equal readings are a fault [m/s] */
    int32_t coast_samples; /* samples without displacement before the fall-back */
    int32_t recovery_samples; /* samples with displacement before the fall-back ends */
    mrd_real fall_back; /* command while the motion is unknown [A] */
} mrd_config_faults;

/* Limits beyond which a temperature is a fault. */
typedef struct {
    mrd_real cold_limit; /* minimum of a reading [K] */
    mrd_real hot_limit; /* maximum of a reading [K] */
    mrd_real jump; /* maximum difference between a reading and the estimate [K] */
    mrd_real change_max; /* maximum change of the estimate in a period [K] */
    mrd_real filter_decay; /* remaining fraction of the gap between estimate and reading after a period [-] */
    int32_t hold_samples; /* samples for which the estimate is used without a valid reading */
    int32_t recover_samples; /* steady samples after which a reading that has jumped is accepted */
    mrd_real nominal; /* temperature used when none is known [K] */
    mrd_real fixed; /* temperature used instead of readings; 0: readings are used [K] */
} mrd_config_thermometer;

/* The damper as one body; detects a frozen thermometer. */
typedef struct {
    mrd_real heat_capacity; /* heat capacity; 0: a frozen thermometer is not detected [J/K] */
    mrd_real loss_conductance; /* loss to the surroundings [W/K] */
    mrd_real loss_ratio_max; /* upper limit of the loss as a multiple of it [-] */
    mrd_real ambient; /* temperature of the surroundings [K] */
    mrd_real coil_heat; /* heat of the coil divided by the square of the applied current [W/A2] */
    mrd_real frozen_rise_max; /* expected warming at a constant reading that is a fault [K] */
    bool extrapolate; /* a frozen temperature is extrapolated by the energy put in; otherwise only flagged */
} mrd_config_heating;

#endif
