/* The configuration of a controller, by parts, and the modes that it may be compiled with.
 *
 * Written from control/config.py (`python -m mrdamper.control.config`); not meant to be edited. Values are
 * in SI and kelvin; "A" is the unit of the command, volts where the card's is.
 */
#ifndef MRD_CONTROLLER_CONFIG_H
#define MRD_CONTROLLER_CONFIG_H

typedef enum mrd_inverse_method { MRD_INVERSE_METHOD_NONE = 0, MRD_INVERSE_METHOD_MODEL = 1, MRD_INVERSE_METHOD_STATIC = 2, MRD_INVERSE_METHOD_PREDICTIVE = 3 } mrd_inverse_method;

typedef enum mrd_feedback_kind { MRD_FEEDBACK_KIND_NONE = 0, MRD_FEEDBACK_KIND_PI = 1, MRD_FEEDBACK_KIND_ON_OFF = 2 } mrd_feedback_kind;

/* Sampling, and the range of the tables. */
typedef struct {
    mrd_real period; /* sampling period [s] */
    mrd_real largest; /* current of the tables' last column; the first is 0 [A] */
    mrd_real coldest; /* lowest temperature of the tables [K] */
    mrd_real warmest; /* highest temperature of the tables [K] */
} mrd_config_axes;

/* The damper's law. */
typedef struct {
    bool series; /* the series valve law */
    bool chain; /* the chain law */
    int32_t elements; /* hysteretic elements: 0 (force follows the sign of velocity), 1, 2 */
    bool saturating; /* the second yield force saturates with speed, on the first element */
    bool shared_rho; /* rho is the same at all currents: a bank's models share one state */
    mrd_real unloaded; /* travel of the universal curve from w = -1 to 0 [-] */
    int32_t substeps; /* series valve and chain: steps in a period */
    int32_t strides; /* series valve: steps to the preview */
    mrd_real horizon; /* series valve: time in which its spring is taken to the wanted force [s] */
} mrd_config_law;

/* Gains of the filter that estimates the motion from the displacement. */
typedef struct {
    mrd_real gain_x; /* of the displacement [-] */
    mrd_real gain_v; /* of the velocity [1/s] */
    mrd_real gain_a; /* of the acceleration [1/s2] */
    bool held; /* readings are held for several periods: one that repeats is none */
    mrd_real swing_share; /* of a period in the means that tell how it swings; 0: none [-] */
    int32_t settle_samples; /* periods in which the filter finds the motion */
    mrd_real most_swing; /* largest ratio of mean a^2 and mean v^2 [1/s2] */
    mrd_real speed_noise; /* what the sensor's noise leaves in v^2 [m2/s2] */
    mrd_real bend_noise; /* ... and in a^2 [m2/s4] */
} mrd_config_motion;

/* Gains of the filter that extrapolates a wanted force which is not known ahead. */
typedef struct {
    mrd_real gain_f; /* of the force [-] */
    mrd_real gain_rate; /* of its rate [1/s] */
    mrd_real gain_bend; /* of its second derivative [1/s2] */
} mrd_config_reference;

/* Dead time, two lags and magnetic play between command and force. */
typedef struct {
    bool no_lag; /* hysteresis is advanced with the command as if there were no lags */
    int32_t dead_samples; /* dead time: whole periods */
    mrd_real dead_part; /* ... and the part of one [-] */
    mrd_real rise; /* what a period leaves of the first lag's gap, command above it [-] */
    mrd_real fall; /* ... and below it [-] */
    mrd_real second; /* what a period leaves of the second lag's gap [-] */
    mrd_real rise_couple; /* share of the first gap that is in the second after a period [-] */
    mrd_real fall_couple; /* ... command below it [-] */
    mrd_real second_ramp; /* share of a ramp of the first lag that the second is late [-] */
    mrd_real wheel; /* period over the free-wheeling current's time; 0: driver pulls down [-] */
    mrd_real bend; /* flux is I / (1 + bend I) [1/A] */
    mrd_real second_ahead; /* the same from the last sample of the dead time to the preview [-] */
    mrd_real rise_couple_ahead; /* ... command above the first lag [-] */
    mrd_real fall_couple_ahead; /* ... and below it [-] */
    mrd_real second_ramp_ahead; /* ... of a ramp [-] */
    mrd_real wheel_ahead; /* ... that time over the free-wheeling current's [-] */
    mrd_real rise_answer; /* share of a command given now that has passed at the preview [-] */
    mrd_real fall_answer; /* ... command below the first lag [-] */
    mrd_real play; /* half width of the magnetic play behind the lags [A] */
    mrd_real play_share; /* share of the field that has it, below 1 [-] */
    mrd_real wide_play; /* half width of a second, wider play; 0: there is one alone [A] */
    mrd_real wide_share; /* share of the field that has it [-] */
} mrd_config_actuation;

