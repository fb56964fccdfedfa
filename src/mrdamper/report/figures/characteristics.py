"""Figures of characteristics: peak-velocity-pick curves of one damper or of two laid over each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrdamper.models.characteristics import PeakVelocityCurve
from mrdamper.report.figures.palette import WIDE, colour_of
from mrdamper.report.figures.sheet import Key, Points, Sheet

_STYLES = ("-", "--")


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
    """Return ``peak_velocity_sheet`` as SVG."""
    return peak_velocity_sheet(panels, command_unit, names).svg("Peak-velocity-pick curves")


def peak_velocity_sheet(panels: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> Sheet:
    """Return force over peak velocity, a panel for each temperature, coloured by command.

    Extension is above zero, retraction below. The second of two dampers is dashed; ``names`` then tells them.
    """
    curves = [curve for panel in panels for damper in panel.dampers for curve in damper]
    highest = max(abs(curve.command) for curve in curves)
    forces = [force for curve in curves for force in (curve.extension, curve.retraction)]
    low, high = min(float(force.min()) for force in forces), max(float(force.max()) for force in forces)
    fastest = 1e3 * max(float(curve.velocity.max()) for curve in curves)
    width = WIDE if len(panels) > 1 else 5.4
    commands = sorted({curve.command for curve in curves}, reverse=True)
    sheet = Sheet(width, 3.3)
    right = 1.0 - (0.8 + (0.3 if names else 0.0)) / width
    table = sheet.table(1, len(panels), left=0.62 / width, right=right, top=0.93, bottom=0.13, wspace=0.05)
    for place, (axes, panel) in enumerate(zip(table, panels, strict=True)):
        axes.x_ends, axes.y_ends = (0.0, 1.03 * fastest), (1.06 * min(low, 0.0), 1.06 * high)
        axes.level(0.0)
        for style, damper in zip(_STYLES, panel.dampers, strict=False):
            for curve in damper:
                for force in (curve.extension, curve.retraction):
                    axes.line(1e3 * curve.velocity, force, colour_of(curve.command, highest), 1.2, style)
        for pick in panel.measured:
            x, y = [1e3 * pick.velocity] * 2, [pick.extension, pick.retraction]
            face = "" if pick.split == "training" else "white"
            axes.marks.append(Points(x, y, colour_of(pick.command, highest), 3.8, face))
        axes.title, axes.x_label, axes.few = panel.title, "peak velocity, mm/s", 6
        axes.y_named, axes.y_label = not place, "" if place else "force, N"
    sheet.keys = [Key(f"{command:g} {command_unit}", colour_of(command, highest)) for command in commands]
    if names:
        sheet.keys += [Key(name, "#555555", style) for name, style in zip(names, _STYLES, strict=True)]
    return sheet
