"""Signals on a uniform step: noise level, cut-off, zero-phase smoothing, derivative, turning points.

Pure functions of arrays. Which of them are applied to a run, and with what numbers, is the business of
``prepare``; what the motion is called, of ``motion``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.quantities import FloatArray

__all__ = ["Spectrum", "differentiate", "low_pass", "measure_spectrum", "quantum_of", "turning_points"]

_ROLL_OFF = 1.5  # the low-pass falls from 1 at the cut-off to 0 at this multiple of it
_MAINS_Hz = tuple(multiple * mains for mains in (50.0, 60.0) for multiple in (1, 2, 3, 4, 5))
_NEGLIGIBLE = 1e-3  # noise in velocity below this share of the rms velocity is left alone

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
    """Sine spectrum of a displacement between its two ends, and the white noise found in it."""

    step: float  # [s]
    frequency: FloatArray  # [Hz]
    power: FloatArray  # scaled so that white noise has its variance at every frequency [m^2]
    noise: float  # standard deviation of the white noise [m]

    @property
    def nyquist_Hz(self) -> float:
        return 0.5 / self.step

    def cut_off(self) -> float:
        """Return the cut-off [Hz] at which the velocity loses as much signal as it is rid of noise.

        With power P and noise level N of the displacement, velocity has f^2 P and f^2 N. Passing a
        frequency costs its noise f^2 N, dropping it costs its signal f^2 (P - N); the cut-off minimises
        the sum of both. What lies within 1 % of the mains (50 and 60 Hz) and their first harmonics counts
        as noise. The cut-off is the Nyquist frequency (nothing removed) when noise would be less than 0.1 %
        of the rms velocity anyway.
        """
        square = self.frequency**2
        velocity_rms = 2 * np.pi * np.sqrt(np.mean(square * self.power))
        if self.noise * _GAIN_ON_WHITE_NOISE / self.step <= _NEGLIGIBLE * velocity_rms:
            return self.nyquist_Hz
        gain = self.power - 2 * self.noise**2
        for low, high in np.searchsorted(self.frequency, np.outer(_MAINS_Hz, (0.99, 1.01))):
            gain[low:high] = -(self.noise**2)
        best = float(self.frequency[int(np.argmax(np.cumsum(square * gain)))])
        return best if best * _ROLL_OFF < self.nyquist_Hz else self.nyquist_Hz

    def noise_passed(self, cutoff_Hz: float) -> float:
        """Return the standard deviation [m] of the noise that a low-pass lets through."""
        if cutoff_Hz >= self.nyquist_Hz:
            return self.noise
        return self.noise * float(np.sqrt(np.mean(_response(self.frequency, cutoff_Hz) ** 2)))


def measure_spectrum(displacement: FloatArray, step: float) -> Spectrum:
    """Return the sine spectrum of a displacement [m], its noise from the upper quarter of frequencies.

    The straight line between the ends is taken off first; what remains goes on oddly beyond both ends, so
    that a record which begins and ends at rest at different places has no jump. The noise level is a
    median, so that single lines (mains, a rig's resonance) do not raise it.
    """
    n = len(displacement)
    line = np.linspace(displacement[0], displacement[-1], n)
    coefficient, frequency = _sine_transform(displacement - line, step, taper=0)
    power = coefficient**2
    top = np.abs(coefficient[-(len(coefficient) // 4 + 1) :])
    noise = 1.4826 * float(np.median(top))
    return Spectrum(step, frequency, power, noise)


def low_pass(displacement: FloatArray, step: float, cutoff_Hz: float) -> FloatArray:
    """Return the displacement without what is above the cut-off; zero phase, nothing lost at the ends.

    The response is 1 to the cut-off, then half a cosine to 0 at 1.5 times the cut-off. A cubic that takes
    value and curvature at both ends (of a parabola fitted over half a period of the cut-off) is taken off
    before and added after, so that a record may begin and end in mid-motion.
    """
    n = len(displacement)
    if cutoff_Hz >= 0.5 / step:
        return displacement
    width = min(n, max(5, round(0.5 / (cutoff_Hz * step))))
    trend = _cubic_between(displacement, width)
    taper = round(2.0 / (cutoff_Hz * step))
    coefficient, frequency = _sine_transform(displacement - trend, step, taper=taper)
    coefficient *= _response(frequency, cutoff_Hz)
    return trend + _inverse_sine_transform(coefficient, n)


def differentiate(values: FloatArray, step: float) -> FloatArray:
    """Return the derivative by sixth-order differences, one-sided at the ends; at least 7 values."""
    derivative = np.empty_like(values)
    derivative[3:-3] = np.correlate(values, _CENTRED, mode="valid")
    derivative[:3] = _ENDS @ values[:7]
    derivative[-3:] = -(_ENDS @ values[:-8:-1])[::-1]
    derivative /= step
    return derivative


def quantum_of(displacement: FloatArray) -> float:
    """Return the smallest step [m] by which the displacement changes (its resolution)."""
    steps = np.abs(np.diff(displacement))
    steps = steps[steps > 1e-9 * np.ptp(displacement)]
    return float(steps.min()) if len(steps) else 0.0


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
    at_high = at_low = -1
    direction = 0
    for index, value in zip(candidates.tolist(), values, strict=True):
        if value > high:
            high, at_high = value, index
        if value < low:
            low, at_low = value, index
        if direction >= 0 and high - value > dead_band:
            if at_high >= 0:
                found.append(at_high)
            direction, low, at_low = -1, value, index
            high = value
        elif direction <= 0 and value - low > dead_band:
            if at_low >= 0:
                found.append(at_low)
            direction, high, at_high = 1, value, index
            low = value
    return np.array(found, dtype=np.intp)


def _response(frequency: FloatArray, cutoff_Hz: float) -> FloatArray:
    beyond = np.clip((frequency / cutoff_Hz - 1.0) / (_ROLL_OFF - 1.0), 0.0, 1.0)
    return 0.5 + 0.5 * np.cos(np.pi * beyond)


def _cubic_between(values: FloatArray, width: int) -> FloatArray:
    """Return the cubic that has the value and the curvature of both ends, over all samples."""
    n = len(values)
    window = np.arange(width, dtype=np.float64)
    fit = np.linalg.pinv(np.vander(window, 3, increasing=True))
    first, _, first_bend = fit @ values[:width]
    last, _, last_bend = fit @ values[: -width - 1 : -1]
    # with s in samples: second derivative goes linearly from 2 first_bend to 2 last_bend
    s = np.arange(n, dtype=np.float64)
    span = n - 1.0
    bend = first_bend * s**2 + (last_bend - first_bend) * s**3 / (3.0 * span)
    cubic: FloatArray = first + bend + (last - first - bend[-1]) * s / span
    return cubic


def _sine_transform(values: FloatArray, step: float, *, taper: int) -> tuple[FloatArray, FloatArray]:
    """Return sine coefficients and frequencies; the end is continued, oddly, to a length fast to transform.

    ``taper`` is the least number of samples over which the continuation falls to nothing.
    """
    from scipy import fft

    n = len(values)
    length = fft.next_fast_len(n - 1 + taper, real=True)
    more = min(length - (n - 1), n - 1)
    padded = np.zeros(length + 1)
    padded[:n] = values
    fall = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, more + 1) / max(more, 1))
    padded[n : n + more] = -values[-2 : -more - 2 : -1][: len(padded) - n] * fall
    coefficient = fft.dst(padded[1:-1], type=1, overwrite_x=True) * np.sqrt(0.5 / length)
    frequency = np.arange(1, length) / (2.0 * length * step)
    return coefficient, frequency


def _inverse_sine_transform(coefficient: FloatArray, n: int) -> FloatArray:
    from scipy import fft

    length = len(coefficient) + 1
    values = np.zeros(length + 1)
    values[1:-1] = fft.dst(coefficient, type=1) * np.sqrt(0.5 / length)
    return values[:n]
