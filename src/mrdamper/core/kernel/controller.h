/* A force-tracking controller: wanted force, displacement and temperature in, current out. And the damper's model
 * on the same tables: displacement, current and temperature in, force out.
 *
 * Everything that a target needs is this header and five files: track_tables.c, track_series.c, track_estimate.c,
 * track_model.c, controller.c.
 * No allocation, no library function but memcpy and memset, no global state, one number type. What takes a power
 * or an exponential was tabulated beforehand (control/tables.py). SI and kelvin; extension positive; the
 * "current" is the command, in volts where the card's is.
 */
#ifndef MRD_CONTROLLER_H
#define MRD_CONTROLLER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifndef MRD_SERIES
#define MRD_SERIES 1 /* 0: the series valve law is left out of the code */
#endif

#ifndef MRD_TRACK_API
#define MRD_TRACK_API /* linkage of the public functions; kernel.c makes them static */
#endif

#ifdef MRD_SINGLE
typedef float mrd_real;
typedef uint32_t mrd_pattern;
#define MRD_DIGITS 23u
#define MRD_PATTERN_OF_ONE UINT32_C(0x3f800000)
#else
typedef double mrd_real;
typedef uint64_t mrd_pattern;
#define MRD_DIGITS 52u
#define MRD_PATTERN_OF_ONE UINT64_C(0x3ff0000000000000)
#endif

#define MRD_TRACK_CURRENTS 65 /* most currents of a table */
#define MRD_TRACK_TERMS 48    /* most terms */
#define MRD_TRACK_BANK 9      /* most models of a bank; one, or those at all, every second ... eighth of the largest */
#define MRD_TRACK_LINE 128u   /* commands under way between controller and coil, at most; a power of two */
#define MRD_TRACK_GAINS 3     /* yield, viscous and friction force, each with a gain that may be learnt */

/* A function of a size u >= 0: cubics on cells that double in width with every octave of u + offset. */
typedef struct {
    mrd_real offset;      /* a power of two */
    mrd_real top;         /* largest u + offset in the table; beyond, the last value holds */
    int32_t bits;         /* log2 of the cells in an octave */
    int32_t cells;
    const mrd_real *cell; /* [4 * cells] */
} mrd_octaves;

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

/* Rows of the series valve's coefficients; all of them may move with temperature. */
enum { MRD_CHAIN_OFFSET, MRD_CHAIN_STIFFNESS, MRD_CHAIN_THINNING, MRD_CHAIN_SLOWNESS, MRD_CHAIN_POSITION,
       MRD_CHAIN_SPRING, MRD_CHAIN_GAP, MRD_CHAIN_SHARPNESS, MRD_CHAIN_LEAK, MRD_CHAIN_MASS, MRD_CHAIN_VISCOSITY,
       MRD_CHAIN_SLIDING, MRD_CHAIN_BREAKAWAY, MRD_CHAIN_TRANSITION, MRD_CHAIN_STRIBECK, MRD_CHAIN };

/* The series valve law: its coefficients over temperature, its yield force over current as well. */
typedef struct {
    int32_t currents;      /* one more than a power of two */
    const mrd_real *yield; /* [temperatures][currents], rising with the current [N] */
    const mrd_real *chain; /* [temperatures][MRD_CHAIN]; lengths and speeds by their inverse */
    mrd_power thinning, leak, viscous;
    mrd_octaves side;      /* tanh u */
    mrd_octaves fade;      /* exp(-u^2) */
    mrd_octaves corner;    /* (sqrt(u^2 + 1) - u) / 2 */
} mrd_series;

