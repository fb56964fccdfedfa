"""Fits of rheometer tables: viscosity versus temperature, yield stress versus field and temperature.

All functions are fitted by ``scipy.optimize.curve_fit`` to the logarithm of the values, because the error of
a rheometer is a percentage. If several functions are fitted, the function with the smallest Akaike criterion
(AICc) is used. Standard errors assume independent errors of the points. ``data.rheometer`` reads the tables.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m
from mrdamper.models.temperature import Arrhenius, Linear, Reynolds, TemperatureFactor, Vft
from mrdamper.quantities import REFERENCE_K, to_degC

VALID_K = (233.15, 403.15)
"""Temperatures of the points that are fitted [K], -40 to 130 degC. Points outside are ignored."""

HOT_K = 373.15  # Reports state the decrease of viscosity or yield stress from 20 to 100 degC.


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """A fitted parameter; its standard error is NaN if it is fixed or at a bound."""

    name: str
    unit: str
    value: float
    standard_error: float


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A fitted function: a value at 20 degC times a temperature factor.

    The value at 20 degC is ``at_reference`` for a viscosity, and the function ``field_law`` of the field for
    a yield stress.
    """

    name: str
    factor: TemperatureFactor
    parameters: tuple[FittedParameter, ...]
    rms_percent: float  # root mean square of the relative residuals
    aicc: float  # Akaike information criterion (corrected for few points); infinite for too few points
    fall_percent: float  # decrease of the value from 20 to 100 degC
    fall_standard_error_percent: float
    at_reference: float = 1.0
    field_law: Carlson | None = None

    def value(self, temperature_K: FloatArray, field_A_m: FloatArray | float = 0.0) -> FloatArray:
        """Return the viscosity [Pa s] or yield stress [Pa]."""
        level = self.at_reference if self.field_law is None else self.field_law.stress(field_A_m)
        return np.asarray(level * self.factor.value(temperature_K))


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """All functions that were fitted to one quantity, best first, and the data points.

    For a viscosity, the field ``field_A_m`` is zero at all points.
    """

    fits: tuple[LawFit, ...]
    temperature_K: FloatArray  # shape (n,), rising
    field_A_m: FloatArray
    value: FloatArray  # viscosity [Pa s] or yield stress [Pa]
    used: BoolArray  # True for points that were fitted
    notes: tuple[str, ...]

    @property
    def best(self) -> LawFit:
        return self.fits[0]


def fit_viscosity(
    temperature_K: FloatArray, viscosity_Pa_s: FloatArray, *, place: str = "viscosity table"
) -> Study:
    """Fit the functions of Arrhenius, Reynolds, and Vogel, Fulcher and Tammann (VFT).

    VFT needs at least six temperatures.

    Parameters
    ----------
    temperature_K, viscosity_Pa_s : the points [K], [Pa s], shape (n,), in any order
    place : origin of the points, for messages

    Raises
    ------
    InputError
        If a value is not positive, or there are too few temperatures.
    """
    order = np.argsort(temperature_K, kind="stable")
    kelvin, viscosity = temperature_K[order], viscosity_Pa_s[order]
    used = _is_valid(kelvin)
    _require_points(kelvin, viscosity, used, 3, place)
    t, y = kelvin[used], np.log(viscosity[used])
    start = float(np.exp(np.interp(REFERENCE_K, t, y)))
    fits = [
        _fit_viscosity(kind, t, y, (start, rate)) for kind, rate in ((Reynolds, 0.02), (Arrhenius, 1500.0))
    ]
    notes = []
    if np.unique(t).size >= 6:
        fits.append(_fit_viscosity(Vft, t, y, (start, 800.0, 150.0)))
    else:
        notes.append(f"{place}: the VFT law is not fitted, because it needs six temperatures")
    fits.sort(key=lambda fit: fit.aicc)
    low, high = float(t[0]), float(t[-1])
    if low > REFERENCE_K + 2.0 or high < HOT_K - 2.0:
        span = f"{to_degC(low):.4g} to {to_degC(high):.4g} degC"
        notes.append(f"{place}: the points are at {span}; the fall from 20 to 100 degC is extrapolated")
    notes += _common_notes(fits[0], used, "viscosity", place)
    return Study(tuple(fits), kelvin, np.zeros_like(kelvin), viscosity, used, tuple(notes))


