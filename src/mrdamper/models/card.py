"""The model card: what identification hands on, as one JSON file that never carries code.

A card holds the damper (law, dependence of each coefficient, numbers with units and standard errors), its
operating envelope, how its data were prepared, the evidence (errors run by run), and a short excerpt of
one run on which it must reproduce its own stated error. docs/card.md describes the file key by key.

The same card gives the same bytes. A file is checked whole before anything is made of it: all its problems
are reported at once, each with its place.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import ParameterLaw, dependence_from_json, dependence_to_json, did_you_mean
from mrdamper.models.laws import LAWS, HysteresisLaw
from mrdamper.quantities import FloatArray

__all__ = [
    "SCHEMA_VERSION",
    "Evidence",
    "Excerpt",
    "ModelCard",
    "card_from_json",
    "card_to_json",
    "cut_excerpt",
    "read_card",
    "verify_excerpt",
    "write_card",
]

SCHEMA_VERSION = 1

Json = Any  # what json.loads returns, or its read-only copy
Document = dict[str, Json]
Simulate = Callable[[Damper, Trajectory], FloatArray]

UPGRADES: dict[int, Callable[[Document], Document]] = {}
"""Schema version -> the function that turns a document of that version into one of the next."""

LAG = "command_lag_s"
"""The lag's name among the standard errors (it is a number of the damper, not of a coefficient)."""

