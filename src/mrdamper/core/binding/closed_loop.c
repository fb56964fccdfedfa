/* The sampled closed loops of control/loop.py in one call: controllers of the kernel, each on a damper in C.
 *
 * Included by module.c. The arithmetic, its order and its rounding are those of the loop in Python, which serves
 * every other controller and damper; tests compare the two bit for bit.
 */
#include "loop_plant.h"

/* Columns of the sensor readings at a sample, in the order of mrd_inputs; for the force its noise. */
enum { SENSED = 5, SENSED_FORCE = 4 };

typedef struct {
    int every, late, apart; /* plant steps per sample; delay of a command in samples and steps */
    int reads_force;
    double gain, offset;                          /* of the damper's force [-], [N] */
    double highest, current_step, force_step;     /* of the driver [A]; of the converters, 0: none */
} loop_settings;

enum { LOOP_SENSED, LOOP_FROZEN, LOOP_FORCE, LOOP_GIVEN, LOOP_ARRAYS };

/* One controller on one damper. */
typedef struct {
    const TrackerObject *tracker;
    state_room state;
    loop_settings set;
    Py_buffer view[LOOP_ARRAYS];
    int opened;                      /* of them */
    const double *sensed, *frozen;   /* [samples][SENSED], [samples] */
    double *force, *given;           /* [steps], [late + 1 + samples]: the commands, of which the first are zero */
    double felt, said;               /* force of the damper and of its sensor [N] */
} loop_member;

/* Loops on one motion, in step with each other. */
typedef struct {
    const double *displacement, *velocity; /* [steps] */
    size_t steps, samples, count;
    loop_member *member; /* [count] */
    double *current;     /* [count] */
    double **force;      /* [count]: next position of each damper */
} loops;

/* A multiple of a converter's step, halves to the even one; never a negative zero. */
static double to_step(double value, double step) { return step * rint(value / step) + 0.0; }

static double driven(const loop_settings *set, double current)
{
    if (set->current_step > 0.0) current = to_step(current, set->current_step);
    const double above = 0.0 > current ? 0.0 : current;
    return set->highest < above ? set->highest : above;
}

/* The controller's command at a sample; 0 where it is not finite. */
static int command_at(loop_member *loop, size_t k)
{
    const loop_settings *set = &loop->set;
    double inputs[SENSED];
    memcpy(inputs, loop->sensed + SENSED * k, sizeof inputs);
    if (!set->reads_force) {
        inputs[SENSED_FORCE] = Py_NAN;
    } else {
        if (loop->frozen[k] == 0.0) {
            loop->said = loop->felt + inputs[SENSED_FORCE];
            if (set->force_step > 0.0 && isfinite(loop->said)) loop->said = to_step(loop->said, set->force_step);
        }
        inputs[SENSED_FORCE] = loop->said;
    }
    const double current = loop->tracker->face->step(loop->tracker->track, &loop->state, inputs);
    loop->given[(size_t)set->late + 1 + k] = driven(set, current);
    return isfinite(current);
}

/* Moves the dampers on from step `begin` to `end` with the commands of place `k`; 0 where a sample is refused. */
static int advance_all(const loops *all, loop_plant *plant, size_t begin, size_t end, size_t k)
{
    if (begin == end) return 1;
    for (size_t m = 0; m < all->count; m++) {
        all->current[m] = all->member[m].given[k];
        all->force[m] = all->member[m].force + begin;
    }
    return plant->advance(plant, all->displacement + begin, all->velocity + begin, end - begin, all->current, all->force);
}

/* Returns 0 where a command is not finite, or the damper refuses a sample. */
static int close_loops(const loops *all, loop_plant *plant)
{
    const size_t every = (size_t)all->member->set.every, apart = (size_t)all->member->set.apart;
    for (size_t k = 0; k < all->samples; k++) {
        for (size_t m = 0; m < all->count; m++)
            if (!command_at(all->member + m, k)) return 0;
        const size_t begin = k * every, rest = all->steps - begin, end = begin + (rest < every ? rest : every);
        const size_t switched = begin + apart, change = switched < end ? switched : end;
        if (!advance_all(all, plant, begin, change, k) || !advance_all(all, plant, change, end, k + 1)) return 0;
        for (size_t m = 0; m < all->count; m++)
            all->member[m].felt = all->member[m].set.gain * all->member[m].force[end - 1] + all->member[m].set.offset;
    }
    return 1;
}

