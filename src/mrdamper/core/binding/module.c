/* The extension mrdamper.core._kernel: buffers in, buffers out, the GIL released around the arithmetic.
 *
 * Built against the stable ABI (CPython 3.11). No NumPy here: anything that exports a contiguous buffer
 * of C doubles will do. Shapes are checked here once; the kernel trusts them.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../kernel/kernel.h"
#include "levels.h"
#include "tracker.h"

/* CPython's slot tables hold functions as void pointers, which ISO C has no conversion for; every platform that
 * runs CPython has. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpedantic"
#endif

const mrd_api *mrd_api_baseline(void);
#ifdef MRD_HAVE_X86_LEVELS
const mrd_api *mrd_api_v3(void);
const mrd_api *mrd_api_v4(void);
#endif

static const mrd_api *levels[3];
static int level_count = 0;
static const mrd_api *kernel = NULL;

static void find_levels(void)
{
    level_count = 0;
    levels[level_count++] = mrd_api_baseline();
#ifdef MRD_HAVE_X86_LEVELS
    const int level = x86_level();
    if (level >= 1) levels[level_count++] = mrd_api_v3();
    if (level >= 2) levels[level_count++] = mrd_api_v4();
#endif
    kernel = levels[level_count - 1];
}

/* A contiguous buffer of doubles; `count` is its length. Returns 0 with an exception set on failure. */
static int open_doubles(PyObject *object, Py_buffer *view, int writable, const char *what)
{
    if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) < 0) return 0;
    if (view->itemsize != (Py_ssize_t)sizeof(double) || !view->format || strcmp(view->format, "d") != 0
        || (view->len && (uintptr_t)view->buf % sizeof(double))) {
        PyErr_Format(PyExc_TypeError, "%s must be contiguous, aligned float64", what);
        PyBuffer_Release(view);
        return 0;
    }
    return 1;
}

static size_t count_of(const Py_buffer *view) { return (size_t)view->len / sizeof(double); }

static PyObject *fail(mrd_status status)
{
    if (status == MRD_NO_MEMORY) return PyErr_NoMemory();
    if (status == MRD_SHAPE_VARIES)
        PyErr_SetString(PyExc_ValueError, "kappa and n must be constant over a run whose command varies");
    else if (status == MRD_NOT_TABULATED)
        PyErr_SetString(PyExc_ValueError, "expected -1 <= kappa <= 1, 0.2 <= n <= 20 and rho not negative");
    else
        PyErr_SetString(PyExc_ValueError, "the kernel has no such law");
    return NULL;
}

/* ---- Record: one run's kinematics, its turning points and stages ------------------------------------ */

typedef struct {
    PyObject_HEAD
    mrd_record record;
    Py_buffer view[3]; /* displacement, velocity, acceleration: held, not copied */
    int held;
} RecordObject;

static PyTypeObject *record_type = NULL, *tracker_type = NULL;

/* A record of the arrays, which it holds on to: they must not change. `motion` NULL: a whole run. */
static PyObject *record_of(PyTypeObject *type, double step, PyObject *const *arrays, double dead_band, double longest_step,
                           size_t patience, int last, mrd_motion *motion)
{
    static const char *what[] = {"displacement", "velocity", "acceleration"};
    if (!(step > 0.0) || !(dead_band >= 0.0) || !(longest_step > 0.0) || step / longest_step > 1e6) {
        PyErr_SetString(PyExc_ValueError, "step and longest_step must be positive, dead_band not negative");
        return NULL;
    }
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    RecordObject *self = (RecordObject *)alloc(type, 0);
    if (!self) return NULL;
    for (; self->held < 3; self->held++)
        if (!open_doubles(arrays[self->held], self->view + self->held, 0, what[self->held])) goto fault;
    const Py_buffer *view = self->view;
    const size_t n = count_of(view);
    if (count_of(view + 1) != n || count_of(view + 2) != n || n == 0) {
        PyErr_SetString(PyExc_ValueError, "displacement, velocity and acceleration must have one, nonzero length");
        goto fault;
    }
    mrd_status status;
    Py_BEGIN_ALLOW_THREADS
    status = motion ? kernel->batch_open(&self->record, n, step, view[0].buf, view[1].buf, view[2].buf, dead_band,
                                         longest_step, patience, last, motion)
                    : kernel->record_open(&self->record, n, step, view[0].buf, view[1].buf, view[2].buf, dead_band,
                                          longest_step);
    Py_END_ALLOW_THREADS
    if (status == MRD_OK) return (PyObject *)self;
    fail(status);
fault:
    Py_DECREF(self);
    return NULL;
}

static PyObject *record_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    PyObject *arrays[3];
    double step, dead_band, longest_step;
    static char *names[] = {"step", "displacement", "velocity", "acceleration", "dead_band", "longest_step", NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "dOOOdd", names, &step, arrays, arrays + 1, arrays + 2, &dead_band,
                                     &longest_step))
        return NULL;
    return record_of(type, step, arrays, dead_band, longest_step, 0, 1, NULL);
}

