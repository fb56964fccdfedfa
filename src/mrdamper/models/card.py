"""The model card: what identification hands on, as one JSON file that never carries code.

A card holds the damper (law, dependence of each coefficient, numbers with units and standard errors), its
operating envelope, how its data were prepared, the evidence (errors run by run), and a short excerpt of
one run on which it must reproduce its own stated error. docs/card.md describes the file key by key.

The same card gives the same bytes. Reading and checking a file is the business of ``card_reading``.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.dependence_json import dependence_to_json
from mrdamper.schema import did_you_mean

__all__ = [
    "RUN_KEYS",
    "SCHEMA_VERSION",
    "SIGNALS",
    "SPLITS",
    "Document",
    "Evidence",
    "Excerpt",
    "Json",
    "ModelCard",
    "Simulate",
    "card_text",
    "card_to_json",
    "cut_excerpt",
    "is_finite",
    "verify_excerpt",
    "write_card",
]

SCHEMA_VERSION = 2

Json = Any  # what json.loads returns, or its read-only copy
Document = dict[str, Json]
Simulate = Callable[[Damper, Trajectory], FloatArray]

SIGNALS = ("displacement_m", "velocity_m_s", "acceleration_m_s2", "command", "force_N")
SPLITS = ("training", "held_out")
RUN_KEYS = ("name", "split", "rmse_N", "nrmse_percent")


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
            lacking = [key for key in RUN_KEYS if key not in run]
            if lacking or run["split"] not in SPLITS:
                wrong = f"no {', '.join(lacking)}" if lacking else f"split is {run['split']!r}"
                raise InputError(f"evidence.runs[{k}]: {wrong}; expected {', '.join(RUN_KEYS)}")

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
    temperature_K: float | None = None  # of the whole stretch

    def __post_init__(self) -> None:
        lengths = {name: len(getattr(self, name)) for name in SIGNALS}
        if len(set(lengths.values())) != 1 or not 0 <= self.scored_from < len(self.force_N):
            raise InputError(
                f"excerpt: lengths are {lengths} and scored_from is {self.scored_from}; expected "
                f"equal lengths and one of the samples"
            )

    def trajectory(self) -> Trajectory:
        x, v, a, command = (np.array(getattr(self, name)) for name in SIGNALS[:4])
        kelvin = None if self.temperature_K is None else np.full(len(x), self.temperature_K)
        return Trajectory(self.step_s, x, v, a, command, self.dead_band_m, kelvin)

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
        parameters = (*self.damper.parameters, LAG)
        for name in self.standard_errors:
            if name not in parameters:
                raise InputError(f"standard_errors: no parameter {name!r}; {did_you_mean(name, parameters)}")
        if (self.damper.law.python is None) != (self.python_law is None):
            raise InputError(f"law {self.damper.law.name!r} and python_law {self.python_law!r} disagree")
        self.damper.check(self.envelope)
        complete = {name: self.standard_errors.get(name) for name in parameters}
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

    A temperature that varies over the stretch is replaced by its mean there. ``force`` is the measured one
    [N]. Pass the simulation by which the card will be verified.
    """
    t = trajectory
    columns = (t.displacement, t.velocity, t.acceleration, t.command, force)
    rounded = {
        name: tuple(float(f"{value:.9g}") for value in column[samples])
        for name, column in zip(SIGNALS, columns, strict=True)
    }
    kelvin = None if t.temperature is None else float(f"{float(np.mean(t.temperature[samples])):.9g}")
    unscored = Excerpt(
        run=run,
        step_s=float(t.step),
        rmse_N=0.0,
        scored_from=scored_from,
        dead_band_m=float(t.dead_band),
        temperature_K=kelvin,
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
        beside.write_text(card_text(card), encoding="utf-8", newline="\n")
        beside.replace(target)
    except OSError as fault:
        beside.unlink(missing_ok=True)
        raise InputError(f"{target}: cannot write: {fault.strerror}; choose another folder") from fault


def card_text(card: ModelCard) -> str:
    """Return what ``write_card`` writes."""
    return _layout(card_to_json(card)) + "\n"


def card_to_json(card: ModelCard) -> Document:
    """Return the card as a JSON document in the order of docs/card.md."""
    damper, evidence = card.damper, card.evidence
    units = damper.units
    coefficients = {}
    for name, form in damper.coefficients.items():
        data = dependence_to_json(form)
        parameters = {
            number: {
                "value": value,
                "unit": units[f"{name}.{number}"],
                "standard_error": card.standard_errors[f"{name}.{number}"],
            }
            for number, value in zip(form.parameter_names, form.parameters, strict=True)
        }
        coefficients[name] = {**data, "unit": damper.law[name].unit, "numbers": parameters}
    return {
        "schema_version": SCHEMA_VERSION,
        "title": card.title,
        "law": damper.law.name,
        "python_law": card.python_law,
        "command_unit": damper.command_unit,
        "command_lag_s": damper.command_lag_s,
        "command_lag_standard_error_s": card.standard_errors[LAG],
        "actuation": None if damper.actuation is None else asdict(damper.actuation),
        "temperature_range_K": damper.temperature_range,
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
            **{split: evidence.errors(split) for split in SPLITS},
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


def is_finite(value: object) -> bool:
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
    if value is None or isinstance(value, str | bool) or is_finite(value):
        return value
    raise InputError(f"{place} is {value!r}; expected what JSON holds: text, finite numbers, lists, tables")


def _parts(value: Json) -> list[Json]:
    """Return what a table or list holds; nothing for a scalar."""
    if isinstance(value, Mapping):
        return list(value.values())
    return list(value) if isinstance(value, list | tuple) else []


def _as_dict(excerpt: Excerpt) -> Document:
    return {each.name: getattr(excerpt, each.name) for each in fields(Excerpt)}
