"""What ``compare`` found: the page, the answer's keys, the tables of a terminal, forces as CSV."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.identify.predict import finite
from mrdamper.models.card import ModelCard
from mrdamper.models.characterisation import in_degrees, spread_out
from mrdamper.models.characteristics import SettledCycle, settled_cycle
from mrdamper.models.comparison import CLEAR, SIDES, Comparison
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile
from mrdamper.report.figures import small_multiples as panels
from mrdamper.report.figures import style as plots
from mrdamper.report.figures.characteristics import PickPanel, peak_velocity, peak_velocity_figure
from mrdamper.report.figures.small_multiples import Band, Line, Row, Series
from mrdamper.report.figures.style import MEASURED, colour_of
from mrdamper.report.page import environment
from mrdamper.schema import Json

__all__ = ["REPORT", "render_comparison"]

_MOST_LOOPS = 5
_CURVE = 61  # commands of a coefficient's curve


def render_comparison(comparison: Comparison) -> str:
    """Return the page's HTML."""
    unit = comparison.cards[0].damper.command_unit
    titles = _titles(comparison)
    return (
        environment()
        .get_template("compare.html.j2")
        .render(
            it=comparison,
            unit=unit,
            titles=titles,
            rows=_card_rows(comparison),
            clear=CLEAR,
            picks=peak_velocity(*_picks(comparison)),
            differences=_differences(comparison, titles),
            loops=_loops(comparison),
            curves=_curves(comparison),
        )
    )


def _titles(comparison: Comparison) -> list[str]:
    """Return the temperatures that are compared, in words."""
    kelvins = comparison.scope.temperatures
    return ["" if warm is None else f"{warm - ZERO_CELSIUS_K:.0f} °C" for warm in kelvins]


def _picks(comparison: Comparison) -> tuple[list[PickPanel], str, list[str]]:
    """Return what the figure of forces over peak velocity shows: panels, command unit, names."""
    curves = zip(*(found.curves for found in comparison.found), strict=True)
    panels = [PickPanel(title, pair) for title, pair in zip(_titles(comparison), curves, strict=True)]
    names = [plots.shortened(name, 16) for name in comparison.names]
    return panels, comparison.cards[0].damper.command_unit, names


def _card_rows(comparison: Comparison) -> list[tuple[str, str, str]]:
    """Return what the cards are, line by line: (what, first, second)."""

    def errors(card: ModelCard, split: str) -> str:
        found = [run["rmse_N"] for run in card.evidence.runs if run["split"] == split]
        return f"{np.sqrt(np.mean(np.square(found))):.1f} N on {len(found)} runs" if found else "-"

    def each(said: list[str]) -> tuple[str, str]:
        return said[0], said[1]

    cards = comparison.cards
    rows = [
        ("title", *each([card.title for card in cards])),
        ("law", *each([card.damper.law.name for card in cards])),
        ("RMS error, training", *each([errors(card, "training") for card in cards])),
        ("RMS error, held out", *each([errors(card, "held_out") for card in cards])),
    ]
    spans = [_spans(card.envelope, card.damper.command_unit) for card in cards]
    return rows + [(what, spans[0][what], spans[1][what]) for what in spans[0]]


def _spans(envelope: OperatingEnvelope, unit: str) -> dict[str, str]:
    """Return an envelope in words, by quantity."""

    def span(pair: tuple[float, float], of: str, scale: float = 1.0, shift: float = 0.0) -> str:
        low, high = (scale * end + shift for end in pair)
        return f"{low:.4g} {of}" if low == high else f"{low:.4g} to {high:.4g} {of}"

    warm = envelope.temperature
    return {
        "current" if unit == "A" else "voltage": span(envelope.command, unit),
        "displacement": span(envelope.displacement, "mm", 1e3),
        "velocity": span(envelope.velocity, "mm/s", 1e3),
        "temperature": "not recorded" if warm is None else span(warm, "°C", 1.0, -ZERO_CELSIUS_K),
    }


def _differences(comparison: Comparison, titles: list[str]) -> str:
    """Return the difference of the damping force over peak velocity, a panel for each temperature."""
    scope = comparison.scope
    highest = max(map(abs, scope.commands))
    columns = tuple(
        tuple(
            Line(1e3 * a.velocity, b.damping - a.damping, colour_of(a.command, highest), 1.2)
            for a, b in zip(first, second, strict=True)
        )
        for first, second in zip(comparison.found[0].curves, comparison.found[1].curves, strict=True)
    )
    row = Row("peak velocity, mm/s", "difference, N", columns)
    return panels.grid(
        [(title, False) for title in titles], [row], "Difference of the damping force", tall=2.0
    )


