"""Scenarios of force tracking as data: target, motion, temperature, sensors, disturbances, seed.

A scenario says what is asked and what is in the way; the damper and the controller are the loop's. Written
by hand they are TOML. The targets of the virtual rig go by a name in ``SCENARIOS``; in phase with velocity.

Sign convention: extension positive, force resisting extension positive. Temperatures are in degC, as a test
is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Motion, motion_from_text
from mrdamper.files import read_toml
from mrdamper.schema import did_you_mean

__all__ = [
    "SCENARIOS",
    "Disturbance",
    "Dropout",
    "Scenario",
    "Sensing",
    "SineTarget",
    "Target",
    "VelocityTarget",
    "find_scenario",
    "read_scenario",
]

Sensor = Literal["displacement", "temperature", "force"]
Fault = Literal["missing", "frozen"]

_ANY_SIGN = ("phase_deg", "modulation_phase_rad", "temperature_offset_K", "temperature_degC")
_MAY_BE_ZERO = ("modulation", "modulation_Hz", "unscored_s", "seed", "start_s")
_LONGEST_S = 3600.0  # the arrays of a run at the plant's rate fit the memory


class Target(Protocol):
    """A wanted force over time."""

    def force(self, time: ArrayLike, motion: Motion) -> FloatArray:
        """Return the wanted force [N] at times [s]."""
        ...


def _check_numbers(record: object, place: str, *, zero: bool = False) -> None:
    """Refuse a number that is not finite, or negative where it must not be."""
    for each in fields(record):  # type: ignore[arg-type]  # dataclasses only
        value = getattr(record, each.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            if each.type in ("float", "int"):
                raise InputError(f"{place}: {each.name} is {value!r}; expected a number")
            continue
        may_be_zero = zero or each.name in _MAY_BE_ZERO
        fine = each.name in _ANY_SIGN or value > 0.0 or (value == 0.0 and may_be_zero)
        if not (math.isfinite(value) and fine):
            kind = "finite" if each.name in _ANY_SIGN else "zero or more" if may_be_zero else "positive"
            raise InputError(f"{place}: {each.name} is {value!r}; expected a number, {kind}")


@dataclass(frozen=True, slots=True)
class SineTarget:
    """F* = amplitude cos(2 pi f t + phase): in phase with the velocity of a sine of that frequency."""

    amplitude_N: float
    frequency_Hz: float
    phase_deg: float = 0.0  # ahead of the velocity

    def __post_init__(self) -> None:
        _check_numbers(self, "target")

    def force(self, time: ArrayLike, motion: Motion) -> FloatArray:
        phase = 2 * np.pi * self.frequency_Hz * np.asarray(time, dtype=np.float64)
        return np.asarray(self.amplitude_N * np.cos(phase + math.radians(self.phase_deg)))


@dataclass(frozen=True, slots=True)
class VelocityTarget:
    """F* = amplitude tanh[v / v0 (1 + modulation sin(2 pi f t + phase))], v the motion's velocity."""

    amplitude_N: float
    velocity_m_s: float  # v0
    modulation: float = 0.0
    modulation_Hz: float = 0.0
    modulation_phase_rad: float = 0.0

    def __post_init__(self) -> None:
        _check_numbers(self, "target")

    def force(self, time: ArrayLike, motion: Motion) -> FloatArray:
        t = np.asarray(time, dtype=np.float64)
        gain = 1.0 + self.modulation * np.sin(2 * np.pi * self.modulation_Hz * t + self.modulation_phase_rad)
        return np.asarray(self.amplitude_N * np.tanh(motion.velocity(t) / self.velocity_m_s * gain))


_TARGETS = ("sine", "velocity")


