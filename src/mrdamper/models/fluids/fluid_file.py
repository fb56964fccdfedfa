"""Fluids as TOML: the presets, the text of a fluid, and the fluid in a text.

Every number is a table of its own (value, unit, confidence, source, standard error), or a bare number of
which nothing else is known. ``like = "preset"`` takes from a preset what the text leaves out. The keys are
described in docs/fluid.md; temperatures are in degC here and in kelvin in ``fluid``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, make_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar, cast

from mrdamper.errors import InputError
from mrdamper.files import parse_toml, read_text
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m
from mrdamper.models.fluids.fluid import Collapse, Confidence, Fluid, Origin
from mrdamper.models.temperature import FACTORS, PolynomialFactor, TemperatureFactor
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Json, Option, fields_of, read_record, toml_text, write_record

PRESETS = ("paper", "lord-mrf-132dg")
"""The fluids that come with the package."""

SCHEMA_VERSION: Final = 1

_MOST_POWERS = 16  # of a polynomial in temperature


# ------------------------------------------------------------------------------------------- records


@dataclass(frozen=True, kw_only=True)
class SourcedNumber:
    """A number with what is known of it."""

    value: float
    unit: str | None = None  # None: the one that it must have
    confidence: Confidence = "D"
    standard_error: Annotated[float | None, Option(least=0.0)] = None
    source: str = "no source given"


def _number(unit: str) -> Option:
    """Return the option of a sourced number of which a file may give the value alone."""
    return Option(unit=unit, short=_bare_number, expected=f"a number in {unit} or a table")


def _bare_number(value: object) -> object:
    return {"value": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


@dataclass(frozen=True, kw_only=True)
class ViscosityTable:
    """The viscosity without field; the parameters of its law stand beside these (``_table_with_law``)."""

    law: Annotated[str, Option("of temperature", among=lambda: FACTORS)]
    fitted_degC: Annotated[tuple[float, float] | None, Option(unit="degC")] = None
    at_20degC_Pa_s: Annotated[SourcedNumber, _number("Pa s")]


@dataclass(frozen=True, kw_only=True)
class YieldStressTable:
    """The yield stress; the parameters of its law stand beside these (``_table_with_law``)."""

    law: Annotated[str, Option("of temperature", among=lambda: FACTORS)]
    field_law: Literal["carlson"] = "carlson"
    saturation_Pa: Annotated[SourcedNumber, _number("Pa")]
    field_scale_A_m: Annotated[SourcedNumber, _number("A/m")] = SourcedNumber(
        value=FIELD_SCALE_A_m, confidence="B", source="the law's own constant"
    )


@dataclass(frozen=True, kw_only=True)
class PropertiesTable:
    """The properties that no law changes."""

    particle_fraction: Annotated[SourcedNumber, _number("-")]
    density_kg_m3: Annotated[SourcedNumber | None, _number("kg/m^3")] = None
    heat_capacity_J_kg_K: Annotated[SourcedNumber | None, _number("J/(kg K)")] = None
    conductivity_W_m_K: Annotated[SourcedNumber | None, _number("W/(m K)")] = None


@dataclass(frozen=True, kw_only=True)
class CollapseTable:
    """The fall of a fluid that fails."""

    middle_K: Annotated[SourcedNumber, _number("K")]
    width_K: Annotated[SourcedNumber, _number("K")]


@dataclass(frozen=True, kw_only=True)
class FluidTables:
    """A fluid's file, key by key (docs/fluid.md)."""

    schema_version: Literal[1] = SCHEMA_VERSION
    name: str
    title: str = ""
    like: str | None = None
    valid_degC: Annotated[tuple[float, float], Option("low, high", unit="degC")] = (-40.0, 130.0)
    viscosity: Mapping[str, Any]
    yield_stress: Mapping[str, Any]
    properties: PropertiesTable
    collapse: CollapseTable | None = None


# ------------------------------------------------------------------------------------------- reading


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
            f"no file that can be read ({fault})",
            place=f"fluid {str(name_or_path)!r}",
            expected=f"a preset ({', '.join(PRESETS)}) or a file",
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
        raise InputError(f"not a TOML file: {fault}", place=place) from fault
    tables = read_record(FluidTables, _completed(given, place), place)
    viscosity, viscosity_factor = _section(ViscosityTable, tables.viscosity, f"{place}: viscosity")
    stress, yield_factor = _section(YieldStressTable, tables.yield_stress, f"{place}: yield_stress")
    sections = {
        "viscosity": viscosity,
        "yield_stress": stress,
        "properties": tables.properties,
        "collapse": tables.collapse,
    }
    numbers = dict(_sourced_numbers(sections, place))
    values = {name: number.value for name, number in numbers.items()}
    valid, fitted = tables.valid_degC, viscosity.fitted_degC
    try:
        return Fluid(
            name=tables.name,
            title=tables.title,
            viscosity_Pa_s=viscosity.at_20degC_Pa_s.value,
            viscosity_factor=viscosity_factor,
            viscosity_fitted_K=_to_kelvin(valid if fitted is None else fitted),
            yield_field=Carlson(stress.saturation_Pa.value, stress.field_scale_A_m.value),
            yield_factor=yield_factor,
            particle_fraction=tables.properties.particle_fraction.value,
            density_kg_m3=values.get("properties.density_kg_m3"),
            heat_capacity_J_kg_K=values.get("properties.heat_capacity_J_kg_K"),
            conductivity_W_m_K=values.get("properties.conductivity_W_m_K"),
            collapse=_collapse(tables.collapse),
            valid_K=_to_kelvin(valid),
            origins={
                name: Origin(each.source, each.confidence, each.standard_error)
                for name, each in numbers.items()
            },
        )
    except InputError as fault:
        raise (
            fault if place in str(fault) else (fault if place in str(fault) else fault.within(place))
        ) from fault


