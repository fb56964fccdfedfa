"""The temperature of a run: what a noisy, slow thermocouple says, as a law can use it."""

from __future__ import annotations

import math

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.signals import smooth

__all__ = ["CUTOFF_Hz", "condition_temperature"]

_STEADY_K = 1.0  # a run that drifts by less is at one temperature
_PARTS = 8  # of a run, whose means tell one that warms up and cools again
CUTOFF_Hz = 0.25  # of the smoothing of one that drifts: heat is slow


def condition_temperature(temperature: FloatArray, step: float, lag_s: float = 0.0) -> FloatArray:
    """Return the temperature [K] without the sensor's noise, and ahead by its lag, shape (n,).

    A run whose straight line of best fit drifts by less than 1 K (or by less than three standard errors), and
    whose eighths have means within 1 K (or six of their standard errors), is at one temperature: its mean,
    at every sample. Any other is smoothed with a cut-off of 0.25 Hz, or is its line below 16 s. A first order
    lag ``lag_s`` of the sensor is taken back: T + lag dT/dt.
    """
    n = len(temperature)
    time = step * (np.arange(n) - 0.5 * (n - 1))
    slope = float(time @ temperature / (time @ time))
    mean = float(np.mean(temperature))
    noise = float(np.std(temperature - mean - slope * time))
    drift = abs(slope) * step * n
    short = step * n < 4.0 / CUTOFF_Hz  # too short for knots
    wander = 0.0 if short else float(np.ptp([part.mean() for part in np.array_split(temperature, _PARTS)]))
    if drift < max(_STEADY_K, 3.0 * noise * math.sqrt(12.0 / n)) and wander < max(
        _STEADY_K, 6.0 * noise * math.sqrt(_PARTS / n)
    ):
        return np.full(n, mean)
    if short:
        return np.asarray(mean + slope * (time + lag_s))
    smoothed = smooth(temperature, step, CUTOFF_Hz)
    return smoothed.displacement + lag_s * smoothed.velocity
