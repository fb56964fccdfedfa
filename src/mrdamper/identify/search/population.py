"""Fit by the genetic algorithm of the paper: the baseline that variable projection is compared with.

It searches all free parameters at once, also the linear ones, as users of a genetic algorithm do. Cost and
kernel are those of variable projection, because the comparison must be fair.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError, MissingExtraError
from mrdamper.identify.limits import make_feasible
from mrdamper.identify.problem import FitProblem, SearchResult, Start, canonical
from mrdamper.identify.search.variable_projection import SearchState
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.models.operating_points import OperatingPoints
from mrdamper.models.simulate import simulate
from mrdamper.quantities import REFERENCE_K
from mrdamper.runtime.progress import Progress, silent

# Cost of a candidate with invalid coefficients on all runs [%^2].
INVALID_COST = 1e6


class Ensemble:
    """The cost of many candidates at once, in search coordinates scaled to 0..1."""

    def __init__(self, problem: FitProblem) -> None:
        self.problem = problem
        self.runs = problem.windows()
        self.low = np.array([float(f.to_search(f.lower)) for f in problem.free])
        self.high = np.array([float(f.to_search(f.upper)) for f in problem.free])
        self._log = np.array([f.scale == "log" for f in problem.free])
        self.evaluations = 0
        self._weights = np.array([run.weight for run in self.runs])
        temperature_dependent = problem.template.temperature_dependent
        self._constant = all(
            run.drive.constant is not None and not (temperature_dependent and run.drive.temperature_varies)
            for run in self.runs
        )
        self._points: OperatingPoints | None = None
        if self._constant and problem.template.law.kernel is not None:
            commands = np.array([run.drive.constant for run in self.runs], dtype=np.float64)
            kelvin = np.array([run.drive.temperature or REFERENCE_K for run in self.runs])
            names = [free.name for free in problem.free]
            self._points = OperatingPoints(problem.template, names, (), commands, kelvin)

    def damper(self, unit: FloatArray) -> Damper:
        """Return the damper of one candidate."""
        point = self.low + unit * (self.high - self.low)
        values = {f.name: f.to_physical(u) for f, u in zip(self.problem.free, point, strict=True)}
        return self.problem.template.with_parameters(values)

    def costs(self, unit: FloatArray) -> FloatArray:
        """Return the cost [%^2] of candidates, shape (count, parameters) -> (count,).

        Coefficients beyond the range of the law are moved to its limit. The cost has a penalty that grows
        with the number of runs and the distance, so that such a candidate is worse than every valid one.
        """
        self.evaluations += len(unit)
        law = self.problem.template.law
        if law.kernel is None or self._points is None:
            return np.array([self._cost(self.damper(row)) for row in unit])
        points = self.low + unit * (self.high - self.low)
        values = np.exp(points, where=self._log, out=points)
        coefficients = self._points.at(values, np.empty((len(values), len(self.runs), 0, 0)))
        penalty = np.zeros(len(values))
        for place, coefficient in enumerate(law.coefficients):
            values = coefficients[:, :, place]
            inside = np.clip(values, coefficient.lower, coefficient.upper)
            beyond = np.abs(inside - values)
            if np.any(beyond):
                penalty += np.mean((beyond > 0.0) + beyond / np.abs(values).max(), axis=1)
            coefficients[:, :, place] = inside
        return np.asarray(
            self._squared_errors(law.kernel, coefficients) @ self._weights + INVALID_COST * penalty
        )

    def _squared_errors(self, law: int, coefficients: FloatArray) -> FloatArray:
        records = [run.drive.record for run in self.runs]
        forces, starts = [run.force for run in self.runs], [run.start for run in self.runs]
        return core.squared_errors(law, records, forces, starts, np.ascontiguousarray(coefficients))

    def _cost(self, damper: Damper) -> float:
        try:
            return sum(run.weight * _squares(damper, run) for run in self.runs)
        except InputError:
            return INVALID_COST


def fit_genetic(
    problem: FitProblem,
    *,
    population: int = 200,
    generations: int = 300,
    seed: int = 0,
    on_progress: Progress = silent,
) -> SearchResult:
    """Fit by a genetic algorithm (pymoo): the method of the paper, kept as the baseline.

    Binary tournament, simulated binary crossover (probability 0.9, eta 15), polynomial mutation (eta 20),
    elitist survival, initial population by Latin hypercube. An interrupt keeps the best so far.
    """
    try:
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM
        from pymoo.operators.sampling.lhs import LHS
    except ImportError as error:
        raise MissingExtraError.of("the genetic algorithm", "pymoo", "genetic") from error
    clock = time.process_time()
    ensemble = Ensemble(problem)
    history: list[float] = []

    class Fit(Problem):  # type: ignore[misc]  # pymoo is not typed
        def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: object, **__: object) -> None:
            out["F"] = ensemble.costs(x)[:, None]

    size = len(problem.free)
    algorithm = GA(
        pop_size=population,
        sampling=LHS(),
        crossover=SBX(prob=0.9, eta=15),
        mutation=PM(eta=20),
        eliminate_duplicates=True,
    )
    fit = Fit(n_var=size, n_obj=1, xl=np.zeros(size), xu=np.ones(size))
    algorithm.setup(fit, termination=("n_gen", generations), seed=seed)

    def steps() -> tuple[FloatArray, bool]:
        best: FloatArray | None = None
        try:
            while algorithm.has_next():
                algorithm.next()
                best = np.asarray(algorithm.opt[0].X)
                _add(float(algorithm.opt[0].F[0]), history, on_progress)
        except KeyboardInterrupt:
            if best is None:
                raise
            return best, True
        assert best is not None
        return best, False

    note = (
        f"genetic algorithm (pymoo): population {population}, {generations} generations, binary tournament, "
        "simulated binary crossover (0.9, eta 15), polynomial mutation (eta 20), elitist, Latin hypercube"
    )
    return _result(problem, ensemble, steps(), history, seed, clock, note)


def _add(cost: float, history: list[float], on_progress: Progress) -> None:
    """Append the smallest cost [%^2] to the history, and report it."""
    history.append(float(np.sqrt(cost)))
    on_progress(SearchState("genetic", 0, 1, len(history), history[-1], history[-1]).update)


def _result(
    problem: FitProblem,
    ensemble: Ensemble,
    outcome: tuple[FloatArray, bool],
    history: Sequence[float],
    seed: int,
    clock: float,
    note: str,
) -> SearchResult:
    best, cancelled = outcome
    damper = canonical(make_feasible(problem, ensemble.damper(best)))
    cost = float(np.sqrt(sum(run.weight * _squares(damper, run) for run in ensemble.runs)))
    estimates, correlation = estimates_of(problem, ensemble.runs, damper)
    return SearchResult(
        damper=damper,
        method="genetic",
        cost_percent=cost,
        estimates=estimates,
        correlation=correlation,
        starts=(Start(0, cost, ensemble.evaluations, not cancelled),),
        history=tuple(history),
        seed=seed,
        cpu_s=time.process_time() - clock,
        cancelled=cancelled,
        notes=(note,),
    )


def _squares(damper: Damper, run: FitWindow) -> float:
    error = (simulate(damper, run.drive) - run.force)[run.start :]
    return float(error @ error)
