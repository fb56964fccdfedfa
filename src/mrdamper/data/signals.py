"""Signals on a uniform step: noise, cut-off, zero-phase smoothing and its derivatives.

Pure functions of arrays. Which of them are applied to a run, and with what numbers, is the business of
``prepare``; what the motion is called, of ``motion``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.core import solve_banded

_NEGLIGIBLE = 1e-3  # noise in velocity below this share of the rms velocity is left alone
_HARMONICS = 5.0  # the cut-off is at least this multiple of the motion's mean frequency
_MAINS_Hz = tuple(multiple * mains for mains in (50.0, 60.0) for multiple in (1, 2, 3, 4, 5))

_DEGREE = 5  # of the spline
_STIFFNESS = 1e-4  # share of the fit given to the fourth differences of the spline's coefficients
_PENALTY = np.array([1.0, -4.0, 6.0, -4.0, 1.0])

# First derivative by sixth-order differences: centred, and for the three samples nearest an end.
_CENTRED = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60.0
_ENDS = (
    np.array(
        [
            [-147, 360, -450, 400, -225, 72, -10],
            [-10, -77, 150, -100, 50, -15, 2],
            [2, -24, -35, 80, -30, 8, -1],
        ]
    )
    / 60.0
)
_GAIN_ON_WHITE_NOISE = float(np.sqrt(np.sum(_CENTRED**2)))


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Sine spectrum of a displacement between its two ends, and the white noise in it."""

    step: float  # [s]
    frequency: FloatArray  # [Hz]
    power: FloatArray  # scaled so that white noise has its variance at every frequency [m^2]
    noise: float  # standard deviation of the white noise [m]

    def cut_off(self) -> float:
        """Return the cut-off [Hz] at which the velocity loses as much signal as it is rid of noise.

        With power P and noise level N of the displacement, velocity has f^2 P and f^2 N. Passing a
        frequency costs its noise f^2 N, dropping it costs its signal f^2 (P - N); the cut-off minimises
        the sum of both. What lies within 1 % of the mains (50 and 60 Hz) and their first harmonics counts
        as noise. The cut-off is at least five times the mean frequency of the motion (rms acceleration
        over 2 pi rms velocity), and the Nyquist frequency (nothing is removed) when noise would be less
        than 0.1 % of the rms velocity anyway.
        """
        square = self.frequency**2
        velocity_rms = 2 * np.pi * np.sqrt(np.mean(square * self.power))
        if self.noise * _GAIN_ON_WHITE_NOISE / self.step <= _NEGLIGIBLE * velocity_rms:
            return 0.5 / self.step
        gain = self.power - 2 * self.noise**2
        for low, high in np.searchsorted(self.frequency, np.outer(_MAINS_Hz, (0.99, 1.01))):
            gain[low:high] = -(self.noise**2)
        best = int(np.argmax(np.cumsum(square * gain))) + 1
        velocity = square[:best] * self.power[:best]
        mean = float(np.sqrt(np.sum(square[:best] * velocity) / np.sum(velocity)))
        return max(float(self.frequency[best - 1]), _HARMONICS * mean)


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """Displacement [m], velocity [m/s] and acceleration [m/s^2] that belong together, shape (n,)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def measure_spectrum(displacement: FloatArray, step: float) -> Spectrum:
    """Return the sine spectrum of a displacement [m], and its noise.

    The straight line between the ends is taken off first; what remains goes on oddly beyond both ends, so
    that a record which begins and ends at rest at different places has no jump. The noise is the median
    level of the upper quarter of frequencies (single lines do not raise it), and at least that of the
    rounding where the displacement keeps to a grid. Up to 2 % of the record may be left out at its end, for
    a length that is fast to transform.
    """
    n = fast_length(len(displacement) - 1) + 1
    kept = displacement[:n] - np.linspace(displacement[0], displacement[n - 1], n)
    odd = np.concatenate([kept[:-1], -kept[:0:-1]])  # its sines alone are left: the sine transform
    coefficient = -np.fft.rfft(odd).imag[1:-1] * np.sqrt(0.5 / (n - 1))
    frequency = np.arange(1, n - 1) / (2.0 * (n - 1) * step)
    noise = 1.4826 * float(np.median(np.abs(coefficient[-(n // 4) :])))
    return Spectrum(step, frequency, coefficient**2, max(noise, _rounding(displacement)))


def knot_spacing(step: float, cutoff_Hz: float) -> int:
    """Return the samples, a step [s] apart, between two knots of the smoothing spline; 1: no smoothing."""
    return max(1, round(0.5 / (cutoff_Hz * step)))


def smooth(displacement: FloatArray, step: float, cutoff_Hz: float) -> Kinematics:
    """Return the displacement [m] without what is above the cut-off, and its derivatives; zero phase.

    A quintic spline is fitted by least squares, with a knot every half period of the cut-off (rounded to
    whole samples); velocity and acceleration are its derivatives. It is bound to nothing at the ends, so
    that a record may begin and end in mid-motion. A slight penalty on fourth differences of its coefficients
    (Eilers & Marx's P-spline) keeps noise at the ends down; on a motion at a fifth of the cut-off it costs
    less than 1e-5.

    Without anything to remove (a spacing of one sample) the derivatives are sixth-order differences.
    """
    n = len(displacement)
    spacing = min(knot_spacing(step, cutoff_Hz), max(1, n // 4))
    if spacing == 1:
        velocity = differentiate(displacement, step)
        return Kinematics(displacement, velocity, differentiate(velocity, step))
    basis = _spline_basis(spacing)
    blocks = -(-n // spacing)
    count = blocks + _DEGREE
    last = basis[0][:, : n - (blocks - 1) * spacing]
    inside, at_end = basis[0] @ basis[0].T, last @ last.T
    normal = np.zeros((_DEGREE + 1, count))  # lower band form
    for d in range(_DEGREE + 1):
        for j in range(_DEGREE + 1 - d):
            normal[d, j : j + blocks - 1] += inside[j + d, j]
            normal[d, j + blocks - 1] += at_end[j + d, j]
    for d in range(len(_PENALTY)):
        for j in range(len(_PENALTY) - d):
            weight = _STIFFNESS * spacing * _PENALTY[j] * _PENALTY[j + d]
            normal[d, j : j + count - len(_PENALTY) + 1] += weight
    padded = np.zeros(blocks * spacing)
    padded[:n] = displacement
    moments = padded.reshape(blocks, spacing) @ basis[0].T
    right = np.zeros(count)
    for j in range(_DEGREE + 1):
        right[j : j + blocks] += moments[:, j]
    coefficients = solve_banded(normal, right)
    active = np.lib.stride_tricks.sliding_window_view(coefficients, _DEGREE + 1)
    x, v, a = ((active @ weights).ravel()[:n] for weights in basis)
    return Kinematics(x, v / step, a / step**2)


def differentiate(values: FloatArray, step: float) -> FloatArray:
    """Return the derivative at a step [s] by sixth-order differences, one-sided at the ends; 7 values."""
    derivative = np.empty_like(values)
    derivative[3:-3] = np.correlate(values, _CENTRED, mode="valid")
    derivative[:3] = _ENDS @ values[:7]
    derivative[-3:] = -(_ENDS @ values[:-8:-1])[::-1]
    derivative /= step
    return derivative


def fast_length(most: int) -> int:
    """Return the longest length up to a most (1 or more) that is fast to transform: 2^i 3^j 5^k."""
    best, fives = 1, 1
    while fives <= most:
        threes = fives
        while threes <= most:
            best = max(best, threes << ((most // threes).bit_length() - 1))
            threes *= 3
        fives *= 5
    return best


def smallest_step(displacement: FloatArray) -> float:
    """Return the smallest amount [m] by which the displacement changes (its resolution, if it has one)."""
    steps = np.abs(np.diff(displacement))
    steps = steps[steps > 1e-9 * np.ptp(displacement)]
    return float(steps.min()) if len(steps) else 0.0


@lru_cache(maxsize=64)
def _spline_basis(spacing: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the six splines active between two knots and their derivatives per sample and per sample^2.

    Shape (6, spacing) each: one row per spline, one column per sample from a knot on.
    """
    at = np.arange(spacing) / spacing

    def active(degree: int) -> FloatArray:
        """Return the uniform splines of a degree that are not zero after a knot (Cox-de Boor)."""
        values = np.ones((1, spacing))
        for d in range(1, degree + 1):
            older, newer = np.pad(values, ((1, 0), (0, 0))), np.pad(values, ((0, 1), (0, 0)))
            j = np.arange(d + 1)[:, None]
            values = ((at + d - j) * older + (j + 1 - at) * newer) / d
        return values

    def slope(values: FloatArray) -> FloatArray:
        """Return the derivative of the splines of the next degree, per sample."""
        return -np.diff(values, axis=0, prepend=0.0, append=0.0) / spacing

    return active(_DEGREE), slope(active(_DEGREE - 1)), slope(slope(active(_DEGREE - 2)))


def _rounding(displacement: FloatArray) -> float:
    """Return the standard deviation of rounding [m] where the displacement keeps to a grid, else 0."""
    resolution = smallest_step(displacement)
    if resolution == 0.0:
        return 0.0
    steps = np.abs(np.diff(displacement)) / resolution
    if steps.min() > 0.5 and steps.max() < 1.5:  # a motion of constant speed, not a grid
        return 0.0
    for parts in (1, 2, 3):  # the finest resolution itself need not occur
        if np.max(np.abs(parts * steps - np.round(parts * steps))) < 0.01:
            return resolution / parts / float(np.sqrt(12.0))
    return 0.0
