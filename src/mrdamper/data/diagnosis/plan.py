"""A test plan beside runs: ``plan.toml`` in their folder declares what they and their damper should be.

.. code-block:: toml

    [run.sine_3]           # a run's name; "sine_*" declares all that match
    frequency_Hz = 2.0
    stroke_mm = 10.0       # amplitude or stroke
    command = 1.5          # [A], or [V] for runs with a voltage
    temperature_degC = 40.0

    [damper]               # from its data sheet; any of these keys
    peak_force_N = 2500.0  # with the largest current
    largest_current_A = 2.0
    stroke_mm = 60.0       # from end to end
    bore_mm = 40.0         # from its drawing, these four together
    rod_mm = 12.0
    gap_mm = 0.7
    pole_mm = 20.0         # length of the gap between poles, all together
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from mrdamper.errors import InputError
from mrdamper.files import is_file, read_toml
from mrdamper.schema import Option, read_record

_FILE = "plan.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredRun:
    """What a plan says of a run; None: nothing."""

    frequency_Hz: Annotated[float | None, Option("Of the motion.", unit="Hz", above=0.0)] = None
    stroke_mm: Annotated[float | None, Option("Amplitude or stroke.", unit="mm", above=0.0)] = None
    command: Annotated[float | None, Option("Current [A], or voltage [V].")] = None
    temperature_degC: Annotated[float | None, Option("Of the damper.", unit="degC", least=-273.15)] = None

    @property
    def values(self) -> Mapping[str, float | None]:
        """The declared values by quantity, in the units of the file."""
        return {
            "frequency": self.frequency_Hz,
            "stroke": self.stroke_mm,
            "command": self.command,
            "temperature": self.temperature_degC,
        }


def _length(text: str) -> Option:
    return Option(text, unit="mm", above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredDamper:
    """What data sheet and drawing say of the damper; None: nothing.

    Raises
    ------
    InputError
        The rod fills the bore.
    """

    peak_force_N: Annotated[float | None, Option("With the largest current.", unit="N", above=0.0)] = None
    largest_current_A: Annotated[float | None, Option("That the coil bears.", unit="A", above=0.0)] = None
    stroke_mm: Annotated[float | None, _length("From end to end.")] = None
    bore_mm: Annotated[float | None, _length("Of the cylinder.")] = None
    rod_mm: Annotated[float | None, _length("Diameter of the rod.")] = None
    gap_mm: Annotated[float | None, _length("Of the fluid, between the poles.")] = None
    pole_mm: Annotated[float | None, _length("Length of that gap, all poles together.")] = None

    def __post_init__(self) -> None:
        if self.bore_mm is not None and self.rod_mm is not None and self.rod_mm >= self.bore_mm:
            raise InputError(
                f"a rod of {self.rod_mm:g} mm in a bore of {self.bore_mm:g} mm",
                place="damper",
                expected="a rod thinner than the bore",
                remedy="Exchange the two, or check their unit",
            )

    @property
    def valve_m(self) -> tuple[float, float, float] | None:
        """The piston's area [m^2], length and height of the gap [m]; None unless all are declared."""
        drawn = (self.bore_mm, self.rod_mm, self.pole_mm, self.gap_mm)
        if any(each is None for each in drawn):
            return None
        bore, rod, pole, gap = (1e-3 * each for each in drawn if each is not None)
        return 0.25 * math.pi * (bore**2 - rod**2), pole, gap


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPlan:
    """The runs of a plan, by name or pattern, and their damper."""

    run: Mapping[str, DeclaredRun] = field(default_factory=lambda: MappingProxyType({}))
    damper: DeclaredDamper = field(default_factory=DeclaredDamper)

    def declared(self, name: str, quantity: str) -> float | None:
        """Return what the plan says of a run: under its own name, else the first pattern that matches."""
        exact = [self.run[name]] if name in self.run else []
        for each in (*exact, *(each for glob, each in self.run.items() if fnmatchcase(name, glob))):
            value = each.values[quantity]
            if value is not None:
                return value
        return None


def plans_beside(sources: Iterable[str]) -> Mapping[str, RunPlan]:
    """Return the plan in the folder of each source, by source; those without one are left out.

    Raises
    ------
    InputError
        A plan is no plan: with place, key, what was found and what is expected.
    """
    plans: dict[Path, RunPlan | None] = {}
    found: dict[str, RunPlan] = {}
    for source in sources:
        folder = Path(source).parent
        if folder not in plans:
            path = folder / _FILE
            plans[folder] = (
                read_record(RunPlan, read_toml(path, "plan"), str(path)) if is_file(path) else None
            )
        plan = plans[folder]
        if plan is not None:
            found[source] = plan
    return found
