"""A sweep's plan: what a TOML file asks for, as a list of tasks that know nothing of each other.

Three kinds: ``identify`` (many campaigns), ``tolerance`` (tracking error over dampers drawn around one) and
``sink`` (heat sinks for many dampers and duties). A task is plain JSON with a seed of its own, so that it
gives the same result wherever and in whatever order it runs.
"""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.errors import InputError
from mrdamper.files import read_toml
from mrdamper.identify.temperature import TEMPERATURES
from mrdamper.models.laws import LAWS
from mrdamper.rig.damper import PRESETS
from mrdamper.schema import did_you_mean
from mrdamper.thermal.drawing_file import DRAWINGS
from mrdamper.thermal.duty import DEFAULT_DUTY

__all__ = ["KINDS", "Plan", "Task", "What", "read_plan"]

What = dict[str, Any]
"""What a task is told, or what came of it: plain JSON."""

KINDS = ("identify", "tolerance", "sink")

_MOST_SPREAD_PERCENT = 30.0
_MOST_DRAWS = 100_000  # a plan is held as a whole


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


def read_plan(path: str | Path) -> Plan:
    """Return the plan in a TOML file; paths in it count from the file's own folder.

    Raises
    ------
    InputError
        A key that is missing, unknown or of the wrong kind; no campaign or drawing where one is named.
    """
    place = Path(path)
    table = _Table(read_toml(place, "sweep"), place.name)
    kind = table.text("kind", None, KINDS)
    seed = table.whole("seed", 0, 0)
    inside = table.table(kind)
    table.done()
    tasks = tuple(_TASKS[kind](inside, place.parent))
    inside.done()
    if not tasks:
        raise InputError(f"{place.name}: [{kind}] gives no tasks; expected at least one")
    seeds = np.random.SeedSequence(seed).generate_state(len(tasks))
    return Plan(
        place.name,
        kind,
        seed,
        tuple(Task(name, kind, int(own), what) for (name, what), own in zip(tasks, seeds, strict=True)),
    )


