"""Characteristics of Bingham, viscous and Dahl dampers agree with closed forms."""

from __future__ import annotations

import doctest
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.excitation import Sine
from mrdamper.models.actuation import Actuation
from mrdamper.models.characteristics import (
    Characterisation,
    Response,
    characterise,
    default_scope,
    peak_velocity_pick,
    steady_cycle,
)
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear

SINE = Sine(5e-3, 1.0)
OMEGA = 2.0 * math.pi * SINE.frequency
SPEEDS = np.array([0.005, 0.02, 0.1, 0.4])
ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.23, 0.2))
REFERENCE = 293.15


def bingham(actuation: Actuation | None = None, **given_coefficients: ParameterLaw) -> Damper:
    """Return a Bingham damper. Its regularisation is so small that it is ideal at the tested speeds."""
    forms: dict[str, ParameterLaw] = {
        "yield_force": Polynomial((40.0, 500.0)),
        "yield_velocity": Constant(1e-7),
        **given_coefficients,
    }
    return Damper(LAWS["bingham"], forms, actuation=actuation)


def dahl(rho: float, **given_coefficients: ParameterLaw) -> Damper:
    return Damper(LAWS["dahl"], {"yield_force": Constant(300.0), "rho": Constant(rho), **given_coefficients})


def characterised(damper: Damper, envelope: OperatingEnvelope = ENVELOPE) -> Characterisation:
    return characterise(damper, default_scope(damper, envelope))


# Energy of cycles


@given(
    command=st.floats(0.0, 2.0),
    viscosity=st.floats(0.0, 5e3),
    amplitude=st.floats(1e-3, 0.05),
    frequency=st.floats(0.1, 10.0),
)
def test_bingham_energy_matches_formula(command, viscosity, amplitude, frequency):
    """The energy per cycle is 4 A F_y + pi c omega A^2. Spring and gas force have no effect."""
    damper = bingham(viscosity=Constant(viscosity), stiffness=Constant(2e3), offset=Constant(70.0))
    cycle = steady_cycle(damper, Sine(amplitude, frequency), command)
    yielding = 4.0 * amplitude * (40.0 + 500.0 * command)
    viscous = math.pi * viscosity * 2.0 * math.pi * frequency * amplitude**2
    assert cycle.energy_J == pytest.approx(yielding + viscous, rel=1e-4)


def test_dahl_energy_converges_to_rectangle():
    """The force loop is smaller than a rectangle of area 4 A F_y, by an area proportional to 1 / rho."""
    rectangle = 4.0 * SINE.amplitude * 300.0
    gaps = [1.0 - steady_cycle(dahl(rho), SINE, 0.0).energy_J / rectangle for rho in (4e3, 8e3, 16e3)]
    assert gaps[0] > 0.0
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.03)
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.03)


def test_settled_force_cycle_is_closed():
    cycle = steady_cycle(dahl(600.0, viscosity=Constant(500.0)), SINE, 0.0)
    assert cycle.force[-1] == pytest.approx(cycle.force[0], rel=1e-6)
    assert cycle.velocity[-1] == pytest.approx(cycle.velocity[0], rel=1e-9)


# Force versus peak velocity


def test_viscous_peak_force_is_proportional_to_speed():
    damper = bingham(yield_force=Constant(0.0), viscosity=Constant(1200.0))
    for amplitude in (1e-3, 0.02):
        curve = peak_velocity_pick(damper, SPEEDS, amplitude=amplitude, command=0.0)
        np.testing.assert_allclose(curve.extension, 1200.0 * SPEEDS, rtol=1e-12)
        np.testing.assert_allclose(curve.retraction, -1200.0 * SPEEDS, rtol=1e-12)


def test_gas_force_shifts_both_branches_equally():
    """At mid-stroke, the gas force is the same on both branches. It is not part of the damping force."""
    bare = peak_velocity_pick(bingham(viscosity=Constant(800.0)), SPEEDS, amplitude=0.01, command=1.0)
    damper = bingham(
        viscosity=Constant(800.0), offset=Constant(65.0), stiffness=Constant(3e3), mass=Constant(3.0)
    )
    curve = peak_velocity_pick(damper, SPEEDS, amplitude=0.01, command=1.0)
    np.testing.assert_allclose(curve.extension - bare.extension, 65.0, rtol=1e-9)
    np.testing.assert_allclose(curve.retraction - bare.retraction, 65.0, rtol=1e-9)
    np.testing.assert_allclose(curve.damping, 540.0 + 800.0 * SPEEDS, rtol=1e-12)


# Force at high temperature


