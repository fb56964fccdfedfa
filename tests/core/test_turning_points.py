"""Turning points: those of a plain loop, and of a motion that comes in batches those of the whole."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.core import TurningPoints, turning_points


def slowly(displacement: FloatArray, dead_band: float) -> list[int]:
    """Return the turning points by following both extremes from sample to sample."""
    found: list[int] = []
    direction, high, low = 0, 0, 0
    for index, value in enumerate(displacement.tolist()):
        high = index if value > displacement[high] else high
        low = index if value < displacement[low] else low
        if direction >= 0 and displacement[high] - value > dead_band:
            found.append(high)
            direction, low = -1, index
        elif direction <= 0 and value - displacement[low] > dead_band:
            found.append(low)
            direction, high = 1, index
    return [index for index in found if index]  # the first sample is no turning point


levels = st.lists(st.integers(-4, 4), min_size=2, max_size=60)


@given(levels=levels, dead_band=st.sampled_from([0.0, 0.5, 1.0, 2.5]))
def test_turning_points_are_extremes_from_which_the_motion_comes_back(
    levels: list[int], dead_band: float
) -> None:
    x = np.array(levels, dtype=np.float64)
    assert turning_points(x, dead_band).tolist() == slowly(x, dead_band)


@given(levels=levels, dead_band=st.sampled_from([0.0, 0.5, 1.0, 2.5]), cuts=st.lists(st.integers(1, 59)))
def test_batches_do_not_move_a_turning_point(levels: list[int], dead_band: float, cuts: list[int]) -> None:
    """Plateaus, single steps and reversals smaller than the dead band lie anywhere about the borders."""
    x = np.array(levels, dtype=np.float64)
    points = TurningPoints(dead_band)
    found: list[tuple[int, int]] = []
    for part in np.split(x, sorted(cut for cut in set(cuts) if cut < len(x))):
        turns, sides = points.step_batch(part)
        found += zip(turns.tolist(), sides.tolist(), strict=True)
    assert [at for at, _ in found] == turning_points(x, dead_band).tolist()
    for (at, side), (after, other) in pairwise(found):
        assert side == -other  # upper and lower ones follow each other
        assert side * (x[at] - x[after]) > dead_band
