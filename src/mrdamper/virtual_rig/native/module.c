/* The extension mrdamper.virtual_rig._plant: a damper with a state, which advances by one step or by a whole run.
 *
 * Built against the stable ABI (CPython 3.11), without NumPy: anything that exports a contiguous buffer of C
 * doubles will do. A whole run works on a copy of the state with the GIL released; the copy is put back at its
 * end. Values are checked here once: nothing that is not finite reaches the state.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hydraulic.h"
#include "loop_plant.h"
#include "plant.h"

/* CPython's slot tables hold functions as void pointers, which ISO C has no conversion for; every platform that
 * runs CPython has. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpedantic"
#endif

enum { MOST_NUMBERS = 96 };

/* A lumped or hydraulic damper with its complete state. */
typedef struct plant_kind plant_kind;
typedef struct {
    const plant_kind *kind;
    double step;
    int inner; /* smaller steps in each step, of the kind that is solved in such */
    union {
        double values[MOST_NUMBERS];
        rig_parameters lumped;
        hydraulic_parameters hydraulic;
    } parameters;
    union {
        double values[MOST_NUMBERS];
        rig_state lumped;
        hydraulic_state hydraulic;
    } state;
    union {
        rig_climate lumped;
        hydraulic_climate hydraulic;
    } climate; /* values at the last temperature, cached because exponentials are slow */
    double kelvin;
} plant;

struct plant_kind {
    const char *name;
    const char *const *parameter_names, *const *state_names;
    Py_ssize_t parameters, states; /* numbers of parameters and states; state 0 is the coil current */
    void (*settle)(plant *self);   /* compute the climate at a temperature */
    int (*is_usable)(const plant *self, double x, double kelvin);
    int (*step)(plant *self, double x, double v, double command, double *force, double *field);
    const char *expected;
};

typedef struct {
    PyObject_HEAD
    plant plant;
} PlantObject;

#define X(name) #name,
static const char *const lumped_parameters[] = {RIG_PARAMETERS(X)};
static const char *const lumped_states[] = {RIG_STATE(X)};
static const char *const hydraulic_parameter_names[] = {HYDRAULIC_PARAMETERS(X)};
static const char *const hydraulic_states[] = {HYDRAULIC_STATE};
#undef X

static void settle_lumped(plant *self)
{
    rig_settle(&self->parameters.lumped, self->step, self->kelvin, &self->climate.lumped);
}

static int is_usable_lumped(const plant *self, double x, double kelvin)
{
    return fabs(x) <= 2.0 && kelvin > self->parameters.lumped.viscosity_pole_K;
}

static int step_lumped(plant *self, double x, double v, double command, double *force, double *field)
{
    *force = rig_step(&self->parameters.lumped, &self->climate.lumped, self->step, x, v, command, &self->state.lumped,
                      field);
    return 1;
}

static void settle_hydraulic(plant *self)
{
    hydraulic_settle(&self->parameters.hydraulic, self->kelvin, &self->climate.hydraulic);
}

static int is_usable_hydraulic(const plant *self, double x, double kelvin)
{
    const hydraulic_parameters *p = &self->parameters.hydraulic;
    return x <= 0.9 * p->chamber_1_m && x >= -0.9 * p->chamber_2_m && kelvin >= 230.0;
}

static int step_hydraulic(plant *self, double x, double v, double command, double *force, double *field)
{
    const int found = hydraulic_step(&self->parameters.hydraulic, &self->climate.hydraulic, self->step, self->inner, x, v,
                                     command, &self->state.hydraulic, force);
    *field = self->state.hydraulic.field_T;
    return found;
}

#define COUNT(names) ((Py_ssize_t)(sizeof(names) / sizeof *(names)))
static const plant_kind kinds[] = {
    {"lumped", lumped_parameters, lumped_states, COUNT(lumped_parameters), COUNT(lumped_states), settle_lumped,
     is_usable_lumped, step_lumped,
     "displacement within 2 m, velocity 10 m/s, current 100 A, temperature -73 to 226 degC and above the viscosity's pole"},
    {"hydraulic", hydraulic_parameter_names, hydraulic_states, COUNT(hydraulic_parameter_names), COUNT(hydraulic_states),
     settle_hydraulic, is_usable_hydraulic, step_hydraulic,
     "displacement within 90 % of the chambers, velocity 10 m/s, current 100 A, temperature -43 to 226 degC"}};

/* Get a contiguous buffer of doubles. Return 0 with an exception set on failure. */
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

