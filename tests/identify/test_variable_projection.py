"""The search: same optimum from every start, the law's conditions kept, an interrupt survived."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.excitation import drive
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.objective import Objective, _bounded_least_squares
from mrdamper.identify.search.variable_projection import SearchState, fit_variable_projection, latin_hypercube
from mrdamper.identify.templates import template
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import simulate
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.truths import MOTIONS, TRUTHS, measured


def problem_of(law: str, *, noise: float = 0.02, seed: int = 0, session_offsets: bool = False) -> FitProblem:
    runs = measured(TRUTHS[law], noise=noise, seed=seed)
    damper, free = template(law, runs)
    return FitProblem(damper, free, runs, session_offsets)


@pytest.mark.system
@pytest.mark.parametrize("law", ["bouc-wen", "bouc-wen-saturating", "series-valve"])
def test_every_seed_finds_the_same_optimum(law: str) -> None:
    problem = problem_of(law)
    costs = [fit_variable_projection(problem, starts=2, seed=seed).cost_percent for seed in range(4)]
    assert max(costs) < 1.001 * min(costs)


def test_the_same_seed_gives_the_same_numbers() -> None:
    problem = problem_of("bouc-wen")
    one, two = (fit_variable_projection(problem, starts=1, seed=4) for _ in range(2))
    assert one.damper.parameters == two.damper.parameters


def test_the_cost_is_the_mean_squared_error_of_the_runs() -> None:
    """Computed here from plain simulations, without Gram sums, weights or elimination."""
    problem = replace(problem_of("bouc-wen"), rate_Hz=1e4)
    result = fit_variable_projection(problem, starts=1, seed=0)
    shares = []
    for run in problem.runs:
        error = (simulate(result.damper, run.trajectory) - run.force)[run.scored_from :]
        shares.append(100.0 * np.sqrt(np.mean(error**2)) / np.std(run.force[run.scored_from :]))
    assert result.cost_percent == pytest.approx(np.sqrt(np.mean(np.square(shares))), rel=1e-9)


def test_eliminating_linear_numbers_is_least_squares() -> None:
    """At given rho, kappa, n no other linear coefficients do better: the gradient by them is zero."""
    problem = problem_of("bouc-wen")
    objective = Objective(problem, problem.prepare())
    nonlinear = np.array([[1800.0, -0.5, 1.4]])
    assert objective.nonlinear == ("rho.value", "kappa.value", "n.value")
    guess = objective.candidate_of(problem.template)[1]
    found = objective.eliminate(nonlinear, guess, np.empty((1, 0)))
    values = dict(zip(objective.nonlinear, nonlinear[0].tolist(), strict=True))
    best = problem.template.with_parameters(
        {**values, **dict(zip(objective.linear, found.linear[0].tolist(), strict=True))}
    )
    assert objective.gram(best, (), {})[-1, -1] == pytest.approx(found.cost[0], rel=1e-9)
    for name in objective.linear:
        value = best.parameters[name]
        for change in (0.99, 1.01):
            moved = best.with_parameters({name: value * change})
            assert objective.gram(moved, (), {})[-1, -1] > found.cost[0]


def test_a_candidate_that_diverges_has_no_cost_and_leaves_the_others_theirs(monkeypatch) -> None:
    """Sums without bound, as of a force that grows for ever, warn nobody (a warning is an error here)."""
    problem = problem_of("bouc-wen")
    objective = Objective(problem, problem.prepare())
    nonlinear = np.array([[1500.0, -0.2, 1.0], [1800.0, -0.5, 1.4]])
    linear = np.repeat(objective.candidate_of(problem.template)[1], 2, axis=0)
    alone = objective.sums(nonlinear, linear, np.empty((2, 0)))
    sums = core.gram_sums

    def diverging(*given, **how):
        found = np.array(sums(*given, **how))
        found.reshape(2, -1)[0] = np.inf
        return found

    monkeypatch.setattr(core, "gram_sums", diverging)
    together = objective.sums(nonlinear, linear, np.empty((2, 0)))
    assert not np.isfinite(together[0, -1, -1])
    assert together[1] == pytest.approx(alone[1], rel=1e-12)


def test_the_projected_gradient_is_the_gradient_of_the_eliminated_cost() -> None:
    problem = problem_of("bouc-wen")
    objective = Objective(problem, problem.prepare())
    at, none = np.array([[1500.0, -0.2, 1.0]]), np.empty((1, 0))
    best = objective.eliminate(at, objective.candidate_of(problem.template)[1], none)
    _, gradient, _ = objective.projected(objective.sums(at, best.linear, none), best.linear)
    for place in range(3):
        step = np.zeros(3)
        step[place] = 1e-5 * abs(at[0, place])
        above, below = objective.eliminate(
            np.concatenate([at + step, at - step]), np.repeat(best.linear, 2, axis=0), np.empty((2, 0))
        ).cost
        assert -2.0 * gradient[0, place] == pytest.approx((above - below) / (2.0 * step[place]), rel=1e-4)


def test_candidates_side_by_side_are_those_of_one_at_a_time() -> None:
    """Steady runs, runs whose command varies and session offsets among them."""
    problem = problem_of("bouc-wen", session_offsets=True)
    last = problem.runs[-1]
    command = np.linspace(0.0, 1.0, len(last.trajectory))
    varying = replace(last, trajectory=replace(last.trajectory, command=command))
    sessions = itertools.cycle("ab")
    runs = tuple(
        replace(run, run=replace(run.run, session=session))
        for run, session in zip((*problem.runs[:-1], varying), sessions, strict=False)
    )
    problem = replace(problem, runs=runs)
    objective = Objective(problem, problem.prepare())
    draw = np.random.default_rng(0)
    nonlinear = np.array([[1500.0, -0.2, 1.0]]) * draw.uniform(0.8, 1.2, (4, 3))
    linear = objective.candidate_of(problem.template)[1] * draw.uniform(0.5, 1.5, (4, 1))
    session_offsets = draw.normal(scale=20.0, size=(4, 2))
    together = objective.sums(nonlinear, linear, session_offsets)
    names = (*objective.nonlinear, *objective.linear)
    for k in range(4):
        values = dict(zip(names, [*nonlinear[k].tolist(), *linear[k].tolist()], strict=True))
        offsets = dict(zip(objective.sessions, session_offsets[k].tolist(), strict=True))
        alone = objective.gram(problem.template.with_parameters(values), names, offsets)
        np.testing.assert_allclose(together[k], alone, rtol=1e-9, atol=1e-9 * float(np.abs(alone).max()))


@pytest.mark.parametrize("seed", range(8))
def test_bounded_least_squares_agrees_with_a_general_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((9, 5))
    matrix, right = root.T @ root, rng.standard_normal(5) * 3.0
    rows, floor = rng.standard_normal((4, 5)), rng.standard_normal(4) * 0.3
    found = _bounded_least_squares(matrix[None], right[None], rows, floor[None])[0]
    other = minimize(  # type: ignore[call-overload]  # the stub asks for more than SLSQP needs
        lambda x: 0.5 * x @ matrix @ x - right @ x,
        np.zeros(5),
        jac=lambda x: matrix @ x - right,
        constraints={"type": "ineq", "fun": lambda x: rows @ x - floor, "jac": lambda x: rows},
        options={"maxiter": 500, "ftol": 1e-14},
    )
    assert np.all(rows @ found - floor >= -1e-7)
    assert 0.5 * found @ matrix @ found - right @ found <= other.fun + 1e-7


def test_no_linear_coefficient_leaves_the_range_of_its_law() -> None:
    """Data that ask for a negative viscosity get none: the law would push."""
    problem = problem_of("bouc-wen")
    pushed = tuple(
        replace(run, force=np.asarray(run.force) - 1500.0 * run.trajectory.velocity) for run in problem.runs
    )
    result = fit_variable_projection(replace(problem, runs=pushed), starts=1, seed=0)
    viscosity = result.damper.coefficients["viscosity"].value(np.linspace(0.0, 2.0, 9))
    assert viscosity.min() >= -1e-6 * 1500.0
    assert viscosity.min() == pytest.approx(0.0, abs=1.0)


def test_a_tare_that_shifted_between_sessions_is_found_and_does_not_touch_the_rest() -> None:
    problem = problem_of("bouc-wen", session_offsets=True)
    shift = {"a": -60.0, "b": 25.0}
    runs = tuple(
        replace(run, run=replace(run.run, session=s), force=np.asarray(run.force) + shift[s])
        for run, s in zip(problem.runs, "ab" * (len(problem.runs) // 2), strict=True)
    )
    result = fit_variable_projection(replace(problem, runs=runs), starts=1, seed=0)
    assert result.offsets_N["b"] - result.offsets_N["a"] == pytest.approx(85.0, abs=2.0)
    truth = TRUTHS["bouc-wen"].parameters
    assert result.offsets_N["a"] + result.offsets_N["b"] == pytest.approx(0.0, abs=2.0), (
        "the rest is the law's"
    )
    assert result.damper.parameters["rho.value"] == pytest.approx(truth["rho.value"], rel=0.1)


@pytest.mark.system
def test_an_interrupt_keeps_the_best_so_far() -> None:
    told: list[SearchState] = []

    def stop_after_three(progress: ProgressUpdate) -> None:
        assert isinstance(progress.detail, SearchState)
        told.append(progress.detail)
        if len(told) == 3:
            raise KeyboardInterrupt

    result = fit_variable_projection(
        problem_of("series-valve"), starts=5, seed=0, on_progress=stop_after_three
    )
    assert result.cancelled
    assert result.cost_percent == pytest.approx(told[-1].best_percent)


class Notebook:
    """A checkpoint in memory, which keeps what a JSON file would."""

    def __init__(self) -> None:
        self.pages: dict[str, str] = {}

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return json.loads(self.pages[key]) if key in self.pages else None

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        self.pages[key] = json.dumps(value)


@pytest.mark.system
def test_a_fit_that_goes_on_from_a_checkpoint_ends_with_the_same_bits() -> None:
    problem, whole = problem_of("series-valve"), Notebook()
    once = fit_variable_projection(problem, starts=3, seed=0, checkpoint=whole)
    made = len(whole.pages)
    assert made >= 2
    for count in range(made + 1):
        part = Notebook()
        part.pages = dict(list(whole.pages.items())[:count])
        again = fit_variable_projection(problem, starts=3, seed=0, checkpoint=part)
        assert again.damper.parameters == once.damper.parameters
        assert (again.starts, again.history, again.cost_percent) == (
            once.starts,
            once.history,
            once.cost_percent,
        )
        assert part.pages == whole.pages


def test_a_start_that_joined_a_former_one_would_have_ended_where_that_one_did() -> None:
    problem = problem_of("bouc-wen")
    result = fit_variable_projection(problem, starts=5, seed=0)
    assert [start.index for start in result.starts] == list(range(5))
    joined = [start for start in result.starts if start.joined is not None]
    assert joined
    for start in joined:
        alone = fit_variable_projection(problem, starts=1, seed=7919 * start.index)
        assert alone.cost_percent == pytest.approx(start.cost_percent, rel=1e-6)


def test_progress_never_gets_worse() -> None:
    told: list[ProgressUpdate] = []
    fit_variable_projection(problem_of("tanh"), starts=3, seed=1, on_progress=told.append)
    best = [update.detail.best_percent for update in told if isinstance(update.detail, SearchState)]
    assert len(best) == len(told) >= 3
    assert best == sorted(best, reverse=True)


def test_starts_fill_their_box_and_every_seed_draws_others() -> None:
    free = (FreeParameter("a", 1e-3, 1e3, "log"), FreeParameter("b", -1.0, 1.0))
    drawn = latin_hypercube(free, 50, 0)
    for column, (low, high) in zip(drawn.T, ((np.log(1e-3), np.log(1e3)), (-1.0, 1.0)), strict=True):
        counts, _ = np.histogram(column, bins=5, range=(low + 0.1 * (high - low), high - 0.1 * (high - low)))
        assert counts.tolist() == [10] * 5
    assert not np.allclose(drawn, latin_hypercube(free, 50, 1))


def test_one_command_alone_is_refused_unless_it_is_asked_for() -> None:
    runs = [run for run in measured(TRUTHS["bouc-wen"], noise=0.0, seed=0) if run.run.constant_command == 1.0]
    with pytest.raises(InputError, match="one command"):
        template("bouc-wen", runs)
    damper, free = template("bouc-wen", runs, one_command=True)
    result = fit_variable_projection(FitProblem(damper, free, tuple(runs)), starts=1, seed=0)
    assert result.cost_percent < 0.5


def test_runs_in_volts_and_in_amperes_do_not_mix() -> None:
    runs = list(measured(TRUTHS["dahl"], noise=0.0, seed=0))
    runs[0] = replace(runs[0], run=replace(runs[0].run, command_unit="V"))
    with pytest.raises(InputError, match="A, V"):
        template("dahl", runs)


@pytest.mark.parametrize("law", TRUTHS)
def test_the_force_is_linear_in_what_a_law_says_and_in_nothing_else(law):
    """Three values in a row, from the truth's or the default up: the middle force is the mean, or is not."""
    truth = TRUTHS[law]
    path = drive(MOTIONS["harmonics"], duration=2.0, rate_Hz=500.0, command=1.0)
    for coefficient in truth.law.coefficients:
        given = truth.coefficients.get(coefficient.name)
        value = float(given.value(np.array([1.0]))[0]) if given else coefficient.default
        assert value is not None
        step = 0.1 * abs(value) or 0.1
        forces = [
            simulate(replace(truth, coefficients={**truth.coefficients, coefficient.name: each}), path)
            for each in map(Constant, (value, value + step, value + 2.0 * step))
        ]
        change = float(np.abs(forces[2] - forces[0]).max())
        if change > 0.0:  # a number of a term that is switched off changes nothing
            bend = float(np.abs(forces[0] + forces[2] - 2.0 * forces[1]).max())
            assert (bend < 1e-9 * change) == coefficient.linear, coefficient.name
