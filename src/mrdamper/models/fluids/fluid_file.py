"""Fluids as TOML: the presets, the text of a fluid, and the fluid in a text.

Every number is a table of its own (value, unit, confidence, source, standard error), or a bare number of
which nothing else is known. ``like = "preset"`` takes from a preset what the text leaves out. The keys are
described in docs/fluid.md; temperatures are in degC here and in kelvin in ``fluid``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, cast

from mrdamper.errors import InputError
from mrdamper.files import parse_toml, read_text
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m
from mrdamper.models.fluids.fluid import PROPERTIES, Collapse, Fluid, Origin
from mrdamper.models.temperature import FACTORS, PolynomialFactor, TemperatureFactor
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import did_you_mean

__all__ = ["PRESETS", "SCHEMA_VERSION", "find_fluid", "fluid_from_toml", "fluid_to_toml"]

PRESETS = ("paper", "lord-mrf-132dg")
"""The fluids that come with the package."""

SCHEMA_VERSION = 1

Document = dict[str, Any]  # what tomllib returns

_SECTIONS = ("viscosity", "yield_stress", "properties", "collapse")
_TOP = ("schema_version", "name", "title", "like", "valid_degC", *_SECTIONS)
_PARAMETER_KEYS = ("value", "unit", "confidence", "source", "standard_error")


def find_fluid(name_or_path: str | Path) -> Fluid:
    """Return a preset by its name, or the fluid in a TOML file.

    Raises
    ------
    InputError
        Neither a preset nor a readable file of a fluid.
    """
    if str(name_or_path) in PRESETS:
        return _preset(str(name_or_path))
    path = Path(name_or_path)
    try:
        text = read_text(path, "fluid")
    except InputError as fault:
        raise InputError(
            f"fluid {str(name_or_path)!r}: neither a preset ({', '.join(PRESETS)}) nor a file that can be "
            f"read ({fault})"
        ) from fault
    return fluid_from_toml(text, path.name)


@cache
def _preset(name: str) -> Fluid:
    text = (Path(__file__).parent / f"{name}.toml").read_text(encoding="utf-8")
    return fluid_from_toml(text, name)


def fluid_from_toml(text: str, place: str = "fluid") -> Fluid:
    """Return the fluid that a TOML text holds; ``place`` stands in messages.

    Raises
    ------
    InputError
        The text is no fluid; the message names the place in it.
    """
    try:
        given = parse_toml(text)
    except InputError as fault:
        raise InputError(f"{place}: not a TOML file: {fault}") from fault
    try:
        return Fluid(**_Reader(_completed(given, place), place).arguments())
    except InputError as fault:
        raise fault if place in str(fault) else InputError(f"{place}: {fault}") from fault


def fluid_to_toml(fluid: Fluid) -> str:
    """Return a fluid as a TOML text; the same fluid gives the same text.

    Plain keys come first, then a table for each section and each number.
    """
    document = _document_of(fluid)
    lines = _plain(document)
    for section in _SECTIONS:
        table = document.get(section, {})
        lines += ["", f"[{section}]", *_plain(table)] if table else []
        for key, number in table.items():
            if isinstance(number, dict):
                lines += ["", f"[{section}.{key}]", *_plain(number)]
    return "\n".join([*lines, ""])


# ------------------------------------------------------------------------------------------- writing


def _document_of(fluid: Fluid) -> Document:
    """Return the fluid as nested tables, every number as a table of its own."""
    document: Document = {
        "schema_version": SCHEMA_VERSION,
        "name": fluid.name,
        "title": fluid.title,
        "valid_degC": _to_celsius(fluid.valid_K),
        "viscosity": {
            "law": fluid.viscosity_factor.kind,
            "fitted_degC": _to_celsius(fluid.viscosity_fitted_K),
        },
        "yield_stress": {"field_law": "carlson", "law": fluid.yield_factor.kind},
        "properties": {},
    }
    for name, (value, unit) in fluid.parameters.items():
        section, _, key = name.partition(".")
        origin = fluid.origins[name]
        table: Document = {"value": value, "unit": unit, "confidence": origin.confidence}
        if origin.standard_error is not None:
            table["standard_error"] = origin.standard_error
        document.setdefault(section, {})[key] = {**table, "source": origin.source}
    return document


def _to_celsius(ends: tuple[float, float]) -> list[float]:
    return [round(end - ZERO_CELSIUS_K, 9) for end in ends]


def _plain(table: Document) -> list[str]:
    return [f"{key} = {_scalar(value)}" for key, value in table.items() if not isinstance(value, dict)]


def _scalar(value: object) -> str:
    """Return a text, number or list as TOML: JSON's spelling is TOML's, but for the delete character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


# ------------------------------------------------------------------------------------------- reading


def _completed(given: Document, place: str) -> Document:
    """Return the document with what it leaves out taken from the preset that it says it is like."""
    _check_keys(given, _TOP, place)
    version = given.get("schema_version", SCHEMA_VERSION)
    if version != SCHEMA_VERSION:
        raise InputError(f"{place}: schema_version is {version!r}; this version reads {SCHEMA_VERSION}")
    for section in _SECTIONS:
        if not isinstance(given.get(section, {}), dict):
            raise InputError(f"{place}: {section} is {given[section]!r}; expected a table [{section}]")
    given = {"name": Path(place).stem, **given}
    if "like" not in given:
        return given
    like = given["like"]
    if not isinstance(like, str) or like not in PRESETS:
        raise InputError(f"{place}: like is {like!r}; expected one of: {', '.join(PRESETS)}")
    base = _document_of(find_fluid(like))
    if "viscosity" in given:
        base.pop("collapse", None)  # it belongs to the other fluid's viscosity
    properties = {**base["properties"], **given.get("properties", {})}
    return {**base, "title": f"like {like}", **given, "properties": properties}


