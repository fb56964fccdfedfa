"""Figure of a card: damping force versus peak velocity."""

from __future__ import annotations

from matplotlib.figure import Figure

from mrdamper.models.card import ModelCard
from mrdamper.models.characteristics import characterise, usual_scope
from mrdamper.quantities import to_degC
from mrdamper.report.figures.characteristics import PickPanel, peak_velocity_figure


def card_figure(card: ModelCard) -> Figure:
    """Return force versus peak velocity within the range of the card, a panel for each temperature."""
    scope = usual_scope(card.damper, card.envelope)
    found = characterise(card.damper, scope)
    panels = [
        PickPanel("" if kelvin is None else f"{to_degC(kelvin):.0f} °C", (curves,))
        for kelvin, curves in zip(scope.temperatures, found.curves, strict=True)
    ]
    return peak_velocity_figure(panels, card.damper.command_unit)
