"""What ``check`` found: the answer's keys, the tables of a terminal, the page, findings as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from mrdamper.data.finding import Finding, Severity, by_kind
from mrdamper.data.readers import UnreadableFile
from mrdamper.errors import CheckError, InputError, spelled
from mrdamper.jobs.check import CheckedFile, CheckedRun, CheckResult
from mrdamper.report.base import DONE, FirstScreen, Outcome, Page, Report, Tile, WrittenFile
from mrdamper.report.sections import Column, Section, Table
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
    number = f"{len(runs)} run{'' if len(runs) == 1 else 's'}"
    verdict, found = _verdict(result)
    worst = next((finding for finding, _ in by_kind(result.findings)), None)
    forces = [run.force_range_N for run in runs if run.force_range_N is not None]
    strokes = [run.stroke_mm for run in runs if run.stroke_mm is not None]
    clean = sum(not run.findings for run in runs)
    return FirstScreen(
        title=f"Check of {number}",
        subject=f"{len(result.files)} files were read, {len(result.unreadable)} were not.",
        verdict=f"{number}: {verdict}; {found}"
        + ("" if worst is None else f"; the gravest is in {worst.run or 'all runs'}: {worst.found}"),
        tiles=(
            Tile(number, "that were read", f"{clean} of them without a finding"),
            Tile(_span(forces, "N"), "range of force of a run, peak to peak"),
            Tile(_span(strokes, "mm"), "stroke of a run, peak to peak"),
        ),
        caption="Measured force over displacement, samples all over each run; red: a run with a fault",
        flags=[("A file was not read", each.error) for each in result.unreadable[:3]],
    )


def _span(values: Sequence[float], unit: str) -> str:
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{high:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"


def _figure(result: CheckResult) -> Figure | None:
    from mrdamper.report.figures.check import runs_figure  # loads Matplotlib

    return runs_figure(result)


# ------------------------------------------------------------------------------------------- the tables


def _sections(result: CheckResult) -> list[Section]:
    found: list[Section] = []
    if result.unreadable:
        error: Column[UnreadableFile] = Column("what is wrong", "error")
        found.append(Table(title="Files that could not be read", columns=[error], rows=result.unreadable))
    if result.findings:
        found.append(findings_table(result.findings, of_runs=True))
    understood: list[Column[CheckedFile]] = [
        Column("file", lambda file: str(file.path)),
        Column("as", lambda file: file.layout.in_words()),
        Column("columns", lambda file: "; ".join(f"{c.role}: {c.name} in {c.unit}" for c in file.columns)),
    ]
    files = Table(title="How the files were understood", columns=understood, rows=result.files)
    return [*found, _runs_table(result.runs), files]


def findings_table(findings: Sequence[Finding], *, of_runs: bool = False) -> Table[Finding]:
    """Return the table of what is wrong, where, and what to do; ``of_runs``: they are of several runs."""
    run: list[Column[Finding]] = [Column("run", "run", names_run=True)] if of_runs else []
    return Table(
        title="Findings",
        columns=[
            Column("", "severity"),
            *run,
            Column("where", _where),
            Column("found", "found"),
            Column("what it does to a fit" if of_runs else "what it does", "effect"),
            Column("what to do", "remedy"),
        ],
        rows=findings,
    )


def _where(finding: Finding) -> str:
    """Return the channel, and from when to when."""
    if finding.from_s is None:
        return finding.channel
    end = "" if finding.to_s in {None, finding.from_s} else f" to {finding.to_s:.6g}"
    return f"{finding.channel} at {finding.from_s:.6g}{end} s".strip()


def _runs_table(runs: Sequence[CheckedRun]) -> Table[CheckedRun]:
    columns: list[Column[CheckedRun]] = [
        Column("run", "name", names_run=True),
        Column("samples", "samples", form="d"),
        Column("rate", "rate_Hz", "Hz", ".4g"),
        Column("lasts", "duration_s", "s", ".4g"),
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
        "worst": run.worst,
        "findings": [finding.kind for finding in run.findings],
    }


def _rows(result: CheckResult) -> list[dict[str, object]]:
    """Return the findings as a table."""
    told = [finding.to_dict() for finding in result.findings]
    return [{name: each[name] for name in _COLUMNS} for each in told]


# --------------------------------------------------------------------------------------------- the terminal


def _show(result: CheckResult, console: Console) -> None:
    """Print how files were understood, the runs, and the findings."""
    for words, paths in _by_layout(result.files).items():
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        console.print(f"{escape(paths[0])}{more}: {escape(words)}")
    for inference in (each for file in result.files for each in file.inferred):
        console.print(escape(inference.in_words()))
    for question in result.questions:
        choice = f" ({escape(', '.join(question.candidates[:6]))})" if question.candidates else ""
        console.print(
            f"[cyan]asked[/cyan] {escape(question.file)}: {escape(spelled(question.text))}{choice}."
        )
        console.print(f"  answer with --answer {question.key}=VALUE", markup=False)
    if not result.runs:
        console.print("[bold]no run could be read[/bold]")
        return
    console.print(_runs_table(result.runs).printed())
    show_findings(result.findings, console)
    verdict, counts = _verdict(result)
    console.print(f"[bold]{verdict}[/bold]: {counts}")


def show_findings(findings: Sequence[Finding], console: Console) -> None:
    """Print the largest finding of each kind, the worst first."""
    for finding, run_count in by_kind(findings):
        colour, others = _COLOUR[finding.severity], max(run_count - 1, 0)
        more = f" (and in {others} more run{'s' if others > 1 else ''})" if others else ""
        console.print(
            f"[{colour}]{finding.severity}[/{colour}] {escape(finding.run or 'all runs')}: "
            f"{escape(finding.found)}{more}. "
            f"{escape(finding.effect)}. {escape(finding.remedy)}."
        )


def _verdict(result: CheckResult) -> tuple[str, str]:
    """Return whether the runs can be fitted, and the number of findings."""
    counts = ", ".join(
        f"{number} {severity}{'s' if number != 1 else ''}" for severity, number in result.counts.items()
    )
    return "the runs can be fitted" if result.usable else "not to be fitted as they are", counts


def _by_layout(files: Sequence[CheckedFile]) -> dict[str, list[str]]:
    """Return the files by how they were understood, columns and all."""
    found: dict[str, list[str]] = {}
    for file in files:
        columns = ", ".join(f"{each.role} {each.name!r} in {each.unit}" for each in file.columns)
        found.setdefault(f"{file.layout.in_words()}; {columns}", []).append(str(file.path))
    return found


def _outcome(result: CheckResult) -> Outcome:
    if result.unreadable:
        said = tuple(each.error for each in result.unreadable)
        return Outcome(exit_code=InputError.exit_code, said=said)
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
            when=lambda _: False,  # written only where the user names a file
            output="write_map",
        ),
    ),
    rows=_rows,
    outcome=_outcome,
)
