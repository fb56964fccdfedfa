"""Fit an actuation (delay, lags and magnetic hysteresis) to step responses or to whole runs.

Magnetic hysteresis means that a falling command causes a larger force than an equal rising command. If the
command is constant between steps, a linear regression of the force error yields the half width of the
hysteresis loop. Otherwise the half width is fitted to the force of whole runs. In both cases, overshoot of
the driver can hide hysteresis but never increases the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    ResponseTimes,
    SteppedRun,
    mean_response_times,
    mean_time,
    model_times,
)
from mrdamper.identify.settings import NUMERICS
from mrdamper.models.actuation import HYSTERESIS_WEIGHT, Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate
from mrdamper.runtime.pool import Pool, thread_count

LAGS = ("rise_s", "fall_s", "second_s", "delay_s")

Residual = Callable[[Sequence[FloatArray]], FloatArray]
"""Function that returns the residual vector of a fit for the simulated forces of all runs."""


class ParameterFit(NamedTuple):
    """Result of a least-squares fit of delay and lags between command and force."""

    actuation: Actuation
    standard_errors: dict[str, float]  # key: name of the fitted parameter; NaN if its value is on a bound
    cost: float  # half the sum of the squared residuals


class LaggedForces:
    """Simulate the forces of runs for trial values of delay and lags, and compute the residual of a fit.

    The command is constant within a sample interval, so that it steps at the samples. ``residual`` is by
    default the force error at the scored samples of each run, divided by the rms force of the run and by the
    square root of the number of samples. All runs then have equal weight.
    """

    def __init__(
        self, still: Damper, runs: Sequence[PreparedRun], oversampling: int, residual: Residual | None = None
    ) -> None:
        self._still, self._oversampling, self._runs = still, oversampling, runs
        self._drives = [open_drive(run.trajectory) for run in runs]
        self.command_max = largest_command(runs)
        self.residual = residual or self._relative_errors

    def lag_commands(self, lags: Actuation) -> list[FloatArray]:
        """Return the effective command after the lags [A or V] for each run."""
        count = self._oversampling
        paths = [drive.trajectory for drive in self._drives]
        return [lags.apply(np.repeat(path.command, count), path.step / count)[::count] for path in paths]

    def forces_at_commands(self, applied: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the force [N] of each run for given effective commands [A or V]."""
        return [
            simulate(
                self._still, replace(drive, trajectory=replace(drive.trajectory, command=at), constant=None)
            )
            for drive, at in zip(self._drives, applied, strict=True)
        ]

    def forces_at_lags(self, lags: Actuation) -> list[FloatArray]:
        """Return the force [N] of each run with the given delay and lags of the command."""
        return self.forces_at_commands(self.lag_commands(lags))

    def rmse_N(self, lags: Actuation) -> float:
        """Return the RMS force error [N] over all scored samples with the given delay and lags."""
        return rms(np.concatenate(self._scored_errors(self.forces_at_lags(lags))))

    def _scored_errors(self, forces: Sequence[FloatArray]) -> list[FloatArray]:
        return [(force - run.force)[run.scored_from :] for run, force in zip(self._runs, forces, strict=True)]

    def _relative_errors(self, forces: Sequence[FloatArray]) -> FloatArray:
        sizes_N = (rms(run.force) * math.sqrt(len(run)) for run in self._runs)
        errors = zip(self._scored_errors(forces), sizes_N, strict=True)
        return np.concatenate([error / size for error, size in errors])


def largest_command(runs: Sequence[PreparedRun]) -> float:
    """Return the largest magnitude of the command [A or V] of all runs."""
    return max(float(np.abs(run.trajectory.command).max()) for run in runs)


