"""Figures of the commands ``heat`` and ``heatsink``.

The figures of ``heat`` show temperatures [degC], heat flows [W] and peak force [N] versus time [min]. The
figures of ``heatsink`` show fluid temperature versus mass of heat sinks, and the parameter studies of the
reference paper.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import (
    DASHED,
    HELD_OUT,
    INK,
    LEGEND_INCH,
    LIMIT,
    MEASURED,
    SERIES,
    TRAINING,
    WIDTH_INCH,
    panels,
)
from mrdamper.thermal.estimation.interval import PredictionInterval
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.sinks.effects import Sweep
from mrdamper.thermal.temperature_rise import Rise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PARTS = (("fluid", HELD_OUT, 1.6), ("coil", SERIES[1], 1.1), ("wall", TRAINING, 1.1))
_PATH_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "body convection": "#5b86a8",
        "body radiation": "#a8c3d6",
        "fin convection": "#8a6f9e",
        "fin radiation": "#c3b3cf",
        "mount": "#8c9a6b",
        "stored": "#d9d5cc",
    }
)


def front_figure(run: HeatsinkResult) -> Figure:
    """Return a figure of fluid temperature versus mass of the fins, with Pareto front."""
    whole, shown, reference = run.found.designs, run.front, run.reference
    limit_K = run.drawing.filling.valid_K[1]
    figure = Figure(figsize=(WIDTH_INCH, 3.9))
    axes = figure.add_axes((0.055, 0.115, 0.93, 0.855))
    mass, fluid = ([1e3 * d.mass for d in whole], [d.network_fluid - ZERO_CELSIUS_K for d in whole])
    axes.step(mass, fluid, where="post", color=MEASURED, lw=1.4, label="front, zone network")
    model = "finite elements" if shown[0].model == "finite_element" else "zone network"
    mass, fluid = [1e3 * d.mass for d in shown], [d.fluid - ZERO_CELSIUS_K for d in shown]
    axes.plot(mass, fluid, "o", color=TRAINING, label=f"members of the front, {model}")
    for place, design in enumerate(shown):
        if (sink := design.sink) is not None:
            axes.annotate(
                f"{sink.fins} × {1e3 * sink.width:.3g} × {1e3 * sink.thickness:.2g}",
                (mass[place], fluid[place]),
                (-5, -9) if place % 2 else (5, 4),
                textcoords="offset points",
                fontsize=6.2,
                ha="right" if place % 2 else "left",
                color="#555555",
            )
    hot = reference.fluid - ZERO_CELSIUS_K
    label = f"{'bare' if reference.sink is None else 'reference'}, {hot:.1f} °C"
    axes.plot([1e3 * reference.mass], [hot], "D", color=HELD_OUT, ms=5.0, label=label)
    if limit_K < max(d.fluid for d in (*shown, reference)):
        axes.axhline(limit_K - ZERO_CELSIUS_K, color=LIMIT, lw=0.8, ls=DASHED, label="fluid's limit")
    axes.set_xlim(left=0.0)
    axes.margins(x=0.06, y=0.08)
    axes.set(xlabel="mass of the fins, g (labels: fins × width × thickness, mm)")
    axes.set_ylabel("fluid at the end, °C")
    axes.legend(loc="upper right")
    return figure


def sweeps_figure(sweeps: tuple[Sweep, Sweep]) -> Figure:
    """Return a figure of both parameter studies of the reference paper."""
    drawn = []
    for sweep, label in zip(sweeps, ("width, mm", "fins"), strict=True):
        sinks = [effect.sink for effect in sweep.effects]
        x = [1e3 * sink.width if label == "width, mm" else float(sink.fins) for sink in sinks]
        degrees = np.array([effect.finned for effect in sweep.effects]) - ZERO_CELSIUS_K
        drawn += [
            Panel("fluid, °C", label, [Line(x, degrees, INK, style=".-")]),
            Panel("efficiency, %", label, [Line(x, 100.0 * sweep.efficiency, HELD_OUT, style=".-")]),
        ]
    return panel_figure(drawn, height=1.9)


Rises = Sequence[tuple[str, Rise]]


def temperature_figure(
    rises: Rises, intervals: Sequence[PredictionInterval] = (), measured: HeatingCurve | None = None
) -> Figure:
    """Return a figure of fluid, coil and wall temperature versus time, one panel for each simulation.

    Each panel also has the temperature limit of the fluid. ``intervals`` is empty or has the interval of
    the fluid temperature of each simulation. The curve ``measured`` is drawn in the first panel.
    """
    drawn: list[Panel] = []
    for (title, rise), interval in zip_longest(rises, intervals):
        lines = [] if interval is None else [_outlook(rise, interval)]
        if measured is not None and not drawn:
            label, celsius = f"{measured.place}, measured", measured.temperature - ZERO_CELSIUS_K
            lines.append(Line(measured.time / 60.0, celsius, "#888888", label, style=","))
        for name, colour, width in _PARTS:
            celsius = getattr(rise, f"{name}_degC")
            label = f"{name} {celsius[-1]:.1f} °C at the end"
            lines.append(Line(rise.time / 60.0, celsius, colour, label, width))
        drawn.append(Panel(title, "minutes", lines, y_label="" if drawn else "temperature, °C"))
    figure = panel_figure(drawn, height=2.45, share="all")
    ends = [_panel_end(rise, interval) for (_, rise), interval in zip_longest(rises, intervals)]
    coolest = min(float(rise.wall_degC.min()) for _, rise in rises)
    limit = rises[0][1].limit_K - ZERO_CELSIUS_K
    hottest = max(limit, *(getattr(rise, f"{name}_degC").max() for name, *_ in _PARTS for _, rise in rises))
    for axes, (_, rise), interval in zip_longest(figure.axes, rises, intervals):
        margin = max(0.08 * (hottest - coolest), 1.0)
        axes.set(xlim=(0.0, max(*ends, 1e-9)), ylim=(coolest - 0.3 * margin, hottest + margin))
        _draw_limit(axes, rise, interval)
        axes.legend(loc="lower right")
    return figure


def _panel_end(rise: Rise, interval: PredictionInterval | None) -> float:
    """Return the largest time [min] of the time axis."""
    end = float(rise.time[-1])
    if interval is not None and rise.time_to_limit_s is not None:
        end = max(end, min(1.05 * interval.to_limit.high_s, float(interval.time[-1])))
    return end / 60.0


def _outlook(rise: Rise, interval: PredictionInterval) -> Line:
    """Return the 90 % band of the fluid temperature. The legend has its final values."""
    below, above = interval.low - ZERO_CELSIUS_K, interval.high - ZERO_CELSIUS_K
    low, high = (float(np.interp(rise.time[-1], interval.time, edge)) for edge in (below, above))
    label = f"fluid {low:.0f} to {high:.0f} °C with {100.0 * interval.probability:.0f} %"
    time = interval.time / 60.0
    return Line(time, interval.median - ZERO_CELSIUS_K, HELD_OUT, label, 0.0, band=(below, above))


def _draw_limit(axes: Axes, rise: Rise, interval: PredictionInterval | None) -> None:
    """Draw the limit of the fluid temperature, the time to the limit, and the interval of this time."""
    limit, longest = rise.limit_K - ZERO_CELSIUS_K, axes.get_xlim()[1]

    def annotate(text: str, at: tuple[float, float], shift: tuple[float, float], align: str = "left") -> None:
        axes.annotate(text, at, shift, textcoords="offset points", fontsize=6.5, color=LIMIT, ha=align)

    axes.axhline(limit, color=LIMIT, lw=0.8, ls=DASHED)
    annotate(f"fluid's limit, {limit:.4g} °C", (0.01 * longest, limit), (0, 2))
    if interval is not None and np.isfinite(interval.to_limit.low_s):
        ends = [interval.to_limit.low_s / 60.0, min(interval.to_limit.high_s / 60.0, longest)]
        axes.plot(ends, [limit, limit], color=LIMIT, lw=2.4, solid_capstyle="butt")
    if rise.time_to_limit_s is not None:
        reached = rise.time_to_limit_s / 60.0
        axes.plot([reached], [limit], "o", color=LIMIT, ms=3.6)
        align = "left" if reached < 0.9 * longest else "right"
        annotate(f"{reached:.1f} min", (reached, limit), (4, -9), align)


def paths_figure(rises: Rises) -> Figure:
    """Return a figure of the heat flows versus time, stacked; one panel for each simulation.

    Heat flows to the surroundings are at the bottom, the heat flow into storage is on top.
    """
    figure, table = panels(len(rises), height=2.5, gap=0.12, right=LEGEND_INCH, share="all")
    used = {path for _, rise in rises for path in rise.paths_W}
    names = [name for name in (*PATHS, "stored") if name in used or name == "stored"]
    for axes, (title, rise) in zip(table, rises, strict=True):
        minutes, total = rise.time / 60.0, rise.mechanical_W + rise.coil_W
        flows = {"stored": total - sum(rise.paths_W.values()), **rise.paths_W}
        values = [flows.get(name, np.zeros_like(total)) for name in names]
        # The line below the stored heat is the total heat flow to the surroundings.
        axes.stackplot(minutes, values, colors=[_PATH_COLOURS[name] for name in names], labels=names, lw=0)
        axes.plot(minutes, total, color=INK, lw=1.2, label="going in")
        axes.plot(minutes, rise.mechanical_W, color=INK, lw=0.8, ls="--", label="mechanical part")
        axes.set(title=title, xlabel="minutes")
        axes.set_xlim(0.0, max(float(minutes[-1]), 1e-9))
    table[0].set_ylabel("heat, W")
    handles, labels = table[0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="center right")
    return figure


def fade_figure(rises: Rises) -> Figure | None:
    """Return a figure of the peak force of a cycle versus time and temperature; None without motion."""
    moving = [(title, rise) for title, rise in rises if np.isfinite(rise.peak_force_N).any()]
    if not moving:
        return None
    in_time, in_heat = [], []
    for (title, rise), colour in zip(moving, (HELD_OUT, INK), strict=False):
        loss = rise.force_loss_percent
        label = title if loss is None else f"{title}: loss {loss:.1f} % at the end"
        in_time.append(Line(rise.time / 60.0, rise.peak_force_N, colour, label))
        in_heat.append(Line(rise.fluid_degC, rise.peak_force_N, colour))
    return panel_figure(
        [
            Panel("", "minutes", in_time, y_label="peak force of the cycle, N"),
            Panel("", "fluid, °C", in_heat),
        ],
        height=1.9,
        share="all",
    )
