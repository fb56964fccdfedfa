"""Estimators of controllers agree with formulas, model cards and implementations in Python."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from mrdamper.control.controllers import controllers_for
from mrdamper.control.settings import SETTINGS
from mrdamper.control.tuning import motion_filter
from mrdamper.excitation import MOTIONS
from mrdamper.models.actuation import Actuation
from tests.oracles.estimators import AppliedCurrent, MotionFilter
from tests.support.cards import CHAIN, DOUBLE, LAGS
from tests.support.examples import examples

PERIOD = 1e-3
MOVED = MOTIONS["nonperiodic"]


# --- Motion filter ------------------------------------------------------------------------------------------


@examples(30)
@given(period=st.floats(2e-4, 1e-2), noise=st.floats(1e-7, 1e-4), density=st.floats(0.05, 100.0))
def test_motion_filter_covariance_solves_riccati_equation(period, noise, density):
    """Gains and covariance agree with SciPy's solution of the Riccati equation in scaled units."""
    step = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    power = (density / noise) ** 2 * period**5
    drive = power * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    seen = np.array([[1.0, 0.0, 0.0]])
    ahead = solve_discrete_are(step.T, seen.T, drive, np.eye(1))
    expected = ahead[:, 0] / (ahead[0, 0] + 1.0)
    gains, covariance = motion_filter(period, noise, density)
    np.testing.assert_allclose(gains * period ** np.arange(3), expected, rtol=1e-6)
    unit = noise / period ** np.arange(3)
    np.testing.assert_allclose(
        covariance / np.outer(unit, unit), ahead - np.outer(expected, ahead[0]), rtol=1e-5, atol=1e-12
    )


def test_motion_filter_predicts_its_velocity_error():
    """For white jerk and 10 um noise, the filter predicts its RMS velocity error within 5 %."""
    rng, reference = np.random.default_rng(3), MotionFilter(PERIOD)
    stated = math.sqrt(reference.covariance[1, 1])
    n = 40_000
    power = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    scale = PERIOD ** np.array([2.5, 1.5, 0.5])
    kicks = rng.multivariate_normal(np.zeros(3), power * np.outer(scale, scale), size=n)
    step = np.array([[1.0, PERIOD, PERIOD**2 / 2], [0.0, 1.0, PERIOD], [0.0, 0.0, 1.0]])
    true, state, errors = np.zeros(3), np.zeros(3), np.empty(n)
    noise, gains = 10e-6 * rng.standard_normal(n), reference.gains
    for k in range(n):
        true = step @ true + kicks[k]
        state = step @ state
        state = state + gains * (true[0] + noise[k] - state[0])
        errors[k] = state[1] - true[1]
    assert np.sqrt(np.mean(errors[1000:] ** 2)) == pytest.approx(stated, rel=0.05)


def test_controller_motion_estimate_matches_python_filter():
    made, reference = controllers_for(DOUBLE)["paper"], MotionFilter(PERIOD)
    rng, t = np.random.default_rng(0), PERIOD * np.arange(300)
    x = MOVED.displacement(t) + 10e-6 * rng.standard_normal(len(t))
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 300.0
    rows[:, 2], rows[:, 3] = x, 300.0
    state = reference.start(x[0])
    for reading in x[1:]:
        state = reference.step(state, reading)
    found = made.estimate(made.run(made.start(), rows)[0])
    assert found.displacement == pytest.approx(state.displacement, abs=1e-15)
    assert found.velocity == pytest.approx(state.velocity, abs=1e-13)
    assert found.acceleration == pytest.approx(state.acceleration, abs=1e-10)


