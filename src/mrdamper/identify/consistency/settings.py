"""Thresholds of the consistency test, which finds runs that contradict the other runs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsistencySettings:
    """Thresholds of the consistency test. ``runs.CAUSES`` has the thresholds of each cause.

    Residuals are divided by the standard deviation of the force before comparison with a threshold.
    """

    # Thresholds that decide whether a single run deviates, and which runs are comparable
    run_count_min: int = 6  # min number of fitted runs; the scatter of fewer runs is not significant
    # Smaller delays are ignored because the model error of a slow motion resembles a delay.
    delay_period_ratio_min: float = 0.002  # min delay / period
    # The simpler of two causes is reported unless its strength, divided by the other strength, is smaller.
    simple_cause_ratio_min: float = 0.9
    # Deviations below this fraction of the worst run's deviation are ignored, because the worst run distorts
    # the fit and therefore the residuals of all runs.
    worst_ratio_min: float = 0.5
    unfitted_ratio_min: float = 1.8  # Thresholds of a run that was omitted from the fit get this factor.
    # A run is a suspect, which a second fit omits, if it exceeds its thresholds times this factor.
    suspect_ratio_min: float = 0.8
    suspect_level_ratio_min: float = 1.6  # min residual of a suspect run, divided by the typical residual
    peer_count_min: int = 3  # min number of runs in a group of comparable runs
    level_ratio_max: float = 3.0  # max typical residual at one command, divided by the median over all runs
    spare_run_count_min: int = 5  # min number of runs minus number of regression coefficients
    scatter_run_count_min: int = 12  # min number of runs at one command for a separate estimate of scatter
    command_tolerance_ratio: float = 0.05  # max difference of two equal commands / range of the commands
    iteration_count: int = 30  # iterations of the robust regression
    # The command labels of two runs are swapped if the estimated label error, divided by the difference of
    # the two commands, is in this range.
    exchange_ratio_min: float = 0.3
    exchange_ratio_max: float = 3.0

    # Thresholds of deviations that a group of runs or all runs have in common
    gain_difference_min: float = 0.04  # min relative gain difference of two groups, and min gain drift
    group_scatter_ratio_min: float = 5.0  # min difference of two groups / scatter within the groups
    drift_fraction_min: float = 0.1  # min fraction of the mean squared residual that a drift explains
    common_delay_min_s: float = 1.2e-3
    group_delay_min_s: float = 4e-3
    common_fraction_min: float = 0.015  # min fraction of the mean squared residual that a delay explains
    filter_ratio_min: float = 1.1  # A filter has to explain this many times as much as a delay.
    # An effect on all runs is not reported if a single run causes more than this fraction of the effect.
    single_run_ratio_min: float = 0.9
    # Runs are ignored if their standard error of gain or delay exceeds this multiple of the median.
    error_ratio_max: float = 2.5
    # min residual that a second cause explains, divided by the residual that the best cause explains
    second_cause_ratio_min: float = 0.5

    training_cv_ratio_max: float = 1.5  # max training error, divided by the cross-validation error
    # Settings for estimating the effect of a possible rig error (cause), such as a delay, on the force
    command_step: float = 0.02  # step of the difference quotient with respect to the command [A or V]
    filter_time_constant_s: float = 0.02  # The assumed filter has a bandwidth of 8 Hz.
    singular_value_ratio_min: float = 1e-9
    # A cause is ignored if the parameters imitate all of its effect on the force except this fraction.
    cause_power_ratio_min: float = 1e-9
    correlated_samples: float = 10.0  # samples that count as one independent sample of the residual


SETTINGS = ConsistencySettings()