static void record_dealloc(PyObject *object)
{
    RecordObject *self = (RecordObject *)object;
    PyTypeObject *type = Py_TYPE(object);
    levels[0]->record_close(&self->record);
    while (self->held) PyBuffer_Release(self->view + --self->held);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

static PyObject *record_get_n(PyObject *self, void *unused)
{
    (void)unused;
    return PyLong_FromSize_t(((RecordObject *)self)->record.n);
}

static PyObject *record_get_behind(PyObject *self, void *unused)
{
    (void)unused;
    return PyLong_FromSize_t(((RecordObject *)self)->record.behind);
}

static PyObject *record_get_substeps(PyObject *self, void *unused)
{
    (void)unused;
    return PyLong_FromSize_t(((RecordObject *)self)->record.substeps);
}

static PyObject *record_get_pieces(PyObject *self, void *unused)
{
    (void)unused;
    const mrd_record *r = &((RecordObject *)self)->record;
    PyObject *out = PyTuple_New((Py_ssize_t)r->pieces);
    for (size_t p = 0; out && p < r->pieces; p++) {
        PyObject *row = Py_BuildValue("(ndi)", (Py_ssize_t)r->first[p], r->turn[p], r->side[p] > 0.0 ? 1 : -1);
        if (!row || PyTuple_SetItem(out, (Py_ssize_t)p, row) < 0) Py_CLEAR(out);
    }
    return out;
}

static PyGetSetDef record_getset[] = {
    {"samples", record_get_n, NULL, "Number of samples.", NULL},
    {"behind", record_get_behind, NULL, "Samples of a batch that were answered in the one before: 0 or 1.", NULL},
    {"substeps", record_get_substeps, NULL, "Steps of the implicit laws per sample.", NULL},
    {"pieces", record_get_pieces, NULL, "Monotone pieces: (first sample, displacement where it starts, direction).", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot record_slots[] = {{Py_tp_new, record_new},
                                     {Py_tp_dealloc, record_dealloc},
                                     {Py_tp_getset, record_getset},
                                     {Py_tp_doc, "One run's kinematics with its turning points."},
                                     {0, NULL}};

static PyType_Spec record_spec = {"mrdamper.core._kernel.Record", (int)sizeof(RecordObject), 0, Py_TPFLAGS_DEFAULT,
                                  record_slots};

/* ---- Workspace: the curve of the last call, for calls that follow each other on one thread ------------ */

typedef struct {
    PyObject_HEAD
    mrd_workspace *workspace;
} WorkspaceObject;

static PyTypeObject *workspace_type = NULL;

static PyObject *workspace_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "", names)) return NULL;
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    WorkspaceObject *self = (WorkspaceObject *)alloc(type, 0);
    if (!self) return NULL;
    self->workspace = levels[0]->workspace_open();
    if (!self->workspace) {
        Py_CLEAR(self);
        PyErr_NoMemory();
    }
    return (PyObject *)self;
}

static void workspace_dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    levels[0]->workspace_close(((WorkspaceObject *)object)->workspace);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

static PyType_Slot workspace_slots[] = {{Py_tp_new, workspace_new},
                                        {Py_tp_dealloc, workspace_dealloc},
                                        {Py_tp_doc, "The universal curve that was tabulated last; for one thread."},
                                        {0, NULL}};

static PyType_Spec workspace_spec = {"mrdamper.core._kernel.Workspace", (int)sizeof(WorkspaceObject), 0,
                                     Py_TPFLAGS_DEFAULT, workspace_slots};

/* ---- Tracker: a controller with its tables; its state is handed out and in as bytes ---------------------- */

#define TRACK(name) kernel->track_##name
#define TRACK_MODEL kernel->model_step
#include "tracker_face.c"

typedef struct {
    PyObject_HEAD
    const tracker_face *face; /* of its precision */
    void *track, *store;
} TrackerObject;

/* Reads one value of a configuration by name: an attribute of an attribute. */
static int read_value(PyObject *config, const char *part, const char *name, double *value)
{
    PyObject *of = PyObject_GetAttrString(config, part), *found = of ? PyObject_GetAttrString(of, name) : NULL;
    if (found) *value = PyFloat_AsDouble(found);
    Py_XDECREF(found);
    Py_XDECREF(of);
    return !PyErr_Occurred();
}

static int read_config(PyObject *config, double *value)
{
    static const char *const names[][2] = {
#define X(part, name, type) {#part, #name},
        MRD_CONFIG_VALUES(X)
#undef X
    };
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (!read_value(config, names[k][0], names[k][1], value + k)) return 0;
    return 1;
}

#define X(part, name, type) +1
enum { CONFIG_VALUES = 0 MRD_CONFIG_VALUES(X) };
#undef X

/* A function of a size: (offset, top, bits, cells). */
static int open_lookup(PyObject *sequence, Py_ssize_t at, double *offset, double *top, int32_t *bits, Py_buffer *view)
{
    PyObject *item = PySequence_GetItem(sequence, at), *ocell;
    int read = 0;
    const int fine = item && PyArg_ParseTuple(item, "ddiO", offset, top, &read, &ocell) && open_doubles(ocell, view, 0, "cells");
    Py_XDECREF(item); /* the caller's sequence keeps it alive */
    *bits = read;
    return fine;
}

/* (planes at temperature and current, rows over temperature, powers, lookups) of series valve and chain. */
static int open_series(PyObject *object, Py_ssize_t pieces, tracker_parts *parts, Py_buffer *view, int *opened)
{
    PyObject *oyield, *ochain, *opowers, *olookups;
    Py_buffer *const first = view;
    if (!PyArg_ParseTuple(object, "OOOO", &oyield, &ochain, &opowers, &olookups)) return 0;
    if (!open_doubles(oyield, view, 0, "yield")) return 0;
    ++*opened;
    if (!open_doubles(ochain, ++view, 0, "chain")) return 0;
    ++*opened;
    int fits = first[0].ndim == 3 && first[1].ndim == 2 && (first[0].shape[0] == 1 || first[0].shape[0] == pieces + 1)
            && first[0].shape[1] <= 1025 && first[1].shape[0] == first[0].shape[0]
            && PySequence_Size(opowers) == SERIES_POWERS && PySequence_Size(olookups) == SERIES_LOOKUPS;
    for (int k = 0; fits && k < SERIES_POWERS; k++) {
        PyObject *item = PySequence_GetItem(opowers, k), *oscale, *ocell;
        int bits = 0;
        const int fine = item && PyArg_ParseTuple(item, "dddiOO", &parts->exponent[k], &parts->least[k],
                                                  &parts->power_top[k], &bits, &oscale, &ocell);
        Py_XDECREF(item);
        if (!fine || !open_doubles(oscale, ++view, 0, "scale")) return 0;
        ++*opened;
        if (!open_doubles(ocell, ++view, 0, "cells")) return 0;
        ++*opened;
        parts->power_bits[k] = bits;
        fits = bits >= 0 && bits <= 10 && count_of(view) == (size_t)4 << bits;
    }
    for (int k = 0; fits && k < SERIES_LOOKUPS; k++) {
        if (!open_lookup(olookups, k, &parts->series_offset[k], &parts->series_top[k], &parts->series_bits[k], ++view))
            return 0;
        ++*opened;
    }
    if (!fits) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "these are not the series valve's tables");
        return 0;
    }
    parts->series = 1;
    parts->series_sheets = (int32_t)first[0].shape[0];
    parts->series_currents = (int32_t)first[0].shape[1];
    parts->series_planes = (int32_t)first[0].shape[2];
    parts->series_rows = (int32_t)first[1].shape[1];
    for (int k = 0; k < SERIES_TABLES; k++) {
        parts->series_table[k] = first[k].buf;
        parts->series_length[k] = count_of(first + k);
    }
    return 1;
}

