"""Fit by the genetic algorithm of the reference paper, the baseline for comparisons with variable projection.

As is common for genetic algorithms, the search includes all free parameters, linear and nonlinear. For a fair
comparison, cost and kernel are the same as in variable projection.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import MissingExtraError
from mrdamper.identify.limits import make_feasible
from mrdamper.identify.problem import FitProblem, SearchResult, Start, canonical
from mrdamper.identify.search.gram_sums import GramSums
from mrdamper.identify.search.objective import Box, Objective
from mrdamper.identify.search.variable_projection import SearchState
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.models.damper import Damper
from mrdamper.runtime.progress import Progress, silent


class Ensemble:
    """Cost of many parameter sets (candidates) in one call; coordinates are scaled to 0 to 1."""

    def __init__(self, problem: FitProblem) -> None:
        self.problem = problem
        self.windows = problem.windows()
        self._box = Box.from_parameters(problem.free)
        self._names = [free.name for free in problem.free]
        self._linear = np.array([free.linear for free in problem.free])
        self._sums = GramSums(problem.template, self._names, (), self.windows)
        self._rows, self._floor = problem.conditions

    def damper(self, unit: FloatArray) -> Damper:
        """Return the damper at the scaled coordinates of one candidate."""
        values = zip(self._names, self._values(unit).tolist(), strict=True)
        return self.problem.template.with_parameters(dict(values))

    def costs(self, unit: FloatArray) -> FloatArray:
        """Return the cost [%^2] of candidates of shape (count, parameters); the result has shape (count,).

        A candidate with invalid coefficients gets a penalty that grows with the distance from the valid range
        of the law. The penalty makes this candidate worse than every valid candidate.
        """
        values = self._values(unit)
        costs = self._sums.evaluate(values)[:, 0, 0]
        linear = values[:, self._linear]
        beyond = np.maximum(self._floor - linear @ self._rows.T, 0.0)
        size = np.abs(linear) @ np.abs(self._rows).T + np.abs(self._floor) + 1e-300
        penalty = NUMERICS.invalid_cost * np.sum((beyond > 0.0) + beyond / size, axis=1)
        return np.asarray(np.where(np.isfinite(costs), costs, NUMERICS.invalid_cost) + penalty)

    def _values(self, unit: FloatArray) -> FloatArray:
        return self._box.to_physical(self._box.low + unit * (self._box.high - self._box.low))


def fit_genetic(
    problem: FitProblem,
    *,
    population: int = 200,
    generations: int = 300,
    seed: int = 0,
    on_progress: Progress = silent,
) -> SearchResult:
    """Fit by the genetic algorithm of the reference paper (library pymoo), which serves as baseline.

    The algorithm uses binary tournaments, simulated binary crossover (probability 0.9, eta 15), polynomial
    mutation (eta 20) and elitist survival. The initial population is a Latin hypercube. After an interrupt,
    the result is the best damper so far.
    """
    try:
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM
        from pymoo.operators.sampling.lhs import LHS
    except ImportError as error:
        raise MissingExtraError.for_package("the genetic algorithm", "pymoo", "genetic") from error
    ensemble = Ensemble(problem)

    class Fit(Problem):  # type: ignore[misc]  # pymoo is not typed
        def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: object, **__: object) -> None:
            out["F"] = ensemble.costs(x)[:, None]

    operators = {"sampling": LHS(), "crossover": SBX(prob=0.9, eta=15), "mutation": PM(eta=20)}
    algorithm = GA(pop_size=population, **operators, eliminate_duplicates=True)
    fit = Fit(n_var=len(problem.free), n_obj=1, xl=0.0, xu=1.0)
    algorithm.setup(fit, termination=("n_gen", generations), seed=seed)
    best: FloatArray | None = None
    generation, cancelled = 0, False
    try:
        while algorithm.has_next():
            algorithm.next()
            best, generation = np.asarray(algorithm.opt[0].X), generation + 1
            percent = float(np.sqrt(algorithm.opt[0].F[0]))
            on_progress(SearchState("genetic", 0, 1, generation, percent, percent).update)
    except KeyboardInterrupt:
        cancelled = True
        if best is None:
            raise
    assert best is not None
    damper = canonical(make_feasible(problem, ensemble.damper(best)))
    cost = float(np.sqrt(Objective(problem, ensemble.windows).gram(damper, ())[0, 0]))
    estimates, correlation = estimates_of(problem, ensemble.windows, damper)
    return SearchResult(
        damper=damper,
        method="genetic",
        cost_percent=cost,
        estimates=estimates,
        correlation=correlation,
        starts=(Start(0, cost, not cancelled),),
        seed=seed,
        cancelled=cancelled,
        notes=(
            f"genetic algorithm (pymoo): population {population}, {generations} generations, binary "
            "tournament, simulated binary crossover (0.9, eta 15), polynomial mutation (eta 20), elitist, "
            "Latin hypercube",
        ),
    )
