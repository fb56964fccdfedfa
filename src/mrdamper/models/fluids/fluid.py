"""The MR fluid as data: viscosity and yield stress over temperature and field, with sources.

A fluid is a value: its numbers, the named laws they belong to, the temperatures it may be used at, and for
every number where it comes from and how sure that is. ``fluid_file`` holds the presets and the TOML of a
user's own fluid (docs/fluid.md). Laws of temperature are ``temperature``'s, the law of the field is
``carlson``'s; fits to rheometer tables are ``viscosity_fit``'s and ``yield_fit``'s.

Viscosity is without field. Shear rate does not enter: a viscosity belongs to the rate it was measured at.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError, EnvelopeWarning, InputError
from mrdamper.models.fluids.carlson import Carlson, checked_fraction, field_strength
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import QUANTITIES, REFERENCE_K, ZERO_CELSIUS_K

Confidence = Literal["A", "B", "C", "D"]
"""A: stated by its source, a standard law, or fitted to the user's own table; B: follows from such numbers
with little room; C: one of several readings; D: nothing but a plausible proposal."""

PROPERTIES: Mapping[str, str] = MappingProxyType(
    {
        "particle_fraction": "-",
        "density_kg_m3": "kg/m^3",
        "heat_capacity_J_kg_K": "J/(kg K)",
        "conductivity_W_m_K": "W/(m K)",
    }
)
"""Properties of a fluid that no law changes, with their units; all but the first may be unknown."""

_PLAUSIBLE_K = (QUANTITIES["temperature"].low, QUANTITIES["temperature"].high)


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a number comes from, how sure it is, and its standard error [the number's unit] where known."""

    source: str
    confidence: Confidence
    standard_error: float | None = None

    def __post_init__(self) -> None:
        if self.confidence not in get_args(Confidence):
            raise InputError(found=f"confidence is {self.confidence!r}", expected="one of A, B, C, D")
        error = self.standard_error
        if error is not None and not (math.isfinite(error) and error >= 0.0):
            raise InputError(found=f"standard error is {error}", expected="a finite number, not negative")


@dataclass(frozen=True, slots=True)
class Collapse:
    """factor = 1 / (1 + exp[(T - middle) / width]): a fluid that fails, outside every validity range."""

    middle_K: float
    width_K: float

    def __post_init__(self) -> None:
        _require_positive("collapse.middle_K", self.middle_K)
        _require_positive("collapse.width_K", self.width_K)

    def value(self, temperature_K: ArrayLike) -> FloatArray:
        """Return the factor [-] at temperatures [K], in their shape."""
        above = (np.asarray(temperature_K, dtype=np.float64) - self.middle_K) / self.width_K
        return np.asarray(0.5 * (1.0 - np.tanh(0.5 * above)))  # the same, and it does not overflow


