"""Figures of characteristics: peak-velocity-pick curves of one damper or of two laid over each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mrdamper.models.characteristics import PeakVelocityCurve
from mrdamper.report.figures.style import WIDE, colour_of, drawing_style, svg_of

__all__ = ["MeasuredPick", "PickPanel", "peak_velocity", "peak_velocity_figure"]

_STYLES: tuple[Literal["-"], Literal["--"]] = ("-", "--")


@dataclass(frozen=True, slots=True)
class MeasuredPick:
    """A measured peak-velocity pick: (velocity [m/s], extension [N], retraction [N]) at a command."""

    command: float
    velocity: float
    extension: float
    retraction: float
    split: str


@dataclass(frozen=True, slots=True, eq=False)
class PickPanel:
    """One temperature: the curves of each damper, and what was measured there."""

    title: str
    dampers: tuple[tuple[PeakVelocityCurve, ...], ...]
    measured: tuple[MeasuredPick, ...] = ()


def peak_velocity(panels: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> str:
    """Return ``peak_velocity_figure`` as SVG."""
    with drawing_style():
        return svg_of(peak_velocity_figure(panels, command_unit, names), "Peak-velocity-pick curves")


def peak_velocity_figure(panels: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> Figure:
    """Return force over peak velocity, a panel for each temperature, coloured by command.

    Extension is above zero, retraction below. The second of two dampers is dashed; ``names`` then tells them.
    """
    curves = [curve for panel in panels for damper in panel.dampers for curve in damper]
    highest = max(abs(curve.command) for curve in curves)
    forces = [force for curve in curves for force in (curve.extension, curve.retraction)]
    low, high = min(float(force.min()) for force in forces), max(float(force.max()) for force in forces)
    fastest = 1e3 * max(float(curve.velocity.max()) for curve in curves)
    height = 3.3
    width = WIDE if len(panels) > 1 else 5.4
    commands = sorted({curve.command for curve in curves}, reverse=True)
    figure = Figure(figsize=(width, height))
    for place, panel in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), place + 1)
        axes.axhline(0.0, color="#888888", linewidth=0.6)
        for style, damper in zip(_STYLES, panel.dampers, strict=False):
            for curve in damper:
                colour = colour_of(curve.command, highest)
                for force in (curve.extension, curve.retraction):
                    axes.plot(1e3 * curve.velocity, force, linestyle=style, color=colour, linewidth=1.2)
        for pick in panel.measured:
            colour = colour_of(pick.command, highest)
            axes.plot(
                [1e3 * pick.velocity] * 2,
                [pick.extension, pick.retraction],
                "o",
                markersize=3.8,
                color=colour,
                markerfacecolor=colour if pick.split == "training" else "white",
                markeredgewidth=0.9,
            )
        axes.set_title(panel.title, loc="left", pad=3)
        axes.set_xlim(0.0, 1.03 * fastest)
        axes.set_ylim(1.06 * min(low, 0.0), 1.06 * high)
        axes.locator_params(nbins=6)
        axes.set_xlabel("peak velocity, mm/s", labelpad=1.5)
        if place:
            axes.tick_params(axis="y", labelleft=False)
        else:
            axes.set_ylabel("force, N", labelpad=1.0)
    keys = [Line2D([], [], color=colour_of(c, highest), linewidth=1.4) for c in commands]
    labels = [f"{command:g} {command_unit}" for command in commands]
    if names:
        keys += [Line2D([], [], color="#555555", linewidth=1.2, linestyle=style) for style in _STYLES]
        labels += list(names)
    figure.legend(keys, labels, loc="center right", bbox_to_anchor=(1.0, 0.55))
    figure.subplots_adjust(
        left=0.62 / width,
        right=1.0 - (0.8 + (0.3 if names else 0.0)) / width,
        top=0.93,
        bottom=0.13,
        wspace=0.05,
    )
    return figure
