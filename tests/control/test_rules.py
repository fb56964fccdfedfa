"""Rules of the controllers: lags over a time against matrix exponentials, horizons against response times."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mrdamper.control.config import Axes, InverseMethod
from mrdamper.control.controllers import Safety, controllers_for
from mrdamper.control.stepper import Flag
from mrdamper.control.tables.heating import Heating
from mrdamper.control.tuning import (
    CALM_SHARE,
    CALM_TIMES,
    HORIZON_SHARE,
    HORIZON_STEPS,
    JERK_DENSITY,
    PREVIEW_SHARE,
    SWING_JERK,
    WHEEL_SHARE,
    WHEEL_STRETCH,
    actuation_of,
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
from mrdamper.models.damper import OperatingEnvelope
from tests.control.dampers import DOUBLE

lags = st.floats(5e-4, 0.03)
NEXT_TO_NONE = 1e-9  # stands for a lag that is not there


def of_two_lags(first: float, second: float, time: float) -> tuple[float, float, float, float]:
    """Return what is left of each gap, what the first leaves in the second, and how late a ramp is.

    Gaps to a held command obey g1' = -g1 / T1, g2' = (g1 - g2) / T2.
    """
    one, two = max(first, NEXT_TO_NONE), max(second, NEXT_TO_NONE)
    gaps = expm(time * np.array([[-1.0 / one, 0.0], [1.0 / two, -1.0 / two]]))
    # the lag of a ramp r' = 1 / time, y' = (r - y) / T2, from rest: the gap r - y
    ramp = expm(time * np.array([[-1.0 / two, 1.0 / time], [0.0, 0.0]])) if time > 0.0 else np.eye(2)
    late = ramp[0, 1] if time > 0.0 else float(second > 0.0)
    return gaps[0, 0], gaps[1, 1], gaps[1, 0], late


@given(
    rise=lags, fall=lags, second=st.floats(0.0, 0.02), delay=st.floats(0.0, 0.01),
    period=st.sampled_from([2e-4, 1e-3, 4e-3]), preview=st.floats(0.0, 0.05),
)  # fmt: skip
def test_what_a_held_command_leaves_of_two_lags_is_the_matrix_exponential_s(
    rise, fall, second, delay, period, preview
):
    second = 0.0 if second < 1e-5 else second
    actuation = Actuation(rise, fall, second, delay, wheel_s=0.04, saturation=1.6, play=0.02)
    found = sampled_actuation(actuation, period, preview)
    assert found.dead_samples + found.dead_part == pytest.approx(delay / period, abs=1e-9)
    assert 0.0 <= found.dead_part < 1.0
    up, down = (of_two_lags(first, second, period) for first in (rise, fall))
    assert (found.rise, found.fall, found.second) == pytest.approx((up[0], down[0], up[1]), abs=1e-9)
    assert (found.rise_couple, found.fall_couple) == pytest.approx((up[2], down[2]), abs=1e-5)
    assert found.second_ramp == pytest.approx(up[3], abs=1e-5)
    rest = max(preview - math.ceil(delay / period - 1e-9) * period, 0.0)
    up, down = (of_two_lags(first, second, rest) for first in (rise, fall))
    ahead = (found.second_ahead, found.rise_couple_ahead, found.fall_couple_ahead)
    if rest > 1e-6:
        assert ahead == pytest.approx((up[1], up[2], down[2]), abs=1e-5)
        assert found.second_ramp_ahead == pytest.approx(up[3], abs=1e-5)
    assert (found.wheel, found.wheel_ahead) == pytest.approx((period / 0.04, rest / 0.04))
    free = max(preview - delay, 0.0)
    up, down = (of_two_lags(first, second, free) for first in (rise, fall))
    if free > 1e-6:
        answers = [1.0 - each[1] - each[2] for each in (up, down)]
        assert (found.rise_answer, found.fall_answer) == pytest.approx(answers, abs=1e-5)
    assert (found.bend, found.play) == pytest.approx((1.0 / 1.6, 0.02))
    assert not found.no_lag


def test_two_lags_that_are_equal_and_lags_that_are_not_there_have_their_limits():
    period = 2e-3
    same = sampled_actuation(Actuation(0.004, 0.004 * (1.0 + 1e-9), 0.004), period)
    assert same.rise_couple == pytest.approx(0.5 * math.exp(-0.5))
    assert same.fall_couple == pytest.approx(0.5 * math.exp(-0.5), rel=1e-6)
    none = sampled_actuation(Actuation(0.0, 0.0), period, 0.01)
    assert (none.rise, none.second, none.rise_couple, none.wheel, none.bend) == (0.0,) * 5
    assert (none.rise_answer, none.fall_answer) == (1.0, 1.0)
    alone = sampled_actuation(Actuation(0.0, 0.0, 0.004), period)
    assert (alone.rise, alone.rise_couple, alone.second) == pytest.approx((0.0, 0.0, math.exp(-0.5)))
    here = sampled_actuation(Actuation(0.004, 0.004, 0.003), period)  # no preview: all of it is still to come
    assert (here.second_ahead, here.second_ramp_ahead, here.rise_answer) == (1.0, 1.0, 0.0)


def test_a_damper_s_own_lag_is_its_actuation_where_it_has_no_other():
    lagging = replace(DOUBLE, actuation=None, command_lag_s=0.007)
    assert actuation_of(lagging) == Actuation(0.007, 0.007)
    assert actuation_of(DOUBLE) is DOUBLE.actuation


@given(rise=st.floats(0.0, 0.02), second=st.floats(0.0, 0.01), delay=st.floats(0.0, 0.01))
def test_the_preview_is_the_answer_s_and_half_a_period(rise, second, delay):
    actuation = Actuation(rise, rise, second, delay)
    none = rise == second == delay == 0.0
    answer = 0.0 if none else actuation.response_time(PREVIEW_SHARE)
    assert preview_of(actuation, 2e-3) == pytest.approx(answer + 1e-3)


@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize(("period", "held"), [(1e-3, 1e-3), (1e-3, 5e-3)])
def test_a_motion_is_read_as_often_as_its_readings_change(period, held, swings):
    """Kalman's filter for the held period; a swing that is three times slower than the filter is believed."""
    found = motion_of(period, held, 12e-6, JERK_DENSITY, swings=swings)
    gain, left = motion_filter(held, 12e-6, JERK_DENSITY * (SWING_JERK if swings else 1.0))
    assert (found.gain_x, found.gain_v, found.gain_a) == tuple(gain)
    assert (found.speed_noise, found.bend_noise) == (left[1, 1], left[2, 2])
    time = (held / gain[2]) ** (1.0 / 3.0)
    assert found.settle_samples == math.ceil(8.0 * time / period)
    assert found.most_swing == pytest.approx((3.0 * time) ** -2.0, rel=1e-5)
    assert found.held == (held > period)
    assert found.swing_share == pytest.approx(1.0 - math.exp(-period) if swings else 0.0)


