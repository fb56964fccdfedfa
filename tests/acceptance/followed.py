"""Simulation of force tracking with dampers of the virtual rig, and the limits of the force errors."""

from __future__ import annotations

from dataclasses import replace

from mrdamper.control.controllers import ForceController
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import Scenario
from mrdamper.control.score import AttainableRange, Score, attainable_range, combine_worst, score_run
from mrdamper.virtual_rig.plant import STEP_S, Plant, VirtualDamper

TEMPERATURES, SEEDS = (20.0, 60.0, 100.0, 123.0), (1, 2)
SLOW, FAST, UNEVEN = TARGETS = ("sine-900N-1Hz", "sine-1100N-2Hz", "non-periodic")
# Limits [N] of three errors: the largest error, and the largest and RMS errors at samples with a target force
# that the damper can produce. One limit is 176 N instead of 175 N because one sample has an error of at least
# 175.3 N with any controller.
MUST = {
    ("nominal", SLOW): (120.0, 62.5, 21.0),
    ("nominal", FAST): (176.0, 75.0, 25.0),
    ("nominal", UNEVEN): (300.0, 160.0, 33.0),
    ("hard", SLOW): (180.0, 90.0, 33.0),
    ("hard", FAST): (265.0, 125.0, 48.0),
    ("hard", UNEVEN): (400.0, 225.0, 63.0),
}
# Limits of the RMS error relative to the controller of the reference paper
OF_THE_PAPERS = {SLOW: 0.3, FAST: 0.25, UNEVEN: 0.35}

_REACHES: dict[tuple[VirtualDamper, str, float, float], AttainableRange] = {}


def reach(damper: VirtualDamper, scenario: Scenario) -> AttainableRange:
    key = damper, scenario.name, scenario.temperature_degC, scenario.duration_s
    if key not in _REACHES:
        course = reference_trajectory(scenario, STEP_S)
        _REACHES[key] = attainable_range(Plant(damper), course, scenario.temperature_degC, scenario.highest_A)
    # The attainable force is proportional to the force gain of the damper.
    gain = scenario.disturbance.force_gain
    return AttainableRange(gain * _REACHES[key].low, gain * _REACHES[key].high)


def forget_reaches() -> None:
    _REACHES.clear()


def scores(damper: VirtualDamper, controller: ForceController, scenario: Scenario) -> dict[float, Score]:
    """Return the scores at each temperature [degC]: the worst of two runs with different sensor noise."""
    found = {}
    for degrees in TEMPERATURES:
        warm = replace(scenario, temperature_degC=degrees)
        can, resistance = reach(damper, warm), damper.coil_resistance_ohm(degrees)
        runs = [run_loop(Plant(damper), controller, replace(warm, seed=seed)) for seed in SEEDS]
        found[degrees] = combine_worst([score_run(each, can, resistance_ohm=resistance) for each in runs])
    return found


def followed(damper: VirtualDamper, controller: ForceController, scenario: Scenario) -> Score:
    return combine_worst(list(scores(damper, controller, scenario).values()))
