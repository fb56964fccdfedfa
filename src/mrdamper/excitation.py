"""Excitations: motions and commands as values, and trajectories of a damper.

A motion has its displacement, velocity and acceleration in closed form. The function :func:`drive` samples a
motion into a :class:`Trajectory`. The module ``data.prepare`` builds trajectories from measured runs. Named
motions are in ``MOTIONS``. The function :func:`motion_from_text` reads a name or a form such as
``sine:5mm:1Hz``.

Sign convention: extension positive.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import InputError
from mrdamper.quantities import to_si
from mrdamper.schema import Option, Positive, check_ranges

ROAD_ROUGHNESS: Mapping[str, float] = MappingProxyType(
    {letter: 16e-6 * 4.0**k for k, letter in enumerate("ABCDEFGH")}
)
"""Roughness Gd(n0) of the ISO 8608 classes at n0 = 0.1 cycles/m [m^3], the geometric mean of each class."""

_REFERENCE_WAVENUMBER = 0.1  # n0 of ISO 8608 [cycles/m]
_FINEST_WAVENUMBER = 2.83  # largest wavenumber in ISO 8608 [cycles/m]
_TONE_COUNT = 480


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Motion, command and temperature of a damper, sampled with a uniform time step.

    Arrays are stored as read-only, contiguous float64, shape (n,).
    """

    step: float  # [s]
    displacement: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    acceleration: FloatArray  # [m/s^2]
    command: FloatArray  # [A or V]
    dead_band: float = 0.0  # max reversal of the motion that a model ignores as noise [m]
    temperature: FloatArray | None = None  # [K]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0.0):
            raise InputError(
                place="trajectory", found=f"step is {self.step} s", expected="a positive, finite number"
            )
        if not (np.isfinite(self.dead_band) and self.dead_band >= 0.0):
            raise InputError(
                place="trajectory", found=f"dead band is {self.dead_band} m", expected="zero or more, finite"
            )
        for name in ("displacement", "velocity", "acceleration", "command", "temperature"):
            given = getattr(self, name)
            if given is None and name == "temperature":
                continue
            array = read_only(given)
            object.__setattr__(self, name, array)
            if array.ndim != 1 or len(array) != len(self.displacement) or len(array) < 2:
                raise InputError(
                    place="trajectory",
                    found=f"{name} has shape {array.shape} and displacement {self.displacement.shape}",
                    expected="one and the same length, at least 2",
                )
            if not np.isfinite(array).all():
                sample = int(np.flatnonzero(~np.isfinite(array))[0])
                raise InputError(
                    place="trajectory",
                    found=f"{name} is {array[sample]} at sample {sample}",
                    expected="finite",
                )

    def __len__(self) -> int:
        return len(self.displacement)

    def part(self, samples: slice) -> Trajectory:
        """Return the trajectory of some samples. The slice ``::2`` doubles the time step."""
        return replace(
            self,
            step=self.step * (samples.step or 1),
            displacement=self.displacement[samples],
            velocity=self.velocity[samples],
            acceleration=self.acceleration[samples],
            command=self.command[samples],
            temperature=None if self.temperature is None else self.temperature[samples],
        )

    @property
    def time(self) -> FloatArray:
        """Time of each sample since the first sample [s], shape (n,)."""
        return self.step * np.arange(len(self), dtype=np.float64)

    @property
    def rate_Hz(self) -> float:
        """Samples per second."""
        return 1.0 / self.step


class Motion(Protocol):
    """A motion in closed form, as a hashable value; ``t`` is the time [s], of any shape."""

    def __hash__(self) -> int: ...
    def displacement(self, t: ArrayLike) -> FloatArray: ...  # [m]
    def velocity(self, t: ArrayLike) -> FloatArray: ...  # [m/s]
    def acceleration(self, t: ArrayLike) -> FloatArray: ...  # [m/s^2]


