"""Fit the actuation: delay, lags and magnetic hysteresis between command and force.

The fraction of the force that follows the command without delay (``follow_share``) is fitted too, if the law
has this coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.actuation.hysteresis import fit_hysteresis_at_levels, fit_hysteresis_over_runs
from mrdamper.identify.actuation.least_squares import (
    LaggedForces,
    fit_lags,
    fit_lags_to_responses,
    largest_command,
    run_residual,
)
from mrdamper.identify.actuation.settings import DEFAULT_SETTINGS, ActuationSettings
from mrdamper.identify.actuation.step_responses import (
    STEP_FRACTION,
    MeanTime,
    ResponseTimes,
    measure_step_responses,
)
from mrdamper.identify.scores import score_run
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import simulate

# Name of a coefficient of some laws: the fraction of the force that follows the effective command
# immediately.
_FOLLOW_SHARE = "follow_share"


@dataclass(frozen=True, slots=True)
class ActuationFit:
    """Fitted delay and lags between command and force, with standard errors and response times."""

    actuation: Actuation
    standard_errors: dict[str, float]  # key: field of ``actuation``; NaN if the runs do not determine a value
    t63_s: float  # time to 63 % of the change of force after an upward step of the command
    t90_s: float  # time to 90 % of the change of the effective command (after the lags), for an upward step
    rmse_N: float  # RMS force error if delay and lags are simulated
    unlagged_rmse_N: float  # RMS force error if the force follows the command without delay
    t63_fall_s: float  # time to 63 % of the change of force after a downward step; NaN without such a step
    t63_error_s: float  # standard error of t63_s
    t63_fall_error_s: float  # standard error of t63_fall_s
    driver_quadrants: int | None  # 1: the driver cannot force the current down; 2: it can; None: unknown

    def to_dict(self) -> dict[str, float | None]:
        """Return response times, force errors and driver quadrants as JSON values; None instead of NaN."""
        names = (
            "t63_s",
            "t63_fall_s",
            "t63_error_s",
            "t63_fall_error_s",
            "t90_s",
            "rmse_N",
            "unlagged_rmse_N",
        )
        values = {name: getattr(self, name) for name in (*names, "rmse_N", "unlagged_rmse_N")}
        finite = {name: value if math.isfinite(value) else None for name, value in values.items()}
        return {**finite, "driver_quadrants": self.driver_quadrants}


class _Candidate(NamedTuple):
    squared_error: float  # squared error, averaged over runs [%^2]
    damper: Damper
    fit: ActuationFit
    share: float


def fit_actuation(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    start: Damper | None = None,
    settings: ActuationSettings = DEFAULT_SETTINGS,
) -> tuple[Damper, ActuationFit]:
    """Fit delay and lags between command and force; return damper and fit.

    The returned damper has the fitted delay and lags. The runs need a changing command.

    Some laws have the coefficient ``follow_share``, the fraction of the force that follows the command
    immediately. A pattern search then fits this fraction. The lags are fitted for each trial fraction.

    Parameters
    ----------
    damper : damper fitted to runs with constant command; its law does not change
    start : damper whose fraction, delay and lags are the initial values of the search; its law may have
        other terms. None: the search tries the fractions 0 and 1 and continues from the better one

    Raises
    ------
    InputError
        If no change of the command changes the force.
    """

    def fit_at(share: float | None, lags: Actuation | None) -> _Candidate:
        still = damper if share is None else _with_follow_share(damper, share)
        fit = _fit_at_fixed_share(still, runs, lags, settings)
        moving = replace(still, actuation=fit.actuation)
        return _Candidate(_squared_error(moving, runs), moving, fit, share or 0.0)

    damper, lags = (
        replace(damper, command_lag_s=0.0, actuation=None),
        None if start is None else start.actuation,
    )
    if _FOLLOW_SHARE not in damper.coefficients:
        return fit_at(None, lags)[1:3]
    shares: Sequence[float] = (0.0, 1.0)
    if start is not None and _FOLLOW_SHARE in start.coefficients:
        shares = (float(start.coefficients[_FOLLOW_SHARE].value(0.0)),)
    best = min((fit_at(share, lags) for share in shares), key=lambda candidate: candidate.squared_error)
    step = settings.follow_share_step
    while step >= settings.follow_share_step_min:
        neighbours = [min(max(best.share + change, 0.0), 1.0) for change in (-step, step)]
        errors = [_squared_error(_with_follow_share(best.damper, share), runs) for share in neighbours]
        if min(errors) < best.squared_error:
            candidate = fit_at(neighbours[int(np.argmin(errors))], best.fit.actuation)
            if candidate.squared_error < best.squared_error:
                best = candidate
                continue
        step *= 0.5
    return best[1:3]


def force_rmse_N(
    still: Damper, lags: Actuation | None, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> float:
    """Return the RMS force error [N] of a damper with delay and lags ``lags`` over all scored samples."""
    forces = LaggedForces(still, runs, settings.run_oversampling).forces_at_lags(lags or Actuation(0.0, 0.0))
    scored = zip(runs, forces, strict=True)
    return rms(np.concatenate([(force - run.force)[run.scored_from :] for run, force in scored]))


def _fit_at_fixed_share(
    damper: Damper, runs: Sequence[PreparedRun], start: Actuation | None, settings: ActuationSettings
) -> ActuationFit:
    """Fit delay, lags and hysteresis of a damper with a given value of ``follow_share``.

    The lags are fitted to step responses if some runs have a constant command between steps, otherwise to
    the force of whole runs. The hysteresis is estimated twice: from runs with a stepwise constant command,
    and from runs whose command changes continuously. The larger estimate is used because overshoot and lags
    hide a part of the hysteresis.
    """
    still = damper.on_limits()
    measured = [measure_step_responses(still, run, settings) for run in runs]
    stepped = [responses for responses in measured if responses is not None]
    if stepped:
        fit, times = fit_lags_to_responses(still, stepped, start, settings)
    else:
        moving = _runs_with_moved_force(still, runs, settings)
        lagged = LaggedForces(still, moving, settings.run_oversampling)
        fit = fit_lags(lagged, run_residual(moving), start, settings)
        up_s = fit.actuation.response_time(STEP_FRACTION)
        down_s = fit.actuation.response_time(STEP_FRACTION, 1.0, 0.0)
        times = ResponseTimes(MeanTime(up_s), MeanTime(down_s))
    lags = replace(fit.actuation, largest_command=largest_command(runs))
    play, play_error = fit_hysteresis_at_levels(replace(still, actuation=lags), runs, settings)
    changing = [
        run
        for run, responses in zip(runs, measured, strict=True)
        if responses is None and np.ptp(run.trajectory.command) > 0.0
    ]
    # If the driver has one quadrant, free-wheeling of the current would be mistaken for hysteresis.
    if stepped and changing and times.driver_quadrants != 1:
        wider, wider_error = fit_hysteresis_over_runs(
            still, replace(lags, hysteresis_width_A=play), changing, settings
        )
        if wider > play:
            play, play_error = wider, wider_error
    return ActuationFit(
        actuation=replace(lags, hysteresis_width_A=play),
        standard_errors={**fit.standard_errors, "hysteresis_width_A": play_error},
        t63_s=times.up.mean_s if math.isfinite(times.up.mean_s) else lags.response_time(STEP_FRACTION),
        t90_s=lags.response_time(0.9),
        rmse_N=force_rmse_N(still, replace(lags, hysteresis_width_A=play), runs, settings),
        unlagged_rmse_N=force_rmse_N(still, None, runs, settings),
        t63_fall_s=times.down.mean_s,
        t63_error_s=times.up.error_s,
        t63_fall_error_s=times.down.error_s,
        driver_quadrants=times.driver_quadrants,
    )


def _runs_with_moved_force(
    still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> list[PreparedRun]:
    moving, force_max_N = [], max(float(np.abs(run.force).max()) for run in runs)
    for run in runs:
        path = run.trajectory
        lowest = replace(path, command=np.full(len(path), path.command.min()))
        change_N = simulate(still, path) - simulate(still, lowest)
        if np.ptp(change_N) > settings.change_force_min * force_max_N:
            moving.append(run)
    if not moving:
        raise InputError(
            found="no run has a step of the command that moves the force",
            expected="runs such as a triangle of constant speed with the current stepped at mid-stroke",
            remedy="Without one the lags are unknown",
        )
    return moving


def _with_follow_share(damper: Damper, share: float) -> Damper:
    return replace(damper, coefficients={**damper.coefficients, _FOLLOW_SHARE: Constant(share)})


def _squared_error(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    return float(np.mean([score_run(damper, run).nrmse_percent ** 2 for run in runs]))
