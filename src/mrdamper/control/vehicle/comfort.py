"""How a body's vertical acceleration is felt: the weighting W_k of ISO 2631-1."""

from __future__ import annotations

import math

import numpy as np

from mrdamper.arrays import FloatArray

_BAND_Hz = (0.4, 100.0)  # limits, by Butterworth's filters of second order
_TRANSITION_Hz, _TRANSITION_Q = 12.5, 0.63  # from acceleration to velocity
_STEP_Hz, _STEP_Q = (2.37, 3.35), 0.91  # upwards


def weighting_sections() -> list[tuple[FloatArray, FloatArray]]:
    """Return numerators and denominators in s of the four parts of W_k, highest power first.

    Structure and numbers as in ``ChISO2631_1_Wk`` of Project Chrono (src/chrono/utils/ChFilters.cpp).
    """
    low, high, turn, first, second = (2.0 * math.pi * each for each in (*_BAND_Hz, _TRANSITION_Hz, *_STEP_Hz))
    root = math.sqrt(2.0)
    parts = (
        ((1.0, 0.0, 0.0), (1.0, root * low, low**2)),
        ((high**2,), (1.0, root * high, high**2)),
        ((turn, turn**2), (1.0, turn / _TRANSITION_Q, turn**2)),
        ((1.0, first / _STEP_Q, first**2), (1.0, second / _STEP_Q, second**2)),
    )
    return [(np.array(above), np.array(below)) for above, below in parts]


def weighted(acceleration: FloatArray, step_s: float) -> FloatArray:
    """Return the weighted acceleration [m/s^2] of one that begins at rest, shape (n,).

    Parameters
    ----------
    acceleration : vertical, of the body [m/s^2], shape (n,)
    step_s : between two samples; a millisecond at most, or the filter's upper end is warped
    """
    from scipy.signal import bilinear, lfilter

    felt = np.asarray(acceleration, dtype=np.float64)
    for above, below in weighting_sections():
        felt = lfilter(*bilinear(above, below, fs=1.0 / step_s), felt)
    return felt
