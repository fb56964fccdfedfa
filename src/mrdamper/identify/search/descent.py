"""Levenberg-Marquardt descents, many side by side: each has its own damping, all share their evaluations.

A trial carries the linear parameters that the last step predicts for it; what is left to eliminate is of
second order in the step, and so one pass of the kernel gives the cost and the next Gauss-Newton matrix.
Where the prediction was too far off, the pass is repeated at what was found; so it is before a step that
fails is held to be too long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.objective import Eliminated, Objective, solve_scaled

_LONGEST = 1.5  # longest step of a search coordinate per iteration, in e-folds on a log scale
_MOST_DRIFT = (
    0.03  # share of the force by which guessed linear parameters may be off for the tangents to hold
)
_EXACT = 1e-4  # the same, for a step that fails to be the fault of its length and not of the tangents


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """The search coordinates of a problem's nonlinear parameters: logarithms where the scale is one."""

    low: FloatArray
    high: FloatArray
    log: BoolArray

    @classmethod
    def of(cls, problem: FitProblem) -> Box:
        free = problem.nonlinear
        return cls(
            np.array([float(f.to_search(f.lower)) for f in free]),
            np.array([float(f.to_search(f.upper)) for f in free]),
            np.array([f.scale == "log" for f in free], dtype=np.bool_),
        )

    def to_physical(self, points: FloatArray) -> FloatArray:
        """Return the values at points, shape (.., parameters)."""
        return np.exp(points, where=self.log, out=points.copy())

    def to_search(self, values: FloatArray) -> FloatArray:
        """Return the points of values, brought inside the box."""
        points = np.log(np.maximum(values, 1e-300), where=self.log, out=values.copy())
        return np.clip(points, self.low, self.high)

    def at_bound(self, points: FloatArray) -> BoolArray:
        """Say which coordinates sit on a bound."""
        return np.asarray((points <= self.low) | (points >= self.high))


