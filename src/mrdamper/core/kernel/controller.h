/* A force-tracking controller (inputs: wanted force, displacement, temperature; output: current), and a model of the
 * damper with the same tables (inputs: displacement, current, temperature; output: force). Both consist of a
 * configuration (controller_config.h) and tables.
 *
 * A target needs these two headers, controller.c and the files that it includes: track_tables.h, track_series.h,
 * track_chain.h, track_estimate.h, track_predict.h, track_model.h. The code allocates no memory, calls only memcpy and
 * memset, has no global state and uses one number type. Powers and exponentials are tabulated beforehand
 * (control/tables). Units are SI and kelvin, extension is positive. If the command of the card is a voltage, "current"
 * means this voltage.
 */
#ifndef MRD_CONTROLLER_H
#define MRD_CONTROLLER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifndef MRD_TRACK_API
#define MRD_TRACK_API /* linkage of the public functions; kernel.c makes them static */
#endif

#ifdef MRD_SINGLE
typedef float mrd_real;
typedef uint32_t mrd_pattern;
#define MRD_DIGITS 23u
#define MRD_PATTERN_OF_ONE UINT32_C(0x3f800000)
#define MRD_PATTERN_OF_ROOT UINT32_C(0x5f375a86)
#define MRD_ROOT_ROUNDS 2
#else
typedef double mrd_real;
typedef uint64_t mrd_pattern;
#define MRD_DIGITS 52u
#define MRD_PATTERN_OF_ONE UINT64_C(0x3ff0000000000000)
#define MRD_PATTERN_OF_ROOT UINT64_C(0x5fe6eb50c7b537a9)
#define MRD_ROOT_ROUNDS 3
#endif

#include "controller_config.h"

#define MRD_TRACK_CURRENTS 65 /* maximum number of currents of a table */
#define MRD_TRACK_TERMS 48    /* maximum number of terms */
#define MRD_TRACK_BANK 5      /* models of a bank, at quarters of the largest current */
#define MRD_TRACK_DELAY_LINE 128u /* maximum number of delayed commands; a power of two */
#define MRD_TRACK_MOVES 3     /* number of command values (moves) in the horizon of a prediction */
#define MRD_TRACK_STEPS 16    /* maximum number of steps of the horizon */
#define MRD_TRACK_BRISTLES 5  /* number of bristles of the chain: three pre-yield, one friction, one memory bristle */

/* A lookup table of a function of u >= 0: cubics on cells whose width doubles with every octave of u + offset. */
typedef struct {
    mrd_real offset;      /* a power of two */
    mrd_real top;         /* largest u + offset in the table; the function is constant above */
    int32_t bits;         /* log2 of the number of cells in an octave */
    int32_t cells;
    const mrd_real *cell; /* [4 * cells] */
} mrd_lookup;

/* A power u^m of u >= 0: cubics over one octave, and a factor for each octave. */
typedef struct {
    mrd_real exponent;     /* m */
    mrd_real lowest;       /* smallest u of the cubics, a power of two; a straight line to zero is used below */
    mrd_real top;          /* largest u in the table; the function is constant above */
    int32_t bits;          /* log2 of the number of cells */
    int32_t octaves;       /* number of octaves, beginning at `lowest` */
    const mrd_real *scale; /* [octaves] */
    const mrd_real *cell;  /* [4 << bits] */
} mrd_power;

/* Coefficients of the series valve, then further coefficients of the chain. All can depend on temperature. */
enum { MRD_CHAIN_OFFSET, MRD_CHAIN_STIFFNESS, MRD_CHAIN_THINNING, MRD_CHAIN_SLOWNESS, MRD_CHAIN_POSITION,
       MRD_CHAIN_SPRING, MRD_CHAIN_GAP, MRD_CHAIN_SHARPNESS, MRD_CHAIN_LEAK, MRD_CHAIN_MASS, MRD_CHAIN_VISCOSITY,
       MRD_CHAIN_SLIDING, MRD_CHAIN_BREAKAWAY, MRD_CHAIN_TRANSITION, MRD_CHAIN_STRIBECK, MRD_CHAIN };
