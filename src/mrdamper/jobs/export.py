"""The job behind ``mrdamper export``: a card in; C folder, FMU and force map out, proved before written.

Nothing is written unless everything that was asked for could be made. Nothing is printed here.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mrdamper.control.tables.heating import Heating
from mrdamper.errors import CheckError, InputError
from mrdamper.export.c_code import c_files
from mrdamper.export.record import Verification
from mrdamper.export.table import force_map
from mrdamper.export.target import Target, target_of
from mrdamper.export.verify import not_verified, verify_c
from mrdamper.files import is_folder
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.runtime.outputs import atomic_output, write_json
from mrdamper.schema import Json
from mrdamper.thermal.drawing_file import read_drawing

__all__ = ["RECORD", "ExportOptions", "export"]

RECORD = "verification.json"
"""The record's name in the C folder."""

_PAPER = (
    "a frozen thermometer is told by the heat capacity of the paper's damper; ⟦--damper FILE.toml⟧ takes "
    "that of your own"
)
_UNLAGGED = (
    "the card has no actuation: force is taken to follow the command at once. Identify with runs whose "
    "current steps for its lags"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """What ``mrdamper export`` can be told; at least one of ``c``, ``fmu`` and ``table``."""

    c: Path | None = None  # folder
    fmu: Path | None = None
    table: Path | None = None
    fmi: Literal["2.0", "3.0"] = "3.0"
    precision: str = "float"
    period_s: float = 1e-3
    content: str = "both"
    controller: str = "recommended"
    name: str = "damper"
    damper: Path | None = None  # a drawing
    verify: bool = True


def export(card: Path, options: ExportOptions) -> Json:
    """Write what was asked for from a card, all of it or nothing.

    Raises
    ------
    InputError
        A card, a choice or a place that cannot be used; no C compiler to prove the code with.
    CheckError
        The compiled code is not the model in Python.
    """
    clock = time.process_time()
    outputs = [path for path in (options.c, options.fmu, options.table) if path is not None]
    if not outputs:
        raise InputError("export: nothing to write; expected ⟦--c DIR⟧, ⟦--fmu FILE⟧ or ⟦--table FILE⟧")
    if len({path.absolute() for path in outputs}) < len(outputs):
        raise InputError(f"export: {outputs[-1]} is to be two things at once; expected a place for each")
    if options.fmu is not None and not options.verify:
        raise InputError("export: an FMU is made from verified sources only; leave out ⟦--no-verify⟧")
    for path in (options.fmu, options.table):
        if path is not None and is_folder(path):
            raise InputError(f"{path}: is a folder; expected the name of a file to write")
    files: list[Path] = []
    with ExitStack() as places:
        # The places first: one that cannot be written to is told before anything is made.
        folders = [atomic_output(path if path is options.c else path.parent) for path in outputs]
        stages = dict(zip(outputs, [places.enter_context(folder) for folder in folders], strict=True))
        model = read_card(card)
        answer: Json = {"card": str(card), "title": model.title, "law": model.damper.law.name}
        if options.c is not None or options.fmu is not None:
            target = _target(card, model, options)
            record = verify_c(target) if options.verify else not_verified(target)
            if options.verify and not record.passed:
                raise CheckError(
                    f"{card}: the compiled code is not the model in Python: {'; '.join(record.problems)}\n"
                    f"Nothing was written. Compiler: {record.compiler_version}, "
                    f"{' '.join(record.compiler_flags)}"
                )
            answer |= _answer(target, record)
            if options.c is not None:
                files += _write_folder(stages[options.c], options.c, target, record)
            if options.fmu is not None:
                files += _write_fmu(stages[options.fmu], options.fmu, target, record, options.fmi)
        if options.table is not None:
            name = options.table.name
            try:
                text = force_map(model).as_csv()
            except InputError as fault:
                raise InputError(f"{card}: {fault}") from fault
            (stages[options.table] / name).write_text(text, encoding="utf-8", newline="\n")
            files.append(options.table)
    answer["files"] = [str(path) for path in files]
    answer["cpu_s"] = round(time.process_time() - clock, 3)
    return answer


def _target(card: Path, model: ModelCard, options: ExportOptions) -> Target:
    heating = None if options.damper is None else Heating.of_drawing(read_drawing(options.damper))
    try:
        return target_of(
            model,
            content=options.content,
            precision=options.precision,
            period_s=options.period_s,
            controller=options.controller,
            name=options.name,
            heating=heating,
        )
    except InputError as fault:
        raise InputError(f"{card}: {fault}") from fault


def _write_folder(stage: Path, folder: Path, target: Target, record: Verification) -> list[Path]:
    sources = c_files(target)
    for name, text in sources.items():
        (stage / name).write_bytes(text.encode("utf-8"))
    write_json(stage / RECORD, record.as_json())
    return [folder / name for name in (*sources, RECORD)]


def _write_fmu(
    stage: Path, path: Path, target: Target, record: Verification, version: Literal["2.0", "3.0"]
) -> list[Path]:
    from mrdamper.export.fmu import write_fmu

    write_fmu(target, stage / path.name, version=version, verification=record)
    return [path]


def _answer(target: Target, record: Verification) -> Json:
    notes = []
    if target.heating is Heating.paper():
        notes.append(_PAPER)
    damper = target.card.damper
    if damper.actuation is None and damper.command_lag_s == 0.0:
        notes.append(_UNLAGGED)
    if not damper.temperature_dependent:
        notes.append("the card does not know temperature: force and command do not follow it")
    controller = target.controller
    return {
        "name": target.name,
        "fingerprint": target.fingerprint,
        "content": target.content,
        "controller": None if controller is None else controller.name,
        "precision": target.precision,
        "step_s": target.period_s,
        "largest": target.largest,
        "command_unit": target.command_unit,
        "tables_bytes": record.sizes_bytes.get("tables"),
        "state_bytes": record.sizes_bytes.get("state"),
        "code_bytes": record.sizes_bytes.get("code"),
        "verification": record.as_json(),
        "notes": notes,
    }
