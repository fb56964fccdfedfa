"""The job of ``mrdamper compare``: two dampers, or one before and after.

Like every job it returns one JSON-ready object; with a folder it writes compare.json and compare.html there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from mrdamper.errors import InputError
from mrdamper.identify.fit import resolve_law
from mrdamper.identify.predict import finite
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.characterisation import in_degrees
from mrdamper.models.comparison import SIDES, Comparison, compare_cards
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.runtime.outputs import atomic_output, write_json
from mrdamper.schema import Json

__all__ = ["compare"]


def compare(first: Path, second: Path, *, out: Path | None = None, law: str | None = None) -> Json:
    """Compare two cards; with ``out`` write compare.json and compare.html there.

    ``law`` is the ``file.py:Class`` of a user's own law, for cards that were identified with one.

    Raises
    ------
    InputError
        A card cannot be read, the commands are in different units, or there is no common envelope.
    """
    cards = (_read(first, law), _read(second, law))
    comparison = compare_cards(*cards, names=_names(first, second))
    answer = _answer(comparison, (first, second))
    if out is not None:
        from mrdamper.report.compare import render_comparison

        answer |= {"report": str(out / "compare.html"), "file": str(out / "compare.json")}
        with atomic_output(out) as beside:
            write_json(beside / "compare.json", answer)
            (beside / "compare.html").write_text(render_comparison(comparison), encoding="utf-8")
    return answer


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Return what the cards are called: by file, or by folder where the file is called card."""
    found = [path.absolute().parent.name if path.stem == "card" else path.stem for path in (first, second)]
    return (found[0], found[1]) if found[0] != found[1] and all(found) else SIDES


def _read(path: Path, law: str | None) -> ModelCard:
    if law is None:
        return read_card(path)
    own = resolve_law(law)[0]
    try:
        return read_card(path)
    except InputError:  # it was identified with a user's own law
        return read_card(path, python_law=own)


# ------------------------------------------------------------------------------------------- JSON


def _answer(comparison: Comparison, files: tuple[Path, Path]) -> Json:
    """Return what ``mrdamper compare --json`` prints."""
    scope, (a, b) = comparison.scope, comparison.found
    unit = comparison.cards[0].damper.command_unit
    places = [
        (t, i, {"command": command, "command_unit": unit, "temperature_degC": in_degrees(warm)})
        for t, warm in enumerate(scope.temperatures)
        for i, command in enumerate(scope.commands)
    ]
    forces = [
        {
            "velocity_m_s": speed,
            **place,
            **_pair("N", a.damping[t, i, v], b.damping[t, i, v]),
            "first_extension_N": a.extension[t, i, v],
            "second_extension_N": b.extension[t, i, v],
            "first_retraction_N": a.retraction[t, i, v],
            "second_retraction_N": b.retraction[t, i, v],
        }
        for t, i, place in places
        for v, speed in enumerate(scope.speeds)
    ]
    largest = max(forces, key=lambda row: abs(float(row["difference_N"])))
    return {
        "verdict": comparison.verdict,
        "largest": largest,
        "own_error_N": comparison.own_error_N,
        "same_law": comparison.same_law,
        "cards": [
            _card(card, name, path)
            for card, name, path in zip(comparison.cards, comparison.names, files, strict=True)
        ],
        "common_envelope": _envelope(comparison.envelope),
        "amplitude_m": scope.amplitude,
        "forces": forces,
        "energy": [
            {
                "amplitude_m": scope.motion.amplitude,
                "frequency_Hz": scope.motion.frequency,
                **place,
                **_pair("J", a.energy[t, i], b.energy[t, i]),
            }
            for t, i, place in places
        ],
        "dynamic_range": [
            {
                "velocity_m_s": speed,
                "temperature_degC": in_degrees(warm),
                "first": finite(a.dynamic_range[t, v]),
                "second": finite(b.dynamic_range[t, v]),
            }
            for t, warm in enumerate(scope.temperatures)
            for v, speed in enumerate(scope.speeds)
            if len(scope.commands) > 1
        ],
        "response": {
            side: [
                {
                    "from": r.start,
                    "to": r.end,
                    "velocity_m_s": r.velocity,
                    "command_t63_s": r.command_t63,
                    "command_t90_s": r.command_t90,
                    "force_t63_s": r.force_t63,
                    "force_t90_s": r.force_t90,
                }
                for r in found.responses
            ]
            for side, found in zip(SIDES, comparison.found, strict=True)
        },
        "gas": {
            side: [
                {"command": command, "offset_N": gas.offset_N, "spring_rate_N_m": gas.spring_rate_N_m}
                for command, gas in zip(scope.commands, found.gas, strict=True)
            ]
            for side, found in zip(SIDES, comparison.found, strict=True)
        },
        "numbers": [
            {
                "name": pair.name,
                "unit": pair.unit,
                "first": pair.values[0],
                "first_standard_error": pair.standard_errors[0],
                "second": pair.values[1],
                "second_standard_error": pair.standard_errors[1],
                "z": pair.z,
            }
            for pair in comparison.parameters
        ]
        if comparison.same_law
        else None,
        "notes": list(comparison.notes),
    }


def _pair(unit: str, first: float, second: float) -> dict[str, float | None]:
    difference = float(second - first)
    return {
        f"first_{unit}": float(first),
        f"second_{unit}": float(second),
        f"difference_{unit}": difference,
        "difference_percent": 100.0 * difference / float(first) if first > 0.0 else None,
    }


def _card(card: ModelCard, name: str, path: Path) -> Json:
    damper = card.damper
    return {
        "file": str(path),
        "name": name,
        "title": card.title,
        "law": damper.law.name,
        "numbers": sum(error is not None for error in card.standard_errors.values()),
        "tempered": damper.temperature_dependent,
        "assumed": list(damper.assumed),
        "envelope": _envelope(card.envelope),
        **{split: _errors(card, split) for split in ("training", "held_out")},
    }


def _errors(card: ModelCard, split: str) -> Mapping[str, float | int | None]:
    squares = [run["rmse_N"] ** 2 for run in card.evidence.runs if run["split"] == split]
    rms = math.sqrt(sum(squares) / len(squares)) if squares else None
    return {**card.evidence.errors(split), "rmse_N": rms}


def _envelope(envelope: OperatingEnvelope) -> Json:
    warm = envelope.temperature
    return {
        "command": list(envelope.command),
        "displacement_m": list(envelope.displacement),
        "velocity_m_s": list(envelope.velocity),
        "temperature_degC": None if warm is None else [in_degrees(end) for end in warm],
    }
