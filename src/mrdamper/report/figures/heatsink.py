"""Figures of ``heatsink``: Pareto front of temperature and mass, and parameter studies of the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import DASHED, HELD_OUT, INK, LIMIT, MEASURED, TRAINING, WIDTH_INCH
from mrdamper.thermal.sinks.efficiency import Sweep


def front_figure(run: HeatsinkResult) -> Figure:
    """Return a figure of temperature versus mass: Pareto front, reference design, and displayed designs."""
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
    """Return a figure of temperature and efficiency in both parameter studies of the paper."""
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
