"""What a damper's parts bear: the fluid at the gap's hottest point, the coil's insulation, the rod's seals.

Each limit holds at the hottest point of its part, not at its mean. The fluid's is the upper end of its
record's validity, or the drawing's; those of coil and seals go by the class and the material in the drawing.
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
"""What the limit of a part is called."""


@dataclass(frozen=True, slots=True)
class Limit:
    """The temperature that a part bears at its hottest point."""

    part: Part
    kelvin: float
    source: str  # in words

    @property
    def celsius(self) -> float:
        return self.kelvin - ZERO_CELSIUS_K

    @property
    def name(self) -> str:
        return PART_WORDS[self.part]


@dataclass(frozen=True, slots=True)
class LimitReached:
    """A limit, how hot the part got, and when it reached the limit."""

    limit: Limit
    hottest: float  # [K]
    time_s: float | None  # None: not reached


def limits_of(drawing: DamperDrawing) -> tuple[Limit, ...]:
    """Return the limits of a drawing's fluid, coil and seals."""
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
    """Return when a curve first reaches a limit [s], by monotone cubics; None: never."""
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
