"""Search of heat sinks by NSGA-II (pymoo): the grid's cross-check, free of its steps.

The unknowns are the number of fins, width, thickness, pitch over the widest, material and finish, each
scaled to 0..1; mass is an objective, its limit and the least gap are constraints.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.operators.sampling.lhs import LHS
from pymoo.optimize import minimize

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.sinks.design import HeatedDamper, SinkDesign, SinkLimits, front_of

_THICKEST = 4.0  # of the least thickness
_LEAST_SHARE = 0.2  # of the greatest width, and of the widest pitch
_UNKNOWNS = 6


class SinkSearch(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Mass [kg] and temperature [K] of sinks, and by how much mass and gap miss their limits."""

    def __init__(self, damper: HeatedDamper, limits: SinkLimits) -> None:
        super().__init__(_UNKNOWNS, n_obj=2, n_ieq_constr=2, xl=np.zeros(_UNKNOWNS), xu=np.ones(_UNKNOWNS))
        self.damper, self.limits = damper, limits
        self.designs: list[SinkDesign] = []  # those that keep to the limits
        self._most = max(limits.most_fins(limits.least_thickness), 1)

    def _evaluate(self, units: FloatArray, out: dict[str, Any], *_: object, **__: object) -> None:
        judged = np.array([self._judge(self._sink(unit)) for unit in units])
        out["F"], out["G"] = judged[:, :2], judged[:, 2:]

    def _judge(self, sink: HeatSink) -> tuple[float, float, float, float]:
        limits, mass = self.limits, sink.mass(self.damper.diameter)
        too_heavy = mass / limits.mass - 1.0 if np.isfinite(limits.mass) else -1.0
        too_close = 1.0 - sink.gap / limits.least_gap if sink.fins > 1 else -1.0
        if limits.allow(sink, self.damper.diameter):
            try:
                self.designs.append(self.damper.evaluate(sink))
            except EnvelopeError:  # outside the range of a correlation
                pass
            else:
                return mass, self.designs[-1].fluid, too_heavy, too_close
        return mass, 1e3, max(too_heavy, 1e-9), too_close

    def _sink(self, unit: FloatArray) -> HeatSink:
        limits = self.limits
        count, wide, thick, full, solid, finish = (float(value) for value in unit)
        fins = 1 + min(int(count * self._most), self._most - 1)
        width = limits.width * (_LEAST_SHARE + (1.0 - _LEAST_SHARE) * wide)
        thickness = limits.least_thickness * (1.0 + (_THICKEST - 1.0) * thick)
        thickness = min(thickness, limits.span / (fins + 1))
        pitch = thickness + limits.least_gap
        if fins > 1:
            share = _LEAST_SHARE + (1.0 - _LEAST_SHARE) * full
            pitch = max(share * limits.widest_pitch(fins, width, thickness), thickness * (1.0 + 1e-6))
        return replace(
            self.damper.pattern,
            fins=fins,
            width=width,
            thickness=thickness,
            pitch=pitch,
            material=limits.materials[min(int(solid * len(limits.materials)), len(limits.materials) - 1)],
            emissivity=limits.emissivities[
                min(int(finish * len(limits.emissivities)), len(limits.emissivities) - 1)
            ],
        )


def search_freely(
    damper: HeatedDamper, limits: SinkLimits, *, population: int, generations: int, seed: int
) -> tuple[SinkDesign, ...]:
    """Return the front of all sinks that NSGA-II tried."""
    search = SinkSearch(damper, limits)
    minimize(search, NSGA2(pop_size=population, sampling=LHS()), ("n_gen", generations), seed=seed)
    return front_of(search.designs)
