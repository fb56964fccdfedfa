"""Data classes that define and validate the requests to the server.

The classes of job requests are generated from the declarations of the jobs. A request contains names of
cards, run files and inputs in the folder, never paths or code. Only the command line accepts a law in a
Python file. The options of a request are the options of the job (``jobs.options``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, make_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatOptions
from mrdamper.jobs.previews.choices import HeatSink
from mrdamper.registry import JOBS, Job
from mrdamper.schema import MORE, Field, Json, Option, fields_of, read_record, unknown_name, write_record

_NAME = Option(
    pattern=r"^[^/\\\x00-\x1f]{1,160}$", expected="a name in the folder, of at most 160 characters"
)
_WORD = Option(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$", expected="a name of letters, digits and ._-")
_ANNOTATED: Any = Annotated  # mypy would reject annotated types that are built at run time.
Name = Annotated[str, _NAME]

ORDER_JOBS: Mapping[str, Job] = {
    name.split()[-1]: job for name, job in JOBS.items() if name not in {"data list", "simulate"}
}
"""Jobs that a request can start, by the kind of the request."""


@dataclass(frozen=True, slots=True)
class Order:
    """A validated job request: kind and options as JSON."""

    kind: str
    options: Json


def read_order(kind: object, options: object) -> Order:
    """Return the validated job request. If it is invalid, raise one InputError that lists all faults."""
    if not isinstance(kind, str) or kind not in ORDER_JOBS:
        raise unknown_name(f"kind is {str(kind)[:40]!r}", str(kind)[:40], ORDER_JOBS)
    if not isinstance(options, dict):
        raise InputError(place=kind, found=f"options are {type(options).__name__}", expected="an object")
    found: object = read_record(_request_type(kind), options, kind)
    return Order(kind, write_record(found, defaults=True, nulls=True))


def request_fields(kind: str) -> tuple[Field, ...]:
    """Return the fields of a job request, each with type, range, default and properties of the web form."""
    return fields_of(_request_type(kind))


@cache
def _request_type(kind: str) -> type:
    members = [(name, type_, field(default=default)) for name, type_, default in _members(ORDER_JOBS[kind])]
    return make_dataclass(f"{kind}_request", members, frozen=True, kw_only=True)


def _members(job: Job) -> Iterator[tuple[str, Any, Any]]:
    """Generate name, type and default of each field of a job request."""
    if job.out == "card":
        yield "card", _ANNOTATED[str, replace(_NAME, label="Name of the card")], MISSING
        option = Option("Replace an existing card.", label="replace a card of the same name", group=MORE)
        yield "replace", _ANNOTATED[bool, option], False
    yield from (_input(each) for each in job.inputs if each.option.flag != "-")
    has_maps = any("runs" in each.option.places and each.many for each in job.inputs)
    for each in (*job.reading, *job.fields):
        if each.option.local or (each.type is Path and has_maps):  # On the server, each file has its own map.
            continue
        if each.type is Path:
            yield _input(each)
        else:
            type_ = each.type | None if each.optional else each.type
            yield each.name, _ANNOTATED[type_, replace(each.option, help=each.help)], each.default


def _input(each: Field) -> tuple[str, Any, Any]:
    """Return name, type and default of a request field for files in the work folder."""
    option, default = replace(each.option, help=each.help), each.default
    if each.many:
        is_runs = option.places == ("runs",)  # optional, because None means all runs
        needed = each.required and not is_runs
        words = f"a list of names, {option.most_items} at most"
        option = replace(option, least_items=int(needed), expected=words)
        type_ = tuple[Name, ...] | None if is_runs else tuple[Name, ...]
        return each.key, _ANNOTATED[type_, option], None if is_runs else MISSING if needed else ()
    known = _NAME if option.places else _WORD
    option = replace(option, pattern=known.pattern, expected=known.expected)
    if each.required:
        return each.key, _ANNOTATED[str, option], MISSING if option.begins is None else option.begins
    return each.key, _ANNOTATED[str | None if default is None else str, option], default


@dataclass(frozen=True, kw_only=True)
class HeatCurve(HeatOptions):
    """Request for a quick heating curve, with the options of the job ``heat``."""

    card_name: Annotated[str, replace(_NAME, key="card")]
    damper: Name = "paper"
    amplitude_mm: Annotated[float, Option("Amplitude of the sine.", unit="mm", least=0.0, most=1000.0)] = 15.0
    frequency_Hz: Annotated[float, Option("Frequency of the sine.", unit="Hz", above=0.0, most=100.0)] = 1.0
    command: Annotated[float, Option("Constant current or voltage.", least=-1000.0, most=1000.0)] = 2.0
    duty_share: Annotated[float, Option("Fraction of the time in operation.", least=0.05, most=1.0)] = 1.0
    duration_s: Annotated[float, Option("Total duration.", unit="s", least=1.0, most=1e6)] = 1800.0


@dataclass(frozen=True, kw_only=True)
class NewDamper:
    """Request for a new damper, which gets a separate folder on the server."""

    name: Name


@dataclass(frozen=True, kw_only=True)
class DrawingRequest:
    """Request to change a geometry. If a new name is given, the result is saved."""

    name: Name | None = None
    replace: bool = False
    tables: Mapping[str, Mapping[str, Any]] | None = None
    fins: HeatSink | None = None


@dataclass(frozen=True, kw_only=True)
class MapRequest:
    """Request to preview or save a channel map for some files."""

    files: Annotated[tuple[Name, ...], Option("Measured files.", least_items=1, most_items=500)]
    map: Mapping[str, Any] | None = None
    save: bool = False
    head: bool = False  # Read only the beginning of large files.
