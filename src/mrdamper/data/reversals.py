"""Reversals of a motion: the turning points on which hysteresis hangs.

Apart from ``signals`` because records count reversals without loading SciPy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrdamper.quantities import FloatArray

__all__ = ["turning_points"]


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
