/* A force-tracking controller: wanted force, displacement and temperature in, current out. And the damper's model
 * on the same tables: displacement, current and temperature in, force out. What a controller is made of is its
 * configuration, by parts (controller_config.h), and its tables.
 *
 * Everything that a target needs are these two headers, controller.c, and the parts that it is made of: track_tables.h,
 * track_series.h, track_chain.h, track_estimate.h, track_predict.h, track_model.h.
 * No allocation, no library function but memcpy and memset, no global state, one number type. What takes a power
 * or an exponential was tabulated beforehand (control/tables). SI and kelvin; extension positive; the
 * "current" is the command, in volts where the card's is.
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

#define MRD_TRACK_CURRENTS 65 /* most currents of a table */
#define MRD_TRACK_TERMS 48    /* most terms */
#define MRD_TRACK_BANK 5      /* models of a bank, at every quarter of the largest current */
#define MRD_TRACK_DELAY_LINE 128u /* commands under way between controller and coil, at most; a power of two */
#define MRD_TRACK_MOVES 3     /* of the command over the horizon of a prediction */
#define MRD_TRACK_STEPS 16    /* most steps of that horizon */
#define MRD_TRACK_BRISTLES 5  /* of the chain: three before yield, friction, memory */

/* A lookup table of a function of a size u >= 0: cubics on bins that double in width with every octave of
 * u + offset. */
typedef struct {
    mrd_real offset;      /* a power of two */
    mrd_real top;         /* largest u + offset in the table; beyond, the last value holds */
    int32_t bits;         /* log2 of the cells in an octave */
    int32_t cells;
    const mrd_real *cell; /* [4 * cells] */
} mrd_lookup;

/* A power u^m of a size u: one octave of it as cubics, and what every octave multiplies. */
typedef struct {
    mrd_real exponent;     /* m */
    mrd_real least;        /* a power of two; below it the power goes straight to zero */
    mrd_real top;          /* largest size in the table; beyond, the last value holds */
    int32_t bits;          /* log2 of the cells */
    int32_t octaves;       /* from `least` up */
    const mrd_real *scale; /* [octaves] */
    const mrd_real *cell;  /* [4 << bits] */
} mrd_power;

/* Rows of the coefficients of the series valve and, beyond them, of the chain; all of them may move with temperature. */
enum { MRD_CHAIN_OFFSET, MRD_CHAIN_STIFFNESS, MRD_CHAIN_THINNING, MRD_CHAIN_SLOWNESS, MRD_CHAIN_POSITION,
       MRD_CHAIN_SPRING, MRD_CHAIN_GAP, MRD_CHAIN_SHARPNESS, MRD_CHAIN_LEAK, MRD_CHAIN_MASS, MRD_CHAIN_VISCOSITY,
       MRD_CHAIN_SLIDING, MRD_CHAIN_BREAKAWAY, MRD_CHAIN_TRANSITION, MRD_CHAIN_STRIBECK, MRD_CHAIN };
enum { MRD_CHAIN_ORIFICE = MRD_CHAIN, MRD_CHAIN_ASYMMETRY, MRD_CHAIN_FLOW_ASYMMETRY, MRD_CHAIN_CURVATURE,
       MRD_CHAIN_SHARE, MRD_CHAIN_APART,
       MRD_CHAIN_FRICTION, MRD_CHAIN_FRICTION_STIFFNESS, MRD_CHAIN_EXCESS, MRD_CHAIN_FADING, MRD_CHAIN_MEMORY_STIFFNESS,
       MRD_CHAIN_GAS, MRD_CHAIN_GAS_PER, MRD_CHAIN_PLAY, MRD_CHAIN_FOLLOW, MRD_CHAIN_CREEP, MRD_CHAIN_KNEE,
       MRD_CHAIN_BYPASS, MRD_CHAIN_CAVITY_PER, MRD_CHAIN_CAVITY, MRD_CHAIN_BUBBLE, MRD_CHAIN_ALL };

/* Planes of what moves with the current as well; the series valve has the first alone. */
enum { MRD_PLANE_YIELD, MRD_PLANE_THINNING, MRD_PLANE_BRISTLE, MRD_PLANE_MEMORY, MRD_PLANES };

/* The series valve law and the chain: coefficients over temperature, some of them over current as well. */
typedef struct {
    int32_t currents;      /* one more than a power of two */
    const mrd_real *yield; /* [temperatures][currents][planes], the first plane rising with the current */
    const mrd_real *chain; /* [temperatures][MRD_CHAIN or MRD_CHAIN_ALL]; lengths and speeds by their inverse */
    mrd_power thinning, leak, viscous, gas;
    mrd_lookup side;       /* tanh u */
    mrd_lookup fade;       /* exp(-u^2) */
} mrd_series;

