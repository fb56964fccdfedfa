"""Test campaigns of the virtual rig: motions, currents, temperatures, and the choice of held-out runs.

The temperature is constant during a run, as in the reference paper. ``measurement`` simulates the runs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from mrdamper.errors import InputError
from mrdamper.excitation import (
    CURRENT_STEPS,
    RANDOM_CURRENT,
    Chirp,
    CurrentSteps,
    Motion,
    RandomCurrent,
    RandomMotion,
    Sine,
    Triangle,
    motion_from_text,
)
from mrdamper.files import read_toml, toml_text
from mrdamper.schema import Option, check_ranges, read_record, write_record
from mrdamper.virtual_rig.damper import HydraulicDamper, VirtualDamper, find_preset
from mrdamper.virtual_rig.sensors import Sensors

_HELD_OUT = {"held_out_temperatures_degC": "temperatures_degC", "held_out_motions": "motions"}
LOG_RATE_HZ = 500.0  # default sampling rate of a campaign
RUN_IN_MIN_S = 1.0  # Minimum run-in before the log. Periodic motions have a run-in of whole periods.


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """The plan of one run of a campaign."""

    name: str
    label: str  # name of the motion in run names
    motion: Motion
    current: float | CurrentSteps | RandomCurrent  # current command [A]
    temperature_degC: float
    duration_s: float
    run_in_s: float
    held_out: bool


@dataclass(frozen=True)
class Campaign:
    """Test plan: each motion at each current and temperature, and changing currents at each temperature.

    Motions have the format of ``motion_from_text``. A periodic motion is logged for whole periods, a chirp to
    its end, and any other motion for ``duration_s``. Held-out temperatures and motions are ignored if the
    campaign does not contain them. The current steps are made during the motion ``steps_motion``. Lags that
    are identified from these steps are valid near the speed of this motion (``identify.actuation``). The run
    with random current and random motion is logged for twice ``duration_s``. The seeds of random current and
    random motion are different at every temperature.
    """

    motions: tuple[str, ...] = ("sine5mm1Hz", "sine3mm2Hz", "nonperiodic", "chirp3mm")
    currents_A: tuple[float, ...] = (0.0, 0.5, 1.0, 1.5, 2.0)
    temperatures_degC: tuple[float, ...] = (20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 123.0)
    steps: Annotated[
        CurrentSteps | None,
        Option(expected="true, false or a table with levels_A and hold_s"),
    ] = CURRENT_STEPS
    steps_motion: str = "steps"  # motion during the current steps
    random: Annotated[
        RandomCurrent | None,
        Option(
            expected="true, false or a table with highest_A, shortest_s, longest_s and seed",
        ),
    ] = None
    random_motion: str = "random:6mm:0.5-4Hz:1"  # motion during the random current
    duration_s: Annotated[float, Option(unit="s", above=0.0)] = 4.0
    held_out_temperatures_degC: tuple[float, ...] = (60.0, 100.0, 123.0)
    held_out_motions: tuple[str, ...] = ("chirp3mm",)
    sensors: Sensors = field(default_factory=lambda: Sensors(rate_Hz=LOG_RATE_HZ))

    def __post_init__(self) -> None:
        check_ranges(self, "campaign")
        for name in ("currents_A", "temperatures_degC", "held_out_temperatures_degC"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        if not self.temperatures_degC or not (
            (self.motions and self.currents_A) or self.steps or self.random
        ):
            raise InputError(
                "nothing to run", place="campaign", expected="temperatures, and motions with currents"
            )
        for name, of in _HELD_OUT.items():
            kept = tuple(value for value in getattr(self, name) if value in getattr(self, of))
            object.__setattr__(self, name, kept)
        if self.steps is not None:
            motion_from_text(self.steps_motion)
        if self.random is not None:
            motion_from_text(self.random_motion)
        names = [run.name for run in self.runs("x")]
        twice = next((name for name, count in Counter(names).items() if count > 1), None)
        if twice is not None:
            raise InputError(f"two runs have the name {twice[2:]!r}", place="campaign", remedy="omit one")

    @property
    def rate_Hz(self) -> float:
        """Sampling rate of the log [Hz]."""
        return self.sensors.rate_Hz

    @property
    def hold_out(self) -> tuple[str, ...]:
        """Name patterns of the held-out runs, in the format of ``mrdamper fit --hold-out``."""
        return (
            *(f"*_{_degrees(value)}_*" for value in self.held_out_temperatures_degC),
            *(f"*_{_label(text)}" for text in self.held_out_motions),
        )

    def runs(self, damper: str = "nominal") -> tuple[PlannedRun, ...]:
        """Return the plans of all runs, coldest first; the names of the runs begin with ``damper``."""
        planned = []
        for degrees in self.temperatures_degC:
            apart = degrees in self.held_out_temperatures_degC
            for text, motion in self._motions.items():
                held_out = apart or text in self.held_out_motions
                for current in self.currents_A:
                    name = f"{damper}_{_degrees(degrees)}_{current:.2f}A_{_label(text)}"
                    times = self._times(motion)
                    planned.append(PlannedRun(name, _label(text), motion, current, degrees, *times, held_out))
            if self.steps is not None:
                motion, label = motion_from_text(self.steps_motion), _label(self.steps_motion)
                span = f"{min(self.steps.levels):g}-{max(self.steps.levels):g}A"
                name = f"{damper}_{_degrees(degrees)}_{span}_{label}"
                times = (self.steps.duration, self._times(motion)[1])
                planned.append(PlannedRun(name, label, motion, self.steps, degrees, *times, apart))
            if self.random is not None:
                name = f"{damper}_{_degrees(degrees)}_0-{self.random.highest:g}A_random"
                planned.append(self._random_run(name, self.random, degrees, held_out=apart))
        return tuple(planned)

    def _random_run(self, name: str, current: RandomCurrent, degrees: float, *, held_out: bool) -> PlannedRun:
        # The seeds grow with the temperature. The constant keeps the increment positive, as seeds must be.
        more = round(10.0 * degrees) + 10_000
        motion = motion_from_text(self.random_motion)
        if isinstance(motion, RandomMotion):
            motion = replace(motion, seed=motion.seed + more)
        current = replace(current, seed=current.seed + more)
        return PlannedRun(
            name, "random", motion, current, degrees, 2.0 * self.duration_s, RUN_IN_MIN_S, held_out
        )

    @cached_property
    def _motions(self) -> dict[str, Motion]:
        return {text: motion_from_text(text) for text in self.motions}

    def _times(self, motion: Motion) -> tuple[float, float]:
        """Return the duration of the log of a motion, and the duration of the run-in before the log [s]."""
        if isinstance(motion, Sine | Triangle):
            period = motion.period
            logged, run_in = (
                period * math.ceil(time / period - 1e-9) for time in (self.duration_s, RUN_IN_MIN_S)
            )
            return logged, run_in
        return motion.duration if isinstance(motion, Chirp) else self.duration_s, RUN_IN_MIN_S

    @classmethod
    def from_mapping(cls, given: Mapping[str, Any], place: str = "campaign") -> Campaign:
        """Return the campaign that a TOML document defines.

        If the document has the key ``preset`` (name of a damper), missing values are taken from the default
        campaign of the named damper. Otherwise missing values have the defaults of this class.
        """
        try:
            usual = default_campaign(find_preset(given["preset"])) if "preset" in given else cls()
        except InputError as error:
            raise error.prepend_place(place) from error
        document = {name: value for name, value in given.items() if name != "preset"}
        known = write_record(usual, defaults=True)
        if isinstance(given.get("sensors"), Mapping):
            document["sensors"] = {**known["sensors"], **given["sensors"]}
        for name, default in (("steps", CURRENT_STEPS), ("random", RANDOM_CURRENT)):
            if isinstance(given.get(name), bool):
                document[name] = write_record(default) if given[name] else None
        campaign = read_record(cls, {**known, **document}, place)
        for name, of in _HELD_OUT.items():
            for value in given.get(name, ()):
                if value not in getattr(campaign, of):
                    run = ", ".join(map(str, getattr(campaign, of)))
                    raise InputError(
                        f"{name} holds {value!r}, which is not in {of} ({run})",
                        place=place,
                        remedy="add it there, or drop it",
                    )
        return campaign

    @classmethod
    def from_toml(cls, path: str | Path) -> Campaign:
        """Return the campaign in a TOML file."""
        return cls.from_mapping(read_toml(path, "campaign"), Path(path).name)

    def to_toml(self) -> str:
        """Return the campaign as TOML text. ``from_toml`` reads an equal campaign from this text."""
        none = {"steps": False} if self.steps is None else {}
        return toml_text({**none, **write_record(self, defaults=True)}, "a campaign on the virtual rig")


CAMPAIGNS: Mapping[str, Mapping[str, Any]] = {
    "short": {  # small campaign that is sufficient for a first card
        "motions": ["sine5mm1Hz", "sine3mm2Hz"],
        "currents_A": [0.0, 0.5, 1.0, 2.0],
        "temperatures_degC": [20.0, 60.0, 100.0],
        "duration_s": 3.0,
        "held_out_temperatures_degC": [60.0],
        "held_out_motions": [],
    },
}
"""Named campaigns: the values that differ from the default campaign, by name of the campaign."""


def find_campaign(name: str | Path) -> Campaign:
    """Return the campaign with this name, or the campaign in the TOML file with this path."""
    if str(name) in CAMPAIGNS:
        return Campaign.from_mapping(CAMPAIGNS[str(name)], str(name))
    return Campaign.from_toml(name)


def _degrees(temperature_degC: float) -> str:
    """Return a temperature as text for run names, such as 020C or 022.5C."""
    whole = float(temperature_degC).is_integer()
    return f"{temperature_degC:03.0f}C" if whole else f"{temperature_degC:05.1f}C"


def _label(motion: str) -> str:
    """Return the text of a motion with only characters that are valid in a file name."""
    return motion.replace(":", "").replace("/", "p")


_LUMPED = Campaign(random=RANDOM_CURRENT)
_BENCH = replace(
    _LUMPED,
    temperatures_degC=(20.0, 45.0, 70.0, 95.0, 120.0),
    held_out_temperatures_degC=(45.0, 95.0),
    sensors=Sensors(
        rate_Hz=LOG_RATE_HZ, displacement_noise_m=10e-6, displacement_step_m=2e-6, force_noise_N=5.0,
        force_step_N=0.5, force_offset_N=3.0, cell_mass_kg=0.8,
    ),
)  # fmt: skip
_CAR = replace(
    _BENCH, motions=("sine:25mm:1Hz", "sine:15mm:2Hz", "nonperiodic5x", "chirp:1.8mm:0.5-8Hz:8s"),
    currents_A=(0.0, 1.0, 2.0, 3.5, 5.0), held_out_motions=("chirp:1.8mm:0.5-8Hz:8s",),
    steps=CurrentSteps((0.0, 2.0, 5.0, 2.0, 0.0, 2.0, 5.0, 2.0, 0.0), hold=0.8),
    steps_motion="triangle:60mm:150mm/s",
    random=RandomCurrent(highest=5.0), random_motion="random:30mm:0.5-4Hz:1",
    sensors=Sensors(
        rate_Hz=LOG_RATE_HZ, displacement_noise_m=20e-6, displacement_step_m=5e-6, force_noise_N=10.0,
        force_step_N=1.0, force_offset_N=-5.0, cell_mass_kg=1.0,
    ),
)  # fmt: skip


def default_campaign(damper: VirtualDamper) -> Campaign:
    """Return the default campaign of a virtual damper, which suits its stroke and its speeds."""
    if not isinstance(damper, HydraulicDamper):
        return _LUMPED
    return _BENCH if damper.through_rod else _CAR
