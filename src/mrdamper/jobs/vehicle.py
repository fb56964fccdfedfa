"""A car, its top mount and its sensors, from the options of the jobs that have them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

from mrdamper.control.vehicle.car import QuarterCar
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.errors import UsageError, option
from mrdamper.jobs.options import CarOptions
from mrdamper.schema import fields_of

OF_CAR = tuple(field.name for field in fields(CarOptions))
OF_SENSORS = tuple(field.name for field in fields(VehicleSensors))
"""Names of the options of a car, and of its sensors."""


def car_of(options: CarOptions) -> QuarterCar:
    """Return body, wheel, spring and tyre; end stops where the options have them."""
    return QuarterCar(**_shared(QuarterCar, options))


def mount_of(options: CarOptions, damping_N_s_m: float = 0.0) -> TopMount | None:
    """Return the top mount; None: the rod is bolted to the body."""
    if options.mount_N_m is None:
        return None
    return TopMount(stiffness_N_m=options.mount_N_m, damping_N_s_m=damping_N_s_m)


def sensors_of(options: CarOptions) -> VehicleSensors:
    """Return what tells the car's states."""
    return VehicleSensors(**_shared(VehicleSensors, options))


def _shared(record: type[QuarterCar | VehicleSensors], options: CarOptions) -> dict[str, Any]:
    """Return the record's fields that options of the same names tell."""
    names = [field.name for field in fields(record)]
    return {name: getattr(options, name) for name in names if hasattr(options, name)}


def refuse_idle(options: CarOptions, names: Iterable[str], needed: str) -> None:
    """Refuse options of these names that differ from their defaults; only what is ``needed`` uses them.

    Raises
    ------
    UsageError
        With the options' names.
    """
    idle = [
        option(field.flag.removeprefix("--"))
        for field in fields_of(type(options))
        if field.name in names and getattr(options, field.name) != field.default
    ]
    if idle:
        raise UsageError(f"nothing uses {', '.join(idle)}", remedy=f"add {needed}, or leave it out")
