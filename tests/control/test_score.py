"""Scores of force tracking for constructed signals, and the feasibility of target forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS, Scenario, SineTarget
from mrdamper.control.score import (
    AttainableRange,
    Score,
    attainable_range,
    combine_worst,
    score_forces,
    score_run,
)
from mrdamper.errors import InputError
from mrdamper.virtual_rig.plant import PRESETS, Plant
from tests.control.loops import Constant, Ideal

N = 20_000
TIME = np.arange(N) * 1e-4
SINE = np.sin(2 * np.pi * TIME)  # The signal has two whole periods.
ZERO = np.zeros(N)
EVERYTHING = AttainableRange(np.full(N, -1e4), np.full(N, 1e4))


def scored(target, force, current=ZERO, reach=EVERYTHING, **more):
    return score_forces(target, force, current, reach, step_s=1e-4, **more)


def test_sine_error_scores_match_formulas():
    score = scored(900.0 * SINE, 900.0 * SINE + 40.0 * np.roll(SINE, 500))
    assert score.max_N == pytest.approx(40.0, rel=1e-6)
    assert score.rmse_N == pytest.approx(40.0 / np.sqrt(2.0))
    assert score.rmse_over_range_percent == pytest.approx(100.0 * 40.0 / np.sqrt(2.0) / 1800.0, rel=1e-5)
    # The absolute value of a sine is below sin(0.99 pi / 2) times its amplitude for 99 % of the time.
    assert score.p99_feasible_N == pytest.approx(40.0 * np.sin(0.99 * np.pi / 2), rel=1e-5)
    assert score.within_5_percent_share == 1.0
    half = scored(28.284271 / 0.05 * SINE, 28.284271 / 0.05 * SINE + 40.0 * SINE)
    assert half.within_5_percent_share == pytest.approx(0.5, abs=1e-3)


def test_feasible_scores_ignore_infeasible_target_samples():
    target = np.full(N, 100.0)
    force = np.where(TIME < 0.5, 400.0, 103.0)
    reach = AttainableRange(np.where(TIME < 0.5, 400.0, 0.0), np.full(N, 1000.0))
    score = scored(target, force, reach=reach)
    assert (score.max_N, score.max_feasible_N) == (300.0, 3.0)
    assert score.rmse_N == pytest.approx(np.sqrt(0.25 * 300.0**2 + 0.75 * 3.0**2))
    assert score.rmse_feasible_N == pytest.approx(3.0)
    assert score.feasible_share == 0.75
    nothing = scored(SINE, SINE, reach=AttainableRange(ZERO + 5e3, ZERO + 6e3))
    assert (nothing.feasible_share, nothing.rmse_feasible_N, nothing.p99_feasible_N) == (0.0, None, None)


def test_coil_power_follows_mean_square_current():
    current = 1.0 + SINE  # The mean of the squared current is 1 + 1/2.
    assert scored(SINE, SINE, current, resistance_ohm=4.0).coil_power_W == pytest.approx(6.0)
    assert scored(SINE, SINE, current).coil_power_W is None


def test_chatter_is_current_travel_per_second():
    """Chatter is 4 a f for a sine of amplitude a and frequency f, 2 f h for a square wave of height h."""
    assert scored(SINE, SINE, 1.0 + 0.5 * SINE).chatter_A_per_s == pytest.approx(4 * 0.5 * 1.0, rel=1e-3)
    square = np.where((TIME * 50.0) % 1.0 < 0.5, 2.0, 0.0)
    assert scored(SINE, SINE, square).chatter_A_per_s == pytest.approx(2 * 50 * 2.0, rel=0.01)


@given(offset=st.floats(-500, 500), factor=st.floats(0.1, 10.0))
def test_force_errors_are_proportional_and_ignore_sign(offset, factor):
    force = 300.0 * SINE + offset
    plain, mirrored = scored(SINE, force), scored(-SINE, -force)
    assert mirrored.rmse_N == pytest.approx(plain.rmse_N)
    scaled = scored(factor * SINE, factor * force)
    assert scaled.max_N == pytest.approx(factor * plain.max_N)
    assert scaled.rmse_over_range_percent == pytest.approx(plain.rmse_over_range_percent)
    assert plain.rmse_feasible_percent == pytest.approx(100.0 * plain.rmse_N / np.sqrt(0.5))


def test_combined_score_has_worst_values_of_runs():
    """The combined score has the largest errors and the smallest feasible fraction of several runs."""
    one = Score(
        max_N=5.0, rmse_N=1.0, max_feasible_N=None, rmse_feasible_N=None, p99_feasible_N=None,
        feasible_share=0.0, rmse_over_range_percent=2.0, coil_power_W=3.0, chatter_A_per_s=1.0,
    )  # fmt: skip
    two = replace(one, max_N=4.0, rmse_N=2.0, rmse_feasible_N=1.5, feasible_share=0.9)
    both = combine_worst([one, two])
    assert (both.max_N, both.rmse_N, both.rmse_feasible_N, both.feasible_share) == (5.0, 2.0, 1.5, 0.0)
    assert both.max_feasible_N is None


def test_scored_signals_must_have_equal_length():
    with pytest.raises(InputError, match=r"lengths are \[19999, 20000\]"):
        scored(SINE, SINE[1:])


def test_score_ignores_unscored_beginning_of_scenario():
    scenario = Scenario(duration_s=2.0, unscored_s=1.0)
    run = run_loop(Ideal(), Constant(0.0), scenario)
    spoilt = replace(run, force=np.where(run.course.time <= 1.0, 1e6, run.course.target + 7.0))
    assert score_run(spoilt, attainable_range(Ideal(), run.course, 20.0, 2.0)).max_N == pytest.approx(7.0)


# --- Feasibility ------------------------------------------------------------------------------------------


def tolerance(phase_deg: float, degrees: float) -> float:
    scenario = Scenario(target=SineTarget(900.0, 1.0, phase_deg), temperature_degC=degrees)
    plant = Plant(PRESETS["nominal"])
    course = reference_trajectory(scenario, plant.step_s)
    reach = attainable_range(plant, course, degrees, 2.0)
    return float(reach.feasible(course.target)[course.scored_from :].mean())


@pytest.mark.parametrize("degrees", [20.0, 123.0])
def test_target_against_velocity_is_infeasible(degrees):
    """A semi-active damper cannot push, so a target of opposite phase is infeasible."""
    assert tolerance(0.0, degrees) > 0.8
    assert tolerance(180.0, degrees) < 0.1


def test_coulomb_damper_feasibility_matches_formula():
    """A sine of 900 N is feasible while |F*| >= 70 N: a fraction 1 - (2/pi) asin(70/900) of the time.

    The damper reaches 50 to 1650 N, and the margin to these limits is 20 N.
    """
    course = reference_trajectory(Scenario(duration_s=2.0), 1e-4)
    inside = attainable_range(Ideal(), course, 20.0, 2.0).feasible(course.target)
    assert inside.mean() == pytest.approx(1.0 - 2 / np.pi * np.arcsin(70.0 / 900.0), abs=2e-4)


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("preset", ["nominal", "hard", "stiff"])
def test_scenario_targets_are_mostly_feasible(name, preset):
    plant = Plant(PRESETS[preset])
    course = reference_trajectory(SCENARIOS[name], plant.step_s)
    reach = attainable_range(plant, course, 123.0, 2.0)
    assert reach.feasible(course.target)[course.scored_from :].mean() > 0.65
