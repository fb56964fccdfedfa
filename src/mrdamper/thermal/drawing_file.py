"""Drawings as TOML: the damper in a text, key by key, in millimetres and degC.

The keys are described in docs/thermal.md. An unknown key is an error that names the nearest; a key that is
missing is named with its unit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal, cast, get_args

from mrdamper.errors import InputError
from mrdamper.files import parse_toml, read_text
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import did_you_mean
from mrdamper.thermal.drawing import (
    Body,
    Calibration,
    Coil,
    DamperDrawing,
    Orientation,
    Piston,
    Rod,
    Surroundings,
    find_filling,
)
from mrdamper.thermal.heatsink import FinLaw, HeatSink
from mrdamper.thermal.materials import Material, find_material

__all__ = ["DRAWINGS", "calibrated_text", "drawing_of", "sink_of", "text_of"]

DRAWINGS = ("paper",)
"""Drawings by name."""

Kind = Literal["mm", "number", "text", "whole", "yes", "degC"]

_WINDING_SHARE = 0.4  # of the piston's depth around the rod, where the drawing states no coil.depth_mm

# Of each table: key -> kind. A key that is not among the required ones has a default.
_KEYS: dict[str, dict[str, Kind]] = {
    "body": {
        "outer_diameter_mm": "mm", "length_mm": "mm", "wall_mm": "mm", "cap_mm": "mm", "material": "text",
        "orientation": "text",
    },
    "piston": {"diameter_mm": "mm", "length_mm": "mm", "material": "text"},
    "rod": {"diameter_mm": "mm", "through": "yes", "material": "text"},
    "coil": {"resistance_ohm": "number", "length_mm": "mm", "depth_mm": "mm", "A_per_V": "number"},
    "fluid": {
        "preset": "text", "density_kg_m3": "number", "heat_capacity_J_kg_K": "number",
        "conductivity_W_m_K": "number", "stirring": "number", "exchange_W_K": "number",
    },
    "surroundings": {
        "ambient_degC": "degC", "air_m_s": "number", "emissivity": "number", "mount_W_K": "number",
    },
    "sink": {
        "fins": "whole", "width_mm": "mm", "thickness_mm": "mm", "pitch_mm": "mm", "material": "text",
        "emissivity": "number", "film_multiplier": "number", "correlation": "text",
        "contact_m2K_W": "number",
    },
    "calibration": dict.fromkeys(Calibration.__dataclass_fields__, "number"),
}  # fmt: skip

_NEEDED: dict[str, tuple[str, ...]] = {
    "body": ("outer_diameter_mm", "length_mm", "wall_mm"),
    "piston": ("diameter_mm", "length_mm"),
    "rod": ("diameter_mm",),
    "coil": ("resistance_ohm", "length_mm"),
    "fluid": ("preset",),
    "sink": ("fins", "width_mm", "thickness_mm", "pitch_mm"),
}

_OPTIONAL_TABLES = ("surroundings", "sink", "calibration")

Document = dict[str, Any]


def text_of(path: str | Path) -> str:
    """Return the text of a drawing's file or of a preset; an ``InputError`` if it cannot be read."""
    if str(path) in DRAWINGS:
        found = resources.files("mrdamper.thermal").joinpath("drawings", f"{path}.toml")
        return found.read_text(encoding="utf-8")
    try:
        return read_text(path, "drawing")
    except InputError as fault:
        raise InputError(
            f"drawing {str(path)!r}: the file cannot be read ({fault}); expected a drawing (TOML), or one of "
            f"the presets: {', '.join(DRAWINGS)}"
        ) from fault


def drawing_of(text: str, place: str) -> DamperDrawing:
    """Return the drawing that a TOML text holds; ``place`` stands in messages."""
    document = _parse(text, place)
    tables = {name: _table(document, name, place) for name in _KEYS if name != "sink"}
    return DamperDrawing(
        name=place,
        body=_body(tables["body"], place),
        piston=Piston(
            tables["piston"]["diameter_mm"],
            tables["piston"]["length_mm"],
            _material(tables["piston"], "steel", f"{place}: piston.material"),
        ),
        rod=Rod(
            tables["rod"]["diameter_mm"],
            tables["rod"].get("through", True),
            _material(tables["rod"], "steel", f"{place}: rod.material"),
        ),
        coil=_coil(tables["coil"], tables["piston"], tables["rod"]),
        filling=_filling(tables["fluid"], place),
        surroundings=_surroundings(tables["surroundings"]),
        sink=_sink(document, place),
        calibration=_calibration(tables["calibration"], place),
        text=text,
    )


def sink_of(text: str, place: str) -> HeatSink:
    """Return the heat sink that a TOML text holds in its table [sink]."""
    document = _parse(text, place)
    found = _sink(document, place)
    if found is None:
        raise InputError(f"{place}: there is no heat sink in it; expected a table [sink] with fins above 0")
    return found


def calibrated_text(
    text: str, entries: Mapping[str, Mapping[str, float]], title: str, *, sink: HeatSink | None = None
) -> str:
    """Return a drawing's TOML with entries of its tables put in the place of those that were there.

    Parameters
    ----------
    text : of a drawing that can be read
    entries : value by table and key
    title : a comment at the top; the comments of the text are not kept
    sink : takes the place of the text's table [sink] where that is another
    """
    document = _parse(text, title)
    if sink is not None and sink != _sink(document, title):
        document["sink"] = _sink_table(sink)
    for table, values in entries.items():
        document[table] = {**document.get(table, {}), **values}
    lines = [f"# {title}"]
    for table, values in document.items():
        lines += ["", f"[{table}]", *(f"{key} = {_in_toml(value)}" for key, value in values.items())]
    return "\n".join([*lines, ""])