class _Table:
    """A TOML table that is taken apart key by key; what is left over is an error."""

    def __init__(self, given: Mapping[str, Any], place: str) -> None:
        self._given, self._place, self._known = dict(given), place, set[str]()

    def _take(self, key: str) -> Any:  # noqa: ANN401 - whatever TOML holds
        self._known.add(key)
        return self._given.get(key)

    def _refuse(self, key: str, found: object, expected: str) -> InputError:
        said = "is missing" if found is None else f"is {found!r}"
        return InputError(f"{self._place}: {key} {said}; expected {expected}")

    def table(self, key: str) -> _Table:
        found = self._take(key)
        if not isinstance(found, dict):
            raise self._refuse(f"the table [{key}]", found, "one, with what the sweep is of")
        return _Table(found, f"{self._place} [{key}]")

    def text(self, key: str, default: str | None, among: tuple[str, ...] | None = None) -> str:
        found = self._take(key)
        found = default if found is None else found
        expected = "a text" if among is None else f"one of {', '.join(among)}"
        if not isinstance(found, str) or (among is not None and found not in among):
            raise self._refuse(key, found, expected)
        return found

    def texts(
        self, key: str, default: tuple[str, ...] | None, among: tuple[str, ...] | None = None
    ) -> tuple[str, ...]:
        found = self._take(key)
        if found is None and default is not None:
            return default
        rows = [found] if isinstance(found, str) else found
        if not isinstance(rows, list) or not rows or not all(isinstance(row, str) for row in rows):
            raise self._refuse(key, found, "a list of texts")
        for row in rows:
            if among is not None and row not in among:
                raise InputError(f"{self._place}: {key}: there is no {row!r}; {did_you_mean(row, among)}")
        return tuple(rows)

    def number(self, key: str, default: float | None, low: float, high: float) -> float:
        found = self._take(key)
        found = default if found is None else found
        if isinstance(found, bool) or not isinstance(found, int | float) or not low <= found <= high:
            raise self._refuse(key, found, f"a number, {low:g} to {high:g}")
        return float(found)

    def numbers(self, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
        found = self._take(key)
        rows = list(default) if found is None else found
        if (
            not isinstance(rows, list)
            or not all(isinstance(r, int | float) and np.isfinite(r) for r in rows)
            or not rows
        ):
            raise self._refuse(key, found, "a list of numbers")
        return tuple(float(row) for row in rows)

    def whole(self, key: str, default: int | None, low: int, high: int = 10_000_000) -> int:
        found = self._take(key)
        found = default if found is None else found
        if isinstance(found, bool) or not isinstance(found, int) or not low <= found <= high:
            raise self._refuse(key, found, f"a whole number, {low} to {high}")
        return found

    def done(self) -> None:
        """Refuse keys that nobody asked for."""
        for key in self._given:
            if key not in self._known:
                raise InputError(
                    f"{self._place}: unknown key {key!r}; {did_you_mean(key, tuple(self._known))}"
                )


def _matches(pattern: str, folder: Path, what: str) -> list[str]:
    found = sorted(glob.glob(str(folder / pattern)))  # noqa: PTH207 - the pattern may be absolute
    if not found:
        raise InputError(f"{pattern}: matches no {what} in {folder}; expected a path or a pattern of one")
    return found


def _identify(table: _Table, folder: Path) -> Iterator[tuple[str, What]]:
    law = table.text("law", "", ("", *LAWS)) or None
    options = {
        "law": law,
        "hold_out": list(table.texts("hold_out", ())),
        "starts": table.whole("starts", 3, 1, 100),
        "temperature": table.text("temperature", "auto", TEMPERATURES),
        "channels": table.text("channels", "") or None,
    }
    if options["channels"] is not None:
        options["channels"] = str(folder / str(options["channels"]))
    paths = [path for each in table.texts("campaigns", None) for path in _matches(each, folder, "campaign")]
    paths = [path for path in dict.fromkeys(paths) if not path.endswith(".truth")]
    for name, path in _named(paths):
        yield name, {"path": path, **options}


def _tolerance(table: _Table, folder: Path) -> Iterator[tuple[str, What]]:
    what: What = {
        "card": str(folder / table.text("card", None)),
        "plant": table.text("plant", "nominal", tuple(PRESETS)),
        "spread_percent": table.number("spread_percent", 10.0, 0.0, _MOST_SPREAD_PERCENT),
        "controller": table.text("controller", "recommended", NAMES),
        "targets": list(table.texts("targets", tuple(SCENARIOS), tuple(SCENARIOS))),
        "temperatures_degC": list(table.numbers("temperatures_degC", (20.0, 60.0, 100.0, 123.0))),
        "rate_Hz": table.number("rate_Hz", 1000.0, 100.0, 5000.0),
    }
    draws = table.whole("draws", 100, 1, _MOST_DRAWS)
    for k in range(draws):
        yield f"draw-{k:0{len(str(draws - 1))}d}", dict(what)


def _sink(table: _Table, folder: Path) -> Iterator[tuple[str, What]]:
    card = str(folder / table.text("card", None))
    duties = [
        str(folder / each) if each.lower().endswith(".csv") else each
        for each in table.texts("duties", (DEFAULT_DUTY,))
    ]
    method = table.text("method", "grid", ("grid", "nsga2"))
    named = table.texts("dampers", ("paper",))
    drawings = [
        path for each in named for path in ([each] if each in DRAWINGS else _matches(each, folder, "drawing"))
    ]
    for name, drawing in _named(list(dict.fromkeys(drawings))):
        for k, duty in enumerate(duties):
            own = name if len(duties) == 1 else f"{name}-duty-{k + 1}"
            yield own, {"card": card, "damper": drawing, "duty": duty, "method": method}


def _named(paths: list[str]) -> Iterator[tuple[str, str]]:
    """Give each path a name of its own: its last part, with as many parents as tell it from the others."""
    for path in paths:
        parts = Path(path).parts
        for count in range(1, len(parts) + 1):
            name = "-".join(parts[-count:])
            if sum("-".join(Path(other).parts[-count:]) == name for other in paths) == 1:
                break
        yield name.removesuffix(".toml").removesuffix(".csv"), path


_TASKS: Mapping[str, Callable[[_Table, Path], Iterator[tuple[str, What]]]] = {
    "identify": _identify,
    "tolerance": _tolerance,
    "sink": _sink,
}