static int loop_fits(const loops *all, const loop_member *loop)
{
    const loop_settings *set = &loop->set, *first = &all->member->set;
    if (set->every < 1 || set->late < 0 || set->apart < 0 || set->apart >= set->every) return 0;
    const size_t every = (size_t)set->every;
    return set->every == first->every && set->apart == first->apart && all->samples == (all->steps + every - 1) / every
        && count_of(loop->view + LOOP_FROZEN) == all->samples && count_of(loop->view + LOOP_SENSED) == SENSED * all->samples
        && count_of(loop->view + LOOP_FORCE) == all->steps
        && count_of(loop->view + LOOP_GIVEN) == (size_t)set->late + 1 + all->samples;
}

/* Read one loop of `follow`. Return 0 and set an exception if it is invalid. The caller closes the buffers. */
static int open_loop(PyObject *given, loop_member *loop)
{
    static const char *const what[LOOP_ARRAYS] = {"sensed", "frozen", "force", "given"};
    PyObject *tracker, *state, *array[LOOP_ARRAYS];
    loop_settings *set = &loop->set;
    if (!PyTuple_Check(given)) {
        PyErr_SetString(PyExc_TypeError, "a closed loop is a tuple");
        return 0;
    }
    if (!PyArg_ParseTuple(given, "O!O(iiiiddddd)OOOO", tracker_type, &tracker, &state, &set->every, &set->late, &set->apart,
                          &set->reads_force, &set->gain, &set->offset, &set->highest, &set->current_step, &set->force_step, array,
                          array + 1, array + 2, array + 3))
        return 0;
    loop->tracker = (const TrackerObject *)tracker;
    if (!read_state(loop->tracker->face, state, &loop->state)) return 0;
    for (; loop->opened < LOOP_ARRAYS; loop->opened++)
        if (!open_doubles(array[loop->opened], loop->view + loop->opened, loop->opened >= LOOP_FORCE, what[loop->opened]))
            return 0;
    loop->sensed = loop->view[LOOP_SENSED].buf;
    loop->frozen = loop->view[LOOP_FROZEN].buf;
    loop->force = loop->view[LOOP_FORCE].buf;
    loop->given = loop->view[LOOP_GIVEN].buf;
    return 1;
}

static PyObject *follow_all(loops *all, loop_plant *plant, PyObject *given)
{
    for (size_t m = 0; m < all->count; m++) {
        if (!open_loop(PyTuple_GetItem(given, (Py_ssize_t)m), all->member + m)) return NULL;
        all->samples = count_of(all->member->view + LOOP_FROZEN);
        if (!loop_fits(all, all->member + m)) {
            PyErr_SetString(PyExc_ValueError, "lengths of a closed loop do not fit its samples, or it keeps another time");
            return NULL;
        }
    }
    int done;
    Py_BEGIN_ALLOW_THREADS
    for (size_t m = 0; m < all->count; m++)
        memset(all->member[m].given, 0, ((size_t)all->member[m].set.late + 1) * sizeof(double));
    done = close_loops(all, plant);
    Py_END_ALLOW_THREADS
    return PyBool_FromLong(done);
}

static PyObject *py_follow(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *oplant, *ox, *ov, *given, *out = NULL;
    Py_buffer x, v;
    if (!PyArg_ParseTuple(args, "OOOO!", &oplant, &ox, &ov, &PyTuple_Type, &given)) return NULL;
    loop_plant *plant = PyCapsule_GetPointer(oplant, MRD_LOOP_PLANT);
    if (!plant) return NULL;
    loops all = {0};
    all.count = (size_t)PyTuple_Size(given);
    if (!all.count || all.count != plant->count) {
        PyErr_SetString(PyExc_ValueError, "expected a loop for each damper");
        return NULL;
    }
    if (!open_doubles(ox, &x, 0, "displacement")) return NULL;
    if (open_doubles(ov, &v, 0, "velocity")) {
        all.displacement = x.buf;
        all.velocity = v.buf;
        all.steps = count_of(&x);
        all.member = calloc(all.count, sizeof *all.member);
        all.current = calloc(all.count, sizeof *all.current);
        all.force = calloc(all.count, sizeof *all.force);
        if (!all.member || !all.current || !all.force)
            PyErr_NoMemory();
        else if (!all.steps || count_of(&v) != all.steps)
            PyErr_SetString(PyExc_ValueError, "displacement and velocity have a sample per step");
        else
            out = follow_all(&all, plant, given);
        for (size_t m = 0; all.member && m < all.count; m++)
            for (int k = 0; k < all.member[m].opened; k++) PyBuffer_Release(all.member[m].view + k);
        free(all.force);
        free(all.current);
        free(all.member);
        PyBuffer_Release(&v);
    }
    PyBuffer_Release(&x);
    return out;
}
