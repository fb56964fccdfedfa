"""Estimate the magnetic hysteresis: a falling command causes a larger force than an equal rising command.

If the command is constant between steps, a linear regression of the force error yields the half width of the
hysteresis loop. If the command changes continuously, the half width is fitted to the force of whole runs. In
both cases, overshoot of the driver can hide hysteresis but never increases the estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.least_squares import LaggedForces, fit_parameters
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.models.actuation import HYSTERESIS_WEIGHT, Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate


def fit_hysteresis_at_levels(
    damper: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> tuple[float, float]:
    """Fit the half width of the magnetic hysteresis to runs with stepped commands.

    Return half width and standard error [A or V], or 0 and NaN if no run has enough settled samples after
    rising and falling steps. Overshoot hides a part of the hysteresis in some runs. Therefore the run with
    the largest lower confidence limit of the half width is the reference. Runs with a significantly smaller
    half width than the reference are ignored. The other runs are averaged.
    """
    sums = [each for run in runs if (each := _regression_sums(damper, run, settings)) is not None]
    if not sums:
        return 0.0, float("nan")
    widths, errors = np.array([_half_width(*each) for each in sums]).T
    surest = int(np.argmax(widths - settings.hysteresis_agreement * errors))
    is_agreeing = widths[surest] - widths <= settings.hysteresis_agreement * np.hypot(errors[surest], errors)
    width, error = _half_width(*np.sum(np.array(sums)[is_agreeing], axis=0))
    return max(width, 0.0), error


def _half_width(
    effect_squares: float, products: float, error_squares: float, freedom: float
) -> tuple[float, float]:
    """Return half width and standard error [A or V] from ``_regression_sums``."""
    half_width = products / effect_squares
    residual = max(error_squares - half_width * products, 0.0)
    return float(half_width), float(np.sqrt(residual / max(freedom - 1, 1) / effect_squares))


def fit_hysteresis_over_runs(
    still: Damper, lags: Actuation, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> tuple[Actuation, float]:
    """Fit the half width of the magnetic hysteresis to whole runs.

    Return ``lags`` with the fitted half width, and its standard error [A or V].
    """
    lagged = LaggedForces(still, runs, settings.run_oversampling)
    start_A = np.clip(lags.hysteresis_width_A, 1e-3 * lagged.command_max, 0.5 * lagged.command_max)
    start = replace(lags, hysteresis_width_A=float(start_A))
    fit = fit_parameters(lagged, start, ("hysteresis_width_A",), settings)
    return fit.actuation, fit.standard_errors["hysteresis_width_A"]


def _regression_sums(damper: Damper, run: PreparedRun, settings: ActuationSettings) -> FloatArray | None:
    """Return the sums of the linear regression that fits the half width to one run.

    Return None if the run has too few settled samples. The *effect* is the derivative of the force with
    respect to the half width, and zero for a command that was reached from below. The regression explains the
    force error by the half width times the effect, plus one offset for each command value and direction of
    motion. The result has the sums of squared effects, of effect times force error and of squared force
    errors, and the number of samples minus the number of offsets.
    """
    path = run.trajectory
    span = float(np.ptp(path.command))
    if span == 0.0 or np.min(path.command) < 0.0:
        return None
    step = 0.01 * span
    force = simulate(damper, path)
    slope = (simulate(damper, replace(path, command=path.command + step)) - force) / step
    # Rising and falling commands differ by two half widths. Only a part of the field has hysteresis.
    slope *= 2.0 * HYSTERESIS_WEIGHT
    last_change, since_s = _last_change(path.command, path.step)
    settled = (since_s >= settings.settling_time_s) & (np.arange(len(force)) >= run.scored_from)
    parts = []
    for level in np.unique(np.round(path.command[settled], 6)):
        for side in (-1.0, 1.0):
            here = settled & (np.abs(path.command - level) < 1e-6 * max(span, 1.0))
            here &= np.sign(path.velocity) == side
            if here.any():  # Omit samples near reversals, because the law has larger errors there.
                here &= side * slope > 0.9 * float(np.quantile(side * slope[here], 0.9))
            counts = [np.count_nonzero(here & (last_change == sign)) for sign in (-1.0, 1.0)]
            if min(counts) < settings.level_sample_count_min:
                continue
            error = (run.force - force)[here]
            effect = np.where(last_change[here] < 0.0, slope[here], 0.0)
            error, effect = error - error.mean(), effect - effect.mean()
            parts.append((effect @ effect, effect @ error, error @ error, len(error) - 1))
    total = np.sum(parts, axis=0) if parts else np.zeros(4)
    return total if total[0] > 0.0 else None


def _last_change(command: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the sign of the last command change (0 before the first change), and the time since then [s]."""
    change, samples = np.diff(command, prepend=command[0]), np.arange(len(command))
    last = np.maximum.accumulate(np.where(change != 0.0, samples, -1))
    sign = np.where(last >= 0, np.sign(change[np.maximum(last, 0)]), 0.0)
    return sign, np.where(last >= 0, (samples - last) * step_s, np.inf)
