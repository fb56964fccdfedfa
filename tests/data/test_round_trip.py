"""Tables with all types of numbers, written by the library of each format, are read back unchanged."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime, timedelta
from itertools import cycle

import h5py
import numpy as np
import polars as pl
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from scipy.io import savemat

from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.mat import read_mat
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.objects import read_json, read_npz
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.formats.tdms import read_tdms

ROWS = 11
WHOLE = tuple(f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8))


def ends(kind: str) -> np.ndarray:
    """Return the smallest and the largest integer of a type, and some integers between them."""
    info = np.iinfo(kind)
    return np.array([info.min, info.max, *range(ROWS - 2)], dtype=kind)


FLOATS = {
    "f4": np.array([0.1, -2.5, np.nan, 1e-30, 3e38, *range(ROWS - 5)], dtype="f4"),
    "f8": np.array([0.1, -2.5, np.nan, 1e-300, 1e300, *range(ROWS - 5)], dtype="f8"),
}
TABLE: Mapping[str, np.ndarray] = {**{kind: ends(kind) for kind in WHOLE}, **FLOATS}
START = np.datetime64("2026-02-28T23:59:59.5", "us")
MOMENTS = START + np.arange(ROWS) * np.timedelta64(250_000, "us")
UNITS = {"i2": "N", "u4": "A", "f4": "V", "i8": "kN", "f8": "mm"}
PLAIN = FileOptions()


def same(found: np.ndarray, expected: np.ndarray) -> bool:
    """Return True if the values are equal, apart from the rounding of a scale factor."""
    return found.shape == expected.shape and np.allclose(
        found, expected, rtol=1e-15, atol=1e-14, equal_nan=True
    )


def assert_table(table, expected: Mapping[str, np.ndarray], rows: int = ROWS) -> None:
    """Check that a table contains these columns in this order, as float64."""
    assert list(table.names) == list(expected)
    assert list(table.columns) == list(expected)
    assert table.rows == rows
    for name, values in expected.items():
        assert np.array_equal(table.columns[name], values.astype(np.float64), equal_nan=True), name


# ------------------------------------------------------------------------------------------- HDF5


@pytest.mark.parametrize("order", "<>")
def test_hdf5_types_and_shapes_are_read(tmp_path, order):
    path = tmp_path / "run.h5"
    shapes = ((ROWS,), (ROWS, 1), (1, ROWS), (1, ROWS, 1))
    with h5py.File(path, "w") as file:
        file.attrs["rig"] = "bench 3"
        group = file.create_group("run")
        group.attrs["coil_current_A"] = 0.5
        group.attrs["list"] = [1, 2]
        for k, (name, values) in enumerate(TABLE.items()):
            given = values.astype(values.dtype.newbyteorder(order)).reshape(shapes[k % len(shapes)])
            stored = group.create_dataset(name, data=given)
            if name in UNITS:
                spelled = ("unit", "Units")[k % 2]
                stored.attrs[spelled] = UNITS[name] if k % 2 else UNITS[name].encode()
        group["flag"] = np.arange(ROWS) % 2 == 0
        group["words"] = [b"a", b"b"]
        group["complex"] = np.ones(ROWS, complex)
        group["three"] = np.ones((2, 3, 4))
    table = read_hdf5(path, PLAIN)
    expected = dict(sorted({**TABLE, "flag": np.arange(ROWS) % 2 == 0}.items()))
    assert_table(table, expected)
    assert dict(table.units) == UNITS
    assert set(table.said) == {"rig: bench 3", "coil_current_A: 0.5 A"}


def test_hdf5_attributes_of_empty_group_are_values(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["run/F"] = np.arange(5.0)
        file.create_group("conditions").attrs["oil_degC"] = 24.0
    assert_table(
        read_hdf5(tmp_path / "run.h5", PLAIN), {"oil_degC": np.array([24.0]), "F": np.arange(5.0)}, 5
    )


def test_hdf5_recordings_are_read_separately(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for k in (1, 2):
            file[f"campaign/test {k}/t"] = np.arange(5.0) * k
            file[f"campaign/test {k}/F"] = np.arange(5.0) + k
            file[f"campaign/test {k}"].attrs["number"] = k
        file["notes/t"] = np.arange(3.0)
    first = read_hdf5(path, PLAIN)
    assert (first.title, first.more) == ("campaign/test 1", ("campaign/test 2",))
    assert_table(first, {"F": np.arange(5.0) + 1, "t": np.arange(5.0)}, 5)
    second = read_hdf5(path, FileOptions("campaign/test 2"))
    assert_table(second, {"F": np.arange(5.0) + 2, "t": 2 * np.arange(5.0)}, 5)
    assert (second.said, second.more, second.layout.part) == (("number: 2",), (), "campaign/test 2")


def test_hdf5_records_and_matrices_give_columns(tmp_path):
    path = tmp_path / "run.h5"
    record = np.zeros(ROWS, [("t", "f8"), ("n", ">i4"), ("pair", "f8", 2), ("word", "S3")])
    record["t"], record["n"] = np.arange(ROWS) / 8.0, np.arange(ROWS) - 5
    with h5py.File(path, "w") as file:
        file["a record"] = record
        file["matrix"] = np.arange(3.0 * ROWS).reshape(ROWS, 3)
        file["wide"] = np.ones((65, 66))  # This matrix is too wide to be a table.
        named = file.create_dataset("two", data=np.arange(2.0 * ROWS).reshape(2, ROWS))
        named.attrs["labels"] = ["1", "2"]  # Numbers are not accepted as names of columns.
        named.attrs["unit"] = "N"
    columns = {"t": record["t"], "n": record["n"]}
    columns |= {f"column {k + 1} of matrix": np.arange(3.0 * ROWS)[k::3] for k in range(3)}
    columns |= {f"column {k + 1} of two": np.arange(2.0 * ROWS)[ROWS * k :][:ROWS] for k in range(2)}
    table = read_hdf5(path, PLAIN)
    assert_table(table, columns)
    assert dict(table.units) == {"column 1 of two": "N", "column 2 of two": "N"}


# ------------------------------------------------------------------------------------------- MAT, NumPy, JSON


def test_mat_types_and_shapes_are_read(tmp_path):
    lying = {f"x_{name}": values[None, :] for name, values in TABLE.items()}
    standing = {f"y_{name}": values[:, None] for name, values in TABLE.items()}
    flag = np.arange(ROWS) > 4
    beside = {"flag": flag, "one": 2.5, "word": "text", "z": np.ones(ROWS, complex)}
    empty = {"none": np.empty((0, 3)), "cube": np.ones((2, 3, 4)), "wide": np.ones((65, 66))}
    savemat(tmp_path / "run.mat", {**lying, **standing, **beside, **empty})
    expected = {**lying, **standing, "flag": flag}
    expected = {name: np.ravel(values) for name, values in expected.items()} | {"one": np.array([2.5])}
    assert_table(read_mat(tmp_path / "run.mat", PLAIN), expected)


def test_units_structure_in_mat_is_used(tmp_path):
    run = {"t": np.arange(5.0), "F": np.arange(5.0) ** 2}
    other = {"t": np.arange(4.0), "F": np.arange(4.0)}
    units = {"t": "s", "F": " kN "}
    savemat(tmp_path / "run.mat", {"a": {**run, "Units": units}, "b": {**other, "units": {"F": "N"}}})
    table = read_mat(tmp_path / "run.mat", PLAIN)
    assert (table.title, table.more, dict(table.units)) == ("a", ("b",), {"t": "s", "F": "kN"})
    assert_table(table, run, 5)
    table = read_mat(tmp_path / "run.mat", FileOptions("b"))
    assert (table.more, dict(table.units)) == ((), {"F": "N"})
    assert_table(table, other, 4)


def test_numpy_arrays_and_fields_are_read(tmp_path):
    record = np.zeros(ROWS, [("t", "<f4"), ("n", ">u2")])
    record["t"], record["n"] = np.arange(ROWS), 65535
    np.savez(tmp_path / "a.npz", **{**TABLE, "record": record, "note": np.array("text")})  # type: ignore[arg-type]
    expected = {**TABLE, "t": record["t"], "n": record["n"]}
    table = read_npz(tmp_path / "a.npz", PLAIN)
    assert_table(table, expected)
    assert table.said == ("note: text",)


@pytest.mark.parametrize("units_first", [True, False])
def test_json_name_list_gives_column_names(tmp_path, units_first):
    names, units = ["t", "F", "x"], ["s", "N", ""]
    rows = [[0.25 * k, None if k == 2 else 3.0 * k, k] for k in range(ROWS)]
    words = {"units": units, "names": names} if units_first else {"names": names, "units": units}
    content = {"meta": {"tags": ["one", "two"], **words}, "samples": rows}
    (tmp_path / "run.json").write_text(json.dumps(content))
    expected = np.array([[np.nan if cell is None else cell for cell in row] for row in rows]).T
    spelled = ["t [s]", "F [N]", "x"]
    assert_table(read_json(tmp_path / "run.json", PLAIN), dict(zip(spelled, expected, strict=True)))
    content["meta"] = {"tags": ["one", "two"]}
    (tmp_path / "run.json").write_text(json.dumps(content))
    bare = {f"column {k + 1} of samples": values for k, values in enumerate(expected)}
    assert_table(read_json(tmp_path / "run.json", PLAIN), bare)


# ------------------------------------------------------------------------------------------- TDMS


def test_tdms_types_and_units_are_read(tmp_path):
    path = tmp_path / "run.tdms"
    keys = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
    stated = {name: {keys[k]: unit} for k, (name, unit) in enumerate(UNITS.items())}

    def write(steps):
        channels = [
            ChannelObject("run", name, values, {"wf_increment": step, **stated.get(name, {})})
            for step, (name, values) in zip(cycle(steps), TABLE.items(), strict=False)
        ]
        spare = [
            ChannelObject("run", "words", ["a", "b"]),  # A channel of texts is omitted.
            ChannelObject("run", "empty", np.empty(0)),
            ChannelObject("run", "one", np.array([7.0])),
        ]
        group = GroupObject("run", properties={"Current [A]": 0.5})
        with TdmsWriter(str(path)) as writer:
            writer.write_segment([RootObject({"rig": "bench 3"}), group, *channels, *spare])
        return read_tdms(path, PLAIN)

    table = write([0.25])
    numbers = {name: table.columns[name] for name in TABLE}
    for name, values in TABLE.items():
        assert np.array_equal(numbers[name], values.astype(np.float64), equal_nan=True)
    assert table.names == (*TABLE, "one")
    assert dict(table.units) == UNITS
    assert (table.step_s, table.rows, table.title) == (0.25, ROWS, "run")
    assert {"rig: bench 3", "Current [A]: 0.5 A"} <= set(table.said)
    assert write([0.25, 0.5]).step_s is None
    assert write([0.0]).step_s is None
    assert write(["fast"]).step_s is None


def test_tdms_timestamps_become_seconds(tmp_path):
    path = tmp_path / "run.tdms"
    with TdmsWriter(str(path)) as writer:
        for half in (slice(0, 4), slice(4, None)):  # The recording has two segments.
            force = ChannelObject("run", "F", np.arange(float(ROWS))[half])
            writer.write_segment([ChannelObject("run", "at", MOMENTS[half]), force])
    table = read_tdms(path, PLAIN)
    assert dict(table.units) == {"at": "s"}
    assert_table(table, {"at": 0.25 * np.arange(ROWS), "F": np.arange(ROWS)})


# ------------------------------------------------------------------------------------------- Parquet


def test_parquet_types_are_read(tmp_path):
    frame = pl.DataFrame(dict(TABLE)).with_columns(
        pl.Series("gaps", [None, *range(ROWS - 1)], dtype=pl.Int16),
        pl.Series("words", [None, *"abcdefghij"]),
        pl.Series("at", [datetime(2026, 2, 28, 23, 59, 59) + timedelta(seconds=k / 4) for k in range(ROWS)]),
        pl.Series("since", [timedelta(seconds=2 + k / 4) for k in range(ROWS)]),
        pl.Series("day", [datetime(2026, 2, 28).date()] * ROWS),
    )
    frame.write_parquet(tmp_path / "run.parquet", row_group_size=4)
    table = read_parquet(tmp_path / "run.parquet", PLAIN)
    quarter = 0.25 * np.arange(ROWS)
    gaps = np.array([np.nan, *range(ROWS - 1)])
    assert table.names == (*TABLE, "gaps", "words", "at", "since")
    assert list(table.texts["words"]) == [None, *"abcdefghij"]
    assert dict(table.units) == {"at": "s", "since": "s"}
    numbers = {**TABLE, "gaps": gaps, "at": quarter, "since": 2.0 + quarter}
    table = read_parquet(tmp_path / "run.parquet", PLAIN)
    assert list(table.columns) == list(numbers)
    for name, values in numbers.items():
        assert same(table.columns[name], values.astype(np.float64)), name
    frame.select("words").write_parquet(tmp_path / "words.parquet")
    assert read_parquet(tmp_path / "words.parquet", PLAIN).rows == 0


def test_brackets_in_parquet_column_name_are_literal(tmp_path):
    for name in ("run[1].parquet", "run*.parquet", "run1.parquet"):
        pl.DataFrame({name: [1.0], "note": ["a"]}).write_parquet(tmp_path / name)
    for name in ("run[1].parquet", "run*.parquet"):
        table = read_parquet(tmp_path / name, PLAIN)
        assert (table.names, table.rows) == ((name, "note"), 1)
        assert table.columns[name].tolist() == [1.0]
        assert list(table.texts["note"]) == ["a"]
    pl.DataFrame({"note": ["a"]}).write_parquet(tmp_path / "words.parquet")
    assert read_parquet(tmp_path / "words.parquet", PLAIN).rows == 0


# ------------------------------------------------------------------------------------------- MDF


@pytest.mark.system
@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_mdf_types_and_clocks_are_read(tmp_path, version):
    from asammdf import MDF, Signal

    time, slow = 0.25 * np.arange(ROWS), 0.5 * np.arange(4.0)
    linear: dict[str, object] = {"a": 0.01, "b": -40.0}  # Factor and offset of a linear conversion
    with MDF(version=version) as file:
        signals = [Signal(values, time, UNITS.get(name, ""), name) for name, values in TABLE.items()]
        scaled = Signal(np.arange(ROWS, dtype="<i2"), time, "degC", "scaled", conversion=linear)
        file.append([*signals, scaled])
        file.append([Signal(np.arange(4.0), slow, "A", "slow")])
        file.append([Signal(np.arange(ROWS) + 2.0, time, "V", "same clock")])
        file.save(tmp_path / "run", overwrite=True)
    (path,) = tmp_path.glob("run.*")
    table = read_mdf(path, PLAIN)
    fast = {**TABLE, "scaled": 0.01 * np.arange(ROWS) - 40.0, "same clock": np.arange(ROWS) + 2.0}
    clocks = [name for name in table.names if name.endswith("time")]
    assert [np.array_equal(table.columns[name], time) for name in clocks] == [True, False]
    assert np.array_equal(table.columns[clocks[1]], slow)
    assert set(table.names) == {*clocks, *fast, "slow"}
    assert dict(table.clocks) == {clocks[0]: 0, clocks[1]: 1, "slow": 1} | dict.fromkeys(fast, 0)
    units = {**UNITS, "scaled": "degC", "slow": "A", "same clock": "V"} | dict.fromkeys(clocks, "s")
    assert dict(table.units) == units
    for name, values in fast.items():
        assert same(table.columns[name], values.astype(np.float64)), name


@pytest.mark.system
def test_mdf_groups_are_separate_recordings(tmp_path):
    from asammdf import MDF, Signal

    time = 0.25 * np.arange(ROWS)
    with MDF(version="4.10") as file:
        for k in (1, 2):
            signals = [
                Signal(k * np.arange(ROWS) + shift, time, "N", name) for shift, name in enumerate("FG")
            ]
            file.append(signals, acq_name=f"test {k}")
        file.append([Signal(np.empty(0), np.empty(0), "N", "F")], acq_name="empty")
        file.save(tmp_path / "run.mf4", overwrite=True)
    for part, k in (("", 1), ("test 2", 2)):
        table = read_mdf(tmp_path / "run.mf4", FileOptions(part))
        forces = {"F": k * np.arange(ROWS), "G": k * np.arange(ROWS) + 1}
        assert_table(table, {"time": time, **forces})
        assert table.title == f"test {k}"
        assert table.more == (() if part else ("test 2",))
