"""Signals with a uniform time step: noise, cut-off, zero-phase smoothing and derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD, FloatArray

_MAINS_Hz = tuple(multiple * mains for mains in (50.0, 60.0) for multiple in (1, 2, 3, 4, 5))

_SPLINE_DEGREE = 5
_FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])

# Weights of sixth-order differences: ``_CENTRED`` for inner samples, ``_ENDS`` for the three at either end.
_CENTRED = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60.0
_END_WEIGHTS = (
    *([-147, 360, -450, 400, -225, 72, -10], [-10, -77, 150, -100, 50, -15, 2]),
    [2, -24, -35, 80, -30, 8, -1],
)
_ENDS = np.array(_END_WEIGHTS) / 60.0
_GAIN_ON_WHITE_NOISE = float(np.sqrt(np.sum(_CENTRED**2)))

# The temperature of a run with a smaller drift is replaced by its mean.
DRIFT_MAX_K = 1.0
# The run is divided into this number of parts. Their mean temperatures show if it warms up and cools down.
PART_COUNT = 8
# Cut-off of the temperature smoothing. Temperature changes slowly because of the heat capacity.
TEMPERATURE_CUTOFF_Hz = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Spectrum of a displacement (discrete sine transform), and its white noise."""

    step: float  # [s]
    frequency: FloatArray  # [Hz]
    power: FloatArray  # [m^2], scaled: the mean power of white noise is the noise's variance.
    noise: float  # standard deviation of the white noise [m]

    def cut_off(self) -> float:
        """Return the cut-off [Hz] that minimises the sum of passed noise and removed signal.

        If the displacement has power P and noise level N, the velocity has f^2 P and f^2 N. A passed
        frequency adds the noise f^2 N. A removed frequency loses the signal f^2 (P - N). Frequencies within
        1 % of the mains (50 and 60 Hz) and their first harmonics count as noise. The cut-off is at least five
        times the mean frequency of the motion (rms acceleration divided by 2 pi and by the rms velocity). It
        is the Nyquist frequency (no filter) if the noise is less than 0.1 % of the rms velocity.
        """
        square = self.frequency**2
        velocity_rms = 2 * np.pi * np.sqrt(np.mean(square * self.power))
        # The displacement is not filtered if the noise of the velocity is below 0.1 % of the rms velocity.
        if self.noise * _GAIN_ON_WHITE_NOISE / self.step <= 1e-3 * velocity_rms:
            return 0.5 / self.step
        gain = self.power - 2 * self.noise**2
        for low, high in np.searchsorted(self.frequency, np.outer(_MAINS_Hz, (0.99, 1.01))):
            gain[low:high] = -(self.noise**2)
        best = int(np.argmax(np.cumsum(square * gain))) + 1
        velocity = square[:best] * self.power[:best]
        mean = float(np.sqrt(np.sum(square[:best] * velocity) / np.sum(velocity)))
        return max(float(self.frequency[best - 1]), 5.0 * mean)


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """Displacement [m], velocity [m/s] and acceleration [m/s^2] of one motion, shape (n,)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def measure_spectrum(displacement: FloatArray, step: float) -> Spectrum:
    """Return the sine spectrum of a displacement [m], and its noise.

    First, the straight line between the first and the last sample is subtracted, and the remainder is
    continued as an odd function. Therefore a record that begins and ends at rest has no jump, even at
    different positions. The noise is the median magnitude in the upper quarter of the frequencies, because
    single spectral lines do not increase a median. If all displacements are multiples of a resolution, the
    noise is at least the rounding error. Up to 2 % of the record are ignored at its end, because the
    transform of the shorter length is faster.
    """
    from scipy.fft import dst, prev_fast_len  # Imported here because SciPy takes 0.25 s to load.

    n = prev_fast_len(len(displacement) - 1, real=True) + 1
    kept = displacement[:n] - np.linspace(displacement[0], displacement[n - 1], n)
    coefficient = np.asarray(dst(kept[1:-1], type=1)) * np.sqrt(0.5 / (n - 1))
    frequency = np.arange(1, n - 1) / (2.0 * (n - 1) * step)
    noise = DEVIATION_PER_MAD * float(np.median(np.abs(coefficient[-(n // 4) :])))
    return Spectrum(step, frequency, coefficient**2, max(noise, _rounding(displacement)))


def knot_spacing(step: float, cutoff_Hz: float) -> int:
    """Return the number of samples, ``step`` [s] apart, between two knots; 1 means no smoothing."""
    return max(1, round(0.5 / (cutoff_Hz * step)))


def smooth(displacement: FloatArray, step: float, cutoff_Hz: float) -> Kinematics:
    """Return the low-pass filtered displacement [m] and its derivatives, without phase shift.

    A quintic spline is fitted by least squares. Its knots have a distance of half a period of the cut-off
    (rounded to whole samples). Velocity and acceleration are its derivatives. The spline has no end
    conditions, because a record can start and end in motion. A small penalty on the fourth differences of its
    coefficients (P-spline of Eilers & Marx) reduces the noise at the ends. The penalty changes a motion at a
    fifth of the cut-off by less than 1e-5.

    If the spacing is one sample, the derivatives are sixth-order differences.
    """
    from scipy.interpolate import BSpline  # Imported here because SciPy takes 0.25 s to load.
    from scipy.linalg import solveh_banded
    from scipy.sparse import diags_array

    n = len(displacement)
    spacing = min(knot_spacing(step, cutoff_Hz), max(1, n // 4))
    if spacing == 1:
        velocity = differentiate(displacement, step)
        return Kinematics(displacement, velocity, differentiate(velocity, step))
    position = np.arange(n) / spacing
    knots = np.arange(-_SPLINE_DEGREE, math.ceil(n / spacing) + _SPLINE_DEGREE + 1.0)
    basis = BSpline.design_matrix(position, knots, _SPLINE_DEGREE)
    count = basis.shape[1]
    fourth = diags_array(_FOURTH_DIFFERENCE, offsets=range(5), shape=(count - 4, count))
    # 1e-4 * spacing is the weight of the penalty on fourth differences of the coefficients.
    normal = basis.T @ basis + 1e-4 * spacing * (fourth.T @ fourth)
    bands = [np.pad(normal.diagonal(-k), (0, k)) for k in range(_SPLINE_DEGREE + 1)]
    coefficients = solveh_banded(bands, np.asarray(basis.T @ displacement), lower=True)
    spline = BSpline(knots, coefficients, _SPLINE_DEGREE)
    x, v, a = (spline(position, order) / (spacing * step) ** order for order in range(3))
    return Kinematics(x, v, a)


def condition_temperature(temperature: FloatArray, step: float, lag_s: float = 0.0) -> FloatArray:
    """Return the measured temperature [K] with the noise and the lag of the sensor removed, shape (n,).

    A constant temperature is replaced by its mean. "Constant" means two conditions. The linear drift is below
    1 K (or three standard errors of the drift). The means of eight equal parts of the run agree within 1 K
    (or six standard errors of a mean). Any other temperature is smoothed with a cut-off of 0.25 Hz, or by a
    straight line if the run is shorter than 16 s. A first-order lag ``lag_s`` of the sensor is compensated:
    T + lag dT/dt.
    """
    n = len(temperature)
    time = step * (np.arange(n) - 0.5 * (n - 1))
    slope = float(time @ temperature / (time @ time))
    mean = float(np.mean(temperature))
    noise = float(np.std(temperature - mean - slope * time))
    drift = abs(slope) * step * n
    short = step * n < 4.0 / TEMPERATURE_CUTOFF_Hz  # The run is too short for the smoothing spline.
    means = [part.mean() for part in np.array_split(temperature, PART_COUNT)]
    wander = 0.0 if short else float(np.ptp(means))
    drift_max = max(DRIFT_MAX_K, 3.0 * noise * math.sqrt(12.0 / n))
    if drift < drift_max and wander < max(DRIFT_MAX_K, 6.0 * noise * math.sqrt(PART_COUNT / n)):
        return np.full(n, mean)
    if short:
        return np.asarray(mean + slope * (time + lag_s))
    smoothed = smooth(temperature, step, TEMPERATURE_CUTOFF_Hz)
    return smoothed.displacement + lag_s * smoothed.velocity


def differentiate(values: FloatArray, step: float) -> FloatArray:
    """Return the derivative of at least 7 values at a uniform step [s], by sixth-order differences."""
    derivative = np.empty_like(values)
    derivative[3:-3] = np.correlate(values, _CENTRED, mode="valid")
    derivative[:3] = _ENDS @ values[:7]
    derivative[-3:] = -(_ENDS @ values[:-8:-1])[::-1]
    return derivative / step


def smallest_step(displacement: FloatArray) -> float:
    """Return the smallest change of the displacement [m]: the resolution of a quantised signal."""
    steps = np.abs(np.diff(displacement))
    steps = steps[steps > 1e-9 * np.ptp(displacement)]
    return float(steps.min()) if len(steps) else 0.0


def _rounding(displacement: FloatArray) -> float:
    """Return the standard deviation of the rounding error [m] of a quantised displacement, otherwise 0."""
    resolution = smallest_step(displacement)
    if resolution == 0.0:
        return 0.0
    steps = np.abs(np.diff(displacement)) / resolution
    if steps.min() > 0.5 and steps.max() < 1.5:  # A constant speed gives equal steps.
        return 0.0
    for parts in (1, 2, 3):  # The smallest change may be 1, 2 or 3 times the resolution.
        if np.max(np.abs(parts * steps - np.round(parts * steps))) < 0.01:
            return resolution / parts / float(np.sqrt(12.0))
    return 0.0
