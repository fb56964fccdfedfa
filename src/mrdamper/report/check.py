"""Result of ``check`` as JSON, terminal output, page and CSV file of the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from mrdamper.data.finding import Finding, Severity, by_kind
from mrdamper.data.readers import UnreadableFile
from mrdamper.errors import CheckError, InputError
from mrdamper.jobs.check import CheckedFile, CheckedRun, CheckResult
from mrdamper.report.base import DONE, FirstScreen, Outcome, Page, Report, Tile, WrittenFile
from mrdamper.report.page import sentence
from mrdamper.report.sections import Column, Section, Table, print_compact
from mrdamper.runtime.outputs import write_table
from mrdamper.schema import Json

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def _first(result: CheckResult) -> FirstScreen:
    runs = result.runs
    number = _run_count(len(runs))
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
            Tile(_range(forces, "N"), "force range of the runs, peak to peak"),
            Tile(_range(strokes, "mm"), "stroke of the runs, peak to peak"),
        ),
        caption="Measured force versus displacement, evenly spaced samples of each run. Runs with a fault "
        "are red.",
        flags=[("A file could not be read", file.error) for file in result.unreadable[:3]],
    )


def _run_count(count: int) -> str:
    return f"{count} run{'' if count == 1 else 's'}"


def _range(values: Sequence[float], unit: str) -> str:
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{high:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"


def _figure(result: CheckResult) -> Figure | None:
    from mrdamper.report.figures.check import runs_figure  # imports Matplotlib

    return runs_figure(result)


# ------------------------------------------------------------------------------------------- the tables


def _sections(result: CheckResult) -> list[Section]:
    found: list[Section] = []
    if result.unreadable:
        error: Column[UnreadableFile] = Column("error", "error")
        found.append(Table(title="Files that could not be read", columns=[error], rows=result.unreadable))
    if result.findings:
        found.append(findings_table(result.findings, of_runs=True))
    columns: list[Column[CheckedFile]] = [
        Column("file", lambda file: str(file.path)),
        Column("format", lambda file: file.layout.in_words()),
        Column("columns", lambda file: "; ".join(f"{c.role}: {c.name} in {c.unit}" for c in file.columns)),
    ]
    files = Table(title="Formats of the files", columns=columns, rows=result.files)
    return [*found, _runs_table(result.runs), files]


def findings_table(findings: Sequence[Finding], *, of_runs: bool = False) -> Table[Finding]:
    """Return the table of findings with effects and remedies.

    Parameters
    ----------
    of_runs : True if the findings belong to several runs, which the table then names
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
    """Return the channel and the time interval of a finding."""
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


# ------------------------------------------------------------------------------------------- the answer


def _answer(result: CheckResult) -> Json:
    return {
        "usable": result.usable,
        "counts": result.counts,
        "files": [
            {
                "path": str(file.path),
                "understood": file.layout.in_words(),
                "layout": file.layout.to_dict(),
                "columns": [
                    {"role": each.role, "name": each.name, "unit": each.unit, "source": each.source}
                    for each in file.columns
                ],
                "runs": list(file.runs),
                "inferred": [asdict(each) for each in file.inferred],
            }
            for file in result.files
        ],
        "runs": [_run(run) for run in result.runs],
        "findings": [dict(finding.to_dict()) for finding in result.findings],
        "questions": [dict(question.to_dict()) for question in result.questions],
        "unreadable": [{"path": str(each.path), "error": each.error} for each in result.unreadable],
    }


def _run(run: CheckedRun) -> Json:
    return {
        "name": run.name,
        "source": run.source,
        "samples": run.samples,
        "rate_Hz": run.rate_Hz,
        "duration_s": run.duration_s,
        "stroke_mm": run.stroke_mm,
        "force_range_N": run.force_range_N,
        "worst": run.max_severity,
        "findings": [finding.kind for finding in run.findings],
    }


def _rows(result: CheckResult) -> list[dict[str, object]]:
    """Return the findings as a table."""
    rows = [finding.to_dict() for finding in result.findings]
    return [{name: row[name] for name in _COLUMNS} for row in rows]


