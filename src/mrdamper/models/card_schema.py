"""Reading a model card: the file is checked whole before anything is made of it.

All its problems are reported at once, each with its place. Nothing in the file is ever run. Older schema
versions are brought up to the present one first.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from mrdamper.errors import InputError
from mrdamper.files import read_text
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import (
    RUN_KEYS,
    SCHEMA_VERSION,
    SIGNALS,
    SPLITS,
    Document,
    Evidence,
    Excerpt,
    Json,
    ModelCard,
    is_finite,
)
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.dependence import ParameterLaw
from mrdamper.models.dependence_json import dependence_from_json
from mrdamper.models.laws import LAWS, HysteresisLaw
from mrdamper.schema import did_you_mean

__all__ = ["UPGRADES", "card_from_json", "read_card"]

_KEYS = (
    *("schema_version", "title", "law", "python_law", "command_unit", "command_lag_s"),
    *("command_lag_standard_error_s", "actuation", "temperature_range_K", "coefficients", "envelope"),
    *("preparation", "evidence", "excerpt", "sources", "notes"),
)
_PARAMETER_KEYS = ("value", "unit", "standard_error")
_EVIDENCE_KEYS = (
    *("method", "seed", "cost", "dataset_fingerprint", *SPLITS, "runs", "session_offsets_N", "versions"),
)


def _from_version_1(document: Document) -> Document:
    """Version 1 knew neither temperature nor an actuation."""
    excerpt = document.get("excerpt")
    if isinstance(excerpt, dict):
        excerpt = {**excerpt, "temperature_K": None}
    return {**document, "actuation": None, "temperature_range_K": None, "excerpt": excerpt}


_MOST_BYTES = 1 << 26  # of a card

UPGRADES: dict[int, Callable[[Document], Document]] = {1: _from_version_1}
"""Schema version -> the function that turns a document of that version into one of the next."""


def read_card(path: str | Path, *, python_law: HysteresisLaw | None = None) -> ModelCard:
    """Read and check a card. Nothing in the file is ever run.

    Parameters
    ----------
    path : the card
    python_law : the user's law that the card names, from ``load_python_law``; needed for such a card only

    Raises
    ------
    InputError
        With every problem of the file and its place.
    """
    text = read_text(path, "card", _MOST_BYTES)
    try:
        document = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except json.JSONDecodeError as fault:
        raise InputError(
            f"{path}: line {fault.lineno}, column {fault.colno}: {fault.msg}; not a whole JSON file "
            f"(cut off while copying?)"
        ) from fault
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{path}: not a card: {fault}") from fault
    try:
        return card_from_json(document, python_law=python_law)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from fault


def card_from_json(document: object, *, python_law: HysteresisLaw | None = None) -> ModelCard:
    """Return the card that ``card_to_json`` wrote; raise ``InputError`` with all that is wrong with it."""
    problems: list[str] = []
    top = _Place(_upgraded(document), "", problems).table(_KEYS)
    law = _read_law(top, python_law)
    damper = None if law is None else _read_damper(top, law)
    errors = {} if damper is None else _read_standard_errors(top, damper)
    envelope = _read_envelope(top["envelope"])
    evidence = _read_evidence(top["evidence"])
    excerpt = _read_excerpt(top["excerpt"])
    title, sources = top["title"].text(), tuple(each.text() for each in top["sources"].items())
    preparation, notes = (_plain(top[key].entries()) for key in ("preparation", "notes"))
    if damper is not None and envelope is not None:
        for problem in damper.problems(envelope):
            top["coefficients"].say(problem)
    if problems or damper is None or envelope is None or evidence is None:
        found = "" if len(problems) == 1 else f"{len(problems)} problems\n  "
        raise InputError(found + "\n  ".join(problems))
    return ModelCard(
        title=title,
        damper=damper,
        envelope=envelope,
        evidence=evidence,
        standard_errors=errors,
        preparation=preparation,
        excerpt=excerpt,
        sources=sources,
        notes=notes,
        python_law=top["python_law"].value,
    )


def _read_law(top: Mapping[str, _Place], python_law: HysteresisLaw | None) -> HysteresisLaw | None:
    name, reference = top["law"].text(), top["python_law"]
    if reference.value in (None, _MISSING):
        if name and name not in LAWS:
            top["law"].say(f"there is no law {name!r}; {did_you_mean(name, LAWS)}")
        return LAWS.get(name)
    file = reference.text()
    if python_law is None:
        reference.say(
            f"law {name!r} is a user's own, and a card carries no code; "
            f"pass python_law=load_python_law({file!r}) if you trust that file"
        )
    elif python_law.name != name:
        reference.say(f"the card needs the law {name!r}; the one passed is {python_law.name!r}")
    else:
        return python_law
    return None


def _read_damper(top: Mapping[str, _Place], law: HysteresisLaw) -> Damper | None:
    unit = top["command_unit"].text("A", "V")
    lag = top["command_lag_s"].number(low=0.0)
    forms: dict[str, ParameterLaw] = {}
    for name, place in top["coefficients"].entries().items():
        if name not in law.names:
            place.say(f"{law.name} has no such coefficient; {did_you_mean(name, law.names)}")
            continue
        form = _read_coefficient(place, law[name].unit, unit)
        if form is not None:
            forms[name] = form
    actuation = _read_actuation(top["actuation"])
    if actuation is not None and lag > 0.0:
        top["actuation"].say(f"command_lag_s is {lag:g} beside it; expected one of them")
        actuation = None
    held = _read_temperature_range(top["temperature_range_K"])
    return top["coefficients"].build(
        lambda: Damper(law, forms, "V" if unit == "V" else "A", lag, actuation, held)
    )


def _read_actuation(place: _Place) -> Actuation | None:
    if place.value is None:
        return None
    needed = tuple(each.name for each in fields(Actuation) if each.name != "play")
    table = place.table(needed, optional=("play",))
    values = {name: each.number_or_none() for name, each in table.items() if each.value is not _MISSING}
    return place.build(lambda: Actuation(**values))  # type: ignore[arg-type]  # checked when built


def _read_temperature_range(place: _Place) -> tuple[float, float] | None:
    if place.value is None:
        return None
    low, high = place.pair()
    sound = place.build(lambda: (low, high))
    if sound is not None and not 0.0 < low <= high:
        place.say(f"is [{low:g}, {high:g}]; expected two temperatures, low and high")
        return None
    return sound


def _read_coefficient(place: _Place, unit: str, command_unit: str) -> ParameterLaw | None:
    """Return the parameter law of one coefficient, its units checked against what the law says."""
    entry = place.table(("kind", "numbers", "unit"), optional=("settings", "temperature"))
    entry["unit"].text(unit)
    parameters = {name: each.table(_PARAMETER_KEYS) for name, each in entry["numbers"].entries().items()}
    values = {name: each["value"].number() for name, each in parameters.items()}
    settings = {name: each.number() for name, each in entry["settings"].entries().items()}
    data: Document = {"kind": entry["kind"].text(), "numbers": values, "settings": settings}
    if entry["temperature"].value is not _MISSING:
        data["temperature"] = entry["temperature"].value
    form = place.build(lambda: dependence_from_json(data))
    if form is not None and command_unit:
        for name, expected in zip(form.parameter_names, form.units(unit, command_unit), strict=True):
            parameters[name]["unit"].text(expected)
    return form


def _read_standard_errors(top: Mapping[str, _Place], damper: Damper) -> dict[str, float | None]:
    """Return the standard errors; called when the coefficients themselves were read."""
    found = {LAG: top["command_lag_standard_error_s"].number_or_none()}
    for coefficient, place in top["coefficients"].entries().items():
        for number, each in place.entries()["numbers"].entries().items():
            found[f"{coefficient}.{number}"] = each.entries()["standard_error"].number_or_none()
    return found


def _read_envelope(place: _Place) -> OperatingEnvelope | None:
    ends = place.table(("command", "displacement_m", "velocity_m_s", "temperature_K"))
    command, displacement, velocity = (ends[k].pair() for k in ("command", "displacement_m", "velocity_m_s"))
    temperature = None if ends["temperature_K"].value is None else ends["temperature_K"].pair()
    return place.build(lambda: OperatingEnvelope(command, displacement, velocity, temperature))


def _read_evidence(place: _Place) -> Evidence | None:
    table = place.table(_EVIDENCE_KEYS)
    runs = [run.table(RUN_KEYS, others=True) for run in table["runs"].items()]
    for run in runs:
        run["name"].text()
        run["split"].text(*SPLITS)
        run["rmse_N"].number(low=0.0)
        run["nrmse_percent"].number(low=0.0)
    seed = None if table["seed"].value is None else table["seed"].whole()
    made = place.build(
        lambda: Evidence(
            runs=tuple(_plain(run) for run in runs),
            method=table["method"].text(),
            cost=table["cost"].number(),
            dataset_fingerprint=table["dataset_fingerprint"].text(),
            seed=seed,
            versions={name: each.text() for name, each in table["versions"].entries().items()},
            session_offsets_N={n: each.number() for n, each in table["session_offsets_N"].entries().items()},
        )
    )
    if made is not None:
        for split in SPLITS:
            if table[split].value != made.errors(split):
                table[split].say(f"is {table[split].value}; the runs listed give {made.errors(split)}")
    return made


def _read_excerpt(place: _Place) -> Excerpt | None:
    if place.value is None:
        return None
    table = place.table(tuple(each.name for each in fields(Excerpt)))
    signals = {name: tuple(each.number() for each in table[name].items()) for name in SIGNALS}
    return place.build(
        lambda: Excerpt(
            run=table["run"].text(),
            step_s=table["step_s"].number(low=0.0),
            rmse_N=table["rmse_N"].number(low=0.0),
            scored_from=table["scored_from"].whole(),
            dead_band_m=table["dead_band_m"].number(low=0.0),
            temperature_K=table["temperature_K"].number_or_none(),
            **signals,
        )
    )


_MISSING: Json = object()
T = TypeVar("T")


class _Place:
    """A value in the document and where it stands.

    What is wrong with it is added to ``problems`` and reads as an empty value, so that one reading finds
    all faults; a missing value is reported once, by the table that it is missing from.
    """

    def __init__(self, value: Json, path: str, problems: list[str]) -> None:
        self.value, self.path, self.problems = value, path, problems

    def say(self, problem: str) -> None:
        self.problems.append(f"{self.path}: {problem}" if self.path else problem)

    def _refuse(self, expected: str) -> None:
        if self.value is not _MISSING:
            shown = json.dumps(self.value, default=str)
            self.say(f"is {shown if len(shown) < 60 else shown[:57] + '...'}; expected {expected}")

    def build(self, make: Callable[[], T]) -> T | None:
        """Return what ``make`` makes of this place, or None when something in it is wrong."""
        before = len(self.problems)
        here = tuple(self.path + mark for mark in ".[:")
        if self.value is _MISSING or any(problem.startswith(here) for problem in self.problems):
            return None
        try:
            made = make()
        except InputError as fault:
            self.say(str(fault).removeprefix(f"{self.path}: "))
        return made if len(self.problems) == before else None

    def entries(self) -> dict[str, _Place]:
        """Return the places in a table of any keys."""
        if not isinstance(self.value, dict):
            self._refuse("a table {...}")
            return {}
        return {key: _Place(each, self._below(key), self.problems) for key, each in self.value.items()}

    def table(
        self, keys: Sequence[str], *, optional: Sequence[str] = (), others: bool = False
    ) -> dict[str, _Place]:
        """Return the places in a table that has ``keys``, and no more than ``optional`` unless ``others``."""
        found, known = self.entries(), (*keys, *optional)
        for key in found:
            if key not in known and not others:
                found[key].say(f"unknown key; {did_you_mean(key, known)}")
        for key in known:
            if key not in found:
                found[key] = _Place(_MISSING, self._below(key), self.problems)
                if key in keys and isinstance(self.value, dict):
                    found[key].say("missing")
        return found

    def _below(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def items(self) -> list[_Place]:
        if not isinstance(self.value, list):
            self._refuse("a list [...]")
            return []
        return [_Place(each, f"{self.path}[{k}]", self.problems) for k, each in enumerate(self.value)]

    def text(self, *choices: str) -> str:
        """Return the text, one of ``choices`` when there are any."""
        if isinstance(self.value, str) and (self.value in choices or not choices):
            return self.value
        self._refuse(" or ".join(repr(choice) for choice in choices) if choices else "a text")
        return ""

    def number(self, *, low: float = -math.inf) -> float:
        if is_finite(self.value) and self.value >= low:
            return float(self.value)
        self._refuse("a finite number" if low == -math.inf else f"a finite number, at least {low:g}")
        return max(low, 0.0)

    def whole(self) -> int:
        if isinstance(self.value, int) and not isinstance(self.value, bool) and self.value >= 0:
            return self.value
        self._refuse("a whole number, at least 0")
        return 0

    def pair(self) -> tuple[float, float]:
        ends = [each.number() for each in self.items()]
        if len(ends) != 2 and isinstance(self.value, list):
            self._refuse("two numbers, low and high")
        return (ends[0], ends[1]) if len(ends) == 2 else (0.0, 0.0)

    def number_or_none(self) -> float | None:
        """Return the number (0 or more), or None for null."""
        return None if self.value is None else self.number(low=0.0)


def _upgraded(document: object) -> Document:
    """Return the document in the present schema, by one function per step."""
    if not isinstance(document, dict):
        raise InputError(f"a card is a table {{...}} with schema_version; found {type(document).__name__}")
    version = document.get("schema_version")
    if isinstance(version, bool) or not isinstance(version, int):
        raise InputError(f"schema_version is {version!r}; a model card has an integer there")
    if version > SCHEMA_VERSION:
        raise InputError(
            f"schema_version is {version}, and this mrdamper reads up to {SCHEMA_VERSION}; upgrade mrdamper"
        )
    while version < SCHEMA_VERSION:
        if version not in UPGRADES:
            raise InputError(f"schema_version is {version}, which no longer can be read")
        document = {**UPGRADES[version](document), "schema_version": version + 1}
        version += 1
    return document


def _plain(table: Mapping[str, _Place]) -> Document:
    return {key: place.value for key, place in table.items() if place.value is not _MISSING}


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a JSON number")


def _unique(pairs: list[tuple[str, Any]]) -> Document:
    table = dict(pairs)
    if len(table) < len(pairs):
        often = Counter(name for name, _ in pairs)
        twice = min(name for name in often if often[name] > 1)
        raise ValueError(f"the key {twice!r} stands twice in one table")
    return table