enum { MRD_CHAIN_ORIFICE = MRD_CHAIN, MRD_CHAIN_ASYMMETRY, MRD_CHAIN_FLOW_ASYMMETRY, MRD_CHAIN_CURVATURE,
       MRD_CHAIN_SHARE, MRD_CHAIN_APART,
       MRD_CHAIN_FRICTION, MRD_CHAIN_FRICTION_STIFFNESS, MRD_CHAIN_EXCESS, MRD_CHAIN_FADING, MRD_CHAIN_MEMORY_STIFFNESS,
       MRD_CHAIN_GAS, MRD_CHAIN_GAS_PER, MRD_CHAIN_PLAY, MRD_CHAIN_FOLLOW, MRD_CHAIN_CREEP, MRD_CHAIN_KNEE,
       MRD_CHAIN_BYPASS, MRD_CHAIN_CAVITY_PER, MRD_CHAIN_CAVITY, MRD_CHAIN_BUBBLE, MRD_CHAIN_ALL };

/* Coefficients that also depend on the current. The series valve has only the first of them. */
enum { MRD_PLANE_YIELD, MRD_PLANE_THINNING, MRD_PLANE_BRISTLE, MRD_PLANE_MEMORY, MRD_PLANES };

/* Tables of series valve and chain: coefficients versus temperature, some coefficients also versus current. */
typedef struct {
    int32_t currents;      /* one more than a power of two */
    const mrd_real *yield; /* [temperatures][currents][planes]; the first plane increases with the current */
    const mrd_real *chain; /* [temperatures][MRD_CHAIN or MRD_CHAIN_ALL]; inverse lengths and speeds */
    mrd_power thinning, leak, viscous, gas;
    mrd_lookup side;       /* tanh u */
    mrd_lookup fade;       /* exp(-u^2) */
} mrd_series;

/* Rows of the table: coefficients of the force, then the inverse yield displacements. */
enum { MRD_ROW_OFFSET, MRD_ROW_STIFFNESS, MRD_ROW_MASS, MRD_ROW_VISCOUS, MRD_ROW_SLIDING, MRD_ROW_BREAKAWAY,
       MRD_ROW_YIELD, MRD_ROW_SECOND, MRD_ROW_RHO, MRD_ROW_SECOND_RHO, MRD_TABLE_ROWS };
#define MRD_ROWS 8 /* number of rows that contribute to the force */

/* Groups of rows with separate sums: all rows up to the breakaway friction, then each remaining row. */
enum { MRD_GROUP_MOTION, MRD_GROUP_YIELD, MRD_GROUP_SECOND, MRD_GROUP_RHO, MRD_GROUP_SECOND_RHO, MRD_GROUPS };

/* A row is a sum of terms. Each term is a factor, which depends on temperature, times a column, which depends on
 * current. A *level* is a term without a column: a row of the first group that does not depend on current. */
typedef struct {
    mrd_config_axes axes;
    mrd_config_law law;
    mrd_config_gains gains;
    mrd_config_motion motion;
    mrd_config_reference reference;
    mrd_config_actuation actuation;
    mrd_config_inverse inverse;
    mrd_config_prediction prediction;
    mrd_config_feedback feedback;
    mrd_config_envelope envelope;
    mrd_config_faults faults;
    mrd_config_thermometer thermometer;
    mrd_config_heating heating;
    int32_t currents;               /* number of currents of the tables (length of a column) */
    int32_t pieces;                 /* number of equal intervals of the temperature axis from coldest to warmest */
    int32_t levels;                 /* number of levels, which are the first terms */
    int32_t begin[MRD_GROUPS + 1];  /* first column of each group, and the number of columns */
    uint8_t row[MRD_TRACK_TERMS];   /* row of each term: levels, then columns, in the order of rows */
    uint8_t quarter[MRD_TRACK_BANK]; /* indices of the quarters of the largest current */
    const mrd_real *current;        /* [currents], rising from 0 to the largest, denser where the force curve bends */
    const mrd_real *factor;         /* [pieces][levels + columns][3], a parabola over 0 to 1 in each piece */
    const mrd_real *column;         /* [currents][columns] */
    mrd_lookup loading, unloading; /* |w| on the universal curve versus the travel from w = 0 */
    mrd_lookup unload_map;      /* reversal while loading: unloading travel versus loading travel */
    mrd_lookup reload_map;      /* reversal while unloading, in the first half of the unloading travel */
    mrd_lookup reload_map_rest; /* like reload_map for the second half, versus the remaining travel, sign reversed */
    mrd_lookup viscous;         /* factor on the viscosity versus speed */
    mrd_lookup sliding;         /* sliding friction divided by its value at high speed */
    mrd_lookup breakaway;       /* factor on the breakaway friction versus speed */
    mrd_lookup saturation;      /* factor on a yield force that saturates with speed or has no memory */
    const mrd_series *series; /* tables of series valve and chain, which replace the tables above; else NULL */
} mrd_track;

