"""The network through time: limits in closed form, conservation, order, symmetry, and what cools better."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_bvp

from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films.correlations import annular_fin_efficiency
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model import network as network_module
from mrdamper.thermal.model.lumped import lumped_network
from mrdamper.thermal.model.network import (
    ThermalNetwork,
    _from_mean,
    _to_inner_from_mean,
    loss_grid,
    zone_network,
)
from mrdamper.thermal.model.stepping import Load, rosenbrock_step
from mrdamper.thermal.model.transient import NetworkSystem, simulate_network, steady_state
from tests.oracles.closed_form import constant_heating

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
AMBIENT = 293.15


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


def fading(kelvin):
    """Power that falls with warmth, as an MR damper's does."""
    return 75.0 - 0.2 * (kelvin - AMBIENT)


DUTY = Load(1800.0, fading, 16.8)


def one_node(*, capacity: float = 1000.0, conductance: float = 0.5) -> ThermalNetwork:
    one, grid = np.ones(1), loss_grid(AMBIENT)
    return ThermalNetwork(
        model="lumped", names=("damper",), capacity=capacity * one, conductance=np.zeros((1, 1)),
        mechanical=one, electrical=one, fluid=one, coil=one, wall=one, ambient=AMBIENT, grid=grid,
        loss_node=(0,), loss_path=("mount",), watts=conductance * (grid - AMBIENT)[None],
    )  # fmt: skip


def without_losses(network: ThermalNetwork) -> ThermalNetwork:
    return replace(network, watts=np.zeros_like(network.watts))


# ------------------------------------------------------------------------------------------------- limits


def test_without_losses_it_warms_by_power_over_capacity():
    """All nodes together: 1e-6, whatever goes on between them."""
    for drawing in (BARE, DRAWING):
        network = without_losses(zone_network(drawing))
        heated = simulate_network(network, [Load(600.0, constant(90.0))])
        mean = heated.temperature[-1] @ network.capacity / network.total_capacity
        assert mean - AMBIENT == pytest.approx(90.0 * 600.0 / network.total_capacity, rel=1e-6)
        # and once the inner differences have settled, every node at that rate
        late = simulate_network(network, [Load(1800.0, constant(90.0))])
        rate = (late.temperature[-1] - late.temperature[-2]) / (late.time[-1] - late.time[-2])
        assert rate == pytest.approx(90.0 / network.total_capacity, rel=1e-6)


def test_with_constant_losses_it_ends_at_power_over_conductance():
    ends = steady_state(one_node(), Load(1.0, constant(50.0)))
    assert ends[0] - AMBIENT == pytest.approx(50.0 / 0.5, rel=1e-6)


def test_a_constant_body_follows_the_closed_form():
    heated = simulate_network(one_node(), [Load(1800.0, constant(50.0))], longest_step=1.0)
    exact = constant_heating(heated.time, 50.0, 0.5, 1000.0, ambient=AMBIENT, start=AMBIENT)
    assert heated.fluid - AMBIENT == pytest.approx(exact - AMBIENT, rel=1e-6, abs=1e-9)


def test_the_closed_form_without_losses_is_a_straight_line_and_starts_anywhere():
    seconds = np.array([0.0, 10.0, 1000.0])
    line = constant_heating(seconds, 50.0, 0.0, 1000.0, ambient=AMBIENT, start=300.0)
    assert line == pytest.approx(300.0 + 0.05 * seconds)
    cooling = constant_heating(np.array([1e6]), 0.0, 0.5, 1000.0, ambient=AMBIENT, start=400.0)
    assert cooling[0] == pytest.approx(AMBIENT)


def test_one_fin_takes_what_the_exact_solution_says(monkeypatch):
    """With a constant film and no radiation the fin's node is exact, contact resistance or not."""
    film = 14.0
    monkeypatch.setattr(network_module, "fin_film", lambda _, kelvin: np.full(np.shape(kelvin), film))
    for contact in (0.0, 2e-4):
        sink = HeatSink(fins=1, width=0.03, thickness=1e-3, pitch=0.02, emissivity=0.0, contact=contact)
        exact = replace(BARE.calibration, fin_root=1.0 / network_module._CALIBRATED["fin_root"])
        network = zone_network(replace(BARE, sink=sink, calibration=exact))
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


