"""Viscosity laws fitted to a table of viscosity over temperature.

Arrhenius', Reynolds' and the VFT law are one curve, ln eta = ln eta_20 - b x / (1 + q x) with
x = T - 293.15 K: q = 0 is Reynolds' law, q = 1 / 293.15 K Arrhenius', a free q > 0 that of Vogel, Fulcher and
Tammann with the pole 293.15 K - 1/q and the temperature b / q^2. For a given q it is a straight line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.models.fluids.rheometer import (
    VALID_K,
    BoolArray,
    FittedParameter,
    aicc_of,
    counted,
    covariance_of,
    enlargement_of,
    fall_of,
    fitted_parameters,
    in_celsius,
    require_positive,
    require_temperatures,
    rms_percent_of,
    span_in_celsius,
    within,
)
from mrdamper.models.temperature import Arrhenius, Reynolds, TemperatureFactor, Vft
from mrdamper.quantities import REFERENCE_K

_POLE_MARGIN_K = 5.0  # a VFT pole stays this far below the coldest point
_REYNOLDS_POLE_K = -1e5  # and above this: there the exponent is Reynolds' within 0.1 %


@dataclass(frozen=True, slots=True, eq=False)
class ViscosityFit:
    """One viscosity law, fitted.

    ``residual`` is ln(measured / law) at the points used, in order of temperature; ``enlarged`` the factor
    by which standard errors were enlarged because neighbours err together; ``limit`` says in words which
    limit a number rests on.
    """

    factor: TemperatureFactor
    viscosity_Pa_s: float  # at 20 degC
    parameters: tuple[FittedParameter, ...]
    covariance: FloatArray  # of numbers
    rms_percent: float
    aicc: float  # infinite with too few points to judge
    residual: FloatArray
    enlarged: float
    limit: str

    def value(self, temperature_K: FloatArray) -> FloatArray:
        """Return the law's viscosity [Pa s]."""
        return self.viscosity_Pa_s * self.factor.value(temperature_K)

    def fall_percent(self, cold_K: float = REFERENCE_K, hot_K: float = 373.15) -> tuple[float, float]:
        """Return the fall between two temperatures [%], and its standard error (NaN when not known)."""
        return fall_of(self.factor, self.covariance[1:, 1:], cold_K, hot_K)


@dataclass(frozen=True, slots=True, eq=False)
class ViscosityStudy:
    """All viscosity laws of one table, the best first, and the points they were fitted to."""

    fits: tuple[ViscosityFit, ...]
    temperature_K: FloatArray  # all points, in order of temperature
    viscosity_Pa_s: FloatArray
    used: BoolArray
    notes: tuple[str, ...]

    @property
    def best(self) -> ViscosityFit:
        return self.fits[0]


def fit_viscosity(
    temperature_K: FloatArray,
    viscosity_Pa_s: FloatArray,
    *,
    place: str = "viscosity table",
) -> ViscosityStudy:
    """Fit Arrhenius', Reynolds' and (from six points on) the VFT law to a table, within ``VALID_K``.

    Parameters
    ----------
    temperature_K, viscosity_Pa_s : the points [K], [Pa s], shape (n,), in any order
    place : where the points come from, for messages

    Raises
    ------
    InputError
        A value that is not positive, or too few points or temperatures for a law.
    """
    order = np.argsort(temperature_K, kind="stable")
    kelvin, viscosity = temperature_K[order], viscosity_Pa_s[order]
    require_positive(viscosity, "viscosity", "Pa s", kelvin, place)
    used = within(kelvin, VALID_K)
    require_temperatures(kelvin[used], 3, place, VALID_K, "a viscosity law has 2 numbers")
    x, y = kelvin[used] - REFERENCE_K, np.log(viscosity[used])
    fits = [_fixed_curve(x, y, Reynolds), _fixed_curve(x, y, Arrhenius)]
    notes: list[str] = []
    if np.unique(x).size >= 6:
        fits.append(_free_curve(x, y))
    else:
        notes.append(f"{place}: the VFT law was not fitted: it takes points at 6 temperatures or more")
    fits.sort(key=lambda fit: (fit.aicc, fit.rms_percent))
    notes += _about_viscosity(fits[0], kelvin, viscosity, used, place)
    return ViscosityStudy(tuple(fits), kelvin, viscosity, used, tuple(notes))


def _fixed_curve(x: FloatArray, y: FloatArray, kind: type[Reynolds] | type[Arrhenius]) -> ViscosityFit:
    """Fit Reynolds' or Arrhenius' law: a straight line in the curve's own abscissa."""
    q = 0.0 if kind is Reynolds else 1.0 / REFERENCE_K
    level, rate = _line(x / (1.0 + q * x), y)
    factor = kind(rate if kind is Reynolds else rate / q**2)
    return _viscosity_fit(factor, level, x, y, limit="")