/* How the command for a wanted force is found. */
typedef struct {
    mrd_inverse_method method; /* from what the command is found */
    int32_t models; /* 1: at the applied current; a bank of so many at constant currents */
    mrd_real preview; /* the force is set for so much later [s] */
    mrd_real compensation; /* share of the lags' remaining gap that the command makes up for [-] */
    mrd_real margin; /* reversal clamp: most above the static answer; any negative value: none [A] */
    mrd_real lead; /* lead compensation: gain of the filtered derivative; 0: none [-] */
    mrd_real lead_keep; /* ... what a period leaves of its filter's gap [-] */
} mrd_config_inverse;

/* The horizon over which the law is stepped, and how the command is moved there. */
typedef struct {
    int32_t steps; /* steps of the horizon, behind the dead time */
    int32_t samples; /* periods that a prediction is spread over; its command comes in the last */
    int32_t together; /* periods of the dead time that are one step of the law */
    mrd_real step; /* length of a step of the horizon [s] */
    int32_t stretch; /* ... times this from the fourth on */
    mrd_real dead; /* time from now to the begin of the horizon [s] */
    mrd_real fade; /* weight of a step's error over that of the step before [-] */
    mrd_real calm; /* force error that is worth a move of the command [N/A] */
    mrd_real rise; /* what a step leaves of the first lag's gap, command above it [-] */
    mrd_real fall; /* ... and below it [-] */
    mrd_real second; /* what a step leaves of the second lag's gap [-] */
    mrd_real rise_couple; /* share of the first gap that is in the second after a step [-] */
    mrd_real fall_couple; /* ... command below it [-] */
    mrd_real second_ramp; /* share of a ramp of the first lag that the second is late [-] */
    mrd_real wheel; /* step over the free-wheeling current's time; 0: driver pulls down [-] */
} mrd_config_prediction;

/* Feedback of a measured force. */
typedef struct {
    mrd_feedback_kind kind; /* what is made of a measured force */
    mrd_real gain; /* of the force error [A/N] */
    mrd_real rate; /* of its integral [A/(N s)] */
    mrd_real full_speed; /* speed from which the feedback is fully there, and gains are learnt [m/s] */
} mrd_config_feedback;

/* What a measured force teaches. */
typedef struct {
    mrd_real observe; /* share of the force error that an observer takes on in a period; 0: none [-] */
    mrd_real forget; /* forgetting of the learnt gains; 0: none are learnt [-] */
    mrd_real error_variance; /* of the model's force [N2] */
    mrd_real gain_variance; /* of the gains before anything is learnt [-] */
    mrd_real offset_share; /* share of the force error in the means of a constant force; 0: none is learnt [-] */
    int32_t offset_samples; /* samples moving each way before it is believed */
    mrd_real offset_error; /* that of the sensor itself: so much of it is left alone [N] */
} mrd_config_learning;

/* The data's envelope; outside it a flag is raised. */
typedef struct {
    mrd_real low_x; /* lowest displacement [m] */
    mrd_real high_x; /* highest displacement [m] */
    mrd_real high_v; /* highest speed [m/s] */
} mrd_config_envelope;

/* When a displacement or a velocity is not believed. */
typedef struct {
    mrd_real far_x; /* a displacement further out is a fault [m] */
    mrd_real far_v; /* a velocity beyond is a fault [m/s] */
    int32_t frozen_samples; /* equal readings that make a fault */
    mrd_real frozen_speed; /* ... where the damper moved at least as fast before [m/s] */
    int32_t coast_samples; /* samples without displacement before the fall-back */
    int32_t back_samples; /* samples with it again before the fall-back ends */
    mrd_real fall_back; /* command when the motion is not known [A] */
} mrd_config_faults;

