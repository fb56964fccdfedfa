"""Figures of the report, as inline SVG: millimetres, millimetres per second and newtons.

Every function takes plain values and returns an SVG element whose bytes depend on them alone. Text stays
text (small, searchable); measured is grey and wide, modelled thin and coloured by command.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

__all__ = [
    "HELD_OUT",
    "INK",
    "MEASURED",
    "TRAINING",
    "WIDE",
    "CoefficientCurve",
    "Limits",
    "Trace",
    "colour_of",
    "correlations",
    "curves",
    "drawing_style",
    "energies",
    "errors",
    "errors_figure",
    "loops",
    "residuals",
    "shortened",
    "svg_of",
]

MEASURED = "#b3b3b3"
HELD_OUT = "#c8553d"
TRAINING = "#4a6d8c"
INK = "#333333"

_DECIMALS = re.compile(r"(\.\d\d)\d+")
WIDE = 10.6  # inches; the page is 1130 px wide, paper shrinks it

_STYLE: dict[str, object] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "mrdamper",
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": INK,
    "xtick.color": "#666666",
    "ytick.color": "#666666",
    "text.color": INK,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.5,
    "text.parse_math": False,
    "axes.formatter.useoffset": False,
    "path.simplify": True,
    "path.simplify_threshold": 0.1,
}


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


def colour_of(command: float | None, highest: float) -> str:
    """Return a run's colour: dark blue at zero command [A or V] to ochre at the highest, on white."""
    share = 1.0 if command is None or highest == 0.0 else min(abs(command) / highest, 1.0)
    return to_hex(mpl.colormaps["viridis"](0.08 + 0.70 * share))


def loops(trace: Trace, limits: Limits, highest: float) -> str:
    """Return force over displacement and over velocity of one run; limits are shared within a motion."""
    with drawing_style():
        figure = Figure(figsize=(2.15, 3.35))
        colour = colour_of(trace.command, highest)
        for place, (x, ends, label) in enumerate(
            (
                (trace.displacement_mm, limits.displacement_mm, "displacement, mm"),
                (trace.velocity_mm_s, limits.velocity_mm_s, "velocity, mm/s"),
            )
        ):
            axes = figure.add_subplot(2, 1, place + 1)
            axes.plot(x, trace.measured_N, color=MEASURED, linewidth=2.0, solid_joinstyle="round")
            axes.plot(x, trace.modelled_N, color=colour, linewidth=0.9)
            axes.set_xlim(*_widened(ends))
            axes.set_ylim(*_widened(limits.force_N))
            axes.locator_params(nbins=5)
            axes.locator_params(axis="x", nbins=5, prune="both")
            axes.set_xlabel(label, labelpad=1.5)
            axes.set_ylabel("force, N", labelpad=1.0)
        figure.subplots_adjust(left=0.25, right=0.98, top=0.985, bottom=0.105, hspace=0.36)
        return svg_of(figure, f"Force loops of {trace.name}, measured and modelled")


def residuals(traces: Sequence[Trace], title: str, highest: float) -> str:
    """Return measured minus modelled force over velocity and over displacement, coloured by command."""
    with drawing_style():
        figure = Figure(figsize=(WIDE, 2.4))
        top = max(float(np.abs(t.measured_N - t.modelled_N).max()) for t in traces)
        shown: dict[str, Artist] = {}
        for place, label in enumerate(("velocity, mm/s", "displacement, mm")):
            axes = figure.add_subplot(1, 2, place + 1)
            axes.axhline(0.0, color="#888888", linewidth=0.6)
            for trace in sorted(traces, key=lambda t: abs(t.command) if t.command is not None else np.inf):
                x = trace.displacement_mm if place else trace.velocity_mm_s
                style = "-" if trace.split == "training" else "--"
                (line,) = axes.plot(
                    x,
                    trace.measured_N - trace.modelled_N,
                    style,
                    color=colour_of(trace.command, highest),
                    linewidth=0.8,
                )
                shown.setdefault(trace.command_label, line)
            axes.set_ylim(-1.08 * top, 1.08 * top)
            axes.set_xlabel(label, labelpad=1.5)
            if not place:
                axes.set_ylabel("measured - modelled, N")
        figure.legend(list(shown.values()), list(shown), loc="center right", bbox_to_anchor=(1.0, 0.55))
        figure.subplots_adjust(left=0.06, right=0.92, top=0.97, bottom=0.175, wspace=0.12)
        return svg_of(figure, f"Residual force, {title}")


