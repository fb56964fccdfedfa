r"""Variable projection with Levenberg-Marquardt and several starts: the standard fit of a damper.

The force is linear in most parameters. They are eliminated by linear least squares at every step, inside the
admissible range of the law. Only the other parameters are searched for:

.. math:: \min_\theta \min_c | y - F(\\theta, c) |^2, \quad F \text{ affine in } c

The derivative of the eliminated problem is Kaufman's approximation: the tangents of theta, projected off the
space of the linear columns. A law without linear parameters uses the same algorithm with nothing to
eliminate. ``objective`` has the elimination, ``descent`` the steps. This module has the starts:

1. Random points (a Latin hypercube) are compared on the screening windows. The best ones descend there.
2. Their ends and all given dampers are compared on all runs. The best different ones descend a few steps.
3. The best of these goes on until it converges.

Method: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432; Kaufman, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.identify.limits import make_feasible
from mrdamper.identify.problem import FitProblem, FreeParameter, SearchResult, Start, canonical
from mrdamper.identify.search.descent import Descents
from mrdamper.identify.search.objective import Box, Objective
from mrdamper.identify.settings import DEFAULT_SETTINGS, FitSettings
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

# Fraction of the coordinates that a hop moves, and how far, in e-folds on a logarithmic scale.
PERTURBATIONS = ((1.0, 0.1), (0.5, 0.5), (0.2, 1.5), (0.5, 1.5))
PERTURBATION_RANGE_RATIO = 0.1  # The same on a linear scale, relative to the range of the bounds.

PYTHON_LAW_DRAW_COUNT = 8  # Random points of each start of a law in Python, which is slow.


@dataclass(frozen=True, slots=True)
class SearchState:
    """State of a search after a step: the ``detail`` of its progress."""

    method: str
    start: int
    starts: int
    iteration: int
    cost_percent: float
    best_percent: float

    @property
    def update(self) -> ProgressUpdate:
        """The progress that a search reports in this state."""
        text = (
            f"{self.method}  iteration {self.iteration}  error {self.cost_percent:.3f} %  best "
            f"{self.best_percent:.3f} %"
        )
        return ProgressUpdate(done=self.start, total=self.starts, text=text, detail=self)


def fit_variable_projection(
    problem: FitProblem,
    *,
    dampers: Sequence[Damper] = (),
    starts: int = 0,
    windows: Sequence[FitWindow] | None = None,
    with_errors: bool = True,
    settings: FitSettings = DEFAULT_SETTINGS,
    on_progress: Progress = silent,
) -> SearchResult:
    """Return the fit with the smallest cost from given dampers and random starts.

    The cost is never above the cost of a given damper. An interrupt (Ctrl-C) keeps the best parameters so
    far.

    Parameters
    ----------
    problem : the runs, the model and the bounds
    dampers : parameter sets to start from
    starts : number of random starts, each with several points of a Latin hypercube; the points are always the
        same, so that a fit does not depend on a seed
    windows : windows to fit; None: all runs
    with_errors : compute standard errors and correlations
    on_progress : receives a ``SearchState`` after every accepted step

    Raises
    ------
    ConvergenceError
        If no start has a finite cost.
    """
    clock = time.process_time()
    windows = problem.windows() if windows is None else tuple(windows)
    objective = Objective(problem, windows)
    starting_dampers, cancelled = list(dampers), False
    try:
        screening = problem.windows(settings.screening_samples_max) if starts else ()
        for index in range(starts):
            starting_dampers += random_start(problem, index, settings, screening)
    except KeyboardInterrupt:
        if not starting_dampers:
            raise
        settings, cancelled = replace(settings, start_count=1, iterations_max=1), True
    search = _Search(objective, settings, on_progress)
    try:
        search.run(starting_dampers or [problem.template])
    except KeyboardInterrupt:
        if search.best is None:
            raise
        cancelled = True
    best = search.best
    if best is None or not np.isfinite(best.cost):
        raise ConvergenceError(
            place=problem.template.law.name,
            found="no start of the fit has a finite error",
            remedy="Check the runs (mrdamper check shows them) or other terms",
        )
    damper = canonical(make_feasible(problem, objective.damper_at(best.point, best.linear)))
    parameters, correlation = estimates_of(problem, windows, damper, with_errors=with_errors)
    return SearchResult(
        damper=damper,
        method="varpro",
        cost_percent=float(np.sqrt(best.cost)),
        estimates=parameters,
        correlation=correlation,
        starts=tuple(search.starts),
        history=tuple(search.history),
        seed=0,
        cpu_s=time.process_time() - clock,
        cancelled=cancelled,
        converged=best.converged and not cancelled,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A parameter set in search coordinates, its linear parameters and its cost [%^2]."""

    point: FloatArray
    linear: FloatArray
    cost: float
    converged: bool


