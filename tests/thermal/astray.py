"""Dampers that deviate from their geometry file in all parameters, to test calibration and intervals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.model.network import NODE_FACTORS, ThermalNetwork, zone_network


def perturbed(base: DamperDrawing, rng: np.random.Generator) -> tuple[ThermalNetwork, float]:
    """Return the thermal network of a perturbed damper, and the factor between its true and stated power."""

    def factor(spread: float) -> float:
        return math.exp(spread * rng.standard_normal())

    given = base.calibration
    changed = replace(given, heat_capacity=given.heat_capacity * factor(0.08), film=given.film * factor(0.2))
    nodes = replace(
        NODE_FACTORS,
        fluid_wall=NODE_FACTORS.fluid_wall * factor(0.3),
        fluid_core=NODE_FACTORS.fluid_core * factor(0.3),
        coil=NODE_FACTORS.coil * factor(0.3),
    )
    around = replace(base.surroundings, emissivity=rng.uniform(0.15, 0.6))
    sink = base.sink and replace(base.sink, film_multiplier=base.sink.film_multiplier * factor(0.2))
    damper = replace(base, calibration=changed, surroundings=around, sink=sink)
    return zone_network(damper, nodes), factor(0.08)
