"""The genetic algorithm minimises the simulation error, but variable projection finds a smaller error."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.identify.problem import FitProblem
from mrdamper.identify.scores import score_run
from mrdamper.identify.search.population import Ensemble, fit_genetic
from mrdamper.identify.search.variable_projection import SearchState, fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs


@pytest.fixture(scope="module")
def problem() -> FitProblem:
    runs = simulate_runs(REFERENCE_DAMPERS["bouc-wen"], noise=0.02, seed=0, duration=2.5)
    damper, free = template("bouc-wen", runs)
    return FitProblem(damper, free, runs, settings=FitSettings(rate_Hz=1e4, samples_per_period=1e9))


def test_genetic_algorithm_minimises_simulation_error(problem: FitProblem) -> None:
    ensemble = Ensemble(problem)
    candidates = 0.3 + 0.4 * np.random.default_rng(0).random((3, len(problem.free)))
    # The value 0.5 means zero: the force does not depend on current.
    candidates[:, [f.name.endswith(("c1", "c2")) for f in problem.free]] = 0.5
    # The value 0.7 means a positive constant.
    candidates[:, [f.name.endswith("c0") for f in problem.free]] = 0.7
    costs = ensemble.costs(candidates)
    for candidate, cost in zip(candidates, costs, strict=True):
        errors = [score_run(ensemble.damper(candidate), run) for run in problem.runs]
        assert cost == pytest.approx(np.mean([e.nrmse_percent**2 for e in errors]), rel=1e-9)


def test_genetic_algorithm_is_not_better_than_variable_projection(problem: FitProblem) -> None:
    told: list[float] = []
    generations = 25

    def note(progress: ProgressUpdate) -> None:
        assert isinstance(progress.detail, SearchState)
        told.append(progress.detail.best_percent)

    genetic = fit_genetic(problem, population=40, generations=generations, seed=0, on_progress=note)
    projected = fit_variable_projection(problem, starts=1)
    assert len(told) == generations
    assert told == sorted(told, reverse=True)
    assert genetic.cost_percent < 0.7 * told[0]
    assert projected.cost_percent < genetic.cost_percent
    assert "tournament" in genetic.notes[0]