/* Rows: what the coefficients of the force are multiplied with, and the inverse yield displacements. */
enum { MRD_ROW_OFFSET, MRD_ROW_STIFFNESS, MRD_ROW_MASS, MRD_ROW_VISCOUS, MRD_ROW_SLIDING, MRD_ROW_BREAKAWAY,
       MRD_ROW_YIELD, MRD_ROW_SECOND, MRD_ROW_RHO, MRD_ROW_SECOND_RHO, MRD_TABLE_ROWS };
#define MRD_ROWS 8 /* those of the force */

/* Groups of rows that are added up on their own: those up to the breakaway friction, then each of the rest. */
enum { MRD_GROUP_MOTION, MRD_GROUP_YIELD, MRD_GROUP_SECOND, MRD_GROUP_RHO, MRD_GROUP_SECOND_RHO, MRD_GROUPS };

/* A row over temperature and current is a sum of terms, each a factor that temperature moves times a column over
 * the currents. A row of the first group that the current does not move is one term without a column: a level. */
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
    int32_t currents;               /* of the columns */
    int32_t pieces;                 /* of the temperature axis, evenly from the coldest to the warmest */
    int32_t levels;                 /* how many there are; they are the first terms */
    int32_t begin[MRD_GROUPS + 1];  /* first column of each group, and how many there are */
    uint8_t row[MRD_TRACK_TERMS];   /* of each term: levels, then columns, in the rows' order */
    uint8_t quarter[MRD_TRACK_BANK]; /* which of the currents the quarters of the largest are */
    const mrd_real *current;        /* [currents], rising from 0 to the largest, closer where the force bends */
    const mrd_real *factor;         /* [pieces][levels + columns][3], a parabola in the place 0 to 1 in the piece */
    const mrd_real *column;         /* [currents][columns] */
    mrd_lookup loading, unloading; /* size of w on the universal curve over travel from w = 0 */
    mrd_lookup unload_map;      /* a turn: travel of unloading over that of loading */
    mrd_lookup reload_map;      /* ... and back, over the first half of the travel of unloading */
    mrd_lookup reload_map_rest;  /* the same over what is left of the second half, sign reversed */
    mrd_lookup viscous;         /* size of the viscous speed */
    mrd_lookup sliding;         /* of the sliding friction's share */
    mrd_lookup breakaway;
    mrd_lookup saturation;      /* of a yield force that saturates with speed, or of one without memory */
    const mrd_series *series; /* series valve and chain, which use none of the tables above; NULL: another law */
} mrd_track;

/* Where the chain stands between steps. */
typedef struct {
    mrd_real e, y;     /* spring's travel [m], valve's velocity [m/s] */
    mrd_real play;     /* displacement behind the play [m] */
    mrd_real cavity;   /* travel that the cavity takes [m] */
    mrd_real bristle[MRD_TRACK_BRISTLES]; /* forces [N] */
    mrd_real level[2]; /* yield and memory force that the bristles follow [N] */
} mrd_chain_state;

/* A value, and its derivatives by the moves of the command that are not decided yet. */
typedef struct {
    mrd_real at, by[MRD_TRACK_MOVES];
} mrd_moved;

/* Derivatives of a chain's state by one of those moves. */
typedef struct {
    mrd_real e, cavity, bristle[MRD_TRACK_BRISTLES], level[2];
} mrd_chain_move;

/* A quadratic in the moves: its slopes and its curvature. */
typedef struct {
    mrd_real slope[MRD_TRACK_MOVES], bend[MRD_TRACK_MOVES][MRD_TRACK_MOVES];
} mrd_move_cost;

/* What a prediction carries ahead: motion, hysteresis, lags and play, with derivatives by the moves; and what the
 * horizon costs so far. */
typedef struct {
    mrd_real x, v, a, side, place[2];
    mrd_chain_state chain;
    mrd_chain_move by[MRD_TRACK_MOVES];
    mrd_moved first, second, play[2];
    mrd_real later, weight; /* time from the sample at which it began [s]; of an error there */
    mrd_move_cost cost;
} mrd_prediction;

