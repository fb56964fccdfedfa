"""Choose by cross-validation if the delay model needs saturation, a second loop or free-wheeling.

A core that saturates has a narrow and a wide hysteresis loop. A driver with one quadrant cannot force the
current down, so that the current decays slowly in the coil (free-wheeling). The speed of the decay depends on
the saturation. Therefore the parameters of several effects are fitted together. A *form* is a set of
parameters to fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.fit import ActuationFit, force_rmse_N
from mrdamper.identify.actuation.least_squares import (
    LAGS,
    LaggedForces,
    ParameterFit,
    fit_over_runs,
    largest_command,
    run_residual,
)
from mrdamper.identify.actuation.settings import DEFAULT_SETTINGS, ActuationSettings
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper

Form = tuple[str, ...]
"""Form of an actuation: names of the fitted parameters. An effect without a fitted parameter is disabled."""

SIMPLE: Form = (*LAGS, "hysteresis_width_A")
FREE_WHEELING: Form = ("rise_s", "fall_s", "freewheel_time_s", "hysteresis_width_A")
SATURATING: Form = (*SIMPLE, "freewheel_time_s", "saturation")
TWO_LOOPS: Form = (*SIMPLE, "wide_hysteresis_width_A", "saturation")
TWO_LOOPS_FREE_WHEELING: Form = (*TWO_LOOPS, "freewheel_time_s")


def refine_actuation(
    damper: Damper,
    fit: ActuationFit,
    runs: Sequence[PreparedRun],
    settings: ActuationSettings = DEFAULT_SETTINGS,
) -> tuple[Damper, ActuationFit]:
    """Add core saturation, second hysteresis loop or free-wheeling if needed; return damper and fit.

    A *form* is a set of parameters to fit. Without evidence of the three effects, damper and fit are returned
    unchanged. One kind of evidence is a driver with one quadrant in ``fit``. The other kind comes from two
    runs with random current: the error with all parameters is clearly smaller than with the simple form.
    The form with the smallest cross-validation error is then fitted to the force of all runs.
    Cross-validation uses the runs with random current, or all runs if fewer than two have random current.
    """
    has_one_quadrant, largest = fit.driver_quadrants == 1, largest_command(runs)
    still = replace(damper, actuation=None).on_limits()
    random_runs = [run for run in runs if _mean_hold_s(run) < 2.0 * settings.settling_time_s]

    def fit_form(form: Form, training: Sequence[PreparedRun], evaluation_count_max: int) -> ParameterFit:
        start = initial_actuation(fit, form, largest, settings)
        return fit_over_runs(still, training, start, form, settings, evaluation_count_max)

    def test_error(form: Form, training: Sequence[PreparedRun], held_out: Sequence[PreparedRun]) -> float:
        actuation = fit_form(form, training, settings.short_evaluation_count_max).actuation
        forces = LaggedForces(still, held_out, settings.run_oversampling).forces_at_lags(actuation)
        return float(np.sum(run_residual(held_out)(forces) ** 2))

    if not has_one_quadrant:
        first = random_runs[:2]
        if len(first) < 2:
            return damper, fit
        saturating, simple = (test_error(form, first, first) for form in (TWO_LOOPS_FREE_WHEELING, SIMPLE))
        if saturating >= settings.saturation_ratio_max * simple:
            return damper, fit
    compared = random_runs if len(random_runs) > 1 else runs
    halves = compared[::2], compared[1::2]
    if not halves[1]:
        return damper, fit
    folds = halves, halves[::-1]
    forms = [SATURATING, TWO_LOOPS, TWO_LOOPS_FREE_WHEELING, *([FREE_WHEELING] if has_one_quadrant else [])]
    errors = {
        form: sum(test_error(form, training, held_out) for held_out, training in folds) for form in forms
    }
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
        rmse_N=force_rmse_N(still, best.actuation, runs, settings),
        driver_quadrants=1 if is_free_wheeling else fit.driver_quadrants,
    )


def initial_actuation(
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