# --- Applied current --------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [2e-4, 1e-3, 4e-3])
def test_current_observer_follows_lags_of_card(period):
    """The observer agrees with the card's model of current lags on a time grid that is 100 times finer."""
    rng = np.random.default_rng(4)
    command = np.repeat(rng.uniform(0.0, 2.0, 30), 5)
    observer = AppliedCurrent(LAGS, period)
    state, found = observer.start(), []
    for level in command:
        state = observer.step(state, level)
        found.append(state.applied)
    fine = np.concatenate([np.zeros(100), np.repeat(command, 100)])
    whole = LAGS.apply(fine, period / 100.0)[100:]
    # The observer interpolates if the dead time is not a whole number of periods. The resulting time error
    # is a fraction of a period.
    blur = 0.6 * period * 2.0 / (LAGS.rise_s + LAGS.second_s)
    assert np.abs(found - whole[99::100]).max() < max(2e-3, blur)


def test_controller_applied_current_matches_python_observer():
    made, observer = controllers_for(DOUBLE)["recommended"], AppliedCurrent(LAGS, PERIOD)
    t = PERIOD * np.arange(400)
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 800.0 * np.sign(MOVED.velocity(t))
    rows[:, 2], rows[:, 3] = MOVED.displacement(t), 300.0
    last, command, _ = made.run(made.start(), rows)
    state = observer.start()
    for level in [0.0, *command[:-1]]:
        state = observer.step(state, level)
    assert made.estimate(last).applied == pytest.approx(state.applied, abs=1e-12)
    assert command.max() > 0.5


@pytest.mark.parametrize("wide_hysteresis_width_A", [0.0, 0.15])
@pytest.mark.parametrize("damper", [DOUBLE, CHAIN])
def test_controller_estimates_freewheeling_current_in_saturated_iron(damper, wide_hysteresis_width_A):
    """The controller's estimate of the effective current deviates by at most 8 mA from the card's model.

    The card's model of lags and hysteresis is computed with a step of 10 us. The largest current is 2 A.
    """
    lags = Actuation(
        0.004,
        0.001,
        0.002,
        0.003,
        largest_command=2.0,
        hysteresis_width_A=0.05,
        freewheel_time_s=0.04,
        saturation=0.9,
    )
    lags = replace(lags, wide_hysteresis_width_A=wide_hysteresis_width_A)
    made = controllers_for(replace(damper, actuation=lags))["recommended"]
    t = PERIOD * np.arange(600)
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 900.0 * np.sign(np.sin(2.0 * np.pi * 7.0 * t)) * np.sin(2.0 * np.pi * 2.0 * t)
    rows[:, 2], rows[:, 3] = 8e-3 * np.sin(2.0 * np.pi * 2.0 * t), 300.0
    state, command, applied = made.start(), [0.0], []
    for row in rows:
        applied.append(made.estimate(state).applied)
        state, given, _ = made.run(state, row[None])
        command.append(float(given[0]))
    fine = lags.apply(np.concatenate([np.zeros(500), np.repeat(command, 100)]), 1e-5)[500:]
    assert max(command) > 1.0
    np.testing.assert_allclose(applied[1:], fine[99::100][: len(applied) - 1], atol=8e-3)


# --- Disturbance observer -----------------------------------------------------------------------------------


def test_disturbance_estimate_has_first_order_lag():
    """The estimate of a constant additional force F rises as F [1 - exp(-t / T)]."""
    made = controllers_for(DOUBLE)["recommended-observer"]
    state, surplus, found = made.start(), 40.0, []
    for k in range(2000):
        # The measured force is the force of the controller's own model plus the additional force.
        row = np.array([[300.0, 300.0, 2e-5 * k, 300.0, np.nan]])
        after = made.run(state, row)[0]
        row[0, 4] = made.estimate(after).force + surplus
        state = made.run(state, row)[0]
        found.append(made.estimate(state).disturbance)
    t = PERIOD * np.arange(1, 2001)
    np.testing.assert_allclose(found, surplus * (1.0 - np.exp(-t / SETTINGS.observer_s)), rtol=2e-2, atol=0.5)
    assert found[-1] == pytest.approx(surplus, abs=1e-3)
