"""What a damper can reach under its driver's limits: from where a run stands, and not at constant currents.

The reach at constant currents (``score.attainable_range``) takes for granted that the current has been where
it should be for ever. A driver has only so many volts, and one of one quadrant cannot pull the current down
at all, so a target that falls faster than the current can is out of reach, whatever controls. The reach of a
run at t holds the forces between those that it has at t if the driver gives nothing, and all it can, from
one lag before on, from the state in which the run stood then. Take the best run that is known: what it
cannot reach from where it stands, no current can without an error before.

The lag is the plant's own, where the driver is not at its limits: the time from a step by a quarter of the
highest current, from half of it up, until the force has gone 63 % of its way, along the very motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.loop import ReferenceTrajectory
from mrdamper.control.protocol import Plant
from mrdamper.control.score import AttainableRange

_SHARE = 1.0 - math.exp(-1.0)  # of its way that a force has gone after one lag
_FROM, _STEP = 0.5, 0.25  # of the highest current
_INSTANTS = 7  # at which the current steps, in as many stretches of much force
_STRONG = 0.75  # of the largest way that a step goes: what such a stretch has
_INTO = 0.3  # of a stretch, after which it steps: what is left is longer than a lag
_LONGEST_S = 0.3
_GRAINS = 5  # of a lag: from how many states the force is driven up and down


@dataclass(frozen=True, slots=True)
class StepLags:
    """Times [s] to 63 % of the force's way after a step of the current up and down."""

    rise_s: float
    fall_s: float


def step_lags(
    plant: Plant, course: ReferenceTrajectory, temperature_degC: float, highest_A: float
) -> StepLags:
    """Return the lags of a plant along a course: the medians over instants at which it has much force."""
    x, v = course.displacement, course.velocity
    levels = [share * highest_A for share in (_FROM, _FROM + _STEP, _FROM - _STEP)]
    held, *given = (plant.copy().advance_many(x, v, level, temperature_degC) for level in levels)
    way = np.min([np.abs(each - held) for each in given], axis=0)
    at = _instants(way, course.scored_from)
    base, done = plant.copy(), 0
    times = np.empty((len(at), 2))
    for row, instant in zip(times, at, strict=True):
        if instant > done:
            base.advance_many(x[done:instant], v[done:instant], levels[0], temperature_degC)
            done = instant
        after = slice(instant, instant + round(_LONGEST_S / course.step_s))
        for k, level in enumerate(levels[1:]):
            force = base.copy().advance_many(x[after], v[after], level, temperature_degC)
            gone = np.abs(force - held[after]) >= _SHARE * np.abs(given[k][after] - held[after])
            row[k] = (int(np.argmax(gone)) + 1 if gone.any() else len(gone)) * course.step_s
    rise_s, fall_s = np.median(times, axis=0).tolist()
    return StepLags(rise_s, fall_s)


def dynamic_range(
    plant: Plant,
    course: ReferenceTrajectory,
    current: FloatArray,
    temperature_degC: float,
    highest_A: float,
    *,
    lead_s: float,
) -> AttainableRange:
    """Return the reach of a run with a current [A], shape (n,), from where it stands ``lead_s`` earlier.

    Parameters
    ----------
    plant : in the state that the course begins with; it is copied
    lead_s : one lag, in steps of a fifth of which the run's states are taken; up to that much longer
    """
    count = len(course)
    lead = max(round(lead_s / course.step_s), 1)
    grain = max(lead // _GRAINS, 1)
    x, v = course.displacement, course.velocity
    ends = np.empty((2, count))
    base = plant.copy()
    for begin in range(0, max(count - lead, 1), grain):
        stop = min(begin + lead + grain, count)
        new = 0 if begin == 0 else lead  # the steps before are known from an earlier state
        for end, given in zip(ends, (0.0, highest_A), strict=True):
            force = base.copy().advance_many(x[begin:stop], v[begin:stop], given, temperature_degC)
            end[begin + new : stop] = force[new:]
        run = slice(begin, begin + grain)
        base.advance_many(x[run], v[run], current[run], temperature_degC)
    return AttainableRange(np.minimum(*ends), np.maximum(*ends))


def _instants(way: FloatArray, scored_from: int) -> list[int]:
    """Return where the current steps: early in the longest stretches in which a step goes far."""
    strong = way >= _STRONG * np.percentile(way, 95.0)
    if strong[scored_from:].any():
        strong[:scored_from] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], strong.astype(np.int8), [0]])))
    stretches = sorted(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True), key=lambda e: e[0] - e[1])
    return sorted(begin + int(_INTO * (end - begin)) for begin, end in stretches[:_INSTANTS])