def test_relative_force_loss_decreases_with_current():
    """The relative force loss is the viscous fraction of the force times the loss of viscosity."""
    damper = bingham(viscosity=TemperatureDependent(Constant(3e3), Arrhenius(1435.5)))
    fall = 1.0 - math.exp(1435.5 * (1.0 / 373.15 - 1.0 / REFERENCE))
    viscous = 3e3 * OMEGA * SINE.amplitude
    losses = [
        1.0 - steady_cycle(damper, SINE, i, 373.15).peak_N / steady_cycle(damper, SINE, i).peak_N
        for i in (0.0, 1.0, 2.0)
    ]
    expected = [viscous / (40.0 + 500.0 * i + viscous) * fall for i in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(losses, expected, rtol=1e-9)
    assert losses == sorted(losses, reverse=True)


# Complete characterisation


def test_bingham_characteristics_match_formulas():
    damper = bingham(
        viscosity=Constant(900.0),
        offset=Constant(35.0),
        stiffness=Constant(2000.0),
        yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(2e-3)),
    )
    found = characterised(damper, replace(ENVELOPE, temperature=(290.0, 374.0)))
    scope = found.scope
    assert scope.commands == (0.0, 0.5, 1.0, 1.5, 2.0)
    assert scope.temperatures == pytest.approx((293.15, 333.15, 373.15))
    factor = 1.0 - 2e-3 * (np.array(scope.temperatures, dtype=float) - REFERENCE)
    yielding = factor[:, None, None] * (60.0 + 600.0 * np.array(scope.commands))[None, :, None]
    force = yielding + 900.0 * np.array(scope.speeds)
    assert found.extension == pytest.approx(force + 35.0, rel=1e-6)
    assert found.retraction == pytest.approx(35.0 - force, rel=1e-6)
    assert found.damping == pytest.approx(force, rel=1e-6)
    assert found.gas_N == pytest.approx(np.full((3, 5), 35.0), rel=1e-6)
    assert found.dynamic_range == pytest.approx(force[:, -1] / force[:, 0], rel=1e-6)
    omega, amplitude = 2.0 * math.pi * scope.motion.frequency, scope.motion.amplitude
    energy = 4.0 * amplitude * yielding[:, :, 0] + math.pi * 900.0 * omega * amplitude**2
    assert found.energy == pytest.approx(energy, rel=1e-4)
    assert found.equivalent_damping == pytest.approx(energy / (math.pi * omega * amplitude**2), rel=1e-4)
    for t, curves in enumerate(found.curves):
        for i, curve in enumerate(curves):
            assert curve.command == scope.commands[i]
            assert curve.damping == pytest.approx(yielding[t, i] + 900.0 * scope.curve_speeds, rel=1e-6)


# Response to current steps


def response(damper: Damper) -> tuple[Response, Response]:
    rising, falling = characterised(damper).responses
    return rising, falling


def test_linear_force_responds_as_fast_as_current():
    """The force completes a fraction of its change in the time delay - tau ln(1 - fraction)."""
    damper = bingham(Actuation(rise_s=0.012, fall_s=0.007, delay_s=0.004), viscosity=Constant(900.0))
    for way, tau in zip(response(damper), (0.012, 0.007), strict=True):
        for times, fraction in (
            ((way.command_t63, way.force_t63), 0.63),
            ((way.command_t90, way.force_t90), 0.9),
        ):
            assert times == pytest.approx([0.004 - tau * math.log(1.0 - fraction)] * 2, rel=2e-3)


def test_quadratic_force_rises_later_than_current():
    """A rising force is proportional to (1 - exp(-t/tau))^2, a falling force to exp(-2 t/tau)."""
    up, down = response(bingham(Actuation(0.01, 0.01), yield_force=Polynomial((0.0, 0.0, 300.0))))
    assert up.force_t63 == pytest.approx(-0.01 * math.log(1.0 - math.sqrt(0.63)), rel=3e-3)
    assert down.force_t63 == pytest.approx(-0.005 * math.log(1.0 - 0.63), rel=3e-3)


def test_force_response_requires_lag_and_current_dependence():
    assert characterised(bingham()).responses == ()
    for way in response(bingham(Actuation(0.01, 0.01), yield_force=Constant(300.0))):
        assert (way.force_t63, way.force_t90) == (None, None)
        assert way.command_t63 == pytest.approx(-0.01 * math.log(0.37), rel=2e-3)


# Default currents, temperatures and speeds of the evaluation


def test_default_characteristics_include_assumed_temperatures():
    """After tests at one temperature, the scope is the range of the assumed temperature dependence."""
    damper = bingham(yield_force=TemperatureDependent(Constant(60.0), Linear(1e-4)))
    assert default_scope(bingham(), replace(ENVELOPE, temperature=(290.0, 374.0))).temperatures == (None,)
    assert default_scope(damper, ENVELOPE).temperatures == (REFERENCE,)
    assumed = replace(damper, temperature_range=(273.15, 353.15))
    tested = replace(ENVELOPE, temperature=(293.0, 294.0))
    assert default_scope(assumed, tested).temperatures[-1] == pytest.approx(353.15)


def test_characteristics_example_in_docs_is_correct():
    page = Path(__file__).parents[2] / "docs" / "characteristics.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert failed == 0
    assert tried > 0
