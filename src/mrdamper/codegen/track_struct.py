"""Compute the values of the C struct ``mrd_track`` of the kernel for a real-time model or a controller.

This module assigns the tables that Python computed to the members of the C struct, which ``controller.h``
declares. ``c_code`` prints the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.control.config import Config, config_values
from mrdamper.control.controllers import ForceController
from mrdamper.control.realtime import RealtimeDamper
from mrdamper.control.tables.card_tables import CURVES, SPEEDS
from mrdamper.control.tables.lookup import LookupTable
from mrdamper.control.tables.series import Power, SeriesTables


@dataclass(frozen=True, slots=True)
class Table:
    """A struct member that points to an array of numbers."""

    values: NDArray[np.float64]
    comment: str


@dataclass(frozen=True, slots=True)
class Nested:
    """A struct member that is a struct."""

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
        **_config(part.config),
        "currents": currents,
        "pieces": pieces,
        "levels": tables.levels,
        "begin": tables.begin,
        "row": tables.rows,
        "quarter": tables.quarters,
        "current": Table(tables.currents, f"{currents} commands"),
        "factor": Table(tables.factor, f"[{pieces} pieces of temperature][{terms} terms][parabola]"),
        "column": Table(tables.column, f"[{currents} commands][{columns} terms]"),
        **{name: _lookup(table) for name, table in zip((*CURVES, *SPEEDS), tables.lookups, strict=True)},
        "series": Pointer("mrd_series", None if tables.series is None else _series(tables.series)),
    }


def _config(config: Config) -> dict[str, Nested]:
    """Return each part of a configuration as a struct whose members are in the order of the C struct."""
    return {
        part: Nested(
            {name: value if isinstance(value, float) else int(value) for name, value in values.items()}
        )
        for part, values in config_values(config).items()
    }


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
            "scale": Table(table.scale, f"factors of {len(table.scale)} octaves"),
            "cell": Table(table.cell, f"cubics of {len(table.cell)} cells, one octave"),
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
            "cell": Table(table.cell, f"cubics of {cells} cells"),
        }
    )