def errors(rows: Sequence[tuple[str, str, float]]) -> str:
    """Return ``errors_figure`` as SVG."""
    with drawing_style():
        return svg_of(errors_figure(rows), "Error by run")


def errors_figure(rows: Sequence[tuple[str, str, float]]) -> Figure:
    """Return a bar for each (run, split, error in percent), in the order given from the top."""
    with drawing_style():
        height = 0.55 + 0.175 * len(rows)
        figure = Figure(figsize=(WIDE, height))
        axes = figure.add_subplot()
        values = [value for _, _, value in rows]
        colours = [TRAINING if split == "training" else HELD_OUT for _, split, _ in rows]
        places = np.arange(len(rows))
        axes.barh(places, values, height=0.66, color=colours)
        for place, value in enumerate(values):
            axes.annotate(
                f"{value:.1f}",
                (value, place),
                (3, 0),
                textcoords="offset points",
                va="center",
                fontsize=6.5,
                color="#555555",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4},
            )
        axes.set_yticks(places, [shortened(name) for name, _, _ in rows])
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_xlim(0.0, 1.08 * max(values))
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("RMS error, % of the standard deviation of the measured force", labelpad=2)
        for split, colour, word in (("training", TRAINING, "training"), ("held_out", HELD_OUT, "held out")):
            of_split = [value for _, s, value in rows if s == split]
            if of_split:
                median = float(np.median(of_split))
                axes.axvline(median, color=colour, linewidth=0.9, linestyle=(0, (4, 2)), zorder=0.9)
                axes.plot([], [], color=colour, linewidth=4, label=f"{word} (median {median:.1f} %, dashed)")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
        figure.subplots_adjust(left=0.23, right=0.985, top=1.0 - 0.19 / height, bottom=0.34 / height)
    return figure


def energies(points: Sequence[tuple[float | None, str, float, float]], highest: float) -> str:
    """Return modelled over measured energy per cycle, points (command, split, measured [J], modelled [J])."""
    with drawing_style():
        figure = Figure(figsize=(4.0, 3.4))
        axes = figure.add_subplot()
        good = [p for p in points if p[2] > 0.0 and p[3] > 0.0]
        if good:
            low = 0.8 * min(min(p[2], p[3]) for p in good)
            high = 1.25 * max(max(p[2], p[3]) for p in good)
            line = np.array([low, high])
            axes.fill_between(line, 0.9 * line, 1.1 * line, color="#eeeeee", linewidth=0, label="within 10 %")
            axes.plot(line, line, color="#888888", linewidth=0.7)
            for command, split, measured, modelled in good:
                colour = colour_of(command, highest)
                face = colour if split == "training" else "white"
                axes.plot([measured], [modelled], "o", markersize=4.0, color=colour, markerfacecolor=face)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(low, high)
            axes.set_ylim(low, high)
            _plain_log_ticks(axes, low, high)
            axes.legend(loc="upper left")
        axes.set_xlabel("measured, J")
        axes.set_ylabel("modelled, J")
        figure.subplots_adjust(left=0.14, right=0.98, top=0.98, bottom=0.125)
        return svg_of(figure, "Energy per cycle, modelled against measured")


def curves(given: Sequence[CoefficientCurve], command_unit: str) -> str:
    """Return each coefficient over the command, the band one standard error, commands of training marked."""
    columns = 4
    rows = -(-len(given) // columns)
    with drawing_style():
        figure = Figure(figsize=(WIDE, 1.95 * rows))
        for place, curve in enumerate(given):
            axes = figure.add_subplot(rows, columns, place + 1)
            if curve.error is not None:
                low, high = curve.value - curve.error, curve.value + curve.error
                axes.fill_between(curve.command, low, high, color=TRAINING, alpha=0.18, linewidth=0)
            axes.plot(curve.command, curve.value, color=TRAINING, linewidth=1.2)
            marked = np.interp(curve.trained_at, curve.command, curve.value)
            axes.plot(curve.trained_at, marked, "o", markersize=3.2, color=TRAINING)
            axes.set_title(f"{curve.name.replace('_', ' ')}, {curve.unit}", loc="left", pad=3)
            axes.set_xlabel("current, A" if command_unit == "A" else "voltage, V", labelpad=1.5)
            axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 5))
            if (curve.value >= 0.0).all():
                axes.set_ylim(bottom=0.0)
        bottom = 0.36 / (1.95 * rows)
        figure.subplots_adjust(
            left=0.045, right=0.99, top=1.0 - 0.22 / (1.95 * rows), bottom=bottom, wspace=0.26, hspace=0.42
        )
        return svg_of(figure, "Coefficients over the command")


