"""Preparation of a measured run: the trajectory for a simulation, and the measured force.

The displacement is smoothed because its derivative drives the model. Without smoothing, displacement steps of
3 um at 1 kHz would cause errors of +-90 N in a dashpot of 3e4 N s/m. The force is not changed. Settings
without a value are chosen for each run by the rules of :func:`prepare_run`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data import signals
from mrdamper.data.motion import describe_motion
from mrdamper.data.records import WITHOUT_MOTION, Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.schema import NotNegative, Positive, check_ranges, read_record

_PLOT_DURATION_s = 3.0  # Plotted duration of a motion without a period.
Reference = Literal["start", "mean", "none"]


class OppositeSignError(InputError):
    """Error of a run whose force and velocity have a negative ``correlation``."""

    correlation = 0.0


@dataclass(frozen=True, slots=True)
class Preparation:
    """Settings for the preparation of runs; ``None``: automatic, by the rules of ``prepare_run``."""

    cutoff_Hz: Positive | None = None  # Smoothing of displacement; math.inf: no smoothing.
    dead_band_m: NotNegative | None = None  # Smaller reversals are noise.
    reference: Reference = "start"  # Choice of the zero of displacement.
    from_s: float | None = None  # First time [s] in the file's clock.
    to_s: float | None = None  # Last time [s].
    force_offset_N: float = 0.0  # Known tare, subtracted from the force.
    thermocouple_lag_s: NotNegative = 0.0  # First-order lag; compensated if the temperature drifts.

    def __post_init__(self) -> None:
        is_unfiltered = self.cutoff_Hz == math.inf
        check_ranges(replace(self, cutoff_Hz=None) if is_unfiltered else self, "preparation")

    def to_dict(self) -> dict[str, float | str | None]:
        """Return the fields as JSON values. Without smoothing, ``cutoff_Hz`` is the text "none"."""
        return asdict(self) | ({"cutoff_Hz": "none"} if self.cutoff_Hz == math.inf else {})

    @classmethod
    def from_dict(cls, given: Mapping[str, object]) -> Preparation:
        """Return the preparation from the result of ``to_dict``. Raise an error for an unknown key."""
        if given.get("cutoff_Hz") != "none":
            return read_record(cls, given, "preparation")
        return replace(read_record(cls, {**given, "cutoff_Hz": None}, "preparation"), cutoff_Hz=math.inf)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRun:
    """The trajectory of a run for a simulation, and the measured force to compare with."""

    run: RigRun
    trajectory: Trajectory
    force: FloatArray  # Measured force [N] on the trajectory's samples.
    scored_from: int  # First sample that counts in an error; earlier samples are a warm-up of the model.
    period_s: float | None  # None: not periodic
    cutoff_Hz: float  # Cut-off of the smoothing; without smoothing, the Nyquist frequency of the grid.
    motion: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", read_only(self.force))

    def __len__(self) -> int:
        return len(self.force)

    @property
    def name(self) -> str:
        return self.run.name


def prepare_run(run: RigRun, preparation: Preparation | None = None) -> PreparedRun:
    """Return the prepared run, by these rules unless ``preparation`` sets other values.

    *Time.* Timestamps are replaced by a uniform grid if they deviate by at most 0.1 % of a step or by their
    rounding. Otherwise, the run is resampled to the median step: displacement by a cubic spline, the other
    channels linearly.

    *Smoothing.* Noise is the median magnitude in the upper quarter of the displacement's spectrum (at least
    its rounding error). The cut-off minimises the sum of passed noise and removed signal in velocity, and is
    at least five times the motion's mean frequency. Noise below 0.1 % of the rms velocity is not smoothed
    (``Spectrum.cut_off``). The smoothing is a least-squares quintic spline with a knot every half period of
    the cut-off, in whole samples (``signals.smooth``): zero phase, free ends; velocity and acceleration are
    its derivatives. A measured velocity is not used.

    *Dead band.* Three times the residual noise after smoothing, at least the resolution of displacement.

    *Reference.* "start": zero is the median displacement in the first half of the time before the motion
    starts, if the displacement varies by at most three dead bands there. Otherwise zero is the first sample
    if the run starts slowly, with at most a tenth of its maximum speed and acceleration. A run that begins in
    motion has its mean as zero. "mean": zero is the mean of the run. "none": as measured.

    *Score.* The motion starts when displacement differs from its first value by 2 % of its range. Samples
    later than half a period after the start are compared with a model. Without a period, half a period is the
    median time between reversals.

    *Command.* A constant command with sensor noise is replaced by its median (``RigRun.constant_command``).

    *Temperature.* Noise is removed: one value for a run with a drift below 1 K, else a smooth curve
    (``signals.condition_temperature``).

    *Sign.* A damper dissipates power. A correlation of force and velocity below -0.05 is an error.

    Raise InputError if the displacement is constant, the force has the wrong sign, or too few samples remain
    after trimming.
    """
    chosen = preparation or Preparation()
    if chosen.from_s is not None or chosen.to_s is not None:
        run = run.between(chosen.from_s, chosen.to_s)
    sampled, step = _sample_uniformly(run)
    displacement = sampled.displacement
    spectrum = signals.measure_spectrum(displacement, step)
    if float(np.std(displacement)) < 2.0 * spectrum.noise:  # There is no motion.
        found = f"displacement has only noise of {spectrum.noise:.2g} m rms and no motion"
        expected = "a motion much larger than the noise"
        raise InputError(place=run.name, found=found, expected=expected, remedy=WITHOUT_MOTION)
    spacing = signals.knot_spacing(step, chosen.cutoff_Hz or spectrum.cut_off())
    cutoff = 0.5 / (spacing * step)
    path = signals.smooth(displacement, step, cutoff)
    dead_band = chosen.dead_band_m
    if dead_band is None:
        resolution = min(signals.smallest_step(displacement), math.sqrt(12.0) * spectrum.noise)
        dead_band = max(3.0 * spectrum.noise / math.sqrt(spacing), resolution)

    x = path.displacement
    started = int(np.argmax(np.abs(x - x[0]) > 0.02 * np.ptp(x)))
    rest = displacement[: max(1, started // 2)]
    command, temperature = run.constant_command, sampled.temperature
    if temperature is not None:
        temperature = signals.condition_temperature(temperature, step, chosen.thermocouple_lag_s)
    trajectory = Trajectory(
        step=step,
        displacement=x - _reference(chosen.reference, rest, path, dead_band),
        velocity=path.velocity,
        acceleration=path.acceleration,
        command=sampled.command if command is None else np.full(len(x), command),
        dead_band=dead_band,
        temperature=temperature,
    )
    force = sampled.force - chosen.force_offset_N if chosen.force_offset_N else sampled.force
    motion = describe_motion(trajectory.displacement, step)
    scored_from = min(started + round(motion.half_period_s / step), len(x) - 1)
    _check_sign(run, force[scored_from:], trajectory.velocity[scored_from:])
    label = run.motion or motion.label
    return PreparedRun(run, trajectory, force, scored_from, motion.period_s, cutoff, label)


def _rounding(time: FloatArray, off: float) -> float:
    """Return the power of ten [s] to which times are rounded, 0 if not rounded.

    ``off`` [s] is the largest deviation of the times from a uniform grid. Smaller powers are not tried.
    """
    unit = 10.0 ** math.ceil(math.log10(off)) if off > 0.0 else 0.0
    for candidate in (unit, 10.0 * unit):
        if candidate and np.allclose(time / candidate, np.round(time / candidate), rtol=0.0, atol=1e-4):
            return candidate
    return 0.0


def _sample_uniformly(run: RigRun) -> tuple[Recording, float]:
    """Return a run on a uniform time grid, and the step [s]. A uniform time is not changed.

    Otherwise, the grid has the median step. Displacement is resampled by a cubic spline, the other channels
    linearly.
    """
    first, last, count = float(run.time[0]), float(run.time[-1]), len(run)
    step = (last - first) / (count - 1)
    off = float(np.max(np.abs(run.time - (first + step * np.arange(count)))))
    # Times are uniform if they deviate from a grid by at most 0.1 % of a step, or by their rounding.
    if off <= max(1e-3 * step, 0.6 * _rounding(run.time, off)):
        return run, step
    from scipy.interpolate import CubicSpline

    step = float(np.median(np.diff(run.time)))
    time = first + step * np.arange(int((last - first) / step * (1.0 + 1e-12)) + 1, dtype=np.float64)
    linear = {
        name: np.interp(time, run.time, values)
        for name in ("force", "command", "velocity", "temperature")
        if (values := getattr(run, name)) is not None
    }
    displacement = np.asarray(CubicSpline(run.time, run.displacement)(time), dtype=np.float64)
    return Recording(run.name, time, displacement, command_unit=run.command_unit, **linear), step


def select_plot_samples(
    prepared: PreparedRun, *, seconds: float | None = None, points: int = 240
) -> NDArray[np.intp]:
    """Return the indices of at most ``points`` samples for a plot: the second cycle, after the transient.

    If ``seconds`` is given, the samples cover this duration from the first scored sample. A motion without a
    period is plotted for three seconds.
    """
    path, start = prepared.trajectory, prepared.scored_from
    length = round((seconds or prepared.period_s or _PLOT_DURATION_s) / path.step) + 1
    if prepared.period_s and not seconds and start + 2 * length <= len(path):
        start += length
    stop = min(start + length, len(path))
    return np.unique(np.linspace(start, stop - 1, min(points, stop - start)).round().astype(np.intp))


def decimate(prepared: PreparedRun, rate_Hz: float) -> PreparedRun:
    """Return the run with every k-th sample, for the largest k with a rate of at least ``rate_Hz``.

    Displacement, velocity and acceleration are samples of the smoothed signals, so they remain consistent.
    The force is not filtered because a filter would remove parts that the model must reproduce. Aliasing does
    not change the standard deviation of the noise.
    """
    path = prepared.trajectory
    factor = int(path.rate_Hz / rate_Hz * (1.0 + 1e-9))
    if factor <= 1:
        return prepared
    return replace(
        prepared,
        trajectory=path.part(slice(None, None, factor)),
        force=prepared.force[::factor],
        scored_from=min(-(-prepared.scored_from // factor), (len(path) - 1) // factor),
    )


def _reference(rule: Reference, rest: FloatArray, path: signals.Kinematics, dead_band: float) -> float:
    """Return the zero of displacement [m]. ``rest`` is the displacement measured before the motion starts."""
    x = path.displacement
    if rule == "none":
        return 0.0
    if rule == "start":
        if np.ptp(x[: len(rest)]) <= 3.0 * dead_band:
            return float(np.median(rest))
        shares = [abs(a[0]) / np.abs(a).max() for a in (path.velocity, path.acceleration)]
        if max(shares) <= 0.1:  # The run begins nearly at rest.
            return float(x[0])
    return float(np.mean(x))


def _check_sign(run: RigRun, force: FloatArray, velocity: FloatArray) -> None:
    power = float(np.mean((force - force.mean()) * (velocity - velocity.mean())))
    spread = float(np.std(force) * np.std(velocity))
    if power < -0.05 * spread:  # The correlation is below -0.05.
        found = f"force and velocity have opposite signs (correlation {power / spread:.2f})"
        expected = "extension positive and a force that resists extension positive"
        remedy = "Put `sign = -1` at [channel.force] in the channel map, or use mrdamper fit --flip-force"
        error = OppositeSignError(place=run.name, found=found, expected=expected, remedy=remedy)
        error.correlation = power / spread
        raise error