def _search_range(
    name: str, command_max: float, settings: ActuationSettings
) -> tuple[float, float, float, float, bool]:
    """Return the range of a parameter in the search: lower and upper bound, scale, margin, ``is_log``.

    The margin is the minimum distance of the initial value from the bounds. If ``is_log`` is True, the search
    varies the logarithm of the parameter. Scale and margin then refer to the logarithm.
    """
    if name in ("hysteresis_width_A", "wide_hysteresis_width_A"):
        return 0.0, command_max, 0.02 * command_max, 0.0, False
    if name == "saturation":
        return settings.saturation_min * command_max, settings.saturation_max * command_max, 0.3, 0.0, True
    if name == "second_s":
        return 0.0, settings.lag_max_s, 2e-3, 1e-4, False
    if name == "delay_s":
        return 0.0, settings.delay_max_s, 1e-3, 1e-4, False
    return settings.lag_min_s, settings.lag_max_s, 0.3, 0.1, True


def fit_parameters(
    lagged: LaggedForces,
    start: Actuation,
    parameter_names: Sequence[str],
    settings: ActuationSettings,
    evaluation_count_max: int | None = None,
) -> ParameterFit:
    """Fit the named parameters of an actuation (delay and lags of the force) by nonlinear least squares.

    All other parameters keep their values in ``start``.

    The force of the law follows the effective command almost without delay. Therefore the derivative of the
    force with respect to a parameter is approximated by the chain rule: the derivative with respect to the
    effective command, times the derivative of this command with respect to the parameter. One additional
    simulation is then sufficient for all parameters.

    Standard errors assume independent residuals. They are NaN for parameters on a bound.
    """
    from scipy.optimize import least_squares  # Loading this module takes a quarter of a second.

    ranges = [_search_range(name, lagged.command_max, settings) for name in parameter_names]
    lower, upper, scales, margins, logs = map(np.array, zip(*ranges, strict=True))
    values = np.array([getattr(start, name) for name in parameter_names])
    values[logs] = np.log(np.maximum(values, lower)[logs])
    lower[logs], upper[logs] = np.log(lower[logs]), np.log(upper[logs])
    command_step = NUMERICS.command_step_ratio * (lagged.command_max or 1.0)

    def actuation(point: FloatArray) -> Actuation:
        numbers = np.where(logs, np.exp(point), point).tolist()
        return replace(start, **dict(zip(parameter_names, numbers, strict=True)))

    @lru_cache(maxsize=2)
    def simulated(point: bytes) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
        applied = lagged.lag_commands(actuation(np.frombuffer(point)))
        forces = lagged.forces_at_commands(applied)
        return applied, forces, lagged.residual(forces)

    def residual_at(point: FloatArray) -> FloatArray:
        return simulated(point.tobytes())[2]

    def jacobian(point: FloatArray) -> FloatArray:
        applied, forces, before = simulated(point.tobytes())
        stepped = lagged.forces_at_commands([at + command_step for at in applied])
        slopes = [(other - force) / command_step for other, force in zip(stepped, forces, strict=True)]
        steps = NUMERICS.parameter_step_ratio * scales * np.where(point < 0.5 * (lower + upper), 1.0, -1.0)
        columns = []
        for step, neighbour in zip(steps, point + np.diag(steps), strict=True):
            runs = zip(forces, slopes, lagged.lag_commands(actuation(neighbour)), applied, strict=True)
            forces_there = [f + slope * (to - at) for f, slope, to, at in runs]
            columns.append((lagged.residual(forces_there) - before) / step)
        return np.stack(columns, axis=1)

    result = least_squares(
        residual_at,
        np.clip(values, lower + margins, upper - margins),
        jac=jacobian,
        bounds=(lower, upper),
        x_scale=scales,
        xtol=settings.tolerance,
        ftol=settings.tolerance,
        max_nfev=evaluation_count_max,
    )
    span, errors = upper - lower, np.full(len(ranges), np.nan)
    free = (result.x > lower + 1e-6 * span) & (result.x < upper - 1e-6 * span)
    columns = np.asarray(result.jac)[:, free]
    variance = 2.0 * result.cost / max(len(result.fun) - int(free.sum()), 1)
    errors[free] = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(columns.T @ columns)), 0.0))
    errors[logs] *= np.exp(result.x[logs])
    return ParameterFit(
        actuation(result.x), dict(zip(parameter_names, errors.tolist(), strict=True)), result.cost
    )


