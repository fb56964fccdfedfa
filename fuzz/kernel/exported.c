/* Fuzzing of exported C: any readings, in any order, through the controller and the model on a real card's tables.
 *
 * The command is always a number from 0 to the largest, the model's force always finite; flags are known ones.
 */
#include "damper.h"

#include "bytes.h"

#define MOST 64 /* steps */
#define FLAGS 0xffffu

static mrd_real real(bytes *b) { return (mrd_real)any(b); }

/* Ordinary readings, so that what follows meets a state that is not the first. */
static mrd_real reading(bytes *b, double low, double high) { return next(b) % 4 ? (mrd_real)between(b, low, high) : real(b); }

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes b = {data, size};
    damper_controller_state controller;
    damper_model_state model;
    damper_controller_start(&controller);
    damper_model_start(&model);
    for (int k = 0; k < MOST && b.left; k++) {
        const damper_controller_input in = {reading(&b, -2000.0, 2000.0), reading(&b, -2000.0, 2000.0), reading(&b, -0.02, 0.02),
                                            reading(&b, 280.0, 400.0), reading(&b, -2000.0, 2000.0)};
        damper_controller_output out;
        damper_controller_step(&controller, &in, &out);
        promise(out.current >= (mrd_real)0 && out.current <= damper_controller_data.axes.largest,
                "the command is in its range", (double)out.current);
        promise(isfinite((double)out.force), "the force that is believed is finite", (double)out.force);
        promise((out.flags & ~FLAGS) == 0, "flags are known ones", out.flags);

        const damper_model_input drive = {in.displacement, reading(&b, -0.5, 0.5), reading(&b, 0.0, 2.0), in.temperature};
        damper_model_output force;
        damper_model_step(&model, &drive, &force);
        promise(isfinite((double)force.force), "the model's force is finite", (double)force.force);
        promise(isfinite((double)force.applied), "the applied command is finite", (double)force.applied);
    }
    return 0;
}