@dataclass(frozen=True, slots=True)
class Sine:
    """x = A sin(2 pi f t)."""

    amplitude: Positive  # A [m]
    frequency: Positive  # f [Hz]

    def __post_init__(self) -> None:
        check_ranges(self, "sine")

    @property
    def period(self) -> float:
        """Time after which the motion repeats [s]."""
        return 1.0 / self.frequency

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.amplitude * np.sin(2 * np.pi * self.frequency * np.asarray(t, dtype=np.float64))

    def velocity(self, t: ArrayLike) -> FloatArray:
        omega = 2 * np.pi * self.frequency
        return self.amplitude * omega * np.cos(omega * np.asarray(t, dtype=np.float64))

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return -((2 * np.pi * self.frequency) ** 2) * self.displacement(t)


@dataclass(frozen=True, slots=True)
class Chirp:
    """x = A sin(phi) with linearly changing frequency: phi = 2 pi (f0 t + (f1 - f0) t^2 / 2T)."""

    amplitude: Positive  # A [m]
    start: Positive  # f0 [Hz]
    stop: Positive  # f1, reached at t = T [Hz]
    duration: Positive  # T [s]

    def __post_init__(self) -> None:
        check_ranges(self, "chirp")

    def _phase(self, t: ArrayLike) -> tuple[FloatArray, FloatArray, float]:
        """Return the phase [rad] and its first [rad/s] and second time derivative [rad/s^2]."""
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
            raise InputError(
                place="harmonics", found=f"{counts} numbers", expected="the same count of each, at least one"
            )
        if not np.isfinite([self.amplitudes, self.frequencies, self.phases]).all():
            raise InputError(
                place="harmonics", found="a number is not finite", expected="amplitudes, frequencies, phases"
            )

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
    """Constant speed between +A and -A, starting at zero in extension; the period is 4 A / speed.

    The acceleration is zero, because the infinite acceleration at the turning points is ignored. The velocity
    at a turning point is the velocity after this point.
    """

    amplitude: Positive  # A [m]
    speed: Positive  # [m/s]

    def __post_init__(self) -> None:
        check_ranges(self, "triangle")

    @property
    def period(self) -> float:
        """Time after which the motion repeats [s]."""
        return 4.0 * self.amplitude / self.speed

    def _quarter(self, t: ArrayLike) -> FloatArray:
        """Return the time since the last turning point at -A, in quarter periods (0 to 4)."""
        return np.mod(np.asarray(t, dtype=np.float64) * (self.speed / self.amplitude) + 1.0, 4.0)

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.amplitude * (1.0 - np.abs(self._quarter(t) - 2.0))

    def velocity(self, t: ArrayLike) -> FloatArray:
        return self.speed * np.where(self._quarter(t) < 2.0, 1.0, -1.0)

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return np.zeros_like(np.asarray(t, dtype=np.float64))


class _Tones:
    """Base class of motions that are sums of tones."""

    __slots__ = ()
    tones: Harmonics

    def displacement(self, t: ArrayLike) -> FloatArray:
        return self.tones.displacement(t)

    def velocity(self, t: ArrayLike) -> FloatArray:
        return self.tones.velocity(t)

    def acceleration(self, t: ArrayLike) -> FloatArray:
        return self.tones.acceleration(t)


