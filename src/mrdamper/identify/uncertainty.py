"""Uncertainty of fitted parameters: standard errors, correlations, active bounds.

The residuals of a measured run are correlated in time. Therefore the covariance for independent noise is much
too small. The standard error is the larger of two estimates: from the covariance for independent noise, and
from the sandwich estimator, whose clusters are half cycles (from one reversal of the motion to the next).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, inverse_sizes, pseudoinverse
from mrdamper.identify.problem import Estimate, FitProblem, FreeParameter
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.tangents import Tangents


def estimates_of(
    problem: FitProblem, runs: Sequence[FitWindow], damper: Damper
) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Return the estimate of every free parameter, and the correlation matrix of these parameters.

    For a parameter on a bound, the standard error and the correlations are NaN.
    """
    values = damper.parameters_and_lag
    units = {**damper.units, LAG: "s"}
    sides = [_side(free, values[free.name]) for free in problem.free]
    moving = [i for i, side in enumerate(sides) if not side]
    names = [problem.free[i].name for i in moving]
    count = len(problem.free)
    design, error = np.full((2, count), np.nan)
    correlation = np.full((count, count), np.nan)
    if names:
        independent, blocks = covariances(runs, damper, names)
        design[moving] = np.sqrt(np.maximum(np.diag(independent), 0.0))
        chosen = blocks if np.trace(blocks) > np.trace(independent) else independent
        error[moving] = np.sqrt(np.maximum(np.maximum(np.diag(independent), np.diag(blocks)), 0.0))
        size = inverse_sizes(chosen)
        correlation[np.ix_(moving, moving)] = chosen * np.outer(size, size)
    sizes = np.abs([values[free.name] for free in problem.free])
    percent = np.divide(100.0 * design, sizes, where=sizes > 0.0, out=np.full(count, np.inf))
    estimates = tuple(
        Estimate(
            name=free.name,
            unit=units[free.name],
            value=values[free.name],
            standard_error=float(error[i]),
            design_error_percent=float(percent[i]),
            lower=free.lower,
            upper=free.upper,
            at_bound=sides[i],
            linear=free.linear,
        )
        for i, free in enumerate(problem.free)
    )
    return estimates, correlation


def covariances(
    runs: Sequence[FitWindow], damper: Damper, names: Sequence[str], clusters: Sequence[int] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return two covariance matrices of parameters: for independent residuals, and the sandwich estimator.

    ``runs`` are windows. ``clusters`` has the cluster number of each window. With None, each half cycle is
    a cluster.
    """
    size = len(names)
    curvature, noise = np.zeros((size, size)), np.zeros((size, size))
    scores: list[FloatArray] = []  # cost gradient of each half cycle, shape (parameters, half cycles)
    tangents = Tangents(damper, names, [run.drive for run in runs])
    for index, run in enumerate(runs):
        s = tangents.evaluate_run(index)
        residual = (run.force - s.force)[run.start :]
        squares = s.combine @ core.gram(s.columns, run.start) @ s.combine.T
        curvature += run.weight * squares
        noise += run.weight**2 * float(np.mean(residual**2)) * squares
        cuts = np.array([first for first, _, _ in run.drive.record.pieces])
        cuts = np.unique(np.concatenate([[0], cuts[cuts > run.start] - run.start])).astype(np.intp)
        half_cycles = np.add.reduceat(s.columns[:, run.start :] * residual, cuts, axis=1)
        scores.append(run.weight * (s.combine @ half_cycles))
    if clusters is None:
        sums = np.hstack(scores)
        small_sample = sums.shape[1] / max(sums.shape[1] - size, 1)
    else:
        sums = np.zeros((size, max(clusters) + 1))
        for cluster, score in zip(clusters, scores, strict=True):
            sums[:, cluster] += score.sum(axis=1)
        small_sample = sums.shape[1] / max(sums.shape[1] - 1, 1)
    inverse = pseudoinverse(curvature)
    return inverse @ noise @ inverse, small_sample * (inverse @ sums @ sums.T @ inverse)


def _side(free: FreeParameter, value: float) -> Literal["", "lower", "upper"]:
    """Return "lower" or "upper" if a nonlinear parameter is on this bound, otherwise an empty string."""
    if free.linear:
        return ""
    low, high, at = (float(free.to_search(v)) for v in (free.lower, free.upper, value))
    margin = 1e-6 * (high - low)
    if at <= low + margin:
        return "lower"
    return "upper" if at >= high - margin else ""
