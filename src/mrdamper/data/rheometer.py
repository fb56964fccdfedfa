"""Rheometer tables: viscosity versus temperature, yield stress versus field and temperature, in SI.

A header contains a quantity and its unit: ``temperature_degC``, ``viscosity_mPas``, ``field_mT`` (flux
density) or ``field_kA_m`` (field strength), ``yield_stress_kPa``. The forms ``Viscosity [mPa s]``,
``Temperature (degC)`` and ``eta / Pa s`` are also accepted. A missing unit is an error. The module
``models.fluids.fits`` fits the fluid properties.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Table
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, is_unit, to_si


@dataclass(frozen=True, slots=True, eq=False)
class RheometerTable:
    """The values of one rheometer table in SI. A missing quantity is ``None``.

    ``viscosity`` is (temperature [K], viscosity [Pa s]). ``yield_stress`` is (field, temperature [K],
    stress [Pa]). The unit of the field is ``field_unit``: "T" (flux density) or "A/m" (field strength).
    """

    name: str
    viscosity: tuple[FloatArray, FloatArray] | None
    yield_stress: tuple[FloatArray, FloatArray, FloatArray] | None
    field_unit: str
    notes: tuple[str, ...]


class _Quantity(NamedTuple):
    words: str  # pattern of the names in headers
    units: Mapping[str, tuple[float, str]]  # unit without blanks, dots, slashes: (factor, SI unit)
    offered: str  # example headers for messages


_QUANTITIES: Mapping[str, _Quantity] = {
    "temperature": _Quantity("(?i:temperature|temp)|T", {}, "temperature_degC or temperature_K"),
    "viscosity": _Quantity(
        "(?i:dynamic viscosity|viscosity|eta)",
        {"Pas": (1.0, "Pa s"), "mPas": (1e-3, "Pa s"), "cP": (1e-3, "Pa s")},
        "viscosity_Pas or viscosity_mPas",
    ),
    "yield stress": _Quantity(
        "(?i:(?:(?:shear|dynamic|static) )?yield stress|tau y)",
        {"Pa": (1.0, "Pa"), "kPa": (1e3, "Pa")},
        "yield_stress_Pa or yield_stress_kPa",
    ),
    "field": _Quantity(
        "(?i:(?:magnetic )?flux density|magnetic field|field strength|field)|B|H",
        {"T": (1.0, "T"), "mT": (1e-3, "T"), "Am": (1.0, "A/m"), "kAm": (1e3, "A/m")},
        "field_mT, field_T or field_kA_m",
    ),
}
# A table with the first quantity of a pair must also contain the second quantity of the pair.
_REQUIRED = (("viscosity", "temperature"), ("yield stress", "temperature"), ("yield stress", "field"))


def read_rheometer_tables(given: Sequence[str | Path | RheometerTable]) -> list[RheometerTable]:
    """Return the rheometer tables in files. Items that are tables already are returned unchanged."""
    return [item if isinstance(item, RheometerTable) else read_rheometer(item) for item in given]


def read_rheometer(path: str | Path) -> RheometerTable:
    """Return the rheometer table in a file.

    Rows with a missing cell, and viscosities that were measured in a magnetic field, are ignored.

    Raise InputError if a column is missing, is duplicated, or has no valid unit, or if a temperature is
    implausible.
    """
    table = read_table(Path(path))
    try:
        return _rheometer_table(table, Path(path).name)
    except InputError as error:
        raise error.prepend_place(Path(path).name) from None


def _rheometer_table(table: Table, place: str) -> RheometerTable:
    headers = {what: header for what in _QUANTITIES if (header := _find_column(what, table.names))}
    used = {name for name, _ in headers.values()}
    found = ", ".join(map(repr, table.names))
    for what, needed in _REQUIRED:
        if what in headers and needed not in headers:
            raise InputError(f"{what} but no {needed} among {found}", expected=_offer(needed))
    if not {"viscosity", "yield stress"} & headers.keys():
        offered = f"{_offer('viscosity')}, or {_offer('yield stress')} with {_offer('field')}"
        raise InputError(f"neither viscosity nor yield stress among {found}", expected=offered)
    columns = {what: _to_si(table, *header, what) for what, header in headers.items()}
    kelvin, (field, field_unit) = columns["temperature"][0], columns.get("field", (None, ""))
    notes = [f"{place}: column {name!r} is not used" for name in table.names if name not in used]
    viscosity = yield_stress = None
    if "viscosity" in columns:
        eta = columns["viscosity"][0]
        in_field = np.isfinite(eta) & (np.nan_to_num(0.0 if field is None else field) != 0.0)
        if in_field.any():  # The viscosity in a magnetic field is a different quantity.
            notes.append(f"{place}: viscosities in a field left out: {int(np.count_nonzero(in_field))}")
        viscosity = _complete_rows("viscosity", kelvin, np.where(in_field, np.nan, eta))
    if "yield stress" in columns and field is not None:
        yield_stress = _complete_rows("yield stress", field, kelvin, columns["yield stress"][0])
    values = [columns[what][0] for what in ("viscosity", "yield stress") if what in columns]
    empty = np.isnan(values).all(axis=0)
    if empty.any():
        notes.append(f"{place}: rows without a value left out: {int(np.count_nonzero(empty))}")
    return RheometerTable(place, viscosity, yield_stress, field_unit, tuple(notes))  # type: ignore[arg-type]


def _offer(what: str) -> str:
    return f"a header such as {_QUANTITIES[what].offered}"


def _find_column(what: str, names: Sequence[str]) -> tuple[str, str] | None:
    """Return the header that names a quantity, and its unit; None if no header names the quantity."""
    words = _QUANTITIES[what].words.replace(" ", r"[\s_]+")
    form = re.compile(rf"(?:{words})(?:[\s_/\[({{,]+(.*?)[\])}}]*)?\s*")
    named = [(name, (match[1] or "").strip()) for name in names if (match := form.fullmatch(name.strip()))]
    good = [(name, unit) for name, unit in named if _factor(what, unit) is not None]
    if len(good) > 1:
        found = f"{len(good)} columns hold the {what}: {', '.join(repr(name) for name, _ in good)}"
        raise InputError(found, expected="one", remedy="Give each its own table")
    if named and not good:
        name, unit = named[0]
        problem = f"unit {unit!r} in {name!r} is not a unit of {what}" if unit else f"{name!r} has no unit"
        raise InputError(problem, expected=_offer(what))
    return good[0] if good else None


def _factor(what: str, unit: str) -> tuple[float, str] | None:
    """Return the conversion factor of a unit and the SI unit; None if the unit is invalid."""
    if what == "temperature":
        return (1.0, "K") if is_unit(unit, [what]) else None
    return _QUANTITIES[what].units.get(re.sub(r"[\s._*·/-]|(?<=m)\^?-1", "", unit))


def _to_si(table: Table, header: str, unit: str, what: str) -> tuple[FloatArray, str]:
    """Return the values of a column in SI, and their unit. Raise InputError for implausible temperatures."""
    if header not in table.columns:
        raise InputError(f"column {header!r} holds text", expected="numbers")
    if what != "temperature":
        factor, si_unit = _factor(what, unit) or (np.nan, "")
        return table.columns[header] * factor, si_unit
    kelvin = to_si(table.columns[header], unit, what)
    low, high = QUANTITIES[what].low, QUANTITIES[what].high
    bad = np.isfinite(kelvin) & ~((kelvin >= low) & (kelvin <= high))
    if bad.any():
        found = f"{header!r} holds {kelvin[bad][0]:g} K ({np.count_nonzero(bad)} such rows)"
        raise InputError(found, expected=f"{low:g} to {high:g} K", remedy="Check the unit in the header")
    return kelvin, "K"


def _complete_rows(what: str, *columns: FloatArray) -> tuple[FloatArray, ...]:
    complete = np.isfinite(columns).all(axis=0)
    if not complete.any():
        raise InputError(f"no row has every cell that a {what} law needs; fill them in")
    return tuple(np.compress(complete, columns, axis=1))
