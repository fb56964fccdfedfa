"""Estimators: against Riccati's equation, closed forms, least squares, and the same inside the controller."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from mrdamper.control.controllers import controllers_for
from mrdamper.control.tuning import ERROR_LASTS_S, motion_filter
from mrdamper.excitation import MOTIONS
from mrdamper.models.actuation import Actuation
from mrdamper.models.dependence import Constant
from tests.control.dampers import CHAIN, DOUBLE, LAGS
from tests.oracles.estimators import AppliedCurrent, DisturbanceObserver, GainLearner, MotionFilter
from tests.support.examples import examples

PERIOD = 1e-3


# ------------------------------------------------------------------------------------- motion


@examples(30)
@given(period=st.floats(2e-4, 1e-2), noise=st.floats(1e-7, 1e-4), density=st.floats(0.05, 100.0))
def test_the_filter_s_covariance_solves_riccati_s_equation(period, noise, density):
    """The solver of scipy, in units in which the numbers are of one size: 1e-6 of the gains."""
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


def test_the_stated_velocity_error_is_what_a_motion_with_white_jerk_leaves():
    """0.93 mm/s at 10 um, 1 kHz and 1 m/s^3 per root Hz; 40 s of such a motion: within 5 %."""
    rng, each = np.random.default_rng(3), MotionFilter(PERIOD)
    stated = math.sqrt(each.covariance[1, 1])
    assert stated == pytest.approx(0.93e-3, rel=0.01)
    n = 40_000
    power = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    scale = PERIOD ** np.array([2.5, 1.5, 0.5])
    kicks = rng.multivariate_normal(np.zeros(3), power * np.outer(scale, scale), size=n)
    step = np.array([[1.0, PERIOD, PERIOD**2 / 2], [0.0, 1.0, PERIOD], [0.0, 0.0, 1.0]])
    true, state, errors = np.zeros(3), each.start(), np.empty(n)
    noise = 10e-6 * rng.standard_normal(n)
    gains = each.gains
    for k in range(n):
        true = step @ true + kicks[k]
        ahead = state.after(PERIOD)
        gap = true[0] + noise[k] - ahead.displacement
        state = type(state)(
            ahead.displacement + gains[0] * gap,
            ahead.velocity + gains[1] * gap,
            ahead.acceleration + gains[2] * gap,
        )
        errors[k] = state.velocity - true[1]
    assert np.sqrt(np.mean(errors[1000:] ** 2)) == pytest.approx(stated, rel=0.05)


def test_an_even_acceleration_is_followed_without_error():
    each, state = MotionFilter(PERIOD), MotionFilter(PERIOD).start()
    for k in range(600):
        t = k * PERIOD
        state = each.step(state, 0.01 * t + 0.2 * t**2)
    assert state.velocity == pytest.approx(0.01 + 0.4 * t, abs=1e-9)
    assert state.acceleration == pytest.approx(0.4, abs=1e-7)


def test_without_a_reading_the_motion_is_carried_on():
    each = MotionFilter(PERIOD)
    state = each.step(each.step(each.start(), 1e-4), 3e-4)
    assert each.step(state, math.nan) == state.after(PERIOD)


def test_the_filter_in_the_controller_is_this_one():
    made, each = controllers_for(DOUBLE)["recommended"], MotionFilter(PERIOD)
    rng, t = np.random.default_rng(0), PERIOD * np.arange(300)
    x = MOTIONS["nonperiodic"].displacement(t) + 10e-6 * rng.standard_normal(len(t))
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 300.0
    rows[:, 2], rows[:, 3] = x, 300.0
    state = each.start(x[0])
    for reading in x[1:]:
        state = each.step(state, reading)
    found = made.estimate(made.run(made.start(), rows)[0])
    assert found.displacement == pytest.approx(state.displacement, abs=1e-15)
    assert found.velocity == pytest.approx(state.velocity, abs=1e-13)
    assert found.acceleration == pytest.approx(state.acceleration, abs=1e-10)


# ------------------------------------------------------------------------------------- applied current


@pytest.mark.parametrize("period", [2e-4, 1e-3, 4e-3])
def test_held_commands_pass_as_they_do_through_the_actuation_itself(period):
    """The card's own actuation at a hundredth of the period, where held and straight are one: 2 mA."""
    rng = np.random.default_rng(4)
    command = np.repeat(rng.uniform(0.0, 2.0, 30), 5)
    each = AppliedCurrent(LAGS, period)
    state, found = each.start(), []
    for level in command:
        state = each.step(state, level)
        found.append(state.applied)
    fine = np.repeat(command, 100)
    # zero before: the actuation starts settled at its first sample
    whole = LAGS.applied(np.concatenate([np.zeros(100), fine]), period / 100.0)[100:]
    # the dead time is a straight line between two samples of the observer: late or early by a part of one
    blur = 0.6 * period * 2.0 / (LAGS.rise_s + LAGS.second_s)
    assert np.abs(found - whole[99::100]).max() < max(2e-3, blur)
    exact = Actuation(LAGS.rise_s, LAGS.fall_s, LAGS.second_s, 2.0 * period, play=LAGS.play)
    each = AppliedCurrent(exact, period)
    state, found = each.start(), []
    for level in command:
        state = each.step(state, level)
        found.append(state.applied)
    whole = exact.applied(np.concatenate([np.zeros(300), fine]), period / 100.0)[300:]
    assert np.abs(found - whole[99::100]).max() < 0.02


