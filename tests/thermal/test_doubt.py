"""A network that may be off by factors: the network itself without doubt, and what its factors mean."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.estimation.uncertainty import FACTORS, ModelUncertainty, UncertainNetwork, WatchedPoint
from mrdamper.thermal.model.lumped import lumped_network
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
LIMIT = 403.15


def power(kelvin: FloatArray) -> FloatArray:
    return np.asarray(75.0 - 0.15 * (np.asarray(kelvin) - 293.15))


LOADS = [Load(900.0, power, 16.8), Load(300.0, np.zeros_like), Load(600.0, power, 4.2)]


def scaled(load: Load, factor: float) -> Callable[[FloatArray], FloatArray]:
    return lambda kelvin: factor * load.power(kelvin)


def state_of(network: ThermalNetwork, start: float = 293.15, **factors: float) -> FloatArray:
    logs = [math.log(factors.get(name, 1.0)) for name in FACTORS]
    return np.array([*np.full(len(network.names), start), *logs])


def run(network: ThermalNetwork, *states: FloatArray, loads: Sequence[Load] = LOADS) -> FloatArray:
    """Return the fluid's temperature over time [K]."""
    return UncertainNetwork(network).run_ahead(np.array(states), loads, hottest_K=600.0)[1] @ network.fluid


def fluid_of(network: ThermalNetwork) -> WatchedPoint:
    return WatchedPoint(network.fluid, LIMIT, np.zeros(1), np.zeros(1))


def ends(network: ThermalNetwork, *states: FloatArray) -> FloatArray:
    return np.asarray(run(network, *states)[-1])


@pytest.mark.parametrize("build", [zone_network, lumped_network])
def test_without_doubt_it_runs_as_the_network_does(build):
    """Over heating, rest and heating; straight lines between the tables' knots cost some millikelvin."""
    network = build(DRAWING)
    time, nodes = UncertainNetwork(network).run_ahead(state_of(network)[None], LOADS, hottest_K=600.0)
    fluid = nodes @ network.fluid
    course = simulate_network(network, LOADS, longest_step=10.0)
    assert time[-1] == pytest.approx(1800.0)
    at = np.searchsorted(time, [900.0 - 1e-6, 1200.0 - 1e-6, 1800.0 - 1e-6])
    assert fluid[at, 0] == pytest.approx(np.interp(time[at], course.time, course.fluid), abs=0.06)


@pytest.mark.parametrize("name", ["power", "capacity", "loss", "coil", "fluid_body", "resistance"])
def test_each_factor_is_that_of_a_network_with_other_numbers(name):
    """A factor of 1.3 in the state against a network or a load with 1.3 times that number."""
    network = zone_network(DRAWING)
    other, loads = network, LOADS
    if name == "power":
        loads = [replace(load, power=scaled(load, 1.3)) for load in LOADS]
    elif name == "resistance":
        loads = [replace(load, coil_W=1.3 * load.coil_W) for load in LOADS]
    elif name == "capacity":
        other = replace(network, capacity=1.3 * network.capacity)
    elif name == "loss":
        other = replace(network, watts=1.3 * network.watts)
    else:
        one, others = (network.coil, None) if name == "coil" else (network.fluid, network.wall)
        joined = one > 0.0
        rest = ~joined if others is None else others > 0.0
        which = (joined[:, None] & rest[None, :]) | (rest[:, None] & joined[None, :])
        other = replace(network, conductance=np.where(which, 1.3, 1.0) * network.conductance)
    expected = run(other, state_of(network), loads=loads)
    found = run(network, state_of(network, **{name: 1.3}))
    plain = run(network, state_of(network))
    assert found == pytest.approx(expected, abs=1e-9)
    assert np.abs(found - plain).max() > 0.02


def test_a_common_factor_of_power_capacity_and_all_conductances_changes_nothing():
    network = replace(zone_network(DRAWING), conductance=2.0 * zone_network(DRAWING).conductance)
    twice = state_of(network, power=2.0, capacity=2.0, loss=2.0, resistance=2.0)
    assert ends(network, twice) == pytest.approx(ends(zone_network(DRAWING), state_of(network)), abs=1e-9)


def test_many_dampers_at_once_are_each_of_them_alone():
    network, rng = zone_network(DRAWING), np.random.default_rng(0)
    states = state_of(network) + 0.1 * rng.standard_normal((5, len(state_of(network))))
    alone = [float(ends(network, state)[0]) for state in states]
    assert ends(network, *states) == pytest.approx(alone, abs=1e-9)


def test_a_small_doubt_spreads_the_end_as_its_derivative_says():
    """One per cent of power: the interval is 1.645 times one per cent of the slope, either way."""
    network = zone_network(DRAWING)
    mean, n = state_of(network), len(network.names)
    covariance = np.zeros((len(mean), len(mean)))
    covariance[n, n] = 0.01**2
    prediction_interval = UncertainNetwork(network).look_ahead(
        mean, covariance, LOADS, [fluid_of(network)], dampers=800
    )
    more, less = ends(network, state_of(network, power=1.01), state_of(network, power=1.0 / 1.01))
    assert prediction_interval.high[-1] - prediction_interval.low[-1] == pytest.approx(
        1.645 * (more - less), rel=0.05
    )
    assert prediction_interval.median[-1] == pytest.approx(0.5 * (more + less), abs=0.02)
    assert prediction_interval.low[0] == prediction_interval.high[0] == pytest.approx(293.15)


