"""A quarter car on the virtual rig's vehicle damper: comfort and road holding, temperature known and not.

Cards are identified on ``examples/vehicle_campaign.toml``, their lag as well; the preview is the rule's. The
car, its road (class C at 20 m/s, seed 5) and its demands are those of ``control.vehicle``. Part of
``python -m bench tracking``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

import mrdamper
from bench.measure import Asked, Row
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.vehicle import (
    LongDrive,
    QuarterCar,
    Ride,
    Stretch,
    Thermometer,
    Vehicle,
    drive_car,
    groundhook,
    hybrid,
    linear_quadratic,
    skyhook,
    warm_up,
)
from mrdamper.data.records import RigRun
from mrdamper.excitation import Road
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import PRESETS, Plant

__all__ = ["rows"]

CAMPAIGN = Path(__file__).parents[1] / "examples" / "vehicle_campaign.toml"
FASTEST_M_S = 4.0
OTHER_ROADS = (1, 2, 3)
WRONG = (0.7, 1.3)  # of the conductance between fluid and housing, as the observer believes it


def rows() -> Iterable[Row]:
    """Return every demand at 20 and 123 degC, other roads, and half an hour of warming up."""
    made = _controllers()
    car = QuarterCar()
    plain = Vehicle(car, linear_quadratic(car), Plant(PRESETS["vehicle"]))
    hot = Stretch(temperature_degC=123.0)
    for demand in (plain.demand, skyhook(), groundhook(), hybrid()):
        for stretch in (replace(hot, temperature_degC=20.0), hot):
            place = f"quarter car, {demand.name}, {stretch.temperature_degC:g} degC"
            ideal = drive_car(Vehicle(car, demand), stretch)
            yield Row(f"{place}: the demand itself", accuracy=_said(ideal))
            ridden = {
                name: drive_car(replace(plain, demand=demand, controller=each), stretch)
                for name, each in made.items()
            }
            for name, ride in ridden.items():
                is_asked = name == "aware" and stretch is hot and demand is plain.demand
                asked = _asked(ride, ridden["unaware (20 degC)"]) if is_asked else ()
                yield Row(
                    f"{place}: {name}, preview {1e3 * made[name].preview_s:.1f} ms",
                    accuracy=_said(ride),
                    asked=asked,
                )
    for stretch in (replace(hot, temperature_degC=20.0), hot):
        passive = _said(drive_car(plain, stretch))
        yield Row(f"quarter car, {stretch.temperature_degC:g} degC: passive", accuracy=passive)
    for seed in OTHER_ROADS:
        road = replace(hot, road=Road("C", 20.0, seed))
        aware, cold = (
            drive_car(replace(plain, controller=made[name]), road) for name in ("aware", "unaware (20 degC)")
        )
        yield Row(
            f"quarter car, {plain.demand.name}, 123 degC, road {seed}: aware over unaware",
            accuracy="{:.3f} in acceleration, {:.3f} in tyre load".format(*_ratios(aware, cold)),
        )
    yield from _warm_up(replace(plain, controller=made["aware"]))


def _controllers() -> dict[str, ForceController]:
    campaign = Campaign.from_toml(CAMPAIGN)
    runs: list[RigRun] = [run for run, _ in measure(PRESETS["vehicle"], campaign, seed=1)]
    cold = [run for run in runs if "_020C_" in run.name]
    law, hold_out = "double-bouc-wen", campaign.hold_out
    cards = {
        "aware": mrdamper.fit(runs, law, hold_out=hold_out).card(),
        "pooled": mrdamper.fit(runs, law, temperature="none", hold_out=hold_out).card(),
        "unaware (20 degC)": mrdamper.fit(cold, law, temperature="none").card(),
    }
    return {
        name: controllers_for(card, largest=2.0, speed_m_s=FASTEST_M_S)["recommended"]
        for name, card in cards.items()
    }


def _ratios(ride: Ride, other: Ride) -> tuple[float, float]:
    """Return acceleration and tyre load over those of another ride."""
    return (
        ride.body_acceleration_m_s2 / other.body_acceleration_m_s2,
        ride.tyre_load_N / other.tyre_load_N,
    )


def _asked(aware: Ride, cold: Ride) -> tuple[Asked, ...]:
    place, (acceleration, load) = (
        "quarter car, regulator, 123 degC, aware over unaware:",
        _ratios(aware, cold),
    )
    return (
        Asked(f"{place} body acceleration", 0.85, acceleration, "x"),
        Asked(f"{place} tyre load", 0.80, load, "x"),
    )


def _said(ride: Ride) -> str:
    comfort, holding = f"{ride.body_acceleration_m_s2:.3f} m/s2", f"{ride.tyre_load_N:.0f} N"
    error = "" if ride.force_error_N is None else f"; force error {ride.force_error_N:.0f} N"
    return f"body acceleration {comfort}, tyre load {holding} rms{error}"


def _warm_up(vehicle: Vehicle) -> Iterable[Row]:
    """Return the force error over half an hour, by what the controller is told of the temperature."""
    plan = LongDrive(every_s=120.0)
    true = plan.bodies.between_W_K

    def guessed(conductance: float) -> Thermometer:
        return lambda _fluid, housing, power: housing + power / conductance

    def error(plan: LongDrive) -> float:
        return float(np.sqrt(np.mean(warm_up(vehicle, plan).force_error_N ** 2)))

    known = error(plan)
    yield Row("warm-up of 30 min: fluid's temperature known", accuracy=f"force error {known:.0f} N rms")
    bare = error(replace(plan, thermometer=lambda _fluid, housing, _power: housing))
    yield Row("warm-up of 30 min: housing's temperature", accuracy=f"force error {bare:.0f} N rms")
    for wrong in WRONG:
        told = f"housing's and power over a conductance {100 * (wrong - 1):+.0f} % wrong"
        found = error(replace(plan, thermometer=guessed(wrong * true)))
        yield Row(
            f"warm-up of 30 min: {told}",
            accuracy=f"force error {found:.0f} N rms",
            asked=(
                Asked(f"warm-up, {told}: force error over that with the fluid's", 1.3, found / known, "x"),
            ),
        )