class _Reader:
    """Takes a document apart, key by key, and keeps the origin of each number on the way."""

    def __init__(self, document: Document, place: str) -> None:
        self.document = document
        self.place = place
        self.origins: dict[str, Origin] = {}

    def arguments(self) -> Document:
        for section in ("viscosity", "yield_stress", "properties"):
            if section not in self.document:
                raise InputError(
                    f"{self.place}: the table [{section}] is missing; give it, or `like` with the preset "
                    f"to take it from ({', '.join(PRESETS)})"
                )
        valid = self.temperatures(self.document.get("valid_degC", [-40.0, 130.0]), "valid_degC")
        fitted = self.document["viscosity"].get("fitted_degC")
        field_law = self.document["yield_stress"].get("field_law", "carlson")
        if field_law != "carlson":
            raise InputError(f"{self.place}: yield_stress.field_law is {field_law!r}; expected 'carlson'")
        return {
            "name": _text(self.document["name"], f"{self.place}: name"),
            "title": _text(self.document.get("title", ""), f"{self.place}: title"),
            "viscosity_Pa_s": self.number("viscosity", "at_20degC_Pa_s", "Pa s"),
            "viscosity_factor": self.factor("viscosity", ("fitted_degC", "at_20degC_Pa_s")),
            "viscosity_fitted_K": (
                valid if fitted is None else self.temperatures(fitted, "viscosity.fitted_degC")
            ),
            "yield_field": Carlson(
                self.number("yield_stress", "saturation_Pa", "Pa"),
                self.number("yield_stress", "field_scale_A_m", "A/m", default=FIELD_SCALE_A_m),
            ),
            "yield_factor": self.factor("yield_stress", ("field_law", "saturation_Pa", "field_scale_A_m")),
            **self.properties(),
            "collapse": self.collapse(),
            "valid_K": valid,
            "origins": self.origins,
        }

    def number(self, section: str, key: str, unit: str, default: float | None = None) -> float:
        """Return a number of a section, and keep its origin."""
        where = f"{self.place}: {section}.{key}"
        given = self.document[section].get(key)
        if given is None and default is not None:
            self.origins[f"{section}.{key}"] = Origin("the law's own constant", "B")
            return default
        if given is None:
            raise InputError(f"{where} is missing; expected a number [{unit}]")
        if not isinstance(given, dict):
            self.origins[f"{section}.{key}"] = Origin("no source given", "D")
            return _finite(given, where)
        _check_keys(given, _PARAMETER_KEYS, where)
        if given.get("unit", unit) != unit:
            raise InputError(f"{where}: unit is {given['unit']!r}; expected {unit!r}, or none")
        error = given.get("standard_error")
        try:
            self.origins[f"{section}.{key}"] = Origin(
                _text(given.get("source", "no source given"), "source"),
                given.get("confidence", "D"),
                None if error is None else _finite(error, "standard_error"),
            )
        except InputError as fault:
            raise InputError(f"{where}: {fault}") from fault
        return _finite(given.get("value"), f"{where}.value")

    def factor(self, section: str, other_keys: Sequence[str]) -> TemperatureFactor:
        """Return the temperature law of a section, whose other keys are named."""
        table = self.document[section]
        kind = table.get("law")
        if not isinstance(kind, str) or kind not in FACTORS:
            raise InputError(
                f"{self.place}: {section}.law is {kind!r}; expected one of: {', '.join(FACTORS)}"
            )
        # a factor of the kind, for the names and units of its numbers
        if kind == PolynomialFactor.kind:
            powers = sum(1 for key in table if key[:1] == "t" and key[1:].isdigit())
            blank: TemperatureFactor = PolynomialFactor((0.0,) * max(powers, 1))
        else:
            form = cast("Any", FACTORS[kind])
            blank = form(*(0.0 for _ in fields(form)))
        _check_keys(table, ("law", *other_keys, *blank.parameter_names), f"{self.place}: {section}")
        named = zip(blank.parameter_names, blank.units, strict=True)
        parameters = [self.number(section, name, unit) for name, unit in named]
        try:
            return blank.with_parameters(parameters)
        except InputError as fault:
            raise InputError(f"{self.place}: {section}: {fault}") from fault

    def properties(self) -> Document:
        table = self.document["properties"]
        _check_keys(table, tuple(PROPERTIES), f"{self.place}: properties")
        wanted = [key for key in PROPERTIES if key in table or key == "particle_fraction"]
        return {key: self.number("properties", key, PROPERTIES[key]) for key in wanted}

    def collapse(self) -> Collapse | None:
        if "collapse" not in self.document:
            return None
        _check_keys(self.document["collapse"], ("middle_K", "width_K"), f"{self.place}: collapse")
        return Collapse(self.number("collapse", "middle_K", "K"), self.number("collapse", "width_K", "K"))

    def temperatures(self, given: object, key: str) -> tuple[float, float]:
        where = f"{self.place}: {key}"
        if not isinstance(given, list) or len(given) != 2:
            raise InputError(f"{where} is {given!r}; expected two temperatures, [low, high] in degC")
        low, high = (_finite(end, where) + ZERO_CELSIUS_K for end in given)
        return low, high


def _finite(given: object, where: str) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        raise InputError(f"{where} is {given!r}; expected a finite number")
    return float(given)


def _text(given: object, where: str) -> str:
    if not isinstance(given, str):
        raise InputError(f"{where} is {given!r}; expected a text")
    return given


def _check_keys(table: Mapping[str, object], known: Sequence[str], place: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"{place}: unknown key {key!r}; {did_you_mean(key, known)}")
