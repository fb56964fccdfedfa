"""Step responses of forces whose response is known at every sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import MOTIONS, drive
from mrdamper.identify.actuation import ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    STEP_FRACTION,
    SteppedRun,
    crossing_time,
    measure_step_responses,
    model_times,
)
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS

LAW = REFERENCE_DAMPERS["bouc-wen"]
SETTINGS = ActuationSettings()
RATE_Hz = 1000.0
LEVELS = (0.0, 1.0, 0.0, 2.0, 1.0, 2.0, 0.0)
HOLD_SAMPLES = 430
TIME_CONSTANT_s = 0.004


def blended_run(*, bend_N: float = 0.0, hysteresis_N: float = 0.0) -> tuple[PreparedRun, FloatArray]:
    """Return a run whose force follows each step as a first-order lag, and its response at each sample.

    ``bend_N`` adds a parabola over position that differs between directions and levels. ``hysteresis_N`` is
    added while a level was reached from above.
    """
    count = HOLD_SAMPLES * len(LEVELS)
    number = np.arange(count) // HOLD_SAMPLES
    before, after = np.array(LEVELS)[np.maximum(number - 1, 0)], np.array(LEVELS)[number]
    time = (np.arange(count) - HOLD_SAMPLES * number) / RATE_Hz
    response = np.where(number == 0, 1.0, 1.0 - np.exp(-time / TIME_CONSTANT_s))
    path = drive(MOTIONS["steps"], duration=(count - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=0.0)
    x = path.displacement / np.abs(path.displacement).max()
    direction = np.sign(path.velocity)
    from_above = {level: np.zeros(count) for level in LEVELS}
    for k in range(1, len(LEVELS)):
        from_above[LEVELS[k]][HOLD_SAMPLES * k :] = LEVELS[k] < LEVELS[k - 1]

    def force(level: float, delay: int) -> FloatArray:
        constant = simulate(LAW, replace(path, command=np.full(count, level)))
        parabola = bend_N * (level + 0.5 * direction) * (1.0 + x - 0.4 * x**2)
        remembered = from_above[level][np.maximum(np.arange(count) - delay, 0)]
        return np.asarray(constant + parabola + hysteresis_N * remembered)

    total = np.zeros(count)
    for level in set(LEVELS):
        total += np.where(after == level, response * force(level, 0), 0.0)
        total += np.where(before == level, (1.0 - response) * force(level, HOLD_SAMPLES), 0.0)
    run = RigRun("steps", path.time, path.displacement, total, after, command_unit="A", motion="steps")
    return prepare_run(run, NO_SMOOTHING), response


def switched_run(levels: Sequence[float] | FloatArray, samples: Sequence[int]) -> PreparedRun:
    """Return a run of a triangle of 24 mm at 30 mm/s whose current switches between levels, at 1 kHz."""
    current = np.repeat(levels, samples)
    path = drive(MOTIONS["steps"], duration=(len(current) - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=0.0)
    path = replace(path, command=current)
    force = simulate(LAW, path)
    run = RigRun("steps", path.time, path.displacement, force, current, command_unit="A", motion="steps")
    return replace(prepare_run(run, NO_SMOOTHING), scored_from=0)


def with_command(run: PreparedRun, command: FloatArray) -> PreparedRun:
    return replace(run, trajectory=replace(run.trajectory, command=command))


def measure(run: PreparedRun) -> SteppedRun:
    stepped = measure_step_responses(LAW, run, SETTINGS)
    assert stepped is not None
    return stepped


def response_windows(run: PreparedRun) -> list[tuple[int, int]]:
    stepped = measure_step_responses(LAW, run, SETTINGS)
    if stepped is None:
        return []
    return [(response.window.start, response.window.stop) for response in stepped.responses]


# Measured responses


@pytest.mark.parametrize(("bend_N", "hysteresis_N"), [(0.0, 0.0), (25.0, 0.0), (0.0, 40.0)])
def test_step_response_equals_known_lag(bend_N, hysteresis_N):
    """A force that depends on position, direction and hysteresis has the same response as one without."""
    run, known = blended_run(bend_N=bend_N, hysteresis_N=hysteresis_N)
    responses = measure(run).responses
    assert len(responses) >= 3
    for response in responses:
        assert response.fraction == pytest.approx(known[response.window], abs=1e-3 if hysteresis_N else 1e-6)
        number, offset = divmod(response.window.start, HOLD_SAMPLES)
        assert offset == 0
        assert response.upwards == (LEVELS[number] > LEVELS[number - 1])
        assert response.time_s == pytest.approx(TIME_CONSTANT_s, rel=0.03)
        direction = np.sign(run.trajectory.velocity[response.window])
        assert len(set(direction.tolist())) == 1


def test_response_size_is_distance_between_levels():
    """The distance of the maps is the difference of the forces at the two constant currents."""
    run, _ = blended_run()
    for response in measure(run).responses:
        number = response.window.start // HOLD_SAMPLES
        before, after = (
            simulate(LAW, with_command(run, np.full(len(run), LEVELS[k])).trajectory)[response.window]
            for k in (number - 1, number)
        )
        assert response.size_N == pytest.approx(after - before, rel=1e-4)
        assert response.law_after_N - response.law_before_N == pytest.approx(after - before)


def test_model_time_of_measured_force_is_measured():
    """A model with the measured force has the measured times; one without lags takes no time."""
    run, _ = blended_run()
    stepped = measure(run)
    same = model_times([stepped, stepped], lambda _: run.force, SETTINGS)
    assert len(same) == 2 * len(stepped.responses)
    for response, time_s in same:
        assert time_s == pytest.approx(response.time_s, rel=1e-6)
    without_lag = model_times([stepped], lambda drive: simulate(LAW, drive), SETTINGS)
    assert {time_s for _, time_s in without_lag} <= {0.0}


def test_response_window_ends_at_reversal_or_step():
    """A window lasts 40 to 150 ms, from 15 % of the stroke after a reversal to 3 % before the next."""
    rng = np.random.default_rng(4)
    samples = [500, 460, *rng.integers(210, 420, 30).tolist(), 39, 40, 41, 100, 300, 300]
    samples = [n for pair in zip(samples, [*samples[18:], *samples[:18]], strict=True) for n in pair]
    run = switched_run(np.resize([0.0, 2.0], len(samples)), samples)
    direction = np.sign(run.trajectory.velocity)
    travelled = 0.5 + 0.5 * direction * run.trajectory.displacement / 0.012  # fraction of the stroke
    expected = []
    for first, end in pairwise(np.cumsum(samples).tolist()):
        stop = first
        while (
            stop < min(end, first + 150)
            and 0.15 < travelled[stop] < 0.97
            and direction[stop] == direction[first]
        ):
            stop += 1
        if stop - first >= 40:
            expected.append((first, stop))
    assert {150, 40} <= {stop - first for first, stop in expected}
    assert response_windows(run) == expected


def test_responses_before_first_scored_sample_are_ignored():
    """Samples before the motion is settled do not count."""
    run = switched_run(np.resize([0.0, 2.0], 8), [430] * 8)
    late = replace(run, scored_from=1500)
    assert response_windows(late) == [window for window in response_windows(run) if window[0] >= 1500]


def test_unusable_runs_have_no_step_response():
    """Constant, quickly switched and creeping currents are unusable, and a force that ignores the current."""
    run, _ = blended_run()
    ones = np.ones(len(run))
    assert measure_step_responses(LAW, with_command(run, ones), SETTINGS) is None
    quick = np.where(np.arange(len(run)) // 150 % 2 == 0, 0.0, 1.0)
    assert measure_step_responses(LAW, with_command(run, quick), SETTINGS) is None
    assert measure_step_responses(LAW, with_command(run, np.linspace(0.0, 2.0, len(run))), SETTINGS) is None
    names = ("yield_force", "viscosity", "stiffness", "offset")
    passive = LAW.with_parameters({f"{name}.c{k}": 0.0 for name in names for k in (1, 2)})
    assert measure_step_responses(passive, run, SETTINGS) is None


@pytest.mark.parametrize(("samples", "is_usable"), [(199, False), (200, True)])
def test_current_must_be_held_until_settled(samples, is_usable):
    """Levels must be held for twice the settling time."""
    assert bool(response_windows(switched_run(np.resize([0.0, 2.0], 60), [samples] * 60))) == is_usable


def test_small_change_is_not_a_step():
    """A change of less than 5 % of the range leaves the other steps as they are."""
    samples = [500, 460, 480, 490, 470, 450, 500, 510]
    run = switched_run(np.resize([0.0, 2.0], len(samples)), samples)
    starts = {first for first, _ in response_windows(run)}
    assert len(starts) > 3
    changed = run.trajectory.command.copy()
    changed[200:350] += 0.095
    changed_starts = {first for first, _ in response_windows(with_command(run, changed))}
    assert starts <= changed_starts | {500}
    assert not {200, 350} & changed_starts


def test_close_levels_count_as_one():
    """Levels within 5 % of the range get one map of the force."""
    levels = [0.0, 2.0, 0.02, 2.03, 0.0, 1.98, 0.04, 2.0]
    run = switched_run(levels, [500, 460, 480, 490, 470, 450, 500, 510])
    responses = measure(run).responses
    assert len({level for response in responses for level in response.levels}) == 2
    assert {response.upwards for response in responses} == {True, False}


# Time to 63 %


@pytest.mark.parametrize("step_s", [1e-3, 0.004])
@pytest.mark.parametrize("late", [3.4, 11.0, 20.75])
def test_crossing_time_of_straight_line_is_exact(step_s, late):
    """Noise of 1 % moves the time by less than a sample."""
    fraction = np.clip(STEP_FRACTION + 0.05 * (np.arange(40) - late), 0.0, 1.0)
    assert crossing_time(fraction, step_s) == pytest.approx(step_s * late, rel=1e-6)
    noise = 0.01 * np.random.default_rng(0).standard_normal(40)
    assert crossing_time(fraction + noise, step_s) == pytest.approx(step_s * late, abs=0.6 * step_s)


def test_crossing_time_of_exponential_is_time_constant():
    """A response that never reaches 63 % has no time; one that starts above it takes no time."""
    time = 1e-4 * np.arange(1000)
    assert crossing_time(1.0 - np.exp(-time / 0.01), 1e-4) == pytest.approx(0.01, rel=0.03)
    assert np.isnan(crossing_time(np.full(20, 0.5), 1e-3))
    assert crossing_time(np.full(20, 0.9), 1e-3) == 0.0


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=9))
def test_crossing_time_scales_with_time_step(fractions):
    """The time is finite if and only if 63 % is reached, and proportional to the time step."""
    fraction = np.array(fractions)
    time_s = crossing_time(fraction, 1e-3)
    assert np.isfinite(time_s) == bool((fraction >= STEP_FRACTION).any())
    assert crossing_time(fraction, 2e-3) == pytest.approx(2.0 * time_s, nan_ok=True)
