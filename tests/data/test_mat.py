"""MAT files with the structures that test-bench programs save are read. Names identify the signals."""

from __future__ import annotations

import struct

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.mat import read_mat
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.readers import read_file
from tests.data.rig_files import read_run, save_mat73

pytestmark = pytest.mark.system

TIME = np.arange(0.0, 2.0, 0.002)
SIGNALS = {
    "displacement": (5.0 * np.sin(2 * np.pi * TIME), "mm"),
    "force": (300.0 * np.cos(2 * np.pi * TIME), "N"),
    "current": (np.full(TIME.size, 0.5), "A"),
}


def structures(names, rows):
    """Return an array of MATLAB structures."""
    made = np.zeros(len(rows), dtype=[(name, object) for name in names])
    for k, row in enumerate(rows):
        made[k] = row
    return made


def dspace(count=3, name="Time", slow=1):
    """Return a dSPACE recording: X are the times and Y are the signals. The current has every n-th sample."""
    fields = ("Name", "Type", "Data", "Unit", "XIndex", "Raster")
    rows = [(name, 4, values, unit, 1, "HostService") for name, (values, unit) in SIGNALS.items()]
    x = structures(fields, [(name, 4, TIME[::k], "", 0, "HostService") for k in {1: None, slow: None}])
    if slow > 1:
        rows[2] = (rows[2][0], 4, rows[2][2][::slow], "A", 2, "Slow")
    return {
        "X": x,
        "Y": structures(fields, rows[:count]),
        "Capture": {"SamplingPeriod": 0.002},
        "RTProgram": "rig",
    }


def simulink(labels):
    """Return a structure with time, as the Scope and To Workspace blocks of Simulink save it."""
    rows = [
        (values[:, None], 1, label, "") for (values, _), label in zip(SIGNALS.values(), labels, strict=True)
    ]
    signals = structures(("values", "dimensions", "label", "title"), rows)
    return {"time": TIME[:, None], "signals": signals, "blockName": "rig/Scope"}


@pytest.fixture(params=["7", "7.3"])
def save(request):
    """Return a function that saves variables in one of the MAT versions."""
    return savemat if request.param == "7" else save_mat73


@pytest.fixture
def table(tmp_path, save):
    """Return a function that saves variables to a file and reads this file."""

    def read(part="", **variables):
        path = tmp_path / "run.mat"
        save(path, variables)
        return (read_mat if save is savemat else read_hdf5)(path, FileOptions(part))

    return read


@pytest.mark.parametrize(
    "variables",
    [
        {"rec1": dspace()},
        {"rec1": dspace(name="")},
        {"rec1": dspace(slow=10)},
        {"ScopeData": simulink(["displacement_mm", "force_N", "current_A"]), "tout": TIME[:, None]},
    ],
)
def test_named_mat_signals_need_no_map(tmp_path, save, variables):
    save(tmp_path / "run.mat", variables)
    (run,) = read_run(tmp_path / "run.mat")
    assert np.array_equal(run.time, TIME)
    assert np.allclose(run.displacement, 1e-3 * SIGNALS["displacement"][0], rtol=1e-15)
    assert np.array_equal(run.force, SIGNALS["force"][0])
    assert run.constant_command == 0.5


@pytest.mark.parametrize(
    "conditions",
    [
        {"oil": {"value": 24.0, "unit": "degC"}, "coil": {"value": 500.0, "unit": "mA"}},
        {"test": {"oil_degC": 24.0, "coil_current_A": 0.5}},
        {"test": {"temperature": "24 degC", "current": "0.5 A"}},
    ],
)
def test_conditions_in_mat_structures_are_used(tmp_path, save, conditions):
    arrays = {f"{name}_{SIGNALS[name][1]}": SIGNALS[name][0] for name in ("displacement", "force")}
    save(tmp_path / "run.mat", {"data": {"time_s": TIME, **arrays}, "conditions": conditions})
    (run,) = read_run(tmp_path / "run.mat")
    assert run.constant_command == 0.5
    assert run.temperature == pytest.approx(297.15)


