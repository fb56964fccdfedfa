"""Small multiples of the reports: many small axes with the same limits.

Measured curves are grey and wide, modelled ones thin and coloured. The colour scale of temperatures is from
violet (cold) to orange (hot).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.palette import HELD_OUT, INK, WIDTH_INCH, colour_of, shortened
from mrdamper.report.figures.style import add_legend, axes_table, drawing_style, svg_drawn_by, svg_of

POOLED_COLOUR = "#222222"


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line through points; ``style`` is -, -- or : as in Matplotlib."""

    x: FloatArray
    y: FloatArray
    colour: str
    width: float = 0.9
    style: str = "-"


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A row of panels with the same axes; an empty panel is left blank."""

    x_label: str
    y_label: str
    panels: tuple[tuple[Line, ...], ...]
    title: str = ""


@dataclass(frozen=True, slots=True)
class Point:
    """A measured value; ``split`` is training or held_out."""

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
    """The curve of a coefficient at one current or temperature, with its standard error if it is known."""

    series: Series
    error: FloatArray | None


def grid(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], label: str, *, tall: float = 1.2) -> str:
    """Return ``grid_figure`` as SVG."""
    return svg_drawn_by(lambda: grid_figure(titles, rows, tall=tall), label)


def grid_figure(titles: Sequence[tuple[str, bool]], rows: Sequence[Row], *, tall: float = 1.2) -> Figure:
    """Return rows of small panels, one column for each (title, held out). All panels of a row share limits.

    ``tall`` is the height of a panel [inch].
    """
    columns = len(titles)
    width = min(WIDTH_INCH, 0.55 + 3.2 * columns)
    height = 0.27 + sum(tall + (0.55 if row.title else 0.4) for row in rows)
    figure = Figure(figsize=(width, height))
    left, gap = 0.6, 0.10  # inches
    across = (width - left - 0.08 - gap * (columns - 1)) / columns
    top = height - 0.22
    for row in rows:
        top -= 0.17 if row.title else 0.0
        first: Axes | None = None
        for column, panel in enumerate(row.panels):
            if not panel:
                continue
            x = left + column * (across + gap)
            place = (x / width, (top - tall) / height, across / width, tall / height)
            axes = figure.add_axes(place, sharex=first, sharey=first)
            for line in panel:
                axes.plot(line.x, line.y, color=line.colour, lw=line.width, ls=line.style)
            axes.set_xlabel(row.x_label)
            if first is None:
                first = axes
                # The last label of x would touch the first one of the next panel.
                axes.locator_params(nbins=4, prune="upper", axis="x")
                axes.locator_params(nbins=5, axis="y")
                axes.set_ylabel(row.y_label)
                axes.set_title(row.title, fontweight="bold")
            else:
                axes.tick_params(labelleft=False)
        top -= tall + 0.38
    for column, (title, held_out) in enumerate(titles):
        figure.text(
            (left + column * (across + gap)) / width,
            1.0 - 0.06 / height,
            shortened(title, max(round(across / 0.072), 8)),  # inches per letter
            fontsize=8.0,
            color=HELD_OUT if held_out else INK,
            va="top",
        )
    return figure


def against_temperature(panels: Sequence[tuple[str, Sequence[Series]]], label: str) -> str:
    """Return panels (title with unit, series) versus temperature [degC] with one legend."""
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.75))
        table = axes_table(figure, 1, len(panels), margins=(0.42, 0.4, 0.8, 0.22), gaps=(0.5, 0.0))
        shown: dict[str, tuple[str, str, str]] = {}
        for axes, (title, members) in zip(table, panels, strict=True):
            for series in members:
                axes.plot(series.x, series.y, color=series.colour, lw=1.1, ls=series.style)
                shown.setdefault(series.label, (series.label, series.colour, series.style))
                _add_points(axes, series.points, series.colour)
            axes.set(title=title, xlabel="temperature, °C")
            axes.locator_params(nbins=6)
            axes.set_ylim(bottom=min(0.0, *(1.05 * float(series.y.min()) for series in members)))
        add_legend(figure, list(shown.values()))
        return svg_of(figure, label)


def run_errors(
    motions: Mapping[str, Sequence[tuple[float, float | None, Point]]],
    pooled: Mapping[str, Sequence[Point]],
    x_label: str,
    highest: float,
) -> str:
    """Return a panel for each motion: a dot for each run, and a diamond for all runs of one level.

    Parameters
    ----------
    motions : for each motion, runs as (value of x, command, point)
    pooled : for each motion, root-mean-square errors
    highest : current with the last colour of the scale
    """
    columns = min(len(motions), 5)
    rows = -(-len(motions) // columns)
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.15 * rows + 0.1))
        table = axes_table(
            figure, rows, columns, margins=(0.55, 0.36, 0.1, 0.22), gaps=(0.15, 0.62), share_y=True
        )
        for axes, (motion, runs) in zip(table, motions.items(), strict=False):
            for x, command, point in runs:
                _add_points(axes, [Point(x, point.y, point.split)], colour_of(command, highest), size=3.0)
            _add_points(axes, pooled[motion], POOLED_COLOUR, size=4.2, marker="D")
            axes.set(title=motion, xlabel=x_label)
            axes.locator_params(nbins=5)
        for axes in table[len(motions) :]:
            axes.set_visible(False)
        for axes in table[::columns]:
            axes.set(ylabel="RMS error, N")
        table[0].set_ylim(bottom=0.0)
        return svg_of(figure, "RMS error of every run by motion")


def curves(panels: Sequence[tuple[str, str, Sequence[Curve], FloatArray | None]], legend_title: str) -> str:
    """Return panels (title, label of x, curves, trained values of x) with one legend."""
    columns = 4
    rows = -(-len(panels) // columns)
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 1.95 * rows + 0.25))
        table = axes_table(figure, rows, columns, margins=(0.45, 0.36, 0.1, 0.5), gaps=(0.5, 0.62))
        shown: dict[str, tuple[str, str, str]] = {}
        for axes, (title, x_label, members, trained) in zip(table, panels, strict=False):
            for curve in members:
                series = curve.series
                if curve.error is not None:
                    low, high = series.y - curve.error, series.y + curve.error
                    axes.fill_between(series.x, low, high, color=series.colour, alpha=0.16, lw=0.0)
                axes.plot(series.x, series.y, color=series.colour, lw=1.2, ls=series.style)
                if series.label:
                    shown.setdefault(series.label, (series.label, series.colour, series.style))
                if trained is not None and len(trained):
                    marked = np.interp(trained, series.x, series.y)
                    axes.plot(trained, marked, "o", color=series.colour, ms=2.6)
            axes.set(title=title, xlabel=x_label)
            axes.locator_params(nbins=5)
            if all((curve.series.y >= 0.0).all() for curve in members):
                axes.set_ylim(bottom=0.0)
        for axes in table[len(panels) :]:
            axes.set_visible(False)
        add_legend(figure, list(shown.values()), title=legend_title, at_top=True)
        return svg_of(figure, "Coefficients")


def _add_points(
    axes: Axes, points: Sequence[Point], colour: str, *, size: float = 4.0, marker: str = "o"
) -> None:
    """Add measured points: filled for training runs, open for held-out ones."""
    for split, face in (("training", colour), ("held_out", "white")):
        chosen = [(point.x, point.y) for point in points if point.split == split]
        if chosen:
            axes.plot(*zip(*chosen, strict=True), marker, ms=size, mfc=face, mec=colour, mew=0.9)
