"""A test plan beside runs: ``plan.toml`` in their folder declares what each of them should be.

.. code-block:: toml

    [run.sine_3]           # a run's name; "sine_*" declares all that match
    frequency_Hz = 2.0
    stroke_mm = 10.0       # amplitude or stroke
    command = 1.5          # [A], or [V] for runs with a voltage
    temperature_degC = 40.0
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from mrdamper.files import is_file, read_toml
from mrdamper.schema import Option, read_record

__all__ = ["DeclaredRun", "RunPlan", "plans_beside"]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPlan:
    """The runs of a plan, by name or pattern."""

    run: Mapping[str, DeclaredRun] = field(default_factory=lambda: MappingProxyType({}))

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
