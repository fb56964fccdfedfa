"""Errors of parameters and of predictions against textbook formulas, from the runs' own motion.

The problem is linear regression on velocity, displacement and one, so that every formula can be written down.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm, t, ttest_1samp

from mrdamper.arrays import FloatArray, inverse_sizes, pseudoinverse
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence import posterior
from mrdamper.identify.confidence.copula import Copula
from mrdamper.identify.confidence.left_out import (
    RefittedFolds,
    _Missed,
    _t_factor,
    across_motions,
    force_band,
    leave_folds_out,
)
from mrdamper.identify.confidence.posterior import _Density, sample_posterior
from mrdamper.identify.confidence.proposals import _candidates, _information, propose_tests
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.problem import FitProblem, FitResult, FreeParameter, PreparedFit
from mrdamper.identify.search.objective import Objective, solve_scaled
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.selection.candidates import Candidate, Fitted, Judged
from mrdamper.identify.uncertainty import _side, covariances, estimates_of
from mrdamper.models.simulate import simulate
from mrdamper.runtime.pool import ONE_CORE
from tests.identify.test_identifiability import LINEAR, linear_problem
from tests.identify.truths import TRUTHS, measured


@pytest.fixture(scope="module")
def linear() -> tuple[FitProblem, FitResult]:
    return linear_problem(seed=4)


def regression(problem: FitProblem, result: FitResult) -> list[tuple[float, FloatArray, FloatArray]]:
    """Return weight, columns (n, 3) and residual of each run."""
    found = []
    for run in problem.runs:
        kept, path = slice(run.scored_from, None), run.trajectory
        columns = np.stack([path.velocity, path.displacement, np.ones(len(path))], axis=1)[kept]
        residual = (run.force - simulate(result.damper, path))[kept]
        weight = 1e4 / (float(np.var(run.force[kept])) * len(residual) * len(problem.runs))
        found.append((weight, columns, residual))
    return found


def blocks_of(run: PreparedFit) -> list[slice]:
    """Return the scored samples between reversals of the motion, counted from the first scored one."""
    velocity = run.drive.trajectory.velocity
    turns = np.flatnonzero(np.signbit(velocity[1:]) != np.signbit(velocity[:-1])) + 1
    cuts = [0, *(turns[turns > run.start] - run.start).tolist(), len(velocity) - run.start]
    return [slice(a, b) for a, b in pairwise(cuts)]


def test_covariances_are_those_of_weighted_regression_with_a_sandwich_over_half_cycles(linear):
    problem, result = linear
    runs = problem.prepare()
    rows = regression(problem, result)
    bread = np.linalg.inv(sum(w * x.T @ x for w, x, _ in rows))
    noise = sum(w**2 * np.mean(r**2) * x.T @ x for w, x, r in rows)
    independent, blocks = covariances(runs, result.damper, LINEAR, {})
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
    spread = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))  # a reversal is a sample early or late
    assert blocks / spread == pytest.approx(expected / spread, abs=0.05)
    clusters = [k // 4 for k in range(len(runs))]
    scores = np.array(
        [sum(w * x.T @ r for c, (w, x, r) in zip(clusters, rows, strict=True) if c == g) for g in range(3)]
    )
    _, clustered = covariances(runs, result.damper, LINEAR, {}, clusters)
    assert clustered == pytest.approx(1.5 * bread @ scores.T @ scores @ bread, rel=1e-6)


def test_a_session_s_offset_is_no_part_of_the_residual(linear):
    problem, result = linear
    shifted = replace(problem, runs=tuple(replace(run, force=run.force + 30.0) for run in problem.runs))
    one = covariances(problem.prepare(), result.damper, LINEAR, {})
    other = covariances(shifted.prepare(), result.damper, LINEAR, {"rig": 30.0})
    assert other[0] == pytest.approx(one[0], rel=1e-9)
    assert other[1] == pytest.approx(one[1], rel=1e-9)


def test_estimates_state_the_larger_error_the_design_s_share_and_correlations(linear):
    problem, result = linear
    independent, blocks = covariances(problem.prepare(), result.damper, LINEAR, {})
    estimates, correlation = estimates_of(problem, problem.prepare(), result.damper, {})
    larger = blocks if np.trace(blocks) > np.trace(independent) else independent
    spread = np.sqrt(np.diag(larger))
    assert correlation == pytest.approx(larger / np.outer(spread, spread), rel=1e-9)
    assert np.diag(correlation) == pytest.approx(np.ones(3))
    for k, each in enumerate(estimates):
        assert each.standard_error == pytest.approx(np.sqrt(max(independent[k, k], blocks[k, k])))
        share = 100.0 * np.sqrt(independent[k, k]) / abs(each.value)
        assert each.design_error_percent == pytest.approx(share)
        assert each.value == result.damper.parameters[each.name]
        assert each.identifiable == (share < 30.0)
    without, none = estimates_of(problem, problem.prepare(), result.damper, {}, with_errors=False)
    assert np.isnan(none).all()
    assert all(np.isnan([e.standard_error, e.design_error_percent]).all() for e in without)


@pytest.mark.parametrize(("value", "side"), [(900.0, "lower"), (3600.0, "upper"), (901.0, ""), (3590.0, "")])
def test_a_searched_parameter_on_a_bound_is_named_and_has_no_error(value, side):
    free = (FreeParameter("rho.value", 900.0, 3600.0, "log"), FreeParameter("kappa.value", -1.0, 1.0))
    damper = TRUTHS["bouc-wen"].with_parameters({"rho.value": value})
    problem = FitProblem(damper, free, measured(damper, noise=0.02, seed=0)[:3])
    (rho, kappa), correlation = estimates_of(problem, problem.prepare(), damper, {})
    assert (rho.at_bound, kappa.at_bound) == (side, "")
    assert np.isnan(rho.standard_error) == np.isnan(correlation[0, 0]) == bool(side)
    assert np.isfinite(kappa.standard_error)


@pytest.mark.parametrize(("scale", "low"), [("linear", -1.0), ("linear", 1.0), ("log", 1.0)])
def test_a_millionth_of_the_width_from_its_bound_a_parameter_rests_on_it(scale, low):
    free = FreeParameter("x", low, 100.0, scale)
    at = free.to_search(np.array([low, 100.0]))
    for share, side in (
        (0.0, "lower"),
        (0.9e-6, "lower"),
        (1.1e-6, ""),
        (1.0 - 0.9e-6, "upper"),
        (1.0, "upper"),
    ):
        value = free.to_physical(float(at[0] + share * (at[1] - at[0])))
        assert _side(free, value) == side
        assert _side(replace(free, linear=True), value) == ""
    assert _side(free, free.to_physical(float(at[0] + (1.0 - 1.1e-6) * (at[1] - at[0])))) == ""


@pytest.mark.parametrize(("turns", "factor"), [(1, 2.0), (2, 3.0), (3, 4.0), (4, 2.5), (5, 2.0)])
def test_few_half_cycles_widen_a_sandwich_as_few_samples_do(linear, turns, factor):
    """By n / (n - 3) for three parameters, and by n where there are no more blocks than those and one."""
    problem, result = linear
    run = problem.prepare()[0]
    path, pieces = run.drive.trajectory, [first for first, _, _ in run.drive.record.pieces]
    run = replace(run, start=pieces[-turns] - 60)
    cuts = [0, *(first - run.start for first in pieces[-turns:]), len(path) - run.start]
    x = np.stack([path.velocity, path.displacement, np.ones(len(path))], axis=1)[run.start :]
    r = (run.force - simulate(result.damper, path))[run.start :]
    bread = np.linalg.inv(run.weight * x.T @ x)
    scores = np.array([run.weight * x[a:b].T @ r[a:b] for a, b in pairwise(cuts)])
    expected = factor * bread @ scores.T @ scores @ bread
    _, blocks = covariances([run], result.damper, LINEAR, {})
    assert blocks == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("decades", [0.0, 12.0])
def test_units_of_the_rows_do_not_matter_to_an_inverse(decades):
    root = np.random.default_rng(0).standard_normal((9, 5))
    matrix, units = root.T @ root, 10.0 ** np.linspace(-decades, decades, 5)
    scaled = matrix * np.outer(units, units)
    assert inverse_sizes(scaled) * units * np.sqrt(np.diag(matrix)) == pytest.approx(np.ones(5))
    inverse = np.linalg.inv(matrix) / np.outer(units, units)
    assert pseudoinverse(scaled) / inverse == pytest.approx(np.ones((5, 5)), rel=1e-8)
    right = matrix @ np.ones(5) * units
    assert solve_scaled(scaled, right[:, None])[:, 0] * units == pytest.approx(np.ones(5), rel=1e-8)
    nothing = np.zeros((6, 6))
    nothing[:5, :5] = scaled  # a parameter that moves nothing
    assert pseudoinverse(nothing)[:5, :5] / inverse == pytest.approx(np.ones((5, 5)), rel=1e-8)
    assert not pseudoinverse(nothing)[5].any()


# --------------------------------------------------------------------------------- motions left out


@pytest.mark.parametrize("groups", [2, 3, 5, 9])
def test_few_groups_widen_an_error_as_student_does(groups):
    assert _t_factor(groups) == pytest.approx(t.ppf(0.95, groups - 1) / norm.ppf(0.95), rel=1e-5)


def test_errors_across_motions_are_jackknife_and_sandwich_of_motions(linear):
    problem, result = linear
    left = leave_folds_out(problem, result)
    assert left is not None
    groups = motion_groups(problem.runs)
    number = {k: g for g, members in enumerate(groups) for k in members}
    rows = regression(problem, result)
    # a linear fit without a motion is its regression without these runs
    for fold, damper in zip(sorted(groups), left.dampers, strict=True):
        rest = [k for k in range(len(rows)) if k not in fold]
        if len(rest) == len(rows) - len(fold):
            continue
        solved = np.linalg.solve(
            sum(rows[k][0] * rows[k][1].T @ rows[k][1] for k in rest),
            sum(rows[k][0] * rows[k][1].T @ rows[k][2] for k in rest),
        )
        for name, change in zip(LINEAR, solved, strict=True):
            assert damper.parameters[name] == pytest.approx(result.damper.parameters[name] + change, rel=1e-6)
    values = np.array([[damper.parameters[name] for name in LINEAR] for damper in left.dampers])
    count = len(values)
    wider = t.ppf(0.95, count - 1) / norm.ppf(0.95)
    jackknife = wider * np.sqrt((count - 1) ** 2 / count * np.var(values, axis=0, ddof=1))
    clusters = [number[k] for k in range(len(problem.runs))]
    _, sandwich = covariances(problem.prepare(), result.damper, LINEAR, {}, clusters)
    by_motion = wider * np.sqrt(np.diag(sandwich))
    for k, (before, after) in enumerate(
        zip(result.estimates, across_motions(problem, result, left), strict=True)
    ):
        expected = max(before.standard_error, jackknife[k], by_motion[k])
        assert after.standard_error == pytest.approx(expected, rel=1e-5)


def test_a_band_holds_nine_of_ten_samples_of_folds_that_are_alike():
    """Errors that are uniform up to the width of the band's unit: 90 % of them lie within 0.9 of it."""
    rng = np.random.default_rng(0)
    folds = []
    for _ in range(4):
        force = 500.0 * np.sin(np.linspace(0.0, 40.0, 4000))
        size = np.sqrt(np.mean(force**2))
        unit = np.sqrt(force**2 + (0.15 * size) ** 2 + (0.1 * size) ** 2)
        folds.append((_Missed(force, rng.uniform(-1.0, 1.0, len(force)) * unit),))
    band = force_band(RefittedFolds("motions", (), tuple(folds), share=1.0))
    assert band.factor == pytest.approx(0.9, abs=0.03)
    assert band.base_N == pytest.approx(0.1 * size, rel=1e-9)
    assert (band.share, band.folds, band.left_out) == (0.9, 4, "motions")
    errors = [100.0 * np.sqrt(np.mean(f.error**2)) / np.std(f.force + f.error) for (f,) in folds]
    assert band.expected_nrmse_percent == pytest.approx(np.median(errors))
    assert band.worst_nrmse_percent == pytest.approx(max(errors))
    apart = [(_Missed(f.force, k * f.error),) for k, (f,) in enumerate(folds, 1)]
    wider = force_band(RefittedFolds("motions", (), tuple(apart), share=1.0))
    quantiles = 0.9 * np.arange(1.0, 5.0)
    assert wider.factor == pytest.approx(quantiles.mean() + 0.4 * quantiles.std(ddof=1), rel=0.03)


