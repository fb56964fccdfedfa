"""Turning points that come in batches are those of the whole motion."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.reversals import TurningPoints, turning_points

levels = st.lists(st.integers(-4, 4), min_size=2, max_size=60)


@given(levels=levels, dead_band=st.sampled_from([0.0, 0.5, 1.0, 2.5]), cuts=st.lists(st.integers(1, 59)))
def test_batches_do_not_move_a_turning_point(levels: list[int], dead_band: float, cuts: list[int]) -> None:
    """Plateaus, single steps and reversals smaller than the dead band lie anywhere about the borders."""
    x = np.array(levels, dtype=np.float64)
    points = TurningPoints(dead_band)
    found: list[tuple[int, int]] = []
    for part in np.split(x, sorted(cut for cut in set(cuts) if cut < len(x))):
        found += points.feed(part)
    assert [at for at, _ in found] == turning_points(x, dead_band).tolist()
    for (at, side), (after, other) in pairwise(found):
        assert side == -other  # upper and lower ones follow each other
        assert side * (x[at] - x[after]) > dead_band