static PyObject *tracker_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    PyObject *oconfig, *orows, *ocurrent, *ofactor, *ocolumn, *olookups, *oseries = Py_None;
    int single = 0;
    static char *names[] = {"config", "rows", "current", "factor", "column", "lookups", "single", "series", NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "OSOOOO|pO", names, &oconfig, &orows, &ocurrent, &ofactor, &ocolumn,
                                     &olookups, &single, &oseries))
        return NULL;
    Py_buffer view[TRACK_TABLES + SERIES_TABLES];
    double config[CONFIG_VALUES];
    int opened = 0, sound = 0;
    TrackerObject *self = NULL;
    tracker_parts parts;
    memset(&parts, 0, sizeof parts);
    if (!read_config(oconfig, config)) return NULL;
    PyObject *const arrays[] = {ocurrent, ofactor, ocolumn};
    for (; opened < 3; opened++)
        if (!open_doubles(arrays[opened], view + opened, 0, names[opened + 2])) goto done;
    if (PySequence_Size(olookups) != TRACK_LOOKUPS) {
        if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "expected %d functions", TRACK_LOOKUPS);
        goto done;
    }
    for (int k = 0; k < TRACK_LOOKUPS; k++) {
        if (!open_lookup(olookups, k, &parts.offset[k], &parts.top[k], &parts.bits[k], view + opened)) goto done;
        opened++;
    }
    parts.row = (const uint8_t *)PyBytes_AsString(orows);
    if (view[1].ndim != 3 || view[1].shape[2] != 3 || view[2].ndim != 2 || view[1].shape[0] > 10000
        || view[1].shape[1] > MRD_TRACK_TERMS || view[1].shape[1] != PyBytes_Size(orows) || view[2].shape[0] > MRD_TRACK_CURRENTS
        || view[2].shape[1] > view[1].shape[1] || count_of(view) != (size_t)view[2].shape[0]) {
        PyErr_SetString(PyExc_ValueError, "factor must be [pieces][terms][3], column [currents][columns], current "
                                          "[currents], and rows the terms' rows, levels first");
        goto done;
    }
    if (oseries != Py_None && !open_series(oseries, view[1].shape[0], &parts, view + opened, &opened)) goto done;
    parts.config = config;
    parts.pieces = (int32_t)view[1].shape[0];
    parts.terms = (int32_t)view[1].shape[1];
    parts.currents = (int32_t)view[2].shape[0];
    parts.columns = (int32_t)view[2].shape[1];
    size_t total = 0;
    for (int k = 0; k < TRACK_TABLES; k++) {
        parts.table[k] = view[k].buf;
        parts.length[k] = count_of(view + k);
        total += parts.length[k];
    }
    for (int k = 0; k < SERIES_TABLES; k++) total += parts.series_length[k];
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    self = (TrackerObject *)alloc(type, 0);
    if (!self) goto done;
    self->face = single ? mrd_tracker_single() : &face;
    self->track = malloc(self->face->track_size);
    self->store = malloc(total * self->face->real_size);
    if (!self->track || !self->store) PyErr_NoMemory();
    else if (!self->face->load(self->track, self->store, &parts))
        PyErr_SetString(PyExc_ValueError, "a controller's configuration or tables are out of their range");
    else sound = 1;
    if (!sound) Py_CLEAR(self);
done:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return (PyObject *)self;
}

static void tracker_dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    free(((TrackerObject *)object)->track);
    free(((TrackerObject *)object)->store);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

/* Memory for a state of either precision. */
typedef union {
    mrd_track_state state;
    unsigned char bytes[sizeof(mrd_track_state)];
} state_room;

/* The bytes of a state, copied; one of the other precision has another size. */
static int read_state(const tracker_face *with, PyObject *object, state_room *state)
{
    char *bytes;
    Py_ssize_t size;
    if (PyBytes_AsStringAndSize(object, &bytes, &size) < 0) return 0;
    if (size == (Py_ssize_t)with->state_size && with->state_size <= sizeof *state) {
        memcpy(state, bytes, (size_t)size);
        if (with->is_sound(state)) return 1;
    }
    PyErr_SetString(PyExc_ValueError, "this is not a controller's state");
    return 0;
}

static PyObject *state_bytes(const tracker_face *with, const state_room *state)
{
    return PyBytes_FromStringAndSize((const char *)state, (Py_ssize_t)with->state_size);
}

/* A number, or None for one that is not known. */
static int read_number(PyObject *object, double *value)
{
    *value = object == Py_None ? Py_NAN : PyFloat_AsDouble(object);
    return !(*value == -1.0 && PyErr_Occurred());
}

static PyObject *tracker_start(PyObject *object, PyObject *unused)
{
    (void)unused;
    const TrackerObject *self = (TrackerObject *)object;
    state_room state;
    self->face->start(self->track, &state);
    return state_bytes(self->face, &state);
}

typedef double (*tracker_move)(const void *track, void *state, const double *inputs);

/* Return the next state and the result of one step with `count` readings. */
static PyObject *one_step(const TrackerObject *self, tracker_move move, PyObject *const *args, int count)
{
    state_room state;
    double inputs[5];
    if (!read_state(self->face, args[0], &state)) return NULL;
    for (int k = 0; k < count; k++)
        if (!read_number(args[1 + k], inputs + k)) return NULL;
    const double answer = move(self->track, &state, inputs);
    PyObject *next = state_bytes(self->face, &state), *given = PyFloat_FromDouble(answer);
    PyObject *out = next && given ? PyTuple_New(2) : NULL;
    if (!out) {
        Py_XDECREF(next);
        Py_XDECREF(given);
        return NULL;
    }
    PyTuple_SetItem(out, 0, next);
    PyTuple_SetItem(out, 1, given);
    return out;
}

