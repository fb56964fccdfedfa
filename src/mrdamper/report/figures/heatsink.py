"""Figures of ``heatsink``: Pareto front of temperature and mass, and parameter studies of the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.style import HELD_OUT, INK, MEASURED, TRAINING, WIDTH_INCH, drawing_style, svg_of
from mrdamper.thermal.sinks.efficiency import Sweep


def draw_sweeps(run: HeatsinkResult) -> str:
    """Return the parameter studies of the paper as SVG, or an empty string."""
    return "" if run.sweeps is None else _draw_sweeps(run.sweeps)


def front_figure(run: HeatsinkResult) -> Figure:
    """Return temperature versus mass: front of the network, designs evaluated again, and reference."""
    whole, shown, reference = run.found.designs, run.front, run.reference
    limit_K = run.drawing.filling.valid_K[1]
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 3.9))
        axes = figure.add_subplot()
        axes.step(
            [1e3 * d.mass for d in whole],
            [d.network_fluid - ZERO_CELSIUS_K for d in whole],
            where="post",
            color=MEASURED,
            linewidth=1.4,
            label="front, zone network",
        )
        model = "finite elements" if shown[0].model == "finite_element" else "zone network"
        axes.plot(
            [1e3 * d.mass for d in shown],
            [d.fluid - ZERO_CELSIUS_K for d in shown],
            "o",
            color=TRAINING,
            markersize=4.2,
            label=f"members of the front, {model}",
        )
        for place, design in enumerate(shown):
            sink = design.sink
            if sink is None:
                continue
            words = f"{sink.fins} × {1e3 * sink.width:.3g} × {1e3 * sink.thickness:.2g}"
            axes.annotate(
                words,
                (1e3 * design.mass, design.fluid - ZERO_CELSIUS_K),
                (5, 4) if place % 2 == 0 else (-5, -9),
                textcoords="offset points",
                fontsize=6.2,
                ha="left" if place % 2 == 0 else "right",
                color="#555555",
            )
        called = "reference" if reference.sink is not None else "bare"
        axes.plot(
            [1e3 * reference.mass],
            [reference.fluid - ZERO_CELSIUS_K],
            "D",
            color=HELD_OUT,
            markersize=5.0,
            label=f"{called}, {reference.fluid - ZERO_CELSIUS_K:.1f} °C",
        )
        if limit_K < max(d.fluid for d in (*shown, reference)):
            axes.axhline(
                limit_K - ZERO_CELSIUS_K,
                color="#a03020",
                linewidth=0.8,
                linestyle=(0, (5, 2)),
                label="fluid's limit",
            )
        axes.set_xlim(left=0.0)
        axes.margins(x=0.06, y=0.08)
        axes.set_xlabel("mass of the fins, g (labels: fins × width × thickness, mm)", labelpad=1.5)
        axes.set_ylabel("fluid at the end, °C", labelpad=1.5)
        axes.legend(loc="upper right")
        figure.subplots_adjust(left=0.055, right=0.985, top=0.97, bottom=0.115)
    return figure


def _draw_sweeps(sweeps: tuple[Sweep, Sweep]) -> str:
    """Return temperature and efficiency in both parameter studies of the paper."""
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.6))
        for place, (sweep, label) in enumerate(zip(sweeps, ("width, mm", "fins"), strict=True)):
            sinks = [effect.sink for effect in sweep.effects]
            x = [1e3 * sink.width if place == 0 else float(sink.fins) for sink in sinks]
            degrees = np.array([effect.finned for effect in sweep.effects]) - ZERO_CELSIUS_K
            for column, (title, values) in enumerate(
                (("fluid, °C", degrees), ("efficiency, %", 100.0 * sweep.efficiency))
            ):
                axes = figure.add_subplot(1, 4, 2 * place + column + 1)
                axes.plot(x, values, "o-", color=HELD_OUT if column else INK, markersize=2.6)
                axes.set_title(title, loc="left", pad=2)
                axes.set_xticks(x, [f"{at:g}" for at in x])
                axes.set_xlabel(label, labelpad=1.0)
        figure.subplots_adjust(left=0.04, right=0.99, top=0.9, bottom=0.17, wspace=0.25)
        return svg_of(figure, "Parameter studies of the paper")
