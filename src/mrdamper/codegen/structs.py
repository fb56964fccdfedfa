"""Compute the values of the C structs ``mrd_track`` (model or controller) and ``mrd_thermal`` of the kernel.

This module assigns the tables that Python computed to the members of the C structs, which ``controller.h``
and ``thermal.h`` declare. ``c_code`` prints the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrdamper.control.controllers import ForceController
from mrdamper.control.realtime import RealtimeDamper
from mrdamper.control.tables.card_tables import CURVES, SPEEDS
from mrdamper.control.tables.lookup import LookupTable
from mrdamper.control.tables.series import Power, SeriesTables
from mrdamper.thermal.compact import PARTS, POINT_COUNT, UPDATE_S, CompactModel, sensor_gains, typical_power

_STILL_K, FROZEN_K, _WRONG_K = 0.1, 5.0, 25.0
HORIZON_S = 7200.0  # upper limit of the predicted time until a limit is reached; equals MRD_THERMAL_HORIZON


@dataclass(frozen=True, slots=True)
class Table:
    """A struct member that points to an array of numbers."""

    values: NDArray[np.float64]
    comment: str


@dataclass(frozen=True, slots=True)
class Nested:
    """A struct member that is itself a struct."""

    members: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Pointer:
    """A struct member that points to a struct of the C type ``kind``, or to nothing if members is None."""

    kind: str
    members: Mapping[str, Value] | None


Value = float | int | tuple[float, ...] | Table | Nested | Pointer


def track_members(part: RealtimeDamper | ForceController) -> dict[str, Value]:
    """Return the members of the C struct ``mrd_track`` for a model or a controller."""
    tables = part.tables
    pieces, terms, _ = tables.factor.shape
    currents, columns = tables.column.shape
    return {
        **_config(part.config).members,
        "currents": currents,
        "pieces": pieces,
        "levels": tables.levels,
        "begin": tables.begin,
        "row": tables.rows,
        "quarter": tables.quarters,
        "current": Table(tables.currents, f"[{currents} commands] of the columns of the tables [A or V]"),
        "factor": Table(tables.factor, f"[{pieces} temperature pieces][{terms} terms][3], parabolas"),
        "column": Table(tables.column, f"[{currents} commands][{columns} terms], factors of the command"),
        **{name: _lookup(table) for name, table in zip((*CURVES, *SPEEDS), tables.lookups, strict=True)},
        "series": Pointer("mrd_series", None if tables.series is None else _series(tables.series)),
    }


def _config(part: Any) -> Nested:  # noqa: ANN401 - a configuration or one of its parts
    """Return the members of a configuration, or of one of its parts, in the order of the C struct."""
    values = {each.name: getattr(part, each.name) for each in fields(part)}
    return Nested(
        {
            name: _config(value) if is_dataclass(value) else value if isinstance(value, float) else int(value)
            for name, value in values.items()
        }
    )


def _series(tables: SeriesTables) -> dict[str, Value]:
    planes, sheets, commands = tables.yield_force.shape
    powers = {
        "thinning": tables.thinning,
        "leak": tables.leak,
        "viscous": tables.viscous,
        "gas": tables.gas,
    }
    functions = {"side": tables.side, "fade": tables.fade}
    return {
        "currents": commands,
        "yield": Table(tables.interleaved, f"[{sheets} temperatures][{commands} commands][{planes} planes]"),
        "chain": Table(tables.chain, f"[{sheets} temperatures][{tables.chain.shape[1]} coefficients]"),
        **{name: _power(table) for name, table in powers.items()},
        **{name: _lookup(table) for name, table in functions.items()},
    }


def _power(table: Power) -> Nested:
    return Nested(
        {
            "exponent": table.exponent,
            "lowest": table.least,
            "top": table.top,
            "bits": table.bits,
            "octaves": len(table.scale),
            "scale": Table(table.scale, f"power function: factors of {len(table.scale)} octaves"),
            "cell": Table(table.cell, f"power function: cubics of {len(table.cell)} cells in one octave"),
        }
    )


def _lookup(table: LookupTable) -> Nested:
    cells = len(table.cell)
    return Nested(
        {
            "offset": table.offset,
            "top": table.top,
            "bits": table.bits,
            "cells": cells,
            "cell": Table(table.cell, f"lookup function: cubics of {cells} cells"),
        }
    )


def steps_between_updates(period_s: float) -> int:
    """Return the number of control periods between two updates of the thermal states (half a second)."""
    return max(round(UPDATE_S / period_s), 1)


def thermal_members(model: CompactModel, period_s: float, amperes_per_command: float) -> dict[str, Value]:
    """Return the members of the C struct ``mrd_thermal`` for a compact thermal model.

    ``period_s`` is the control period. ``amperes_per_command`` is the coil current divided by the command
    [A/A or A/V]; 0 if it is unknown.
    """
    power_filter_s = 30.0  # time constant of the smoothed power that predicts the time to a limit
    # *Missing heat* is a heat flow that the thermal model does not contain. It is estimated from temperature
    # readings. Without a valid reading, the estimate decays with this time constant.
    missing_heat_decay_s = 1800.0
    missing_heat_max_ratio = 0.3  # upper limit of the missing heat, divided by the typical power
    command_min_A = 0.2  # A current below this value is too small to measure the coil resistance.
    surface_kind_count_max = 8
    n, kinds, every = model.states, len(model.law), steps_between_updates(period_s)
    update, power, films = every * period_s, typical_power(model), model.films
    points = len(PARTS) * POINT_COUNT
    rows = np.vstack([model.fluid, model.coil, model.spots.reshape(points, n)])
    through = np.vstack(
        [model.fluid_feedthrough, model.coil_feedthrough, model.spots_feedthrough.reshape(points, 2)]
    )
    law = (*model.law, *[0] * (surface_kind_count_max - kinds))
    limits = {f"limit_{part}": float(each) for part, each in zip(PARTS, model.limits, strict=True)}
    return {
        "states": n,
        "kinds": kinds,
        "every": every,
        "speeds": len(films.speed),
        "differences": len(films.above),
        "update": update,
        "reference": model.reference,
        "film_ambient": float(films.ambient[1]),
        "film_width": float(films.ambient[1] - films.ambient[0]),
        "air_speed": model.air_speed,
        "coil_heat": model.resistance * amperes_per_command**2,
        "resistance": model.resistance,
        "least_command": command_min_A / amperes_per_command if amperes_per_command else 1e6,
        "smoothing": update / power_filter_s,
        "most_excess": missing_heat_max_ratio * power,
        "fading": float(np.exp(-update / missing_heat_decay_s)),
        "still": _STILL_K,
        "frozen_change": FROZEN_K,
        "wrong": _WRONG_K,
        **limits,
        "law": law,
        "capacity": Table(model.capacity, f"[{n} states], heat capacity [J/K]"),
        "conductance": Table(model.conductance, f"[{n} states], conductance [W/K]"),
        "mechanical": Table(model.mechanical, f"[{n} states], fraction of the mechanical power"),
        "electrical": Table(model.electrical, f"[{n} states], fraction of the coil heat"),
        "area": Table(model.loss, f"[{kinds} kinds of surface][{n}][{n}], area [m^2]"),
        "mean": Table(model.mean, f"[{kinds} kinds of surface][{n}], mean temperature"),
        "radiation": Table(model.radiation, f"[{kinds} kinds of surface], radiation [W/(m^2 K^4)]"),
        "mount": Table(model.mount, f"[{kinds} kinds of surface], conductance of the mount [W/(m^2 K)]"),
        "speed": Table(films.speed, "air speed [m/s]"),
        "above": Table(films.above, "surface minus ambient [K]"),
        "film": Table(
            films.film, "[laws][3 ambients][speeds][differences], heat-transfer coefficient [W/(m^2 K)]"
        ),
        "row": Table(rows, f"[{len(rows)} temperatures][{n} states]: temperature of a part per state [K/K]"),
        "through": Table(
            through, f"[{len(rows)} temperatures][power, coil heat], direct effect of heat [K/W]"
        ),
        "gain": Table(
            sensor_gains(model, update), f"[2 sensors][{n} states, missing heat]: corrections per kelvin"
        ),
    }