@dataclass(frozen=True, slots=True)
class Road(_Tones):
    """The height of an ISO 8608 road under a vehicle at constant speed, as a sum of random sinusoids.

    The spectrum Gd(n) = Gd(n0) n0^2 / (n^2 + corner^2) equals the standard's Gd(n0) (n / n0)^-2 well above
    the corner wavenumber and is flat below the corner. The 480 tones are evenly spaced on a logarithmic axis
    from a tenth of the corner to 2.83 cycles/m, each with the power of its band. They have no common period.
    The same seed gives the same road at any speed.
    """

    road_class: Annotated[str, Option(among=lambda: ROAD_ROUGHNESS)] = "C"  # A (smooth) to H
    speed: Annotated[float, Option(unit="m/s", above=0.0)] = 20.0
    seed: Annotated[int, Option(least=0)] = 5
    corner: Annotated[float, Option(unit="cycles/m", above=0.0, below=_FINEST_WAVENUMBER)] = 0.01
    tones: Harmonics = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_ranges(self, "road")
        edges = np.geomspace(0.1 * self.corner, _FINEST_WAVENUMBER, _TONE_COUNT + 1)
        power = np.diff(np.arctan(edges / self.corner)) / self.corner  # integrals of 1 / (n^2 + corner^2)
        amplitudes = np.sqrt(2.0 * ROAD_ROUGHNESS[self.road_class] * _REFERENCE_WAVENUMBER**2 * power)
        phases = np.random.default_rng(self.seed).uniform(0.0, 2 * np.pi, _TONE_COUNT)
        tones = (amplitudes, self.speed * np.sqrt(edges[1:] * edges[:-1]), phases)
        object.__setattr__(self, "tones", Harmonics(*(tuple(map(float, values)) for values in tones)))


@dataclass(frozen=True, slots=True)
class RandomMotion(_Tones):
    """A random motion: 32 tones of equal velocity amplitude with random phases.

    The frequencies are evenly spaced on a logarithmic axis. ``amplitude`` is three standard deviations of the
    displacement, so that the displacement seldom exceeds it. The same seed gives the same motion.
    """

    amplitude: float  # [m]
    start: float  # lowest frequency [Hz]
    stop: float  # highest frequency [Hz]
    seed: int = 1
    tones: Harmonics = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        low, high = self.start, self.stop
        if not (self.amplitude > 0.0 and 0.0 < low < high and np.isfinite([self.amplitude, high]).all()):
            raise InputError(
                place="random motion",
                found=f"{self.amplitude} m, {low} to {high} Hz",
                expected="an amplitude and two rising frequencies, all positive",
            )
        frequencies = np.geomspace(low, high, 32)
        amplitudes = 1.0 / frequencies
        amplitudes *= self.amplitude / 3.0 / np.sqrt(0.5 * np.sum(amplitudes**2))
        phases = np.random.default_rng(self.seed).uniform(0.0, 2 * np.pi, len(frequencies))
        tones = (tuple(map(float, values)) for values in (amplitudes, frequencies, phases))
        object.__setattr__(self, "tones", Harmonics(*tones))


@dataclass(frozen=True, slots=True)
class RandomCurrent:
    """A piecewise constant current with random values and durations.

    The current is uniformly distributed between zero and ``highest``. A twelfth of the values is zero and a
    twelfth is ``highest``. Durations are log-uniform. Only runs with changing current show whether a
    hysteresis model is correct while the current changes.
    """

    highest: Annotated[float, Option(key="highest_A", unit="A", above=0.0)] = 2.0
    shortest: Annotated[float, Option(key="shortest_s", unit="s", above=0.0)] = 0.02
    """Shortest holding time."""
    longest: Annotated[float, Option(key="longest_s", unit="s", above=0.0)] = 0.3
    """Longest holding time."""
    seed: Annotated[int, Option(least=0)] = 1

    def __post_init__(self) -> None:
        check_ranges(self, "random current")
        if self.longest < self.shortest:
            raise InputError(
                place="random current",
                found=f"longest is {self.longest} s, shortest {self.shortest} s",
                expected="at least the shortest",
            )

    def current(self, t: ArrayLike) -> FloatArray:
        """Return the commanded current [A]; before t = 0 the first level."""
        time = np.asarray(t, dtype=np.float64)
        most = int(max(float(time.max(initial=0.0)), 0.0) / self.shortest) + 2
        level, hold = np.random.default_rng(self.seed).uniform(size=(most, 2)).T
        levels = self.highest * np.clip(1.2 * level - 0.1, 0.0, 1.0)
        ends = np.cumsum(self.shortest * (self.longest / self.shortest) ** hold)
        # 1e-9: a rounded sample time can be slightly before the time of a switch.
        current: FloatArray = levels[np.searchsorted(ends, time + 1e-9, side="right")]
        return current


