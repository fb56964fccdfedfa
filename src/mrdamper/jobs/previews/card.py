"""Summary of a card for one line of a list. The JSON of the card is not validated.

Only modules that load fast are imported. ``require_card`` is the exception, because it validates the card.
"""

from __future__ import annotations

import json
import math
from operator import itemgetter
from pathlib import Path
from typing import Any

from mrdamper.control.controllers import names_for
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
            "cancelled": "cancelled" in notes,
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


def require_card(path: Path) -> None:
    """Raise an ``InputError`` with all faults if a card is invalid; code in the card is never executed."""
    from mrdamper.models.card_schema import read_card

    read_card(path)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError
    return float(value)
