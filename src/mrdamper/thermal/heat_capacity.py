"""Heat capacities as polynomials in temperature: the table ``[heat_capacity]`` of a geometry file.

The finite-element model and the reduced model evaluate the polynomial of a part at the mean temperature of
the part. Models with constant heat capacities (networks, compact model) use the mean of the polynomial over
its temperature range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.polynomial import Polynomial, polynomial

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Option

Coefficients = tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class CapacityCurve:
    """A heat capacity: polynomial between two temperatures, constant below and above."""

    low: float  # lowest temperature of the polynomial [K]
    high: float  # highest temperature of the polynomial [K]
    coefficients: tuple[float, ...]  # coefficients of the powers of T - low, lowest power first

    def evaluate(self, kelvin: float) -> float:
        """Return the value of the curve at a temperature [K]."""
        x = min(max(kelvin, self.low), self.high) - self.low
        return float(polynomial.polyval(x, self.coefficients))

    def integral(self, kelvin: FloatArray) -> FloatArray:
        """Return the integral of the curve from ``low`` to temperatures [K]; the shape is unchanged."""
        x, width = np.asarray(kelvin, dtype=np.float64) - self.low, self.high - self.low
        inside = polynomial.polyval(np.clip(x, 0.0, width), polynomial.polyint(self.coefficients))
        below, above = (
            self.evaluate(self.low) * np.minimum(x, 0.0),
            self.evaluate(self.high) * np.maximum(x - width, 0.0),
        )
        return np.asarray(inside + below + above)

    @property
    def mean(self) -> float:
        """Return the mean of the curve from ``low`` to ``high``."""
        return float(self.integral(np.array(self.high))) / (self.high - self.low)

    def over_mean(self) -> CapacityCurve:
        """Return the curve divided by its mean."""
        mean = self.mean
        return CapacityCurve(self.low, self.high, tuple(each / mean for each in self.coefficients))


def _polynomial(part: str, unit: str = "J/(kg K)") -> Option:
    return Option(f"Coefficients for {part}: powers of the temperature in degC, lowest first.", unit=unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class PolynomialHeatCapacity:
    """Heat capacities c(T) = c0 + c1 T + c2 T^2 + ... of parts, with T in degC.

    Outside ``range_degC``, the heat capacities are constant.
    """

    range_degC: Annotated[tuple[Annotated[float, Option(least=-100.0, most=500.0)], ...], Option(unit="degC")]
    """Lowest and highest temperature of the polynomials."""
    fluid_J_kg_K: Annotated[Coefficients, _polynomial("the fluid")] = None
    body_J_kg_K: Annotated[Coefficients, _polynomial("tube and caps")] = None
    piston_J_kg_K: Annotated[Coefficients, _polynomial("the piston")] = None
    rod_J_kg_K: Annotated[Coefficients, _polynomial("the rod")] = None
    coil_J_kg_K: Annotated[Coefficients, _polynomial("the winding")] = None
    fins_J_kg_K: Annotated[Coefficients, _polynomial("the fins")] = None
    damper_J_K: Annotated[Coefficients, _polynomial("the whole damper without fins", "J/K")] = None

    def __post_init__(self) -> None:
        if len(self.range_degC) != 2 or not self.range_degC[0] < self.range_degC[1]:
            raise _fault(f"range_degC is {list(self.range_degC)}", "two rising temperatures")
        given = self._coefficients
        if not given:
            names = ", ".join(each.name for each in fields(self)[1:])
            raise _fault("no part has coefficients", f"at least one of: {names}")
        if "damper_J_K" in given and len(given.keys() - {"fins_J_kg_K"}) > 1:
            raise _fault("damper_J_K and single parts are both given", "the whole damper, or its parts")
        for name, coefficients in given.items():
            if not 1 <= len(coefficients) <= 6:
                raise _fault(f"{name} has {len(coefficients)} coefficients", "1 to 6")
            least = float(Polynomial(coefficients)(np.linspace(*self.range_degC, 101)).min())
            if not 0.0 < least < np.inf:
                raise _fault(f"{name} falls to {least:.4g} in its range", "finite heat capacities above zero")

    @property
    def _coefficients(self) -> dict[str, tuple[float, ...]]:
        values = {each.name: getattr(self, each.name) for each in fields(self)[1:]}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def parts(self) -> Mapping[str, CapacityCurve]:
        """Return the curve of each part by name [J/(kg K)]; the curve of the whole damper is in [J/K]."""
        low, high = (each + ZERO_CELSIUS_K for each in self.range_degC)
        shifted = Polynomial([self.range_degC[0], 1.0])
        return MappingProxyType(
            {
                name.split("_")[0]: CapacityCurve(low, high, tuple(Polynomial(value)(shifted).coef.tolist()))
                for name, value in self._coefficients.items()
            }
        )


def _fault(found: str, expected: str) -> InputError:
    return InputError(
        place="heat_capacity",
        found=found,
        expected=expected,
        remedy="Check the coefficients: powers of degC, J/(kg K) of a part, J/K of the whole damper",
    )
