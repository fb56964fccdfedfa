"""Reversals of a motion: the turning points on which hysteresis hangs.

Apart from ``signals`` because records count reversals without loading SciPy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray

__all__ = ["TurningPoints", "turning_points"]


def turning_points(displacement: FloatArray, dead_band: float) -> NDArray[np.intp]:
    """Return the samples at which the motion reverses by more than the dead band [m]; the ends do not count.

    A turning point is an extreme from which the displacement comes back by more than the dead band.
    """
    moves = np.diff(displacement)
    moving = np.flatnonzero(moves)
    rising = moves[moving] > 0.0
    candidates = np.append(moving[:-1][rising[1:] != rising[:-1]] + 1, len(displacement) - 1)
    values = displacement[candidates].tolist()
    found: list[int] = []
    high = low = float(displacement[0])
    at_high = at_low = -1  # not yet a candidate: the first sample is no turning point
    direction = 0
    for index, value in zip(candidates.tolist(), values, strict=True):
        if value > high:
            high, at_high = value, index
        if value < low:
            low, at_low = value, index
        if direction >= 0 and high - value > dead_band:
            if at_high >= 0:
                found.append(at_high)
            direction, low, at_low, high = -1, value, index, value
        elif direction <= 0 and value - low > dead_band:
            if at_low >= 0:
                found.append(at_low)
            direction, high, at_high, low = 1, value, index, value
    return np.array(found, dtype=np.intp)


@dataclass(slots=True)
class TurningPoints:
    """The same of a motion that comes in batches: what it has found so far, and what may yet turn.

    ``feed`` gives the turning points that the batch makes certain, as (sample, +1 for an upper one, -1 for a
    lower one), samples counted from the first of all. ``pending_low`` is where a lower one would be if
    the motion rose from now on; None while it rises already.
    """

    dead_band: float
    taken: int = 0  # samples so far
    last: float = 0.0  # displacement at the latest
    direction: int = 0
    high: float = 0.0
    at_high: int = -1  # -1: not yet a candidate; the first sample is no turning point
    low: float = 0.0
    at_low: int = -1

    @property
    def pending_low(self) -> int | None:
        return self.at_low if self.direction <= 0 and self.at_low >= 0 else None

    @property
    def pending_high(self) -> int | None:
        return self.at_high if self.direction >= 0 and self.at_high >= 0 else None

    def feed(self, displacement: FloatArray) -> list[tuple[int, int]]:
        """Take the next samples; return the turning points that are certain now."""
        if not len(displacement):
            return []
        if not self.taken:
            self.last = self.high = self.low = float(displacement[0])
        x = np.concatenate(([self.last], displacement))
        first = self.taken - 1  # sample of x[0]
        moves = np.diff(x)
        moving = np.flatnonzero(moves)
        rising = moves[moving] > 0.0
        # where the motion turns, and where the last move led: the next may lead back from there
        candidates = moving[np.append(rising[1:] != rising[:-1], True)] + 1 if len(moving) else moving
        found: list[tuple[int, int]] = []
        for at, value in zip(candidates.tolist(), x[candidates].tolist(), strict=True):
            index = first + at
            if value > self.high:
                self.high, self.at_high = value, index
            if value < self.low:
                self.low, self.at_low = value, index
            if self.direction >= 0 and self.high - value > self.dead_band:
                if self.at_high >= 0:
                    found.append((self.at_high, 1))
                self.direction, self.low, self.at_low, self.high = -1, value, index, value
            elif self.direction <= 0 and value - self.low > self.dead_band:
                if self.at_low >= 0:
                    found.append((self.at_low, -1))
                self.direction, self.high, self.at_high, self.low = 1, value, index, value
        self.taken += len(displacement)
        self.last = float(displacement[-1])
        return found
