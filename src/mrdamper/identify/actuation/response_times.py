"""Mean response times of rises and falls, their standard errors, and the quadrants of the driver."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.identify.actuation.step_responses import StepResponse


class MeanTime(NamedTuple):
    """Mean time to 63 % of a step [s] with its standard error [s]."""

    mean_s: float
    error_s: float = math.nan
    repeat_error_s: float = 0.0  # part of the error that repeated steps of one kind show


class ResponseTimes(NamedTuple):
    """Times to 63 % of a step of the command, and the quadrants of the driver (None: unknown)."""

    up: MeanTime
    down: MeanTime
    driver_quadrants: int | None = None


def measured_times(steps: Sequence[StepResponse], settings: ActuationSettings) -> ResponseTimes:
    """Return the mean measured times of steps."""
    up, down = (
        mean_time(
            [(step.levels, step.time_s) for step in steps if step.upwards == upwards], settings.map_error
        )
        for upwards in (True, False)
    )
    return ResponseTimes(up, down, driver_quadrants(steps, up.mean_s, settings.free_wheeling_time_ratio))


def mean_time(times: Sequence[tuple[tuple[int, int], float]], relative_error: float = 0.0) -> MeanTime:
    """Return the mean of pairs of levels and times [s]. Each pair of levels has the same weight.

    The standard error combines the scatter of the pairs of levels, but at least the scatter of repeated
    steps, with a systematic part, ``relative_error``.
    """
    if not times:
        return MeanTime(math.nan)
    by_levels = defaultdict(list)
    for levels, time_s in times:
        by_levels[levels].append(time_s)
    kinds = [np.array(repeated) for repeated in by_levels.values()]
    means, count = np.array([repeated.mean() for repeated in kinds]), len(kinds)
    squares = sum(float(np.sum((repeated - repeated.mean()) ** 2)) for repeated in kinds)
    variance = squares / max(len(times) - count, 1)
    repeat_error = math.sqrt(variance * sum(1.0 / len(repeated) for repeated in kinds)) / count
    scatter = float(np.std(means, ddof=1)) / math.sqrt(count) if count > 1 else repeat_error
    mean = float(means.mean())
    return MeanTime(mean, math.hypot(max(scatter, repeat_error), relative_error * mean), repeat_error)


def driver_quadrants(steps: Sequence[StepResponse], up_s: float, ratio: float) -> int | None:
    """Return 1 if falls to zero take much longer than other steps, else 2; None if it is unknown.

    A driver with one quadrant cannot pull the current down. The current free-wheels with the time constant of
    the coil. A fall to a level above zero needs only a part of this time.
    """
    to_zero, to_level = (
        [step.time_s for step in steps if not step.upwards and (step.levels[1] == 0) == is_zero]
        for is_zero in (True, False)
    )
    if not (to_zero and to_level and math.isfinite(up_s)):
        return None
    return 1 if float(np.mean(to_zero)) > ratio * max(float(np.mean(to_level)), up_s) else 2