@pytest.mark.parametrize("inner", [1e-4, 0.3, 0.95])
def test_an_annulus_with_heat_of_its_own_is_that_much_warmer_than_its_cooled_face(inner):
    """By Poisson's equation, one face tight: (r T')' = -r, the mean over the area less the cooled face."""
    radius = np.linspace(inner, 1.0, 200)
    area = 0.5 * (1.0 - inner**2)
    for cooled_outside, formula in ((True, _from_mean), (False, _to_inner_from_mean)):
        if inner < 0.1 and not cooled_outside:
            continue
        tight_inside = cooled_outside

        def ends(a, b, tight_inside=tight_inside):
            return np.array([a[1], b[0]] if tight_inside else [a[0], b[1]])

        solved = solve_bvp(
            lambda r, y: np.vstack([y[1] / r, -r]),
            ends,
            radius,
            np.ones((2, 200)),
            tol=1e-9,
            max_nodes=100_000,
        )
        profile = solved.sol

        def weighted(r, profile=profile):
            return r * profile(r)[0]

        mean = quad(weighted, inner, 1.0, epsabs=1e-12)[0] / area
        # heat per radian and length is the area: resistance times 2 pi k L is mean over area
        assert formula(inner, 1.0) == pytest.approx(mean / area, rel=1e-5)


# ------------------------------------------------------------------------------------ conservation, order


@given(
    fins=st.integers(0, 8),
    width=st.floats(0.008, 0.035),
    air=st.floats(0.0, 4.0).map(lambda speed: 0.0 if speed < 0.01 else speed),
    step=st.sampled_from([5.0, 60.0, 600.0]),
    start=st.floats(-20.0, 60.0),
    model=st.sampled_from([zone_network, lumped_network]),
)
def test_the_energy_account_closes_for_any_design_and_step(fins, width, air, step, start, model):
    sink = None if fins == 0 else HeatSink(fins=fins, width=width, thickness=2e-3, pitch=0.02)
    drawing = replace(BARE.with_sink(sink), surroundings=replace(BARE.surroundings, air_speed=air))
    heated = simulate_network(model(drawing), [DUTY], longest_step=step, start=AMBIENT + start)
    assert heated.closure <= 1e-9
    assert heated.energy_in[-1] > 0.0


