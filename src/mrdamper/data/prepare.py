"""Preparation: from a measured run to the trajectory that a law is driven through, and its force.

The displacement is smoothed (a law differentiates it, and 3 um steps at 1 kHz would become +-90 N through
a dashpot of 3e4 N s/m); the force is left as measured. Everything a preparation does not say is chosen
from the run itself by the rules of :func:`prepare_run`; ``conditioning`` applies them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data.conditioning import Rules, condition_run, sample_uniformly
from mrdamper.data.motion import describe_motion
from mrdamper.data.records import WITHOUT_MOTION, RigRun
from mrdamper.data.signals import Kinematics, knot_spacing, measure_spectrum, smallest_step, smooth
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.schema import read_record

_WITHOUT_PERIOD_s = 3.0  # of a motion without a period that is drawn
Reference = Literal["start", "mean", "none"]
VelocitySource = Literal["displacement", "channel"]

_MOVED = 0.02  # a motion has started when it is this share of its range from where it began
_MOVES = 2.0  # a displacement whose rms is less than so many times its noise is none
_SLOWLY = 0.1  # of top speed and acceleration: a run that begins livelier was cut out of a motion
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
            raise InputError(found=f"cutoff_Hz is {self.cutoff_Hz}", expected="a positive number")
        if self.dead_band_m is not None and not 0.0 <= self.dead_band_m < math.inf:
            raise InputError(found=f"dead_band_m is {self.dead_band_m}", expected="zero or more")
        for name, known in (
            ("reference", ("start", "mean", "none")),
            ("velocity", ("displacement", "channel")),
        ):
            if getattr(self, name) not in known:
                choices = ", ".join(known)
                raise InputError(found=f"{name} is {getattr(self, name)!r}", expected=f"one of: {choices}")
        if not 0.0 <= self.thermocouple_lag_s < math.inf:
            raise InputError(
                found=f"thermocouple_lag_s is {self.thermocouple_lag_s}", expected="zero or more"
            )
        if not math.isfinite(self.force_offset_N):
            raise InputError(found=f"force_offset_N is {self.force_offset_N}", expected="a number")

    def to_dict(self) -> dict[str, float | str | None]:
        """Return the fields as JSON takes them (no smoothing is the text "none")."""
        given = asdict(self)
        if given["cutoff_Hz"] == math.inf:
            given["cutoff_Hz"] = "none"
        return given

    @classmethod
    def from_dict(cls, given: Mapping[str, object]) -> Preparation:
        """Return the preparation that ``to_dict`` wrote; an unknown key is an error."""
        if given.get("cutoff_Hz") != "none":
            return read_record(cls, given, "preparation")
        smoothed = {key: value for key, value in given.items() if key != "cutoff_Hz"}
        return replace(read_record(cls, smoothed, "preparation"), cutoff_Hz=math.inf)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRun:
    """A run as a law is driven through it, and the force that it is compared with."""

    run: RigRun
    trajectory: Trajectory
    force: FloatArray  # [N], as measured, on the trajectory's samples
    scored_from: int  # first sample that counts in an error
    period_s: float | None  # None: not periodic
    rules: Rules  # by which it was prepared
    motion: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", read_only(self.force))
        if self.force.shape != self.trajectory.displacement.shape:
            raise InputError(
                place=self.run.name,
                found=(
                    f"force has shape {self.force.shape} and the trajectory "
                    f"{self.trajectory.displacement.shape}"
                ),
                expected="the same",
            )
        if not 0 <= self.scored_from < len(self.force):
            raise InputError(
                place=self.run.name,
                found=f"scored from sample {self.scored_from} of {len(self.force)}",
                expected="a sample of the run",
            )

    def __len__(self) -> int:
        return len(self.force)

    @property
    def name(self) -> str:
        return self.run.name

    @property
    def cutoff_Hz(self) -> float:
        """Cut-off of the smoothing; the Nyquist frequency of the run when nothing was removed."""
        return self.rules.cutoff_Hz

    @property
    def dead_band_m(self) -> float:
        return self.rules.dead_band_m

    @property
    def reference_m(self) -> float:
        """Measured displacement that counts as zero."""
        return self.rules.reference_m


def prepare_run(run: RigRun, preparation: Preparation | None = None) -> PreparedRun:
    """Return the run ready for a law, by these rules where ``preparation`` does not say otherwise.

    *Time.* Timestamps within 0.1 % of a step of a uniform grid, or off it by no more than their own rounding,
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
    A rest of one sample counts as still: zero is then where the run begins.
    "mean": the mean over the run. "none": as measured.

    *Score.* The motion starts where displacement is 2 % of its range from where it began; errors count
    from half a period later. Without a period, half a period is the median time between reversals.

    *Command.* One that keeps still but for its sensor's noise is its median (``RigRun.constant_command``).

    *Temperature.* Noise is taken out: one number for a run that drifts by less than 1 K, else a smooth curve
    (``conditioning.condition_temperature``).

    *Sign.* A damper takes power. When force and velocity correlate below -0.05 the run is refused.

    Raises
    ------
    InputError
        The displacement keeps still, the force has the wrong sign, trimming leaves too little, or a velocity
        channel does not agree.
    """
    chosen = preparation or Preparation()
    if chosen.from_s is not None or chosen.to_s is not None:
        run = run.between(chosen.from_s, chosen.to_s)
    sampled = sample_uniformly(run)
    displacement, step = sampled.displacement, sampled.step_s
    spectrum = measure_spectrum(displacement, step)
    if float(np.std(displacement)) < _MOVES * spectrum.noise:
        raise InputError(
            place=run.name,
            found=f"displacement keeps still but for noise of {spectrum.noise:.2g} m rms",
            expected="a motion far above it",
            remedy=WITHOUT_MOTION,
        )
    spacing = knot_spacing(step, chosen.cutoff_Hz or spectrum.cut_off())
    cutoff = 0.5 / (spacing * step)
    path = smooth(displacement, step, cutoff)
    dead_band = chosen.dead_band_m
    if dead_band is None:
        resolution = min(smallest_step(displacement), math.sqrt(12.0) * spectrum.noise)
        dead_band = max(3.0 * spectrum.noise / math.sqrt(spacing), resolution)

    x = path.displacement
    started = int(np.argmax(np.abs(x - x[0]) > _MOVED * np.ptp(x)))
    rest = displacement[: max(1, started // 2)]
    if chosen.velocity == "channel":
        _check_velocity(run, sampled.velocity, path.velocity)
    rules = Rules(
        step_s=step,
        cutoff_Hz=cutoff,
        dead_band_m=dead_band,
        reference_m=_reference(chosen.reference, rest, path, dead_band),
        command=run.constant_command,
        measured_velocity=chosen.velocity == "channel",
        thermocouple_lag_s=chosen.thermocouple_lag_s,
    )
    trajectory = condition_run(sampled, path, rules)
    force = sampled.force - chosen.force_offset_N if chosen.force_offset_N else sampled.force
    found = describe_motion(trajectory.displacement, step)
    scored_from = min(started + round(found.half_period_s / step), len(x) - 1)
    _check_sign(run, force[scored_from:], trajectory.velocity[scored_from:])
    motion = run.motion or found.label
    return PreparedRun(run, trajectory, force, scored_from, found.period_s, rules, motion)


def shown_samples(
    prepared: PreparedRun, *, seconds: float | None = None, points: int = 240
) -> NDArray[np.intp]:
    """Return the samples that are drawn of a run: its second cycle (its start has died away), thinned.

    ``seconds`` from the start on in place of a cycle; a motion without a period shows three of them.
    """
    path, start = prepared.trajectory, prepared.scored_from
    length = round((seconds or prepared.period_s or _WITHOUT_PERIOD_s) / path.step) + 1
    if prepared.period_s and not seconds and start + 2 * length <= len(path):
        start += length
    stop = min(start + length, len(path))
    return np.unique(np.linspace(start, stop - 1, min(points, stop - start)).round().astype(np.intp))


def decimate(prepared: PreparedRun, rate_Hz: float) -> PreparedRun:
    """Return every k-th sample, k the largest whole number that leaves at least ``rate_Hz``.

    Displacement, velocity and acceleration are samples of the smoothed signals, so the kinematics stay
    exact. The force is sampled as it is: a filter would take from it what the law is asked to explain, and
    noise that folds back is noise of the same size on each sample.
    """
    if not rate_Hz > 0.0:
        raise InputError(place="decimate", found=f"rate is {rate_Hz} Hz", expected="a positive number")
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


def shortened(prepared: PreparedRun, samples: int) -> PreparedRun:
    """Return the first so many samples of a run."""
    if samples >= len(prepared):
        return prepared
    path = prepared.trajectory
    return replace(
        prepared,
        trajectory=replace(
            path,
            displacement=path.displacement[:samples],
            velocity=path.velocity[:samples],
            acceleration=path.acceleration[:samples],
            command=path.command[:samples],
            temperature=None if path.temperature is None else path.temperature[:samples],
        ),
        force=prepared.force[:samples],
    )


def _reference(rule: Reference, rest: FloatArray, path: Kinematics, dead_band: float) -> float:
    """Return the displacement [m] that counts as zero by a rule of ``prepare_run``.

    ``rest`` is the displacement as measured over the first half of the rest before the motion starts.
    """
    x = path.displacement
    if rule == "none":
        return 0.0
    if rule == "start":
        if np.ptp(x[: len(rest)]) <= 3.0 * dead_band:
            return float(np.median(rest))
        shares = [abs(a[0]) / np.abs(a).max() for a in (path.velocity, path.acceleration)]
        if max(shares) <= _SLOWLY:
            return float(x[0])
    return float(np.mean(x))


def _check_velocity(run: RigRun, measured: FloatArray | None, derived: FloatArray) -> None:
    if measured is None:
        raise InputError(
            place=run.name,
            found="no velocity channel",
            expected="one",
            remedy="Derive it from the displacement",
        )
    differs = float(np.std(measured - derived) / np.std(derived))
    if not differs < _AGREE:
        raise InputError(
            place=run.name,
            found=(
                f"the velocity channel differs from the displacement's rate by {100 * differs:.3g} % of its "
                "rms"
            ),
            expected=f"less than {100 * _AGREE:g} %",
            remedy="Check its unit, sign and delay in the channel map",
        )


def _check_sign(run: RigRun, force: FloatArray, velocity: FloatArray) -> None:
    power = float(np.mean((force - force.mean()) * (velocity - velocity.mean())))
    spread = float(np.std(force) * np.std(velocity))
    if power < _AGAINST * spread:
        raise InputError(
            place=run.name,
            found=(
                f"force and velocity have opposite signs (correlation {power / spread:.2f}), as if the "
                "damper gave power"
            ),
            expected="extension positive and a force that resists extension positive",
            remedy=(
                "If the load cell or the sensor counts the other way, put `sign = -1` at [channel.force] in "
                "the channel map"
            ),
        )
