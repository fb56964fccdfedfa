"""Figures of every cycle of a record, whatever the batches that it is read in."""

from __future__ import annotations

from dataclasses import fields
from math import pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mrdamper.data.batches import Batch

from mrdamper.arrays import FloatArray
from mrdamper.data.cycles import CycleCounter, CycleFigures, cycles
from mrdamper.data.prepare import prepare_run
from mrdamper.data.records import RigRun
from tests.support.examples import examples

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
    columns: tuple[FloatArray, FloatArray, FloatArray],
    rows: int,
    warm: FloatArray | None = None,
    **how: float,
) -> tuple[CycleCounter, CycleFigures]:
    time, x, force = columns
    if warm is None:
        warm = np.asarray(300.0 + 0.01 * np.arange(len(time)), dtype=np.float64)
    counter, parts = CycleCounter("record", **how), []  # type: ignore[arg-type]
    for start in range(0, len(time), rows):
        k = slice(start, start + rows)
        n = len(time[k])
        parts.append(
            counter.step_batch(Batch(start, time[k], x[k], force[k], np.full(n, 1.5), None, warm[k]))
        )
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


@pytest.mark.system
@given(
    rows=st.integers(1, 3_000),
    seed=st.integers(0, 30),
    noise=st.sampled_from([0.0, 1e-5, 3e-4]),
)
@examples(8)
def test_what_is_carried_over_batches_changes_no_bit_and_each_cycle_is_that_of_plain_loops(
    rows: int, seed: int, noise: float
) -> None:
    """A short head, so that nearly every row comes after it; breaks and holes of all kinds."""
    rng = np.random.default_rng(seed)
    time, x, force = sine(5_000)
    x = x + noise * rng.standard_normal(len(x))
    warm = np.asarray(300.0 + 1e-3 * np.arange(len(x)), dtype=np.float64)
    warm[rng.integers(0, len(x), 50)] = np.nan
    force[rng.integers(0, len(x), 3)] = np.nan
    time[rng.integers(2_500, 3_500) :] -= 2.0
    time[4_000:] += 9.0
    how = {"least_stroke_m": 1e-3, "head_rows": 500}
    one, whole = counted((time, x, force), len(x), warm, **how)
    many, found = counted((time, x, force), rows, warm, **how)
    for each in fields(CycleFigures):
        np.testing.assert_array_equal(getattr(found, each.name), getattr(whole, each.name))
    assert many.findings() == one.findings()
    assert many.broken == one.broken
    assert len(found) > 12
    for i, first in enumerate(found.row.tolist()):
        k = slice(first, first + int(found.samples[i]) + 1)
        moved, pulled = x[k], force[k]
        middle = 0.5 * (pulled[0] + pulled[-1])
        work = np.trapezoid(pulled, moved) + middle * (moved[0] - moved[-1])
        assert found.energy_J[i] == pytest.approx(work, rel=1e-10)
        assert found.highest_force_N[i] == pulled.max()
        assert found.lowest_force_N[i] == pulled.min()
        assert found.amplitude_m[i] == pytest.approx(np.ptp(moved) / 2, rel=1e-12)
        u = int(np.argmax(moved))
        secant = (pulled[u] - middle) / (moved[u] - 0.5 * (moved[0] + moved[-1]))
        assert found.stiffness_N_per_m[i] == pytest.approx(secant, rel=1e-10)
        assert found.temperature_K[i] == pytest.approx(np.nanmean(warm[k][:-1]), rel=1e-12)


def test_the_cycles_are_those_that_a_whole_run_has() -> None:
    """A prepared run is smoothed, and so differs a little."""
    rng = np.random.default_rng(1)
    time, x, force = sine(12_001)
    x = x + 1e-6 * rng.standard_normal(len(x))
    force = force + 5.0 * rng.standard_normal(len(x))
    run = RigRun("run", time, x, force, np.full(len(x), 1.5), "A")
    whole = cycles(prepare_run(run))
    _, found = counted((time, x, force), 1_000)
    mine = {int(row): k for k, row in enumerate(found.row)}
    near = [mine[row] for start in whole.row.tolist() for row in mine if abs(row - start) <= 4]
    same = found.where(np.isin(np.arange(len(found)), near))
    assert len(same) == len(whole) > 50
    np.testing.assert_allclose(same.energy_J, whole.energy_J, rtol=2e-4)
    np.testing.assert_array_equal(same.highest_force_N, whole.highest_force_N)
    np.testing.assert_allclose(same.stroke_m, whole.stroke_m, atol=1e-5)


@pytest.mark.parametrize("rows", [97, 5_000])
def test_a_rest_longer_than_the_longest_cycle_is_left_out_and_memory_let_go(rows: int) -> None:
    time, x, force = sine(2_051)  # ends at the upper turning point
    rest = np.full(3_000, x[-1])
    x = np.concatenate([x, rest, x[51:]])
    force = np.concatenate([force, np.full(3_000, force[-1]), force[51:]])
    time = STEP_s * np.arange(len(x), dtype=np.float64)
    counter, found = counted((time, x, force), rows, longest_cycle=1_000, head_rows=500)
    longest = [each for each in counter.findings() if each.kind == "long_cycle"]
    assert [each.size for each in longest] == [1.0]
    assert found.samples.max() == OF_CYCLE
    assert len(found) == 9 + 9
    assert counter._segment is not None
    assert counter._segment.held <= 1_000 + rows


def test_an_impossible_value_is_no_value() -> None:
    time, x, force = sine(4_001)
    force[1_000] = 1e12
    x[2_000] = np.inf
    counter, found = counted((time, x, force), 1_000)
    assert counter.findings()[0].size == 2.0
    assert counter.broken == 2
    np.testing.assert_allclose(found.energy_J, ENERGY_J, rtol=1e-12)
