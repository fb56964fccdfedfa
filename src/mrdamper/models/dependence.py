"""Functions that describe a coefficient versus command and temperature.

Such a function is called a parameter law. It consists of a named form, for example a polynomial, and
parameters. The model card stores the name (``kind``) and the ``parameters``. ``identify.templates`` decides
which parameters a fit may change. ``damper`` checks the values against the limits of the hysteresis law.

Every form has closed-form expressions for its value and for the derivatives with respect to parameters and
command. Every form also lists the parameters with a linear effect on the value. Most forms depend only on the
command. ``TemperatureDependent`` multiplies such a form by a temperature factor. ``Bipolynomial`` is a
polynomial in command and temperature. The default temperature is 20 degC.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import REFERENCE_K


class ParameterLaw(Protocol):
    """A coefficient as a function of command and temperature [K], with named parameters.

    ``linear[k]`` is True if the value is linear in parameter ``k`` for fixed values of all other parameters.
    ``settings`` are constants of the form that are never fitted, for example a reference current. Command and
    temperature may be arrays of equal shape. None as temperature means 20 degC.
    """

    @property
    def kind(self) -> str: ...

    @property
    def temperature_dependent(self) -> bool:
        """Return True if the coefficient depends on temperature."""
        ...

    @property
    def parameters(self) -> tuple[float, ...]: ...

    @property
    def parameter_names(self) -> tuple[str, ...]: ...

    @property
    def linear(self) -> tuple[bool, ...]: ...

    @property
    def settings(self) -> Mapping[str, float]: ...

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        """Return the unit of each parameter."""
        ...

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        """Return the coefficient in the shape of the command."""
        ...

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        """Return d value / d parameter, shape (parameters, *shape of command)."""
        ...

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        """Return value and gradient for many sets of parameters at once.

        ``parameters`` has one column per set, shape (parameters, sets); command and temperature have shape
        (points,). The value and each row of the gradient can be broadcast to the shape (sets, points).
        """
        ...

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        """Return d value / d command, in the shape of the command."""
        ...

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        """Return the same function with new values of the parameters."""
        ...


@dataclass(frozen=True, slots=True)
class Constant:
    """value = parameter, for all commands."""

    number: float

    kind: ClassVar[str] = "constant"
    temperature_dependent: ClassVar[bool] = False
    parameter_names: ClassVar[tuple[str, ...]] = ("value",)
    linear: ClassVar[tuple[bool, ...]] = (True,)
    settings: ClassVar[Mapping[str, float]] = MappingProxyType({})

    def __post_init__(self) -> None:
        _require_finite(self)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.number,)

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return (coefficient_unit,)

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.full(np.shape(command), self.number)

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.ones((1, *np.shape(command)))

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        return _linear_batch(self, parameters, command, temperature)

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.zeros(np.shape(command))

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return type(self)(*_as_many(self, parameters))


@dataclass(frozen=True, slots=True)
class Polynomial:
    """value = c0 + c1 I + c2 I^2 + ..., ascending powers of the command."""

    parameters: tuple[float, ...]

    kind: ClassVar[str] = "polynomial"
    temperature_dependent: ClassVar[bool] = False
    settings: ClassVar[Mapping[str, float]] = MappingProxyType({})

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(float(number) for number in self.parameters))
        if not self.parameters:
            raise InputError("a polynomial has no parameters", expected="at least one (c0)")
        _require_finite(self)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"c{power}" for power in range(len(self.parameters)))

    @property
    def linear(self) -> tuple[bool, ...]:
        return (True,) * len(self.parameters)

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return tuple(_per(coefficient_unit, command_unit, power) for power in range(len(self.parameters)))

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.asarray(
            np.polynomial.polynomial.polyval(_array(command), self.parameters), dtype=np.float64
        )

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.stack([_array(command) ** power for power in range(len(self.parameters))])

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        return _linear_batch(self, parameters, command, temperature)

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        derivative = np.polynomial.polynomial.polyder(self.parameters)
        return np.asarray(np.polynomial.polynomial.polyval(_array(command), derivative), dtype=np.float64)

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return type(self)(_as_many(self, parameters))


@dataclass(frozen=True, slots=True)
class Hill:
    r"""value = base + gain s(I), an S-shaped rise with s(0) = 0 and s(reference) = 1.

    .. math:: s = (1 + h^q)\,u^q / (u^q + h^q)

    with u = abs(command) / ``reference``, h = ``half_command`` / ``reference``, and the exponent q.

    At zero command, the slope towards positive commands is 0 for q > 1, finite for q = 1 and infinite for q <
    1. If it is infinite, ``slope`` returns infinity with the sign of the gain, but the value remains finite.
    """

    base: float  # value at zero command [coefficient unit]
    gain: float  # rise from zero to the reference command [coefficient unit]
    half_command: float  # command of half the saturated rise [command unit]
    exponent: float  # q [-]; above 1, the slope at zero command is 0
    reference: float = 1.0  # command at which the rise is `gain` [command unit]

    kind: ClassVar[str] = "hill"
    temperature_dependent: ClassVar[bool] = False
    parameter_names: ClassVar[tuple[str, ...]] = ("base", "gain", "half_command", "exponent")
    linear: ClassVar[tuple[bool, ...]] = (True, True, False, False)

    def __post_init__(self) -> None:
        _require_finite(self)
        for name in (*self.parameter_names[2:], "reference"):
            if not 0.0 < getattr(self, name) < math.inf:
                found = f"{name} is {getattr(self, name):g}; it must be positive and finite"
                raise InputError(place=self.kind, found=found)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.base, self.gain, self.half_command, self.exponent)

    @property
    def settings(self) -> Mapping[str, float]:
        return {"reference": self.reference}

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return (coefficient_unit, coefficient_unit, command_unit, "-")

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.asarray(self.base + self.gain * self._rise(command)[0], dtype=np.float64)

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return _gradient(self, command, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        base, gain, half, exponent, *sharp = parameters[:, :, None]
        rise, log_u, free, free_at_reference = _hill_rise(
            command / self.reference, half / self.reference, exponent, *sharp
        )
        log_h = np.log(half / self.reference)
        by_half = rise * (exponent / half) * (free_at_reference - free)
        # The logarithm of u is -inf at zero command, but the limit of rise times logarithm is 0.
        by_exponent = rise * (free * (np.where(rise > 0.0, log_u, 0.0) - log_h) + free_at_reference * log_h)
        columns = [np.ones_like(base), rise, gain * by_half, gain * by_exponent]
        for sharpness in sharp:  # ``sharp`` is empty for a Hill form and has one element for ``Saturation``.
            own = exponent * by_exponent - rise * np.log(np.where(rise > 0.0, rise, 1.0))
            columns.append(gain * own / sharpness)
        return base + gain * rise, columns

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        if self.gain == 0.0:
            return np.zeros(np.shape(command))
        signed = _array(command)
        rise, _, free, _ = self._rise(signed)
        h, q, (r,) = self.half_command / self.reference, self.exponent, self._sharpness or (1.0,)
        at_zero = 0.0 if q > 1.0 else math.inf if q < 1.0 else (1.0 + h**-r) ** (1.0 / r)
        away = signed != 0.0
        steepness = np.where(away, rise * free * q, at_zero)
        steepness = np.divide(steepness, np.abs(signed) / self.reference, out=steepness, where=away)
        return np.asarray(self.gain / self.reference * np.where(signed < 0.0, -1.0, 1.0) * steepness)

    def _rise(self, command: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        return _hill_rise(
            _array(command) / self.reference,
            _array(self.half_command / self.reference),
            _array(self.exponent),
            *map(_array, self._sharpness),
        )

    @property
    def _sharpness(self) -> tuple[float, ...]:
        return self.parameters[4:]

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return replace(self, **dict(zip(self.parameter_names, _as_many(self, parameters), strict=True)))


@dataclass(frozen=True, slots=True)
class Saturation(Hill):
    r"""value = base + gain s(I), like ``Hill`` with adjustable width of the transition.

    .. math:: s = (1 + h^{qr})^{1/r}\,u^q / (u^{qr} + h^{qr})^{1/r}

    Well below ``half_command``, s is a power of the command. Well above, s is constant. The ``sharpness`` r
    defines the width of the transition; r = 1 gives ``Hill``. With r, curves at small and at large commands
    can be fitted separately.
    """

    sharpness: float = 1.0  # r [-]

    kind: ClassVar[str] = "saturation"
    parameter_names: ClassVar[tuple[str, ...]] = ("base", "gain", "half_command", "exponent", "sharpness")
    linear: ClassVar[tuple[bool, ...]] = (True, True, False, False, False)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.base, self.gain, self.half_command, self.exponent, self.sharpness)

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return (coefficient_unit, coefficient_unit, command_unit, "-", "-")


@dataclass(frozen=True, slots=True)
class Exponential:
    """value = at_zero exp(rate I)."""

    at_zero: float  # value at zero command [coefficient unit]
    rate: float  # relative increase per command [1 / command unit]

    kind: ClassVar[str] = "exponential"
    temperature_dependent: ClassVar[bool] = False
    parameter_names: ClassVar[tuple[str, ...]] = ("at_zero", "rate")
    linear: ClassVar[tuple[bool, ...]] = (True, False)
    settings: ClassVar[Mapping[str, float]] = MappingProxyType({})

    def __post_init__(self) -> None:
        _require_finite(self)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.at_zero, self.rate)

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return (coefficient_unit, f"1/{command_unit}")

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return np.asarray(self.at_zero * self._growth(command))

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return _gradient(self, command, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        at_zero, rate = parameters[:, :, None]
        with np.errstate(over="ignore"):
            growth = np.exp(rate * command)
        value = at_zero * growth
        return value, (growth, command * value)

    def _growth(self, command: ArrayLike) -> FloatArray:
        with np.errstate(over="ignore"):  # Overflow gives infinity, which ``Damper.violations`` reports.
            return np.asarray(np.exp(self.rate * _array(command)))

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return self.rate * self.value(command)

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return type(self)(*_as_many(self, parameters))


@dataclass(frozen=True, slots=True)
class Bipolynomial:
    """value = sum of c_ij I^i (T - 293.15)^j, a polynomial in command I and temperature T.

    The value is linear in all parameters. The order of the parameters is c00, c01, c10, c11, ...
    """

    parameters: tuple[float, ...]
    temperature_degree: int = 1

    kind: ClassVar[str] = "bipolynomial"

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(float(number) for number in self.parameters))
        columns = self.temperature_degree + 1
        if self.temperature_degree < 0 or not self.parameters or len(self.parameters) % columns:
            raise InputError(
                place="bipolynomial",
                found=f"{len(self.parameters)} parameters, temperature degree {self.temperature_degree}",
                expected="c00, c01, ... one for each power of temperature and command",
            )
        _require_finite(self)

    @property
    def temperature_dependent(self) -> bool:
        return self.temperature_degree > 0

    @property
    def settings(self) -> Mapping[str, float]:
        return {"temperature_degree": float(self.temperature_degree)}

    @property
    def powers(self) -> tuple[tuple[int, int], ...]:
        """Return the powers of command and temperature of each parameter."""
        columns = self.temperature_degree + 1
        return tuple(divmod(k, columns) for k in range(len(self.parameters)))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"c{i}{j}" for i, j in self.powers)

    @property
    def linear(self) -> tuple[bool, ...]:
        return (True,) * len(self.parameters)

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return tuple(_per(_per(coefficient_unit, command_unit, i), "K", j) for i, j in self.powers)

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        at, above = _array(command), _excess(command, temperature)
        table = np.reshape(self.parameters, (-1, self.temperature_degree + 1))
        inner = np.polynomial.polynomial.polyval(above, table.T)  # coefficients of the polynomial in I
        value = np.zeros(above.shape)
        for row in inner[::-1]:
            value = value * at + row
        return value

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        at, above = _array(command), _excess(command, temperature)
        rows = len(self.parameters) // (self.temperature_degree + 1)
        powers = (
            np.power.outer(at, np.arange(rows)),
            np.power.outer(above, np.arange(self.temperature_degree + 1)),
        )
        product = powers[0][..., :, None] * powers[1][..., None, :]
        return np.moveaxis(product.reshape(*at.shape, len(self.parameters)), -1, 0)

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        return _linear_batch(self, parameters, command, temperature)

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        at, above = _array(command), _excess(command, temperature)
        terms = [
            c * i * at ** max(i - 1, 0) * above**j
            for c, (i, j) in zip(self.parameters, self.powers, strict=True)
        ]
        return np.asarray(np.sum(terms, axis=0))

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        return replace(self, parameters=_as_many(self, parameters))


CommandForm = Constant | Polynomial | Hill | Exponential


@dataclass(frozen=True, slots=True)
class TemperatureDependent:
    """value = form(command) factor(temperature): a coefficient at 20 degC times its temperature factor.

    The value is linear in the linear parameters of the form. ``assumed`` is True if the factor comes from
    fluid data. It is False if the factor was fitted to runs of this damper.
    """

    form: CommandForm
    factor: TemperatureFactor
    assumed: bool = False

    temperature_dependent: ClassVar[bool] = True

    @property
    def kind(self) -> str:
        return self.form.kind

    @property
    def parameters(self) -> tuple[float, ...]:
        return (*self.form.parameters, *self.factor.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return (*self.form.parameter_names, *self.factor.parameter_names)

    @property
    def linear(self) -> tuple[bool, ...]:
        return (*self.form.linear, *(False for _ in self.factor.parameters))

    @property
    def settings(self) -> Mapping[str, float]:
        return self.form.settings

    def units(self, coefficient_unit: str, command_unit: str) -> tuple[str, ...]:
        return (*self.form.units(coefficient_unit, command_unit), *self.factor.units)

    def value(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return self.form.value(command) * self.factor.value(_kelvin(command, temperature))

    def gradient(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return _gradient(self, command, temperature)

    def evaluate_batch(
        self, parameters: FloatArray, command: FloatArray, temperature: FloatArray
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        split = len(self.form.parameters)
        value, by_form = self.form.evaluate_batch(parameters[:split], command, temperature)
        factor, by_factor = self.factor.evaluate_batch(parameters[split:], temperature)
        return value * factor, (*(g * factor for g in by_form), *(g * value for g in by_factor))

    def slope(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        return self.form.slope(command) * self.factor.value(_kelvin(command, temperature))

    def with_parameters(self, parameters: Sequence[float]) -> Self:
        given = _as_many(self, parameters)
        split = len(self.form.parameters)
        return replace(
            self,
            form=self.form.with_parameters(given[:split]),
            factor=self.factor.with_parameters(given[split:]),
        )


def _linear_batch(
    form: ParameterLaw, parameters: FloatArray, command: FloatArray, temperature: FloatArray
) -> tuple[FloatArray, Sequence[FloatArray]]:
    basis = form.gradient(command, temperature)
    return parameters.T @ basis, list(basis)


def _gradient(form: ParameterLaw, command: ArrayLike, temperature: ArrayLike | None) -> FloatArray:
    at = _array(command)
    rows = form.evaluate_batch(
        np.array(form.parameters)[:, None], at.ravel(), _kelvin(at, temperature).ravel()
    )[1]
    return np.stack([np.broadcast_to(row, (1, at.size)).reshape(at.shape) for row in rows])


def _hill_rise(
    command: FloatArray, half: FloatArray, exponent: FloatArray, sharpness: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return s, log u, and h^qr / (u^qr + h^qr) at the command and at u = 1.

    The letters have the same meaning as in ``Hill`` and ``Saturation``; without ``sharpness``, r = 1.
    Logarithms avoid overflow for large exponents.
    """
    with np.errstate(divide="ignore"):  # log 0 = -inf is the correct limit.
        log_u = np.log(np.abs(command))
    log_h = np.log(half)
    if sharpness is not None:
        exponent = exponent * sharpness
    beyond = exponent * (log_u - log_h)
    far = exponent * log_h
    top = np.logaddexp(0.0, far)
    taken = np.logaddexp(0.0, -beyond)
    # u^qr / (u^qr + h^qr) = exp(-taken). At the reference u = 1, this value is exp(-top).
    rise = top - taken if sharpness is None else (top - taken) / sharpness
    # beyond = qr log(u / h). Therefore h^qr / (u^qr + h^qr) = 1 / (1 + exp(beyond)).
    return np.exp(rise), log_u, np.exp(-np.logaddexp(0.0, beyond)), np.exp(far - top)