class Descents:
    """Descents from many points, which ``advance`` moves by one trial each.

    ``iterations`` counts accepted steps, ``evaluations`` passes; a descent is ``done`` when it has
    converged or has made ``most`` steps. The first axis of every array counts descents.
    """

    def __init__(
        self,
        objective: Objective,
        points: FloatArray,
        linear: FloatArray,
        session_offsets: FloatArray,
        *,
        most: int,
    ) -> None:
        self._objective = objective
        self._box = Box.of(objective.problem)
        self._most = most
        self._longest = np.where(self._box.log, _LONGEST, 0.3 * (self._box.high - self._box.low))
        count, size = points.shape
        self.points = points.copy()
        self.evaluations = np.ones(count, dtype=np.intp)
        self.iterations = np.zeros(count, dtype=np.intp)
        self.converged = np.full(count, size == 0)
        self.done = self.converged.copy()
        self._damping = np.full(count, 1e-2)
        self._growth = np.full(count, 2.0)
        self._quiet = np.zeros(count, dtype=np.intp)
        self._rough = np.zeros(count, dtype=np.bool_)
        found = objective.eliminate(self._box.to_physical(points), linear, session_offsets)
        self.costs, self.linear, self.session_offsets = found.cost, found.linear, found.session_offsets
        self._slopes = np.ones((count, size))
        self.hessians = np.empty((count, size, size))
        self._gradients = np.empty((count, size))
        self._follow = np.empty((count, linear.shape[1] + session_offsets.shape[1], size))
        self._renew(np.arange(count), found)

    def advance(self) -> BoolArray:
        """Try one step of every descent that is not done; return which were accepted."""
        accepted = np.zeros(len(self.done), dtype=np.bool_)
        k = np.flatnonzero(~self.done)
        points, costs, hessian, gradient = self.points[k], self.costs[k], self.hessians[k], self._gradients[k]
        step = _damped_steps(hessian, gradient, self._inside(points, gradient), self._damping[k])
        step *= np.minimum(1.0, np.min(self._longest / np.maximum(np.abs(step), 1e-300), axis=1))[:, None]
        trial = np.clip(points + step, self._box.low, self._box.high)
        step = trial - points
        promised = np.sum(step * (2.0 * gradient - np.einsum("bij,bj->bi", hessian, step)), axis=1)
        still = ~step.any(axis=1) | ((promised >= 0.0) & (promised <= 1e-9 * costs)) | ~np.isfinite(promised)
        self._fail(k[still], self._finish)
        uphill = ~still & (promised < 0.0)  # a bound bent the step
        self._fail(k[uphill], self._stiffen)
        go = ~still & ~uphill
        if not go.any():
            return accepted
        k, trial, step, promised = k[go], trial[go], step[go], promised[go]
        shift = np.einsum("bij,bj->bi", self._follow[k], self._slopes[k] * step)
        split = self.linear.shape[1]
        found = self._objective.eliminate(
            self._box.to_physical(trial),
            self.linear[k] + shift[:, :split],
            self.session_offsets[k] + shift[:, split:],
        )
        self.evaluations[k] += 1
        better = found.cost < self.costs[k]  # false where it is not a number
        self._fail(k[~better], self._stiffen)
        if better.any():
            accepted[k[better]] = True
            self._accept(k[better], trial[better], promised[better], _chosen(found, better))
        return accepted

    def run(self) -> None:
        """Go on until all are done."""
        while not self.done.all():
            self.advance()

    def go_on(self, more: int) -> None:
        """Let those that have made their steps, but not converged, make so many more."""
        self._most += more
        self.done = self.converged.copy()
        self.run()

    def _accept(
        self, k: NDArray[np.intp], trial: FloatArray, promised: FloatArray, found: Eliminated
    ) -> None:
        gained = self.costs[k] - found.cost
        self._damping[k] *= np.maximum(0.1, 1.0 - (2.0 * gained / promised - 1.0) ** 3)
        self._growth[k] = 2.0
        self._quiet[k] = np.where(gained < 1e-6 * self.costs[k], self._quiet[k] + 1, 0)
        self.iterations[k] += 1
        self.points[k], self.costs[k] = trial, found.cost
        self.linear[k], self.session_offsets[k] = found.linear, found.session_offsets
        self.converged[k] = self._quiet[k] >= 2
        self.done[k] = self.converged[k] | (self.iterations[k] >= self._most)
        self._renew(k, found)

    def _renew(self, k: NDArray[np.intp], found: Eliminated) -> None:
        """Take up the Gram matrices of accepted points."""
        assert found.gram is not None
        self._slopes[k] = np.where(self._box.log, self._box.to_physical(self.points[k]), 1.0)
        self._rough[k] = found.drift > _EXACT
        off = (found.drift > _MOST_DRIFT) & ~self.done[k]
        self._take(k[~off], found.gram[~off])
        self._refine(k[off])

    def _refine(self, k: NDArray[np.intp]) -> None:
        """Work out the tangents again, at the linear parameters that were found."""
        if len(k):
            values = self._box.to_physical(self.points[k])
            self._take(k, self._objective.sums(values, self.linear[k], self.session_offsets[k]))
            self.evaluations[k] += 1
            self._rough[k] = False

    def _take(self, k: NDArray[np.intp], gram: FloatArray) -> None:
        hessian, gradient, follow = self._objective.projected(gram, self.linear[k])
        slopes = self._slopes[k]
        self.hessians[k] = hessian * (slopes[:, :, None] * slopes[:, None, :])
        self._gradients[k] = gradient * slopes
        self._follow[k] = follow

    def _inside(self, points: FloatArray, gradient: FloatArray) -> BoolArray:
        """Say which coordinates are free to move: not those that a bound stops."""
        below = (points <= self._box.low) & (gradient < 0.0)
        above = (points >= self._box.high) & (gradient > 0.0)
        return np.asarray(~(below | above))

    def _fail(self, k: NDArray[np.intp], give_up: Callable[[NDArray[np.intp]], None]) -> None:
        """Blame the tangents of steps that failed where those are rough, and the steps elsewhere."""
        rough = self._rough[k]
        self._refine(k[rough])
        give_up(k[~rough])

    def _stiffen(self, k: NDArray[np.intp]) -> None:
        """Ask for shorter steps after one that did not help."""
        self._damping[k] *= self._growth[k]
        self._growth[k] *= 2.0
        self._finish(k[self._damping[k] >= 1e12])

    def _finish(self, k: NDArray[np.intp]) -> None:
        self.converged[k] = True
        self.done[k] = True


def _chosen(found: Eliminated, which: BoolArray) -> Eliminated:
    gram = None if found.gram is None else found.gram[which]
    return Eliminated(
        found.cost[which], found.linear[which], found.session_offsets[which], gram, found.drift[which]
    )


def _damped_steps(
    hessian: FloatArray, gradient: FloatArray, inside: BoolArray, damping: FloatArray
) -> FloatArray:
    """Return the Marquardt steps of the coordinates that are free to move."""
    h = np.where(inside[:, :, None] & inside[:, None, :], hessian, 0.0)
    scale = np.diagonal(hessian, axis1=1, axis2=2)
    scale = np.where(scale > 0.0, scale, 1e-300)
    places = np.arange(h.shape[1])
    h[:, places, places] += damping[:, None] * scale + 1e-14 * scale.max(axis=1, keepdims=True)
    return solve_scaled(h, np.where(inside, gradient, 0.0)[..., None])[..., 0]
