"""Scores on constructed signals, and the physics of what is feasible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS, Scenario, SineTarget
from mrdamper.control.score import AttainableRange, Score, attainable_range, score_forces, score_run, worst
from mrdamper.errors import InputError
from mrdamper.virtual_rig.plant import PRESETS, Plant
from tests.control.loops import Constant, Ideal

N = 20_000
TIME = np.arange(N) * 1e-4
SINE = np.sin(2 * np.pi * TIME)  # two whole periods
ZERO = np.zeros(N)
EVERYTHING = AttainableRange(np.full(N, -1e4), np.full(N, 1e4))


def scored(target, force, current=ZERO, reach=EVERYTHING, **more):
    return score_forces(target, force, current, reach, step_s=1e-4, **more)


def test_a_sine_error_has_its_amplitude_as_maximum_and_its_root_half_as_rms():
    score = scored(900.0 * SINE, 900.0 * SINE + 40.0 * np.roll(SINE, 500))
    assert score.max_N == pytest.approx(40.0, rel=1e-6)
    assert score.rmse_N == pytest.approx(40.0 / np.sqrt(2.0))
    assert score.rmse_over_range_percent == pytest.approx(100.0 * 40.0 / np.sqrt(2.0) / 1800.0, rel=1e-5)
    # and within 45 N of 1800 N, half of the time within 28.3 N of 40
    assert score.within_5_percent_share == 1.0
    half = scored(28.284271 / 0.05 * SINE, 28.284271 / 0.05 * SINE + 40.0 * SINE)
    assert half.within_5_percent_share == pytest.approx(0.5, abs=1e-3)
    # a sine is below sin(0.99 pi / 2) of its amplitude 99 % of the time
    assert score.p99_feasible_N == pytest.approx(40.0 * np.sin(0.99 * np.pi / 2), rel=1e-5)


def test_what_is_infeasible_counts_in_all_samples_and_not_in_the_feasible_ones():
    target = np.full(N, 100.0)
    force = np.where(TIME < 0.5, 400.0, 103.0)
    reach = AttainableRange(np.where(TIME < 0.5, 400.0, 0.0), np.full(N, 1000.0))
    score = scored(target, force, reach=reach)
    assert (score.max_N, score.max_feasible_N) == (300.0, 3.0)
    assert score.rmse_N == pytest.approx(np.sqrt(0.25 * 300.0**2 + 0.75 * 3.0**2))
    assert score.rmse_feasible_N == pytest.approx(3.0)
    assert score.feasible_share == 0.75
    assert score.rmse_feasible_percent == pytest.approx(3.0)
    assert score.within_5_percent_share == 0.75  # 3 N of 100


@given(gap=st.floats(0.0, 100.0), size=st.sampled_from([0.01, 0.1, 2.0, 100.0]))
def test_a_target_is_feasible_from_20_N_or_a_fortieth_of_it_inside_the_reach_on(gap, size):
    """Of a target of 500 N and of others of so many times the size; a large damper has 20 N, too."""
    ends = AttainableRange(size * np.array([100.0, -500.0, 0.0]), size * np.array([500.0, -100.0, 1e3]))
    inside = ends.feasible(np.array([size * 100.0 + gap, -size * 100.0 - gap, 500.0 * size]))
    largest = max(500.0 * size, size * 100.0 + gap)
    margin = min(20.0, largest / 40.0)
    fits = margin <= gap <= 400.0 * size - margin
    assert inside.tolist() == [fits, fits, True] or abs(gap - margin) < 1e-9


def test_nothing_feasible_leaves_those_figures_open():
    score = scored(SINE, SINE, reach=AttainableRange(ZERO + 5e3, ZERO + 6e3))
    assert score.feasible_share == 0.0
    assert score.max_feasible_N is None
    assert score.rmse_feasible_N is None
    assert score.p99_feasible_N is None


def test_coil_power_is_the_mean_of_i_squared_r():
    current = 1.0 + np.sin(2 * np.pi * TIME)  # mean of the square: 1 + 1/2
    assert scored(SINE, SINE, current, resistance_ohm=4.0).coil_power_W == pytest.approx(6.0)
    assert scored(SINE, SINE, current).coil_power_W is None


def test_chatter_is_the_travel_of_the_current_per_second():
    """A sine of amplitude a and frequency f travels 4 a f; a square of height h switches 2 f times by h."""
    assert scored(SINE, SINE, 1.0 + 0.5 * SINE).chatter_A_per_s == pytest.approx(4 * 0.5 * 1.0, rel=1e-3)
    square = np.where((TIME * 50.0) % 1.0 < 0.5, 2.0, 0.0)
    assert scored(SINE, SINE, square).chatter_A_per_s == pytest.approx(2 * 50 * 2.0, rel=0.01)


@given(offset=st.floats(-500, 500), factor=st.floats(0.1, 10.0))
def test_scores_scale_with_the_force_and_do_not_see_its_sign(offset, factor):
    force = 300.0 * SINE + offset
    plain, mirrored = scored(SINE, force), scored(-SINE, -force)
    assert mirrored.rmse_N == pytest.approx(plain.rmse_N)
    scaled = scored(factor * SINE, factor * force)
    assert scaled.max_N == pytest.approx(factor * plain.max_N)
    assert scaled.rmse_over_range_percent == pytest.approx(plain.rmse_over_range_percent)
    size = np.sqrt(0.5)
    assert plain.rmse_feasible_percent == pytest.approx(100.0 * plain.rmse_N / size)
    assert scaled.rmse_feasible_percent == pytest.approx(plain.rmse_feasible_percent)


def test_the_worst_of_runs_is_the_highest_of_each_figure_and_the_lowest_share():
    one = Score(
        max_N=5.0, rmse_N=1.0, max_feasible_N=None, rmse_feasible_N=None, p99_feasible_N=None,
        feasible_share=0.0, rmse_over_range_percent=2.0, coil_power_W=3.0, chatter_A_per_s=1.0,
    )  # fmt: skip
    two = replace(one, max_N=4.0, rmse_N=2.0, rmse_feasible_N=1.5, feasible_share=0.9)
    both = worst([one, two])
    assert (both.max_N, both.rmse_N, both.rmse_feasible_N, both.feasible_share) == (5.0, 2.0, 1.5, 0.0)
    assert both.max_feasible_N is None


def test_signals_of_different_length_are_refused():
    with pytest.raises(InputError, match=r"lengths are \[19999, 20000\]"):
        scored(SINE, SINE[1:])


def test_the_unscored_beginning_is_not_scored():
    scenario = Scenario(duration_s=2.0, unscored_s=1.0)
    run = run_loop(Ideal(), Constant(0.0), scenario)
    spoilt = replace(run, force=np.where(run.course.time <= 1.0, 1e6, run.course.target + 7.0))
    assert score_run(spoilt, attainable_range(Ideal(), run.course, 20.0, 2.0)).max_N == pytest.approx(7.0)


# ------------------------------------------------------------------------------- what is feasible


def share(phase_deg: float, degrees: float) -> float:
    scenario = Scenario(target=SineTarget(900.0, 1.0, phase_deg), temperature_degC=degrees)
    plant = Plant(PRESETS["nominal"])
    course = reference_trajectory(scenario, plant.step_s)
    reach = attainable_range(plant, course, degrees, 2.0)
    return float(reach.feasible(course.target)[course.scored_from :].mean())


@pytest.mark.parametrize("degrees", [20.0, 60.0, 100.0, 123.0])
def test_a_damper_follows_its_own_velocity_and_cannot_push(degrees):
    """In phase with velocity 85 to 90 %; some degrees behind it is best; against it, next to nothing."""
    in_phase, behind = share(0.0, degrees), share(-10.0, degrees)
    assert 0.85 <= in_phase <= 0.90
    assert 0.95 <= behind <= 0.98
    assert share(180.0, degrees) == pytest.approx(0.05, abs=0.02)
    for side in (90.0, -90.0):
        assert 0.2 <= share(side, degrees) <= 0.5


def test_for_a_plain_coulomb_damper_the_share_has_a_closed_form():
    """50 to 1650 N: a sine of 900 N is feasible where 70 N <= |F*|, which is 1 - (2/pi) asin(70/900)."""
    course = reference_trajectory(Scenario(duration_s=2.0), 1e-4)
    inside = attainable_range(Ideal(), course, 20.0, 2.0).feasible(course.target)
    assert inside.mean() == pytest.approx(1.0 - 2 / np.pi * np.arcsin(70.0 / 900.0), abs=2e-4)


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_named_targets_are_feasible_most_of_the_time_on_every_preset(name):
    for preset in ("nominal", "hard", "stiff"):
        plant = Plant(PRESETS[preset])
        course = reference_trajectory(SCENARIOS[name], plant.step_s)
        reach = attainable_range(plant, course, 123.0, 2.0)
        assert reach.feasible(course.target)[course.scored_from :].mean() > 0.65
