"""Uncertainty of fitted parameters: standard errors, correlations, active bounds.

The residuals of a measured run are correlated in time. Therefore the covariance for independent noise is much
too small. The standard error is the larger of two values: the covariance for independent noise, and the
sandwich estimator with half cycles as clusters (from one reversal to the next).
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
    problem: FitProblem,
    runs: Sequence[FitWindow],
    damper: Damper,
) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Return the estimate of every free parameter, and the correlation matrix.

    Parameters on a bound have NaN.
    """
    values = damper.parameters_and_lag
    units = {**damper.units, LAG: "s"}
    sides = [_side(free, values[free.name]) for free in problem.free]
    moving = [i for i, side in enumerate(sides) if not side]
    names = [problem.free[i].name for i in moving]
    count = len(problem.free)
    design = np.full(count, np.nan)
    error = np.full(count, np.nan)
    correlation = np.full((count, count), np.nan)
    if names:
        independent, blocks = covariances(runs, damper, names)
        design[moving] = np.sqrt(np.maximum(np.diag(independent), 0.0))
        chosen = blocks if np.trace(blocks) > np.trace(independent) else independent
        error[moving] = np.sqrt(np.maximum(np.maximum(np.diag(independent), np.diag(blocks)), 0.0))
        size = inverse_sizes(chosen)
        correlation[np.ix_(moving, moving)] = chosen * np.outer(size, size)
    estimates = tuple(
        Estimate(
            name=free.name,
            unit=units[free.name],
            value=values[free.name],
            standard_error=float(error[i]),
            design_error_percent=_percent(design[i], values[free.name]),
            lower=free.lower,
            upper=free.upper,
            at_bound=sides[i],
            linear=free.linear,
        )
        for i, free in enumerate(problem.free)
    )
    return estimates, correlation


def covariances(
    runs: Sequence[FitWindow],
    damper: Damper,
    names: Sequence[str],
    clusters: Sequence[int] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance for independent residuals, and the sandwich estimator.

    ``clusters`` has the cluster number of each run. If it is None, half cycles are the clusters.
    """
    size = len(names)
    cluster_scores = np.zeros((0 if clusters is None else max(clusters) + 1, size))
    curvature = np.zeros((size, size))
    noise = np.zeros((size, size))
    blocks = np.zeros((size, size))
    count = 0
    tangents = Tangents(damper, names, [run.drive for run in runs])
    for index, run in enumerate(runs):
        s = tangents.along(index)
        columns = s.columns[:, run.start :]
        residual = (run.force - s.force)[run.start :]
        squares = s.combine @ core.gram(s.columns, run.start) @ s.combine.T
        curvature += run.weight * squares
        noise += run.weight**2 * float(np.mean(residual**2)) * squares
        if clusters is not None:
            cluster_scores[clusters[index]] += run.weight * (s.combine @ (columns @ residual))
            continue
        cuts = np.array([first for first, _, _ in run.drive.record.pieces])
        cuts = np.unique(np.concatenate([[0], cuts[cuts > run.start] - run.start])).astype(np.intp)
        scores = run.weight * (s.combine @ np.add.reduceat(columns * residual, cuts, axis=1))
        blocks += scores @ scores.T
        count += len(cuts)
    inverse = pseudoinverse(curvature)
    if clusters is not None:
        groups = len(cluster_scores)
        outer = inverse @ cluster_scores.T @ cluster_scores @ inverse
        by_cluster: FloatArray = groups / max(groups - 1, 1) * outer
        return inverse @ noise @ inverse, by_cluster
    small_sample = count / max(count - size, 1)
    return inverse @ noise @ inverse, small_sample * (inverse @ blocks @ inverse)


def _side(free: FreeParameter, value: float) -> Literal["", "lower", "upper"]:
    """Return the bound on which a nonlinear parameter is; linear parameters have the model's conditions."""
    if free.linear:
        return ""
    low, high, at = (float(free.to_search(v)) for v in (free.lower, free.upper, value))
    margin = 1e-6 * (high - low)
    if at <= low + margin:
        return "lower"
    return "upper" if at >= high - margin else ""


def _percent(error: float, value: float) -> float:
    """Return an error in percent of a value."""
    return 100.0 * float(error) / abs(value) if value else float("inf")
