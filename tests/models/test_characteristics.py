"""Characteristics against closed forms: Bingham, viscous and Dahl dampers, linear factors, lags."""

from __future__ import annotations

import doctest
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.models.actuation import Actuation
from mrdamper.models.characteristics import (
    ForceResponse,
    dynamic_range,
    force_loss,
    force_response,
    gas_force,
    peak_velocity_pick,
    settled_cycle,
)
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear

SINE = Sine(5e-3, 1.0)
OMEGA = 2.0 * math.pi * SINE.frequency
SPEEDS = np.array([0.005, 0.02, 0.1, 0.4])
WARM = np.array([313.15, 353.15, 393.15])


def bingham(**given_coefficients: ParameterLaw) -> Damper:
    """Return the Bingham damper, its corner so sharp that it is the ideal one at these speeds."""
    forms: dict[str, ParameterLaw] = {
        "yield_force": Polynomial((40.0, 500.0)),
        "yield_velocity": Constant(1e-7),
        **given_coefficients,
    }
    return Damper(LAWS["bingham"], forms)


def dahl(rho: float, **given_coefficients: ParameterLaw) -> Damper:
    return Damper(LAWS["dahl"], {"yield_force": Constant(300.0), "rho": Constant(rho), **given_coefficients})


# ------------------------------------------------------------------------------------------- cycles


@given(
    command=st.floats(0.0, 2.0),
    viscosity=st.floats(0.0, 5e3),
    amplitude=st.floats(1e-3, 0.05),
    frequency=st.floats(0.1, 10.0),
)
def test_a_bingham_damper_takes_up_four_strokes_of_yield_force_and_the_viscous_ellipse(
    command, viscosity, amplitude, frequency
):
    """Energy = 4 A F_y + pi c omega A^2, whatever spring and gas force stand beside it."""
    damper = bingham(viscosity=Constant(viscosity), stiffness=Constant(2e3), offset=Constant(70.0))
    cycle = settled_cycle(damper, Sine(amplitude, frequency), command)
    yielding = 4.0 * amplitude * (40.0 + 500.0 * command)
    viscous = math.pi * viscosity * 2.0 * math.pi * frequency * amplitude**2
    assert cycle.energy_J == pytest.approx(yielding + viscous, rel=1e-4)
    equivalent = viscosity + 4.0 * (40.0 + 500.0 * command) / (
        math.pi * 2.0 * math.pi * frequency * amplitude
    )
    assert cycle.equivalent_damping_N_s_m == pytest.approx(equivalent, rel=1e-4)


def test_the_work_of_a_linear_damper_is_exact():
    cycle = settled_cycle(bingham(yield_force=Constant(0.0), viscosity=Constant(900.0)), SINE, 0.0)
    assert cycle.energy_J == pytest.approx(math.pi * 900.0 * OMEGA * SINE.amplitude**2, rel=1e-12)
    assert cycle.equivalent_damping_N_s_m == pytest.approx(900.0, rel=1e-12)


def test_the_energy_of_hysteresis_tends_to_the_rectangle_as_the_yield_displacement_vanishes():
    """A Dahl loop lacks about one yield displacement at each end: the gap to 4 A F_y halves with 1 / rho."""
    rectangle = 4.0 * SINE.amplitude * 300.0
    gaps = [1.0 - settled_cycle(dahl(rho), SINE, 0.0).energy_J / rectangle for rho in (4e3, 8e3, 16e3)]
    assert gaps[0] > 0.0
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.03)
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.03)


def test_the_cycle_that_is_read_is_closed():
    """The start has died away: force and displacement end where they began."""
    cycle = settled_cycle(dahl(600.0, viscosity=Constant(500.0)), SINE, 0.0)
    assert cycle.force[-1] == pytest.approx(cycle.force[0], rel=1e-6)
    assert cycle.displacement[-1] == pytest.approx(cycle.displacement[0], abs=1e-12)


# ------------------------------------------------------------------------------------------- peak velocity


def test_the_peak_velocity_pick_of_a_viscous_damper_is_its_line_at_any_stroke():
    damper = bingham(yield_force=Constant(0.0), viscosity=Constant(1200.0))
    for amplitude in (1e-3, 0.02):
        curve = peak_velocity_pick(damper, SPEEDS, amplitude=amplitude, command=0.0)
        np.testing.assert_allclose(curve.extension, 1200.0 * SPEEDS, rtol=1e-12)
        np.testing.assert_allclose(curve.retraction, -1200.0 * SPEEDS, rtol=1e-12)