/* Run many steps: rows of `count` readings in, results and flags out. */
static PyObject *many_steps(const TrackerObject *self, tracker_move move, PyObject *args, size_t count)
{
    PyObject *ostate, *oinputs, *ogiven, *oflags;
    if (!PyArg_ParseTuple(args, "OOOO", &ostate, &oinputs, &ogiven, &oflags)) return NULL;
    const tracker_face *with = self->face;
    state_room state;
    if (!read_state(with, ostate, &state)) return NULL;
    Py_buffer inputs, given, flags;
    if (!open_doubles(oinputs, &inputs, 0, "inputs")) return NULL;
    PyObject *out = NULL;
    if (open_doubles(ogiven, &given, 1, "what is given")) {
        if (open_doubles(oflags, &flags, 1, "flags")) {
            const size_t n = count_of(&given);
            if (count_of(&inputs) != count * n || count_of(&flags) != n) {
                PyErr_Format(PyExc_ValueError, "inputs must be [n][%zu], what is given and flags [n]", count);
            } else {
                const double *row = inputs.buf;
                double *to = given.buf, *raised = flags.buf;
                Py_BEGIN_ALLOW_THREADS
                for (size_t k = 0; k < n; k++, row += count) {
                    to[k] = move(self->track, &state, row);
                    raised[k] = with->flags(&state);
                }
                Py_END_ALLOW_THREADS
                out = state_bytes(with, &state);
            }
            PyBuffer_Release(&flags);
        }
        PyBuffer_Release(&given);
    }
    PyBuffer_Release(&inputs);
    return out;
}

static PyObject *tracker_step(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    const TrackerObject *self = (TrackerObject *)object;
    if (count == 6) return one_step(self, self->face->step, args, 5);
    PyErr_SetString(PyExc_TypeError, "step(state, now, ahead, displacement, temperature, force)");
    return NULL;
}

static PyObject *tracker_model(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    const TrackerObject *self = (TrackerObject *)object;
    if (count == 5) return one_step(self, self->face->model, args, 4);
    PyErr_SetString(PyExc_TypeError, "model(state, displacement, velocity, current, temperature)");
    return NULL;
}

static PyObject *tracker_run(PyObject *self, PyObject *args)
{
    return many_steps((TrackerObject *)self, ((TrackerObject *)self)->face->step, args, 5);
}

static PyObject *tracker_simulate(PyObject *self, PyObject *args)
{
    return many_steps((TrackerObject *)self, ((TrackerObject *)self)->face->model, args, 4);
}

static PyObject *tracker_read(PyObject *object, PyObject *ostate)
{
    const TrackerObject *self = (TrackerObject *)object;
    state_room state;
    double v[TRACK_READ];
    if (!read_state(self->face, ostate, &state)) return NULL;
    self->face->read(self->track, &state, v);
    return Py_BuildValue("{s:(ddd),s:d,s:d,s:d,s:d,s:(dddd),s:d,s:i}", "motion", v[0], v[1], v[2], "applied", v[3],
                         "command", v[4], "temperature", v[5], "disturbance", v[6], "parts", v[7], v[8], v[9], v[10],
                         "warmed", v[11], "flags", (int)self->face->flags(&state));
}

