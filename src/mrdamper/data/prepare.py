"""Preparation: from a measured run to the trajectory that a law is driven through, and its force.

The displacement is smoothed (a law differentiates it, and 3 um steps at 1 kHz would become +-90 N through
a dashpot of 3e4 N s/m); the force is left as measured. Everything a preparation does not say is chosen
from the run itself by the rules of :func:`prepare_run`; cycles, repeatability, lag and drift of a prepared
run are in ``cycles``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data.motion import describe_motion
from mrdamper.data.records import WITHOUT_MOTION, RigRun, nearest_names
from mrdamper.data.signals import (
    Kinematics,
    differentiate,
    knot_spacing,
    measure_spectrum,
    smallest_step,
    smooth,
)
from mrdamper.data.temperature import condition_temperature
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory

__all__ = ["Preparation", "PreparedRun", "decimate", "even_step", "prepare_run"]

Reference = Literal["start", "mean", "none"]
VelocitySource = Literal["displacement", "channel"]

_MOVED = 0.02  # a motion has started when it is this share of its range from where it began
_MOVES = 2.0  # a displacement whose rms is less than so many times its noise is none
_SLOWLY = 0.1  # of top speed and acceleration: a run that begins livelier was cut out of a motion
_JITTER = 1e-3  # of a step: time stamps further from a uniform grid are resampled
_AGAINST = -0.05  # correlation of force and velocity below which the sign is wrong
_AGREE = 0.1  # a velocity channel agrees when it differs by less than this share of its rms


@dataclass(frozen=True, slots=True)
class Preparation:
    """How runs are prepared; ``None`` means chosen from each run by the rule in ``prepare_run``."""

    cutoff_Hz: float | None = None  # of the smoothing of displacement; math.inf: none
    dead_band_m: float | None = None  # reversals smaller than this are not reversals
    reference: Reference = "start"  # where displacement is zero
    velocity: VelocitySource = "displacement"  # derived from displacement, or the measured channel
    from_s: float | None = None  # time before this is cut off, as in the file
    to_s: float | None = None  # time after this is cut off
    force_offset_N: float = 0.0  # a known tare, taken off the force
    thermocouple_lag_s: float = 0.0  # of the temperature sensor, taken back where the temperature drifts

    def __post_init__(self) -> None:
        if self.cutoff_Hz is not None and not self.cutoff_Hz > 0.0:
            raise InputError(f"preparation: cutoff_Hz is {self.cutoff_Hz}; expected a positive number")
        if self.dead_band_m is not None and not 0.0 <= self.dead_band_m < math.inf:
            raise InputError(f"preparation: dead_band_m is {self.dead_band_m}; expected zero or more")
        for name, known in (
            ("reference", ("start", "mean", "none")),
            ("velocity", ("displacement", "channel")),
        ):
            if getattr(self, name) not in known:
                choices = ", ".join(known)
                raise InputError(f"preparation: {name} is {getattr(self, name)!r}; use one of: {choices}")
        if not 0.0 <= self.thermocouple_lag_s < math.inf:
            raise InputError(
                f"preparation: thermocouple_lag_s is {self.thermocouple_lag_s}; expected zero or more"
            )
        if not math.isfinite(self.force_offset_N):
            raise InputError(f"preparation: force_offset_N is {self.force_offset_N}; expected a number")

    def to_dict(self) -> dict[str, float | str | None]:
        """Return the fields as JSON takes them (no smoothing is the text "none")."""
        given = asdict(self)
        if given["cutoff_Hz"] == math.inf:
            given["cutoff_Hz"] = "none"
        return given

    @classmethod
    def from_dict(cls, given: Mapping[str, object]) -> Preparation:
        """Return the preparation that ``to_dict`` wrote; an unknown key is an error."""
        known = [field.name for field in fields(cls)]
        for key in given:
            if key not in known:
                near = ", ".join(nearest_names(key, known))
                raise InputError(f"preparation: {key!r} is not known; the nearest are: {near}")
        values = dict(given)
        if values.get("cutoff_Hz") == "none":
            values["cutoff_Hz"] = math.inf
        try:
            return cls(**values)  # type: ignore[arg-type]  # checked when built
        except TypeError as error:
            raise InputError(f"preparation: {dict(given)} does not hold numbers where they belong") from error


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRun:
    """A run as a law is driven through it, and the force that it is compared with."""

    run: RigRun
    trajectory: Trajectory
    force: FloatArray  # [N], as measured, on the trajectory's samples
    scored_from: int  # first sample that counts in an error
    period_s: float | None  # None: not periodic
    cutoff_Hz: float  # of the smoothing; the Nyquist frequency of the run when nothing was removed
    dead_band_m: float
    motion: str
    reference_m: float = 0.0  # measured displacement that counts as zero

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", read_only(self.force))
        if self.force.shape != self.trajectory.displacement.shape:
            raise InputError(
                f"{self.run.name}: force has shape {self.force.shape} and the trajectory "
                f"{self.trajectory.displacement.shape}; expected the same"
            )
        if not 0 <= self.scored_from < len(self.force):
            raise InputError(
                f"{self.run.name}: scored from sample {self.scored_from} of {len(self.force)}; "
                "expected a sample of the run"
            )

    def __len__(self) -> int:
        return len(self.force)

    @property
    def name(self) -> str:
        return self.run.name


def prepare_run(run: RigRun, preparation: Preparation | None = None) -> PreparedRun:
    """Return the run ready for a law, by these rules where ``preparation`` does not say otherwise.

    *Time.* Stamps within 0.1 % of a step of a uniform grid, or off it by no more than their own rounding,
    are taken as that grid. Others are resampled to the median step: displacement by a cubic spline, the
    rest linearly.

    *Smoothing.* Noise is the median level of the upper quarter of the displacement's spectrum (at least its
    rounding). The cut-off is where the velocity loses as much signal as it is rid of noise, and at least
    five times the motion's mean frequency; there is no smoothing when noise would be below 0.1 % of the rms
    velocity (``Spectrum.cut_off``). The smoothing is a least-squares quintic spline with a knot every half
    period of the cut-off, in whole samples (``signals.smooth``): zero phase, free ends; velocity and
    acceleration are its derivatives. A measured velocity is taken only when asked for and when it agrees
    within 10 % of its rms.

    *Dead band.* Three times the noise that the smoothing lets through, at least the resolution of the
    displacement.

    *Reference.* "start": zero is the median of the first half of the rest before the motion starts; where the
    run begins, when it does not keep still there (within three dead bands) but sets out slowly; the mean over
    the run, when it begins in full motion (beyond a tenth of the top speed or of the top acceleration).
    "mean": the mean over the run. "none": as measured.

    *Score.* The motion starts where displacement is 2 % of its range from where it began; errors count
    from half a period later. Without a period, half a period is the median time between reversals.

    *Command.* One that keeps still but for its sensor's noise is its median (``RigRun.constant_command``).

    *Temperature.* Noise is taken out: one number for a run that drifts by less than 1 K, else a smooth curve
    (``warmth.condition_temperature``).

    *Sign.* A damper takes power. When force and velocity correlate below -0.05 the run is refused.

    Raises
    ------
    InputError
        The displacement keeps still, the force has the wrong sign, trimming leaves too little, or a velocity
        channel does not agree.
    """
    chosen = preparation or Preparation()
    run = _trim(run, chosen)
    step, displacement, channels = _on_uniform_grid(run)
    spectrum = measure_spectrum(displacement, step)
    if float(np.std(displacement)) < _MOVES * spectrum.noise:
        raise InputError(
            f"{run.name}: displacement keeps still but for noise of {spectrum.noise:.2g} m rms; expected a "
            f"motion far above it. {WITHOUT_MOTION}"
        )
    spacing = knot_spacing(step, chosen.cutoff_Hz or spectrum.cut_off())
    cutoff = 0.5 / (spacing * step)
    moved = smooth(displacement, step, cutoff)
    dead_band = chosen.dead_band_m
    if dead_band is None:
        resolution = min(smallest_step(displacement), math.sqrt(12.0) * spectrum.noise)
        dead_band = max(3.0 * spectrum.noise / math.sqrt(spacing), resolution)

    x = moved.displacement
    started = int(np.argmax(np.abs(x - x[0]) > _MOVED * np.ptp(x)))
    reference = 0.0
    if chosen.reference == "start":
        reference = _where_it_rests(displacement[: max(1, started // 2)], moved, dead_band)
    elif chosen.reference == "mean":
        reference = float(np.mean(x))
    x = x - reference

    velocity, acceleration = moved.velocity, moved.acceleration
    if chosen.velocity == "channel":
        velocity = _measured_velocity(run, channels.get("velocity"), velocity)
        acceleration = differentiate(velocity, step)
    force = channels["force"] - chosen.force_offset_N if chosen.force_offset_N else channels["force"]
    found = describe_motion(x, step)
    scored_from = min(started + round(found.half_period_s / step), len(x) - 1)
    _check_sign(run, force[scored_from:], velocity[scored_from:])
    held = run.constant_command
    trajectory = Trajectory(
        step=step,
        displacement=x,
        velocity=velocity,
        acceleration=acceleration,
        command=channels["command"] if held is None else np.full(len(x), held),
        dead_band=dead_band,
        temperature=None
        if "temperature" not in channels
        else condition_temperature(channels["temperature"], step, chosen.thermocouple_lag_s),
    )
    motion = run.motion or found.label
    return PreparedRun(
        run, trajectory, force, scored_from, found.period_s, cutoff, dead_band, motion, reference
    )


def decimate(prepared: PreparedRun, rate_Hz: float) -> PreparedRun:
    """Return every k-th sample, k the largest whole number that leaves at least ``rate_Hz``.

    Displacement, velocity and acceleration are samples of the smoothed signals, so the kinematics stay
    exact. The force is sampled as it is: a filter would take from it what the law is asked to explain, and
    noise that folds back is noise of the same size on each sample.
    """
    if not rate_Hz > 0.0:
        raise InputError(f"decimate: rate is {rate_Hz} Hz; expected a positive number")
    path = prepared.trajectory
    factor = int(path.rate_Hz / rate_Hz * (1.0 + 1e-9))
    if factor <= 1:
        return prepared
    return replace(
        prepared,
        trajectory=replace(
            path,
            step=path.step * factor,
            displacement=path.displacement[::factor],
            velocity=path.velocity[::factor],
            acceleration=path.acceleration[::factor],
            command=path.command[::factor],
            temperature=None if path.temperature is None else path.temperature[::factor],
        ),
        force=prepared.force[::factor],
        scored_from=min(-(-prepared.scored_from // factor), (len(path) - 1) // factor),
    )


def _where_it_rests(rest: FloatArray, moved: Kinematics, dead_band: float) -> float:
    """Return the displacement [m] that counts as zero by the rule "start" of ``prepare_run``."""
    x = moved.displacement
    if np.ptp(x[: len(rest)]) <= 3.0 * dead_band:
        return float(np.median(rest))
    shares = [abs(a[0]) / np.abs(a).max() for a in (moved.velocity, moved.acceleration)]
    return float(x[0] if max(shares) <= _SLOWLY else np.mean(x))


def _trim(run: RigRun, chosen: Preparation) -> RigRun:
    if chosen.from_s is None and chosen.to_s is None:
        return run
    low = -math.inf if chosen.from_s is None else chosen.from_s
    high = math.inf if chosen.to_s is None else chosen.to_s
    kept = (run.time >= low) & (run.time <= high)

    def cut(array: FloatArray | None) -> FloatArray | None:
        return None if array is None else array[kept]

    return replace(
        run,
        time=run.time[kept],
        displacement=run.displacement[kept],
        force=run.force[kept],
        command=run.command[kept],
        velocity=cut(run.velocity),
        temperature=cut(run.temperature),
    )


def _on_uniform_grid(run: RigRun) -> tuple[float, FloatArray, dict[str, FloatArray]]:
    """Return step [s], displacement, and the other channels by name, on a uniform grid."""
    channels = {"force": run.force, "command": run.command}
    if run.velocity is not None:
        channels["velocity"] = run.velocity
    if run.temperature is not None:
        channels["temperature"] = run.temperature
    time = run.time
    even = even_step(time)
    if even is not None:
        return even, run.displacement, channels
    from scipy.interpolate import CubicSpline

    step = float(np.median(np.diff(time)))
    grid = time[0] + step * np.arange(int((time[-1] - time[0]) / step * (1.0 + 1e-12)) + 1)
    resampled = {name: np.interp(grid, time, values) for name, values in channels.items()}
    return step, np.asarray(CubicSpline(time, run.displacement)(grid), dtype=np.float64), resampled


def even_step(time: FloatArray) -> float | None:
    """Return the step [s] of time stamps that are taken as a uniform grid; None where they are resampled."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    off = float(np.max(np.abs(time - (time[0] + step * np.arange(len(time))))))
    return step if off <= max(_JITTER * step, 0.6 * _rounding(time, off)) else None


