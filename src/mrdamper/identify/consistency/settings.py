"""Thresholds of the consistency test."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsistencySettings:
    """Thresholds of the consistency test. The module ``causes`` defines the thresholds of each cause.

    Levels and residuals are divided by the spread of the force.
    """

    # Single runs
    run_count_min: int = 6  # fitted runs; the scatter of fewer runs is not significant
    delay_period_ratio_min: float = 0.002  # The model error of a slow motion resembles a delay.
    simple_cause_ratio_min: float = 0.9  # A simpler cause has to explain this fraction of the deviation.
    worst_ratio_min: float = 0.5  # Smaller deviations are ignored, because the worst run distorts the fit.
    unfitted_ratio_min: float = 1.8  # factor of all thresholds for runs that are not fitted
    suspect_ratio_min: float = 0.8  # factor of all thresholds for runs omitted from a second fit
    suspect_level_ratio_min: float = 1.6  # residual of an omitted run, divided by the typical residual
    peer_count_min: int = 3  # runs of one command for a typical residual, and runs of a group
    level_ratio_max: float = 3.0  # typical residual of one command, divided by the one of all runs
    spare_run_count_min: int = 5  # runs minus the number of compared levels of command and motion
    scatter_run_count_min: int = 12  # runs of one command for a separate estimate of scatter
    command_tolerance_ratio: float = 0.05  # difference of equal commands, divided by the range
    iteration_count: int = 30  # iterations of the robust regression
    # Estimated error of a command, divided by the difference to the command of the exchanged run
    exchange_ratio_min: float = 0.3
    exchange_ratio_max: float = 3.0

    # Groups of runs
    gain_difference_min: float = 0.04  # difference of two groups, and smallest drift
    group_scatter_ratio_min: float = 5.0  # difference of two groups, divided by the scatter inside them
    drift_fraction_min: float = 0.1  # fraction of the residual that a drift explains
    common_delay_min_s: float = 1.2e-3
    group_delay_min_s: float = 4e-3
    common_fraction_min: float = 0.015  # fraction of the residual that one common delay explains
    filter_ratio_min: float = 1.1  # A filter has to explain this many times as much as a delay.
    single_run_ratio_min: float = 0.9  # A run that explains more of a common effect is its cause.
    error_ratio_max: float = 2.5  # Runs with a larger standard error than this times the median are ignored.
    second_cause_ratio_min: float = 0.5  # size of a second common cause divided by that of the first

    # Errors of one result
    training_cv_ratio_max: float = 1.5  # training error divided by cross-validation error


DEFAULTS = ConsistencySettings()
