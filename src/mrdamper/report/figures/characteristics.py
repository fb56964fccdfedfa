"""Figures of characteristics: force versus peak velocity of one damper, or of two for comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from mrdamper.models.card import ModelCard
from mrdamper.models.characteristics import PeakVelocityCurve, characterise, default_scope
from mrdamper.quantities import to_degC
from mrdamper.report.figures.small_multiples import Line, Panel, Point, panel_figure
from mrdamper.report.figures.style import INK, colour_of

LINE_STYLES = ("-", "--")


@dataclass(frozen=True, slots=True, eq=False)
class PickPanel:
    """Content of a plot of force [N] versus peak velocity [mm/s] at one temperature.

    ``dampers`` contains the curves of each damper, ``measured`` the measured points by current.
    """

    title: str
    dampers: Sequence[Sequence[PeakVelocityCurve]]
    measured: Mapping[float, Sequence[Point]] = field(default_factory=dict)


def peak_velocity_figure(drawn: Sequence[PickPanel], command_unit: str, names: Sequence[str] = ()) -> Figure:
    """Return a figure of force versus peak velocity of one or two dampers.

    There is a panel for each temperature and a colour for each current. Forces in extension are positive,
    forces in retraction negative. Curves of a second damper are dashed, and a legend shows the ``names`` of
    the dampers.
    """
    highest = max(abs(curve.command) for each in drawn for damper in each.dampers for curve in damper)

    def lines(panel: PickPanel) -> list[Line]:
        found = [
            Line([], [], INK, name, style=style) for name, style in zip(names, LINE_STYLES, strict=False)
        ]
        for style, damper in zip(LINE_STYLES, panel.dampers, strict=False):
            for curve in sorted(damper, key=lambda curve: -curve.command):
                colour, speed = colour_of(curve.command, highest), 1e3 * curve.velocity
                label = f"{curve.command:g} {command_unit}" if style == "-" else ""
                points = panel.measured.get(curve.command, ()) if style == "-" else ()
                found += [
                    Line(speed, curve.extension, colour, label, style=style, points=points),
                    Line(speed, curve.retraction, colour, style=style),
                ]
        return found

    return panel_figure(
        [
            Panel(each.title, "peak velocity, mm/s", lines(each), y_label="" if k else "force, N")
            for k, each in enumerate(drawn)
        ],
        len(drawn),
        height=2.4,
        share="all",
        legend="",
    )


def card_figure(card: ModelCard) -> Figure:
    """Return a figure of force versus peak velocity of a model card."""
    scope = default_scope(card.damper, card.envelope)
    found = characterise(card.damper, scope)
    panels = [
        PickPanel("" if kelvin is None else f"{to_degC(kelvin):.0f} °C", (curves,))
        for kelvin, curves in zip(scope.temperatures, found.curves, strict=True)
    ]
    return peak_velocity_figure(panels, card.damper.command_unit)
