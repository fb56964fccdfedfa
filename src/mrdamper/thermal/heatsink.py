"""A heat sink: equal annular fins at equal pitch on a damper's body; its geometry, mass and radiation.

The sink is a value and knows nothing of temperatures; what it gives off is the business of ``surfaces``.
"Width" is the radial width of a fin: the paper's "outer diameter 23 mm" of both damper and fin can only be
the body's radius and the fin's width.
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

_LONGEST_mm = 10_000.0  # what is longer was written in another unit


def length_option(said: str, key: str, default_help: str = "") -> Option:
    """Return the option of a length [m] that is drawn in millimetres under ``key``."""
    return Option(said, key=key, unit="mm", above=0.0, most=_LONGEST_mm, default_help=default_help)


@dataclass(frozen=True, slots=True, kw_only=True)
class Manufacture:
    """What of a sink can be made, and what use makes of its gaps; lengths in metres."""

    least_thickness: Annotated[float, length_option("of a fin", "least_thickness_mm")] = 1e-3
    least_gap: Annotated[float, length_option("between two fins", "least_gap_mm")] = 3e-3
    tolerance: Annotated[
        float, Option("by which a gap may be narrower than drawn", key="tolerance_mm", unit="mm", least=0.0)
    ] = 0.0
    fouling: Annotated[
        float, Option("dirt on each face of a gap", key="fouling_mm", unit="mm", least=0.0)
    ] = 0.0

    def __post_init__(self) -> None:
        check_ranges(self, "manufacture")

    @property
    def closing(self) -> float:
        """By how much a gap is narrower in use than drawn [m]."""
        return self.tolerance + 2.0 * self.fouling


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatSink:
    """Annular fins on a body; lengths in metres."""

    fins: Annotated[int, Option("number of fins", least=1, most=10_000)]
    width: Annotated[float, length_option("radial, root to tip", "width_mm")]
    thickness: Annotated[float, length_option("of a fin", "thickness_mm")]
    pitch: Annotated[float, length_option("from fin to fin", "pitch_mm")]
    material: Annotated[Material, Option("of the fins", among=lambda: MATERIALS)] = MATERIALS[
        "aluminium-alloy"
    ]
    emissivity: Annotated[float, Option("of the fins", least=0.0, most=1.0)] = 0.3
    film_multiplier: Annotated[
        float, Option("on the fins' convection; 1 is the correlation as it stands", above=0.0)
    ] = 1.0
    contact: Annotated[
        float,
        Option("thermal resistance, body to fin", key="contact_m2K_W", unit="m^2 K/W", least=0.0),
    ] = 0.0

    def __post_init__(self) -> None:
        check_ranges(self, "sink")
        if self.fins > 1 and not self.gap > 0.0:
            raise InputError(
                found=(
                    f"the fins overlap: thickness_mm is {_mm(self.thickness)} and pitch_mm {_mm(self.pitch)}"
                ),
                expected="a pitch larger than the thickness",
                remedy="Widen the pitch, or take thinner fins",
            )

    @property
    def gap(self) -> float:
        """Free distance between two fins [m]."""
        return self.pitch - self.thickness

    @property
    def span(self) -> float:
        """Length of the body from the first fin's outer face to the last one's [m]."""
        return (self.fins - 1) * self.pitch + self.thickness

    def centres(self, body_length: float) -> FloatArray:
        """Return the axial positions of the fins' middles on a body that starts at 0 [m], shape (fins,)."""
        numbers = np.arange(self.fins, dtype=np.float64)
        return 0.5 * body_length + self.pitch * (numbers - 0.5 * (self.fins - 1))

    def tip_radius(self, body_diameter: float) -> float:
        return 0.5 * body_diameter + self.width

    def corrected_radius(self, body_diameter: float) -> float:
        """Return the radius [m] with which two faces alone stand for faces and tip: r2 + t/2."""
        return self.tip_radius(body_diameter) + 0.5 * self.thickness

    def fin_area(self, body_diameter: float) -> float:
        """Return the area of one fin that gives off heat [m^2]: both faces and the tip (corrected radius)."""
        return 2.0 * math.pi * (self.corrected_radius(body_diameter) ** 2 - 0.25 * body_diameter**2)

    def fin_volume(self, body_diameter: float) -> float:
        """Return the volume of one fin [m^3]."""
        return math.pi * self.thickness * (self.tip_radius(body_diameter) ** 2 - 0.25 * body_diameter**2)

    def mass(self, body_diameter: float) -> float:
        """Return the mass of all fins [kg]."""
        return self.fins * self.fin_volume(body_diameter) * self.material.density

    def groove_share(self, body_diameter: float, body_emissivity: float) -> float:
        """Return the radiation of a groove per area of its walls, as an emissivity [-].

        The apparent emissivity of the opening times opening over walls. The groove's walls are two fin faces
        and the body between them; their emissivity is the mean of fins' and body's by area.
        """
        root, tip = 0.5 * body_diameter, self.tip_radius(body_diameter)
        faces, floor = 2.0 * math.pi * (tip**2 - root**2), 2.0 * math.pi * root * self.gap
        opening = 2.0 * math.pi * tip * self.gap
        walls = faces + floor
        mean = (self.emissivity * faces + body_emissivity * floor) / walls
        if opening >= walls:  # a groove wider than it is deep: its walls see the surroundings
            return mean
        return groove_emissivity(mean, opening, walls) * opening / walls


def _mm(length: float) -> str:
    return f"{1e3 * length:g}"
