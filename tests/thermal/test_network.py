"""The thermal network agrees with closed forms, conserves energy, converges, and is symmetric."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson, quad, simpson

from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films.correlations import annular_fin_efficiency
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import MATERIALS
from mrdamper.thermal.model import network as network_module
from mrdamper.thermal.model import surfaces
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.lumped import lumped_network
from mrdamper.thermal.model.network import (
    NODE_FACTORS,
    PATHS,
    NodeFactors,
    ThermalNetwork,
    loss_grid,
    zone_network,
)
from mrdamper.thermal.model.stepping import Load, rosenbrock_step
from mrdamper.thermal.model.transient import NetworkSystem, simulate_network
from tests.oracles.closed_form import constant_heating
from tests.thermal.bodies import draw_body

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
AMBIENT = 293.15


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


def fading(kelvin):
    """Return a power that decreases with temperature, like the power of an MR damper."""
    return 75.0 - 0.2 * (kelvin - AMBIENT)


DUTY = Load(1800.0, fading, 16.8)


def one_node(*, capacity: float = 1000.0, conductance: float = 0.5) -> ThermalNetwork:
    one, grid = np.ones(1), loss_grid(AMBIENT)
    return ThermalNetwork(
        model="lumped", names=("damper",), capacity=capacity * one, conductance=np.zeros((1, 1)),
        mechanical=one, electrical=one, fluid=one, coil=one, wall=one, ambient=AMBIENT, grid=grid,
        loss_node=(0,), loss_path=("mount",), watts=conductance * (grid - AMBIENT)[None],
    )  # fmt: skip


def steady_state(network: ThermalNetwork, load: Load) -> np.ndarray:
    """Return the steady temperatures of a load [K], from long steps of the L-stable method."""
    run = simulate_network(network, [replace(load, duration=1e7)], longest_step=1e5)
    return np.asarray(run.temperature[-1])


def without_losses(network: ThermalNetwork) -> ThermalNetwork:
    return replace(network, watts=np.zeros_like(network.watts))


# ----------------------------------------------------------------------------------------------- closed forms


def test_insulated_network_warms_by_supplied_heat():
    """The mean temperature rise is the supplied heat divided by the heat capacity, within 1e-6."""
    for drawing in (BARE, DRAWING):
        network = without_losses(zone_network(drawing))
        heated = simulate_network(network, [Load(600.0, constant(90.0))])
        mean = heated.temperature[-1] @ network.capacity / network.total_capacity
        assert mean - AMBIENT == pytest.approx(90.0 * 600.0 / network.total_capacity, rel=1e-6)
        # Finally, all nodes warm at the same rate.
        late = simulate_network(network, [Load(1800.0, constant(90.0))])
        rate = (late.temperature[-1] - late.temperature[-2]) / (late.time[-1] - late.time[-2])
        assert rate == pytest.approx(90.0 / network.total_capacity, rel=1e-6)


def test_steady_network_rise_is_power_over_conductance():
    ends = steady_state(one_node(), Load(1.0, constant(50.0)))
    assert ends[0] - AMBIENT == pytest.approx(50.0 / 0.5, rel=1e-6)


def test_single_thermal_node_agrees_with_formula():
    heated = simulate_network(one_node(), [Load(1800.0, constant(50.0))], longest_step=1.0)
    exact = constant_heating(heated.time, 50.0, 0.5, 1000.0, ambient=AMBIENT, start=AMBIENT)
    assert heated.fluid - AMBIENT == pytest.approx(exact - AMBIENT, rel=1e-6, abs=1e-9)


def test_fin_node_has_exact_heat_flow(monkeypatch):
    """With constant heat transfer and without radiation, the heat flow from body to fin is exact.

    This includes fins with contact resistance.
    """
    film = 14.0
    for module in (network_module, surfaces):
        monkeypatch.setattr(module, "fin_film", lambda _, kelvin: np.full(np.shape(kelvin), film))
    for contact in (0.0, 2e-4):
        sink = HeatSink(fins=1, width=0.03, thickness=1e-3, pitch=0.02, emissivity=0.0, contact=contact)
        network = zone_network(BARE.with_sink(sink), replace(NODE_FACTORS, fin_root=1.0))
        ends = dict(zip(network.names, steady_state(network, DUTY), strict=True))
        area = sink.fin_area(0.046)
        efficiency = float(
            annular_fin_efficiency(
                film, 0.023, sink.corrected_radius(0.046), 1e-3, sink.material.conductivity
            )
        )
        ideal = film * area * efficiency
        resistance = 1.0 / ideal + contact / (np.pi * 0.046 * 1e-3)
        given_off = film * area * (ends["fins 1"] - AMBIENT)
        assert given_off == pytest.approx((ends["wall 1"] - AMBIENT) / resistance, rel=1e-6)


def shell(inner: float, outer: float, conductivity: float, length: float) -> float:
    """Return the radial thermal resistance of an annulus [K/W], summed over thin rings."""
    return quad(lambda r: 1.0 / (2.0 * np.pi * r * conductivity * length), inner, outer)[0]


def heated(inner: float, outer: float, conductivity: float, length: float, *, cooled_outside: bool) -> float:
    """Return the resistance [K/W] between the mean of a uniformly heated annulus and its cooled face.

    The other face is insulated. The heat generated between the insulated face and a radius flows through this
    radius. The mean is weighted by area.
    """
    radius = np.linspace(inner, outer, 4001)
    passing = radius**2 - inner**2 if cooled_outside else outer**2 - radius**2
    slope = np.zeros_like(radius)
    np.divide(passing, radius, out=slope, where=radius > 0.0)
    above = cumulative_simpson(slope / (outer**2 - inner**2), x=radius, initial=0.0)
    above = above[-1] - above if cooled_outside else above
    mean = simpson(above * radius, x=radius) / (0.5 * (outer**2 - inner**2))
    return float(mean / (2.0 * np.pi * conductivity * length))


@pytest.mark.parametrize("through", [True, False])
def test_network_conductances_agree_with_quadrature(through):
    """Radial resistances are integrated over thin rings. A heated layer has a third of its resistance."""
    factors = NodeFactors(fluid_wall=1.3, fluid_core=0.8, coil=1.4, fin_root=1.7)
    sink = HeatSink(fins=3, width=0.02, thickness=2e-3, pitch=0.01, contact=1e-4)
    drawing = replace(
        BARE, rod=replace(BARE.rod, through=through, material=MATERIALS["stainless-steel"]), sink=sink
    )
    network, conducts = zone_network(drawing, factors), drawing.fluid_heat
    bore, outer, face, long, room, cap = 0.018, 0.023, 0.017, 0.070, 0.060, 0.005
    rod, tube, iron = (each.material.conductivity for each in (drawing.rod, drawing.body, drawing.piston))
    wound, winding, root = drawing.coil.length, drawing.coil.material.conductivity, face - drawing.coil.depth
    middle, half = 0.5 * (face + bore), face - 0.5 * drawing.coil.depth

    def ring(inner: float, outside: float) -> float:
        return np.pi * (outside**2 - inner**2)

    into_wall, gap = shell(bore, 0.5 * (bore + outer), tube, 1.0), (conducts.gap, 1.0)
    outer_half, inner_half = shell(middle, bore, *gap) / 3.0, shell(face, middle, *gap) / 3.0
    solid = [heated(0.0, 1.0, k, 1.0, cooled_outside=True) for k in (rod, iron)]
    expected = {
        ("fluid 1", "wall 1"): factors.fluid_wall * long / (outer_half + into_wall),
        ("core 1", "fluid 1"): factors.fluid_core * (long - wound) / (inner_half + solid[1]),
        ("coil", "fluid 1"): factors.coil * wound / (inner_half + shell(half, face, winding, 1.0) / 3.0),
        ("coil", "core 1"): factors.coil
        * (wound / (shell(root, half, winding, 1.0) / 3.0) + 2.0 * ring(root, face) * winding * 6.0 / wound),
        ("fins 1", "wall 1"): 3.0 * factors.fin_root * network_module.fin_root_conductance(drawing, sink),
    }
    for zone in (0, 2):
        shaft = 0.007 if through or zone == 0 else 0.0
        fluid, core, wall = f"fluid {zone}", f"core {zone}", f"wall {zone}"
        into_tube = heated(shaft, bore, conducts.chamber, room, cooled_outside=True) + into_wall / room
        into_cap = room / (6.0 * conducts.chamber) + 0.5 * cap / tube
        expected[fluid, wall] = factors.fluid_wall * (1.0 / into_tube + ring(shaft, bore) / into_cap)
        expected["wall 1", wall] = tube * ring(bore, outer) / (0.5 * (room + long))
        expected["fluid 1", fluid] = conducts.exchange
        along_iron = 0.5 * long / iron
        end = room / (6.0 * conducts.chamber) + along_iron
        expected["core 1", fluid] = factors.fluid_core * ring(shaft, face) / end
        if shaft:
            inwards = heated(shaft, bore, conducts.chamber, room, cooled_outside=False) + solid[0] / room
            expected[core, fluid] = factors.fluid_core / inwards
            expected[core, wall] = rod * ring(0.0, shaft) / (0.5 * room)
            along = 0.5 * room / (rod * ring(0.0, shaft)) + along_iron / ring(0.0, face)
            expected["core 1", core] = 1.0 / along
    found = {
        tuple(sorted((network.names[i], network.names[j]))): network.conductance[i, j]
        for i, j in zip(*np.nonzero(np.triu(network.conductance)), strict=True)
    }
    wanted = {tuple(sorted(pair)): value for pair, value in expected.items()}
    assert found.keys() == wanted.keys()
    assert [found[pair] for pair in wanted] == pytest.approx(list(wanted.values()), rel=1e-6)


UPRIGHT = replace(
    DRAWING,
    body=replace(DRAWING.body, orientation="vertical"),
    sink=HeatSink(fins=3, width=0.02, thickness=1e-3, pitch=0.02),
)


@pytest.mark.parametrize("drawing", [*(draw_body(seed).drawing for seed in (1, 5, 11)), UPRIGHT])
def test_network_and_finite_elements_have_equal_losses(drawing):
    """The losses of each heat path agree at any temperature. A corrected fin radius represents the rim."""
    network, model = zone_network(drawing), build_field(drawing, size=0.05)
    equation = model.equation
    for kelvin in network.grid[[60, 90, 140]]:
        theta = np.full(len(equation.area), kelvin - network.ambient)
        by_path = equation.cooling.by_path(equation.cooling.fluxes(theta)[0], equation.area)
        at = int(np.argmin(np.abs(network.grid - kelvin)))
        ours = [
            sum(row[at] for row, other in zip(network.watts, network.loss_path, strict=True) if other == path)
            for path in PATHS
        ]
        rel = np.array([5e-3 if path == "fin convection" else 1e-9 for path in PATHS])
        assert np.all(np.abs(ours - by_path) <= rel * np.abs(by_path) + 1e-9)


@pytest.mark.parametrize("through", [True, False])
def test_mount_heat_divides_between_rod_and_cap(through):
    """The heat flow to the mount is divided between rod and cap in proportion to their conductances."""
    held = replace(BARE, rod=replace(BARE.rod, through=through, mount=1e-6))
    network = zone_network(replace(held, surroundings=replace(BARE.surroundings, mount=0.0)))
    excess = float(network.grid[-1] - AMBIENT)
    taken = {
        network.names[node]: row[-1] / excess
        for node, row, path in zip(network.loss_node, network.watts, network.loss_path, strict=True)
        if path == "mount"
    }
    assert sum(taken.values()) == pytest.approx(1e-6 * (2 if through else 1), rel=1e-5)
    along = held.rod.material.conductivity * np.pi * 0.007**2 / (0.5 * 0.060 + 0.005)
    across = 1.0 / shell(0.007, 0.018, held.body.material.conductivity, 0.005)
    assert taken["core 0"] / taken["wall 0"] == pytest.approx(along / across, rel=1e-6)


# ------------------------------------------------------------------------------------ conservation and order


@given(
    fins=st.integers(0, 8),
    width=st.floats(0.008, 0.035),
    air=st.floats(0.0, 4.0).map(lambda speed: 0.0 if speed < 0.01 else speed),
    step=st.sampled_from([5.0, 60.0, 600.0]),
    start=st.floats(-20.0, 60.0),
    model=st.sampled_from([zone_network, lumped_network]),
)
def test_network_conserves_energy_for_any_design(fins, width, air, step, start, model):
    sink = None if fins == 0 else HeatSink(fins=fins, width=width, thickness=2e-3, pitch=0.02)
    drawing = replace(BARE.with_sink(sink), surroundings=replace(BARE.surroundings, air_speed=air))
    heated = simulate_network(model(drawing), [DUTY], longest_step=step, start=AMBIENT + start)
    assert heated.closure <= 1e-9
    assert heated.energy_in[-1] > 0.0


def test_network_steps_converge_with_second_order():
    """Halving the step divides the error by about four (observed order 1.9 or more)."""
    network = zone_network(DRAWING)
    # The simulation begins after the initial transient.
    warm = simulate_network(network, [Load(120.0, fading, 16.8)], longest_step=1.0).temperature[-1]
    load = [Load(960.0, fading, 16.8)]
    exact = simulate_network(network, load, start=warm, longest_step=0.25).fluid[-1]
    errors = []
    for step in (16.0, 8.0, 4.0):
        # Loads of one step each give equal steps because a simulation increases its steps within a load.
        pieces = [Load(step, fading, 16.8)] * round(960.0 / step)
        state = warm
        heated = heat_up_evenly(network, pieces, state)
        errors.append(abs(heated - exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders.min() >= 1.9


def heat_up_evenly(network: ThermalNetwork, loads: list[Load], start):
    """Return the fluid temperature after equal steps, one step per load."""
    system = NetworkSystem(network)
    system.take(loads[0])
    state = np.concatenate([start, np.zeros(system.columns)])
    for load in loads:
        state = rosenbrock_step(system, state, load.duration)
    return system.fluid(state)


@pytest.mark.system
def test_thermal_network_is_accurate_with_minute_steps():
    for drawing in (BARE, DRAWING):
        network = zone_network(drawing)
        coarse, fine = simulate_network(network, [DUTY]), simulate_network(network, [DUTY], longest_step=0.5)
        seen = np.interp(coarse.time, fine.time, fine.fluid)
        assert np.abs(coarse.fluid - seen).max() < 0.01


# ---------------------------------------------------------------------------------------- symmetry and masses


def test_through_rod_network_is_symmetric():
    for drawing in (BARE, DRAWING):
        network = zone_network(drawing)
        ends = dict(zip(network.names, simulate_network(network, [DUTY]).temperature[-1], strict=True))
        for part in ("core", "fluid", "wall"):
            assert ends[f"{part} 0"] == pytest.approx(ends[f"{part} 2"], rel=1e-12)


def test_network_heat_capacity_equals_hand_calculation():
    """The reference adds the heat capacities of tube, caps, piston, rod, copper, potting and fluid."""
    drawing = replace(BARE, calibration=replace(BARE.calibration, heat_capacity=1.0))
    ring = lambda a, b: np.pi / 4.0 * (b**2 - a**2)  # noqa: E731
    steel = ring(36, 46) * 200 + 2 * ring(14, 36) * 5  # mm^3
    steel += ring(0, 14) * 200 + ring(14, 34) * 70
    coil = ring(26, 34) * 20
    fluid = ring(14, 36) * 120 + ring(34, 36) * 70
    by_hand = ((steel - coil) * 7850 * 470 + coil * 5860 * 470 + fluid * 2300 * 800) * 1e-9
    assert zone_network(drawing).total_capacity == pytest.approx(by_hand, rel=1e-9)