# --------------------------------------------------------------------------------------------- the terminal


def _show(result: CheckResult, console: Console) -> None:
    """Print the verdict, the findings, the runs with findings, open questions, and the file formats."""
    # The terminal shows the most important lines. The report has all of them.
    run_count_max = 8
    format_count_max = 2
    verdict, counts = _verdict(result)
    runs = [run for run in result.runs if run.findings]
    if result.runs:
        console.print(f"[bold]{verdict}[/bold]: {counts} in {_run_count(len(result.runs))}.")
    else:
        console.print("[bold]No run could be read.[/bold]")
    show_findings(result.findings, console)
    if len(runs) > 1:
        columns: list[Column[CheckedRun]] = [
            Column("run with findings", "name"),
            Column("findings", lambda run: ", ".join(finding.kind for finding in run.findings)),
        ]
        table = Table(title="", columns=columns, rows=runs[:run_count_max])
        print_compact(table.printed(whole=True), console)
        _print_rest(len(runs) - run_count_max, "runs with findings", console)
    _show_questions(result, console)
    layouts = _by_layout(result.files)
    for words, paths in list(layouts.items())[:format_count_max]:
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        console.print(f"{escape(paths[0])}{more}: {escape(words)}")
    _print_rest(len(layouts) - format_count_max, "formats", console)


def _show_questions(result: CheckResult, console: Console) -> None:
    """Print values that were read from words, and questions that the files leave open."""
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
    """Print the largest finding of each kind, the worst first."""
    finding_count_max = 4
    kinds = by_kind(findings)
    for finding, run_count in kinds[:finding_count_max]:
        colour, others = _COLOUR[finding.severity], max(run_count - 1, 0)
        more = f" (and in {others} more run{'s' if others > 1 else ''})" if others else ""
        text = f"{finding.run or 'all runs'}: {finding.found}{more}. {finding.effect}. {finding.remedy}"
        console.print(f"[{colour}]{finding.severity.capitalize()}[/{colour}]: {escape(sentence(text))}")
    _print_rest(len(kinds) - finding_count_max, "kinds of findings", console)


def _print_rest(count: int, name: str, console: Console) -> None:
    """Print the number of omitted lines, if any."""
    if count > 0:
        console.print(f"The report has {count} more {name}.")


def _verdict(result: CheckResult) -> tuple[str, str]:
    """Return whether the runs can be fitted, and the number of findings."""
    counts = ", ".join(
        f"{number} {severity}{'s' if number != 1 else ''}" for severity, number in result.counts.items()
    )
    return "The runs can be fitted" if result.usable else "The runs have faults and cannot be fitted", counts


def _by_layout(files: Sequence[CheckedFile]) -> dict[str, list[str]]:
    """Return the paths of the files by format and columns."""
    paths: dict[str, list[str]] = {}
    for file in files:
        columns = ", ".join(f"{column.role} {column.name!r} in {column.unit}" for column in file.columns)
        paths.setdefault(f"{file.layout.in_words()}; {columns}", []).append(str(file.path))
    return paths


def _outcome(result: CheckResult) -> Outcome:
    if result.unreadable:
        messages = tuple(file.error for file in result.unreadable)
        return Outcome(exit_code=InputError.exit_code, messages=messages)
    return DONE if result.usable else Outcome(exit_code=CheckError.exit_code)


_PAGE = Page(name="check.html", first=_first, picture=_figure, label="Measured loops", sections=_sections)

REPORT: Report[CheckResult] = Report(
    answer=_answer,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="check.json"),
        WrittenFile(
            name="findings.csv",
            write=lambda result, path: write_table(path, _rows(result) or [dict.fromkeys(_COLUMNS)]),
        ),
        WrittenFile(
            name="channels.toml",
            key="channel_map",
            write=lambda result, path: path.write_text(result.channel_map.text, encoding="utf-8"),
            when=lambda _: False,  # Only --write-map writes it.
            output="write_map",
        ),
    ),
    rows=_rows,
    outcome=_outcome,
)
