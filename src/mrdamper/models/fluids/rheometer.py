"""Fits of rheometer tables, shared parts: the statistics of a small least-squares fit, its conditions.

All fits are least squares of the logarithm (a rheometer errs in percent). Laws of one table are compared by
AICc. Standard errors are those of independent scatter; ``enlargement_of`` says by how much more when the
neighbouring points of a temperature ramp err together. The laws are fitted in ``viscosity_fit`` and
``yield_fit``; reading tables is the business of ``data.rheometer``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.errors import InputError
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import ZERO_CELSIUS_K

__all__ = [
    "VALID_K",
    "BoolArray",
    "FittedParameter",
    "aicc_of",
    "counted",
    "covariance_of",
    "enlargement_of",
    "fall_of",
    "fitted_parameters",
    "in_celsius",
    "require_positive",
    "require_temperatures",
    "rms_percent_of",
    "span_in_celsius",
    "within",
]


VALID_K = (233.15, 403.15)
"""-40 to 130 degC: points outside are kept out of every law."""

_LEAST_SPAN_K = 10.0  # temperatures closer together than this tell no law
_EXACT = 1e-12  # scatter below which a table is computed, not measured


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """A number of a fitted law; the standard error is NaN where the table does not determine it."""

    name: str
    unit: str
    value: float
    standard_error: float


def fall_of(
    factor: TemperatureFactor, covariance: FloatArray, cold_K: float, hot_K: float
) -> tuple[float, float]:
    """Return a factor's fall between two temperatures [%], and its standard error from its numbers'."""
    temperatures = np.array([cold_K, hot_K])
    cold, hot = factor.value(temperatures)
    gradient = factor.gradient(temperatures)
    slope = gradient[:, 1] / cold - hot * gradient[:, 0] / cold**2
    known = np.isfinite(np.diag(covariance))  # a number on its limit counts as known
    slope, covariance = slope[known], covariance[np.ix_(known, known)]
    variance = float(slope @ covariance @ slope) if known.any() else float("nan")
    return 100.0 * (1.0 - float(hot / cold)), 100.0 * float(np.sqrt(variance))


def covariance_of(columns: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of numbers for independent scatter; NaN without points to spare."""
    count, size = columns.shape
    if count <= size:
        return np.full((size, size), np.nan)
    scale = np.linalg.norm(columns, axis=0)
    factor = np.linalg.pinv(columns / scale)
    return np.asarray(factor @ factor.T / np.outer(scale, scale) * (residual @ residual) / (count - size))


def enlargement_of(residual: FloatArray) -> float:
    """Return by how much standard errors grow when neighbours err together: lag-1 correlation r.

    sqrt[(1 + r) / (1 - r)], as for a mean of first-order autoregressive scatter; 1 unless r is above
    2 / sqrt(n), what independent scatter reaches once in forty tables.
    """
    total = float(residual @ residual)
    if residual.size < 8 or not total > residual.size * _EXACT**2:
        return 1.0
    r = float(residual[1:] @ residual[:-1]) / total
    return float(np.sqrt((1.0 + r) / (1.0 - r))) if r > 2.0 / np.sqrt(residual.size) else 1.0


def aicc_of(residual: FloatArray, parameters: int) -> float:
    """Return Akaike's criterion with its small-sample term; the scatter counts as one number more."""
    count, size = residual.size, parameters + 1
    if count <= size + 1:
        return float("inf")
    mean_square = max(float(residual @ residual) / count, _EXACT**2)
    return float(count * np.log(mean_square) + 2.0 * size * count / (count - size - 1))


def rms_percent_of(residual: FloatArray) -> float:
    """Return the root mean square of logarithmic residuals, in percent of the value."""
    return 100.0 * float(np.sqrt(np.mean(residual**2)))


def fitted_parameters(
    names: Sequence[str], units: Sequence[str], values: Sequence[float], covariance: FloatArray
) -> tuple[FittedParameter, ...]:
    """Return the numbers of a law with the standard errors that a covariance holds."""
    errors = np.sqrt(np.diag(covariance))
    return tuple(
        FittedParameter(name, unit, value, float(error))
        for name, unit, value, error in zip(names, units, values, errors, strict=True)
    )


def within(kelvin: FloatArray, ends: tuple[float, float]) -> BoolArray:
    """Return which temperatures lie within a range, its ends included."""
    return np.asarray((kelvin >= ends[0] - 1e-6) & (kelvin <= ends[1] + 1e-6))


def require_positive(values: FloatArray, what: str, unit: str, kelvin: FloatArray, place: str) -> None:
    """Refuse a value that is not positive, with its temperature."""
    bad = ~((values > 0.0) & np.isfinite(values))
    if bad.any():
        raise InputError(
            place=place,
            found=(
                f"{what} is {values[bad][0]:g} {unit} at {in_celsius(kelvin[bad][0])} "
                f"({counted(bad, 'such point')})"
            ),
            expected="a positive number",
            remedy="Correct the point, or leave its row out",
        )


def require_temperatures(
    kelvin: FloatArray, least: int, place: str, valid_K: tuple[float, float], why: str
) -> None:
    """Refuse a table whose temperatures cannot tell a law."""
    distinct = np.unique(np.round(kelvin, 1)).size
    span = float(np.ptp(kelvin)) if kelvin.size else 0.0
    if distinct >= least and span >= _LEAST_SPAN_K:
        return
    found = (
        "no temperature"
        if not distinct
        else "one temperature"
        if distinct == 1
        else f"{distinct} temperatures"
    )
    over = f" ({span_in_celsius((float(kelvin.min()), float(kelvin.max())))})" if distinct > 1 else ""
    at = f" ({in_celsius(float(kelvin[0]))})" if distinct == 1 else over
    raise InputError(
        place=place,
        found=f"{found}{at} within {span_in_celsius(valid_K)}",
        expected=f"at least {least}, {_LEAST_SPAN_K:g} K or more apart: {why}",
        remedy="Measure at more temperatures, such as 20, 40, 60, 80 and 100 degC",
    )


def counted(members: BoolArray, word: str) -> str:
    """Return how many there are, as messages say it."""
    count = np.count_nonzero(members)
    return f"{count} {word}{'' if count == 1 else 's'}"


def in_celsius(kelvin: float) -> str:
    """Return a temperature as messages say it."""
    return f"{kelvin - ZERO_CELSIUS_K:.4g} degC"


def span_in_celsius(ends: tuple[float, float]) -> str:
    """Return a range of temperatures as messages say it."""
    return f"{ends[0] - ZERO_CELSIUS_K:.4g} to {ends[1] - ZERO_CELSIUS_K:.4g} degC"
