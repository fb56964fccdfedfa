"""Conditioning: convert the measured samples of a run to the trajectory that a damper model follows.

The samples are put on a uniform time grid. The displacement is smoothed and differentiated, and the noise of
current and temperature is removed. The module ``prepare`` chooses the settings (``Rules``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.data.signals import Kinematics, differentiate, smooth
from mrdamper.excitation import Trajectory

# The temperature of a run with a smaller drift is replaced by its mean.
DRIFT_MAX_K = 1.0
# The run is divided into this number of parts. Their mean temperatures show if it warms up and cools down.
PART_COUNT = 8
# Cut-off of the temperature smoothing. Temperature changes slowly because of the heat capacity.
TEMPERATURE_CUTOFF_Hz = 0.25


@dataclass(frozen=True, slots=True)
class Rules:
    """Settings for the conditioning of one run.

    Parameters
    ----------
    step_s : step of the grid
    cutoff_Hz : cut-off of the smoothing; the Nyquist frequency of the grid if there is no smoothing
    dead_band_m : smaller reversals of the motion are noise
    reference_m : measured displacement at the zero of the trajectory
    command : constant current or voltage of the run [A or V]; None: the measured samples are used
    measured_velocity : True if the velocity channel is used
    thermocouple_lag_s : first-order lag of the temperature sensor
    """

    step_s: float
    cutoff_Hz: float
    dead_band_m: float
    reference_m: float
    command: float | None
    measured_velocity: bool
    thermocouple_lag_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Channels of a run on a uniform grid, arrays of shape (n,)."""

    step_s: float
    displacement: FloatArray  # [m]
    force: FloatArray  # [N]
    command: FloatArray  # [A or V]
    velocity: FloatArray | None  # [m/s]
    temperature: FloatArray | None  # [K]

    def __len__(self) -> int:
        return len(self.displacement)


def even_step(time: FloatArray) -> float | None:
    """Return the step [s] of uniform time stamps, None if the run must be resampled."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    off = float(np.max(np.abs(time - (time[0] + step * np.arange(len(time))))))
    # Times are uniform if they deviate from a grid by at most 0.1 % of a step, or by their rounding.
    return step if off <= max(1e-3 * step, 0.6 * _rounding(time, off)) else None


def _rounding(time: FloatArray, off: float) -> float:
    """Return the power of ten [s] to which times are rounded, 0 if not rounded.

    ``off`` [s] is the largest deviation of the times from a uniform grid. Smaller powers are not tried.
    """
    unit = 10.0 ** math.ceil(math.log10(off)) if off > 0.0 else 0.0
    for candidate in (unit, 10.0 * unit):
        if candidate and np.allclose(time / candidate, np.round(time / candidate), rtol=0.0, atol=1e-4):
            return candidate
    return 0.0


def sample_uniformly(run: RigRun) -> Samples:
    """Return the channels of a run on a uniform time grid, unchanged if the time is uniform already.

    Otherwise, the grid has the median step. Displacement is resampled by a cubic spline, the other channels
    linearly.
    """
    step = even_step(run.time)
    if step is not None:
        return Samples(step, run.displacement, run.force, run.command, run.velocity, run.temperature)
    from scipy.interpolate import CubicSpline

    step = float(np.median(np.diff(run.time)))
    first, last = float(run.time[0]), float(run.time[-1])
    count = int((last - first) / step * (1.0 + 1e-12)) + 1
    time = first + step * np.arange(count)

    def resample(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else np.interp(time, run.time, values)

    return Samples(
        step,
        np.asarray(CubicSpline(run.time, run.displacement)(time), dtype=np.float64),
        np.interp(time, run.time, run.force),
        np.interp(time, run.time, run.command),
        resample(run.velocity),
        resample(run.temperature),
    )


def condition_run(sampled: Samples, path: Kinematics, rules: Rules) -> Trajectory:
    """Return the trajectory of a run, given its samples on the grid and its smoothed displacement."""
    temperature = sampled.temperature
    if temperature is not None:
        temperature = condition_temperature(temperature, rules.step_s, rules.thermocouple_lag_s)
    velocity, acceleration = path.velocity, path.acceleration
    if rules.measured_velocity and sampled.velocity is not None:
        velocity = sampled.velocity
        acceleration = differentiate(velocity, rules.step_s)
    return Trajectory(
        step=rules.step_s,
        displacement=path.displacement - rules.reference_m,
        velocity=velocity,
        acceleration=acceleration,
        command=sampled.command if rules.command is None else np.full(len(sampled), rules.command),
        dead_band=rules.dead_band_m,
        temperature=temperature,
    )


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
    if drift < max(DRIFT_MAX_K, 3.0 * noise * math.sqrt(12.0 / n)) and wander < max(
        DRIFT_MAX_K, 6.0 * noise * math.sqrt(PART_COUNT / n)
    ):
        return np.full(n, mean)
    if short:
        return np.asarray(mean + slope * (time + lag_s))
    smoothed = smooth(temperature, step, TEMPERATURE_CUTOFF_Hz)
    return smoothed.displacement + lag_s * smoothed.velocity
