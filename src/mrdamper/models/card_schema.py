"""Read, check and write the file of a model card.

A card contains no code. Each coefficient states the name of its form (``FORMS``) and the name of its
temperature factor (``temperature.FACTORS``). The file contains a hash of its content, so that an edited card
is rejected. There is one schema version. The same card is always written as the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from mrdamper.errors import InputError
from mrdamper.files import read_text
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.dependence import (
    Bipolynomial,
    CommandForm,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    Saturation,
    TemperatureDependent,
)
from mrdamper.models.force_band import ForceBand
from mrdamper.models.laws import LAWS, HysteresisLaw
from mrdamper.models.temperature import FACTORS, factor_parameter_names, make_factor
from mrdamper.schema import Json, NotNegative, Option, read_record, unknown_name, write_record

SCHEMA_VERSION = 4

FORMS: Mapping[str, type[CommandForm | Bipolynomial]] = MappingProxyType(
    {form.kind: form for form in (Constant, Polynomial, Hill, Saturation, Exponential, Bipolynomial)}
)
"""Forms of the dependence of a coefficient on command and temperature, by their name in a card."""

_HASH_KEY = "content_sha256"
_KEYS_OUTSIDE_HASH = {_HASH_KEY, "notes"}
_FormName = Annotated[str, Option(among=lambda: FORMS)]
_FactorName = Annotated[str, Option(among=lambda: FACTORS)]


@dataclass(frozen=True, kw_only=True)
class TemperatureRecord:
    """Temperature factor of a coefficient; ``assumed`` is True if the factor comes from fluid data."""

    kind: _FactorName
    assumed: bool = False


@dataclass(frozen=True, kw_only=True)
class ParameterRecord:
    """One parameter with its unit and standard error."""

    value: float
    unit: str
    standard_error: NotNegative | None


@dataclass(frozen=True, kw_only=True)
class CoefficientRecord:
    """A coefficient: kind of function, parameters by name, unit, and fixed settings."""

    kind: _FormName
    temperature: TemperatureRecord | None = None
    numbers: Mapping[str, ParameterRecord]
    settings: Mapping[str, float] | None = None
    unit: str


@dataclass(frozen=True, kw_only=True)
class SplitRecord:
    """Number and errors of the training runs or of the held-out runs."""

    runs: int
    median_nrmse_percent: float | None
    worst_nrmse_percent: float | None


@dataclass(frozen=True, kw_only=True)
class EvidenceRecord:
    """``card.Evidence`` with the errors of the training runs and of the held-out runs."""

    method: str
    seed: int | None
    cost: float
    converged: bool
    dataset_fingerprint: str
    training: SplitRecord
    held_out: SplitRecord
    runs: tuple[Mapping[str, Any], ...]
    versions: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class CardRecord:
    """The file of a card, key by key (docs/card.md)."""

    schema_version: int
    content_sha256: str
    title: str
    law: str
    python_law: str | None
    command_unit: Literal["A", "V"]
    command_lag_s: NotNegative
    command_lag_standard_error_s: NotNegative | None
    actuation: Actuation | None
    temperature_range_K: tuple[float, float] | None
    coefficients: Mapping[str, CoefficientRecord]
    envelope: OperatingEnvelope
    preparation: Mapping[str, Any]
    evidence: EvidenceRecord
    sources: tuple[str, ...]
    notes: Mapping[str, Any]
    force_band: ForceBand | None


def write_card(card: ModelCard, path: str | Path) -> None:
    """Write a card to a file. If writing fails, no incomplete file remains."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        beside.write_text(card_text(card), encoding="utf-8", newline="\n")
        beside.replace(target)
    except OSError as fault:
        beside.unlink(missing_ok=True)
        raise InputError(
            place=target, found=f"cannot write: {fault.strerror}; choose another folder"
        ) from fault


def card_text(card: ModelCard) -> str:
    """Return the content of a card's file as text."""
    return _layout(card_to_json(card)) + "\n"


