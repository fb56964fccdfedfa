"""Output of the command ``export``: C code, FMU, force map, MATLAB files, page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mrdamper.codegen.c_code import c_files
from mrdamper.codegen.fmu import write_fmu
from mrdamper.codegen.matlab import write_matlab
from mrdamper.codegen.record import Verification
from mrdamper.codegen.target import Target
from mrdamper.jobs.export import CodeExport, ExportResult
from mrdamper.report.base import Report, WrittenFile, print_notes
from mrdamper.report.figures.characteristics import card_figure
from mrdamper.report.identification.verdict import expected_tile
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import table_of
from mrdamper.runtime.outputs import write_json
from mrdamper.schema import Json

_CONTENT = {"model": "model", "controller": "controller", "both": "model and controller"}


def _fields(found: ExportResult) -> dict[str, object]:
    return {
        "title": found.card.title,
        "law": found.card.damper.law.name,
        **({} if found.code is None else _code_answer(found.code, found.notes)),
        "cpu_s": round(found.cpu_s, 3),
    }


def _code_answer(code: CodeExport, notes: tuple[str, ...]) -> Json:
    target, record = code.target, code.record
    return {
        "name": target.name,
        "fingerprint": target.fingerprint,
        "content": target.content,
        "controller": None if target.controller is None else target.controller.name,
        "precision": target.precision,
        "step_s": target.period_s,
        "largest": target.largest,
        "command_unit": target.command_unit,
        **{f"{part}_bytes": record.sizes_bytes.get(part) for part in ("tables", "state", "code")},
        "verification": record.as_json(),
        "notes": notes,
    }


def _summary(found: ExportResult) -> list[str]:
    """Return lines that describe the code, its verification and the force map."""
    lines = []
    if found.code is not None:
        target = found.code.target
        controller = "" if target.controller is None else f" ({target.controller.name})"
        lines += [
            f"{target.name}: {_CONTENT[target.content]}{controller} of {found.card.title!r}, law "
            f"{found.card.damper.law.name}, {target.precision}, step {1e3 * target.period_s:g} ms",
            _comparison(found.code.record),
            *_sizes(found.code.record),
            *_thermal(target, found.code.record),
        ]
    if found.table is not None:
        shape = (len(found.table.temperature), len(found.table.command), len(found.table.velocity))
        lines.append("force map: {} temperatures, {} commands, {} velocities".format(*shape))
    return lines


def _comparison(record: Verification) -> str:
    worst = record.max_ulp
    same = "identical bits" if worst == 0 else f"a difference of at most {worst} units in the last place"
    return (
        f"compiled with {record.compiler_version} and compared with the model in Python in {record.samples} "
        f"samples: {same}"
    )


def _sizes(record: Verification) -> list[str]:
    words = (("tables", "tables"), ("state", "state"), ("code here", "code"))
    sizes = [f"{word} {record.sizes_bytes[key]} bytes" for word, key in words if key in record.sizes_bytes]
    return [", ".join(sizes)] if sizes else []


def _thermal(target: Target, record: Verification) -> list[str]:
    if target.thermal is None:
        return []
    worst = max(record.thermal_K.values())
    return [
        f"thermal model: {target.thermal.states} states, maximum difference between compiled code and Python "
        f"{1e3 * worst:.2g} mK"
    ]


def _show(found: ExportResult, console: Console) -> None:
    for line in _summary(found):
        console.print(escape(line))
    print_notes(found.notes, console)


def _closing(_: ExportResult, answer: Json) -> list[str]:
    """Return a line with the paths of the written files, or only their folders."""
    files = [Path(name) for name in answer["files"]]
    if len(files) <= 3:  # A line with more paths is too long.
        return [f"Wrote {', '.join(map(str, files))}."]
    folders = dict.fromkeys(str(file.parent) for file in files)
    return [f"Wrote {len(files)} files to {', '.join(folders)}."]


def _first(found: ExportResult) -> FirstScreen:
    code = found.code
    return FirstScreen(
        title=f"Exported: {found.card.title or 'a card'}",
        subject="" if code is None else _summary(found)[0] + ".",
        verdict="No code was exported" if code is None else _verdict(code.record),
        tiles=(
            _comparison_tile(code),
            _size_tile(code),
            expected_tile(found.card.force_band) or Tile("–", "the card has no expected error"),
        ),
        caption="Force versus peak velocity of the card's damper, one curve for each command",
        notes=() if code is None else [*_thermal(code.target, code.record), *found.notes],
    )


def _verdict(record: Verification) -> str:
    same = "is identical to the model in all bits"
    if record.max_ulp:
        same = "differs from the model only in the last digits"
    return f"The compiled code {same}, in {record.samples:,} samples ({record.compiler_version})"


def _comparison_tile(code: CodeExport | None) -> Tile:
    if code is None:
        return Tile("–", "no exported code")
    record = code.record
    differing = sum(each.samples_differing for each in record.outputs.values())
    off = f"{record.max_ulp} ulp" if record.max_ulp else "0 bits"
    return Tile(off, "maximum difference from Python", f"{differing:,} of {record.samples:,} samples differ")


def _size_tile(code: CodeExport | None) -> Tile:
    sizes = {} if code is None else code.record.sizes_bytes
    if "code" not in sizes:
        return Tile("–", "size of the code is not available")
    rest = ", ".join(f"{part} {1e-3 * sizes[part]:.1f} kB" for part in ("tables", "state") if part in sizes)
    return Tile(f"{1e-3 * sizes['code']:.1f} kB", "code size, compiled on this computer", rest)


def _output_rows(found: ExportResult) -> list[dict[str, object]]:
    """Return the differences between compiled code and Python, one row for each output."""
    outputs = {} if found.code is None else found.code.record.outputs
    return [
        {
            "output": name,
            "largest_difference_ulp": each.ulp,
            "relative": each.relative,
            "samples_differing": each.samples_differing,
        }
        for name, each in outputs.items()
    ]


def _write_folder(found: ExportResult, folder: Path) -> None:
    """Write the C source files, the record of their verification, and the page."""
    assert found.code is not None
    target = found.code.target
    folder.mkdir(exist_ok=True)
    for name, text in c_files(target, found.code.record).items():
        (folder / name).write_bytes(text.encode("utf-8"))
    write_json(folder / "verification.json", found.code.record.as_json())
    assert REPORT.page is not None
    REPORT.page.write(found, folder / REPORT.page.name)


def _write_fmu(found: ExportResult, path: Path) -> None:
    assert found.code is not None
    write_fmu(found.code.target, path, verification=found.code.record)


def _write_table(found: ExportResult, path: Path) -> None:
    assert found.table is not None
    path.write_text(found.table.as_csv(), encoding="utf-8", newline="\n")


def _write_matlab(found: ExportResult, folder: Path) -> None:
    assert found.table is not None
    write_matlab(found.table, folder)


def _output(key: str, ending: str, write: Callable[[ExportResult, Path], None]) -> WrittenFile[ExportResult]:
    return WrittenFile(
        name=lambda found: f"{found.name}{ending}",
        output=key,
        write=write,
        when=lambda found: key in found.what,
    )


REPORT = Report(
    fields=_fields,
    show=_show,
    closing=_closing,
    summary=_summary,
    page=Page(
        name="export.html",
        first=_first,
        picture=lambda found: card_figure(found.card),
        label="Force versus peak velocity",
        sections=lambda found: table_of(_output_rows(found), "Compiled code compared with the model"),
    ),
    files=(
        _output("c", "_c", _write_folder),
        _output("fmu", ".fmu", _write_fmu),
        _output("table", "_map.csv", _write_table),
        _output("matlab", "_matlab", _write_matlab),
    ),
    lists_files=True,
)
