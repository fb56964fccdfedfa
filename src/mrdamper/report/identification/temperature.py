"""Sections of the report on the damper: temperature dependence, and characteristic values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mrdamper.excitation import Sine
from mrdamper.identify.problem import envelope_of
from mrdamper.models.characteristics import (
    Characterisation,
    characterise,
    default_scope,
    pick_evenly,
    steady_cycles,
)
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.report.figures import small_multiples as panels
from mrdamper.report.figures.characteristics import MeasuredPick, PickPanel, peak_velocity
from mrdamper.report.figures.palette import colour_of
from mrdamper.report.figures.runs import PANEL_COLUMNS_MAX
from mrdamper.report.figures.small_multiples import Point, Series
from mrdamper.report.identification.campaign import Campaign
from mrdamper.report.identification.groups import peak_force, pick_of, sine_of

REFERENCE_DISTANCE_MAX_K = 2.5  # A level this close to 20 degC is the reference.


@dataclass(frozen=True, slots=True)
class Warmth:
    """Peak force, relative loss of force and energy versus temperature, with a summary sentence."""

    motion: str
    summary: str
    svg: str
    reference: str
    assumed: bool  # True if all temperature factors were taken from a fluid.


def temperature_section(campaign: Campaign) -> Warmth | None:
    """Return force, relative loss and energy versus temperature, or None without temperature dependence."""
    damper = campaign.fitted.damper
    if not damper.temperature_dependent:
        return None
    envelope = envelope_of(campaign.fitted.training)
    sines = [campaign.runs[error.name] for error in campaign.errors if error.motion == campaign.main]
    motion = (sine_of(sines) if sines else None) or default_scope(damper, envelope).motion
    commands = pick_evenly(campaign.commands or sorted(set(envelope.command)), PANEL_COLUMNS_MAX)
    if campaign.warm:
        low, high = (end + ZERO_CELSIUS_K for end in (campaign.levels.values[0], campaign.levels.values[-1]))
        near = min(campaign.levels.values, key=lambda level: abs(level + ZERO_CELSIUS_K - REFERENCE_K))
        near += ZERO_CELSIUS_K
        reference = near if abs(near - REFERENCE_K) <= REFERENCE_DISTANCE_MAX_K else low
    else:
        low, high = damper.temperature_range or (REFERENCE_K, REFERENCE_K + 100.0)
        reference = float(np.clip(REFERENCE_K, low, high))
    count = 25 if damper.law.kernel is not None else 4  # A law in Python is slow.
    grid = np.linspace(low, high, count)
    found: tuple[list[Series], list[Series], list[Series]] = ([], [], [])
    ends = []
    for command in reversed(commands):
        places = [(motion, command, warm) for warm in (reference, *grid.tolist())]
        first, *cycles = steady_cycles(damper, places)
        at_reference = first.peak_N
        peak = np.array([cycle.peak_N for cycle in cycles])
        energy = np.array([cycle.energy_J for cycle in cycles])
        measured = _measurements(campaign, command, reference)
        ends.append((command, 100.0 * (1.0 - peak[-1] / at_reference), _last(measured[1])))
        label = f"{command:g} {damper.command_unit}"
        colour = colour_of(command, campaign.highest)
        values = (peak, 100.0 * (1.0 - peak / at_reference), energy)
        for series, y, points in zip(found, values, measured, strict=True):
            series.append(Series(label, colour, grid - ZERO_CELSIUS_K, y, points))
    degrees = reference - ZERO_CELSIUS_K
    titles = ("peak force, N", f"loss of peak force since {degrees:.0f} °C, %", "energy per cycle, J")
    label = f"sine {1e3 * motion.amplitude:.3g} mm {motion.frequency:.3g} Hz"
    name = campaign.main or label
    return Warmth(
        name,
        _loss_sentence(name, ends[::-1], high - ZERO_CELSIUS_K, degrees, damper.command_unit),
        panels.against_temperature(
            list(zip(titles, found, strict=True)), "Force and energy over temperature"
        ),
        f"{degrees:.0f} °C",
        bool(damper.assumed),
    )


def _measurements(
    campaign: Campaign, command: float, reference: float
) -> tuple[tuple[Point, ...], tuple[Point, ...], tuple[Point, ...]]:
    """Return measured peak force [N], relative loss [%] and energy per cycle [J] at each temperature."""
    if not campaign.warm or campaign.main is None:
        return (), (), ()
    runs = [(level, campaign.find_run(campaign.main, level, command)) for level in campaign.levels.values]
    known = [(level, error, peak_force(campaign.runs[error.name])) for level, error in runs if error]
    peaks = [Point(level, peak, error.split) for level, error, peak in known if peak is not None]
    first = next(
        (p.y for p in peaks if abs(p.x + ZERO_CELSIUS_K - reference) < REFERENCE_DISTANCE_MAX_K), None
    )
    lost = [] if not first else [Point(p.x, 100.0 * (1.0 - p.y / first), p.split) for p in peaks]
    energies = [Point(level, error.energy_measured_J, error.split) for level, error, _ in known]
    return tuple(peaks), tuple(lost), tuple(energies)


def _last(points: Sequence[Point]) -> float | None:
    return points[-1].y if points else None


def _loss_sentence(
    motion: str,
    ends: Sequence[tuple[float, float, float | None]],
    hottest: float,
    reference: float,
    unit: str,
) -> str:
    """Return a sentence on the loss at the highest temperature, and on its dependence on current."""
    losses = [
        f"{lost:.0f} %"
        + ("" if measured is None else f" (measured {measured:.0f} %)")
        + f" at {command:g} {unit}"
        for command, lost, measured in pick_evenly(ends, 3)
    ]
    head = f"From {reference:.0f} to {hottest:.0f} °C, the peak force of the {motion} decreases by "
    head += ", ".join(losses)
    if len(ends) < 2:
        return f"{head}."
    by_size = sorted(ends, key=lambda end: abs(end[0]))

    def is_falling(values: Sequence[float]) -> bool:
        return all(after < before for before, after in pairwise(values))

    claim = f"The relative loss is smaller at higher {'current' if unit == 'A' else 'voltage'}"
    model = is_falling([lost for _, lost, _ in by_size])
    seen = [measured for _, _, measured in by_size if measured is not None]
    if len(seen) < 2:
        return f"{head}. {claim}{'' if model else ' only for some currents'}."
    both = (model, is_falling(seen))
    if all(both):
        return f"{head}. {claim}, measured and modelled."
    if not any(both):
        return f"{head}. {claim} only for some currents, measured and modelled."
    source = "in the model but not in the measured runs"
    return f"{head}. {claim} {source if model else 'in the measured runs but not in the model'}."


def assumption_sentence(campaign: Campaign) -> str:
    """Return a sentence on coefficients with an assumed temperature dependence, or an empty string."""
    assumed = campaign.fitted.damper.assumed
    if not assumed:
        return ""
    names = ", ".join(name.replace("_", " ") for name in assumed)
    return f"The temperature factor of {names} was taken from a fluid, not fitted to this damper."


@dataclass(frozen=True, eq=False)
class Characteristics:
    """Characteristic values and curves of a damper."""

    found: Characterisation
    svg: str
    titles: tuple[str, ...]  # One for each temperature, empty without temperature dependence.
    motion: str
    assumed: tuple[bool, ...]  # For each temperature: True if it was not tested and the factors are assumed.


def characteristics_section(campaign: Campaign) -> Characteristics:
    """Return force-velocity curves with measured points, dynamic range, response time and gas force."""
    damper = campaign.fitted.damper
    steady = [run for run in campaign.fitted.training if run.run.constant_command is not None]
    envelope = envelope_of(steady or campaign.fitted.training)
    sines = [campaign.runs[error.name] for error in campaign.errors if error.motion == campaign.main]
    motion: Sine | None = sine_of(sines) if sines else None
    scope = default_scope(
        damper,
        envelope,
        commands=pick_evenly(campaign.commands, 5) or None,
        temperatures=[level + ZERO_CELSIUS_K for level in pick_evenly(campaign.levels.values, 3)]
        if campaign.warm
        else None,
        motion=motion,
    )
    found = characterise(damper, scope)
    titles = tuple("" if warm is None else f"{warm - ZERO_CELSIUS_K:.0f} °C" for warm in scope.temperatures)
    assumed = tuple(bool(damper.assumed) and not _is_tested(campaign, warm) for warm in scope.temperatures)
    picks = [
        PickPanel(
            f"{title} (assumed)" if by_fluid else title, (curves,), _picks(campaign, scope.commands, warm)
        )
        for title, by_fluid, curves, warm in zip(
            titles, assumed, found.curves, scope.temperatures, strict=True
        )
    ]
    name = campaign.main if motion is not None else None
    return Characteristics(
        found,
        peak_velocity(picks, damper.command_unit),
        titles,
        name or f"sine {1e3 * scope.motion.amplitude:.3g} mm {scope.motion.frequency:.3g} Hz",
        assumed,
    )


def _is_tested(campaign: Campaign, temperature: float | None) -> bool:
    """Return True if training runs were near a temperature [K]. Runs without temperature count as 20 degC."""
    tested_distance_max_K = 5.0  # Results at a larger distance from tested temperatures use assumed factors.
    tested = envelope_of(campaign.fitted.training).temperature or (REFERENCE_K, REFERENCE_K)
    return (
        temperature is None
        or tested[0] - tested_distance_max_K <= temperature <= tested[1] + tested_distance_max_K
    )


def _picks(
    campaign: Campaign, commands: Sequence[float], temperature: float | None
) -> tuple[MeasuredPick, ...]:
    """Return the measured forces of all sines at a temperature, or of all without temperature dependence."""
    found = []
    if not campaign.warm and not _is_tested(campaign, temperature):
        return ()
    for error in campaign.errors:
        if error.command not in commands or error.command is None:
            continue
        if campaign.warm and temperature is not None:
            level = campaign.levels.level_of(error)
            if level is None or abs(level + ZERO_CELSIUS_K - temperature) > 1e-6:
                continue
        pick = pick_of(campaign.runs[error.name])
        if pick is not None:
            found.append(
                MeasuredPick(error.command, pick.velocity, pick.extension, pick.retraction, error.split)
            )
    return tuple(found)
