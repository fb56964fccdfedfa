"""Two dampers asked the same questions at the same places, inside what both were identified on.

Their numbers are compared only where the laws are the same; standard errors count as independent.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.characterisation import Characterisation, Scope, characterise, usual_scope
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K, to_degC

CLEAR = 3.0
"""Standard errors by which a number has moved for certain."""

SIDES: tuple[str, str] = ("first", "second")

_NEARLY = 0.9  # of the places: nearly everywhere
_NEAR_K = 5.0  # temperatures so near count as the same


@dataclass(frozen=True, slots=True)
class ParameterPair:
    """One parameter of two dampers of the same law; ``z`` is their difference over its standard error."""

    name: str
    unit: str
    values: tuple[float | None, float | None]
    standard_errors: tuple[float | None, float | None]
    z: float | None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two cards with their figures at the same places."""

    cards: tuple[ModelCard, ModelCard]
    names: tuple[str, str]
    envelope: OperatingEnvelope  # common to both
    scope: Scope
    found: tuple[Characterisation, Characterisation]
    parameters: tuple[ParameterPair, ...]  # empty where the laws differ
    own_error_N: float | None  # RMS errors of both cards on their runs, together
    notes: tuple[str, ...]
    verdict: str

    @property
    def same_law(self) -> bool:
        return self.cards[0].damper.law.name == self.cards[1].damper.law.name


def compare_cards(first: ModelCard, second: ModelCard, *, names: tuple[str, str] = SIDES) -> Comparison:
    """Return two cards with their figures at round places of their common envelope.

    Raises
    ------
    InputError
        Commands in different units, or no common envelope.
    """
    cards = (first, second)
    envelope, notes = common_envelope(cards, names)
    dampers = (first.damper, second.damper)
    leading = next((damper for damper in dampers if damper.temperature_dependent), dampers[0])
    kelvin = envelope.temperature
    single = [kelvin[0]] if kelvin is not None and kelvin[0] == kelvin[1] else None
    scope = usual_scope(leading, envelope, temperatures=single)
    pair = (characterise(dampers[0], scope), characterise(dampers[1], scope))
    own = _own_error(cards)
    return Comparison(
        cards=cards,
        names=names,
        envelope=envelope,
        scope=scope,
        found=pair,
        parameters=_parameters(cards),
        own_error_N=own,
        notes=(*notes, *_assumptions(cards, names), *_other_forms(cards)),
        verdict=_verdict(pair, names, first.damper.command_unit, own),
    )


def common_envelope(
    cards: tuple[ModelCard, ModelCard], names: tuple[str, str]
) -> tuple[OperatingEnvelope, list[str]]:
    """Return the envelope that two cards share, and what to know about it.

    Raises
    ------
    InputError
        Commands in different units, or a quantity whose ranges do not meet.
    """
    units = [card.damper.command_unit for card in cards]
    if units[0] != units[1]:
        raise InputError(
            found=f"{names[0]} is commanded in {units[0]} and {names[1]} in {units[1]}",
            expected="the same unit",
            remedy="Identify both from the same channel",
        )
    shared = {}
    for what, unit, scale in (
        ("command", units[0], 1.0),
        ("displacement", "mm", 1e3),
        ("velocity", "mm/s", 1e3),
    ):
        ranges = [getattr(card.envelope, what) for card in cards]
        shared[what] = _meeting(ranges, what, unit, scale, names)
    temperature, notes = _common_temperature(cards, names)
    return OperatingEnvelope(**shared, temperature=temperature), notes


def _meeting(
    ranges: list[tuple[float, float]],
    what: str,
    unit: str,
    scale: float,
    names: tuple[str, str],
    shift: float = 0.0,
) -> tuple[float, float]:
    low, high = max(pair[0] for pair in ranges), min(pair[1] for pair in ranges)
    single = what in {"command", "temperature"}
    if low < high or (single and low == high):
        return low, high
    told = [f"{scale * pair[0] + shift:.4g} to {scale * pair[1] + shift:.4g} {unit}" for pair in ranges]
    raise InputError(
        found=f"no common envelope: {what} is {told[0]} in {names[0]} and {told[1]} in {names[1]}",
        expected="ranges that overlap",
        remedy="Identify both on runs of the same kind",
    )


def _common_temperature(
    cards: tuple[ModelCard, ModelCard], names: tuple[str, str]
) -> tuple[tuple[float, float] | None, list[str]]:
    """Return the temperatures [K] at which both hold; a damper that knows none holds where it was tested."""
    ranges = [_known(card) for card in cards]
    temperature_dependent = [card.damper.temperature_dependent for card in cards]
    known = [pair for pair in ranges if pair is not None]
    if not any(temperature_dependent):
        notes: list[str] = []
        if len(known) == 2 and max(abs(a - b) for a, b in zip(*known, strict=True)) > _NEAR_K:
            told = [
                f"{pair[0] - ZERO_CELSIUS_K:.0f} to {pair[1] - ZERO_CELSIUS_K:.0f} degC" for pair in known
            ]
            first, second = names
            notes.append(
                f"{first} was tested at {told[0]}, {second} at {told[1]}; neither model has a temperature "
                "dependence, so that the effect of temperature on the difference is unknown"
            )
        return None, notes
    if all(temperature_dependent):
        if len(known) < 2:
            return (known[0] if known else None), []
        return _meeting(known, "temperature", "degC", 1.0, names, -ZERO_CELSIUS_K), []
    knows = temperature_dependent.index(True)
    other = 1 - knows
    pair, tested = ranges[knows] or (REFERENCE_K, REFERENCE_K), ranges[other]
    if tested is None:
        at = float(np.clip(REFERENCE_K, *pair))
        said = f"{names[other]} does not say at which temperature it was tested"
    else:
        middle = 0.5 * (tested[0] + tested[1])
        at = float(np.clip(middle, *pair))
        if abs(at - middle) > _NEAR_K:
            both = [pair, tested] if knows == 0 else [tested, pair]
            _meeting(both, "temperature", "degC", 1.0, names, -ZERO_CELSIUS_K)
        said = f"{names[other]} was tested near {to_degC(middle):.0f} degC and knows no other temperature"
    return (at, at), [f"{said}: both are compared at {at - ZERO_CELSIUS_K:.0f} degC"]


