"""A damper: a hysteresis law with each coefficient as a function of command and temperature.

A damper object contains neither runs nor a solver. Its parameters have flat names, ``coefficient.parameter``
(for example ``yield_force.gain``), in the order of the law. A fit changes them with ``with_parameters``. The
module ``simulate`` computes the force by the kernel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.dependence import Constant, ParameterLaw, TemperatureDependent
from mrdamper.models.laws import HysteresisLaw
from mrdamper.quantities import ZERO_CELSIUS_K, CommandUnit
from mrdamper.schema import Option, unknown_name

LAG = "command_lag_s"
"""Name of the command lag among the parameters. It belongs to the damper, not to a coefficient."""

Range = tuple[float, float]

COMMAND_COUNT = 201  # number of commands in the envelope at which coefficients are checked
TEMPERATURE_COUNT = 9  # number of temperatures at which temperature-dependent coefficients are checked
ROUNDING_RATIO = 1e-6  # A coefficient may exceed its limit by this fraction, because of rounding errors.


@dataclass(frozen=True, slots=True)
class OperatingEnvelope:
    """Ranges of the runs from which a damper was identified, as (low, high) pairs."""

    command: Range  # [A or V]
    displacement: Annotated[Range, Option(key="displacement_m")]
    velocity: Annotated[Range, Option(key="velocity_m_s")]
    temperature: Annotated[Range | None, Option(key="temperature_K")] = None  # None: unknown temperature
    acceleration: Annotated[Range | None, Option(key="acceleration_m_s2")] = None
    frequency: Annotated[Range | None, Option(key="frequency_Hz")] = None  # frequency band with 90 % of v^2

    def __post_init__(self) -> None:
        for field in fields(self):
            name, given = field.name, getattr(self, field.name)
            if given is None and field.default is None:
                continue
            pair = tuple(float(end) for end in given)
            if len(pair) != 2 or not all(map(math.isfinite, pair)) or not pair[0] <= pair[1]:
                raise InputError(
                    place="envelope", found=f"{name} is {pair}", expected="two finite numbers, low and high"
                )
            object.__setattr__(self, name, pair)

    def commands(self) -> FloatArray:
        """Return evenly spaced commands [A or V] at which coefficients are checked."""
        return np.linspace(*self.command, COMMAND_COUNT)

    def temperatures(self) -> FloatArray | None:
        """Return the temperatures [K] at which coefficients are checked; None: unknown."""
        return None if self.temperature is None else np.linspace(*self.temperature, TEMPERATURE_COUNT)


@dataclass(frozen=True)
class Damper:
    """A hysteresis law, and each of its coefficients as a function of command and temperature.

    Missing coefficients are constant and have their default value. The effective command follows the command
    with a first-order lag of ``command_lag_s`` (0: no lag), or as described by ``actuation``. Temperatures
    are clipped to ``temperature_range`` [K] (None: not clipped). If ``limited`` is True, coefficients beyond
    the limits of the hysteresis law are clipped instead of rejected.

    Raises
    ------
    InputError
        If a coefficient is unknown, or missing without a default, or both a lag and an actuation are given.
    """

    law: HysteresisLaw
    coefficients: Mapping[str, ParameterLaw]
    command_unit: CommandUnit = "A"
    command_lag_s: float = 0.0
    actuation: Actuation | None = None
    temperature_range: Range | None = None
    limited: bool = False

    def __post_init__(self) -> None:
        law, given = self.law, self.coefficients
        for name in given:
            if name not in law.names:
                raise unknown_name(f"no coefficient {name!r}", name, law.names, law.name)
        missing = [c.name for c in law.coefficients if c.name not in given and c.default is None]
        if missing:
            raise InputError(place=law.name, found=f"{', '.join(missing)} not given, and there is no default")
        if self.command_unit not in ("A", "V"):
            raise InputError(found=f"command_unit is {self.command_unit!r}", expected="'A' or 'V'")
        if not 0.0 <= self.command_lag_s < math.inf:
            raise InputError(found=f"command_lag_s is {self.command_lag_s}", expected="0 s or more")
        if self.temperature_range is not None:
            low, high = self.temperature_range
            if not (math.isfinite(low) and math.isfinite(high) and 0.0 < low <= high):
                raise InputError(
                    found=f"temperature_range is {self.temperature_range} K", expected="low and high"
                )
            object.__setattr__(self, "temperature_range", (float(low), float(high)))
        if self.actuation is not None and self.command_lag_s > 0.0:
            raise InputError(found="command_lag_s and an actuation are both given", expected="one of them")
        complete = {
            c.name: given[c.name] if c.name in given else Constant(_default(c.default))
            for c in law.coefficients
        }
        object.__setattr__(self, "coefficients", MappingProxyType(complete))
        object.__setattr__(self, "command_lag_s", float(self.command_lag_s))

    def __reduce__(self) -> tuple[type[Damper], tuple[object, ...]]:
        """Pickle through the constructor because the read-only mapping cannot be pickled."""
        parts = (self.law, dict(self.coefficients), self.command_unit, self.command_lag_s)
        return Damper, (*parts, self.actuation, self.temperature_range, self.limited)

    @property
    def temperature_dependent(self) -> bool:
        """Return True if a coefficient depends on temperature."""
        return any(form.temperature_dependent for form in self.coefficients.values())

    @property
    def assumed(self) -> tuple[str, ...]:
        """Return the coefficients with a temperature factor that is assumed from a fluid."""
        return tuple(
            name
            for name, form in self.coefficients.items()
            if isinstance(form, TemperatureDependent) and form.assumed
        )

    @property
    def parameters(self) -> dict[str, float]:
        """Return every parameter by its flat name, such as ``yield_force.gain``."""
        return {
            f"{coefficient}.{name}": number
            for coefficient, form in self.coefficients.items()
            for name, number in zip(form.parameter_names, form.parameters, strict=True)
        }

    @property
    def units(self) -> dict[str, str]:
        """Return the unit of every parameter by its flat name."""
        return {
            f"{coefficient}.{name}": unit
            for coefficient, form in self.coefficients.items()
            for name, unit in zip(
                form.parameter_names, form.units(self.law[coefficient].unit, self.command_unit), strict=True
            )
        }

    @property
    def parameters_and_lag(self) -> dict[str, float]:
        """Return all parameters by their flat names, and the command lag [s] as ``LAG``."""
        return {**self.parameters, LAG: self.command_lag_s}

    def with_parameters(self, parameters: Mapping[str, float]) -> Damper:
        """Return the damper with some parameters replaced (flat names), including the command lag."""
        if LAG in parameters:
            rest = {name: value for name, value in parameters.items() if name != LAG}
            return replace(self, command_lag_s=parameters[LAG]).with_parameters(rest)
        if not parameters:
            return self
        present = self.parameters
        for name in parameters:
            if name not in present:
                raise unknown_name(f"no parameter {name!r}", name, present, self.law.name)
        changed = {
            coefficient: form.with_parameters(
                [
                    parameters.get(f"{coefficient}.{n}", v)
                    for n, v in zip(form.parameter_names, form.parameters, strict=True)
                ]
            )
            for coefficient, form in self.coefficients.items()
        }
        return replace(self, coefficients=changed)

    def coefficients_at(self, command: ArrayLike, temperature: ArrayLike | None = None) -> FloatArray:
        """Return the coefficients at n commands, shape (m, n), in the order of the law.

        ``temperature`` [K] is one number or one per command; None: 20 degC. A value that is beyond a limit
        only because of rounding errors is set to the limit.
        """
        at, kelvin = self._grid(command, temperature)
        found = np.empty((len(self.coefficients), len(at)))
        for row, name in zip(found, self.coefficients, strict=True):
            row[:] = self._value(name, at, kelvin)
        return found

    def violations(self, commands: ArrayLike, temperatures: ArrayLike | None = None) -> tuple[str, ...]:
        """Return a sentence for each coefficient outside the limits of the hysteresis law.

        The sentence names one command and temperature at which the coefficient is invalid.
        """
        at, kelvin = self._grid(commands, temperatures)
        found = []
        for name, form in self.coefficients.items():
            with np.errstate(over="ignore", invalid="ignore"):  # Overflow is reported below.
                values = self._value(name, at, kelvin)
            if not self.law.violations({name: values}) and np.isfinite(values).all():
                continue
            for k, value in enumerate(values.tolist()):
                reasons = self.law.violations({name: value})
                if not math.isfinite(value):
                    reasons = (f"{self.law.name}: {name} is {value}; it must be finite",)
                if reasons:
                    where = f"{at[k]:g} {self.command_unit}"
                    if kelvin is not None and form.temperature_dependent:
                        where += f", {kelvin[k] - ZERO_CELSIUS_K:.1f} degC"
                    found.append(f"{reasons[0]} (at {where})")
                    break
        return tuple(found)

    def problems(self, envelope: OperatingEnvelope) -> tuple[str, ...]:
        """Return a sentence for each coefficient that is invalid inside the envelope."""
        commands, temperatures = envelope.commands(), envelope.temperatures()
        if self.temperature_dependent and temperatures is not None:
            commands, temperatures = (g.ravel() for g in np.meshgrid(commands, temperatures))
        else:
            temperatures = None
        found = list(self.violations(commands, temperatures))
        if self.law.name == "series-valve":
            found += self._reversed_valve(envelope)
        return tuple(found)

    def check(self, envelope: OperatingEnvelope) -> None:
        """Raise ``InputError`` if a coefficient is invalid somewhere inside the envelope."""
        problems = self.problems(envelope)
        if problems:
            raise InputError(faults=[InputError(problem) for problem in problems])

    def on_limits(self) -> Damper:
        """Return a damper whose coefficients are clipped to the limits of its law."""
        return replace(self, limited=True)

    def clip_temperature(self, temperature: FloatArray) -> FloatArray:
        """Return temperatures [K] clipped to the temperature range."""
        return (
            temperature if self.temperature_range is None else np.clip(temperature, *self.temperature_range)
        )

    def _value(self, name: str, at: FloatArray, kelvin: FloatArray | None) -> FloatArray:
        form, admissible = self.coefficients[name], self.law[name]
        if self.limited and isinstance(form, Constant):  # The usual case needs no operations on arrays.
            return np.array([min(max(form.number, admissible.lower), admissible.upper)])
        values = form.value(at[:1] if isinstance(form, Constant) else at, kelvin)
        if self.limited:
            return np.clip(values, admissible.lower, admissible.upper)
        size = max(abs(number) for number, linear in zip(form.parameters, form.linear, strict=True) if linear)
        for limit, beyond in ((admissible.lower, np.less), (admissible.upper, np.greater)):
            if math.isfinite(limit):
                near = np.abs(values - limit) <= ROUNDING_RATIO * max(size, abs(limit))
                values = np.where(near & beyond(values, limit), limit, values)
        return values

    def _grid(
        self, command: ArrayLike, temperature: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray | None]:
        at = np.atleast_1d(np.asarray(command, dtype=np.float64))
        if temperature is None:
            return at, None
        kelvin = np.asarray(temperature, dtype=np.float64)
        if kelvin.shape not in {(), at.shape}:
            raise InputError(
                found=f"temperature has shape {kelvin.shape}, the command {at.shape}",
                expected="one number or the same shape",
            )
        return at, np.broadcast_to(self.clip_temperature(kelvin), at.shape)

    def _reversed_valve(self, envelope: OperatingEnvelope) -> list[str]:
        """Return a sentence if 1 + position_gain x is not positive in the envelope.

        The force of the valve would change its sign at this displacement x.
        """
        commands = envelope.commands()
        for x in envelope.displacement:
            with np.errstate(over="ignore", invalid="ignore"):  # NaN is reported as not positive.
                side = 1.0 + self.coefficients["position_gain"].value(commands) * x
            bad = np.flatnonzero(~(side > 0.0))
            if bad.size:
                return [
                    f"{self.law.name}: 1 + position_gain x is {side[bad[0]]:g} at x = {x:g} m and "
                    f"{commands[bad[0]]:g} {self.command_unit}; it must be positive over the stroke (bring "
                    f"position_gain nearer to 0, or narrow the envelope)"
                ]
        return []


def _default(value: float | None) -> float:
    return 0.0 if value is None else value