static PyMethodDef tracker_methods[] = {
    {"start", tracker_start, METH_NOARGS, "The state before the first sample."},
    {"step", (PyCFunction)(void (*)(void))tracker_step, METH_FASTCALL,
     "step(state, now, ahead, displacement, temperature, force): the next state and the command."},
    {"run", tracker_run, METH_VARARGS, "run(state, inputs, current, flags): many steps; the state after them."},
    {"model", (PyCFunction)(void (*)(void))tracker_model, METH_FASTCALL,
     "model(state, displacement, velocity, current, temperature): the next state and the model's force."},
    {"simulate", tracker_simulate, METH_VARARGS,
     "simulate(state, inputs, force, flags): many steps of the model; the state after them."},
    {"read", tracker_read, METH_O, "read(state): what the controller believes."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot tracker_slots[] = {{Py_tp_new, tracker_new},
                                      {Py_tp_dealloc, tracker_dealloc},
                                      {Py_tp_methods, tracker_methods},
                                      {Py_tp_doc, "A force-tracking controller with its tables; it does not change."},
                                      {0, NULL}};

static PyType_Spec tracker_spec = {"mrdamper.core._kernel.Tracker", (int)sizeof(TrackerObject), 0, Py_TPFLAGS_DEFAULT,
                                   tracker_slots};

static mrd_record *as_record(PyObject *object)
{
    if (!PyObject_TypeCheck(object, record_type)) {
        PyErr_SetString(PyExc_TypeError, "expected a Record");
        return NULL;
    }
    return &((RecordObject *)object)->record;
}

#include "closed_loop.c"

/* ---- functions -------------------------------------------------------------------------------------- */

static int open_model(int law, PyObject *object, size_t n, Py_buffer *view, mrd_model *model)
{
    const size_t count = (size_t)kernel->coefficient_count(law);
    if (!count) {
        fail(MRD_NOT_A_LAW);
        return 0;
    }
    if (!open_doubles(object, view, 0, "coefficients")) return 0;
    if (count_of(view) != count && count_of(view) != count * n) {
        PyErr_Format(PyExc_ValueError, "law %d takes %zu coefficients (or %zu rows of %zu samples), got %zu numbers", law,
                     count, count, n, count_of(view));
        PyBuffer_Release(view);
        return 0;
    }
    model->law = (mrd_law)law;
    model->coefficient = view->buf;
    model->stride = count_of(view) == count ? 0 : n;
    return 1;
}

/* Coefficients of a law, by their places in it; returns 0 with an exception set on failure. */
static int read_places(int law, PyObject *object, int *place, size_t *places)
{
    const Py_ssize_t wanted = PySequence_Size(object);
    if (wanted < 0) return 0;
    if (wanted > MRD_DIRECTIONS) {
        PyErr_Format(PyExc_ValueError, "at most %d directions, got %zd", MRD_DIRECTIONS, wanted);
        return 0;
    }
    for (Py_ssize_t d = 0; d < wanted; d++) {
        PyObject *item = PySequence_GetItem(object, d);
        const long k = item ? PyLong_AsLong(item) : -1;
        Py_XDECREF(item);
        if (PyErr_Occurred()) return 0;
        if (k < 0 || k >= kernel->coefficient_count(law)) {
            PyErr_Format(PyExc_ValueError, "the law has no coefficient number %ld", k);
            return 0;
        }
        place[d] = (int)k;
    }
    *places = (size_t)wanted;
    return 1;
}

static PyObject *py_run(PyObject *module, PyObject *args)
{
    (void)module;
    int law;
    PyObject *orecord, *ocoef, *odirections, *oseeds, *oforce, *ocolumns, *oworkspace, *result = NULL;
    if (!PyArg_ParseTuple(args, "iOOOOOOO", &law, &orecord, &ocoef, &odirections, &oseeds, &oforce, &ocolumns,
                          &oworkspace))
        return NULL;
    if (oworkspace != Py_None && !PyObject_TypeCheck(oworkspace, workspace_type)) {
        PyErr_SetString(PyExc_TypeError, "expected a Workspace or None");
        return NULL;
    }
    mrd_workspace *workspace = oworkspace == Py_None ? NULL : ((WorkspaceObject *)oworkspace)->workspace;
    const mrd_record *r = as_record(orecord);
    if (!r) return NULL;
    mrd_direction direction[MRD_DIRECTIONS];
    int place[MRD_DIRECTIONS];
    size_t directions;
    if (!kernel->coefficient_count(law)) return fail(MRD_NOT_A_LAW);
    if (!read_places(law, odirections, place, &directions)) return NULL;
    Py_buffer coef, seeds, force, columns;
    mrd_model model;
    if (!open_model(law, ocoef, r->known, &coef, &model)) return NULL;
    const int have_seeds = oseeds != Py_None, have_force = oforce != Py_None, have_columns = directions > 0;
    int open = 0;
    if (have_seeds && !open_doubles(oseeds, &seeds, 0, "seeds")) goto close;
    open = 1;
    if (have_force && !open_doubles(oforce, &force, 1, "force")) goto close;
    open = 2;
    if (have_columns && !open_doubles(ocolumns, &columns, 1, "columns")) goto close;
    open = 3;
    if ((have_force && count_of(&force) != r->n) || (have_columns && count_of(&columns) != directions * r->n)
        || (have_seeds && count_of(&seeds) != directions && count_of(&seeds) != directions * r->n)) {
        PyErr_SetString(PyExc_ValueError, "force, columns or seeds do not have the record's length");
        goto close;
    }
    for (size_t d = 0; d < directions; d++) {
        direction[d].coefficient = place[d];
        direction[d].stride = have_seeds && count_of(&seeds) == directions * r->n && r->n != 1;
        direction[d].seed = have_seeds ? (const double *)seeds.buf + (direction[d].stride ? d * r->n : d) : NULL;
    }
    {
        mrd_status status;
        Py_BEGIN_ALLOW_THREADS
        status = kernel->run(&model, r, directions, direction, have_force ? force.buf : NULL,
                             have_columns ? columns.buf : NULL, workspace);
        Py_END_ALLOW_THREADS
        result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
    }
close:
    if (open >= 3 && have_columns) PyBuffer_Release(&columns);
    if (open >= 2 && have_force) PyBuffer_Release(&force);
    if (open >= 1 && have_seeds) PyBuffer_Release(&seeds);
    PyBuffer_Release(&coef);
    return result;
}

/* The numbers of a state between batches, of exactly its size. */
static int open_state(PyObject *object, Py_buffer *view, size_t size, const char *what)
{
    if (!open_doubles(object, view, 1, what)) return 0;
    if ((size_t)view->len == size) return 1;
    PyErr_Format(PyExc_ValueError, "%s has %zu numbers; expected %zu", what, count_of(view), size / sizeof(double));
    PyBuffer_Release(view);
    return 0;
}

static PyObject *py_batch(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *arrays[3], *omotion;
    double step, dead_band, longest_step;
    Py_ssize_t patience;
    int last;
    if (!PyArg_ParseTuple(args, "dOOOddniO", &step, arrays, arrays + 1, arrays + 2, &dead_band, &longest_step, &patience,
                          &last, &omotion))
        return NULL;
    if (patience < 1) {
        PyErr_SetString(PyExc_ValueError, "patience must be 1 sample or more");
        return NULL;
    }
    Py_buffer motion;
    if (!open_state(omotion, &motion, sizeof(mrd_motion), "motion")) return NULL;
    PyObject *out = NULL;
    if (((const mrd_motion *)motion.buf)->path >= 0.0)
        out = record_of(record_type, step, arrays, dead_band, longest_step, (size_t)patience, last, motion.buf);
    else /* kept states come back from files: a cell of the curve is found by this one */
        PyErr_SetString(PyExc_ValueError, "motion: its path is not a travel since a turning point");
    PyBuffer_Release(&motion);
    return out;
}

static PyObject *py_carry(PyObject *module, PyObject *args)
{
    (void)module;
    int law;
    PyObject *orecord, *ocoef, *ostate, *oforce, *oworkspace, *result = NULL;
    if (!PyArg_ParseTuple(args, "iOOOOO", &law, &orecord, &ocoef, &ostate, &oforce, &oworkspace)) return NULL;
    if (!PyObject_TypeCheck(oworkspace, workspace_type)) {
        PyErr_SetString(PyExc_TypeError, "expected a Workspace");
        return NULL;
    }
    const mrd_record *r = as_record(orecord);
    if (!r) return NULL;
    Py_buffer coef, state, force;
    mrd_model model;
    if (!open_model(law, ocoef, r->known, &coef, &model)) return NULL;
    if (open_state(ostate, &state, sizeof(mrd_state), "state")) {
        mrd_state *const at = state.buf;
        if (open_doubles(oforce, &force, 1, "force")) {
            if (count_of(&force) != r->n) {
                PyErr_SetString(PyExc_ValueError, "force does not have the record's length");
            } else if (r->n > r->behind && (at->begun != 0.0) != (r->behind != 0)) {
                PyErr_SetString(PyExc_ValueError, "the state is not that of the batch before");
            } else {
                mrd_status status;
                Py_BEGIN_ALLOW_THREADS
                status = kernel->carry(&model, r, at, force.buf, ((WorkspaceObject *)oworkspace)->workspace);
                Py_END_ALLOW_THREADS
                result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
            }
            PyBuffer_Release(&force);
        }
        PyBuffer_Release(&state);
    }
    PyBuffer_Release(&coef);
    return result;
}

static PyObject *py_causal(PyObject *module, PyObject *args)
{
    (void)module;
    int law;
    PyObject *orecord, *ocoef, *oforce, *result = NULL;
    if (!PyArg_ParseTuple(args, "iOOO", &law, &orecord, &ocoef, &oforce)) return NULL;
    const mrd_record *r = as_record(orecord);
    if (!r) return NULL;
    Py_buffer coef, force;
    mrd_model model;
    if (!open_model(law, ocoef, r->n, &coef, &model)) return NULL;
    if (open_doubles(oforce, &force, 1, "force")) {
        if (count_of(&force) != r->n) {
            PyErr_SetString(PyExc_ValueError, "force does not have the record's length");
        } else {
            mrd_status status;
            Py_BEGIN_ALLOW_THREADS
            status = kernel->causal(&model, r, force.buf);
            Py_END_ALLOW_THREADS
            result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
        }
        PyBuffer_Release(&force);
    }
    PyBuffer_Release(&coef);
    return result;
}

/* Runs with their measured force and first evaluated sample. */
typedef struct {
    size_t count;
    const mrd_record **record;
    const double **measured;
    size_t *from;
    Py_buffer *view;
    Py_ssize_t opened;
} open_runs;

static void close_runs(open_runs *runs)
{
    for (Py_ssize_t k = 0; k < runs->opened; k++) PyBuffer_Release(runs->view + k);
    free(runs->record);
    free(runs->measured);
    free(runs->from);
    free(runs->view);
}

/* Returns 0 with an exception set on failure; close_runs() is due either way. */
static int open_all_runs(open_runs *runs, PyObject *orecords, PyObject *omeasured, PyObject *ofrom)
{
    memset(runs, 0, sizeof *runs);
    const Py_ssize_t wanted = PySequence_Size(orecords);
    if (wanted < 0) return 0;
    if (PySequence_Size(omeasured) != wanted || PySequence_Size(ofrom) != wanted || wanted == 0) {
        PyErr_SetString(PyExc_ValueError, "records, measured and from must have one, nonzero length");
        return 0;
    }
    runs->count = (size_t)wanted;
    runs->record = calloc(runs->count, sizeof *runs->record);
    runs->measured = calloc(runs->count, sizeof *runs->measured);
    runs->from = calloc(runs->count, sizeof *runs->from);
    runs->view = calloc(runs->count, sizeof *runs->view);
    if (!runs->record || !runs->measured || !runs->from || !runs->view) {
        PyErr_NoMemory();
        return 0;
    }
    for (Py_ssize_t k = 0; k < wanted; k++) {
        PyObject *orecord = PySequence_GetItem(orecords, k), *oforce = PySequence_GetItem(omeasured, k);
        PyObject *ostart = PySequence_GetItem(ofrom, k);
        runs->record[k] = orecord ? as_record(orecord) : NULL;
        runs->from[k] = ostart ? PyLong_AsSize_t(ostart) : 0;
        const int fine = runs->record[k] && oforce && !PyErr_Occurred()
                      && open_doubles(oforce, runs->view + k, 0, "measured force");
        Py_XDECREF(orecord); /* the caller's sequence keeps it alive */
        Py_XDECREF(oforce);
        Py_XDECREF(ostart);
        if (!fine) return 0;
        runs->opened++;
        if (count_of(runs->view + k) != runs->record[k]->n || runs->from[k] > runs->record[k]->n) {
            PyErr_SetString(PyExc_ValueError, "measured force does not have its record's length, or starts beyond it");
            return 0;
        }
        runs->measured[k] = runs->view[k].buf;
    }
    return 1;
}

static PyObject *py_squared_errors(PyObject *module, PyObject *args)
{
    (void)module;
    int law;
    PyObject *orecords, *omeasured, *ofrom, *ocoef, *oerrors, *result = NULL;
    if (!PyArg_ParseTuple(args, "iOOOOO", &law, &orecords, &omeasured, &ofrom, &ocoef, &oerrors)) return NULL;
    const size_t count = (size_t)kernel->coefficient_count(law);
    if (!count) return fail(MRD_NOT_A_LAW);
    open_runs runs;
    Py_buffer coef, errors;
    if (!open_all_runs(&runs, orecords, omeasured, ofrom) || !open_doubles(ocoef, &coef, 0, "coefficients")) goto release;
    if (open_doubles(oerrors, &errors, 1, "errors")) {
        const size_t candidates = count_of(&errors) / runs.count;
        if (candidates * runs.count != count_of(&errors) || candidates * runs.count * count != count_of(&coef)) {
            PyErr_SetString(PyExc_ValueError, "coefficients must be [candidate][run][coefficient], errors [candidate][run]");
        } else {
            mrd_status status;
            Py_BEGIN_ALLOW_THREADS
            status = kernel->squared_errors((mrd_law)law, runs.count, runs.record, runs.measured, runs.from, candidates,
                                            coef.buf, errors.buf);
            Py_END_ALLOW_THREADS
            result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
        }
        PyBuffer_Release(&errors);
    }
    PyBuffer_Release(&coef);
release:
    close_runs(&runs);
    return result;
}

static size_t samples_of(const open_runs *runs)
{
    size_t all = 0;
    for (size_t k = 0; k < runs->count; k++) all += runs->record[k]->n;
    return all;
}

static PyObject *py_gram_sums(PyObject *module, PyObject *args)
{
    (void)module;
    int law, place[MRD_DIRECTIONS];
    size_t places;
    PyObject *orecords, *omeasured, *ofrom, *ocoef, *oplaces, *oout, *oresiduals, *result = NULL;
    if (!PyArg_ParseTuple(args, "iOOOOOOO", &law, &orecords, &omeasured, &ofrom, &ocoef, &oplaces, &oout, &oresiduals))
        return NULL;
    const size_t count = (size_t)kernel->coefficient_count(law);
    if (!count) return fail(MRD_NOT_A_LAW);
    if (!read_places(law, oplaces, place, &places)) return NULL;
    open_runs runs;
    Py_buffer coef, out, left = {0};
    if (oresiduals != Py_None && !open_doubles(oresiduals, &left, 1, "residuals")) return NULL;
    if (!open_all_runs(&runs, orecords, omeasured, ofrom) || !open_doubles(ocoef, &coef, 0, "coefficients")) goto release;
    if (open_doubles(oout, &out, 1, "out")) {
        const size_t candidates = count_of(&coef) / (runs.count * count), rows = places + 1;
        if (candidates * runs.count * count != count_of(&coef) || candidates * runs.count * rows * rows != count_of(&out)) {
            PyErr_SetString(PyExc_ValueError, "coefficients must be [candidate][run][coefficient], out [candidate][run][row][row]");
        } else if (left.buf && count_of(&left) != candidates * samples_of(&runs)) {
            PyErr_SetString(PyExc_ValueError, "residuals must be [candidate][samples of all runs]");
        } else {
            mrd_status status;
            Py_BEGIN_ALLOW_THREADS
            status = kernel->gram_sums((mrd_law)law, runs.count, runs.record, runs.measured, runs.from, candidates,
                                       coef.buf, places, place, out.buf, left.buf);
            Py_END_ALLOW_THREADS
            result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
        }
        PyBuffer_Release(&out);
    }
    PyBuffer_Release(&coef);
release:
    if (left.buf) PyBuffer_Release(&left);
    close_runs(&runs);
    return result;
}

static PyObject *py_gram(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *ocolumns, *oout, *result = NULL;
    Py_ssize_t rows, from;
    if (!PyArg_ParseTuple(args, "OnnO", &ocolumns, &rows, &from, &oout)) return NULL;
    Py_buffer columns, out;
    if (!open_doubles(ocolumns, &columns, 0, "columns")) return NULL;
    if (open_doubles(oout, &out, 1, "out")) {
        const size_t m = rows > 0 ? (size_t)rows : 0, n = m ? count_of(&columns) / m : 0;
        if (!m || m * n != count_of(&columns) || count_of(&out) != m * m || from < 0 || (size_t)from > n) {
            PyErr_SetString(PyExc_ValueError, "columns must be rows x samples, out rows x rows");
        } else {
            mrd_status status;
            Py_BEGIN_ALLOW_THREADS
            status = kernel->gram(m, n, columns.buf, (size_t)from, out.buf);
            Py_END_ALLOW_THREADS
            result = status == MRD_OK ? Py_NewRef(Py_None) : fail(status);
        }
        PyBuffer_Release(&out);
    }
    PyBuffer_Release(&columns);
    return result;
}

static PyObject *py_curve(PyObject *module, PyObject *args)
{
    (void)module;
    double kappa, n;
    PyObject *object[5], *result = NULL;
    Py_buffer view[5];
    if (!PyArg_ParseTuple(args, "ddOOOOO", &kappa, &n, &object[0], &object[1], &object[2], &object[3], &object[4])) return NULL;
    if (!(kappa >= -1.0 && kappa <= 1.0 && n >= 0.2 && n <= 20.0)) {
        PyErr_SetString(PyExc_ValueError, "the curve is tabulated for -1 <= kappa <= 1 and 0.2 <= n <= 20");
        return NULL;
    }
    int opened = 0;
    for (; opened < 5; opened++) {
        if (!open_doubles(object[opened], view + opened, opened > 0, "curve array")) goto release;
        if (count_of(view + opened) != count_of(view)) {
            opened++;
            PyErr_SetString(PyExc_ValueError, "the arrays must have one length");
            goto release;
        }
    }
    Py_BEGIN_ALLOW_THREADS
    kernel->curve(kappa, n, count_of(view), view[0].buf, view[1].buf, view[2].buf, view[3].buf, view[4].buf);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
release:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return result;
}

static PyObject *py_lag(PyObject *module, PyObject *args)
{
    (void)module;
    double step, rise, fall, wheel, saturation;
    PyObject *object[3], *obefore, *result = NULL;
    Py_buffer view[3];
    double before[2];
    if (!PyArg_ParseTuple(args, "dddddOOOO", &step, &rise, &fall, &wheel, &saturation, &object[0], &object[1],
                          &object[2], &obefore))
        return NULL;
    if (obefore != Py_None && !PyArg_ParseTuple(obefore, "dd", before, before + 1)) return NULL;
    int opened = 0;
    for (; opened < 3; opened++) {
        if (!open_doubles(object[opened], view + opened, opened > 0, "lag array")) goto release;
        if (count_of(view + opened) != count_of(view)) {
            opened++;
            PyErr_SetString(PyExc_ValueError, "the arrays must have one length");
            goto release;
        }
    }
    Py_BEGIN_ALLOW_THREADS
    kernel->lag(count_of(view), step, rise, fall, wheel, saturation, view[0].buf, view[1].buf, view[2].buf,
                obefore == Py_None ? NULL : before);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
release:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return result;
}

static PyObject *py_banded(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *olower, *oright, *result = NULL;
    Py_buffer lower, right;
    if (!PyArg_ParseTuple(args, "OO", &olower, &oright) || !open_doubles(olower, &lower, 1, "lower")) return NULL;
    if (open_doubles(oright, &right, 1, "right")) {
        const size_t n = count_of(&right), rows = n ? count_of(&lower) / n : 0;
        int solved = 0;
        if (!rows || rows * n != count_of(&lower)) {
            PyErr_SetString(PyExc_ValueError, "lower must have whole rows of the length of right");
        } else {
            Py_BEGIN_ALLOW_THREADS
            solved = kernel->banded(n, rows - 1, lower.buf, right.buf);
            Py_END_ALLOW_THREADS
            if (solved) result = Py_NewRef(Py_None);
            else PyErr_SetString(PyExc_ValueError, "the matrix is not positive definite");
        }
        PyBuffer_Release(&right);
    }
    PyBuffer_Release(&lower);
    return result;
}

static PyObject *py_turns(PyObject *module, PyObject *args)
{
    (void)module;
    double dead_band;
    PyObject *object[3], *result = NULL;
    Py_buffer view[3]; /* where the motion stands, displacement, turning points */
    if (!PyArg_ParseTuple(args, "OOdO", &object[0], &object[1], &dead_band, &object[2])) return NULL;
    int opened = 0;
    for (; opened < 3; opened++)
        if (!open_doubles(object[opened], view + opened, opened != 1, "turning point array")) goto release;
    if (view[0].len != (Py_ssize_t)sizeof(mrd_turns) || view[1].len != view[2].len) {
        PyErr_SetString(PyExc_ValueError, "expected TURNS_NUMBERS numbers, and room for a turning point a sample");
        goto release;
    }
    size_t count;
    Py_BEGIN_ALLOW_THREADS
    count = kernel->turns(view[0].buf, count_of(view + 1), view[1].buf, dead_band, view[2].buf);
    Py_END_ALLOW_THREADS
    result = PyLong_FromSize_t(count);
release:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return result;
}

static PyObject *py_levels(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
    PyObject *out = PyTuple_New(level_count);
    for (int k = 0; out && k < level_count; k++)
        if (PyTuple_SetItem(out, k, PyUnicode_FromString(levels[k]->name)) < 0) Py_CLEAR(out);
    return out;
}

static PyObject *py_level(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
    return PyUnicode_FromString(kernel->name);
}

static PyObject *py_use_level(PyObject *module, PyObject *args)
{
    (void)module;
    const char *name;
    if (!PyArg_ParseTuple(args, "s", &name)) return NULL;
    for (int k = 0; k < level_count; k++) {
        if (strcmp(levels[k]->name, name) == 0) {
            kernel = levels[k];
            Py_RETURN_NONE;
        }
    }
    PyErr_Format(PyExc_ValueError, "this machine or build has no instruction set level '%s'", name);
    return NULL;
}

static PyMethodDef methods[] = {
    {"run", py_run, METH_VARARGS,
     "run(law, record, coefficients, directions, seeds, force, columns, workspace): force and tangent columns."},
    {"causal", py_causal, METH_VARARGS, "causal(law, record, coefficients, force): the per-sample map."},
    {"follow", py_follow, METH_VARARGS,
     "follow(plant, displacement, velocity, loops): whole closed loops of trackers with the dampers of a capsule, which\n"
     "it moves on; False where a command is not finite or a sample is refused. A loop: tracker, state, settings, sensed,\n"
     "frozen, force, given."},
    {"squared_errors", py_squared_errors, METH_VARARGS,
     "squared_errors(law, records, measured, from, coefficients, errors): ensemble over candidates and runs."},
    {"gram", py_gram, METH_VARARGS, "gram(columns, rows, from, out): Gram matrix of the rows."},
    {"gram_sums", py_gram_sums, METH_VARARGS,
     "gram_sums(law, records, measured, from, coefficients, places, out, residuals): over candidates and runs."},
    {"curve", py_curve, METH_VARARGS, "curve(kappa, n, tau, w, slope, by_kappa, by_n): the universal curve."},
    {"lag", py_lag, METH_VARARGS,
     "lag(step, rise, fall, wheel, saturation, command, applied, by_lag, before): first-order lag of a command."},
    {"banded", py_banded, METH_VARARGS,
     "banded(lower, right): solve a symmetric positive definite system of a narrow band, in place."},
    {"batch", py_batch, METH_VARARGS,
     "batch(step, displacement, velocity, acceleration, dead_band, longest_step, patience, last, motion): a Record."},
    {"carry", py_carry, METH_VARARGS,
     "carry(law, record, coefficients, state, force, workspace): force of a batch, from state to state."},
    {"turns", py_turns, METH_VARARGS,
     "turns(state, displacement, dead_band, at): how many turning points the next samples show; their samples in at."},
    {"levels", py_levels, METH_NOARGS, "Instruction set levels that this machine can run, slowest first."},
    {"level", py_level, METH_NOARGS, "The level in use."},
    {"use_level", py_use_level, METH_VARARGS, "use_level(name): choose a level (for tests and the bench)."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_kernel", "The C kernel of mrdamper.", -1, methods,
                                        NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernel(void)
{
    find_levels();
    PyObject *module = PyModule_Create(&definition);
    if (!module) return NULL;
    PyObject *type = PyType_FromSpec(&record_spec);
    if (!type || PyModule_AddObjectRef(module, "Record", type) < 0) {
        Py_XDECREF(type);
        Py_DECREF(module);
        return NULL;
    }
    record_type = (PyTypeObject *)type;
    type = PyType_FromSpec(&workspace_spec);
    if (!type || PyModule_AddObjectRef(module, "Workspace", type) < 0) {
        Py_XDECREF(type);
        Py_DECREF(module);
        return NULL;
    }
    workspace_type = (PyTypeObject *)type;
    type = PyType_FromSpec(&tracker_spec);
    if (!type || PyModule_AddObjectRef(module, "Tracker", type) < 0) {
        Py_XDECREF(type);
        Py_DECREF(module);
        return NULL;
    }
    tracker_type = (PyTypeObject *)type;
    if (PyModule_AddIntConstant(module, "MOTION_NUMBERS", (long)(sizeof(mrd_motion) / sizeof(double))) < 0
        || PyModule_AddIntConstant(module, "TURNS_NUMBERS", (long)(sizeof(mrd_turns) / sizeof(double))) < 0
        || PyModule_AddIntConstant(module, "STATE_NUMBERS", (long)(sizeof(mrd_state) / sizeof(double))) < 0) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
