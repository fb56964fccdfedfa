"""The yield stress law fitted to a table of yield stress over field and temperature.

ln tau = ln tau_s + ln tanh(H / H_s) + ln[1 - k (T - 293.15 K)], the field scale H_s Carlson's or fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m
from mrdamper.models.fluids.rheometer import (
    VALID_K,
    BoolArray,
    FittedParameter,
    aicc_of,
    counted,
    covariance_of,
    fall_of,
    fitted_parameters,
    require_positive,
    require_temperatures,
    rms_percent_of,
    span_in_celsius,
    within,
)
from mrdamper.models.temperature import Linear
from mrdamper.quantities import REFERENCE_K


@dataclass(frozen=True, slots=True, eq=False)
class YieldFit:
    """Carlson's field law times a factor linear in temperature, fitted; see ``ViscosityFit``."""

    name: str  # "carlson" with his field scale, "carlson-free-scale" with a fitted one
    field_law: Carlson
    factor: Linear
    parameters: tuple[FittedParameter, ...]
    covariance: FloatArray
    rms_percent: float
    aicc: float
    residual: FloatArray
    limit: str

    def value(self, field_A_m: FloatArray, temperature_K: FloatArray) -> FloatArray:
        """Return the law's yield stress [Pa]."""
        return self.field_law.stress(field_A_m) * self.factor.value(temperature_K)

    def fall_percent(self, cold_K: float = REFERENCE_K, hot_K: float = 373.15) -> tuple[float, float]:
        """Return the fall between two temperatures [%], and its standard error (NaN when not known)."""
        return fall_of(self.factor, self.covariance[2:, 2:], cold_K, hot_K)


@dataclass(frozen=True, slots=True, eq=False)
class YieldStudy:
    """Both forms of the yield stress law, the better first, and the points they were fitted to."""

    fits: tuple[YieldFit, ...]
    field_A_m: FloatArray
    temperature_K: FloatArray
    stress_Pa: FloatArray
    used: BoolArray
    notes: tuple[str, ...]

    @property
    def best(self) -> YieldFit:
        return self.fits[0]


def fit_yield_stress(
    field_A_m: FloatArray,
    temperature_K: FloatArray,
    stress_Pa: FloatArray,
    *,
    place: str = "yield stress table",
) -> YieldStudy:
    """Fit Carlson's law times a factor linear in temperature to a yield stress table.

    Parameters
    ----------
    field_A_m, temperature_K, stress_Pa : the points, shape (n,); points without field stay out (the law is
        zero there), as do those outside ``VALID_K``
    place : as in ``fit_viscosity``

    Raises
    ------
    InputError
        A stress that is not positive in a field, or too few points, fields or temperatures.
    """
    order = np.lexsort((temperature_K, np.abs(field_A_m)))
    field, kelvin, stress = np.abs(field_A_m)[order], temperature_K[order], stress_Pa[order]
    in_field = field > 0.0
    require_positive(stress[in_field], "yield stress", "Pa", kelvin[in_field], place)
    valid = within(kelvin, VALID_K)
    used = valid & in_field
    require_temperatures(kelvin[used], 2, place, VALID_K, "the temperature slope of the yield stress is one")
    if np.count_nonzero(used) < 3:
        raise InputError(
            place=place,
            found=f"{np.count_nonzero(used)} yield stresses in a field",
            expected="at least 3: 2 numbers, and one point to judge them by",
            remedy="Measure more fields or temperatures",
        )
    h, t, y = field[used], kelvin[used], np.log(stress[used])
    fits = [_carlson(h, t, y, free_scale=False)]
    notes: list[str] = []
    if np.unique(h).size >= 3 and h.size >= 6:
        fits.append(_carlson(h, t, y, free_scale=True))
    else:
        notes.append(f"{place}: Carlson's field scale was kept: fitting it takes 3 fields and 6 points")
    fits.sort(key=lambda fit: (fit.aicc, fit.rms_percent))
    if not in_field.all():
        notes.append(f"{place}: {counted(~in_field, 'point')} without field left out: the law is zero there")
    if not valid.all():
        notes.append(f"{place}: {counted(~valid, 'point')} outside {span_in_celsius(VALID_K)} left out")
    if fits[0].factor.temperature_slope < 0.0:
        notes.append(f"{place}: the yield stress rises with temperature; check the table")
    if h.max() < 0.5 * fits[0].field_law.field_scale_A_m:
        notes.append(
            f"{place}: fields reach {h.max() / 1e3:.3g} kA/m, where the law is still "
            "almost straight: its saturation is extrapolated"
        )
    return YieldStudy(tuple(fits), field, kelvin, stress, used, tuple(notes))


