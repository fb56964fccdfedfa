"""Figures of a fit: loops, residuals, errors, energies, coefficients and their correlations.

Every function takes plain values and returns an SVG element whose bytes depend on them alone, in millimetres,
millimetres per second and newtons. Measured is grey and wide, modelled thin and coloured by command.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.palette import (
    HELD_OUT,
    MEASURED,
    TRAINING,
    WIDE,
    colour_of,
    colour_of_share,
    shortened,
)
from mrdamper.report.figures.sheet import Band, Box, Key, Points, Sheet, Words
from mrdamper.report.figures.ticks import log_ticks


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """One cycle (or a few seconds) of a run, measured and modelled, thinned for drawing."""

    name: str
    motion: str
    command: float | None
    command_unit: str
    split: str
    error_percent: float
    rmse_N: float
    time_s: FloatArray  # from the first drawn sample
    displacement_mm: FloatArray
    velocity_mm_s: FloatArray
    measured_N: FloatArray
    modelled_N: FloatArray

    @property
    def command_label(self) -> str:
        return "varying" if self.command is None else f"{self.command:g} {self.command_unit}"


@dataclass(frozen=True, slots=True)
class Limits:
    """Low and high end of the axes that several runs share."""

    displacement_mm: tuple[float, float]
    velocity_mm_s: tuple[float, float]
    force_N: tuple[float, float]

    @classmethod
    def of(cls, traces: Sequence[Trace]) -> Limits:
        """Return the limits that show all of these."""

        def span(arrays: Sequence[FloatArray]) -> tuple[float, float]:
            return min(float(a.min()) for a in arrays), max(float(a.max()) for a in arrays)

        forces = [force for t in traces for force in (t.measured_N, t.modelled_N)]
        return cls(
            span([t.displacement_mm for t in traces]), span([t.velocity_mm_s for t in traces]), span(forces)
        )


@dataclass(frozen=True, slots=True, eq=False)
class CoefficientCurve:
    """A coefficient over the command, with its standard error where that is known."""

    name: str
    unit: str
    command: FloatArray
    value: FloatArray
    error: FloatArray | None
    trained_at: FloatArray  # commands of the training runs


def loops(trace: Trace, limits: Limits, highest: float) -> str:
    """Return force over displacement and over velocity of one run; limits are shared within a motion."""
    sheet = Sheet(2.15, 3.35)
    panels = sheet.table(2, 1, left=0.25, right=0.98, top=0.985, bottom=0.105, hspace=0.36)
    over = (
        (trace.displacement_mm, limits.displacement_mm, "displacement, mm"),
        (trace.velocity_mm_s, limits.velocity_mm_s, "velocity, mm/s"),
    )
    for axes, (x, ends, label) in zip(panels, over, strict=True):
        axes.line(x, trace.measured_N, MEASURED, 2.0)
        axes.line(x, trace.modelled_N, colour_of(trace.command, highest), 0.9)
        axes.x_ends, axes.y_ends, axes.few = _widened(ends), _widened(limits.force_N), 5
        axes.x_label, axes.y_label = label, "force, N"
    return sheet.svg(f"Force loops of {trace.name}, measured and modelled")


def residuals(traces: Sequence[Trace], title: str, highest: float) -> str:
    """Return measured minus modelled force over velocity and over displacement, coloured by command."""
    sheet = Sheet(WIDE, 2.4)
    top = 1.08 * max(float(np.abs(t.measured_N - t.modelled_N).max()) for t in traces)
    panels = sheet.table(1, 2, left=0.06, right=0.92, top=0.97, bottom=0.175, wspace=0.12)
    ordered = sorted(traces, key=lambda t: abs(t.command) if t.command is not None else np.inf)
    shown: dict[str, Key] = {}
    for axes, name in zip(panels, ("velocity", "displacement"), strict=True):
        for trace in ordered:
            x = trace.displacement_mm if name == "displacement" else trace.velocity_mm_s
            style, colour = "-" if trace.split == "training" else "--", colour_of(trace.command, highest)
            axes.line(x, trace.measured_N - trace.modelled_N, colour, 0.8, style)
            shown.setdefault(trace.command_label, Key(trace.command_label, colour, style))
        axes.level(0.0)
        axes.y_ends, axes.x_label = (-top, top), f"{name}, mm{'/s' if name == 'velocity' else ''}"
    panels[0].y_label = "measured - modelled, N"
    sheet.keys = list(shown.values())
    return sheet.svg(f"Residual force, {title}")


def errors(rows: Sequence[tuple[str, str, float]]) -> str:
    """Return ``errors_sheet`` as SVG."""
    return errors_sheet(rows).svg("Error by run")


def errors_sheet(rows: Sequence[tuple[str, str, float]]) -> Sheet:
    """Return a bar for each (run, split, error in percent), in the order given from the top."""
    height = 0.55 + 0.175 * len(rows)
    sheet = Sheet(WIDE, height, keys_at="top")
    (axes,) = sheet.table(1, 1, left=0.23, right=0.985, top=1.0 - 0.19 / height, bottom=0.34 / height)
    ends = (len(rows) - 0.4, -0.6)
    for split, colour, word in (("training", TRAINING, "training"), ("held_out", HELD_OUT, "held out")):
        places = [(k, value) for k, (_, s, value) in enumerate(rows) if s == split]
        if places:
            median = float(np.median([value for _, value in places]))
            axes.line(np.full(2, median), np.array(ends), colour, 0.9, "--")
            sheet.keys.append(Key(f"{word} (median {median:.1f} %, dashed)", colour, width=4.0))
            axes.marks += [Box(0.0, k - 0.33, value, k + 0.33, colour) for k, value in places]
    axes.marks += [
        Words(value, k, f"{value:.1f}", 6.5, "#555555", right=3.0) for k, (_, _, value) in enumerate(rows)
    ]
    axes.y_ends, axes.x_ends = ends, (0.0, 1.08 * max(value for _, _, value in rows))
    axes.y_ticks, axes.y_names = range(len(rows)), [shortened(name) for name, _, _ in rows]
    axes.grid, axes.x_label = "x", "RMS error, % of the standard deviation of the measured force"
    return sheet


def energies(points: Sequence[tuple[float | None, str, float, float]], highest: float) -> str:
    """Return modelled over measured energy per cycle, points (command, split, measured [J], modelled [J])."""
    sheet = Sheet(4.0, 3.4)
    (axes,) = sheet.table(1, 1, left=0.14, right=0.98, top=0.98, bottom=0.125)
    good = [p for p in points if p[2] > 0.0 and p[3] > 0.0]
    axes.x_label, axes.y_label = "measured, J", "modelled, J"
    if good:
        low = 0.8 * min(min(p[2], p[3]) for p in good)
        high = 1.25 * max(max(p[2], p[3]) for p in good)
        line = np.array([low, high])
        axes.log, axes.x_ends, axes.y_ends = True, (low, high), (low, high)
        axes.x_ticks = axes.y_ticks = log_ticks(low, high)
        axes.marks.append(Band(line, 0.9 * line, 1.1 * line, "#eeeeee", 1.0))
        axes.marks.append(
            Words(low, high * (low / high) ** 0.04, "grey: within 10 %", 7.0, "#666666", right=6.0)
        )
        axes.line(line, line, "#888888", 0.7)
        for command, split, measured, modelled in good:
            face = "" if split == "training" else "white"
            axes.marks.append(Points([measured], [modelled], colour_of(command, highest), 4.0, face))
    return sheet.svg("Energy per cycle, modelled against measured")


def curves(given: Sequence[CoefficientCurve], command_unit: str) -> str:
    """Return each coefficient over the command, the band one standard error, commands of training marked."""
    columns = 4
    rows = -(-len(given) // columns)
    height = 1.95 * rows
    sheet = Sheet(WIDE, height)
    edges = {"left": 0.045, "right": 0.99, "top": 1.0 - 0.22 / height, "bottom": 0.36 / height}
    for axes, curve in zip(
        sheet.table(rows, columns, **edges, wspace=0.26, hspace=0.42), given, strict=False
    ):
        if curve.error is not None:
            low, high = curve.value - curve.error, curve.value + curve.error
            axes.marks.append(Band(curve.command, low, high, TRAINING, 0.18))
        axes.line(curve.command, curve.value, TRAINING, 1.2)
        marked = np.interp(curve.trained_at, curve.command, curve.value)
        axes.marks.append(Points(curve.trained_at.tolist(), marked.tolist(), TRAINING, 3.2))
        axes.title = f"{curve.name.replace('_', ' ')}, {curve.unit}"
        axes.x_label = "current, A" if command_unit == "A" else "voltage, V"
        axes.few = 6
        if (curve.value >= 0.0).all():
            axes.y_ends = (0.0, axes.ends[1][1])
    return sheet.svg("Coefficients over the command")


def correlations(names: Sequence[str], matrix: FloatArray) -> str:
    """Return the correlation matrix of the numbers; values are written where they are strong."""
    count = len(names)
    side = 0.27 * count
    sheet = Sheet(side + 2.3, side + 1.55)
    axes = sheet.add(1.55, 1.5, 1.55 + side, 1.5 + side)
    for i in range(1, count):
        for j in range(i):
            value = float(matrix[i, j])
            if not np.isfinite(value):
                continue
            axes.marks.append(Box(j + 0.03, i + 0.03, j + 0.97, i + 0.97, colour_of_share(value)))
            if abs(value) >= 0.8:
                axes.marks.append(Words(j + 0.5, i + 0.5, f"{value:.2f}", 5.2, "white", "middle"))
    axes.x_ends, axes.y_ends = (0.0, count), (count, 0.0)
    axes.x_ticks = axes.y_ticks = [k + 0.5 for k in range(count)]
    axes.x_names = axes.y_names = [name.removesuffix(".value") for name in names]
    axes.grid, axes.spines, axes.upright = "", False, True
    low = 0.45 * sheet.height
    bar = sheet.add(sheet.width - 0.45, low, sheet.width - 0.35, low + 0.4 * sheet.height)
    steps = np.linspace(-1.0, 1.0, 22).tolist()
    bar.marks = [Box(0.0, a, 1.0, b, colour_of_share(0.5 * (a + b))) for a, b in itertools.pairwise(steps)]
    bar.x_ends, bar.y_ends = (0.0, 1.0), (-1.0, 1.0)
    bar.x_ticks, bar.y_ticks, bar.grid, bar.spines, bar.names_right = (), (-1, 0, 1), "", False, True
    return sheet.svg("Correlations of the numbers")


def _widened(ends: tuple[float, float]) -> tuple[float, float]:
    margin = 0.05 * (ends[1] - ends[0])
    return ends[0] - margin, ends[1] + margin
