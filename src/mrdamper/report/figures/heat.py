"""Figures of ``mrdamper heat``: temperatures [degC], heat flows [W] and peak force [N] versus time [min]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.style import HELD_OUT, INK, TRAINING, WIDTH_INCH, drawing_style, svg_of
from mrdamper.thermal.estimation.interval import PredictionInterval
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.temperature_rise import Rise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LIMIT_COLOUR = "#a03020"
_PARTS = (("fluid", HELD_OUT, 1.6), ("coil", "#b08a3c", 1.1), ("wall", TRAINING, 1.1))
_PATH_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "stored": "#d9d5cc",
        "body convection": "#5b86a8",
        "body radiation": "#a8c3d6",
        "fin convection": "#8a6f9e",
        "fin radiation": "#c3b3cf",
        "mount": "#8c9a6b",
    }
)


def temperature_figure(
    rises: Sequence[tuple[str, Rise]],
    prediction_intervals: Sequence[PredictionInterval] = (),
    measured: HeatingCurve | None = None,
) -> Figure:
    """Return fluid, coil and wall temperature versus time, a panel for each (title, rise), with the limit.

    ``prediction_intervals``, one for each rise or none, are bands of the fluid temperature. The curve
    ``measured`` belongs to the first panel.
    """
    limit = rises[0][1].limit_K - ZERO_CELSIUS_K
    hottest = max(
        max(float(getattr(rise, f"{name}_degC").max()) for name, _, _ in _PARTS) for _, rise in rises
    )
    coolest = min(float(rise.wall_degC.min()) for _, rise in rises)
    longest = max(
        _panel_end(rise, prediction_intervals[k] if prediction_intervals else None)
        for k, (_, rise) in enumerate(rises)
    )
    high = max(hottest, limit) + max(0.08 * (max(hottest, limit) - coolest), 1.0)
    with drawing_style():
        width, height = WIDTH_INCH if len(rises) > 1 else 6.4, 3.1
        figure = Figure(figsize=(width, height))
        for place, (title, rise) in enumerate(rises):
            axes = figure.add_subplot(1, len(rises), place + 1)
            axes.set_xlim(0.0, max(longest, 1e-9))
            axes.set_ylim(coolest - 0.03 * (high - coolest), high)
            axes.set_title(title, loc="left", pad=4)
            axes.set_xlabel("minutes", labelpad=1.5)
            if place:
                axes.tick_params(axis="y", labelleft=False)
            else:
                axes.set_ylabel("temperature, °C", labelpad=1.5)
            _draw_parts(axes, rise)
            if measured is not None and place == 0:
                _draw_measured(axes, measured)
            if prediction_intervals:
                _draw_outlook(axes, rise, prediction_intervals[place])
            _draw_limit(axes, rise, prediction_intervals[place] if prediction_intervals else None)
            axes.legend(loc="lower right", title="at the end", title_fontsize=6.5)
        figure.subplots_adjust(left=0.5 / width, right=1.0 - 0.12 / width, top=0.92, bottom=0.13, wspace=0.05)
    return figure


def _panel_end(rise: Rise, prediction_interval: PredictionInterval | None) -> float:
    """Return the end of a panel [min]: the end of the curve, or the upper bound of the time to the limit."""
    end = float(rise.time[-1])
    if prediction_interval is not None and rise.time_to_limit_s is not None:
        end = max(end, min(1.05 * prediction_interval.to_limit.high_s, float(prediction_interval.time[-1])))
    return end / 60.0


def _draw_parts(axes: Axes, rise: Rise) -> None:
    for name, colour, line in _PARTS:
        celsius = getattr(rise, f"{name}_degC")
        label = f"{name} {celsius[-1]:.1f} °C"
        axes.plot(rise.time / 60.0, celsius, color=colour, linewidth=line, label=label)


def _draw_measured(axes: Axes, measured: HeatingCurve) -> None:
    celsius = measured.temperature - ZERO_CELSIUS_K
    label = f"{measured.place}, measured"
    axes.plot(measured.time / 60.0, celsius, ".", color=INK, markersize=1.5, alpha=0.5, label=label, zorder=1)


def _draw_outlook(axes: Axes, rise: Rise, prediction_interval: PredictionInterval) -> None:
    """Draw the interval of the fluid temperature. The legend gives its final values."""
    below, above = prediction_interval.low - ZERO_CELSIUS_K, prediction_interval.high - ZERO_CELSIUS_K
    low, high = (float(np.interp(rise.time[-1], prediction_interval.time, edge)) for edge in (below, above))
    label = f"fluid {low:.0f} to {high:.0f} °C with {100.0 * prediction_interval.probability:.0f} %"
    axes.fill_between(
        prediction_interval.time / 60.0,
        below,
        above,
        color=HELD_OUT,
        alpha=0.16,
        linewidth=0,
        label=label,
        zorder=0,
    )


def _draw_limit(axes: Axes, rise: Rise, prediction_interval: PredictionInterval | None) -> None:
    """Draw the limit of the fluid, the time to the limit, and the interval of this time as a thick line."""
    limit, longest = rise.limit_K - ZERO_CELSIUS_K, axes.get_xlim()[1]

    def annotate(text: str, at: tuple[float, float], shift: tuple[float, float], align: str = "left") -> None:
        axes.annotate(
            text, at, shift, textcoords="offset points", fontsize=6.5, color=_LIMIT_COLOUR, ha=align
        )

    axes.axhline(limit, color=_LIMIT_COLOUR, linewidth=0.8, linestyle=(0, (5, 2)))
    annotate(f"fluid's limit, {limit:.4g} °C", (0.01 * longest, limit), (0, 2))
    if prediction_interval is not None and np.isfinite(prediction_interval.to_limit.low_s):
        ends = [
            prediction_interval.to_limit.low_s / 60.0,
            min(prediction_interval.to_limit.high_s / 60.0, longest),
        ]
        axes.plot(ends, [limit, limit], color=_LIMIT_COLOUR, linewidth=2.4, solid_capstyle="butt")
    if rise.time_to_limit_s is not None:
        reached = rise.time_to_limit_s / 60.0
        axes.plot([reached], [limit], "o", color=_LIMIT_COLOUR, markersize=3.6)
        align = "left" if reached < 0.9 * longest else "right"
        annotate(f"{reached:.1f} min", (reached, limit), (4, -9), align)


def draw_paths(rises: Sequence[tuple[str, Rise]]) -> str:
    """Return the heat flows versus time, stacked, with the stored heat on top, one panel for each rise."""
    most = max(float((rise.mechanical_W + rise.coil_W).max()) for _, rise in rises)
    longest = max(float(rise.time[-1]) for _, rise in rises) / 60.0
    named = [
        name for name in ("stored", *PATHS) if name == "stored" or any(name in r.paths_W for _, r in rises)
    ]
    with drawing_style():
        width, height = WIDTH_INCH if len(rises) > 1 else 6.4, 3.2
        figure = Figure(figsize=(width, height))
        axes = None
        for place, (title, rise) in enumerate(rises):
            axes = figure.add_subplot(1, len(rises), place + 1)
            _stack(axes, rise, named)
            axes.set_xlim(0.0, max(longest, 1e-9))
            axes.set_ylim(0.0, 1.08 * max(most, 1e-9))
            axes.set_title(title, loc="left", pad=4)
            axes.set_xlabel("minutes", labelpad=1.5)
            if place:
                axes.tick_params(axis="y", labelleft=False)
            else:
                axes.set_ylabel("heat, W", labelpad=1.5)
        if axes is not None:
            handles, labels = axes.get_legend_handles_labels()
            figure.legend(handles[::-1], labels[::-1], loc="center right", bbox_to_anchor=(1.0, 0.55))
        figure.subplots_adjust(left=0.5 / width, right=1.0 - 1.45 / width, top=0.92, bottom=0.14, wspace=0.05)
        return svg_of(figure, "Heat flows")


def _stack(axes: Axes, rise: Rise, named: Sequence[str]) -> None:
    """Draw the heat flows. The difference between input and output is stored."""
    minutes, going_in = rise.time / 60.0, rise.mechanical_W + rise.coil_W
    given_off = np.sum(list(rise.paths_W.values()), axis=0) if rise.paths_W else np.zeros_like(going_in)
    shares = {"stored": going_in - given_off, **rise.paths_W}
    # The line between output at the bottom and stored heat on top is the total output.
    order = [*(name for name in named if name != "stored"), "stored"]
    base = np.zeros_like(going_in)
    for name in order:
        share = shares.get(name, np.zeros_like(going_in))
        axes.fill_between(
            minutes, base, base + share, color=_PATH_COLOURS[name], linewidth=0, label=name, zorder=2
        )
        base = base + share
    axes.plot(minutes, going_in, color=INK, linewidth=1.2, label="going in", zorder=3)
    axes.plot(
        minutes,
        rise.mechanical_W,
        color=INK,
        linewidth=0.8,
        linestyle=(0, (4, 2)),
        label="mechanical part of the input",
        zorder=3,
    )


def draw_fade(rises: Sequence[tuple[str, Rise]]) -> str:
    """Return the peak force of a cycle versus time and fluid temperature, or "" without motion."""
    moving = [(title, rise) for title, rise in rises if np.isfinite(rise.peak_force_N).any()]
    if not moving:
        return ""
    styles = ("-", (0, (4, 2)))
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.6))
        left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
        for (title, rise), style in zip(moving, styles, strict=False):
            loss = rise.force_loss_percent
            label = title if loss is None else f"{title}: loss {loss:.1f} % at the end"
            for axes, x in ((left, rise.time / 60.0), (right, rise.fluid_degC)):
                axes.plot(
                    x,
                    rise.peak_force_N,
                    color=HELD_OUT if style == "-" else INK,
                    linestyle=style,
                    linewidth=1.3,
                    label=label,
                )
        for axes, word in ((left, "minutes"), (right, "fluid, °C")):
            axes.set_ylim(bottom=0.0)
            axes.set_xlabel(word, labelpad=1.5)
        left.set_xlim(left=0.0)
        left.set_ylabel("peak force of the cycle, N", labelpad=1.5)
        right.tick_params(axis="y", labelleft=False)
        left.legend(loc="lower left")
        figure.subplots_adjust(left=0.055, right=0.99, top=0.97, bottom=0.16, wspace=0.06)
        return svg_of(figure, "Peak force versus time and temperature")
