"""Figures of ``mrdamper sink``: the front of temperature against mass, and the paper's sweeps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrdamper.app.plots import HELD_OUT, INK, MEASURED, TRAINING, WIDE, drawing_style, svg_of
from mrdamper.thermal.design import SinkDesign
from mrdamper.thermal.efficiency import DEFAULT_EFFICIENCY, EFFICIENCIES, Sweep

__all__ = ["draw_front", "draw_sweeps"]

_ZERO_CELSIUS_K = 273.15
_FOLLOWS, _OTHER = HELD_OUT, "#a9a9a9"


def draw_front(
    whole: Sequence[SinkDesign], shown: Sequence[SinkDesign], reference: SinkDesign, limit_K: float
) -> str:
    """Return temperature over mass: the network's whole front, its members judged again, and the reference."""
    with drawing_style():
        figure = Figure(figsize=(WIDE, 3.9))
        axes = figure.add_subplot()
        axes.step(
            [1e3 * d.mass for d in whole],
            [d.network_fluid - _ZERO_CELSIUS_K for d in whole],
            where="post",
            color=MEASURED,
            linewidth=1.4,
            label="front, zone network",
        )
        model = "finite elements" if shown[0].model == "finite_element" else "zone network"
        axes.plot(
            [1e3 * d.mass for d in shown],
            [d.fluid - _ZERO_CELSIUS_K for d in shown],
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
                (1e3 * design.mass, design.fluid - _ZERO_CELSIUS_K),
                (5, 4) if place % 2 == 0 else (-5, -9),
                textcoords="offset points",
                fontsize=6.2,
                ha="left" if place % 2 == 0 else "right",
                color="#555555",
            )
        called = "reference" if reference.sink is not None else "bare"
        axes.plot(
            [1e3 * reference.mass],
            [reference.fluid - _ZERO_CELSIUS_K],
            "D",
            color=HELD_OUT,
            markersize=5.0,
            label=f"{called}, {reference.fluid - _ZERO_CELSIUS_K:.1f} °C",
        )
        if limit_K < max(d.fluid for d in (*shown, reference)):
            axes.axhline(
                limit_K - _ZERO_CELSIUS_K,
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
        return svg_of(figure, "Front of temperature against mass")


def draw_sweeps(sweeps: Sequence[Sweep]) -> str:
    """Return the paper's sweeps: temperatures, and every candidate's efficiency over its own greatest value."""
    labels = ("fin width, mm (three fins)", "number of fins (23 mm wide)")
    both = [name for name in EFFICIENCIES if all(sweep.follows_paper(name) for sweep in sweeps)]
    with drawing_style():
        figure = Figure(figsize=(WIDE, 5.0))
        for column, (sweep, label) in enumerate(zip(sweeps, labels, strict=True)):
            x = [1e3 * e.sink.width if sweep.of == "width" else float(e.sink.fins) for e in sweep.effects]
            upper, lower = figure.add_subplot(2, 2, column + 1), figure.add_subplot(2, 2, column + 3)
            upper.plot(
                x,
                [e.finned - _ZERO_CELSIUS_K for e in sweep.effects],
                "o-",
                color=INK,
                markersize=3.6,
                linewidth=1.1,
            )
            upper.set_title("Fluid at the end, °C", loc="left", pad=3)
            ends: list[tuple[float, str, str]] = []
            for name, values in sweep.values.items():
                relative = 100.0 * values / values.max()
                follows = name in both
                colour = _FOLLOWS if follows else _OTHER
                lower.plot(
                    x,
                    relative,
                    "o-",
                    color=colour,
                    markersize=3.2 if follows else 2.2,
                    linewidth=1.6 if name == DEFAULT_EFFICIENCY else 0.9,
                    zorder=3 if follows else 2,
                )
                ends.append((float(relative[-1]), EFFICIENCIES[name].symbol, colour))
            lower.set_title("Efficiency, % of its greatest value", loc="left", pad=3)
            span = lower.get_ylim()
            for y, symbol, colour in _apart(ends, 0.052 * (span[1] - span[0])):
                lower.annotate(
                    symbol,
                    (x[-1], y),
                    (6, -2),
                    textcoords="offset points",
                    fontsize=6.5,
                    color=colour,
                    annotation_clip=False,
                )
            for axes in (upper, lower):
                axes.set_xticks(x)
                axes.set_xlim(x[0] - 0.06 * (x[-1] - x[0]), x[-1] + 0.03 * (x[-1] - x[0]))
            lower.set_xlabel(label, labelpad=1.5)
        figure.subplots_adjust(left=0.05, right=0.965, top=0.955, bottom=0.085, wspace=0.14, hspace=0.24)
        return svg_of(figure, "The paper's sweeps")


def _apart(ends: Sequence[tuple[float, str, str]], least: float) -> list[tuple[float, str, str]]:
    """Return labels at their lines' ends, moved so that none covers another."""
    ordered = sorted(ends, key=lambda end: end[0])
    heights = np.array([end[0] for end in ordered])
    for k in range(1, len(heights)):
        heights[k] = max(heights[k], heights[k - 1] + least)
    heights -= max(0.0, heights[-1] - ordered[-1][0]) * 0.5
    return [(float(y), symbol, colour) for y, (_, symbol, colour) in zip(heights, ordered, strict=True)]
