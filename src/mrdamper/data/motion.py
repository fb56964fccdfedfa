"""Motion of a run: sine, triangle, chirp, periodic or random, with amplitude and frequency."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import fft

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points

REVERSAL_MIN_RATIO = 0.05  # A smaller reversal / range of the motion is not a turning point.
_STROKE_DEVIATION_MAX = 0.15  # Equal strokes and durations deviate from their median by less than this.


class MotionFound(NamedTuple):
    """Result of the classification. A motion that is not periodic has no ``period_s``."""

    label: str
    period_s: float | None
    half_period_s: float


def describe_motion(displacement: FloatArray, step: float) -> MotionFound:
    """Classify a motion by the turning points of a smoothed displacement [m] at a uniform step [s].

    - Sine: at least 70 % of the strokes are equal (within 15 % in length and duration). The amplitude is half
      the median stroke. The motion is a triangle if the rms is nearer to the rms of a triangle.
    - Chirp: the durations of the strokes change smoothly, by a factor above 1.5 in total.
    - Periodic: the autocorrelation exceeds 0.9 at a lag, which is the period.
    - Random: all other motions. The label has the frequency band with 90 % of the squared velocity.

    Amplitudes have two significant digits. A frequency is replaced by the roundest number within 2.5 %
    (10 % for the ends of a band): 0.2549 and 0.2551 Hz are "0.25 Hz". If a motion has no period, the half
    period is the median time between reversals.
    """
    stroke_range = float(np.ptp(displacement))
    turns = turning_points(displacement, REVERSAL_MIN_RATIO * stroke_range)
    if len(turns) < 3:
        whole = step * (len(displacement) - 1)
        return MotionFound(f"single stroke {_mm(stroke_range / 2)}", None, whole / 2)
    strokes = np.abs(np.diff(displacement[turns]))
    durations = np.diff(turns) * step
    half = float(np.median(durations))
    stroke = float(np.median(strokes))
    deviation = np.maximum(np.abs(durations / half - 1.0), np.abs(strokes / stroke - 1.0))
    alike = deviation < _STROKE_DEVIATION_MAX
    # The motion is a sine or a triangle if at least 70 % of its strokes are equal.
    if np.count_nonzero(alike) >= 0.7 * len(alike):
        regular = np.flatnonzero(alike)
        period = 2.0 * float(durations[regular[1:-1] if len(regular) > 4 else regular].mean())
        steady = displacement[turns[regular[0]] : turns[regular[-1] + 1]]
        # The ratio rms / amplitude is 0.707 for a sine and 0.577 for a triangle. The limit is midway.
        kind = "triangle" if float(np.std(steady)) < 0.64 * stroke / 2 else "sine"
        return MotionFound(f"{kind} {_mm(stroke / 2)} {_round_number(1.0 / period)} Hz", period, period / 2)
    change = float(np.median(np.abs(np.diff(np.log(durations)))))  # Relative change from stroke to stroke.
    is_smooth = len(durations) >= 8 and change < _STROKE_DEVIATION_MAX / 2
    if is_smooth and durations.max() > 1.5 * durations.min():
        band = f"{_round_number(0.5 / durations.max(), 0.1)}-{_round_number(0.5 / durations.min(), 0.1)} Hz"
        return MotionFound(f"chirp {_mm(strokes.max() / 2)} {band}", None, half)
    echo = _period_by_autocorrelation(displacement, step)
    if echo is not None:
        label = f"periodic {_mm(stroke_range / 2)} {_round_number(1.0 / echo)} Hz"
        return MotionFound(label, echo, echo / 2)
    low, high = (_round_number(f, 0.1) for f in velocity_band(np.diff(displacement) / step, step))
    return MotionFound(f"random {_mm(stroke_range / 2)} {low}-{high} Hz", None, half)


def _period_by_autocorrelation(displacement: FloatArray, step: float) -> float | None:
    n = len(displacement)
    size = 1 << (2 * n - 1).bit_length()  # Zero padding avoids a circular correlation.
    centred = displacement - displacement.mean()
    echo = fft.irfft(np.abs(fft.rfft(centred, size)) ** 2, size)[: n // 2]
    # The correlation at a lag is divided by the rms of the two sections that overlap at this lag.
    energy = np.concatenate(([0.0], np.cumsum(centred**2)))
    lags = np.arange(len(echo))
    overlap = np.sqrt(energy[n - lags] * (energy[n] - energy[lags]))
    echo = np.divide(echo, overlap, out=np.zeros_like(echo), where=overlap > 0.0)
    below = np.flatnonzero(echo < 0.5)
    if not len(below) or not (rest := echo[below[0] :]).max() > 0.9:  # The motion is not periodic.
        return None
    near = np.flatnonzero(rest > 0.98 * rest.max())  # The first peak is the period, later ones are multiples.
    first = near[: int(np.argmax(np.diff(near, append=len(echo)) > 1)) + 1]
    return float(below[0] + first[np.argmax(rest[first])]) * step


def velocity_band(velocity: FloatArray, step: float) -> tuple[float, float]:
    """Return the frequency band [Hz] that holds 90 % of the squared velocity [m/s]."""
    power = np.cumsum(np.abs(fft.rfft(velocity - velocity.mean())) ** 2)
    frequency = fft.rfftfreq(len(velocity), step)
    low, high = np.searchsorted(power, (0.05 * power[-1], 0.95 * power[-1]))
    return float(frequency[max(low, 1)]), float(frequency[high])


def _round_number(value: float, tolerance: float = 0.025) -> str:
    """Round to one digit, or two with a final 5, within ``tolerance``, else to any two."""
    decade = 10.0 ** np.floor(np.log10(value))
    for unit in (decade, 0.5 * decade):
        near = unit * round(value / unit)
        if abs(near / value - 1.0) <= tolerance:
            value = near
            break
    return f"{float(f'{value:.2g}'):g}"


def _mm(metres: float) -> str:
    return f"{float(f'{1e3 * metres:.2g}'):g} mm"
