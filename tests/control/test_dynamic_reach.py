"""What a driver can reach, on dampers behind a first-order lag: all of it known in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mrdamper.control.dynamic_reach import dynamic_range, step_lags
from mrdamper.control.loop import reference_trajectory
from mrdamper.control.scenario import Scenario
from mrdamper.control.score import attainable_range, score_forces
from mrdamper.rig.plant import PRESETS, Plant
from tests.control.loops import Ideal, Lagging, quiet

SHORT = quiet(Scenario(duration_s=1.2, unscored_s=0.1))
HIGHEST_A = 2.0


@dataclass
class OneWay(Lagging):
    """A lag of its own up and down: a driver that cannot pull the current down."""

    rise_s: float = 0.005
    fall_s: float = 0.05

    def __post_init__(self):
        super().__init__(self.rise_s)

    def advance_many(self, displacement, velocity, current, temperature_degC):
        felt = []
        for level in np.broadcast_to(current, velocity.shape).tolist():
            lag_s = self.rise_s if level > self.applied else self.fall_s
            self.applied = level + (self.applied - level) * np.exp(-self.step_s / lag_s)
            felt.append(self.applied)
        return Ideal.advance_many(self, displacement, velocity, np.array(felt), temperature_degC)

    def copy(self):
        other = OneWay(self.rise_s, self.fall_s)
        other.applied = self.applied
        return other


def course_of(plant, scenario=SHORT):
    return reference_trajectory(scenario, plant.step_s)


@pytest.mark.parametrize("lag_s", [0.002, 0.01, 0.04])
def test_the_lag_of_a_first_order_damper_is_its_time_constant(lag_s):
    plant = Lagging(lag_s)
    lags = step_lags(plant, course_of(plant), 20.0, HIGHEST_A)
    assert (lags.rise_s, lags.fall_s) == pytest.approx((lag_s, lag_s), abs=1.01 * plant.step_s)


def test_a_driver_of_one_quadrant_has_its_free_wheel_as_fall():
    lags = step_lags(OneWay(), course_of(OneWay()), 20.0, HIGHEST_A)
    assert (lags.rise_s, lags.fall_s) == pytest.approx((0.005, 0.05), abs=1.01e-4)


def test_the_lag_does_not_change_with_temperature_where_the_damper_s_does_not():
    """The virtual damper's lag to 63 % is some 13 ms at 30 mm/s, hot and cold."""
    plant = Plant(PRESETS["nominal"])
    cold, hot = (step_lags(plant, course_of(plant), degrees, HIGHEST_A) for degrees in (20.0, 123.0))
    assert 0.011 < hot.rise_s < cold.rise_s < 0.016


@pytest.mark.parametrize(("lead_s", "steps", "grain"), [(0.01, 101.0, 20), (1e-5, 2.0, 1)])
def test_so_long_after_it_stood_at_a_current_a_damper_has_gone_its_share_of_the_way_to_either_end(
    lead_s, steps, grain
):
    """F = 50 + 800 i, i' = (I - i) / 10 ms: from 1 A down to exp(-t / tau), up to 2 - exp(-t / tau)."""
    plant = Lagging(0.01)
    plant.applied = 1.0
    course = course_of(plant)
    reach = dynamic_range(plant, course, np.ones(len(course)), 20.0, HIGHEST_A, lead_s=lead_s)
    side = np.where(course.velocity > 0.0, 1.0, -1.0)
    low, high = (np.where(side > 0.0, *ends) for ends in ((reach.low, -reach.high), (reach.high, -reach.low)))
    later = np.exp(-0.0001 * (steps + np.arange(1000) % grain) / 0.01)  # states a fifth of a lag apart
    assert low[100:1100] == pytest.approx(50.0 + 800.0 * later)
    assert high[100:1100] == pytest.approx(50.0 + 800.0 * (2.0 - later))


def test_without_a_lag_it_is_the_reach_at_constant_currents():
    plant = Ideal()
    course = course_of(plant)
    lags = step_lags(plant, course, 20.0, HIGHEST_A)
    found = dynamic_range(plant, course, np.ones(len(course)), 20.0, HIGHEST_A, lead_s=lags.rise_s)
    constant = attainable_range(plant, course, 20.0, HIGHEST_A)
    assert np.array_equal(found.low, constant.low)
    assert np.array_equal(found.high, constant.high)


def test_a_fall_faster_than_the_driver_s_is_feasible_at_constant_currents_and_out_of_its_reach():
    """From 1000 to 500 N at once: a free-wheeling current is within 20 N of it after 50 ms ln(950 / 430)."""
    plant = OneWay()
    course = course_of(plant)
    begin = 2000  # 0.2 s: the motion goes one way until 0.25 s
    after = np.arange(len(course)) >= begin
    target = np.sign(course.velocity) * np.where(after, 500.0, 1000.0)
    falling = after & (course.time < 0.2 + 0.05 * np.log(950.0 / 450.0))  # as fast as the current can
    wanted_A = np.where(falling, 0.0, np.where(after, 0.5625, 1.1875))
    force = plant.copy().advance_many(course.displacement, course.velocity, wanted_A, 20.0)
    constant = attainable_range(plant, course, 20.0, HIGHEST_A)
    dynamic = dynamic_range(plant, course, wanted_A, 20.0, HIGHEST_A, lead_s=0.005)
    part = slice(1000, 2500)  # settled before, one way
    assert constant.feasible(target)[part][500:].all()
    too_fast = 0.05 * np.log(950.0 / 430.0)
    assert (~dynamic.feasible(target)[part]).sum() == pytest.approx(too_fast / plant.step_s, abs=1.0)
    known = replace(constant, dynamic=dynamic).part(part)
    score = score_forces(target[part], force[part], wanted_A[part], known, step_s=1e-4)
    assert score.dynamic_share == pytest.approx(1.0 - too_fast / 0.15, abs=2e-3)
    assert score.rmse_dynamic_N is not None
    assert score.rmse_feasible_N is not None
    assert score.rmse_dynamic_N < 0.1 * score.rmse_feasible_N
