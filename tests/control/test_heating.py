"""A frozen thermometer is found out by the energy put in; one that reads a balance is not accused."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.realtime import RealtimeDamper, realtime_model
from mrdamper.control.stepper import Flag
from mrdamper.control.tables.heating import NO_HEATING, Heating
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network
from tests.control.dampers import DOUBLE
from tests.oracles.closed_form import constant_heating

PERIOD, ROOM = 5e-3, 293.15  # a slow sampling will do: half an hour is 360,000 steps
MOTION = Sine(15e-3, 1.0)
PAPER = read_drawing("paper")
WHOLE = Heating.paper()
FROZEN = int(Flag.FROZEN_TEMPERATURE)


def model(heating: Heating = WHOLE, **changed: Any) -> RealtimeDamper:
    return realtime_model(DOUBLE, period_s=PERIOD, heating=heating, **changed)


def rows(seconds: float, *, current: float = 2.0, kelvin: Any = ROOM) -> FloatArray:
    t = PERIOD * np.arange(round(seconds / PERIOD))
    out = np.empty((len(t), 4))
    out[:, 0], out[:, 1] = MOTION.displacement(t), MOTION.velocity(t)
    out[:, 2], out[:, 3] = current, kelvin
    return out


def power_of(kelvin: float, current: float = 2.0) -> float:
    """Return the mean work of the damper's force over whole periods [W]."""
    told = rows(4.0, current=current, kelvin=kelvin)
    quiet = model(NO_HEATING)
    force = quiet.run(quiet.start(), told)[1]
    return float((force * told[:, 1])[400:].mean())


def first(flags: NDArray[np.int64]) -> float:
    """Return when the flag is raised first [s]; infinite if never."""
    raised = np.flatnonzero(flags & FROZEN)
    return PERIOD * float(raised[0]) if raised.size else math.inf


# ------------------------------------------------------------------------------------- found out


@pytest.mark.parametrize("single", [False, True])
def test_a_reading_that_stands_still_is_flagged_when_the_energy_put_in_is_that_of_5_K(single):
    """From the surroundings' temperature on: no sooner than without losses, no later than with all."""
    made = model(single=single)
    _, _, flags = made.run(made.start(), rows(80.0))
    heat = power_of(ROOM) + 4.0 * PAPER.coil.resistance
    soonest = 5.0 * WHOLE.capacity_J_K / heat
    loss = WHOLE.loss_margin * WHOLE.loss_W_K
    # C dT/dt = P - G T with T(t) = 5 K
    latest = -WHOLE.capacity_J_K / loss * math.log(1.0 - 5.0 * loss / heat)
    assert 40.0 < soonest * 0.99 < first(flags) < latest * 1.01 < 60.0
    assert (flags[round(first(flags) / PERIOD) :] & FROZEN).all()


def test_a_controller_finds_out_as_the_model_does():
    """It counts one row of the force's table at a time; over a minute that is the whole force's work."""
    seconds = 75.0
    both: list[ForceController | RealtimeDamper] = [
        model(),
        controllers_for(DOUBLE, period_s=PERIOD, heating=WHOLE)["recommended"],
    ]
    t = PERIOD * np.arange(round(seconds / PERIOD))
    told = np.full((len(t), 5), np.nan)
    told[:, 0] = told[:, 1] = 5000.0 * np.sign(MOTION.velocity(t))  # more than there is: 2 A throughout
    told[:, 2], told[:, 3] = MOTION.displacement(t), ROOM
    times = [
        first(made.run(made.start(), given)[2])
        for made, given in zip(both, (rows(seconds), told), strict=True)
    ]
    assert times[1] == pytest.approx(times[0], rel=0.05)


def test_a_flagged_temperature_goes_on_by_the_energy_account_until_the_reading_moves():
    """As one body heated with constant power does; when the sensor wakes it is believed after 2 s."""
    made = model(extrapolate_temperature=True)
    told = rows(500.0)
    state, _, flags = made.run(made.start(), told)
    heat = power_of(ROOM) + 4.0 * PAPER.coil.resistance
    expected = constant_heating(500.0, heat, WHOLE.loss_W_K, WHOLE.capacity_J_K, ambient=ROOM, start=ROOM)
    risen = made.estimate(state).temperature - ROOM
    # the warmer the damper the less force: the account goes by the force at what it believes
    assert 0.85 * (float(expected) - ROOM) < risen < float(expected) - ROOM
    assert flags[-1] & FROZEN
    awake = rows(4.0, kelvin=ROOM + 12.0)
    state, _, flags = made.run(state, awake)
    assert not (flags & FROZEN).any()
    assert made.estimate(state).temperature == pytest.approx(ROOM + 12.0, abs=0.1)


