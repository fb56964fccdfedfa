"""The job ``export``: a card in; C code, FMU and force map out, proved against the model before written."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from mrdamper.codegen.record import Verification
from mrdamper.codegen.table import ForceMap, force_map
from mrdamper.codegen.target import Target, target_of
from mrdamper.codegen.verify import not_verified, verify_c
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import CheckError, InputError, UsageError, option
from mrdamper.jobs.options import ExportOptions
from mrdamper.models.card import ModelCard
from mrdamper.notes import Note
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.compact.model import compact_model
from mrdamper.thermal.drawing import DamperDrawing

_USUAL = ExportOptions()


@dataclass(frozen=True, slots=True)
class CodeExport:
    """A card's code for a target, and the record of its proof."""

    target: Target
    record: Verification
    fmi: Literal["2.0", "3.0"]  # version of the FMU


@dataclass(frozen=True, slots=True)
class ExportResult:
    """What is made of a card: code, as C folder and as FMU, and a force map."""

    card: ModelCard
    name: str
    what: tuple[str, ...]  # of c, fmu, table, matlab, report
    code: CodeExport | None
    table: ForceMap | None
    notes: tuple[str, ...]
    cpu_s: float


def check_options(given: Mapping[str, Any], options: ExportOptions) -> None:
    """Refuse an FMU without proof."""
    if "fmu" in options.what and not options.verify:
        raise UsageError(
            f"{option('fmu')} and {option('no-verify')} exclude each other",
            remedy="an FMU is made from proved sources",
        )


def export(
    card: ModelCard,
    options: ExportOptions = _USUAL,
    *,
    damper: DamperDrawing | None = None,
    on_progress: Progress = silent,
) -> ExportResult:
    """Make what is asked for from a card, and prove its code.

    Parameters
    ----------
    damper : the drawing, which gives the thermal model and tells a frozen thermometer; None: no thermal
        model, and the heat capacity of the paper's damper

    Raises
    ------
    InputError
        A card or a choice that cannot be used; no C compiler to prove the code with.
    CheckError
        The compiled code is not the model in Python.
    """
    clock = time.process_time()
    code, table = None, None
    if {"c", "fmu", "report"} & {*options.what}:
        on_progress(ProgressUpdate(total=2, text="code"))
        code = _code(card, options, damper)
    if {"table", "matlab"} & {*options.what}:
        on_progress(ProgressUpdate(done=1, total=2, text="force map"))
        try:
            table = force_map(card)
        except InputError as fault:
            raise fault.within("card") from fault
    return ExportResult(
        card=card,
        name=options.name,
        what=options.what,
        code=code,
        table=table,
        notes=() if code is None else _notes(code.target),
        cpu_s=time.process_time() - clock,
    )


def _code(card: ModelCard, options: ExportOptions, damper: DamperDrawing | None) -> CodeExport:
    """Return the code of a target, compiled and compared with the model unless that is not wanted."""
    try:
        target = target_of(
            card,
            content=options.content,
            precision=options.precision,
            period_s=options.period_s,
            controller=options.controller,
            name=options.name,
            heating=None if damper is None else Heating.of_drawing(damper),
        )
    except InputError as fault:
        raise fault.within("card") from fault
    if damper is not None:
        target = replace(target, thermal=compact_model(damper))
    record = verify_c(target) if options.verify else not_verified(target)
    if options.verify and not record.passed:
        raise CheckError(
            f"the compiled code is not the model in Python: {'; '.join(record.problems)}\n"
            "Nothing was written",
            place="card",
            remedy=f"Compiler: {record.compiler_version}, {' '.join(record.compiler_flags)}",
        )
    return CodeExport(target, record, options.fmi)


def _notes(target: Target) -> tuple[str, ...]:
    notes = []
    if target.heating is Heating.paper():
        form = (
            "a frozen thermometer is told by the heat capacity of the paper's damper; {option} takes that of "
            "your own"
        )
        notes.append(Note("papers_heat_capacity", form, option=option("damper", "FILE.toml")))
    damper = target.card.damper
    if damper.actuation is None and damper.command_lag_s == 0.0:
        form = (
            "the card has no actuation: force is taken to follow the command at once. Identify with runs "
            "whose current steps for its lags"
        )
        notes.append(Note("no_actuation", form))
    if not damper.temperature_dependent:
        form = "the card does not know temperature: force and command do not follow it"
        notes.append(Note("no_temperature", form))
    return tuple(notes)
