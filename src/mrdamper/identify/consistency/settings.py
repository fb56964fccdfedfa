"""Thresholds of the consistency test, which finds runs that contradict the other runs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsistencySettings:
    """Thresholds of the consistency test. The module ``causes`` defines the thresholds of each cause.

    Residuals and thresholds for them are divided by the standard deviation of the force.
    """

    # Single runs
    run_count_min: int = 6  # min number of fitted runs; the scatter of fewer runs is not significant
    # Smaller delays are ignored because the model error of a slow motion resembles a delay.
    delay_period_ratio_min: float = 0.002  # min delay / period
    # The simpler of two causes is reported if its strength / strength of the complex cause is at least this.
    simple_cause_ratio_min: float = 0.9
    # Deviations below this fraction of the worst run's deviation are ignored, because the worst run distorts
    # the fit and therefore the residuals of all runs.
    worst_ratio_min: float = 0.5
    unfitted_ratio_min: float = 1.8  # factor on all thresholds of a run that was omitted from the fit
    suspect_ratio_min: float = 0.8  # factor on all thresholds for a suspect run, which a second fit omits
    suspect_level_ratio_min: float = 1.6  # min residual of a suspect run, divided by the typical residual
    peer_count_min: int = 3  # min number of runs with the same command to compute their typical residual
    level_ratio_max: float = 3.0  # max typical residual at one command, divided by the median over all runs
    spare_run_count_min: int = 5  # min number of runs minus number of regression coefficients
    scatter_run_count_min: int = 12  # min number of runs at one command for a separate estimate of scatter
    command_tolerance_ratio: float = 0.05  # max difference of two equal commands / range of the commands
    iteration_count: int = 30  # iterations of the robust regression
    # The command labels of two runs are swapped if the estimated label error, divided by the difference of
    # the two commands, is in this range.
    exchange_ratio_min: float = 0.3
    exchange_ratio_max: float = 3.0

    # Groups of runs
    gain_difference_min: float = 0.04  # min relative gain difference of two groups, and min gain drift
    group_scatter_ratio_min: float = 5.0  # min difference of two groups / scatter within the groups
    drift_fraction_min: float = 0.1  # min fraction of the mean squared residual that a drift explains
    common_delay_min_s: float = 1.2e-3
    group_delay_min_s: float = 4e-3
    common_fraction_min: float = 0.015  # min fraction of the mean squared residual that a delay explains
    filter_ratio_min: float = 1.1  # A filter has to explain this many times as much as a delay.
    # An effect that was estimated for all runs is not reported if a single run alone has more than this
    # fraction of the effect (RMS). Then only this run is reported.
    single_run_ratio_min: float = 0.9
    error_ratio_max: float = 2.5  # Runs with a larger standard error / median of all runs are ignored.
    second_cause_ratio_min: float = 0.5  # min fraction explained by a second cause / by the best cause

    # Errors of one result
    training_cv_ratio_max: float = 1.5  # max training error, divided by the cross-validation error
    # Effect of a possible rig error (cause), such as a delay, on the force
    command_step: float = 0.02  # step of the difference quotient with respect to the command [A or V]
    filter_time_constant_s: float = 0.02  # The assumed filter has a bandwidth of 8 Hz.
    singular_value_ratio_min: float = 1e-9
    # A cause is ignored if the fitted parameters can imitate its effect on the force up to this fraction.
    cause_power_ratio_min: float = 1e-9
    correlated_samples: float = 10.0  # samples that count as one independent sample of the residual


DEFAULTS = ConsistencySettings()
