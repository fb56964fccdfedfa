"""Figures of characteristics: force versus peak velocity of one damper, or of two for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from mrdamper.models.characteristics import PeakVelocityCurve
from mrdamper.report.figures.palette import WIDTH_INCH, colour_of
from mrdamper.report.figures.style import add_legend, axes_table, svg_drawn_by

LINE_STYLES = ("-", "--")


@dataclass(frozen=True, slots=True)
class MeasuredPick:
    """A measured force at peak velocity: (velocity [m/s], extension [N], retraction [N]) at a current."""

    command: float
    velocity: float
    extension: float
    retraction: float
    split: str


@dataclass(frozen=True, slots=True, eq=False)
class PickPanel:
    """The curves of each damper and the measured points at one temperature."""

    title: str
    dampers: tuple[tuple[PeakVelocityCurve, ...], ...]
    measured: tuple[MeasuredPick, ...] = ()


def peak_velocity(panels: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> str:
    """Return ``peak_velocity_figure`` as SVG."""
    return svg_drawn_by(
        lambda: peak_velocity_figure(panels, command_unit, names), "Peak-velocity-pick curves"
    )


def peak_velocity_figure(panels: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> Figure:
    """Return force versus peak velocity, a panel for each temperature, coloured by current.

    Extension is above zero, retraction below. The second of two dampers is dashed; the
    legend shows their ``names``.
    """
    curves = [curve for panel in panels for damper in panel.dampers for curve in damper]
    highest = max(abs(curve.command) for curve in curves)
    fastest = 1e3 * max(float(curve.velocity.max()) for curve in curves)
    figure = Figure(figsize=(WIDTH_INCH if len(panels) > 1 else 5.4, 3.3))
    margins = (0.62, 0.43, 1.1 if names else 0.8, 0.23)
    table = axes_table(figure, 1, len(panels), margins=margins, gaps=(0.12, 0.0), share_y=True)
    for axes, panel in zip(table, panels, strict=True):
        axes.axhline(0.0, color="#888888", lw=0.6)
        for style, damper in zip(LINE_STYLES, panel.dampers, strict=False):
            for curve in damper:
                for force in (curve.extension, curve.retraction):
                    colour = colour_of(curve.command, highest)
                    axes.plot(1e3 * curve.velocity, force, color=colour, lw=1.2, ls=style)
        for pick in panel.measured:
            x, y = [1e3 * pick.velocity] * 2, [pick.extension, pick.retraction]
            colour = colour_of(pick.command, highest)
            face = colour if pick.split == "training" else "white"
            axes.plot(x, y, "o", ms=3.8, mec=colour, mfc=face, mew=0.9)
        axes.set(title=panel.title, xlabel="peak velocity, mm/s", xlim=(0.0, 1.03 * fastest))
        axes.locator_params(nbins=6)
    table[0].set_ylabel("force, N")
    commands = sorted({curve.command for curve in curves}, reverse=True)
    entries = [(f"{command:g} {command_unit}", colour_of(command, highest), "-") for command in commands]
    if names:
        entries += [(name, "#555555", style) for name, style in zip(names, LINE_STYLES, strict=True)]
    add_legend(figure, entries)
    return figure
