"""Fit of delay, first-order lag (rise and fall) and second lag, in particular to step responses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.actuation.least_squares import (
    ParameterFit,
    SearchParameter,
    fit_parameters,
    lagged_force,
)
from mrdamper.identify.actuation.response_times import ResponseTimes, mean_time, measured_times
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.identify.actuation.step_responses import SteppedRun, StepResponse, model_times
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper


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
