"""Parallel Levenberg-Marquardt descents with bounds; one kernel call evaluates the trials of all descents.

Each descent has a separate damping parameter. Each step solves the damped normal equations with bounds on
every coordinate: the bounds of the search and a maximum step. A coordinate that reaches a bound is fixed
there, and the equations are solved again for the other coordinates.

The linear parameters of a trial are predicted by linear extrapolation from the last accepted point. The error
of the predicted values is of second order in the step. Therefore one kernel call with the predicted values is
sufficient for the cost and the next Gauss-Newton matrix. If the prediction was too inaccurate, the call is
repeated with the best linear parameters. After a failed step, the call is also repeated before the step is
shortened.

Method: Marquardt, J. SIAM 11 (1963) 431-441; update of the damping: Nielsen, report IMM-REP-1999-05 (1999).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.identify.search.objective import Eliminated, Objective, solve_scaled
from mrdamper.identify.settings import NUMERICS


class Descents:
    """Several Levenberg-Marquardt descents. ``advance`` makes one trial step of each descent.

    Parameters
    ----------
    points : search coordinates of the starting points, shape (descents, nonlinear)
    linear : start values of the linear parameters, shape (descents, linear)
    most : max number of accepted steps of a descent

    Attributes
    ----------
    points, linear, costs, hessians : state of each descent; costs in %^2
    iterations : number of accepted steps
    converged : True for each descent that has converged
    done : True for each descent that has ended, with or without convergence
    """

    def __init__(self, objective: Objective, points: FloatArray, linear: FloatArray, *, most: int) -> None:
        self._objective = objective
        self._box = objective.box
        self._most = most
        width = self._box.high - self._box.low
        longest = NUMERICS.step_range_ratio_max * width
        self._step_max = np.where(self._box.log, NUMERICS.step_max_e_folds, longest)
        count, size = points.shape
        self.points = points.copy()
        self.iterations = np.zeros(count, dtype=np.intp)
        self.converged = np.full(count, size == 0)
        self.done = self.converged.copy()
        self._damping = np.full(count, NUMERICS.damping_start)
        self._growth = np.full(count, 2.0)
        self._last_costs = np.full((NUMERICS.gain_step_count, count), np.inf)
        self._is_rough = np.zeros(count, dtype=np.bool_)
        found = objective.eliminate(self._box.to_physical(points), linear)
        self.costs, self.linear = found.cost, found.linear
        self._slopes = np.ones((count, size))
        self.hessians = np.empty((count, size, size))
        self._gradients = np.empty((count, size))
        self._follow = np.empty((count, linear.shape[1], size))
        self._update_model(np.arange(count), found)

    def run(self) -> None:
        """Advance until all descents are done."""
        while not self.done.all():
            self.advance()

    def extend(self, most: int, cost_max: float = np.inf) -> None:
        """Continue the descents that have not converged, up to a total of ``most`` steps each.

        Descents with a cost [%^2] above ``cost_max`` are not continued.
        """
        self._most = most
        self.done = self.converged | (self.costs > cost_max)

    def advance(self) -> None:
        """Make one trial step of every unfinished descent."""
        k = np.flatnonzero(~self.done)
        step, gain = self._steps(k)
        is_useless = ~step.any(axis=1) | ~np.isfinite(gain)
        is_useless |= (gain >= 0.0) & (gain <= NUMERICS.predicted_gain_min * self.costs[k])
        # The predicted gain is negative if clipping at a bound has turned the step uphill.
        is_downhill = ~is_useless & (gain > 0.0)
        self._fail(k[is_useless], self._finish)
        self._fail(k[~is_useless & ~is_downhill], self._shorten)
        k, step, gain = k[is_downhill], step[is_downhill], gain[is_downhill]
        if not len(k):
            return
        points = np.clip(self.points[k] + step, self._box.low, self._box.high)
        change = np.einsum("bij,bj->bi", self._follow[k], self._slopes[k] * step)
        found = self._objective.eliminate(self._box.to_physical(points), self.linear[k] + change)
        is_better = found.cost < self.costs[k]  # False if the cost is NaN
        self._fail(k[~is_better], self._shorten)
        arrays = found.cost, found.linear, found.gram, found.drift
        better = Eliminated(*(values[is_better] for values in arrays))
        self._accept(k[is_better], points[is_better], gain[is_better], better)

    def _steps(self, k: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Return the next steps of the descents ``k``, and the expected decrease of the cost in each step."""
        points, hessian, gradient = self.points[k], self.hessians[k], self._gradients[k]
        low = np.minimum(np.maximum(self._box.low - points, -self._step_max), 0.0)
        high = np.maximum(np.minimum(self._box.high - points, self._step_max), 0.0)
        # A coordinate at a bound is fixed if its descent direction points outwards.
        free = ~((points <= self._box.low) & (gradient < 0.0) | (points >= self._box.high) & (gradient > 0.0))
        step = _steps_in_box(hessian, gradient, free, self._damping[k], low, high)
        step = np.clip(points + step, self._box.low, self._box.high) - points
        gain = np.sum(step * (2.0 * gradient - np.einsum("bij,bj->bi", hessian, step)), axis=1)
        return step, gain

    def _accept(
        self, k: NDArray[np.intp], points: FloatArray, predicted_gain: FloatArray, found: Eliminated
    ) -> None:
        gain = self.costs[k] - found.cost
        self._damping[k] *= np.maximum(0.1, 1.0 - (2.0 * gain / predicted_gain - 1.0) ** 3)
        self._growth[k] = 2.0
        index = self.iterations[k] % NUMERICS.gain_step_count
        before = self._last_costs[index, k]
        self._last_costs[index, k] = self.costs[k]
        self.iterations[k] += 1
        self.points[k], self.costs[k], self.linear[k] = points, found.cost, found.linear
        self.converged[k] = before - found.cost < NUMERICS.gain_min * found.cost
        self.done[k] = self.converged[k] | (self.iterations[k] >= self._most)
        self._update_model(k, found)

    def _update_model(self, k: NDArray[np.intp], found: Eliminated) -> None:
        self._slopes[k] = np.where(self._box.log, self._box.to_physical(self.points[k]), 1.0)
        self._is_rough[k] = found.drift > NUMERICS.failed_drift_max
        is_inaccurate = (found.drift > NUMERICS.drift_max) & ~self.done[k]
        self._set_model(k[~is_inaccurate], found.gram[~is_inaccurate])
        self._refine(k[is_inaccurate])

    def _refine(self, k: NDArray[np.intp]) -> None:
        """Recompute the force derivatives with the best linear parameters of the last evaluation."""
        if len(k):
            values = self._box.to_physical(self.points[k])
            self._set_model(k, self._objective.sums(values, self.linear[k]))
            self._is_rough[k] = False

    def _set_model(self, k: NDArray[np.intp], gram: FloatArray) -> None:
        hessian, gradient, follow = self._objective.projected(gram, self.linear[k])
        slopes = self._slopes[k]
        self.hessians[k] = hessian * (slopes[:, :, None] * slopes[:, None, :])
        self._gradients[k] = gradient * slopes
        self._follow[k] = follow

    def _fail(self, k: NDArray[np.intp], give_up: Callable[[NDArray[np.intp]], None]) -> None:
        """After failed steps, recompute inaccurate force derivatives; call ``give_up`` if they are accurate.

        ``give_up`` shortens the step or ends the descent.
        """
        is_rough = self._is_rough[k]
        self._refine(k[is_rough])
        give_up(k[~is_rough])

    def _shorten(self, k: NDArray[np.intp]) -> None:
        self._damping[k] *= self._growth[k]
        self._growth[k] *= 2.0
        self._finish(k[self._damping[k] >= NUMERICS.damping_max])

    def _finish(self, k: NDArray[np.intp]) -> None:
        self.converged[k] = True
        self.done[k] = True