/* State of the chain. */
typedef struct {
    mrd_real e, y;     /* travel of the spring [m], velocity of the valve [m/s] */
    mrd_real play;     /* displacement behind the free play [m] */
    mrd_real cavity;   /* length of the cavity z [m] */
    mrd_real bristle[MRD_TRACK_BRISTLES]; /* forces [N] */
    mrd_real level[2]; /* yield and memory force of the bristles [N] */
} mrd_chain_state;

/* A value, and its derivatives with respect to the moves (command values in the prediction horizon). */
typedef struct {
    mrd_real at, by[MRD_TRACK_MOVES];
} mrd_moved;

/* Derivatives of the state of a chain with respect to one move. */
typedef struct {
    mrd_real e, cavity, bristle[MRD_TRACK_BRISTLES], level[2];
} mrd_chain_move;

/* A quadratic cost of the moves: gradient and Hessian. */
typedef struct {
    mrd_real slope[MRD_TRACK_MOVES], curvature[MRD_TRACK_MOVES][MRD_TRACK_MOVES];
} mrd_move_cost;

/* State of a prediction: motion, hysteresis, lags and magnetic hysteresis, their derivatives with respect to the moves,
 * and the cost of the steps of the horizon so far. */
typedef struct {
    mrd_real x, v, a, direction, curve_position[2];
    mrd_chain_state chain;
    mrd_chain_move by[MRD_TRACK_MOVES];
    mrd_moved first_lag_flux, second_lag_flux, hysteresis_output[2];
    mrd_real elapsed_time, weight; /* time since the first sample of the prediction [s]; weight of an error */
    mrd_move_cost cost;
} mrd_prediction;

/* Flags of the last step. The first eight flags, and the flags from MRD_NO_CURRENT on, report faults. */
enum {
    MRD_NO_DISPLACEMENT = 1, /* displacement is NaN or beyond its limit */
    MRD_FROZEN = 2, /* displacement is constant although the damper moved */
    MRD_MOTION_UNKNOWN = 4, /* displacement is missing for too long: the fall-back command is used */
    MRD_NO_TEMPERATURE = 8, /* temperature is NaN or beyond its limits: the last valid temperature is used */
    MRD_TEMPERATURE_JUMP = 16, /* temperature changes too fast for a damper: the last valid temperature is used */
    MRD_NOMINAL_TEMPERATURE = 32, /* temperature is invalid for too long: the nominal temperature is used */
    MRD_NO_TARGET = 64, /* wanted force is NaN: zero is used */
    MRD_NO_FORCE = 128, /* force reading is missing although the controller uses force feedback */
    MRD_OUTSIDE_MOTION = 256, /* displacement or velocity is outside the identified range */
    MRD_OUTSIDE_TEMPERATURE = 512, /* temperature is outside the identified range: the nearest end is used */
    MRD_INFEASIBLE = 1024, /* no command gives the wanted force */
    MRD_SATURATED = 4096, /* command is at its minimum or maximum, or beyond */
    MRD_NO_CURRENT = 8192, /* current is NaN or far outside its range: the last valid current is used, then zero */
    MRD_FROZEN_TEMPERATURE = 16384, /* temperature is constant although the damper warms */
    MRD_NO_VELOCITY = 32768, /* velocity is beyond its limit and is estimated from the displacement */
    MRD_INTERNAL_FAULT = 65536 /* the state was not finite and was reset */
};

