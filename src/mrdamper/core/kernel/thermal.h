/* A thermal model of a damper. Inputs: force, velocity and current. Outputs: temperatures and the time to the first
 * limit.
 *
 * The model has at most six states: the uniform temperature, then modes of conduction inside the damper. Each kind of
 * surface loses heat with the heat-transfer coefficient at its mean temperature. Each call adds up work and the square
 * of the current. After `every` calls, one implicit step, which is unconditionally stable, advances the states. A
 * thermometer in the fluid and the resistance of the coil correct the states and the missing heat flow. This is the
 * heat flow that the model does not contain. Both sensors are optional.
 */
#ifndef MRD_THERMAL_H
#define MRD_THERMAL_H

#include "controller.h"

#ifndef MRD_THERMAL_API
#define MRD_THERMAL_API /* linkage of the public functions */
#endif

#define MRD_THERMAL_STATES 6
#define MRD_THERMAL_KINDS 8   /* maximum number of kinds of surface */
#define MRD_THERMAL_POINTS 3  /* candidate points of each part for its hottest point */
#define MRD_THERMAL_ROWS 11   /* number of temperatures: mean of the fluid, mean of the coil, 3 points of 3 parts */
#define MRD_THERMAL_SENSORS 2 /* thermometer (mean fluid temperature) and coil resistance (mean coil temperature) */

typedef struct {
    int32_t states, kinds;
    int32_t every;              /* number of steps between two updates of the states */
    int32_t speeds, differences;
    mrd_real update;            /* time between two updates [s] */
    mrd_real reference;         /* temperature at which all states are zero [K] */
    mrd_real film_ambient;      /* middle of the three ambient temperatures of `film` [K] */
    mrd_real film_width;        /* difference between two of these ambient temperatures [K] */
    mrd_real air_speed;         /* default air speed [m/s] */
    mrd_real coil_heat;         /* coil heat at 20 degC divided by the square of the command [W/A^2 or W/V^2] */
    mrd_real resistance;        /* coil resistance at 20 degC [ohm]; 0: the coil is not used as a sensor */
    mrd_real least_command;     /* minimum command for a resistance reading [A or V] */
    mrd_real smoothing;         /* weight of an update in the smoothed power for the time to the limit */
    mrd_real most_excess;       /* maximum of the missing heat flow [W] */
    mrd_real fading;            /* remaining fraction of the missing heat flow after an update without a reading */
    mrd_real still;             /* readings that differ by less count as constant [K] */
    mrd_real frozen_change;     /* a constant reading is frozen if the model changes by more than this [K] */
    mrd_real wrong;             /* maximum difference between model and reading [K] */
    mrd_real limit_gap, limit_coil, limit_seal; /* limits at the hottest point of each part [K] */
    uint8_t law[MRD_THERMAL_KINDS]; /* index in `film` for each kind */
    const mrd_real *capacity;   /* [states], [J/K] */
    const mrd_real *conductance; /* [states], [W/K] */
    const mrd_real *mechanical; /* [states], fraction of the mechanical power */
    const mrd_real *electrical; /* [states], fraction of the coil heat */
    const mrd_real *area;       /* [kinds][states][states], [m^2] */
    const mrd_real *mean;       /* [kinds][states] */
    const mrd_real *radiation;  /* [kinds], [W/(m^2 K^4)] */
    const mrd_real *mount;      /* [kinds], [W/(m^2 K)] */
    const mrd_real *speed;      /* [speeds], [m/s] */
    const mrd_real *above;      /* [differences], temperature of a surface minus temperature of the air [K] */
    const mrd_real *film;       /* [films][3 ambients][speeds][differences], heat-transfer coefficients [W/(m^2 K)] */
    const mrd_real *row;        /* [rows][states] */
    const mrd_real *through;    /* [rows][2], feedthrough of mechanical power and coil heat [K/W] */
    const mrd_real *gain;       /* [sensors][states + 1], correction of states and missing heat flow per kelvin */
} mrd_thermal;

/* Flags of the last update. */
enum {
    MRD_THERMAL_NO_POWER = 1,      /* force, velocity or command was invalid in a step: this value is ignored */
    MRD_THERMAL_NO_AMBIENT = 2,    /* ambient temperature is invalid: the last value, or the default, is used */
    MRD_THERMAL_NO_AIR_SPEED = 4,  /* air speed is invalid: the last value, or the default, is used */
    MRD_THERMAL_NO_THERMOMETER = 8, /* thermometer is missing or invalid */
    MRD_THERMAL_FROZEN = 16,       /* the thermometer is constant although the damper warms or cools */
    MRD_THERMAL_WRONG = 32,        /* the thermometer differs too much from the model and is rejected */
    MRD_THERMAL_NO_RESISTANCE = 64, /* resistance is missing or implausible, or the current is too small */
    MRD_THERMAL_LIMIT = 128,       /* a part is at its limit or above */
    MRD_THERMAL_OUTSIDE = 256,     /* air or surface is outside the table `film`: the end of the table is used */
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

/* Load and surroundings since the last update. */
typedef struct {
    mrd_real power;  /* mean mechanical power [W] */
    mrd_real square; /* mean square of the command [A^2 or V^2] */
    mrd_real coil_W; /* coil heat at the temperature of the coil */
    mrd_real ambient, air_speed;
} mrd_thermal_load;

typedef struct {
    mrd_real fluid;         /* mean fluid temperature [K] */
    mrd_real gap;           /* hottest point of the gap [K] */
    mrd_real coil;          /* hottest point of the coil [K] */
    mrd_real seal;          /* hottest point of the rod's seals [K] */
    mrd_real time_to_limit; /* time to the first limit at the present load [s]; MRD_THERMAL_HORIZON: no limit before */
} mrd_thermal_outputs;

typedef struct {
    mrd_real z[MRD_THERMAL_STATES];
    mrd_real ahead[MRD_THERMAL_STATES]; /* predicted states on the way to the limit */
    mrd_thermal_load load;              /* load of the last update */
    mrd_real slow_power, slow_square;   /* smoothed load for the prediction */
    mrd_real ahead_time, ahead_step, ahead_hottest; /* time and step of the prediction [s], its smallest margin [K] */
    mrd_real begun;                     /* time since the prediction began [s] */
    mrd_real time_left;                 /* time to the first limit [s] */
    mrd_real work, square;              /* sums of power and squared command since the last update */
    mrd_real excess;                    /* missing heat flow [W] */
    mrd_real still_reading, still_model; /* first of the constant readings, and the model temperature then [K] */
    mrd_real still_excess;              /* missing heat flow then [W] */
    mrd_real corrected;                 /* corrections of the model since then [K] */
    mrd_thermal_outputs found;          /* outputs of the last update */
    int32_t count;                      /* steps since the last update */
    int32_t powers, squares, missed;    /* number of steps with power, with command; 1 if either was missing once */
    int32_t started, way;               /* 1: a temperature is known; 1: a prediction is unfinished */
    int32_t frozen;
    int32_t flags;
} mrd_thermal_state;

#define MRD_THERMAL_HORIZON 7200 /* longest predicted time to a limit [s] */

/* Start at a uniform temperature [K]. NaN: the first update sets it to the thermometer reading, or else to ambient. */
MRD_THERMAL_API void mrd_thermal_start(const mrd_thermal *c, mrd_thermal_state *s, mrd_real kelvin);
/* Compute one step, which is called once per control period. */
MRD_THERMAL_API void mrd_thermal_step(const mrd_thermal *c, mrd_thermal_state *s, const mrd_thermal_inputs *in,
                                    mrd_thermal_outputs *out);

#endif
