"""The page of ``compare``: two cards side by side, one HTML file that opens offline."""

from __future__ import annotations

import numpy as np

from mrdamper.models.card import ModelCard
from mrdamper.models.characterisation import spread_out
from mrdamper.models.characteristics import SettledCycle, settled_cycle
from mrdamper.models.comparison import CLEAR, Comparison
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures import palette as plots
from mrdamper.report.figures import small_multiples as panels
from mrdamper.report.figures.characteristics import PickPanel, peak_velocity_figure
from mrdamper.report.figures.palette import MEASURED, colour_of
from mrdamper.report.figures.small_multiples import Curve, Line, Row, Series
from mrdamper.report.page import FirstScreen, Page, Tile

_MOST_LOOPS = 5
_CURVE = 61  # commands of a coefficient's curve


def _first(comparison: Comparison) -> FirstScreen:
    first, second = comparison.found
    step = second.damping - first.damping
    scope, own = comparison.scope, comparison.own_error_N
    t, i, v = np.unravel_index(int(np.argmax(np.abs(step))), step.shape)
    most, before = float(step[t, i, v]), float(first.damping[t, i, v])
    warm = scope.temperatures[t]
    at = f"{scope.commands[i]:.3g} {comparison.cards[0].damper.command_unit}"
    at += "" if warm is None else f", {warm - ZERO_CELSIUS_K:.0f} °C"
    energy = 100.0 * (second.energy / first.energy - 1.0)
    return FirstScreen(
        title=f"{comparison.names[0]} and {comparison.names[1]}",
        subject="Two MR dampers compared, second minus first, inside what both were identified on",
        verdict=comparison.verdict,
        tiles=(
            Tile(
                f"{most:+.0f} N",
                f"largest difference of the damping force, at {at}, {1e3 * scope.speeds[v]:.3g} mm/s",
                "" if own is None else f"both cards' own RMS errors: {own:.0f} N",
            ),
            Tile(
                f"{100.0 * step.sum() / first.damping.sum():+.1f} %",
                "damping force over all",
                "" if before <= 0.0 else f"{100.0 * most / before:+.1f} % where it differs most",
            ),
            Tile(
                f"{np.median(energy):+.1f} %",
                "energy per cycle, median",
                f"{energy.min():+.1f} to {energy.max():+.1f} %",
            ),
        ),
        caption=f"Force at peak velocity of sines of ±{1e3 * scope.amplitude:.3g} mm at rising "
        f"frequencies; extension above zero, retraction below. "
        f"Solid: {comparison.names[0]}; dashed: {comparison.names[1]}",
        notes=comparison.notes,
    )


def _sections(comparison: Comparison) -> dict[str, object]:
    titles = _titles(comparison)
    return {
        "unit": comparison.cards[0].damper.command_unit,
        "titles": titles,
        "rows": _card_rows(comparison),
        "clear": CLEAR,
        "differences": _differences(comparison, titles),
        "loops": _loops(comparison),
        "curves": _curves(comparison),
    }


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
            Curve(Series(plots.shortened(called, 24), colour, commands, value, style=style), None)
            for called, colour, value, style in zip(
                comparison.names, (plots.INK, plots.HELD_OUT), values, ("-", "--"), strict=True
            )
        ]
        found.append((f"{name.replace('_', ' ')}, {first.law[name].unit}", label, bands, None))
    return panels.curves(found, "") if found else ""


PAGE = Page(
    name="compare.html",
    first=_first,
    picture=lambda comparison: peak_velocity_figure(*_picks(comparison)),
    label="Peak-velocity-pick curves",
    template="compare.html.j2",
    values=_sections,
)
