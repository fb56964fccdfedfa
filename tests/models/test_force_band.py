"""The prediction band of the force has the correct width, also far from the fitted motions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.excitation import Sine, drive
from mrdamper.models.force_band import ForceBand, MotionSize

BAND = ForceBand(
    share=0.9,
    factor=0.5,
    run_share=0.3,
    base_N=4.0,
    expected_nrmse_percent=2.0,
    worst_nrmse_percent=3.0,
    left_out="motions",
    folds=3,
)


def test_force_band_width_matches_formula():
    force = np.array([3.0, -4.0, 0.0, 5.0])
    mean_square = (9.0 + 16.0 + 25.0) / 4.0
    width = 0.5 * np.sqrt(force**2 + 0.09 * mean_square + 16.0)
    assert BAND.half_width(force) == pytest.approx(width)
    assert BAND.half_width(force, 2.5) == pytest.approx(2.5 * width)
    measured = force + np.array([0.99, -0.99, 1.01, -1.01]) * width
    assert BAND.coverage(force, measured) == 0.5
    assert BAND.coverage(force, measured, 2.5) == 1.0


def test_motion_distance_is_larger_logarithm_of_ratios():
    """The distance of motions is the larger of |ln(displacement ratio)| and |ln(velocity ratio)|."""
    size = MotionSize(0.01, 0.2)
    assert size.distance([MotionSize(0.01, 0.1), MotionSize(0.1, 0.2)]) == pytest.approx(math.log(2.0))
    assert size.distance([MotionSize(0.02, 0.1), MotionSize(0.01, 0.05)]) == pytest.approx(math.log(2.0))


def test_distant_motion_widens_force_band():
    """The band is wider if a motion differs from the fitted motions by more than ``usual_distance``."""
    motion = drive(Sine(0.01, 2.0), duration=1.0, rate_Hz=400.0, command=0.0)
    own = MotionSize.from_motion(motion)
    assert own.displacement_m == pytest.approx(0.01 / math.sqrt(2.0), rel=2e-3)
    assert own.velocity_m_s == pytest.approx(0.04 * math.pi / math.sqrt(2.0), rel=2e-3)
    double = MotionSize(own.displacement_m, 2.0 * own.velocity_m_s)
    band = replace(BAND, motions=(double,), usual_distance=0.5, widening=3.0)
    assert band.widened(motion) == pytest.approx(1.0 + 3.0 * (math.log(2.0) - 0.5))
    assert replace(band, usual_distance=0.7).widened(motion) == 1.0
    assert replace(band, motions=()).widened(motion) == 1.0
    assert band.widened(replace(motion, velocity=0.0 * motion.time)) == 1.0