@dataclass(frozen=True, slots=True)
class CurrentSteps:
    """A current that has each of the values ``levels`` for the time ``hold``.

    Before this sequence, the current is the first level; after this sequence, the last level.
    """

    levels: Annotated[tuple[float, ...], Option(key="levels_A", least_items=1)]
    hold: Annotated[float, Option(key="hold_s", unit="s", above=0.0)]
    """Holding time of each level."""

    def __post_init__(self) -> None:
        check_ranges(self, "current steps")
        if not self.levels:
            raise InputError(place="current steps", found="there are no levels", expected="at least one")

    @property
    def duration(self) -> float:
        """Total time of all levels [s]."""
        return self.hold * len(self.levels)

    @property
    def switches(self) -> FloatArray:
        """Times of the changes from one level to the next [s], shape (levels - 1,)."""
        return self.hold * np.arange(1.0, len(self.levels))

    def current(self, t: ArrayLike) -> FloatArray:
        """Return the current [A]; at the time of a switch, the current after the switch."""
        # 1e-9: a rounded sample time can be slightly before the time of a switch.
        position = np.asarray(t, dtype=np.float64) / self.hold + 1e-9
        level = np.clip(np.floor(position), 0, len(self.levels) - 1).astype(np.intp)
        return np.asarray(self.levels, dtype=np.float64)[level]


MOTIONS: Mapping[str, Motion] = MappingProxyType(
    {
        "sine5mm1Hz": Sine(5e-3, 1.0),
        "sine3mm2Hz": Sine(3e-3, 2.0),
        "sine15mm1Hz": Sine(15e-3, 1.0),
        "chirp3mm": Chirp(3e-3, 0.5, 8.0, 8.0),
        "nonperiodic": Harmonics(
            (1.1e-3, 1.3e-3, 0.9e-3, 0.6e-3, 0.35e-3),
            (0.43, 0.91, 1.37, 2.11, 2.83),
            (0.3, 1.9, 4.1, 2.7, 5.2),
        ),
        "nonperiodic5x": Harmonics(
            (5.5e-3, 6.5e-3, 4.5e-3, 3.0e-3, 1.75e-3),
            (0.43, 0.91, 1.37, 2.11, 2.83),
            (0.3, 1.9, 4.1, 2.7, 5.2),
        ),
        "steps": Triangle(12e-3, 30e-3),
    }
)
"""Name -> motion. The motion ``steps`` is used with ``CURRENT_STEPS``."""

CURRENT_STEPS = CurrentSteps((0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0), hold=0.8)
"""Current steps 0-1-2-1-0 A, twice. With the motion ``steps``, each step is at mid-stroke, at 30 mm/s."""

RANDOM_CURRENT = RandomCurrent()
"""Random currents from 0 to 2 A, each held for 20 to 300 ms."""

_FORMS: Mapping[str, str] = MappingProxyType(
    {
        "sine": "sine:5mm:1Hz",
        "triangle": "triangle:12mm:30mm/s",
        "chirp": "chirp:3mm:0.5-8Hz:8s",
        "road": "road:C:20m/s:5",
        "random": "random:6mm:0.5-4Hz:1",
    }
)


