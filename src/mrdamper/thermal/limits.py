"""Temperature limits of fluid, coil and rod seals.

Each limit applies to the hottest point of the part, not to the mean temperature. The limit of the fluid is
the upper end of its valid temperature range, or a value in the geometry file. The limits of coil and seals
follow from the insulation class and from the seal material, unless the geometry file has its own values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.materials import INSULATION_DEGC, SEALS_DEGC
from mrdamper.thermal.model.stepping import Part

PART_WORDS: Mapping[Part, str] = MappingProxyType({"gap": "fluid", "coil": "coil", "seal": "seals"})
"""Names of the parts in messages."""


@dataclass(frozen=True, slots=True)
class Limit:
    """The maximum permissible temperature of a part at its hottest point."""

    part: Part
    kelvin: float
    source: str  # description of the origin of the limit

    @property
    def celsius(self) -> float:
        return self.kelvin - ZERO_CELSIUS_K

    @property
    def name(self) -> str:
        return PART_WORDS[self.part]


@dataclass(frozen=True, slots=True)
class LimitReached:
    """A temperature limit of a part, its highest simulated temperature, and the time to the limit."""

    limit: Limit
    hottest: float  # highest temperature in the simulation [K]
    time_s: float | None  # None: the limit is not reached


def limits_of(drawing: DamperDrawing) -> tuple[Limit, ...]:
    """Return the limits of fluid, coil and seals of a geometry, in this order."""
    coil, seals = drawing.coil, drawing.seals
    by_class, by_material = INSULATION_DEGC[coil.insulation], SEALS_DEGC[seals.material]
    return (
        Limit("gap", drawing.filling.valid_K[1], f"of {drawing.filling.name}"),
        _limit("coil", coil.limit, by_class, f"of insulation class {coil.insulation}"),
        _limit("seal", seals.limit, by_material, f"of {seals.material}"),
    )


def _limit(part: Part, stated: float | None, usual_degC: float, source: str) -> Limit:
    if stated is not None:
        return Limit(part, stated, "of the drawing")
    return Limit(part, usual_degC + ZERO_CELSIUS_K, source)


def first_time(time: FloatArray, temperature: FloatArray, limit_K: float) -> float | None:
    """Return the first time [s] at which a temperature curve reaches a limit; None if it never does.

    The curve is interpolated by piecewise cubic Hermite interpolation (PCHIP).
    """
    above = np.flatnonzero(temperature >= limit_K)
    if not above.size:
        return None
    k = int(above[0])
    if k == 0:
        return float(time[0])
    course = PchipInterpolator(time, temperature)
    roots = np.asarray(course.solve(limit_K, extrapolate=False))
    roots = roots[(roots >= time[k - 1]) & (roots <= time[k])]
    return float(roots[0]) if roots.size else float(time[k])