def _rounding(time: FloatArray, off: float) -> float:
    """Return the decimal unit [s], no smaller than ``off``, to which time stamps are rounded; 0 when none."""
    unit = 10.0 ** math.ceil(math.log10(off)) if off > 0.0 else 0.0
    for candidate in (unit, 10.0 * unit):
        if candidate and np.allclose(time / candidate, np.round(time / candidate), rtol=0.0, atol=1e-4):
            return candidate
    return 0.0


def _measured_velocity(run: RigRun, measured: FloatArray | None, derived: FloatArray) -> FloatArray:
    if measured is None:
        raise InputError(f"{run.name}: no velocity channel; expected one. Derive it from the displacement")
    differs = float(np.std(measured - derived) / np.std(derived))
    if not differs < _AGREE:
        raise InputError(
            f"{run.name}: the velocity channel differs from the displacement's rate by "
            f"{100 * differs:.3g} % of its rms; expected less than {100 * _AGREE:g} %. "
            "Check its unit, sign and delay in the channel map"
        )
    return measured


def _check_sign(run: RigRun, force: FloatArray, velocity: FloatArray) -> None:
    power = float(np.mean((force - force.mean()) * (velocity - velocity.mean())))
    spread = float(np.std(force) * np.std(velocity))
    if power < _AGAINST * spread:
        raise InputError(
            f"{run.name}: force and velocity have opposite signs (correlation {power / spread:.2f}), as if "
            "the damper gave power; expected extension positive and a force that resists extension positive. "
            "If the load cell or the sensor counts the other way, put `sign = -1` at [channel.force] in the "
            "channel map"
        )
