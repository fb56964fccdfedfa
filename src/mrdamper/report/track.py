"""What ``track`` found: the answer's keys, tables of a terminal, the page, its traces, rows as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.control.score import Score
from mrdamper.jobs.track import Row, Traced, TrackResult
from mrdamper.report.base import Report, WrittenFile, print_notes
from mrdamper.report.figures.track import draw_temperatures, draw_tracking, error_figure
from mrdamper.report.page import environment
from mrdamper.runtime.outputs import write_table, write_text
from mrdamper.schema import Json

__all__ = ["REPORT", "render_track"]

_MOST_SAMPLES = 2000  # of a trace
_COLUMNS = (
    "max N", "RMS N", "max feasible N", "RMS feasible N", "coil W", "chatter A/s", "max / optimum",
)  # fmt: skip


def render_track(run: TrackResult) -> str:
    """Return the page's HTML."""
    worst = run.worst
    return (
        environment()
        .get_template("track.html.j2")
        .render(
            it=run,
            temperatures=_temperatures(run),
            summary=[(target, [row for row in worst if row.target == target]) for target in run.targets],
            rows=[(target, [row for row in run.rows if row.target == target]) for target in run.targets],
            has_optimum=any(row.score.max_over_optimum is not None for row in run.rows),
            pictures=[draw_tracking(each) for each in run.traced],
            over_temperature=draw_temperatures(run),
        )
    )


def _temperatures(run: TrackResult) -> list[float]:
    return sorted({row.temperature_degC for row in run.rows})


# ------------------------------------------------------------------------------------------- the answer


def _answer(run: TrackResult) -> Json:
    return {
        "rows": [_row(row, run.plant) for row in run.rows],
        "worst": [_row(row, run.plant) for row in run.worst],
        "plant": run.plant,
        "seeds": list(run.seeds),
        "rate_Hz": run.rate_Hz,
        "scored": "the worse of the seeds; all samples after the first second, at the plant's steps",
        "notes": list(run.notes),
        "cpu_s": round(run.cpu_s, 3),
    }


def _row(row: Row, plant: str) -> Json:
    return {
        "controller": row.controller,
        "target": row.target,
        "plant": plant,
        "temperature_degC": row.temperature_degC,
        **asdict(row.score),
    }


def _trace(each: Traced) -> Json:
    """Return a target's hottest test, every k-th sample of it."""
    course, reach = each.course, each.reach
    part = slice(None, None, max(1, -(-len(course) // _MOST_SAMPLES)))
    return {
        "target": each.target,
        "temperature_degC": each.temperature_degC,
        "time_s": course.time[part].tolist(),
        "wanted_N": course.target[part].tolist(),
        "low_N": reach.low[part].tolist(),
        "high_N": reach.high[part].tolist(),
        "runs": [
            {
                "controller": one.controller,
                "force_N": one.force[part].tolist(),
                "command_A": one.current[part].tolist(),
            }
            for one in each.runs
        ],
    }


# ------------------------------------------------------------------------------------------- a terminal


def _show(run: TrackResult, console: Console) -> None:
    """Print the worst of all temperatures by target, and what a reader should know."""
    at = ", ".join(f"{each:g}" for each in _temperatures(run))
    for target in run.targets:
        rows = [row for row in run.worst if row.target == target]
        share = 100.0 * rows[0].score.feasible_share
        title = f"{target} on {run.plant}: worst of {at} degC; feasible {share:.0f} % of the time"
        console.print(_table(rows, title))
    print_notes(run.notes, console)
    console.print(
        f"noise seeds {run.seeds[0]} and {run.seeds[1]}, the worse of the two; the first second is not scored"
    )


def _table(rows: Sequence[Row], title: str) -> Table:
    table = Table(title=escape(title))
    table.add_column("controller", no_wrap=True)
    count = len(_COLUMNS) - all(row.score.max_over_optimum is None for row in rows)
    for name in _COLUMNS[:count]:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(escape(row.controller), *_cells(row.score)[:count])
    return table


def _cells(score: Score) -> list[str]:
    forces = (score.max_N, score.rmse_N, score.max_feasible_N, score.rmse_feasible_N, score.coil_power_W)
    ratio = score.max_over_optimum
    return [
        *("-" if value is None else f"{value:.1f}" for value in forces),
        f"{score.chatter_A_per_s:.0f}",
        "-" if ratio is None else f"{ratio:.2f}",
    ]


def _summary(run: TrackResult) -> list[str]:
    """Return the controller with the least RMS error for each target."""
    lines = [f"{run.plant}, {', '.join(f'{each:g}' for each in _temperatures(run))} degC, worst of all:"]
    for target in run.targets:
        rows = [row for row in run.worst if row.target == target and row.controller != "optimum"]
        best = min(rows, key=lambda row: row.score.rmse_feasible_N or row.score.rmse_N)
        score = best.score
        feasible = "-" if score.rmse_feasible_N is None else f"{score.rmse_feasible_N:.1f}"
        lines.append(f"{target}: {best.controller}, RMS error {feasible} N where feasible")
    return lines


def _rows(run: TrackResult) -> list[Json]:
    return [_row(row, run.plant) for row in run.rows]


def _write_page(run: TrackResult, path: Path) -> None:
    write_text(path, render_track(run))


REPORT = Report(
    answer=_answer,
    show=_show,
    summary=_summary,
    files=(
        WrittenFile(name="track.html", key="report", write=_write_page),
        WrittenFile(name="track.json", key="file"),
        WrittenFile(name="track.csv", write=lambda run, path: write_table(path, _rows(run))),
    ),
    for_page=lambda run: {"traces": [_trace(each) for each in run.traced]},
    figure=error_figure,
    rows=_rows,
)