def _steps_in_box(
    hessian: FloatArray,
    gradient: FloatArray,
    free: BoolArray,
    damping: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Return the Levenberg-Marquardt steps of several descents, subject to low <= step <= high.

    Coordinates that would exceed a bound are fixed at the bound. The equations are then solved again for the
    other coordinates.
    """
    scale = np.diagonal(hessian, axis1=1, axis2=2)
    scale = np.where(scale > 0.0, scale, 1e-300)
    diagonal = np.arange(hessian.shape[1])
    damped = hessian.copy()
    damped[:, diagonal, diagonal] += damping[:, None] * scale + 1e-14 * scale.max(axis=1, keepdims=True)
    step = np.zeros_like(gradient)
    for _ in range(NUMERICS.box_round_count_max):
        system = np.where(free[:, :, None] & free[:, None, :], damped, 0.0)
        system[:, diagonal, diagonal] = damped[:, diagonal, diagonal]
        held = np.where(free, 0.0, step)
        right = np.where(free, gradient - np.einsum("bij,bj->bi", damped, held), 0.0)
        solved = np.where(free, solve_scaled(system, right[..., None])[..., 0], held)
        solved = np.where(np.isfinite(solved), solved, 0.0)
        beyond = free & ((solved < low) | (solved > high))
        step = np.clip(solved, low, high)
        if not beyond.any():
            break
        free = free & ~beyond
    return step
