"""Small multiples of the reports: many small axes with shared limits, and the figures made of them.

As in ``plots``: plain values in, an SVG element out, measured grey and wide, modelled thin and coloured.
Temperatures have a colour scale of their own, from violet (cold) to orange (hot).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.style import HELD_OUT, INK, WIDE, colour_of, drawing_style, shortened, svg_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

__all__ = [
    "Band",
    "Line",
    "Point",
    "Row",
    "Series",
    "against_temperature",
    "colour_of_warmth",
    "curves",
    "grid",
    "grid_figure",
    "run_errors",
]

_TICKS = MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10])
_POOLED = "#222222"
_LETTER = 0.072  # width of a title's letter [inch]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One line of a panel."""

    x: FloatArray
    y: FloatArray
    colour: str
    width: float = 0.9
    style: str = "-"


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
class Band:
    """A coefficient's curve at one command or temperature, with its standard error where that is known."""

    series: Series
    error: FloatArray | None


def colour_of_warmth(temperature: float, levels: Sequence[float]) -> str:
    """Return a temperature's colour among the levels, [K] or any other unit: violet (cold) to orange."""
    low, high = min(levels), max(levels)
    share = 0.5 if low == high else (temperature - low) / (high - low)
    return to_hex(mpl.colormaps["plasma"](0.05 + 0.70 * share))


def grid(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], label: str, *, tall: float = 1.2) -> str:
    """Return ``grid_figure`` as SVG."""
    with drawing_style():
        return svg_of(grid_figure(titles, rows, tall=tall), label)


def grid_figure(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], *, tall: float = 1.2) -> Figure:
    """Return rows of small panels, one column for each (title, held out); limits are shared along a row.

    ``tall`` is the height of a panel [inch]. The caller sets the style of drawing.
    """
    columns = len(titles)
    width = min(WIDE, 0.55 + 3.2 * columns)
    height = 0.27 + sum(tall + (0.55 if row.title else 0.4) for row in rows)
    figure = Figure(figsize=(width, height))
    left, right, gap = 0.6, 0.08, 0.10  # inches
    across = (width - left - right - gap * (columns - 1)) / columns
    top = height - 0.22
    for row in rows:
        top -= 0.17 if row.title else 0.0
        drawn = [line for panel in row.panels for line in panel]
        x_ends, y_ends = _span([line.x for line in drawn]), _span([line.y for line in drawn])
        first = True
        for column, panel in enumerate(row.panels):
            if not panel:
                continue
            place = (left + column * (across + gap)) / width, (top - tall) / height
            axes = figure.add_axes((*place, across / width, tall / height))
            _prepare(axes, x_ends, y_ends)
            for line in panel:
                axes.plot(line.x, line.y, line.style, color=line.colour, linewidth=line.width)
            axes.set_xlabel(row.x_label, labelpad=1.0)
            if first:
                axes.set_ylabel(row.y_label, labelpad=1.0)
                if row.title:
                    axes.set_title(row.title, loc="left", pad=3, fontweight="bold")
            else:
                axes.tick_params(axis="y", labelleft=False)
            first = False
        top -= tall + 0.38
    for column, (title, held_out) in enumerate(titles):
        figure.text(
            (left + column * (across + gap)) / width,
            1.0 - 0.06 / height,
            shortened(title, max(round(across / _LETTER), 8)),
            color=HELD_OUT if held_out else INK,
            fontsize=8.0,
            va="top",
        )
    return figure


