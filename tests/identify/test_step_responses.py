"""Step responses are computed from forces whose response is known at every sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import MOTIONS, drive
from mrdamper.identify.actuation import ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    StepResponse,
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
    """Return a run whose force follows each current step with a lag, and its response at each sample.

    ``bend_N`` adds a parabola over position that differs between directions and currents. ``hysteresis_N`` is
    added at a current that was reached from a larger current.
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


def with_command(run: PreparedRun, command: FloatArray) -> PreparedRun:
    return replace(run, trajectory=replace(run.trajectory, command=command))


def measure(run: PreparedRun) -> tuple[StepResponse, ...]:
    return measure_step_responses(LAW, run, SETTINGS)


# Step responses of the measured force


@pytest.mark.parametrize(("bend_N", "hysteresis_N"), [(0.0, 0.0), (25.0, 0.0), (0.0, 40.0)])
def test_step_response_equals_known_current_lag(bend_N, hysteresis_N):
    """The response is not changed by a force that depends on position, direction and hysteresis."""
    run, known = blended_run(bend_N=bend_N, hysteresis_N=hysteresis_N)
    responses = measure(run)
    assert len(responses) >= 3
    for response in responses:
        assert response.fraction == pytest.approx(known[response.window], abs=1e-3 if hysteresis_N else 1e-6)
        number, offset = divmod(response.window.start, HOLD_SAMPLES)
        assert offset == 0
        assert response.upwards == (LEVELS[number] > LEVELS[number - 1])
        assert response.time_s == pytest.approx(TIME_CONSTANT_s, rel=0.03)
        direction = np.sign(run.trajectory.velocity[response.window])
        assert len(set(direction.tolist())) == 1


def test_size_of_step_response_is_force_difference():
    run, _ = blended_run()
    for response in measure(run):
        number = response.window.start // HOLD_SAMPLES
        before, after = (
            simulate(LAW, with_command(run, np.full(len(run), LEVELS[k])).trajectory)[response.window]
            for k in (number - 1, number)
        )
        assert response.size_N == pytest.approx(after - before, rel=1e-4)
        assert response.law_after_N - response.law_before_N == pytest.approx(after - before)


def test_response_times_of_measured_force_are_reproduced():
    """A model with the measured force has the measured times. A model without lags has response time zero."""
    run, _ = blended_run()
    stepped = run, measure(run)
    same = model_times([stepped, stepped], [run.force] * 2, SETTINGS)
    assert len(same) == 2 * len(stepped[1])
    for response, time_s in same:
        assert time_s == pytest.approx(response.time_s, rel=1e-6)
    without_lag = model_times([stepped], [simulate(LAW, run.trajectory)], SETTINGS)
    assert {time_s for _, time_s in without_lag} <= {0.0}


# Time to 63 %


def test_crossing_time_of_exponential_is_time_constant():
    """A response below 63 % has the time NaN. A response that begins above 63 % has the time zero."""
    time = 1e-4 * np.arange(1000)
    assert crossing_time(1.0 - np.exp(-time / 0.01), 1e-4) == pytest.approx(0.01, rel=0.03)
    assert np.isnan(crossing_time(np.full(20, 0.5), 1e-3))
    assert crossing_time(np.full(20, 0.9), 1e-3) == 0.0
