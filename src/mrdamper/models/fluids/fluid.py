"""An MR fluid: viscosity and yield stress versus temperature and field, further properties, and source.

``fluid_file`` reads and writes the presets and the TOML file of a user's fluid (docs/fluid.md). The
dependence on temperature is in ``models.temperature`` and the dependence on the field in ``carlson``.
``fits`` contains fits of rheometer tables. The viscosity is valid without field, and only near the shear rate
at which it was measured.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError, EnvelopeWarning, InputError
from mrdamper.models.fluids.carlson import Carlson, checked_fraction, field_strength
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import QUANTITIES, REFERENCE_K, to_degC
from mrdamper.schema import Positive, check_ranges

PLAUSIBLE_K = (QUANTITIES["temperature"].low, QUANTITIES["temperature"].high)


@dataclass(frozen=True, slots=True)
class Collapse:
    """Factor on the viscosity of a fluid that becomes thin when it is hot.

    factor = 1 / (1 + exp[(T - middle) / width])
    """

    middle_K: Positive
    width_K: Positive

    def __post_init__(self) -> None:
        check_ranges(self, "collapse")

    def value(self, temperature_K: ArrayLike) -> FloatArray:
        """Return the factor [-] on the viscosity at temperatures [K] of any shape."""
        excess = (np.asarray(temperature_K, dtype=np.float64) - self.middle_K) / self.width_K
        return np.asarray(0.5 * (1.0 - np.tanh(0.5 * excess)))  # the equation in a form without overflow


@dataclass(frozen=True, slots=True, kw_only=True)
class Fluid:
    """An MR fluid: parameters at 20 degC, dependence on temperature and field, valid range, source.

    ``viscosity_fitted_K`` is the temperature range of the measured viscosities. For temperatures outside this
    range or outside ``valid_K``, values are returned, but with a warning.
    """

    name: str
    title: str = ""
    source: str = ""
    viscosity_Pa_s: Positive  # viscosity at 20 degC, without field
    viscosity_factor: TemperatureFactor
    viscosity_fitted_K: tuple[float, float]
    yield_field: Carlson  # yield stress at 20 degC
    yield_factor: TemperatureFactor
    particle_fraction: float  # volume fraction of iron [-]
    density_kg_m3: Positive | None = None
    heat_capacity_J_kg_K: Positive | None = None
    conductivity_W_m_K: Positive | None = None  # thermal conductivity
    collapse: Collapse | None = None
    valid_K: tuple[float, float]

    def __post_init__(self) -> None:
        place = f"fluid {self.name!r}"
        if not self.name:
            raise InputError("the name is empty", place="fluid")
        check_ranges(self, place)
        checked_fraction(self.particle_fraction)
        for what, (low, high) in (("valid", self.valid_K), ("viscosity's fitted", self.viscosity_fitted_K)):
            if not PLAUSIBLE_K[0] <= low < high <= PLAUSIBLE_K[1]:
                raise InputError(
                    place=place,
                    found=f"its {what} range is {low:g} to {high:g} K",
                    expected=f"low before high, both in {PLAUSIBLE_K[0]:g} to {PLAUSIBLE_K[1]:g} K",
                )
        for what, factor in (("viscosity", self.viscosity_factor), ("yield stress", self.yield_factor)):
            values = factor.value(np.linspace(*self.valid_K, 101))
            if not ((values > 0.0) & np.isfinite(values)).all():
                raise InputError(
                    place=f"{place}: {what}",
                    found=f"its {factor.kind} law is not positive over the whole range {_span(self.valid_K)}",
                    remedy="Narrow valid_degC, or correct the numbers of the law",
                )

    def viscosity(self, temperature_K: ArrayLike, *, with_collapse: bool = False) -> FloatArray:
        """Return the viscosity without field [Pa s].

        Parameters
        ----------
        temperature_K : temperature [K], any shape
        with_collapse : multiply by the factor ``collapse`` of a fluid that fails above its valid range

        Raises
        ------
        InputError
            ``with_collapse`` is True, but the fluid has no ``collapse``.
        EnvelopeError
            The viscosity is not positive and finite, or a temperature is not plausible in kelvin.

        Warns
        -----
        EnvelopeWarning
            Once, if a temperature is outside ``valid_K`` or ``viscosity_fitted_K``.
        """
        kelvin = np.asarray(temperature_K, dtype=np.float64)
        values = self.viscosity_Pa_s * self._factor("viscosity", self.viscosity_factor, kelvin)
        self._warn_outside("viscosity", kelvin, self.valid_K, self.viscosity_fitted_K)
        if not with_collapse:
            return values
        if self.collapse is None:
            raise InputError("has no collapse", place=f"fluid {self.name!r}", remedy="omit with_collapse")
        return np.asarray(values * self.collapse.value(kelvin))

    def yield_stress(
        self,
        temperature_K: ArrayLike,
        *,
        field_A_m: ArrayLike | None = None,
        flux_density_T: ArrayLike | None = None,
    ) -> FloatArray:
        """Return the yield stress [Pa] at temperatures [K], and at a field strength or a flux density.

        The shapes of the arguments are broadcast.

        Raises
        ------
        InputError
            Neither or both of field strength and flux density are given.
        EnvelopeError
            The temperature factor is not positive and finite, or a temperature is not plausible in kelvin.

        Warns
        -----
        EnvelopeWarning
            Once, if a temperature is outside ``valid_K``.
        """
        if (field_A_m is None) == (flux_density_T is None):
            raise InputError(place="yield stress", found="give either field_A_m or flux_density_T")
        if flux_density_T is not None:
            field_A_m = field_strength(flux_density_T, self.particle_fraction)
        kelvin = np.asarray(temperature_K, dtype=np.float64)
        factor = self._factor("yield stress", self.yield_factor, kelvin)
        self._warn_outside("yield stress", kelvin, self.valid_K)
        return np.asarray(factor * self.yield_field.stress(cast("ArrayLike", field_A_m)))

    def _factor(self, what: str, factor: TemperatureFactor, kelvin: FloatArray) -> FloatArray:
        low, high = PLAUSIBLE_K
        bad = ~((kelvin >= low) & (kelvin <= high))
        if bad.any():
            raise EnvelopeError(
                place=f"fluid {self.name!r}",
                found=f"temperature is {kelvin[bad].flat[0]:g} K",
                expected=f"{low:g} to {high:g} K",
                remedy="Temperatures are in kelvin here",
            )
        values = factor.value(kelvin)
        bad = ~((values > 0.0) & np.isfinite(values))
        if bad.any():
            raise EnvelopeError(
                place=f"fluid {self.name!r}",
                found=f"the {factor.kind} law of the {what} has no value at {_celsius(kelvin[bad].flat[0])}; "
                f"it is valid for {_span(self.valid_K)}",
            )
        return values

    def _warn_outside(self, what: str, kelvin: FloatArray, *ranges: tuple[float, float]) -> None:
        if not kelvin.size:
            return
        lowest, highest = float(kelvin.min()), float(kelvin.max())
        for (low, high), word in zip(ranges, ("valid for", "from measurements at"), strict=False):
            if lowest < low - 1e-9 or highest > high + 1e-9:
                worst = lowest if low - lowest > highest - high else highest
                warnings.warn(
                    f"fluid {self.name!r}: {what} requested at {_celsius(worst)}; its law is {word} "
                    f"{_span((low, high))}",
                    EnvelopeWarning,
                    stacklevel=3,
                )
                return


def fall_percent(factor: TemperatureFactor, cold_K: float = REFERENCE_K, hot_K: float = 373.15) -> float:
    """Return the decrease of a factor between two temperatures, in % of the value at the first."""
    return 100.0 * (1.0 - float(factor.value(hot_K)) / float(factor.value(cold_K)))


def _celsius(kelvin: float) -> str:
    return f"{to_degC(kelvin):.4g} degC"


def _span(ends: tuple[float, float]) -> str:
    return f"{to_degC(ends[0]):.4g} to {_celsius(ends[1])}"
