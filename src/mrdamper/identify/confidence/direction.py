"""The worst direction: the combination of parameters that a fit knows least, from the curvature at the fit.

Sizes: a change is measured in a parameter's own value, or in the width of its bounds where the parameter is
searched on a linear scale through zero (a relative change of something near zero says nothing). What the
direction means in words is the business of ``identifiability``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.problem import FitProblem, FitResult, FreeParameter, PreparedFit
from mrdamper.identify.search.variable_projection import Objective, fit_variable_projection
from mrdamper.identify.uncertainty import covariances
from mrdamper.models.damper import Damper

_NOTHING = 1e-12  # least eigenvalue of the curvature at unit diagonal: below it there is only rounding
_NAMED = 0.25  # of the heaviest weight: from there on a parameter is named in the sentence
_MOST_NAMED = 4
_HALVINGS = 12  # of a step along a curved valley, until the fit really does not notice


@dataclass(frozen=True, slots=True)
class Direction:
    """The combination of parameters that a fit knows least.

    ``changes`` are what follows when its heaviest parameter goes along it by one standard error (less where a
    bound or a bend comes before) and the others are refitted; they take the error of the fit from
    ``cost_percent`` to ``moved_percent``.
    """

    names: tuple[str, ...]  # every parameter that moved in the fit, the heaviest first
    weights: tuple[float, ...]  # in units of ``scales``; their squares add up to one, the first is positive
    scales: tuple[float, ...]  # |value|, or width of the bounds [its unit]
    relative: tuple[bool, ...]  # whether the scale is the value
    units: tuple[str, ...]
    changes: tuple[float, ...]  # [its unit]
    standard_error_percent: float  # of the combination; infinite: the data say nothing about it
    condition: float  # greatest over least eigenvalue of the scaled curvature
    others_follow: bool  # whether the fit would notice if the parameters that are not named stayed
    cost_percent: float
    moved_percent: float

    @property
    def named(self) -> tuple[str, ...]:
        """The parameters that make up most of the direction, at most four."""
        return tuple(n for n, h in zip(self.names, _heavy(np.array(self.weights)), strict=True) if h)


def worst_direction(problem: FitProblem, result: FitResult) -> Direction:
    """Return the direction of least curvature among the parameters that do not rest on a bound.

    Session offsets move along freely. The standard error is the larger of the one for independent
    residuals and of the sandwich over half cycles. One refit shows what a step along it really does.

    Raises
    ------
    InputError
        When no parameter moved.
    """
    moving = [(free, e) for free, e in zip(problem.free, result.estimates, strict=True) if not e.at_bound]
    if not moving:
        raise InputError(
            "every parameter of the fit rests on a bound", expected="one that is free to look along"
        )
    runs = problem.prepare()
    objective = Objective(problem, runs)
    names = tuple(free.name for free, _ in moving)
    scale, relative = map(np.array, zip(*(_scale(free, e.value) for free, e in moving), strict=True))
    curvature, held, cost = _curvature(objective, result, names)

    size = np.sqrt(np.maximum(np.diag(curvature), 0.0))
    size[size == 0.0] = 1.0
    eigenvalue, vector = np.linalg.eigh(curvature / np.outer(size, size))
    shape = 1.0 / (size * scale)
    greatest = float(np.linalg.eigvalsh(curvature * np.outer(scale, scale))[-1])
    if eigenvalue[0] < _NOTHING:
        weight = vector[:, 0] * shape
        weight /= np.linalg.norm(weight)
        error, condition = math.inf, math.inf
        noise = cost / half_cycles(runs)
    else:
        # The inverse, at its large end: there rounding does not reach the small eigenvalues of the curvature.
        inverse = (vector / eigenvalue) @ vector.T * np.outer(shape, shape)
        softness, vectors = np.linalg.eigh(inverse)
        weight = vectors[:, -1]
        along = weight / scale
        spreads = [along @ c @ along for c in covariances(runs, result.damper, names, result.offsets_N)]
        # Where session offsets follow, the error grows as the curvature shrinks.
        share = float(softness[-1]) / float(along @ np.linalg.lstsq(held, along)[0])
        error = math.sqrt(max(spreads) * (share if objective.sessions else 1.0))
        condition = float(softness[-1]) * greatest
        noise = error**2 / float(softness[-1])
    order = np.argsort(-np.abs(weight), kind="stable")
    weight *= math.copysign(1.0, weight[order[0]])
    one = error if math.isfinite(error) else 1.0
    alone = np.where(_heavy(weight), weight, 0.0) * scale * one
    start = np.array([e.value for _, e in moving])
    heaviest = int(order[0])
    step = one * float(weight[heaviest] * scale[heaviest])
    moved, after = _walk(problem, result, runs, names[heaviest], step, 2.0 * noise)
    changes = np.array([moved[name] for name in names]) - start
    pick = order.tolist()
    return Direction(
        names=tuple(names[i] for i in pick),
        weights=tuple(weight[order].tolist()),
        scales=tuple(scale[order].tolist()),
        relative=tuple(relative[order].tolist()),
        units=tuple(moving[i][1].unit for i in pick),
        changes=tuple(changes[order].tolist()),
        standard_error_percent=100.0 * error,
        condition=condition,
        others_follow=bool(alone @ curvature @ alone > 2.0 * noise),
        cost_percent=math.sqrt(cost),
        moved_percent=math.sqrt(after),
    )


def fit_held(
    problem: FitProblem,
    damper: Damper,
    free: FreeParameter,
    value: float,
    runs: Sequence[PreparedFit],
    *,
    first: Damper,
) -> FitResult:
    """Return the fit, without errors, of all parameters but one, that one held at a value.

    What does not move is ``damper``'s.

    Raises
    ------
    ConvergenceError, InputError
        There is no fit with that value.
    """
    held = replace(
        problem,
        template=damper.with_parameters({free.name: value}),
        free=tuple(other for other in problem.free if other.name != free.name),
    )
    return fit_variable_projection(held, starts=0, first=first, prepared=runs, with_errors=False)


def half_cycles(runs: Sequence[PreparedFit]) -> int:
    """Return the number of blocks between reversals that are scored, as ``covariances`` counts them."""
    return sum(1 + sum(first > run.start for first, _, _ in run.drive.record.pieces) for run in runs)


def _scale(free: FreeParameter, value: float) -> tuple[float, bool]:
    """Return the unit in which a parameter's change is measured, and whether it is the parameter's value."""
    through_zero = free.scale == "linear" and free.lower < 0.0 < free.upper
    least = 1e-5 * (free.upper - free.lower) if free.scale == "linear" else 0.0
    if abs(value) > least and not through_zero:
        return abs(value), True
    return free.upper - free.lower, False


def _heavy(weights: FloatArray) -> NDArray[np.bool_]:
    """Return which weights are heavy enough to be named, at most four."""
    size = np.abs(weights)
    fourth = np.sort(size)[-min(_MOST_NAMED, len(size))]
    return np.asarray(size >= max(_NAMED * size.max(), fourth))


def _curvature(
    objective: Objective, result: FitResult, names: Sequence[str]
) -> tuple[FloatArray, FloatArray, float]:
    """Return the Gauss-Newton matrix with session offsets moving along, that with them held, and the cost."""
    g = objective.gram(result.damper, names, result.offsets_N)
    n = len(names)
    held, cross, offsets = g[:n, :n], g[:n, n:-1], g[n:-1, n:-1]
    following = held - cross @ np.linalg.solve(offsets, cross.T) if offsets.size else held
    return 0.5 * (following + following.T), held, float(g[-1, -1])


def _walk(
    problem: FitProblem,
    result: FitResult,
    runs: Sequence[PreparedFit],
    name: str,
    step: float,
    allowed: float,
) -> tuple[dict[str, float], float]:
    """Return where a step of one parameter leads when the others are refitted, and the squared cost there.

    The step is halved until it keeps to the bounds and raises the cost by no more than ``allowed``.
    """
    free = next(free for free in problem.free if free.name == name)
    start = {e.name: e.value for e in result.estimates}
    for _ in range(_HALVINGS):
        value = _moved(free, start[name], step)
        if free.lower <= value <= free.upper:
            try:
                fit = fit_held(problem, result.damper, free, value, runs, first=result.damper)
            except (ConvergenceError, InputError):  # too far
                fit = None
            if fit is not None and fit.cost_percent**2 <= result.cost_percent**2 + allowed:
                return {name: value, **{e.name: e.value for e in fit.estimates}}, fit.cost_percent**2
        step *= 0.5
    return start, result.cost_percent**2


def _moved(free: FreeParameter, value: float, change: float) -> float:
    """Return a parameter after a change, in the coordinate in which it is searched."""
    if free.scale == "log":
        return value * math.exp(min(change / abs(value), 500.0))
    return value + change
