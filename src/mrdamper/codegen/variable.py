"""Variables of an FMU and their units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mrdamper.quantities import ZERO_CELSIUS_K

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["independent", "input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "tunable", "constant"]


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as powers of SI base units, and its display unit: displayed = factor * value + offset."""

    base: Mapping[str, int]
    display: str = ""
    factor: float = 1.0
    offset: float = 0.0


UNITS: Mapping[str, Unit] = {
    "s": Unit({"s": 1}),
    "m": Unit({"m": 1}, "mm", 1000.0),
    "m/s": Unit({"m": 1, "s": -1}, "mm/s", 1000.0),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "K": Unit({"K": 1}, "degC", 1.0, -ZERO_CELSIUS_K),
    "A": Unit({"A": 1}),
    "V": Unit({"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A/N": Unit({"A": 1, "kg": -1, "m": -1, "s": 2}),
    "V/N": Unit({"m": 1, "s": -1, "A": -1}),
    "A/(N.s)": Unit({"A": 1, "kg": -1, "m": -1, "s": 1}),
    "V/(N.s)": Unit({"m": 1, "s": -2, "A": -1}),
    "ohm": Unit({"kg": 1, "m": 2, "s": -3, "A": -2}),
    "1": Unit({}),
}
"""Units of the variables, by name of the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One variable of an FMU.

    ``place`` is the C struct member that a parameter sets. An output of flags is true if one of the flags in
    ``bits`` is set.
    """

    name: str
    description: str
    kind: Kind
    causality: Causality
    variability: Variability
    unit: str = ""  # unit of a real variable; empty for other kinds
    start: float | None = None  # start value; None: the FMU computes the value
    low: float = -math.inf
    high: float = math.inf
    place: str = ""
    bits: int = 0

    @property
    def label(self) -> str:
        """Return the name of the C constant that contains the value reference of the variable."""
        return f"VR_{self.name.upper()}"


def tunable(
    name: str, unit: str, start: float, low: float, high: float, description: str, place: str
) -> Variable:
    """Return a real parameter that can change between time steps."""
    return Variable(
        name=name, description=description, kind="real", causality="parameter", variability="tunable",
        unit=unit, start=start, low=low, high=high, place=place,
    )  # fmt: skip
