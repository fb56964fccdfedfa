"""Uncertainties of parameters and predictions agree with textbook formulas.

The problem is a linear regression on velocity, displacement and a constant, so that all formulas are
explicit.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import norm, t, ttest_1samp

from mrdamper.arrays import FloatArray, inverse_sizes, pseudoinverse
from mrdamper.identify.confidence.held_out_folds import (
    HeldOutError,
    RefittedFolds,
    force_band,
    refit_without_folds,
    with_errors_between_motions,
)
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.problem import FitProblem, FreeParameter, SearchResult
from mrdamper.identify.search.objective import solve_scaled
from mrdamper.identify.selection.candidates import Candidate, FittedCandidate, ValidatedCandidate
from mrdamper.identify.uncertainty import covariances, estimates_of
from mrdamper.identify.windows import FitWindow
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs
from tests.identify.small_problems import LINEAR, linear_problem


@pytest.fixture(scope="module")
def linear() -> tuple[FitProblem, SearchResult]:
    return linear_problem(seed=4)


def regression(problem: FitProblem, result: SearchResult) -> list[tuple[float, FloatArray, FloatArray]]:
    """Return weight, regressor columns (n, 3) and residual of each run."""
    found = []
    for run in problem.runs:
        kept, path = slice(run.scored_from, None), run.trajectory
        columns = np.stack([path.velocity, path.displacement, np.ones(len(path))], axis=1)[kept]
        residual = (run.force - simulate(result.damper, path))[kept]
        weight = 1e4 / (float(np.var(run.force[kept])) * len(residual) * len(problem.runs))
        found.append((weight, columns, residual))
    return found


def blocks_of(run: FitWindow) -> list[slice]:
    """Return slices of the scored samples between reversals, counted from the first scored sample."""
    velocity = run.drive.trajectory.velocity
    turns = np.flatnonzero(np.signbit(velocity[1:]) != np.signbit(velocity[:-1])) + 1
    cuts = [0, *(turns[turns > run.start] - run.start).tolist(), len(velocity) - run.start]
    return [slice(a, b) for a, b in pairwise(cuts)]


def test_parameter_covariances_match_weighted_regression(linear):
    problem, result = linear
    runs = problem.windows()
    rows = regression(problem, result)
    bread = np.linalg.inv(sum(w * x.T @ x for w, x, _ in rows))
    noise = sum(w**2 * np.mean(r**2) * x.T @ x for w, x, r in rows)
    independent, blocks = covariances(runs, result.damper, LINEAR)
    assert independent == pytest.approx(bread @ noise @ bread, rel=1e-6)
    scores = np.array(
        [
            w * x[part].T @ r[part]
            for run, (w, x, r) in zip(runs, rows, strict=True)
            for part in blocks_of(run)
        ]
    )
    small_sample = len(scores) / (len(scores) - 3)
    expected = small_sample * bread @ scores.T @ scores @ bread
    # The tolerance allows each reversal to shift by one sample.
    spread = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert blocks / spread == pytest.approx(expected / spread, abs=0.05)
    clusters = [k // 4 for k in range(len(runs))]
    scores = np.array(
        [sum(w * x.T @ r for c, (w, x, r) in zip(clusters, rows, strict=True) if c == g) for g in range(3)]
    )
    _, clustered = covariances(runs, result.damper, LINEAR, clusters)
    assert clustered == pytest.approx(1.5 * bread @ scores.T @ scores @ bread, rel=1e-6)


@pytest.mark.parametrize(("value", "side"), [(900.0, "lower"), (3600.0, "upper"), (901.0, ""), (3590.0, "")])
def test_parameter_on_bound_has_no_standard_error(value, side):
    free = (FreeParameter("rho.value", 900.0, 3600.0, "log"), FreeParameter("kappa.value", -1.0, 1.0))
    damper = REFERENCE_DAMPERS["bouc-wen"].with_parameters({"rho.value": value})
    problem = FitProblem(damper, free, simulate_runs(damper, noise=0.02, seed=0)[:3])
    (rho, kappa), correlation = estimates_of(problem, problem.windows(), damper)
    assert (rho.at_bound, kappa.at_bound) == (side, "")
    assert np.isnan(rho.standard_error) == np.isnan(correlation[0, 0]) == bool(side)
    assert np.isfinite(kappa.standard_error)


@pytest.mark.parametrize("decades", [0.0, 12.0])
def test_matrix_inverse_is_independent_of_units(decades):
    root = np.random.default_rng(0).standard_normal((9, 5))
    matrix, units = root.T @ root, 10.0 ** np.linspace(-decades, decades, 5)
    scaled = matrix * np.outer(units, units)
    assert inverse_sizes(scaled) * units * np.sqrt(np.diag(matrix)) == pytest.approx(np.ones(5))
    inverse = np.linalg.inv(matrix) / np.outer(units, units)
    assert pseudoinverse(scaled) / inverse == pytest.approx(np.ones((5, 5)), rel=1e-8)
    right = matrix @ np.ones(5) * units
    assert solve_scaled(scaled, right[:, None])[:, 0] * units == pytest.approx(np.ones(5), rel=1e-8)
    nothing = np.zeros((6, 6))
    nothing[:5, :5] = scaled  # The sixth parameter has no effect.
    assert pseudoinverse(nothing)[:5, :5] / inverse == pytest.approx(np.ones((5, 5)), rel=1e-8)
    assert not pseudoinverse(nothing)[5].any()


# Errors between held-out motions


def test_standard_errors_between_motions_match_regression(linear):
    problem, result = linear
    folds = refit_without_folds(problem, result)
    assert folds is not None
    groups = motion_groups(problem.runs)
    number = {k: g for g, members in enumerate(groups) for k in members}
    rows = regression(problem, result)
    # The normal equations without the runs of a motion give the refitted parameters.
    for fold, damper in zip(sorted(groups), folds.dampers, strict=True):
        rest = [k for k in range(len(rows)) if k not in fold]
        if len(rest) == len(rows) - len(fold):
            continue
        solved = np.linalg.solve(
            sum(rows[k][0] * rows[k][1].T @ rows[k][1] for k in rest),
            sum(rows[k][0] * rows[k][1].T @ rows[k][2] for k in rest),
        )
        for name, change in zip(LINEAR, solved, strict=True):
            assert damper.parameters[name] == pytest.approx(result.damper.parameters[name] + change, rel=1e-6)
    values = np.array([[damper.parameters[name] for name in LINEAR] for damper in folds.dampers])
    count = len(values)
    wider = t.ppf(0.95, count - 1) / norm.ppf(0.95)
    jackknife = wider * np.sqrt((count - 1) ** 2 / count * np.var(values, axis=0, ddof=1))
    clusters = [number[k] for k in range(len(problem.runs))]
    _, sandwich = covariances(problem.windows(), result.damper, LINEAR, clusters)
    by_motion = wider * np.sqrt(np.diag(sandwich))
    for k, (before, after) in enumerate(
        zip(result.estimates, with_errors_between_motions(problem, result, folds).estimates, strict=True)
    ):
        expected = max(before.standard_error, jackknife[k], by_motion[k])
        assert after.standard_error == pytest.approx(expected, rel=1e-5)


def test_force_band_contains_90_percent_of_errors():
    """The error is uniform between zero and the reference width, so 90 % are below 0.9 of this width."""
    rng = np.random.default_rng(0)
    folds = []
    for _ in range(4):
        force = 500.0 * np.sin(np.linspace(0.0, 40.0, 4000))
        size = np.sqrt(np.mean(force**2))
        unit = np.sqrt(force**2 + (0.15 * size) ** 2 + (0.1 * size) ** 2)
        folds.append((HeldOutError(force, rng.uniform(-1.0, 1.0, len(force)) * unit),))
    band = force_band(RefittedFolds("motions", (), tuple(folds), expected_ratio=1.0))
    assert band.factor == pytest.approx(0.9, abs=0.03)
    assert band.base_N == pytest.approx(0.1 * size, rel=1e-9)
    assert (band.share, band.folds, band.left_out) == (0.9, 4, "motions")
    errors = [100.0 * np.sqrt(np.mean(f.error**2)) / np.std(f.force + f.error) for (f,) in folds]
    assert band.expected_nrmse_percent == pytest.approx(np.median(errors))
    assert band.worst_nrmse_percent == pytest.approx(max(errors))
    apart = [(HeldOutError(f.force, k * f.error),) for k, (f,) in enumerate(folds, 1)]
    wider = force_band(RefittedFolds("motions", (), tuple(apart), expected_ratio=1.0))
    quantiles = 0.9 * np.arange(1.0, 5.0)
    assert wider.factor == pytest.approx(quantiles.mean() + 0.4 * quantiles.std(ddof=1), rel=0.03)


# Comparison of candidates


def validated(squares: FloatArray) -> ValidatedCandidate:
    """Return a candidate with this squared error [%^2] in each fold."""
    fitted = FittedCandidate(Candidate("dahl", ()), REFERENCE_DAMPERS["dahl"], 1, 1.0, 0.0)
    folds = np.arange(len(squares))
    return ValidatedCandidate(fitted, (), squares, np.full(len(folds), 1.0 / len(folds)), folds, folds, 0.0)


def test_candidates_are_compared_by_paired_t_test():
    """The statistic is Student's t of the differences of the errors, as computed by SciPy."""
    first, second = np.random.default_rng(0).uniform(1.0, 4.0, (2, 6))
    gain, statistic = validated(first).gain_relative_to(validated(second))
    assert statistic == pytest.approx(ttest_1samp(np.sqrt(second) - np.sqrt(first), 0.0).statistic)
    assert gain == pytest.approx(1.0 - np.sqrt(first).mean() / np.sqrt(second).mean())
    assert validated(first).cv_rms_percent == pytest.approx(np.sqrt(first.mean()))
    assert validated(first).cv_mean_percent == pytest.approx(np.sqrt(first).mean())
