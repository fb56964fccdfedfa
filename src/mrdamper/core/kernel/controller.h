/* A force-tracking controller (inputs: wanted force, displacement, temperature; output: current), and the model of the
 * damper on the same tables (inputs: displacement, current, temperature; output: force). Both consist of a
 * configuration in parts (controller_config.h) and tables.
 *
 * A target needs these two headers, controller.c and the files that it includes: track_tables.h, track_series.h,
 * track_chain.h, track_estimate.h, track_predict.h, track_model.h. The code allocates no memory, calls only memcpy and
 * memset, has no global state and uses one number type. Powers and exponentials are tabulated beforehand
 * (control/tables). Units are SI and kelvin, extension is positive; the "current" is in volts if the card has volts.
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
#define MRD_TRACK_MOVES 3     /* command values over the horizon of a prediction */
#define MRD_TRACK_STEPS 16    /* maximum number of steps of that horizon */
#define MRD_TRACK_BRISTLES 5  /* bristles of the chain: three before yield, friction, memory */

/* A lookup table of a function of u >= 0: cubics on cells whose width doubles with every octave of u + offset. */
typedef struct {
    mrd_real offset;      /* a power of two */
    mrd_real top;         /* largest u + offset in the table; the function is constant beyond */
    int32_t bits;         /* log2 of the cells in an octave */
    int32_t cells;
    const mrd_real *cell; /* [4 * cells] */
} mrd_lookup;

/* A power u^m of u >= 0: cubics over one octave, and a factor for each octave. */
typedef struct {
    mrd_real exponent;     /* m */
    mrd_real lowest;       /* a power of two; below it the power is a straight line to zero */
    mrd_real top;          /* largest u in the table; the power is constant beyond */
    int32_t bits;          /* log2 of the cells */
    int32_t octaves;       /* number of octaves, beginning at `lowest` */
    const mrd_real *scale; /* [octaves] */
    const mrd_real *cell;  /* [4 << bits] */
} mrd_power;

/* Rows of the coefficients of the series valve, then further rows of the chain. All can depend on temperature. */
enum { MRD_CHAIN_OFFSET, MRD_CHAIN_STIFFNESS, MRD_CHAIN_THINNING, MRD_CHAIN_SLOWNESS, MRD_CHAIN_POSITION,
       MRD_CHAIN_SPRING, MRD_CHAIN_GAP, MRD_CHAIN_SHARPNESS, MRD_CHAIN_LEAK, MRD_CHAIN_MASS, MRD_CHAIN_VISCOSITY,
       MRD_CHAIN_SLIDING, MRD_CHAIN_BREAKAWAY, MRD_CHAIN_TRANSITION, MRD_CHAIN_STRIBECK, MRD_CHAIN };
enum { MRD_CHAIN_ORIFICE = MRD_CHAIN, MRD_CHAIN_ASYMMETRY, MRD_CHAIN_FLOW_ASYMMETRY, MRD_CHAIN_CURVATURE,
       MRD_CHAIN_SHARE, MRD_CHAIN_APART,
       MRD_CHAIN_FRICTION, MRD_CHAIN_FRICTION_STIFFNESS, MRD_CHAIN_EXCESS, MRD_CHAIN_FADING, MRD_CHAIN_MEMORY_STIFFNESS,
       MRD_CHAIN_GAS, MRD_CHAIN_GAS_PER, MRD_CHAIN_PLAY, MRD_CHAIN_FOLLOW, MRD_CHAIN_CREEP, MRD_CHAIN_KNEE,
       MRD_CHAIN_BYPASS, MRD_CHAIN_CAVITY_PER, MRD_CHAIN_CAVITY, MRD_CHAIN_BUBBLE, MRD_CHAIN_ALL };

/* Planes of the coefficients that also depend on the current; the series valve has only the first. */
enum { MRD_PLANE_YIELD, MRD_PLANE_THINNING, MRD_PLANE_BRISTLE, MRD_PLANE_MEMORY, MRD_PLANES };

/* Tables of series valve and chain: coefficients by temperature, and some coefficients also by current. */
typedef struct {
    int32_t currents;      /* one more than a power of two */
    const mrd_real *yield; /* [temperatures][currents][planes], the first plane rising with the current */
    const mrd_real *chain; /* [temperatures][MRD_CHAIN or MRD_CHAIN_ALL]; inverse lengths and speeds */
    mrd_power thinning, leak, viscous, gas;
    mrd_lookup side;       /* tanh u */
    mrd_lookup fade;       /* exp(-u^2) */
} mrd_series;

