"""Runs from memory: frames and arrays give what files give, faults are told as those of files."""

from __future__ import annotations

import numpy as np
import pandas as pd
import polars as pl
import pytest

import mrdamper
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError, UsageError
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

TESTS = Campaign(
    motions=("sine5mm1Hz",), currents_A=(0.5, 2.0), temperatures_degC=(20.0,), steps=None, duration_s=3.0
)


@pytest.fixture(scope="module")
def runs() -> list[RigRun]:
    return [run for run, _ in measure(find_preset("nominal"), TESTS)]


def columns(run: RigRun, **changes: object) -> dict[str, object]:
    """Return a run's columns under names with units; None takes one away."""
    given = {
        "time_ms": 1e3 * run.time,
        "displacement_mm": 1e3 * run.displacement,
        "Load [kN]": 1e-3 * run.force,
        "current_A": run.command,
    }
    return {name: values for name, values in (given | changes).items() if values is not None}


def structured(given):
    rows = np.empty(len(given["time_ms"]), dtype=[(name, float) for name in given])
    for name, values in given.items():
        rows[name] = values
    return rows


@pytest.mark.parametrize(
    "frame",
    [pd.DataFrame, pl.DataFrame, dict, structured, lambda given: pd.DataFrame(given).set_index("time_ms")],
)
def test_a_frame_of_any_kind_is_the_run_that_it_holds(frame, runs):
    (read,) = mrdamper.read(frame(columns(runs[0])))
    for channel in ("time", "displacement", "force", "command"):
        np.testing.assert_allclose(getattr(read, channel), getattr(runs[0], channel), rtol=1e-9, atol=1e-12)
    assert read.command_unit == "A"


TIMES = {
    "elapsed": lambda run: pd.to_timedelta(run.time, unit="s"),
    "moments": lambda run: pd.Timestamp("2026-11-21") + pd.to_timedelta(run.time, unit="s"),
    "moments of a zone": lambda run: (
        pd.Timestamp("2026-11-21", tz="Asia/Tokyo") + pd.to_timedelta(run.time, unit="s")
    ),
}


@pytest.mark.parametrize("kind", TIMES)
def test_an_index_of_times_without_a_name_is_the_time(kind, runs):
    frame = pd.DataFrame(columns(runs[0], time_ms=None)).set_index(TIMES[kind](runs[0]))
    named = frame.rename_axis(None).reset_index(names="when")
    for each in (frame, named):
        (read,) = mrdamper.read(each)
        np.testing.assert_allclose(read.time, runs[0].time, atol=1e-6)


def test_a_second_level_of_names_is_the_unit_and_a_lazy_frame_is_collected(runs):
    given = columns(runs[0])
    given["force_kN"] = given.pop("Load [kN]")
    frame = pd.DataFrame(given).set_axis(
        pd.MultiIndex.from_tuples([name.split("_") for name in given]), axis=1
    )
    for each in (frame, pl.DataFrame(given).lazy()):
        (read,) = mrdamper.read(each)
        np.testing.assert_allclose(read.force, runs[0].force, rtol=1e-9)


def test_what_a_mask_hides_is_not_taken(runs):
    load = 1e-3 * runs[0].force
    load[700] = 1e3
    masked = np.ma.masked_where(np.arange(len(load)) == 700, load)
    (read,) = mrdamper.read(columns(runs[0], **{"Load [kN]": masked}))
    np.testing.assert_allclose(read.force, runs[0].force, atol=0.02 * np.ptp(runs[0].force))
    with pytest.raises(InputError, match="several columns are called 'current_A'"):
        mrdamper.read(pd.concat([pd.DataFrame(columns(runs[0]))] * 2, axis=1)[["time_ms", "current_A"]])


def test_names_say_commands_and_tell_runs_apart(runs):
    found = mrdamper.read({f"{run.command[0]:g} A": columns(run, current_A=None) for run in runs})
    assert found.names == ("0.5 A", "2 A")
    assert [run.constant_command for run in found] == [0.5, 2.0]


