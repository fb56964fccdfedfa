/* The sampled closed loop of control/loop.py in one call: a controller of the kernel on a damper in C.
 *
 * Included by module.c. The arithmetic, its order and its rounding are those of the loop in Python, which serves
 * every other controller and damper; tests compare the two bit for bit.
 */
#include "loop_plant.h"

/* Columns of what the sensors say at a sample, in the order of mrd_inputs; the force's is its noise. */
enum { SENSED = 5, SENSED_FORCE = 4 };

typedef struct {
    int every, late, apart; /* plant steps per sample; samples and then steps by which a command comes late */
    int reads_force;
    double gain, highest, current_step, force_step; /* of the damper's force; of the driver [A]; of the converters, 0: none */
} loop_settings;

typedef struct {
    const double *displacement, *velocity; /* [steps] */
    const double *sensed, *frozen;         /* [samples][SENSED], [samples] */
    size_t steps, samples;
    double *force, *given; /* [steps], [late + 1 + samples]: the commands, of which the first are zero */
} loop_arrays;

/* A multiple of a converter's step, halves to the even one; never a negative zero. */
static double to_step(double value, double step) { return step * rint(value / step) + 0.0; }

static double driven(const loop_settings *set, double current)
{
    if (set->current_step > 0.0) current = to_step(current, set->current_step);
    const double above = 0.0 > current ? 0.0 : current;
    return set->highest < above ? set->highest : above;
}

/* Returns 0 where a command is not finite, or the damper refuses a sample. */
static int close_loop(const TrackerObject *tracker, state_room *state, loop_plant *plant, const loop_settings *set,
                      const loop_arrays *at)
{
    const size_t every = (size_t)set->every, late = (size_t)set->late;
    double felt = 0.0, said = 0.0;
    for (size_t k = 0; k < at->samples; k++) {
        double inputs[SENSED];
        memcpy(inputs, at->sensed + SENSED * k, sizeof inputs);
        if (!set->reads_force) {
            inputs[SENSED_FORCE] = Py_NAN;
        } else {
            if (at->frozen[k] == 0.0) {
                said = felt + inputs[SENSED_FORCE];
                if (set->force_step > 0.0 && isfinite(said)) said = to_step(said, set->force_step);
            }
            inputs[SENSED_FORCE] = said;
        }
        const double current = tracker->face->step(tracker->track, state, inputs);
        if (!isfinite(current)) return 0;
        at->given[late + 1 + k] = driven(set, current);
        const size_t begin = k * every, rest = at->steps - begin, end = begin + (rest < every ? rest : every);
        const size_t switched = begin + (size_t)set->apart, change = switched < end ? switched : end;
        const double *x = at->displacement, *v = at->velocity;
        if (!plant->advance(plant, x + begin, v + begin, at->given[k], change - begin, at->force + begin)) return 0;
        if (!plant->advance(plant, x + change, v + change, at->given[k + 1], end - change, at->force + change)) return 0;
        felt = set->gain * at->force[end - 1];
    }
    return 1;
}

enum { LOOP_DISPLACEMENT, LOOP_VELOCITY, LOOP_SENSED, LOOP_FROZEN, LOOP_FORCE, LOOP_GIVEN, LOOP_ARRAYS };

static int loop_fits(const loop_settings *set, const loop_arrays *at, const Py_buffer *view)
{
    if (set->every < 1 || set->late < 0 || set->apart < 0 || set->apart >= set->every || !at->steps) return 0;
    const size_t every = (size_t)set->every;
    return at->samples == (at->steps + every - 1) / every && count_of(view + LOOP_VELOCITY) == at->steps
        && count_of(view + LOOP_SENSED) == SENSED * at->samples && count_of(view + LOOP_FORCE) == at->steps
        && count_of(view + LOOP_GIVEN) == (size_t)set->late + 1 + at->samples;
}

static PyObject *tracker_follow(PyObject *object, PyObject *args)
{
    static const char *const what[LOOP_ARRAYS] = {"displacement", "velocity", "sensed", "frozen", "force", "given"};
    const TrackerObject *self = (TrackerObject *)object;
    PyObject *ostate, *oplant, *given[LOOP_ARRAYS], *out = NULL;
    Py_buffer view[LOOP_ARRAYS];
    loop_settings set;
    if (!PyArg_ParseTuple(args, "OO(iiiidddd)OOOOOO", &ostate, &oplant, &set.every, &set.late, &set.apart, &set.reads_force,
                          &set.gain, &set.highest, &set.current_step, &set.force_step, given, given + 1, given + 2,
                          given + 3, given + 4, given + 5))
        return NULL;
    state_room state;
    loop_plant *plant = PyCapsule_GetPointer(oplant, MRD_LOOP_PLANT);
    if (!plant || !read_state(self->face, ostate, &state)) return NULL;
    int opened = 0;
    for (; opened < LOOP_ARRAYS; opened++)
        if (!open_doubles(given[opened], view + opened, opened >= LOOP_FORCE, what[opened])) goto release;
    {
        const loop_arrays at = {view[LOOP_DISPLACEMENT].buf, view[LOOP_VELOCITY].buf, view[LOOP_SENSED].buf,
                                view[LOOP_FROZEN].buf, count_of(view + LOOP_DISPLACEMENT), count_of(view + LOOP_FROZEN),
                                view[LOOP_FORCE].buf, view[LOOP_GIVEN].buf};
        if (!loop_fits(&set, &at, view)) {
            PyErr_SetString(PyExc_ValueError, "lengths of a closed loop do not fit its samples");
            goto release;
        }
        int done;
        Py_BEGIN_ALLOW_THREADS
        memset(at.given, 0, ((size_t)set.late + 1) * sizeof *at.given);
        done = close_loop(self, &state, plant, &set, &at);
        Py_END_ALLOW_THREADS
        out = PyBool_FromLong(done);
    }
release:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return out;
}
