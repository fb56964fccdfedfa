/* The controller's step: wanted force, displacement and temperature in, current out.
 *
 * Everything that a target needs is here and in controller.c: no allocation, no library function, no global
 * state, one number type (MRD_REAL, double unless it is defined). What needs exponentials and powers is
 * tabulated beforehand: control/tables.py fills a `mrd_track`. SI and kelvin; extension positive.
 */
#ifndef MRD_CONTROLLER_H
#define MRD_CONTROLLER_H

#ifndef MRD_REAL
#define MRD_REAL double
#define MRD_REAL_DIGITS 52 /* bits of its mantissa: 52 or 23 */
#endif

#include <stdint.h>
#include <string.h>

typedef MRD_REAL mrd_real;
#if MRD_REAL_DIGITS == 52
typedef uint64_t mrd_pattern;
#define MRD_PATTERN_ONE UINT64_C(0x3ff0000000000000)
#else
typedef uint32_t mrd_pattern;
#define MRD_PATTERN_ONE UINT32_C(0x3f800000)
#endif

#define MRD_TRACK_DELAY 128  /* most samples between a command and its first effect, less one */
#define MRD_TRACK_BANK 9     /* most currents of a bank */
#define MRD_TRACK_CURRENTS 65 /* most currents of the table */
#define MRD_TRACK_ROWS 8     /* rows of the table: what multiplies each term of the force */

/* A function of a size u >= 0: cubics on cells that double in width with every octave of u + offset. */
typedef struct {
    mrd_real offset;        /* power of two */
    mrd_real top;           /* largest u + offset inside the table */
    int bits;               /* log2 of the cells in an octave */
    int cells;
    const mrd_real *cell;   /* [4 * cells] */
} mrd_octaves;

/* The numbers of a controller, in the order in which a binding or an exporter gives them. */
#define MRD_TRACK_NUMBERS(X)                                                                                   \
    X(period)            /* [s] */                                                                             \
    X(currents)          /* columns of the table */                                                            \
    X(temperatures)      /* its sheets */                                                                      \
    X(largest)           /* last column's current [A]; the first is 0 */                                       \
    X(coldest)           /* first sheet's temperature [K] */                                                   \
    X(warmest)           /* last sheet's temperature [K] */                                                    \
    X(elements)          /* hysteretic elements, 1 or 2 */                                                     \
    X(saturating)        /* the first element also carries a force that builds up with speed */               \
    X(gain_x)            /* of the motion filter [-] */                                                        \
    X(gain_v)            /* [1/s] */                                                                           \
    X(gain_a)            /* [1/s2] */                                                                          \
    X(delay)             /* whole samples of dead time */                                                      \
    X(delay_part)        /* and the part of one [-] */                                                         \
    X(lag_steps)         /* steps of the lags in a period */                                                   \
    X(rise)              /* what is left of the first lag's gap after such a step, command above it [-] */     \
    X(fall)              /* ... below it */                                                                    \
    X(second)            /* of the second lag's */                                                             \
    X(preview)           /* the force is set for so much later [s] */                                          \
    X(margin)            /* reversal clamp: at most so much above the static answer [A]; negative: none */     \
    X(reach)             /* share of the gap left by the lags that the command makes up for [-] */             \
    X(is_static)         /* the hysteresis is taken as settled */                                              \
    X(bank)              /* models at constant currents; 0: one model at the applied current */                \
    X(e1) X(e2) X(e3)

typedef struct {
#define X(name) mrd_real name;
    MRD_TRACK_NUMBERS(X)
#undef X
    const mrd_real *force;  /* [temperatures][MRD_TRACK_ROWS][currents] */
    const mrd_real *rho;    /* [temperatures][2][currents] */
    mrd_octaves rise_curve, fall_curve; /* the universal curve of the hysteresis */
    mrd_octaves viscous;    /* |v|^m, scaled */
    mrd_octaves side;       /* tanh(|v| / vt) */
    mrd_octaves breakaway;  /* the same times exp(-(v / vs)^2) */
    mrd_octaves share;      /* |v| / (|v| + v0) */
} mrd_track;

enum { MRD_ROW_OFFSET, MRD_ROW_STIFFNESS, MRD_ROW_MASS, MRD_ROW_VISCOUS, MRD_ROW_COULOMB, MRD_ROW_BREAKAWAY,
       MRD_ROW_YIELD, MRD_ROW_SECOND };

typedef struct {
    mrd_real x, v, a;             /* estimated motion */
    mrd_real first, second;       /* the applied current behind the first and the second lag [A] */
    mrd_real side;                /* direction of motion that tau is counted in */
    mrd_real tau[2];              /* place on the universal curve, of each element */
    mrd_real bank_tau[MRD_TRACK_BANK][2];
    mrd_real command;             /* last command [A] */
    mrd_real line[MRD_TRACK_DELAY]; /* commands under way */
    mrd_real temperature;
    int32_t at;                   /* place of the newest in it */
    int32_t started;
} mrd_track_state;

void mrd_track_start(const mrd_track *c, mrd_track_state *s);
mrd_real mrd_track_step(const mrd_track *c, mrd_track_state *s, mrd_real now, mrd_real ahead, mrd_real displacement,
                        mrd_real temperature);
#endif