/* When a temperature is not believed. */
typedef struct {
    mrd_real cold_limit; /* a temperature below is a fault [K] */
    mrd_real hot_limit; /* a temperature above is a fault [K] */
    mrd_real jump; /* a reading further from what is believed is a fault [K] */
    mrd_real slew; /* what is believed moves at most so much in a period [K] */
    mrd_real keep; /* what a period leaves of the gap between belief and reading [-] */
    int32_t hold_samples; /* samples that a belief lasts without a good temperature */
    int32_t recover_samples; /* steady samples after which a reading that had jumped is believed */
    mrd_real nominal; /* temperature to fall back to [K] */
    mrd_real coil_gap; /* a temperature further from the coil's is a fault [K] */
    int32_t coil_samples; /* samples after which a coil far from what is believed is believed */
    mrd_real held; /* temperature to use whatever is read; 0: read it [K] */
} mrd_config_thermometer;

/* The damper as one body, which tells a frozen thermometer. */
typedef struct {
    mrd_real capacity; /* heat that warms the damper by a kelvin; 0: nobody looks [J/K] */
    mrd_real loss; /* what it loses to its surroundings [W/K] */
    mrd_real loss_margin; /* ... and at most so many times that [-] */
    mrd_real ambient; /* temperature of the surroundings [K] */
    mrd_real coil_heat; /* heat of the coil over the applied current squared [W/A2] */
    mrd_real frozen_rise; /* one reading while the damper warms by more than this is a fault [K] */
    bool extrapolate; /* a frozen temperature goes on by the energy put in; else a flag only */
} mrd_config_heating;

/* The parts: members of mrd_track. */
#define MRD_CONFIG_PARTS(X) \
    X(axes) \
    X(law) \
    X(motion) \
    X(reference) \
    X(actuation) \
    X(inverse) \
    X(prediction) \
    X(feedback) \
    X(learning) \
    X(envelope) \
    X(faults) \
    X(thermometer) \
    X(heating)

/* Every value: part, name, type. */
#define MRD_CONFIG_VALUES(X) \
    X(axes, period, mrd_real) \
    X(axes, largest, mrd_real) \
    X(axes, coldest, mrd_real) \
    X(axes, warmest, mrd_real) \
    X(law, series, bool) \
    X(law, chain, bool) \
    X(law, elements, int32_t) \
    X(law, saturating, bool) \
    X(law, shared_rho, bool) \
    X(law, unloaded, mrd_real) \
    X(law, substeps, int32_t) \
    X(law, strides, int32_t) \
    X(law, horizon, mrd_real) \
    X(motion, gain_x, mrd_real) \
    X(motion, gain_v, mrd_real) \
    X(motion, gain_a, mrd_real) \
    X(motion, held, bool) \
    X(motion, swing_share, mrd_real) \
    X(motion, settle_samples, int32_t) \
    X(motion, most_swing, mrd_real) \
    X(motion, speed_noise, mrd_real) \
    X(motion, bend_noise, mrd_real) \
    X(reference, gain_f, mrd_real) \
    X(reference, gain_rate, mrd_real) \
    X(reference, gain_bend, mrd_real) \
    X(actuation, no_lag, bool) \
    X(actuation, dead_samples, int32_t) \
    X(actuation, dead_part, mrd_real) \
    X(actuation, rise, mrd_real) \
    X(actuation, fall, mrd_real) \
    X(actuation, second, mrd_real) \
    X(actuation, rise_couple, mrd_real) \
    X(actuation, fall_couple, mrd_real) \
    X(actuation, second_ramp, mrd_real) \
    X(actuation, wheel, mrd_real) \
    X(actuation, bend, mrd_real) \
    X(actuation, second_ahead, mrd_real) \
    X(actuation, rise_couple_ahead, mrd_real) \
    X(actuation, fall_couple_ahead, mrd_real) \
    X(actuation, second_ramp_ahead, mrd_real) \
    X(actuation, wheel_ahead, mrd_real) \
    X(actuation, rise_answer, mrd_real) \
    X(actuation, fall_answer, mrd_real) \
    X(actuation, play, mrd_real) \
    X(actuation, play_share, mrd_real) \
    X(actuation, wide_play, mrd_real) \
    X(actuation, wide_share, mrd_real) \
    X(inverse, method, mrd_inverse_method) \
    X(inverse, models, int32_t) \
    X(inverse, preview, mrd_real) \
    X(inverse, compensation, mrd_real) \
    X(inverse, margin, mrd_real) \
    X(inverse, lead, mrd_real) \
    X(inverse, lead_keep, mrd_real) \
    X(prediction, steps, int32_t) \
    X(prediction, samples, int32_t) \
    X(prediction, together, int32_t) \
    X(prediction, step, mrd_real) \
    X(prediction, stretch, int32_t) \
    X(prediction, dead, mrd_real) \
    X(prediction, fade, mrd_real) \
    X(prediction, calm, mrd_real) \
    X(prediction, rise, mrd_real) \
    X(prediction, fall, mrd_real) \
    X(prediction, second, mrd_real) \
    X(prediction, rise_couple, mrd_real) \
    X(prediction, fall_couple, mrd_real) \
    X(prediction, second_ramp, mrd_real) \
    X(prediction, wheel, mrd_real) \
    X(feedback, kind, mrd_feedback_kind) \
    X(feedback, gain, mrd_real) \
    X(feedback, rate, mrd_real) \
    X(feedback, full_speed, mrd_real) \
    X(learning, observe, mrd_real) \
    X(learning, forget, mrd_real) \
    X(learning, error_variance, mrd_real) \
    X(learning, gain_variance, mrd_real) \
    X(learning, offset_share, mrd_real) \
    X(learning, offset_samples, int32_t) \
    X(learning, offset_error, mrd_real) \
    X(envelope, low_x, mrd_real) \
    X(envelope, high_x, mrd_real) \
    X(envelope, high_v, mrd_real) \
    X(faults, far_x, mrd_real) \
    X(faults, far_v, mrd_real) \
    X(faults, frozen_samples, int32_t) \
    X(faults, frozen_speed, mrd_real) \
    X(faults, coast_samples, int32_t) \
    X(faults, back_samples, int32_t) \
    X(faults, fall_back, mrd_real) \
    X(thermometer, cold_limit, mrd_real) \
    X(thermometer, hot_limit, mrd_real) \
    X(thermometer, jump, mrd_real) \
    X(thermometer, slew, mrd_real) \
    X(thermometer, keep, mrd_real) \
    X(thermometer, hold_samples, int32_t) \
    X(thermometer, recover_samples, int32_t) \
    X(thermometer, nominal, mrd_real) \
    X(thermometer, coil_gap, mrd_real) \
    X(thermometer, coil_samples, int32_t) \
    X(thermometer, held, mrd_real) \
    X(heating, capacity, mrd_real) \
    X(heating, loss, mrd_real) \
    X(heating, loss_margin, mrd_real) \
    X(heating, ambient, mrd_real) \
    X(heating, coil_heat, mrd_real) \
    X(heating, frozen_rise, mrd_real) \
    X(heating, extrapolate, bool)

