"""Small multiples: figures of many small axes with lines, bands and points.

Measured curves are grey and wide, modelled ones thin and coloured. Measured points are filled for training
runs, open for held-out runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.style import HELD_OUT, INK, TOP_INCH, Share, add_legend, panels, shortened


@dataclass(frozen=True, slots=True)
class Point:
    """A measured value; ``split`` is ``training`` or ``held_out``."""

    x: float
    y: float
    split: str


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line with a band around the line, and points.

    Attributes
    ----------
    style : format string of Matplotlib, such as "--" or "."
    band : lower and upper limits
    points : measured values
    dots : values of x that are marked on the line
    """

    x: FloatArray | Sequence[float]
    y: FloatArray | Sequence[float]
    colour: str
    label: str = ""
    width: float = 1.1
    style: str = "-"
    band: tuple[FloatArray, FloatArray] | None = None
    points: Sequence[Point] = ()
    dots: FloatArray | Sequence[float] = ()

    def draw(self, axes: Axes) -> None:
        """Draw the line with its band, points and dots."""
        if self.band is not None:
            axes.fill_between(self.x, *self.band, color=self.colour, alpha=0.2, lw=0.0)
        axes.plot(self.x, self.y, self.style, color=self.colour, lw=self.width, label=self.label or None)
        if len(self.dots):
            axes.plot(self.dots, np.interp(self.dots, self.x, self.y), "o", color=self.colour, ms=2.6)
        for split, face in (("training", self.colour), ("held_out", "white")):
            if chosen := [(point.x, point.y) for point in self.points if point.split == split]:
                axes.plot(*zip(*chosen, strict=True), "o", mfc=face, mec=self.colour, mew=0.9)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Axes with a title and lines. ``held`` marks a held-out run: its title is red."""

    title: str
    x_label: str
    lines: Sequence[Line]
    held: bool = False
    y_label: str = ""


def panel_figure(
    drawn: Sequence[Panel],
    columns: int = 4,
    *,
    height: float = 1.35,
    share: Share = "",
    legend: str | None = None,
) -> Figure:
    """Return a figure of panels. If a panel has no negative values, its axis begins at zero.

    Parameters
    ----------
    height : height of the axes [inch]
    share : see ``style.panels``
    legend : title of a common legend above the panels; None: each panel has its own legend
    """
    letter_inch = 0.072  # width of a letter in a title
    entries = [(line.label, line.colour, line.style) for each in drawn for line in each.lines if line.label]
    common = legend is not None and bool(entries)
    figure, table = panels(
        len(drawn),
        columns,
        height=height,
        gap=0.2 if share else 0.5,  # Panels with shared y limits have labels only at the left panel.
        top=0.6 if common else TOP_INCH,  # A common legend with title and one row needs 0.6 inch.
        share=share,
    )
    letters = round(table[0].get_position().width * figure.get_size_inches()[0] / letter_inch)
    for axes, panel in zip(table, drawn, strict=True):
        for line in panel.lines:
            line.draw(axes)
        axes.set_title(shortened(panel.title, max(letters, 8)), color=HELD_OUT if panel.held else INK)
        axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
        # The last tick label of the x axis would touch the first label of the next panel.
        axes.locator_params(nbins=4 if share else 5, prune="upper" if share else None, axis="x")
        axes.locator_params(nbins=5, axis="y")
        if share != "row" and all(np.fmin.reduce(line.y, initial=0.0) >= 0.0 for line in panel.lines):
            axes.set_ylim(bottom=0.0)
        if not common and any(line.label for line in panel.lines):
            axes.legend(loc="best")
    if legend is not None:
        add_legend(figure, entries, title=legend, at_top=True)
    return figure
