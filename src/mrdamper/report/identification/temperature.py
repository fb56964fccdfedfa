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
from mrdamper.report.figures.characteristics import PickPanel, peak_velocity_figure
from mrdamper.report.figures.runs import PANEL_COLUMNS_MAX
from mrdamper.report.figures.small_multiples import Line, Panel, Point, panel_figure
from mrdamper.report.figures.style import colour_of
from mrdamper.report.identification.campaign import Campaign, peak_force, pick_of, sine_of
from mrdamper.report.sections import Picture

REFERENCE_DISTANCE_MAX_K = 2.5  # Force losses refer to a tested temperature this close to 20 degC.


@dataclass(frozen=True, slots=True)
class Warmth:
    """Figure (``svg``) and summary of force, force loss and energy versus temperature."""

    motion: str
    summary: str
    picture: Picture
    assumed: bool  # True if temperature factors were taken from a fluid instead of fitted


def temperature_section(campaign: Campaign) -> Warmth | None:
    """Return the section on temperature; None if the damper model ignores temperature."""
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
    count = 25 if damper.law.kernel is not None else 4  # Hysteresis models without compiled code are slow.
    grid = np.linspace(low, high, count)
    drawn: tuple[list[Line], list[Line], list[Line]] = ([], [], [])
    ends = []
    for command in reversed(commands):
        places = [(motion, command, warm) for warm in (reference, *grid.tolist())]
        first, *cycles = steady_cycles(damper, places)
        peak = np.array([cycle.peak_N for cycle in cycles])
        loss = 100.0 * (1.0 - peak / first.peak_N)
        energy = np.array([cycle.energy_J for cycle in cycles])
        measured = _measurements(campaign, command, reference)
        ends.append((command, float(loss[-1]), measured[1][-1].y if measured[1] else None))
        colour, label = colour_of(command, campaign.highest), f"{command:g} {damper.command_unit}"
        for lines, y, points in zip(drawn, (peak, loss, energy), measured, strict=True):
            lines.append(Line(grid - ZERO_CELSIUS_K, y, colour, label, points=points))
    degrees = reference - ZERO_CELSIUS_K
    titles = ("peak force, N", f"loss of peak force since {degrees:.0f} °C, %", "energy per cycle, J")
    panels = [Panel(title, "temperature, °C", lines) for title, lines in zip(titles, drawn, strict=True)]
    name = campaign.main or f"sine {1e3 * motion.amplitude:.3g} mm {motion.frequency:.3g} Hz"
    return Warmth(
        name,
        _loss_sentence(name, ends[::-1], high - ZERO_CELSIUS_K, degrees, damper.command_unit),
        Picture("Force and energy over temperature", lambda: panel_figure(panels, height=1.8, legend="")),
        bool(damper.assumed),
    )


def _measurements(
    campaign: Campaign, command: float, reference: float
) -> tuple[tuple[Point, ...], tuple[Point, ...], tuple[Point, ...]]:
    """Return measured points of peak force [N], force loss [%], energy per cycle [J]."""
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


def _loss_sentence(
    motion: str,
    ends: Sequence[tuple[float, float, float | None]],
    hottest: float,
    reference: float,
    unit: str,
) -> str:
    """Return sentences on the force loss at the highest temperature, and on its dependence on current."""
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
    some = " only for some currents"
    model = is_falling([lost for _, lost, _ in by_size])
    seen = [measured for _, _, measured in by_size if measured is not None]
    if len(seen) < 2:
        return f"{head}. {claim}{'' if model else some}."
    if model == is_falling(seen):
        return f"{head}. {claim}{'' if model else some}, measured and modelled."
    if model:
        return f"{head}. {claim} in the model but not in the measured runs."
    return f"{head}. {claim} in the measured runs but not in the model."


@dataclass(frozen=True, eq=False)
class Characteristics:
    """Characteristic values and curves of a damper."""

    found: Characterisation
    picture: Picture
    titles: tuple[str, ...]  # each temperature as text; "" if the damper model ignores temperature
    motion: str
    assumed: tuple[bool, ...]  # True for untested temperatures with assumed temperature factors


def characteristics_section(campaign: Campaign) -> Characteristics:
    """Return the section on force-velocity curves, dynamic range, response time and gas force of a damper."""
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
        Picture("Peak-velocity-pick curves", lambda: peak_velocity_figure(picks, damper.command_unit)),
        titles,
        name or f"sine {1e3 * scope.motion.amplitude:.3g} mm {scope.motion.frequency:.3g} Hz",
        assumed,
    )


def _is_tested(campaign: Campaign, temperature: float | None) -> bool:
    """Return True if a temperature [K] is in or near the range of the training runs.

    Runs without a measured temperature count as 20 degC.
    """
    tested_distance_max_K = 5.0  # max distance from the range of tested temperatures
    tested = envelope_of(campaign.fitted.training).temperature or (REFERENCE_K, REFERENCE_K)
    return (
        temperature is None
        or tested[0] - tested_distance_max_K <= temperature <= tested[1] + tested_distance_max_K
    )


def _picks(
    campaign: Campaign, commands: Sequence[float], temperature: float | None
) -> dict[float, list[Point]]:
    """Return the measured forces at peak velocity at a temperature, by current."""
    found: dict[float, list[Point]] = {}
    if not campaign.warm and not _is_tested(campaign, temperature):
        return found
    for error in campaign.errors:
        if error.command not in commands or error.command is None:
            continue
        if campaign.warm and temperature is not None:
            level = campaign.levels.level_of(error)
            if level is None or abs(level + ZERO_CELSIUS_K - temperature) > 1e-6:
                continue
        if (pick := pick_of(campaign.runs[error.name])) is not None:
            found.setdefault(error.command, []).extend(
                Point(1e3 * pick.velocity, force, error.split) for force in (pick.extension, pick.retraction)
            )
    return found
