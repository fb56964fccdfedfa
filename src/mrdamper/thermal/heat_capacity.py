"""Heat capacity over temperature: a calorimeter's rows of a damper's parts, and the curve fitted to each.

The rows stand in the drawing's table ``[heat_capacity]``, or in a CSV file of the same columns. Each part's
curve is a parabola by least squares (a straight line through two rows), held at its ends beyond the rows.
Finite elements and reduced model follow it by each part's mean temperature; what takes constants (networks,
the exported states) takes its mean over the rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Option, did_you_mean

_PLACE = "heat_capacity"
_REMEDY = "Check the rows of the calorimeter: J/(kg K) of a part, J/K of the whole damper, over degC"
_DEGREE = 2

_Values = tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class CapacityCurve:
    """A parabola over temperature between two ends, held beyond them; equal curves are one value."""

    low: float  # [K]
    high: float  # [K]
    coefficients: tuple[float, ...]  # of powers of T - low, lowest first

    def at(self, kelvin: float) -> float:
        """Return the curve at a temperature [K]."""
        x = min(max(kelvin, self.low), self.high) - self.low
        return float(np.polynomial.polynomial.polyval(x, self.coefficients))

    def integral(self, kelvin: FloatArray) -> FloatArray:
        """Return the integral from the low end to temperatures [K], in their shape."""
        x, width = np.asarray(kelvin, dtype=np.float64) - self.low, self.high - self.low
        whole = np.polynomial.polynomial.polyint(self.coefficients)
        inside = np.polynomial.polynomial.polyval(np.clip(x, 0.0, width), whole)
        below, above = self.at(self.low) * np.minimum(x, 0.0), self.at(self.high) * np.maximum(x - width, 0.0)
        return np.asarray(inside + below + above)

    @property
    def mean(self) -> float:
        """Mean over the rows' temperatures."""
        return float(self.integral(np.array(self.high))) / (self.high - self.low)

    def over_mean(self) -> CapacityCurve:
        """Return the curve over its mean: a factor."""
        mean = self.mean
        return CapacityCurve(self.low, self.high, tuple(each / mean for each in self.coefficients))


@dataclass(frozen=True, slots=True)
class PartCapacity:
    """What was fitted to a part's rows."""

    curve: CapacityCurve  # [J/(kg K)], of the whole damper [J/K]
    residual: float  # root mean square over the mean [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredHeatCapacity:
    """A calorimeter's rows: temperatures and, for each part that was measured, one value a row."""

    temperature_degC: Annotated[
        tuple[Annotated[float, Option(least=-100.0, most=500.0)], ...],
        Option("Of the rows, rising.", unit="degC"),
    ]
    fluid_J_kg_K: Annotated[_Values, Option("Of the fluid.", unit="J/(kg K)")] = None
    body_J_kg_K: Annotated[_Values, Option("Of tube and caps.", unit="J/(kg K)")] = None
    piston_J_kg_K: Annotated[_Values, Option("Of the piston.", unit="J/(kg K)")] = None
    rod_J_kg_K: Annotated[_Values, Option("Of the rod.", unit="J/(kg K)")] = None
    coil_J_kg_K: Annotated[_Values, Option("Of the winding.", unit="J/(kg K)")] = None
    fins_J_kg_K: Annotated[_Values, Option("Of the fins.", unit="J/(kg K)")] = None
    damper_J_K: Annotated[_Values, Option("Of the whole damper without fins.", unit="J/K")] = None

    def __post_init__(self) -> None:
        rows = self.temperature_degC
        if len(rows) < 2:
            raise _fault(f"it has {len(rows)} row", "two rows or more, at temperatures that rise")
        if not (np.diff(rows) > 0.0).all():
            raise _fault("temperature_degC does not rise from row to row", "rising temperatures")
        given = {each.name: getattr(self, each.name) for each in fields(self)[1:]}
        for name, values in given.items():
            if values is not None:
                _check(name, rows, values)
        measured = [name for name, values in given.items() if values is not None]
        if not measured:
            raise _fault("no part has values", f"one or more of: {', '.join(given)}")
        if "damper_J_K" in measured and len(set(measured) - {"fins_J_kg_K"}) > 1:
            raise _fault(f"damper_J_K stands beside {measured[0]}", "the whole damper, or parts of it")
        self.parts  # noqa: B018 - a curve that cannot be is refused here

    @property
    def parts(self) -> Mapping[str, PartCapacity]:
        """What was fitted, by the part's name."""
        kelvin = np.array(self.temperature_degC) + ZERO_CELSIUS_K
        given = {each.name.split("_")[0]: getattr(self, each.name) for each in fields(self)[1:]}
        return MappingProxyType(
            {name: fit_capacity(kelvin, np.array(v)) for name, v in given.items() if v is not None}
        )


def fit_capacity(kelvin: FloatArray, values: FloatArray) -> PartCapacity:
    """Return the parabola (a line through two rows) by least squares; both shape (rows,), rising [K].

    Raises
    ------
    InputError
        The curve falls to zero or below between the rows.
    """
    low, high = float(kelvin[0]), float(kelvin[-1])
    x = kelvin - low
    found = np.polynomial.Polynomial.fit(x, values, min(_DEGREE, len(x) - 1)).convert().coef
    curve = CapacityCurve(low, high, tuple(map(float, found)))
    least = min(curve.at(each) for each in np.linspace(low, high, 101))
    if not least > 0.0:
        raise _fault(f"the curve through its rows falls to {least:.4g}", "heat capacities above zero")
    off = np.polynomial.polynomial.polyval(x, found) - values
    return PartCapacity(curve, float(np.sqrt(np.mean(off**2))) / curve.mean)


def read_heat_capacity(path: str | Path) -> MeasuredHeatCapacity:
    """Return a calorimeter's rows from a CSV file with the columns of ``[heat_capacity]``."""
    name = Path(path).name
    try:
        table = read_table(Path(path))
    except InputError as fault:
        rows = "a header and two rows of numbers or more"
        raise InputError(
            place=name, found=fault.found or str(fault), expected=rows, remedy=_REMEDY
        ) from fault
    known = [each.name for each in fields(MeasuredHeatCapacity)]
    for column in table.columns:
        if column not in known:
            raise InputError(place=name, found=f"unknown column {column!r}; {did_you_mean(column, known)}")
    if known[0] not in table.columns:
        raise InputError(place=name, found="no column temperature_degC", expected=f"{known[0]} and a part's")
    columns = {each: tuple(map(float, table.columns[each])) for each in table.columns}
    try:
        return MeasuredHeatCapacity(**columns)
    except InputError as fault:
        raise fault.within(name) from fault


def _check(name: str, rows: tuple[float, ...], values: tuple[float, ...]) -> None:
    if len(values) != len(rows):
        raise _fault(f"{name} has {len(values)} values for {len(rows)} temperatures", "one a row")
    for row, value in zip(rows, values, strict=True):
        if not 0.0 < value < np.inf:
            raise _fault(f"{name} is {value:g} at {row:g} degC", "heat capacities above zero")


def _fault(found: str, expected: str) -> InputError:
    return InputError(place=_PLACE, found=found, expected=expected, remedy=_REMEDY)
