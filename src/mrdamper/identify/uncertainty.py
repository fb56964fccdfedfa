"""Uncertainty of fitted parameters: standard errors, correlations, bounds that were reached.

Residuals of a real run hang together in time, so the usual covariance (independent noise) is far too
small. The reported standard error is the larger of that and of a sandwich over blocks of half a cycle
(between two reversals), inside which anything may be correlated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, inverse_sizes, pseudoinverse
from mrdamper.identify.problem import Estimate, FitProblem, FreeParameter, PreparedFit
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.tangents import Tangents


def estimates_of(
    problem: FitProblem,
    runs: Sequence[PreparedFit],
    damper: Damper,
    offsets: Mapping[str, float],
    *,
    with_errors: bool = True,
) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Return every free parameter with its errors, and their correlation matrix (NaN on a bound).

    Without errors both are NaN throughout.
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
    if names and with_errors:
        independent, blocks = covariances(runs, damper, names, offsets)
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
    runs: Sequence[PreparedFit],
    damper: Damper,
    names: Sequence[str],
    offsets: Mapping[str, float],
    clusters: Sequence[int] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of the parameters for independent residuals, and by blocks of half a cycle.

    With ``clusters``, the number of each run's, the second is by clusters of whole runs.
    """
    size = len(names)
    together = np.zeros((0 if clusters is None else max(clusters) + 1, size))
    curvature = np.zeros((size, size))
    noise = np.zeros((size, size))
    blocks = np.zeros((size, size))
    count = 0
    tangents = Tangents(damper, names, [run.drive for run in runs])
    for index, run in enumerate(runs):
        s = tangents.along(index)
        columns = s.columns[:, run.start :]
        residual = (run.force - s.force - offsets.get(run.session, 0.0))[run.start :]
        squares = s.combine @ core.gram(s.columns, run.start) @ s.combine.T
        curvature += run.weight * squares
        noise += run.weight**2 * float(np.mean(residual**2)) * squares
        if clusters is not None:
            together[clusters[index]] += run.weight * (s.combine @ (columns @ residual))
            continue
        cuts = np.array([first for first, _, _ in run.drive.record.pieces])
        cuts = np.unique(np.concatenate([[0], cuts[cuts > run.start] - run.start])).astype(np.intp)
        scores = run.weight * (s.combine @ np.add.reduceat(columns * residual, cuts, axis=1))
        blocks += scores @ scores.T
        count += len(cuts)
    inverse = pseudoinverse(curvature)
    if clusters is not None:
        groups = len(together)
        by_cluster: FloatArray = groups / max(groups - 1, 1) * (inverse @ together.T @ together @ inverse)
        return inverse @ noise @ inverse, by_cluster
    small_sample = count / max(count - size, 1)
    return inverse @ noise @ inverse, small_sample * (inverse @ blocks @ inverse)


def _side(free: FreeParameter, value: float) -> Literal["", "lower", "upper"]:
    """Return the bound that a searched parameter sits on; eliminated ones have the law's conditions."""
    if free.linear:
        return ""
    low, high, at = (float(free.to_search(v)) for v in (free.lower, free.upper, value))
    margin = 1e-6 * (high - low)
    if at <= low + margin:
        return "lower"
    return "upper" if at >= high - margin else ""


def _percent(error: float, value: float) -> float:
    return 100.0 * float(error) / abs(value) if value else float("inf")
