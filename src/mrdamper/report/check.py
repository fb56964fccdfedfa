"""Output of the command ``check``: findings (faults, warnings) in measured data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.data.finding import SEVERITIES, Finding, Severity, by_kind
from mrdamper.data.readers import UnreadableFile
from mrdamper.errors import CheckError, InputError
from mrdamper.jobs.check import CheckedFile, CheckedRun, CheckResult
from mrdamper.report.base import DONE, Outcome, Report, WrittenFile, csv_file, text_file
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import TRAINING
from mrdamper.report.page import FirstScreen, Page, Tile, count_of, range_of, sentence
from mrdamper.report.sections import Column, Section, Table

_COLOUR: dict[Severity, str] = {"fault": "red", "warning": "yellow", "note": "cyan"}
_COLUMNS = (
    "run",
    "severity",
    "kind",
    "channel",
    "size",
    "unit",
    "from_s",
    "to_s",
    "found",
    "effect",
    "remedy",
)
_RUN_FIELDS = ("name", "source", "samples", "rate_Hz", "duration_s", "stroke_mm", "force_range_N")


def _first(result: CheckResult) -> FirstScreen:
    runs = result.runs
    number = count_of("run", len(runs))
    verdict, counts = _verdict(result)
    worst = next((finding for finding, _ in by_kind(result.findings)), None)
    forces = [run.force_range_N for run in runs if run.force_range_N is not None]
    strokes = [run.stroke_mm for run in runs if run.stroke_mm is not None]
    clean = sum(not run.findings for run in runs)
    return FirstScreen(
        title=f"Check of {number}",
        subject=f"{len(result.files)} files were read. {len(result.unreadable)} files could not be read.",
        verdict=f"{verdict}: {counts} in {number}"
        + ("" if worst is None else f". The worst is in {worst.run or 'all runs'}: {worst.found}"),
        tiles=(
            Tile(number, "were read", f"{clean} without findings"),
            Tile(range_of(forces, "N"), "force range of the runs, peak to peak"),
            Tile(range_of(strokes, "mm"), "stroke of the runs, peak to peak"),
        ),
        caption="Measured force versus displacement, evenly spaced samples of each run. Runs with a fault "
        "are red.",
        flags=[("A file could not be read", file.error) for file in result.unreadable[:3]],
    )


def _figure(result: CheckResult) -> Figure | None:
    panel_count_max = 8  # A figure with more panels is hard to read.
    drawable = [run for run in result.runs if np.isfinite(run.samples_drawn).all(axis=1).any()]
    if not drawable:
        return None
    return panel_figure(
        [
            Panel(
                run.name,
                "displacement, mm",
                [Line(run.samples_drawn[:, 0], run.samples_drawn[:, 1], TRAINING, style=",")],
                run.max_severity == "fault",
                "force, N",
            )
            for run in sorted(drawable, key=_severity)[:panel_count_max]
        ]
    )


def _severity(run: CheckedRun) -> int:
    return len(SEVERITIES) if run.max_severity is None else SEVERITIES.index(run.max_severity)


def _sections(result: CheckResult) -> list[Section]:
    found: list[Section] = []
    if result.unreadable:
        error: Column[UnreadableFile] = Column("error", "error")
        found.append(Table(title="Files that could not be read", columns=[error], rows=result.unreadable))
    if result.findings:
        found.append(findings_table(result.findings, of_runs=True))
    files = Table(
        title="Formats of the files",
        columns=[
            Column("files", lambda each: each[1]),
            Column("format and columns", lambda each: each[0]),
        ],
        rows=list(_by_layout(result.files).items()),
    )
    return [*found, _runs_table(result.runs), files]


def findings_table(findings: Sequence[Finding], *, of_runs: bool = False) -> Table[Finding]:
    """Return the table of findings with effects and remedies.

    Parameters
    ----------
    of_runs : True if the findings belong to several runs; then the table has a column with the run
    """
    run: list[Column[Finding]] = [Column("run", "run", names_run=True)] if of_runs else []
    return Table(
        title="Findings",
        columns=[
            Column("", "severity"),
            *run,
            Column("where", _where),
            Column("finding", "found"),
            Column("effect on a fit" if of_runs else "effect", "effect"),
            Column("remedy", "remedy"),
        ],
        rows=findings,
    )


def _where(finding: Finding) -> str:
    if finding.from_s is None:
        return finding.channel
    end = "" if finding.to_s in {None, finding.from_s} else f" to {finding.to_s:.6g}"
    return f"{finding.channel} at {finding.from_s:.6g}{end} s".strip()


def _runs_table(runs: Sequence[CheckedRun]) -> Table[CheckedRun]:
    columns: list[Column[CheckedRun]] = [
        Column("run", "name", names_run=True),
        Column("samples", "samples", form="d"),
        Column("rate", "rate_Hz", "Hz", ".4g"),
        Column("duration", "duration_s", "s", ".4g"),
        Column("stroke", "stroke_mm", "mm", ".4g"),
        Column("force", "force_range_N", "N", ".4g"),
        Column("findings", lambda run: ", ".join(each.kind for each in run.findings) or None),
    ]
    return Table(title="Runs", columns=columns, rows=runs)


def _fields(result: CheckResult) -> dict[str, object]:
    return {
        "usable": result.usable,
        "counts": result.counts,
        "files": [
            {
                "path": file.path,
                "understood": file.layout.in_words(),
                "layout": asdict(file.layout),
                "columns": file.columns,
                "runs": file.runs,
                "inferred": file.inferred,
            }
            for file in result.files
        ],
        "runs": [
            {
                **{name: getattr(run, name) for name in _RUN_FIELDS},
                "worst": run.max_severity,
                "findings": [finding.kind for finding in run.findings],
            }
            for run in result.runs
        ],
        "findings": [finding.to_dict() for finding in result.findings],
        "questions": [question.to_dict() for question in result.questions],
        "unreadable": [{"path": each.path, "error": each.error} for each in result.unreadable],
    }


def _rows(result: CheckResult) -> list[dict[str, object]]:
    rows = [finding.to_dict() for finding in result.findings]
    return [{name: row[name] for name in _COLUMNS} for row in rows]


def _show(result: CheckResult, console: Console) -> None:
    format_count_max = 2
    verdict, counts = _verdict(result)
    if result.runs:
        console.print(f"[bold]{verdict}[/bold]: {counts} in {count_of('run', len(result.runs))}.")
    else:
        console.print("[bold]No run could be read.[/bold]")
    show_findings(result.findings, console)
    _show_questions(result, console)
    layouts = _by_layout(result.files)
    for words, paths in list(layouts.items())[:format_count_max]:
        console.print(f"{escape(paths)}: {escape(words)}")
    _print_rest(len(layouts) - format_count_max, "formats", console)


def _show_questions(result: CheckResult, console: Console) -> None:
    """Print values that were inferred from file names, and questions to the user."""
    question_count_max = 4
    inference_count_max = 3
    inferred = [inference for file in result.files for inference in file.inferred]
    for inference in inferred[:inference_count_max]:
        console.print(escape(inference.in_words()))
    _print_rest(len(inferred) - inference_count_max, "values from the names of files and folders", console)
    for question in result.questions[:question_count_max]:
        choice = f" ({escape(', '.join(question.candidates[:6]))})" if question.candidates else ""
        console.print(f"[cyan]Question[/cyan] {escape(question.file)}: {escape(question.text)}{choice}.")
        console.print(f"  Answer it with --answer {question.key}=VALUE", markup=False)
    _print_rest(len(result.questions) - question_count_max, "questions", console)


def show_findings(findings: Sequence[Finding], console: Console) -> None:
    """Print the worst finding of each kind, and the number of other affected runs."""
    finding_count_max = 4
    kinds = by_kind(findings)
    for finding, run_count in kinds[:finding_count_max]:
        colour, others = _COLOUR[finding.severity], max(run_count - 1, 0)
        more = f" (and in {others} more run{'s' if others > 1 else ''})" if others else ""
        text = f"{finding.run or 'all runs'}: {finding.found}{more}. {finding.effect}. {finding.remedy}"
        console.print(f"[{colour}]{finding.severity.capitalize()}[/{colour}]: {escape(sentence(text))}")
    _print_rest(len(kinds) - finding_count_max, "kinds of findings", console)


def _print_rest(count: int, name: str, console: Console) -> None:
    if count > 0:
        console.print(f"The report has {count} more {name}.")


def _verdict(result: CheckResult) -> tuple[str, str]:
    """Return the verdict, and the number of findings of each severity."""
    counts = ", ".join(count_of(severity, number) for severity, number in result.counts.items())
    return "The runs can be fitted" if result.usable else "The runs have faults and cannot be fitted", counts


def _by_layout(files: Sequence[CheckedFile]) -> dict[str, str]:
    """Group files by format and columns; a value describes the files of a group."""
    paths: dict[str, list[str]] = {}
    for file in files:
        columns = ", ".join(f"{column.role} {column.name!r} in {column.unit}" for column in file.columns)
        paths.setdefault(f"{file.layout.in_words()}; {columns}", []).append(str(file.path))
    return {
        words: first + (f" and {len(others)} more" if others else "")
        for words, (first, *others) in paths.items()
    }


def _outcome(result: CheckResult) -> Outcome:
    if result.unreadable:
        messages = tuple(file.error for file in result.unreadable)
        return Outcome(exit_code=InputError.exit_code, messages=messages)
    return DONE if result.usable else Outcome(exit_code=CheckError.exit_code)


_PAGE = Page(name="check.html", first=_first, picture=_figure, label="Measured loops", sections=_sections)

REPORT: Report[CheckResult] = Report(
    fields=_fields,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="check.json"),
        csv_file("findings.csv", lambda result: _rows(result) or [dict.fromkeys(_COLUMNS)]),
        replace(
            text_file("channels.toml", lambda result: result.channel_map.text, key="channel_map"),
            when=lambda _: False,  # The channel map is written only if the user sets --write-map.
            output="write_map",
        ),
    ),
    rows=_rows,
    outcome=_outcome,
)