def test_the_gas_force_shifts_both_branches_and_the_spring_neither():
    """At mid-stroke the spring is at rest; damping, half the step, is free of the gas force."""
    bare = peak_velocity_pick(bingham(viscosity=Constant(800.0)), SPEEDS, amplitude=0.01, command=1.0)
    damper = bingham(viscosity=Constant(800.0), offset=Constant(65.0), stiffness=Constant(3e3))
    curve = peak_velocity_pick(damper, SPEEDS, amplitude=0.01, command=1.0)
    np.testing.assert_allclose(curve.extension - bare.extension, 65.0, rtol=1e-9)
    np.testing.assert_allclose(curve.retraction - bare.retraction, 65.0, rtol=1e-9)
    np.testing.assert_allclose(curve.damping, 540.0 + 800.0 * SPEEDS, rtol=1e-12)


def test_a_moving_mass_does_not_show_at_the_peak_velocity():
    heavy = peak_velocity_pick(bingham(mass=Constant(3.0)), [0.1], amplitude=0.01, command=0.0)
    assert heavy.damping[0] == pytest.approx(40.0, rel=1e-9)


@given(high=st.floats(0.1, 2.0), velocity=st.floats(1e-3, 1.0))
def test_the_dynamic_range_of_a_bingham_damper(high, velocity):
    """(F_y(I) + c v) / (F_y(0) + c v), without the gas force."""
    damper = bingham(viscosity=Constant(700.0), offset=Constant(90.0))
    viscous = 700.0 * velocity
    expected = (40.0 + 500.0 * high + viscous) / (40.0 + viscous)
    assert dynamic_range(damper, velocity, amplitude=0.01, high=high) == pytest.approx(expected, rel=1e-9)


def test_the_dynamic_range_tends_to_one_where_viscosity_rules():
    damper = bingham(viscosity=Constant(1e6))
    ranges = [dynamic_range(damper, v, amplitude=0.01, high=2.0) for v in (0.01, 0.1, 1.0)]
    assert ranges == sorted(ranges, reverse=True)
    assert ranges[-1] == pytest.approx(1.0, abs=2e-3)


# ------------------------------------------------------------------------------------------- temperature


def test_the_loss_of_a_linear_factor_is_its_slope():
    """Yield force alone: the share lost per kelvin is the factor's slope, at every current."""
    damper = bingham(yield_force=TemperatureDependent(Polynomial((40.0, 500.0)), Linear(1.67e-3)))
    for command in (0.0, 1.0, 2.0):
        np.testing.assert_allclose(
            force_loss(damper, SINE, command, WARM), 1.67e-3 * (WARM - 293.15), rtol=1e-9
        )


def test_the_loss_of_a_viscous_damper_is_that_of_its_viscosity():
    """65 % from 20 to 100 degC, the paper's fluid, with E/R = 1435.5 K."""
    viscous = TemperatureDependent(Constant(2e3), Arrhenius(1435.5))
    damper = bingham(yield_force=Constant(0.0), viscosity=viscous)
    assert force_loss(damper, SINE, 0.0, [373.15])[0] == pytest.approx(0.65, abs=1e-3)


