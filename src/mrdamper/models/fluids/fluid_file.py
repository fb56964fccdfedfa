"""Fluids as TOML: read the presets, read and write the file of a fluid.

The key ``like`` names a preset, which supplies all parts that the file does not contain. docs/fluid.md
describes the keys. Temperatures are in degC in the file and in kelvin in ``Fluid``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

from mrdamper.errors import InputError
from mrdamper.files import parse_toml, read_text, toml_text
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m
from mrdamper.models.fluids.fluid import Collapse, Fluid
from mrdamper.models.temperature import FACTORS, TemperatureFactor, make_factor
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Json, Option, fields_of, read_record, write_record

PRESETS = ("paper", "lord-mrf-132dg")
"""The fluids that come with the package."""

SCHEMA_VERSION: Final = 1

_Law = Annotated[str, Option(among=lambda: FACTORS)]


@dataclass(frozen=True, kw_only=True)
class ViscosityTable:
    """Table of the viscosity without field. It also contains the parameters of the temperature law."""

    law: _Law
    fitted_degC: Annotated[tuple[float, float] | None, Option(unit="degC")] = None
    at_20degC_Pa_s: Annotated[float, Option(unit="Pa s")]


@dataclass(frozen=True, kw_only=True)
class YieldStressTable:
    """Table of the yield stress. It also contains the parameters of the temperature law."""

    law: _Law
    saturation_Pa: Annotated[float, Option(unit="Pa")]
    field_scale_A_m: Annotated[float, Option(unit="A/m")] = FIELD_SCALE_A_m


@dataclass(frozen=True, kw_only=True)
class PropertiesTable:
    """Properties that do not depend on temperature or field."""

    particle_fraction: float
    density_kg_m3: float | None = None
    heat_capacity_J_kg_K: float | None = None
    conductivity_W_m_K: float | None = None


@dataclass(frozen=True, kw_only=True)
class FluidTables:
    """All tables and keys of a fluid file."""

    schema_version: Literal[1] = SCHEMA_VERSION
    name: str
    title: str = ""
    source: str = ""
    like: str | None = None
    valid_degC: Annotated[tuple[float, float], Option(unit="degC")] = (-40.0, 130.0)
    """Lowest and highest temperature for which the fluid data are valid."""
    viscosity: Mapping[str, Any]
    yield_stress: Mapping[str, Any]
    properties: PropertiesTable
    collapse: Collapse | None = None


def find_fluid(name_or_path: str | Path) -> Fluid:
    """Return the fluid preset with a name, or the fluid in a TOML file.

    Raises
    ------
    InputError
        If the argument is neither the name of a preset nor a readable file of a fluid.
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
    """Return the fluid in a TOML text; ``place`` begins the messages.

    Raises
    ------
    InputError
        If the text is not a valid fluid. The message names the key with the fault.
    """
    try:
        given = parse_toml(text)
    except InputError as fault:
        raise InputError(f"not a TOML file: {fault}", place=place) from fault
    tables = read_record(FluidTables, _completed(given, place), place)
    viscosity, viscosity_factor = _section(ViscosityTable, tables.viscosity, f"{place}: viscosity")
    stress, yield_factor = _section(YieldStressTable, tables.yield_stress, f"{place}: yield_stress")
    properties, valid = tables.properties, tables.valid_degC
    try:
        return Fluid(
            name=tables.name,
            title=tables.title,
            source=tables.source,
            viscosity_Pa_s=viscosity.at_20degC_Pa_s,
            viscosity_factor=viscosity_factor,
            viscosity_fitted_K=_to_kelvin(viscosity.fitted_degC or valid),
            yield_field=Carlson(stress.saturation_Pa, stress.field_scale_A_m),
            yield_factor=yield_factor,
            particle_fraction=properties.particle_fraction,
            density_kg_m3=properties.density_kg_m3,
            heat_capacity_J_kg_K=properties.heat_capacity_J_kg_K,
            conductivity_W_m_K=properties.conductivity_W_m_K,
            collapse=tables.collapse,
            valid_K=_to_kelvin(valid),
        )
    except InputError as fault:
        raise fault.prepend_place(place) from fault


def _completed(given: Json, place: str) -> Json:
    """Return the content of a fluid file, completed by the preset named in ``like``."""
    given = {"name": Path(place).stem, **given}
    like = given.get("like")
    if like is None:
        return given
    if not isinstance(like, str) or like not in PRESETS:
        raise InputError(f"like is {like!r}", place=place, expected=f"one of: {', '.join(PRESETS)}")
    base = _document_of(find_fluid(like))
    if "viscosity" in given:
        base.pop("collapse", None)  # The preset's collapse does not apply to another viscosity.
    if isinstance(given.get("properties"), Mapping):
        given["properties"] = {**base["properties"], **given["properties"]}
    return {**base, "title": f"like {like}", **given}


_Section = TypeVar("_Section", ViscosityTable, YieldStressTable)


def _section(
    kind: type[_Section], table: Mapping[str, Any], place: str
) -> tuple[_Section, TemperatureFactor]:
    """Return the record of a table and the temperature factor with its parameters."""
    own = {field.key for field in fields_of(kind)}
    record = read_record(kind, {key: value for key, value in table.items() if key in own}, place)
    parameters = {key: value for key, value in table.items() if key not in own}
    for key, value in parameters.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{key} is {value!r}", place=place, expected="a number")
    try:
        return record, make_factor(record.law, parameters)
    except InputError as fault:
        raise fault.prepend_place(place) from fault


def fluid_to_toml(fluid: Fluid) -> str:
    """Return a fluid as a TOML text; the same fluid gives the same text."""
    return toml_text(_document_of(fluid))


def _document_of(fluid: Fluid) -> Json:
    def parameters(factor: TemperatureFactor) -> Json:
        return dict(zip(factor.parameter_names, factor.parameters, strict=True))

    viscosity = ViscosityTable(
        law=fluid.viscosity_factor.kind,
        fitted_degC=_to_celsius(fluid.viscosity_fitted_K),
        at_20degC_Pa_s=fluid.viscosity_Pa_s,
    )
    stress = YieldStressTable(
        law=fluid.yield_factor.kind,
        saturation_Pa=fluid.yield_field.saturation_Pa,
        field_scale_A_m=fluid.yield_field.field_scale_A_m,
    )
    tables = FluidTables(
        name=fluid.name,
        title=fluid.title,
        source=fluid.source,
        valid_degC=_to_celsius(fluid.valid_K),
        viscosity={**write_record(viscosity, defaults=True), **parameters(fluid.viscosity_factor)},
        yield_stress={**write_record(stress, defaults=True), **parameters(fluid.yield_factor)},
        properties=PropertiesTable(
            **{each.name: getattr(fluid, each.name) for each in fields(PropertiesTable)}
        ),
        collapse=fluid.collapse,
    )
    return write_record(tables, defaults=True)


def _to_kelvin(ends: tuple[float, float]) -> tuple[float, float]:
    return ends[0] + ZERO_CELSIUS_K, ends[1] + ZERO_CELSIUS_K


def _to_celsius(ends: tuple[float, float]) -> tuple[float, float]:
    return round(ends[0] - ZERO_CELSIUS_K, 9), round(ends[1] - ZERO_CELSIUS_K, 9)