@dataclass(frozen=True, slots=True)
class Dropout:
    """A sensor that fails for a while: it gives nothing (NaN), or the last good value again and again."""

    sensor: Sensor
    start_s: float
    end_s: float
    fault: Fault = "missing"

    def __post_init__(self) -> None:
        _check_numbers(self, "dropout")
        for name, choices in (("sensor", get_args(Sensor)), ("fault", get_args(Fault))):
            if getattr(self, name) not in choices:
                said = ", ".join(choices)
                raise InputError(f"dropout: {name} is {getattr(self, name)!r}; expected one of: {said}")
        if not self.start_s < self.end_s:
            raise InputError(f"dropout: from {self.start_s:g} to {self.end_s:g} s; expected a later end")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """What the sensors add: white noise (standard deviation), converter steps (0: none), offset, losses."""

    displacement_noise_m: float = 10e-6
    displacement_step_m: float = 0.0
    displacement_delay_s: float = 0.0
    force_noise_N: float = 5.0
    force_step_N: float = 0.0
    temperature_noise_K: float = 0.3
    temperature_offset_K: float = 0.0
    lost_share: float = 0.0  # of the samples of each sensor, at random, NaN
    dropouts: tuple[Dropout, ...] = ()

    def __post_init__(self) -> None:
        _check_numbers(self, "sensors", zero=True)
        if not self.lost_share < 1.0:
            raise InputError(f"sensors: lost_share is {self.lost_share:g}; expected below 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What the damper and its driver do that the controller does not know."""

    force_gain: float = 1.0  # the damper's force, times this
    command_delay_s: float = 0.0  # from the sample to the driver, in whole steps of the plant
    command_step_A: float = 0.0  # of the driver's converter; 0: none

    def __post_init__(self) -> None:
        _check_numbers(self, "disturbance", zero=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One test of a controller: 900 N at 1 Hz on the 5 mm sine unless it says otherwise.

    Raises
    ------
    InputError
        A number without sense, an unknown motion, or nothing left to score.
    """

    name: str = "sine-900N-1Hz"
    target: Target = field(default_factory=lambda: SineTarget(900.0, 1.0))
    motion: str = "sine5mm1Hz"  # a name or a form that ``motion_from_text`` knows
    duration_s: float = 4.0
    unscored_s: float = 1.0  # at the beginning
    temperature_degC: float = 20.0  # of fluid and coil, held
    highest_A: float = 2.0  # the driver gives 0 to this
    seed: int = 1  # of the sensors' noise
    sensors: Sensing = field(default_factory=Sensing)
    disturbance: Disturbance = field(default_factory=Disturbance)

    def __post_init__(self) -> None:
        place = f"scenario {self.name!r}"
        _check_numbers(self, place)
        motion_from_text(self.motion)
        if not -40.0 <= self.temperature_degC <= 200.0:
            raise InputError(f"{place}: temperature is {self.temperature_degC:g} degC; expected -40 to 200")
        if not self.unscored_s < self.duration_s <= _LONGEST_S:
            raise InputError(
                f"{place}: lasts {self.duration_s:g} s, of which {self.unscored_s:g} s are not scored; "
                f"expected something to score, in at most {_LONGEST_S:g} s"
            )
        if isinstance(self.seed, bool) or not isinstance(self.seed, int):
            raise InputError(f"{place}: seed is {self.seed!r}; expected a whole number, zero or more")

    @property
    def path(self) -> Motion:
        """The motion itself."""
        return motion_from_text(self.motion)

    def force(self, time: ArrayLike) -> FloatArray:
        """Return the wanted force [N] at times [s]."""
        return self.target.force(time, self.path)

    @classmethod
    def from_mapping(cls, given: Mapping[str, Any], place: str = "scenario") -> Scenario:
        """Return the scenario of a TOML document; ``like`` names one that gives what it does not say."""
        try:
            base = find_scenario(given["like"]) if "like" in given else cls()
            values = {each.name: getattr(base, each.name) for each in fields(cls)}
            _check_keys(given, (*values, "like"), "")
            values |= {key: value for key, value in given.items() if key != "like"}
            if "target" in given:
                values["target"] = _target(given["target"])
            if "sensors" in given:
                values["sensors"] = _sensing(given["sensors"])
            if "disturbance" in given:
                values["disturbance"] = _record(Disturbance, given["disturbance"], "disturbance")
            if not isinstance(values["name"], str) or not isinstance(values["motion"], str):
                raise InputError("name and motion must be texts")
            return cls(**values)
        except InputError as error:
            raise InputError(f"{place}: {error}") from error


def read_scenario(path: str | Path) -> Scenario:
    """Return the scenario in a TOML file."""
    file, given = Path(path), read_toml(path, "scenario")
    return Scenario.from_mapping({"name": file.stem, **given}, file.name)


SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {
        each.name: each
        for each in (
            Scenario(),
            Scenario(
                name="sine-1100N-2Hz", target=SineTarget(1100.0, 2.0), motion="sine3mm2Hz", duration_s=3.0
            ),
            Scenario(
                name="non-periodic",
                target=VelocityTarget(1000.0, 0.022, 0.35, 0.31, 1.0),
                motion="nonperiodic",
                duration_s=10.0,
            ),
        )
    }
)
"""The scenarios that go by a name, at 20 degC with seed 1."""


def find_scenario(name: object) -> Scenario:
    """Return a scenario by its name; an unknown one is an error that names the nearest."""
    if not isinstance(name, str) or name not in SCENARIOS:
        raise InputError(f"there is no target {name!r}; {did_you_mean(str(name), SCENARIOS)}")
    return SCENARIOS[name]


_Record = TypeVar("_Record", Disturbance, Dropout, Sensing, SineTarget, VelocityTarget)


def _check_keys(given: Mapping[str, Any], known: tuple[str, ...], place: str) -> None:
    for key in given:
        if key not in known:
            raise InputError(
                f"{place}{': ' if place else ''}{key!r} is not known; {did_you_mean(key, known)}"
            )


def _record(kind: type[_Record], given: object, place: str) -> _Record:
    if not isinstance(given, dict):
        raise InputError(f"{place} is {given!r}; expected a table [{place}]")
    _check_keys(given, tuple(each.name for each in fields(kind)), f"{place}: ")
    try:
        return kind(**given)
    except TypeError as error:
        needed = ", ".join(each.name for each in fields(kind))
        raise InputError(f"{place}: something is missing; it has {needed}") from error


def _target(given: object) -> SineTarget | VelocityTarget:
    if not isinstance(given, dict) or given.get("kind") not in _TARGETS:
        raise InputError(f"target is {given!r}; expected a table with kind = {' or '.join(_TARGETS)}")
    numbers = {key: value for key, value in given.items() if key != "kind"}
    if given["kind"] == "sine":
        return _record(SineTarget, numbers, "target")
    return _record(VelocityTarget, numbers, "target")


def _sensing(given: object) -> Sensing:
    if isinstance(given, dict) and isinstance(given.get("dropouts"), list):
        dropouts = tuple(_record(Dropout, each, "sensors.dropouts") for each in given["dropouts"])
        given = {**given, "dropouts": dropouts}
    return _record(Sensing, given, "sensors")
