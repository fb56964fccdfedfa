"""Excitations: motions as values, and the trajectory that a damper is driven through.

A motion knows its displacement, velocity and acceleration in closed form; :func:`drive` samples one into
a :class:`Trajectory`. Trajectories from measured runs come from ``data.prepare``.

Sign convention: extension positive.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray, read_only

__all__ = ["Chirp", "Harmonics", "Motion", "Sine", "Trajectory", "Triangle", "drive"]


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """What a damper is driven through, on a uniform time step.

    Arrays are kept as read-only, contiguous float64, shape (n,).
    """

    step: float  # [s]
    displacement: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    acceleration: FloatArray  # [m/s^2]
    command: FloatArray  # [A or V]
    dead_band: float = 0.0  # reversals smaller than this are not reversals [m]
    temperature: FloatArray | None = None  # [K]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0.0):
            raise InputError(f"trajectory: step is {self.step} s; expected a positive, finite number")
        if not (np.isfinite(self.dead_band) and self.dead_band >= 0.0):
            raise InputError(f"trajectory: dead band is {self.dead_band} m; expected zero or more, finite")
        for name in ("displacement", "velocity", "acceleration", "command", "temperature"):
            given = getattr(self, name)
            if given is None and name == "temperature":
                continue
            array = read_only(given)
            object.__setattr__(self, name, array)
            if array.ndim != 1 or len(array) != len(self.displacement) or len(array) < 2:
                raise InputError(
                    f"trajectory: {name} has shape {array.shape} and displacement "
                    f"{self.displacement.shape}; expected one and the same length, at least 2"
                )
            if not np.isfinite(array).all():
                sample = int(np.flatnonzero(~np.isfinite(array))[0])
                raise InputError(f"trajectory: {name} is {array[sample]} at sample {sample}; expected finite")

    def __len__(self) -> int:
        return len(self.displacement)

    @property
    def time(self) -> FloatArray:
        """Time of each sample from the first [s], shape (n,)."""
        return self.step * np.arange(len(self), dtype=np.float64)

    @property
    def rate_Hz(self) -> float:
        """Samples per second."""
        return 1.0 / self.step


class Motion(Protocol):
    """A motion in closed form; ``t`` is time [s], of any shape."""

    def displacement(self, t: ArrayLike) -> FloatArray: ...  # [m]
    def velocity(self, t: ArrayLike) -> FloatArray: ...  # [m/s]
    def acceleration(self, t: ArrayLike) -> FloatArray: ...  # [m/s^2]


def _require_positive(motion: object) -> None:
    """Refuse a motion with a number that is not positive and finite."""
    for field in fields(motion):  # type: ignore[arg-type]  # every motion is a dataclass
        value = getattr(motion, field.name)
        if not (np.isfinite(value) and value > 0.0):
            kind = type(motion).__name__.lower()
            raise InputError(f"{kind}: {field.name} is {value}; expected a positive, finite number")


@dataclass(frozen=True, slots=True)
class Sine:
    """x = A sin(2 pi f t)."""

    amplitude: float  # A [m]
    frequency: float  # f [Hz]

    def __post_init__(self) -> None:
        _require_positive(self)

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.amplitude * np.sin(2 * np.pi * self.frequency * np.asarray(t, dtype=np.float64))

    def velocity(self, t: ArrayLike) -> FloatArray:
        omega = 2 * np.pi * self.frequency
        return self.amplitude * omega * np.cos(omega * np.asarray(t, dtype=np.float64))

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return -((2 * np.pi * self.frequency) ** 2) * self.displacement(t)


@dataclass(frozen=True, slots=True)
class Chirp:
    """x = A sin(phi), its frequency going linearly: phi = 2 pi (f0 t + (f1 - f0) t^2 / 2T)."""

    amplitude: float  # A [m]
    start: float  # f0 [Hz]
    stop: float  # f1, reached at t = T [Hz]
    duration: float  # T [s]

    def __post_init__(self) -> None:
        _require_positive(self)

    def _phase(self, t: ArrayLike) -> tuple[FloatArray, FloatArray, float]:
        """Return the phase [rad], its rate [rad/s] and the rate of that [rad/s^2]."""
        time = np.asarray(t, dtype=np.float64)
        sweep = 2 * np.pi * (self.stop - self.start) / self.duration
        rate = 2 * np.pi * self.start + sweep * time
        return (2 * np.pi * self.start + 0.5 * sweep * time) * time, rate, sweep

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.amplitude * np.sin(self._phase(t)[0])

    def velocity(self, t: ArrayLike) -> FloatArray:
        phase, rate, _ = self._phase(t)
        return self.amplitude * rate * np.cos(phase)

    def acceleration(self, t: ArrayLike) -> FloatArray:
        phase, rate, sweep = self._phase(t)
        return self.amplitude * (sweep * np.cos(phase) - rate**2 * np.sin(phase))


@dataclass(frozen=True, slots=True)
class Harmonics:
    """x = sum of A_k sin(2 pi f_k t + phi_k): several tones, or a random motion with given phases."""

    amplitudes: tuple[float, ...]  # A_k [m]
    frequencies: tuple[float, ...]  # f_k [Hz]
    phases: tuple[float, ...]  # phi_k [rad]

    def __post_init__(self) -> None:
        counts = {field.name: len(getattr(self, field.name)) for field in fields(self)}
        if len(set(counts.values())) != 1 or not self.amplitudes:
            raise InputError(f"harmonics: {counts} numbers; expected the same count of each, at least one")
        if not np.isfinite([self.amplitudes, self.frequencies, self.phases]).all():
            raise InputError("harmonics: a number is not finite; expected amplitudes, frequencies, phases")

    def _sum(self, t: ArrayLike, order: int) -> FloatArray:
        time = np.asarray(t, dtype=np.float64)
        total = np.zeros_like(time)
        for amplitude, frequency, phase in zip(self.amplitudes, self.frequencies, self.phases, strict=True):
            omega = 2 * np.pi * frequency
            total += amplitude * omega**order * np.sin(omega * time + phase + order * np.pi / 2)
        return total

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self._sum(t, 0)

    def velocity(self, t: ArrayLike) -> FloatArray:
        return self._sum(t, 1)

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return self._sum(t, 2)


@dataclass(frozen=True, slots=True)
class Triangle:
    """Constant speed to and fro between +A and -A, starting at zero in extension; one period is 4 A / speed.

    Acceleration is zero (the impulses at the turning points are not sampled); at a turning point itself
    velocity is that of the stroke that begins there.
    """

    amplitude: float  # A [m]
    speed: float  # [m/s]

    def __post_init__(self) -> None:
        _require_positive(self)

    def _quarter(self, t: ArrayLike) -> FloatArray:
        """Return the time in quarter periods since the last turning point at -A, 0 to 4."""
        return np.mod(np.asarray(t, dtype=np.float64) * (self.speed / self.amplitude) + 1.0, 4.0)

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.amplitude * (1.0 - np.abs(self._quarter(t) - 2.0))

    def velocity(self, t: ArrayLike) -> FloatArray:
        return self.speed * np.where(self._quarter(t) < 2.0, 1.0, -1.0)

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return np.zeros_like(np.asarray(t, dtype=np.float64))


def drive(
    motion: Motion,
    *,
    duration: float,
    rate_Hz: float,
    command: ArrayLike,
    temperature: ArrayLike | None = None,
) -> Trajectory:
    """Return the motion sampled from t = 0 to ``duration``, both ends included.

    Parameters
    ----------
    motion : the motion
    duration : length of the trajectory [s]
    rate_Hz : samples per second
    command : current [A] or voltage [V], a number or one per sample
    temperature : temperature [K], a number or one per sample; None: not known
    """
    for name, value in (("duration", duration), ("rate_Hz", rate_Hz)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"drive: {name} is {value}; expected a positive, finite number")
    time = np.arange(round(duration * rate_Hz) + 1) / rate_Hz

    def per_sample(value: ArrayLike, name: str) -> FloatArray:
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in {(), time.shape}:
            raise InputError(f"drive: {name} has shape {array.shape}; expected one number or {len(time)}")
        return np.broadcast_to(array, time.shape)

    return Trajectory(
        step=1.0 / rate_Hz,
        displacement=motion.displacement(time),
        velocity=motion.velocity(time),
        acceleration=motion.acceleration(time),
        command=per_sample(command, "command"),
        temperature=None if temperature is None else per_sample(temperature, "temperature"),
    )