def _known(card: ModelCard) -> tuple[float, float] | None:
    """Return where a card's temperatures hold: the envelope, or what was assumed beyond one temperature."""
    seen, held = card.envelope.temperature, card.damper.temperature_range
    if not card.damper.temperature_dependent or held is None:
        return seen
    return held if seen is None or seen[1] - seen[0] < _NEAR_K else seen


# ------------------------------------------------------------------------------------------- numbers


def _parameters(cards: tuple[ModelCard, ModelCard]) -> tuple[ParameterPair, ...]:
    """Return the parameters of two dampers of one law that were identified in either or that differ."""
    dampers = [card.damper for card in cards]
    if dampers[0].law.name != dampers[1].law.name:
        return ()
    values = [damper.parameters for damper in dampers]
    units = {**dampers[1].units, **dampers[0].units}
    found = []
    for name in dict.fromkeys([*values[0], *values[1]]):
        pair = (values[0].get(name), values[1].get(name))
        errors = (cards[0].standard_errors.get(name), cards[1].standard_errors.get(name))
        if errors == (None, None) and pair[0] == pair[1]:
            continue
        found.append(ParameterPair(name, units[name], pair, errors, _z(dampers, name, pair, errors)))
    return tuple(found)


def _z(
    dampers: list[Damper],
    name: str,
    values: tuple[float | None, float | None],
    errors: tuple[float | None, float | None],
) -> float | None:
    coefficient = name.partition(".")[0]
    forms = [damper.coefficients[coefficient] for damper in dampers]
    if forms[0].kind != forms[1].kind or dict(forms[0].settings) != dict(forms[1].settings):
        return None
    (a, b), (by_a, by_b) = values, errors
    if a is None or b is None or by_a is None or by_b is None:
        return None
    spread = math.hypot(by_a, by_b)
    return (b - a) / spread if spread > 0.0 else None


def _own_error(cards: Iterable[ModelCard]) -> float | None:
    """Return both cards' RMS errors together [N]: on held-out runs where there are some, else on training."""
    total = 0.0
    for card in cards:
        for split in ("held_out", "training"):
            squares = [run["rmse_N"] ** 2 for run in card.evidence.runs if run["split"] == split]
            if squares:
                total += sum(squares) / len(squares)
                break
        else:
            return None
    return math.sqrt(total)


# ------------------------------------------------------------------------------------------- words


def _verdict(
    found: tuple[Characterisation, Characterisation], names: tuple[str, str], unit: str, own: float | None
) -> str:
    """Say in one sentence how the second damper differs from the first, and where most."""
    before, after = found[0].damping, found[1].damping
    difference = after - before
    t, i, v = np.unravel_index(int(np.argmax(np.abs(difference))), difference.shape)
    most = float(difference[t, i, v])
    scope = found[0].scope
    if most == 0.0:
        return f"{names[1]} and {names[0]} give the same force everywhere."
    kelvin = scope.temperatures[t]
    at = "" if kelvin is None else f", {kelvin - ZERO_CELSIUS_K:.0f} degC"
    where = f"at {scope.commands[i]:.3g} {unit}{at} and {1e3 * scope.speeds[v]:.3g} mm/s"
    share = "" if not before[t, i, v] > 0.0 else f" ({100.0 * most / before[t, i, v]:+.1f} %)"
    if own is not None and abs(most) < own:
        return (
            f"No clear difference: {names[1]} differs from {names[0]} by {most:+.0f} N{share} at most, "
            f"{where}, less than the RMS errors of both cards together ({own:.0f} N)."
        )
    total = float(before.sum())
    mean = f" ({100.0 * float(difference.sum()) / total:+.1f} % over all)" if total > 0.0 else ""
    share_below = float(np.mean(difference < 0.0))
    if max(share_below, 1.0 - share_below) >= _NEARLY:
        word, part = ("weaker", share_below) if share_below > 0.5 else ("stronger", 1.0 - share_below)
        head = f"{names[1]} is {word} than {names[0]} {'' if part == 1.0 else 'nearly '}everywhere{mean}"
    else:
        head = f"{names[1]} is weaker than {names[0]} in some places and stronger in others{mean}"
    errors = "" if own is None else f"; the RMS errors of both cards together are {own:.0f} N"
    return f"{head}, most {where}: {most:+.0f} N{share}{errors}."


def _assumptions(cards: tuple[ModelCard, ModelCard], names: tuple[str, str]) -> list[str]:
    return [
        (
            f"{name}: the temperature factor of {', '.join(card.damper.assumed)} is assumed (a "
            "fluid's data), not identified on that damper"
        )
        for card, name in zip(cards, names, strict=True)
        if card.damper.assumed
    ]


def _other_forms(cards: tuple[ModelCard, ModelCard]) -> list[str]:
    first, second = (card.damper for card in cards)
    if first.law.name != second.law.name:
        return [
            (
                f"the laws differ ({first.law.name}, {second.law.name}): their parameters do "
                "not mean the same and are not compared"
            )
        ]
    other = [
        name
        for name, form in first.coefficients.items()
        if form.kind != second.coefficients[name].kind
        or dict(form.settings) != dict(second.coefficients[name].settings)
    ]
    return [f"{', '.join(other)}: of another form in the two cards, no z-score"] if other else []
