"""Figures of a fit: loops, residuals, errors, energies, coefficients and their correlations.

Every function takes plain values and returns an SVG element that depends only on them. Units are millimetres,
millimetres per second and newtons. Measured curves are grey and wide, modelled curves thin and coloured by
current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.report.figures import small_multiples
from mrdamper.report.figures.palette import HELD_OUT, MEASURED, TRAINING, WIDTH_INCH, colour_of, shortened
from mrdamper.report.figures.small_multiples import Series
from mrdamper.report.figures.style import add_legend, axes_table, drawing_style, svg_drawn_by, svg_of


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """One cycle (or a few seconds) of a run, measured and modelled, with reduced samples."""

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
    """Common axis limits of several runs."""

    displacement_mm: tuple[float, float]
    velocity_mm_s: tuple[float, float]
    force_N: tuple[float, float]

    @classmethod
    def from_traces(cls, traces: Sequence[Trace]) -> Limits:
        """Return limits that fit all traces."""

        def span(arrays: Sequence[FloatArray]) -> tuple[float, float]:
            return min(float(a.min()) for a in arrays), max(float(a.max()) for a in arrays)

        forces = [force for t in traces for force in (t.measured_N, t.modelled_N)]
        return cls(
            span([t.displacement_mm for t in traces]), span([t.velocity_mm_s for t in traces]), span(forces)
        )


@dataclass(frozen=True, slots=True, eq=False)
class CoefficientCurve:
    """A coefficient versus current, with its standard error if it is known."""

    name: str
    unit: str
    command: FloatArray
    value: FloatArray
    error: FloatArray | None
    trained_at: FloatArray  # commands of the training runs


def loops(trace: Trace, limits: Limits, highest: float) -> str:
    """Return force versus displacement and velocity of one run. All runs of a motion have the same limits."""
    with drawing_style():
        figure = Figure(figsize=(2.15, 3.35))
        panels = axes_table(figure, 2, 1, margins=(0.55, 0.38, 0.05, 0.06), gaps=(0.0, 0.5))
        over = (
            (trace.displacement_mm, limits.displacement_mm, "displacement, mm"),
            (trace.velocity_mm_s, limits.velocity_mm_s, "velocity, mm/s"),
        )
        for axes, (x, ends, label) in zip(panels, over, strict=True):
            axes.plot(x, trace.measured_N, color=MEASURED, lw=2.0)
            axes.plot(x, trace.modelled_N, color=colour_of(trace.command, highest), lw=0.9)
            axes.set(xlim=_widened(ends), ylim=_widened(limits.force_N), xlabel=label, ylabel="force, N")
            axes.locator_params(nbins=5)
        return svg_of(figure, f"Force loops of {trace.name}, measured and modelled")


def residuals(traces: Sequence[Trace], title: str, highest: float) -> str:
    """Return measured minus modelled force versus velocity and displacement, coloured by current."""
    top = 1.08 * max(float(np.abs(t.measured_N - t.modelled_N).max()) for t in traces)
    ordered = sorted(traces, key=lambda t: abs(t.command) if t.command is not None else np.inf)
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.4))
        panels = axes_table(figure, 1, 2, margins=(0.63, 0.42, 0.85, 0.08), gaps=(0.3, 0.0), share_y=True)
        shown: dict[str, tuple[str, str, str]] = {}
        for axes, name in zip(panels, ("velocity", "displacement"), strict=True):
            for trace in ordered:
                x = trace.displacement_mm if name == "displacement" else trace.velocity_mm_s
                style, colour = "-" if trace.split == "training" else "--", colour_of(trace.command, highest)
                axes.plot(x, trace.measured_N - trace.modelled_N, color=colour, lw=0.8, ls=style)
                shown.setdefault(trace.command_label, (trace.command_label, colour, style))
            axes.axhline(0.0, color="#888888", lw=0.6)
            axes.set(ylim=(-top, top), xlabel=f"{name}, mm{'/s' if name == 'velocity' else ''}")
        panels[0].set_ylabel("measured - modelled, N")
        add_legend(figure, list(shown.values()))
        return svg_of(figure, f"Residual force, {title}")


def errors(rows: Sequence[tuple[str, str, float]]) -> str:
    """Return ``errors_figure`` as SVG."""
    return svg_drawn_by(lambda: errors_figure(rows), "Error by run")


def errors_figure(rows: Sequence[tuple[str, str, float]]) -> Figure:
    """Return a bar for each (run, split, error in percent), from top to bottom."""
    figure = Figure(figsize=(WIDTH_INCH, 0.55 + 0.175 * len(rows)))
    (axes,) = axes_table(figure, 1, 1, margins=(2.45, 0.36, 0.15, 0.2))
    for split, colour, word in (("training", TRAINING, "training"), ("held_out", HELD_OUT, "held out")):
        values = {k: value for k, (_, s, value) in enumerate(rows) if s == split}
        if values:
            median = float(np.median([*values.values()]))
            axes.axvline(median, color=colour, lw=0.9, ls="--")
            label = f"{word} (median {median:.1f} %, dashed)"
            bars = axes.barh([*values], [*values.values()], 0.66, color=colour, label=label)
            axes.bar_label(bars, fmt="%.1f", fontsize=6.5, color="#555555", padding=2.0)
    axes.set_yticks(range(len(rows)), [shortened(name) for name, _, _ in rows])
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlim=(0.0, 1.08 * max(value for _, _, value in rows)))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("RMS error, % of the standard deviation of the measured force")
    figure.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    return figure


def energies(points: Sequence[tuple[float | None, str, float, float]], highest: float) -> str:
    """Return modelled versus measured energy per cycle of (current, split, measured [J], modelled [J])."""
    good = [p for p in points if p[2] > 0.0 and p[3] > 0.0]
    with drawing_style():
        figure = Figure(figsize=(4.0, 3.4))
        (axes,) = axes_table(figure, 1, 1, margins=(0.56, 0.43, 0.08, 0.07))
        axes.set(xlabel="measured, J", ylabel="modelled, J")
        if good:
            low = 0.8 * min(min(p[2], p[3]) for p in good)
            high = 1.25 * max(max(p[2], p[3]) for p in good)
            line = np.array([low, high])
            axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
            axes.fill_between(line, 0.9 * line, 1.1 * line, color="#eeeeee", lw=0.0)
            axes.plot(line, line, color="#888888", lw=0.7)
            axes.text(
                0.02, 0.98, "grey: within 10 %", transform=axes.transAxes, va="top", size=7.0, color="#666666"
            )
            for command, split, measured, modelled in good:
                colour = colour_of(command, highest)
                face = colour if split == "training" else "white"
                axes.plot(measured, modelled, "o", ms=4.0, mec=colour, mfc=face, mew=0.9)
        return svg_of(figure, "Energy per cycle, modelled versus measured")


def curves(given: Sequence[CoefficientCurve], command_unit: str) -> str:
    """Return each coefficient versus current. The band is one standard error, dots are fitted currents."""
    over = "current, A" if command_unit == "A" else "voltage, V"
    return small_multiples.curves(
        [
            (
                f"{curve.name.replace('_', ' ')}, {curve.unit}",
                over,
                [small_multiples.Curve(Series("", TRAINING, curve.command, curve.value), curve.error)],
                curve.trained_at,
            )
            for curve in given
        ],
        "",
    )


def correlations(names: Sequence[str], matrix: FloatArray) -> str:
    """Return the correlation matrix of the parameters. Strong correlations are printed as numbers."""
    count = len(names)
    side = 0.27 * count
    labels = [name.removesuffix(".value") for name in names]
    with drawing_style():
        figure = Figure(figsize=(side + 2.3, side + 1.55))
        (axes,) = axes_table(figure, 1, 1, margins=(1.55, 1.5, 0.75, 0.05))
        below = np.where(np.tri(count, k=-1, dtype=bool), matrix, np.nan)
        levels = mpl.colormaps["RdBu_r"].resampled(20)  # The SVG stays small with few colours.
        centres = np.arange(count)
        image = axes.pcolormesh(centres, centres, below, cmap=levels, vmin=-1.0, vmax=1.0)
        axes.invert_yaxis()
        for i, j in zip(*np.nonzero(np.abs(below) >= 0.8), strict=True):
            axes.text(j, i, f"{below[i, j]:.2f}", size=5.2, color="white", ha="center", va="center")
        axes.set_xticks(range(count), labels, rotation=90)
        axes.set_yticks(range(count), labels)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        width = figure.get_size_inches()[0]
        bar = figure.add_axes((1.0 - 0.5 / width, 0.45, 0.1 / width, 0.4))
        figure.colorbar(image, cax=bar, ticks=[-1, 0, 1]).outline.set_visible(False)
        return svg_of(figure, "Correlations of the parameters")


def _widened(ends: tuple[float, float]) -> tuple[float, float]:
    margin = 0.05 * (ends[1] - ends[0])
    return ends[0] - margin, ends[1] + margin
