"""Energy, forces and stiffness of motion cycles agree with closed forms and plain loops."""

from __future__ import annotations

from math import pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.data.cycles import CountedRecord, count_record
from mrdamper.data.records import Recording
from tests.support.examples import examples

STEP_s, SAMPLES_PER_CYCLE = 1e-3, 200
AMPLITUDE_m, FORCE_N, STIFFNESS_N_m = 0.01, 900.0, 5e4
ANGLE = 2.0 * pi / SAMPLES_PER_CYCLE
ENERGY_J = (
    pi * AMPLITUDE_m * FORCE_N * sin(ANGLE) / ANGLE
)  # The trapezoidal rule gives exactly this energy for a sampled sine.


def sine(samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, displacement and force of a viscous damper in parallel with a spring."""
    number = np.arange(samples, dtype=np.float64)
    x = AMPLITUDE_m * np.sin(ANGLE * number)
    return STEP_s * number, x, FORCE_N * np.cos(ANGLE * number) + STIFFNESS_N_m * x


def count(
    time: FloatArray, x: FloatArray, force: FloatArray, temperature: FloatArray | None = None
) -> CountedRecord:
    command = np.full(len(time), 1.5)
    return count_record(Recording("record", time, x, force, command, "A", temperature=temperature))


def test_energy_of_sampled_sine_matches_formula() -> None:
    time, x, force = sine(20_001)
    record = count(time, x, force, np.asarray(300.0 + 0.01 * np.arange(len(time)), dtype=np.float64))
    found = record.figures
    assert (len(found), found.row[0], record.breaks) == (99, 150, 0)
    np.testing.assert_array_equal(found.samples, SAMPLES_PER_CYCLE)
    np.testing.assert_allclose(found.energy_J, ENERGY_J, rtol=1e-12)
    np.testing.assert_allclose(found.stiffness_N_per_m, STIFFNESS_N_m, rtol=1e-9)
    np.testing.assert_allclose(found.amplitude_m, AMPLITUDE_m, rtol=1e-12)
    np.testing.assert_allclose(found.period_s, SAMPLES_PER_CYCLE * STEP_s, rtol=1e-9)
    np.testing.assert_allclose(found.temperature_K, 300.0 + 0.01 * (found.row + 99.5), rtol=1e-12)


def test_interrupted_cycles_are_omitted() -> None:
    """An invalid number, a decreasing time, and a gap each interrupt one cycle of the record."""
    time, x, force = sine(10_001)
    force[1_000] = np.nan  # This sample is in the cycle that starts at sample 950.
    x[3_000] = 1e12  # This sample is in the cycle that starts at sample 2950.
    time[5_000:] -= 3.0  # This step is in the cycle that starts at sample 4950.
    time[8_000:] += 7.0  # This gap is in the cycle that starts at sample 7950.
    record = count(time, x, force)
    assert record.breaks == 4
    assert not {950, 2_950, 4_950, 7_950} & set(record.figures.row.tolist())
    assert len(record.figures) == 49 - 4
    np.testing.assert_allclose(record.figures.energy_J, ENERGY_J, rtol=1e-12)


@given(seed=st.integers(0, 30), noise=st.sampled_from([0.0, 1e-5, 3e-4]))
@examples(8)
def test_cycle_values_match_plain_loops(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    time, x, force = sine(5_000)
    x = x + noise * rng.standard_normal(len(x))
    warm = np.asarray(300.0 + 1e-3 * np.arange(len(x)), dtype=np.float64)
    warm[rng.integers(0, len(x), 50)] = np.nan
    force[rng.integers(0, len(x), 3)] = np.nan
    time[4_000:] += 9.0
    found = count(time, x, force, warm).figures
    assert len(found) > 12
    for i, first in enumerate(found.row.tolist()):
        k = slice(first, first + int(found.samples[i]) + 1)
        moved, pulled = x[k], force[k]
        middle = 0.5 * (pulled[0] + pulled[-1])
        work = np.trapezoid(pulled, moved) + middle * (moved[0] - moved[-1])
        u = int(np.argmax(moved))
        secant = (pulled[u] - middle) / (moved[u] - 0.5 * (moved[0] + moved[-1]))
        assert found.energy_J[i] == pytest.approx(work, rel=1e-10)
        assert (found.highest_force_N[i], found.lowest_force_N[i]) == (pulled.max(), pulled.min())
        assert found.amplitude_m[i] == pytest.approx(np.ptp(moved) / 2, rel=1e-12)
        assert found.stiffness_N_per_m[i] == pytest.approx(secant, rel=1e-10)
        assert found.temperature_K[i] == pytest.approx(np.nanmean(warm[k][:-1]), rel=1e-12)
