"""Targets for a damper of any size: shares of the force that it has at the largest current and 20 degC.

The three targets of the virtual rig are made for a damper of some 1.7 kN and 12 mm; another one is asked for
as much of its own force, over motions of its own size, around the offset of its gas at that temperature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.control.loop import reference_trajectory
from mrdamper.control.protocol import Plant
from mrdamper.control.scenario import SCENARIOS, Scenario, VelocityTarget
from mrdamper.excitation import motion_from_text

SHARES = {"sine-900N-1Hz": 0.55, "sine-1100N-2Hz": 0.65, "non-periodic": 0.6}
"""Of half the range of the force at the largest current, along the target's motion."""

_NAMES = dict(zip(SHARES, ("sized-sine-1Hz", "sized-sine-2Hz", "sized-non-periodic"), strict=True))
_PERCENTILES = (2.5, 97.5)  # of a force, so that no short peak sizes a target
_ROOM_DEGC = 20.0
_FORMS = ("sine:{:.2g}mm:1Hz", "sine:{:.2g}mm:2Hz", "random:{:.2g}mm:0.4-3Hz:1")
_FILLED = 0.8  # of a known stroke and speed, by a motion's own
_PROBE_S = np.linspace(0.0, 10.0, 5001)  # where a motion is looked at for its largest stroke and speed


def motions_within(stroke: tuple[float, float], speed: tuple[float, float]) -> tuple[str, ...]:
    """Return a motion for each target that keeps within known displacements [m] and velocities [m/s].

    None where the displacements do not lie around zero: then no motion about zero is within them.
    """
    room, fastest = (_FILLED * min(-low, high) for low, high in (stroke, speed))
    if not min(room, fastest) > 0.0:
        return ()
    found = []
    for form in _FORMS:
        unit = motion_from_text(form.format(1.0))
        largest = (np.abs(course).max() for course in (unit.displacement(_PROBE_S), unit.velocity(_PROBE_S)))
        found.append(form.format(min(end / size for end, size in zip((room, fastest), largest, strict=True))))
    return tuple(found)


def sized_targets(plant: Plant, highest_A: float, motions: Sequence[str] = ()) -> list[Scenario]:
    """Return the targets of a damper that takes currents up to ``highest_A``, for 20 degC.

    ``motions`` : one for each target, as ``motion_from_text`` knows them; none: those of the rig
    """
    found = []
    for name, share, motion in zip_longest(SHARES, SHARES.values(), motions[: len(SHARES)]):
        base = _moved(SCENARIOS[name], motion or SCENARIOS[name].motion)
        low, high = _ends(plant, base, highest_A)
        target = replace(
            base.target,  # type: ignore[type-var]  # both kinds have an amplitude and an offset
            amplitude_N=round(share * 0.5 * (high - low), 1),
        )
        sized = replace(base, name=_NAMES[name], target=target, highest_A=highest_A)
        found.append(at_temperature(plant, sized, _ROOM_DEGC))
    return found


def at_temperature(plant: Plant, scenario: Scenario, temperature_degC: float) -> Scenario:
    """Return a sized target for another temperature [degC]: no current can change what the gas gives then."""
    low, high = _ends(plant, scenario, 0.0, temperature_degC)
    target = replace(scenario.target, offset_N=round(0.5 * (low + high), 1))  # type: ignore[type-var]
    return replace(scenario, target=target, temperature_degC=temperature_degC)


def _moved(scenario: Scenario, motion: str) -> Scenario:
    """Return the scenario over another motion; a target that follows the velocity bends at as much of it."""
    target = scenario.target
    if isinstance(target, VelocityTarget):
        times = np.linspace(0.0, scenario.duration_s, 2001)
        speeds = [rms(motion_from_text(each).velocity(times)) for each in (scenario.motion, motion)]
        target = replace(target, velocity_m_s=round(target.velocity_m_s * speeds[1] / speeds[0], 4))
    return replace(scenario, motion=motion, target=target)


def _ends(
    plant: Plant, scenario: Scenario, current: float, temperature_degC: float = _ROOM_DEGC
) -> tuple[float, float]:
    """Return the low and the high end of the force [N] at a constant current."""
    course = reference_trajectory(scenario, plant.step_s)
    force = plant.copy().advance_many(course.displacement, course.velocity, current, temperature_degC)
    return ends_of(force[course.scored_from :])


def ends_of(force: FloatArray) -> tuple[float, float]:
    """Return the low and the high end [N] of a force, without its short peaks."""
    low, high = np.percentile(force, _PERCENTILES)
    return float(low), float(high)