def _array(command: ArrayLike) -> FloatArray:
    return np.asarray(command, dtype=np.float64)


def _kelvin(command: ArrayLike, temperature: ArrayLike | None) -> FloatArray:
    return np.broadcast_to(_array(REFERENCE_K if temperature is None else temperature), np.shape(command))


def _excess(command: ArrayLike, temperature: ArrayLike | None) -> FloatArray:
    return _kelvin(command, temperature) - REFERENCE_K


def _per(coefficient_unit: str, command_unit: str, power: int) -> str:
    if power == 0:
        return coefficient_unit
    above = "1" if coefficient_unit == "-" else coefficient_unit
    return f"{above}/{command_unit}" if power == 1 else f"{above}/{command_unit}^{power}"


def _require_finite(law: ParameterLaw) -> None:
    for name, number in zip(law.parameter_names, law.parameters, strict=True):
        if not math.isfinite(number):
            raise InputError(place=law.kind, found=f"{name} is {number}; it must be a finite number")


def _as_many(law: ParameterLaw, parameters: Sequence[float]) -> tuple[float, ...]:
    if len(parameters) != len(law.parameters):
        raise InputError(
            place=law.kind,
            found=f"{len(parameters)} parameters given; it has {', '.join(law.parameter_names)}",
        )
    return tuple(float(number) for number in parameters)