class _Search:
    """The descents on all runs, their history and the best parameters so far."""

    def __init__(self, objective: Objective, settings: FitSettings, on_progress: Progress) -> None:
        self._objective, self._settings, self._on_progress = objective, settings, on_progress
        self.best: _State | None = None
        self.history: list[float] = []
        self.starts: list[Start] = []

    def run(self, dampers: Sequence[Damper]) -> None:
        """Descend from the best different dampers, then from the best of the ends until it converges."""
        settings = self._settings
        chosen = best_different(self._objective, dampers, settings.start_count, settings.same_cost_ratio)
        points, linear = self._objective.points_of(chosen)
        ends = []
        for index, (point, parameters) in enumerate(zip(points, linear, strict=True)):
            steps = settings.start_iterations_max if len(points) > 1 else settings.iterations_max
            descents = Descents(self._objective, point[None], parameters[None], most=steps)
            self._descend(descents, index, len(points))
            ends.append(descents)
        best = int(np.argmin([each.costs[0] for each in ends]))
        if len(ends) > 1 and not ends[best].converged[0]:
            ends[best].extend(settings.iterations_max)
            self._descend(ends[best], best, len(points))
        self.starts = [
            Start(k, float(np.sqrt(each.costs[0])), int(each.evaluations[0]), bool(each.converged[0]))
            for k, each in enumerate(ends)
        ]

    def _descend(self, descents: Descents, index: int, count: int) -> None:
        self._record(descents, index, count)
        while not descents.done[0]:
            if descents.advance()[0] or descents.done[0]:
                self._record(descents, index, count)

    def _record(self, descents: Descents, index: int, count: int) -> None:
        state = _State(
            descents.points[0].copy(),
            descents.linear[0].copy(),
            float(descents.costs[0]),
            bool(descents.converged[0]),
        )
        if self.best is None or state.cost <= self.best.cost:
            self.best = state
        percent, best_percent = float(np.sqrt(state.cost)), float(np.sqrt(self.best.cost))
        self.history.append(best_percent)
        iteration = int(descents.iterations[0])
        self._on_progress(SearchState("varpro", index, count, iteration, percent, best_percent).update)


def random_start(
    problem: FitProblem,
    index: int,
    settings: FitSettings,
    windows: Sequence[FitWindow],
    rough_above_percent: float = np.inf,
) -> list[Damper]:
    """Return the ends of descents on the screening windows from the best random points, best first.

    The index of a start selects its random points.
    """
    if not problem.nonlinear:
        return [problem.template]
    objective = Objective(problem, windows)
    points, linear, costs = _random_points(objective, index, settings)
    return _screened(objective, points, linear, costs, settings, rough_above_percent)


def thorough_starts(
    problem: FitProblem,
    dampers: Sequence[Damper],
    windows: Sequence[FitWindow],
    settings: FitSettings,
    pool: Pool = ONE_CORE,
) -> list[Damper]:
    """Return different local minima on some windows, best first.

    The search starts from given dampers and random points. It then perturbs the best minimum several times
    (basin hopping, Wales & Doye, J. Phys. Chem. A 101 (1997) 5111-5116). The random numbers are always the
    same, so that a fit does not depend on a seed.
    """
    objective, rng = Objective(problem, windows), np.random.default_rng(0)
    box = objective.box
    points, linear, costs = _random_points(objective, 0, settings)
    best = np.argsort(costs, kind="stable")[: settings.thorough_count]
    given, given_linear = objective.points_of(dampers)
    descents = Descents(
        objective,
        np.vstack([given, points[best]]),
        np.vstack([given_linear, linear[best]]),
        most=settings.thorough_iterations_max,
    )
    descents.run()
    kept = _different(descents.costs, settings.finalist_count, settings.same_cost_ratio)
    if not kept:
        raise ConvergenceError(place=problem.template.law.name, found="no descent has a finite error")
    finalists = Descents(
        objective, descents.points[kept], descents.linear[kept], most=settings.start_iterations_max
    )
    finalists.run()
    points, linear, costs = finalists.points, finalists.linear, finalists.costs
    width = np.where(box.log, 1.0, PERTURBATION_RANGE_RATIO * (box.high - box.low))

    def hop(start: tuple[FloatArray, FloatArray]) -> Descents:
        point = np.clip(start[0], box.low, box.high)[None]
        descents = Descents(objective, point, start[1][None], most=settings.hop_iterations_max)
        descents.run()
        return descents

    failures = 0
    while failures < settings.failed_hop_count_max:
        first = int(costs.argmin())
        moved = []
        for fraction, size in PERTURBATIONS:
            is_moved = rng.random(len(width)) < fraction
            change = is_moved * size * rng.standard_normal(len(width)) * width
            moved.append((points[first] + change, linear[first]))
        hops = list(pool.map(hop, moved, threads=True))
        points = np.vstack([points, *(each.points for each in hops)])
        linear = np.vstack([linear, *(each.linear for each in hops)])
        before = costs.min()
        costs = np.concatenate([costs, *(each.costs for each in hops)])
        failures = 0 if costs.min() < (1.0 - settings.same_cost_ratio) * before else failures + 1
    kept = _different(costs, settings.start_count, settings.same_cost_ratio)
    return [objective.damper_at(points[k], linear[k]) for k in kept]


