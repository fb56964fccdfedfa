r"""Variable projection with Levenberg-Marquardt and several starts: the standard fit of a damper.

The force is linear in most parameters. Linear least squares, limited to the valid range of the law,
eliminates these parameters in every step. The search varies only the other parameters:

.. math:: \min_\theta \min_c | y - F(\\theta, c) |^2, \quad F \text{ affine in } c

The derivative of the reduced problem is Kaufman's approximation: the tangents of theta, projected onto the
orthogonal complement of the linear columns. A law without linear parameters uses the same algorithm without
elimination. ``objective`` contains the elimination, ``descent`` the steps, and this module the starts:

1. Compare random points (a Latin hypercube) on a few windows of the runs. Start short descents from the best
   points.
2. Compare the resulting dampers and all given dampers on all runs. Start descents with a few steps from the
   best dampers. If several dampers have nearly equal costs, use only one.
3. Continue the best descent until it converges.

Method: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432; Kaufman, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.identify.limits import make_feasible
from mrdamper.identify.problem import FitProblem, SearchResult, Start, canonical
from mrdamper.identify.search.descent import Descents
from mrdamper.identify.search.objective import Box, Objective
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent


@dataclass(frozen=True, slots=True)
class SearchState:
    """State of a parameter search after a step, reported as ``detail`` of a progress message."""

    method: str
    start: int
    starts: int
    iteration: int
    cost_percent: float
    best_percent: float

    @property
    def update(self) -> ProgressUpdate:
        """Progress message that describes this state of the search."""
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
    on_progress: Progress = silent,
) -> SearchResult:
    """Return the fit with the smallest cost, found by descents from given dampers and random starts.

    The cost is never larger than the cost of a given damper. After an interrupt (Ctrl-C) of a descent, the
    result has the best parameters so far. Raise ConvergenceError if no start has a finite cost.

    Parameters
    ----------
    starts : number of random starts, each with several points of a Latin hypercube
    windows : sections of runs to fit; None: all runs
    on_progress : receives a ``SearchState`` after every trial step
    """
    windows = problem.windows() if windows is None else tuple(windows)
    objective, starting_dampers = Objective(problem, windows), list(dampers)
    screening = problem.windows(problem.settings.screening_samples_max) if starts else ()
    for index in range(starts):
        starting_dampers += screened_starts(problem, random_dampers(problem, index), screening)
    ends: list[Descents] = []
    cancelled = False
    try:
        _descend(objective, starting_dampers or [problem.template], ends, on_progress)
    except KeyboardInterrupt:
        if not ends:
            raise
        cancelled = True
    best = min(ends, key=lambda end: end.costs[0])
    if not np.isfinite(best.costs[0]):
        raise ConvergenceError(
            place=problem.template.law.name,
            found="no start of the fit has a finite error",
            remedy="Check the runs (mrdamper check shows them) or other terms",
        )
    damper = canonical(make_feasible(problem, objective.damper_at(best.points[0], best.linear[0])))
    parameters, correlation = estimates_of(problem, windows, damper)
    return SearchResult(
        damper=damper,
        method="varpro",
        cost_percent=float(np.sqrt(best.costs[0])),
        estimates=parameters,
        correlation=correlation,
        starts=tuple(
            Start(k, float(np.sqrt(end.costs[0])), bool(end.converged[0])) for k, end in enumerate(ends)
        ),
        seed=0,
        cancelled=cancelled,
        converged=bool(best.converged[0]) and not cancelled,
    )


def _descend(
    objective: Objective, dampers: Sequence[Damper], ends: list[Descents], on_progress: Progress
) -> None:
    """Make short descents from the best dampers, then continue the best descent until it converges.

    Each descent is added to ``ends``, so that its result is available after an interrupt.
    """
    settings = objective.problem.settings
    chosen = best_different(objective, dampers, settings.start_count, settings.same_cost_ratio)
    steps_max = settings.start_iterations_max if len(chosen) > 1 else settings.iterations_max

    def run(index: int) -> None:
        descents = ends[index]
        while True:
            percent, best_percent = np.sqrt([descents.costs[0], min(end.costs[0] for end in ends)]).tolist()
            iteration = int(descents.iterations[0])
            state = SearchState("varpro", index, len(chosen), iteration, percent, best_percent)
            on_progress(state.update)
            if descents.done[0]:
                return
            descents.advance()

    for index, damper in enumerate(chosen):
        ends.append(Descents(objective, *objective.points_of([damper]), most=steps_max))
        run(index)
    best = int(np.argmin([end.costs[0] for end in ends]))
    if len(ends) > 1 and not ends[best].converged[0]:
        ends[best].extend(settings.iterations_max)
        run(best)


def thorough_starts(
    problem: FitProblem,
    dampers: Sequence[Damper],
    windows: Sequence[FitWindow],
    search_windows: Sequence[FitWindow],
) -> list[Damper]:
    """Search for local minima of the cost on ``windows``; return dampers at different minima, best first.

    The minima are searched on ``search_windows``, which can be a part of ``windows``. Descents on ``windows``
    then start from the best minima.

    The search begins with descents from given dampers and random points. Rounds of further descents follow.
    In each round, several descents start from the best minimum with some coefficients replaced by values from
    a different minimum (memetic algorithm, Moscato & Cotta, Handbook of Metaheuristics (2003) 105-144). For
    example, the different minimum can have the right free play, but a wrong friction. One more descent starts
    from a random perturbation of the best minimum (basin hopping, Wales & Doye, J. Phys. Chem. A 101 (1997)
    5111-5116). The random numbers are always the same, so that a fit does not depend on a seed.
    """
    objective, rng = Objective(problem, search_windows), np.random.default_rng(0)
    box, settings = objective.box, problem.settings
    dampers = [*dampers, *best_different(objective, random_dampers(problem, 0), settings.thorough_count)]
    points, linear = objective.points_of(dampers)
    points, linear, costs = _ends(objective, points, linear, settings.thorough_iterations_max, len(dampers))
    width = np.where(box.log, 1.0, NUMERICS.perturbation_range_ratio * (box.high - box.low))
    coefficients = [free.name.partition(".")[0] for free in problem.nonlinear]
    names = list(dict.fromkeys(coefficients))
    number = np.array([names.index(name) for name in coefficients], dtype=np.intp)

    failures = 0
    while failures < settings.failed_hop_count_max:
        first = int(costs.argmin())
        hops = []
        others = np.flatnonzero(costs > (1.0 + settings.same_cost_ratio) * costs[first])
        for fraction in NUMERICS.exchanged_fractions if len(others) else ():
            is_exchanged = (rng.random(len(names)) < fraction)[number]
            hops.append(np.where(is_exchanged, points[rng.choice(others)], points[first]))
        fraction, size = NUMERICS.perturbations[rng.integers(len(NUMERICS.perturbations))]
        change = (rng.random(len(width)) < fraction) * size * rng.standard_normal(len(width)) * width
        hops.append(points[first] + change)
        moved, values = np.clip(hops, box.low, box.high), np.tile(linear[first], (len(hops), 1))
        descents = Descents(objective, moved, values, most=settings.hop_iterations_max)
        descents.run()
        points = np.vstack([points, descents.points])
        linear = np.vstack([linear, descents.linear])
        before = costs.min()
        costs = np.concatenate([costs, descents.costs])
        failures = 0 if costs.min() < (1.0 - settings.same_cost_ratio) * before else failures + 1
    kept = _different(costs, settings.minimum_count, settings.same_cost_ratio)
    objective, count = Objective(problem, windows), settings.start_count
    points, linear, _ = _ends(objective, points[kept], linear[kept], settings.thorough_iterations_max, count)
    return [objective.damper_at(*end) for end in zip(points, linear, strict=True)]


def random_dampers(problem: FitProblem, seed: int) -> list[Damper]:
    """Return template dampers with random nonlinear parameters.

    The parameters are a Latin hypercube of search coordinates over the middle 80 % of the range of each one.
    """
    settings, size = problem.settings, len(problem.nonlinear)
    count = min(settings.draw_count_max, settings.draws_per_parameter * max(size, 2))
    if problem.template.law.kernel is None:
        count = NUMERICS.python_law_draw_count
    rng = np.random.default_rng(seed)
    cell = rng.permuted(np.tile(np.arange(count), (size, 1)), axis=1).T
    unit = (cell + rng.random((count, size))) / count
    box = Box.from_parameters(problem.nonlinear)
    values = box.to_physical(box.low + (0.1 + 0.8 * unit) * (box.high - box.low))
    names = [free.name for free in problem.nonlinear]
    return [problem.template.with_parameters(dict(zip(names, row, strict=True))) for row in values.tolist()]


def screened_starts(
    problem: FitProblem, dampers: Sequence[Damper], windows: Sequence[FitWindow]
) -> list[Damper]:
    """Descend from the dampers with the smallest costs; return the resulting dampers, best first."""
    return continued_starts(problem, first_starts(problem, dampers, windows), windows)


def first_starts(
    problem: FitProblem, dampers: Sequence[Damper], windows: Sequence[FitWindow]
) -> list[Damper]:
    """Make short descents from the best dampers; return the resulting dampers, best first."""
    objective, settings = Objective(problem, windows), problem.settings
    points, linear = objective.points_of(dampers)
    found = objective.eliminate(objective.box.to_physical(points), linear, tangents=False)
    order = np.argsort(found.cost, kind="stable")[: settings.screened_count]
    points, linear, count = points[order], found.linear[order], settings.finalist_count
    points, linear, _ = _ends(objective, points, linear, settings.screening_iterations_max, count)
    return [objective.damper_at(*end) for end in zip(points, linear, strict=True)]


def continued_starts(
    problem: FitProblem, dampers: Sequence[Damper], windows: Sequence[FitWindow]
) -> list[Damper]:
    """Continue the descents from the results of ``first_starts``; return the resulting dampers, best first.

    If parameters of a damper are at bounds, a further descent starts with these parameters in the middle of
    their ranges. The reason is that parameters of a term without effect stay at bounds, although the term
    could improve the fit with other values.
    """
    objective, settings = Objective(problem, windows), problem.settings
    box = objective.box
    points, linear = objective.points_of(dampers)
    at_bound = (points <= box.low) | (points >= box.high)
    freed = at_bound.any(axis=1)
    middle = np.where(at_bound, 0.5 * (box.low + box.high), points)
    points, linear = np.vstack([points, middle[freed]]), np.vstack([linear, linear[freed]])
    count = settings.finalist_count
    points, linear, _ = _ends(objective, points, linear, settings.finalist_iterations_max, count)
    return [objective.damper_at(*end) for end in zip(points, linear, strict=True)]


def _ends(
    objective: Objective, points: FloatArray, linear: FloatArray, iterations_max: int, count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run descents; return final points, linear parameters and costs [%^2], best first.

    At most ``count`` results are returned. If several results have nearly equal costs, one is returned.
    """
    descents = Descents(objective, points, linear, most=iterations_max)
    descents.run()
    kept = _different(descents.costs, count, objective.problem.settings.same_cost_ratio)
    if not kept:
        law = objective.problem.template.law.name
        raise ConvergenceError(place=law, found="no descent has a finite error")
    return descents.points[kept], descents.linear[kept], descents.costs[kept]


