"""The controller's numbers by rule: lags against the matrix exponential, Skogestad's rule, refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mrdamper.control.stepper import Flag
from mrdamper.control.tuning import (
    HORIZON_STEPS,
    LEAD_RATIO,
    check_sampling,
    feedback_gains,
    horizon_end,
    lead_of,
    motion_filter,
    motion_of,
    prediction_of,
    preview_of,
    sampled_actuation,
)
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation

lags = st.sampled_from([0.0, 2e-3, 5e-3, 5.0001e-3, 0.03])


def held(first: float, second: float, time: float) -> tuple[float, float, float]:
    """Return what is left of the first gap and of the second, and what the first leaves in the second."""
    if first == 0.0:
        return 0.0, math.exp(-time / second) if second else 0.0, 0.0
    if second == 0.0:
        return math.exp(-time / first), 0.0, math.exp(-time / first)
    moved = expm(time * np.array([[-1.0 / first, 0.0], [1.0 / second, -1.0 / second]]))
    return float(moved[0, 0]), float(moved[1, 1]), float(moved[1, 0])


@given(rise=lags, fall=lags, second=lags, delay=st.sampled_from([0.0, 1e-3, 2.5e-3]))
def test_what_the_lags_leave_after_a_period_is_the_matrix_exponential(rise, fall, second, delay):
    """And from the end of the dead time to the preview, which is not before the first whole period."""
    period, preview = 1e-3, 8e-3
    found = sampled_actuation(Actuation(rise, fall, second, delay), period, preview)
    up, down = held(rise, second, period), held(fall, second, period)
    assert (found.rise, found.second, found.rise_couple) == pytest.approx(up, abs=1e-9)
    assert (found.fall, found.second, found.fall_couple) == pytest.approx(down, abs=1e-9)
    rest = preview - math.ceil(delay / period) * period
    for ahead, lag in ((found.rise_couple_ahead, rise), (found.fall_couple_ahead, fall)):
        assert ahead == pytest.approx(held(lag, second, rest)[2], abs=1e-9)
    assert found.second_ahead == pytest.approx(held(0.0, second, rest)[1], abs=1e-9)
    for answer, lag in ((found.rise_answer, rise), (found.fall_answer, fall)):
        _, kept, crossed = held(lag, second, preview - delay)
        assert answer == pytest.approx(1.0 - kept - crossed, abs=1e-9)
    assert found.dead_samples + found.dead_part == pytest.approx(delay / period)
    late = second / period * (1.0 - math.exp(-period / second)) if second else 0.0
    assert found.second_ramp == pytest.approx(late, abs=1e-12)
    assert found.wheel == found.bend == 0.0


def test_free_wheeling_and_the_flux_s_bend_come_in_by_their_inverses():
    found = sampled_actuation(Actuation(0.01, 0.01, wheel_s=0.2, saturation=4.0), 1e-3)
    assert (found.wheel, found.bend) == pytest.approx((1.0 / 200.0, 0.25))
    assert found.rise_couple_ahead == 1.0  # no time has passed


@pytest.mark.parametrize(("noise", "density"), [(0.0, 1.0), (1e-5, 0.0), (-1.0, 1.0), (1e-5, math.nan)])
def test_a_motion_without_noise_or_jerk_has_no_filter(noise, density):
    with pytest.raises(InputError, match=f"noise {noise} and density {density}; expected two positive"):
        motion_filter(1e-3, noise, density)


def test_a_period_up_to_the_time_of_95_percent_is_enough():
    actuation = Actuation(0.02, 0.02)
    slowest = actuation.response_time(0.95)  # three time constants
    assert slowest == pytest.approx(-0.02 * math.log(0.05), rel=1e-3)
    check_sampling(actuation, slowest)
    with pytest.raises(
        InputError, match=r"the period is 6.* ms, .* within 59\.9 ms.*Sample at \d+ Hz or faster"
    ):
        check_sampling(actuation, 1.01 * slowest)
    check_sampling(Actuation(0.0, 0.0), 10.0)  # there is nothing to miss
    for one in (Actuation(1e-3, 0.0), Actuation(0.0, 0.0, 1e-3), Actuation(0.0, 0.0, 0.0, 1e-3)):
        with pytest.raises(InputError, match="the period is 10000 ms"):
            check_sampling(one, 10.0)


def test_a_dead_time_of_125_periods_is_kept_and_one_of_126_refused():
    check_sampling(Actuation(0.01, 0.01, delay_s=125.5e-3), 1e-3)
    with pytest.raises(InputError, match=r"dead time of 126\.5 ms is 126 periods; expected at most 125"):
        check_sampling(Actuation(0.01, 0.01, delay_s=126.5e-3), 1e-3)


def test_the_preview_is_the_answer_s_time_and_half_a_period():
    one = Actuation(0.01, 0.01, delay_s=2e-3)
    at = 2e-3 - 0.01 * math.log(1.0 - 0.57)
    assert preview_of(one, 1e-3) == pytest.approx(at + 0.5e-3, rel=1e-3)
    assert preview_of(one, 5e-3) - preview_of(one, 1e-3) == pytest.approx(2e-3)


@given(
    rise=lags,
    fall=lags,
    second=lags,
    delay=st.sampled_from([0.0, 4e-3]),
    slope=st.sampled_from([100.0, 900.0]),
)
def test_the_feedback_is_skogestad_s_rule(rise, fall, second, delay, slope):
    """K = tau / [k (tc + theta)] and Ti = min[tau, 4 (tc + theta)] with a closed loop of tc = theta."""
    period = 1e-3
    tau, theta = max(rise, fall, period), delay + second + period
    gain, rate = feedback_gains(Actuation(rise, fall, second, delay), period, slope)
    assert gain == pytest.approx(tau / (slope * (theta + theta)))
    assert rate == pytest.approx(gain / min(tau, 4.0 * (theta + theta)))


def test_a_lead_undoes_all_lags_as_one_and_none_without():
    gain, keep = lead_of(Actuation(0.01, 0.03, 5e-3, 5e-3), 1e-3)
    assert gain == LEAD_RATIO - 1.0
    assert keep == pytest.approx(math.exp(-1e-3 * LEAD_RATIO / 0.04))
    assert lead_of(Actuation(0.0, 0.0), 1e-3) == (0.0, 0.0)


@pytest.mark.parametrize(("wheel_s", "lag_s"), [(0.0, 0.04), (0.03, 0.01)])
def test_a_horizon_is_the_time_of_its_share_of_the_answer_behind_the_dead_time(wheel_s, lag_s):
    """0.8 of a step; with a driver that only lets go, 0.95 of a fall from the largest command."""
    one = Actuation(lag_s, lag_s, delay_s=3e-3, wheel_s=wheel_s, largest_command=2.0)
    motion = motion_of(1e-3, 1e-3, 1e-5, 1.0, swings=True)
    found = prediction_of(one, 1e-3, motion, 500.0)
    at_once = replace(one, delay_s=0.0)
    time = at_once.response_time(0.8)
    if wheel_s:
        time = max(time, at_once.response_time(0.95, 2.0, 0.0))
    parts = HORIZON_STEPS + 2 * (HORIZON_STEPS - 3) if wheel_s else HORIZON_STEPS
    assert found.step == pytest.approx(time / parts)
    assert found.dead == pytest.approx(3e-3)
    assert horizon_end(found) == pytest.approx(3e-3 + time)
    assert found.samples == 1
    assert found.together == round(found.step / 1e-3)
    assert found.rise == pytest.approx(math.exp(-found.step / lag_s))
    assert found.wheel == (pytest.approx(found.step / wheel_s) if wheel_s else 0.0)
    spread = prediction_of(one, 1e-3, motion, 500.0, spread=True)
    assert spread.samples == 3
    assert spread.dead == pytest.approx(found.dead + 2e-3)
    assert prediction_of(one, 1e-3, motion, -500.0, 2.0).calm == pytest.approx(0.03 * 500.0 + 12.0 * 2.0)


@pytest.mark.parametrize(("delay_s", "dead_s"), [(0.0, 0.0), (2.4e-3, 3e-3), (3e-3, 3e-3), (3.01e-3, 4e-3)])
def test_the_dead_time_of_a_prediction_is_whole_periods(delay_s, dead_s):
    motion = motion_of(1e-3, 1e-3, 1e-5, 1.0, swings=False)
    found = prediction_of(Actuation(0.04, 0.04, delay_s=delay_s), 1e-3, motion, 500.0)
    assert found.dead == pytest.approx(dead_s)


def test_a_filter_of_a_motion_that_swings_expects_less_jerk_and_readings_that_are_held_are_known_as_such():
    any_motion, swings = (motion_of(1e-3, 1e-3, 1e-5, 1.0, swings=each) for each in (False, True))
    gains, left = motion_filter(1e-3, 1e-5, 0.3)
    assert (swings.gain_x, swings.gain_v, swings.gain_a) == pytest.approx(gains)
    assert (swings.speed_noise, swings.bend_noise) == pytest.approx((left[1, 1], left[2, 2]))
    assert any_motion.gain_x > swings.gain_x
    assert any_motion.swing_share == 0.0
    assert swings.swing_share == pytest.approx(1.0 - math.exp(-1e-3))
    time = (1e-3 / gains[2]) ** (1.0 / 3.0)
    assert swings.settle_samples == math.ceil(8.0 * time / 1e-3)
    assert swings.most_swing == pytest.approx(1.0 / (9.0 * time**2))
    assert [motion_of(1e-3, k * 1e-3, 1e-5, 1.0, swings=True).held for k in (1, 2)] == [False, True]


def test_every_flag_is_one_bit_of_its_own():
    assert sorted(each.value for each in Flag) == [1 << k for k in range(len(Flag))]
