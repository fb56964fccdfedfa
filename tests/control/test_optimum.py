"""The offline optimum: known answers, bounds from both sides, a budget that is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.optimum import (
    _boxed_step,
    _normal_equations,
    _Problem,
    _Search,
    _times,
    agreed_optimum,
    search_optimum,
)
from mrdamper.control.scenario import SCENARIOS, Scenario
from mrdamper.control.score import attainable_range, score_run
from mrdamper.errors import InputError
from mrdamper.rig.plant import PRESETS, Plant
from tests.control.loops import Constant, Ideal, Inverse, Lagging, quiet

SHORT = quiet(Scenario(duration_s=0.6, unscored_s=0.1))


@pytest.mark.parametrize("gain", [800.0, 428.0])
def test_without_memory_the_optimum_is_the_mean_of_the_target_over_each_hold(gain):
    """F = (50 + gain I) sign v: the best held current is that of the mean target, also close to a limit."""
    found = search_optimum(Ideal(gain=gain), SHORT, period_s=1e-3)
    side = np.sign(found.course.velocity).reshape(-1, 10)
    blocks = np.abs(found.course.target).reshape(-1, 10)
    exact = np.clip((blocks.mean(axis=1) - 50.0) / gain, 0.0, 2.0)
    scored = (side == side[:, :1]).all(axis=1) & (np.arange(len(side)) >= 100)
    assert found.current[::10][scored] == pytest.approx(exact[scored], abs=2e-3)
    assert found.score.max_feasible_N is not None
    assert found.score.max_feasible_N < 0.51 * 900 * 2 * np.pi * 1e-3  # half a hold of the steepest target


def test_the_bounded_step_is_that_of_a_dense_solver():
    """On a banded least-squares problem, half of whose unknowns end on a bound."""
    rng = np.random.default_rng(2)
    count, window, hold = 60, 5, 3
    slopes = rng.normal(size=(count, window * hold))
    error = rng.normal(size=count * hold)
    dense = np.zeros((count * hold, count))
    for j in range(count):
        part = slopes[j, : len(error) - j * hold]
        dense[j * hold : j * hold + len(part), j] = part
    band, gradient = _normal_equations(slopes, error, 0, hold)
    assert gradient == pytest.approx(dense.T @ error)
    vector = rng.normal(size=count)
    assert _times(band, vector) == pytest.approx(dense.T @ (dense @ vector))
    limit = np.full(count, 0.2)
    step = _boxed_step(band, gradient, -limit, limit)
    expected = lsq_linear(dense, -error, bounds=(-limit, limit)).x
    assert 0.2 < (np.abs(expected) > 0.1999).mean() < 0.8
    assert step == pytest.approx(expected, abs=2e-3)


def test_derivatives_that_are_measured_together_are_those_of_a_lag():
    """Each sample's answer 1 - e^(-t/T) while it is held, then its decay, whichever way it is moved."""
    course = reference_trajectory(replace(SHORT, duration_s=0.1, unscored_s=0.02), 1e-4)
    plant = Lagging(0.002, low=50.0, gain=900.0)
    problem = _Problem(plant, course, SHORT, 100)
    search = _Search(problem, every=10, memory=30, seed=1)
    rng = np.random.default_rng(1)
    point = problem.at(search.held(rng.uniform(0.2, 1.8, 100)))
    slopes = search._derivative(point, 0.1 * rng.choice([-1.0, 1.0], 100), length=1, offset=0)
    after = 1e-4 * np.arange(1, 301)
    answer = 900.0 * (1.0 - np.exp(-after / 0.002))
    answer[10:] -= answer[:-10].copy()
    for j in (0, 17, 60, 95):
        part = slice(10 * j, min(10 * j + 300, 1000))
        expected = answer[: part.stop - part.start] * np.sign(course.velocity[part])
        assert slopes[j, : len(expected)] == pytest.approx(expected, abs=0.01)
        assert (slopes[j, len(expected) :] == 0.0).all()
    assert problem.runs == 31