/* A mode is left out of the code, always there, or there where the configuration says so. */
#define MRD_NEVER 0
#define MRD_ALWAYS 1
#define MRD_ASKED 2

#ifndef MRD_WITH_SERIES
#define MRD_WITH_SERIES MRD_ASKED /* series valve law */
#endif
#ifndef MRD_WITH_CHAIN
#define MRD_WITH_CHAIN MRD_ASKED /* chain law */
#endif
#ifndef MRD_WITH_MEMORYLESS
#define MRD_WITH_MEMORYLESS MRD_ASKED /* law without hysteresis */
#endif
#ifndef MRD_WITH_SATURATING
#define MRD_WITH_SATURATING MRD_ASKED /* yield force that saturates with speed */
#endif
#ifndef MRD_WITH_SHARED_RHO
#define MRD_WITH_SHARED_RHO MRD_ASKED /* one rho at all currents */
#endif
#ifndef MRD_WITH_SWING
#define MRD_WITH_SWING MRD_ASKED /* jerk by how the motion swings */
#endif
#ifndef MRD_WITH_NO_LAG
#define MRD_WITH_NO_LAG MRD_ASKED /* no lags between command and force */
#endif
#ifndef MRD_WITH_WHEEL
#define MRD_WITH_WHEEL MRD_ASKED /* driver that cannot pull the current down */
#endif
#ifndef MRD_WITH_SATURATION
#define MRD_WITH_SATURATION MRD_ASKED /* iron that saturates */
#endif
#ifndef MRD_WITH_PLAY
#define MRD_WITH_PLAY MRD_ASKED /* magnetic play */
#endif
#ifndef MRD_WITH_WIDE_PLAY
#define MRD_WITH_WIDE_PLAY MRD_ASKED /* a second, wider magnetic play */
#endif
#ifndef MRD_WITH_BANK
#define MRD_WITH_BANK MRD_ASKED /* bank of models at constant currents */
#endif
#ifndef MRD_WITH_INVERSE
#define MRD_WITH_INVERSE MRD_ASKED /* inverse of the model */
#endif
#ifndef MRD_WITH_STATIC
#define MRD_WITH_STATIC MRD_ASKED /* inverse of the settled model */
#endif
#ifndef MRD_WITH_PREDICTIVE
#define MRD_WITH_PREDICTIVE MRD_ASKED /* command by prediction */
#endif
#ifndef MRD_WITH_PREVIEW
#define MRD_WITH_PREVIEW MRD_ASKED /* force set for later */
#endif
#ifndef MRD_WITH_COMPENSATION
#define MRD_WITH_COMPENSATION MRD_ASKED /* compensation of the lags' remaining gap */
#endif
#ifndef MRD_WITH_CLAMP
#define MRD_WITH_CLAMP MRD_ASKED /* reversal clamp */
#endif
#ifndef MRD_WITH_LEAD
#define MRD_WITH_LEAD MRD_ASKED /* lead compensation */
#endif
#ifndef MRD_WITH_FEEDBACK
#define MRD_WITH_FEEDBACK MRD_ASKED /* feedback of a measured force */
#endif
#ifndef MRD_WITH_ON_OFF
#define MRD_WITH_ON_OFF MRD_ASKED /* all or nothing by the force error */
#endif
#ifndef MRD_WITH_OBSERVER
#define MRD_WITH_OBSERVER MRD_ASKED /* disturbance observer */
#endif
#ifndef MRD_WITH_ADAPTIVE
#define MRD_WITH_ADAPTIVE MRD_ASKED /* learnt gains */
#endif
#ifndef MRD_WITH_OFFSET
#define MRD_WITH_OFFSET MRD_ASKED /* learnt constant force */
#endif
#ifndef MRD_WITH_HELD_TEMPERATURE
#define MRD_WITH_HELD_TEMPERATURE MRD_ASKED /* one temperature, whatever is read */
#endif
#ifndef MRD_WITH_HEATING
#define MRD_WITH_HEATING MRD_ASKED /* look for a frozen thermometer */
#endif
#ifndef MRD_WITH_EXTRAPOLATION
#define MRD_WITH_EXTRAPOLATION MRD_ASKED /* frozen temperature carried on */
#endif