@pytest.mark.parametrize("wheel", [0.0, 0.06])
@pytest.mark.parametrize(("delay", "dead"), [(0.0, 0.0), (0.0034, 0.004)])
def test_a_horizon_ends_where_enough_of_a_step_has_passed(wheel, delay, dead):
    """Behind the dead time, in whole periods; its steps go through the lags exactly."""
    actuation = Actuation(0.05, 0.045, 0.02, delay, largest_command=2.0, wheel_s=wheel)
    motion = motion_of(1e-3, 1e-3, 1e-6, 30.0, swings=True)
    found = prediction_of(actuation, 1e-3, motion, -600.0, 12.0)
    without = replace(actuation, delay_s=0.0)
    span = without.response_time(HORIZON_SHARE)
    parts = HORIZON_STEPS
    if wheel:
        span, parts = max(span, without.response_time(WHEEL_SHARE, 2.0, 0.0)), 3 + 3 * WHEEL_STRETCH
    longest = 122e-3 - dead
    assert found.dead == pytest.approx(dead)
    assert horizon_end(found) == pytest.approx(dead + min(span, longest), rel=1e-9)
    assert found.step == pytest.approx(min(span, longest) / parts)
    assert found.together == round(found.step / 1e-3)
    assert found.calm == pytest.approx(CALM_SHARE * 600.0 + CALM_TIMES * 12.0)
    up, down = (of_two_lags(first, 0.02, found.step) for first in (0.05, 0.045))
    passed = (found.rise, found.fall, found.second, found.rise_couple, found.fall_couple, found.second_ramp)
    assert passed == pytest.approx((up[0], down[0], up[1], up[2], down[2], up[3]), rel=1e-6)
    assert found.wheel == pytest.approx(found.step / wheel if wheel else 0.0)