def card_to_json(card: ModelCard) -> Json:
    """Return the card as a JSON document in the order of docs/card.md."""
    damper, evidence = card.damper, card.evidence
    record = CardRecord(
        schema_version=SCHEMA_VERSION,
        content_sha256="",
        title=card.title,
        law=damper.law.name,
        python_law=card.python_law,
        command_unit=damper.command_unit,
        command_lag_s=damper.command_lag_s,
        command_lag_standard_error_s=card.standard_errors[LAG],
        actuation=damper.actuation,
        temperature_range_K=damper.temperature_range,
        coefficients={name: _coefficient_of(card, name) for name in damper.coefficients},
        envelope=card.envelope,
        preparation=card.preparation,
        evidence=EvidenceRecord(
            method=evidence.method,
            seed=evidence.seed,
            cost=evidence.cost,
            converged=evidence.converged,
            dataset_fingerprint=evidence.dataset_fingerprint,
            training=_error_record(evidence, "training"),
            held_out=_error_record(evidence, "held_out"),
            runs=tuple({"name": run["name"], "split": run["split"], **run} for run in evidence.runs),
            versions=evidence.versions,
        ),
        sources=card.sources,
        notes=card.notes,
        force_band=card.force_band,
    )
    document = write_record(record, defaults=True, nulls=True)
    for coefficient in document["coefficients"].values():
        for key in ("temperature", "settings"):
            if coefficient[key] is None:
                del coefficient[key]
    return signed(document)


def card_sha256(card: ModelCard) -> str:
    """Return the hash that is stored in the card's file. Notes do not change the hash."""
    return content_sha256(card_to_json(card))


def _coefficient_of(card: ModelCard, name: str) -> CoefficientRecord:
    law, unit = card.damper.coefficients[name], card.damper.law[name].unit
    errors = [card.standard_errors[f"{name}.{parameter}"] for parameter in law.parameter_names]
    return record_of_law(law, unit, card.damper.command_unit, errors)


def record_of_law(
    law: ParameterLaw, unit: str, command_unit: str, errors: Sequence[float | None] | None = None
) -> CoefficientRecord:
    """Return a coefficient as it is stored in the card's file."""
    known = [None] * len(law.parameters) if errors is None else errors
    rows = zip(law.parameter_names, law.parameters, law.units(unit, command_unit), known, strict=True)
    temperature = None
    if isinstance(law, TemperatureDependent):
        temperature = TemperatureRecord(kind=law.factor.kind, assumed=law.assumed)
    return CoefficientRecord(
        kind=law.kind,
        temperature=temperature,
        numbers={n: ParameterRecord(value=v, unit=u, standard_error=e) for n, v, u, e in rows},
        settings=dict(law.settings) or None,
        unit=unit,
    )


def _error_record(evidence: Evidence, split: str) -> SplitRecord:
    return SplitRecord(**evidence.errors(split))  # type: ignore[arg-type]  # by the names of its fields


def _layout(value: Any, indent: int = 0) -> str:  # noqa: ANN401 - any JSON value
    """Return JSON text with one line for each short table and each row of numbers."""
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    parts = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    nested = isinstance(value, dict) or any(isinstance(part, dict) for part in parts)
    if not parts or not nested or (indent > 2 and len(line) + indent <= 110):
        return line
    inner = " " * (indent + 2)
    if isinstance(value, dict):
        rows = [f"{json.dumps(key, ensure_ascii=False)}: {_layout(value[key], indent + 2)}" for key in value]
        return "{\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * indent}}}"
    rows = [_layout(part, indent + 2) for part in value]
    return "[\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * indent}]"


def read_card(path: str | Path, *, python_law: HysteresisLaw | None = None) -> ModelCard:
    """Read and check a card. Nothing in the file is executed.

    Parameters
    ----------
    path : the card
    python_law : the user-defined hysteresis law of the card, from ``load_python_law``; None if the law is in
        the kernel

    Raises
    ------
    InputError
        If the file is not a valid card. The message lists all problems and their locations.
    """
    card_size_max_bytes = 1 << 26  # A card has about 10 kB. A file above this limit is not a card.
    text = read_text(path, "card", card_size_max_bytes)
    try:
        document = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except json.JSONDecodeError as fault:
        raise InputError(
            place=path,
            found=(
                f"line {fault.lineno}, column {fault.colno}: {fault.msg}; not a whole JSON file (cut off "
                "while copying?)"
            ),
        ) from fault
    except (ValueError, RecursionError) as fault:
        raise InputError(place=path, found=f"not a card: {fault}") from fault
    return replace(card_from_json(document, str(path), python_law=python_law), file=str(path))


