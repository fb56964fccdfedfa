"""The job ``export``: convert a card to verified C code, an FMU, a force map and a MATLAB folder."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from mrdamper.codegen.record import Verification
from mrdamper.codegen.table import ForceMap, force_map
from mrdamper.codegen.target import Target, target_of
from mrdamper.codegen.verify import verify_c
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import CheckError, InputError
from mrdamper.jobs.options import ExportOptions
from mrdamper.models.card import ModelCard
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.compact import compact_model
from mrdamper.thermal.drawing import DamperDrawing

_USUAL = ExportOptions()


@dataclass(frozen=True, slots=True)
class CodeExport:
    """The content and settings of the generated code, and the record of its verification."""

    target: Target
    record: Verification


@dataclass(frozen=True, slots=True, repr=False)
class ExportResult(JobResult):
    """The result of an export: verified code for C and FMU, and a force map."""

    _job = "export"
    card: ModelCard
    name: str  # prefix of all names in the code
    what: tuple[str, ...]  # requested outputs: c, fmu, table, matlab
    code: CodeExport | None  # None if neither c nor fmu is requested
    table: ForceMap | None  # None if neither table nor matlab is requested
    notes: tuple[str, ...]
    cpu_s: float


def export(
    card: ModelCard,
    options: ExportOptions = _USUAL,
    *,
    damper: DamperDrawing | None = None,
    on_progress: Progress = silent,
) -> ExportResult:
    """Export a card as code or force map, and verify the code against the model in Python.

    Parameters
    ----------
    damper : geometry of the damper, for a thermal model in the code and for the detection of a temperature
        sensor that no longer changes. None: no thermal model; the detection uses the heat capacity of the
        damper in the paper that the program reproduces (``mrdamper.paper``)

    Raises
    ------
    InputError
        If the card or an option is not usable, or there is no C compiler.
    CheckError
        If the compiled code differs from the model in Python.
    """
    clock = time.process_time()
    code, table = None, None
    if {"c", "fmu"} & {*options.what}:
        on_progress(ProgressUpdate(total=2, text="code"))
        code = _code(card, options, damper)
    if {"table", "matlab"} & {*options.what}:
        on_progress(ProgressUpdate(done=1, total=2, text="force map"))
        try:
            table = force_map(card)
        except InputError as fault:
            raise fault.prepend_place("card") from fault
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
    """Generate the code of a card, compile it, and compare its outputs with the model in Python."""
    try:
        target = target_of(
            card,
            content=options.content,
            precision=options.precision,
            period_s=options.period_s,
            controller=options.controller,
            name=options.name,
            heating=None if damper is None else Heating.from_drawing(damper),
        )
    except InputError as fault:
        raise fault.prepend_place("card") from fault
    if damper is not None:
        target = replace(target, thermal=compact_model(damper))
    record = verify_c(target)
    if not record.passed:
        raise CheckError(
            f"the compiled code is not the model in Python: {'; '.join(record.problems)}\n"
            "Nothing was written",
            place="card",
            remedy=f"Compiler: {record.compiler_version}, {' '.join(record.compiler_flags)}",
        )
    return CodeExport(target, record)


def _notes(target: Target) -> tuple[str, ...]:
    notes = []
    if target.heating is Heating.paper():
        notes.append(
            "a frozen thermometer is told by the heat capacity of the paper's "
            f"damper; {'--damper FILE.toml'} takes that of your own"
        )
    damper = target.card.damper
    if damper.actuation is None and damper.command_lag_s == 0.0:
        notes.append(
            "the card has no actuation: force is taken to follow the command at "
            "once. Fit with runs whose current steps for its lags"
        )
    if not damper.temperature_dependent:
        notes.append("the card does not know temperature: force and command do not follow it")
    return tuple(notes)