/* Rows: factors of the coefficients of the force, and the inverse yield displacements. */
enum { MRD_ROW_OFFSET, MRD_ROW_STIFFNESS, MRD_ROW_MASS, MRD_ROW_VISCOUS, MRD_ROW_SLIDING, MRD_ROW_BREAKAWAY,
       MRD_ROW_YIELD, MRD_ROW_SECOND, MRD_ROW_RHO, MRD_ROW_SECOND_RHO, MRD_TABLE_ROWS };
#define MRD_ROWS 8 /* rows of the force */

/* Groups of rows with separate sums: all rows up to the breakaway friction, then each remaining row. */
enum { MRD_GROUP_MOTION, MRD_GROUP_YIELD, MRD_GROUP_SECOND, MRD_GROUP_RHO, MRD_GROUP_SECOND_RHO, MRD_GROUPS };

/* A row is a sum of terms. Each term is a factor that depends on temperature times a column over the currents. A row of
 * the first group that does not depend on the current is one term without a column: a level. */
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
    int32_t currents;               /* length of a column */
    int32_t pieces;                 /* equal intervals of the temperature axis from coldest to warmest */
    int32_t levels;                 /* number of levels; they are the first terms */
    int32_t begin[MRD_GROUPS + 1];  /* first column of each group, and the number of columns */
    uint8_t row[MRD_TRACK_TERMS];   /* row of each term: levels, then columns, in the order of rows */
    uint8_t quarter[MRD_TRACK_BANK]; /* indices of the quarters of the largest current */
    const mrd_real *current;        /* [currents], rising from 0 to the largest, denser where the force curve bends */
    const mrd_real *factor;         /* [pieces][levels + columns][3], a parabola over 0 to 1 in each piece */
    const mrd_real *column;         /* [currents][columns] */
    mrd_lookup loading, unloading; /* |w| on the universal curve against the travel from w = 0 */
    mrd_lookup unload_map;      /* reversal: unloading travel against loading travel */
    mrd_lookup reload_map;      /* reversal back, first half of the unloading travel */
    mrd_lookup reload_map_rest;  /* the same against the remaining second half, sign reversed */
    mrd_lookup viscous;         /* viscous function of the speed */
    mrd_lookup sliding;         /* sliding friction divided by its final value */
    mrd_lookup breakaway;
    mrd_lookup saturation;      /* yield force that saturates with speed or has no memory */
    const mrd_series *series; /* tables of series valve and chain, which replace the tables above; else NULL */
} mrd_track;

/* State of the chain. */
typedef struct {
    mrd_real e, y;     /* spring's travel [m], valve's velocity [m/s] */
    mrd_real play;     /* displacement behind the free play [m] */
    mrd_real cavity;   /* growth of the cavity [m] */
    mrd_real bristle[MRD_TRACK_BRISTLES]; /* forces [N] */
    mrd_real level[2]; /* yield and memory force of the bristles [N] */
} mrd_chain_state;

/* A value and its derivatives by the moves of the command (its values over the horizon). */
typedef struct {
    mrd_real at, by[MRD_TRACK_MOVES];
} mrd_moved;

/* Derivatives of the state of a chain by one move. */
typedef struct {
    mrd_real e, cavity, bristle[MRD_TRACK_BRISTLES], level[2];
} mrd_chain_move;

/* A quadratic cost of the moves: gradient and Hessian. */
typedef struct {
    mrd_real slope[MRD_TRACK_MOVES], curvature[MRD_TRACK_MOVES][MRD_TRACK_MOVES];
} mrd_move_cost;

/* State of a prediction: motion, hysteresis, lags and magnetic hysteresis, with derivatives by the moves, and the cost of
 * the horizon so far. */
typedef struct {
    mrd_real x, v, a, direction, curve_position[2];
    mrd_chain_state chain;
    mrd_chain_move by[MRD_TRACK_MOVES];
    mrd_moved first_lag_flux, second_lag_flux, hysteresis_output[2];
    mrd_real elapsed_time, weight; /* time since the first sample of the prediction [s]; weight of an error */
    mrd_move_cost cost;
} mrd_prediction;

