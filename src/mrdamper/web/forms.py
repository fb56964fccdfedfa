"""Describe form fields as JSON; the JavaScript of the pages builds the forms.

The fields are generated from the declarations of the jobs (``jobs.options``, ``registry``). The JavaScript
contains no options of jobs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mrdamper.jobs.previews.choices import WRITTEN
from mrdamper.schema import Field, Json, fields_of
from mrdamper.web.schemas import ORDER_JOBS, HeatCurve, request_fields

_SHOWN_UNITS = {"degC": "°C", "ohm": "Ω"}
_SHOWN = ("group", "offers", "places", "files", "looks", "word", "part")
_TYPES = {bool: "yes", int: "whole", float: "number"}


def all_forms(choices: Mapping[str, Any]) -> Json:
    """Return the fields of forms for jobs, TOML tables of files, and heating curves.

    ``choices`` contains the names that the forms offer, such as laws and presets.
    """
    forms = {kind: [_field(each, choices) for each in request_fields(kind)] for kind in ORDER_JOBS}
    written = {
        f"{kind}-{table.key}": [_written(each, choices) for each in fields_of(table.item)]
        for kind, record in WRITTEN.items()
        for table in fields_of(record)
    }
    return {**forms, **written, "heat curve": [_field(each, choices) for each in fields_of(HeatCurve)]}


def _written(field: Field, choices: Mapping[str, Any]) -> Json:
    """Return a form field for a key of a TOML file; empty fields are not written."""
    default = None if field.required else field.default
    if field.option.key and isinstance(default, int | float):
        default = field.option.from_si(default)
    shown = field.option.default_help or ("" if default is None else str(default))
    row = _field(replace(field, default=default if isinstance(default, bool) else None), choices)
    return {**row, "none": shown, "required": field.required}


def label_of(field: Field) -> str:
    """Return the declared label of a field, or else a label made from its name without the unit."""
    if field.option.label:
        return field.option.label
    unit = re.sub(r"\W+", "_", field.option.unit).strip("_")
    words = field.name.removesuffix(f"_{unit}").replace("_", " ")
    return words[:1].upper() + words[1:]


def _field(field: Field, choices: Mapping[str, Any]) -> Json:
    option = field.option
    default = None if field.required else field.default
    return {
        "name": field.key,
        "label": label_of(field),
        "help": field.help,
        "type": _TYPES.get(field.item, "text"),
        "many": field.many,
        "required": field.required,
        "default": default,
        "begins": default if option.begins is None else option.begins,
        "none": option.default_help or ("none" if option.places else ""),
        "unit": _SHOWN_UNITS.get(option.unit, option.unit).replace("^2", "²").replace("^3", "³"),
        "choices": _choices(field, choices),
        # True: the user may enter a value that is not in ``choices``.
        "free": not field.choices and not option.places and option.offers in {"", "runs"},
        **{name: getattr(option, name) for name in _SHOWN},
    }


def _choices(field: Field, choices: Mapping[str, Any]) -> list[list[str]]:
    """Return the choices as pairs of value and label."""
    if field.choices:
        return [list(pair) for pair in zip(field.choices, field.option.titles or field.choices, strict=True)]
    offered = choices.get(field.option.offers, ())
    named = [each if isinstance(each, Mapping) else {"name": each, "title": ""} for each in offered]
    return [[one["name"], ": ".join(filter(None, (one["name"], one["title"])))] for one in named]
