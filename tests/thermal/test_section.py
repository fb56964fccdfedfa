"""The section of a damper has the volumes, areas and conductances computed by hand from the dimensions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import MATERIALS
from mrdamper.thermal.model.network import loss_grid
from mrdamper.thermal.model.section import Section, section_of
from mrdamper.thermal.model.surfaces import body_film, fin_films
from tests.thermal.bodies import draw_body

PAPER = read_drawing("paper")
FINNED = replace(
    PAPER,
    rod=replace(PAPER.rod, through=False, mount=0.3, material=MATERIALS["stainless-steel"]),
    piston=replace(PAPER.piston, material=MATERIALS["copper"]),
    coil=replace(PAPER.coil, length=0.03, depth=0.004),
    surroundings=replace(PAPER.surroundings, ambient=281.0, emissivity=0.6, mount=0.26, air_speed=1.2),
    sink=HeatSink(fins=4, width=0.02, thickness=2e-3, pitch=0.012, contact=2e-4, emissivity=0.4),
    calibration=replace(PAPER.calibration, heat_capacity=1.3, film=0.8),
)
DRAWINGS = [
    FINNED,
    replace(FINNED, rod=replace(FINNED.rod, through=True)),
    PAPER.with_sink(None),
    *(draw_body(seed).drawing for seed in (1, 5)),
]


def ring(inner: float, outer: float) -> float:
    return math.pi * (outer**2 - inner**2)


def area_of(section: Section, name: str) -> float:
    return sum(each.area for each in section.edges if section.surfaces[each.surface].name == name)


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_damper_outline_contains_all_cooled_areas(drawing: DamperDrawing):
    body, sink, around, section = drawing.body, drawing.sink, drawing.surroundings, section_of(drawing)
    outer, shaft = 0.5 * body.outer_diameter, 0.5 * drawing.rod.diameter
    through = drawing.rod.through
    assert area_of(section, "near cap") == pytest.approx(ring(shaft, outer))
    assert area_of(section, "far cap") == pytest.approx(ring(shaft if through else 0.0, outer))
    tube = 2.0 * math.pi * outer
    if sink is None:
        assert area_of(section, "bare") == pytest.approx(tube * body.length)
    else:
        tip = outer + sink.width
        assert area_of(section, "bare") == pytest.approx(tube * (body.length - sink.span))
        assert area_of(section, "floor") == pytest.approx(tube * sink.gap * (sink.fins - 1))
        assert area_of(section, "outside") == pytest.approx(2.0 * ring(outer, tip))
        assert area_of(section, "groove") == pytest.approx(2.0 * (sink.fins - 1) * ring(outer, tip))
        assert area_of(section, "rim") == pytest.approx(sink.fins * 2.0 * math.pi * tip * sink.thickness)
    taken = {name: 0.5 * around.mount for name in ("near cap", "far cap") if around.mount}
    if drawing.rod.mount:
        taken["rod end"] = drawing.rod.mount * (1 + through)
    mounted = {each.name: each.mount * area_of(section, each.name) for each in section.surfaces if each.mount}
    assert mounted == pytest.approx(taken)
    grid = loss_grid(around.ambient)
    bare, none = body_film(drawing, grid), np.zeros_like(grid)
    law_of = {"bare": bare, "near cap": bare, "far cap": bare, "rod end": none}
    shines = {**dict.fromkeys(("bare", "near cap", "far cap"), around.emissivity), "rod end": 0.0}
    paths = dict.fromkeys(law_of, "body")
    if sink is not None:
        films, share = fin_films(drawing, grid), sink.groove_share(body.outer_diameter, around.emissivity)
        law_of |= {"floor": films.floor, "groove": films.sides, "outside": films.sides, "rim": films.rim}
        shines |= {"floor": share, "groove": share, "outside": sink.emissivity, "rim": sink.emissivity}
        paths |= {"floor": "body", "groove": "fin", "outside": "fin", "rim": "fin"}
    for each in section.surfaces:
        assert section.films[each.law] == pytest.approx(law_of[each.name], rel=1e-12)
        assert each.emissivity == shines[each.name]
        ways = (each.convection_path, each.radiation_path)
        assert ways == (f"{paths[each.name]} convection", f"{paths[each.name]} radiation")
    ends = [(0.0, body.cap), (body.length - body.cap, body.length)][: 1 + through]
    assert [(each.inner, each.outer, each.low, each.high) for each in section.seals] == [
        (shaft, shaft, *end) for end in ends
    ]


@pytest.mark.parametrize(("width", "layer"), [(0.02, 0.5e-3), (0.003, 0.3e-3)])
def test_contact_resistance_equals_thin_layer(width: float, layer: float):
    """The layer is 0.5 mm thick, or thinner at narrow fins. Axially, the layer conducts like the fin."""
    assert FINNED.sink is not None
    section = section_of(FINNED.with_sink(replace(FINNED.sink, width=width)))
    feet = [each for each in section.blocks if section.regions[each.region].name == "fin feet"]
    foot, k = section.regions[feet[0].region], FINNED.sink.material.conductivity
    assert [each.outer - each.inner for each in feet] == pytest.approx([layer] * 4)
    assert layer / foot.conductivity_r == pytest.approx(FINNED.sink.contact + layer / k)
    assert (foot.conductivity_z, foot.part, len(feet)) == (k, "fins", 4)


def test_fully_finned_body_has_no_bare_surface():
    sink = HeatSink(fins=11, width=0.01, thickness=3e-3, pitch=0.0197)
    section = section_of(PAPER.with_sink(sink))
    assert area_of(section, "bare") == pytest.approx(0.0, abs=1e-12)
    assert min(each.low for each in section.blocks) >= 0.0
    assert max(each.high for each in section.blocks) <= PAPER.body.length
