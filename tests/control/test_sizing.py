"""Target forces and motions are scaled to the force and stroke of a damper."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mrdamper.control.loop import reference_trajectory
from mrdamper.control.score import attainable_range
from mrdamper.control.sizing import SHARES, motions_within, shift_to_temperature, size_targets
from mrdamper.excitation import motion_from_text
from mrdamper.virtual_rig.campaign import default_campaign
from mrdamper.virtual_rig.damper import PRESETS
from mrdamper.virtual_rig.plant import Plant
from tests.control.loops import Ideal


def targets_of(*, low: float, gain: float) -> list[Any]:
    """Return the targets for an ideal damper with currents up to 2 A."""
    return [each.target for each in size_targets(Ideal(low=low, gain=gain), 2.0)]


@pytest.mark.parametrize("size", [1.0, 2.0])
def test_target_amplitude_scales_with_damper_force(size):
    """A damper with the force (50 + 800 I) sign(v) gets targets up to 1650 N in both directions."""
    found = targets_of(low=50.0 * size, gain=800.0 * size)
    assert [each.amplitude_N for each in found] == pytest.approx([1650.0 * size * s for s in SHARES.values()])
    assert [each.offset_N for each in found] == pytest.approx([0.0, 0.0, 0.0])


def test_target_knee_velocity_scales_with_motion():
    """If the stroke doubles at the same frequency, the velocity at the knee of the target doubles."""
    one, two = (
        size_targets(Ideal(), 2.0, ["sine5mm1Hz", "sine3mm2Hz", motion])[2].target
        for motion in ("sine5mm1Hz", "sine:10mm:1Hz")
    )
    assert two.velocity_m_s == pytest.approx(2.0 * one.velocity_m_s, abs=2e-4)  # type: ignore[attr-defined]


def test_proposed_motions_use_stroke_and_speed_limits():
    """The amplitude is 80 % of the nearer stroke limit, or less if the speed limit requires it."""
    slow, fast, other = motions_within((-0.02, 0.01), (-10.0, 12.0))
    assert (slow, fast) == ("sine:8mm:1Hz", "sine:8mm:2Hz")
    time = np.linspace(0.0, 10.0, 20_001)
    assert np.abs(motion_from_text(other).displacement(time)).max() == pytest.approx(8e-3, rel=0.05)
    slow, fast, _ = motions_within((-1.0, 1.0), (-0.5, 0.3))
    assert (slow, fast) == ("sine:38mm:1Hz", "sine:19mm:2Hz")
    assert motions_within((0.0, 0.01), (-1.0, 1.0)) == ()


@pytest.mark.nightly
@pytest.mark.parametrize("degrees", [20.0, 123.0])
def test_targets_are_feasible_for_monotube_damper(degrees: float) -> None:
    """The damper reaches 68 to 92 % of the target samples, although its gas force rises by 50 % when hot."""
    damper = PRESETS["hydraulic-monotube"]
    plant = Plant(damper)
    for target in size_targets(plant, damper.highest_A, default_campaign(damper).motions):
        scenario = shift_to_temperature(plant, target, degrees)
        course = reference_trajectory(scenario, plant.step_s)
        reach = attainable_range(plant, course, degrees, damper.highest_A)
        assert reach.feasible(course.target)[course.scored_from :].mean() > 0.6