def test_the_method_is_of_second_order():
    """Halve the step, and the error falls by about four: order 1.9 or more, observed."""
    network = zone_network(DRAWING)
    warm = simulate_network(network, [Load(120.0, fading, 16.8)], longest_step=1.0).temperature[
        -1
    ]  # past the start
    load = [Load(960.0, fading, 16.8)]
    exact = simulate_network(network, load, start=warm, longest_step=0.25).fluid[-1]
    errors = []
    for step in (16.0, 8.0, 4.0):
        # steps that do not grow: each load begins with 1 s and grows by 1.4 to the longest
        pieces = [Load(step, fading, 16.8)] * round(960.0 / step)
        state = warm
        heated = heat_up_evenly(network, pieces, state)
        errors.append(abs(heated - exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders.min() >= 1.9


def heat_up_evenly(network: ThermalNetwork, loads: list[Load], start):
    """Return the fluid's temperature after steps of equal size, one per load."""
    system = NetworkSystem(network)
    system.take(loads[0])
    state = np.concatenate([start, np.zeros(system.columns)])
    for load in loads:
        state = rosenbrock_step(system, state, load.duration)
    return system.fluid(state)


@pytest.mark.system
def test_sixty_seconds_a_step_cost_less_than_ten_millikelvin():
    for drawing in (BARE, DRAWING):
        network = zone_network(drawing)
        coarse, fine = simulate_network(network, [DUTY]), simulate_network(network, [DUTY], longest_step=0.5)
        seen = np.interp(coarse.time, fine.time, fine.fluid)
        assert np.abs(coarse.fluid - seen).max() < 0.01


def test_a_load_that_goes_on_is_no_new_load():
    """Cut in two, the same duty ends at the same temperature, within the steps' own error."""
    network = zone_network(BARE)
    whole = simulate_network(network, [DUTY]).fluid[-1]
    halves = simulate_network(network, [replace(DUTY, duration=900.0)] * 2)
    assert halves.time[-1] == pytest.approx(1800.0)
    assert halves.fluid[-1] == pytest.approx(whole, abs=0.01)


# ------------------------------------------------------------------------------------------ what it is like


def test_a_through_rod_damper_is_the_same_from_either_end():
    for drawing in (BARE, DRAWING):
        network = zone_network(drawing)
        ends = dict(zip(network.names, simulate_network(network, [DUTY]).temperature[-1], strict=True))
        for part in ("core", "fluid", "wall"):
            assert ends[f"{part} 0"] == pytest.approx(ends[f"{part} 2"], rel=1e-12)


def test_without_a_through_rod_one_core_is_missing_and_the_fluid_takes_its_place():
    single = replace(BARE, rod=replace(BARE.rod, through=False))
    network = zone_network(single)
    assert "core 2" not in network.names
    assert network.capacity[network.names.index("fluid 2")] > network.capacity[network.names.index("fluid 0")]


def test_it_has_ten_nodes_bare_and_one_more_for_each_zone_with_fins():
    assert len(zone_network(BARE).names) == 10
    assert len(zone_network(DRAWING).names) == 13
    short = HeatSink(fins=3, width=0.02, thickness=2e-3, pitch=0.01)
    assert len(zone_network(BARE.with_sink(short)).names) == 11


def test_capacities_are_those_of_the_parts_masses():
    """By hand: a steel tube with caps, a piston and rod without the coil, copper and potting, the fluid."""
    drawing = replace(BARE, calibration=replace(BARE.calibration, heat_capacity=1.0))
    ring = lambda a, b: np.pi / 4.0 * (b**2 - a**2)  # noqa: E731
    steel = ring(36, 46) * 200 + 2 * ring(14, 36) * 5  # mm^3
    steel += ring(0, 14) * 200 + ring(14, 34) * 70
    coil = ring(26, 34) * 20
    fluid = ring(14, 36) * 120 + ring(34, 36) * 70
    by_hand = ((steel - coil) * 7850 * 470 + coil * 5860 * 470 + fluid * 2300 * 800) * 1e-9
    assert zone_network(drawing).total_capacity == pytest.approx(by_hand, rel=1e-9)


def test_fins_add_their_own_heat_capacity_and_nothing_else():
    sink = DRAWING.sink
    assert sink is not None
    added = zone_network(DRAWING).total_capacity - zone_network(BARE).total_capacity
    assert added == pytest.approx(sink.mass(0.046) * 900.0, rel=1e-9)


def test_surfaces_give_off_nothing_at_ambient_and_cool_above_it():
    network = zone_network(DRAWING)
    at = int(np.argmin(np.abs(network.grid - AMBIENT)))
    assert network.watts[:, at] == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(network.watts, axis=1) > 0.0).all()


def test_bare_area_is_kept_whatever_zone_a_fin_falls_into():
    """With a film of 1 everywhere and no radiation, the surfaces' conductance is their area."""
    network = zone_network(replace(BARE, surroundings=replace(BARE.surroundings, emissivity=1.0, mount=0.0)))
    black = [
        row for row, path in zip(network.watts, network.loss_path, strict=True) if path == "body radiation"
    ]
    tube, caps = np.pi * 0.046 * 0.2, 2.0 * np.pi / 4.0 * (0.046**2 - 0.014**2)
    flux = 5.670374419e-8 * (network.grid[-1] ** 4 - AMBIENT**4)
    assert sum(row[-1] for row in black) == pytest.approx((tube + caps) * flux, rel=1e-9)


def end_temperature(drawing: DamperDrawing) -> float:
    return float(simulate_network(zone_network(drawing), [DUTY]).fluid[-1])


def test_more_fins_wider_fins_and_more_air_are_cooler():
    sinks = [HeatSink(fins=n, width=0.023, thickness=3e-3, pitch=0.02) for n in (1, 2, 3, 4, 5, 6)]
    by_number = [end_temperature(BARE), *(end_temperature(BARE.with_sink(sink)) for sink in sinks)]
    assert (np.diff(by_number) < 0.0).all()
    by_width = [
        end_temperature(BARE.with_sink(replace(sinks[4], width=w))) for w in (0.018, 0.023, 0.028, 0.033)
    ]
    assert (np.diff(by_width) < 0.0).all()
    for drawing in (BARE, DRAWING):
        windy = [replace(drawing.surroundings, air_speed=speed) for speed in (0.0, 0.3, 1.0, 2.0, 4.0)]
        by_air = [end_temperature(replace(drawing, surroundings=around)) for around in windy]
        assert (np.diff(by_air) < 0.0).all()


def test_a_contact_resistance_and_a_polished_surface_are_warmer():
    sink = DRAWING.sink
    assert sink is not None
    usual = end_temperature(DRAWING)
    assert end_temperature(DRAWING.with_sink(replace(sink, contact=5e-4))) > usual
    assert end_temperature(DRAWING.with_sink(replace(sink, emissivity=0.05))) < usual + 5.0
    assert end_temperature(DRAWING.with_sink(replace(sink, emissivity=0.05))) > usual


def test_the_coil_is_hotter_than_the_fluid_only_while_it_carries_current():
    network = zone_network(BARE)
    with_current, without = (
        simulate_network(network, [DUTY]),
        simulate_network(network, [replace(DUTY, coil_W=0.0)]),
    )
    assert 5.0 < with_current.coil[-1] - with_current.fluid[-1] < 20.0
    assert abs(without.coil[-1] - without.fluid[-1]) < 2.0


def test_one_node_and_three_zones_agree_within_a_few_kelvin():
    for drawing in (BARE, DRAWING):
        one = simulate_network(lumped_network(drawing), [DUTY]).fluid[-1]
        assert one == pytest.approx(end_temperature(drawing), abs=4.3)


def test_a_vertical_damper_takes_its_own_correlations():
    upright = replace(BARE, body=replace(BARE.body, orientation="vertical"))
    assert end_temperature(upright) != pytest.approx(end_temperature(BARE), abs=0.01)
    sink = HeatSink(fins=5, width=0.023, thickness=3e-3, pitch=0.02, correlation="disc")
    assert end_temperature(upright.with_sink(sink)) < end_temperature(upright)


def test_thirty_minutes_take_a_few_milliseconds():
    """The bar is 5 ms of CPU; ten times that here, for a loaded machine."""
    network = zone_network(DRAWING)
    simulate_network(network, [DUTY])
    spent = []
    for _ in range(5):
        start = time.process_time()
        simulate_network(network, [DUTY])
        spent.append(time.process_time() - start)
    assert min(spent) < 0.05


# --------------------------------------------------------------------------------------------------- stops


def test_it_stops_where_it_is_told_to():
    network = zone_network(BARE)
    stopped = simulate_network(network, [Load(7200.0, fading, 16.8)], stop_at=380.0)
    assert stopped.stopped
    assert stopped.fluid[-1] == pytest.approx(380.0, abs=1e-6)
    on = simulate_network(network, [Load(float(stopped.time[-1]), fading, 16.8)])
    assert on.fluid[-1] == pytest.approx(380.0, abs=0.02)
    assert stopped.closure <= 1e-9


def test_what_starts_too_hot_stops_at_once():
    heated = simulate_network(zone_network(BARE), [DUTY], start=400.0, stop_at=380.0)
    assert heated.stopped
    assert len(heated.time) == 1


def test_what_cannot_be_computed_is_said():
    network = zone_network(BARE)
    with pytest.raises(EnvelopeError, match=r"a node is at .* degC; expected"):
        simulate_network(network, [Load(7200.0, constant(2000.0))])
    with pytest.raises(ConvergenceError, match="steady state"):
        steady_state(without_losses(network), DUTY)
    with pytest.raises(InputError, match="there is no load"):
        simulate_network(network, [])
    with pytest.raises(InputError, match="duration is 0"):
        Load(0.0, fading)
    with pytest.raises(InputError, match="mechanical sums to 2"):
        replace(one_node(), mechanical=np.array([2.0]))
    with pytest.raises(InputError, match="conductance is negative or one-sided"):
        replace(one_node(), conductance=np.array([[-1.0]]))
