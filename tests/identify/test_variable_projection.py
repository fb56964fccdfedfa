"""A fit reaches the global minimum, keeps coefficients valid, and never worsens an initial damper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import SearchState, fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.models.simulate import simulate
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs
from tests.support.tiers import one_by_day


def problem_of(law: str, *, noise: float = 0.02, seed: int = 0, duration: float = 2.0) -> FitProblem:
    runs = simulate_runs(REFERENCE_DAMPERS[law], noise=noise, seed=seed, duration=duration)
    damper, free = template(law, runs)
    return FitProblem(damper, free, runs)


@pytest.mark.system
@pytest.mark.parametrize("law", one_by_day(["bouc-wen", "bouc-wen-saturating", "series-valve"], 2))
def test_additional_starts_find_same_minimum(law: str) -> None:
    problem = problem_of(law, duration=4.0)
    costs = [fit_variable_projection(problem, starts=count).cost_percent for count in (1, 3)]
    assert max(costs) < 1.001 * min(costs)


def test_same_seed_gives_same_fitted_parameters() -> None:
    problem = problem_of("bouc-wen")
    first, second = (fit_variable_projection(problem, starts=1) for _ in range(2))
    assert first.damper.parameters == second.damper.parameters


def test_cost_is_mean_squared_error_of_runs() -> None:
    """The cost agrees with plain simulations at the full sample rate."""
    problem = replace(problem_of("bouc-wen"), settings=FitSettings(rate_Hz=1e4, samples_per_period=1e9))
    result = fit_variable_projection(problem, starts=1)
    errors = []
    for run in problem.runs:
        error = (simulate(result.damper, run.trajectory) - run.force)[run.scored_from :]
        errors.append(100.0 * np.sqrt(np.mean(error**2)) / np.std(run.force[run.scored_from :]))
    assert result.cost_percent == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-9)


@pytest.mark.parametrize("rho", [200.0, 1800.0, 2e4])
def test_fit_never_exceeds_cost_of_given_damper(rho: float) -> None:
    """Even after one iteration, the cost is at most the smallest cost of the initial dampers."""
    problem = replace(problem_of("bouc-wen"), settings=FitSettings())
    start = REFERENCE_DAMPERS["bouc-wen"].with_parameters({"rho.value": rho})
    objective = Objective(problem, problem.windows())
    known, other = (float(np.sqrt(cost)) for cost in objective.costs_of([start, problem.template]))
    settings = FitSettings(iterations_max=1, start_iterations_max=1)
    for dampers in ([start], [problem.template, start], [start, problem.template]):
        result = fit_variable_projection(replace(problem, settings=settings), dampers=dampers)
        limit = known if len(dampers) == 1 else min(known, other)
        assert result.cost_percent <= limit * (1.0 + 1e-9)


def test_fitted_viscosity_is_never_negative() -> None:
    """Data with negative viscosity give zero viscosity because the damper would be active otherwise."""
    problem = problem_of("bouc-wen")
    active = tuple(
        replace(run, force=np.asarray(run.force) - 1500.0 * run.trajectory.velocity) for run in problem.runs
    )
    result = fit_variable_projection(replace(problem, runs=active), starts=1)
    viscosity = result.damper.coefficients["viscosity"].value(np.linspace(0.0, 2.0, 9))
    assert viscosity.min() == pytest.approx(0.0, abs=1.0)


def test_interrupted_fit_keeps_best_parameters() -> None:
    states: list[SearchState] = []

    def stop_after_three(progress: ProgressUpdate) -> None:
        assert isinstance(progress.detail, SearchState)
        states.append(progress.detail)
        if len(states) == 3:
            raise KeyboardInterrupt

    problem = problem_of("bouc-wen")
    far = [problem.template.with_parameters({"rho.value": 200.0})]
    result = fit_variable_projection(problem, dampers=far, on_progress=stop_after_three)
    assert result.cancelled
    assert not result.converged
    assert result.cost_percent == pytest.approx(states[-1].best_percent)