def _fit_viscosity(
    kind: type[Reynolds] | type[Arrhenius] | type[Vft], t: FloatArray, y: FloatArray, start: Sequence[float]
) -> LawFit:
    """Fit ln eta = ln eta_20 + ln factor(T) to logarithms of viscosities ``y`` at temperatures ``t`` [K]."""
    pole_min_K = -500.0  # A VFT law with its pole below this temperature is practically the Reynolds law.
    pole_margin_K = 5.0  # The pole of a VFT law is at least this far below the lowest measured temperature.
    low, high = [0.0, -np.inf, pole_min_K], [np.inf, np.inf, min(float(t[0]), REFERENCE_K) - pole_margin_K]

    def logarithm(kelvin: FloatArray, level: float, *parameters: float) -> FloatArray:
        return np.asarray(np.log(level) + np.log(kind(*parameters).value(kelvin)))

    size = len(start)
    values, covariance = _curve_fit(logarithm, t, y, start, low[:size], high[:size])
    factor = kind(*values[1:])
    return _law_fit(
        kind.kind,
        factor,
        ("at_20degC_Pa_s", *factor.parameter_names),
        ("Pa s", *factor.units),
        values,
        covariance,
        y - logarithm(t, *values),
        at_reference=float(values[0]),
    )


def fit_yield_stress(
    field_A_m: FloatArray,
    temperature_K: FloatArray,
    stress_Pa: FloatArray,
    *,
    place: str = "yield stress table",
) -> Study:
    """Fit the yield stress: Carlson's function of the field times a linear factor.

    The factor is linear in temperature. The field scale H_s is fitted if there are at least three field
    strengths and six points. Otherwise H_s has Carlson's value.

    Parameters
    ----------
    field_A_m, temperature_K, stress_Pa : the points, shape (n,); points at zero field are not fitted
    place : origin of the points, for messages

    Raises
    ------
    InputError
        If a stress in a field is not positive, or there are too few points or temperatures.
    """
    order = np.lexsort((np.abs(field_A_m), temperature_K))
    field, kelvin, stress = np.abs(field_A_m)[order], temperature_K[order], stress_Pa[order]
    used = _is_valid(kelvin) & (field > 0.0)
    _require_points(kelvin, np.where(field > 0.0, stress, 1.0), used, 2, place)
    h, t, y = field[used], kelvin[used], np.log(stress[used])
    if h.size < 3:
        raise InputError(
            place=place,
            found=f"{h.size} yield stresses in a field",
            expected="at least 3",
            remedy="Measure more fields or temperatures",
        )
    fits = [_fit_yield_stress(h, t, y, is_free=False)]
    if np.unique(h).size >= 3 and h.size >= 6:
        fits.append(_fit_yield_stress(h, t, y, is_free=True))
    fits.sort(key=lambda fit: fit.aicc)
    notes = _common_notes(fits[0], used, "yield stress", place)
    law = fits[0].field_law
    if law is not None and h.max() < 0.5 * law.field_scale_A_m:
        notes.append(
            f"{place}: fields reach {h.max() / 1e3:.3g} kA/m, so that the saturation is extrapolated"
        )
    return Study(tuple(fits), kelvin, field, stress, used, tuple(notes))


def _fit_yield_stress(h: FloatArray, t: FloatArray, y: FloatArray, *, is_free: bool) -> LawFit:
    """Fit ln tau = ln saturation + ln(1 - slope x) + ln tanh(H / scale).

    x is the temperature minus 20 degC. If ``is_free`` is False, scale has Carlson's value.
    """
    factor_min = 0.01  # The fit keeps the linear factor above this value.
    x = t - REFERENCE_K
    coldest, hottest = min(float(x.min()), -1.0), max(float(x.max()), 1.0)

    def logarithm(
        _: FloatArray, saturation: float, slope: float, scale: float = FIELD_SCALE_A_m
    ) -> FloatArray:
        return np.asarray(np.log(saturation * np.tanh(h / scale)) + np.log(1.0 - slope * x))

    start = [float(np.exp(y.max())), 0.0, float(h.mean())]
    low = [0.0, (1.0 - factor_min) / coldest, 1e-2 * float(h.max())]
    high = [np.inf, (1.0 - factor_min) / hottest, 1e2 * float(h.max())]
    size = 3 if is_free else 2
    values, covariance = _curve_fit(logarithm, t, y, start[:size], low[:size], high[:size])
    residual = y - logarithm(t, *values)
    return _law_fit(
        "carlson-free-scale" if is_free else "carlson",
        Linear(float(values[1])),
        ("saturation_Pa", "temperature_slope", "field_scale_A_m")[:size],
        ("Pa", "1/K", "A/m")[:size],
        values,
        covariance,
        residual,
        field_law=Carlson(float(values[0]), float(values[2]) if is_free else FIELD_SCALE_A_m),
    )


