"""Cross-validation over motions: compute a force band and standard errors that are valid for new motions.

Standard errors from the residuals are valid only for repetitions of the same motions. Because the model
equations are not exact, a new motion would be fitted with different parameters. Refits that each omit one
fold (a group of motions) show how much the parameters change. Each refit starts at the fit to all runs and
makes a few steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from mrdamper.arrays import FloatArray, inverse_sizes, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError
from mrdamper.identify.confidence.settings import SETTINGS
from mrdamper.identify.limits import make_feasible
from mrdamper.identify.motions import Fold, block_count, fold_content, folds_of, motion_groups
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import descend
from mrdamper.identify.uncertainty import covariances
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand, LeftOut, MotionSize, width_unit
from mrdamper.models.simulate import simulate_each


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutError:
    """Simulated force of one run and its error [N], at the scored samples."""

    force: FloatArray
    error: FloatArray  # measured minus simulated force

    @property
    def nrmse_percent(self) -> float:
        """RMS error in percent of the standard deviation of the measured force."""
        return 100.0 * rms(self.error) / float(np.std(self.force + self.error))


@dataclass(frozen=True, slots=True, eq=False)
class RefittedFolds:
    """For each fold (group of runs), the damper refitted without this fold, and its errors on the fold."""

    kind: LeftOut  # what each fold holds out: motions, currents or time blocks
    dampers: tuple[Damper, ...]  # one damper for each fold
    errors: tuple[tuple[HeldOutError, ...], ...]  # errors of the held-out runs, for each fold
    expected_ratio: float  # expected error of the fit to all runs, divided by the held-out error [-]
    motions: tuple[MotionSize, ...] = ()  # sizes of all motions of the runs, if motions were held out
    distance: float = 0.0  # mean distance of a held-out run to the nearest fitted motion [-]


def refit_without_folds(problem: FitProblem, result: SearchResult) -> RefittedFolds | None:
    """Refit the damper once for each fold, without the data of this fold.

    Return None if fewer than two refits succeed. The fit to all runs uses more data than each refit.
    Therefore the fit to all runs is expected to have a smaller mean squared error on new runs than the
    refits. The expected error is the held-out error, minus the mean error of the refits on all runs, plus the
    error of the fit on all runs (corrected cross-validation, Burman, Biometrika 76 (1989) 503).
    """
    folds = folds_of(problem.runs)
    windows = problem.windows(blocks=block_count(folds))
    dampers, held_out_errors, errors_on_all = [], [], []
    for fold in folds:
        objective = Objective(problem, fold.training(windows))
        try:
            damper, _ = descend(objective, [result.damper], SETTINGS.refit_steps)
        except ConvergenceError:
            continue
        dampers.append(damper)
        held_out_errors.append(_errors_on(damper, [window for window in windows if fold.holds_out(window)]))
        errors_on_all.append(_mean_square(_errors_on(damper, windows)))
    if len(dampers) < 2:
        return None
    kind = fold_content(problem.runs, folds)
    held_out = _mean_square([run for fold in held_out_errors for run in fold])
    fitted = _mean_square(_errors_on(make_feasible(problem, result.damper), windows))
    corrected = max(held_out + fitted - float(np.mean(errors_on_all)), fitted)
    expected_ratio = math.sqrt(corrected / held_out) if 0.0 < corrected < held_out else 1.0
    sizes, distance = _motion_distances(problem.runs, folds) if kind == "motions" else ((), 0.0)
    return RefittedFolds(kind, tuple(dampers), tuple(held_out_errors), expected_ratio, sizes, distance)


def force_band(folds: RefittedFolds) -> ForceBand:
    """Return the force band, which is expected to contain 90 % of the samples of a held-out motion.

    The half width of the band is a factor times a fixed function of the force (``width_unit``). Each fold
    needs a different factor to contain 90 % of its held-out samples. The factor of the band is the mean of
    these factors plus a multiple of their standard deviation.
    """
    runs = [run for fold in folds.errors for run in fold]
    base = SETTINGS.band_base_ratio * float(np.median([rms(run.force) for run in runs]))
    run_ratio = SETTINGS.band_run_ratio
    quantiles = [
        np.quantile(
            np.concatenate([np.abs(r.error) / width_unit(r.force, run_ratio, base) for r in fold]),
            SETTINGS.band_coverage,
        )
        for fold in folds.errors
    ]
    errors = [run.nrmse_percent for run in runs]
    return ForceBand(
        share=SETTINGS.band_coverage,
        factor=float(np.mean(quantiles) + SETTINGS.band_spread * np.std(quantiles, ddof=1)),
        run_share=run_ratio,
        base_N=base,
        expected_nrmse_percent=folds.expected_ratio * float(np.median(errors)),
        worst_nrmse_percent=max(errors),
        left_out=folds.kind,
        folds=len(folds.errors),
        motions=folds.motions,
        usual_distance=folds.distance,
        widening=SETTINGS.band_widening if folds.motions else 0.0,
    )


def with_changing_current(
    band: ForceBand,
    damper: Damper,
    runs: Sequence[PreparedRun],
) -> ForceBand:
    """Return the force band with an additional factor for runs with changing current.

    If the current changes, the delay model causes additional errors. Each run therefore needs a wider band to
    contain 90 % of its samples. The additional factor is the mean of the required increases of the width plus
    a multiple of their standard deviation, and at least 1.
    """
    ratios = []
    for run, force in zip(runs, simulate_each(damper, [run.trajectory for run in runs]), strict=True):
        scored = slice(run.scored_from, None)
        width = band.half_width(force[scored], band.widened(run.trajectory))
        errors = np.abs(run.force - force)[scored]
        ratios.append(float(np.quantile(errors / width, SETTINGS.band_coverage)))
    spread = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else 0.0
    ratio = float(np.mean(ratios)) + SETTINGS.band_spread * spread
    return replace(band, changing_current_ratio=max(1.0, ratio))


def with_errors_between_motions(
    problem: FitProblem, result: SearchResult, folds: RefittedFolds
) -> SearchResult:
    """Return the fit with standard errors and a covariance that are also valid for new motions.

    Each standard error is the largest of three estimates: from the residuals of the runs, from the sandwich
    estimator with motions as clusters, and from the jackknife over the folds. The last two estimates are
    multiplied by a Student's t factor because there are few motions.

    The covariance matrix is the sum of the three estimated matrices, scaled so that its diagonal agrees with
    the standard errors. The sum is used because the last two matrices are singular: their rank is below the
    number of motions or folds. The largest matrix dominates the correlations. The standard errors of
    parameters on a bound stay NaN.
    """
    estimates = result.estimates
    moving = [k for k, estimate in enumerate(estimates) if not math.isnan(estimate.standard_error)]
    if not moving:
        return result
    names = [estimates[k].name for k in moving]
    own = np.array([estimates[k].standard_error for k in moving])
    parts = [
        result.correlation[np.ix_(moving, moving)] * np.outer(own, own),
        _t_factor(len(folds.dampers)) ** 2 * _jackknife(folds.dampers, names),
    ]
    groups = motion_groups(problem.runs)
    if len(groups) > 1:
        number = {run: k for k, group in enumerate(groups) for run in group}
        windows = problem.windows()
        clusters = [number[window.run] for window in windows]
        parts.append(_t_factor(len(groups)) ** 2 * covariances(windows, result.damper, names, clusters)[1])
    total = np.sum(parts, axis=0)
    errors = np.sqrt(np.maximum(np.max([np.diag(part) for part in parts], axis=0), 0.0))
    changed = list(estimates)
    for k, error in zip(moving, errors.tolist(), strict=True):
        changed[k] = replace(estimates[k], standard_error=error)
    scale = errors * inverse_sizes(total)
    covariance = np.full((len(estimates), len(estimates)), np.nan)
    covariance[np.ix_(moving, moving)] = total * np.outer(scale, scale)
    return replace(result, estimates=tuple(changed), covariance=covariance)


def _motion_distances(
    runs: Sequence[PreparedRun], folds: Sequence[Fold]
) -> tuple[tuple[MotionSize, ...], float]:
    """Return the sizes of all motions, and the mean distance of a run to the nearest run outside its fold."""
    sizes = [MotionSize.from_motion(run.trajectory) for run in runs]
    distances = [
        sizes[k].distance([size for j, size in enumerate(sizes) if j not in fold.runs])
        for fold in folds
        for k in fold.runs
    ]
    return tuple(sizes[group[0]] for group in motion_groups(runs)), float(np.mean(distances))


def _mean_square(errors: Sequence[HeldOutError]) -> float:
    """Return the squared error [%^2], averaged over runs."""
    return float(np.mean([run.nrmse_percent**2 for run in errors]))


def _errors_on(damper: Damper, windows: Sequence[FitWindow]) -> tuple[HeldOutError, ...]:
    forces = simulate_each(damper, [window.drive for window in windows])
    return tuple(
        HeldOutError(force[window.start :], (window.force - force)[window.start :])
        for window, force in zip(windows, forces, strict=True)
    )


def _jackknife(dampers: Sequence[Damper], names: Sequence[str]) -> FloatArray:
    """Return the jackknife covariance matrix of parameters, computed from the refitted dampers."""
    values = np.array([[damper.parameters_and_lag[name] for name in names] for damper in dampers])
    deviations = values - values.mean(axis=0)
    return np.asarray((len(values) - 1) / len(values) * deviations.T @ deviations)


def _t_factor(groups: int) -> float:
    """Return the ratio of the 95 % points of Student's t distribution and the normal distribution.

    The t distribution has ``groups`` - 1 degrees of freedom.
    """
    return float(stdtrit(groups - 1, 0.95)) / 1.644854  # 95 % quantile of the normal distribution