@dataclass(frozen=True, slots=True, kw_only=True)
class Fluid:
    """An MR fluid: numbers at 20 degC, laws of temperature and field, range of use, origins.

    ``origins`` has one entry for each name in ``numbers``. ``viscosity_fitted_K`` are the temperatures that
    the viscosity's law comes from; outside them, as outside ``valid_K``, a value comes with a warning.
    """

    name: str
    title: str = ""
    viscosity_Pa_s: float  # at 20 degC, without field
    viscosity_factor: TemperatureFactor
    viscosity_fitted_K: tuple[float, float]
    yield_field: Carlson  # at 20 degC
    yield_factor: TemperatureFactor
    particle_fraction: float  # volume of iron [-]
    density_kg_m3: float | None = None
    heat_capacity_J_kg_K: float | None = None
    conductivity_W_m_K: float | None = None  # thermal
    collapse: Collapse | None = None
    valid_K: tuple[float, float]
    origins: Mapping[str, Origin]

    def __post_init__(self) -> None:
        object.__setattr__(self, "origins", MappingProxyType(dict(self.origins)))
        if not self.name:
            raise InputError("it has no name", place="fluid")
        for name, (value, _) in self.parameters.items():
            if name in _POSITIVE:
                _require_positive(f"fluid {self.name!r}: {name}", value)
        checked_fraction(self.particle_fraction)
        _require_origins(self)
        for what, ends in (("valid", self.valid_K), ("viscosity's fitted", self.viscosity_fitted_K)):
            _require_range(f"fluid {self.name!r}: its {what} range", ends)
        for what, factor in (("viscosity", self.viscosity_factor), ("yield stress", self.yield_factor)):
            _require_positive_over(f"fluid {self.name!r}: {what}", factor, self.valid_K)

    @property
    def parameters(self) -> Mapping[str, tuple[float, str]]:
        """Return every number of the fluid with its unit, by the name it has in a file."""
        found = {"viscosity.at_20degC_Pa_s": (self.viscosity_Pa_s, "Pa s")}
        found |= _parameters_of("viscosity", self.viscosity_factor)
        found["yield_stress.saturation_Pa"] = (self.yield_field.saturation_Pa, "Pa")
        found["yield_stress.field_scale_A_m"] = (self.yield_field.field_scale_A_m, "A/m")
        found |= _parameters_of("yield_stress", self.yield_factor)
        for key, unit in PROPERTIES.items():
            value = getattr(self, key)
            if value is not None:
                found[f"properties.{key}"] = (value, unit)
        if self.collapse is not None:
            found["collapse.middle_K"] = (self.collapse.middle_K, "K")
            found["collapse.width_K"] = (self.collapse.width_K, "K")
        return found

    def viscosity(self, temperature_K: ArrayLike, *, with_collapse: bool = False) -> FloatArray:
        """Return the viscosity without field [Pa s].

        Parameters
        ----------
        temperature_K : temperature [K], any shape
        with_collapse : multiply by ``collapse``, the fall of a failing fluid (outside its validity)

        Raises
        ------
        InputError
            The collapse is asked for and the fluid states none.
        EnvelopeError
            The law has no positive, finite value there, or a temperature is not one in kelvin.

        Warns
        -----
        EnvelopeWarning
            Outside ``valid_K`` or ``viscosity_fitted_K``, once, with the numbers.
        """
        kelvin = np.asarray(temperature_K, dtype=np.float64)
        values = self.viscosity_Pa_s * self._factor("viscosity", self.viscosity_factor, kelvin)
        self._warn_outside("viscosity", kelvin, self.valid_K, self.viscosity_fitted_K)
        if not with_collapse:
            return values
        if self.collapse is None:
            raise InputError(
                "states no collapse", place=f"fluid {self.name!r}", remedy="leave with_collapse out"
            )
        return np.asarray(values * self.collapse.value(kelvin))

    def yield_stress(
        self,
        temperature_K: ArrayLike,
        *,
        field_A_m: ArrayLike | None = None,
        flux_density_T: ArrayLike | None = None,
    ) -> FloatArray:
        """Return the yield stress [Pa] at temperatures [K] and one of field strength or flux density.

        Shapes broadcast. Errors and the warning are those of ``viscosity``, on ``valid_K`` alone.
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
        low, high = _PLAUSIBLE_K
        strange = ~((kelvin >= low) & (kelvin <= high))
        if strange.any():
            raise EnvelopeError(
                place=f"fluid {self.name!r}",
                found=f"temperature is {kelvin[strange].flat[0]:g} K",
                expected=f"{low:g} to {high:g} K",
                remedy="Temperatures are in kelvin here",
            )
        values = factor.value(kelvin)
        bad = ~((values > 0.0) & np.isfinite(values))
        if bad.any():
            raise EnvelopeError(
                place=f"fluid {self.name!r}",
                found=(
                    f"the {factor.kind} law of the {what} has no value at {_celsius(kelvin[bad].flat[0])}; "
                    f"it is meant for {_span(self.valid_K)}"
                ),
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
                    f"fluid {self.name!r}: {what} asked for at {_celsius(worst)}; its law is {word} "
                    f"{_span((low, high))}",
                    EnvelopeWarning,
                    stacklevel=3,
                )
                return


def fall_percent(factor: TemperatureFactor, cold_K: float = REFERENCE_K, hot_K: float = 373.15) -> float:
    """Return by how much a factor falls from one temperature to another [% of its value at the first]."""
    return 100.0 * (1.0 - float(factor.value(hot_K)) / float(factor.value(cold_K)))


# ------------------------------------------------------------------------------------------- checks

_POSITIVE = frozenset({"viscosity.at_20degC_Pa_s", *(f"properties.{key}" for key in PROPERTIES)})


def _require_positive(what: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{what} is {value:g}", expected="a positive number")


def _require_origins(fluid: Fluid) -> None:
    lacking = [name for name in fluid.parameters if name not in fluid.origins]
    unknown = [name for name in fluid.origins if name not in fluid.parameters]
    if lacking:
        raise InputError(place=f"fluid {fluid.name!r}", found=f"no origin is given for {', '.join(lacking)}")
    if unknown:
        raise InputError(
            place=f"fluid {fluid.name!r}", found=f"origins of numbers it does not have: {', '.join(unknown)}"
        )


def _require_range(what: str, ends: tuple[float, float]) -> None:
    low, high = ends
    if not _PLAUSIBLE_K[0] <= low < high <= _PLAUSIBLE_K[1]:
        raise InputError(
            found=f"{what} is {low:g} to {high:g} K",
            expected=f"the lower before the higher, both in {_PLAUSIBLE_K[0]:g} to {_PLAUSIBLE_K[1]:g} K",
        )


def _require_positive_over(what: str, factor: TemperatureFactor, ends: tuple[float, float]) -> None:
    grid = np.linspace(*ends, 101)
    values = factor.value(grid)
    bad = ~((values > 0.0) & np.isfinite(values))
    if bad.any():
        raise InputError(
            place=what,
            found=(
                f"its {factor.kind} law is {values[bad][0]:g} at {_celsius(grid[bad][0])}; it must be "
                f"positive over the fluid's range {_span(ends)}"
            ),
            remedy="Narrow valid_degC, or correct the law's numbers",
        )


def _parameters_of(section: str, factor: TemperatureFactor) -> dict[str, tuple[float, str]]:
    names = zip(factor.parameter_names, factor.parameters, factor.units, strict=True)
    return {f"{section}.{name}": (number, unit) for name, number, unit in names}


def _celsius(kelvin: float) -> str:
    return f"{kelvin - ZERO_CELSIUS_K:.4g} degC"


def _span(ends: tuple[float, float]) -> str:
    return f"{ends[0] - ZERO_CELSIUS_K:.4g} to {ends[1] - ZERO_CELSIUS_K:.4g} degC"
