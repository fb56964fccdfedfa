"""Temperature factors: a quantity divided by its value at 20 degC, as a function of temperature.

Every factor is 1 at 293.15 K. A coefficient of a damper (``dependence.TemperatureDependent``) is its value at
20 degC times a factor. Viscosity and yield stress of a fluid (``fluid``) also use such factors. Temperature
is in kelvin.

A factor can be invalid, for example a linear factor below zero or a VFT factor at its pole. The calling
module reports the error with the name of the coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K
from mrdamper.schema import unknown_name


class TemperatureFactor(Protocol):
    """A function of temperature [K] that is 1 at ``REFERENCE_K``, with named parameters."""

    kind: ClassVar[str]

    @property
    def parameters(self) -> tuple[float, ...]: ...
    @property
    def parameter_names(self) -> tuple[str, ...]: ...
    @property
    def units(self) -> tuple[str, ...]: ...

    def value(self, temperature: ArrayLike) -> FloatArray:
        """Return the factor [-] in the shape of the temperature."""
        ...

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        """Return d factor / d parameter, shape (parameters, *shape of temperature)."""
        ...

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        """Return value and gradient for many sets of parameters at once.

        ``parameters`` has one column per set, shape (parameters, sets); the temperature has shape (points,).
        """
        ...

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        """Return the same factor with new values of the parameters."""
        ...


@dataclass(frozen=True, slots=True)
class _Factor:
    """Base class of temperature factors. The dataclass fields are the parameters."""

    def __post_init__(self) -> None:
        for name, number in zip(self.parameter_names, self.parameters, strict=True):
            if not math.isfinite(number):
                raise InputError(
                    place="temperature factor", found=f"{name} is {number}; it must be a finite number"
                )

    @property
    def parameters(self) -> tuple[float, ...]:
        return tuple(float(getattr(self, field.name)) for field in fields(self))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(field.name for field in fields(self))

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return replace(self, **dict(zip(self.parameter_names, parameters, strict=True)))


@dataclass(frozen=True, slots=True)
class Linear(_Factor):
    """factor = 1 - temperature_slope (T - 293.15 K): the yield stress of an MR fluid."""

    temperature_slope: float  # relative decrease per kelvin [1/K]

    kind: ClassVar[str] = "linear"
    units: ClassVar[tuple[str, ...]] = ("1/K",)

    def value(self, temperature: ArrayLike) -> FloatArray:
        return 1.0 - self.temperature_slope * _excess(temperature)

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        return _gradient(self, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        above = _excess(temperature)
        return 1.0 - parameters[0][:, None] * above, (-above,)


@dataclass(frozen=True, slots=True)
class Arrhenius(_Factor):
    """factor = exp[activation (1/T - 1/293.15)]: viscosity of a liquid in a range of some tens of kelvin.

    The activation temperature is E/R; 1435.5 K gives a decrease of 65 % from 20 to 100 degC.
    """

    activation_K: float  # activation temperature [K]

    kind: ClassVar[str] = "arrhenius"
    units: ClassVar[tuple[str, ...]] = ("K",)

    def value(self, temperature: ArrayLike) -> FloatArray:
        return _exp(self.activation_K * _inverse(temperature, 0.0))

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        return _gradient(self, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        inverse = _inverse(temperature, 0.0)
        value = _exp(parameters[0][:, None] * inverse)
        return value, (inverse * value,)


@dataclass(frozen=True, slots=True)
class Reynolds(_Factor):
    """factor = exp[-rate (T - 293.15)]: exponential decrease of viscosity."""

    temperature_rate: float  # relative decrease per kelvin at any temperature [1/K]

    kind: ClassVar[str] = "reynolds"
    units: ClassVar[tuple[str, ...]] = ("1/K",)

    def value(self, temperature: ArrayLike) -> FloatArray:
        return _exp(-self.temperature_rate * _excess(temperature))

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        return _gradient(self, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        above = _excess(temperature)
        value = _exp(-parameters[0][:, None] * above)
        return value, (-above * value,)


@dataclass(frozen=True, slots=True)
class Vft(_Factor):
    """factor = exp[B (1/(T - pole) - 1/(293.15 - pole))]: Vogel, Fulcher and Tammann.

    Valid for T > pole; pole = 0 gives the Arrhenius law. For T <= pole the factor is not finite.
    """

    vft_K: float  # B [K]
    vft_pole_K: float  # pole [K], below all temperatures of use

    kind: ClassVar[str] = "vft"
    units: ClassVar[tuple[str, ...]] = ("K", "K")

    def __post_init__(self) -> None:
        _Factor.__post_init__(self)
        if not self.vft_pole_K < REFERENCE_K:
            raise InputError(
                place="temperature factor",
                found=f"vft_pole_K is {self.vft_pole_K:g} K; it must be below 293.15 K",
            )

    def value(self, temperature: ArrayLike) -> FloatArray:
        return _exp(self.vft_K * _inverse(temperature, self.vft_pole_K))

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        return _gradient(self, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        size, pole = parameters[:, :, None]
        inverse = _inverse(temperature, pole)
        value = _exp(size * inverse)
        by_pole = size * (1.0 / (temperature - pole) ** 2 - 1.0 / (REFERENCE_K - pole) ** 2)
        return value, (inverse * value, by_pole * value)


@dataclass(frozen=True, slots=True)
class PolynomialFactor:
    """factor = 1 + t1 (T - 293.15) + t2 (T - 293.15)^2 + ...: empirical form of the reference paper."""

    parameters: tuple[float, ...]

    kind: ClassVar[str] = "polynomial"

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(float(number) for number in self.parameters))
        if not self.parameters or not all(map(math.isfinite, self.parameters)):
            raise InputError(
                place="temperature factor", found=f"{self.parameters}", expected="one or more finite numbers"
            )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"t{power}" for power in range(1, len(self.parameters) + 1))

    @property
    def units(self) -> tuple[str, ...]:
        return tuple("1/K" if power == 1 else f"1/K^{power}" for power in range(1, len(self.parameters) + 1))

    def value(self, temperature: ArrayLike) -> FloatArray:
        return np.asarray(
            np.polynomial.polynomial.polyval(_excess(temperature), (1.0, *self.parameters)), dtype=np.float64
        )

    def gradient(self, temperature: ArrayLike) -> FloatArray:
        return _gradient(self, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        above = _excess(temperature)
        powers = [above**power for power in range(1, len(parameters) + 1)]
        return np.asarray(1.0 + parameters.T @ np.stack(powers)), powers

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return type(self)(tuple(parameters))


FACTORS: Mapping[str, type[TemperatureFactor]] = MappingProxyType(
    {factor.kind: factor for factor in (Linear, Arrhenius, Reynolds, Vft, PolynomialFactor)}
)
"""Temperature factors, by their name in a card or fluid file."""


def factor_parameter_names(kind: str, names: Iterable[str]) -> tuple[str, ...]:
    """Return the parameter names of a kind of temperature factor.

    The degree of a polynomial is the number of ``names`` such as ``t1`` and ``t2``.
    """
    if kind not in FACTORS:
        raise unknown_name(f"there is no temperature factor of kind {kind!r}", kind, FACTORS)
    if kind != PolynomialFactor.kind:
        return tuple(each.name for each in fields(cast("Any", FACTORS[kind])))
    degree = sum(name[:1] == "t" and name[1:].isdigit() for name in names)
    return tuple(f"t{power}" for power in range(1, max(degree, 1) + 1))


def make_factor(kind: str, parameters: Mapping[str, float]) -> TemperatureFactor:
    """Return the temperature factor of a kind.

    Raises
    ------
    InputError
        If the kind is unknown, or a parameter is missing, unknown or not finite.
    """
    names = factor_parameter_names(kind, parameters)
    for name in parameters:
        if name not in names:
            raise unknown_name(f"{kind} has no parameter {name!r}", name, names)
    for name in names:
        if name not in parameters:
            raise InputError(place=kind, found=f"parameter {name} is missing", expected="a finite number")
    values = [float(parameters[name]) for name in names]
    if kind == PolynomialFactor.kind:
        return PolynomialFactor(tuple(values))
    return FACTORS[kind](*values)


def _excess(temperature: ArrayLike) -> FloatArray:
    return np.asarray(temperature, dtype=np.float64) - REFERENCE_K


def _gradient(factor: TemperatureFactor, temperature: ArrayLike) -> FloatArray:
    at = np.asarray(temperature, dtype=np.float64)
    rows = factor.evaluate_batch(np.array(factor.parameters)[:, None], at.ravel())[1]
    return np.stack([np.broadcast_to(row, (1, at.size)).reshape(at.shape) for row in rows])


def _inverse(temperature: ArrayLike, pole: float | FloatArray) -> FloatArray:
    """Return 1/(T - pole) - 1/(293.15 - pole), infinite at and below the pole."""
    away = np.asarray(temperature, dtype=np.float64) - pole
    with np.errstate(divide="ignore"):
        return np.where(away > 0.0, 1.0 / away, np.inf) - 1.0 / (REFERENCE_K - pole)


def _exp(exponent: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):  # The caller reports an infinite value.
        return np.asarray(np.exp(exponent))
