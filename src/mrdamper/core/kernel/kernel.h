/* The kernel of mrdamper: hysteresis laws, their solution along a run, tangents and Gram matrices.
 *
 * The language is C99, without allocation inside the arithmetic, without global state, and without fused
 * multiply-add (compile with -ffp-contract=off). Therefore, the results of all builds are bitwise equal. kernel.c
 * includes the other files; it is compiled once per instruction set, and MRD_API() is its only external name.
 * implicit_run.c is compiled only once. It also includes the implicit laws, with a number type of one lane.
 *
 * All units are SI. Extension is positive; a force that resists extension is positive.
 */
#ifndef MRD_KERNEL_H
#define MRD_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#include "controller.h"

#define MRD_CELLS 1024   /* maximum number of cells of one branch of the universal curve */
#define MRD_COMMON 9     /* number of coefficients that every law has */
#define MRD_VISCOUS_SPEED 0.1 /* speed at which the viscosity equals viscous force / speed [m/s] */
#define MRD_DIRECTIONS 96

typedef enum {
    MRD_BOUC_WEN = 0,
    MRD_DAHL = 1,
    MRD_SATURATING = 2,
    MRD_BINGHAM = 3,
    MRD_TANH = 4,
    MRD_LUGRE = 5,
    MRD_SPENCER = 6,
    MRD_SERIES_VALVE = 7,
    MRD_DOUBLE = 8,
    MRD_CHAIN_LAW = 9
} mrd_law;

typedef enum { MRD_OK = 0, MRD_NO_MEMORY = 1, MRD_NOT_A_LAW = 2, MRD_SHAPE_VARIES = 3, MRD_NOT_TABULATED = 4 } mrd_status;

/* Order of the coefficients, the same as in models/laws.py. All laws have the first MRD_COMMON coefficients. */
enum { C_VISCOSITY, C_STIFFNESS, C_OFFSET, C_MASS, C_COULOMB, C_BREAKAWAY, C_STRIBECK, C_TRANSITION,
       C_VISCOUS_EXPONENT };
enum { BW_YIELD = MRD_COMMON, BW_RHO, BW_KAPPA, BW_N };
enum { SAT_YIELD = MRD_COMMON, SAT_RATE, SAT_VELOCITY, SAT_RHO, SAT_KAPPA, SAT_N };
enum { DB_YIELD = MRD_COMMON, DB_SECOND, DB_RHO, DB_SECOND_RHO, DB_KAPPA, DB_N };
enum { BH_YIELD = MRD_COMMON, BH_VELOCITY };
enum { TH_YIELD = MRD_COMMON, TH_SLOPE, TH_SHIFT };
enum { LG_YIELD = MRD_COMMON, LG_RHO, LG_EXCESS, LG_FADE, LG_DAMPING };
enum { SP_YIELD = MRD_COMMON, SP_SERIES, SP_VISCOSITY, SP_STIFFNESS, SP_RHO, SP_KAPPA, SP_N };
enum { SV_YIELD = MRD_COMMON, SV_THINNING, SV_EXPONENT, SV_VELOCITY, SV_POSITION, SV_SPRING, SV_GAP, SV_CORNER, SV_LEAK,
       SV_LEAK_EXPONENT, SV_COUNT };
enum { CH_YIELD = MRD_COMMON, CH_VELOCITY, CH_THINNING, CH_OWN, CH_EXPONENT, CH_SPEED, CH_ORIFICE, CH_ASYMMETRY,
       CH_FLOW_ASYMMETRY, CH_POSITION, CH_CURVATURE, CH_SPRING, CH_GAP, CH_CORNER, CH_LEAK, CH_LEAK_EXPONENT,
       CH_SHARE, CH_BRISTLE, CH_SPREAD,
       CH_FRICTION, CH_FRICTION_STIFFNESS, CH_EXCESS, CH_FADE, CH_MEMORY, CH_MEMORY_STIFFNESS, CH_GAS, CH_GAS_LENGTH,
       CH_PLAY, CH_FOLLOW, CH_CREEP, CH_KNEE,
       CH_CAVITY_LENGTH, CH_CAVITY, CH_BUBBLE, CH_BYPASS, CH_COUNT };

/* A measured or prescribed run, or a batch of its samples: kinematics at a uniform step, and monotone pieces.
 *
 * The first n of the `known` samples of a batch are settled: later samples do not change their piece. Sample 0 of every
 * batch except the first is the last settled sample of the previous batch (`behind` is 1); it is in no piece.
 */
typedef struct {
    size_t n;            /* number of settled samples, whose forces are computed */
    size_t known;        /* number of samples in x, v, a and the rows of coefficients; equal to n for a whole run */
    size_t behind;       /* 1: the force of sample 0 was computed in the previous batch */
    double step;         /* [s] */
    const double *x;     /* displacement [m] */
    const double *v;     /* velocity [m/s] */
    const double *a;     /* acceleration [m/s2] */
    size_t pieces;       /* monotone pieces of motion */
    size_t *first;       /* [pieces + 1] first sample of each piece */
    double *turn;        /* [pieces + 1] displacement where each piece starts [m] */
    double *side;        /* [pieces] +1 extending, -1 retracting */
    double *path;        /* [n] travel since the last turning point [m], which never falls inside a piece; NULL if
                            side * (x - turn) never falls and is used instead */
    double travelled;    /* path at sample 0 if `behind` is 1 [m] */
    size_t substeps;     /* integration steps of the stepped laws per sample */
    double longest_step; /* longest integration step of these laws [s] */
} mrd_record;

