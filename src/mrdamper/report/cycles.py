"""What ``cycles`` found: the answer's keys, the tables of a terminal, page, figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.data.cycle_groups import FigureSummary
from mrdamper.jobs.cycles import CyclesResult
from mrdamper.report.base import (
    DONE,
    FirstScreen,
    Outcome,
    Page,
    Report,
    Tile,
    WrittenFile,
    interrupted,
)
from mrdamper.report.check import findings_table
from mrdamper.report.figures.style import HELD_OUT, TRAINING, WIDE
from mrdamper.report.sections import Column, Section, Table
from mrdamper.schema import Json

TITLES = {
    "energy_J": "energy per cycle, J",
    "highest_force_N": "highest force, N",
    "lowest_force_N": "lowest force, N",
    "stiffness_N_per_mm": "secant stiffness, N/mm",
    "temperature_degC": "mean temperature, °C",
    "amplitude_mm": "amplitude, mm",
    "period_s": "period, s",
}
_PANELS = (
    ("energy_J",),
    ("highest_force_N", "lowest_force_N"),
    ("stiffness_N_per_mm",),
    ("temperature_degC",),
)

_MOST_FLAGS = 2  # findings on the first screen


def _first(result: CyclesResult) -> FirstScreen:
    rows, least = result.rows, result.least_stroke_m
    stroke = "" if least is None else f"; a cycle has a stroke of more than {1e3 * least:.4g} mm"
    step = "" if result.step_s is None else f", usual step {result.step_s:.4g} s"
    broken = f"; cycles left out at breaks: {result.broken_cycles:,}" if result.broken_cycles else ""
    flags = []
    if result.cancelled:
        flags.append(("Interrupted", f"These are the cycles of the first {rows} rows only"))
    if not result.cycles:
        remedy = "Set a smaller least stroke, or look at the record's channels"
        flags.append(("No cycle was found", f"Nothing moves to and fro so far. {remedy}"))
    flags += [(each.found, f"{each.effect}. {each.remedy}") for each in result.findings[:_MOST_FLAGS]]
    return FirstScreen(
        title=f"{result.cycles} cycles of {result.record.path.name}",
        subject=f"{result.record.path}: {rows:,} rows ({result.record.understood}){step}{stroke}{broken}.",
        verdict=f"{result.cycles:,} cycles took up {result.energy_J:.5g} J",
        tiles=_tiles(result),
        caption="Figures over the number of the cycle"
        + (
            ""
            if result.groups.size == 1
            else f": means of {result.groups.size} cycles, bands from least to most"
        ),
        flags=flags,
    )


def _tiles(result: CyclesResult) -> tuple[Tile, Tile, Tile]:
    """Return energy, force and temperature (or stiffness) of a cycle."""
    named = [("energy_J", "J", "energy per cycle"), ("highest_force_N", "N", "highest force")]
    warm = "temperature_degC" in result.figures
    named.append(
        ("temperature_degC", "°C", "mean temperature")
        if warm
        else ("stiffness_N_per_mm", "N/mm", "stiffness")
    )
    first, second, third = (_tile(result.figures.get(name), unit, label) for name, unit, label in named)
    return first, second, third


def _tile(found: FigureSummary | None, unit: str, label: str) -> Tile:
    if found is None:
        return Tile("–", label)
    return Tile(f"{found.mean:.4g} {unit}", f"{label}, mean", f"{found.least:.4g} to {found.most:.4g} {unit}")


def _over_cycles(result: CyclesResult) -> Figure | None:
    """Return a panel for each figure over the number of the cycle: the groups' means, and their range."""
    groups, known = result.groups, set(result.figures)
    panels = [panel for panel in _PANELS if panel[0] in known]
    if not panels:
        return None
    count = -(-len(panels) // 2)
    height = 1.35 * count + 0.4
    figure = Figure(figsize=(WIDE, height))
    places = figure.subplots(count, min(len(panels), 2), sharex=True, squeeze=False).ravel(order="F")
    for axes, panel in zip(places, panels, strict=False):
        for name, colour in zip(panel, (TRAINING, HELD_OUT), strict=False):
            k = groups.names.index(name)
            least, most = groups.least[:, k], groups.most[:, k]
            if groups.size > 1:
                axes.fill_between(groups.number, least, most, color=colour, alpha=0.25, linewidth=0)
            mark = "." if len(groups.count) < 2 else ""
            axes.plot(groups.number, groups.mean[:, k], mark or "-", color=colour, linewidth=1.0)
        said = "; ".join(TITLES[name] for name in panel)
        axes.set_title(said[0].upper() + said[1:], loc="left", pad=3)
    for axes in places[len(panels) :]:
        axes.remove()
    for axes in places[count - 1 : len(panels) : count]:
        axes.set_xlabel("cycle", labelpad=1.5)
    figure.subplots_adjust(
        left=0.06, right=0.99, top=1.0 - 0.22 / height, bottom=0.36 / height, hspace=0.3, wspace=0.14
    )
    return figure


# ------------------------------------------------------------------------------------------- the tables


def _sections(result: CyclesResult) -> list[Section]:
    found: list[Section] = []
    if result.findings:
        found.append(findings_table(result.findings))
    if result.figures:
        found.append(_figures_table(result, "Over the cycles"))
    return found


def _figures_table(
    result: CyclesResult, title: str, words: Mapping[str, str] = TITLES
) -> Table[tuple[str, FigureSummary]]:
    """Return the table of each figure over the cycles; ``words`` are what it calls them."""
    count = result.groups.size
    ends = f"means of the first and the last {count} cycles at most" if count > 1 else "single cycles"

    def figure(title: str, form: str = ".5g") -> Column[tuple[str, FigureSummary]]:
        return Column(title, lambda row: getattr(row[1], title), form=form)

    return Table(
        title=title,
        columns=[
            Column("figure", lambda row: words.get(row[0], row[0])),
            *map(figure, ("first", "last", "mean", "least", "most")),
            Column("change", lambda row: _change(*row), "%", ".1f", printed=False),
            Column("per 1000 cycles", lambda row: row[1].trend_per_1000_cycles, form=".5g"),
        ],
        rows=[(name, result.figures[name]) for name in TITLES if name in result.figures],
        caption=f"First and last are {ends}; the trend is a straight line by least squares. Energy: the "
        "integral of force over displacement by the trapezoidal rule, closed over the cycle. Stiffness: "
        "the secant through the extremes of displacement. Every cycle is in cycles.csv.",
    )


def _change(name: str, figure: FigureSummary) -> float | None:
    """Return how much more the last cycles have than the first [%]; None for degrees, which have no share."""
    return 100.0 * (figure.last / figure.first - 1.0) if figure.first and name != "temperature_degC" else None


# ------------------------------------------------------------------------------------------- the answer


def _answer(result: CyclesResult) -> Json:
    """Return what ``mrdamper cycles --json`` prints, but for the files."""
    least = result.least_stroke_m
    return {
        "record": str(result.record.path),
        "understood": result.record.understood,
        "rows": result.rows,
        "step_s": result.step_s,
        "least_stroke_mm": None if least is None else 1e3 * least,
        "cycles": result.cycles,
        "broken_cycles": result.broken_cycles,
        "energy_J": result.energy_J,
        "group_cycles": result.groups.size,
        "figures": {name: _summary_json(summary) for name, summary in result.figures.items()},
        "findings": [dict(finding.to_dict()) for finding in result.findings],
        "cancelled": result.cancelled,
    }


def _summary_json(summary: FigureSummary) -> Json:
    told = asdict(summary)
    told.pop("slope")
    return {**told, "trend_per_1000_cycles": summary.trend_per_1000_cycles}


def _rows(result: CyclesResult) -> list[dict[str, object]]:
    """Return the means of the groups as a table."""
    groups = result.groups
    return [
        {"cycle": number, **dict(zip(groups.names, mean, strict=True))}
        for number, mean in zip(groups.number.tolist(), groups.mean.tolist(), strict=True)
    ]


# --------------------------------------------------------------------------------------------- the terminal


def _show(result: CyclesResult, console: Console) -> None:
    """Print the figures over the cycles, and what is wrong with the record."""
    title = f"{result.cycles:,} cycles in {result.rows:,} rows"
    console.print(_figures_table(result, title, words={}).printed())
    for finding in result.findings:
        console.print(escape(f"- {finding.severity}: {finding.in_words()}"))


def _outcome(result: CyclesResult) -> Outcome:
    return interrupted() if result.cancelled else DONE


_PAGE = Page(
    name="cycles.html",
    first=_first,
    picture=_over_cycles,
    label="Figures over the cycles",
    sections=_sections,
)

REPORT: Report[CyclesResult] = Report(
    answer=_answer,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="cycles.csv", key="file", streamed=True),
        WrittenFile(name="summary.json", key="summary_file"),
    ),
    curves=lambda result: {"curves": result.groups.curves(), "titles": TITLES},
    rows=_rows,
    outcome=_outcome,
)