def test_a_lag_that_is_known_ahead_costs_next_to_nothing():
    """The optimum leads the target; the inverse without preview is late by the lag."""
    plant = Lagging(0.01, gain=1600.0)
    found = search_optimum(plant, SHORT)
    late = run_loop(plant, Inverse(gain=1600.0), SHORT)
    score = score_run(late, found.reach)
    assert found.score.rmse_feasible_N is not None
    assert score.rmse_feasible_N is not None
    assert found.score.rmse_feasible_N < 0.1 * score.rmse_feasible_N


def least_rmse(plant, scenario, period_s):
    """Return the RMS error of the best held current of a damper whose force is linear in it, exactly."""
    course = reference_trajectory(scenario, plant.step_s)
    every, count = round(period_s / plant.step_s), round(scenario.duration_s / period_s)
    still = plant.copy().advance_many(course.displacement, course.velocity, 0.0, 20.0)
    pulse = np.repeat(np.eye(count), every, axis=1)
    slopes = [plant.copy().advance_many(course.displacement, course.velocity, one, 20.0) for one in pulse]
    part = slice(course.scored_from, None)
    found = lsq_linear(
        (slopes - still).T[part], (course.target - still)[part], bounds=(0.0, scenario.highest_A)
    )
    return float(np.sqrt(2.0 * found.cost / (len(course) - course.scored_from)))


@pytest.mark.parametrize("lag_s", [0.01, 0.03, 0.06])
def test_on_a_linear_damper_both_searches_end_at_the_optimum_of_a_convex_solver(lag_s):
    """F = (50 + 800 i) sign v behind a first-order lag, its target too quick for the two slower ones."""
    scenario = replace(SHORT, duration_s=0.4)
    plant, start = Lagging(lag_s), np.full(4000, 0.3)
    found = agreed_optimum(plant, scenario, (start,), period_s=4e-3)
    exact = least_rmse(plant, scenario, 4e-3)
    assert found.rmse_N == pytest.approx((exact, exact), rel=0.01)
    assert found.agrees
    assert found.best.score.rmse_N >= (1.0 - 1e-6) * exact


def test_without_memory_the_search_begins_at_the_optimum():
    """No run is left for a step: the currents that give the target where they are held, from a table."""
    found = search_optimum(Ideal(), SHORT, most_runs=14)
    assert found.score.rmse_feasible_N is not None
    assert found.score.rmse_feasible_N < 0.015 * 900.0


@pytest.mark.parametrize(("budget", "steps"), [(14, 0), (15, 1)])
def test_a_step_is_taken_where_its_runs_are_left(budget: int, steps: int) -> None:
    """One run for the start, 12 stretches of 8 ms in a memory of 0.1 s, one for the step, one spliced."""
    found = search_optimum(Ideal(), SHORT, starts=[np.ones(6000)], most_runs=budget, memory_s=0.1)
    assert found.iterations == steps
    assert found.runs <= budget


def test_a_current_that_is_not_felt_is_not_spent() -> None:
    """All are as good: it stays at the first of the constant ones, none, or at the first to start from."""
    deaf, first = Ideal(gain=0.0), np.full(6000, 0.3)
    begun = search_optimum(deaf, SHORT, starts=[first, first + 1.0], most_runs=30, memory_s=0.1)
    assert (begun.current == 0.3).all()
    assert (search_optimum(deaf, SHORT, most_runs=30, memory_s=0.1).current == 0.0).all()


def test_currents_to_start_from_are_spliced_where_each_is_better():
    """One is right in the first half, the other in the second: so is the start but where they meet."""
    plant = Ideal()
    course = reference_trajectory(SHORT, plant.step_s)
    right = np.clip((np.abs(course.target) - 50.0) / 800.0, 0.0, 2.0)
    early = np.arange(len(course)) < 3000
    starts = np.where(early, right, 1.9), np.where(early, 0.1, right)
    found, *alone = (  # no run is left for a step
        search_optimum(plant, SHORT, starts=some, most_runs=14, memory_s=0.1)
        for some in (starts, starts[:1], starts[1:])
    )
    assert found.runs == 3
    assert found.score.rmse_N < 0.6 * min(each.score.rmse_N for each in alone)


