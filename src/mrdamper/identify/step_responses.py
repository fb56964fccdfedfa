"""How force follows a step of the command, measured against what the same run has at either level.

Force depends on position, speed and direction as well as on the command. So each level's force is mapped
first, from the settled samples: the law's own force at that level held, plus a parabola over position for
each direction. What a step does is then a share, from 0 on the map of the level before to 1 on that of the
level after, whatever the motion goes through meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate

LEAST_STEP = 0.05  # of the command's range: a smaller change is none
_SAME_LEVEL = 0.05  # of the command's range
SETTLED_S = 0.1  # after a step, before the force counts as that of the level
_LONGEST_S = 0.15  # that is looked at after a step
_SHORTEST_S = 0.04  # that is needed after a step before the motion turns back
_AFTER_TURN, _BEFORE_TURN = 0.15, 0.03  # of the stroke: near a reversal the law errs in other ways
_LEAST_SAMPLES = 20  # of a map
_LINE = (0.5, 0.77)  # shares between which a response is taken as a line about 63 %
_LEAST_MOVED = 0.03  # of the run's largest force, by a step
SHARE = 1.0 - float(np.exp(-1.0))
"""Share of a step that is reached after one time constant of a first-order lag."""


@dataclass(frozen=True, slots=True, eq=False)
class StepResponse:
    """The response to one step: samples from the step on, the share that was reached, the maps' distance."""

    window: slice
    share: FloatArray
    size: FloatArray  # [N], by which the maps are apart
    upwards: bool  # whether the size of the command grows


@dataclass(frozen=True, slots=True)
class StepTime:
    """Times to 63 % of a step from one level to another: the model's, and as measured [s]."""

    levels: tuple[int, int]
    upwards: bool
    model_s: float
    measured_s: float


@dataclass(frozen=True, slots=True, eq=False)
class SteppedRun:
    """A run with its drive, its responses, and the law's force under each level held, by level."""

    run: PreparedRun
    drive: Drive
    responses: tuple[StepResponse, ...]
    held: Mapping[int, FloatArray]  # [N], the law's force
    levels: tuple[tuple[int, int], ...]  # before and after each response

    def model_shares(self, force: FloatArray) -> list[FloatArray]:
        """Return the shares that a law's force [N] over the run has reached, one row for each response."""
        found = []
        for response, (before, after) in zip(self.responses, self.levels, strict=True):
            low, high = self.held[before][response.window], self.held[after][response.window]
            found.append((force[response.window] - low) / (high - low))
        return found


def stepped_run(still: Damper, run: PreparedRun) -> SteppedRun | None:
    """Return the responses of a run to the steps of its command; None where there is none that tells.

    ``still`` is the damper without actuation. A step tells when its level is held long enough before and
    after, the motion goes on in one direction, and both levels have settled samples in that direction.
    """
    path = run.trajectory
    span = float(np.ptp(path.command))
    if span == 0.0:
        return None
    switches = np.flatnonzero(np.abs(np.diff(path.command)) > LEAST_STEP * span) + 1
    cuts = [0, *switches.tolist(), len(path)]
    levels = [float(np.median(path.command[a:b])) for a, b in pairwise(cuts)]
    key = [round(level / (_SAME_LEVEL * span)) for level in levels]
    settled_after = round(SETTLED_S / path.step)
    if np.median(np.diff(cuts)) < 2 * settled_after:
        return None
    drive, sliding, direction = open_drive(path), _sliding(run), np.sign(path.velocity)
    held = {
        k: simulate(still, replace(path, command=np.full(len(path), np.mean([
            level for level, of in zip(levels, key, strict=True) if of == k
        ]))))
        for k in set(key)
    }  # fmt: skip
    segment = np.repeat(np.arange(len(levels)), np.diff(cuts))
    since = np.arange(len(path)) - np.array(cuts)[segment]
    fell = np.array([False, *(b < a for a, b in pairwise(levels))])
    maps = _Maps(run, held, np.array(key)[segment], fell[segment], sliding & (since >= settled_after))
    responses, of_levels = [], []
    for j in range(1, len(levels)):
        first = cuts[j]
        stop = min(cuts[j + 1], first + round(_LONGEST_S / path.step))
        alike = sliding[first:stop] & (direction[first:stop] == direction[first])
        stop = first + (int(np.argmin(alike)) if not alike.all() else stop - first)
        ends = [maps.level(key[k], direction[first], fell=bool(fell[k])) for k in (j - 1, j)]
        if (stop - first) * path.step < _SHORTEST_S or ends[0] is None or ends[1] is None:
            continue
        window = slice(first, stop)
        size = (ends[1] - ends[0])[window]
        moved = held[key[j]][window] - held[key[j - 1]][window]
        least = _LEAST_MOVED * float(np.abs(run.force).max())
        if min(np.abs(size).min(), np.abs(moved).min()) < least:
            continue
        share = (run.force - ends[0])[window] / size
        responses.append(StepResponse(window, share, size, abs(levels[j]) > abs(levels[j - 1])))
        of_levels.append((key[j - 1], key[j]))
    return SteppedRun(run, drive, tuple(responses), held, tuple(of_levels)) if responses else None