def fit_lags(
    lagged: LaggedForces,
    start: Actuation | None,
    settings: ActuationSettings,
    parameter_names: Sequence[str] = LAGS,
) -> ParameterFit:
    """Fit delay and lags from ``start``. With None, the fit starts from several default values.

    ``parameter_names`` can also contain the half width of one hysteresis loop, which otherwise is zero.
    """
    starts = [Actuation(lag_s, lag_s, 0.3 * lag_s, 0.1 * lag_s) for lag_s in settings.lag_start_s]
    if start is not None:
        starts = [Actuation(**{name: getattr(start, name) for name in parameter_names})]
    pool, names = Pool(thread_count()), parameter_names
    fits = pool.map(lambda first: fit_parameters(lagged, first, names, settings), starts)
    return min(fits, key=lambda fit: fit.cost)


def fit_lags_to_responses(
    still: Damper, runs: Sequence[SteppedRun], start: Actuation | None, settings: ActuationSettings
) -> tuple[ParameterFit, ResponseTimes]:
    """Fit delay and lags to measured step responses; return the fit and the measured response times.

    After the fit, the time constants of rise and fall are corrected a few times, so that the mean simulated
    time to 63 % approaches the mean measured time. The standard errors of rise and fall include the scatter
    of repeated steps. The search begins at ``start`` if it is given.
    """

    def residual(forces: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate(
            [
                (response.model_fraction(force) - response.fraction) * np.abs(response.size_N)
                for (_, responses), force in zip(runs, forces, strict=True)
                for response in responses
            ]
        )

    lagged = LaggedForces(still, [run for run, _ in runs], settings.oversampling, residual)
    fit = fit_lags(lagged, start, settings)
    lags, errors = fit.actuation, fit.standard_errors
    for _ in range(settings.time_correction_count):
        times = model_times(runs, lagged.forces_at_lags(lags), settings)
        measured = mean_response_times([step for step, _ in times], settings)
        up_s, down_s = (
            mean_time([(step.levels, s) for step, s in times if step.upwards == upwards]).mean_s
            for upwards in (True, False)
        )
        rise_s = _lengthen(lags.rise_s, measured.up.mean_s - up_s, settings)
        fall_s = _lengthen(lags.fall_s, measured.down.mean_s - down_s, settings)
        lags = replace(lags, rise_s=rise_s, fall_s=fall_s)
    for name, time in (("rise_s", measured.up), ("fall_s", measured.down)):
        errors[name] = math.hypot(errors[name], time.repeat_error_s)
    return fit._replace(actuation=lags), measured


def _lengthen(lag_s: float, by_s: float, settings: ActuationSettings) -> float:
    """Return the sum of ``lag_s`` and ``by_s``, limited to 0.3 to 3 times the lag and to the search bounds.

    If ``by_s`` is NaN, the lag is unchanged.
    """
    if not np.isfinite(by_s):
        return lag_s
    lower_s, upper_s = max(0.3 * lag_s, settings.lag_min_s), min(3.0 * lag_s, settings.lag_max_s)
    return float(np.clip(lag_s + by_s, lower_s, upper_s))


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
    widths, errors = np.array([_half_width(each) for each in sums]).T
    surest = int(np.argmax(widths - settings.hysteresis_agreement * errors))
    is_agreeing = widths[surest] - widths <= settings.hysteresis_agreement * np.hypot(errors[surest], errors)
    width, error = _half_width(np.sum(np.array(sums)[is_agreeing], axis=0))
    return max(width, 0.0), error


def _half_width(sums: FloatArray) -> tuple[float, float]:
    """Return half width and standard error [A or V] from ``_regression_sums``."""
    effect_squares, products, error_squares, freedom = sums
    half_width = products / effect_squares
    residual = max(error_squares - half_width * products, 0.0)
    return float(half_width), float(np.sqrt(residual / max(freedom - 1, 1) / effect_squares))


def _regression_sums(damper: Damper, run: PreparedRun, settings: ActuationSettings) -> FloatArray | None:
    """Return the sums of the regression for the half width; None if too few samples have settled.

    The *effect* is the derivative of the force with
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
