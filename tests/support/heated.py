"""Compute the temperature rise of a card in a geometry as the job ``heat`` does."""

from __future__ import annotations

from dataclasses import replace

from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.temperature_rise import Model, Rise, notes_of, simulate_rise, works_of


def predict_rise(
    card: ModelCard | Damper,
    drawing: DamperDrawing,
    duty: Duty | str = DEFAULT_DUTY,
    *,
    model: Model = "reduced",
    stop_at_limit: bool = True,
    longest_step: float = 60.0,
) -> Rise:
    """Return the temperature rise of a damper from ambient temperature, with the notes of the card."""
    damper = card.damper if isinstance(card, ModelCard) else card
    plan = duty if isinstance(duty, Duty) else read_duty(duty)
    found = simulate_rise(
        works_of(damper, plan),
        drawing,
        plan,
        model=model,
        stop_at_limit=stop_at_limit,
        longest_step=longest_step,
    )
    return replace(found, notes=(*notes_of(card, plan), *found.notes))