def test_the_account_stays_within_the_limits_of_temperature():
    """All heat and no loss for ten minutes: 150 degC, no more."""
    made = model(replace(WHOLE, loss_W_K=0.0, capacity_J_K=100.0), extrapolate_temperature=True)
    state, force, _ = made.run(made.start(), rows(600.0))
    assert made.estimate(state).temperature == pytest.approx(423.15)
    assert np.isfinite(force).all()


def test_without_being_asked_to_extrapolate_the_model_only_says_so():
    told = rows(100.0)
    plain, none = model(), model(NO_HEATING)
    _, force, flags = plain.run(plain.start(), told)
    _, same, quiet = none.run(none.start(), told)
    np.testing.assert_array_equal(force, same)
    assert (flags & FROZEN).any()
    assert not (quiet & FROZEN).any()


def test_noise_or_a_gap_in_the_reading_is_no_standstill():
    """One count of noise now and then clears the account; a gap does not."""
    made = model()
    noisy, gap = rows(150.0), rows(150.0)
    noisy[::2000, 3] += 0.25
    gap[::500, 3] = math.nan
    assert first(made.run(made.start(), noisy)[2]) == math.inf
    assert first(made.run(made.start(), gap)[2]) < 150.0


def test_a_damper_at_rest_may_read_one_temperature_for_ever():
    """Warm, cold, or in surroundings far from those that were stated."""
    for kelvin in (253.15, ROOM, 353.15):
        told = rows(900.0, current=0.0, kelvin=kelvin)
        told[:, 0] = told[:, 1] = 0.0
        made = model()
        assert first(made.run(made.start(), told)[2]) == math.inf


# ------------------------------------------------------------------------------------- not accused


@cache
def warming(drawing: DamperDrawing, seconds: float, current: float) -> FloatArray:
    """Return the fluid's temperature of the zone network [K], from its surroundings' on, at every sample."""
    network = zone_network(drawing)
    warm = [float(k) for k in np.linspace(drawing.surroundings.ambient, 400.0, 5)]
    powers = [power_of(k, current) for k in warm]

    def power_at(kelvin: FloatArray) -> FloatArray:
        return np.asarray(np.interp(kelvin, warm, powers))

    course = simulate_network(network, [Load(seconds, power_at, current**2 * drawing.coil.resistance)])
    return np.asarray(np.interp(PERIOD * np.arange(round(seconds / PERIOD)), course.time, course.fluid))


@pytest.mark.nightly
@pytest.mark.parametrize("fins", [True, False])
@pytest.mark.parametrize("step_K", [0.1, 0.25, 1.0, 3.0])
def test_half_an_hour_into_balance_with_a_coarse_thermometer_accuses_nobody(fins, step_K):
    """The network of zones as the damper, its reading in steps, no noise; the account is one body's."""
    drawing = PAPER if fins else PAPER.with_sink(None)
    made = model(Heating.of_drawing(drawing))
    kelvin = np.round(warming(drawing, 1800.0, 1.0) / step_K) * step_K
    if fins and step_K >= 1.0:  # in the end one reading for minutes
        still = PERIOD * np.diff(np.flatnonzero(np.diff(kelvin)), append=len(kelvin)).max()
        assert still > 60.0
    assert first(made.run(made.start(), rows(1800.0, current=1.0, kelvin=kelvin))[2]) == math.inf


@pytest.mark.parametrize("wrong", [0.7, 1.4])
def test_a_loss_that_is_stated_a_third_wrong_accuses_nobody_in_balance(wrong):
    """A quarter of an hour of one reading at the temperature where the damper is in balance."""
    kelvin = float(warming(PAPER, 5400.0, 1.0)[-1])
    made = model(replace(WHOLE, loss_W_K=wrong * WHOLE.loss_W_K))
    assert first(made.run(made.start(), rows(900.0, current=1.0, kelvin=kelvin))[2]) == math.inf


# ------------------------------------------------------------------------------------- the numbers


def test_a_drawing_s_numbers_are_those_of_its_network():
    """In balance 60 K above ambient the loss is the heat put in, by the network of one node."""
    bare = Heating.of_drawing(PAPER.with_sink(None))
    assert bare.capacity_J_K == pytest.approx(zone_network(PAPER.with_sink(None)).total_capacity)
    assert WHOLE.loss_W_K > 3.0 * bare.loss_W_K
    assert WHOLE.capacity_J_K > bare.capacity_J_K
    assert WHOLE.source == f"drawing {PAPER.name}"
    assert WHOLE.config("A", extrapolate=True).coil_heat == PAPER.coil.resistance
    assert WHOLE.config("V", extrapolate=True).coil_heat == 0.0
    driver = replace(WHOLE, amperes_per_volt=0.5)
    assert driver.config("V", extrapolate=True).coil_heat == pytest.approx(0.25 * PAPER.coil.resistance)


def test_a_capacity_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="capacity_J_K is nan; expected a finite number, 0 or more"):
        replace(WHOLE, capacity_J_K=math.nan)
