"""Read and write geometry files, which describe a damper as TOML in millimetres and degC.

The keys are declared by the classes in ``drawing`` and by ``HeatSink``. docs/thermal.md describes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Annotated

from mrdamper.errors import InputError
from mrdamper.files import parse_toml, read_text, toml_text
from mrdamper.schema import Json, Option, fields_of, read_record, unknown_name, write_record
from mrdamper.thermal.drawing import (
    Body,
    Calibration,
    Coil,
    DamperDrawing,
    Filling,
    Piston,
    Rod,
    Seals,
    Surroundings,
    find_filling,
)
from mrdamper.thermal.heat_capacity import PolynomialHeatCapacity
from mrdamper.thermal.heatsink import HeatSink, Manufacture

DRAWINGS = ("paper",)
"""Names of the geometry files that are installed with the package (presets)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FluidTable:
    """The table [fluid] of a geometry file: a fluid preset with optional changes."""

    preset: Annotated[str, Option(offers="fluids")]
    """Name of a fluid preset, or path of a fluid file."""
    density: Annotated[float | None, Option(key="density_kg_m3", unit="kg/m^3", above=0.0)] = None
    heat_capacity: Annotated[float | None, Option(key="heat_capacity_J_kg_K", unit="J/(kg K)", above=0.0)] = (
        None
    )
    conductivity: Annotated[float | None, Option(key="conductivity_W_m_K", unit="W/(m K)", above=0.0)] = None
    """Conductivity of the fluid at rest."""
    stirring: Annotated[float | None, Option(above=0.0)] = None
    """Ratio of the effective conductivity to the conductivity at rest."""
    exchange: Annotated[float | None, Option(key="exchange_W_K", unit="W/K", least=0.0)] = None
    """Conductance of the pumped fluid from the gap to each chamber."""
    limit: Annotated[
        float | None, Option(key="limit_degC", unit="degC", default_help="the limit of the preset")
    ] = None
    """Limit of the hottest point of the fluid."""

    def filling(self) -> Filling:
        """Return the thermal properties of the fluid preset with the changes of this table."""
        given = {each.name: getattr(self, each.name) for each in fields(self)[1:]}
        limit = given.pop("limit")
        found = find_filling(self.preset, {name: x for name, x in given.items() if x is not None})
        return found if limit is None else replace(found, valid_K=(found.valid_K[0], limit))


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawingTables:
    """The tables of a geometry file."""

    body: Body
    piston: Piston
    rod: Rod
    coil: Coil
    fluid: FluidTable
    seals: Seals = field(default_factory=Seals)
    surroundings: Surroundings = field(default_factory=Surroundings)
    sink: HeatSink | None = None
    calibration: Calibration = field(default_factory=Calibration)
    manufacture: Manufacture = field(default_factory=Manufacture)
    heat_capacity: PolynomialHeatCapacity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _SinkTable:
    """Schema of a heat-sink file: the table [sink] is required."""

    sink: HeatSink


def read_drawing(path: str | Path) -> DamperDrawing:
    """Return the geometry in a TOML file, or a preset such as ``paper``.

    Raises
    ------
    InputError
        If the file does not exist or the geometry is invalid.
    """
    return drawing_of(text_of(path), Path(path).name)


def read_sink(path: str | Path) -> HeatSink:
    """Return the heat sink in the table [sink] of a TOML file, which can also be a geometry file."""
    return sink_of(text_of(path), Path(path).name)


def text_of(path: str | Path) -> str:
    """Return the text of a geometry file or preset; raise ``InputError`` if the file is not readable."""
    if str(path) in DRAWINGS:
        found = resources.files("mrdamper.thermal").joinpath("drawings", f"{path}.toml")
        return found.read_text(encoding="utf-8")
    try:
        return read_text(path, "drawing")
    except InputError as fault:
        raise InputError(
            place=f"drawing {str(path)!r}",
            found=f"the file cannot be read ({fault})",
            expected=f"a drawing (TOML), or one of the presets: {', '.join(DRAWINGS)}",
        ) from fault


def drawing_of(text: str, place: str = "drawing") -> DamperDrawing:
    """Return the geometry in a TOML text; ``place`` is used in messages."""
    tables = read_record(DrawingTables, _without_empty_sink(_parse(text, place)), place)
    try:
        filling = tables.fluid.filling()
    except InputError as fault:
        raise InputError(place=place, found=f"fluid: {fault}") from fault
    return DamperDrawing(
        name=place,
        body=tables.body,
        piston=tables.piston,
        rod=tables.rod,
        coil=tables.coil,
        filling=filling,
        seals=tables.seals,
        surroundings=tables.surroundings,
        sink=tables.sink,
        calibration=tables.calibration,
        manufacture=tables.manufacture,
        heat_capacity=tables.heat_capacity,
        text=text,
    )


def sink_of(text: str, place: str) -> HeatSink:
    """Return the heat sink in the table [sink] of a TOML text; other tables are ignored."""
    document = _parse(text, place)
    known = [each.key for each in fields_of(DrawingTables)]
    for key in document:
        if key not in known:
            raise unknown_name(f"unknown key {key!r}", key, known, place)
    found = _sink_of(document, place)
    if found is None:
        raise InputError(
            place=place, found="the file contains no heat sink", expected="a table [sink] with fins above 0"
        )
    return found


def calibrated_text(
    text: str,
    entries: Mapping[str, Mapping[str, float]],
    title: str,
    *,
    sink: HeatSink | None = None,
) -> str:
    """Return the TOML text of a geometry file with some changed values.

    Parameters
    ----------
    text : text of a valid geometry file; its comments are removed
    entries : new values by table and key, which are written with six digits
    title : comment at the top of the new text
    sink : heat sink that replaces the table [sink] if it is different
    """
    document = _parse(text, title)
    if sink is not None and sink != _sink_of(document, title):
        document["sink"] = write_record(sink, defaults=True)
    for table, values in entries.items():
        rounded = {key: float(f"{value:.6g}") for key, value in values.items()}
        document[table] = {**document.get(table, {}), **rounded}
    return toml_text(document, title)


def _parse(text: str, place: str) -> Json:
    try:
        return parse_toml(text)
    except InputError as fault:
        raise InputError(place=place, found=f"not a TOML file: {fault}") from fault


def _sink_of(document: Json, place: str) -> HeatSink | None:
    """Return the heat sink in a parsed TOML file; None if missing or without fins."""
    table = _without_empty_sink(document).get("sink")
    return None if table is None else read_record(_SinkTable, {"sink": table}, place).sink


def _without_empty_sink(document: Json) -> Json:
    """Return the tables of a parsed TOML file; omit a table [sink] without fins."""
    sink = document.get("sink")
    if isinstance(sink, dict) and sink.get("fins") == 0:
        return {key: table for key, table in document.items() if key != "sink"}
    return document