def test_keywords_say_which_column_is_which_or_hold_it(runs):
    run = runs[0]
    bare = pd.DataFrame({"t": run.time, "Pos": 1e3 * run.displacement, "Load": 1e-3 * run.force})
    named = mrdamper.read(bare, time_s="t", displacement_mm="Pos", force_kN="Load", current_A=0.5)
    held = mrdamper.read(time_s=run.time, displacement_m=run.displacement, force_N=run.force, current_A=0.5)
    sampled = mrdamper.read(
        bare.drop(columns="t"), displacement_mm="Pos", force_kN="Load", current_A=0.5, rate_Hz=500.0
    )
    for each in (named, held, sampled):
        np.testing.assert_allclose(each.runs[0].force, run.force)
        np.testing.assert_allclose(each.runs[0].time, run.time, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "kind", "said"),
    [
        ({"Load [kN]": None, "force": 1.0}, AskingError, r"frame: force has no unit; .*force_kN=\"Load\""),
        ({"current_A": None}, AskingError, "frame: no current or voltage; expected a column"),
        ({"displacement_mm": None}, AskingError, "frame: no displacement column; the columns are: time_ms"),
        ({"time_ms": np.arange(40.0)}, InputError, r"frame: columns differ in length \(time_ms 40"),
        ({"time_ms": np.zeros((3, 3))}, InputError, r"column 'time_ms' has shape \(3, 3\); expected"),
        ({"force_N": 1.0}, AskingError, "frame: columns 'Load .kN.', 'force_N' all hold force"),
        ({"Load [kN]": np.full(1500, np.nan)}, InputError, "frame: force is nan at sample 0"),
        ({"time_ms": np.full(1500, 2.0)}, InputError, "expected time to increase at every sample"),
        ({"Load [kN]": np.full(1500, 1j)}, InputError, r"column 'Load \[kN\]' is complex; expected numbers"),
        ({"Load [kN]": ["a"] * 1500}, InputError, r"column 'Load \[kN\]' .force. holds text"),
    ],
)  # fmt: skip
def test_what_arrays_leave_open_or_have_wrong_is_told_as_of_files(changes, kind, said, runs):
    with pytest.raises(kind, match=said):
        mrdamper.read(columns(runs[0], **changes))


@pytest.mark.parametrize(
    ("given", "said", "expected"),
    [
        ({"force_kN": "Laod"}, {}, "channel.force: no column 'Laod'; did you mean 'Load"),
        ({"force": "Load"}, {}, "force has no unit"),
        ({"force_parsec": "Load"}, {}, "unit 'parsec' is not a unit of force"),
        ({"forze": "Load"}, {}, "no option 'forze'"),
        ({"force_kN": "Load", "channels": "map.toml"}, {}, "exclude each other"),
    ],
)
def test_keywords_that_do_not_fit_are_refused(given, said, expected, runs):
    bare = pd.DataFrame(columns(runs[0])).rename(columns={"Load [kN]": "Load"})
    with pytest.raises((InputError, UsageError, TypeError), match=expected):
        mrdamper.read(bare, **given, **said)


def test_an_array_without_names_and_a_number_are_no_runs():
    with pytest.raises(InputError, match=r"an array of shape \(9, 4\) has no names of columns"):
        mrdamper.read(np.zeros((9, 4)))
    with pytest.raises(InputError, match="expected paths, runs, or frames with columns"):
        mrdamper.read(3)


def test_a_simulated_force_needs_no_measured_one_and_is_the_same_with_one(runs):
    card = mrdamper.fit(runs, "bouc-wen").card()
    with_force, without = (
        card.simulate(columns(runs[1])),
        card.simulate(columns(runs[1], **{"Load [kN]": None})),
    )
    np.testing.assert_allclose(without.force, with_force.force)
    assert without.measured is None
    (error,) = card.evaluate(columns(runs[1]))
    assert f"RMS error {error.rmse_N:.4g} N" in with_force.summary()
