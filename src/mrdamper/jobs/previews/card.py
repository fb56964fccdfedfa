"""A card in a line, for a list of cards: read as JSON and not checked; whoever uses the card checks it.

Only light modules are loaded, but by ``require_card``, which reads it as a card.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

from mrdamper.control.controllers import names_for
from mrdamper.errors import InputError
from mrdamper.files import read_text
from mrdamper.quantities import ZERO_CELSIUS_K

_MOST_BYTES = 8_000_000


def card_line(path: Path) -> dict[str, object]:
    """Return title, law, envelope and error of a card; ``error`` says that it is none."""
    row: dict[str, object] = dict.fromkeys(
        (
            *("title", "law", "method", "command_unit", "runs", "cost_percent", "converged"),
            *("held_out_percent", "tempered", "envelope", "error"),
        )
    )
    try:
        match json.loads(read_text(path, "card", _MOST_BYTES)):
            case {
                "title": title,
                "law": law,
                "command_unit": command_unit,
                "command_lag_s": lag_s,
                "temperature_range_K": temperature_range,
                "notes": notes,
                "envelope": {
                    "command": command,
                    "displacement_m": displacement,
                    "velocity_m_s": velocity,
                    "temperature_K": temperature,
                },
                "evidence": {
                    "method": method,
                    "runs": runs,
                    "cost": cost,
                    "converged": converged,
                    **evidence,
                },
                **card,
            }:
                held_out = evidence.get("held_out", {}).get("median_nrmse_percent")
            case _:
                raise LookupError
        return row | {
            "title": str(title),
            "law": str(law),
            "method": str(method),
            "command_unit": str(command_unit),
            "runs": len(runs),
            "cost_percent": _number(cost),
            "converged": bool(converged),
            "held_out_percent": None if held_out is None else _number(held_out),
            "tempered": temperature_range is not None,
            "controllers": list(
                names_for(str(law), has_lag=card.get("actuation") is not None or lag_s > 0.0)
            ),
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
    """Raise an ``InputError`` with all that is wrong with a card; nothing in it is ever run."""
    from mrdamper.models.card_schema import read_card

    read_card(path)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError
    return float(value)