/* State of a motion between two batches of samples; zero before the first. It contains no pointers. */
typedef struct {
    double begun;        /* 1 once a sample is settled */
    double side, turn;   /* direction and turning point of the unfinished piece */
    double inside;       /* 1: the last settled sample is in this piece */
    double path;         /* path of the last settled sample in this piece [m] */
    double furthest;     /* displacement of the extreme sample of this piece [m] */
    double turns_at;     /* displacement of the turning point at this sample, if the sample is already settled [m] */
} mrd_motion;

/* State of the search for turning points; zeros before the first sample. */
typedef struct {
    double taken;             /* number of processed samples */
    double side;              /* 1: rising, -1: falling, 0: the motion is still within the dead band of its start */
    double furthest, at;      /* extreme in the present direction, and its sample; -1: the first sample */
    double lowest, lowest_at; /* lower extreme and its sample while side is 0 (`furthest` is then the upper extreme) */
    double turned;            /* sample of the latest turning point */
} mrd_turns;

/* State of a law between two batches; zero before the first batch. */
typedef struct {
    double begun;
    double kappa, n;                        /* values in the first batch */
    double tau[2], base[2], from[2], rho[2]; /* Bouc-Wen family, by element: see travel_to() in hysteresis.c */
    double w;                               /* LuGre */
    double y, q, q_rate;                    /* Spencer; series valve: y; chain: y, q */
    double lag[2], change[2];               /* series valve, chain: elastic velocity, its change in the last step */
    double e, side, place;                  /* Spencer */
    double play, cavity, bristle[5], level[2]; /* chain */
} mrd_state;

/* A direction of differentiation: a coefficient, and its seed (derivative along the direction) at each sample
 * (NULL: 1). */
typedef struct {
    int coefficient;
    const double *seed;
    size_t stride;       /* 0: one value for the whole run; 1: one per sample */
} mrd_direction;

/* A law and its coefficients along one run. */
typedef struct {
    mrd_law law;
    const double *coefficient; /* one row per coefficient; a row has one value, or one value per sample */
    size_t stride;             /* 0: constant over the run; otherwise the length of a row */
} mrd_model;

/* The last tabulated universal curve, for successive calls on one thread. */
typedef struct mrd_workspace mrd_workspace;

typedef struct {
    const char *name;
    mrd_workspace *(*workspace_open)(void); /* NULL: no memory */
    void (*workspace_close)(mrd_workspace *workspace);
    mrd_status (*record_open)(mrd_record *record, size_t n, double step, const double *x, const double *v,
                              const double *a, double dead_band, double longest_step);
    mrd_status (*batch_open)(mrd_record *record, size_t n, double step, const double *x, const double *v,
                             const double *a, double dead_band, double longest_step, size_t patience, int last,
                             mrd_motion *motion);
    void (*record_close)(mrd_record *record);
    int (*coefficient_count)(int law);
    mrd_status (*run)(const mrd_model *model, const mrd_record *record, size_t directions,
                      const mrd_direction *direction, double *force, double *columns, mrd_workspace *workspace);
    mrd_status (*carry)(const mrd_model *model, const mrd_record *record, mrd_state *state, double *force,
                        mrd_workspace *workspace);
    mrd_status (*causal)(const mrd_model *model, const mrd_record *record, double *force);
    mrd_status (*squared_errors)(mrd_law law, size_t runs, const mrd_record *const *records,
                                 const double *const *measured, const size_t *from, size_t candidates,
                                 const double *coefficients, double *errors);
    mrd_status (*gram)(size_t rows, size_t n, const double *columns, size_t from, double *out);
    mrd_status (*gram_sums)(mrd_law law, size_t runs, const mrd_record *const *records,
                            const double *const *measured, const size_t *from, size_t candidates,
                            const double *coefficients, size_t places, const int *by, size_t part, size_t parts, double *out,
                            double *residuals);
    void (*curve)(double kappa, double n, size_t count, const double *tau, double *w, double *slope, double *by_kappa,
                  double *by_n);
    void (*lag)(size_t n, double step, double rise, double fall, double wheel, double saturation, const double *command,
                double *applied, double *by_lag, const double *before);
    size_t (*turns)(mrd_turns *turns, size_t n, const double *x, double dead_band, double *at);
    void (*track_start)(const mrd_track *controller, mrd_track_state *state);
    mrd_real (*track_step)(const mrd_track *controller, mrd_track_state *state, const mrd_inputs *told);
    mrd_real (*model_step)(const mrd_track *model, mrd_track_state *state, const mrd_model_inputs *told);
    void (*track_parts)(const mrd_track *controller, const mrd_track_state *state, mrd_real *parts);
} mrd_api;

#endif
