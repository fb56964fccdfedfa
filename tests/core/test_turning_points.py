"""The kernel finds the same turning points as a plain loop over the samples."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points


def slowly(displacement: FloatArray, dead_band: float) -> list[int]:
    """Return the turning points by following the last maximum and minimum from sample to sample."""
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
    return [index for index in found if index]  # The first sample is not a turning point.


levels = st.lists(st.integers(-4, 4), min_size=2, max_size=60)


@given(levels=levels, dead_band=st.sampled_from([0.0, 0.5, 1.0, 2.5]))
def test_turning_points_match_simple_python_loop(levels: list[int], dead_band: float) -> None:
    x = np.array(levels, dtype=np.float64)
    assert turning_points(x, dead_band).tolist() == slowly(x, dead_band)
