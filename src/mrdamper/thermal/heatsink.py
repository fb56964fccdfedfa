"""A heat sink: equal annular fins at equal distances on the body of a damper; geometry, mass and radiation.

The properties in this module do not depend on temperature. ``surfaces`` computes the heat transfer. "Width"
is the radial width of a fin. The geometry of the reference damper uses 23 mm as radius of the body and as
width of a fin. The publication calls 23 mm an "outer diameter", but then the piston would not fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.schema import Option, check_ranges
from mrdamper.thermal.films.correlations import groove_emissivity
from mrdamper.thermal.materials import MATERIALS, Material


def length_option(key: str, default_help: str = "") -> Option:
    """Return the declaration of a length that a file states in millimetres."""
    # A value above 10 000 mm probably has another unit.
    return Option(key=key, unit="mm", above=0.0, most=10_000.0, default_help=default_help)


@dataclass(frozen=True, slots=True, kw_only=True)
class Manufacture:
    """Manufacturing limits of a heat sink, and fouling that narrows the gaps; lengths in metres."""

    least_thickness: Annotated[float, length_option("least_thickness_mm")] = 1e-3
    """Smallest thickness of a fin that can be manufactured."""
    least_gap: Annotated[float, length_option("least_gap_mm")] = 3e-3
    """Smallest gap between two fins."""
    tolerance: Annotated[float, Option(key="tolerance_mm", unit="mm", least=0.0)] = 0.0
    """Manufacturing tolerance of a gap."""
    fouling: Annotated[float, Option(key="fouling_mm", unit="mm", least=0.0)] = 0.0
    """Thickness of dirt on each side of a gap."""

    def __post_init__(self) -> None:
        check_ranges(self, "manufacture")

    @property
    def closing(self) -> float:
        """Return the reduction of a gap by tolerance and fouling [m]."""
        return self.tolerance + 2.0 * self.fouling


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatSink:
    """A heat sink: annular fins on the body of a damper; lengths in metres."""

    fins: Annotated[int, Option(least=1, most=10_000)]
    """Number of fins."""
    width: Annotated[float, length_option("width_mm")]
    """Radial width from root to tip."""
    thickness: Annotated[float, length_option("thickness_mm")]
    """Thickness of a fin."""
    pitch: Annotated[float, length_option("pitch_mm")]
    """Distance between the centres of two adjacent fins."""
    material: Annotated[Material, Option(among=lambda: MATERIALS)] = MATERIALS["aluminium-alloy"]
    """Material of the fins."""
    emissivity: Annotated[float, Option(least=0.0, most=1.0)] = 0.3
    """Emissivity of the fins."""
    film_multiplier: Annotated[float, Option(above=0.0)] = 1.0
    """Factor on the convection of the fins; 1 is the value of the correlation."""
    contact: Annotated[float, Option(key="contact_m2K_W", unit="m^2 K/W", least=0.0)] = 0.0
    """Thermal resistance between body and fins."""

    def __post_init__(self) -> None:
        check_ranges(self, "sink")
        if self.fins > 1 and not self.gap > 0.0:
            raise InputError(
                found=(
                    f"the fins overlap: thickness_mm is {_mm(self.thickness)} and pitch_mm {_mm(self.pitch)}"
                ),
                expected="a pitch larger than the thickness",
                remedy="Widen the pitch, or use thinner fins",
            )

    @property
    def gap(self) -> float:
        """Return the free distance between two fins [m]."""
        return self.pitch - self.thickness

    @property
    def span(self) -> float:
        """Return the body length between the outer sides of the first and the last fin [m]."""
        return (self.fins - 1) * self.pitch + self.thickness

    def centres(self, body_length: float) -> FloatArray:
        """Return the axial positions of the centres of the fins [m], shape (fins,); the body begins at 0."""
        numbers = np.arange(self.fins, dtype=np.float64)
        return 0.5 * body_length + self.pitch * (numbers - 0.5 * (self.fins - 1))

    def tip_radius(self, body_diameter: float) -> float:
        return 0.5 * body_diameter + self.width

    def corrected_radius(self, body_diameter: float) -> float:
        """Return the corrected radius [m]: tip radius plus half the thickness.

        The two sides of a fin with this radius have as much area as the two sides and the tip of the fin.
        """
        return self.tip_radius(body_diameter) + 0.5 * self.thickness

    def fin_area(self, body_diameter: float) -> float:
        """Return the area of one fin [m^2]: two sides and tip, by the corrected radius."""
        return 2.0 * math.pi * (self.corrected_radius(body_diameter) ** 2 - 0.25 * body_diameter**2)

    def fin_volume(self, body_diameter: float) -> float:
        """Return the volume of one fin [m^3]."""
        return math.pi * self.thickness * (self.tip_radius(body_diameter) ** 2 - 0.25 * body_diameter**2)

    def mass(self, body_diameter: float) -> float:
        """Return the mass of all fins [kg]."""
        return self.fins * self.fin_volume(body_diameter) * self.material.density

    def groove_share(self, body_diameter: float, body_emissivity: float) -> float:
        """Return the effective emissivity of the walls between two fins [-].

        The walls are the facing sides of two fins and the body between the fins. With this emissivity, freely
        radiating walls lose as much heat as the groove loses through its opening. The emissivity inside the
        groove is the mean of fins and body, weighted by area.
        """
        root, tip = 0.5 * body_diameter, self.tip_radius(body_diameter)
        faces, floor = 2.0 * math.pi * (tip**2 - root**2), 2.0 * math.pi * root * self.gap
        opening = 2.0 * math.pi * tip * self.gap
        walls = faces + floor
        mean = (self.emissivity * faces + body_emissivity * floor) / walls
        if opening >= walls:  # The groove is so wide that its walls radiate directly to the surroundings.
            return mean
        return groove_emissivity(mean, opening, walls) * opening / walls


def _mm(length: float) -> str:
    return f"{1e3 * length:g}"
