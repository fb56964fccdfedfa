"""A default fit represents a damper whose force is larger in extension than in compression.

The equations of the damper differ from all hysteresis models of the package. They describe an asymmetric
valve with tanh, linear and square terms in series with a spring, plus friction and gas. They are integrated
with steps of 50 us.
"""

from __future__ import annotations

import numpy as np
import pytest

import mrdamper
from mrdamper.data.records import Dataset, RigRun

pytestmark = pytest.mark.nightly

RATE_Hz, STEPS = 500.0, 40
# Relative deviations from the mean of extension and compression. In extension, the yield force is 2.2 times
# as large as in compression, and the flow resistance 2.6 times.
YIELD_ASYMMETRY, FLOW_ASYMMETRY = 0.38, 0.44
SPEEDS = np.concatenate([-np.logspace(0.5, -9.0, 4000), [0.0], np.logspace(-9.0, 0.5, 4000)])


def run(amplitude: float, frequency: float, current: float) -> RigRun:
    time = np.arange(0.0, 4.0, 1.0 / RATE_Hz)
    step, stiffness = 1.0 / (RATE_Hz * STEPS), 4e6
    side = np.sign(SPEEDS)
    level = (150.0 + 900.0 * np.tanh(current / 2.2)) * (1.0 + YIELD_ASYMMETRY * side)
    flow = (1250.0 + 300.0 * np.abs(SPEEDS)) * (1.0 + FLOW_ASYMMETRY * side)
    surplus = level * np.tanh(SPEEDS / 4e-3) + flow * SPEEDS + stiffness * step * SPEEDS
    travelled, force = 0.0, []
    for x in amplitude * np.sin(2.0 * np.pi * frequency * step * np.arange(len(time) * STEPS)):
        travelled += step * float(np.interp(stiffness * (x - travelled), surplus, SPEEDS))
        force.append(stiffness * (x - travelled))
    phase = 2.0 * np.pi * frequency * time
    speed = 2.0 * np.pi * frequency * amplitude * np.cos(phase)
    noise = np.random.default_rng(round(1e4 * amplitude + 1e2 * current)).normal(0.0, 4.0, len(time))
    return RigRun(
        name=f"{1e3 * amplitude:g}mm_{frequency:g}Hz_{current:g}A",
        time=time,
        displacement=amplitude * np.sin(phase),
        force=np.array(force)[::STEPS] + 25.0 * np.tanh(speed / 1e-3) + 120.0 + noise,
        command=np.full(len(time), current),
        command_unit="A",
    )


def test_default_fit_represents_asymmetric_damper():
    motions = ((8e-3, 1.0), (8e-3, 3.0), (20e-3, 1.5))
    runs = Dataset(tuple(run(*motion, current) for motion in motions for current in (0.0, 1.0, 2.0, 3.5)))
    card = mrdamper.fit(runs).card()
    assert card.damper.law.name == "chain"
    assert min(card.damper.parameters[f"{each}.value"] for each in ("asymmetry", "flow_asymmetry")) > 0.2
    errors = [each.nrmse_percent for each in mrdamper.evaluate(card, runs)]
    assert np.median(errors) < 3.0
    assert max(errors) < 6.0