@dataclass(frozen=True, slots=True, eq=False)
class _Maps:
    """Maps of the force over position, one for each level of the command and direction of the motion."""

    run: PreparedRun
    held: Mapping[int, FloatArray]
    key: FloatArray  # level of each sample
    fell: BoolArray  # whether it was reached from above: the iron remembers
    settled: BoolArray

    def level(self, key: int, direction: float, *, fell: bool) -> FloatArray | None:
        """Return the force [N] that a level would have at every sample; None where no samples tell."""
        path = self.run.trajectory
        here = self.settled & (self.key == key) & (np.sign(path.velocity) == direction)
        if np.count_nonzero(here) < _LEAST_SAMPLES:
            return None
        x = path.displacement / np.abs(path.displacement).max()
        columns = [np.ones_like(x), x, x**2]
        both = 0.0 < float(self.fell[here].mean()) < 1.0
        if both:
            columns.append(self.fell.astype(np.float64))
        a = np.stack(columns, axis=1)
        found = np.linalg.lstsq(a[here], (self.run.force - self.held[key])[here], rcond=None)[0]
        more = float(found[3]) * fell if both else 0.0
        return np.asarray(self.held[key] + a[:, :3] @ found[:3] + more)


def crossing(share: FloatArray, step: float) -> float:
    """Return the time [s] at which shares, a step [s] apart, reach 63 %; NaN where they do not.

    It is read from a line through the samples about it: noise does not take several across.
    """
    above = np.flatnonzero(share >= SHARE)
    if not len(above) or above[0] == 0:
        return 0.0 if len(above) else float("nan")
    k = int(above[0])
    near = [k - 1, k]
    while near[0] > 0 and share[near[0]] > share[near[0] - 1] > _LINE[0]:
        near.insert(0, near[0] - 1)
    while near[-1] + 1 < len(share) and share[near[-1]] < share[near[-1] + 1] < _LINE[1]:
        near.append(near[-1] + 1)
    slope, start = np.polyfit(share[near] - SHARE, near, 1)
    return float(step * (start if slope > 0.0 else k))


def measured_times(
    runs: Sequence[SteppedRun], force_of: Callable[[SteppedRun], FloatArray]
) -> list[StepTime]:
    """Return the times to 63 % of each step, under a model's force [N] over a run and as measured."""
    found = []
    for each in runs:
        step = each.run.trajectory.step
        shares = each.model_shares(force_of(each))
        for response, levels, model in zip(each.responses, each.levels, shares, strict=True):
            times = crossing(model, step), crossing(response.share, step)
            if np.isfinite(times).all():
                found.append(StepTime(levels, response.upwards, *times))
    return found


def _sliding(run: PreparedRun) -> BoolArray:
    """Return where the motion is well under way between two reversals and is scored."""
    path = run.trajectory
    turns = np.flatnonzero(np.diff(np.sign(path.velocity)) != 0.0) + 1
    marks = np.concatenate([[0], turns, [len(path) - 1]])
    x = path.displacement
    place = np.searchsorted(marks[1:-1], np.arange(len(path)), side="right")
    stroke = float(np.median(np.abs(np.diff(x[marks]))))
    since, left = np.abs(x - x[marks[place]]), np.abs(x - x[marks[place + 1]])
    found = (since > _AFTER_TURN * stroke) & (left > _BEFORE_TURN * stroke)
    found[: run.scored_from] = False
    return np.asarray(found)