# --------------------------------------------------------------------------------- candidates that are judged


def judged(squares: FloatArray, changing: FloatArray | None = None) -> Judged:
    fitted = Fitted(Candidate("dahl", ()), TRUTHS["dahl"], 1, 1.0, 1.0, 0.0)
    return Judged(fitted, squares, (), 0.0, np.zeros(0) if changing is None else changing)


def test_a_gain_is_the_paired_t_test_of_squared_errors():
    rng = np.random.default_rng(0)
    one, other = rng.uniform(1.0, 4.0, (2, 6))
    squares = [np.where(np.eye(6, dtype=bool), each, np.nan) for each in (one, other)]
    gain, statistic = judged(squares[0]).gain_over(judged(squares[1]))
    assert statistic == pytest.approx(ttest_1samp(other - one, 0.0).statistic)
    assert gain == pytest.approx(1.0 - np.sqrt(one.mean() / other.mean()))
    assert judged(squares[0]).percent == pytest.approx(np.sqrt(one.mean()))
    assert judged(squares[0]).by_run == pytest.approx(np.sqrt(one))
    assert judged(squares[0]).highest_training_percent == pytest.approx(np.sqrt(one.mean()))


def test_held_and_changing_commands_count_alike_however_many_runs_there_are():
    rng = np.random.default_rng(1)
    held = [np.where(np.eye(4, dtype=bool), each, np.nan) for each in rng.uniform(1.0, 4.0, (2, 4))]
    moving = rng.uniform(1.0, 9.0, (2, 30))
    one, other = (judged(a, b) for a, b in zip(held, moving, strict=True))
    by_kind = [np.nanmean(held[0]), moving[0].mean()]
    assert one.percent == pytest.approx(np.sqrt(np.mean(by_kind)))
    assert one.highest_training_percent == pytest.approx(np.sqrt(np.sum(by_kind)))
    assert len(one.by_run) == 34
    falls = [np.diag(held[1] - held[0]), moving[1] - moving[0]]
    error = np.sqrt(sum(f.var(ddof=1) / len(f) for f in falls))
    assert one.gain_over(other)[1] == pytest.approx(sum(f.mean() for f in falls) / error)