def _free_curve(x: FloatArray, y: FloatArray) -> ViscosityFit:
    """Fit the VFT law: q by a grid and then least squares of all three, between its limits."""
    from scipy.optimize import least_squares

    coldest = min(float(x.min()), 0.0)
    lowest, highest = -1.0 / (_REYNOLDS_POLE_K - REFERENCE_K), -1.0 / (coldest - _POLE_MARGIN_K)
    grid = np.geomspace(lowest, highest, 60)
    lines = [_line(x / (1.0 + q * x), y) for q in grid]
    sums = [
        float(np.sum((y - a + b * x / (1.0 + q * x)) ** 2)) for q, (a, b) in zip(grid, lines, strict=True)
    ]
    start = int(np.argmin(sums))

    def residual(parameters: FloatArray) -> FloatArray:
        level, rate, q = parameters
        return np.asarray(level - rate * x / (1.0 + q * x) - y)

    def jacobian(parameters: FloatArray) -> FloatArray:
        _, rate, q = parameters
        bent = x / (1.0 + q * x)
        return np.column_stack([np.ones_like(x), -bent, rate * bent**2])

    solved = least_squares(
        residual,
        [*lines[start], grid[start]],
        jac=jacobian,
        bounds=([-np.inf, -np.inf, lowest], [np.inf, np.inf, highest]),
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=500,
    )
    level, rate, q = (float(number) for number in solved.x)
    limit = ""
    if q < 1.001 * lowest:
        q, limit = lowest, "its pole runs to minus infinity, where it is Reynolds' law"
    elif q > 0.999 * highest:
        q, limit = highest, f"its pole rests {_POLE_MARGIN_K:g} K below the coldest point"
    if limit:
        level, rate = _line(x / (1.0 + q * x), y)
    return _viscosity_fit(Vft(rate / q**2, REFERENCE_K - 1.0 / q), level, x, y, limit=limit)


def _line(bent: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return level and rate of y = level - rate * bent by least squares."""
    centred = bent - bent.mean()
    rate = -float(centred @ (y - y.mean()) / (centred @ centred))
    return float(y.mean()) + rate * float(bent.mean()), rate


def _viscosity_fit(
    factor: Arrhenius | Reynolds | Vft, level: float, x: FloatArray, y: FloatArray, *, limit: str
) -> ViscosityFit:
    """Return a fitted law with its standard errors."""
    kelvin = x + REFERENCE_K
    value = factor.value(kelvin)
    residual = y - level - np.log(value)
    viscosity = float(np.exp(level))
    columns = np.column_stack([np.full_like(x, 1.0 / viscosity), (factor.gradient(kelvin) / value).T])
    known = columns[:, :-1] if limit else columns  # a number on its limit is not estimated
    enlarged = enlargement_of(residual)
    covariance = np.full((columns.shape[1],) * 2, np.nan)
    part = covariance_of(known, residual) * enlarged**2
    covariance[: part.shape[0], : part.shape[1]] = part
    return ViscosityFit(
        factor=factor,
        viscosity_Pa_s=viscosity,
        parameters=fitted_parameters(
            ("at_20degC_Pa_s", *factor.parameter_names),
            ("Pa s", *factor.units),
            (viscosity, *factor.parameters),
            covariance,
        ),
        covariance=covariance,
        rms_percent=rms_percent_of(residual),
        aicc=aicc_of(residual, columns.shape[1]),
        residual=residual,
        enlarged=enlarged,
        limit=limit,
    )


def _about_viscosity(
    best: ViscosityFit,
    kelvin: FloatArray,
    viscosity: FloatArray,
    used: BoolArray,
    place: str,
) -> list[str]:
    """Say what the points outside show, and what else a reader should know."""
    notes = []
    hot, cold = kelvin > VALID_K[1] + 1e-6, kelvin < VALID_K[0] - 1e-6
    for outside, end, word in ((hot, VALID_K[1], "above"), (cold, VALID_K[0], "below")):
        if not outside.any():
            continue
        ratio = viscosity[outside] / best.value(kelvin[outside]) - 1.0
        worst = int(np.argmax(np.abs(ratio)))
        at = kelvin[outside][worst]
        fails = outside is hot and ratio.min() < -max(0.1, 5.0 * best.rms_percent / 100.0)
        notes.append(
            f"{place}: {counted(outside, 'point')} {word} {in_celsius(end)} left out of the laws; at "
            f"{in_celsius(at)} the table is {100.0 * float(ratio[worst]):+.1f} % from the law"
            + (": the fluid fails there, and no law here describes it" if fails else "")
        )
    inside = kelvin[used]
    covered = span_in_celsius((inside[0], inside[-1]))
    if inside[0] > REFERENCE_K + 2.0 or inside[-1] < 373.15 - 2.0:
        notes.append(f"{place}: the points lie at {covered}: the fall from 20 to 100 degC is extrapolated")
    if best.fall_percent()[0] < 0.0:
        notes.append(f"{place}: the viscosity rises with temperature; check the table")
    if best.enlarged > 1.0:
        notes.append(
            f"{place}: neighbouring points err together; standard errors are enlarged by {best.enlarged:.2g}"
        )
    return notes
