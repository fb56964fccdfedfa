"""Output of the command ``track``, which tests how well controllers track a force.

The figures show force, error and current versus time, like Figures 28 to 31 of the reference paper. The grey
band is the force that is attainable with currents from zero to the maximum. The error and current panels are
grey while the target is not feasible: it is outside the band, or inside but too close to a limit of the band.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.control.score import Score
from mrdamper.jobs.track import Row, Traced, TrackResult
from mrdamper.models.card_draws import INTERVAL_PROBABILITY
from mrdamper.report.base import Report, WrittenFile, csv_file, print_notes
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import INK, SERIES, WIDTH_INCH, add_legend
from mrdamper.report.page import FirstScreen, Page, Tile, sentence
from mrdamper.report.sections import Column, Picture, Section, Table, print_compact
from mrdamper.schema import Json

REACH_COLOUR, OUTSIDE_COLOUR = "#ececec", "#f1efe9"
DRAWN_RATE_HZ = 500.0
DRAWN_TIME_S_MAX = 4.0


def tracking_figure(traced: Traced) -> Figure:
    """Return a figure of one target: target and attainable force, errors and currents of the controllers."""
    course = traced.course
    thin = max(round(1.0 / (DRAWN_RATE_HZ * course.step_s)), 1)
    last = min(course.scored_from + round(DRAWN_TIME_S_MAX / course.step_s), len(course))
    shown = slice(course.scored_from, last, thin)
    time, target = course.time[shown], course.target[shown]
    figure = Figure(figsize=(WIDTH_INCH, 4.3))
    margins = {"left": 0.06, "right": 0.99, "bottom": 0.09, "top": 0.935, "hspace": 0.1}
    force, error, current = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [1.87, 0.93, 0.64], **margins}
    )
    force.fill_between(time, traced.reach.low[shown], traced.reach.high[shown], color=REACH_COLOUR, lw=0.0)
    force.plot(time, target, color=INK, lw=1.0, ls="--")
    error.axhline(0.0, color="#888888", lw=0.6)
    intervals = {each.controller: each for each in traced.posterior}
    entries = [("attainable", "#d4d4d4", "-"), ("target", INK, "--")]
    for run, colour in zip(traced.runs, SERIES, strict=False):
        if run.controller in intervals:
            ends = intervals[run.controller]
            low, high = ends.low_N[shown] - target, ends.high_N[shown] - target
            error.fill_between(time, low, high, color=colour, alpha=0.25, lw=0.0)
        for axes, values in ((force, run.force), (error, run.error), (current, run.current)):
            axes.plot(time, values[shown], color=colour, lw=0.9)
        entries.append((run.controller, colour, "-"))
    outside = ~traced.reach.feasible(course.target)[shown]
    for axes in (error, current):
        bottom, top = axes.get_ylim()
        axes.fill_between(time, bottom, top, where=outside, color=OUTSIDE_COLOUR, lw=0.0, zorder=0.5)
        axes.set_ylim(bottom, top)
    for axes in (force, error, current):
        axes.grid(visible=False)
        axes.locator_params(nbins=5, axis="y")
    reach = 1.6 * float(np.abs(course.target).max())
    force.set(ylabel="force, N", ylim=(-reach, reach), xlim=(time[0], time[-1]))
    force.set_title(f"{traced.target} at {traced.temperature_degC:g} °C")
    error.set_ylabel("error, N")
    current.set(ylabel="current, A", xlabel="time, s")
    figure.align_ylabels()
    add_legend(figure, entries, at_top=True)
    return figure


def error_figure(run: TrackResult) -> Figure:
    """Return a figure of RMS error (while the target is attainable) versus temperature, by target."""
    drawn: list[Panel] = []
    for target in run.targets:
        lines = []
        for name, colour in zip(dict.fromkeys(row.controller for row in run.rows), SERIES, strict=False):
            points = sorted(
                (row.temperature_degC, row.score.rmse_feasible_N)
                for row in run.rows
                if (row.target, row.controller) == (target, name) and row.score.rmse_feasible_N is not None
            )
            x, y = ([point[k] for point in points] for k in (0, 1))
            lines.append(Line(x, y, colour, name, dots=x))
        drawn.append(
            Panel(target, "temperature, °C", lines, y_label="" if drawn else "RMS error, feasible, N")
        )
    return panel_figure(drawn, height=1.8, legend="")


_CAPTION = (
    "Tracking at the highest temperature. The grey band is the attainable force. The lower panels have a "
    "grey background if the target is not feasible"
)


def _first(run: TrackResult) -> FirstScreen:
    best = {target: _best(run, target) for target in run.targets}
    hardest = max(best.values(), key=lambda row: _feasible(row.score))
    card, score = run.card, hardest.score
    temperatures = _temperatures(run)
    return FirstScreen(
        title=f"Force tracking on {run.plant}",
        subject=f"Controllers from the card {card.title or card.damper.law.name}, at {run.rate_Hz:g} Hz "
        f"and {temperatures} °C. Values are the worse of the noise seeds {run.seeds[0]} and {run.seeds[1]}.",
        verdict=_verdict(best),
        tiles=(
            Tile(
                f"{_feasible(score):.1f} N",
                f"RMS error of {hardest.controller} on {hardest.target} while the target is feasible",
                f"{score.rmse_over_range_percent:.1f} % of the range of the target force",
            ),
            Tile(
                "–" if score.max_feasible_N is None else f"{score.max_feasible_N:.0f} N",
                "maximum error while the target is feasible",
                ""
                if score.p99_feasible_N is None
                else f"below {score.p99_feasible_N:.0f} N for 99 % of the time",
            ),
            Tile(
                f"{100 * score.feasible_share:.0f} %",
                "of the time the target is feasible",
                f"RMS error at all times {score.rmse_N:.0f} N",
            ),
        ),
        caption=_CAPTION,
        flags=[("This is a simulation, not a measurement", "The controllers use only the card")],
        notes=[*_posterior_words(run), *run.notes],
    )


def _verdict(best: Mapping[str, Row]) -> str:
    return "Lowest RMS error while the target is feasible: " + "; ".join(
        f"{controller} with "
        + ", ".join(
            f"{_feasible(row.score):.1f} N RMS on {target}"
            for target, row in best.items()
            if row.controller == controller
        )
        for controller in dict.fromkeys(row.controller for row in best.values())
    )


def _columns(*first: Column[Row]) -> list[Column[Row]]:
    """Return the columns of an error table: first the given columns, then controller and errors."""
    return [
        *first,
        Column("controller", "controller"),
        Column("max", "score.max_N", "N", ".1f"),
        Column("RMS", "score.rmse_N", "N", ".1f"),
        Column("max feasible", "score.max_feasible_N", "N", ".1f"),
        Column("p99 feasible", "score.p99_feasible_N", "N", ".1f", printed=False),
        Column("RMS feasible", "score.rmse_feasible_N", "N", ".1f"),
        Column("feasible", "score.feasible_share", form=".1%", printed=False),
        Column("RMS over range", "score.rmse_over_range_percent", "%", ".2f", printed=False),
        Column("within 5 %", "score.within_5_percent_share", form=".0%"),
        Column("coil", "score.coil_power_W", "W", ".1f"),
        Column("chatter", "score.chatter_A_per_s", "A/s", ".0f"),
    ]


def _sections(run: TrackResult) -> list[Section]:
    best = [_best(run, target) for target in run.targets]
    target: Column[Row] = Column("target", "target")
    degrees: Column[Row] = Column("at", "temperature_degC", "degC", "g")
    temperatures = _temperatures(run)
    return [
        Table(
            title=f"Worst of {temperatures} °C",
            columns=_columns(target),
            rows=run.max_error_rows,
            caption="A target is feasible if it is at least 20 N inside the range between the forces at zero "
            "and at maximum current, for the same motion and temperature. For targets below 800 N the margin "
            "is 2.5 % of the target. Errors always refer to the full target. The first second is ignored. "
            "The lowest error is highlighted.",
            held=lambda row: row in best,
        ),
        *([Picture("Errors versus temperature", lambda: error_figure(run))] if "," in temperatures else []),
        *(Picture(f"Target {each.target}", partial(tracking_figure, each)) for each in run.traced[1:]),
        Table(
            title="All temperatures",
            columns=_columns(target, degrees),
            rows=run.rows,
            folded=f"{len(run.rows)} tests",
        ),
    ]


def _best(run: TrackResult, target: str) -> Row:
    """Return the row of the controller whose RMS error at its worst temperature is smallest."""
    rows = [row for row in run.max_error_rows if row.target == target]
    return min(rows, key=lambda row: _feasible(row.score))


def _feasible(score: Score) -> float:
    """Return the RMS error [N] of samples with attainable target; if none, of all."""
    return score.rmse_N if score.rmse_feasible_N is None else score.rmse_feasible_N


def _posterior_words(run: TrackResult) -> list[str]:
    """Return a line for each run with the interval of the RMS error due to parameter uncertainty."""
    return [
        f"{error.controller} on {each.target} at {each.temperature_degC:g} degC: "
        f"{100.0 * INTERVAL_PROBABILITY:.0f} % interval {error.rmse_N[0]:.1f} to {error.rmse_N[1]:.1f} N "
        "RMS, from posterior samples of the card"
        for each in run.traced
        for error in each.posterior
    ]


def _temperatures(run: TrackResult) -> str:
    """Return the tested temperatures [degC] as text, such as "20, 60"."""
    return ", ".join(f"{degrees:g}" for degrees in sorted({row.temperature_degC for row in run.rows}))


def _fields(run: TrackResult) -> dict[str, object]:
    return {
        "rows": _rows(run),
        "worst": [_row(row, run.plant) for row in run.max_error_rows],
        "plant": run.plant,
        "seeds": run.seeds,
        "rate_Hz": run.rate_Hz,
        "scored": "worse of the seeds; all samples after the first second, at the time steps of the plant",
        "posterior": [
            {
                "target": each.target,
                "temperature_degC": each.temperature_degC,
                "controller": error.controller,
                "rmse_interval_N": error.rmse_N,
                "max_interval_N": error.max_N,
            }
            for each in run.traced
            for error in each.posterior
        ],
        "notes": run.notes,
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


def _trace(each: Traced) -> dict[str, object]:
    """Return forces and currents of a simulation, reduced to about 2000 samples."""
    course, reach = each.course, each.reach
    part = slice(None, None, max(1, -(-len(course) // 2000)))  # A browser plots longer curves slowly.
    return {
        "target": each.target,
        "temperature_degC": each.temperature_degC,
        "time_s": course.time[part],
        "wanted_N": course.target[part],
        "low_N": reach.low[part],
        "high_N": reach.high[part],
        "runs": [
            {"controller": one.controller, "force_N": one.force[part], "command_A": one.current[part]}
            for one in each.runs
        ],
    }


def _show(run: TrackResult, console: Console) -> None:
    """Print the best controller, the errors for each target at the worst temperature, and notes."""
    console.print(escape(sentence(_verdict({target: _best(run, target) for target in run.targets}))))
    temperatures = _temperatures(run)
    for target in run.targets:
        rows = [row for row in run.max_error_rows if row.target == target]
        feasible = rows[0].score.feasible_share
        console.print(
            f"{target} on {run.plant}, worst of {temperatures} degC, "
            f"feasible {100.0 * feasible:.0f} % of the time:",
            markup=False,
        )
        print_compact(Table(title="", columns=_columns(), rows=rows).printed(), console)
    print_notes([*_posterior_words(run), *run.notes], console)


def _rows(run: TrackResult) -> list[Json]:
    return [_row(row, run.plant) for row in run.rows]


PAGE = Page(
    name="track.html",
    first=_first,
    picture=lambda run: tracking_figure(run.traced[0]) if run.traced else error_figure(run),
    label="Target and force, error, current",
    sections=_sections,
)

REPORT = Report(
    fields=_fields,
    show=_show,
    page=PAGE,
    files=(
        WrittenFile(name="track.json", key="file"),
        csv_file("track.csv", _rows),
    ),
    curves=lambda run: {"traces": [_trace(each) for each in run.traced]},
    rows=_rows,
)
