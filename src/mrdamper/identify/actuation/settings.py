"""Settings of the identification of the actuation (delay and lags between command and force)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuationSettings:
    """Limits and thresholds for identifying delay and lags between command and force.

    *Error* means the sum of the squared force errors. The thresholds that decide about saturation, hysteresis
    loops and free-wheeling were tuned on randomised virtual dampers with even seeds.
    """

    # Command steps. The first two limits are divided by the range of the command.
    step_size_min: float = 0.05  # A smaller change of the command is not a step.
    level_tolerance: float = 0.05  # Commands are equal if they round to the same multiple of the tolerance.
    settling_time_s: float = 0.1  # The force is considered settled when this time has passed after a step.

    # Limits that decide which parts of a run are evaluated as step responses
    response_duration_min_s: float = 0.04  # A shorter response is ignored because it may not reach 63 %.
    response_duration_max_s: float = 0.15
    response_force_min: float = 0.03  # min force change of a usable step / peak force of the run
    change_force_min: float = 0.003  # min force change of a usable run / peak force of all runs
    # Samples are ignored near a reversal because laws have larger errors there. The two limits are the
    # distance from the reversal divided by the stroke.
    stroke_after_reversal_min: float = 0.15
    stroke_before_reversal_min: float = 0.03
    level_sample_count_min: int = 20  # min settled samples at one command and one direction of motion
    # A line is fitted to this range of a step response. The response time is where the line crosses 63 %.
    crossing_fit_range: tuple[float, float] = (0.5, 0.77)
    map_error: float = 0.06  # relative standard error of a response time due to errors of the settled force
    # A driver has one quadrant (cannot force the current down) if steps to zero take this many times as long.
    free_wheeling_time_ratio: float = 1.4

    # Bounds, initial values and accuracy of the search for delay and lags
    lag_min_s: float = 1e-4
    lag_max_s: float = 0.3
    delay_max_s: float = 0.1
    lag_start_s: tuple[float, ...] = (0.008, 0.03)  # two start values because the error can have two minima
    tolerance: float = 1e-4  # The search ends if lags and error change relatively by less than this.
    # Integration steps of the lags per sample interval. In step responses, the exact time of a command step
    # is more important than in whole runs.
    oversampling: int = 16  # integration steps in a fit to step responses
    run_oversampling: int = 4  # integration steps in a fit to whole runs
    time_correction_count: int = 3  # number of corrections of rise and fall times by measured response times
    follow_share_step: float = 0.25  # first step of the pattern search for ``follow_share``
    follow_share_step_min: float = 0.05  # A smaller step ends the pattern search.
    # Hysteresis widths of runs are averaged if their difference is at most this many standard errors.
    hysteresis_agreement: float = 2.0

    # Bounds and initial values for fits with saturation, a wide loop or free-wheeling. Saturation current and
    # remanence are divided by the largest command.
    saturation_min: float = 0.05
    saturation_max: float = 30.0
    saturation_start: float = 0.5
    remanence_start_min: float = 0.02
    narrow_loop_start: float = 0.6  # half width of the narrow hysteresis loop, divided by the remanence
    wide_loop_start: float = 2.4  # half width of the wide hysteresis loop, divided by the remanence
    fall_to_rise_start: float = 5.0  # fall time divided by rise time, if no fall was measured
    saturated_fall_ratio: float = 3.0  # free-wheeling time constant / fall time, if the flux saturates
    evaluation_count_max: int = 20  # max function evaluations in the final fit
    short_evaluation_count_max: int = 6  # max function evaluations in each fit during the cross-validation

    # Error ratios that decide if the delay model gets saturation, a second hysteresis loop or free-wheeling.
    # Further parameters are tried only if they reduce the error of the simplest model below this fraction.
    saturation_ratio_max: float = 0.95
    one_loop_ratio: float = 0.98  # The error with one hysteresis loop gets this factor to prefer one loop.
    # A driver has one quadrant if a model with free-wheeling reduces the error below this fraction.
    free_wheeling_ratio_max: float = 0.7


DEFAULT_SETTINGS = ActuationSettings()