def correlations(names: Sequence[str], matrix: FloatArray, strong: float = 0.8) -> str:
    """Return the correlation matrix of the numbers; values are written where they are strong."""
    count = len(names)
    side = 0.27 * count
    width, height = side + 2.3, side + 1.55
    with drawing_style():
        figure = Figure(figsize=(width, height))
        axes = figure.add_subplot()
        shown = np.where(np.tri(count, k=-1, dtype=bool), matrix, np.nan)
        axes.pcolormesh(
            np.ma.masked_invalid(shown), cmap="RdBu_r", vmin=-1.0, vmax=1.0, edgecolors="white", linewidth=0.5
        )
        for i, j in zip(*np.nonzero(np.abs(np.nan_to_num(shown)) >= strong), strict=True):
            axes.text(
                j + 0.5, i + 0.5, f"{shown[i, j]:.2f}", ha="center", va="center", fontsize=5.2, color="white"
            )
        labels = [name.removesuffix(".value") for name in names]
        axes.set_xticks(np.arange(count) + 0.5, labels, rotation=90)
        axes.set_yticks(np.arange(count) + 0.5, labels)
        axes.invert_yaxis()
        axes.tick_params(length=0)
        axes.grid(visible=False)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_aspect("equal")
        bar = figure.add_axes((1.0 - 0.45 / width, 0.45, 0.1 / width, 0.4))
        steps = np.linspace(-1.0, 1.0, 22)  # a colour bar of Matplotlib's would be a bitmap
        bar.pcolormesh(
            [0.0, 1.0], steps, 0.5 * (steps[1:] + steps[:-1])[:, None], cmap="RdBu_r", vmin=-1.0, vmax=1.0
        )
        bar.set_xticks([])
        bar.set_yticks([-1, 0, 1])
        bar.yaxis.tick_right()
        bar.grid(visible=False)
        for spine in bar.spines.values():
            spine.set_visible(False)
        figure.subplots_adjust(left=1.55 / width, right=1.0 - 0.7 / width, top=0.99, bottom=1.5 / height)
        return svg_of(figure, "Correlations of the numbers")


@contextmanager
def drawing_style() -> Iterator[None]:
    """Give the context in which every figure is drawn; letters that its font lacks are the browser's."""
    with mpl.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type]  # stubs list every key
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def _widened(ends: tuple[float, float]) -> tuple[float, float]:
    margin = 0.05 * (ends[1] - ends[0])
    return ends[0] - margin, ends[1] + margin


def svg_of(figure: Figure, label: str) -> str:
    """Return the figure as an SVG element without header, dates and ids that nothing refers to."""
    buffer = io.StringIO()
    FigureCanvasSVG(figure).print_svg(  # type: ignore[no-untyped-call]
        buffer, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
    )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(?<=<g) id="[\w.]+"|(?<=<path) id="[\w.]+_\d+"', "", text)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"\n\s*\n+|\n\s+", "\n", text)
    # a hundredth of a point is less than anyone sees
    text = re.sub(r'(?<= )(d|x|y)="[^"]*"', lambda found: _DECIMALS.sub(r"\1", found[0]), text)
    said = re.sub(r"[^\w .,+-]", "_", label)  # an attribute: nothing in it may end it
    return text.replace("<svg", f'<svg role="img" aria-label="{said}"', 1)


def shortened(name: str, longest: int = 40) -> str:
    """Return a name cut in its middle where it is too long for a figure."""
    return name if len(name) <= longest else f"{name[: longest // 2]}...{name[-longest // 2 + 3 :]}"


def _plain_log_ticks(axes: Axes, low: float, high: float) -> None:
    """Label a log axis with plain numbers, 1-2-5."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [m * 10.0**d for d in decades for m in (1, 2, 5) if low <= m * 10.0**d <= high]
    if len(ticks) > 8:
        ticks = [t for t in ticks if abs(np.log10(t) - round(float(np.log10(t)))) < 1e-9]
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(ticks, [f"{t:g}" for t in ticks])
        axis.set_ticks([], minor=True)