# --------------------------------------------------------------------------------- posterior


def test_the_density_of_the_nonlinear_parameters_is_the_gaussian_integral_over_the_linear_ones():
    """By plain simulation: least squares of the force at each place, its determinant, its covariance."""
    free = (
        FreeParameter("rho.value", 900.0, 3600.0, scale="log"),
        FreeParameter("viscosity.c0", -1e5, 1e5, linear=True),
        FreeParameter("yield_force.c0", 1.0, 1e5, linear=True),
    )
    truth = TRUTHS["bouc-wen"]
    problem = FitProblem(truth, free, measured(truth, noise=0.05, seed=1)[:3], rate_Hz=1e4)
    result = fit_variable_projection(problem, starts=0, first=truth)
    density = _Density(problem, Objective(problem, problem.prepare()), result, ONE_CORE)
    points = np.log([[1300.0], [1800.0], [2500.0], [4000.0]])
    logs, means, spreads = [], [], []
    for (point,) in points[:3]:
        damper = truth.with_parameters({"rho.value": float(np.exp(point))})
        matrix, right, squares = np.diag([1e-10, 1e-10]), np.zeros(2), np.zeros(())
        for run in problem.runs:
            kept, path = slice(run.scored_from, None), run.trajectory
            base = simulate(damper.with_parameters({"viscosity.c0": 0.0, "yield_force.c0": 0.0}), path)[kept]
            columns = []
            for name in ("viscosity.c0", "yield_force.c0"):
                others = {"viscosity.c0": 0.0, "yield_force.c0": 0.0, name: 1.0}
                columns.append(simulate(damper.with_parameters(others), path)[kept] - base)
            x, y = np.stack(columns, axis=1), run.force[kept] - base
            weight = 1e4 / (np.var(run.force[kept]) * len(y) * len(problem.runs))
            matrix, right, squares = (
                matrix + weight * x.T @ x,
                right + weight * x.T @ y,
                squares + weight * y @ y,
            )
        mean = np.linalg.solve(matrix, right)
        logs.append(-0.5 * (squares - right @ mean + np.linalg.slogdet(matrix)[1]))
        means.append(mean)
        spreads.append(np.linalg.inv(matrix))
    rng = np.random.default_rng(0)
    found = density.at(points, rng)
    assert found.log[3] == -np.inf, "beyond the box"
    inside = [multivariate_normal(m, c).cdf([np.inf, np.inf], lower_limit=[-np.inf, 0.0])
              for m, c in zip(means, spreads, strict=True)]  # fmt: skip
    expected = np.array(logs) + np.log(inside)
    assert found.log[:3] - found.log[0] == pytest.approx(expected - expected[0], abs=1e-3)
    many = density.at(np.repeat(points[1:2], 3000, axis=0), rng)
    deviation = np.sqrt(np.diag(spreads[1]))
    assert (many.linear.mean(axis=0) - means[1]) / deviation == pytest.approx(np.zeros(2), abs=0.09)
    assert np.cov(many.linear.T) == pytest.approx(spreads[1], rel=0.15)


