"""Targets by a damper's own force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mrdamper.control.loop import reference_trajectory
from mrdamper.control.scenario import SCENARIOS, VelocityTarget
from mrdamper.control.score import attainable_range
from mrdamper.control.sizing import SHARES, at_temperature, motions_within, sized_targets
from mrdamper.excitation import motion_from_text
from mrdamper.virtual_rig.campaign import usual_campaign
from mrdamper.virtual_rig.damper import PRESETS
from mrdamper.virtual_rig.plant import Plant
from tests.control.loops import Ideal


def asked(*, low: float, gain: float) -> list[Any]:
    """Return the targets of an ideal damper up to 2 A."""
    return [each.target for each in sized_targets(Ideal(low=low, gain=gain), 2.0)]


def test_an_ideal_damper_is_asked_for_shares_of_its_force_at_the_largest_current():
    """(50 + 800 I) sign v: 1650 N at 2 A, as much to either side, and no offset."""
    found = asked(low=50.0, gain=800.0)
    assert [each.amplitude_N for each in found] == pytest.approx([1650.0 * s for s in SHARES.values()])
    assert [each.offset_N for each in found] == pytest.approx([0.0, 0.0, 0.0])


class Thinning(Ideal):
    """An ideal damper that loses a hundredth of its force with each kelvin above 20 degC."""

    def advance_many(self, displacement, velocity, current, temperature_degC):
        cold = super().advance_many(displacement, velocity, current, temperature_degC)
        return cold * (1.0 - 0.01 * (temperature_degC - 20.0))

    def copy(self) -> Thinning:
        return self


def test_targets_are_sized_at_20_degC():
    found = sized_targets(Thinning(low=50.0, gain=800.0), 2.0)
    assert [each.target for each in found] == asked(low=50.0, gain=800.0)
    assert {each.temperature_degC for each in found} == {20.0}


def test_twice_the_damper_is_asked_for_twice_the_force():
    one, two = (asked(low=50.0 * k, gain=800.0 * k) for k in (1.0, 2.0))
    for small, large in zip(one, two, strict=True):
        assert large.amplitude_N == pytest.approx(2.0 * small.amplitude_N)


def test_a_target_that_follows_the_velocity_bends_at_as_much_of_another_motion():
    """Twice the stroke at the same frequency: twice the velocity at which it bends, in tenths of 1 mm/s."""
    one, two = (
        sized_targets(Ideal(), 2.0, ["sine5mm1Hz", "sine3mm2Hz", motion])[2].target
        for motion in ("sine5mm1Hz", "sine:10mm:1Hz")
    )
    assert isinstance(one, VelocityTarget)
    assert isinstance(two, VelocityTarget)
    assert two.velocity_m_s == pytest.approx(2.0 * one.velocity_m_s, abs=2e-4)
    assert [one.velocity_m_s, two.velocity_m_s] == [round(each.velocity_m_s, 4) for each in (one, two)]
    usual = SCENARIOS["non-periodic"]
    times = np.linspace(0.0, usual.duration_s, 40_001)
    motions = (motion_from_text("sine5mm1Hz"), usual.path)
    speeds = [np.sqrt(np.mean(each.velocity(times) ** 2)) for each in motions]
    assert one.velocity_m_s == pytest.approx(0.022 * speeds[0] / speeds[1], rel=0.02)


def test_motions_fill_four_fifths_of_the_nearer_end_of_a_stroke_or_of_a_speed():
    """Sines by hand; 10 s of the random motion reach 0.8 of the room to 5 %, two digits."""
    slow, fast, other = motions_within((-0.02, 0.01), (-10.0, 12.0))
    assert (slow, fast) == ("sine:8mm:1Hz", "sine:8mm:2Hz")
    time = np.linspace(0.0, 10.0, 20_001)
    assert np.abs(motion_from_text(other).displacement(time)).max() == pytest.approx(8e-3, rel=0.05)
    slow, fast, other = motions_within((-1.0, 1.0), (-0.5, 0.3))
    assert (slow, fast) == ("sine:38mm:1Hz", "sine:19mm:2Hz")
    assert np.abs(motion_from_text(other).velocity(time)).max() == pytest.approx(0.24, rel=0.05)
    assert motions_within((0.0, 0.01), (-1.0, 1.0)) == ()
    assert motions_within((-0.01, 0.01), (0.0, 1.0)) == ()


@pytest.mark.nightly
@pytest.mark.parametrize("degrees", [20.0, 123.0])
def test_a_damper_with_gas_can_follow_its_targets_hot_and_cold(degrees: float) -> None:
    """Its gas pushes half as hard again when hot: 68 to 92 % of the samples are within its reach."""
    damper = PRESETS["hydraulic-monotube"]
    plant = Plant(damper)
    for target in sized_targets(plant, damper.highest_A, usual_campaign(damper).motions):
        scenario = at_temperature(plant, target, degrees)
        course = reference_trajectory(scenario, plant.step_s)
        reach = attainable_range(plant, course, degrees, damper.highest_A)
        assert reach.feasible(course.target)[course.scored_from :].mean() > 0.6
