"""Thresholds of the consistency test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class CauseLimits:
    """Thresholds above which a cause is reported for one run.

    A deviation is the difference between a run's size of a cause and the size of comparable runs, as the rms
    force that it explains, divided by the typical residual.

    Parameters
    ----------
    size_min : smallest size, in the unit of the cause; for a command: for a range of 1 A
    scatter_ratio_min : smallest deviation divided by the scatter of the deviations of all runs
    deviation_min : smallest deviation
    weight : factor of the deviation when causes of one run are compared; below 1 for a less common cause
    """

    size_min: float
    scatter_ratio_min: float
    deviation_min: float
    weight: float = 1.0


def _default_limits() -> Mapping[str, CauseLimits]:
    return MappingProxyType(
        {
            "force_delay": CauseLimits(1.0e-3, 3.2, 0.15),
            "force_gain": CauseLimits(0.03, 2.5, 0.4),
            "command_label": CauseLimits(0.02, 2.5, 0.4),
            "force_saturation": CauseLimits(0.06, 4.0, 0.4, weight=0.7),
            "force_offset_of_run": CauseLimits(3.0, 6.0, 0.5),
        }
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsistencySettings:
    """Thresholds of the consistency test. Levels and residuals are divided by the spread of the force.

    Parameters
    ----------
    limits : thresholds of each cause, in the order from the simplest cause to the least simple
    run_count_min : smallest number of fitted runs; the scatter of fewer runs is not significant
    delay_period_ratio_min : smallest delay divided by the period: in a slow motion, the model error resembles
        a delay
    simple_cause_ratio_min : report a simpler cause if it explains at least this fraction of the deviation
    equal_fraction_difference_max : report gain and command both if their explained fractions differ by less
    worst_ratio_min : ignore runs below this fraction of the worst fitted run, because that run distorts the
        fit
    unfitted_ratio_min : factor on all thresholds for runs that are not fitted: their residuals are larger
    suspect_ratio_min : factor on all thresholds for suspects, which are omitted from a second fit
    suspect_level_ratio_min : residual of a suspect, divided by the typical residual
    peer_count_min : smallest number of runs of one command for a typical residual, and of a group of runs
    level_ratio_max : largest typical residual of one command, divided by the typical residual of all runs
    spare_run_count_min : smallest number of runs minus the number of compared levels of command and motion
    scatter_run_count_min : smallest number of runs of one command for a scatter of its own
    command_tolerance_ratio : largest difference of equal commands, divided by the range of the commands
    iteration_count : iterations of the robust regression
    exchange_ratio_min, exchange_ratio_max : estimated error of a command, divided by the difference to
        the command of the exchanged run
    gain_difference_min : smallest difference of gains between groups, and smallest drift of the gain
    group_scatter_ratio_min : smallest difference of two groups, divided by the scatter inside them; a single
        group that is divided anywhere has a smaller ratio
    session_error_ratio_min : smallest difference between sessions, divided by its standard error
    drift_fraction_min : smallest fraction of the residual that a drift explains
    common_delay_min_s : smallest delay of all runs
    group_delay_min_s : smallest difference of delay between two groups
    common_fraction_min : smallest fraction of the residual that a delay of all runs explains
    filter_ratio_min : report a filter if it explains this many times as much as a delay
    single_run_ratio_min : one run that explains this fraction of a common effect is the cause of it
    error_ratio_max : ignore runs in a group if their standard error exceeds the median by this factor
    second_cause_ratio_min : ignore a second common cause that explains a smaller fraction than this ratio
    training_cv_ratio_max : largest training error divided by the cross-validation error of the selected model
    """

    limits: Mapping[str, CauseLimits] = field(default_factory=_default_limits)

    # Single runs
    run_count_min: int = 6
    delay_period_ratio_min: float = 0.002
    simple_cause_ratio_min: float = 0.9
    equal_fraction_difference_max: float = 0.05
    worst_ratio_min: float = 0.5
    unfitted_ratio_min: float = 1.8
    suspect_ratio_min: float = 0.8
    suspect_level_ratio_min: float = 1.6
    peer_count_min: int = 3
    level_ratio_max: float = 3.0
    spare_run_count_min: int = 5
    scatter_run_count_min: int = 12
    command_tolerance_ratio: float = 0.05
    iteration_count: int = 30
    exchange_ratio_min: float = 0.3
    exchange_ratio_max: float = 3.0

    # Groups of runs
    gain_difference_min: float = 0.04
    group_scatter_ratio_min: float = 5.0
    session_error_ratio_min: float = 4.0
    drift_fraction_min: float = 0.1
    common_delay_min_s: float = 1.2e-3
    group_delay_min_s: float = 4e-3
    common_fraction_min: float = 0.015
    filter_ratio_min: float = 1.1
    single_run_ratio_min: float = 0.9
    error_ratio_max: float = 2.5
    second_cause_ratio_min: float = 0.5

    # Errors of one result
    training_cv_ratio_max: float = 1.5


DEFAULTS = ConsistencySettings()
