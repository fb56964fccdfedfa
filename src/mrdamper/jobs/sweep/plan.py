"""A sweep's plan: what a TOML file asks for, as a list of tasks that know nothing of each other.

Three kinds: ``fit`` (many campaigns), ``tolerance`` (tracking error over dampers drawn around one) and
``heatsink`` (heat sinks for many dampers and duties). A task is plain JSON with a seed of its own, so that it
gives the same result wherever and in whatever order it runs.
"""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.errors import InputError
from mrdamper.files import read_toml
from mrdamper.jobs.options import FitOptions, HeatsinkOptions, TrackConditions
from mrdamper.models.laws import LAWS
from mrdamper.schema import Json, Option, check_ranges, fields_of, read_record, write_record
from mrdamper.thermal.drawing_file import DRAWINGS
from mrdamper.thermal.duty import DEFAULT_DUTY
from mrdamper.virtual_rig.damper import PRESETS

What = dict[str, Any]
"""What a task is told, or what came of it: plain JSON."""

SweepKind = Literal["fit", "tolerance", "heatsink"]
KINDS: tuple[str, ...] = get_args(SweepKind)


@dataclass(frozen=True, kw_only=True)
class _Fit(FitOptions):
    """The table [fit]: options of the job, and of what."""

    campaigns: Annotated[tuple[str, ...], Option("Files or folders of runs; patterns.", least_items=1)]
    law: Annotated[str | None, Option("A law of the package.", among=lambda: LAWS)] = None
    channels: str | None = None

    def tasks(self, folder: Path) -> Iterator[tuple[str, What]]:
        channels = None if self.channels is None else str(folder / self.channels)
        what = {"law": self.law, "channels": channels, "options": _of(FitOptions, self)}
        paths = [path for each in self.campaigns for path in _matches(each, folder, "campaign")]
        paths = [path for path in dict.fromkeys(paths) if not path.endswith(".truth")]
        for name, path in _named(paths):
            yield name, {"path": path, **what}


@dataclass(frozen=True, kw_only=True)
class _Tolerance(TrackConditions):
    """The table [tolerance]: tracking over dampers that are drawn around one."""

    card: str
    plant: Annotated[str, Option(among=lambda: PRESETS)] = "nominal"
    spread_percent: Annotated[float, Option(least=0.0, most=30.0)] = 10.0
    controller: Annotated[str, Option(among=lambda: NAMES)] = "recommended"
    targets: Annotated[tuple[str, ...], Option(among=lambda: SCENARIOS, least_items=1)] = tuple(SCENARIOS)
    draws: Annotated[int, Option(least=1, most=100_000)] = 100  # a plan is held as a whole

    def tasks(self, folder: Path) -> Iterator[tuple[str, What]]:
        what = write_record(self, defaults=True, nulls=True) | {"card": str(folder / self.card)}
        for k in range(what.pop("draws")):
            yield f"draw-{k:0{len(str(self.draws - 1))}d}", dict(what)


@dataclass(frozen=True, kw_only=True)
class _Heatsink(HeatsinkOptions):
    """The table [heatsink]: options of the job, and for which dampers and duties."""

    card: str
    dampers: Annotated[tuple[str, ...], Option(least_items=1)] = ("paper",)
    duties: Annotated[tuple[str, ...], Option(least_items=1)] = (DEFAULT_DUTY,)
    by_field: bool = False

    def tasks(self, folder: Path) -> Iterator[tuple[str, What]]:
        what = {"card": str(folder / self.card), "options": _of(HeatsinkOptions, self)}
        duties = [str(folder / each) if each.lower().endswith(".csv") else each for each in self.duties]
        drawings = [
            path
            for each in self.dampers
            for path in ([each] if each in DRAWINGS else _matches(each, folder, "drawing"))
        ]
        for name, drawing in _named(list(dict.fromkeys(drawings))):
            for k, duty in enumerate(duties):
                own = name if len(duties) == 1 else f"{name}-duty-{k + 1}"
                yield own, {"damper": drawing, "duty": duty, **what}


@dataclass(frozen=True, kw_only=True)
class _Document:
    """A plan's file."""

    kind: SweepKind
    seed: Annotated[int, Option("Of all tasks' own seeds.", least=0, most=10_000_000)] = 0
    fit: _Fit | None = None
    tolerance: _Tolerance | None = None
    heatsink: _Heatsink | None = None


