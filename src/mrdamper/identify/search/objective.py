"""Cost of a fit problem after elimination of the linear parameters (variable projection).

The best linear parameters follow from the Gram matrices, subject to the conditions of the law (for example a
yield force that is not negative). One evaluation treats many candidates. It returns their costs and, in
Kaufman's approximation, the Gauss-Newton matrices of the nonlinear parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray, inverse_sizes
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.gram_sums import GramSums
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Bounds of the search coordinates. A coordinate is the value of a parameter, or its logarithm."""

    low: FloatArray
    high: FloatArray
    log: BoolArray

    @classmethod
    def from_parameters(cls, free: Sequence[FreeParameter]) -> Box:
        return cls(
            np.array([float(f.to_search(f.lower)) for f in free]),
            np.array([float(f.to_search(f.upper)) for f in free]),
            np.array([f.scale == "log" for f in free], dtype=np.bool_),
        )

    def to_physical(self, points: FloatArray) -> FloatArray:
        """Convert search coordinates to parameter values, both of shape (.., parameters)."""
        return np.exp(points, where=self.log, out=points.copy())

    def to_search(self, values: FloatArray) -> FloatArray:
        """Convert parameter values to search coordinates and clip these to the bounds."""
        points = np.log(np.maximum(values, 1e-300), where=self.log, out=values.copy())
        return np.clip(points, self.low, self.high)


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """Candidates (parameter sets) with their best linear parameters; the first array axis counts them.

    The rows of ``gram`` are the nonlinear parameters, the linear parameters and the residual. The tangents
    are computed with the initial guess of the linear parameters, and the residual with the best linear
    parameters. ``drift`` is the relative change of the force between these two sets of linear parameters.
    """

    cost: FloatArray  # [%^2]; inf if the simulation diverged
    linear: FloatArray
    gram: FloatArray
    drift: FloatArray