@pytest.fixture(scope="module")
def nominal():
    scenario = replace(SHORT, temperature_degC=123.0)
    plant = Plant(PRESETS["nominal"])
    return plant, scenario, search_optimum(plant, scenario)


@pytest.mark.system
def test_no_constant_current_is_better(nominal):
    plant, scenario, found = nominal
    for current in np.linspace(0.0, 2.0, 11):
        run = run_loop(plant, Constant(float(current)), scenario)
        assert score_run(run, found.reach).rmse_N > found.score.rmse_N


def test_what_it_found_is_what_the_plant_does_with_that_current(nominal):
    plant, _, found = nominal
    course = found.course
    force = plant.copy().advance_many(course.displacement, course.velocity, found.current, 123.0)
    assert np.array_equal(force, found.force)
    assert found.current.min() >= 0.0
    assert found.current.max() <= 2.0
    assert np.array_equal(found.current, found.current[::10].repeat(10))


def test_no_single_current_can_be_moved_to_much_gain(nominal):
    """At an optimum the slope along every current is zero, or points out of its range."""
    plant, _, found = nominal
    course = found.course

    def rmse(current):
        force = plant.copy().advance_many(course.displacement, course.velocity, current, 123.0)
        return np.sqrt(np.mean((force - course.target)[course.scored_from :] ** 2))

    best = rmse(found.current)
    for sample in range(100, 600, 40):
        for move in (-0.1, -0.02, 0.02, 0.1):
            tried = found.current.copy()
            block = slice(10 * sample, 10 * sample + 10)
            tried[block] = np.clip(tried[block] + move, 0.0, 2.0)
            assert rmse(tried) > 0.999 * best


def test_what_is_left_is_where_the_damper_cannot_push(nominal):
    """The largest errors are infeasible ones; there the target crosses zero before the motion turns."""
    _, _, found = nominal
    score = found.score
    assert score.max_feasible_N is not None
    assert score.max_feasible_N < 0.4 * score.max_N


def test_the_search_stops_at_its_budget(nominal):
    plant, scenario, found = nominal
    assert found.converged
    assert found.runs <= 1000
    small = search_optimum(plant, scenario, most_runs=60)
    assert small.runs <= 60
    assert not small.converged
    assert small.score.rmse_N >= found.score.rmse_N
    with pytest.raises(InputError, match=r"5 runs; expected at least 14"):
        search_optimum(plant, scenario, most_runs=5)


def test_a_coarser_hold_cannot_do_better(nominal):
    plant, scenario, found = nominal
    coarse = search_optimum(plant, scenario, period_s=8e-3)
    assert coarse.score.rmse_N >= 0.99 * found.score.rmse_N


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("target", "highest"),
    [
        ("sine-900N-1Hz", 88.0),
        pytest.param("sine-1100N-2Hz", 120.0, marks=pytest.mark.release),
        pytest.param("non-periodic", 200.0, marks=pytest.mark.release),
    ],
)
def test_the_physical_limit_on_the_nominal_damper(target, highest):
    """The figures of docs/tracking.md; worst of the temperatures, over all samples."""
    found = [
        search_optimum(Plant(PRESETS["nominal"]), replace(SCENARIOS[target], temperature_degC=degrees))
        for degrees in (20.0, 60.0, 100.0, 123.0)
    ]
    assert max(each.score.max_N for each in found) <= highest
    reach = attainable_range(Plant(PRESETS["nominal"]), found[0].course, 20.0, 2.0)
    assert np.array_equal(reach.low, found[0].reach.low)
