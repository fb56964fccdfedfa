"""A quarter car on a rough road: a damper without current, the ideal one, and one with a controller.

The controller is made from a card that is identified here on the virtual rig's vehicle damper.
"""

from dataclasses import replace
from pathlib import Path

import mrdamper
from mrdamper.control.controllers import controllers_for
from mrdamper.control.vehicle.car import QuarterCar, linear_quadratic
from mrdamper.control.vehicle.drive import RoadSegment, Vehicle, drive_car
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import PRESETS, Plant

tests = Campaign.from_toml(Path(__file__).with_name("vehicle_campaign.toml"))
tests = replace(
    tests, temperatures_degC=(20.0, 110.0), currents_A=(0.0, 1.0, 2.0), held_out_temperatures_degC=()
)
runs = [run for run, _ in measure(PRESETS["vehicle"], tests)]
card = mrdamper.fit(runs, "double-bouc-wen").card()

car = QuarterCar()
demand, damper = linear_quadratic(car), Plant(PRESETS["vehicle"])
controller = controllers_for(card, largest=2.0, speed_m_s=4.0)["recommended"]
rides = {
    "no current": Vehicle(car, demand, damper),
    "controlled": Vehicle(car, demand, damper, controller),
    "ideal": Vehicle(car, demand),
}
for name, vehicle in rides.items():
    ride = drive_car(vehicle, RoadSegment(duration_s=20.0, temperature_degC=100.0))
    print(f"{name:10} body {ride.body_acceleration_m_s2:.2f} m/s2, tyre {ride.tyre_load_N:.0f} N")