def card_from_json(
    document: object, place: str = "card", *, python_law: HysteresisLaw | None = None
) -> ModelCard:
    """Return the card in a JSON object that ``card_to_json`` has made.

    Error messages begin with ``place``.

    Raises
    ------
    InputError
        If the schema version is different, the content does not match its hash, or the content is invalid.
    """
    record = read_record(CardRecord, _verified(document, place), place)
    law = _law_of(record, place, python_law)
    errors = {
        f"{name}.{parameter}": each.standard_error
        for name, coefficient in record.coefficients.items()
        for parameter, each in coefficient.numbers.items()
    }
    try:
        laws = {
            name: _checked_law(law, name, each, record.command_unit)
            for name, each in record.coefficients.items()
        }
        return ModelCard(
            title=record.title,
            damper=Damper(
                law,
                laws,
                record.command_unit,
                record.command_lag_s,
                record.actuation,
                record.temperature_range_K,
            ),
            envelope=record.envelope,
            evidence=Evidence(
                **{each.name: getattr(record.evidence, each.name) for each in fields(Evidence)}
            ),
            standard_errors={LAG: record.command_lag_standard_error_s, **errors},
            preparation=record.preparation,
            sources=record.sources,
            notes=record.notes,
            python_law=record.python_law,
            force_band=record.force_band,
        )
    except InputError as fault:
        raise InputError(place=place, found=f"{fault}") from fault


def content_sha256(document: Json) -> str:
    """Return the SHA-256 of a card's JSON object, with the prefix ``sha256:``.

    The notes are excluded. Spaces, line breaks and the order of keys do not change the hash.
    """
    content = {key: value for key, value in document.items() if key not in _KEYS_OUTSIDE_HASH}
    values = json.loads(json.dumps(content), parse_int=float)  # 1 and 1.0 get the same hash.
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def signed(document: Json) -> Json:
    """Return the JSON object of a card with its hash added."""
    return {**document, _HASH_KEY: content_sha256(document)}


def _verified(document: object, place: str) -> Json:
    """Return the JSON object of a card after a check of its schema version and hash.

    Raises
    ------
    InputError
        If the object is not a card, has a different schema version, or was edited.
    """
    if not isinstance(document, dict):
        raise InputError(
            place=place,
            found=f"a card is a table {{...}} with schema_version; found {type(document).__name__}",
        )
    if document.get("schema_version") != SCHEMA_VERSION:
        raise InputError(
            place=place,
            found=f"schema_version is {document.get('schema_version')!r}",
            expected=f"{SCHEMA_VERSION}, the only version of this mrdamper",
            remedy="Identify again, or install the mrdamper that wrote the card",
        )
    stated, found = document.get(_HASH_KEY), content_sha256(document)
    if stated != found:
        raise InputError(
            place=place,
            found=f"the hash of the content is {found[:19]}..., and {_HASH_KEY} is {str(stated)[:19]}...",
            expected="the card as it was written",
            remedy=(
                "The file was edited or damaged. Use the original, or identify again. Only notes may be "
                "edited"
            ),
        )
    return document


def _law_of(record: CardRecord, place: str, python_law: HysteresisLaw | None) -> HysteresisLaw:
    """Return the hysteresis law of a card; a user-defined law must be an argument."""
    if record.python_law is None:
        if record.law not in LAWS:
            raise unknown_name(f"law: there is no law {record.law!r}", record.law, LAWS, place)
        return LAWS[record.law]
    if python_law is None:
        raise InputError(
            place=place,
            found=(
                f"python_law: law {record.law!r} is user-defined, and a card contains no code; pass "
                f"python_law=load_python_law({record.python_law!r}) if you trust that file"
            ),
        )
    if python_law.name != record.law:
        raise InputError(
            place=place,
            found=f"python_law: the card needs the law {record.law!r}; the one passed is {python_law.name!r}",
        )
    return python_law


