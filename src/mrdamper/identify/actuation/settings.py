"""Limits and thresholds of the identification of an actuation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuationSettings:
    """Limits and thresholds of the fit of an actuation.

    *Error* means the sum of the squared force errors. The thresholds of the selection were chosen on
    randomised virtual dampers with even seeds.
    """

    # Steps of the command, as fractions of its range
    step_size_min: float = 0.05  # a smaller change is not a step
    level_tolerance: float = 0.05  # Levels with a smaller difference count as one level.
    settling_time_s: float = 0.1  # Later samples after a step count as settled at the level.

    # Step responses
    response_duration_min_s: float = 0.04  # A shorter record ends before a slow response reaches 63 %.
    response_duration_max_s: float = 0.15
    response_force_min: float = 0.03  # fraction of the largest force of the run; a smaller step is ignored
    change_force_min: float = 0.003  # fraction by which all changes of the command must change the force
    stroke_after_reversal_min: float = 0.15  # fraction of the stroke; laws have larger errors at reversals
    stroke_before_reversal_min: float = 0.03
    level_sample_count_min: int = 20  # settled samples at one level, in one direction of the motion
    crossing_fit_range: tuple[float, float] = (0.5, 0.77)  # A line through 63 % is fitted here.
    map_error: float = 0.06  # relative standard error of a response time because of the maps of the force
    free_wheeling_time_ratio: float = 1.4  # response time to zero / of other steps, for one quadrant

    # Search for delay and lags
    lag_min_s: float = 1e-4
    lag_max_s: float = 0.3
    delay_max_s: float = 0.1
    lag_start_s: tuple[float, ...] = (0.008, 0.03)  # start values of the lags; the error can have two minima
    tolerance: float = 1e-4  # relative change of the lags and of the error that ends the search
    oversampling: int = 16  # parts of a sample interval, because the command jumps at samples
    run_oversampling: int = 4  # The exact time of the jump matters less over whole runs.
    time_correction_count: int = 3  # corrections of rise and fall by the measured response times
    follow_share_step: float = 0.25  # first step of the fraction of the force that follows at once
    follow_share_step_min: float = 0.05
    hysteresis_agreement: float = 2.0  # standard errors; runs that differ by more are not averaged

    # Search for all parameters over whole runs; commands are fractions of the largest command
    saturation_min: float = 0.05
    saturation_max: float = 30.0
    saturation_start: float = 0.5
    remanence_start_min: float = 0.02
    narrow_loop_start: float = 0.6  # half width divided by the remanence
    wide_loop_start: float = 2.4
    fall_to_rise_start: float = 5.0  # ratio of the times to 63 %, if no fall was measured
    saturated_fall_ratio: float = 3.0  # time constant without saturation divided by the time of the fall
    evaluation_count_max: int = 20
    short_evaluation_count_max: int = 6  # limit in cross-validation

    # Selection of the form, by ratios of errors
    saturation_ratio_max: float = 0.95  # Other forms are ignored if their ratio to the simple form is larger.
    one_loop_ratio: float = 0.98  # weight of a form with one hysteresis loop against one with two
    free_wheeling_ratio_max: float = 0.7  # The driver has one quadrant if the ratio is smaller.


DEFAULT_SETTINGS = ActuationSettings()