def descend(
    objective: Objective,
    dampers: Sequence[Damper],
    iterations: int,
    round_count_max: int = 1,
    round_gain_min: float = 0.0,
) -> tuple[Damper, float]:
    """Descend from several dampers; return the best resulting damper and its error [%].

    The first round has ``iterations`` steps. A further round, without the descents with large costs, follows
    if the last round has decreased the smallest error by at least the fraction ``round_gain_min``.
    """
    problem = objective.problem
    descents = Descents(objective, *objective.points_of(dampers), most=iterations)
    descents.run()
    for count in range(2, round_count_max + 1):
        before = descents.costs.min()
        descents.extend(count * iterations, cost_max=NUMERICS.round_cost_ratio_max * before)
        descents.run()
        if not descents.costs.min() <= (1.0 - round_gain_min) ** 2 * before:
            break
    costs = descents.costs
    best = int(costs.argmin())
    if not np.isfinite(costs[best]):
        raise ConvergenceError(place=problem.template.law.name, found="no descent has a finite error")
    found = objective.damper_at(descents.points[best], descents.linear[best])
    return make_feasible(problem, found), float(np.sqrt(costs[best]))


def _different(costs: FloatArray, count: int, ratio: float) -> list[int]:
    """Return indices of at most ``count`` finite costs, smallest cost first.

    An index is omitted if the relative difference from a smaller selected cost is at most ``ratio``.
    """
    kept: list[int] = []
    for k in np.argsort(costs, kind="stable").tolist():
        if np.isfinite(costs[k]) and all(abs(costs[k] - costs[j]) > ratio * costs[j] for j in kept):
            kept.append(k)
        if len(kept) == count:
            break
    return kept


def best_different(
    objective: Objective, dampers: Sequence[Damper], count: int = 1, ratio: float = 0.0
) -> list[Damper]:
    """Return at most ``count`` dampers with the smallest costs, best first.

    A damper is omitted if the relative difference from the cost of a better damper is at most ``ratio``.
    """
    if len(dampers) == 1:
        return list(dampers)
    kept = _different(objective.costs_of(dampers), count, ratio)
    return [dampers[k] for k in kept] or list(dampers[:1])