@dataclass(frozen=True, slots=True)
class Task:
    """One job of a sweep."""

    name: str
    kind: str
    seed: int
    what: What  # the rest of what the job is told


@dataclass(frozen=True, slots=True)
class Plan:
    """All tasks of a sweep, in order."""

    name: str  # of its file
    kind: str
    seed: int
    tasks: tuple[Task, ...]

    @property
    def fingerprint(self) -> str:
        """SHA-256 over all tasks: results of another plan are not taken for this one's."""
        rows = [(task.name, task.kind, task.seed, task.what) for task in self.tasks]
        return hashlib.sha256(json.dumps(rows, sort_keys=True).encode()).hexdigest()

    @property
    def reads(self) -> tuple[Path, ...]:
        """Files and folders that the tasks read."""
        named = [
            text
            for task in self.tasks
            for key in ("path", "channels", "card", "damper", "duty")
            if isinstance(text := task.what.get(key), str) and text not in DRAWINGS and not is_words(text)
        ]
        return tuple(Path(text) for text in dict.fromkeys(named))


def is_words(text: str) -> bool:
    """Tell a duty in words, sine:15mm:1Hz:2A:1800s, from the name of a table."""
    return len(text.split(":")) >= 3 and not text.lower().endswith(".csv")


def read_plan(path: str | Path) -> Plan:
    """Return the plan in a TOML file; paths in it count from the file's own folder.

    Raises
    ------
    InputError
        A key that is missing, unknown or of the wrong kind; no campaign or drawing where one is named.
    """
    place = Path(path)
    document = read_record(_Document, _listed(read_toml(place, "sweep")), place.name)
    kind = document.kind
    inside: _Fit | _Tolerance | _Heatsink | None = getattr(document, kind)
    for other in KINDS:
        if (getattr(document, other) is None) is (other == kind):
            found = f"the table [{other}] is {'missing' if other == kind else 'of another kind of sweep'}"
            raise InputError(place=place.name, found=found, expected=f"the table [{kind}] alone")
    assert inside is not None
    check_ranges(inside, f"{place.name}: {kind}")
    tasks = tuple(inside.tasks(place.parent))
    if not tasks:
        raise InputError(f"[{kind}] gives no tasks", place=place.name, expected="at least one")
    seeds = np.random.SeedSequence(document.seed).generate_state(len(tasks))
    return Plan(
        place.name,
        kind,
        document.seed,
        tuple(Task(name, kind, int(own), what) for (name, what), own in zip(tasks, seeds, strict=True)),
    )


def _listed(document: Mapping[str, Any]) -> Json:
    """Return a document with single texts as lists; the seed of a task follows from the plan's."""
    found = dict(document)
    for kind, record in (("fit", _Fit), ("tolerance", _Tolerance), ("heatsink", _Heatsink)):
        if isinstance(table := document.get(kind), Mapping):
            many = {field.key for field in fields_of(record) if field.many}
            found[kind] = {k: [v] if k in many and isinstance(v, str) else v for k, v in table.items()}
            if "seed" in table:
                raise InputError(
                    place=f"[{kind}]", found="seed", expected="it above the table, for all tasks"
                )
    return found


def _of(options: type, record: object) -> Json:
    """Return the options of a job that a table holds, without the seed."""
    names = [field.key for field in fields_of(options) if field.key != "seed"]
    told = write_record(record, defaults=True, nulls=True)
    return {name: told[name] for name in names}


def _matches(pattern: str, folder: Path, what: str) -> list[str]:
    found = sorted(glob.glob(str(folder / pattern)))  # noqa: PTH207 - the pattern may be absolute
    if not found:
        raise InputError(
            f"matches no {what} in {folder}", place=pattern, expected="a path or a pattern of one"
        )
    return found


def _named(paths: list[str]) -> Iterator[tuple[str, str]]:
    """Give each path a name of its own: its last part, with as many parents as tell it from the others."""
    for path in paths:
        parts = Path(path).parts
        for count in range(1, len(parts) + 1):
            name = "-".join(parts[-count:])
            if sum("-".join(Path(other).parts[-count:]) == name for other in paths) == 1:
                break
        yield name.removesuffix(".toml").removesuffix(".csv"), path
