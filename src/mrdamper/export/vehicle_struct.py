"""The kernel's ``mrd_vehicle`` as a tree of values, and its numbers one by one, for the block of parameters.

Member names are those of ``vehicle.h``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from mrdamper.control.vehicle.observer import DemandStep
from mrdamper.export.track_struct import Value
from mrdamper.export.variable import Variable, tunable

_GAINS = ("by_rattle", "by_body", "by_tyre", "by_wheel")  # of the demand, in the order of the states
_MOST_GAIN = 1e7  # of a demand, either way [N/m], [N s/m]
_LARGE = 1e9  # for what has no bound of its own


class _Quantity(NamedTuple):
    """A state of the observer, or a reading; its unit is m/s^order."""

    name: str
    said: str
    order: int


class _Axes(NamedTuple):
    """What the rows and columns of a table stand for, and what an entry is."""

    rows: tuple[_Quantity, ...]
    columns: tuple[_Quantity, ...]
    said: str


_STATES = (
    _Quantity("rattle", "rattle space", 0),
    _Quantity("body", "speed of the body", 1),
    _Quantity("tyre", "tyre deflection", 0),
    _Quantity("wheel", "speed of the wheel", 1),
    _Quantity("body_bias", "bias of the body's accelerometer", 2),
    _Quantity("wheel_bias", "bias of the wheel's accelerometer", 2),
)
_STROKE = _Quantity("stroke", "stroke", 0)
_BODY = _Quantity("body_acceleration", "acceleration of the body", 2)
_WHEEL = _Quantity("wheel_acceleration", "acceleration of the wheel", 2)
_UNITS = {-2: "s2", -1: "s", 0: "1", 1: "1/s", 2: "1/s2"}  # of a row by a column, by their orders


def vehicle_members(asked: DemandStep) -> dict[str, Value]:
    """Return every member of a car's ``mrd_vehicle``."""
    return {
        "wheel_accelerometer": int(asked.sensors.wheel_accelerometer),
        "acceleration_driven": int(asked.demand.by_acceleration),
        "coast_samples": asked.coast_samples,
        "body": asked.car.body_kg,
        "spring": asked.car.spring_N_m,
        **dict(zip(_GAINS, asked.demand.gains, strict=True)),
        **{name: tuple(np.ravel(table).tolist()) for name, table in asked.tables.items()},
    }


def vehicle_numbers(asked: DemandStep) -> Iterator[Variable]:
    """Return what differs with car, sensors and gains of the demand, each with its place in the struct."""
    car, data = asked.car, "vehicle_data."
    yield tunable("vehicle_mass", "kg", car.body_kg, 1e-3, 1e6, "mass of the body", f"{data}body")
    said = "stiffness of the spring"
    yield tunable("vehicle_spring", "N/m", car.spring_N_m, 0.0, _LARGE, said, f"{data}spring")
    for member, state, gain in zip(_GAINS, _STATES[:4], asked.demand.gains, strict=True):
        unit, said = ("N.s/m" if state.order else "N/m"), f"wanted force of the {state.said}"
        yield tunable(f"demand_{member}", unit, gain, -_MOST_GAIN, _MOST_GAIN, said, f"{data}{member}")
    wheel = asked.sensors.wheel_accelerometer
    for table, axes in _axes(_STATES if wheel else _STATES[:-1]).items():
        for place, (row, column) in enumerate(product(axes.rows, axes.columns)):
            if _WHEEL in (row, column) and not wheel:
                continue  # no step reads it
            name = f"vehicle_{table}"
            name += f"_{row.name}" if len(axes.rows) > 1 else ""
            name += f"_by_{column.name}" if len(axes.columns) > 1 else ""
            unit, value = _UNITS[row.order - column.order], float(asked.tables[table].flat[place])
            said = axes.said.format(row=row.said, column=column.said)
            yield tunable(name, unit, value, -_LARGE, _LARGE, said, f"{data}{table}[{place}]")


def _axes(states: tuple[_Quantity, ...]) -> Mapping[str, _Axes]:
    """Return the axes of every table of an observer of these states."""
    after = "{row} after a period, of the {column} "
    expected = "{row} as expected, of the {column}"
    return {
        "predict": _Axes(states, states, f"{after}before it"),
        "before": _Axes(states, (_BODY,), f"{after}at its begin"),
        "present": _Axes(states, (_BODY,), f"{after}at its end"),
        "stroke": _Axes((_STROKE,), (*states, _BODY), expected),
        "wheel": _Axes((_WHEEL,), (*states, _BODY), expected),
        "gain": _Axes(
            states, (_STROKE, _WHEEL), "correction of the {row}, of the difference in the {column}"
        ),
        "ahead": _Axes(_STATES[:4], _STATES[:4], "{row} at the preview, of the {column} now"),
    }
