"""What steps and filters take for derivatives are derivatives: each against differences of the rate itself.

A step of ROS2 is of second order whatever stands for the Jacobian, so that no course tells a wrong one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.thermal.estimation.observer import TemperatureObserver, ThermalMeasurement, Thermometers
from mrdamper.thermal.estimation.two_node import PARAMETERS, PRIOR, _TwoNodeSystem
from mrdamper.thermal.estimation.uncertainty import FACTORS, UncertainNetwork
from mrdamper.thermal.model.finite_element import FieldModel, build_field
from mrdamper.thermal.model.heat_equation import FieldSystem
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.reduced import ReducedModel, reduce_field
from mrdamper.thermal.model.stepping import Load, System
from mrdamper.thermal.model.transient import NetworkSystem, steady_state
from tests.thermal.designs import DRAWING

SHRUNK_S = 7.0
WINDY = replace(DRAWING, surroundings=replace(DRAWING.surroundings, air_speed=1.5, mount=0.2))
NETWORK = zone_network(WINDY)


def falling(kelvin: FloatArray) -> FloatArray:
    """Power that bends with temperature, so that no slope of it is a constant."""
    return np.asarray(80.0 * np.exp(-0.004 * (kelvin - 293.15)))


LOAD = Load(600.0, falling, 20.0)


def slope_along(function: Callable[[FloatArray], FloatArray], at: FloatArray, move: FloatArray) -> FloatArray:
    """Return the derivative along a move, by differences of fourth order."""
    step = 0.02 / float(np.abs(move).max())
    one, two = (function(at + k * step * move) - function(at - k * step * move) for k in (1.0, 2.0))
    return np.asarray((8.0 * one - two) / (12.0 * step))


def check(system: System, state: FloatArray, seed: int = 0) -> None:
    """Compare rate and solver of (M - shrunk J) with the rate itself."""
    rate, solve = system.linearise(state, SHRUNK_S)
    assert rate == pytest.approx(system.rate(state), rel=1e-12)
    right = np.random.default_rng(seed).standard_normal(state.shape)
    move = solve(right)
    left = system.inertia(move) - SHRUNK_S * slope_along(system.rate, state, move)
    assert left == pytest.approx(right, abs=2e-6 * np.abs(system.inertia(move)).max())


def test_of_a_network():
    system = NetworkSystem(NETWORK)
    system.take(LOAD)
    nodes = len(NETWORK.names)
    state = np.zeros(nodes + system.columns)
    state[:nodes] = np.random.default_rng(1).uniform(300.5, 380.5, nodes)
    check(system, state)


def test_of_many_dampers_at_once():
    factor = np.exp(0.3 * np.random.default_rng(2).standard_normal((4, len(FACTORS))))
    system = UncertainNetwork(NETWORK)._system(factor)
    system.take(LOAD)
    nodes = len(NETWORK.names)
    state = np.zeros((4, nodes + system.columns))
    state[:, :nodes] = np.random.default_rng(3).uniform(300.5, 380.5, (4, nodes))
    check(system, state)


def test_of_the_finite_elements_and_of_the_reduced_model():
    full = build_field(WINDY, size=0.05)
    models: tuple[FieldModel | ReducedModel, ...] = (full, reduce_field(full, order=8))
    for model in models:
        equation = model.equation
        system = FieldSystem(equation)
        system.take(LOAD)
        profile = np.random.default_rng(4).uniform(0.8, 1.2, equation.size) if model is full else 1.0
        state = np.concatenate([equation.uniform * 45.0 * profile, np.zeros(7)])
        check(system, state)


def test_of_two_nodes():
    rng = np.random.default_rng(5)
    given = {name: PRIOR[name].value(0.5 * rng.standard_normal(6)) for name in PARAMETERS}
    check(_TwoNodeSystem(given, 293.15), rng.uniform(285.0, 380.0, (2, 6)))
    # held at the least power, it no longer falls
    steep = {**given, "slope": np.full(6, 0.02), "viscous": np.full(6, 0.1)}
    check(_TwoNodeSystem(steep, 293.15), np.full((2, 6), 370.0))


def test_where_the_rate_is_nothing_a_load_ends():
    system = NetworkSystem(NETWORK)
    system.take(LOAD)
    rate, _ = system.rate_and_jacobian(steady_state(NETWORK, LOAD))
    assert np.abs(rate).max() < 1e-9


# ------------------------------------------------------------------------------------------- the observer


def derivative(function: Callable[[FloatArray], FloatArray], at: FloatArray, scale: FloatArray) -> FloatArray:
    columns = [
        (function(at + h * unit) - function(at - h * unit)) / (2.0 * h)
        for unit, h in zip(np.eye(len(at)), scale, strict=True)
    ]
    return np.transpose(columns)


@pytest.mark.parametrize("read", [{}, {"resistance_ohm": 5.1}, {"body_K": 331.0}], ids=str)
def test_the_observer_is_the_textbook_s_with_exact_derivatives(read: dict[str, Any]):
    """Kalman's filter, extended: predicted with the derivative of the step, corrected with the reading's."""
    thermometers = Thermometers(resistance=0.02, voltage_V=0.03, body_K=0.7)
    observer = TemperatureObserver(NETWORK, 4.2, thermometers=thermometers)
    doubt, (n, size) = observer.model_uncertainty, (len(NETWORK.names), len(NETWORK.names) + len(FACTORS))
    rng = np.random.default_rng(6)
    mean = np.concatenate([rng.uniform(300.5, 340.5, n), 0.1 * rng.standard_normal(len(FACTORS))])
    doubts = np.append(np.full(n, 0.5), np.full(len(FACTORS), 0.02))
    root = rng.standard_normal((size, size)) * doubts[:, None]
    spread = root @ root.T
    scale = np.append(np.full(n, 1e-3), np.full(len(FACTORS), 1e-4))
    start = replace(observer.start(), mean=mean, covariance=spread)
    seen = ThermalMeasurement(8.0, 70.0, 1.6, **read)

    def advanced(at: FloatArray) -> FloatArray:
        return observer.step(replace(start, mean=at), ThermalMeasurement(8.0, 70.0, 1.6)).mean

    slope, wander = derivative(advanced, mean, scale), np.zeros(size)
    wander[:n] = doubt.node_K_per_sqrt_s**2 * 8.0
    wander[n : n + 5] = doubt.drift_per_sqrt_h**2 * 8.0 / 3600.0
    expected, ahead = advanced(mean), slope @ spread @ slope.T + np.diag(wander)

    def shown(at: FloatArray) -> FloatArray:
        if "body_K" in read:
            return np.array([NETWORK.wall @ at[:n]])
        copper = 1.0 + 0.00393 * (NETWORK.coil @ at[:n] - 293.15)
        return np.array([4.2 * np.exp(at[n + 5]) * copper])

    if read:
        (value,), row = read.values(), derivative(shown, expected, scale)[0]
        (guess,) = shown(expected)
        noise = 0.7 if "body_K" in read else np.hypot(0.02 * guess, 0.03 / 1.6)
        gain = ahead @ row / (row @ ahead @ row + noise**2)
        expected, ahead = expected + gain * (value - guess), ahead - np.outer(gain, row @ ahead)
    found = observer.step(start, seen)
    size_of = np.sqrt(np.diag(ahead))
    assert (found.mean - expected) / size_of == pytest.approx(0.0, abs=1e-5)
    assert (found.covariance - ahead) / np.outer(size_of, size_of) == pytest.approx(0.0, abs=1e-5)
    assert found.time_s == 8.0
