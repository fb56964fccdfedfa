"""For laws in Python, the motion is interpolated by cubics, whose turning points are found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.excitation import Trajectory
from mrdamper.models.python_law import hermite, turns_of

shares = st.integers(-8, 24).map(lambda k: k / 16)


@given(first=shares, second=shares, steepness=st.sampled_from([-4.0, -1.0, 1.0, 64.0]))
def test_cubic_has_extremum_where_slope_changes_sign(first, second, steepness):
    """The slope is s (t - t1) (t - t2). All values are multiples of 1/16, which are exact floats."""
    slope = (steepness * first * second, -steepness * (first + second), steepness)
    turns = turns_of((0.0, slope[0], slope[1] / 2.0, slope[2] / 3.0))
    expected = [] if first == second else sorted(t for t in (first, second) if 0.0 < t < 1.0)
    assert turns == pytest.approx(expected, abs=1e-12)


def test_turning_point_of_near_quadratic_is_found():
    assert turns_of((0.0, -1.0, 1.0, 1e-18)) == pytest.approx([0.5])
    assert turns_of((0.0, -1.0, 1.0, 0.0)) == [0.5]
    assert turns_of((0.0, -1e-20, 1.0, -1.0)) == pytest.approx([0.5e-20, 2.0 / 3.0])
    assert turns_of((0.0, 1.0, 0.0, 0.0)) == []


def test_cubic_motion_is_interpolated_exactly():
    """The interpolant of x = 1 - 2 t + 3 t^2 - t^3 (t in seconds) is exact for any step."""
    time = 0.25 * np.arange(5.0)
    motion = np.polynomial.Polynomial([1.0, -2.0, 3.0, -1.0])
    path = Trajectory(
        step=0.25,
        displacement=motion(time),
        velocity=motion.deriv()(time),
        acceleration=motion.deriv(2)(time),
        command=np.zeros(5),
    )
    for start, cubic in zip(time, hermite(path), strict=False):
        assert np.polynomial.polynomial.polyval([0.0, 0.3, 1.0], cubic) == pytest.approx(
            motion(start + 0.25 * np.array([0.0, 0.3, 1.0]))
        )