typedef struct {
    mrd_real x, v, a;                   /* estimated motion */
    mrd_real target, target_rate, target_second_derivative; /* filtered wanted force, for extrapolation */
    mrd_real first_lag_flux, second_lag_flux; /* flux of the command behind the first and the second lag */
    mrd_real hysteresis_output[2];      /* output minus half width of both magnetic hysteresis elements */
    mrd_real applied_current;           /* current behind lags and magnetic hysteresis; the force depends on it */
    mrd_real direction;                 /* 1 or -1: last direction of the hysteresis */
    mrd_real curve_position[MRD_TRACK_BANK][2]; /* position on the universal curve for each model and element;
                                           series valve: travel of the spring [m] and velocity of the valve [m/s] */
    mrd_real command;                   /* last command */
    mrd_real force_integral;            /* integral term of the force feedback [A] */
    mrd_real disturbance;               /* observed force error in the direction of motion [N] */
    mrd_real temperature;               /* estimate [K] */
    mrd_real candidate;                 /* reading that has jumped and is not accepted yet [K] */
    mrd_real last_temperature;          /* last reading within the limits [K] */
    mrd_real expected_rise, min_rise;   /* expected and minimum warming since the last reading has changed [K] */
    mrd_real min_temperature;           /* lowest estimate so far [K] */
    mrd_real predicted_warming;         /* expected warming in a period [K] */
    mrd_real last_displacement, speed_before_repeat; /* last reading; speed when this reading was first repeated */
    mrd_real velocity_mean_square, acceleration_mean_square, omega_squared; /* the jerk is -omega_squared v */
    mrd_chain_state chain;
    mrd_real planned_moves[MRD_TRACK_MOVES]; /* moves of the last finished prediction [A] */
    mrd_prediction prediction;          /* unfinished prediction */
    mrd_real delay_line[MRD_TRACK_DELAY_LINE];  /* commands in the dead time */
    mrd_real wanted_line[MRD_TRACK_DELAY_LINE]; /* wanted forces that were known ahead [N] */
    int32_t newest_command;             /* index of the newest value in delay_line and wanted_line */
    int32_t repeated_readings;          /* number of consecutive equal displacement readings */
    int32_t missing_samples, recovery_countdown; /* samples without displacement; remaining samples of the recovery */
    int32_t settled_samples;            /* samples since the motion filter started, until it has settled */
    int32_t samples_without_temperature, candidate_samples; /* samples without temperature; with steady candidate */
    int32_t valid_temperature_samples;  /* samples with a valid temperature, up to thermometer.hold_samples */
    int32_t started;
    int32_t temperature_frozen;         /* 1: the temperature reading counts as frozen */
    int32_t samples_without_current;    /* samples without a valid current */
    int32_t prediction_samples;         /* samples of the unfinished prediction */
    int32_t infeasible;                 /* 1: the last prediction did not reach the wanted force */
    int32_t target_known_ahead;         /* 1: at least one future wanted force has been an input */
    int32_t velocity_known;             /* 1: the last velocity was an input */
    int32_t flags;
} mrd_track_state;

/* Inputs of a step; NaN if unknown. */
typedef struct {
    mrd_real now, ahead;   /* wanted force now and after the time `preview` [N]; only a prediction uses `ahead` */
    mrd_real displacement; /* [m] */
    mrd_real temperature;  /* [K] */
    mrd_real force;        /* [N] */
} mrd_inputs;

/* Inputs of a step of the model; NaN if unknown. */
typedef struct {
    mrd_real displacement; /* [m] */
    mrd_real velocity;     /* [m/s]; NaN: estimated from the displacement */
    mrd_real current;      /* current during the period that ends now [A] */
    mrd_real temperature;  /* [K] */
} mrd_model_inputs;

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s);
MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_inputs *inputs);
/* Return the force of the damper [N]. The model needs its own state from mrd_track_start. */
MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_model_inputs *inputs);
/* Compute yield, viscous, friction and remaining force [N] of the model at the estimated state. */
MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts);

#endif