_KEYS = (
    *("schema_version", "title", "law", "python_law", "command_unit", "command_lag_s"),
    *("command_lag_standard_error_s", "coefficients", "envelope", "preparation", "evidence", "excerpt"),
    *("sources", "notes"),
)
_NUMBER_KEYS = ("value", "unit", "standard_error")
_SIGNALS = ("displacement_m", "velocity_m_s", "acceleration_m_s2", "command", "force_N")
_SPLITS = ("training", "held_out")
_RUN_KEYS = ("name", "split", "rmse_N", "nrmse_percent")
_EVIDENCE_KEYS = (
    *("method", "seed", "cost", "dataset_fingerprint", *_SPLITS, "runs", "session_offsets_N", "versions"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Why a card may be believed: the errors of every run, and where its numbers come from.

    Each run has at least ``name``, ``split`` ("training" or "held_out"), ``rmse_N`` and ``nrmse_percent``.
    """

    runs: tuple[Mapping[str, Any], ...]
    method: str
    cost: float
    dataset_fingerprint: str
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    session_offsets_N: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("runs", "versions", "session_offsets_N"):
            object.__setattr__(self, name, _freeze(getattr(self, name), f"evidence.{name}"))
        object.__setattr__(self, "cost", float(self.cost))
        for k, run in enumerate(self.runs):
            lacking = [key for key in _RUN_KEYS if key not in run]
            if lacking or run["split"] not in _SPLITS:
                wrong = f"no {', '.join(lacking)}" if lacking else f"split is {run['split']!r}"
                raise InputError(f"evidence.runs[{k}]: {wrong}; expected {', '.join(_RUN_KEYS)}")

    def errors(self, split: str) -> dict[str, float | int | None]:
        """Return the number of runs of a split and their median and worst ``nrmse_percent``."""
        found = [run["nrmse_percent"] for run in self.runs if run["split"] == split]
        return {
            "runs": len(found),
            "median_nrmse_percent": statistics.median(found) if found else None,
            "worst_nrmse_percent": max(found, default=None),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Excerpt:
    """A short stretch of one training run, and the card's error on it when simulated from rest."""

    run: str
    step_s: float
    displacement_m: tuple[float, ...]
    velocity_m_s: tuple[float, ...]
    acceleration_m_s2: tuple[float, ...]
    command: tuple[float, ...]
    force_N: tuple[float, ...]
    rmse_N: float  # from sample `scored_from` on
    scored_from: int = 0
    dead_band_m: float = 0.0

    def __post_init__(self) -> None:
        lengths = {name: len(getattr(self, name)) for name in _SIGNALS}
        if len(set(lengths.values())) != 1 or not 0 <= self.scored_from < len(self.force_N):
            raise InputError(
                f"excerpt: lengths are {lengths} and scored_from is {self.scored_from}; expected "
                f"equal lengths and one of the samples"
            )

    def trajectory(self) -> Trajectory:
        x, v, a, command = (np.array(getattr(self, name)) for name in _SIGNALS[:4])
        return Trajectory(self.step_s, x, v, a, command, dead_band=self.dead_band_m)

    def error(self, damper: Damper, simulate: Simulate) -> float:
        """Return the RMS force error [N] of a damper on the excerpt."""
        residual = simulate(damper, self.trajectory()) - np.array(self.force_N)
        return float(np.sqrt(np.mean(residual[self.scored_from :] ** 2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCard:
    """A damper with its evidence. ``python_law`` is ``file.py:Class`` when the law is a user's own."""

    title: str
    damper: Damper
    envelope: OperatingEnvelope
    evidence: Evidence
    standard_errors: Mapping[str, float | None] = field(default_factory=dict)  # by flat number name
    preparation: Mapping[str, Any] = field(default_factory=dict)
    excerpt: Excerpt | None = None
    sources: tuple[str, ...] = ()
    notes: Mapping[str, Any] = field(default_factory=dict)
    python_law: str | None = None

    def __post_init__(self) -> None:
        numbers = (*self.damper.numbers, LAG)
        for name in self.standard_errors:
            if name not in numbers:
                raise InputError(f"standard_errors: no number {name!r}; {did_you_mean(name, numbers)}")
        if (self.damper.law.python is None) != (self.python_law is None):
            raise InputError(f"law {self.damper.law.name!r} and python_law {self.python_law!r} disagree")
        self.damper.check(self.envelope)
        complete = {name: self.standard_errors.get(name) for name in numbers}
        object.__setattr__(self, "standard_errors", _freeze(complete, "standard_errors", ordered=True))
        object.__setattr__(self, "preparation", _freeze(self.preparation, "preparation"))
        object.__setattr__(self, "notes", _freeze(self.notes, "notes"))
        object.__setattr__(self, "sources", tuple(self.sources))


def cut_excerpt(
    damper: Damper,
    trajectory: Trajectory,
    force: FloatArray,
    simulate: Simulate,
    *,
    run: str,
    samples: slice,
    scored_from: int = 0,
) -> Excerpt:
    """Return a stretch of a run with the damper's error on it, numbers rounded to nine digits.

    ``force`` is the measured one [N]. Pass the simulation by which the card will be verified.
    """
    t = trajectory
    columns = (t.displacement, t.velocity, t.acceleration, t.command, force)
    rounded = {
        name: tuple(float(f"{value:.9g}") for value in column[samples])
        for name, column in zip(_SIGNALS, columns, strict=True)
    }
    unscored = Excerpt(
        run=run,
        step_s=float(t.step),
        rmse_N=0.0,
        scored_from=scored_from,
        dead_band_m=float(t.dead_band),
        **rounded,
    )
    return Excerpt(**{**_as_dict(unscored), "rmse_N": unscored.error(damper, simulate)})


def verify_excerpt(card: ModelCard, simulate: Simulate) -> float:
    """Return the re-simulated error [N] on the card's excerpt.

    Raises
    ------
    InputError
        No excerpt, or an error that differs from the stated one by more than 1e-4 of the peak force.
    """
    if card.excerpt is None:
        raise InputError(f"card {card.title!r} carries no excerpt to verify; identify again to have one")
    found = card.excerpt.error(card.damper, simulate)
    allowed = 1e-4 * max(map(abs, card.excerpt.force_N))
    if not abs(found - card.excerpt.rmse_N) <= allowed:
        raise InputError(
            f"card {card.title!r}: its error on the excerpt of {card.excerpt.run} is {found:.6g} N, and it "
            f"states {card.excerpt.rmse_N:.6g} N; its numbers were changed, or the simulation was"
        )
    return found


# ------------------------------------------------------------------------------------------------ writing


def write_card(card: ModelCard, path: str | Path) -> None:
    """Write the card; the file appears whole or not at all."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        beside.write_text(_layout(card_to_json(card)) + "\n", encoding="utf-8", newline="\n")
        beside.replace(target)
    except OSError as fault:
        beside.unlink(missing_ok=True)
        raise InputError(f"{target}: cannot write: {fault.strerror}; choose another folder") from fault


def card_to_json(card: ModelCard) -> Document:
    """Return the card as a JSON document in the order of docs/card.md."""
    damper, evidence = card.damper, card.evidence
    units = damper.units
    coefficients = {}
    for name, form in damper.coefficients.items():
        data = dependence_to_json(form)
        numbers = {
            number: {
                "value": value,
                "unit": units[f"{name}.{number}"],
                "standard_error": card.standard_errors[f"{name}.{number}"],
            }
            for number, value in zip(form.number_names, form.numbers, strict=True)
        }
        coefficients[name] = {**data, "unit": damper.law[name].unit, "numbers": numbers}
    return {
        "schema_version": SCHEMA_VERSION,
        "title": card.title,
        "law": damper.law.name,
        "python_law": card.python_law,
        "command_unit": damper.command_unit,
        "command_lag_s": damper.command_lag_s,
        "command_lag_standard_error_s": card.standard_errors[LAG],
        "coefficients": coefficients,
        "envelope": {
            "command": card.envelope.command,
            "displacement_m": card.envelope.displacement,
            "velocity_m_s": card.envelope.velocity,
            "temperature_K": card.envelope.temperature,
        },
        "preparation": card.preparation,
        "evidence": {
            "method": evidence.method,
            "seed": evidence.seed,
            "cost": evidence.cost,
            "dataset_fingerprint": evidence.dataset_fingerprint,
            **{split: evidence.errors(split) for split in _SPLITS},
            "runs": [{"name": run["name"], "split": run["split"], **run} for run in evidence.runs],
            "session_offsets_N": evidence.session_offsets_N,
            "versions": evidence.versions,
        },
        "excerpt": None if card.excerpt is None else _as_dict(card.excerpt),
        "sources": list(card.sources),
        "notes": card.notes,
    }


def _layout(value: Json, indent: int = 0) -> str:
    """Return JSON text: short tables and rows of numbers on one line, the rest one entry per line."""
    line = json.dumps(value, default=dict, ensure_ascii=False, allow_nan=False)
    nested = isinstance(value, Mapping) or any(isinstance(part, Mapping) for part in _parts(value))
    if not _parts(value) or not nested or (indent > 2 and len(line) + indent <= 110):
        return line
    inner = " " * (indent + 2)
    if isinstance(value, Mapping):
        rows = [f"{json.dumps(key, ensure_ascii=False)}: {_layout(value[key], indent + 2)}" for key in value]
        return "{\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * indent}}}"
    rows = [_layout(part, indent + 2) for part in value]
    return "[\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * indent}]"


# ------------------------------------------------------------------------------------------------ reading


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
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as fault:
        raise InputError(f"{path}: cannot read the card: {fault.strerror}") from fault
    except UnicodeDecodeError as fault:
        raise InputError(f"{path}: not UTF-8 text at byte {fault.start}; a card is a JSON file") from fault
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
    return top["coefficients"].build(lambda: Damper(law, forms, "V" if unit == "V" else "A", lag))


def _read_coefficient(place: _Place, unit: str, command_unit: str) -> ParameterLaw | None:
    """Return the parameter law of one coefficient, its units checked against what the law says."""
    entry = place.table(("kind", "numbers", "unit"), optional=("settings",))
    entry["unit"].text(unit)
    numbers = {name: each.table(_NUMBER_KEYS) for name, each in entry["numbers"].entries().items()}
    values = {name: each["value"].number() for name, each in numbers.items()}
    settings = {name: each.number() for name, each in entry["settings"].entries().items()}
    data = {"kind": entry["kind"].text(), "numbers": values, "settings": settings}
    form = place.build(lambda: dependence_from_json(data))
    if form is not None and command_unit:
        for name, expected in zip(form.number_names, form.units(unit, command_unit), strict=True):
            numbers[name]["unit"].text(expected)
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
    runs = [run.table(_RUN_KEYS, others=True) for run in table["runs"].items()]
    for run in runs:
        run["name"].text()
        run["split"].text(*_SPLITS)
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
        for split in _SPLITS:
            if table[split].value != made.errors(split):
                table[split].say(f"is {table[split].value}; the runs listed give {made.errors(split)}")
    return made


def _read_excerpt(place: _Place) -> Excerpt | None:
    if place.value is None:
        return None
    table = place.table(tuple(each.name for each in fields(Excerpt)))
    signals = {name: tuple(each.number() for each in table[name].items()) for name in _SIGNALS}
    return place.build(
        lambda: Excerpt(
            run=table["run"].text(),
            step_s=table["step_s"].number(low=0.0),
            rmse_N=table["rmse_N"].number(low=0.0),
            scored_from=table["scored_from"].whole(),
            dead_band_m=table["dead_band_m"].number(low=0.0),
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
        if _is_finite(self.value) and self.value >= low:
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


def _is_finite(value: object) -> bool:
    """Say whether the value is a JSON number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _freeze(value: Json, place: str, *, ordered: bool = False) -> Json:
    """Return a read-only copy, tables in alphabetical order; refuse what JSON cannot hold."""
    if isinstance(value, Mapping):
        keys = list(value) if ordered else sorted(value, key=str)
        if not all(isinstance(key, str) for key in keys):
            raise InputError(f"{place}: keys are {keys}; expected text")
        return MappingProxyType({key: _freeze(value[key], f"{place}.{key}") for key in keys})
    if isinstance(value, list | tuple):
        return tuple(_freeze(each, f"{place}[{k}]") for k, each in enumerate(value))
    if isinstance(value, np.generic | np.ndarray):
        return _freeze(value.tolist(), place)
    if value is None or isinstance(value, str | bool) or _is_finite(value):
        return value
    raise InputError(f"{place} is {value!r}; expected what JSON holds: text, finite numbers, lists, tables")


def _parts(value: Json) -> list[Json]:
    """Return what a table or list holds; nothing for a scalar."""
    if isinstance(value, Mapping):
        return list(value.values())
    return list(value) if isinstance(value, list | tuple) else []


def _plain(table: Mapping[str, _Place]) -> Document:
    return {key: place.value for key, place in table.items() if place.value is not _MISSING}


def _as_dict(excerpt: Excerpt) -> Document:
    return {each.name: getattr(excerpt, each.name) for each in fields(Excerpt)}


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a JSON number")


def _unique(pairs: list[tuple[str, Any]]) -> Document:
    names = [name for name, _ in pairs]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"the key {twice[0]!r} stands twice in one table")
    return dict(pairs)
