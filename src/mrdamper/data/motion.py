"""What a measured motion is: sine, triangle, chirp, periodic or random; its amplitude and frequency.

Read from the turning points of the smoothed displacement, never from a file's name, so that runs at other
currents share the label of their motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import fft

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points

SWING = 0.05
"""Share of its range by which a motion comes back where a turning point counts."""

_ALIKE = 0.15  # strokes and their durations are alike when this near to their median
_MOST = 0.7  # this share of the strokes must be alike for a motion to be periodic
_TRIANGLE = 0.64  # rms / amplitude: sine 0.707, triangle 0.577; halfway
_ECHO = 0.9  # autocorrelation of a periodic motion at its period


@dataclass(frozen=True, slots=True)
class MotionFound:
    """A motion's label, its period (None: not periodic) and the usual time from one reversal to the next."""

    label: str
    period_s: float | None
    half_period_s: float


def describe_motion(displacement: FloatArray, step: float) -> MotionFound:
    """Return what the motion is, from the turning points of a displacement [m] at a uniform step [s].

    - At least 70 % of the strokes alike (within 15 % in length and duration): a sine or, when the rms is
      nearer to that, a triangle; amplitude is half the median stroke.
    - Durations that change smoothly from stroke to stroke, by a factor over 1.5 in all: a chirp.
    - An autocorrelation over 0.9 at some lag: periodic, with that period.
    - Anything else: random, with the frequencies between which 90 % of the squared velocity lies.

    Amplitudes are given to two significant digits; a frequency as the plainest number within 2.5 % of it
    (10 % for the ends of a band), so that 0.2549 and 0.2551 Hz are both "0.25 Hz". The half period is the
    median time between reversals.
    """
    stroke_range = float(np.ptp(displacement))
    turns = turning_points(displacement, SWING * stroke_range)
    if len(turns) < 3:
        whole = step * (len(displacement) - 1)
        return MotionFound(f"single stroke {_mm(stroke_range / 2)}", None, whole / 2)
    strokes = np.abs(np.diff(displacement[turns]))
    durations = np.diff(turns) * step
    half = float(np.median(durations))
    stroke = float(np.median(strokes))
    alike = (np.abs(durations / half - 1.0) < _ALIKE) & (np.abs(strokes / stroke - 1.0) < _ALIKE)
    if np.count_nonzero(alike) >= _MOST * len(alike):
        regular = np.flatnonzero(alike)
        period = 2.0 * float(durations[regular[1:-1] if len(regular) > 4 else regular].mean())
        steady = displacement[turns[regular[0]] : turns[regular[-1] + 1]]
        kind = "triangle" if float(np.std(steady)) < _TRIANGLE * stroke / 2 else "sine"
        return MotionFound(f"{kind} {_mm(stroke / 2)} {_plain(1.0 / period)} Hz", period, period / 2)
    if len(durations) >= 8 and _is_smooth(durations) and durations.max() > 1.5 * durations.min():
        band = f"{_plain(0.5 / durations.max(), 0.1)}-{_plain(0.5 / durations.min(), 0.1)} Hz"
        return MotionFound(f"chirp {_mm(strokes.max() / 2)} {band}", None, half)
    echo = _period_by_autocorrelation(displacement, step)
    if echo is not None:
        label = f"periodic {_mm(stroke_range / 2)} {_plain(1.0 / echo)} Hz"
        return MotionFound(label, echo, echo / 2)
    low, high = velocity_band(np.diff(displacement) / step, step)
    return MotionFound(
        f"random {_mm(stroke_range / 2)} {_plain(low, 0.1)}-{_plain(high, 0.1)} Hz", None, half
    )


def _is_smooth(durations: FloatArray) -> bool:
    """Tell whether durations of strokes change little from one to the next."""
    return float(np.median(np.abs(np.diff(np.log(durations))))) < _ALIKE / 2


def _period_by_autocorrelation(displacement: FloatArray, step: float) -> float | None:
    n = len(displacement)
    size = 1 << (2 * n - 1).bit_length()  # as many zeros as values, or more
    centred = displacement - displacement.mean()
    echo = fft.irfft(np.abs(fft.rfft(centred, size)) ** 2, size)[: n // 2]
    # normalised by the energy of the two segments that overlap at each lag
    energy = np.concatenate(([0.0], np.cumsum(centred**2)))
    lags = np.arange(len(echo))
    overlap = np.sqrt(energy[n - lags] * (energy[n] - energy[lags]))
    echo = np.divide(echo, overlap, out=np.zeros_like(echo), where=overlap > 0.0)
    below = np.flatnonzero(echo < 0.5)
    if not len(below):
        return None
    rest = echo[below[0] :]
    if not rest.max() > _ECHO:
        return None
    near = np.flatnonzero(rest > 0.98 * rest.max())  # the first echo, not one of its multiples
    first = near[: int(np.argmax(np.diff(near, append=len(echo)) > 1)) + 1]
    return float(below[0] + first[np.argmax(rest[first])]) * step


def velocity_band(velocity: FloatArray, step: float) -> tuple[float, float]:
    """Return the frequencies [Hz] between which 90 % of the squared velocity [m/s] lies."""
    power = np.cumsum(np.abs(fft.rfft(velocity - velocity.mean())) ** 2)
    frequency = fft.rfftfreq(len(velocity), step)
    low, high = np.searchsorted(power, (0.05 * power[-1], 0.95 * power[-1]))
    return float(frequency[max(low, 1)]), float(frequency[high])


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def _plain(value: float, tolerance: float = 0.025) -> str:
    """Return the plainest number near a value: one digit, else two with the second a 5, else any two."""
    decade = 10.0 ** np.floor(np.log10(value))
    for unit in (decade, 0.5 * decade):
        near = unit * round(value / unit)
        if abs(near / value - 1.0) <= tolerance:
            return _two_digits(near)
    return _two_digits(value)


def _mm(metres: float) -> str:
    return f"{_two_digits(1e3 * metres)} mm"
