"""Where a file's rows are cut into runs, what joins them again, and what is filled in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Layout, Table
from mrdamper.data.proposal.clocks import with_clocks
from mrdamper.data.proposal.pieces import (
    Piece,
    cut_at_gaps,
    evened,
    filled,
    integrated,
    joined,
    run_edges,
    to_one_clock,
)
from mrdamper.data.proposal.recordings import runs_in
from mrdamper.data.proposal.roles import find_columns
from mrdamper.data.proposal.side_by_side import side_by_side
from mrdamper.data.readers import read_run
from mrdamper.errors import InputError

STEP_s: Any = 0.01


def piece(rows: int, *, first_s: float = 0.0, **channels: object) -> Piece:
    """Return a piece of even times, of channels that are numbers or arrays."""
    time = first_s + STEP_s * np.arange(rows)
    held = {role: np.broadcast_to(np.asarray(each, float), rows).copy() for role, each in channels.items()}
    return Piece(time=time, channels=held)


def table(**columns: object) -> Table:
    """Return a table of columns by name, ``__`` for the bracket of a unit: ``force__N`` is ``force [N]``."""
    named = {f"{name.replace('__', ' [', 1)}]" if "__" in name else name: np.asarray(values, float)
             for name, values in columns.items()}  # fmt: skip
    rows = max(map(len, named.values()))
    return Table(names=(*named,), columns=named, texts={}, layout=Layout("text"), rows=rows)


@pytest.mark.parametrize(("back", "runs"), [(1.0, 1), (14.0, 1), (16.0, 2)])
def test_a_time_that_falls_by_sixteen_samples_begins_another_run(back, runs):
    time = STEP_s * np.concatenate([np.arange(100.0), 99.0 - back + np.arange(100.0)])
    edges, _ = run_edges(time, (), {})
    assert edges == ([0, 200] if runs == 1 else [0, 100, 200])


def test_no_run_is_shorter_than_sixteen_samples():
    for rows, edges in ((15, [0, 115]), (16, [0, 16, 116])):
        time = STEP_s * np.concatenate([200.0 + np.arange(rows), np.arange(100.0)])
        assert run_edges(time, (), {})[0] == edges


def test_words_in_every_row_name_runs_where_they_change_at_most_every_sixteenth():
    time = STEP_s * np.arange(64)
    few, many = (list[str | None](f"run {k // rows}" for k in range(64)) for rows in (16, 15))
    assert run_edges(time, (), {"name": few}) == (
        [0, 16, 32, 48, 64],
        {0: "run 0", 16: "run 1", 32: "run 2", 48: "run 3"},
    )
    assert run_edges(time, (), {"name": many}) == ([0, 64], {})
    assert run_edges(time, (), {"name": ["", *few[1:]]}) == ([0, 64], {})


@pytest.mark.parametrize(
    ("pause", "command", "parts"), [(1.4, 1.0, 1), (1.6, 1.0, 2), (-1.0, 1.0, 2), (1.0, 1.5, 2)]
)
def test_pieces_are_joined_whose_time_goes_on_at_the_same_command(pause, command, parts):
    before = piece(50, command=1.0)
    after = piece(50, first_s=float(before.time[-1]) + pause * STEP_s, command=command)
    found = joined([before, after])
    assert [len(each.time) for each in found] == ([100] if parts == 1 else [50, 50])
    assert len(joined([before, piece(50, first_s=0.5)])) == 2  # no command is not the same
    warmer = replace(piece(50, first_s=0.5, command=1.0), told=(("temperature", 300.0, "its title"),))
    assert len(joined([before, warmer])) == 2


def test_a_temperature_said_in_the_first_row_holds_for_all():
    said = np.full(40, np.nan)
    said[0] = 300.0
    found = filled(piece(40, temperature=said, force=1.0))
    assert np.array_equal(found.channels["temperature"], np.full(40, 300.0))
    assert [each.kind for each in found.findings] == ["slow_channel"]
    assert np.isnan(filled(piece(40, temperature=np.nan)).channels["temperature"]).all()


@pytest.mark.parametrize(
    ("every", "offset", "slow"), [(2, 0, True), (10, 0, True), (10, 9, True), (1, 0, False)]
)
def test_a_slow_channel_stands_at_even_distances_up_to_both_ends(every, offset, slow):
    values = np.full(101, np.nan)
    values[offset::every] = np.arange(offset, 101, every)
    found = filled(piece(101, temperature=values))
    assert [each.kind for each in found.findings] == (["slow_channel"] if slow else [])
    inner = slice(offset, 100)
    assert np.array_equal(found.channels["temperature"][inner], np.arange(101.0)[inner])
    values[50] = np.nan if every == 10 and not offset else values[50]
    uneven = filled(piece(101, temperature=values))
    assert bool(uneven.findings) is (slow and not (every == 10 and not offset))


@pytest.mark.parametrize(("rows", "slow"), [(100, True), (101, True), (102, False)])
def test_behind_the_last_number_of_a_slow_channel_are_no_more_rows_than_between_two(rows, slow):
    values = np.full(rows, np.nan)
    values[:91:10] = 300.0
    assert bool(filled(piece(rows, temperature=values)).findings) is slow


@pytest.mark.parametrize(
    ("missing", "there"), [([50], True), ([50, 51], True), ([50, 51, 52], False), ([0], False)]
)
def test_a_hundredth_of_the_numbers_may_miss_between_others(missing, there):
    values = np.arange(200.0)
    values[missing] = np.nan
    found = filled(piece(200, force=values))
    assert np.array_equal(found.channels["force"], np.arange(200.0)) is there
    assert [each.size for each in found.findings] == [len(missing)] * there
    assert [each.from_s for each in found.findings] == pytest.approx([0.5] * there)


def test_repeated_stamps_are_spread_evenly_where_no_sample_was_lost():
    stamps = STEP_s * (np.arange(400) // 2)
    found = evened(Piece(time=stamps, channels={}))
    assert np.allclose(np.diff(found.time), 0.005, rtol=1e-4)
    assert [each.kind for each in found.findings] == ["coarse_time"]
    assert found.findings[0].size == pytest.approx(STEP_s)
    lost = np.concatenate([stamps[:200], stamps[200:] + 0.1])
    kept: Any
    for kept in (lost, stamps[:198], np.arange(400.0), stamps[::-1]):
        assert np.array_equal(evened(Piece(time=kept, channels={})).time, kept)


def test_a_record_is_cut_at_gaps_of_five_steps_where_both_parts_are_runs():
    for steps, rows, lengths in ((4.9, 50, [100]), (5.1, 50, [50, 50]), (5.1, 15, [100])):
        time = STEP_s * np.arange(100.0)
        time[rows:] += (steps - 1.0) * STEP_s
        parts = [*cut_at_gaps(Piece(time=time, channels={}))]
        assert [len(each.time) for each in parts] == lengths
        gaps = [found.size for each in parts for found in each.findings]
        assert gaps == ([] if len(parts) == 1 else [pytest.approx(steps * STEP_s)])


@pytest.mark.parametrize("cycles", [3.7, 4.0, 4.3])  # an even or an odd number of reversals
@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_a_velocity_is_integrated_without_its_drift(offset, cycles):
    """Over whole cycles: the best line through some cycles of a sine is not level."""
    time = 0.1 * STEP_s * np.arange(round(1000 * cycles))
    velocity = 0.05 * np.cos(2.0 * np.pi * time + 0.4) + offset
    found = integrated(Piece(time=time, channels={"velocity": velocity}))
    path = 0.05 / (2.0 * np.pi) * np.sin(2.0 * np.pi * time + 0.4)
    assert np.allclose(found.channels["displacement"], path, atol=2e-5)


@pytest.mark.parametrize("cycles", [9.7, 10.0, 10.3])  # an even or an odd number of reversals
def test_a_drift_that_grows_is_taken_off_over_the_whole_record(cycles):
    """To within a cycle: of c t^2 over T, the line through its ends leaves cT a second."""
    time, grows = 0.1 * STEP_s * np.arange(round(1000 * cycles)), 1e-5
    velocity = 0.05 * np.cos(2.0 * np.pi * time + 0.4) + 2.0 * grows * time
    path = integrated(Piece(time=time, channels={"velocity": velocity})).channels["displacement"]
    assert abs(path[-1000:].mean() - path[:1000].mean()) < 2.0 * grows * cycles


@pytest.mark.parametrize("first_s", [0.0, 100.0, -100.0])
@pytest.mark.parametrize(
    ("begins", "ends"), [(0.0, 0.91), (0.0, 0.89), (0.09, 1.0), (0.11, 1.0), (-0.5, 1.5)]
)
def test_clocks_cover_nine_tenths_of_the_fastest_whenever_it_begins(first_s, begins, ends):
    fast, slow = first_s + 0.01 * np.arange(101), first_s + np.linspace(begins, ends, 11)
    text = np.full((2, 101), np.nan)
    text[:, :11] = slow, slow
    read = with_clocks(table(time__s=fast, force__N=fast, slow_time__s=text[0], temperature__degC=text[1]))
    names = {"force": "force [N]", "temperature": "temperature [degC]"}
    if min(ends, 1.0) - max(begins, 0.0) > 0.9:
        columns, _ = to_one_clock(read, names, "run.csv")
        assert np.allclose(columns["temperature"], np.clip(fast, slow[0], slow[-1]))
    else:
        with pytest.raises(
            InputError, match=r"run.csv: column 'temperature \[degC\]' has a clock of its own"
        ):
            to_one_clock(read, names, "run.csv")


@pytest.mark.parametrize(("other", "beside"), [("force__N", False), ("peak__kN", True)])
def test_a_table_of_the_same_columns_that_is_no_run_is_refused_and_another_left_out(other, beside):
    t = STEP_s * np.arange(100)
    run = table(time__s=t, displacement__mm=np.sin(20.0 * t), force__N=np.cos(20.0 * t), current__A=t * 0.0)
    tables = [run, table(time__s=t[:50], **{other: t[:50]})]
    if beside:
        read = runs_in(tables, ChannelMap(), Path("run.csv"))
        assert len(read.recordings) == 1
        assert "1 tables without force over time left out" in read.layout.notes
    else:
        with pytest.raises(InputError, match=r"run.csv: no displacement"):
            runs_in(tables, ChannelMap(), Path("run.csv"))


def test_columns_of_a_slower_clock_are_interpolated_to_the_fastest():
    fast, slow = 0.01 * np.arange(101), 0.1 * np.arange(11)
    text = np.full((2, 101), np.nan)
    text[:, :11] = slow, 20.0 + slow
    read = with_clocks(table(time__s=fast, force__N=fast, slow_time__s=text[0], temperature__degC=text[1]))
    assert [*read.clocks.values()] == [0, 0, 1, 1]
    names = {"force": "force [N]", "temperature": "temperature [degC]"}
    columns, interpolated = to_one_clock(read, names, "run.csv")
    assert interpolated == ("temperature",)
    assert np.allclose(columns["temperature"], 20.0 + fast)
    text[1, 5] = np.nan  # a number is missing: it is no clock of its own
    torn = table(time__s=fast, force__N=fast, slow_time__s=text[0], temperature__degC=text[1])
    assert with_clocks(torn) is torn


@pytest.mark.parametrize("rows", [9, 10, 40])
def test_a_map_names_columns_side_by_side_as_they_repeat(rows):
    """Runs of ten rows at the least."""
    t = STEP_s * np.arange(rows)
    runs = {
        f"{name}{number}": t + k
        for number in ("", " (2)")
        for k, name in enumerate(("time_s", "x_mm", "F_N"))
    }
    both = Table(names=(*runs,), columns=runs, texts={}, layout=Layout("text"), rows=rows)
    for name, count in (("F_N", 2 if rows >= 10 else 1), ("F_N (2)", 1)):
        chosen = ChannelMap.from_dict({"channel": {"force": {"name": name, "unit": "N"}}})
        assert len(side_by_side(both, chosen)) == count


def test_runs_with_a_measured_current_are_named_by_the_words_beside_them(tmp_path):
    t = STEP_s * np.arange(300)
    x = 5.0 * np.sin(2.0 * np.pi * t)
    columns = (t, x, 100.0 * np.tanh(np.gradient(x, t)), 1.0 + 0.5 * np.sin(t))
    rows = "".join(
        f"{','.join(f'{cell:.6f}' for cell in row)},{name}\n"
        for name in ("cold", "warm")
        for row in zip(*columns, strict=True)
    )
    (tmp_path / "run.csv").write_text(f"time_s,displacement_mm,force_N,current_A,test\n{rows}")
    assert [run.name for run in read_run(tmp_path / "run.csv")] == ["run_cold", "run_warm"]


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
def test_of_several_columns_of_a_unit_words_choose_one(role, wins, loses, first):
    """A measured one before its set point, a word before a symbol, the fluid before the air; in any order."""
    order = (wins, loses) if first == "wins" else (loses, wins)
    others = {} if role == "force" else {"force__N": np.ones(50)}
    found = named(role, **MOVED, **dict.fromkeys(order, np.ones(50)), **others)
    assert found == f"{wins.replace('__', ' [')}]"


def test_of_two_times_the_one_that_increases_is_it():
    counter = np.arange(50.0)
    found = named("time", lap__s=counter % 10.0, time__s=counter, displacement__mm=counter, force__N=counter)
    assert found == "time [s]"
