"""Least-squares fits of an actuation: lags to step responses, and parameters to the force over whole runs."""

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
    mean_time,
    measured_times,
    model_times,
)
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate

COMMAND_STEP_RATIO = 0.01  # Step of the derivative of the force by the command [largest command].
DIFFERENCE_RATIO = 0.01  # Step of the derivatives by the parameters [scale of the parameter].


class SearchParameter(NamedTuple):
    """A parameter of an actuation in a search; ``scale`` and ``margin`` are logarithmic if ``is_log``."""

    name: str
    lower: float
    upper: float
    scale: float
    is_log: bool
    margin: float = 0.0  # The search starts at least so far from the bounds.


class ParameterFit(NamedTuple):
    """The fitted actuation, the standard errors of its fitted parameters, and half the sum of squares."""

    actuation: Actuation
    standard_errors: dict[str, float]
    cost: float


class LaggedForces:
    """Forces of a damper behind an actuation along several drives. The command jumps at its samples."""

    def __init__(self, still: Damper, drives: Sequence[Drive], oversampling: int) -> None:
        self._still, self._drives, self._oversampling = still, tuple(drives), oversampling
        largest = max(float(np.abs(drive.trajectory.command).max()) for drive in drives)
        self._command_step = COMMAND_STEP_RATIO * (largest or 1.0)

    def applied(self, lags: Actuation) -> list[FloatArray]:
        """Return the command that the law feels [A or V] along each drive."""
        count = self._oversampling
        paths = [drive.trajectory for drive in self._drives]
        return [lags.applied(np.repeat(path.command, count), path.step / count)[::count] for path in paths]

    def at_commands(self, applied: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the forces [N] at applied commands."""
        return [
            simulate(
                self._still, replace(drive, trajectory=replace(drive.trajectory, command=at), constant=None)
            )
            for drive, at in zip(self._drives, applied, strict=True)
        ]

    def behind(self, lags: Actuation) -> list[FloatArray]:
        """Return the forces [N] behind an actuation."""
        return self.at_commands(self.applied(lags))

    def slopes(self, applied: Sequence[FloatArray], forces: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the derivatives of the forces by the applied command [N/A]."""
        step = self._command_step
        stepped = self.at_commands([at + step for at in applied])
        return [(other - force) / step for other, force in zip(stepped, forces, strict=True)]


def fit_parameters(
    lagged: LaggedForces,
    residual: Callable[[Sequence[FloatArray]], FloatArray],
    start: Actuation,
    parameters: Sequence[SearchParameter],
    tolerances: tuple[float, float],
    evaluation_count_max: int | None = None,
    *,
    with_errors: bool = True,
) -> ParameterFit:
    """Fit parameters of an actuation by nonlinear least squares. The others keep their values.

    The law follows its command almost at once. Therefore the derivative of the force by a parameter is
    approximated by the derivative by the applied command times the derivative of the applied command by the
    parameter. All parameters together need one more simulation instead of one each.

    The search ends if the relative change of the parameters or of the cost is below its tolerance. Standard
    errors use the exact derivatives. They are for independent residuals, and NaN for parameters on a bound.

    Parameters
    ----------
    lagged : simulates the runs
    residual : residual as a function of the simulated forces
    """
    from scipy.optimize import least_squares  # It takes a quarter of a second to load.

    names, lower, upper, scales, logs, margins = map(np.array, zip(*parameters, strict=True))
    values = np.array([getattr(start, name) for name in names])
    values[logs] = np.log(np.maximum(values, lower)[logs])
    lower[logs], upper[logs] = np.log(lower[logs]), np.log(upper[logs])

    def actuation(point: FloatArray) -> Actuation:
        numbers = np.where(logs, np.exp(point), point).tolist()
        return replace(start, **dict(zip(names.tolist(), numbers, strict=True)))

    @lru_cache(maxsize=2)
    def simulated(point: bytes) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
        applied = lagged.applied(actuation(np.frombuffer(point)))
        forces = lagged.at_commands(applied)
        return applied, forces, residual(forces)

    def residual_at(point: FloatArray) -> FloatArray:
        return simulated(point.tobytes())[2]

    def neighbours(point: FloatArray) -> list[tuple[float, list[FloatArray]]]:
        """Return the step of each parameter, and the applied commands behind this step."""
        steps = DIFFERENCE_RATIO * scales * np.where(point < 0.5 * (lower + upper), 1.0, -1.0)
        points = point + np.diag(steps)
        return [(float(step), lagged.applied(actuation(to))) for step, to in zip(steps, points, strict=True)]

    def approximate_jacobian(point: FloatArray) -> FloatArray:
        applied, forces, before = simulated(point.tobytes())
        slopes = lagged.slopes(applied, forces)
        columns = []
        for step, changed in neighbours(point):
            runs = zip(forces, slopes, changed, applied, strict=True)
            moved = [force + slope * (to - at) for force, slope, to, at in runs]
            columns.append((residual(moved) - before) / step)
        return np.stack(columns, axis=1)

    result = least_squares(
        residual_at,
        np.clip(values, lower + margins, upper - margins),
        jac=approximate_jacobian,
        bounds=(lower, upper),
        x_scale=scales,
        xtol=tolerances[0],
        ftol=tolerances[1],
        max_nfev=evaluation_count_max,
    )
    span, errors = upper - lower, np.full(len(names), np.nan)
    free = (result.x > lower + 1e-6 * span) & (result.x < upper - 1e-6 * span)
    if with_errors and free.any():
        moved = [(residual(lagged.at_commands(to)) - result.fun) / step for step, to in neighbours(result.x)]
        columns = np.stack(moved, axis=1)[:, free]
        variance = float(result.fun @ result.fun) / max(len(result.fun) - int(free.sum()), 1)
        covariance = variance * np.linalg.pinv(columns.T @ columns)
        errors[free] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors[logs] *= np.exp(result.x[logs])
    return ParameterFit(
        actuation(result.x), dict(zip(names.tolist(), errors.tolist(), strict=True)), result.cost
    )


class WholeRuns:
    """Whole runs for a fit. Each run is weighted by the root of the sum of its squared force."""

    def __init__(self, still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings) -> None:
        self._settings, self._runs = settings, tuple(runs)
        drives = [open_drive(run.trajectory) for run in runs]
        self._lagged = LaggedForces(still, drives, settings.run_oversampling)
        self._sizes_N = [rms(run.force) * math.sqrt(len(run)) for run in runs]

    def error(self, actuation: Actuation) -> FloatArray:
        """Return the weighted force errors at the scored samples of all runs, shape (n,)."""
        return self._residual(self._lagged.behind(actuation))

    def fit(
        self,
        start: Actuation,
        names: Sequence[str],
        largest: float,
        evaluation_count_max: int | None = None,
        *,
        with_errors: bool = True,
    ) -> ParameterFit:
        """Fit the parameters with these names; ``largest`` is the largest command [A or V]."""
        settings = self._settings
        lag = settings.lag_min_s, settings.lag_max_s, 0.3, True
        loop = 0.0, largest, 0.02 * largest, False
        saturation = settings.saturation_min * largest, settings.saturation_max * largest, 0.3, True
        kinds = {"play": loop, "wide_play": loop, "saturation": saturation}
        parameters = [SearchParameter(name, *kinds.get(name, lag)) for name in names]
        tolerances = 1e-3, 1e-4
        return fit_parameters(
            self._lagged,
            self._residual,
            start,
            parameters,
            tolerances,
            evaluation_count_max,
            with_errors=with_errors,
        )

    def _residual(self, forces: Sequence[FloatArray]) -> FloatArray:
        runs = zip(self._runs, forces, self._sizes_N, strict=True)
        return np.concatenate(
            [((force - run.force) / size_N)[run.scored_from :] for run, force, size_N in runs]
        )


def fit_lags_to_responses(
    still: Damper, runs: Sequence[SteppedRun], start: Actuation | None, settings: ActuationSettings
) -> tuple[ParameterFit, ResponseTimes]:
    """Fit the lags to measured step responses, and return the measured response times.

    Rise and fall are then corrected so that the model has the measured mean times to 63 %. Their errors
    include the scatter of repeated steps. The search begins at ``start``, if given.
    """
    lagged = LaggedForces(still, [run.drive for run in runs], settings.oversampling)

    def residual(forces: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate(
            [
                (response.model_fraction(force) - response.fraction) * np.abs(response.size_N)
                for run, force in zip(runs, forces, strict=True)
                for response in run.responses
            ]
        )

    fit = fit_lags(lagged, residual, settings.response_start_s, start, settings)
    lags, errors = fit.actuation, fit.standard_errors
    times = model_times(runs, lagged.behind(lags), settings)
    measured = measured_times([step for step, _ in times], settings)
    for count in range(settings.time_correction_count):
        if count:
            times = model_times(runs, lagged.behind(lags), settings)
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
    """Return a lag that is longer by a time, at most by a factor of about three; unchanged if it is NaN."""
    if not np.isfinite(by_s):
        return lag_s
    lower_s, upper_s = max(0.3 * lag_s, settings.lag_min_s), min(3.0 * lag_s, settings.lag_max_s)
    return float(np.clip(lag_s + by_s, lower_s, upper_s))


def fit_lags(
    lagged: LaggedForces,
    residual: Callable[[Sequence[FloatArray]], FloatArray],
    default_start_s: Sequence[float],
    start: Actuation | None,
    settings: ActuationSettings,
) -> ParameterFit:
    """Fit the lags, starting from ``start`` or from several default values if it is None."""
    lag_range, tolerances = (settings.lag_min_s, settings.lag_max_s), (settings.tolerance, settings.tolerance)
    parameters = (
        SearchParameter("rise_s", *lag_range, 0.3, is_log=True, margin=0.1),
        SearchParameter("fall_s", *lag_range, 0.3, is_log=True, margin=0.1),
        SearchParameter("second_s", 0.0, settings.lag_max_s, 2e-3, is_log=False, margin=1e-4),
        SearchParameter("delay_s", 0.0, settings.delay_max_s, 1e-3, is_log=False, margin=1e-4),
    )
    starts = [Actuation(lag_s, lag_s, 0.3 * lag_s, 0.1 * lag_s) for lag_s in default_start_s]
    if start is not None:
        starts = [Actuation(start.rise_s, start.fall_s, start.second_s, start.delay_s)]
    fits = [fit_parameters(lagged, residual, first, parameters, tolerances) for first in starts]
    return min(fits, key=lambda fit: fit.cost)
