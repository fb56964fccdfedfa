"""Measure step responses of the force to steps of the command.

The force depends on position, speed and direction as well as on the command. Therefore a curve of the settled
force is fitted first, for each constant command (*level*) and direction of motion. The curve is the force of
the law at this command plus a parabola in the position. The step response is the measured force on a scale
from 0 on the curve before the step to 1 on the curve after the step.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.settings import DEFAULT_SETTINGS, ActuationSettings
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate

STEP_FRACTION = 1.0 - math.exp(-1.0)
"""Fraction of a step that a first-order lag reaches after its time constant, about 63 %."""


@dataclass(frozen=True, slots=True, eq=False)
class StepResponse:
    """Response to one step of the command. Arrays have one value per sample in ``window``."""

    window: slice  # samples after the step
    fraction: FloatArray  # measured step response [-]: 0 before the step, 1 when the force has settled
    size_N: FloatArray  # settled force after the step minus settled force before the step
    law_before_N: FloatArray  # force of the law at the command before the step
    law_after_N: FloatArray  # force of the law at the command after the step
    levels: tuple[int, int]  # commands before and after the step, rounded to multiples of the tolerance
    upwards: bool  # the magnitude of the command increases
    time_s: float  # measured time to 63 % of the step; NaN if 63 % is not reached

    def model_fraction(self, force_N: FloatArray) -> FloatArray:
        """Return the step response [-] of a simulated force of the whole run."""
        return (force_N[self.window] - self.law_before_N) / (self.law_after_N - self.law_before_N)


SteppedRun = tuple[PreparedRun, tuple[StepResponse, ...]]
"""A run and the force responses to its command steps."""


def measure_step_responses(
    still: Damper, run: PreparedRun, settings: ActuationSettings
) -> tuple[StepResponse, ...]:
    """Return the force responses to the usable command steps of a run.

    A step is usable if it satisfies three conditions. There are enough settled samples at the commands before
    and after the step, in the direction of motion at the step. The motion continues in this direction. The
    step changes the force.
    """
    path, step_s = run.trajectory, run.trajectory.step
    span = float(np.ptp(path.command))
    switches = np.flatnonzero(np.abs(np.diff(path.command)) > settings.step_size_min * span) + 1
    cuts = [0, *switches.tolist(), len(path)]
    settled_samples = round(settings.settling_time_s / step_s)
    if span == 0.0 or np.median(np.diff(cuts)) < 2 * settled_samples:
        return ()
    commands = [float(np.median(path.command[a:b])) for a, b in pairwise(cuts)]
    levels = [round(command / (settings.level_tolerance * span)) for command in commands]
    falls = [False, *(after < before for before, after in pairwise(commands))]
    law_force = {}
    for level in set(levels):
        mean = np.mean([command for command, k in zip(commands, levels, strict=True) if k == level])
        law_force[level] = simulate(still, replace(path, command=np.full(len(path), mean)))
    segment = np.repeat(np.arange(len(levels)), np.diff(cuts))
    sliding, direction = _is_sliding(run, settings), np.sign(path.velocity)
    settled = sliding & (np.arange(len(path)) - np.array(cuts)[segment] >= settled_samples)
    force_min_N = settings.response_force_min * float(np.abs(run.force).max())

    def fit_force(k: int, first: int) -> FloatArray | None:
        samples = settled & (np.array(levels)[segment] == levels[k]) & (direction == direction[first])
        if np.count_nonzero(samples) < settings.level_sample_count_min:
            return None
        return _fit_force_curve(run, law_force[levels[k]], samples, np.array(falls)[segment], float(falls[k]))

    responses = []
    for k, (first, end) in enumerate(pairwise(cuts[1:]), start=1):
        same_stroke = sliding & (direction == direction[first])
        stop = min(end, first + round(settings.response_duration_max_s / step_s))
        if not same_stroke[first:stop].all():
            stop = first + int(np.argmin(same_stroke[first:stop]))
        before, after, window = fit_force(k - 1, first), fit_force(k, first), slice(first, stop)
        if (stop - first) * step_s < settings.response_duration_min_s or before is None or after is None:
            continue
        size_N = (after - before)[window]
        law_before_N, law_after_N = law_force[levels[k - 1]][window], law_force[levels[k]][window]
        if min(np.abs(size_N).min(), np.abs(law_after_N - law_before_N).min()) < force_min_N:
            continue
        fraction = (run.force - before)[window] / size_N
        pair, upwards = (levels[k - 1], levels[k]), abs(commands[k]) > abs(commands[k - 1])
        time_s = crossing_time(fraction, step_s, settings)
        responses.append(
            StepResponse(window, fraction, size_N, law_before_N, law_after_N, pair, upwards, time_s)
        )
    return tuple(responses)


def crossing_time(
    fraction: FloatArray, step_s: float, settings: ActuationSettings = DEFAULT_SETTINGS
) -> float:
    """Return the time [s] at which a step response, shape (n,), reaches 63 %; NaN if it stays below 63 %.

    Because single samples have noise, the time is taken from a straight line fitted to the rising samples
    near 63 %.
    """
    reached = np.flatnonzero(fraction >= STEP_FRACTION)
    if not len(reached) or reached[0] == 0:
        return 0.0 if len(reached) else math.nan
    first, last = int(reached[0]) - 1, int(reached[0])
    lower, upper = settings.crossing_fit_range
    while first > 0 and fraction[first] > fraction[first - 1] > lower:
        first -= 1
    while last + 1 < len(fraction) and fraction[last] < fraction[last + 1] < upper:
        last += 1
    samples = np.arange(first, last + 1)
    return float(step_s * np.polyfit(fraction[samples] - STEP_FRACTION, samples, 1)[1])


def model_times(
    runs: Sequence[SteppedRun], forces_N: Sequence[FloatArray], settings: ActuationSettings
) -> list[tuple[StepResponse, float]]:
    """Return pairs of a step and the time [s] at which the simulated response to the step reaches 63 %.

    Steps whose measured or simulated response stays below 63 % are omitted.
    """
    times = []
    for (run, responses), force_N in zip(runs, forces_N, strict=True):
        for response in responses:
            time_s = crossing_time(response.model_fraction(force_N), run.trajectory.step, settings)
            if np.isfinite([time_s, response.time_s]).all():
                times.append((response, time_s))
    return times


def _fit_force_curve(
    run: PreparedRun, law_force: FloatArray, samples: BoolArray, from_above: BoolArray, weight: float
) -> FloatArray:
    """Return the settled force [N] that the regression predicts for every sample of a run.

    ``samples`` selects the settled samples of one command and direction of motion for the regression. If the
    command was reached from above (``weight`` 1), the force has an offset because the core has hysteresis.
    """
    x = run.trajectory.displacement / np.abs(run.trajectory.displacement).max()
    columns = [np.ones_like(x), x, x**2]
    if has_both := 0.0 < float(from_above[samples].mean()) < 1.0:
        columns.append(from_above.astype(np.float64))
    matrix = np.stack(columns, axis=1)
    numbers = np.linalg.lstsq(matrix[samples], (run.force - law_force)[samples], rcond=None)[0]
    offset = float(numbers[3]) * weight if has_both else 0.0
    return np.asarray(law_force + matrix[:, :3] @ numbers[:3] + offset)


def _is_sliding(run: PreparedRun, settings: ActuationSettings) -> BoolArray:
    """Return a mask of the scored samples that are far enough from both reversals of the stroke."""
    x = run.trajectory.displacement
    reversals = np.flatnonzero(np.diff(np.sign(run.trajectory.velocity)) != 0.0) + 1
    ends = np.concatenate([[0], reversals, [len(x) - 1]])
    number = np.searchsorted(reversals, np.arange(len(x)), side="right")
    stroke = float(np.median(np.abs(np.diff(x[ends]))))
    since, left = np.abs(x - x[ends[number]]), np.abs(x - x[ends[number + 1]])
    sliding = since > settings.stroke_after_reversal_min * stroke
    sliding &= left > settings.stroke_before_reversal_min * stroke
    sliding[: run.scored_from] = False
    return np.asarray(sliding)


class MeanTime(NamedTuple):
    """Mean time to 63 % of a step, and standard errors of this mean [s]."""

    mean_s: float
    error_s: float = math.nan
    repeat_error_s: float = 0.0  # standard error from the scatter of repeated steps


class ResponseTimes(NamedTuple):
    """Mean times to 63 % of upward and downward command steps, and the number of driver quadrants."""

    up: MeanTime
    down: MeanTime
    driver_quadrants: int | None = None


def mean_response_times(steps: Sequence[StepResponse], settings: ActuationSettings) -> ResponseTimes:
    """Return the mean measured times to 63 % of upward and downward steps, and the driver quadrants.

    A driver with one quadrant cannot force the current down. The current free-wheels with the time constant
    of the coil. Steps to zero then take much longer than other steps, because a step down to a current above
    zero needs only a part of this time. The quadrants are unknown if the runs lack steps up, steps to zero,
    or steps down to another value.
    """
    up, down = (
        mean_time(
            [(step.levels, step.time_s) for step in steps if step.upwards == upwards], settings.map_error
        )
        for upwards in (True, False)
    )
    to_zero, to_level = (
        [step.time_s for step in steps if not step.upwards and (step.levels[1] == 0) == is_zero]
        for is_zero in (True, False)
    )
    if not (to_zero and to_level and math.isfinite(up.mean_s)):
        return ResponseTimes(up, down)
    other_s = max(float(np.mean(to_level)), up.mean_s)
    is_slow = float(np.mean(to_zero)) > settings.free_wheeling_time_ratio * other_s
    return ResponseTimes(up, down, driver_quadrants=1 if is_slow else 2)


def mean_time(times: Sequence[tuple[tuple[int, int], float]], relative_error: float = 0.0) -> MeanTime:
    """Return the mean response time [s] of steps, and the standard error of this mean.

    ``times`` has one pair for each step: ``StepResponse.levels`` and the response time. Each combination of
    commands before and after the step has the same weight. The standard error has a random and a systematic
    part. The random part is the scatter between combinations, but at least the scatter of repeated steps. The
    systematic part is ``relative_error`` times the mean.
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
