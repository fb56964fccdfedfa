"""Output of the command ``sweep``, which repeats a computation for many tasks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.jobs.sweep.store import RESULTS_FILE
from mrdamper.jobs.sweep.sweep import FigureSummary, SweepResult, SweptTask
from mrdamper.report.base import DONE, Outcome, Report, WrittenFile, csv_file, interrupted, wrote_sentence
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import INK, TRAINING
from mrdamper.report.page import FirstScreen, Page, Tile, count_of
from mrdamper.report.sections import Column, Section, Table
from mrdamper.runtime.outputs import write_json
from mrdamper.schema import Json, json_value

_TITLES = {
    "campaigns": "Fits of many campaigns",
    "samples": "Tracking on random dampers",
    "dampers": "Heat sinks for several dampers",
}


def _table(run: SweepResult) -> dict[str, object]:
    """Return the values of ``sweep.json``, which exclude run times and run order."""
    return {
        "kind": run.plan.kind,
        "seed": run.plan.seed,
        "tasks": len(run.plan.tasks),
        "failed": [{"name": task.name, "error": task.error} for task in run.failed],
        "summary": run.statistics,
        "rows": [{"name": task.name, **task.figures} for task in run.tasks_with_values],
    }


def _fields(run: SweepResult) -> dict[str, object]:
    if run.cancelled:
        return {
            "kind": run.plan.kind,
            "cancelled": True,
            "done": len(run.tasks),
            "tasks": len(run.plan.tasks),
        }
    return {**_table(run), "cancelled": False, "resumed": run.resumed}


def _in_folder(run: SweepResult, out: Path) -> Json:
    if run.cancelled:
        note = f"{len(run.tasks)} of {len(run.plan.tasks)} results are in {out}. Use --resume to continue."
        return {"notes": [note]}
    return {"files": [str(out / name) for name in ("sweep.html", "sweep.json", "sweep.csv", RESULTS_FILE)]}


def _rows(run: SweepResult) -> list[Json]:
    names = run.names
    return [
        {"name": task.name, **{name: task.figures.get(name) for name in names}, "error": task.error or None}
        for task in run.tasks
    ]


def _show(run: SweepResult, console: Console) -> None:
    if run.cancelled:
        return
    title = f"{count_of('task', len(run.tasks))}, of which {run.resumed} are from an earlier run"
    console.print(_figures_table(run, title).printed())
    for task in run.failed:
        console.print(escape(f"Failed: {task.name}: {task.error}"))


def _figures_table(run: SweepResult, title: str) -> Table[tuple[str, FigureSummary]]:
    """Return a table of minimum, percentiles and maximum of each result of the tasks."""

    def figure(title: str, name: str) -> Column[tuple[str, FigureSummary]]:
        return Column(title, lambda row: getattr(row[1], name), form=".4g")

    shown = (("min", "least"), ("5 %", "p5"), ("median", "median"), ("95 %", "p95"), ("max", "most"))
    name: Column[tuple[str, FigureSummary]] = Column("value", lambda row: row[0].replace("_", " "))
    count: Column[tuple[str, FigureSummary]] = Column(
        "tasks", lambda row: row[1].count, "", "d", printed=False
    )
    columns = [name, count, *(figure(*each) for each in shown)]
    return Table(title=title, columns=columns, rows=list(run.statistics.items()))


def _sections(run: SweepResult) -> list[Section]:
    def figure(name: str) -> Column[SweptTask]:
        return Column(name.replace("_", " "), lambda task: task.figures.get(name), form=".4g")

    task: Column[SweptTask] = Column("task", "name")
    failed: list[Section] = []
    if run.failed:
        error: Column[SweptTask] = Column("error", "error")
        failed = [Table(title="Failed tasks", columns=[task, error], rows=run.failed)]
    columns, folded = [task, *map(figure, run.names)], f"{len(run.tasks_with_values)} tasks"
    tasks = Table(title="Tasks", columns=columns, rows=run.tasks_with_values, folded=folded)
    return [_figures_table(run, "Statistics of all tasks"), *failed, tasks]


def _closing(run: SweepResult, answer: Json) -> list[str]:
    return list(answer["notes"]) if run.cancelled else wrote_sentence(run, answer)


def _outcome(run: SweepResult) -> Outcome:
    remaining = "The results so far are stored. Repeat the command with --resume to continue."
    return interrupted(remaining) if run.cancelled else DONE


def _write_cards(run: SweepResult, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for task in run.tasks_with_values:
        if task.card is not None:
            write_json(folder / f"{task.name}.json", task.card)


def _figure(run: SweepResult) -> Figure | None:
    """Return a figure of the distribution of each result; None if all are constant."""
    panel_count_max = 12  # More panels do not fit on the page.
    names = [name for name, found in run.statistics.items() if found.least < found.most][:panel_count_max]
    if not names:
        return None
    drawn = []
    for name in names:
        values = np.sort([v for task in run.tasks_with_values if (v := task.figures.get(name)) is not None])
        percent = 100.0 * (np.arange(len(values)) + 0.5) / len(values)
        median = Line(2 * [float(np.median(values))], (0.0, 100.0), INK, width=0.6, style="--")
        drawn.append(Panel(name, "", [Line(values, percent, TRAINING, width=0.9, style=".-"), median]))
    return panel_figure(drawn)


def _first(run: SweepResult) -> FirstScreen:
    plan, done, tasks = run.plan, len(run.tasks_with_values), len(run.plan.tasks)
    leading = list(run.statistics.items())[:3]
    tiles = [
        Tile(
            f"{found.median:.4g}",
            name.replace("_", " "),
            f"90 % of the tasks: {found.p5:.4g} to {found.p95:.4g}",
        )
        for name, found in leading
    ]
    tiles += [Tile("–", "no further value")] * (3 - len(tiles))
    medians = ", ".join(f"{name.replace('_', ' ')} {found.median:.4g}" for name, found in leading[:1])
    return FirstScreen(
        title=_TITLES[plan.kind],
        subject=f"{tasks} tasks, seed {plan.seed}.",
        verdict=f"{done} of {tasks} tasks have a result" + (f"; median of {medians}" if medians else ""),
        tiles=(tiles[0], tiles[1], tiles[2]),
        caption="Percentage of the tasks below each value. The dashed line is the median.",
        notes=[f"Task {task.name} failed: {task.error}" for task in run.failed[:5]],
    )


_PAGE = Page(
    name="sweep.html",
    first=_first,
    picture=_figure,
    label="Distributions over the tasks",
    sections=_sections,
    when=lambda run: not run.cancelled,
)

REPORT = Report(
    fields=_fields,
    show=_show,
    closing=_closing,
    page=_PAGE,
    files=(
        WrittenFile(
            name="sweep.json",
            write=lambda run, path: write_json(path, json_value(_table(run))),
            when=lambda run: not run.cancelled,
        ),
        replace(csv_file("sweep.csv", _rows), when=lambda run: not run.cancelled),
        WrittenFile(
            name="cards",
            write=_write_cards,
            when=lambda run: (
                not run.cancelled and any(task.card is not None for task in run.tasks_with_values)
            ),
        ),
    ),
    in_folder=_in_folder,
    rows=_rows,
    outcome=_outcome,
)
