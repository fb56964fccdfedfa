"""How a parameter law is written into a card: kind, numbers by name, settings, temperature factor.

A card never carries code; ``KINDS`` and ``temperature.FACTORS`` are the forms that it may name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType

from mrdamper.errors import InputError
from mrdamper.models.dependence import (
    Bipolynomial,
    CommandForm,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.temperature import FACTORS, PolynomialFactor, TemperatureFactor
from mrdamper.schema import did_you_mean

__all__ = ["KINDS", "dependence_from_json", "dependence_to_json"]

KINDS: Mapping[str, type[CommandForm | Bipolynomial]] = MappingProxyType(
    {kind.kind: kind for kind in (Constant, Polynomial, Hill, Exponential, Bipolynomial)}
)
"""The forms there are, by the name that a card stores."""


def dependence_to_json(law: ParameterLaw) -> dict[str, object]:
    """Return kind, numbers by name, settings and temperature factor (where there are any), all JSON."""
    data: dict[str, object] = {"kind": law.kind}
    if isinstance(law, TemperatureDependent):
        data["temperature"] = {"kind": law.factor.kind, "assumed": law.assumed}
    data["numbers"] = dict(zip(law.parameter_names, law.parameters, strict=True))
    if law.settings:
        data["settings"] = dict(law.settings)
    return data


def dependence_from_json(data: Mapping[str, object]) -> ParameterLaw:
    """Return the parameter law that ``dependence_to_json`` wrote.

    Raises
    ------
    InputError
        Unknown kind, number names that do not belong to it, values that are no finite numbers.
    """
    known = ("kind", "numbers", "settings", "temperature")
    for key in data:
        if key not in known:
            raise InputError(f"unknown key {key!r}; a dependence has {', '.join(known)}")
    kind, parameters, settings = data.get("kind"), data.get("numbers"), data.get("settings", {})
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"there is no dependence of kind {kind!r}; there are {', '.join(KINDS)}")
    if not isinstance(parameters, Mapping) or not isinstance(settings, Mapping):
        raise InputError(f"{kind}: numbers and settings must be tables of name and value")
    temperature = data.get("temperature")
    if temperature is None:
        return _form_from_json(kind, parameters, settings)
    factor_kind, assumed = _factor_kind(temperature)
    degree = sum(name[:1] == "t" and name[1:].isdigit() for name in parameters)
    powers = tuple(f"t{power}" for power in range(1, max(degree, 1) + 1))
    names = powers if factor_kind == PolynomialFactor.kind else _names_of(FACTORS[factor_kind])
    of_factor = _by_name(factor_kind, "number", {k: v for k, v in parameters.items() if k in names}, names)
    of_form = {name: value for name, value in parameters.items() if name not in names}
    form = _form_from_json(kind, of_form, settings)
    if isinstance(form, Bipolynomial):
        raise InputError("bipolynomial depends on temperature itself; it takes no temperature factor")
    if factor_kind == PolynomialFactor.kind:
        return TemperatureDependent(form, PolynomialFactor(tuple(of_factor)), assumed)
    return TemperatureDependent(form, FACTORS[factor_kind](*of_factor), assumed)


def _form_from_json(
    kind: str, parameters: Mapping[str, object], settings: Mapping[str, object]
) -> CommandForm | Bipolynomial:
    if kind == Hill.kind:
        values = _by_name("hill", "number", parameters, Hill.parameter_names)
        return Hill(*values, *_by_name("hill", "setting", settings, ("reference",)))
    if kind == Bipolynomial.kind:
        (degree,) = _by_name(kind, "setting", settings, ("temperature_degree",))
        if not 0 <= degree <= len(parameters) or degree != int(degree):
            raise InputError(
                f"bipolynomial: temperature_degree is {degree:g}; it must be a whole number, and every power "
                "of the command has a number for each power of the temperature up to it"
            )
        rows = max(len(parameters), 1) // (int(degree) + 1)
        names = tuple(f"c{i}{j}" for i in range(max(rows, 1)) for j in range(int(degree) + 1))
        return Bipolynomial(tuple(_by_name(kind, "number", parameters, names)), int(degree))
    _by_name(kind, "setting", settings, ())
    if kind == Polynomial.kind:
        powers = tuple(f"c{power}" for power in range(max(len(parameters), 1)))
        return Polynomial(tuple(_by_name(kind, "number", parameters, powers)))
    form = Constant if kind == Constant.kind else Exponential
    return form(*_by_name(kind, "number", parameters, form.parameter_names))


def _factor_kind(given: object) -> tuple[str, bool]:
    """Return the kind of a temperature factor and whether it is assumed."""
    if not isinstance(given, Mapping):
        raise InputError("temperature must be a table of kind and assumed")
    kind, assumed = given.get("kind"), given.get("assumed", False)
    if not isinstance(kind, str) or kind not in FACTORS:
        raise InputError(f"there is no temperature factor of kind {kind!r}; there are {', '.join(FACTORS)}")
    if not isinstance(assumed, bool) or set(given) - {"kind", "assumed"}:
        raise InputError("temperature holds kind and assumed (true or false), nothing else")
    return kind, assumed


def _names_of(factor: type[TemperatureFactor]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(factor))  # type: ignore[arg-type]  # all are dataclasses


def _by_name(kind: str, role: str, given: Mapping[str, object], names: Sequence[str]) -> list[float]:
    """Return the given values in the order of ``names``; every name once, nothing else."""
    for name in given:
        if name not in names:
            raise InputError(f"{kind} has no {role} {name!r}; {did_you_mean(name, names)}")
    values = []
    for name in names:
        value = given.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            found = f"is {value!r}" if name in given else "is missing"
            raise InputError(f"{kind}: {role} {name} {found}; it must be a finite number")
        values.append(float(value))
    return values
