"""Fit the actuation: delay, lags and magnetic hysteresis between command and force.

``refine_actuation`` chooses by cross-validation if the model also needs a saturating core or free-wheeling. A
core that saturates has a narrow and a wide hysteresis loop. A driver with one quadrant cannot force the
current down, so that the current decays slowly in the coil (free-wheeling). The speed of the decay depends on
the saturation. Therefore the parameters of several effects are fitted together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from operator import itemgetter

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.actuation.least_squares import (
    LAGS,
    LaggedForces,
    ParameterFit,
    fit_hysteresis_at_levels,
    fit_lags,
    fit_lags_to_responses,
    fit_parameters,
    largest_command,
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
from mrdamper.runtime.pool import Pool, thread_count

_FOLLOW_SHARE = "follow_share"  # Name of the coefficient in some laws

Form = tuple[str, ...]
"""Form of an actuation: names of the fitted parameters. An effect without a fitted parameter is disabled."""
SIMPLE: Form = (*LAGS, "hysteresis_width_A")
FREE_WHEELING: Form = ("rise_s", "fall_s", "freewheel_time_s", "hysteresis_width_A")
SATURATING: Form = (*SIMPLE, "freewheel_time_s", "saturation")
TWO_LOOPS: Form = (*SIMPLE, "wide_hysteresis_width_A", "saturation")
TWO_LOOPS_FREE_WHEELING: Form = (*TWO_LOOPS, "freewheel_time_s")


@dataclass(frozen=True, slots=True)
class ActuationFit:
    """Fitted delay and lags between command and force, with standard errors and response times."""

    actuation: Actuation
    standard_errors: dict[str, float]  # key: field of ``actuation``; NaN if the runs do not determine a value
    t63_s: float  # time to 63 % of the change of force after an upward step of the command
    t63_fall_s: float  # time to 63 % of the change of force after a downward step; NaN without such a step
    t63_error_s: float  # standard error of t63_s
    t63_fall_error_s: float  # standard error of t63_fall_s
    t90_s: float  # time to 90 % of the change of the effective command (after the lags), for an upward step
    rmse_N: float  # RMS force error if delay and lags are simulated
    unlagged_rmse_N: float  # RMS force error if the force follows the command without delay
    driver_quadrants: int | None  # 1: the driver cannot force the current down; 2: it can; None: unknown

    def to_dict(self) -> dict[str, float | None]:
        """Return response times, force errors and driver quadrants as JSON values; None instead of NaN."""
        omitted = {"actuation", "standard_errors"}
        values = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in omitted}
        return {
            name: None if value is None or not math.isfinite(value) else value
            for name, value in values.items()
        }


def fit_actuation(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    start: Damper | None = None,
    settings: ActuationSettings = DEFAULT_SETTINGS,
) -> tuple[Damper, ActuationFit]:
    """Fit delay and lags between command and force; return damper and fit.

    If the law has the coefficient ``follow_share``, a pattern search fits this fraction. The lags are fitted
    for each trial fraction.

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

    def fit_at(share: float, lags: Actuation | None) -> tuple[float, float, Damper, ActuationFit]:
        """Return the squared error [%^2], the fraction, the damper with its lags, and the fit."""
        still = _with_follow_share(damper, share)
        fit = _fit_at_fixed_share(still, runs, lags, settings)
        moving = replace(still, actuation=fit.actuation)
        return _squared_error(moving, runs), share, moving, fit

    lags = None if start is None else start.actuation
    damper = replace(damper, command_lag_s=0.0, actuation=None)
    if _FOLLOW_SHARE not in damper.coefficients:
        return fit_at(0.0, lags)[2:]
    shares: Sequence[float] = (0.0, 1.0)
    if start is not None and _FOLLOW_SHARE in start.coefficients:
        shares = (float(start.coefficients[_FOLLOW_SHARE].value(0.0)),)
    error, share, best, fit = min((fit_at(share, lags) for share in shares), key=itemgetter(0))
    step = settings.follow_share_step
    while step >= settings.follow_share_step_min:
        neighbours = [min(max(share + change, 0.0), 1.0) for change in (-step, step)]
        errors = [_squared_error(_with_follow_share(best, neighbour), runs) for neighbour in neighbours]
        if min(errors) < error:
            candidate = fit_at(neighbours[int(np.argmin(errors))], fit.actuation)
            if candidate[0] < error:
                error, share, best, fit = candidate
                continue
        step *= 0.5
    return best, fit