def test_a_parameter_s_posterior_is_as_wide_as_its_standard_error(monkeypatch):
    monkeypatch.setattr(posterior, "_SETTLING", 30)
    monkeypatch.setattr(posterior, "_REFITTED", 15)
    truth = TRUTHS["bouc-wen"]
    free = (
        FreeParameter("rho.value", 900.0, 3600.0, "log"),
        FreeParameter("viscosity.c0", 0.0, 1e5, linear=True),
    )
    problem = FitProblem(truth, free, measured(truth, noise=0.02, seed=2)[:3])
    result = fit_variable_projection(problem, starts=0, first=truth)
    found = sample_posterior(problem, result, draws=300)
    assert found.effective_draws >= 300.0
    assert 0.2 < found.accepted_share <= 1.0
    shares = []
    for each in result.estimates:
        spread = found.standard_deviation[each.name]
        column = found.draws.values[:, found.draws.names.index(each.name)]
        assert np.mean(column) == pytest.approx(each.value, abs=0.3 * spread)
        shares.append(spread / each.standard_error)
    assert np.exp(np.mean(np.log(shares))) == pytest.approx(1.0, rel=0.12)


@pytest.mark.parametrize("size", [1, 2])
def test_a_copula_s_density_is_that_of_its_draws_and_is_one_in_all(size):
    rng = np.random.default_rng(0)
    points = rng.multivariate_normal(np.zeros(size), 0.3 + 0.7 * np.eye(size), 4000)
    points[:, 0] = np.exp(points[:, 0])  # any marginal
    low, high = np.array([0.0, -8.0])[:size], np.array([60.0, 8.0])[:size]
    fitted = Copula(points, low, high)
    drawn = fitted.draw(40_000, rng)
    assert np.all((drawn >= low) & (drawn <= high))
    sides = [np.linspace(a, b, 1202 if size == 2 else 200_001) for a, b in zip(low, high, strict=True)]
    middle = [0.5 * (side[1:] + side[:-1]) for side in sides]
    cell = np.prod([side[1] - side[0] for side in sides])
    grid = np.stack([each.ravel() for each in np.meshgrid(*middle, indexing="ij")], axis=1)
    density = np.exp(fitted.log(grid)) * cell
    total = density.sum()
    if size == 1:
        assert total == pytest.approx(1.0, rel=1e-3)
    for limit in (0.2, 1.0, 2.0, 8.0):
        below = density[grid[:, 0] < limit].sum() / total
        assert np.mean(drawn[:, 0] < limit) == pytest.approx(below, abs=0.015)
        assert np.mean(points[:, 0] < limit) == pytest.approx(below, abs=0.05)
    if size == 2:
        both = (grid[:, 0] < 1.0) & (grid[:, 1] < 0.0)
        assert np.mean((drawn[:, 0] < 1.0) & (drawn[:, 1] < 0.0)) == pytest.approx(
            density[both].sum() / total, abs=0.015
        )
        assert density[both].sum() / total == pytest.approx(
            np.mean((points[:, 0] < 1.0) & (points[:, 1] < 0.0)), abs=0.03
        )


