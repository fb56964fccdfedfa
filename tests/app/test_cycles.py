"""``mrdamper cycles``: figures of every cycle of a record, whatever the batches it is read in."""

from __future__ import annotations

import json
import signal
from dataclasses import fields
from math import pi, sin
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from mrdamper.app.cli import cli
from mrdamper.app.cycles_job import cycles
from mrdamper.data.cycle_stream import CycleCounter, CycleFigures
from mrdamper.data.streaming import Batch
from mrdamper.quantities import FloatArray

STEP_s, OF_CYCLE = 1e-3, 200
STROKE_m, FORCE_N, STIFFNESS_N_m = 0.01, 900.0, 5e4
ANGLE = 2.0 * pi / OF_CYCLE
ENERGY_J = pi * STROKE_m * FORCE_N * sin(ANGLE) / ANGLE  # of the sampled sine, by trapezoids: exact


def sine(samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, displacement and force of a viscous damper beside a spring."""
    number = np.arange(samples, dtype=np.float64)
    x = STROKE_m * np.sin(ANGLE * number)
    return STEP_s * number, x, FORCE_N * np.cos(ANGLE * number) + STIFFNESS_N_m * x


def counted(
    columns: tuple[FloatArray, FloatArray, FloatArray], rows: int
) -> tuple[CycleCounter, CycleFigures]:
    time, x, force = columns
    counter, parts = CycleCounter("record"), []
    for start in range(0, len(time), rows):
        k = slice(start, start + rows)
        n = len(time[k])
        warm = 300.0 + 0.01 * np.arange(start, start + n, dtype=np.float64)
        parts.append(counter.feed(Batch(start, time[k], x[k], force[k], np.full(n, 1.5), None, warm)))
    parts.append(counter.close())
    return counter, CycleFigures.joined(parts)


def test_a_sampled_sine_takes_up_its_closed_form_energy() -> None:
    counter, found = counted(sine(20_001), 3_000)
    assert len(found) == 99  # from the first lower turning point on
    assert found.row[0] == 150
    np.testing.assert_array_equal(found.samples, OF_CYCLE)
    np.testing.assert_allclose(found.energy_J, ENERGY_J, rtol=1e-12)
    np.testing.assert_allclose(found.stiffness_N_per_m, STIFFNESS_N_m, rtol=1e-9)
    np.testing.assert_allclose(found.amplitude_m, STROKE_m, rtol=1e-12)
    np.testing.assert_allclose(found.period_s, OF_CYCLE * STEP_s, rtol=1e-9)
    np.testing.assert_allclose(found.temperature_K, 300.0 + 0.01 * (found.row + 99.5), rtol=1e-12)
    assert not counter.findings()


@given(rows=st.integers(20, 30_000), seed=st.integers(0, 5))
@settings(max_examples=15, deadline=None)
def test_batches_do_not_matter_to_the_last_bit(rows: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time, x, force = sine(8_000)
    x = x + 1e-5 * rng.standard_normal(len(x))
    force[rng.integers(0, len(force), 3)] = np.nan
    time[rng.integers(4_000, 6_000) :] -= 2.0
    _, whole = counted((time, x, force), len(time))
    _, parts = counted((time, x, force), rows)
    for field in fields(CycleFigures):
        np.testing.assert_array_equal(getattr(parts, field.name), getattr(whole, field.name))


def test_a_cycle_that_a_break_touches_is_left_out_and_said() -> None:
    time, x, force = sine(10_001)
    force[1_000] = np.nan  # in the cycle from 950 on
    time[5_000:] -= 3.0  # in the one from 4950 on
    time[8_000:] += 7.0  # in the one from 7950 on
    counter, found = counted((time, x, force), 777)
    assert counter.broken == 3
    assert not {950, 4_950, 7_950} & set(found.row.tolist())
    assert len(found) == 49 - 3
    np.testing.assert_allclose(found.energy_J, ENERGY_J, rtol=1e-12)
    assert {each.kind for each in counter.findings()} == {"missing_rows", "time_back", "gap"}


def test_a_force_of_the_wrong_sign_is_a_fault() -> None:
    time, x, force = sine(2_001)
    counter, _ = counted((time, x, -force), 500)
    assert [each.kind for each in counter.findings()] == ["force_sign"]


def write(place: Path, samples: int = 20_001) -> Path:
    time, x, force = sine(samples)
    frame = {"time_s": time, "displacement_mm": 1e3 * x, "force_N": force, "current_A": np.full(samples, 1.5)}
    pl.DataFrame(frame).write_parquet(place, row_group_size=3_000)
    return place


def test_the_command_writes_table_page_and_summary(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    done = CliRunner().invoke(cli, ["cycles", str(record), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["cycles"] == 99
    assert answer["energy_J"] == pytest.approx(99 * ENERGY_J, rel=1e-9)
    assert answer == json.loads((tmp_path / "out" / "summary.json").read_text())
    table = pl.read_csv(tmp_path / "out" / "cycles.csv")
    np.testing.assert_allclose(table["energy_J"].to_numpy(), ENERGY_J, rtol=1e-9)
    assert table["cycle"].to_list() == list(range(1, 100))
    page = (tmp_path / "out" / "cycles.html").read_text()
    assert "energy per cycle" in page
    assert "<svg" in page


def test_the_table_does_not_depend_on_the_batches(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    for rows in (500, 20_001):
        cycles(record, batch_rows=rows, out=tmp_path / str(rows))
    tables = [(tmp_path / str(rows) / "cycles.csv").read_bytes() for rows in (500, 20_001)]
    assert tables[0] == tables[1]


def test_an_interrupt_keeps_what_was_counted(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")

    def stop(rows: int, _of: int | None, _cycles: int) -> None:
        if rows == 6_000:
            signal.raise_signal(signal.SIGINT)

    answer = cycles(record, batch_rows=2_000, out=tmp_path / "out", report=stop)
    assert answer["cancelled"]
    assert answer["rows"] == 6_000
    assert answer["cycles"] == 30 - 1  # lower turning points at 150, 350, ... 5950
    assert len(pl.read_csv(tmp_path / "out" / "cycles.csv")) == answer["cycles"]
    assert "Interrupted" in (tmp_path / "out" / "cycles.html").read_text()


def test_a_second_interrupt_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = write(tmp_path / "record.parquet")
    monkeypatch.setattr("mrdamper.app.interrupts._ONE_S", 0.0)

    def stop(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        cycles(record, batch_rows=2_000, out=tmp_path / "out", report=stop)
    assert [path.name for path in tmp_path.iterdir()] == ["record.parquet"]