/* The numbers of a controller, in the order in which a binding or an exporter gives them. */
#define MRD_TRACK_NUMBERS(X)                                                                                   \
    X(period)         /* [s] */                                                                                \
    X(largest)        /* current of the tables' last column [A]; the first is 0 */                             \
    X(coldest)        /* temperature of their first sheet [K] */                                               \
    X(warmest)        /* ... and of their last */                                                              \
    X(elements)       /* hysteretic elements: 0 (force follows the sign of velocity), 1 or 2 */                \
    X(saturating)     /* 1: what builds up with speed is carried by the first element */                       \
    X(filter_x)       /* gains of the motion filter [-] */                                                     \
    X(filter_v)       /* [1/s] */                                                                              \
    X(filter_a)       /* [1/s2] */                                                                             \
    X(wanted_f)       /* gains of the filter that extrapolates a target */                                     \
    X(wanted_v)                                                                                                \
    X(wanted_a)                                                                                                \
    X(dead_samples)   /* dead time of the actuation: whole periods */                                          \
    X(dead_part)      /* ... and the part of one */                                                            \
    X(rise)           /* what a period leaves of the first lag's gap, command above it [-] */                  \
    X(fall)           /* ... and below it */                                                                   \
    X(second)         /* what it leaves of the second lag's gap */                                             \
    X(rise_couple)    /* share of the first lag's gap that is in the second after a period */                  \
    X(fall_couple)                                                                                             \
    X(second_ahead)   /* the same from the last sample of the dead time to the preview */                      \
    X(rise_couple_ahead)                                                                                       \
    X(fall_couple_ahead)                                                                                       \
    X(rise_answer)    /* share of a command given now that has passed the lags at the preview */               \
    X(fall_answer)                                                                                             \
    X(play)           /* half width of the magnetic play behind the lags [A] */                                \
    X(play_share)     /* share of the field that has it, below 1 */                                            \
    X(preview)        /* the force is set for so much later [s] */                                             \
    X(reach)          /* share of the lags' remaining gap that the command makes up for */                     \
    X(margin)         /* reversal clamp: at most so much above the static answer [A]; negative: none */        \
    X(is_static)      /* 1: hysteresis taken as settled */                                                     \
    X(unlagged)       /* 1: hysteresis advanced with the command as if there were no lags */                   \
    X(bank)           /* models at constant currents, interpolated; 0: one model at the applied current */     \
    X(lead)           /* of a lead compensation [s over s]: gain of the filtered derivative; 0: none */        \
    X(lead_keep)      /* what a period leaves of its filter's gap */                                           \
    X(feed_forward)   /* share of the model's answer in the command: 1, or 0 for pure feedback */              \
    X(on_off)         /* 1: all or nothing by the sign of the force error */                                   \
    X(gain)           /* of the force error [A/N] */                                                           \
    X(rate)           /* of its integral [A/(N s)] */                                                          \
    X(gain_speed)     /* speed at which the feedback is fully there [m/s] */                                   \
    X(observe)        /* share of the force error that a disturbance observer takes on in a period */          \
    X(forget)         /* forgetting of the learnt gains; 0: none are learnt */                                 \
    X(error_variance) /* of the model's force [N2], for the learning */                                        \
    X(gain_variance)  /* of the gains before anything is learnt */                                             \
    X(low_x) X(high_x) X(high_v)          /* the data's envelope [m], [m/s] */                                 \
    X(far_x)          /* a displacement further out is a fault [m] */                                          \
    X(frozen_samples) /* equal readings that make a fault */                                                   \
    X(frozen_speed)   /* ... where the damper moved at least as fast before [m/s] */                           \
    X(coast_samples)  /* samples without displacement before the fall-back, and with it after */               \
    X(fall_back)      /* command when the motion is not known [A] */                                           \
    X(cold_limit) X(hot_limit)            /* temperatures beyond are faults [K] */                             \
    X(jump)           /* a reading further from what is believed is a fault [K] */                             \
    X(slew)           /* what is believed moves at most so much in a period [K] */                             \
    X(warm_keep)      /* what a period leaves of the gap between belief and reading */                         \
    X(hold_samples)   /* samples for which the last good temperature is held */                                \
    X(recover_samples) /* steady samples after which a reading that had jumped is believed */                  \
    X(nominal)        /* temperature to fall back to [K] */                                                    \
    X(held_temperature) /* temperature to use whatever is read [K]; 0: read it */                              \
    X(far_v)          /* a velocity beyond is a fault [m/s] */                                                 \
    X(capacity)       /* heat that warms the damper by a kelvin [J/K]; 0: nobody looks for a frozen temperature */ \
    X(loss)           /* what it loses to its surroundings [W/K] */                                            \
    X(loss_margin)    /* ... and at most so many times that */                                                 \
    X(ambient)        /* temperature of the surroundings [K] */                                                \
    X(coil_heat)      /* heat of the coil over the applied current squared [W/A2] */                           \
    X(frozen_warming) /* one reading while the damper warms by more than this is a fault [K] */                \
    X(reckon)         /* 1: a frozen temperature is carried on by the energy put in; 0: a flag only */         \
    X(unloaded)       /* travel of the universal curve from w = -1 to 0 */                                     \
    X(shared)         /* 1: rho is the same at all currents, so that a bank's models share one hysteresis */   \
    X(substeps)       /* series valve: steps in a period */                                                    \
    X(strides)        /* ... and to the preview */                                                             \
    X(horizon)        /* ... time in which its spring is taken to the wanted force [s] */

