"""The kernel's ``mrd_vehicle`` as a tree of values; member names are those of ``vehicle.h``."""

from __future__ import annotations

from mrdamper.control.vehicle.observer import DemandStep
from mrdamper.export.track_struct import Table, Value

_COMMENTS = {
    "predict": "[states][states], over a period",
    "before": "[states], of the body's acceleration at a period's begin",
    "present": "[states], ... at its end",
    "stroke": "[states and the body's acceleration]",
    "wheel": "[states and the body's acceleration]",
    "gain": "[states][stroke, wheel's acceleration]",
    "ahead": "[at the preview][4 states]",
}


DEMAND_GAINS = ("by_rattle", "by_body", "by_tyre", "by_wheel")
"""Members that hold the demand's gains, in the order of the states."""


def vehicle_members(asked: DemandStep) -> dict[str, Value]:
    """Return every member of a car's ``mrd_vehicle``."""
    return {
        "wheel_accelerometer": int(asked.sensors.wheel_accelerometer),
        "acceleration_driven": int(asked.demand.by_acceleration),
        "coast_samples": asked.coast_samples,
        "body": asked.car.body_kg,
        "spring": asked.car.spring_N_m,
        **dict(zip(DEMAND_GAINS, asked.demand.gains, strict=True)),
        **{name: Table(table, _COMMENTS[name]) for name, table in asked.tables.items()},
    }
