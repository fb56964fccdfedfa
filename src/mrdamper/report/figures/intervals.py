"""Predictions with their 90 % intervals, and histograms of posterior samples, as panels of one figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.jobs.intervals import CoefficientInterval, ForceInterval
from mrdamper.report.figures.palette import INK, MEASURED, TRAINING, WIDTH_INCH
from mrdamper.report.figures.style import axes_table

BAR_COLOUR = "#9db8cc"


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A prediction versus x with its interval, and measured values if there are any."""

    title: str
    x_label: str
    x: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray
    measured: FloatArray | None = None

    def draw(self, axes: Axes) -> None:
        if self.measured is not None:
            axes.plot(self.x, self.measured, color=MEASURED, lw=2.0)
        axes.fill_between(self.x, self.low, self.high, color=TRAINING, alpha=0.25, lw=0.0)
        axes.plot(self.x, self.value, color=TRAINING, lw=1.0)
        axes.set_xlabel(self.x_label)
        axes.locator_params(nbins=5)


@dataclass(frozen=True, slots=True, eq=False)
class Histogram:
    """Posterior samples of a parameter, the ends of their interval, and the best fit."""

    title: str
    counts: NDArray[np.intp]  # shape (bins,)
    edges: FloatArray  # shape (bins + 1,)
    interval: tuple[float, float]
    best: float

    def draw(self, axes: Axes) -> None:
        axes.stairs(self.counts, self.edges, fill=True, color=BAR_COLOUR)
        for x, colour, width in (
            *((end, TRAINING, 0.8) for end in self.interval),
            (self.best, INK, 1.0),
        ):
            axes.axvline(x, color=colour, lw=width)
        axes.set_yticks([])
        axes.locator_params(nbins=4, axis="x")


def force_panels(found: Sequence[ForceInterval]) -> list[Panel]:
    """Return the force of each run during a cycle, measured and modelled."""
    return [
        Panel(
            f"{each.name[:40]}: force, N",
            "time, s",
            each.time_s,
            each.modelled_N,
            each.low_N,
            each.high_N,
            each.measured_N,
        )
        for each in found
    ]


def coefficient_panels(found: Sequence[CoefficientInterval], command_unit: str) -> list[Panel]:
    """Return each coefficient versus current."""
    over = "current, A" if command_unit == "A" else "voltage, V"
    return [
        Panel(
            f"{each.name.replace('_', ' ')}, {each.unit}", over, each.command, each.value, each.low, each.high
        )
        for each in found
    ]


def panel_figure(groups: Sequence[Sequence[Panel | Histogram]]) -> Figure:
    """Return groups of panels. Each group starts a new row."""
    panel_columns = 4
    rows = [-(-len(group) // panel_columns) for group in groups]
    figure = Figure(figsize=(WIDTH_INCH, 1.95 * max(sum(rows), 1)))
    table = axes_table(
        figure, max(sum(rows), 1), panel_columns, margins=(0.6, 0.43, 0.1, 0.25), gaps=(0.5, 0.68)
    )
    first = 0
    for group, count in zip(groups, rows, strict=True):
        places = table[first * panel_columns : (first + count) * panel_columns]
        for axes, panel in zip(places, group, strict=False):
            axes.set_title(panel.title)
            panel.draw(axes)
        for axes in places[len(group) :]:
            axes.set_visible(False)
        first += count
    return figure
