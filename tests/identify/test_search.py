"""The objective, the constrained least squares and the optimiser agree with independent computations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares, minimize

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.descent import Descents
from mrdamper.identify.search.objective import Box, Eliminated, Objective, _bounded_least_squares
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs
from tests.support.examples import examples

DAMPER = REFERENCE_DAMPERS["bouc-wen"]


def objective_of(*, noise: float = 0.02) -> Objective:
    """Return the objective of a fit to runs of a Bouc-Wen damper, one of them with varying current."""
    *runs, last = simulate_runs(DAMPER, noise=noise, seed=0, duration=2.0)[:5]
    sweep = replace(last.trajectory, command=np.linspace(0.0, 1.0, len(last.trajectory)))
    runs.append(replace(last, trajectory=sweep, force=simulate(DAMPER, sweep)))
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, tuple(runs), FitSettings(rate_Hz=1e4, samples_per_period=1e9))
    return Objective(problem, problem.windows())


def values_of(objective: Objective, damper: Damper) -> tuple[FloatArray, FloatArray]:
    """Return the nonlinear and the linear parameters of a damper, as one row each."""
    points, linear = objective.points_of([damper])
    return objective.box.to_physical(points), linear


# Sums over the samples


def test_gram_matrices_match_central_differences() -> None:
    """The Gram matrix of force derivatives and residual agrees with central differences of the force."""
    objective = objective_of()
    names = (*objective.nonlinear, *objective.linear)
    values = np.array([[1500.0, -0.2, 1.3]]), values_of(objective, objective.problem.template)[1]
    damper = objective.problem.template.with_parameters(
        dict(zip(names, np.concatenate(values, axis=1)[0].tolist(), strict=True))
    )
    sums = np.zeros((len(names) + 1, len(names) + 1))
    for run in objective.runs:
        columns = []
        for name in names:
            step = 1e-5 * max(abs(damper.parameters[name]), 1e-2)
            above, below = (
                simulate(damper.with_parameters({name: damper.parameters[name] + way * step}), run.drive)
                for way in (1.0, -1.0)
            )
            columns.append((above - below) / (2.0 * step))
        rows = np.array([*columns, run.force - simulate(damper, run.drive)])
        sums += run.weight * (rows[:, run.start :] @ rows[:, run.start :].T)
    gram = objective.sums(*values)[0]
    size = np.sqrt(np.diag(sums))
    np.testing.assert_allclose(gram / np.outer(size, size), sums / np.outer(size, size), atol=5e-5)
    assert gram[-1, -1] == pytest.approx(sums[-1, -1], rel=1e-12)


@pytest.mark.parametrize("tangents", [True, False])
def test_variable_projection_without_noise_recovers_linear_parameters(tangents: bool) -> None:
    """Elimination reduces the cost to rounding errors, even from values that are 1000 times too large."""
    objective = objective_of(noise=0.0)
    nonlinear, linear = values_of(objective, DAMPER)
    result = objective.eliminate(nonlinear, 1e3 * linear, tangents=tangents)
    assert result.cost[0] < 1e-12
    np.testing.assert_allclose(result.linear, linear, rtol=1e-4, atol=0.02)


def test_variable_projection_minimises_cost() -> None:
    """For given nonlinear parameters, a change of any linear parameter increases the cost."""
    objective = objective_of()
    nonlinear = np.array([[1800.0, -0.5, 1.4]])
    result = objective.eliminate(nonlinear, values_of(objective, objective.problem.template)[1])
    best = objective.damper_at(objective.box.to_search(nonlinear)[0], result.linear[0])
    assert objective.gram(best, ())[-1, -1] == pytest.approx(result.cost[0], rel=1e-9)
    for name in objective.linear:
        for factor in (0.99, 1.01):
            changed = best.with_parameters({name: factor * best.parameters[name]})
            assert objective.gram(changed, ())[-1, -1] > result.cost[0]


def test_projected_gradient_matches_finite_differences() -> None:
    """Kaufman's gradient equals the gradient of the cost after elimination of the linear parameters."""
    objective = objective_of()
    at = np.array([[1500.0, -0.2, 1.0]])
    best = objective.eliminate(at, values_of(objective, objective.problem.template)[1])
    _, gradient, _ = objective.projected(objective.sums(at, best.linear), best.linear)
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-5 * abs(at[0, k])
        above, below = objective.eliminate(
            np.concatenate([at + step, at - step]), np.repeat(best.linear, 2, axis=0)
        ).cost
        assert -2.0 * gradient[0, k] == pytest.approx((above - below) / (2.0 * step[k]), rel=1e-4)