/* Rows: what the coefficients of the force are multiplied with, and the inverse yield displacements. */
enum { MRD_ROW_OFFSET, MRD_ROW_STIFFNESS, MRD_ROW_MASS, MRD_ROW_VISCOUS, MRD_ROW_SLIDING, MRD_ROW_BREAKAWAY,
       MRD_ROW_YIELD, MRD_ROW_SECOND, MRD_ROW_RHO, MRD_ROW_SECOND_RHO, MRD_TABLE_ROWS };
#define MRD_ROWS 8 /* those of the force */

/* Groups of rows that are added up on their own: those up to the breakaway friction, then each of the rest. */
enum { MRD_GROUP_MOTION, MRD_GROUP_YIELD, MRD_GROUP_SECOND, MRD_GROUP_RHO, MRD_GROUP_SECOND_RHO, MRD_GROUPS };

/* A row over temperature and current is a sum of terms, each a factor that temperature moves times a column over
 * the currents. A row of the first group that the current does not move is one term without a column: a level. */
typedef struct {
#define X(name) mrd_real name;
    MRD_TRACK_NUMBERS(X)
#undef X
    int32_t currents;               /* of the columns */
    int32_t pieces;                 /* of the temperature axis, evenly from the coldest to the warmest */
    int32_t levels;                 /* how many there are; they are the first terms */
    int32_t begin[MRD_GROUPS + 1];  /* first column of each group, and how many there are */
    uint8_t row[MRD_TRACK_TERMS];   /* of each term: levels, then columns, in the rows' order */
    uint8_t eighth[MRD_TRACK_BANK]; /* which of the currents the eighths of the largest are */
    const mrd_real *current;        /* [currents], rising from 0 to the largest, closer where the force bends */
    const mrd_real *factor;         /* [pieces][levels + columns][3], a parabola in the place 0 to 1 in the piece */
    const mrd_real *column;         /* [currents][columns] */
    mrd_octaves loading, unloading; /* size of w on the universal curve over travel from w = 0 */
    mrd_octaves from_loading;   /* a turn: travel of unloading over that of loading */
    mrd_octaves from_unloading; /* ... and back, over the first half of the travel of unloading */
    mrd_octaves from_unloaded;  /* the same over what is left of the second half, sign reversed */
    mrd_octaves viscous;   /* size of the viscous speed */
    mrd_octaves sliding;   /* of the sliding friction's share */
    mrd_octaves breakaway;
    mrd_octaves built_up;  /* of what builds up with speed, or of a yield force without memory */
    const mrd_series *series; /* the series valve law, which uses none of the tables above; NULL: another law */
} mrd_track;

