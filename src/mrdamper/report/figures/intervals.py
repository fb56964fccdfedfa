"""Predictions with their 90 % intervals, and histograms of draws, as panels of one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.jobs.intervals import CoefficientInterval, ForceInterval
from mrdamper.report.figures.palette import INK, MEASURED, TRAINING
from mrdamper.report.figures.sheet import Axes, Band, Box, Sheet

_COLUMNS, _WIDE, _TALL = 4, 10.6, 1.95  # inches: of the sheet, of a row
_BAND, _BAR = 0.25, "#9db8cc"


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A prediction over x with its interval, and what was measured where there is such."""

    title: str
    x_label: str
    x: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray
    measured: FloatArray | None = None

    def draw(self, axes: Axes) -> None:
        if self.measured is not None:
            axes.line(self.x, self.measured, MEASURED, 2.0)
        axes.marks.append(Band(self.x, self.low, self.high, TRAINING, _BAND))
        axes.line(self.x, self.value, TRAINING, 1.0)
        axes.x_label = self.x_label


@dataclass(frozen=True, slots=True, eq=False)
class Histogram:
    """Draws of a number, the ends of their interval, and the best fit."""

    title: str
    counts: NDArray[np.intp]  # shape (bins,)
    edges: FloatArray  # shape (bins + 1,)
    interval: tuple[float, float]
    best: float

    def draw(self, axes: Axes) -> None:
        most = 1.05 * float(self.counts.max())
        sides = zip(self.edges[:-1].tolist(), self.edges[1:].tolist(), self.counts.tolist(), strict=True)
        axes.marks += [Box(left, 0.0, right, count, _BAR) for left, right, count in sides if count]
        for x, colour, width in (
            *((end, TRAINING, 0.8) for end in self.interval),
            (self.best, INK, 1.0),
        ):
            axes.line(np.full(2, x), np.array([0.0, most]), colour, width)
        low, high = min(float(self.edges[0]), self.best), max(float(self.edges[-1]), self.best)
        room = 0.05 * (high - low) or 1.0
        axes.x_ends, axes.y_ends = (low - room, high + room), (0.0, most)
        axes.y_ticks, axes.y_names, axes.few, axes.grid = [], [], 4, "x"


def force_panels(found: Sequence[ForceInterval]) -> list[Panel]:
    """Return the force of each run over a cycle, measured and modelled."""
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
    """Return each coefficient over the command."""
    over = "current, A" if command_unit == "A" else "voltage, V"
    return [
        Panel(
            f"{each.name.replace('_', ' ')}, {each.unit}", over, each.command, each.value, each.low, each.high
        )
        for each in found
    ]


def panel_sheet(groups: Sequence[Sequence[Panel | Histogram]]) -> Sheet:
    """Return groups of panels, each on rows of its own."""
    rows = [-(-len(group) // _COLUMNS) for group in groups]
    height = _TALL * max(sum(rows), 1)
    sheet = Sheet(_WIDE, height)
    wide, gap = (_WIDE - 0.6) / _COLUMNS, 0.55
    first = 0
    for group, count in zip(groups, rows, strict=True):
        for k, panel in enumerate(group):
            row, column = divmod(k, _COLUMNS)
            top, left = height - _TALL * (first + row) - 0.25, 0.6 + column * wide
            axes = sheet.add(left, top - _TALL + 0.68, left + wide - gap, top)
            axes.title, axes.few = panel.title, 5
            panel.draw(axes)
        first += count
    return sheet