@pytest.mark.parametrize(("period", "dead"), [(1e-3, 2e-3), (2e-3, 2e-3), (5e-3, 0.0), (1e-2, 0.0)])
def test_a_dead_time_of_a_small_part_of_a_slow_period_is_none(period, dead):
    """1.6 ms at 100 Hz: a horizon that began a whole period later would plan for the wrong 8 ms."""
    quick = Actuation(2e-3, 5e-3, 2e-3, 1.6e-3, largest_command=2.0)
    motion = motion_of(period, period, 1e-5, 30.0, swings=True)
    assert prediction_of(quick, period, motion, 500.0).dead == pytest.approx(dead)


def test_no_step_of_a_horizon_is_shorter_than_a_period_or_a_quarter_of_the_motion_filter_s_time():
    quick = Actuation(1e-4, 1e-4, largest_command=2.0)
    sharp, blunt = (motion_of(1e-3, 1e-3, noise, 30.0, swings=False) for noise in (1e-9, 1e-4))
    assert prediction_of(quick, 1e-3, sharp, 500.0).step == 1e-3
    step = prediction_of(quick, 1e-3, blunt, 500.0).step
    assert step == pytest.approx(0.25 * (1e-3 / blunt.gain_a) ** (1.0 / 3.0), rel=1e-6)
    assert step > 1e-3


def test_feedback_is_skogestad_s_and_the_lead_is_of_all_lags_together():
    """Closed loop as slow as its dead time: K = T / (2 k d), and the integral over min(T, 8 d)."""
    actuation = Actuation(0.03, 0.02, 0.002, 0.001)
    dead, gain_of = 0.001 + 0.002 + 1e-3, 700.0
    for slow in (actuation, replace(actuation, rise_s=0.1)):
        gain, rate = feedback_gains(slow, 1e-3, gain_of)
        assert gain == pytest.approx(slow.rise_s / (gain_of * 2.0 * dead))
        assert gain / rate == pytest.approx(min(slow.rise_s, 8.0 * dead))
    assert lead_of(actuation, 1e-3) == pytest.approx((4.0, math.exp(-1e-3 / (0.033 / 5.0))))
    assert lead_of(Actuation(0.0, 0.0), 1e-3) == (0.0, 0.0)


def test_what_is_said_in_seconds_is_counted_in_periods_and_reaches_are_times_the_data_s():
    """And without data, a metre and 100 m/s; what must be seen at all is seen at least once."""
    safety = Safety(
        stroke_times=7.0, frozen_s=0.03, coast_s=0.11, back_s=0.05, fall_back=0.3, slew_K_s=15.0, jump_K=9.0,
        smooth_s=0.4, recover_s=1.2, coil_gap_K=21.0, coil_s=0.16, cold_K=240.0, hot_K=420.0,
    )  # fmt: skip
    axes = Axes(period=2e-3, largest=2.0, coldest=280.0, warmest=400.0)
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.009), (-0.2, 0.3), (280.0, 400.0))
    found = safety.faults(axes, envelope, frozen_speed=0.01)
    assert (found.far_x, found.far_v) == pytest.approx((7.0 * 0.012, 7.0 * 0.3))
    assert (found.frozen_samples, found.coast_samples, found.back_samples) == (15, 55, 25)
    assert (found.fall_back, found.frozen_speed) == (0.3, 0.01)
    assert safety.faults(replace(axes, largest=0.2), envelope, frozen_speed=0.0).fall_back == 0.2
    nowhere = safety.faults(replace(axes, period=1.0), None, frozen_speed=0.0)
    assert (nowhere.far_x, nowhere.far_v) == (1.0, 100.0)
    assert (nowhere.frozen_samples, nowhere.coast_samples, nowhere.back_samples) == (2, 1, 1)
    heat = Heating(capacity_J_K=900.0, loss_W_K=1.5).config("A", extrapolate=True)
    warm = safety.thermometer(axes, heat)
    assert (warm.cold_limit, warm.hot_limit, warm.jump, warm.coil_gap) == (240.0, 420.0, 9.0, 21.0)
    assert warm.slew == pytest.approx(0.03)
    assert warm.keep == pytest.approx(math.exp(-2e-3 / 0.4))
    assert (warm.recover_samples, warm.coil_samples, warm.nominal) == (600, 80, 340.0)
    assert warm.hold_samples == round(600.0 / 2e-3)  # as long as the damper keeps its heat
    kept = safety.thermometer(axes, replace(heat, loss=1e-3))
    assert kept.hold_samples == round(1800.0 / 2e-3)
    for changed in (replace(heat, extrapolate=False), replace(heat, capacity=0.0)):
        assert safety.thermometer(axes, changed).hold_samples == round(10.0 / 2e-3)
    stated = replace(safety, hold_s=0.7, nominal_K=330.0).thermometer(axes, heat)
    assert (stated.hold_samples, stated.nominal) == (350, 330.0)


