"""Requests to the server: job requests, built from the registry, and queries of the pages.

A request contains names of cards, run files and inputs in the folder, never paths or code. Only the command
line accepts a law in a Python file. The options of a request are the options of the job (``jobs.options``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatOptions
from mrdamper.registry import JOBS, KINDS, Job
from mrdamper.schema import Field, Json, Option, fields_of, read_record, unknown_name, write_record

_NAME, _WORD = r"^[^/\\\x00-\x1f]{1,160}$", r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"
_NAME_WORDS = "a name in the folder, of at most 160 characters"
_WORD_WORDS = "a name of letters, digits and ._-"
Name = Annotated[str, Option("An item in the folder.", pattern=_NAME, expected=_NAME_WORDS)]
Names = Annotated[
    tuple[Name, ...],
    Option("Items in the folder.", most_items=20_000, expected="a list of names in the folder"),
]
Length = Annotated[float, Option("A length.", unit="mm", above=0.0, below=1e6)]
Share = Annotated[float, Option("A fraction.", least=0.0, most=1.0)]


@dataclass(frozen=True, slots=True)
class Order:
    """A validated job request: kind and options as JSON."""

    kind: str
    options: Json

    @property
    def needs_runs(self) -> bool:
        """Return True if the request names no files and takes all usable runs."""
        return self.kind in {"fit", "evaluate"} and self.options["files"] is None


# --------------------------------------------------------------------------------- requests for jobs


_REQUIRED = object()
_ANNOTATED: Any = Annotated  # The types are built at run time.
_OWN: Mapping[str, Mapping[str, tuple[Any, Any]]] = {
    "fit": {
        "card": (
            _ANNOTATED[
                str,
                Option(pattern=_NAME, expected=_NAME_WORDS, label="Name of the card", group=""),
            ],
            _REQUIRED,
        ),
        "replace": (
            _ANNOTATED[bool, Option("Of the same name.", label="replace a card of the same name")],
            False,
        ),
    },
}
"""Further fields of a request by kind: name -> (type, default)."""

_NO_ORDERS = ("data list", "simulate")
"""Jobs that are not started by a job request."""


@cache
def _jobs() -> Mapping[str, Job]:
    return {name.split()[-1]: job for name, job in JOBS.items() if name not in _NO_ORDERS}


def order_kinds() -> tuple[str, ...]:
    """Return the kinds of job requests."""
    return tuple(_jobs())


def job_of(kind: str) -> Job:
    """Return the registry row of a kind."""
    return _jobs()[kind]


def request_fields(kind: str) -> tuple[Field, ...]:
    """Return the fields of a job request with type, range, default and form."""
    return fields_of(_request_type(kind))


@cache
def _request_type(kind: str) -> type:
    members = []
    for name, type_, default in _members(kind, job_of(kind)):
        members.append((name, type_) if default is _REQUIRED else (name, type_, field(default=default)))
    return make_dataclass(f"{kind}_request", members, frozen=True, kw_only=True)


def _members(kind: str, job: Job) -> Iterator[tuple[str, Any, Any]]:
    """Yield (name, type, default) of each field of a job request."""
    yield from ((name, type_, default) for name, (type_, default) in _OWN.get(kind, {}).items())
    for each in job.inputs:
        if each.option.flag != "-":
            yield _member_of(each)
    mapped = any(KINDS[each.option.kind].place == "runs" for each in job.inputs)  # Each run has its own map.
    for option in (*job.reading, *job.fields):
        is_path = option.type is Path
        if option.option.local or (is_path and mapped):
            continue
        plain: Any = str if is_path else option.type
        more: Json = {"pattern": _NAME, "expected": _NAME_WORDS} if is_path else {}
        described = replace(option.option, help=option.help, **more)
        yield option.name, _ANNOTATED[plain | None if option.optional else plain, described], option.default


def _member_of(each: Field) -> tuple[str, Any, Any]:
    """Return (name, type, default) of an input of a job."""
    kind = KINDS[each.option.kind]
    places = tuple(place for place in (kind.place, kind.also) if place)
    option = replace(
        each.option,
        help=each.help,
        group=kind.group,
        offers=kind.choices,
        places=("records", "runs") if places == ("records",) else places,
        files=kind.files,
        looks=kind.looks,
        word=each.option.kind,
    )
    if each.many:
        most = 20_000 if kind.place == "runs" else 20
        needed = each.required and kind.place != "runs"  # Without names the job reads all runs.
        words = f"a list of names, {most} at most"
        option = replace(option, most_items=most, least_items=int(needed), expected=words)
        if kind.place == "runs":
            return "files", _ANNOTATED[tuple[Name, ...] | None, option], None
        return each.key, _ANNOTATED[tuple[Name, ...], option], _REQUIRED if needed else ()
    is_word = each.option.kind in {"law", "name"}
    pattern, words = (_WORD, _WORD_WORDS) if is_word else (_NAME, _NAME_WORDS)
    option = replace(option, pattern=pattern, expected=words)
    if each.required:
        default = "paper" if each.option.kind == "drawing" else _REQUIRED
        return each.key, _ANNOTATED[str, option], default
    return each.key, _ANNOTATED[str | None if each.default is None else str, option], each.default


def read_order(kind: object, options: object) -> Order:
    """Return a validated job request; raise one InputError that lists all faults."""
    kinds = order_kinds()
    if not isinstance(kind, str) or kind not in kinds:
        raise unknown_name(f"kind is {str(kind)[:40]!r}", str(kind)[:40], kinds)
    if not isinstance(options, dict):
        raise InputError(place=kind, found=f"options are {type(options).__name__}", expected="an object")
    found: object = read_record(_request_type(kind), options, kind)
    return Order(kind, write_record(found, defaults=True, nulls=True))


# --------------------------------------------------------------------------------- queries of the pages


@dataclass(frozen=True, kw_only=True)
class Fins:
    """A heat sink design of a search."""

    fins: Annotated[int, Option("Number of fins.", least=1, most=500)]
    width_mm: Length
    thickness_mm: Length
    pitch_mm: Length
    material: Name
    emissivity: Share


@dataclass(frozen=True, kw_only=True)
class HeatCurve(HeatOptions):
    """A quick heating curve, with the options of the job."""

    card: Name
    damper: Name = "paper"
    amplitude_mm: Annotated[float, Option("Of the sine.", unit="mm", least=0.0, most=1000.0)] = 15.0
    frequency_Hz: Annotated[float, Option("Of the sine.", unit="Hz", above=0.0, most=100.0)] = 1.0
    command: Annotated[float, Option("Current or voltage.", least=-1000.0, most=1000.0)] = 2.0
    duty_share: Annotated[float, Option("Fraction of the time in operation.", least=0.05, most=1.0)] = 1.0
    duration_s: Annotated[float, Option("Duration.", unit="s", least=1.0, most=1e6)] = 1800.0


@dataclass(frozen=True, kw_only=True)
class NewDamper:
    """A new damper with its own folder on the server."""

    name: Name


@dataclass(frozen=True, kw_only=True)
class DrawingRequest:
    """A geometry that is derived from another; without a name it is not saved."""

    name: Name | None = None
    replace: bool = False
    tables: Mapping[str, Mapping[str, Any]] | None = None
    fins: Fins | None = None


@dataclass(frozen=True, kw_only=True)
class MapRequest:
    """A channel map for some files."""

    files: Annotated[tuple[Name, ...], Option("Measured files.", least_items=1, most_items=500)]
    map: Mapping[str, Any] | None = None
    save: bool = False
    head: bool = False  # Read only the beginning of large files.

    def __post_init__(self) -> None:
        def depth(value: object) -> int:
            inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
            return 1 + max(map(depth, inner), default=0)

        if self.map is not None and depth(self.map) > 5:
            raise InputError(found="map is nested too deep", expected="the tables of a channel map")
