"""Small multiples of the reports: many small axes with shared limits, and the figures made of them.

Plain values in, an SVG element out, measured grey and wide, modelled thin and coloured.
Temperatures have a colour scale of their own, from violet (cold) to orange (hot).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.palette import HELD_OUT, INK, WIDE, colour_of, shortened
from mrdamper.report.figures.sheet import Axes, Band, Key, Line, Points, Sheet, Words
from mrdamper.report.figures.ticks import nice_ticks

__all__ = [
    "Curve",
    "Line",
    "Point",
    "Row",
    "Series",
    "against_temperature",
    "curves",
    "grid",
    "grid_sheet",
    "run_errors",
]

_POOLED = "#222222"
_LETTER = 0.072  # width of a title's letter [inch]


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One row of panels with the same axes; an empty panel is left blank."""

    x_label: str
    y_label: str
    panels: tuple[tuple[Line, ...], ...]
    title: str = ""


@dataclass(frozen=True, slots=True)
class Point:
    """A measured value; ``split`` says whether the fit has seen its run."""

    x: float
    y: float
    split: str


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A modelled curve with its measured points."""

    label: str
    colour: str
    x: FloatArray
    y: FloatArray
    points: tuple[Point, ...] = ()
    style: str = "-"


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A coefficient's curve at one command or temperature, with its standard error where that is known."""

    series: Series
    error: FloatArray | None


def grid(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], label: str, *, tall: float = 1.2) -> str:
    """Return ``grid_sheet`` as SVG."""
    return grid_sheet(titles, rows, tall=tall).svg(label)


def grid_sheet(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], *, tall: float = 1.2) -> Sheet:
    """Return rows of small panels, one column for each (title, held out); limits are shared along a row.

    ``tall`` is the height of a panel [inch].
    """
    columns = len(titles)
    width = min(WIDE, 0.55 + 3.2 * columns)
    height = 0.27 + sum(tall + (0.55 if row.title else 0.4) for row in rows)
    sheet = Sheet(width, height)
    left, right, gap = 0.6, 0.08, 0.10  # inches
    across = (width - left - right - gap * (columns - 1)) / columns
    top = height - 0.22
    for row in rows:
        top -= 0.17 if row.title else 0.0
        drawn = [line for panel in row.panels for line in panel]
        ends = _span([line.x for line in drawn]), _span([line.y for line in drawn])
        first = True
        for column, panel in enumerate(row.panels):
            if not panel:
                continue
            x = left + column * (across + gap)
            axes = sheet.add(x, top - tall, x + across, top)
            axes.marks += panel
            _prepare(axes, *ends)
            axes.x_label, axes.y_named = row.x_label, first
            if first:
                axes.y_label, axes.title, axes.bold = row.y_label, row.title, True
            first = False
        top -= tall + 0.38
    for column, (title, held_out) in enumerate(titles):
        place = (left + column * (across + gap)) / width, 1.0 - 0.06 / height
        text = shortened(title, max(round(across / _LETTER), 8))
        sheet.words.append(Words(*place, text, 8.0, HELD_OUT if held_out else INK))
    return sheet


def against_temperature(panels: Sequence[tuple[str, Sequence[Series]]], label: str) -> str:
    """Return panels (title with unit, series) over temperature in degC, with one legend."""
    sheet = Sheet(WIDE, 2.75)
    shown: dict[str, Key] = {}
    table = sheet.table(1, len(panels), left=0.04, right=0.925, top=0.92, bottom=0.145, wspace=0.17)
    for axes, (title, members) in zip(table, panels, strict=True):
        for series in members:
            axes.line(series.x, series.y, series.colour, 1.1, series.style)
            shown.setdefault(series.label, Key(series.label, series.colour, series.style))
            _add_points(axes, series.points, series.colour)
        axes.title, axes.x_label, axes.few = title, "temperature, °C", 6
        low = min(0.0, *(1.05 * float(series.y.min()) for series in members))
        axes.y_ends = (low, axes.ends[1][1])
    sheet.keys = list(shown.values())
    return sheet.svg(label)


