/* A thermal model of a damper: force, velocity and current in; temperatures and the time to the first limit out.
 *
 * At most six states: modes of conduction inside the damper, the uniform temperature first. Each kind of surface
 * gives heat off by the film of its mean temperature. A step adds up work and the square of the current; every
 * `every` steps the states go on by one implicit step, which is stable however long it is. A thermometer in the
 * fluid and the coil's resistance correct the states and a heat that the model does not have; neither is needed.
 */
#ifndef MRD_THERMAL_H
#define MRD_THERMAL_H

#include "controller.h"

#ifndef MRD_THERMAL_API
#define MRD_THERMAL_API /* linkage of the public functions */
#endif

#define MRD_THERMAL_STATES 6
#define MRD_THERMAL_KINDS 8   /* most kinds of surface */
#define MRD_THERMAL_POINTS 3  /* candidate points of each part for its hottest point */
#define MRD_THERMAL_ROWS 11   /* mean of the fluid, mean of the coil, points of the parts */
#define MRD_THERMAL_SENSORS 2 /* thermometer in the fluid, resistance of the coil: the first two rows */

typedef struct {
    int32_t states, kinds;
    int32_t every;              /* steps between two updates of the states */
    int32_t speeds, differences;
    mrd_real update;            /* time between two updates [s] */
    mrd_real reference;         /* temperatures of the states count from it [K] */
    mrd_real film_ambient;      /* middle one of three even ambients of the films' table [K] */
    mrd_real film_width;        /* between two of them [K] */
    mrd_real air_speed;         /* default air speed [m/s] */
    mrd_real coil_heat;         /* coil heat at 20 degC over the square of the command [W/A^2 or W/V^2] */
    mrd_real resistance;        /* coil resistance at 20 degC [ohm]; 0: it is not a sensor */
    mrd_real least_command;     /* minimum command for a resistance reading [A or V] */
    mrd_real smoothing;         /* share that an update has in the power for the time to the limit */
    mrd_real most_excess;       /* limit of the missing heat [W] */
    mrd_real fading;            /* remaining fraction of the missing heat after an update without a reading */
    mrd_real still;             /* readings that differ by less are constant [K] */
    mrd_real frozen_change;     /* change of the model at a constant reading that means frozen [K] */
    mrd_real wrong;             /* maximum difference between model and reading [K] */
    mrd_real limit_gap, limit_coil, limit_seal; /* limits at the hottest point of each part [K] */
    uint8_t law[MRD_THERMAL_KINDS]; /* row of the films for each kind */
    const mrd_real *capacity;   /* [states], [J/K] */
    const mrd_real *conductance; /* [states], [W/K] */
    const mrd_real *mechanical; /* [states], share of the mechanical power */
    const mrd_real *electrical; /* [states], share of the coil's heat */
    const mrd_real *area;       /* [kinds][states][states], [m^2] */
    const mrd_real *mean;       /* [kinds][states] */
    const mrd_real *radiation;  /* [kinds], [W/(m^2 K^4)] */
    const mrd_real *mount;      /* [kinds], [W/(m^2 K)] */
    const mrd_real *speed;      /* [speeds], [m/s] */
    const mrd_real *above;      /* [differences], of a surface to the air [K] */
    const mrd_real *film;       /* [films][3 ambients][speeds][differences], [W/(m^2 K)] */
    const mrd_real *row;        /* [rows][states] */
    const mrd_real *through;    /* [rows][2], of mechanical power and coil heat [K/W] */
    const mrd_real *gain;       /* [sensors][states + 1], of states and excess heat by kelvin of a reading */
} mrd_thermal;

/* Flags flags of the last update. */
enum {
    MRD_THERMAL_NO_POWER = 1,      /* force or velocity was not known: the power before is used */
    MRD_THERMAL_NO_AMBIENT = 2,    /* the last value, or the default, is used */
    MRD_THERMAL_NO_AIR_SPEED = 4,  /* the last one, or the drawing's, is used */
    MRD_THERMAL_NO_THERMOMETER = 8, /* none, or not a temperature */
    MRD_THERMAL_FROZEN = 16,       /* the thermometer is constant although the damper warms or cools */
    MRD_THERMAL_WRONG = 32,        /* the thermometer differs too much from the model and is rejected */
    MRD_THERMAL_NO_RESISTANCE = 64, /* none, too little current, or no resistance of this coil */
    MRD_THERMAL_LIMIT = 128,       /* a part is at its limit or beyond */
    MRD_THERMAL_OUTSIDE = 256,     /* air or surface outside the table of films: its edge is held */
    MRD_THERMAL_FAULT = 512        /* the state was invalid and was reset */
};

/* Inputs of a step; NaN if unknown. */
typedef struct {
    mrd_real force, velocity; /* [N], [m/s] */
    mrd_real command;         /* command in the coil [A or V] */
    mrd_real ambient;         /* [K] */
    mrd_real air_speed;       /* across the axis [m/s] */
    mrd_real thermometer;     /* thermometer in the fluid [K] */
    mrd_real resistance;      /* resistance of the coil [ohm] */
} mrd_thermal_inputs;

/* What holds for a while. */
typedef struct {
    mrd_real power;  /* mechanical, mean [W] */
    mrd_real square; /* of the command, mean [A^2 or V^2] */
    mrd_real coil_W; /* coil heat at its temperature */
    mrd_real ambient, air_speed;
} mrd_thermal_load;

typedef struct {
    mrd_real fluid;         /* mean [K] */
    mrd_real gap;           /* hottest point of the gap [K] */
    mrd_real coil;          /* hottest point of the coil [K] */
    mrd_real seal;          /* hottest point of the rod's seals [K] */
    mrd_real time_to_limit; /* time to the first limit at the present load [s]; MRD_THERMAL_HORIZON or longer */
} mrd_thermal_outputs;

typedef struct {
    mrd_real z[MRD_THERMAL_STATES];
    mrd_real ahead[MRD_THERMAL_STATES]; /* states on the way ahead to the limit */
    mrd_thermal_load load;              /* of the last update */
    mrd_real slow_power, slow_square;   /* smoothed, for the way ahead */
    mrd_real ahead_time, ahead_step, ahead_hottest; /* [s], [s], nearest to its limit there [K] */
    mrd_real begun;                     /* time since the way ahead began [s] */
    mrd_real time_left;                 /* [s] */
    mrd_real work, square;              /* added up since the last update */
    mrd_real excess;                    /* heat that the model does not have [W] */
    mrd_real still_reading, still_model; /* first of the constant readings, and the model temperature then [K] */
    mrd_real still_excess;              /* excess heat then [W] */
    mrd_real corrected;                 /* corrections of the model since then [K] */
    mrd_thermal_outputs found;          /* by the last update */
    int32_t count;                      /* steps since the last update */
    int32_t powers, squares, missed;    /* of them: with power, with a command, without one of the two */
    int32_t started, way;               /* 1: there is a temperature; a way ahead is under way */
    int32_t frozen;
    int32_t flags;
} mrd_thermal_state;

#define MRD_THERMAL_HORIZON 7200 /* [s] */

/* Start at a uniform temperature [K]; NaN: thermometer reading, otherwise ambient, at the first update. */
MRD_THERMAL_API void mrd_thermal_start(const mrd_thermal *c, mrd_thermal_state *s, mrd_real kelvin);
/* One step of the control period. */
MRD_THERMAL_API void mrd_thermal_step(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in,
                                    mrd_thermal_outputs *out);

#endif
