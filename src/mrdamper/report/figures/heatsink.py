"""Figures of ``mrdamper heatsink``: the front of temperature against mass, and the paper's sweeps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.style import HELD_OUT, INK, MEASURED, TRAINING, WIDE, drawing_style, svg_of
from mrdamper.thermal.sinks.efficiency import DEFAULT_EFFICIENCY, EFFICIENCIES, Sweep

_FOLLOWS, _OTHER = HELD_OUT, "#8a8a8a"


def draw_front(run: HeatsinkResult) -> str:
    """Return ``front_figure`` as SVG."""
    with drawing_style():
        return svg_of(front_figure(run), "Front of temperature against mass")


def draw_sweeps(run: HeatsinkResult) -> str:
    """Return the paper's sweeps; empty where there are none."""
    return "" if run.sweeps is None else _draw_sweeps(run.sweeps)


def draw_varied(run: HeatsinkResult) -> str:
    """Return the fluid over every number that was varied, a panel each; empty where there are none."""
    if not run.varied:
        return ""
    with drawing_style():
        figure = Figure(figsize=(WIDE, 2.6))
        for place, variation in enumerate(run.varied):
            axes = figure.add_subplot(1, len(run.varied), place + 1)
            for name, colour in (("bare", MEASURED), ("finned", TRAINING)):
                degrees = [getattr(effect, name) - ZERO_CELSIUS_K for effect in variation.effects]
                label = "without fins" if name == "bare" else "with the sink"
                axes.plot(variation.values, degrees, "o-", color=colour, markersize=3.0, label=label)
            axes.set_xlabel(variation.key, labelpad=1.5)
            axes.set_ylabel("fluid at the end, °C", labelpad=1.5)
            if place == 0:
                axes.legend(loc="best")
        figure.subplots_adjust(left=0.06, right=0.985, top=0.96, bottom=0.17, wspace=0.25)
        return svg_of(figure, "The drawing_s sink over its numbers")


def front_figure(run: HeatsinkResult) -> Figure:
    """Return temperature over mass: the network's front, its members judged again, the reference."""
    whole, shown, reference = run.found.designs, run.front, run.reference
    limit_K = run.drawing.filling.valid_K[1]
    with drawing_style():
        figure = Figure(figsize=(WIDE, 3.9))
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


def _draw_sweeps(sweeps: Sequence[Sweep]) -> str:
    """Return the paper's sweeps: the temperature, and every candidate's efficiency, a small panel each.

    What has the paper's trend is coloured; every panel has its own scale.
    """
    labels = ("width, mm", "fins")
    columns = 1 + len(EFFICIENCIES)
    with drawing_style():
        figure = Figure(figsize=(WIDE, 2.9))
        for row, (sweep, label) in enumerate(zip(sweeps, labels, strict=True)):
            x = [1e3 * e.sink.width if sweep.of == "width" else float(e.sink.fins) for e in sweep.effects]
            panels = [("fluid, °C", np.array([e.finned - ZERO_CELSIUS_K for e in sweep.effects]), INK)]
            for name, values in sweep.values.items():
                colour = _FOLLOWS if sweep.follows_paper(name) else _OTHER
                star = "*" if name == DEFAULT_EFFICIENCY else ""
                panels.append((EFFICIENCIES[name].symbol + star, values, colour))
            for column, (title, values, colour) in enumerate(panels):
                axes = figure.add_subplot(2, columns, row * columns + column + 1)
                axes.plot(x, values, "o-", color=colour, markersize=2.6, linewidth=1.2)
                axes.set_title(title, loc="left", pad=2, color=colour if colour == _FOLLOWS else INK)
                axes.set_xticks(x, [f"{at:g}" for at in x])
                axes.margins(x=0.14, y=0.16)
                axes.set_yticks([])
                axes.tick_params(axis="x", labelsize=5.6, pad=1.5, length=2)
                if column == 0:
                    axes.set_xlabel(label, labelpad=1.0, fontsize=6.5)
        figure.subplots_adjust(left=0.008, right=0.995, top=0.935, bottom=0.13, wspace=0.1, hspace=0.55)
        return svg_of(figure, "The paper's sweeps")
