"""A fit without each motion in turn, and what follows from it: a force band, and errors of the parameters.

Standard errors from the residuals of the runs hold for more runs of the same motions. Another motion asks a
law that is not quite right for other parameters; how far these go is seen when motions are left out. Every
fit begins at the fit to all runs and takes a few steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.limits import brought_inside
from mrdamper.identify.motions import Fold, folds_of, motion_groups
from mrdamper.identify.problem import Estimate, FitProblem, FitResult, PreparedFit, envelope_of
from mrdamper.identify.search.descent import Box, Descents
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.uncertainty import covariances
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand, LeftOut, MotionSize, width_unit
from mrdamper.models.simulate import simulate_each

_STEPS = 2  # of Levenberg-Marquardt, from the fit to all runs; four change the band by 2 %
_SHARE = 0.9  # of the samples inside the band
# Chosen on one family of real runs and even draws of the virtual damper (docs/believe.md).
_RUN_SHARE = 0.15  # of a run's rms force in the band's width where the force passes zero,
_BASE_SHARE = 0.1  # of the rms force of the usual run, where a run's force is small,
_SPREAD = 0.4  # standard deviations over folds that are added to the mean of their quantiles,
_WIDENING = 1.5  # of the band's width, for each e-fold that a motion is farther away than left-out ones were


@dataclass(frozen=True, slots=True, eq=False)
class _Missed:
    """A run under a fit that has not seen it: force of the model and error [N], scored samples."""

    force: FloatArray
    error: FloatArray

    @property
    def nrmse_percent(self) -> float:
        return 100.0 * rms(self.error) / float(np.std(self.force + self.error))


@dataclass(frozen=True, slots=True, eq=False)
class RefittedFolds:
    """Each fold with the damper fitted to all but it, and what that damper misses by on it.

    ``share`` is what the fit to all runs is expected to miss of that: it has seen more than the fits without
    a fold. ``motions`` are those of all runs where motions were left out, and ``distance`` is what theirs was
    to the nearest that was fitted, mean over runs.
    """

    kind: LeftOut
    dampers: tuple[Damper, ...]
    missed: tuple[tuple[_Missed, ...], ...]
    share: float
    motions: tuple[MotionSize, ...] = ()
    distance: float = 0.0


def leave_folds_out(problem: FitProblem, result: FitResult) -> RefittedFolds | None:
    """Return the fits without each fold of the problem's runs; None where fewer than two succeed.

    The mean squared error of a fit to all runs on new ones is that on what was left out, less what the fits
    without a fold miss more than it on all runs together (Burman's correction of cross-validation, Biometrika
    76 (1989) 503).
    """
    runs, whole = problem.prepare(), Objective(problem, problem.prepare())
    folds = folds_of(problem.runs)
    envelope = envelope_of(problem.runs)
    every = Fold("", tuple(range(len(runs))))
    dampers, missed, on_all = [], [], []
    for fold in folds:
        damper = _refitted(problem, result, fold.training(runs), whole)
        if damper is None:
            continue
        inside = brought_inside(damper, envelope)[0]
        dampers.append(damper)
        missed.append(_missed(inside, [runs[k] for k in fold.runs], fold))
        on_all.append(_mean_square(_missed(inside, runs, every)))
    if len(dampers) < 2:
        return None
    motions = len(motion_groups(problem.runs)) > 1
    kind: LeftOut = "motions" if motions else "commands" if folds[0].whole else "blocks of time"
    left_out = _mean_square([run for fold in missed for run in fold])
    fitted = _mean_square(_missed(brought_inside(result.damper, envelope)[0], runs, every))
    corrected = max(left_out + fitted - float(np.mean(on_all)), fitted)
    share = math.sqrt(corrected / left_out) if 0.0 < corrected < left_out else 1.0
    sizes, distance = _distances(problem.runs, folds) if motions else ((), 0.0)
    return RefittedFolds(kind, tuple(dampers), tuple(missed), share, sizes, distance)


def _distances(runs: Sequence[PreparedRun], folds: Sequence[Fold]) -> tuple[tuple[MotionSize, ...], float]:
    """Return the motions of runs, each once, and how far those of a fold are from the nearest other one."""
    sizes = [MotionSize.of(run.trajectory) for run in runs]
    away = [
        sizes[k].distance([each for j, each in enumerate(sizes) if j not in fold.runs])
        for fold in folds
        for k in fold.runs
    ]
    return tuple(sizes[group[0]] for group in motion_groups(runs)), float(np.mean(away))


def _mean_square(missed: Sequence[_Missed]) -> float:
    """Return the mean over runs of the squared error [%^2]."""
    return float(np.mean([run.nrmse_percent**2 for run in missed]))


def _refitted(
    problem: FitProblem, result: FitResult, runs: Sequence[PreparedFit], whole: Objective
) -> Damper | None:
    """Return the damper a few steps from a fit towards the best one on other runs."""
    objective, box = Objective(problem, runs, like=whole), Box.of(problem)
    values, linear = objective.candidate_of(result.damper)
    offsets = np.array([[result.offsets_N.get(session, 0.0) for session in objective.sessions]])
    descent = Descents(objective, box.to_search(values[0])[None], linear, offsets, most=_STEPS)
    descent.run()
    if not math.isfinite(descent.costs[0]):
        return None
    found = np.concatenate([box.to_physical(descent.points[0]), descent.linear[0]]).tolist()
    names = (*objective.nonlinear, *objective.linear)
    return result.damper.with_parameters(dict(zip(names, found, strict=True)))


def _missed(damper: Damper, runs: Sequence[PreparedFit], fold: Fold) -> tuple[_Missed, ...]:
    found = []
    for run, force in zip(runs, simulate_each(damper, [run.drive for run in runs]), strict=True):
        part = fold.scored(run.start, len(force))
        found.append(_Missed(force[part], run.force[part] - force[part]))
    return tuple(found)


def force_band(left: RefittedFolds) -> ForceBand:
    """Return the band that holds 90 % of the samples of a motion that was left out.

    The factor is the mean over folds of the 90 % quantile of |error| over the width of a band of factor one,
    and 0.4 standard deviations over folds.
    """
    runs = [run for fold in left.missed for run in fold]
    base = _BASE_SHARE * float(np.median([rms(run.force) for run in runs]))
    quantiles = [
        np.quantile(
            np.concatenate([np.abs(r.error) / width_unit(r.force, _RUN_SHARE, base) for r in fold]), _SHARE
        )
        for fold in left.missed
    ]
    errors = [run.nrmse_percent for run in runs]
    return ForceBand(
        share=_SHARE,
        factor=float(np.mean(quantiles) + _SPREAD * np.std(quantiles, ddof=1)),
        run_share=_RUN_SHARE,
        base_N=base,
        expected_nrmse_percent=left.share * float(np.median(errors)),
        worst_nrmse_percent=max(errors),
        left_out=left.kind,
        folds=len(left.missed),
        motions=left.motions,
        usual_distance=left.distance,
        widening=_WIDENING if left.motions else 0.0,
    )


def across_motions(problem: FitProblem, result: FitResult, left: RefittedFolds) -> tuple[Estimate, ...]:
    """Return the estimates with standard errors that hold for other motions as well.

    The largest of three: as it was (the residuals of these runs); a sandwich whose clusters are motions; the
    jackknife over the folds that were left out. The latter two with the factor of Student's t for 90 %, since
    motions are few. Parameters that rest on a bound keep none.
    """
    estimates = result.estimates
    moving = [k for k, each in enumerate(estimates) if not math.isnan(each.standard_error)]
    if not moving:
        return estimates
    names = [estimates[k].name for k in moving]
    jackknife = _jackknife(left.dampers, names)
    sandwich = np.zeros(len(names))
    groups = motion_groups(problem.runs)
    if len(groups) > 1:
        cluster = np.zeros(len(problem.runs), dtype=np.intp)
        for k, group in enumerate(groups):
            cluster[list(group)] = k
        runs = problem.prepare()
        by_motion = covariances(runs, result.damper, names, result.offsets_N, cluster.tolist())[1]
        sandwich = np.sqrt(np.maximum(np.diag(by_motion), 0.0)) * _t_factor(len(groups))
    made = list(estimates)
    for k, other in zip(moving, np.maximum(jackknife, sandwich).tolist(), strict=True):
        made[k] = replace(estimates[k], standard_error=max(estimates[k].standard_error, other))
    return tuple(made)


def _jackknife(dampers: Sequence[Damper], names: Sequence[str]) -> FloatArray:
    """Return the jackknife's standard errors of parameters from their values without each fold."""
    values = np.array([[damper.parameters_and_lag[name] for name in names] for damper in dampers])
    count = len(values)
    spread = np.sum((values - values.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((count - 1) / count * spread) * _t_factor(count))


def _t_factor(groups: int) -> float:
    """Return the 95 % point of Student's t for so many groups over that of the normal distribution."""
    return _student_95(groups - 1) / 1.644854


def _student_95(freedom: int) -> float:
    """Return the 95 % point of Student's t: sqrt(freedom) tan(a), with 90 % of its upper half from 0 to a.

    The density over the angle is cos(a)^(freedom - 1). SciPy's function takes a sixth of a second to load.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)

    def share(angle: float) -> float:
        density = np.cos(0.5 * angle * (nodes + 1.0)) ** (freedom - 1)
        return angle * float(weights @ density)

    low, high = 0.0, 0.5 * np.pi
    whole = share(high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share(middle) < 0.9 * whole else (low, middle)
    return float(np.sqrt(freedom) * np.tan(high))
