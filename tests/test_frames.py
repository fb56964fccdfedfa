"""Runs from data frames and arrays equal runs from files, and have the same error messages."""

from __future__ import annotations

import numpy as np
import pandas as pd
import polars as pl
import pytest

import mrdamper
from mrdamper.data.records import RigRun
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
    """Return the columns of a run under names that contain units. A change to None removes a column."""
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
def test_data_frames_of_all_libraries_are_read(frame, runs):
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
def test_time_index_of_data_frame_is_time(kind, runs):
    frame = pd.DataFrame(columns(runs[0], time_ms=None)).set_index(TIMES[kind](runs[0]))
    named = frame.rename_axis(None).reset_index(names="when")
    for each in (frame, named):
        (read,) = mrdamper.read(each)
        np.testing.assert_allclose(read.time, runs[0].time, atol=1e-6)


def test_second_level_of_data_frame_columns_is_unit(runs):
    given = columns(runs[0])
    given["force_kN"] = given.pop("Load [kN]")
    frame = pd.DataFrame(given).set_axis(
        pd.MultiIndex.from_tuples([name.split("_") for name in given]), axis=1
    )
    for each in (frame, pl.DataFrame(given).lazy()):
        (read,) = mrdamper.read(each)
        np.testing.assert_allclose(read.force, runs[0].force, rtol=1e-9)


def test_channels_may_be_column_names_or_arrays(runs):
    run = runs[0]
    bare = pd.DataFrame({"t": run.time, "Pos": 1e3 * run.displacement, "Load": 1e-3 * run.force})
    named = mrdamper.read(
        bare, {"time_s": "t", "displacement_mm": "Pos", "force_kN": "Load", "current_A": 0.5}
    )
    held = mrdamper.read(
        columns={
            "time_s": run.time,
            "displacement_m": run.displacement,
            "force_N": run.force,
            "current_A": 0.5,
        }
    )
    sampled = mrdamper.read(
        bare.drop(columns="t"),
        {"displacement_mm": "Pos", "force_kN": "Load", "current_A": 0.5, "rate_Hz": 500.0},
    )
    for each in (named, held, sampled):
        np.testing.assert_allclose(each.runs[0].force, run.force)
        np.testing.assert_allclose(each.runs[0].time, run.time, atol=1e-9)


def test_simulation_is_independent_of_measured_force(runs):
    card = mrdamper.fit(runs, "bouc-wen").card()
    with_force, without = (
        card.simulate(columns(runs[1])),
        card.simulate(columns(runs[1], **{"Load [kN]": None})),
    )
    np.testing.assert_allclose(without.force, with_force.force)
    assert without.measured is None
    (error,) = card.evaluate(columns(runs[1]))
    assert f"RMS error {error.rmse_N:.4g} N" in with_force.summary()