def _completed(given: Json, place: str) -> Json:
    """Return the document with what it leaves out taken from the preset that it says it is like."""
    given = {"name": Path(place).stem, **given}
    like = given.get("like")
    if like is None:
        for section in ("viscosity", "yield_stress", "properties"):
            if section not in given and given.keys() <= {each.key for each in fields_of(FluidTables)}:
                raise InputError(
                    f"the table [{section}] is missing",
                    place=place,
                    remedy=f"give it, or `like` with the preset to take it from ({', '.join(PRESETS)})",
                )
        return given
    if not isinstance(like, str) or like not in PRESETS:
        raise InputError(f"like is {like!r}", place=place, expected=f"one of: {', '.join(PRESETS)}")
    base = _document_of(find_fluid(like))
    if "viscosity" in given:
        base.pop("collapse", None)  # it belongs to the other fluid's viscosity
    if isinstance(given.get("properties"), Mapping):
        given["properties"] = {**base["properties"], **given["properties"]}
    return {**base, "title": f"like {like}", **given}


# Of each section and law, once asked for.
_TABLES_WITH_LAW: dict[tuple[type, tuple[tuple[str, str], ...]], type] = {}

_Section = TypeVar("_Section", ViscosityTable, YieldStressTable)


def _section(
    kind: type[_Section], table: Mapping[str, Any], place: str
) -> tuple[_Section, TemperatureFactor]:
    """Return the record of a section and its factor of temperature; the section says which law that is."""
    law = table.get("law")
    if not isinstance(law, str) or law not in FACTORS:
        raise InputError(f"{place}.law is {law!r}", expected=f"one of: {', '.join(FACTORS)}")
    # a factor of the law, for the names and units of its parameters
    if law == PolynomialFactor.kind:
        powers = sum(1 for key in table if key[:1] == "t" and key[1:].isdigit())
        blank: TemperatureFactor = PolynomialFactor((0.0,) * min(max(powers, 1), _MOST_POWERS))
    else:
        form = cast("Any", FACTORS[law])
        blank = form(*(0.0 for _ in fields(form)))
    parameters = tuple(zip(blank.parameter_names, blank.units, strict=True))
    record = read_record(_table_with_law(kind, parameters), table, place)
    try:
        return record, blank.with_parameters([getattr(record, name).value for name in blank.parameter_names])
    except InputError as fault:
        raise fault.within(place) from fault


def _table_with_law(kind: type[_Section], parameters: tuple[tuple[str, str], ...]) -> type[_Section]:
    """Return the record of a section that also has the parameters (name, unit) of its law of temperature."""
    if (kind, parameters) not in _TABLES_WITH_LAW:
        _TABLES_WITH_LAW[kind, parameters] = make_dataclass(
            kind.__name__,
            [(name, Annotated[SourcedNumber, _number(unit)]) for name, unit in parameters],
            bases=(kind,),
            frozen=True,
            kw_only=True,
            namespace={"__module__": __name__},
        )
    return cast("type[_Section]", _TABLES_WITH_LAW[kind, parameters])


def _sourced_numbers(sections: Mapping[str, Any], place: str) -> Iterator[tuple[str, SourcedNumber]]:
    """Yield every number of the sections by its name in the file; its unit is checked."""
    for section, record in sections.items():
        for field in fields_of(type(record)) if record is not None else ():
            number = getattr(record, field.name)
            if not isinstance(number, SourcedNumber):
                continue
            if number.unit not in (None, field.option.unit):
                raise InputError(
                    f"unit is {number.unit!r}",
                    place=f"{place}: {section}.{field.key}",
                    expected=f"{field.option.unit!r}, or none",
                )
            yield f"{section}.{field.key}", number


def _collapse(table: CollapseTable | None) -> Collapse | None:
    return None if table is None else Collapse(table.middle_K.value, table.width_K.value)


def _to_kelvin(ends: tuple[float, float]) -> tuple[float, float]:
    return ends[0] + ZERO_CELSIUS_K, ends[1] + ZERO_CELSIUS_K


# ------------------------------------------------------------------------------------------- writing


def fluid_to_toml(fluid: Fluid) -> str:
    """Return a fluid as a TOML text; the same fluid gives the same text."""
    return toml_text(_document_of(fluid))


def _document_of(fluid: Fluid) -> Json:
    """Return the fluid as nested tables, every number as a table of its own."""
    document: Json = {
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
        number = SourcedNumber(
            value=value,
            unit=unit,
            confidence=origin.confidence,
            standard_error=origin.standard_error,
            source=origin.source,
        )
        document.setdefault(section, {})[key] = write_record(number, defaults=True)
    return document


def _to_celsius(ends: tuple[float, float]) -> list[float]:
    return [round(end - ZERO_CELSIUS_K, 9) for end in ends]
