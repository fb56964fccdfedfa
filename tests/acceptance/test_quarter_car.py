"""A quarter car whose damper warms: what it is worth that the controller knows the temperature.

Cards are identified on the virtual rig's vehicle damper, from tests of a car's strokes and speeds, the lag as
well; the preview is the rule's. The damper is the rig's physics.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mrdamper
from mrdamper.control.controllers import controllers_for
from mrdamper.control.protocol import Controller, Measurement, Reference
from mrdamper.control.vehicle.car import Demand, QuarterCar, linear_quadratic
from mrdamper.control.vehicle.drive import Ride, RoadSegment, Vehicle, drive_car
from mrdamper.control.vehicle.long_drive import LongDrive, Thermometer, drive_long
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.data.records import Dataset, RigRun
from mrdamper.excitation import Road
from mrdamper.models.card import ModelCard
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import PRESETS, Plant

pytestmark = pytest.mark.nightly

CAMPAIGN = Campaign.from_toml(Path(__file__).parents[2] / "examples" / "vehicle_campaign.toml")
CAR = QuarterCar()
FASTEST_M_S = 4.0


@cache
def runs() -> tuple[RigRun, ...]:
    return tuple(run for run, _ in measure(PRESETS["vehicle"], CAMPAIGN, seed=1))


def card(which: str) -> ModelCard:
    """Return the card that knows temperature, one of 20 degC alone, or one pooled over all."""
    wanted = tuple(run for run in runs() if which != "cold" or "_020C_" in run.name)
    made: ModelCard = mrdamper.fit(
        Dataset(wanted),
        "double-bouc-wen",
        temperature="auto" if which == "aware" else "none",
        hold_out=CAMPAIGN.hold_out if which != "cold" else (),
    ).card()
    return made


@cache
def controller(which: str) -> Controller:
    return controllers_for(card(which), largest=2.0, speed_m_s=FASTEST_M_S)["recommended"]


@cache
def demand() -> Demand:
    return linear_quadratic(CAR)


@cache
def ride(which: str, degrees: float) -> Ride:
    """Return a minute of class C road."""
    vehicle = Vehicle(CAR, demand(), Plant(PRESETS["vehicle"]))
    if which == "ideal":
        vehicle = Vehicle(CAR, demand())
    elif which != "passive":
        vehicle = replace(vehicle, controller=controller(which))
    return drive_car(vehicle, RoadSegment(temperature_degC=degrees))


def test_a_hot_car_rides_better_when_its_controller_knows_that_it_is_hot():
    """Asked: acceleration at most 0.85, tyre load at most 0.80 of those of a card identified at 20 degC."""
    aware, cold, pooled = (ride(which, 123.0) for which in ("aware", "cold", "pooled"))
    assert aware.body_acceleration_m_s2 <= 0.85 * cold.body_acceleration_m_s2
    assert aware.tyre_load_N <= 0.80 * cold.tyre_load_N
    assert aware.body_acceleration_m_s2 < pooled.body_acceleration_m_s2
    assert aware.tyre_load_N < pooled.tyre_load_N


def test_at_20_degrees_there_is_nothing_to_know():
    aware, cold = ride("aware", 20.0), ride("cold", 20.0)
    assert aware.body_acceleration_m_s2 == pytest.approx(cold.body_acceleration_m_s2, rel=0.03)
    assert aware.tyre_load_N == pytest.approx(cold.tyre_load_N, rel=0.03)


def test_it_lies_between_the_ideal_damper_and_none():
    for degrees in (20.0, 123.0):
        comfort = [ride(which, degrees).body_acceleration_m_s2 for which in ("ideal", "aware", "passive")]
        assert comfort == sorted(comfort)


class WithinReach:
    """The damper without lag and error: the demand at once, between its forces at no and the largest current.

    No controller can follow the demand more closely. It is its own controller, too: the demand is passed on
    as it is.
    """

    name, needs_force, period_s, preview_s = "within-reach", False, 1e-3, 0.0

    def __init__(self, damper: Plant) -> None:
        self.ends = damper.copy(), damper.copy()
        self.wanted, self.step_s = 0.0, damper.step_s

    def copy(self) -> WithinReach:
        return self

    def start(self) -> None:
        return None

    def step(self, _state: None, reference: Reference, _measurement: Measurement) -> tuple[None, float]:
        self.wanted = reference.now
        return None, 0.0

    def advance(self, x: float, v: float, _current: float, degrees: float) -> float:
        forces = [
            end.advance(x, v, amperes, degrees) for end, amperes in zip(self.ends, (0.0, 2.0), strict=True)
        ]
        return min(max(self.wanted, min(forces)), max(forces))


def test_over_roads_b_to_d_it_holds_the_wheel_and_rides_as_the_damper_can():
    """Medians of ten seeds, aware over unaware at 123 degC; beside it what the damper's reach alone allows.

    Smooth roads ask for less force than the damper has without current: there knowing the temperature cannot
    help comfort, and the aware car rides as a damper would that gives the demand wherever it is within reach.
    """
    damper = Plant(PRESETS["vehicle"])
    for road, most_N in (("B", 0.88), ("C", 0.82), ("D", 0.82)):
        shares = []
        for seed in range(1, 11):
            drive = RoadSegment(
                road=Road(road, 20.0, seed), duration_s=20.0, temperature_degC=123.0, seed=seed
            )
            aware, cold = (
                drive_car(Vehicle(CAR, demand(), damper, controller(which)), drive)
                for which in ("aware", "cold")
            )
            reached = WithinReach(damper)
            able = drive_car(Vehicle(CAR, demand(), reached, reached), drive)
            ideal = drive_car(Vehicle(CAR, demand()), drive)
            names = ("weighted_acceleration_m_s2", "body_acceleration_m_s2", "tyre_load_N")
            over = [
                getattr(each, name) / getattr(cold, name) for name in names for each in (aware, able, ideal)
            ]
            bodies = [each.body_acceleration_m_s2 / ideal.body_acceleration_m_s2 for each in (aware, able)]
            shares.append([*over, *bodies])
        found = np.median(shares, axis=0)
        weighted, body, tyre, over_ideal = found[:3], found[3:6], found[6:9], found[9:]
        rows = zip(
            ("weighted", "body", "tyre", "over ideal"), (weighted, body, tyre, over_ideal), strict=True
        )
        print(f"{road}, aware, within reach, ideal:", *(f"{name} {np.round(row, 2)}" for name, row in rows))
        assert weighted[0] < 1.04 * weighted[1]
        assert over_ideal[0] < 1.08 * over_ideal[1]
        assert body[0] < 0.9
        assert tyre[0] < most_N


@pytest.mark.parametrize("road", ["B", "C", "D"])
def test_estimated_states_cost_little(road):
    """Over true ones at 123 degC, medians of ten seeds; and the errors of the speeds."""
    true = Vehicle(CAR, demand(), Plant(PRESETS["vehicle"]), controller("aware"))
    names = ("weighted_acceleration_m_s2", "body_acceleration_m_s2", "tyre_load_N")
    found: dict[bool, list[list[float]]] = {False: [], True: []}
    for seed in range(1, 11):
        drive = RoadSegment(road=Road(road, 20.0, seed), duration_s=20.0, temperature_degC=123.0, seed=seed)
        known = drive_car(true, drive)
        for wheel, rows in found.items():
            told = drive_car(replace(true, sensors=VehicleSensors(wheel_accelerometer=wheel)), drive)
            assert told.state_errors is not None
            over = [getattr(told, name) / getattr(known, name) for name in names]
            rows.append([*over, told.state_errors[1], told.state_errors[3]])
    for wheel, rows in found.items():
        weighted, body, tyre, body_m_s, wheel_m_s = np.median(rows, axis=0)
        print(
            f"{road}, wheel {wheel}: weighted {weighted:.3f}, body {body:.3f}, tyre {tyre:.3f}; "
            f"speeds {1e3 * body_m_s:.0f}, {1e3 * wheel_m_s:.0f} mm/s"
        )
        assert weighted < 1.02
        assert body < 1.03
        assert tyre < 1.02


def journey_error(thermometer: Thermometer | None) -> float:
    """Return the RMS force error [N] over half an hour."""
    plan = LongDrive(every_s=120.0)
    if thermometer is not None:
        plan = replace(plan, thermometer=thermometer)
    vehicle = Vehicle(CAR, demand(), Plant(PRESETS["vehicle"]), controller("aware"))
    return float(np.sqrt(np.mean(drive_long(vehicle, plan).force_error_N ** 2)))


def test_a_thermocouple_on_the_housing_will_do_with_a_guess_of_the_gradient():
    """The gradient is the power over a conductance that is 30 % wrong: at most 1.3 times the error."""
    told_true = journey_error(None)
    for wrong in (0.7, 1.3):
        guessed = journey_error(lambda _fluid, housing, power, g=6.0 * wrong: housing + power / g)  # type: ignore[misc]
        assert guessed <= 1.3 * told_true
