"""Output of the command ``cycles``, which evaluates all cycles of a measurement."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.jobs.cycles import CyclesResult, FigureSummary
from mrdamper.report.base import Report, WrittenFile
from mrdamper.report.check import findings_table
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import HELD_OUT, TRAINING
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import Column, Section, Table

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


def _first(result: CyclesResult) -> FirstScreen:
    flag_count_max = 2  # The top of the page has space for only two findings about the data.
    count = len(result.cycles)
    stroke = f"a cycle has a stroke of more than {1e3 * result.stroke_min_m:.4g} mm"
    size = result.group_size
    groups = "" if size == 1 else f". Points are means of {size} cycles, bands are their range"
    return FirstScreen(
        title=f"{count} cycles of {Path(result.source).name}",
        subject=f"{result.source}: {result.rows:,} rows ({result.understood}); {stroke}.",
        verdict=f"{count:,} cycles dissipate {result.energy_J:.5g} J",
        tiles=_tiles(result),
        caption=f"Values versus cycle number{groups}",
        flags=[(each.found, f"{each.effect}. {each.remedy}") for each in result.findings[:flag_count_max]],
    )


def _tiles(result: CyclesResult) -> tuple[Tile, Tile, Tile]:
    """Return the values of the first screen: energy, force, and temperature or stiffness."""
    named = [("energy_J", "J", "energy per cycle"), ("highest_force_N", "N", "highest force")]
    warm = "temperature_degC" in result.columns
    named.append(
        ("temperature_degC", "°C", "mean temperature")
        if warm
        else ("stiffness_N_per_mm", "N/mm", "stiffness")
    )
    figures = result.figures
    first, second, third = (_tile(figures.get(name), unit, label) for name, unit, label in named)
    return first, second, third


def _tile(found: FigureSummary | None, unit: str, label: str) -> Tile:
    if found is None:
        return Tile("–", label)
    return Tile(f"{found.mean:.4g} {unit}", f"{label}, mean", f"{found.min:.4g} to {found.max:.4g} {unit}")


def _over_cycles(result: CyclesResult) -> Figure | None:
    """Return a figure of energy, force, stiffness and temperature versus cycle number."""
    groups, number = result.groups, result.group_number
    drawn = []
    for names in (panel for panel in _PANELS if panel[0] in groups):
        text = "; ".join(TITLES[name] for name in names)
        lines = [
            Line(number, mean, colour, style="-" if len(number) > 1 else ".", band=(low, high))
            for (mean, low, high), colour in zip(
                (groups[name] for name in names), (TRAINING, HELD_OUT), strict=False
            )
        ]
        drawn.append(Panel(text[0].upper() + text[1:], "cycle", lines))
    return panel_figure(drawn, 2) if drawn else None


def _sections(result: CyclesResult) -> list[Section]:
    found: list[Section] = [findings_table(result.findings)] if result.findings else []
    return [*found, _figures_table(result, "Over the cycles")] if len(result.cycles) else found


def _figures_table(
    result: CyclesResult, title: str, words: Mapping[str, str] = TITLES
) -> Table[tuple[str, FigureSummary]]:
    """Return a table of statistics, one row for each quantity of a cycle."""
    count, figures = result.group_size, result.figures
    ends = f"means of up to {count} cycles at the start and at the end" if count > 1 else "single cycles"

    def figure(title: str, form: str = ".5g") -> Column[tuple[str, FigureSummary]]:
        return Column(title, lambda row: getattr(row[1], title), form=form)

    return Table(
        title=title,
        columns=[
            Column("figure", lambda row: words.get(row[0], row[0])),
            *map(figure, ("first", "last", "mean", "min", "max")),
            Column("change", lambda row: _change(*row), "%", ".1f", printed=False),
            Column("per 1000 cycles", lambda row: row[1].trend_per_1000_cycles, form=".5g"),
        ],
        rows=[(name, figures[name]) for name in TITLES if name in figures],
        caption=f"First and last are {ends}. The trend is the slope of a least-squares line. The energy "
        f"is the "
        "integral of force over displacement by the trapezoidal rule. The stiffness is the slope of the line "
        "between the extremes of displacement. The file cycles.csv has all cycles.",
    )


def _change(name: str, figure: FigureSummary) -> float | None:
    """Return the change from the first to the last group [%]; None for temperatures."""
    return 100.0 * (figure.last / figure.first - 1.0) if figure.first and name != "temperature_degC" else None


def _fields(result: CyclesResult) -> dict[str, object]:
    return {
        "record": result.source,
        "understood": result.understood,
        "rows": result.rows,
        "least_stroke_mm": 1e3 * result.stroke_min_m,
        "cycles": len(result.cycles),
        "breaks": result.breaks,
        "energy_J": result.energy_J,
        "group_cycles": result.group_size,
        "figures": result.figures,
        "findings": [finding.to_dict() for finding in result.findings],
    }


def _rows(result: CyclesResult) -> list[dict[str, object]]:
    """Return one table row for each group of cycles, with the means in the group."""
    columns = {"cycle": result.group_number, **{name: mean for name, (mean, _, _) in result.groups.items()}}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _write_table(result: CyclesResult, path: Path) -> None:
    """Write one CSV row for each cycle. The cell of a missing value is empty."""
    found = result.cycles
    columns = {
        "cycle": range(1, len(found) + 1),
        "run": result.run,
        "row": found.row.tolist(),
        "start_s": found.start_s.tolist(),
        **{name: values.tolist() for name, values in result.columns.items()},
        f"command_{result.command_unit}": found.command.tolist(),
        "samples": found.samples.tolist(),
    }
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            table.writerow(["" if value != value else value for value in row])  # noqa: PLR0124 - NaN


def _show(result: CyclesResult, console: Console) -> None:
    title = f"{len(result.cycles):,} cycles in {result.rows:,} rows"
    console.print(_figures_table(result, title, words={}).printed())
    for finding in result.findings:
        console.print(escape(f"- {finding.severity}: {finding.in_words()}"))


_PAGE = Page(
    name="cycles.html",
    first=_first,
    picture=_over_cycles,
    label="Values versus cycle number",
    sections=_sections,
)

REPORT: Report[CyclesResult] = Report(
    fields=_fields,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="cycles.csv", key="file", write=_write_table),
        WrittenFile(name="summary.json", key="summary_file"),
    ),
    rows=_rows,
)