def test_prefixes_of_runs_in_mat_are_groups(table):
    """A list of one current for each run has no prefix."""
    run = {"time_s": TIME, "force_N": SIGNALS["force"][0], "x_mm": SIGNALS["displacement"][0]}
    named = {f"run{k}_{name}": values * k for k in (1, 2) for name, values in run.items()}
    whole = table(**named, current_A=np.array([0.5, 1.0]))
    assert (whole.title, whole.more) == ("run1", ("run2",))
    assert {"current_A: 0.5 A"} <= set(whole.said)
    apart = table(force_t_s=TIME, force_raw_N=TIME, force_N=TIME, x_t_s=TIME, x_raw_mm=TIME, x_mm=TIME)
    assert apart.more == ()


def test_mat_recordings_are_read_separately(table):
    read = table(rec1=dspace(), rec2=dspace(), part="rec2")
    assert {"Time [s]", "displacement", "force", "current"} <= set(read.names)
    whole = table(rec1=dspace(), rec2=dspace())
    assert (whole.title, whole.more) == ("rec1", ("rec2",))
    assert {"Time [s]", "displacement", "force", "current"} <= set(whole.names)


def opaque(name, kind):
    """Return the bytes with which a MAT file stores a MATLAB object, such as a string or a table."""

    def element(code, content):
        return struct.pack("<II", code, len(content)) + content + b"\0" * (-len(content) % 8)

    numbers = np.array([3707764736, 2, 1, 1, 1, 1], np.uint32)
    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", kind))
    content = (
        element(6, struct.pack("<II", 17, 0)) + texts + element(14, inner + element(6, numbers.tobytes()))
    )
    return element(14, content)


@pytest.mark.parametrize("first", [True, False])
def test_objects_in_mat_are_skipped(tmp_path, first):
    """A string object next to the arrays does not prevent the arrays from being read."""
    path = tmp_path / "run.mat"
    savemat(path, {f"{name}_{unit}": values for name, (values, unit) in SIGNALS.items()} | {"time_s": TIME})
    content = path.read_bytes()
    notes = opaque("note", "string") + opaque("log", "timetable")
    path.write_bytes(content[:128] + (notes + content[128:] if first else content[128:] + notes))
    read = read_file(path)
    assert np.array_equal(read.recordings[0].force, SIGNALS["force"][0])
    assert read.layout.notes == ("skipped: note (string object), log (timetable object)",)


def test_objects_in_hdf5_mat_are_skipped(tmp_path):
    path = tmp_path / "run.mat"
    save_mat73(
        path, {f"{name}_{unit}": values for name, (values, unit) in SIGNALS.items()} | {"time_s": TIME}
    )
    with h5py.File(path, "r+") as file:
        note = file.create_dataset("note", data=np.array([[3707764736, 2, 1, 1, 1, 1]], np.uint32))
        note.attrs.update({"MATLAB_class": np.bytes_("string"), "MATLAB_object_decode": np.int32(3)})
    read = read_file(path)
    assert np.array_equal(read.recordings[0].force, SIGNALS["force"][0])
    assert read.layout.notes == ("skipped: note (string object)",)


def test_circular_references_in_mat_are_ignored(tmp_path):
    path = tmp_path / "run.mat"
    save_mat73(path, {"run": {"time_s": TIME}, "runs": np.array([{"a": TIME}, {"a": TIME}], dtype=object)})
    with h5py.File(path, "r+") as file:
        file["run/again"] = file["run"]
        file["run/soft"] = h5py.SoftLink("/run/time_s")
        file["runs"][0] = file["run"].ref
        file["runs"][1] = h5py.Reference()
        to_itself = file.create_dataset("ring", (1, 1), h5py.ref_dtype)
        to_itself[0, 0] = to_itself.ref
    assert read_hdf5(path, FileOptions()).names == ("time_s",)