# --------------------------------------------------------------------------------- tests to run next


def test_a_proposed_test_takes_off_what_its_regression_does(linear):
    """Each in turn lowers the mean variance of the force over all candidates most."""
    problem, result = linear
    candidates = _candidates(problem, result.damper)
    told = _information(result.damper, LINEAR, candidates)
    some = [candidates[0], candidates[len(candidates) // 2], (4e-3, 0.35, 1.0, None)]
    for (amplitude, frequency, command, _), shown_by in zip(
        some, _information(result.damper, LINEAR, some), strict=True
    ):
        phase = 2.0 * np.pi * np.arange(0.0, 1.0, 1e-4)
        speed = 2.0 * np.pi * frequency * amplitude * np.cos(phase)
        columns = np.stack([speed, amplitude * np.sin(phase), np.ones_like(phase)])
        rate = 1e4 * frequency
        path = drive(Sine(amplitude, frequency), duration=1.0 / frequency, rate_Hz=rate, command=command)
        force = simulate(result.damper, path)
        expected = 1e4 * columns @ columns.T / len(phase) / np.var(force)
        shown = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert shown_by / shown == pytest.approx(expected / shown, abs=0.06)
        assert command in {0.0, 1.0, 2.0}
    rows = regression(problem, result)
    known = len(rows) * sum(w * x.T @ x for w, x, _ in rows)
    target = told.mean(axis=0)
    before = left = np.trace(np.linalg.solve(known, target))
    for test in propose_tests(problem, result):
        after = [np.trace(np.linalg.solve(known + len(rows) / 3 * each, target)) for each in told]
        best = int(np.argmin(after))
        amplitude, frequency, command, kelvin = candidates[best]
        assert test.amplitude_mm == pytest.approx(1e3 * amplitude, rel=1e-2)
        assert (test.frequency_Hz, test.command) == pytest.approx((frequency, command), rel=1e-2)
        assert test.temperature_degC is kelvin is None
        assert test.reduction_percent == pytest.approx(
            100.0 * (1.0 - np.sqrt(after[best] / before)), abs=0.06
        )
        assert after[best] < left
        left, known = after[best], known + len(rows) / 3 * told[best]


def test_a_copula_s_marginals_are_histograms_of_equal_counts_with_a_fiftieth_beyond_on_either_side():
    rng = np.random.default_rng(2)
    points = rng.gamma(2.0, 1.0, (5000, 1))
    low, high = np.array([-5.0]), np.array([30.0])
    fitted = Copula(points, low, high)
    edges = np.quantile(points[:, 0], np.linspace(0.02, 0.98, 25))
    middle = 0.5 * (edges[1:] + edges[:-1])
    assert np.exp(fitted.log(middle[:, None])) == pytest.approx(0.96 / 24 / np.diff(edges), rel=1e-5)
    drawn = fitted.draw(50_000, rng)[:, 0]
    assert np.histogram(drawn, edges)[0] / 50_000 == pytest.approx(np.full(24, 0.04), abs=0.005)
    reach = 0.5 * (edges[-1] - edges[0])
    near, far = (
        max(edges[0] - reach, 0.5 * (edges[0] - 5.0)),
        min(edges[-1] + reach, 0.5 * (30.0 + edges[-1])),
    )
    outer = np.histogram(drawn, [-5.0, near, edges[0], edges[-1], far, 30.0])[0] / 50_000
    assert outer == pytest.approx([0.004, 0.016, 0.96, 0.016, 0.004], abs=0.003)


def test_a_copula_of_points_that_repeat_is_a_distribution_all_the_same():
    """Chains stand still for a while: a tenth of the points are one."""
    rng = np.random.default_rng(2)
    points = rng.standard_normal((2000, 2))
    points[:300] = points[0]
    fitted = Copula(points, np.array([-9.0, -9.0]), np.array([9.0, 9.0]))
    drawn = fitted.draw(20_000, rng)
    assert np.isfinite(fitted.log(points)).all()
    assert np.mean(np.abs(drawn - points[0]).max(axis=1) < 1e-4) > 0.005
    assert drawn.mean(axis=0) == pytest.approx(points.mean(axis=0), abs=0.06)


def test_a_copula_joins_its_marginals_as_the_normal_scores_of_the_points_are_correlated():
    """But for a fiftieth of it: no direction vanishes."""
    rng = np.random.default_rng(3)
    for correlation in (0.7, -0.4, 1.0):
        points = rng.multivariate_normal([0.0, 0.0], [[1.0, correlation], [correlation, 1.0]], 20_000)
        fitted = Copula(points, np.array([-9.0, -9.0]), np.array([9.0, 9.0]))
        found = np.atleast_2d(np.corrcoef(fitted._normal(fitted.draw(20_000, rng)).T))[0, 1]
        assert found == pytest.approx(0.98 * correlation, abs=0.015)
        assert np.isfinite(fitted.log(points)).all()