class Objective:
    """Cost of a fit problem on windows (sections) of the runs, with the best linear parameters."""

    def __init__(self, problem: FitProblem, runs: Sequence[FitWindow]) -> None:
        self.problem = problem
        self.runs = tuple(runs)
        self.box = Box.from_parameters(problem.nonlinear)
        self.nonlinear = tuple(free.name for free in problem.nonlinear)
        self.linear = tuple(free.name for free in problem.linear)
        names = (*self.nonlinear, *self.linear)
        self._all = GramSums(problem.template, names, names, runs)
        self._inner = GramSums(problem.template, names, self.linear, runs)
        self._rows, self._floor = problem.conditions
        size = np.array([max(abs(free.lower), abs(free.upper)) for free in problem.linear])
        self._light = NUMERICS.regularisation_cost / size**2

    def gram(self, damper: Damper, parameters: Sequence[str]) -> FloatArray:
        """Return the weighted Gram matrix of the force derivatives (one per parameter) and the residual."""
        return np.asarray(GramSums(damper, (), parameters, self.runs).evaluate(np.empty((1, 0)))[0])

    def points_of(self, dampers: Sequence[Damper]) -> tuple[FloatArray, FloatArray]:
        """Return search coordinates and linear parameters of dampers: two arrays with one row per damper."""
        values = [damper.parameters_and_lag for damper in dampers]
        nonlinear = np.array([[each[name] for name in self.nonlinear] for each in values])
        linear = np.array([[each[name] for name in self.linear] for each in values])
        return self.box.to_search(nonlinear.reshape(len(values), -1)), linear.reshape(len(values), -1)

    def damper_at(self, point: FloatArray, linear: FloatArray) -> Damper:
        """Return the damper that has the given search coordinates and linear parameters."""
        values = np.concatenate([self.box.to_physical(point), linear]).tolist()
        names = (*self.nonlinear, *self.linear)
        return self.problem.template.with_parameters(dict(zip(names, values, strict=True)))

    def costs_of(self, dampers: Sequence[Damper]) -> FloatArray:
        """Return the cost [%^2] of each damper with the best linear parameters; infinite if it diverges."""
        points, linear = self.points_of(dampers)
        return self.eliminate(self.box.to_physical(points), linear, tangents=False).cost

    def eliminate(
        self, nonlinear: FloatArray, linear: FloatArray, *, tangents: bool = True, is_repeated: bool = False
    ) -> Eliminated:
        """Return parameter sets in which the best linear parameters replace ``linear``.

        If ``tangents`` is False, the Gram matrix lacks the nonlinear parameters. The new cost is computed as
        the initial cost minus the improvement. If rounding errors dominate the difference, the elimination is
        repeated once, with the new linear parameters as initial values.
        """
        g = self.sums(nonlinear, linear, tangents=tangents)
        skip = len(self.nonlinear) if tangents else 0
        inner, right = g[:, skip:-1, skip:-1], g[:, skip:-1, -1]
        guessed = np.where(np.isfinite(g[:, -1, -1]), g[:, -1, -1], np.inf)
        if not inner.shape[1]:
            return Eliminated(guessed, linear, g, np.zeros(len(g)))
        floor = self._floor - linear @ self._rows.T
        pulled = inner + np.diag(self._light)
        moved = _bounded_least_squares(pulled, right - self._light * linear, self._rows, floor)
        change = np.einsum("bij,bj->bi", inner, moved)
        cost = np.maximum(guessed + np.sum(moved * (change - 2.0 * right), axis=1), 0.0)
        blurred = np.flatnonzero(cost < NUMERICS.resolved_cost_ratio * guessed)
        if is_repeated:
            moved[blurred], change[blurred], cost[blurred] = 0.0, 0.0, guessed[blurred]
        present = linear + moved
        force = np.einsum("bi,bij,bj->b", present, inner, present)
        drift = np.sqrt(np.maximum(np.sum(moved * change, axis=1), 0.0) / np.maximum(force, 1e-300))
        g[:, :-1, -1] -= np.einsum("bij,bj->bi", g[:, :-1, skip:-1], moved)
        g[:, -1, :-1] = g[:, :-1, -1]
        g[:, -1, -1] = cost
        cost[~np.isfinite(cost)] = np.inf
        if len(blurred) and not is_repeated:
            again = self.eliminate(nonlinear[blurred], present[blurred], tangents=tangents, is_repeated=True)
            cost[blurred], present[blurred], drift[blurred] = again.cost, again.linear, again.drift
            g[blurred] = again.gram
        return Eliminated(cost, present, g, drift)

    def sums(self, nonlinear: FloatArray, linear: FloatArray, *, tangents: bool = True) -> FloatArray:
        """Return the Gram matrices of candidates (parameter sets).

        If ``tangents`` is False, the matrices contain only the linear parameters and the residual.
        """
        values = np.concatenate([nonlinear, linear], axis=1)
        return (self._all if tangents else self._inner).evaluate(values)

    def projected(self, g: FloatArray, linear: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the reduced Gauss-Newton matrices and gradients, and derivatives of the linear parameters.

        Matrices and gradients refer to the nonlinear parameters, after elimination of the linear parameters.
        The derivatives of the linear parameters are with respect to the nonlinear parameters.
        """
        n = len(self.nonlinear)
        hessian, gradient = g[:, :n, :n], g[:, :n, -1]
        if g.shape[1] == n + 1:
            return hessian, gradient, np.empty((len(g), 0, n))
        # Without regularisation, a linear parameter without effect could get an arbitrarily large value.
        inner = g[:, n:-1, n:-1] + np.diag(self._light)
        both = np.concatenate([g[:, n:-1, :n], g[:, n:-1, -1:]], axis=2)
        rows = self._rows
        active = linear @ rows.T - self._floor <= 1e-7 * (np.abs(linear) @ np.abs(rows).T)
        if active.any():
            # A coefficient at its limit stays at its limit. A stiff penalty enforces this.
            spread = 1.0 / np.maximum(np.diagonal(inner, axis1=1, axis2=2), 1e-300)
            stiffness = NUMERICS.active_stiffness * active / (spread @ (rows**2).T)
            inner = inner + (rows.T * stiffness[:, None, :]) @ rows
        solved = solve_scaled(inner, both)
        reduced = g[:, :n, n:-1] @ solved
        return hessian - reduced[:, :, :n], gradient - reduced[:, :, n], -solved[:, :, :n]


def solve_scaled(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve positive semi-definite systems after scaling to a unit diagonal, with a small regularisation.

    ``matrix`` has shape (.., n, n), ``right`` and the result have shape (.., n, k).
    """
    scale = inverse_sizes(matrix)
    scaled = matrix * (scale[..., :, None] * scale[..., None, :])
    places = np.arange(matrix.shape[-1])
    scaled[..., places, places] += NUMERICS.eigenvalue_min
    right = scale[..., None] * right
    try:
        solved = np.linalg.solve(scaled, right)
    except np.linalg.LinAlgError:
        each = [np.linalg.lstsq(a, b, rcond=1e-12)[0] for a, b in zip(scaled, right, strict=True)]
        solved = np.stack(each)
    return np.asarray(scale[..., None] * solved)


def _bounded_least_squares(
    matrix: FloatArray, right: FloatArray, rows: FloatArray, floor: FloatArray
) -> FloatArray:
    """Minimise x' ``matrix`` x / 2 - x' ``right`` subject to ``rows`` x >= ``floor``.

    All arguments except ``rows`` have a first axis that counts several problems.
    """
    solution = solve_scaled(matrix, right[..., None])[..., 0]
    beyond = solution @ rows.T - floor < -1e-12 * (np.abs(solution) @ np.abs(rows).T + np.abs(floor))
    for k in np.flatnonzero(beyond.any(axis=1)):
        solution[k] = _nearest_valid(matrix[k], solution[k], rows, floor[k])
    return solution


def _nearest_valid(
    matrix: FloatArray, solution: FloatArray, rows: FloatArray, floor: FloatArray
) -> FloatArray:
    """Return the point that satisfies the conditions and is nearest to ``solution`` in the matrix norm.

    The Lagrange multipliers of the conditions, which are not negative, follow from the dual problem.
    """
    from scipy.optimize import nnls  # SciPy takes a quarter of a second to load.

    scale = inverse_sizes(matrix)
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    half = scale[:, None] * vectors / np.sqrt(np.maximum(values, 0.0) + NUMERICS.eigenvalue_min)
    projected = half.T @ rows.T
    size = inverse_sizes(projected.T @ projected)
    projected *= size
    # The dual matrix is computed as a product with its transpose. It is then positive semi-definite in spite
    # of rounding errors, as the Cholesky decomposition requires.
    regular = NUMERICS.multiplier_regularisation * np.eye(len(rows))
    root = np.linalg.cholesky(projected.T @ projected + regular).T
    slack = size * (rows @ solution - floor)
    multipliers, _ = nnls(root, np.linalg.solve(root.T, -slack))
    return np.asarray(solution + half @ (projected @ multipliers))
