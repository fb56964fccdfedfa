"""Scenarios of force tracking: target, motion, temperature, sensors, disturbances and seed.

A scenario is a test case for a controller. It does not contain the damper or the controller. Users write
scenarios as TOML files. ``SCENARIOS`` contains the named scenarios of the virtual test rig. Their wanted
force is in phase with the velocity, so that the damper can produce it.

Extension is positive, and a force that resists extension is positive. Temperatures are in degC.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Motion, motion_from_text
from mrdamper.files import read_toml
from mrdamper.schema import Option, check_ranges, read_record, unknown_name, write_record

Sensor = Literal["displacement", "temperature", "force"]
Fault = Literal["missing", "frozen", "shifted"]

_LONGEST_S = 3600.0  # max duration of a scenario; limits the memory that a run needs


class Target(Protocol):
    """A wanted force as a function of time."""

    def force(self, time: ArrayLike, velocity: ArrayLike) -> FloatArray:
        """Return the wanted force [N] at times [s] and velocities [m/s] of the motion."""
        ...


@dataclass(frozen=True, slots=True)
class SineTarget:
    """F* = offset + amplitude cos(2 pi f t + phase).

    With phase 0, the target is in phase with the velocity of the motion A sin(2 pi f t).
    """

    amplitude_N: Annotated[float, Option(unit="N", above=0.0)]
    frequency_Hz: Annotated[float, Option(unit="Hz", above=0.0)]
    phase_deg: Annotated[float, Option(unit="deg")] = 0.0
    """Phase lead of the target relative to the velocity."""
    offset_N: Annotated[float, Option(unit="N")] = 0.0
    """Constant force of a gas spring."""

    def __post_init__(self) -> None:
        check_ranges(self, "target")

    def force(self, time: ArrayLike, velocity: ArrayLike) -> FloatArray:
        phase = 2 * np.pi * self.frequency_Hz * np.asarray(time, dtype=np.float64)
        return np.asarray(self.offset_N + self.amplitude_N * np.cos(phase + math.radians(self.phase_deg)))


@dataclass(frozen=True, slots=True)
class VelocityTarget:
    """F* = offset + amplitude tanh[v / v0 (1 + modulation sin(2 pi f t + phase))], with the velocity v."""

    amplitude_N: Annotated[float, Option(unit="N", above=0.0)]
    velocity_m_s: Annotated[float, Option(unit="m/s", above=0.0)]
    """The velocity v0."""
    modulation: Annotated[float, Option(least=0.0)] = 0.0
    modulation_Hz: Annotated[float, Option(unit="Hz", least=0.0)] = 0.0
    modulation_phase_rad: Annotated[float, Option(unit="rad")] = 0.0
    offset_N: Annotated[float, Option(unit="N")] = 0.0
    """Constant force of a gas spring."""

    def __post_init__(self) -> None:
        check_ranges(self, "target")

    def force(self, time: ArrayLike, velocity: ArrayLike) -> FloatArray:
        t = np.asarray(time, dtype=np.float64)
        gain = 1.0 + self.modulation * np.sin(2 * np.pi * self.modulation_Hz * t + self.modulation_phase_rad)
        rise = np.tanh(np.asarray(velocity) / self.velocity_m_s * gain)
        return np.asarray(self.offset_N + self.amplitude_N * rise)


_TARGETS: Mapping[str, type[SineTarget | VelocityTarget]] = MappingProxyType(
    {"sine": SineTarget, "velocity": VelocityTarget}
)


@dataclass(frozen=True, slots=True)
class Dropout:
    """A temporary fault of a sensor: no reading (NaN), the last valid reading, or a shifted reading."""

    sensor: Sensor
    start_s: Annotated[float, Option(unit="s", least=0.0)]
    end_s: Annotated[float, Option(unit="s", above=0.0)]
    fault: Fault = "missing"
    shift: float = 0.0
    """Shift of the readings [SI]."""

    def __post_init__(self) -> None:
        check_ranges(self, "dropout")
        if not self.start_s < self.end_s:
            raise InputError(
                f"from {self.start_s:g} to {self.end_s:g} s", place="dropout", expected="a later end"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """Sensor properties: standard deviation of white noise, resolution (0: exact), offsets, lost readings."""

    displacement_noise_m: Annotated[float, Option(unit="m", least=0.0)] = 10e-6
    displacement_step_m: Annotated[float, Option(unit="m", least=0.0)] = 0.0
    displacement_hold_s: Annotated[float, Option(unit="s", least=0.0)] = 0.0
    """Time for which a slow bus repeats each reading; 0: each sample has a new reading."""
    displacement_delay_s: Annotated[float, Option(unit="s", least=0.0)] = 0.0
    force_noise_N: Annotated[float, Option(unit="N", least=0.0)] = 5.0
    force_step_N: Annotated[float, Option(unit="N", least=0.0)] = 0.0
    force_offset_N: Annotated[float, Option(unit="N")] = 0.0
    temperature_noise_K: Annotated[float, Option(unit="K", least=0.0)] = 0.3
    temperature_offset_K: Annotated[float, Option(unit="K")] = 0.0
    lost_share: Annotated[float, Option(least=0.0, below=1.0)] = 0.0
    """Fraction of the samples of each sensor that are lost at random."""
    dropouts: tuple[Dropout, ...] = ()

    def __post_init__(self) -> None:
        check_ranges(self, "sensors")


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Unmeasured deviations of the damper and of the current driver from the controller's model."""

    force_gain: Annotated[float, Option(least=0.0)] = 1.0
    """Factor on the damper's force."""
    force_offset_N: Annotated[float, Option(unit="N")] = 0.0
    """Constant force that the card does not contain."""
    command_delay_s: Annotated[float, Option(unit="s", least=0.0)] = 0.0
    """Delay between sample and driver, rounded to steps of the plant."""
    command_step_A: Annotated[float, Option(unit="A", least=0.0)] = 0.0
    """Resolution of the driver's converter; 0: no rounding."""

    def __post_init__(self) -> None:
        check_ranges(self, "disturbance")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Conditions:
    """All fields of a scenario except the target."""

    name: str = "sine-900N-1Hz"
    motion: str = "sine5mm1Hz"
    """Motion, as a name or a text for ``motion_from_text``."""
    duration_s: Annotated[float, Option(unit="s", above=0.0, most=_LONGEST_S)] = 4.0
    unscored_s: Annotated[float, Option(unit="s", least=0.0)] = 1.0
    """Time at the beginning of the run that is not scored."""
    temperature_degC: Annotated[float, Option(unit="degC", least=-40.0, most=200.0)] = 20.0
    """Constant temperature of the damper."""
    highest_A: Annotated[float, Option(unit="A", above=0.0)] = 2.0
    """Largest current of the driver."""
    seed: Annotated[int, Option(least=0)] = 1
    """Seed of the sensor noise."""
    sensors: Sensing = field(default_factory=Sensing)
    disturbance: Disturbance = field(default_factory=Disturbance)

    def __post_init__(self) -> None:
        check_ranges(self, f"scenario {self.name!r}")
        motion_from_text(self.motion)
        if not self.unscored_s < self.duration_s:
            raise InputError(
                f"lasts {self.duration_s:g} s, of which {self.unscored_s:g} s are not scored",
                place=f"scenario {self.name!r}",
                expected="something to score",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _ScenarioTable(_Conditions):
    """Keys of a scenario file; ``like`` names the scenario with the missing values."""

    like: str | None = None
    target: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(_Conditions):
    """One test of a controller. The default target is a sine of 900 N and 1 Hz; the motion is a 5 mm sine.

    Raises
    ------
    InputError
        If a value is invalid, the motion is unknown, or ``unscored_s`` is not shorter than the run.
    """

    target: Target = field(default_factory=lambda: SineTarget(900.0, 1.0))

    @property
    def path(self) -> Motion:
        return motion_from_text(self.motion)

    def force(self, time: ArrayLike) -> FloatArray:
        """Return the wanted force [N] at times [s]."""
        return self.target.force(time, self.path.velocity(time))

    @classmethod
    def from_mapping(cls, given: Mapping[str, Any], place: str = "scenario") -> Scenario:
        """Return the scenario of a TOML document. The scenario in ``like`` supplies missing values."""
        try:
            base = find_scenario(given["like"]) if "like" in given else cls()
        except InputError as error:
            raise error.prepend_place(place) from error
        own = {each.name: getattr(base, each.name) for each in fields(_Conditions)}
        conditions = write_record(_Conditions(**own), defaults=True)
        table = read_record(_ScenarioTable, {**conditions, **given}, place)
        read = {name: getattr(table, name) for name in own}
        return cls(**read, target=base.target if table.target is None else _target(table.target, place))


def read_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a TOML file."""
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
"""Named scenarios, at 20 degC with seed 1."""


def find_scenario(name: object) -> Scenario:
    """Return a scenario by name. The error about an unknown name suggests the most similar name."""
    if not isinstance(name, str) or name not in SCENARIOS:
        raise unknown_name(f"there is no target {name!r}", str(name), SCENARIOS)
    return SCENARIOS[name]


def _target(table: Mapping[str, Any], place: str) -> Target:
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _TARGETS:
        raise InputError(f"target.kind is {kind!r}", place=place, expected=f"one of: {', '.join(_TARGETS)}")
    numbers = {key: value for key, value in table.items() if key != "kind"}
    return read_record(_TARGETS[kind], numbers, f"{place}: target")