def _loops(comparison: Comparison) -> str:
    """Return the loops of both at the first temperature: the first grey and wide, the second coloured."""
    scope, unit = comparison.scope, comparison.cards[0].damper.command_unit
    commands = spread_out(scope.commands, _MOST_LOOPS)
    highest = max(map(abs, scope.commands))
    pairs = [
        [
            settled_cycle(card.damper, scope.motion, command, scope.temperatures[0])
            for card in comparison.cards
        ]
        for command in commands
    ]

    def both(pair: list[SettledCycle], quantity: str, command: float) -> tuple[Line, ...]:
        styles = ((MEASURED, 2.6), (colour_of(command, highest), 0.9))
        return tuple(
            Line(1e3 * getattr(cycle, quantity), cycle.force, *style)
            for cycle, style in zip(pair, styles, strict=True)
        )

    rows = [
        Row(
            label,
            "force, N",
            tuple(both(pair, quantity, command) for pair, command in zip(pairs, commands, strict=True)),
        )
        for quantity, label in (("displacement", "displacement, mm"), ("velocity", "velocity, mm/s"))
    ]
    return panels.grid([(f"{command:g} {unit}", False) for command in commands], rows, "Loops of both")


def _curves(comparison: Comparison) -> str:
    """Return the coefficients of both over the command where one law has them all; or nothing."""
    if not comparison.same_law:
        return ""
    low, high = comparison.envelope.command
    if low == high:
        return ""
    commands = np.linspace(low, high, _CURVE)
    warm = comparison.scope.temperatures[0]
    at = None if warm is None else np.full(len(commands), warm)
    first, second = (card.damper for card in comparison.cards)
    label = "current, A" if first.command_unit == "A" else "voltage, V"
    found = []
    for name in first.law.names:
        values = [damper.coefficients[name].value(commands, at) for damper in (first, second)]
        if np.array_equal(values[0], values[1]):
            continue
        bands = [
            Band(Series(plots.shortened(called, 24), colour, commands, value, style=style), None)
            for called, colour, value, style in zip(
                comparison.names, (plots.INK, plots.HELD_OUT), values, ("-", "--"), strict=True
            )
        ]
        found.append((f"{name.replace('_', ' ')}, {first.law[name].unit}", label, bands, None))
    return panels.curves(found, "") if found else ""


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
    for note in comparison.notes:
        console.print(f"- {escape(note)}")


def _forces_side_by_side(comparison: Comparison) -> Table:
    """Return one row for each temperature and command, one column for each speed [mm/s]."""
    scope, unit = comparison.scope, comparison.cards[0].damper.command_unit
    first, second = (escape(name) for name in comparison.names)
    table = Table(title=f"Damping force at peak velocity: {first} → {second}")
    table.add_column("degC", justify="right")
    table.add_column("command", justify="right")
    for speed in scope.speeds:
        table.add_column(f"{1e3 * speed:.3g} mm/s: N", justify="right", no_wrap=True)
    a, b = (found.damping for found in comparison.found)
    for t, warm in enumerate(scope.temperatures):
        degrees = in_degrees(warm)
        for i, command in enumerate(scope.commands):
            cells = [_change(*pair) for pair in zip(a[t, i], b[t, i], strict=True)]
            table.add_row("-" if degrees is None else f"{degrees:.0f}", f"{command:g} {unit}", *cells)
    return table


def _change(first: float, second: float) -> str:
    share = f" ({100.0 * (second - first) / first:+.1f} %)" if first > 0.0 else ""
    return f"{first:.0f} → {second:.0f}{share}"


def _numbers_table(comparison: Comparison) -> Table:
    first, second = (escape(name) for name in comparison.names)
    table = Table(title="Numbers")
    for name in ("number", first, "±", second, "±", "unit", "z"):
        table.add_column(name, justify="left" if name in {"number", "unit"} else "right", no_wrap=True)
    for pair in comparison.parameters:
        cells = []
        for value, error in zip(pair.values, pair.standard_errors, strict=True):
            cells += ["-" if value is None else f"{value:.5g}", "" if error is None else f"{error:.2g}"]
        z = "-" if pair.z is None else f"{pair.z:+.1f}"
        table.add_row(escape(pair.name), *cells, escape(pair.unit), z)
    return table


def _write_page(comparison: Comparison, path: Path) -> None:
    path.write_text(render_comparison(comparison), encoding="utf-8")


REPORT: Report[Comparison] = Report(
    answer=_answer,
    show=_show,
    summary=lambda comparison: [comparison.verdict, *comparison.notes],
    files=(
        WrittenFile(name="compare.html", key="report", write=_write_page),
        WrittenFile(name="compare.json", key="file"),
    ),
    figure=lambda comparison: peak_velocity_figure(*_picks(comparison)),
    rows=_rows,
)