@given(seed=st.integers(0, 2**32 - 1))
@examples(20)
def test_bounded_least_squares_agrees_with_slsqp(seed: int) -> None:
    """The quadratic programme with inequality constraints has the same minimum as a general solver."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((9, 5))
    matrix, right = root.T @ root, rng.standard_normal(5) * 3.0
    rows, floor = rng.standard_normal((4, 5)), rng.standard_normal(4) * 0.3
    solution = _bounded_least_squares(matrix[None], right[None], rows, floor[None])[0]
    other = minimize(  # type: ignore[call-overload]  # The stub requires more arguments than SLSQP.
        lambda x: 0.5 * x @ matrix @ x - right @ x,
        np.zeros(5),
        jac=lambda x: matrix @ x - right,
        constraints={"type": "ineq", "fun": lambda x: rows @ x - floor, "jac": lambda x: rows},
        options={"maxiter": 500, "ftol": 1e-14},
    )
    size = np.abs(rows) @ np.abs(solution) + np.abs(floor)  # size of the terms of each condition
    assert np.all(rows @ solution - floor >= -1e-7 * size)
    assert 0.5 * solution @ matrix @ solution - right @ solution <= other.fun + 1e-6


# Steps of the optimiser


Residuals = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function of parameters that returns residuals and their derivatives."""


@dataclass
class LeastSquares:
    """Objective without linear parameters. The derivatives are wrong by the factor ``off``."""

    residuals: Residuals
    free: tuple[FreeParameter, ...]
    off: float = 1.0
    runs: tuple[FitWindow, ...] = ()

    @property
    def problem(self) -> SimpleNamespace:
        return SimpleNamespace(nonlinear=self.free)

    @property
    def box(self) -> Box:
        return Box.from_parameters(self.problem.nonlinear)

    def sums(self, values: FloatArray, linear: FloatArray, off: float = 1.0) -> FloatArray:
        grams = []
        for point in values:
            residuals, tangents = self.residuals(point)
            columns = np.column_stack([off * tangents, -residuals])
            grams.append(columns.T @ columns)
        return np.array(grams)

    def eliminate(self, values: FloatArray, linear: FloatArray) -> Eliminated:
        gram = self.sums(values, linear, self.off)
        drift = np.full(len(values), abs(self.off - 1.0))
        return Eliminated(gram[:, -1, -1].copy(), linear, gram, drift)

    def projected(self, gram: FloatArray, linear: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        n = len(self.free)
        return gram[:, :n, :n], gram[:, :n, -1], np.empty((len(gram), 0, n))


def decay(point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of an exponential decay with height 3 and rate 0.5, and their derivatives."""
    t = np.linspace(0.0, 6.0, 40)
    height, rate = point[:2]
    shape = np.exp(-rate * t)
    return height * shape - 3.0 * np.exp(-0.5 * t), np.column_stack([shape, -height * t * shape])


DECAY = (FreeParameter("height", 0.01, 100.0, "log"), FreeParameter("rate", 0.0, 5.0))
STARTS = np.column_stack([np.log([0.02, 0.5, 50.0, 90.0]), [4.5, 0.1, 3.0, 0.0]])


def descents(objective: LeastSquares, points: FloatArray, most: int = 100) -> Descents:
    return Descents(objective, points, np.empty((len(points), 0)), most=most)  # type: ignore[arg-type]


@pytest.mark.parametrize("off", [1.0, 1.01, 1.3, -1.0])
def test_optimiser_converges_with_inexact_derivatives(off: float) -> None:
    """All starting points reach the solution, although the derivatives are wrong by the factor ``off``."""
    result = descents(LeastSquares(decay, DECAY, off), STARTS)
    result.run()
    assert result.converged.all()
    np.testing.assert_allclose(result.points, [[np.log(3.0), 0.5]] * len(STARTS), atol=1e-4)


@pytest.mark.parametrize("rate_max", [5.0, 0.4])
def test_optimiser_with_bounds_agrees_with_scipy(rate_max: float) -> None:
    """The minimum equals the trust-region reflective method of SciPy, inside the bounds and at a bound."""
    free = (DECAY[0], FreeParameter("rate", 0.0, rate_max))

    def residual(x: FloatArray) -> FloatArray:
        return decay(x)[0]

    def jacobian(x: FloatArray) -> FloatArray:
        return decay(x)[1]

    other = least_squares(
        residual,
        [0.5, 0.1],
        jacobian,
        ([0.01, 0.0], [100.0, rate_max]),
        method="trf",
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    result = descents(LeastSquares(decay, free), np.array([[np.log(0.5), 0.1]]))
    result.run()
    assert result.costs[0] == pytest.approx(2.0 * other.cost, rel=1e-6, abs=1e-9)
    assert [np.exp(result.points[0, 0]), result.points[0, 1]] == pytest.approx(other.x, rel=1e-3)
