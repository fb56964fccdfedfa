/* VehicleStep: a car's observer and demand; its state is handed out and in as bytes. Included by module.c. */
#define MRD_VEHICLE_API static
#include "../kernel/vehicle.c"

#include "vehicle_face.c"

typedef struct {
    PyObject_HEAD
    const vehicle_face *face; /* of its precision */
    void *vehicle;
} VehicleObject;

typedef union {
    mrd_vehicle_state state;
    unsigned char bytes[sizeof(mrd_vehicle_state)];
} vehicle_state_room;

static PyObject *vehicle_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"numbers", "wheel_accelerometer", "acceleration_driven", "coast_samples", "single", NULL};
    PyObject *onumbers;
    vehicle_parts parts;
    int single = 0;
    Py_buffer numbers;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "Oppi|p", names, &onumbers, &parts.wheel_accelerometer,
                                     &parts.acceleration_driven, &parts.coast_samples, &single)
        || !open_doubles(onumbers, &numbers, 0, "numbers"))
        return NULL;
    const size_t count = parts.wheel_accelerometer ? VEHICLE_NUMBERS(6) : VEHICLE_NUMBERS(5);
    const int fits = count_of(&numbers) == count && parts.coast_samples >= 0;
    if (fits) memcpy(parts.number, numbers.buf, count * sizeof *parts.number);
    PyBuffer_Release(&numbers);
    if (!fits) {
        PyErr_Format(PyExc_ValueError, "such a vehicle has %zu numbers, and coasts for some samples", count);
        return NULL;
    }
    const allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    VehicleObject *self = (VehicleObject *)alloc(type, 0);
    if (!self) return NULL;
    self->face = single ? mrd_vehicle_single() : &vehicle_of_precision;
    self->vehicle = malloc(self->face->vehicle_size);
    if (!self->vehicle) {
        Py_DECREF(self);
        return PyErr_NoMemory();
    }
    self->face->load(self->vehicle, &parts);
    return (PyObject *)self;
}

static void vehicle_dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    free(((VehicleObject *)object)->vehicle);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(object);
    Py_DECREF(type);
}

static int read_vehicle_state(const vehicle_face *with, PyObject *object, vehicle_state_room *state)
{
    char *bytes;
    Py_ssize_t size;
    if (PyBytes_AsStringAndSize(object, &bytes, &size) < 0) return 0;
    if (size != (Py_ssize_t)with->state_size) {
        PyErr_SetString(PyExc_ValueError, "this is not a vehicle's state");
        return 0;
    }
    memcpy(state, bytes, (size_t)size);
    return 1;
}

static PyObject *vehicle_bytes(const vehicle_face *with, const vehicle_state_room *state)
{
    return PyBytes_FromStringAndSize((const char *)state, (Py_ssize_t)with->state_size);
}

static PyObject *vehicle_start(PyObject *object, PyObject *unused)
{
    (void)unused;
    const VehicleObject *self = (VehicleObject *)object;
    vehicle_state_room state;
    self->face->start(&state);
    return vehicle_bytes(self->face, &state);
}

static PyObject *vehicle_step(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    const VehicleObject *self = (VehicleObject *)object;
    vehicle_state_room state;
    double inputs[VEHICLE_INPUTS], outputs[VEHICLE_OUTPUTS];
    if (count != 1 + VEHICLE_INPUTS) {
        PyErr_SetString(PyExc_TypeError, "step(state, body_acceleration, wheel_acceleration, stroke)");
        return NULL;
    }
    if (!read_vehicle_state(self->face, args[0], &state)) return NULL;
    for (int k = 0; k < VEHICLE_INPUTS; k++)
        if (!read_number(args[1 + k], inputs + k)) return NULL;
    self->face->step(self->vehicle, &state, inputs, outputs);
    return Py_BuildValue("Ndd", vehicle_bytes(self->face, &state), outputs[0], outputs[1]);
}

