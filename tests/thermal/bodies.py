"""Random dampers of many shapes, one for each seed.

Model constants were chosen with even seeds, and tests use odd seeds. ``python -m tests.thermal.bodies 50``
prints the errors of the reduced model compared with the finite elements.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

from mrdamper.thermal.drawing import (
    Body,
    Coil,
    DamperDrawing,
    Piston,
    Rod,
    Surroundings,
    find_filling,
)
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import MATERIALS
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.stirring import Stroke

HALF_HOUR_S = 1800.0
_SHORTEST_GAP = 0.003


@dataclass(frozen=True)
class HeatedBody:
    """A damper and its thermal load, which lasts half an hour."""

    drawing: DamperDrawing
    load: Load


def draw_body(seed: int) -> HeatedBody:
    """Return a random damper with up to 15 fins, and its thermal load.

    The diameter is 32 to 80 mm and the length 120 to 320 mm. At constant power, the load would heat the
    insulated damper by 40 to 130 K.
    """
    rng = np.random.default_rng(seed)
    outer, length = rng.uniform(0.032, 0.080), rng.uniform(0.120, 0.320)
    wall = outer * rng.uniform(0.06, 0.12)
    bore = outer - 2.0 * wall
    rod = bore * rng.uniform(0.30, 0.45)
    gap = rng.uniform(0.0007, 0.0020)
    piston = Piston(bore - 2.0 * gap, length * rng.uniform(0.20, 0.35))
    material = MATERIALS[str(rng.choice(["steel", "stainless-steel", "aluminium-alloy"]))]
    fins, speed = int(rng.integers(0, 16)), float(rng.choice([0.0, rng.uniform(0.5, 5.0)]))
    drawing = DamperDrawing(
        name=f"body {seed}",
        body=Body(outer, length, wall, material=material),
        piston=piston,
        rod=Rod(rod, through=bool(rng.integers(0, 2))),
        coil=Coil(4.0, piston.length * rng.uniform(0.2, 0.5)),
        filling=find_filling(str(rng.choice(["paper", "lord-mrf-132dg"]))),
        surroundings=Surroundings(
            rng.uniform(263.15, 318.15), speed, rng.uniform(0.1, 0.9), rng.uniform(0.0, 0.3)
        ),
        sink=_draw_sink(rng, fins, outer, length),
        stroke=Stroke(rng.uniform(0.002, 0.030), rng.uniform(0.5, 8.0)),
    )
    rise = rng.uniform(40.0, 130.0)
    watts = section_of(drawing).heat_capacity * rise / HALF_HOUR_S
    fall, coil_W = rng.uniform(0.0, 0.004), rng.uniform(0.0, 0.15) * watts
    ambient = drawing.surroundings.ambient

    def power(kelvin):
        return watts * np.maximum(1.0 - fall * (kelvin - ambient), 0.2)

    return HeatedBody(drawing, Load(HALF_HOUR_S, power, float(coil_W)))


def _draw_sink(rng: np.random.Generator, fins: int, outer: float, length: float) -> HeatSink | None:
    width, thickness = rng.uniform(0.15, 0.5) * outer, rng.uniform(0.001, 0.003)
    share, contact = rng.uniform(0.3, 0.9), float(rng.choice([0.0, rng.uniform(0.0, 1e-4)]))
    fins = min(fins, int((share * length - thickness) / (_SHORTEST_GAP + thickness)) + 1)
    if fins < 1:
        return None
    pitch = (share * length - thickness) / max(fins - 1, 1)
    return HeatSink(fins=fins, width=width, thickness=thickness, pitch=pitch, contact=contact)


@dataclass(frozen=True)
class BodyScore:
    """Largest errors of the reduced model against the finite elements [mK], and its CPU time [s]."""

    fluid: float
    gap: float
    coil: float
    cpu_s: float


def score_body(seed: int) -> BodyScore:
    """Return the errors and the CPU time of the reduced model, built for a body and run for half an hour."""
    body = draw_body(seed)
    started = time.process_time()
    model = build_field(body.drawing)
    small = simulate_field(reduce_field(model).equation, [body.load])
    spent = time.process_time() - started
    full = simulate_field(model.equation, [body.load])
    off = [
        1e3 * float(np.abs(one - other).max())
        for one, other in (
            (small.fluid, full.fluid), (small.hottest("gap"), full.hottest("gap")),
            (small.hottest("coil"), full.hottest("coil")),
        )
    ]  # fmt: skip
    return BodyScore(off[0], off[1], off[2], spent)


def odd_bodies(count: int) -> list[int]:
    """Return the first odd seeds. Constants of the models were chosen with even seeds."""
    return [2 * k + 1 for k in range(count)]


if __name__ == "__main__":
    scores = np.array([tuple(vars(score_body(seed)).values()) for seed in odd_bodies(int(sys.argv[1]))])
    for name, column in zip(("fluid mK", "hot gap mK", "hot coil mK", "CPU s"), scores.T, strict=True):
        print(f"{name}: median {np.median(column):.3g}, worst {column.max():.3g}")