def _carlson(h: FloatArray, t: FloatArray, y: FloatArray, *, free_scale: bool) -> YieldFit:
    """Fit ln tau = ln saturation + ln tanh(h / scale) + ln(1 - slope x), the scale Carlson's or free."""
    from scipy.optimize import least_squares

    x = t - REFERENCE_K
    moving = [0, 1, 2] if free_scale else [0, 2]
    start, low, high = _yield_bounds(h, x)

    def curve(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the law's logarithm, and its derivatives by ln saturation, ln scale and slope."""
        every = start.copy()
        every[moving] = parameters
        u = h / np.exp(every[1])
        factor = 1.0 - every[2] * x
        value = every[0] + np.log(np.tanh(u)) + np.log(factor)
        by_scale = -2.0 * u / np.sinh(np.minimum(2.0 * u, 700.0))
        return value, np.column_stack([np.ones_like(y), by_scale, -x / factor])[:, moving]

    def residual_of(parameters: FloatArray) -> FloatArray:
        return curve(parameters)[0] - y

    def jacobian_of(parameters: FloatArray) -> FloatArray:
        return curve(parameters)[1]

    if free_scale:
        start[1] = np.clip(start[1], low[1] + 0.1, high[1] - 0.1)
    start[0] = float(np.mean(y - curve(start[moving])[0]))
    solved = least_squares(
        residual_of,
        start[moving],
        jac=jacobian_of,
        bounds=(low[moving], high[moving]),
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=1000,
    )
    parameters = start.copy()
    parameters[moving] = solved.x
    residual = -np.asarray(solved.fun)
    limit = ""
    if free_scale and not low[1] + 0.01 < parameters[1] < high[1] - 0.01:
        limit = "its field scale rests on the end of what the fields of the table can tell"
    known = [k for k in moving if not (limit and k == 1)]
    columns = curve(solved.x)[1][:, [moving.index(k) for k in known]]
    covariance = _unscaled_covariance(parameters, known, covariance_of(columns, residual))
    saturation, scale, slope = (float(number) for number in parameters)
    field_law = Carlson(float(np.exp(saturation)), float(np.exp(scale)) if free_scale else FIELD_SCALE_A_m)
    return YieldFit(
        name="carlson-free-scale" if free_scale else "carlson",
        field_law=field_law,
        factor=Linear(slope),
        parameters=fitted_parameters(
            ("saturation_Pa", "field_scale_A_m", "temperature_slope"),
            ("Pa", "A/m", "1/K"),
            (field_law.saturation_Pa, field_law.field_scale_A_m, slope),
            covariance,
        ),
        covariance=covariance,
        rms_percent=rms_percent_of(residual),
        aicc=aicc_of(residual, len(moving)),
        residual=residual,
        limit=limit,
    )


def _unscaled_covariance(parameters: FloatArray, known: list[int], covariance: FloatArray) -> FloatArray:
    """Return the covariance of saturation, scale and slope from that of the logarithms of the first two.

    Shape (3, 3); NaN where a parameter is not ``known``.
    """
    by_logarithm = np.array([np.exp(parameters[0]), np.exp(parameters[1]), 1.0])
    found = np.full((3, 3), np.nan)
    found[np.ix_(known, known)] = covariance
    return np.asarray(found * np.outer(by_logarithm, by_logarithm))


def _yield_bounds(h: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return start and bounds of (ln saturation, ln scale, slope): the factor stays above 0.01."""
    coldest, hottest = float(x.min()), float(x.max())
    low = np.array([-np.inf, np.log(1e-2 * h.max()), 0.99 / coldest if coldest < -1.0 else -0.99])
    high = np.array([np.inf, np.log(1e2 * h.max()), 0.99 / hottest if hottest > 1.0 else 0.99])
    return np.array([0.0, np.log(FIELD_SCALE_A_m), min(1e-3, 0.5 * float(high[2]))]), low, high
