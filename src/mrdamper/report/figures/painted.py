"""A sheet drawn by Matplotlib, for who wants a figure to go on with."""

from __future__ import annotations

from matplotlib.axes import Axes as DrawnAxes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from mrdamper.report.figures.sheet import INCH, SMALL, Axes, Band, Box, Line, Mark, Points, Sheet
from mrdamper.report.figures.ticks import labels_of


def painted(sheet: Sheet) -> Figure:
    """Return a sheet as a Matplotlib figure; the caller sets the style of drawing."""
    figure = Figure(figsize=(sheet.width, sheet.height))
    size = (sheet.width * INCH, sheet.height * INCH)
    for axes in sheet.axes:
        if axes.marks:
            left, low, right, high = axes.place
            edges = (left / size[0], low / size[1], (right - left) / size[0], (high - low) / size[1])
            _paint(axes, figure.add_axes(edges))
    for each in sheet.words:
        figure.text(each.x, each.y, each.text, fontsize=each.size, color=each.colour, va="top")
    if sheet.keys:
        lines = [
            Line2D([], [], color=key.colour, linewidth=key.width, linestyle=key.style)  # type: ignore[arg-type]
            for key in sheet.keys
        ]
        names = [key.label for key in sheet.keys]
        if sheet.keys_at == "right":
            figure.legend(lines, names, loc="center right", bbox_to_anchor=(1.0, 0.55))
        else:
            title = sheet.keys_title or None
            figure.legend(lines, names, loc="upper right", ncols=len(lines) + 1, title=title, borderaxespad=0)
    return figure


def _paint(axes: Axes, drawn: DrawnAxes) -> None:
    if axes.log:
        drawn.set_xscale("log")
        drawn.set_yscale("log")
    for mark in axes.marks:
        _paint_mark(mark, drawn)
    x_ends, y_ends = axes.ends
    drawn.set_xlim(*x_ends)
    drawn.set_ylim(*y_ends)
    for axis, ticks, names in zip(
        (drawn.xaxis, drawn.yaxis), axes.ticks, (axes.x_names, axes.y_names), strict=True
    ):
        axis.set_ticks(list(ticks), list(names or labels_of(ticks)[0]))
        axis.set_ticks([], minor=True)
    power = labels_of(axes.ticks[1])[1]
    if power and axes.y_names is None:
        drawn.text(0.0, 1.02, power, transform=drawn.transAxes, fontsize=SMALL, ha="right")
    drawn.tick_params(length=axes.tick)
    drawn.tick_params(axis="x", rotation=90.0 if axes.upright else 0.0)
    if not axes.y_named:
        drawn.tick_params(axis="y", labelleft=False)
    if axes.names_right:
        drawn.yaxis.tick_right()
    drawn.grid(visible=False)
    for along in axes.grid:
        drawn.grid(visible=True, axis="x" if along == "x" else "y")
    if not axes.spines:
        drawn.spines[:].set_visible(False)
        drawn.tick_params(length=0.0)
    drawn.set_title(axes.title, loc="left", pad=3, fontweight="bold" if axes.bold else "normal")
    drawn.set_xlabel(axes.x_label, labelpad=1.5)
    drawn.set_ylabel(axes.y_label, labelpad=1.0)


def _paint_mark(mark: Mark, drawn: DrawnAxes) -> None:
    if isinstance(mark, Line):
        drawn.plot(mark.x, mark.y, mark.style, color=mark.colour, linewidth=mark.width)
    elif isinstance(mark, Band):
        drawn.fill_between(mark.x, mark.low, mark.high, color=mark.colour, alpha=mark.opacity, linewidth=0)
    elif isinstance(mark, Points):
        drawn.plot(
            mark.x,
            mark.y,
            "D" if mark.diamond else "o",
            markersize=mark.size,
            color=mark.colour,
            markerfacecolor=mark.face or mark.colour,
            markeredgewidth=0.9,
        )
    elif isinstance(mark, Box):
        corner, size = (mark.left, mark.low), (mark.right - mark.left, mark.high - mark.low)
        drawn.add_patch(Rectangle(corner, *size, facecolor=mark.colour, edgecolor="none"))
    else:
        drawn.annotate(
            mark.text,
            (mark.x, mark.y),
            (mark.right, 0.0),
            textcoords="offset points",
            va="center",
            ha={"start": "left", "middle": "center", "end": "right"}[mark.anchor],
            fontsize=mark.size,
            color=mark.colour,
        )
