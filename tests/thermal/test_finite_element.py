"""The finite elements agree with closed forms, conserve energy, and converge in space and time."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import i0, i1, k0, k1

from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.finite_element import build_field, discretise
from mrdamper.thermal.model.heat_equation import simulate_field, steady_field
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.network import loss_grid, zone_network
from mrdamper.thermal.model.section import Block, Edge, Region, Section, Surface, section_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import cap_area
from mrdamper.thermal.model.transient import simulate_network
from tests.oracles.closed_form import heat_field, refined, with_constant_films
from tests.support.tiers import one_by_day

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
SINK = DRAWING.sink
assert SINK is not None
SLENDER = DRAWING.with_sink(replace(SINK, fins=8, thickness=1e-3, width=35e-3, pitch=11e-3))
AMBIENT = 293.15


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


def fading(kelvin):
    """Return a power that decreases with temperature, like the power of an MR damper."""
    return 95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - AMBIENT)


DUTY = Load(1800.0, fading, 16.8)


def of(course, name: str):
    """Return the temperature of fluid, coil or wall [K] by name."""
    return getattr(course, name)


def small_section(
    regions: tuple[Region, ...], blocks: tuple[Block, ...], edges: tuple[Edge, ...], film: float
) -> Section:
    """Return a section with one constant heat-transfer coefficient and without radiation."""
    grid = loss_grid(AMBIENT)
    surface = Surface("outside", 0, 0.0, 0.0, "body convection", "body radiation")
    return Section(regions, blocks, (surface,), edges, AMBIENT, grid, np.full((1, len(grid)), film))


def insulated(section: Section) -> Section:
    return replace(section, edges=())


# ----------------------------------------------------------------------------------------- closed forms


def test_insulated_finite_elements_warm_by_supplied_heat():
    """The temperature rise is the supplied heat divided by the heat capacity."""
    section = insulated(section_of(DRAWING))
    model = discretise(section, mesh_section(section, 0.016))
    course = simulate_field(model.equation, [Load(600.0, constant(80.0), 0.0)])
    rise = course.stored[-1] / section.heat_capacity
    assert rise == pytest.approx(80.0 * 600.0 / section.heat_capacity, rel=1e-9)
    # After the start, all locations warm at the same rate P/C.
    slope = np.diff(course.fluid[-2:]) / np.diff(course.time[-2:])
    assert slope == pytest.approx(80.0 / section.heat_capacity, rel=1e-3)


def test_heated_tube_has_logarithmic_temperature_profile():
    """The profile is a parabola in the heated core and a logarithm in the wall, within 1e-6 of the rise."""
    length, inner, middle, outer, k_core, k_wall, film, power = 0.01, 0.004, 0.01, 0.03, 3.0, 5.0, 40.0, 6.0
    regions = (Region("gap", "gap", k_core, k_core, 2e6), Region("wall", "wall", k_wall, k_wall, 3e6))
    blocks = (Block(0, inner, middle, 0.0, length), Block(1, middle, outer, 0.0, length))
    section = small_section(regions, blocks, (Edge(0, outer, outer, 0.0, length),), film)
    model = discretise(section, mesh_section(section, 0.0008))
    theta = steady_field(model.equation, Load(1.0, constant(power)))
    outside = power / (film * 2.0 * math.pi * outer * length)
    per_length = power / length
    at_middle = outside + per_length * math.log(outer / middle) / (2.0 * math.pi * k_wall)
    # The annulus is heated uniformly and insulated inside.
    heat = per_length / (math.pi * (middle**2 - inner**2))
    at_inner = at_middle + heat / (4.0 * k_core) * (
        middle**2 - inner**2 - 2.0 * inner**2 * math.log(middle / inner)
    )
    radius = model.nodes[:, 0]
    for r, expected in ((outer, outside), (middle, at_middle), (inner, at_inner)):
        found = theta[np.abs(radius - r) < 1e-12]
        assert found == pytest.approx(np.full(len(found), expected), rel=1e-6)


def test_annular_fin_elements_have_exact_efficiency():
    """The reference is the equation of Kern and Kraus (Bessel functions, insulated tip, thin fin)."""
    root, tip, thickness, k, film, power = 0.02, 0.05, 1e-3, 20.0, 60.0, 30.0
    regions = (Region("gap", "gap", 1e6, 1e6, 2e6), Region("fins", "fins", k, 1e5, 2e6))
    blocks = (Block(0, 0.015, root, 0.0, thickness), Block(1, root, tip, 0.0, thickness))
    faces = (Edge(0, root, tip, 0.0, 0.0), Edge(0, root, tip, thickness, thickness))
    section = small_section(regions, blocks, faces, film)
    model = discretise(section, mesh_section(section, 0.001))
    theta = steady_field(model.equation, Load(1.0, constant(power)))
    at_root = float(theta[np.abs(model.nodes[:, 0] - root) < 1e-12].mean())
    m = math.sqrt(2.0 * film / (k * thickness))
    a, b = m * root, m * tip
    exact = 2.0 * root / (m * (tip**2 - root**2))
    exact *= (k1(a) * i1(b) - i1(a) * k1(b)) / (i0(a) * k1(b) + k0(a) * i1(b))
    found = power / (film * 2.0 * math.pi * (tip**2 - root**2) * at_root)
    assert exact < 0.5
    assert found == pytest.approx(exact, rel=2e-6)


def test_perfect_conductor_warms_by_power_over_conductance():
    section = section_of(BARE)
    section = replace(
        with_constant_films(section, np.array([12.0])),
        regions=tuple(replace(each, conductivity_r=3e5, conductivity_z=3e5) for each in section.regions),
        surfaces=tuple(replace(each, emissivity=0.0, mount=0.0) for each in section.surfaces),
    )
    model = discretise(section, mesh_section(section, 0.016))
    area = sum(edge.area for edge in section.edges)
    theta = steady_field(model.equation, Load(1.0, constant(50.0)))
    assert model.equation.fluid @ theta == pytest.approx(50.0 / (12.0 * area), rel=1e-5)
    assert np.ptp(theta) < 5e-3


# ------------------------------------------------------------------------------- section, mesh, and areas


@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE, SLENDER]), ids=["paper", "bare", "slender"])
def test_finite_elements_have_heat_capacity_of_network(drawing: DamperDrawing):
    """Both models give the same total heat capacity.

    The network sums it over annular zones, the finite-element model over mesh elements.
    """
    model = build_field(drawing)
    expected = zone_network(drawing).total_capacity
    assert model.section.heat_capacity == pytest.approx(expected, rel=1e-12)
    assert float(model.equation.mass.sum()) == pytest.approx(expected, rel=1e-11)
    volumes = np.bincount(model.mesh.region, model.mesh.volumes())
    blocks = [(block.region, block.volume) for block in model.section.blocks]
    assert volumes == pytest.approx(np.bincount(*map(np.array, zip(*blocks, strict=True))), rel=1e-9)


def test_finite_element_surfaces_have_exact_areas():
    body, r = DRAWING.body, 0.5 * DRAWING.body.outer_diameter
    assert SINK is not None
    model = build_field(DRAWING)
    by_name = {surface.name: k for k, surface in enumerate(model.section.surfaces)}
    areas = np.bincount(model.mesh.surface, model.mesh.areas())
    face = math.pi * ((r + SINK.width) ** 2 - r**2)
    tips = SINK.fins * 2.0 * math.pi * (r + SINK.width) * SINK.thickness
    expected = {
        "bare": 2.0 * math.pi * r * (body.length - SINK.span),
        "near cap": cap_area(DRAWING, with_rod=True),
        "far cap": cap_area(DRAWING, with_rod=True),
        "floor": 2.0 * math.pi * r * (SINK.fins - 1) * SINK.gap,
        "groove": 2.0 * (SINK.fins - 1) * face,
        "outside": 2.0 * face,
        "rim": tips,
    }
    assert {name: areas[k] for name, k in by_name.items()} == pytest.approx(expected, rel=1e-9)
    points = np.bincount(model.surface, model.equation.area)
    assert points == pytest.approx(areas, rel=1e-12)


# -------------------------------------------------------------------------------- conservation, symmetry


@pytest.mark.system
@pytest.mark.parametrize("longest_step", [60.0, 20.0])
def test_finite_elements_conserve_energy_with_any_step(longest_step: float):
    loads = [Load(300.0, fading, 16.8), Load(200.0, constant(0.0)), Load(300.0, constant(150.0), 5.0)]
    course = heat_field(DRAWING, loads, size=0.05, longest_step=longest_step)[1]
    assert course.closure <= 1e-9
    assert course.energy_in[-1] == pytest.approx(course.energy_out[-1] + course.stored[-1], rel=1e-9)


@pytest.mark.system
def test_steady_heat_paths_sum_to_losses():
    model = build_field(DRAWING, size=0.05)
    course = simulate_field(model.equation, [DUTY], start=steady_field(model.equation, DUTY))
    lost = sum(float(watts[-1]) for watts in course.paths_W.values())
    assert lost == pytest.approx(float(course.mechanical_W[-1] + course.coil_W[-1]), rel=1e-8)
    assert course.fluid == pytest.approx(np.full(len(course.time), course.fluid[0]), abs=1e-6)
    assert all(float(watts[-1]) > 0.5 for watts in course.paths_W.values())


@pytest.mark.system
@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE, SLENDER]), ids=["paper", "bare", "slender"])
def test_symmetric_damper_has_symmetric_temperatures(drawing: DamperDrawing):
    model, course = heat_field(drawing, [DUTY])
    length = drawing.body.length
    key = np.round(model.nodes / 1e-9).astype(np.int64)
    mirrored = np.round((model.nodes * [1.0, -1.0] + [0.0, length]) / 1e-9).astype(np.int64)
    order, other = np.lexsort(key.T), np.lexsort(mirrored.T)
    assert np.abs(key[order] - mirrored[other]).max() <= 1
    field = course.state[-1]
    assert np.abs(field[order] - field[other]).max() < 1e-8


@pytest.mark.nightly
def test_contact_resistance_causes_temperature_drop():
    """The temperature difference is the heat flow times the contact resistance divided by the area."""
    assert SINK is not None
    contact = 4e-4
    with_it = DRAWING.with_sink(replace(SINK, contact=contact))
    model = build_field(with_it)
    theta = steady_field(model.equation, DUTY)
    regions = [region.name for region in model.section.regions]
    feet = regions.index("fin feet")
    layer = next(block for block in model.section.blocks if block.region == feet)
    r = model.nodes[:, 0]
    in_feet = np.unique(model.elements[model.mesh.region == feet])
    low, high = (
        float(theta[in_feet][np.abs(r[in_feet] - radius) < 1e-9].mean())
        for radius in (layer.outer, layer.inner)
    )
    course = simulate_field(model.equation, [DUTY], start=theta)
    through = float(course.paths_W["fin convection"][0] + course.paths_W["fin radiation"][0])
    area = 2.0 * math.pi * layer.inner * SINK.thickness * SINK.fins
    assert high - low == pytest.approx(through * contact / area, rel=0.06)
    assert model.equation.fluid @ theta > build_field(DRAWING).equation.fluid @ steady_field(
        build_field(DRAWING).equation, DUTY
    )


# ------------------------------------------------------------------------------ convergence of mesh and steps


def test_mesh_converges_with_third_order():
    """In a smooth problem, the error of a mean has order 3 or more with quadratic elements (4 in theory)."""
    regions = (Region("gap", "gap", 3.0, 3.0, 2e6),)
    section = small_section(
        regions, (Block(0, 0.005, 0.03, 0.0, 0.08),), (Edge(0, 0.03, 0.03, 0.0, 0.08),), 500.0
    )
    mesh = mesh_section(section, 0.08)
    found = []
    for _ in range(4):
        model = discretise(section, mesh)
        theta = steady_field(model.equation, Load(1.0, constant(40.0)))
        found.append(float(model.equation.fluid @ theta))
        mesh = refined(mesh)
    gaps = np.abs(np.diff(found))
    assert np.log2(gaps[:-1] / gaps[1:]).min() > 2.8


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", [DRAWING, BARE, SLENDER], ids=["paper", "bare", "slender"])
def test_mesh_error_is_below_50_millikelvin(drawing: DamperDrawing):
    """The error is largest in the gap, which conducts 1e4 times better along than across the thin layers."""
    section = section_of(drawing)
    fine = discretise(section, refined(mesh_section(section)))
    steps: dict[str, Any] = {"longest_step": 300.0, "first_step": 20.0}
    truth = simulate_field(fine.equation, [DUTY], **steps)
    course = simulate_field(build_field(drawing).equation, [DUTY], **steps)
    for name in ("fluid", "coil", "wall"):
        assert np.abs(of(course, name) - of(truth, name)).max() < 50e-3
    assert np.abs(course.hottest("gap") - truth.hottest("gap")).max() < 0.1


@pytest.mark.nightly
def test_finite_elements_are_accurate_with_minute_steps():
    model = build_field(BARE, size=0.04)
    course = simulate_field(model.equation, [DUTY], longest_step=60.0)
    truth = simulate_field(model.equation, [DUTY], longest_step=8.0, first_step=0.25)
    for name in ("fluid", "coil", "wall"):
        at_the_same = np.interp(course.time, truth.time, of(truth, name))
        late = course.time >= 60.0  # The fine simulation has too few points before 60 s.
        assert np.abs(of(course, name) - at_the_same)[late].max() < 50e-3


@pytest.mark.nightly
def test_finite_element_steps_converge_with_second_order():
    """The step is halved while the temperatures still change, after the transient of the first 300 s."""
    model = build_field(DRAWING, size=0.04)
    warm = simulate_field(model.equation, [Load(300.0, fading, 16.8)]).state[-1]
    ends = [
        simulate_field(
            model.equation, [Load(480.0, fading, 5.0)], start=warm, longest_step=step, first_step=step
        ).state[-1]
        for step in (40.0, 20.0, 10.0, 5.0)
    ]
    gaps = [float(np.abs(a - b).max()) for a, b in pairwise(ends)]
    assert np.log2(gaps[-2] / gaps[-1]) > 1.9


# ------------------------------------------------------------------------------------ other models and limits


@pytest.mark.nightly
def test_finite_elements_agree_with_thermal_network():
    """The network has ten nodes, the finite elements have thousands, for the same geometry."""
    course = heat_field(DRAWING, [DUTY])[1]
    network = simulate_network(zone_network(DRAWING), [DUTY])
    assert np.abs(course.fluid - np.interp(course.time, network.time, network.fluid)).max() < 3.0
    assert course.coil[-1] > course.fluid[-1] + 3.0 > course.wall[-1]


def test_finite_element_simulation_stops_at_limit():
    course = heat_field(BARE, [DUTY], size=0.016, stop_at=353.15)[1]
    assert course.stopped
    assert course.fluid[-1] == pytest.approx(353.15, abs=1e-4)
    assert course.closure <= 1e-9
