"""Output of the command ``compare``: differences of two dampers."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.models.characteristics import in_degrees
from mrdamper.models.comparison import Comparison
from mrdamper.report.base import Report, WrittenFile, print_notes
from mrdamper.report.figures.characteristics import PickPanel, peak_velocity_figure
from mrdamper.report.figures.style import shortened
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import Table, table_of
from mrdamper.schema import Json


def _fields(comparison: Comparison) -> dict[str, object]:
    forces = _forces(comparison)
    return {
        "verdict": comparison.verdict,
        "largest": max(forces, key=lambda row: abs(row["difference_N"])),
        "own_error_N": comparison.own_error_N,
        "same_law": comparison.same_law,
        "cards": [
            {"file": card.file, "name": name, "title": card.title, "law": card.damper.law.name}
            for card, name in zip(comparison.cards, comparison.names, strict=True)
        ],
        "command_unit": comparison.cards[0].damper.command_unit,
        "amplitude_m": comparison.scope.amplitude,
        "forces": forces,
        "energy": _energies(comparison),
        "response": _responses(comparison),
        "numbers": comparison.parameters,
        "notes": comparison.notes,
    }


def _cases(comparison: Comparison) -> list[tuple[int, int, Json]]:
    """Return all pairs of temperature and current: indices, and values by name."""
    return [
        (t, i, {"temperature_degC": in_degrees(kelvin), "command": command})
        for t, kelvin in enumerate(comparison.scope.temperatures)
        for i, command in enumerate(comparison.scope.commands)
    ]


def _forces(comparison: Comparison) -> list[Json]:
    """Return the damping forces of both dampers, one row for each temperature, current and peak velocity."""
    first, second = (found.damping for found in comparison.found)
    return [
        {
            **case,
            "velocity_m_s": speed,
            "first_N": float(first[t, i, v]),
            "second_N": float(second[t, i, v]),
            "difference_N": float(second[t, i, v] - first[t, i, v]),
            "difference_percent": _percent(first[t, i, v], second[t, i, v]),
        }
        for t, i, case in _cases(comparison)
        for v, speed in enumerate(comparison.scope.speeds)
    ]


def _energies(comparison: Comparison) -> list[Json]:
    """Return energy per cycle and gas force of both dampers, one row for each temperature and current."""
    first, second = comparison.found
    return [
        {
            **case,
            "first_J": float(first.energy[t, i]),
            "second_J": float(second.energy[t, i]),
            "difference_percent": _percent(first.energy[t, i], second.energy[t, i]),
            "first_gas_N": float(first.gas_N[t, i]),
            "second_gas_N": float(second.gas_N[t, i]),
        }
        for t, i, case in _cases(comparison)
    ]


def _responses(comparison: Comparison) -> list[Json]:
    """Return the times [s] to 63 and 90 % of the response to current steps."""
    return [
        {"card": name, **asdict(response)}
        for name, found in zip(comparison.names, comparison.found, strict=True)
        for response in found.responses
    ]


def _percent(first: float, second: float) -> float | None:
    return 100.0 * float(second - first) / float(first) if first > 0.0 else None


def _tables(comparison: Comparison) -> list[Table[Any]]:
    motion = comparison.scope.motion
    sine = f"sine {1e3 * motion.amplitude:.3g} mm {motion.frequency:.3g} Hz"
    return [
        *table_of(_forces(comparison), "Damping force at peak velocity"),
        *table_of(_energies(comparison), f"Energy per cycle ({sine}) and gas force"),
        *table_of(_responses(comparison), "Response time including delay"),
        *table_of([asdict(pair) for pair in comparison.parameters], "Parameters"),
    ]


def _show(comparison: Comparison, console: Console) -> None:
    console.print(f"[bold]{escape(comparison.verdict)}[/bold]")
    for table in _tables(comparison):
        console.print(table.printed(whole=True))
    print_notes(comparison.notes, console)


def _first(comparison: Comparison) -> FirstScreen:
    first, second = comparison.found
    names, own = comparison.names, comparison.own_error_N
    difference = second.damping - first.damping
    energy = 100.0 * (second.energy / first.energy - 1.0)
    amplitude_mm = 1e3 * comparison.scope.amplitude
    return FirstScreen(
        title=f"{names[0]} and {names[1]}",
        subject=f"Two MR dampers in their common range. First is {names[0]}, second is {names[1]}.",
        verdict=comparison.verdict,
        tiles=(
            Tile(
                f"{difference[comparison.largest]:+.0f} N",
                "maximum difference of the damping force",
                "" if own is None else f"RMS errors of both cards: {own:.0f} N",
            ),
            Tile(
                f"{100.0 * difference.sum() / first.damping.sum():+.1f} %",
                "damping force, average",
            ),
            Tile(
                f"{np.median(energy):+.1f} %",
                "energy per cycle, median",
                f"{energy.min():+.1f} to {energy.max():+.1f} %",
            ),
        ),
        caption=f"Force at the peak velocity of sines of ±{amplitude_mm:.3g} mm at rising "
        f"frequencies; extension above zero, retraction below. Solid: {names[0]}; dashed: {names[1]}",
        notes=comparison.notes,
    )


def _picture(comparison: Comparison) -> Figure:
    degrees = map(in_degrees, comparison.scope.temperatures)
    curves = zip(*(found.curves for found in comparison.found), strict=True)
    panels = [
        PickPanel("" if at is None else f"{at:.0f} °C", pair)
        for at, pair in zip(degrees, curves, strict=True)
    ]
    names = [shortened(name, 16) for name in comparison.names]
    return peak_velocity_figure(panels, comparison.cards[0].damper.command_unit, names)


REPORT: Report[Comparison] = Report(
    fields=_fields,
    show=_show,
    page=Page(
        name="compare.html",
        first=_first,
        picture=_picture,
        label="Peak-velocity-pick curves",
        sections=_tables,
    ),
    files=(WrittenFile(name="compare.json", key="file"),),
    rows=_forces,
)
