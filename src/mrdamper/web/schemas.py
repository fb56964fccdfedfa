"""What may be asked of the server: requests for jobs, made from the registry, and questions of the pages.

A request names things in the folder (a card, a run's file, an input), never paths, and nothing that would be
run: a law in a Python file is for the command line alone. Its options are the job's own (``jobs.options``);
what the pages add to them, and leave out, stands in ``_PAGES``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, make_dataclass
from functools import cache
from typing import Annotated, Any

from mrdamper.errors import InputError
from mrdamper.registry import JOBS, KINDS, Input, Job
from mrdamper.schema import Field, Json, Option, did_you_mean, fields_of, read_record, write_record

__all__ = ["HeatCurve", "MapRequest", "Order", "order_kinds", "read_order", "request_fields"]

_NAME, _WORD = r"^[^/\\\x00-\x1f]{1,160}$", r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"
Name = Annotated[
    str,
    Option(
        "Something in the folder.", pattern=_NAME, expected="a name in the folder, of at most 160 characters"
    ),
]
Word = Annotated[
    str, Option("A name of the package.", pattern=_WORD, expected="a name of letters, digits and ._-")
]
Names = Annotated[
    tuple[Name, ...],
    Option("Things in the folder.", most_items=20_000, expected="a list of names in the folder"),
]
Celsius = Annotated[float, Option("A temperature.", unit="degC", least=-100.0, most=400.0)]
AirSpeed = Annotated[float, Option("Speed of the air.", unit="m/s", least=0.0, most=200.0)]
Length = Annotated[float, Option("A length.", unit="mm", above=0.0, below=1e6)]
Share = Annotated[float, Option("A share.", least=0.0, most=1.0)]


@dataclass(frozen=True, slots=True)
class Order:
    """A job that was asked for: its kind, and what it is told as plain JSON."""

    kind: str
    options: Json

    @property
    def needs_runs(self) -> bool:
        """Whether it is of all usable runs, as no files were named."""
        return self.kind in {"identify", "predict"} and self.options["files"] is None


# --------------------------------------------------------------------------------- requests for jobs


@dataclass(frozen=True, slots=True, kw_only=True)
class _Page:
    """What the pages add to the options of a job, and what they leave out."""

    more: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)  # name -> (type, default)
    without: tuple[str, ...] = ()


_REQUIRED = object()
_ANNOTATED: Any = Annotated  # of types that are known at run time
_PAGES: Mapping[str, _Page] = {
    "check": _Page(without=("channels",)),
    "identify": _Page(more={"card": (Name, _REQUIRED), "replace": (bool, False)}, without=("channels",)),
    "predict": _Page(without=("channels", "law")),
    "compare": _Page(without=("law",)),
}


@dataclass(frozen=True, kw_only=True)
class _Rig:
    preset: Word = "nominal"
    damper: Name | None = None
    campaign: Name = "short"
    seed: Annotated[int, Option(least=0, below=2**31)] = 0


@dataclass(frozen=True, kw_only=True)
class _Demo:
    quick: bool = True
    seed: Annotated[int, Option(least=0, below=2**31)] = 0


@dataclass(frozen=True, kw_only=True)
class _Cycles:
    record: Name
    channels: Name | None = None
    least_stroke_mm: Length | None = None
    model: Name | None = None
    flip_force: bool = False


@dataclass(frozen=True, kw_only=True)
class _Sweep:
    plan: Name
    workers: Annotated[int | None, Option("Processes.", least=1, most=64)] = None


@dataclass(frozen=True, kw_only=True)
class _Fetch:
    name: Word


_BY_HAND: Mapping[str, type] = {
    "rig": _Rig,
    "demo": _Demo,
    "cycles": _Cycles,
    "sweep": _Sweep,
    "fetch": _Fetch,
}
_NO_ORDERS = ("cite", "data list", "data fetch", "forecast", "observe", "ride")
"""Jobs that are questions of the pages, or for the command line and Python alone."""


def order_kinds() -> tuple[str, ...]:
    """Return the kinds of jobs that can be asked for."""
    return (*(name for name in JOBS if name not in {*_BY_HAND, *_NO_ORDERS}), *_BY_HAND)


def request_fields(kind: str) -> tuple[Field, ...]:
    """Return the fields of a request for a job, with their types, ranges and defaults."""
    return fields_of(_request_type(kind))


@cache
def _request_type(kind: str) -> type:
    if kind in _BY_HAND:
        return _BY_HAND[kind]
    members = []
    for name, type_, default in _members(JOBS[kind], _PAGES.get(kind, _Page())):
        members.append((name, type_) if default is _REQUIRED else (name, type_, field(default=default)))
    return make_dataclass(f"{kind}_request", members, frozen=True, kw_only=True)


def _members(job: Job, page: _Page) -> Iterator[tuple[str, Any, Any]]:
    """Yield (name, type, default) of all that a request for a job holds."""
    yield from ((name, type_, default) for name, (type_, default) in page.more.items())
    for each in job.inputs:
        if each.flag != "-":
            yield _member_of(each)
    for option in (*job.reading, *job.fields):
        if option.name not in page.without:
            kind: Any = option.type | None if option.optional else option.type
            yield option.name, _ANNOTATED[kind, option.option], option.default


def _member_of(each: Input) -> tuple[str, Any, Any]:
    """Return (name, type, default) of a thing that a job reads."""
    kind = KINDS[each.kind]
    if kind.place == "runs":
        return "files", Names | None, None
    if kind.many:
        few = Annotated[
            tuple[Name, ...],
            Option(
                each.help,
                most_items=20,
                least_items=int(each.required),
                expected="a list of 20 names at most",
            ),
        ]
        return each.told, few, _REQUIRED if each.required else ()
    single: Any = Word if each.kind == "law" else Name
    if not each.required:
        return each.told, single if each.default else single | None, each.default
    return each.told, single, "paper" if each.kind == "drawing" else _REQUIRED


def read_order(kind: object, options: object) -> Order:
    """Return a job that was asked for, or one ``InputError`` with all that is wrong with it."""
    kinds = order_kinds()
    if not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"kind is {str(kind)[:40]!r}; {did_you_mean(str(kind)[:40], kinds)}")
    if not isinstance(options, dict):
        raise InputError(place=kind, found=f"options are {type(options).__name__}", expected="an object")
    found: object = read_record(_request_type(kind), options, kind)
    return Order(kind, write_record(found, defaults=True, nulls=True))


# ------------------------------------------------------------------------------- questions of the pages


@dataclass(frozen=True, kw_only=True)
class Fins:
    """A heat sink of a search, to be heated."""

    fins: Annotated[int, Option("Number of fins.", least=1, most=500)]
    width_mm: Length
    thickness_mm: Length
    pitch_mm: Length
    material: Name
    emissivity: Share


@dataclass(frozen=True, kw_only=True)
class HeatCurve:
    """A quick heating curve."""

    card: Name
    damper: Name = "paper"
    amplitude_mm: Annotated[float, Option("Of the sine.", unit="mm", least=0.0, most=1000.0)] = 15.0
    frequency_Hz: Annotated[float, Option("Of the sine.", unit="Hz", above=0.0, most=100.0)] = 1.0
    command: Annotated[float, Option("Current or voltage.", least=-1000.0, most=1000.0)] = 2.0
    duty_share: Annotated[float, Option("Share of the time at work.", least=0.05, most=1.0)] = 1.0
    duration_s: Annotated[float, Option("Duration.", unit="s", least=1.0, most=1e6)] = 1800.0
    ambient_degC: Celsius | None = None
    air_m_s: AirSpeed | None = None
    with_sink: bool = True
    fins: Fins | None = None
    past_limit: bool = False


@dataclass(frozen=True, kw_only=True)
class MapRequest:
    """A channel map for some files."""

    files: Annotated[tuple[Name, ...], Option("Measured files.", least_items=1, most_items=500)]
    map: Mapping[str, Any] | None = None
    save: bool = False
    head: bool = False  # look at the beginning alone, where that tells something

    def __post_init__(self) -> None:
        def depth(value: object) -> int:
            inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
            return 1 + max(map(depth, inner), default=0)

        if self.map is not None and depth(self.map) > 5:
            raise InputError(found="map is nested too deep", expected="the tables of a channel map")
