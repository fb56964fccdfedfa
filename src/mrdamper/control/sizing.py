"""Targets for a damper of any size, as fractions of the force of this damper.

The three targets of the virtual rig were chosen for a damper with 1.7 kN and 12 mm stroke. For another
damper, each target keeps its ratio of amplitude to damper force. This damper force is simulated at the
largest current and 20 degC. Stroke and speed of the motion stay inside the ranges of the damper. The offset
of the target is the gas force at the test temperature.
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
from mrdamper.control.settings import SETTINGS
from mrdamper.excitation import motion_from_text

SHARES = {"sine-900N-1Hz": 0.55, "sine-1100N-2Hz": 0.65, "non-periodic": 0.6}
"""Amplitude of each target, divided by half the force range (max - min) in its motion at full current."""

_NAMES = dict(zip(SHARES, ("sized-sine-1Hz", "sized-sine-2Hz", "sized-non-periodic"), strict=True))
_FORMS = ("sine:{:.2g}mm:1Hz", "sine:{:.2g}mm:2Hz", "random:{:.2g}mm:0.4-3Hz:1")
PROBE_TIMES_S = np.linspace(0.0, 10.0, 5001)  # times at which the peaks of a motion are searched


def motions_within(stroke: tuple[float, float], speed: tuple[float, float]) -> tuple[str, ...]:
    """Return one motion per target, each within the ranges of displacement [m] and velocity [m/s].

    The result is empty unless both ranges extend to both sides of zero.
    """
    room, fastest = (SETTINGS.motion_ratio_max * min(-low, high) for low, high in (stroke, speed))
    if not min(room, fastest) > 0.0:
        return ()
    found = []
    for form in _FORMS:
        unit = motion_from_text(form.format(1.0))
        largest = (
            np.abs(course).max()
            for course in (unit.displacement(PROBE_TIMES_S), unit.velocity(PROBE_TIMES_S))
        )
        found.append(form.format(min(end / size for end, size in zip((room, fastest), largest, strict=True))))
    return tuple(found)


def size_targets(plant: Plant, highest_A: float, motions: Sequence[str] = ()) -> list[Scenario]:
    """Return the scenarios of the three targets for a damper with currents up to ``highest_A``, at 20 degC.

    ``motions`` contains one motion per target as text for ``motion_from_text``. If ``motions`` is empty, the
    motions of the virtual rig are used.
    """
    found = []
    for name, share, motion in zip_longest(SHARES, SHARES.values(), motions[: len(SHARES)]):
        base = _replace_motion(SCENARIOS[name], motion or SCENARIOS[name].motion)
        low, high = _force_range_at_current(plant, base, highest_A)
        target = replace(
            base.target,  # type: ignore[type-var]  # both target classes have an amplitude and an offset
            amplitude_N=round(share * 0.5 * (high - low), 1),
        )
        sized = replace(base, name=_NAMES[name], target=target, highest_A=highest_A)
        found.append(shift_to_temperature(plant, sized, SETTINGS.sizing_temperature_degC))
    return found


def shift_to_temperature(plant: Plant, scenario: Scenario, temperature_degC: float) -> Scenario:
    """Return a scenario at another temperature; its target offset is the gas force."""
    low, high = _force_range_at_current(plant, scenario, 0.0, temperature_degC)
    target = replace(scenario.target, offset_N=round(0.5 * (low + high), 1))  # type: ignore[type-var]
    return replace(scenario, target=target, temperature_degC=temperature_degC)


def _replace_motion(scenario: Scenario, motion: str) -> Scenario:
    """Return the scenario with another motion, and with v0 scaled by the RMS velocity."""
    target = scenario.target
    if isinstance(target, VelocityTarget):
        times = np.linspace(0.0, scenario.duration_s, 2001)
        speeds = [rms(motion_from_text(each).velocity(times)) for each in (scenario.motion, motion)]
        target = replace(target, velocity_m_s=round(target.velocity_m_s * speeds[1] / speeds[0], 4))
    return replace(scenario, motion=motion, target=target)


def _force_range_at_current(
    plant: Plant,
    scenario: Scenario,
    current: float,
    temperature_degC: float = SETTINGS.sizing_temperature_degC,
) -> tuple[float, float]:
    course = reference_trajectory(scenario, plant.step_s)
    force = plant.copy().advance_many(course.displacement, course.velocity, current, temperature_degC)
    return ends_of(force[course.scored_from :])


def ends_of(force: FloatArray) -> tuple[float, float]:
    """Return the minimum and maximum of a force [N] without short peaks (2.5 and 97.5 % percentiles)."""
    low, high = np.percentile(force, SETTINGS.force_percentiles)
    return float(low), float(high)
