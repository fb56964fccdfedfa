"""Jacobians of the thermal models agree with difference quotients of the temperature rates.

Time steps of the method ROS2 have second order with any Jacobian. A simulation would therefore not reveal a
wrong Jacobian.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.thermal.model.finite_element import FieldModel, build_field
from mrdamper.thermal.model.heat_equation import FieldSystem
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.reduced import ReducedModel, reduce_field
from mrdamper.thermal.model.stepping import Load, System
from mrdamper.thermal.model.transient import NetworkSystem
from tests.thermal.designs import DRAWING

SHRUNK_S = 7.0
WINDY = replace(DRAWING, surroundings=replace(DRAWING.surroundings, air_speed=1.5, mount=0.2))
NETWORK = zone_network(WINDY)


def falling(kelvin: FloatArray) -> FloatArray:
    """Return a power that is nonlinear in temperature, so that none of its derivatives is constant."""
    return np.asarray(80.0 * np.exp(-0.004 * (kelvin - 293.15)))


LOAD = Load(600.0, falling, 20.0)


def slope_along(function: Callable[[FloatArray], FloatArray], at: FloatArray, move: FloatArray) -> FloatArray:
    """Return the derivative along a direction, by fourth-order differences."""
    step = 0.02 / float(np.abs(move).max())
    one, two = (function(at + k * step * move) - function(at - k * step * move) for k in (1.0, 2.0))
    return np.asarray((8.0 * one - two) / (12.0 * step))


def check(system: System, state: FloatArray, seed: int = 0) -> None:
    """Check that the linearised rate and the solution with (M - c J) agree with differences of the rate."""
    rate, solve = system.linearise(state, SHRUNK_S)
    assert rate == pytest.approx(system.rate(state), rel=1e-12)
    right = np.random.default_rng(seed).standard_normal(state.shape)
    move = solve(right)
    left = system.inertia(move) - SHRUNK_S * slope_along(system.rate, state, move)
    assert left == pytest.approx(right, abs=2e-6 * np.abs(system.inertia(move)).max())


def test_network_jacobian_is_exact():
    system = NetworkSystem(NETWORK)
    system.take(LOAD)
    nodes = len(NETWORK.names)
    state = np.zeros(nodes + system.columns)
    state[:nodes] = np.random.default_rng(1).uniform(300.5, 380.5, nodes)
    check(system, state)


def test_finite_element_jacobian_is_exact():
    full = build_field(WINDY, size=0.05)
    models: tuple[FieldModel | ReducedModel, ...] = (full, reduce_field(full, order=8))
    for model in models:
        equation = model.equation
        system = FieldSystem(equation)
        system.take(LOAD)
        profile = np.random.default_rng(4).uniform(0.8, 1.2, equation.size) if model is full else 1.0
        state = np.concatenate([equation.uniform * 45.0 * profile, np.zeros(7)])
        check(system, state)