def refine_actuation(
    damper: Damper,
    fit: ActuationFit,
    runs: Sequence[PreparedRun],
    settings: ActuationSettings = DEFAULT_SETTINGS,
) -> tuple[Damper, ActuationFit]:
    """Add core saturation, second hysteresis loop or free-wheeling if needed; return damper and fit.

    Without evidence of the three effects, damper and fit are returned unchanged. One kind of evidence is a
    driver with one quadrant in ``fit``. The other kind comes from two runs with random current: the error
    with all parameters is clearly smaller than with the simple form. The form with the smallest
    cross-validation error is then fitted to the force of all runs. Cross-validation uses the runs with random
    current, or all runs if fewer than two have random current.
    """
    has_one_quadrant, largest = fit.driver_quadrants == 1, largest_command(runs)
    pool = Pool(thread_count())
    still = replace(damper, actuation=None).on_limits()
    random_runs = [run for run in runs if _mean_hold_s(run) < 2.0 * settings.settling_time_s]

    def fit_form(form: Form, training: Sequence[PreparedRun], evaluation_count_max: int) -> ParameterFit:
        start = _initial_actuation(fit, form, largest, settings)
        lagged = LaggedForces(still, training, settings.run_oversampling)
        return fit_parameters(lagged, start, form, settings, evaluation_count_max)

    def test_error(test: tuple[Form, Sequence[PreparedRun], Sequence[PreparedRun]]) -> float:
        form, training, held_out = test
        actuation = fit_form(form, training, settings.short_evaluation_count_max).actuation
        lagged = LaggedForces(still, held_out, settings.run_oversampling)
        return float(np.sum(lagged.residual(lagged.forces_at_lags(actuation)) ** 2))

    compared = random_runs if len(random_runs) > 1 else runs
    if len(compared) < 2 or (len(random_runs) < 2 and not has_one_quadrant):
        return damper, fit
    if not has_one_quadrant:
        pair = [(form, random_runs[:2], random_runs[:2]) for form in (TWO_LOOPS_FREE_WHEELING, SIMPLE)]
        saturating, simple = pool.map(test_error, pair)
        if saturating >= settings.saturation_ratio_max * simple:
            return damper, fit
    forms = [SATURATING, TWO_LOOPS, TWO_LOOPS_FREE_WHEELING, *([FREE_WHEELING] if has_one_quadrant else [])]
    halves = compared[::2], compared[1::2]
    tests = [(form, *fold) for form in forms for fold in (halves, halves[::-1])]
    fold_errors = np.reshape(list(pool.map(test_error, tests)), (-1, 2))
    errors = dict(zip(forms, fold_errors.sum(axis=1).tolist(), strict=True))
    weights = {form: 1.0 if "wide_hysteresis_width_A" in form else settings.one_loop_ratio for form in forms}
    best_form = min(forms, key=lambda form: weights[form] * errors[form])
    best = fit_form(best_form, runs, settings.evaluation_count_max)
    ratio_max = settings.free_wheeling_ratio_max
    is_free_wheeling = errors[TWO_LOOPS_FREE_WHEELING] < ratio_max * errors[TWO_LOOPS]
    return replace(damper, actuation=best.actuation), replace(
        fit,
        actuation=best.actuation,
        standard_errors=fit.standard_errors | best.standard_errors,
        t90_s=best.actuation.response_time(0.9),
        rmse_N=LaggedForces(still, runs, settings.run_oversampling).rmse_N(best.actuation),
        driver_quadrants=1 if is_free_wheeling else fit.driver_quadrants,
    )