/* Flags of the last step. The first seven, and those from MRD_NO_CURRENT on, are faults of readings. */
enum {
    MRD_NO_DISPLACEMENT = 1, /* displacement is not a number, or far outside */
    MRD_FROZEN = 2, /* displacement is constant although the damper moved */
    MRD_MOTION_UNKNOWN = 4, /* no displacement for too long: a controller gives its fall-back */
    MRD_NO_TEMPERATURE = 8, /* temperature is not a number, or beyond its limits: the last valid one is used */
    MRD_TEMPERATURE_JUMP = 16, /* temperature moves faster than a damper warms: the last valid one is used */
    MRD_NOMINAL_TEMPERATURE = 32, /* no valid temperature for too long: the nominal one is used */
    MRD_NO_TARGET = 64, /* wanted force is not a number: zero is used */
    MRD_NO_FORCE = 128, /* no force reading although the controller feeds force back */
    MRD_OUTSIDE_MOTION = 256, /* displacement or velocity outside the identified range */
    MRD_OUTSIDE_TEMPERATURE = 512, /* temperature outside the identified range: its edge is used */
    MRD_INFEASIBLE = 1024, /* no command gives the wanted force */
    MRD_CLAMPED = 2048, /* the reversal clamp limits the command */
    MRD_SATURATED = 4096, /* the command is at one of its ends, or beyond them */
    MRD_NO_CURRENT = 8192, /* command is not a number, or far outside: the last valid one is used, then zero */
    MRD_FROZEN_TEMPERATURE = 16384, /* temperature is constant although the damper warms */
    MRD_NO_VELOCITY = 32768, /* velocity is beyond its limit: estimated from the displacement */
    MRD_INTERNAL_FAULT = 65536 /* the state was not finite and was reset */
};

typedef struct {
    mrd_real x, v, a;                 /* estimated motion */
    mrd_real reference, reference_rate, reference_bend; /* filtered target, for extrapolation */
    mrd_real first, second;           /* the command's flux behind the first and the second lag */
    mrd_real play[2];                 /* output of the play and of the wide one, less than that by the half width while it rises */
    mrd_real applied;                 /* what the force feels: behind lags and play */
    mrd_real side;                    /* 1 or -1: way that the hysteresis has gone last */
    mrd_real place[MRD_TRACK_BANK][2]; /* ... and its place on the universal curve then: of each model and element;
                                          of the series valve its spring's travel [m] and its valve's velocity [m/s] */
    mrd_real command;                 /* the last one given */
    mrd_real integral;                /* of the force feedback [A] */
    mrd_real disturbance;             /* observed, in the direction of motion [N] */
    mrd_real temperature;             /* believed [K] */
    mrd_real candidate;               /* a reading that is not believed yet */
    mrd_real read;                    /* the last temperature that was in its limits [K] */
    mrd_real temperature_rise, least_rise; /* by the energy put in since it changed: expected, at least [K] */
    mrd_real coolest;                 /* lowest temperature believed so far [K] */
    mrd_real warming;                 /* in a period, by the energy put in [K] */
    mrd_real last_x, speed_before;    /* last reading; speed when it began to repeat */
    mrd_real speed_square, bend_square, swing; /* means of v^2 and a^2, and their ratio: the jerk is -swing v */
    mrd_chain_state chain;
    mrd_real move[MRD_TRACK_MOVES];   /* of the command over the horizon, from the last prediction [A] */
    mrd_prediction ahead;             /* the one that is under way */
    mrd_real delay_line[MRD_TRACK_DELAY_LINE]; /* commands under way */
    mrd_real wanted_line[MRD_TRACK_DELAY_LINE]; /* wanted forces that were known ahead [N] */
    int32_t at;                       /* place of the newest */
    int32_t repeated, lost, back;     /* samples: equal readings, without displacement, with it again */
    int32_t followed;                 /* samples since the motion was taken up, until it has settled */
    int32_t cold, steady;             /* samples without a good temperature; with a steady candidate */
    int32_t good;                     /* samples with a good one, up to those of thermometer.hold_samples */
    int32_t started;
    int32_t temperature_frozen;       /* 1: the temperature is taken for frozen */
    int32_t unpowered;                /* samples without a good current */
    int32_t predicting;               /* samples that have gone into the prediction that is under way */
    int32_t infeasible;               /* 1: the last prediction ended short of the wanted force */
    int32_t said;                     /* 1: a wanted force has been known ahead */
    int32_t velocity_known;           /* 1: the last velocity was given */
    int32_t flags;
} mrd_track_state;

/* Inputs of a step; not-a-number for what is not known. */
typedef struct {
    mrd_real now, ahead;   /* wanted force [N], and the same at `preview` later */
    mrd_real displacement; /* [m] */
    mrd_real temperature;  /* [K] */
    mrd_real force;        /* [N] */
} mrd_inputs;

/* Inputs of a step of the model; not-a-number for what is not known. */
typedef struct {
    mrd_real displacement; /* [m] */
    mrd_real velocity;     /* [m/s]; not-a-number: estimated from the displacement */
    mrd_real current;      /* through the period that ends now [A] */
    mrd_real temperature;  /* [K] */
} mrd_model_inputs;

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s);
MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_inputs *inputs);
/* The damper's force [N]; the state is one of its own, from mrd_track_start. */
MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_model_inputs *inputs);
/* Yield, viscous and friction force and the rest [N] that the model has at the estimated state. */
MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts);

#endif