/* Convert a Python float, which is constant over the run, to a buffer with one value. */
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
    const char *name;
    PyObject *given;
    double step;
    int inner;
    static char *names[] = {"kind", "parameters", "step", "inner", NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "sOdi", names, &name, &given, &step, &inner)) return NULL;
    const plant_kind *kind = NULL;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        if (strcmp(kinds[k].name, name) == 0) kind = kinds + k;
    if (!kind) return PyErr_Format(PyExc_ValueError, "there is no kind of damper %s", name);
    Py_buffer view;
    if (!open_doubles(given, &view, 0, "parameters")) return NULL;
    PlantObject *self = NULL;
    if (count_of(&view) != (size_t)kind->parameters || !(step > 0.0) || inner < 1)
        PyErr_Format(PyExc_ValueError, "expected %zd parameters, a positive step and one smaller step or more",
                     kind->parameters);
    else if ((self = make_plant(type)) != NULL) {
        memset(&self->plant, 0, sizeof self->plant);
        memcpy(self->plant.parameters.values, view.buf, (size_t)view.len);
        self->plant.kind = kind;
        self->plant.step = step;
        self->plant.inner = inner;
        self->plant.kelvin = 293.15;
        kind->settle(&self->plant);
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

enum { DONE, REFUSED, LOST };

/* NaN fails these comparisons. The bounds hold for any damper on a rig and keep the state finite. */
static int is_in_range(const plant *self, double x, double v, double command, double kelvin)
{
    return fabs(v) <= 10.0 && fabs(command) <= 100.0 && kelvin >= 200.0 && kelvin <= 500.0
        && self->kind->is_usable(self, x, kelvin);
}

/* Check the inputs and make one step. */
static int move(plant *self, double x, double v, double command, double kelvin, double *force, double *field)
{
    if (!is_in_range(self, x, v, command, kelvin)) return REFUSED;
    if (kelvin != self->kelvin) {
        self->kelvin = kelvin;
        self->kind->settle(self);
    }
    return self->kind->step(self, x, v, command, force, field) ? DONE : LOST;
}

static PyObject *refuse(const plant *self, int why, size_t sample)
{
    if (why == LOST)
        return PyErr_Format(PyExc_ValueError,
                            "sample %zu: the damper's equations have no solution there; move it less violently, or ask "
                            "for a smaller solver step",
                            sample);
    return PyErr_Format(PyExc_ValueError, "sample %zu: expected finite numbers: %s", sample, self->kind->expected);
}

static PyObject *plant_advance(PyObject *object, PyObject *args)
{
    PlantObject *self = (PlantObject *)object;
    double x, v, command, kelvin, force, field;
    if (!PyArg_ParseTuple(args, "dddd", &x, &v, &command, &kelvin)) return NULL;
    plant moved = self->plant;
    const int why = move(&moved, x, v, command, kelvin, &force, &field);
    if (why != DONE) return refuse(&moved, why, 0);
    self->plant = moved;
    return PyFloat_FromDouble(force);
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
        if (opened >= COIL && given[opened] == Py_None) { /* not requested */
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
        /* A current or temperature with one value is constant over the run. */
        if (count != n && !(count == 1 && may_hold)) {
            PyErr_Format(PyExc_ValueError, "%s has %zu values; expected %zu", what[opened], count, n);
            opened++;
            goto release;
        }
    }
    {
        const size_t along = count_of(view + COMMAND) == 1 ? 0 : 1, warming = count_of(view + KELVIN) == 1 ? 0 : 1;
        plant moved = self->plant;
        size_t k = 0;
        int why = DONE;
        Py_BEGIN_ALLOW_THREADS
        for (; k < n; k++) {
            double field;
            why = move(&moved, array[DISPLACEMENT][k], array[VELOCITY][k], array[COMMAND][along * k],
                       array[KELVIN][warming * k], array[FORCE] + k, &field);
            if (why != DONE) break;
            if (array[COIL]) array[COIL][k] = moved.state.values[0];
            if (array[FIELD]) array[FIELD][k] = field;
        }
        Py_END_ALLOW_THREADS
        if (why != DONE) {
            refuse(&moved, why, k);
        } else {
            self->plant = moved;
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
    other->plant = self->plant;
    return (PyObject *)other;
}

/* Copies of a damper at one temperature, for the closed loops of another extension. */
enum { COPIES_MAX = 64 };

typedef struct {
    loop_plant face; /* first member: a pointer to it is also a pointer to the struct */
    double kelvin;
    plant each[]; /* face.count */
} held_plants;

static int advance_copies(loop_plant *self, const double *x, const double *v, size_t steps, const double *command,
                           double *const *force)
{
    held_plants *held = (held_plants *)self;
    double field;
    for (size_t m = 0; m < self->count; m++)
        for (size_t k = 0; k < steps; k++)
            if (move(held->each + m, x[k], v[k], command[m], held->kelvin, force[m] + k, &field) != DONE) return 0;
    return 1;
}

static void free_held(PyObject *capsule) { free(PyCapsule_GetPointer(capsule, MRD_LOOP_PLANT)); }

static PyObject *plant_hold(PyObject *object, PyObject *args)
{
    double kelvin;
    int count;
    if (!PyArg_ParseTuple(args, "di", &kelvin, &count)) return NULL;
    if (count < 1 || count > COPIES_MAX) return PyErr_Format(PyExc_ValueError, "1 to %d copies", (int)COPIES_MAX);
    held_plants *held = malloc(sizeof *held + (size_t)count * sizeof *held->each);
    if (!held) return PyErr_NoMemory();
    plant settled = ((const PlantObject *)object)->plant;
    settled.kelvin = kelvin;
    settled.kind->settle(&settled);
    held->face.count = (size_t)count;
    held->face.advance = advance_copies;
    held->kelvin = kelvin;
    for (int m = 0; m < count; m++) held->each[m] = settled;
    PyObject *capsule = PyCapsule_New(held, MRD_LOOP_PLANT, free_held);
    if (!capsule) free(held);
    return capsule;
}

static PyObject *plant_get_state(PyObject *object, void *unused)
{
    (void)unused;
    const plant *self = &((const PlantObject *)object)->plant;
    PyObject *out = PyTuple_New(self->kind->states);
    for (Py_ssize_t k = 0; out && k < self->kind->states; k++)
        if (PyTuple_SetItem(out, k, PyFloat_FromDouble(self->state.values[k])) < 0) Py_CLEAR(out);
    return out;
}

static int plant_set_state(PyObject *object, PyObject *given, void *unused)
{
    (void)unused;
    PlantObject *self = (PlantObject *)object;
    plant changed = self->plant;
    const Py_ssize_t states = changed.kind->states;
    if (!given || !PyTuple_Check(given) || PyTuple_Size(given) != states) {
        PyErr_Format(PyExc_ValueError, "a state is a tuple of %zd numbers", states);
        return -1;
    }
    for (Py_ssize_t k = 0; k < states; k++) {
        changed.state.values[k] = PyFloat_AsDouble(PyTuple_GetItem(given, k));
        if (PyErr_Occurred()) return -1;
        if (!isfinite(changed.state.values[k])) {
            PyErr_Format(PyExc_ValueError, "%s of the state is not finite", changed.kind->state_names[k]);
            return -1;
        }
    }
    self->plant = changed;
    return 0;
}

static PyMethodDef plant_methods[] = {
    {"advance", plant_advance, METH_VARARGS,
     "advance(displacement, velocity, current, kelvin): one step; returns the force [N] at its end."},
    {"run", plant_run, METH_VARARGS,
     "run(displacement, velocity, current, kelvin, force, coil, field): a step per sample; fills the last three, of\n"
     "which coil and field may be None. A current or a temperature that is a float is held."},
    {"hold", plant_hold, METH_VARARGS,
     "hold(kelvin, count): copies at that temperature, in a capsule for closed loops in C."},
    {"copy", plant_copy, METH_NOARGS, "A damper in the same state, which goes its own way from here."},
    {NULL, NULL, 0, NULL}};

static PyGetSetDef plant_attributes[] = {
    {"state", plant_get_state, plant_set_state, "All that the damper remembers, in the order of STATE.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot plant_slots[] = {{Py_tp_new, (void *)plant_new},
                                    {Py_tp_dealloc, (void *)plant_dealloc},
                                    {Py_tp_methods, plant_methods},
                                    {Py_tp_getset, plant_attributes},
                                    {Py_tp_doc, "Plant(kind, parameters, step, inner): a virtual damper at rest, no current."},
                                    {0, NULL}};

static PyType_Spec plant_spec = {"mrdamper.virtual_rig._plant.Plant", sizeof(PlantObject), 0, Py_TPFLAGS_DEFAULT, plant_slots};

static PyObject *names_of(const char *const *names, Py_ssize_t count)
{
    PyObject *out = PyTuple_New(count);
    for (Py_ssize_t k = 0; out && k < count; k++)
        if (PyTuple_SetItem(out, k, PyUnicode_FromString(names[k])) < 0) Py_CLEAR(out);
    return out;
}

/* Add the names of parameters and states of each kind of damper. Return 0 with an exception set on failure. */
static int add_names(PyObject *module)
{
    PyObject *parameters = PyDict_New(), *states = PyDict_New();
    int good = parameters && states;
    for (size_t k = 0; good && k < sizeof kinds / sizeof *kinds; k++) {
        PyObject *of_parameters = names_of(kinds[k].parameter_names, kinds[k].parameters);
        PyObject *of_states = names_of(kinds[k].state_names, kinds[k].states);
        good = of_parameters && of_states && PyDict_SetItemString(parameters, kinds[k].name, of_parameters) == 0
               && PyDict_SetItemString(states, kinds[k].name, of_states) == 0;
        Py_XDECREF(of_parameters);
        Py_XDECREF(of_states);
    }
    good = good && PyModule_AddObjectRef(module, "PARAMETERS", parameters) == 0
           && PyModule_AddObjectRef(module, "STATE", states) == 0;
    Py_XDECREF(parameters);
    Py_XDECREF(states);
    return good;
}

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_plant", "The C part of the virtual rig.", -1, NULL,
                                        NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__plant(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (!module) return NULL;
    PyObject *type = PyType_FromSpec(&plant_spec);
    if (!type || PyModule_AddObjectRef(module, "Plant", type) < 0 || !add_names(module)) {
        Py_XDECREF(type);
        Py_DECREF(module);
        return NULL;
    }
    Py_DECREF(type);
    return module;
}