/* Flags of the last step. The first seven and the last three are faults of readings. */
enum {
    MRD_NO_DISPLACEMENT = 1,    /* not a number, or far outside */
    MRD_FROZEN = 2,             /* the displacement stands still though the damper moved */
    MRD_MOTION_UNKNOWN = 4,     /* for too long: the command is the fall-back */
    MRD_NO_TEMPERATURE = 8,     /* not a number, or beyond its limits: the last good one is used */
    MRD_TEMPERATURE_JUMP = 16,
    MRD_NOMINAL_TEMPERATURE = 32, /* for too long: the nominal one is used */
    MRD_NO_TARGET = 64,         /* not a number: zero is taken */
    MRD_NO_FORCE = 128,         /* no reading where the controller feeds force back */
    MRD_OUTSIDE_MOTION = 256,   /* outside the data's displacement or velocity */
    MRD_OUTSIDE_TEMPERATURE = 512, /* the tables' edge is held */
    MRD_INFEASIBLE = 1024,      /* no current gives the wanted force */
    MRD_CLAMPED = 2048,         /* the reversal clamp holds */
    MRD_SATURATED = 4096,       /* the command is at one of its ends, or the current beyond them */
    MRD_NO_CURRENT = 8192,      /* a model's: not a number, or far outside; the last good one is used, then none */
    MRD_FROZEN_TEMPERATURE = 16384, /* it stands still though the damper warms; see `reckon` */
    MRD_NO_VELOCITY = 32768     /* a model's: beyond what can be; estimated from the displacement instead */
};

typedef struct {
    mrd_real x, v, a;                 /* estimated motion */
    mrd_real wanted, wanted_rate, wanted_bend; /* filtered target, for extrapolation */
    mrd_real first, second;           /* the command behind the first and the second lag */
    mrd_real play;                    /* the play's output, less than that by its half width while it rises */
    mrd_real applied;                 /* what the force feels: behind lags and play */
    mrd_real side;                    /* 1 or -1: way that the hysteresis has gone last */
    mrd_real place[MRD_TRACK_BANK][2]; /* ... and its place on the universal curve then: of each model and element;
                                          of the series valve its spring's travel [m] and its valve's velocity [m/s] */
    mrd_real command;                 /* the last one given */
    mrd_real leading;                 /* filter of the lead compensation */
    mrd_real integral;                /* of the force feedback [A] */
    mrd_real disturbance;             /* observed, in the direction of motion [N] */
    mrd_real gain[MRD_TRACK_GAINS];   /* learnt */
    mrd_real spread[MRD_TRACK_GAINS * MRD_TRACK_GAINS]; /* their covariance */
    mrd_real temperature;             /* believed [K] */
    mrd_real probe;                   /* a reading that is not believed yet */
    mrd_real read;                    /* the last temperature that was in its limits [K] */
    mrd_real warmed, warmed_least;    /* what the energy put in since it changed warms: as reckoned, at least [K] */
    mrd_real coolest;                 /* lowest temperature believed so far [K] */
    mrd_real last_x, speed_before;    /* last reading; speed when it began to repeat */
    mrd_real line[MRD_TRACK_LINE];    /* commands under way */
    int32_t at;                       /* place of the newest */
    int32_t repeated, lost, back;     /* samples: equal readings, without displacement, with it again */
    int32_t cold, steady;             /* samples without a good temperature; with a steady probe */
    int32_t started;
    int32_t stuck;                    /* 1: the temperature is taken for frozen */
    int32_t term;                     /* of the force whose work was counted last */
    int32_t unpowered;                /* samples without a good current */
    int32_t driven;                   /* 1: the last velocity was told */
    int32_t flags;
} mrd_track_state;

/* What a step is told; not-a-number for what is not known. */
typedef struct {
    mrd_real now, ahead;   /* wanted force [N], and the same at `preview` later */
    mrd_real displacement; /* [m] */
    mrd_real temperature;  /* [K] */
    mrd_real force;        /* [N] */
} mrd_told;

/* What a step of the model is told; not-a-number for what is not known. */
typedef struct {
    mrd_real displacement; /* [m] */
    mrd_real velocity;     /* [m/s]; not-a-number: estimated from the displacement */
    mrd_real current;      /* through the period that ends now [A] */
    mrd_real temperature;  /* [K] */
} mrd_driven;

MRD_TRACK_API void mrd_track_start(const mrd_track *c, mrd_track_state *s);
MRD_TRACK_API mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, const mrd_told *told);
/* The damper's force [N]; the state is one of its own, from mrd_track_start. */
MRD_TRACK_API mrd_real mrd_model_step(const mrd_track *c, mrd_track_state *s, const mrd_driven *told);
/* Yield, viscous and friction force and the rest [N] that the model has at the estimated state. */
MRD_TRACK_API void mrd_track_parts(const mrd_track *c, const mrd_track_state *s, mrd_real *parts);

#endif