def _fit_at_fixed_share(
    damper: Damper, runs: Sequence[PreparedRun], start: Actuation | None, settings: ActuationSettings
) -> ActuationFit:
    """Fit delay, lags and hysteresis of a damper with a given value of ``follow_share``.

    The lags are fitted to step responses if some runs have a constant command between steps. Otherwise lags
    and hysteresis are fitted together to the force of whole runs. The hysteresis is estimated again from
    settled samples at constant command, and from runs whose command changes continuously. The larger estimate
    is used because overshoot and lags hide a part of the hysteresis.
    """
    still = damper.on_limits()
    measured = [(run, measure_step_responses(still, run, settings)) for run in runs]
    stepped = [(run, responses) for run, responses in measured if responses]
    if stepped:
        fit, times = fit_lags_to_responses(still, stepped, start, settings)
    else:
        moving = _runs_with_moved_force(still, runs, settings)
        fit = fit_lags(LaggedForces(still, moving, settings.run_oversampling), start, settings, SIMPLE)
        down_s = fit.actuation.response_time(STEP_FRACTION, 1.0, 0.0)
        times = ResponseTimes(MeanTime(math.nan), MeanTime(down_s))
    lags = replace(fit.actuation, largest_command=largest_command(runs), hysteresis_width_A=0.0)
    at_levels = fit_hysteresis_at_levels(replace(still, actuation=lags), runs, settings)
    fitted = fit.actuation.hysteresis_width_A, fit.standard_errors.get("hysteresis_width_A", math.nan)
    width, width_error = max(at_levels, fitted, key=itemgetter(0))
    lags = replace(lags, hysteresis_width_A=width)
    changing = [run for run, steps in measured if not steps and np.ptp(run.trajectory.command) > 0.0]
    # If the driver has one quadrant, free-wheeling of the current would be mistaken for hysteresis.
    if stepped and changing and times.driver_quadrants != 1:
        lagged = LaggedForces(still, changing, settings.run_oversampling)
        start_A = float(np.clip(width, 1e-3 * lagged.command_max, 0.5 * lagged.command_max))
        start = replace(lags, hysteresis_width_A=start_A)
        wider = fit_parameters(lagged, start, ("hysteresis_width_A",), settings)
        if wider.actuation.hysteresis_width_A > width:
            lags, width_error = wider.actuation, wider.standard_errors["hysteresis_width_A"]
    lagged = LaggedForces(still, runs, settings.run_oversampling)
    return ActuationFit(
        actuation=lags,
        standard_errors={**fit.standard_errors, "hysteresis_width_A": width_error},
        t63_s=times.up.mean_s if math.isfinite(times.up.mean_s) else lags.response_time(STEP_FRACTION),
        t63_fall_s=times.down.mean_s,
        t63_error_s=times.up.error_s,
        t63_fall_error_s=times.down.error_s,
        t90_s=lags.response_time(0.9),
        rmse_N=lagged.rmse_N(lags),
        unlagged_rmse_N=lagged.rmse_N(Actuation(0.0, 0.0)),
        driver_quadrants=times.driver_quadrants,
    )


def _runs_with_moved_force(
    still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> list[PreparedRun]:
    """Return the runs whose force depends on the change of the command; raise InputError if there is none."""
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
    """Return the damper with a given fraction; the same damper if its law has no such coefficient."""
    if _FOLLOW_SHARE not in damper.coefficients:
        return damper
    return replace(damper, coefficients={**damper.coefficients, _FOLLOW_SHARE: Constant(share)})


def _squared_error(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    return float(np.mean([score_run(damper, run).nrmse_percent ** 2 for run in runs]))


def _initial_actuation(
    fit: ActuationFit, form: Form, largest: float, settings: ActuationSettings
) -> Actuation:
    """Return initial values for a fit of the parameters in ``form``.

    ``fit`` is the earlier fit of delay, lags and one hysteresis loop. ``largest`` is the largest magnitude of
    the command [A or V].
    """
    start = fit.actuation
    if "saturation" in form:
        start = replace(start, saturation=settings.saturation_start * largest)
    if "wide_hysteresis_width_A" in form:
        remanence = max(start.hysteresis_width_A, settings.remanence_start_min * largest)
        widths = settings.narrow_loop_start * remanence, settings.wide_loop_start * remanence
        start = replace(start, hysteresis_width_A=widths[0], wide_hysteresis_width_A=widths[1])
    if "freewheel_time_s" in form:
        is_measured = math.isfinite(fit.t63_fall_s)
        fall_s = fit.t63_fall_s if is_measured else settings.fall_to_rise_start * fit.t63_s
        ratio = settings.saturated_fall_ratio if "saturation" in form else 1.0
        start = replace(start, fall_s=0.5 * start.fall_s, freewheel_time_s=ratio * fall_s)
    return start


def _mean_hold_s(run: PreparedRun) -> float:
    changes = int(np.count_nonzero(np.diff(run.trajectory.command)))
    return len(run) * run.trajectory.step / (changes + 1)