def test_the_loss_is_smaller_at_higher_current_when_only_the_viscous_part_is_warm():
    """The viscous share times the fall of the viscosity: the paper's claim, in closed form."""
    damper = bingham(viscosity=TemperatureDependent(Constant(3e3), Arrhenius(1435.5)))
    fall = 1.0 - math.exp(1435.5 * (1.0 / 373.15 - 1.0 / 293.15))
    viscous = 3e3 * OMEGA * SINE.amplitude
    losses = [float(force_loss(damper, SINE, command, [373.15])[0]) for command in (0.0, 1.0, 2.0)]
    expected = [viscous / (40.0 + 500.0 * command + viscous) * fall for command in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(losses, expected, rtol=1e-9)
    assert losses == sorted(losses, reverse=True)


def test_nothing_is_lost_at_the_reference_and_something_gained_below_it():
    damper = bingham(yield_force=TemperatureDependent(Constant(500.0), Linear(2e-3)))
    loss = force_loss(damper, SINE, 0.0, [303.15, 313.15, 323.15], reference=313.15)
    assert loss[1] == 0.0
    assert loss[0] < 0.0 < loss[2]
    assert loss[2] == pytest.approx(20e-3 / 0.96 / 1.0, rel=1e-9)


def test_without_a_temperature_a_tempered_damper_is_at_20_degrees():
    damper = bingham(yield_force=TemperatureDependent(Constant(500.0), Linear(2e-3)))
    assert settled_cycle(damper, SINE, 0.0).peak_N == settled_cycle(damper, SINE, 0.0, 293.15).peak_N


# ------------------------------------------------------------------------------------------- response


def lagged(actuation: Actuation, yield_force: ParameterLaw | None = None) -> Damper:
    return replace(bingham(yield_force=yield_force or Polynomial((40.0, 500.0))), actuation=actuation)


@pytest.mark.parametrize("share", [0.63, 0.9])
def test_a_force_linear_in_the_command_answers_a_step_like_its_lag(share):
    """The time is delay - tau ln(1 - share), up with the rise time and down with the fall time."""
    damper = lagged(Actuation(rise_s=0.012, fall_s=0.007, delay_s=0.004))
    up, down = force_response(damper, 0.0, 2.0), force_response(damper, 2.0, 0.0)
    assert up.time_to(share) == pytest.approx(0.004 - 0.012 * math.log(1.0 - share), abs=3e-5)
    assert down.time_to(share) == pytest.approx(0.004 - 0.007 * math.log(1.0 - share), abs=3e-5)


def test_two_equal_lags_in_a_row():
    """1 - (1 + t / tau) exp(-t / tau) = share."""
    found = force_response(lagged(Actuation(0.008, 0.008, 0.008)), 0.0, 1.0).time_to(0.63)
    expected = brentq(lambda t: 1.0 - (1.0 + t / 0.008) * math.exp(-t / 0.008) - 0.63, 0.0, 0.1)
    assert found == pytest.approx(expected, abs=3e-5)


def test_a_force_that_rises_with_the_square_of_the_command_comes_later_and_falls_sooner():
    """Share (1 - exp(-t/tau))^2 going up, exp(-2 t/tau) left going down."""
    damper = lagged(Actuation(0.01, 0.01), Polynomial((0.0, 0.0, 300.0)))
    up, down = force_response(damper, 0.0, 1.5), force_response(damper, 1.5, 0.0)
    assert up.time_to(0.63) == pytest.approx(-0.01 * math.log(1.0 - math.sqrt(0.63)), abs=5e-5)
    assert down.time_to(0.63) == pytest.approx(-0.005 * math.log(1.0 - 0.63), abs=5e-5)


def test_spring_and_gas_force_take_no_part_in_the_response():
    actuation = Actuation(0.01, 0.01)
    springy = replace(bingham(stiffness=Constant(2e4), offset=Constant(80.0)), actuation=actuation)
    plain = force_response(lagged(actuation), 0.0, 1.0)
    np.testing.assert_allclose(force_response(springy, 0.0, 1.0).share, plain.share, atol=1e-9)


def test_a_command_lag_counts_like_an_actuation():
    damper = replace(bingham(), command_lag_s=0.02)
    found = force_response(damper, 0.0, 1.0, velocity=0.02).time_to(0.9)
    assert found == pytest.approx(0.02 * math.log(10.0), abs=3e-5)


def test_without_lags_the_force_is_there_at_once():
    assert force_response(bingham(), 0.0, 1.0).time_to(0.9) <= 1e-4


# ------------------------------------------------------------------------------------------- gas


@given(rate=st.floats(-5e3, 5e3), offset=st.floats(-300.0, 300.0))
def test_gas_force_and_spring_are_read_from_the_middle_line(rate, offset):
    damper = bingham(viscosity=Constant(600.0), stiffness=Constant(abs(rate)), offset=Constant(offset))
    found = gas_force(damper, amplitude=0.02, command=1.0)
    assert found.offset_N == pytest.approx(offset, abs=1e-6)
    assert found.spring_rate_N_m == pytest.approx(abs(rate), abs=1e-3)


def test_hysteresis_drops_out_of_the_gas_spring_as_the_stroke_grows():
    """The middle line of a Dahl loop is k x + 2 F_y exp(-rho A) sinh(rho x), read within A / 5."""
    damper, rho = dahl(1e3, stiffness=Constant(1500.0)), 1e3
    for amplitude in (5e-3, 10e-3, 20e-3):
        wrong = gas_force(damper, amplitude=amplitude).spring_rate_N_m - 1500.0
        least = 2.0 * 300.0 * rho * math.exp(-rho * amplitude)
        assert least < wrong < least * math.cosh(0.2 * rho * amplitude)


# ------------------------------------------------------------------------------------------- the page


def test_the_example_of_the_docs_gives_what_it_says():
    page = Path(__file__).parents[2] / "docs" / "characteristics.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert (failed, tried) == (0, 8)


# ------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (
            lambda: peak_velocity_pick(bingham(), [0.1, 0.0], amplitude=0.01, command=0.0),
            "peak velocity is 0",
        ),
        (lambda: peak_velocity_pick(bingham(), [0.1], amplitude=math.nan, command=0.0), "amplitude is nan"),
        (lambda: gas_force(bingham(), amplitude=-1.0), "amplitude is -1.0"),
        (lambda: force_response(bingham(), 0.0, 1.0, velocity=0.0), "velocity is 0.0"),
        (lambda: force_response(bingham(), 1.0, 1.0), "the force at 1 and at 1 A is the same"),
        (
            lambda: dynamic_range(bingham(yield_force=Polynomial((0.0, 9.0))), 0.1, amplitude=0.01, high=1.0),
            "damping force at 0 A and 0.1 m/s is 0 N",
        ),
        (lambda: ForceResponse(np.arange(2.0), np.array([0.0, 0.5])).time_to(0.9), "0.9 is not reached"),
    ],
)
def test_what_has_no_answer_is_refused_with_the_place(ask, said):
    with pytest.raises(InputError, match=said):
        ask()
