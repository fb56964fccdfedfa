/* Control loop at 1 kHz, independent of the board: controller with parameters in RAM, and thermal model instead of a
 * thermometer.
 *
 * The damper is the exported model, moved by 8 mm at 1 Hz. On a real target, a sensor measures the displacement, and
 * `current` is sent to the driver.
 */
#include "loop.h"

#include <math.h> /* only for the constant NAN, which needs no library */

#include "damper_thermal.h"

static mrd_track data; /* copy of the controller data in RAM, where they can be changed */
static damper_controller_state controller;
static damper_model_state damper;
static damper_thermal_state heat;
static damper_thermal_output warm;
static mrd_real cosine, sine, current, force;
static uint32_t flags;

void loop_begin(void)
{
    damper_controller_start(&controller);
    damper_model_start(&damper);
    damper_thermal_start(&heat, (mrd_real)NAN);
    warm.fluid = (mrd_real)293.15;
    data = damper_controller_data;
    cosine = (mrd_real)1.0;
    sine = (mrd_real)0.0;
}

/* Compute one step. The board calls this function every millisecond. */
void loop_step(void)
{
    const mrd_real turn = (mrd_real)6.2831853e-3, c = cosine - turn * sine, s = sine + turn * c; /* rotation for a sine of 1 Hz */
    const mrd_real displacement = (mrd_real)8e-3 * s, velocity = (mrd_real)50.265e-3 * c, nothing = (mrd_real)NAN;
    const damper_controller_input asked = {(mrd_real)600.0 * c, nothing, displacement, warm.fluid, nothing};
    const damper_model_input moved = {displacement, velocity, current, warm.fluid};
    damper_controller_output answer;
    damper_model_output felt;
    cosine = c;
    sine = s;
    damper_model_step(&damper, &moved, &felt);
    damper_controller_step_with(&data, &controller, &asked, &answer);
    const damper_thermal_input load = {felt.force, velocity, current, (mrd_real)293.15, (mrd_real)0.0, nothing, nothing};
    damper_thermal_step(&heat, &load, &warm);
    current = answer.current;
    force = felt.force;
    flags = answer.flags | felt.flags;
}

void loop_end(uint32_t shown[LOOP_SHOWN])
{
    const mrd_real values[3] = {current, force, warm.fluid};
    for (int i = 0; i < 3; i++) (void)memcpy(&shown[i], &values[i], sizeof shown[i]); /* Copy the bits of the float. */
    shown[3] = flags;
}
