"""Comparison of two dampers at the same commands, temperatures and speeds.

Both dampers are evaluated inside their common envelope. Parameters are compared only if both dampers have one
hysteresis law. The standard errors of the two dampers are assumed to be independent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.characteristics import Characterisation, Scope, characterise, default_scope
from mrdamper.models.damper import OperatingEnvelope, Range
from mrdamper.quantities import REFERENCE_K, to_degC
from mrdamper.results import JobResult

TEMPERATURE_TOLERANCE_K = 5.0  # Temperature differences below this value are ignored.


@dataclass(frozen=True, slots=True)
class ParameterPair:
    """A parameter of two dampers; ``z`` is the difference in standard errors."""

    name: str
    unit: str
    first: float | None
    first_standard_error: float | None
    second: float | None
    second_standard_error: float | None
    z: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(JobResult):
    """Characteristics of two cards; differences are second damper minus first damper."""

    _job = "compare"
    cards: tuple[ModelCard, ModelCard]
    names: tuple[str, str]
    envelope: OperatingEnvelope  # common envelope of both cards
    scope: Scope
    found: tuple[Characterisation, Characterisation]
    parameters: tuple[ParameterPair, ...]  # empty if the hysteresis laws differ
    own_error_N: float | None  # root sum of squares of the RMS errors of both models
    notes: tuple[str, ...]

    @property
    def same_law(self) -> bool:
        return self.cards[0].damper.law.name == self.cards[1].damper.law.name

    @property
    def largest(self) -> tuple[int, int, int]:
        """Indices (temperature, command, speed) of the largest difference of the damping force."""
        difference = np.abs(self.found[1].damping - self.found[0].damping)
        t, i, v = np.unravel_index(int(np.argmax(difference)), difference.shape)
        return int(t), int(i), int(v)

    @property
    def verdict(self) -> str:
        """One sentence: how the second damper differs from the first, and where the difference is largest."""
        nearly_everywhere_fraction = 0.9
        first, second = self.names
        before = self.found[0].damping
        difference = self.found[1].damping - before
        t, i, v = self.largest
        most, unit = float(difference[t, i, v]), self.cards[0].damper.command_unit
        if most == 0.0:
            return f"{second} and {first} give the same force everywhere."
        kelvin = self.scope.temperatures[t]
        at = "" if kelvin is None else f", {to_degC(kelvin):.0f} degC"
        where = f"at {self.scope.commands[i]:.3g} {unit}{at} and {1e3 * self.scope.speeds[v]:.3g} mm/s"
        own = self.own_error_N
        if own is not None and abs(most) < own:
            return (
                f"No clear difference: {second} differs from {first} by {most:+.0f} N at most, {where}, less "
                f"than the RMS errors of both cards together ({own:.0f} N)."
            )
        mean = 100.0 * float(difference.sum()) / float(before.sum())
        below = float(np.mean(difference < 0.0))
        word = "weaker" if below > 0.5 else "stronger"
        part = max(below, 1.0 - below)
        extent = "everywhere" if part == 1.0 else "nearly everywhere"
        if part < nearly_everywhere_fraction:
            word, extent = "weaker", "in some cases and stronger in others"
        errors = "" if own is None else f"; the RMS errors of both cards together are {own:.0f} N"
        return (
            f"{second} is {word} than {first} {extent} ({mean:+.1f} % on average), most {where}: "
            f"{most:+.0f} N{errors}."
        )


def _names(*files: str) -> tuple[str, str]:
    """Return the names of two cards: the name of the file, or of its folder if the file is ``card.json``."""
    paths = [Path(file) for file in files]
    first, second = (path.absolute().parent.name if path.stem == "card" else path.stem for path in paths)
    return (first, second) if first != second and first and second else ("first", "second")


def compare_cards(first: ModelCard, second: ModelCard, *, names: tuple[str, str] | None = None) -> Comparison:
    """Compare two cards inside their common envelope; differences are second minus first.

    Parameters
    ----------
    names : names of the cards; None: the names of their files

    Raises
    ------
    InputError
        If the commands have different units, or the envelopes have no common part.
    """
    cards = (first, second)
    names = names or _names(first.file, second.file)
    units = [card.damper.command_unit for card in cards]
    if units[0] != units[1]:
        raise InputError(
            found=f"the command of {names[0]} is in {units[0]} and that of {names[1]} in {units[1]}",
            expected="the same unit",
            remedy="Identify both from the same channel",
        )
    ranges = {
        what: _intersection(what, *(getattr(card.envelope, what) for card in cards))
        for what in ("command", "displacement", "velocity")
    }
    temperature, notes = _common_temperature(cards, names)
    envelope = OperatingEnvelope(**ranges, temperature=temperature)
    leading = next((card.damper for card in cards if card.damper.temperature_dependent), first.damper)
    single = [temperature[0]] if temperature is not None and temperature[0] == temperature[1] else None
    scope = default_scope(leading, envelope, temperatures=single)
    for card, name in zip(cards, names, strict=True):
        if card.damper.assumed:
            factors = ", ".join(card.damper.assumed)
            notes.append(f"{name}: the temperature factor of {factors} is assumed from the data of a fluid")
    if first.damper.law.name != second.damper.law.name:
        notes.append("the laws differ, so that their parameters are not compared")
    return Comparison(
        cards=cards,
        names=names,
        envelope=envelope,
        scope=scope,
        found=(characterise(first.damper, scope), characterise(second.damper, scope)),
        parameters=_parameters(cards),
        own_error_N=_combined_error(cards),
        notes=tuple(notes),
    )


def _intersection(what: str, first: Range, second: Range) -> Range:
    low, high = max(first[0], second[0]), min(first[1], second[1])
    if low < high or (low == high and what in {"command", "temperature"}):
        return low, high
    spans = [f"{pair[0]:.4g} to {pair[1]:.4g}" for pair in (first, second)]
    raise InputError(
        found=f"no common envelope: {what} is {spans[0]} in the first card and {spans[1]} in the second (SI)",
        expected="ranges that overlap",
        remedy="Fit both to runs of the same kind",
    )


def _common_temperature(
    cards: tuple[ModelCard, ModelCard], names: tuple[str, str]
) -> tuple[Range | None, list[str]]:
    """Return the temperature range [K] for a comparison, and notes for the user.

    If only one damper depends on temperature, both are compared at one temperature: the mean temperature of
    the runs of the damper without temperature dependence (20 degC if unknown). If no damper depends on
    temperature, the range is missing.
    """
    ranges = [_temperatures_of(card) for card in cards]
    known = [each for each in ranges if each is not None]
    dependent = [card.damper.temperature_dependent for card in cards]
    if all(dependent):
        return (_intersection("temperature", known[0], known[-1]) if known else None), []
    if not any(dependent):
        if len(known) < 2 or np.ptp(known, axis=0).max() <= TEMPERATURE_TOLERANCE_K:
            return None, []
        spans = [f"{to_degC(low):.0f} to {to_degC(high):.0f} degC" for low, high in known]
        tested = ", ".join(f"{name} at {span}" for name, span in zip(names, spans, strict=True))
        return None, [f"tested at different temperatures ({tested}), on which neither model depends"]
    other = dependent.index(False)
    valid, tested_range = (each or (REFERENCE_K, REFERENCE_K) for each in (ranges[1 - other], ranges[other]))
    middle = 0.5 * sum(tested_range)
    at = float(np.clip(middle, *valid))
    if ranges[other] is not None and abs(at - middle) > TEMPERATURE_TOLERANCE_K:
        _intersection("temperature", valid, (middle, middle))
    return (at, at), [f"{names[other]} has no temperature model: both are compared at {to_degC(at):.0f} degC"]


def _temperatures_of(card: ModelCard) -> Range | None:
    """Return the temperature range [K] for the evaluation of a card.

    This is the range of the runs, or for runs at one temperature the range of assumed temperature factors.
    """
    tested, assumed = card.envelope.temperature, card.damper.temperature_range
    single = tested is None or tested[1] - tested[0] < TEMPERATURE_TOLERANCE_K
    if single and card.damper.temperature_dependent and assumed is not None:
        return assumed
    return tested


def _parameters(cards: tuple[ModelCard, ModelCard]) -> tuple[ParameterPair, ...]:
    """Return fitted or different parameters; empty if the hysteresis laws differ."""
    dampers = [card.damper for card in cards]
    if dampers[0].law.name != dampers[1].law.name:
        return ()
    first, second = (damper.parameters for damper in dampers)
    units = {**dampers[1].units, **dampers[0].units}
    found = []
    for name in dict.fromkeys([*first, *second]):
        a, b = first.get(name), second.get(name)
        forms = [damper.coefficients[name.partition(".")[0]] for damper in dampers]
        by_a, by_b = (card.standard_errors.get(name) for card in cards)
        if by_a is None and by_b is None and a == b:
            continue
        z = None
        same_form = forms[0].kind == forms[1].kind and dict(forms[0].settings) == dict(forms[1].settings)
        if same_form and a is not None and b is not None and by_a and by_b:
            z = (b - a) / math.hypot(by_a, by_b)
        found.append(ParameterPair(name, units[name], a, by_a, b, by_b, z))
    return tuple(found)


def _combined_error(cards: tuple[ModelCard, ModelCard]) -> float | None:
    """Return the root sum of squares of the RMS errors of two cards [N], of held-out runs if available."""
    total = 0.0
    for card in cards:
        runs = [run for run in card.evidence.runs if run["split"] == "held_out"] or card.evidence.runs
        if not runs:
            return None
        total += sum(run["rmse_N"] ** 2 for run in runs) / len(runs)
    return math.sqrt(total)