def test_a_controller_s_parts_go_by_its_sampling_and_by_the_force_of_its_tables():
    """The names differ in what the module says, and in nothing else; learning counts in seconds."""
    made = controllers_for(DOUBLE, period_s=2e-3, force_error_N=17.0)
    base = made["recommended"].config
    tables = made["recommended"].tables
    rows = tables.at(343.15)
    gain = float((rows[6:8, -1] - rows[6:8, 0]).sum()) / 2.0
    peak = max(float(tables.at(kelvin)[6:8].sum(axis=0).max()) for kelvin in tables.temperatures)
    assert base.learning.error_variance == pytest.approx((0.05 * peak) ** 2 * 150.0, rel=1e-9)
    assert base.learning.gain_variance == pytest.approx(0.09)
    assert (base.learning.offset_samples, base.learning.offset_error) == (50, 17.0)
    assert base.inverse.margin == pytest.approx(0.05 * 2.0)
    noise = math.sqrt(base.motion.speed_noise)
    assert (base.feedback.full_speed, base.faults.frozen_speed) == pytest.approx((4.0 * noise, 8.0 * noise))
    assert base.law.substeps == 2
    feedback, lead, learns = base.feedback, base.inverse, base.learning
    assert (feedback.gain, feedback.rate, lead.lead, lead.lead_keep) == (0.0,) * 4  # what is off
    assert (learns.observe, learns.forget, learns.offset_share) == (0.0,) * 3
    assert made["predictive"].config.prediction.calm == pytest.approx(0.03 * gain, rel=1e-6)
    unclamped = made["predictive"].config.inverse
    assert (unclamped.margin, unclamped.compensation) == (-1.0, 0.0)
    rare = controllers_for(DOUBLE, displacement_period_s=0.04)["recommended"]  # two readings and a half
    assert (base.faults.frozen_samples, rare.config.faults.frozen_samples) == (10, 100)
    learned = ("adaptive", "observer", "offset")
    learning = {name: made[f"recommended-{name}"].config.learning for name in learned}
    assert learning["adaptive"].forget == pytest.approx(math.exp(-2e-3 / 60.0))
    assert learning["observer"].observe == pytest.approx(1.0 - math.exp(-2e-3 / 0.15))
    assert learning["offset"].offset_share == pytest.approx(1.0 - math.exp(-2e-3 / 5.0))
    for name, models in (("paper", 5), ("paper-2", 2), ("paper-3", 3), ("paper-9", 9), ("paper-preview", 5)):
        assert made[name].config.inverse.models == models
    assert made["paper"].config.actuation == replace(base.actuation, no_lag=True, play=0.0)
    assert made["paper-preview"].config.actuation == replace(base.actuation, play=0.0)
    assert made["exact"].config == replace(
        base, inverse=replace(base.inverse, compensation=0.0, margin=-1.0, preview=0.0)
    )
    assert made["pi"].config.inverse.method is InverseMethod.NONE
    assert made["feed-forward-pi"].config.feedback == made["pi"].config.feedback
    assert made["paper-unaware"].config.thermometer.held == 293.15


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


def test_every_flag_is_one_bit_of_its_own():
    assert sorted(each.value for each in Flag) == [1 << k for k in range(len(Flag))]