static PyObject *vehicle_demand(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    const VehicleObject *self = (VehicleObject *)object;
    double value[6], outputs[VEHICLE_OUTPUTS];
    if (count != 6) {
        PyErr_SetString(PyExc_TypeError, "demand(z1, z2, z3, z4, off, pushed)");
        return NULL;
    }
    for (int k = 0; k < 6; k++)
        if (!read_number(args[k], value + k)) return NULL;
    self->face->demand(self->vehicle, value, value[4], value[5], outputs);
    return Py_BuildValue("dd", outputs[0], outputs[1]);
}

static PyObject *vehicle_run(PyObject *object, PyObject *args)
{
    const VehicleObject *self = (VehicleObject *)object;
    PyObject *ostate, *oinputs, *owanted, *oflags, *out = NULL;
    vehicle_state_room state;
    Py_buffer inputs, wanted, flags;
    if (!PyArg_ParseTuple(args, "OOOO", &ostate, &oinputs, &owanted, &oflags)) return NULL;
    if (!read_vehicle_state(self->face, ostate, &state) || !open_doubles(oinputs, &inputs, 0, "inputs")) return NULL;
    if (open_doubles(owanted, &wanted, 1, "wanted")) {
        if (open_doubles(oflags, &flags, 1, "flags")) {
            const size_t n = count_of(&flags);
            if (count_of(&inputs) != VEHICLE_INPUTS * n || count_of(&wanted) != VEHICLE_OUTPUTS * n) {
                PyErr_SetString(PyExc_ValueError, "inputs must be [n][3], wanted [n][2], flags [n]");
            } else {
                const double *row = inputs.buf;
                double *to = wanted.buf, *raised = flags.buf;
                for (size_t k = 0; k < n; k++, row += VEHICLE_INPUTS, to += VEHICLE_OUTPUTS) {
                    self->face->step(self->vehicle, &state, row, to);
                    raised[k] = self->face->flags(&state);
                }
                out = vehicle_bytes(self->face, &state);
            }
            PyBuffer_Release(&flags);
        }
        PyBuffer_Release(&wanted);
    }
    PyBuffer_Release(&inputs);
    return out;
}

static PyObject *vehicle_read(PyObject *object, PyObject *ostate)
{
    const VehicleObject *self = (VehicleObject *)object;
    vehicle_state_room state;
    double z[VEHICLE_READ];
    if (!read_vehicle_state(self->face, ostate, &state)) return NULL;
    self->face->read(&state, z);
    return Py_BuildValue("(dddddd)", z[0], z[1], z[2], z[3], z[4], z[5]);
}

static PyMethodDef vehicle_methods[] = {
    {"start", vehicle_start, METH_NOARGS, "The state before the first sample."},
    {"step", (PyCFunction)(void (*)(void))vehicle_step, METH_FASTCALL,
     "step(state, body_acceleration, wheel_acceleration, stroke): the next state, the wanted force now and ahead."},
    {"demand", (PyCFunction)(void (*)(void))vehicle_demand, METH_FASTCALL,
     "demand(z1, z2, z3, z4, off, pushed): the wanted force of these states, now and ahead."},
    {"run", vehicle_run, METH_VARARGS, "run(state, inputs, wanted, flags): many steps; the state after them."},
    {"read", vehicle_read, METH_O, "read(state): what the observer believes."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot vehicle_slots[] = {{Py_tp_new, vehicle_new},
                                      {Py_tp_dealloc, vehicle_dealloc},
                                      {Py_tp_methods, vehicle_methods},
                                      {Py_tp_doc, "What a car asks of its damper; it does not change."},
                                      {0, NULL}};

static PyType_Spec vehicle_spec = {"mrdamper.core._kernel.VehicleStep", (int)sizeof(VehicleObject), 0, Py_TPFLAGS_DEFAULT,
                                   vehicle_slots};
