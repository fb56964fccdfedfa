"""One damper's figures over its envelope: closed forms of a Bingham damper, and round places inside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.excitation import Sine, drive
from mrdamper.models.actuation import Actuation
from mrdamper.models.characterisation import (
    characterise,
    in_degrees,
    responses,
    round_down,
    spread_out,
    usual_scope,
)
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.force_band import ForceBand, MotionSize
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Linear

ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.23, 0.2))
REFERENCE = 293.15
LAGS = Actuation(0.004, 0.009, 0.002, 0.003)
BAND = ForceBand(
    share=0.9,
    factor=0.5,
    run_share=0.3,
    base_N=4.0,
    expected_nrmse_percent=2.0,
    worst_nrmse_percent=3.0,
    left_out="motions",
    folds=3,
)


def bingham(**changed: ParameterLaw) -> Damper:
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(900.0),
        "yield_force": Polynomial((60.0, 600.0)),
        "yield_velocity": Constant(1e-7),
        "offset": Constant(35.0),
        "stiffness": Constant(2000.0),
        **changed,
    }
    return Damper(LAWS["bingham"], forms, actuation=LAGS)


def warm(slope: float = 2e-3) -> Damper:
    return bingham(yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(slope)))


def test_every_figure_of_a_bingham_damper_is_its_closed_form():
    envelope = replace(ENVELOPE, temperature=(290.0, 374.0))
    damper = warm()
    found = characterise(damper, scope := usual_scope(damper, envelope))
    assert scope.commands == (0.0, 0.5, 1.0, 1.5, 2.0)
    assert scope.temperatures == pytest.approx((293.15, 333.15, 373.15))
    factor = 1.0 - 2e-3 * (np.array(scope.temperatures, dtype=float) - REFERENCE)
    yielding = factor[:, None, None] * (60.0 + 600.0 * np.array(scope.commands))[None, :, None]
    force = yielding + 900.0 * np.array(scope.speeds)
    assert found.extension == pytest.approx(force + 35.0, rel=1e-6)
    assert found.retraction == pytest.approx(35.0 - force, rel=1e-6)
    assert found.damping == pytest.approx(force, rel=1e-6)
    assert found.dynamic_range == pytest.approx(force[:, -1] / force[:, 0], rel=1e-6)
    motion = scope.motion
    assert motion.amplitude == scope.amplitude
    assert 2.0 * math.pi * motion.frequency * motion.amplitude == pytest.approx(scope.speeds[-1])
    viscous = math.pi * 900.0 * 2.0 * math.pi * motion.frequency * motion.amplitude**2
    energy = 4.0 * motion.amplitude * yielding[:, :, 0] + viscous
    assert found.energy == pytest.approx(energy, rel=1e-4)
    equivalent = energy / (2.0 * math.pi**2 * motion.frequency * motion.amplitude**2)
    assert found.equivalent_damping == pytest.approx(equivalent, rel=1e-4)
    for gas in found.gas:
        assert (gas.offset_N, gas.spring_rate_N_m) == pytest.approx((35.0, 2000.0), rel=1e-6)
    assert len(found.gas) == len(scope.commands)
    for t, curves in enumerate(found.curves):
        for i, curve in enumerate(curves):
            assert (curve.temperature, curve.command) == (scope.temperatures[t], scope.commands[i])
            assert curve.velocity == pytest.approx(scope.drawn)
            assert curve.damping == pytest.approx(yielding[t, i] + 900.0 * scope.drawn, rel=1e-6)


def test_a_force_that_is_linear_in_the_command_follows_it_in_the_command_s_own_times():
    damper = bingham()
    up, down = responses(damper, scope := usual_scope(damper, ENVELOPE))
    assert (up.start, up.end, down.start, down.end) == (0.0, 2.0, 2.0, 0.0)
    for way in (up, down):
        ends = way.start, way.end
        assert way.command_t63 == LAGS.response_time(0.63, *ends)
        assert way.command_t90 == LAGS.response_time(0.90, *ends)
        assert way.force_t63 == pytest.approx(way.command_t63, abs=2e-4)
        assert way.force_t90 == pytest.approx(way.command_t90, abs=2e-4)
        assert 0.0 < way.velocity <= 0.03
    slow = replace(damper, actuation=None, command_lag_s=0.02)
    for way in responses(slow, scope):
        assert way.command_t63 == pytest.approx(-0.02 * math.log(0.37), rel=1e-3)
        assert way.force_t90 == pytest.approx(-0.02 * math.log(0.1), abs=2e-4)
    assert responses(replace(damper, actuation=None), scope) == ()
    assert responses(damper, replace(scope, commands=(1.0,))) == ()
    for way in responses(bingham(yield_force=Constant(300.0)), scope):
        assert (way.force_t63, way.force_t90) == (None, None)
        assert way.command_t63 > 0.0


def test_a_weakest_command_without_force_has_no_dynamic_range():
    damper = bingham(yield_force=Polynomial((0.0, 600.0)), viscosity=Constant(0.0))
    assert np.isnan(characterise(damper, usual_scope(damper, ENVELOPE)).dynamic_range).all()


def test_the_weakest_and_strongest_command_are_those_of_least_and_largest_size():
    scope = usual_scope(bingham(), replace(ENVELOPE, command=(-2.0, 1.0)))  # -2, -1.25, -0.5, 0.25, 1
    assert [scope.commands[place] for place in scope.ends] == [0.25, -2.0]
    assert usual_scope(bingham(), replace(ENVELOPE, command=(1.0, 1.0))).commands == (1.0,)
    assert usual_scope(bingham(), ENVELOPE, commands=(2, 0, 1)).commands == (0.0, 1.0, 2.0)


def test_stroke_and_speeds_are_round_and_inside_the_envelope():
    scope = usual_scope(bingham(), ENVELOPE)
    assert scope.amplitude == 0.02
    assert len(scope.speeds) == 4
    assert 0.23 / 1.25 < scope.speeds[-1] <= 0.23
    assert (scope.drawn[-1], scope.drawn[0]) == pytest.approx((0.23, 0.02 * 0.23))
    assert np.all(np.diff(np.sqrt(scope.drawn), 2) == pytest.approx(0.0))
    # off the middle of the stroke: what both ways have, unless that is next to nothing
    assert usual_scope(bingham(), replace(ENVELOPE, displacement=(-0.01, 0.03))).amplitude == 0.01
    assert usual_scope(bingham(), replace(ENVELOPE, displacement=(0.0, 0.1))).amplitude == 0.05
    given = Sine(1e-3, 3.0)
    assert usual_scope(bingham(), ENVELOPE, motion=given).motion is given


@given(st.floats(1e-6, 1e6))
def test_a_round_number_is_the_largest_of_one_two_and_five_times_a_power_of_ten_below(value):
    found = round_down(value)
    mantissa = found / 10.0 ** math.floor(math.log10(found) + 1e-9)
    assert min(abs(mantissa - each) for each in (1.0, 2.0, 5.0)) < 1e-6
    assert found <= value * (1.0 + 1e-6)
    above = {1: 2.0, 2: 5.0, 5: 10.0}[round(mantissa)] / round(mantissa) * found
    assert value < above


@given(st.lists(st.integers(), max_size=12), st.integers(2, 6))
def test_spread_out_values_keep_order_and_ends_and_are_evenly_apart(values, most):
    found = spread_out(list(enumerate(values)), most)
    assert len(found) == min(len(values), most)
    places = [place for place, _ in found]
    assert places == sorted(set(places))
    if values:
        assert (places[0], places[-1]) == (0, len(values) - 1)
    if len(places) > 1:
        assert np.ptp(np.diff(places)) <= 1


@given(st.floats(243.0, 420.0), st.floats(0.0, 150.0))
def test_temperatures_are_round_inside_the_tested_ones_or_their_ends(low, span):
    damper = warm(slope=1e-4)
    found = usual_scope(damper, replace(ENVELOPE, temperature=(low, low + span))).temperatures
    kelvin = np.array(found, dtype=float)
    assert np.all((kelvin >= low - 1.0) & (kelvin <= low + span + 1.0))
    assert len(found) <= 3
    assert list(kelvin) == sorted(set(kelvin.tolist()))
    if span >= 42.0:
        steps = (kelvin - REFERENCE) / 20.0
        assert steps == pytest.approx(np.round(steps), abs=1e-9)
        assert kelvin[0] < low + 19.1
        assert kelvin[-1] > low + span - 19.1
    elif span < 4.9:
        assert found == (low,)


def test_temperatures_are_those_asked_for_none_without_and_up_to_those_assumed():
    assert usual_scope(bingham(), replace(ENVELOPE, temperature=(290.0, 374.0))).temperatures == (None,)
    assert usual_scope(warm(), ENVELOPE, temperatures=(350, 300)).temperatures == (300.0, 350.0)
    assert usual_scope(warm(), ENVELOPE).temperatures == (REFERENCE,)
    assumed = replace(warm(), temperature_range=(273.15, 353.15))
    tested = replace(ENVELOPE, temperature=(293.0, 294.0))
    assert usual_scope(assumed, tested).temperatures == pytest.approx((293.15, 313.15, 353.15), abs=20.1)
    assert usual_scope(assumed, tested).temperatures[-1] == pytest.approx(353.15)
    assert in_degrees(300.0) == pytest.approx(26.85)
    assert in_degrees(None) is None


def test_a_band_is_as_wide_as_force_run_and_base_make_it_and_covers_what_lies_inside():
    force = np.array([3.0, -4.0, 0.0, 5.0])
    mean_square = (9.0 + 16.0 + 25.0) / 4.0
    width = 0.5 * np.sqrt(force**2 + 0.09 * mean_square + 16.0)
    assert BAND.half_width(force) == pytest.approx(width)
    measured = force + np.array([0.99, -0.99, 1.01, -1.01]) * width
    assert BAND.coverage(force, measured) == 0.5


def test_a_motion_s_distance_is_the_larger_logarithm_to_the_nearest_and_widens_the_band_beyond_the_usual():
    """Half as fast is ln 2 away, and so is twice as large; a motion of constant speed has no distance."""
    size = MotionSize(0.01, 0.2)
    assert size.distance([MotionSize(0.01, 0.1), MotionSize(0.1, 0.2)]) == pytest.approx(math.log(2.0))
    assert size.distance([MotionSize(0.02, 0.1), MotionSize(0.01, 0.05)]) == pytest.approx(math.log(2.0))
    motion = drive(Sine(0.01, 2.0), duration=1.0, rate_Hz=400.0, command=0.0)
    own = MotionSize.of(motion)
    assert own.displacement_m == pytest.approx(0.01 / math.sqrt(2.0), rel=2e-3)
    assert own.velocity_m_s == pytest.approx(0.04 * math.pi / math.sqrt(2.0), rel=2e-3)
    double = MotionSize(own.displacement_m, 2.0 * own.velocity_m_s)
    band = replace(BAND, motions=(double,), usual_distance=0.5, widening=3.0)
    assert band.widened(motion) == pytest.approx(1.0 + 3.0 * (math.log(2.0) - 0.5))
    assert replace(band, usual_distance=0.7).widened(motion) == 1.0
    assert replace(band, motions=()).widened(motion) == 1.0
    for still in (
        replace(motion, velocity=0.0 * motion.time),
        replace(motion, displacement=0.0 * motion.time),
    ):
        assert band.widened(still) == 1.0
    force = np.array([3.0, -4.0])
    assert band.half_width(force, 2.5) == pytest.approx(2.5 * band.half_width(force))
    assert band.coverage(force, force + 2.0 * band.half_width(force), 2.5) == 1.0
    assert band.coverage(np.zeros(2), np.array([1.0, -1.0]) * band.half_width(np.zeros(2))) == 1.0


@pytest.mark.parametrize(
    ("fastest", "speeds"),
    [
        (1.0, (0.1, 0.2, 0.5, 1.0)),
        (0.29, (0.02, 0.05, 0.1, 0.25)),
        (0.35, (0.05, 0.1, 0.2, 0.3)),
        (0.79, (0.05, 0.1, 0.2, 0.6)),
        (0.119, (0.01, 0.02, 0.05, 0.1)),
    ],
)
def test_the_speeds_of_the_tables_are_one_two_and_five_below_the_one_next_to_the_fastest(fastest, speeds):
    envelope = replace(ENVELOPE, velocity=(-0.5 * fastest, fastest))
    assert usual_scope(bingham(), envelope).speeds == speeds


@pytest.mark.parametrize("factor", [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0])
def test_the_fastest_round_speed_itself_is_a_speed_of_the_tables(factor):
    """Ten steps a decade; a little faster is the same one."""
    for just in (1.0, 1.01):
        envelope = replace(ENVELOPE, velocity=(-0.1 * factor * just, 0.05))
        assert usual_scope(bingham(), envelope).speeds[-1] == pytest.approx(0.1 * factor)