def _checked_law(
    law: HysteresisLaw, name: str, coefficient: CoefficientRecord, command_unit: str
) -> ParameterLaw:
    """Return a coefficient as a function of command and temperature; check its units."""
    place = f"coefficients.{name}"
    if name not in law.names:
        raise unknown_name(f"{place}: {law.name} has no such coefficient", name, law.names)
    unit = law[name].unit
    if coefficient.unit != unit:
        raise InputError(place=place, found=f"unit is {coefficient.unit!r}", expected=f"{unit!r}")
    try:
        form = parameter_law(coefficient)
    except InputError as fault:
        raise fault.prepend_place(place) from fault
    for parameter, expected in zip(form.parameter_names, form.units(unit, command_unit), strict=True):
        found = coefficient.numbers[parameter].unit
        if found != expected:
            raise InputError(
                place=place, found=f"numbers.{parameter}.unit is {found!r}", expected=f"{expected!r}"
            )
    return form


def parameter_law(coefficient: CoefficientRecord) -> ParameterLaw:
    """Return the coefficient of a card record as a function of command and temperature.

    Raises
    ------
    InputError
        If the kind is unknown, or parameters and settings do not match it.
    """
    kind, settings = coefficient.kind, coefficient.settings or {}
    parameters = {name: each.value for name, each in coefficient.numbers.items()}
    if kind not in FORMS:
        raise unknown_name(f"there is no parameter law of kind {kind!r}", kind, FORMS)
    if coefficient.temperature is None:
        return _form(kind, parameters, settings)
    factor, assumed = coefficient.temperature.kind, coefficient.temperature.assumed
    names = factor_parameter_names(factor, parameters)
    of_factor = make_factor(factor, {n: v for n, v in parameters.items() if n in names})
    form = _form(kind, {n: v for n, v in parameters.items() if n not in names}, settings)
    if isinstance(form, Bipolynomial):
        raise InputError("bipolynomial depends on temperature itself", expected="no temperature factor")
    return TemperatureDependent(form, of_factor, assumed)


def _form(
    kind: str, parameters: Mapping[str, float], settings: Mapping[str, float]
) -> CommandForm | Bipolynomial:
    if kind in (Hill.kind, Saturation.kind):
        shape = Hill if kind == Hill.kind else Saturation
        values = _by_name(kind, "parameter", parameters, shape.parameter_names)
        return shape(*values[:4], *_by_name(kind, "setting", settings, ("reference",)), *values[4:])
    if kind == Bipolynomial.kind:
        (degree,) = _by_name(kind, "setting", settings, ("temperature_degree",))
        if not 0 <= degree <= len(parameters) or degree != int(degree):
            raise InputError(
                place="bipolynomial",
                found=(
                    f"temperature_degree is {degree:g}; it must be a whole number, and every power of the "
                    "command has a parameter for each power of the temperature up to it"
                ),
            )
        rows = max(len(parameters), 1) // (int(degree) + 1)
        names = tuple(f"c{i}{j}" for i in range(max(rows, 1)) for j in range(int(degree) + 1))
        return Bipolynomial(tuple(_by_name(kind, "parameter", parameters, names)), int(degree))
    _by_name(kind, "setting", settings, ())
    if kind == Polynomial.kind:
        powers = tuple(f"c{power}" for power in range(max(len(parameters), 1)))
        return Polynomial(tuple(_by_name(kind, "parameter", parameters, powers)))
    form = Constant if kind == Constant.kind else Exponential
    return form(*_by_name(kind, "parameter", parameters, form.parameter_names))


def _by_name(kind: str, role: str, given: Mapping[str, float], names: Sequence[str]) -> list[float]:
    """Return values in the order of ``names``; reject missing and unknown names."""
    for name in given:
        if name not in names:
            raise unknown_name(f"{kind} has no {role} {name!r}", name, names)
    for name in names:
        if name not in given:
            raise InputError(place=kind, found=f"{role} {name} is missing; it must be a finite number")
    return [float(given[name]) for name in names]


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a JSON number")


def _unique(pairs: list[tuple[str, Any]]) -> Json:
    table = dict(pairs)
    if len(table) < len(pairs):
        often = Counter(name for name, _ in pairs)
        twice = min(name for name in often if often[name] > 1)
        raise ValueError(f"the key {twice!r} is used twice in one table")
    return table
