"""The heat balance of a controller detects a stuck thermometer, but accepts a constant temperature."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import controllers_for
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
from tests.oracles.closed_form import constant_heating
from tests.support.cards import DOUBLE

PERIOD, ROOM = 5e-3, 293.15  # The long period limits a run of half an hour to 360,000 steps.
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
    """Return the mechanical power of the damper [W], averaged over whole periods of its motion."""
    told = rows(4.0, current=current, kelvin=kelvin)
    quiet = model(NO_HEATING)
    force = quiet.run(quiet.start(), told)[1]
    return float((force * told[:, 1])[400:].mean())


def first(flags: NDArray[np.int64]) -> float:
    """Return the time of the first raised flag [s], or infinity."""
    raised = np.flatnonzero(flags & FROZEN)
    return PERIOD * float(raised[0]) if raised.size else math.inf


# --- Detected faults --------------------------------------------------------------------------------------


@pytest.mark.parametrize("single", [False, True])
def test_stuck_thermometer_is_flagged_after_5_kelvin_rise(single):
    """The flag is raised at a calculated rise of 5 K, for a heat loss from zero to its assumed maximum."""
    made = model(single=single)
    _, _, flags = made.run(made.start(), rows(80.0))
    heat = power_of(ROOM) + 4.0 * PAPER.coil.resistance
    soonest = 5.0 * WHOLE.capacity_J_K / heat
    loss = WHOLE.loss_ratio_max * WHOLE.loss_W_K
    # The temperature rise T reaches 5 K at this time, from C dT/dt = P - G T.
    latest = -WHOLE.capacity_J_K / loss * math.log(1.0 - 5.0 * loss / heat)
    assert 40.0 < soonest * 0.99 < first(flags) < latest * 1.01 < 60.0
    assert (flags[round(first(flags) / PERIOD) :] & FROZEN).all()


def test_controller_and_model_flag_stuck_thermometer_simultaneously():
    """A controller and the damper model raise the flag at the same time within 5 %."""
    made = controllers_for(DOUBLE, period_s=PERIOD, heating=WHOLE)["recommended"]
    t = PERIOD * np.arange(round(75.0 / PERIOD))
    told = np.full((len(t), 5), np.nan)
    # The target is infeasible, so the command is always 2 A.
    told[:, 0] = told[:, 1] = 5000.0 * np.sign(MOTION.velocity(t))
    told[:, 2], told[:, 3] = MOTION.displacement(t), ROOM
    reference = first(model().run(model().start(), rows(75.0))[2])
    assert first(made.run(made.start(), told)[2]) == pytest.approx(reference, rel=0.05)


def test_heat_balance_extrapolates_stuck_temperature():
    """The estimate rises like the temperature of a single heat capacity until the sensor works again."""
    made = model(extrapolate_temperature=True)
    state, _, flags = made.run(made.start(), rows(500.0))
    heat = power_of(ROOM) + 4.0 * PAPER.coil.resistance
    expected = constant_heating(500.0, heat, WHOLE.loss_W_K, WHOLE.capacity_J_K, ambient=ROOM, start=ROOM)
    risen = made.estimate(state).temperature - ROOM
    # The force falls with temperature, so the estimate rises less than at constant power.
    assert 0.85 * (float(expected) - ROOM) < risen < float(expected) - ROOM
    assert flags[-1] & FROZEN
    state, _, flags = made.run(state, rows(4.0, kelvin=ROOM + 12.0))
    assert not (flags & FROZEN).any()
    assert made.estimate(state).temperature == pytest.approx(ROOM + 12.0, abs=0.1)


def test_extrapolated_temperature_never_exceeds_its_limit():
    made = model(replace(WHOLE, loss_W_K=0.0, capacity_J_K=100.0), extrapolate_temperature=True)
    state, force, _ = made.run(made.start(), rows(600.0))
    assert made.estimate(state).temperature == pytest.approx(423.15)
    assert np.isfinite(force).all()


def test_stuck_thermometer_flag_leaves_force_unchanged():
    told = rows(100.0)
    plain, none = model(), model(NO_HEATING)
    _, force, flags = plain.run(plain.start(), told)
    _, same, quiet = none.run(none.start(), told)
    np.testing.assert_array_equal(force, same)
    assert (flags & FROZEN).any()
    assert not (quiet & FROZEN).any()


# --- No false alarms ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kelvin", [253.15, ROOM, 353.15])
def test_constant_temperature_at_rest_is_valid(kelvin):
    told = rows(900.0, current=0.0, kelvin=kelvin)
    told[:, 0] = told[:, 1] = 0.0
    made = model()
    assert first(made.run(made.start(), told)[2]) == math.inf


@cache
def warming(drawing: DamperDrawing, seconds: float, current: float) -> FloatArray:
    """Simulate heating from ambient with the thermal network. Return the fluid temperature [K] by sample."""
    network = zone_network(drawing)
    warm = [float(k) for k in np.linspace(drawing.surroundings.ambient, 400.0, 5)]
    powers = [power_of(k, current) for k in warm]

    def power_at(kelvin: FloatArray) -> FloatArray:
        return np.asarray(np.interp(kelvin, warm, powers))

    course = simulate_network(network, [Load(seconds, power_at, current**2 * drawing.coil.resistance)])
    return np.asarray(np.interp(PERIOD * np.arange(round(seconds / PERIOD)), course.time, course.fluid))


@pytest.mark.nightly
@pytest.mark.parametrize("fins", [True, False])
@pytest.mark.parametrize("step_K", [0.1, 1.0, 3.0])
def test_coarse_temperature_reading_is_valid(fins, step_K):
    """The damper warms for half an hour until thermal balance. The reading is rounded and has no noise."""
    drawing = PAPER if fins else PAPER.with_sink(None)
    made = model(Heating.from_drawing(drawing))
    kelvin = np.round(warming(drawing, 1800.0, 1.0) / step_K) * step_K
    assert first(made.run(made.start(), rows(1800.0, current=1.0, kelvin=kelvin))[2]) == math.inf


@pytest.mark.parametrize("wrong", [0.7, 1.4])
def test_wrong_assumed_heat_loss_sets_no_flag(wrong):
    """In thermal balance, the reading is constant for 15 min. The assumed loss is wrong by 30 to 40 %."""
    kelvin = float(warming(PAPER, 5400.0, 1.0)[-1])
    made = model(replace(WHOLE, loss_W_K=wrong * WHOLE.loss_W_K))
    assert first(made.run(made.start(), rows(900.0, current=1.0, kelvin=kelvin))[2]) == math.inf


# --- Values of the heat balance ---------------------------------------------------------------------------


def test_heat_balance_uses_heat_capacity_of_geometry():
    bare = Heating.from_drawing(PAPER.with_sink(None))
    assert bare.capacity_J_K == pytest.approx(zone_network(PAPER.with_sink(None)).total_capacity)
    assert WHOLE.loss_W_K > 3.0 * bare.loss_W_K
    assert WHOLE.config("A", extrapolate=True).coil_heat == PAPER.coil.resistance
    assert WHOLE.config("V", extrapolate=True).coil_heat == 0.0
    driver = replace(WHOLE, amperes_per_volt=0.5)
    assert driver.config("V", extrapolate=True).coil_heat == pytest.approx(0.25 * PAPER.coil.resistance)


def test_invalid_heat_capacity_is_rejected():
    with pytest.raises(InputError, match="capacity_J_K is nan"):
        replace(WHOLE, capacity_J_K=math.nan)
