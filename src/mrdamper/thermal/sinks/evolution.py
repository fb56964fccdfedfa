"""Search of heat sinks by NSGA-II (pymoo, extra ``[genetic]``): the grid's cross-check, free of its steps.

The unknowns are the number of fins, width, thickness, pitch over the widest, material and finish, each
scaled to 0..1; mass is an objective, its limit and the least gap are constraints.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError, MissingExtraError
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    Memory,
    SinkDesign,
    SinkFront,
    SinkLimits,
    evaluate_all,
    front_of,
)

_THICKEST = 4.0  # of the least thickness
_LEAST_SHARE = 0.2  # of the greatest width, and of the widest pitch
_UNKNOWNS = 6


def search_genetic(
    damper: HeatedDamper,
    limits: SinkLimits,
    *,
    population: int = 40,
    generations: int = 40,
    seed: int = 0,
    on_progress: Progress = silent,
    memory: Memory | None = None,
) -> SinkFront:
    """Return the front of all sinks that NSGA-II tried; the same seed gives the same front.

    With a ``memory`` a search that was killed is gone through again, each generation's temperatures recalled.

    Raises
    ------
    MissingExtraError
        pymoo is not installed.
    InputError
        No sink that was tried keeps to the limits.
    """
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
        from pymoo.operators.sampling.lhs import LHS
    except ImportError as error:
        raise MissingExtraError.of("NSGA-II", "pymoo", "genetic") from error
    clock = time.process_time()
    tried = _Tried(damper, limits, memory)

    class Search(Problem):  # type: ignore[misc]  # pymoo is not typed
        def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: object, **__: object) -> None:
            judged = tried.judge(x)
            out["F"], out["G"] = judged[:, :2], judged[:, 2:]

    search = Search(n_var=_UNKNOWNS, n_obj=2, n_ieq_constr=2, xl=np.zeros(_UNKNOWNS), xu=np.ones(_UNKNOWNS))
    algorithm = NSGA2(pop_size=population, sampling=LHS())
    algorithm.setup(search, termination=("n_gen", generations), seed=seed)
    while algorithm.has_next():
        on_progress(ProgressUpdate(done=len(tried.designs), total=population * generations, text="NSGA-II"))
        algorithm.next()
    if not tried.designs:
        raise InputError(
            place="sink limits",
            found=(
                f"none of {population * generations} sinks keeps to them; raise the mass or lower the least "
                "thickness"
            ),
        )
    return SinkFront(
        front_of(tried.designs),
        len(tried.designs) + tried.outside,
        tried.outside,
        "nsga2",
        time.process_time() - clock,
    )


class _Tried:
    """What NSGA-II has asked for: admissible designs are kept, the others counted."""

    def __init__(self, damper: HeatedDamper, limits: SinkLimits, memory: Memory | None) -> None:
        self.damper, self.limits, self._memory = damper, limits, memory
        self.designs: list[SinkDesign] = []
        self.outside = 0
        self._generation = 0
        self._most = max(limits.most_fins(limits.least_thickness), 1)

    def judge(self, units: FloatArray) -> FloatArray:
        """Return mass [kg], temperature [K], and by how much the mass and the gap miss their limits.

        One row for each candidate of a generation, shape (count, 6) -> (count, 4).
        """
        limits, diameter = self.limits, self.damper.diameter
        sinks = [self._sink(unit) for unit in units]
        allowed = [sink for sink in sinks if limits.allow(sink, diameter)]
        tried = evaluate_all(self.damper, allowed, f"nsga2 generation {self._generation}", self._memory)
        self._generation += 1
        self.outside += sum(design is None for design in tried)
        known = iter(tried)
        rows = []
        for sink in sinks:
            mass = sink.mass(diameter)
            too_heavy = mass / limits.mass - 1.0 if np.isfinite(limits.mass) else -1.0
            too_close = 1.0 - sink.gap / limits.least_gap if sink.fins > 1 else -1.0
            design = next(known) if limits.allow(sink, diameter) else None
            if design is None:
                rows.append((mass, 1e3, max(too_heavy, 1e-9), too_close))
                continue
            self.designs.append(design)
            rows.append((mass, design.fluid, too_heavy, too_close))
        return np.array(rows)

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
