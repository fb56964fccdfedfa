"""Dampers off their drawing in every way at once: what calibration and observer must cope with."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.thermal.drawing import DamperDrawing


def perturbed(base: DamperDrawing, rng: np.random.Generator) -> tuple[DamperDrawing, float]:
    """Return a damper off its drawing in every way at once, and the factor by which its power is off."""

    def factor(spread: float) -> float:
        return math.exp(spread * rng.standard_normal())

    given = base.calibration
    changed = replace(
        given,
        heat_capacity=given.heat_capacity * factor(0.08),
        film=given.film * factor(0.2),
        fluid_wall=given.fluid_wall * factor(0.3),
        fluid_core=given.fluid_core * factor(0.3),
        core_axial=given.core_axial * factor(0.3),
        coil=given.coil * factor(0.3),
    )
    around = replace(base.surroundings, emissivity=rng.uniform(0.15, 0.6))
    sink = base.sink and replace(base.sink, film_multiplier=base.sink.film_multiplier * factor(0.2))
    return replace(base, calibration=changed, surroundings=around, sink=sink), factor(0.08)
