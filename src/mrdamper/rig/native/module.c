/* The extension mrdamper.rig._plant: a damper that keeps its state, moved on by a step or by a run.
 *
 * Built against the stable ABI (CPython 3.11), without NumPy: anything that exports a contiguous buffer of C
 * doubles will do. A whole run works on a copy of the state with the GIL released; the copy is put back at its
 * end. Values are checked here once: nothing that is not finite reaches the state.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#include <math.h>
#include <string.h>

#include "plant.h"

/* CPython's slot tables hold functions as void pointers, which ISO C has no conversion for; every platform that
 * runs CPython has. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpedantic"
#endif

#define X(name) #name,
static const char *const parameter_names[] = {RIG_PARAMETERS(X)};
static const char *const state_names[] = {RIG_STATE(X)};
#undef X

enum {
    PARAMETERS = sizeof parameter_names / sizeof *parameter_names,
    STATES = sizeof state_names / sizeof *state_names
};

typedef struct {
    PyObject_HEAD
    rig_parameters parameters;
    rig_state state;
    rig_climate climate; /* of the last temperature: a function of it alone, kept to save its exponentials */
    double step;
} PlantObject;

/* A contiguous buffer of doubles. Returns 0 with an exception set on failure. */
static int open_doubles(PyObject *object, Py_buffer *view, int writable, const char *what)
{
    if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) < 0) return 0;
    if (view->itemsize != (Py_ssize_t)sizeof(double) || !view->format || strcmp(view->format, "d") != 0) {
        PyErr_Format(PyExc_TypeError, "%s must be contiguous float64", what);
        PyBuffer_Release(view);
        return 0;
    }
    return 1;
}

/* A Python float, held over the run, as a buffer of one. */
static int hold_double(PyObject *object, Py_buffer *view, double *held)
{
    *held = PyFloat_AsDouble(object);
    return PyBuffer_FillInfo(view, NULL, held, sizeof *held, 1, PyBUF_SIMPLE) == 0;
}

static size_t count_of(const Py_buffer *view) { return (size_t)view->len / sizeof(double); }

static PlantObject *make_plant(PyTypeObject *type)
{
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    return (PlantObject *)alloc(type, 0);
}

static PyObject *plant_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    PyObject *given;
    double step;
    static char *names[] = {"parameters", "step", NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "Od", names, &given, &step)) return NULL;
    Py_buffer view;
    if (!open_doubles(given, &view, 0, "parameters")) return NULL;
    PlantObject *self = NULL;
    if (count_of(&view) != PARAMETERS || !(step > 0.0))
        PyErr_Format(PyExc_ValueError, "expected %d parameters and a positive step", (int)PARAMETERS);
    else if ((self = make_plant(type)) != NULL) {
        memcpy(&self->parameters, view.buf, sizeof self->parameters);
        memset(&self->state, 0, sizeof self->state);
        self->step = step;
        rig_settle(&self->parameters, step, 293.15, &self->climate);
    }
    PyBuffer_Release(&view);
    return (PyObject *)self;
}

static void plant_dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

/* Written so that what is not a number fails. The bounds are those of any damper on a rig; within them the state
 * stays finite. */
static int is_usable(const rig_parameters *p, double x, double v, double command, double kelvin)
{
    return fabs(x) <= 2.0 && fabs(v) <= 10.0 && fabs(command) <= 100.0 && kelvin >= 200.0 && kelvin <= 500.0
           && kelvin > p->viscosity_pole_K;
}

static PyObject *refuse(size_t sample)
{
    return PyErr_Format(PyExc_ValueError,
                        "sample %zu: expected finite numbers: displacement within 2 m, velocity 10 m/s, current 100 A, "
                        "temperature -73 to 226 degC and above the viscosity's pole",
                        sample);
}

static PyObject *plant_advance(PyObject *object, PyObject *args)
{
    PlantObject *self = (PlantObject *)object;
    double x, v, command, kelvin, field;
    if (!PyArg_ParseTuple(args, "dddd", &x, &v, &command, &kelvin)) return NULL;
    if (!is_usable(&self->parameters, x, v, command, kelvin)) return refuse(0);
    if (kelvin != self->climate.kelvin) rig_settle(&self->parameters, self->step, kelvin, &self->climate);
    return PyFloat_FromDouble(
        rig_step(&self->parameters, &self->climate, self->step, x, v, command, &self->state, &field));
}

enum { DISPLACEMENT, VELOCITY, COMMAND, KELVIN, FORCE, COIL, FIELD, ARRAYS };

