"""Division of rows into runs, joined runs, and interpolated values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Layout, Table
from mrdamper.data.proposal.clocks import to_one_clock, with_clocks
from mrdamper.data.proposal.pieces import (
    Piece,
    cut_at_gaps,
    evened,
    integrated,
    run_edges,
)
from mrdamper.data.proposal.roles import find_columns

STEP_s: Any = 0.01


def table(**columns: object) -> Table:
    """Return a table of columns by name, ``__`` for the bracket of a unit: ``force__N`` is ``force [N]``."""
    named = {f"{name.replace('__', ' [', 1)}]" if "__" in name else name: np.asarray(values, float)
             for name, values in columns.items()}  # fmt: skip
    rows = max(map(len, named.values()))
    return Table(names=(*named,), columns=named, texts={}, layout=Layout("text"), rows=rows)


@pytest.mark.parametrize(("back", "runs"), [(1.0, 1), (14.0, 1), (16.0, 2)])
def test_falling_time_begins_new_run(back, runs):
    time = STEP_s * np.concatenate([np.arange(100.0), 99.0 - back + np.arange(100.0)])
    edges, _ = run_edges(time, {})
    assert edges == ([0, 200] if runs == 1 else [0, 100, 200])


def test_repeated_time_stamps_are_spread_evenly():
    stamps = STEP_s * (np.arange(400) // 2)
    found = evened(Piece(time=stamps, channels={}))
    assert np.allclose(np.diff(found.time), 0.005, rtol=1e-4)
    assert [each.kind for each in found.findings] == ["coarse_time"]
    assert found.findings[0].size == pytest.approx(STEP_s)
    lost = np.concatenate([stamps[:200], stamps[200:] + 0.1])
    kept: Any
    for kept in (lost, stamps[:198], np.arange(400.0), stamps[::-1]):
        assert np.array_equal(evened(Piece(time=kept, channels={})).time, kept)


def test_record_is_cut_at_gaps():
    for steps, rows, lengths in ((4.9, 50, [100]), (5.1, 50, [50, 50]), (5.1, 15, [100])):
        time = STEP_s * np.arange(100.0)
        time[rows:] += (steps - 1.0) * STEP_s
        parts = [*cut_at_gaps(Piece(time=time, channels={}))]
        assert [len(each.time) for each in parts] == lengths
        gaps = [found.size for each in parts for found in each.findings]
        assert gaps == ([] if len(parts) == 1 else [pytest.approx(steps * STEP_s)])


@pytest.mark.parametrize("cycles", [3.7, 4.0, 4.3])  # an even or an odd number of reversals
@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_velocity_is_integrated_without_its_drift(offset, cycles):
    """The drift is computed over whole cycles because a line fitted to a part of a sine has a slope."""
    time = 0.1 * STEP_s * np.arange(round(1000 * cycles))
    velocity = 0.05 * np.cos(2.0 * np.pi * time + 0.4) + offset
    found = integrated(Piece(time=time, channels={"velocity": velocity}))
    path = 0.05 / (2.0 * np.pi) * np.sin(2.0 * np.pi * time + 0.4)
    assert np.allclose(found.channels["displacement"], path, atol=2e-5)


def test_slower_clock_is_interpolated():
    fast, slow = 0.01 * np.arange(101), 0.1 * np.arange(11)
    text = np.full((2, 101), np.nan)
    text[:, :11] = slow, 20.0 + slow
    read = with_clocks(table(time__s=fast, force__N=fast, slow_time__s=text[0], temperature__degC=text[1]))
    assert [*read.clocks.values()] == [0, 0, 1, 1]
    names = {"force": "force [N]", "temperature": "temperature [degC]"}
    one = to_one_clock(read, names, ChannelMap(), "run.csv")
    assert one.interpolated == ("temperature",)
    assert np.allclose(one.columns["temperature"], 20.0 + fast)
    text[1, 5] = np.nan  # A missing number is not a second clock.
    torn = table(time__s=fast, force__N=fast, slow_time__s=text[0], temperature__degC=text[1])
    assert with_clocks(torn) is torn


# --------------------------------------------------------------------------------------------- roles

MOVED = {"time__s": np.arange(50.0), "displacement__mm": np.arange(50.0)}


def named(role: str, **columns: object) -> str:
    """Return the name of the column that has a role."""
    found = find_columns(table(**columns), ChannelMap(), "run.csv")
    return next(column.name for column in found if column.role == role)


@pytest.mark.parametrize(
    ("role", "wins", "loses"),
    [
        ("force", "force__N", "force_setpoint__N"),
        ("force", "force__N", "F__N"),
        ("force", "load__N", "x2__N"),
        ("temperature", "fluid_temperature__degC", "temperature__degC"),
        ("temperature", "temperature__degC", "ambient_temperature__degC"),
        ("current", "current__A", "current_setpoint__A"),
    ],
)
@pytest.mark.parametrize("first", ["wins", "loses"])
def test_header_words_select_column_of_same_unit(role, wins, loses, first):
    """Measured values have priority over set points, words over symbols, and fluid over air, in any order."""
    order = (wins, loses) if first == "wins" else (loses, wins)
    others = {} if role == "force" else {"force__N": np.ones(50)}
    found = named(role, **MOVED, **dict.fromkeys(order, np.ones(50)), **others)
    assert found == f"{wins.replace('__', ' [')}]"


def test_increasing_column_is_the_time():
    counter = np.arange(50.0)
    found = named("time", lap__s=counter % 10.0, time__s=counter, displacement__mm=counter, force__N=counter)
    assert found == "time [s]"