static inline bool mrd_has_series(const mrd_config_law *p)
{
    (void)p;
    return (MRD_WITH_SERIES == MRD_ASKED) ? (p->series) : (MRD_WITH_SERIES == MRD_ALWAYS);
}
static inline bool mrd_has_chain(const mrd_config_law *p)
{
    (void)p;
    return (MRD_WITH_CHAIN == MRD_ASKED) ? (p->chain) : (MRD_WITH_CHAIN == MRD_ALWAYS);
}
static inline bool mrd_has_memoryless(const mrd_config_law *p)
{
    (void)p;
    return (MRD_WITH_MEMORYLESS == MRD_ASKED) ? (p->elements == 0) : (MRD_WITH_MEMORYLESS == MRD_ALWAYS);
}
static inline bool mrd_has_saturating(const mrd_config_law *p)
{
    (void)p;
    return (MRD_WITH_SATURATING == MRD_ASKED) ? (p->saturating) : (MRD_WITH_SATURATING == MRD_ALWAYS);
}
static inline bool mrd_has_shared_rho(const mrd_config_law *p)
{
    (void)p;
    return (MRD_WITH_SHARED_RHO == MRD_ASKED) ? (p->shared_rho) : (MRD_WITH_SHARED_RHO == MRD_ALWAYS);
}
static inline bool mrd_has_swing(const mrd_config_motion *p)
{
    (void)p;
    return (MRD_WITH_SWING == MRD_ASKED) ? (p->swing_share > (mrd_real)0) : (MRD_WITH_SWING == MRD_ALWAYS);
}
static inline bool mrd_has_no_lag(const mrd_config_actuation *p)
{
    (void)p;
    return (MRD_WITH_NO_LAG == MRD_ASKED) ? (p->no_lag) : (MRD_WITH_NO_LAG == MRD_ALWAYS);
}
static inline bool mrd_has_wheel(const mrd_config_actuation *p)
{
    (void)p;
    return (MRD_WITH_WHEEL == MRD_ASKED) ? (p->wheel > (mrd_real)0) : (MRD_WITH_WHEEL == MRD_ALWAYS);
}
static inline bool mrd_has_saturation(const mrd_config_actuation *p)
{
    (void)p;
    return (MRD_WITH_SATURATION == MRD_ASKED) ? (p->bend > (mrd_real)0) : (MRD_WITH_SATURATION == MRD_ALWAYS);
}
static inline bool mrd_has_play(const mrd_config_actuation *p)
{
    (void)p;
    return (MRD_WITH_PLAY == MRD_ASKED) ? (p->play > (mrd_real)0) : (MRD_WITH_PLAY == MRD_ALWAYS);
}
static inline bool mrd_has_wide_play(const mrd_config_actuation *p)
{
    (void)p;
    return (MRD_WITH_WIDE_PLAY == MRD_ASKED) ? (p->wide_play > (mrd_real)0) : (MRD_WITH_WIDE_PLAY == MRD_ALWAYS);
}
static inline bool mrd_has_bank(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_BANK == MRD_ASKED) ? (p->models > 1) : (MRD_WITH_BANK == MRD_ALWAYS);
}
static inline bool mrd_has_inverse(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_INVERSE == MRD_ASKED) ? (p->method != MRD_INVERSE_METHOD_NONE) : (MRD_WITH_INVERSE == MRD_ALWAYS);
}
static inline bool mrd_has_static(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_STATIC == MRD_ASKED) ? (p->method == MRD_INVERSE_METHOD_STATIC) : (MRD_WITH_STATIC == MRD_ALWAYS);
}
static inline bool mrd_has_predictive(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_PREDICTIVE == MRD_ASKED) ? (p->method == MRD_INVERSE_METHOD_PREDICTIVE) : (MRD_WITH_PREDICTIVE == MRD_ALWAYS);
}
static inline bool mrd_has_preview(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_PREVIEW == MRD_ASKED) ? (p->preview > (mrd_real)0) : (MRD_WITH_PREVIEW == MRD_ALWAYS);
}
static inline bool mrd_has_compensation(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_COMPENSATION == MRD_ASKED) ? (p->compensation > (mrd_real)0) : (MRD_WITH_COMPENSATION == MRD_ALWAYS);
}
static inline bool mrd_has_clamp(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_CLAMP == MRD_ASKED) ? (p->margin >= (mrd_real)0) : (MRD_WITH_CLAMP == MRD_ALWAYS);
}
static inline bool mrd_has_lead(const mrd_config_inverse *p)
{
    (void)p;
    return (MRD_WITH_LEAD == MRD_ASKED) ? (p->lead > (mrd_real)0) : (MRD_WITH_LEAD == MRD_ALWAYS);
}
static inline bool mrd_has_feedback(const mrd_config_feedback *p)
{
    (void)p;
    return (MRD_WITH_FEEDBACK == MRD_ASKED) ? (p->kind != MRD_FEEDBACK_KIND_NONE) : (MRD_WITH_FEEDBACK == MRD_ALWAYS);
}
static inline bool mrd_has_on_off(const mrd_config_feedback *p)
{
    (void)p;
    return (MRD_WITH_ON_OFF == MRD_ASKED) ? (p->kind == MRD_FEEDBACK_KIND_ON_OFF) : (MRD_WITH_ON_OFF == MRD_ALWAYS);
}
static inline bool mrd_has_observer(const mrd_config_learning *p)
{
    (void)p;
    return (MRD_WITH_OBSERVER == MRD_ASKED) ? (p->observe > (mrd_real)0) : (MRD_WITH_OBSERVER == MRD_ALWAYS);
}
static inline bool mrd_has_adaptive(const mrd_config_learning *p)
{
    (void)p;
    return (MRD_WITH_ADAPTIVE == MRD_ASKED) ? (p->forget > (mrd_real)0) : (MRD_WITH_ADAPTIVE == MRD_ALWAYS);
}
static inline bool mrd_has_offset(const mrd_config_learning *p)
{
    (void)p;
    return (MRD_WITH_OFFSET == MRD_ASKED) ? (p->offset_share > (mrd_real)0) : (MRD_WITH_OFFSET == MRD_ALWAYS);
}
static inline bool mrd_has_held_temperature(const mrd_config_thermometer *p)
{
    (void)p;
    return (MRD_WITH_HELD_TEMPERATURE == MRD_ASKED) ? (p->held > (mrd_real)0) : (MRD_WITH_HELD_TEMPERATURE == MRD_ALWAYS);
}
static inline bool mrd_has_heating(const mrd_config_heating *p)
{
    (void)p;
    return (MRD_WITH_HEATING == MRD_ASKED) ? (p->capacity > (mrd_real)0) : (MRD_WITH_HEATING == MRD_ALWAYS);
}
static inline bool mrd_has_extrapolation(const mrd_config_heating *p)
{
    (void)p;
    return (MRD_WITH_EXTRAPOLATION == MRD_ASKED) ? (p->extrapolate) : (MRD_WITH_EXTRAPOLATION == MRD_ALWAYS);
}

#endif