def motion_from_text(text: str) -> Motion:
    """Return the motion that a text names (``MOTIONS``) or describes in one of these forms.

    ``sine:AMPLITUDE:FREQUENCY``, ``triangle:AMPLITUDE:SPEED``, ``chirp:AMPLITUDE:FROM-TO:DURATION``,
    ``road:CLASS:SPEED:SEED`` or ``random:AMPLITUDE:FROM-TO:SEED``, each number with its unit, such as
    ``chirp:3mm:0.5-8Hz:8s``.

    Raises
    ------
    InputError
        If the text is neither a name nor a form, or a number in it is invalid.
    """
    if text in MOTIONS:
        return MOTIONS[text]
    kind, *parts = text.split(":")
    if kind not in _FORMS or len(parts) != _FORMS[kind].count(":"):
        near = difflib.get_close_matches(text, [*MOTIONS, *_FORMS.values()], n=3, cutoff=0.4)
        raise InputError(
            f"motion {text!r} is not known",
            expected=f"a name ({', '.join(MOTIONS)}) or a form ({', '.join(_FORMS.values())})",
            remedy=f"the nearest are: {', '.join(near)}" if near else "",
        )
    try:
        if kind in {"road", "random"} and not parts[2].isdecimal():
            raise InputError(found=f"seed is {parts[2]!r}", expected="a whole number")
        if kind == "road":
            return Road(parts[0], measure(parts[1], "velocity"), int(parts[2]))
        amplitude = measure(parts[0], "displacement")
        if kind == "sine":
            return Sine(amplitude, _hertz(parts[1]))
        if kind == "triangle":
            return Triangle(amplitude, measure(parts[1], "velocity"))
        start, _, stop = parts[1].partition("-")
        low, high = _hertz(f"{start.removesuffix('Hz')}Hz"), _hertz(stop)
        if kind == "random":
            return RandomMotion(amplitude, low, high, int(parts[2]))
        return Chirp(amplitude, low, high, measure(parts[2], "time"))
    except InputError as error:
        raise InputError(
            place=f"motion {text!r}", found=f"{error}", expected=f"such as {_FORMS[kind]}"
        ) from error


def measure(text: str, role: str) -> float:
    """Return the value of a text such as 5mm, converted to the SI unit of a role."""
    number, unit = _number_and_unit(text)
    if not unit:
        raise InputError(found=f"{role} is {text!r}", expected="a number and its unit")
    return float(to_si(number, unit, role))


def _hertz(text: str) -> float:
    number, unit = _number_and_unit(text)
    if unit != "Hz":
        raise InputError(found=f"frequency is {text!r}", expected="a number in Hz")
    return number


def _number_and_unit(text: str) -> tuple[float, str]:
    """Return number and unit of a text such as 5mm; NaN and "" if the text has a different form."""
    found = re.fullmatch(r"\s*([0-9]+\.?[0-9]*(?:e[-+]?[0-9]+)?|\.[0-9]+)\s*([A-Za-z].*?)\s*", text)
    return (float(found[1]), found[2]) if found else (float("nan"), "")


def drive(
    motion: Motion,
    *,
    duration: float,
    rate_Hz: float,
    command: ArrayLike,
    temperature: ArrayLike | None = None,
) -> Trajectory:
    """Return the trajectory of a motion, sampled from t = 0 to ``duration`` inclusive.

    Parameters
    ----------
    motion : the motion
    duration : length of the trajectory [s]
    rate_Hz : samples per second
    command : current [A] or voltage [V], a number or one per sample
    temperature : temperature [K], a number or one per sample; None if unknown
    """
    for name, value in (("duration", duration), ("rate_Hz", rate_Hz)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(place="drive", found=f"{name} is {value}", expected="a positive, finite number")
    time = np.arange(round(duration * rate_Hz) + 1) / rate_Hz

    def per_sample(value: ArrayLike, name: str) -> FloatArray:
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in {(), time.shape}:
            raise InputError(
                place="drive", found=f"{name} has shape {array.shape}", expected=f"one number or {len(time)}"
            )
        return np.broadcast_to(array, time.shape)

    return Trajectory(
        step=1.0 / rate_Hz,
        displacement=motion.displacement(time),
        velocity=motion.velocity(time),
        acceleration=motion.acceleration(time),
        command=per_sample(command, "command"),
        temperature=None if temperature is None else per_sample(temperature, "temperature"),
    )
