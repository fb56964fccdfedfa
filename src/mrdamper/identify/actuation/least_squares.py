"""Least-squares fits of an actuation: lags to step responses, and parameters to the force over whole runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    ResponseTimes,
    SteppedRun,
    StepResponse,
    mean_time,
    measured_times,
    model_times,
)
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate


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


def fit_parameters(
    residual: Callable[[Actuation], FloatArray],
    start: Actuation,
    parameters: Sequence[SearchParameter],
    tolerances: tuple[float, float],
    difference_step: float,
    evaluation_count_max: int | None = None,
) -> ParameterFit:
    """Fit parameters of an actuation by nonlinear least squares. The others keep their values.

    The search ends if the relative change of the parameters or of the cost is below its tolerance.
    ``difference_step`` is the relative step of the derivatives. Standard errors are for independent
    residuals, and NaN for parameters on a bound.
    """
    from scipy.optimize import least_squares  # It takes a quarter of a second to load.

    names, lower, upper, scales, logs, margins = map(np.array, zip(*parameters, strict=True))
    values = np.array([getattr(start, name) for name in names])
    values[logs] = np.log(np.maximum(values, lower)[logs])
    lower[logs], upper[logs] = np.log(lower[logs]), np.log(upper[logs])

    def actuation(point: FloatArray) -> Actuation:
        numbers = np.where(logs, np.exp(point), point).tolist()
        return replace(start, **dict(zip(names.tolist(), numbers, strict=True)))

    def residual_at(point: FloatArray) -> FloatArray:
        return residual(actuation(point))

    result = least_squares(
        residual_at,
        np.clip(values, lower + margins, upper - margins),
        bounds=(lower, upper),
        x_scale=scales,
        diff_step=np.full(len(names), difference_step),
        xtol=tolerances[0],
        ftol=tolerances[1],
        max_nfev=evaluation_count_max,
    )
    span, errors = upper - lower, np.full(len(names), np.nan)
    free = (result.x > lower + 1e-6 * span) & (result.x < upper - 1e-6 * span)
    if free.any():
        jacobian = np.asarray(result.jac)[:, free]
        variance = float(result.fun @ result.fun) / max(len(result.fun) - int(free.sum()), 1)
        covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
        errors[free] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors[logs] *= np.exp(result.x[logs])
    return ParameterFit(
        actuation(result.x), dict(zip(names.tolist(), errors.tolist(), strict=True)), result.cost
    )


def lagged_force(still: Damper, lags: Actuation | None, drive: Drive, oversampling: int) -> FloatArray:
    """Return the force [N] of a damper behind an actuation. The command jumps at its samples."""
    if lags is None:
        return simulate(still, drive)
    path = drive.trajectory
    applied = lags.applied(np.repeat(path.command, oversampling), path.step / oversampling)[::oversampling]
    return simulate(still, replace(drive, trajectory=replace(path, command=applied), constant=None))


class WholeRuns:
    """Whole runs for a fit. Each run is weighted by the root of the sum of its squared force."""

    def __init__(self, still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings) -> None:
        self._still, self._settings = still, settings
        self._runs = [(run, open_drive(run.trajectory), rms(run.force) * math.sqrt(len(run))) for run in runs]

    def error(self, actuation: Actuation) -> FloatArray:
        """Return the weighted force errors at the scored samples of all runs, shape (n,)."""
        errors = []
        for run, drive, size_N in self._runs:
            force = lagged_force(self._still, actuation, drive, self._settings.run_oversampling)
            errors.append(((force - run.force) / size_N)[run.scored_from :])
        return np.concatenate(errors)

    def fit(
        self,
        start: Actuation,
        names: Sequence[str],
        largest: float,
        evaluation_count_max: int | None = None,
        difference_step: float = 1e-3,
    ) -> ParameterFit:
        """Fit the parameters with these names; ``largest`` is the largest command [A or V]."""
        lag = self._settings.lag_min_s, self._settings.lag_max_s, 0.3, True
        loop = 0.0, largest, 0.02 * largest, False
        saturation = (
            self._settings.saturation_min * largest,
            self._settings.saturation_max * largest,
            0.3,
            True,
        )
        kinds = {"play": loop, "wide_play": loop, "saturation": saturation}
        parameters = [SearchParameter(name, *kinds.get(name, lag)) for name in names]
        tolerances = 1e-3, 1e-4
        return fit_parameters(
            self.error, start, parameters, tolerances, difference_step, evaluation_count_max
        )


def fit_lags_to_responses(
    still: Damper, runs: Sequence[SteppedRun], start: Actuation | None, settings: ActuationSettings
) -> tuple[ParameterFit, ResponseTimes]:
    """Fit the lags to measured step responses, and return the measured response times.

    Rise and fall are then corrected so that the model has the measured mean times to 63 %. Their errors
    include the scatter of repeated steps. The search begins at ``start``, if given.
    """

    def residual(lags: Actuation) -> FloatArray:
        parts = []
        for run in runs:
            force = lagged_force(still, lags, run.drive, settings.oversampling)
            parts += [
                (response.model_fraction(force) - response.fraction) * np.abs(response.size_N)
                for response in run.responses
            ]
        return np.concatenate(parts)

    def times_with(lags: Actuation) -> list[tuple[StepResponse, float]]:
        return model_times(
            runs, lambda drive: lagged_force(still, lags, drive, settings.oversampling), settings
        )

    def mean_with(lags: Actuation, *, upwards: bool) -> float:
        return mean_time([(step.levels, s) for step, s in times_with(lags) if step.upwards == upwards]).mean_s

    fit = fit_lags(residual, settings.response_start_s, start, settings)
    lags, errors = fit.actuation, fit.standard_errors
    measured = measured_times([step for step, _ in times_with(lags)], settings)
    for _ in range(settings.time_correction_count):
        up_s, down_s = (mean_with(lags, upwards=upwards) for upwards in (True, False))
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
    residual: Callable[[Actuation], FloatArray],
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
    fits = [fit_parameters(residual, first, parameters, tolerances, difference_step=1e-4) for first in starts]
    return min(fits, key=lambda fit: fit.cost)