def test_more_doubt_is_a_wider_interval_and_an_earlier_and_later_limit():
    network = zone_network(DRAWING.with_sink(None))
    mean, n = state_of(network), len(network.names)
    load = [Load(3000.0, power, 16.8)]
    widths = []
    for scale in (0.2, 1.0):
        covariance = np.zeros((len(mean), len(mean)))
        covariance[n:, n:] = scale**2 * ModelUncertainty().covariance
        prediction_interval = UncertainNetwork(network).look_ahead(
            mean, covariance, load, [fluid_of(network)]
        )
        widths.append(
            (
                prediction_interval.high[-1] - prediction_interval.low[-1],
                prediction_interval.to_limit.low_s,
                prediction_interval.to_limit.high_s,
            )
        )
    assert widths[1][0] > 4.0 * widths[0][0]
    assert widths[1][1] < widths[0][1] < widths[0][2] < widths[1][2]


def test_a_load_of_days_ends_in_the_steady_state():
    from mrdamper.thermal.model.transient import steady_state

    network, load = zone_network(DRAWING), Load(9e5, power, 16.8)
    fluid = run(network, state_of(network), loads=[load])
    assert len(fluid) < 400
    assert fluid[-1, 0] == pytest.approx(float(network.fluid @ steady_state(network, load)), abs=0.02)


def test_a_doubt_below_zero_is_refused():
    with pytest.raises(InputError, match=r"model uncertainty: loss is -1"):
        ModelUncertainty(loss=-1.0)


@pytest.mark.parametrize("name", [*FACTORS, "drift_per_sqrt_h", "node_K_per_sqrt_s"])
@pytest.mark.parametrize("value", [-1e-9, math.nan, math.inf])
def test_every_doubt_is_zero_or_more(name: str, value: float):
    assert getattr(ModelUncertainty(**{name: 0.0}), name) == 0.0
    with pytest.raises(InputError, match=f"{name} is {value}; expected zero or more, finite"):
        ModelUncertainty(**{name: value})


def test_doubts_are_those_of_the_docs():
    """Power and capacity 10 %, losses 25 %, the ways from fluid and coil 30 %, the resistance 2 %."""
    page = (Path(__file__).parents[2] / "docs" / "thermal.md").read_text(encoding="utf-8")
    assert "power and heat capacity by 10 %, losses by 25 %" in page
    deviations = dict(zip(FACTORS, np.sqrt(np.diag(ModelUncertainty().covariance)), strict=True))
    assert deviations == pytest.approx(
        {"power": 0.1, "capacity": 0.1, "loss": 0.25, "fluid_body": 0.3, "coil": 0.3, "resistance": 0.02}
    )


def test_losses_of_nodes_are_their_tables_along_straight_lines():
    """With the slope between two knots; beyond either end the last line goes on."""
    network = zone_network(DRAWING)
    uncertain, grid = UncertainNetwork(network), network.grid
    rng = np.random.default_rng(2)
    nodes = rng.uniform(grid[0], grid[-1], (3, len(network.names)))
    nodes[0, :2] = grid[0] - 3.0, grid[-1] + 5.0
    lost, slope = uncertain.losses(nodes)
    table = np.zeros((len(network.names), len(grid)))
    for node, row in zip(network.loss_node, network.watts, strict=True):
        table[node] += row
    for row, kelvin in enumerate(nodes):
        for node, at in enumerate(kelvin):
            k = min(max(int((at - grid[0]) // 2.0), 0), len(grid) - 2)
            steep = (table[node, k + 1] - table[node, k]) / 2.0
            assert slope[row, node] == pytest.approx(steep)
            assert lost[row, node] == pytest.approx(table[node, k] + steep * (at - grid[k]), abs=1e-9)


def test_nodes_are_held_at_the_hottest_and_steps_grow_to_a_minute():
    network = zone_network(DRAWING.with_sink(None))
    hot = Load(4000.0, lambda kelvin: np.full(np.shape(kelvin), 900.0))
    time, nodes = UncertainNetwork(network).run_ahead(state_of(network)[None], [hot], hottest_K=390.0)
    assert nodes.max() == 390.0
    assert np.diff(time)[:4] == pytest.approx([2.0, 2.8, 3.92, 5.488])
    assert np.diff(time).max() == pytest.approx(60.0)
    assert time[-1] == pytest.approx(4000.0)
    far = Load(90_000.0, np.zeros_like)
    time, _ = UncertainNetwork(network).run_ahead(state_of(network)[None], [far], hottest_K=390.0)
    assert np.diff(time).max() == pytest.approx(300.0)  # three hundred of the longest


def test_a_network_is_printed_without_what_follows_from_it():
    uncertain = UncertainNetwork(lumped_network(DRAWING))
    assert repr(uncertain) == f"UncertainNetwork(network={uncertain.network!r})"
