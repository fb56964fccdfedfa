"""A car, its top mount and its sensors, from the options of the jobs that have them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from mrdamper.control.vehicle.car import QuarterCar
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.jobs.options import CarOptions


def car_of(options: CarOptions) -> QuarterCar:
    """Return body, wheel, spring and tyre; end stops where the options have them."""
    return QuarterCar(**_shared(QuarterCar, options))


def mount_of(options: CarOptions) -> TopMount | None:
    """Return the top mount; None: the rod is bolted to the body."""
    if options.mount_N_m is None:
        return None
    return TopMount(stiffness_N_m=options.mount_N_m, damping_N_s_m=options.mount_damping_N_s_m)


def sensors_of(options: CarOptions) -> VehicleSensors:
    """Return what tells the car's states."""
    return VehicleSensors(**_shared(VehicleSensors, options))


def _shared(record: type[QuarterCar | VehicleSensors], options: CarOptions) -> dict[str, Any]:
    """Return the record's fields that options of the same names tell."""
    names = [field.name for field in fields(record)]
    return {name: getattr(options, name) for name in names if hasattr(options, name)}