def _curve_fit(
    law: Callable[..., FloatArray],
    t: FloatArray,
    y: FloatArray,
    start: Sequence[float],
    low: Sequence[float],
    high: Sequence[float],
) -> tuple[FloatArray, FloatArray]:
    """Return the fitted parameters and their covariance.

    The covariance is NaN for parameters at a bound, and for all parameters if there are too few points.
    """
    from scipy.optimize import OptimizeWarning, curve_fit

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptimizeWarning)  # A singular covariance is set to NaN below.
        values, covariance = curve_fit(
            law, t, y, start, bounds=(low, high), x_scale="jac", ftol=1e-12, xtol=1e-12, gtol=1e-12
        )
    fixed = np.isclose(values, low, rtol=1e-6, atol=0.0) | np.isclose(values, high, rtol=1e-6, atol=0.0)
    covariance = np.where(np.isfinite(covariance), covariance, np.nan)
    covariance[fixed] = covariance[:, fixed] = np.nan
    return values, covariance


def _law_fit(  # noqa: PLR0913 - all parts of one fit
    name: str,
    factor: TemperatureFactor,
    names: Sequence[str],
    units: Sequence[str],
    values: FloatArray,
    covariance: FloatArray,
    residual: FloatArray,
    *,
    at_reference: float = 1.0,
    field_law: Carlson | None = None,
) -> LawFit:
    """Return the fit with standard errors, residuals and the decrease from 20 to 100 degC."""
    errors = np.sqrt(np.diag(covariance))
    # The first parameter is the value at 20 degC. The parameters of the temperature factor are next.
    size = len(factor.parameters)
    known = np.isfinite(errors[1 : 1 + size])
    slope = factor.gradient(HOT_K)[known]
    part = covariance[1 : 1 + size, 1 : 1 + size][np.ix_(known, known)]
    # The variance of the residuals also counts as a parameter in the AICc. The value 1e-24 avoids the
    # logarithm of zero.
    count, size_all = residual.size, values.size + 1
    spare = count - size_all - 1
    square = max(float(np.mean(residual**2)), 1e-24)
    return LawFit(
        name=name,
        factor=factor,
        parameters=tuple(map(FittedParameter, names, units, values.tolist(), errors.tolist())),
        rms_percent=100.0 * float(np.sqrt(np.mean(residual**2))),
        aicc=count * float(np.log(square)) + 2.0 * size_all * count / spare if spare > 0 else np.inf,
        fall_percent=100.0 * (1.0 - float(factor.value(HOT_K))),
        fall_standard_error_percent=100.0 * float(np.sqrt(slope @ part @ slope)) if known.any() else np.nan,
        at_reference=at_reference,
        field_law=field_law,
    )


def _is_valid(kelvin: FloatArray) -> BoolArray:
    return np.asarray((kelvin >= VALID_K[0] - 1e-6) & (kelvin <= VALID_K[1] + 1e-6))


def _require_points(kelvin: FloatArray, values: FloatArray, used: BoolArray, count: int, place: str) -> None:
    """Raise InputError if a value is not positive or if there are too few temperatures."""
    # A temperature dependence cannot be fitted to a smaller range of temperatures.
    temperature_span_min_K = 10.0
    bad = ~((values > 0.0) & np.isfinite(values))
    if bad.any():
        raise InputError(
            place=place,
            found=f"the value at {to_degC(kelvin[bad][0]):.4g} degC is {values[bad][0]:g} (SI)",
            expected="a positive number",
            remedy="Correct the point, or delete its row",
        )
    temperatures = np.unique(np.round(kelvin[used], 1))
    if temperatures.size < count or np.ptp(temperatures) < temperature_span_min_K - 0.05:
        raise InputError(
            place=place,
            found=f"{temperatures.size} temperature(s) within -40 to 130 degC",
            expected=f"at least {count}, over {temperature_span_min_K:g} K or more",
            remedy="Measure at more temperatures, such as 20, 40, 60, 80 and 100 degC",
        )


def _common_notes(best: LawFit, used: BoolArray, quantity: str, place: str) -> list[str]:
    notes = []
    count = int(np.count_nonzero(~used))
    if count:
        notes.append(f"{place}: {count} point(s) outside -40 to 130 degC or without field are not fitted")
    if best.fall_percent < 0.0:
        notes.append(f"{place}: the {quantity} rises with temperature; check the table")
    return notes