def _random_points(
    objective: Objective, index: int, settings: FitSettings
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points of a Latin hypercube, their best linear parameters and their costs [%^2]."""
    problem = objective.problem
    size = max(len(problem.nonlinear), 2)
    count = min(settings.draw_count_max, settings.draws_per_parameter * size)
    if problem.template.law.kernel is None:
        count = PYTHON_LAW_DRAW_COUNT
    points = latin_hypercube(problem.nonlinear, count, index)
    linear = np.tile(objective.points_of([problem.template])[1], (count, 1))
    found = objective.eliminate(objective.box.to_physical(points), linear, tangents=False)
    return points, found.linear, found.cost


def screened_starts(
    problem: FitProblem, dampers: Sequence[Damper], windows: Sequence[FitWindow], settings: FitSettings
) -> tuple[list[Damper], list[float]]:
    """Return the ends of descents on the screening windows from given dampers, best first, and errors [%]."""
    objective = Objective(problem, windows)
    points, linear = objective.points_of(dampers)
    found = objective.eliminate(Box.of(problem).to_physical(points), linear, tangents=False)
    ends = _screened(objective, points, found.linear, found.cost, settings)
    return ends, [float(np.sqrt(cost)) for cost in objective.costs_of(ends)]


def _screened(
    objective: Objective,
    points: FloatArray,
    linear: FloatArray,
    costs: FloatArray,
    settings: FitSettings,
    rough_above_percent: float = np.inf,
) -> list[Damper]:
    """Return the different ends of descents from the points with the smallest costs, best first.

    A descent that ends at a bound goes on from the middle of the range of these parameters as well. A term
    without effect leaves its parameters at bounds, and can have an effect elsewhere.
    """
    box = Box.of(objective.problem)
    order = np.argsort(costs, kind="stable")
    order = order[: settings.screened_count]
    first = Descents(objective, points[order], linear[order], most=settings.screening_iterations_max)
    first.run()
    finalists = _different(first.costs, settings.finalist_count, settings.same_cost_ratio)
    if not finalists:
        raise ConvergenceError(
            place=objective.problem.template.law.name, found="no descent has a finite error"
        )
    points, linear = first.points[finalists], first.linear[finalists]
    if first.costs[finalists[0]] > rough_above_percent**2:
        return [objective.damper_at(points[0], linear[0])]
    at_bound = box.at_bound(points)
    freed = at_bound.any(axis=1)
    middle = np.where(at_bound, 0.5 * (box.low + box.high), points)
    points, linear = np.vstack([points, middle[freed]]), np.vstack([linear, linear[freed]])
    last = Descents(objective, points, linear, most=settings.finalist_iterations_max)
    last.run()
    kept = _different(last.costs, settings.finalist_count, settings.same_cost_ratio)
    return [objective.damper_at(last.points[k], last.linear[k]) for k in kept]


def _different(costs: FloatArray, count: int, ratio: float) -> list[int]:
    """Return the indices of the smallest finite costs that differ by more than a ratio, smallest first."""
    kept: list[int] = []
    for k in np.argsort(costs, kind="stable").tolist():
        if np.isfinite(costs[k]) and all(abs(costs[k] - costs[j]) > ratio * costs[j] for j in kept):
            kept.append(k)
        if len(kept) == count:
            break
    return kept


def best_different(objective: Objective, dampers: Sequence[Damper], count: int, ratio: float) -> list[Damper]:
    """Return the dampers with the smallest costs that differ by more than a ratio, smallest first."""
    if len(dampers) == 1:
        return list(dampers)
    kept = _different(objective.costs_of(dampers), count, ratio)
    return [dampers[k] for k in kept] or list(dampers[:1])


def latin_hypercube(free: Sequence[FreeParameter], count: int, seed: int) -> FloatArray:
    """Return ``count`` points in search coordinates, spread over the inner four fifths of the bounds."""
    rng = np.random.default_rng(seed)
    cell = rng.permuted(np.tile(np.arange(count), (len(free), 1)), axis=1).T
    unit = (cell + rng.random((count, len(free)))) / count
    low = np.array([float(f.to_search(f.lower)) for f in free])
    high = np.array([float(f.to_search(f.upper)) for f in free])
    return np.asarray(low + (0.1 + 0.8 * unit) * (high - low))