/* Flags of the last step. The first seven, and those from MRD_NO_CURRENT on, are faults of readings. */
enum {
    MRD_NO_DISPLACEMENT = 1, /* displacement is not a number, or far outside */
    MRD_FROZEN = 2, /* displacement is constant although the damper moved */
    MRD_MOTION_UNKNOWN = 4, /* no displacement for too long: the fall-back command is used */
    MRD_NO_TEMPERATURE = 8, /* temperature is not a number, or beyond its limits: the last valid one is used */
    MRD_TEMPERATURE_JUMP = 16, /* temperature moves faster than a damper warms: the last valid one is used */
    MRD_NOMINAL_TEMPERATURE = 32, /* no valid temperature for too long: the nominal one is used */
    MRD_NO_TARGET = 64, /* wanted force is not a number: zero is used */
    MRD_NO_FORCE = 128, /* no force reading although the controller feeds force back */
    MRD_OUTSIDE_MOTION = 256, /* displacement or velocity outside the identified range */
    MRD_OUTSIDE_TEMPERATURE = 512, /* temperature outside the identified range: its edge is used */
    MRD_INFEASIBLE = 1024, /* no command gives the wanted force */
    MRD_SATURATED = 4096, /* the command is at one of its ends, or beyond them */
    MRD_NO_CURRENT = 8192, /* command is not a number, or far outside: the last valid one is used, then zero */
    MRD_FROZEN_TEMPERATURE = 16384, /* temperature is constant although the damper warms */
    MRD_NO_VELOCITY = 32768, /* velocity is beyond its limit: estimated from the displacement */
    MRD_INTERNAL_FAULT = 65536 /* the state was not finite and was reset */
};

typedef struct {
    mrd_real x, v, a;                   /* estimated motion */
    mrd_real target, target_rate, target_second_derivative; /* filtered wanted force, for extrapolation */
    mrd_real first_lag_flux, second_lag_flux; /* flux of the command behind the first and the second lag */
    mrd_real hysteresis_output[2];      /* both magnetic hysteresis elements, minus the half width while the flux rises */
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
    mrd_real expected_rise, min_rise;   /* warming by the energy put in since that reading changed [K] */
    mrd_real min_temperature;           /* lowest estimate so far [K] */
    mrd_real predicted_warming;         /* warming in a period by the energy put in [K] */
    mrd_real last_displacement, speed_before_repeat; /* last reading; speed when it began to repeat */
    mrd_real velocity_mean_square, acceleration_mean_square, omega_squared; /* the jerk is -omega_squared v */
    mrd_chain_state chain;
    mrd_real planned_moves[MRD_TRACK_MOVES]; /* command over the horizon from the last prediction [A] */
    mrd_prediction prediction;          /* unfinished prediction */
    mrd_real delay_line[MRD_TRACK_DELAY_LINE];  /* commands in the dead time */
    mrd_real wanted_line[MRD_TRACK_DELAY_LINE]; /* wanted forces that were known ahead [N] */
    int32_t newest_command;             /* index in both lines */
    int32_t repeated_readings;          /* equal displacement readings */
    int32_t missing_samples, recovery_countdown; /* samples without displacement; remaining samples of the recovery */
    int32_t settled_samples;            /* samples since the motion filter started, until it has settled */
    int32_t samples_without_temperature, candidate_samples; /* no valid temperature; steady candidate */
    int32_t valid_temperature_samples;  /* samples with a valid temperature, up to thermometer.hold_samples */
    int32_t started;
    int32_t temperature_frozen;         /* 1: the temperature reading counts as frozen */
    int32_t samples_without_current;    /* samples without a valid current */
    int32_t prediction_samples;         /* samples of the unfinished prediction */
    int32_t infeasible;                 /* 1: the last prediction did not reach the wanted force */
    int32_t target_known_ahead;         /* 1: a wanted force has been known ahead */
    int32_t velocity_known;             /* 1: the last velocity was an input */
    int32_t flags;
} mrd_track_state;

/* Inputs of a step; NaN if unknown. */
typedef struct {
    mrd_real now, ahead;   /* wanted force [N], and the same at `preview` later; only a prediction uses `ahead` */
    mrd_real displacement; /* [m] */
    mrd_real temperature;  /* [K] */
    mrd_real force;        /* [N] */
} mrd_inputs;

/* Inputs of a step of the model; NaN if unknown. */
typedef struct {
    mrd_real displacement; /* [m] */
    mrd_real velocity;     /* [m/s]; NaN: estimated from the displacement */
    mrd_real current;      /* through the period that ends now [A] */
    mrd_real temperature;  /* [K] */
} mrd_model_inputs;

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s);
MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_inputs *inputs);
/* Return the force of the damper [N]. The model needs its own state from mrd_track_start. */
MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_model_inputs *inputs);
/* Compute yield, viscous, friction and remaining force [N] of the model at the estimated state. */
MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts);

#endif
