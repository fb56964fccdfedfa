"""Summarise a model card for a list, and check a card before a job starts.

The summary loads quickly because the JSON of the card is not validated. Only ``require_card`` validates a
card. Therefore only ``require_card`` imports the slow modules.
"""

from __future__ import annotations

import json
import math
from operator import itemgetter
from pathlib import Path
from typing import Any

from mrdamper.control.controllers import NAMES, names_for
from mrdamper.errors import InputError
from mrdamper.files import read_text
from mrdamper.quantities import ZERO_CELSIUS_K

_CARD = itemgetter(
    "title", "law", "command_unit", "actuation", "command_lag_s", "temperature_range_K", "notes"
)
_EVIDENCE = itemgetter("method", "runs", "cost", "converged", "held_out")
_ENVELOPE = itemgetter("command", "displacement_m", "velocity_m_s", "temperature_K")


def card_line(path: Path) -> dict[str, object]:
    """Return title, law, envelope and fit error of a card; ``error`` is the reason if the card is invalid."""
    card_bytes_max = 8_000_000
    row: dict[str, object] = dict.fromkeys(
        (
            *("title", "law", "method", "command_unit", "runs", "cost_percent", "converged"),
            *("held_out_percent", "tempered", "envelope", "error"),
        )
    )
    try:
        card: Any = json.loads(read_text(path, "card", card_bytes_max))
        envelope, evidence = card["envelope"], card["evidence"]
        title, law, unit, actuation, lag_s, warm, notes = _CARD(card)
        method, runs, cost, converged, held_out = _EVIDENCE(evidence)
        command, displacement, velocity, temperature = _ENVELOPE(envelope)
        travel_mm, speed_mm_s = (
            1e3 * min(-_number(low), _number(high)) for low, high in (displacement, velocity)
        )
        held_out = held_out.get("median_nrmse_percent")
        has_lag = actuation is not None or lag_s > 0.0
        return row | {
            "title": str(title),
            "law": str(law),
            "method": str(method),
            "command_unit": str(unit),
            "runs": len(runs),
            "cost_percent": _number(cost),
            "converged": bool(converged),
            "held_out_percent": None if held_out is None else _number(held_out),
            "tempered": warm is not None,
            "controllers": list(names_for(str(law), has_lag=has_lag)),
            "missing": _missing(str(law), has_lag=has_lag),
            "cancelled": "cancelled" in notes,
            "sine": _sine(travel_mm, speed_mm_s, _number(command[1]), str(unit)),
            "envelope": {
                "command": [_number(end) for end in command],
                "displacement_mm": [1e3 * _number(end) for end in displacement],
                "velocity_mm_s": [1e3 * _number(end) for end in velocity],
                "temperature_degC": None
                if temperature is None
                else [_number(end) - ZERO_CELSIUS_K for end in temperature],
            },
        }
    except (InputError, ValueError, RecursionError, LookupError, TypeError, AttributeError) as fault:
        return row | {"error": f"not a readable card ({type(fault).__name__})"}


def _missing(law: str, *, has_lag: bool) -> str:
    """Return a sentence that lists controllers unavailable for a card, with reasons."""
    known = names_for(law)
    banks = ", ".join(name for name in NAMES if name not in known)
    others = ", ".join(name for name in known if name not in names_for(law, has_lag=has_lag))
    reasons = [
        banks and f"{banks} (a bank of models, which the law of the card does not allow)",
        others and f"{others} (no run of the card steps its current, so that the delay is unknown)",
    ]
    words = "; ".join(filter(None, reasons))
    return words and f"Not available: {words}."


def _sine(travel_mm: float, speed_mm_s: float, command: float, unit: str) -> dict[str, object]:
    """Return a sinusoidal load cycle within the stroke, speed and command range of a card's runs."""
    amplitude_mm = min(15.0, max(1.0, math.floor(travel_mm)))
    speed_Hz = math.floor(10.0 * speed_mm_s / (2.0 * math.pi * amplitude_mm)) / 10.0
    return {
        "amplitude_mm": amplitude_mm,
        "frequency_Hz": min(1.0, max(0.1, speed_Hz)),
        "command": min(2.0, command),
        "duration_s": 1800.0,
        "unit": unit,
    }


def require_card(path: Path) -> None:
    """Raise an ``InputError`` with all faults if a card is invalid; code in the card is never executed."""
    from mrdamper.models.card_schema import read_card

    read_card(path)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError
    return float(value)
