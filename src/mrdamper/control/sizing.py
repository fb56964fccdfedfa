"""Targets for a damper of any size: shares of the force that it has at the largest current and 20 degC.

The three targets of the virtual rig are made for a damper of some 1.7 kN; another one is asked for as much of
its own force, around the offset that its gas gives it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.loop import reference_trajectory
from mrdamper.control.protocol import Plant
from mrdamper.control.scenario import SCENARIOS, Scenario

__all__ = ["SHARES", "sized_targets"]

SHARES = {"sine-900N-1Hz": 0.55, "sine-1100N-2Hz": 0.65, "non-periodic": 0.6}
"""Of half the range of the force at the largest current, along the target's motion."""

_NAMES = dict(zip(SHARES, ("sized-sine-1Hz", "sized-sine-2Hz", "sized-non-periodic"), strict=True))
_PERCENTILES = (2.5, 97.5)  # of a force, so that no short peak sizes a target
_ROOM_DEGC = 20.0


def sized_targets(plant: Plant, highest_A: float) -> list[Scenario]:
    """Return the targets of a damper that takes currents up to ``highest_A``."""
    found = []
    for name, share in SHARES.items():
        base = SCENARIOS[name]
        low, high = (_ends(plant, base, current) for current in (0.0, highest_A))
        target = replace(
            base.target,  # type: ignore[type-var]  # both kinds have an amplitude and an offset
            amplitude_N=round(share * 0.5 * float(high[1] - high[0]), 1),
            offset_N=round(0.5 * float(low[0] + low[1]), 1),
        )
        found.append(replace(base, name=_NAMES[name], target=target, highest_A=highest_A))
    return found


def _ends(plant: Plant, scenario: Scenario, current: float) -> FloatArray:
    """Return the low and the high end of the force [N] at a constant current and 20 degC."""
    course = reference_trajectory(scenario, plant.step_s)
    force = plant.copy().advance_many(course.displacement, course.velocity, current, _ROOM_DEGC)
    return np.percentile(force[course.scored_from :], _PERCENTILES)
