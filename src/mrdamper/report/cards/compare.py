"""What ``compare`` found: the answer's keys, the tables of a terminal, forces as CSV."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.identify.evaluate import finite
from mrdamper.models.card import ModelCard
from mrdamper.models.characterisation import Characterisation, Scope, in_degrees
from mrdamper.models.comparison import SIDES, Comparison, ParameterPair
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.report.base import Report, WrittenFile, print_notes
from mrdamper.report.cards.comparison_page import PAGE
from mrdamper.report.sections import terminal_table
from mrdamper.schema import Json

# ------------------------------------------------------------------------------------------- the answer


def _answer(comparison: Comparison) -> Json:
    """Return what ``mrdamper compare --json`` prints."""
    scope, (a, b) = comparison.scope, comparison.found
    places = _places(comparison)
    forces = _rows(comparison)
    largest = max(forces, key=lambda row: abs(float(row["difference_N"])))
    return {
        "verdict": comparison.verdict,
        "largest": largest,
        "own_error_N": comparison.own_error_N,
        "same_law": comparison.same_law,
        "cards": [_card(card, name) for card, name in zip(comparison.cards, comparison.names, strict=True)],
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
        "response": {side: _responses(found) for side, found in zip(SIDES, comparison.found, strict=True)},
        "gas": {side: _gas(found, scope) for side, found in zip(SIDES, comparison.found, strict=True)},
        "numbers": [_number(pair) for pair in comparison.parameters] if comparison.same_law else None,
        "notes": list(comparison.notes),
    }


def _responses(found: Characterisation) -> list[Json]:
    return [
        {
            "from": each.start,
            "to": each.end,
            "velocity_m_s": each.velocity,
            "command_t63_s": each.command_t63,
            "command_t90_s": each.command_t90,
            "force_t63_s": each.force_t63,
            "force_t90_s": each.force_t90,
        }
        for each in found.responses
    ]


def _gas(found: Characterisation, scope: Scope) -> list[Json]:
    return [
        {"command": command, "offset_N": gas.offset_N, "spring_rate_N_m": gas.spring_rate_N_m}
        for command, gas in zip(scope.commands, found.gas, strict=True)
    ]


def _number(pair: ParameterPair) -> Json:
    return {
        "name": pair.name,
        "unit": pair.unit,
        "first": pair.values[0],
        "first_standard_error": pair.standard_errors[0],
        "second": pair.values[1],
        "second_standard_error": pair.standard_errors[1],
        "z": pair.z,
    }


def _places(comparison: Comparison) -> list[tuple[int, int, Json]]:
    """Return the places that are compared: numbers of temperature and command, and what they are."""
    scope, unit = comparison.scope, comparison.cards[0].damper.command_unit
    return [
        (t, i, {"command": command, "command_unit": unit, "temperature_degC": in_degrees(warm)})
        for t, warm in enumerate(scope.temperatures)
        for i, command in enumerate(scope.commands)
    ]


def _rows(comparison: Comparison) -> list[Json]:
    """Return the forces at peak velocities as a table, a row for each place."""
    a, b = comparison.found
    return [
        {
            "velocity_m_s": speed,
            **place,
            **_pair("N", a.damping[t, i, v], b.damping[t, i, v]),
            "first_extension_N": a.extension[t, i, v],
            "second_extension_N": b.extension[t, i, v],
            "first_retraction_N": a.retraction[t, i, v],
            "second_retraction_N": b.retraction[t, i, v],
        }
        for t, i, place in _places(comparison)
        for v, speed in enumerate(comparison.scope.speeds)
    ]


def _pair(unit: str, first: float, second: float) -> dict[str, float | None]:
    difference = float(second - first)
    return {
        f"first_{unit}": float(first),
        f"second_{unit}": float(second),
        f"difference_{unit}": difference,
        "difference_percent": 100.0 * difference / float(first) if first > 0.0 else None,
    }


def _card(card: ModelCard, name: str) -> Json:
    damper = card.damper
    return {
        "file": card.file,
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


# --------------------------------------------------------------------------------------------- the terminal


def _show(comparison: Comparison, console: Console) -> None:
    """Print the verdict, forces side by side, and the numbers where the laws are the same."""
    console.print(f"[bold]{escape(comparison.verdict)}[/bold]")
    console.print(_forces_side_by_side(comparison))
    if comparison.same_law and comparison.parameters:
        console.print(_numbers_table(comparison))
    print_notes(comparison.notes, console)


def _forces_side_by_side(comparison: Comparison) -> Table:
    """Return one row for each temperature and command, one column for each speed [mm/s]."""
    scope, unit = comparison.scope, comparison.cards[0].damper.command_unit
    a, b = (found.damping for found in comparison.found)
    rows = []
    for t, warm in enumerate(scope.temperatures):
        degrees = in_degrees(warm)
        for i, command in enumerate(scope.commands):
            cells = [_change(*pair) for pair in zip(a[t, i], b[t, i], strict=True)]
            rows.append(("-" if degrees is None else f"{degrees:.0f}", f"{command:g} {unit}", *cells))
    title = f"Damping force at peak velocity: {' → '.join(comparison.names)}"
    names = ("degC", "command", *(f"{1e3 * speed:.3g} mm/s: N" for speed in scope.speeds))
    return terminal_table(title, names, rows, whole=True)


def _change(first: float, second: float) -> str:
    share = f" ({100.0 * (second - first) / first:+.1f} %)" if first > 0.0 else ""
    return f"{first:.0f} → {second:.0f}{share}"


def _numbers_table(comparison: Comparison) -> Table:
    first, second = comparison.names
    rows = []
    for pair in comparison.parameters:
        cells = []
        for value, error in zip(pair.values, pair.standard_errors, strict=True):
            cells += ["-" if value is None else f"{value:.5g}", "" if error is None else f"{error:.2g}"]
        rows.append((pair.name, *cells, pair.unit, "-" if pair.z is None else f"{pair.z:+.1f}"))
    names = ("number", first, "±", second, "±", "unit", "z")
    return terminal_table("Numbers", names, rows, left=("number", "unit"), whole=True)


REPORT: Report[Comparison] = Report(
    answer=_answer,
    show=_show,
    page=PAGE,
    files=(WrittenFile(name="compare.json", key="file"),),
    rows=_rows,
)