def run_errors(
    motions: Mapping[str, Sequence[tuple[float, float | None, Point]]],
    pooled: Mapping[str, Sequence[Point]],
    x_label: str,
    highest: float,
) -> str:
    """Return a panel for each motion: a dot for each run, and the runs of one level pooled.

    Parameters
    ----------
    motions : of each motion, runs as (place on the x axis, command, point)
    pooled : of each motion, root mean squares
    highest : the command that has the last colour
    """
    columns = min(len(motions), 5)
    rows = -(-len(motions) // columns)
    height = 2.15 * rows + 0.1
    top = max(point.y for runs in motions.values() for _, _, point in runs)
    sheet = Sheet(WIDE, height)
    edges = {"left": 0.05, "right": 0.99, "top": 1.0 - 0.22 / height, "bottom": 0.36 / height}
    table = sheet.table(rows, columns, **edges, wspace=0.08, hspace=0.45)
    for place, (axes, (motion, runs)) in enumerate(zip(table, motions.items(), strict=False)):
        for x, command, point in runs:
            _add_points(axes, [Point(x, point.y, point.split)], colour_of(command, highest), size=3.0)
        _add_points(axes, pooled[motion], _POOLED, size=4.6, diamond=True)
        axes.title, axes.x_label, axes.few, axes.y_ends = motion, x_label, 5, (0.0, 1.06 * top)
        axes.y_named = place % columns == 0
        axes.y_label = "RMS error, N" if axes.y_named else ""
    return sheet.svg("RMS error of every run by motion")


def curves(panels: Sequence[tuple[str, str, Sequence[Curve], FloatArray | None]], legend_title: str) -> str:
    """Return panels (title, label of x, curves, trained places) with one legend in the first free place."""
    columns = 4
    rows = -(-len(panels) // columns)
    height = 1.95 * rows + 0.25
    sheet = Sheet(WIDE, height, keys_at="top", keys_title=legend_title)
    shown: dict[str, Key] = {}
    edges = {"left": 0.045, "right": 0.99, "top": 1.0 - 0.5 / height, "bottom": 0.36 / height}
    table = sheet.table(rows, columns, **edges, wspace=0.26, hspace=0.5)
    for axes, (title, x_label, members, trained) in zip(table, panels, strict=False):
        for curve in members:
            series = curve.series
            if curve.error is not None:
                low, high = series.y - curve.error, series.y + curve.error
                axes.marks.append(Band(series.x, low, high, series.colour, 0.16))
            axes.line(series.x, series.y, series.colour, 1.2, series.style)
            if series.label:
                shown.setdefault(series.label, Key(series.label, series.colour, series.style))
            if trained is not None and len(trained):
                marked = np.interp(trained, series.x, series.y)
                axes.marks.append(Points(trained.tolist(), marked.tolist(), series.colour, 2.6))
        axes.title, axes.x_label, axes.few = title, x_label, 5
        if all((curve.series.y >= 0.0).all() for curve in members):
            axes.y_ends = (0.0, axes.ends[1][1])
    sheet.keys = list(shown.values())
    return sheet.svg("Coefficients")


def _add_points(
    axes: Axes, points: Sequence[Point], colour: str, *, size: float = 4.0, diamond: bool = False
) -> None:
    """Add measured points: filled where the fit has seen the run, open where not."""
    for split in ("training", "held_out"):
        chosen = [point for point in points if point.split == split]
        if chosen:
            x, y = [point.x for point in chosen], [point.y for point in chosen]
            axes.marks.append(Points(x, y, colour, size, "" if split == "training" else "white", diamond))


def _span(arrays: Sequence[FloatArray]) -> tuple[float, float]:
    low, high = min(float(a.min()) for a in arrays), max(float(a.max()) for a in arrays)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _prepare(axes: Axes, x_ends: tuple[float, float], y_ends: tuple[float, float]) -> None:
    """Set limits and few ticks; of those of x the last one could touch the next panel's first."""
    axes.x_ends, axes.y_ends, axes.few, axes.tick = x_ends, y_ends, 4, 2.0
    ticks = nice_ticks(x_ends, 4)
    axes.x_ticks = ticks[:-1] if len(ticks) > 3 else ticks