def test_the_applied_current_in_the_controller_is_this_one():
    made, each = controllers_for(DOUBLE)["recommended"], AppliedCurrent(LAGS, PERIOD)
    t = PERIOD * np.arange(400)
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 800.0 * np.sign(MOTIONS["nonperiodic"].velocity(t))
    rows[:, 2], rows[:, 3] = MOTIONS["nonperiodic"].displacement(t), 300.0
    last, command, _ = made.run(made.start(), rows)
    state = each.start()
    for level in [0.0, *command[:-1]]:
        state = each.step(state, level)
    assert made.estimate(last).applied == pytest.approx(state.applied, abs=1e-12)
    assert command.max() > 0.5


def test_play_makes_a_falling_current_felt_as_more():
    """From 2 A down to 1 A: 1 A and the half width; up to 1 A: 1 A."""
    lags = Actuation(1e-3, 1e-3, play=0.05)
    each = AppliedCurrent(lags, PERIOD)
    for levels, expected in (((1.0,), 1.0), ((2.0, 1.0), 1.05), ((2.0, 1.0, 1.05), 1.075)):
        state = each.start()
        for level in levels:
            for _ in range(60):
                state = each.step(state, level)
        assert state.applied == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("wide_play", [0.0, 0.15])
@pytest.mark.parametrize("damper", [DOUBLE, CHAIN])
def test_a_free_wheeling_current_of_iron_that_saturates_is_followed(damper, wide_play):
    """Dead time, lags, wheel, plays: within 8 mA of 2 A of the card's actuation in steps of 10 us."""
    lags = Actuation(0.004, 0.001, 0.002, 0.003, largest_command=2.0, play=0.05, wheel_s=0.04, saturation=0.9)
    lags = replace(lags, wide_play=wide_play)
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
    fine = lags.applied(np.concatenate([np.zeros(500), np.repeat(command, 100)]), 1e-5)[500:]
    assert max(command) > 1.0
    assert np.ptp(np.diff(fine)) > 0.0
    np.testing.assert_allclose(applied[1:], fine[99::100][: len(applied) - 1], atol=8e-3)


def _exact(damper):
    return controllers_for(damper)["exact"]


@pytest.mark.parametrize(("wide_play", "within"), [(0.0, 1e-6), (0.2, 2e-3)])
def test_the_plays_of_iron_that_saturates_are_inverted(wide_play, within):
    """Without lags, and where rho stays, the force feels the same as without: one to 1 uA, two to 2 mA."""
    ideal = Actuation(0.0, 0.0, largest_command=2.0)
    worn = replace(ideal, play=0.06, saturation=0.7, wide_play=wide_play)
    t = PERIOD * np.arange(500)
    rows = np.full((len(t), 5), np.nan)
    x = 5e-3 * np.sin(2.0 * np.pi * 2.0 * t)
    rows[:, 0] = rows[:, 1] = 600.0 * np.sin(2.0 * np.pi * 2.3 * t + 1.5)
    rows[:, 2], rows[:, 3] = x, 300.0
    steady = {**DOUBLE.coefficients, "rho": Constant(16e3), "second_rho": Constant(5e3)}
    dampers = (replace(DOUBLE, coefficients=steady, actuation=each) for each in (ideal, worn))
    plain, given = (made.run(made.start(), rows)[1] for made in map(_exact, dampers))
    felt = worn.applied(np.concatenate([[0.0], given]), PERIOD)[1:]
    inside = (given > 0.0) & (given < 2.0) & (plain > 0.0) & (plain < 2.0)
    assert inside.mean() > 0.2
    assert np.abs(given - plain)[inside].max() > 0.03
    np.testing.assert_allclose(felt[inside], plain[inside], atol=within)


# ------------------------------------------------------------------------------------- with a force sensor


def test_a_constant_surplus_in_the_direction_of_motion_is_observed_in_full():
    each = DisturbanceObserver(PERIOD, 0.1)
    state = each.start()
    for k in range(2000):
        velocity = math.sin(0.05 * k)
        state = each.step(state, math.copysign(340.0, velocity), math.copysign(300.0, velocity), velocity)
    assert state == pytest.approx(40.0, abs=1e-6)
    assert each.step(state, math.nan, 300.0, 1.0) == state


def test_the_learner_without_forgetting_is_regularised_least_squares():
    rng = np.random.default_rng(5)
    each = GainLearner(PERIOD, 20.0, forgetting_s=1e12)
    parts = rng.uniform(-300.0, 300.0, size=(400, 4))
    true = np.array([0.9, 1.2, 1.1])
    force = parts[:, :3] @ true + parts[:, 3] + 20.0 * rng.standard_normal(len(parts))
    state = each.start()
    for row, measured in zip(parts, force, strict=True):
        state = each.step(state, measured, row)
    variance = 20.0**2 * ERROR_LASTS_S / PERIOD
    normal = parts[:, :3].T @ parts[:, :3] / variance + np.eye(3) / each.spread**2
    right = parts[:, :3].T @ (force - parts[:, 3]) / variance + np.ones(3) / each.spread**2
    np.testing.assert_allclose(state.gains, np.linalg.solve(normal, right), rtol=1e-8)
    np.testing.assert_allclose(state.covariance, np.linalg.inv(normal), rtol=1e-6)
