"""Fit of an actuation, and of the fraction of the force that follows the command at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.hysteresis import fit_hysteresis_at_levels, fit_hysteresis_over_runs
from mrdamper.identify.actuation.least_squares import LaggedForces, fit_lags, fit_lags_to_responses
from mrdamper.identify.actuation.settings import DEFAULT_SETTINGS, ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    STEP_FRACTION,
    MeanTime,
    ResponseTimes,
    measure_step_responses,
)
from mrdamper.identify.actuation.windows import select_windows, window_error, window_rmse_N
from mrdamper.identify.scores import score_run
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant

_FOLLOW_SHARE = "follow_share"  # Coefficient of the laws that divide their force.


@dataclass(frozen=True, slots=True)
class ActuationFit:
    """An identified actuation with its standard errors and its errors in windows around the steps."""

    actuation: Actuation
    standard_errors: dict[str, float]  # by field of the actuation; NaN if the runs do not determine it
    t63_s: float  # from a step up of the command to 63 % of the change of the force
    t90_s: float  # from a step up of the command to 90 % of it behind the lags
    rmse_N: float  # in the windows; a gain and an offset are fitted in each window
    unlagged_rmse_N: float  # the same without an actuation
    windows: int  # number of windows
    t63_fall_s: float  # from a step down of the command; NaN if no run has one
    t63_error_s: float  # standard errors of the two response times
    t63_fall_error_s: float
    driver_quadrants: int | None  # 1: the driver cannot pull the current down; None: unknown

    @property
    def response_times(self) -> dict[str, float]:
        """The times to 63 % of a step and their standard errors [s], by their names in files."""
        names = ("t63_s", "t63_fall_s", "t63_error_s", "t63_fall_error_s")
        return {name: getattr(self, name) for name in names}


class CurrentResponse(NamedTuple):
    """Response of the force to the command: the fraction that follows at once, and the actuation."""

    follow_share: float | None  # None if the law does not divide its force
    actuation: Actuation

    @classmethod
    def of(cls, damper: Damper) -> CurrentResponse | None:
        """Return the response of a damper; None if it has no actuation."""
        share = damper.coefficients.get(_FOLLOW_SHARE)
        if damper.actuation is None:
            return None
        return cls(None if share is None else float(share.value(0.0)), damper.actuation)


class _Candidate(NamedTuple):
    squared_error: float  # mean over runs [%^2]
    damper: Damper
    fit: ActuationFit


def fit_actuation(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    resistance_20_ohm: float | None = None,
    start: CurrentResponse | None = None,
    settings: ActuationSettings = DEFAULT_SETTINGS,
) -> tuple[Damper, ActuationFit]:
    """Return a damper with the actuation that is fitted to runs with a changing command.

    If the law divides its force, the fraction that follows the command at once is fitted, too, each fraction
    with its own lags: by steps from ``start``, the response of another law, as long as the error decreases.
    Without it the fraction is 0 or 1, or found by a line search if a fraction between them is better. Raise
    InputError if no run has a step of the command that changes the force.
    """

    def fit_at(share: float | None, lags: Actuation | None = None) -> _Candidate:
        still = damper if share is None else _with_follow_share(damper, share)
        fit = _fit_at_fixed_share(still, runs, lags, settings)
        fit = replace(fit, actuation=replace(fit.actuation, resistance_20_ohm=resistance_20_ohm))
        moving = replace(still, actuation=fit.actuation)
        return _Candidate(_squared_error(moving, runs), moving, fit)

    def error_at(candidate: _Candidate, share: float) -> float:
        return _squared_error(_with_follow_share(candidate.damper, share), runs)

    damper, step = replace(damper, command_lag_s=0.0, actuation=None), settings.follow_share_step
    if _FOLLOW_SHARE not in damper.coefficients:
        return fit_at(None, None if start is None else start.actuation)[1:]
    if start is not None and start.follow_share is not None:
        share, best = start.follow_share, fit_at(start.follow_share, start.actuation)
        while True:
            neighbours = {min(max(share + change, 0.0), 1.0) for change in (-step, step)} - {share}
            errors = {neighbour: error_at(best, neighbour) for neighbour in neighbours}
            share = min(errors, key=errors.__getitem__)
            if errors[share] >= best.squared_error:
                return best[1:]
            candidate = fit_at(share, best.fit.actuation)
            if candidate.squared_error >= best.squared_error:
                return best[1:]
            best = candidate
    candidates = {share: fit_at(share) for share in (0.0, 1.0)}
    end = min(candidates, key=lambda share: candidates[share].squared_error)
    if error_at(candidates[end], abs(end - step)) < candidates[end].squared_error:
        from scipy.optimize import minimize_scalar  # It takes a quarter of a second to load.

        def error(share: float) -> float:
            candidates[share] = fit_at(share)
            return candidates[share].squared_error

        tolerance = settings.follow_share_tolerance
        minimize_scalar(error, bounds=(0.0, 1.0), method="bounded", options={"xatol": tolerance})
    return min(candidates.values(), key=lambda candidate: candidate.squared_error)[1:]


def largest_command(runs: Sequence[PreparedRun]) -> float:
    """Return the largest magnitude of the command [A or V] over runs."""
    return max(float(np.abs(run.trajectory.command).max()) for run in runs)


def _fit_at_fixed_share(
    damper: Damper, runs: Sequence[PreparedRun], start: Actuation | None, settings: ActuationSettings
) -> ActuationFit:
    """Fit delay, lags and hysteresis.

    The lags are fitted to step responses if some runs hold their command between steps, else to the force in
    windows around the changes. Of the hysteresis at held and at changing commands the larger is kept, because
    overshoot and lags hide a part of it.
    """
    still = damper.on_limits()
    measured = [measure_step_responses(still, run, settings) for run in runs]
    stepped = [responses for responses in measured if responses is not None]
    windowed = select_windows(still, [responses.run for responses in stepped] or runs, settings)
    if stepped:
        fit, times = fit_lags_to_responses(still, stepped, start, settings)
    else:
        lagged = LaggedForces(still, [drive for drive, _, _ in windowed], settings.oversampling)
        fit = fit_lags(
            lagged, lambda forces: window_error(forces, windowed), settings.window_start_s, start, settings
        )
        up_s = fit.actuation.response_time(STEP_FRACTION)
        down_s = fit.actuation.response_time(STEP_FRACTION, 1.0, 0.0)
        times = ResponseTimes(MeanTime(up_s), MeanTime(down_s))
    largest = largest_command(runs)
    lags = replace(fit.actuation, largest_command=largest)
    play, play_error = fit_hysteresis_at_levels(replace(still, actuation=lags), runs, settings)
    changing = [
        run
        for run, responses in zip(runs, measured, strict=True)
        if responses is None and np.ptp(run.trajectory.command) > 0.0
    ]
    if stepped and changing and times.driver_quadrants != 1:  # Free-wheeling looks like hysteresis.
        start = replace(lags, play=play)
        wider, wider_error = fit_hysteresis_over_runs(still, start, changing, largest, settings)
        if wider > play:
            play, play_error = wider, wider_error
    return ActuationFit(
        actuation=replace(lags, play=play),
        standard_errors={**fit.standard_errors, "play": play_error},
        t63_s=times.up.mean_s if math.isfinite(times.up.mean_s) else lags.response_time(STEP_FRACTION),
        t90_s=lags.response_time(0.9),
        rmse_N=window_rmse_N(still, lags, windowed, settings),
        unlagged_rmse_N=window_rmse_N(still, None, windowed, settings),
        windows=sum(len(windows) for _, _, windows in windowed),
        t63_fall_s=times.down.mean_s,
        t63_error_s=times.up.error_s,
        t63_fall_error_s=times.down.error_s,
        driver_quadrants=times.driver_quadrants,
    )


def _with_follow_share(damper: Damper, share: float) -> Damper:
    return replace(damper, coefficients={**damper.coefficients, _FOLLOW_SHARE: Constant(share)})


def _squared_error(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    """Return the mean over runs of the squared error [%^2]."""
    return float(np.mean([score_run(damper, run).nrmse_percent ** 2 for run in runs]))