def _sink_table(sink: HeatSink) -> Document:
    """Return a heat sink as the table [sink]."""
    return {
        "fins": sink.fins,
        "width_mm": 1e3 * sink.width,
        "thickness_mm": 1e3 * sink.thickness,
        "pitch_mm": 1e3 * sink.pitch,
        "material": sink.material.name,
        "emissivity": sink.emissivity,
        "film_multiplier": sink.film_multiplier,
        "contact_m2K_W": sink.contact,
        "correlation": sink.correlation,
    }


def _in_toml(value: object) -> str:
    """Return a number, text or truth value as TOML: JSON writes these alike."""
    return f"{value:.6g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def _parse(text: str, place: str) -> Document:
    try:
        document = parse_toml(text)
    except InputError as fault:
        raise InputError(f"{place}: not a TOML file: {fault}") from fault
    for key in document:
        if key not in _KEYS:
            raise InputError(f"{place}: unknown table {key!r}; {did_you_mean(key, _KEYS)}")
    return document


def _table(document: Document, name: str, place: str) -> Document:
    """Return a table with its values checked and in SI; an optional one that is missing is empty."""
    given = document.get(name)
    if given is None:
        if name in _OPTIONAL_TABLES:
            return {}
        raise InputError(f"{place}: the table [{name}] is missing; expected {', '.join(_NEEDED[name])} in it")
    if not isinstance(given, dict):
        raise InputError(f"{place}: {name} is {given!r}; expected a table [{name}]")
    kinds = _KEYS[name]
    for key in given:
        if key not in kinds:
            raise InputError(f"{place}: {name} has no key {key!r}; {did_you_mean(key, kinds)}")
    for key in _NEEDED.get(name, ()):
        if key not in given:
            raise InputError(f"{place}: {name}.{key} is missing; expected a {_WORDS[kinds[key]]}")
    return {key: _value(value, kinds[key], f"{place}: {name}.{key}") for key, value in given.items()}


_WORDS: dict[Kind, str] = {
    "mm": "number in millimetres",
    "number": "number",
    "degC": "number in degC",
    "text": "text",
    "whole": "whole number",
    "yes": "true or false",
}


def _value(given: object, kind: Kind, where: str) -> Any:  # noqa: ANN401  # what TOML holds
    fits = {
        "text": isinstance(given, str),
        "yes": isinstance(given, bool),
        "whole": isinstance(given, int) and not isinstance(given, bool),
    }.get(kind, isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given))
    if not fits:
        raise InputError(f"{where} is {given!r}; expected a {_WORDS[kind]}")
    if kind == "mm":
        return float(cast("float", given)) / 1e3
    if kind == "degC":
        return float(cast("float", given)) + ZERO_CELSIUS_K
    return float(cast("float", given)) if kind == "number" else given


def _material(table: Document, default: str, place: str) -> Material:
    return find_material(table.get("material", default), place)


def _body(table: Document, place: str) -> Body:
    orientation = table.get("orientation", "horizontal")
    if orientation not in get_args(Orientation):
        raise InputError(
            f"{place}: body.orientation is {orientation!r}; use one of: {', '.join(get_args(Orientation))}"
        )
    return Body(
        table["outer_diameter_mm"],
        table["length_mm"],
        table["wall_mm"],
        table["cap_mm"] if "cap_mm" in table else table["wall_mm"],
        _material(table, "steel", f"{place}: body.material"),
        orientation,
    )


def _coil(table: Document, piston: Document, rod: Document) -> Coil:
    depth = table.get("depth_mm", _WINDING_SHARE * 0.5 * (piston["diameter_mm"] - rod["diameter_mm"]))
    return Coil(table["resistance_ohm"], table["length_mm"], depth, table.get("A_per_V"))


def _filling(table: Document, place: str) -> Any:  # noqa: ANN401
    names = {
        "density_kg_m3": "density",
        "heat_capacity_J_kg_K": "heat_capacity",
        "conductivity_W_m_K": "conductivity",
        "stirring": "stirring",
        "exchange_W_K": "exchange",
    }
    try:
        return find_filling(table["preset"], **{names[key]: table[key] for key in table if key != "preset"})
    except InputError as fault:
        raise InputError(f"{place}: fluid: {fault}") from fault


def _surroundings(table: Document) -> Surroundings:
    names = {
        "ambient_degC": "ambient",
        "air_m_s": "air_speed",
        "emissivity": "emissivity",
        "mount_W_K": "mount",
    }
    return Surroundings(**{names[key]: value for key, value in table.items()})


def _calibration(table: Document, place: str) -> Calibration:
    try:
        return Calibration(**table)
    except InputError as fault:
        raise InputError(f"{place}: {fault}") from fault


def _sink(document: Document, place: str) -> HeatSink | None:
    """Return the heat sink of a document; None when there is none, or one of no fins."""
    given = document.get("sink")
    if given is None or (isinstance(given, dict) and given.get("fins") == 0):
        return None
    table = _table(document, "sink", place)
    body = document.get("body")
    upright = isinstance(body, dict) and body.get("orientation") == "vertical"
    names = {"emissivity": "emissivity", "film_multiplier": "film_multiplier", "contact_m2K_W": "contact"}
    optional = {names[key]: table[key] for key in table if key in names}
    try:
        return HeatSink(
            fins=table["fins"],
            width=table["width_mm"],
            thickness=table["thickness_mm"],
            pitch=table["pitch_mm"],
            material=_material(table, "aluminium-alloy", f"{place}: sink.material"),
            correlation=cast("FinLaw", table.get("correlation", "disc" if upright else "channel")),
            **optional,
        )
    except InputError as fault:
        raise fault if str(fault).startswith(place) else InputError(f"{place}: {fault}") from fault
