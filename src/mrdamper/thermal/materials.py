"""Solid materials of a damper: conductivity, density, heat capacity, and the source of these values.

The values are constants for about 20 to 100 degC. The heat capacity of steel increases by about 5 % in this
range, which is less than the uncertainty of a geometry file. The MR fluid is defined in ``models.fluid``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from mrdamper.schema import Positive, check_ranges, unknown_name

COPPER_PER_K = 0.00393
"""Temperature coefficient of the resistance of copper, relative to 20 degC [1/K] (standard copper)."""


@dataclass(frozen=True, slots=True)
class Material:
    """A solid material with its thermal properties."""

    name: str
    conductivity: Positive  # [W/(m K)]
    density: Positive  # [kg/m^3]
    heat_capacity: Positive  # [J/(kg K)]
    source: str = "given by the user"

    def __post_init__(self) -> None:
        check_ranges(self, f"material {self.name!r}")

    def __str__(self) -> str:
        return self.name

    @classmethod
    def __get_pydantic_core_schema__(cls, _source: object, _handler: object) -> Any:  # noqa: ANN401
        """Return the pydantic schema: a file contains only the name of a material."""
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(
            find_material, core_schema.str_schema(), serialization=core_schema.to_string_ser_schema()
        )

    @property
    def volumetric_heat(self) -> float:
        """Return the volumetric heat capacity [J/(m^3 K)]."""
        return self.density * self.heat_capacity


_HANDBOOK = "a typical value near 20 degC"

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
        "across the wires assumed within 0.3 to 1 W/(m K)",
    ),
)

MATERIALS: Mapping[str, Material] = MappingProxyType({material.name: material for material in _TABLE})
"""Materials that a geometry file can use, by name."""


INSULATION_DEGC: Mapping[str, float] = MappingProxyType(
    {"Y": 90.0, "A": 105.0, "E": 120.0, "B": 130.0, "F": 155.0, "H": 180.0}
)
"""Maximum temperature of a winding by insulation class of IEC 60085 [degC].

Source: https://croylek.com/pages/temperature-classes-of-electrical-insulation and other manufacturers."""

SEALS_DEGC: Mapping[str, float] = MappingProxyType(
    {"NBR": 100.0, "PU": 100.0, "HNBR": 150.0, "EPDM": 150.0, "FKM": 200.0}
)
"""Maximum continuous temperature of elastomers [degC].

Source: standard compounds of https://www.bodeseal.com/technical-support. Other sources
state 20 K more for NBR and 20 K less for PU."""


def find_material(name: str, place: str = "") -> Material:
    """Return the material with a name; an InputError suggests a similar name."""
    if name not in MATERIALS:
        raise unknown_name(f"there is no material {name!r}", name, MATERIALS, place)
    return MATERIALS[name]