static PyObject *plant_run(PyObject *object, PyObject *args)
{
    static const char *const what[ARRAYS] = {"displacement", "velocity", "current", "temperature",
                                             "force",        "coil",     "field"};
    PlantObject *self = (PlantObject *)object;
    PyObject *given[ARRAYS], *result = NULL;
    Py_buffer view[ARRAYS];
    double *array[ARRAYS], held[ARRAYS];
    if (!PyArg_ParseTuple(args, "OOOOOOO", given, given + 1, given + 2, given + 3, given + 4, given + 5, given + 6))
        return NULL;
    int opened = 0;
    size_t n = 0;
    for (; opened < ARRAYS; opened++) {
        const int may_hold = opened == COMMAND || opened == KELVIN;
        if (opened >= COIL && given[opened] == Py_None) { /* not asked for */
            array[opened] = NULL;
            PyBuffer_FillInfo(view + opened, NULL, NULL, 0, 1, PyBUF_SIMPLE);
            continue;
        }
        if (!(may_hold && PyFloat_CheckExact(given[opened])
                  ? hold_double(given[opened], view + opened, held + opened)
                  : open_doubles(given[opened], view + opened, opened >= FORCE, what[opened])))
            goto release;
        array[opened] = view[opened].buf;
        const size_t count = count_of(view + opened);
        if (opened == DISPLACEMENT) n = count;
        /* a current or a temperature of one value is held */
        if (count != n && !(count == 1 && may_hold)) {
            PyErr_Format(PyExc_ValueError, "%s has %zu values; expected %zu", what[opened], count, n);
            opened++;
            goto release;
        }
    }
    {
        const rig_parameters parameters = self->parameters;
        const double step = self->step;
        const size_t along = count_of(view + COMMAND) == 1 ? 0 : 1, warming = count_of(view + KELVIN) == 1 ? 0 : 1;
        rig_state state = self->state;
        rig_climate climate = self->climate;
        size_t k = 0;
        Py_BEGIN_ALLOW_THREADS
        for (; k < n; k++) {
            const double x = array[DISPLACEMENT][k], v = array[VELOCITY][k];
            const double command = array[COMMAND][along * k], kelvin = array[KELVIN][warming * k];
            if (!is_usable(&parameters, x, v, command, kelvin)) break;
            if (kelvin != climate.kelvin) rig_settle(&parameters, step, kelvin, &climate);
            double field;
            array[FORCE][k] = rig_step(&parameters, &climate, step, x, v, command, &state, &field);
            if (array[COIL]) array[COIL][k] = state.coil_A;
            if (array[FIELD]) array[FIELD][k] = field;
        }
        Py_END_ALLOW_THREADS
        if (k < n) {
            refuse(k);
        } else {
            self->state = state;
            self->climate = climate;
            result = Py_NewRef(Py_None);
        }
    }
release:
    for (int k = 0; k < opened; k++) PyBuffer_Release(view + k);
    return result;
}

static PyObject *plant_copy(PyObject *object, PyObject *unused)
{
    (void)unused;
    const PlantObject *self = (const PlantObject *)object;
    PlantObject *other = make_plant(Py_TYPE(object));
    if (!other) return NULL;
    other->parameters = self->parameters;
    other->state = self->state;
    other->climate = self->climate;
    other->step = self->step;
    return (PyObject *)other;
}

static PyObject *plant_get_state(PyObject *object, void *unused)
{
    (void)unused;
    double values[STATES];
    memcpy(values, &((const PlantObject *)object)->state, sizeof values);
    PyObject *out = PyTuple_New(STATES);
    for (Py_ssize_t k = 0; out && k < STATES; k++)
        if (PyTuple_SetItem(out, k, PyFloat_FromDouble(values[k])) < 0) Py_CLEAR(out);
    return out;
}

static int plant_set_state(PyObject *object, PyObject *given, void *unused)
{
    (void)unused;
    double values[STATES];
    if (!given || !PyTuple_Check(given) || PyTuple_Size(given) != STATES) {
        PyErr_Format(PyExc_ValueError, "a state is a tuple of %d numbers", (int)STATES);
        return -1;
    }
    for (Py_ssize_t k = 0; k < STATES; k++) {
        values[k] = PyFloat_AsDouble(PyTuple_GetItem(given, k));
        if (PyErr_Occurred()) return -1;
        if (!isfinite(values[k])) {
            PyErr_Format(PyExc_ValueError, "%s of the state is not finite", state_names[k]);
            return -1;
        }
    }
    memcpy(&((PlantObject *)object)->state, values, sizeof values);
    return 0;
}

static PyMethodDef plant_methods[] = {
    {"advance", plant_advance, METH_VARARGS,
     "advance(displacement, velocity, current, kelvin): one step; returns the force [N] at its end."},
    {"run", plant_run, METH_VARARGS,
     "run(displacement, velocity, current, kelvin, force, coil, field): a step per sample; fills the last three, of\n"
     "which coil and field may be None. A current or a temperature that is a float is held."},
    {"copy", plant_copy, METH_NOARGS, "A damper in the same state, which goes its own way from here."},
    {NULL, NULL, 0, NULL}};

static PyGetSetDef plant_attributes[] = {
    {"state", plant_get_state, plant_set_state, "All that the damper remembers, in the order of STATE.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot plant_slots[] = {{Py_tp_new, (void *)plant_new},
                                    {Py_tp_dealloc, (void *)plant_dealloc},
                                    {Py_tp_methods, plant_methods},
                                    {Py_tp_getset, plant_attributes},
                                    {Py_tp_doc, "Plant(parameters, step): a virtual damper at rest, no current."},
                                    {0, NULL}};

static PyType_Spec plant_spec = {"mrdamper.rig._plant.Plant", sizeof(PlantObject), 0, Py_TPFLAGS_DEFAULT, plant_slots};

static int add_names(PyObject *module, const char *attribute, const char *const *names, Py_ssize_t count)
{
    PyObject *out = PyTuple_New(count);
    for (Py_ssize_t k = 0; out && k < count; k++)
        if (PyTuple_SetItem(out, k, PyUnicode_FromString(names[k])) < 0) Py_CLEAR(out);
    const int status = out ? PyModule_AddObjectRef(module, attribute, out) : -1;
    Py_XDECREF(out);
    return status;
}

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_plant", "The C part of the virtual rig.", -1, NULL,
                                        NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__plant(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (!module) return NULL;
    PyObject *type = PyType_FromSpec(&plant_spec);
    if (!type || PyModule_AddObjectRef(module, "Plant", type) < 0
        || add_names(module, "PARAMETERS", parameter_names, PARAMETERS) < 0
        || add_names(module, "STATE", state_names, STATES) < 0) {
        Py_XDECREF(type);
        Py_DECREF(module);
        return NULL;
    }
    Py_DECREF(type);
    return module;
}