def against_temperature(panels: Sequence[tuple[str, Sequence[Series]]], label: str) -> str:
    """Return panels (title with unit, series) over temperature in degC, with one legend."""
    height = 2.75
    with drawing_style():
        figure = Figure(figsize=(WIDE, height))
        shown: dict[str, Artist] = {}
        for place, (title, members) in enumerate(panels):
            axes = figure.add_subplot(1, len(panels), place + 1)
            for series in members:
                (line,) = axes.plot(series.x, series.y, series.style, color=series.colour, linewidth=1.1)
                shown.setdefault(series.label, line)
                _draw_points(axes, series.points, series.colour)
            axes.set_title(title, loc="left", pad=4)
            axes.set_xlabel("temperature, °C", labelpad=1.5)
            axes.set_ylim(bottom=min(0.0, *(1.05 * float(series.y.min()) for series in members)))
            axes.locator_params(nbins=6)
        figure.legend(list(shown.values()), list(shown), loc="center right", bbox_to_anchor=(1.0, 0.55))
        figure.subplots_adjust(left=0.04, right=0.925, top=0.92, bottom=0.145, wspace=0.17)
        return svg_of(figure, label)


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
    with drawing_style():
        figure = Figure(figsize=(WIDE, height))
        for place, (motion, runs) in enumerate(motions.items()):
            axes = figure.add_subplot(rows, columns, place + 1)
            for split in ("training", "held_out"):
                chosen = [point for point in pooled[motion] if point.split == split]
                filled = _POOLED if split == "training" else "white"
                axes.plot(
                    [point.x for point in chosen],
                    [point.y for point in chosen],
                    "D",
                    markersize=4.6,
                    color=_POOLED,
                    markerfacecolor=filled,
                    markeredgewidth=0.9,
                    zorder=3,
                )
            for x, command, point in runs:
                _draw_points(
                    axes, [Point(x, point.y, point.split)], colour_of(command, highest), size=3.0, width=0.7
                )
            axes.set_title(motion, loc="left", pad=3)
            axes.set_ylim(0.0, 1.06 * top)
            axes.locator_params(nbins=5)
            axes.set_xlabel(x_label, labelpad=1.5)
            if place % columns == 0:
                axes.set_ylabel("RMS error, N")
            else:
                axes.tick_params(axis="y", labelleft=False)
        figure.subplots_adjust(
            left=0.05,
            right=0.99,
            top=1.0 - 0.22 / height,
            bottom=0.36 / height,
            wspace=0.08,
            hspace=0.45,
        )
        return svg_of(figure, "RMS error of every run by motion")


def curves(panels: Sequence[tuple[str, str, Sequence[Band], FloatArray | None]], legend_title: str) -> str:
    """Return panels (title, label of x, curves, trained places) with one legend in the first free place."""
    columns = 4
    rows = -(-len(panels) // columns)
    height = 1.95 * rows + 0.25
    with drawing_style():
        figure = Figure(figsize=(WIDE, height))
        shown: dict[str, Artist] = {}
        for place, (title, x_label, members, trained) in enumerate(panels):
            axes = figure.add_subplot(rows, columns, place + 1)
            for band in members:
                series = band.series
                if band.error is not None:
                    low, high = series.y - band.error, series.y + band.error
                    axes.fill_between(series.x, low, high, color=series.colour, alpha=0.16, linewidth=0)
                (line,) = axes.plot(series.x, series.y, series.style, color=series.colour, linewidth=1.2)
                if series.label:
                    shown.setdefault(series.label, line)
                if trained is not None and len(trained):
                    marked = np.interp(trained, series.x, series.y)
                    axes.plot(trained, marked, "o", markersize=2.6, color=series.colour)
            axes.set_title(title, loc="left", pad=3)
            axes.set_xlabel(x_label, labelpad=1.5)
            axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 5))
            axes.locator_params(nbins=5)
            if all((band.series.y >= 0.0).all() for band in members):
                axes.set_ylim(bottom=0.0)
        if shown:
            figure.legend(
                list(shown.values()),
                list(shown),
                loc="upper right",
                ncols=len(shown) + 1,
                title=legend_title,
                title_fontsize=7.0,
                borderaxespad=0.0,
            )
        figure.subplots_adjust(
            left=0.045,
            right=0.99,
            top=1.0 - 0.5 / height,
            bottom=0.36 / height,
            wspace=0.26,
            hspace=0.5,
        )
        return svg_of(figure, "Coefficients")


def _draw_points(
    axes: Axes, points: Sequence[Point], colour: str, *, size: float = 4.0, width: float = 0.9
) -> None:
    """Draw measured points: filled where the fit has seen the run, open where not."""
    for split in ("training", "held_out"):
        chosen = [point for point in points if point.split == split]
        if chosen:
            axes.plot(
                [point.x for point in chosen],
                [point.y for point in chosen],
                "o",
                markersize=size,
                color=colour,
                markerfacecolor=colour if split == "training" else "white",
                markeredgewidth=width,
                zorder=2.5,
            )


def _span(arrays: Sequence[FloatArray]) -> tuple[float, float]:
    low, high = min(float(a.min()) for a in arrays), max(float(a.max()) for a in arrays)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _prepare(axes: Axes, x_ends: tuple[float, float], y_ends: tuple[float, float]) -> None:
    """Set limits and few ticks, inside the limits: cheaper than to let each axes find its own."""
    axes.set_xlim(*x_ends)
    axes.set_ylim(*y_ends)
    axes.set_xticks(_inside(x_ends)[:-1] if len(_inside(x_ends)) > 3 else _inside(x_ends))
    axes.set_yticks(_inside(y_ends))
    axes.tick_params(length=2.0)


def _inside(ends: tuple[float, float]) -> list[float]:
    return [tick for tick in map(float, _TICKS.tick_values(*ends)) if ends[0] <= tick <= ends[1]]
