"""Materials of a damper's body, piston, coil and fins: conductivity, density, heat capacity, with sources.

Values are those near 20 to 100 degC, taken as constants: over that span the heat capacity of steel rises by
about 5 %, less than a drawing is uncertain by. The MR fluid is ``models.fluid``'s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from mrdamper.errors import InputError
from mrdamper.schema import unknown_name

COPPER_PER_K = 0.00393
"""Rise of copper's resistance per kelvin, of its value at 20 degC [1/K]; known as standard copper's."""


@dataclass(frozen=True, slots=True)
class Material:
    """A solid that conducts and stores heat."""

    name: str
    conductivity: float  # [W/(m K)]
    density: float  # [kg/m^3]
    heat_capacity: float  # [J/(kg K)]
    source: str = "given by the user"

    def __post_init__(self) -> None:
        for name, unit in (("conductivity", "W/(m K)"), ("density", "kg/m^3"), ("heat_capacity", "J/(kg K)")):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(
                    place=f"material {self.name!r}",
                    found=f"{name} is {value} {unit}",
                    expected="a positive, finite number",
                )

    def __str__(self) -> str:
        return self.name

    @classmethod
    def __get_pydantic_core_schema__(cls, _source: object, _handler: object) -> Any:  # noqa: ANN401
        """Return how a file names a material: by a text (``mrdamper.schema``)."""
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(find_material, core_schema.str_schema())

    @property
    def volumetric_heat(self) -> float:
        """Heat capacity of a cubic metre [J/(m^3 K)]."""
        return self.density * self.heat_capacity


_HANDBOOK = "a usual value near 20 degC"

_TABLE = (
    Material("steel", 48.0, 7850.0, 470.0, f"unalloyed steel, 0.2 to 0.45 % carbon: {_HANDBOOK}"),
    Material("stainless-steel", 15.0, 7900.0, 500.0, f"austenitic, 18 % Cr, 8 % Ni: {_HANDBOOK}"),
    Material("aluminium-alloy", 160.0, 2700.0, 900.0, f"wrought, 6000 series: {_HANDBOOK}"),
    Material("copper", 390.0, 8930.0, 385.0, _HANDBOOK),
    Material(
        "winding",
        0.6,
        5860.0,
        470.0,
        "60 % copper, 40 % enamel and potting by volume: density and heat capacity by mixture, conductivity "
        "across the wires a proposal inside 0.3 to 1 W/(m K)",
    ),
)

MATERIALS: Mapping[str, Material] = MappingProxyType({material.name: material for material in _TABLE})
"""The materials that a drawing may name."""


INSULATION_DEGC: Mapping[str, float] = MappingProxyType(
    {"Y": 90.0, "A": 105.0, "E": 120.0, "B": 130.0, "F": 155.0, "H": 180.0}
)
"""Hottest point of a winding by the class of its insulation [degC]: IEC 60085's classes, as
https://croylek.com/pages/temperature-classes-of-electrical-insulation and other makers list them."""

SEALS_DEGC: Mapping[str, float] = MappingProxyType(
    {"NBR": 100.0, "PU": 100.0, "HNBR": 150.0, "EPDM": 150.0, "FKM": 200.0}
)
"""What elastomers bear for long [degC], the standard compounds of https://www.bodeseal.com/technical-support;
others give 20 K more for NBR and 20 K less for PU."""


def find_material(name: str, place: str = "") -> Material:
    """Return a material by its name; an unknown one is an error that names the nearest."""
    if name not in MATERIALS:
        raise unknown_name(f"no material is called {name!r}", name, MATERIALS, place)
    return MATERIALS[name]
