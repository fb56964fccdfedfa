/* Simulate sampled closed loops in one call. Each loop has a controller of the kernel and a damper in C.
 *
 * The arithmetic, its order and its rounding are the same as in control/loop.py, which simulates all other controllers
 * and dampers. Tests compare the results of both bit for bit.
 */
#include <math.h>

#include "interface.h"

/* Return the value rounded to a multiple of a converter's step, halves to even. The result is never a negative zero. */
static double to_step(double value, double step) { return step * rint(value / step) + 0.0; }

static double driven(const mrd_loop *loop, double current)
{
    if (loop->current_step > 0.0) current = to_step(current, loop->current_step);
    const double above = 0.0 > current ? 0.0 : current;
    return loop->highest < above ? loop->highest : above;
}

/* Compute the controller's command at sample k; return 0 if it is not finite. */
static int command_at(const mrd_api *api, mrd_loop *loop, size_t k)
{
    mrd_inputs inputs = loop->sensed[k];
    if (!loop->reads_force) {
        inputs.force = (double)NAN;
    } else {
        if (loop->frozen[k] == 0.0) {
            loop->read = loop->felt + inputs.force;
            if (loop->force_step > 0.0 && isfinite(loop->read)) loop->read = to_step(loop->read, loop->force_step);
        }
        inputs.force = loop->read;
    }
    const double current = api->track_step(loop->track, loop->state, &inputs);
    loop->given[loop->late + 1 + k] = driven(loop, current);
    return isfinite(current);
}

int mrd_follow(const mrd_api *api, loop_plant *plant, size_t steps, const double *displacement, const double *velocity,
               size_t every, size_t apart, size_t count, mrd_loop *loops)
{
    double current[MRD_LOOPS_MAX], *force[MRD_LOOPS_MAX];
    for (size_t m = 0; m < count; m++) memset(loops[m].given, 0, (loops[m].late + 1) * sizeof(double));
    for (size_t begin = 0, k = 0; begin < steps; begin += every, k++) {
        for (size_t m = 0; m < count; m++)
            if (!command_at(api, loops + m, k)) return 0;
        const size_t end = steps - begin < every ? steps : begin + every;
        const size_t change = begin + apart < end ? begin + apart : end;
        const size_t edge[3] = {begin, change, end};
        for (size_t part = 0; part < 2; part++) { /* The command changes inside a sample. */
            const size_t from = edge[part], n = edge[part + 1] - from;
            if (!n) continue;
            for (size_t m = 0; m < count; m++) {
                current[m] = loops[m].given[k + part];
                force[m] = loops[m].force + from;
            }
            if (!plant->advance(plant, displacement + from, velocity + from, n, current, force)) return 0;
        }
        for (size_t m = 0; m < count; m++) loops[m].felt = loops[m].gain * loops[m].force[end - 1] + loops[m].offset;
    }
    return 1;
}
