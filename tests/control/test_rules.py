"""Design rules of controllers: sampled lags equal matrix exponentials, and horizons cover response times."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from mrdamper.control.config import Axes
from mrdamper.control.controllers import Safety, controllers_for
from mrdamper.control.settings import SETTINGS
from mrdamper.control.tables.heating import Heating
from mrdamper.control.tuning import (
    check_sampling,
    feedback_gains,
    horizon_end,
    motion_of,
    prediction_of,
    sampled_actuation,
)
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import OperatingEnvelope
from tests.support.cards import DOUBLE

lag_times = st.floats(5e-4, 0.03)
NO_LAG_S = 1e-9  # The smallest lag, because the matrix exponential requires a positive lag


def of_two_lags(first: float, second: float, time: float) -> tuple[float, float, float, float]:
    """Return four coefficients of a time step of two lags in series, from the matrix exponential.

    The gaps g1 and g2 are the differences between a constant command and the outputs of the two lags:
    g1' = -g1 / T1, g2' = (g1 - g2) / T2. The first two coefficients are the fractions of g1 and g2 that
    remain. The third is the fraction of g1 that is added to g2. The fourth is the gap that the second lag
    has after a ramp from 0 to 1.
    """
    one, two = max(first, NO_LAG_S), max(second, NO_LAG_S)
    gaps = expm(time * np.array([[-1.0 / one, 0.0], [1.0 / two, -1.0 / two]]))
    ramp = expm(time * np.array([[-1.0 / two, 1.0 / time], [0.0, 0.0]]))
    return gaps[0, 0], gaps[1, 1], gaps[1, 0], ramp[0, 1]


@given(
    rise=lag_times, fall=lag_times, second=st.floats(0.0, 0.02), delay=st.floats(0.0, 0.01),
    period=st.sampled_from([2e-4, 1e-3, 4e-3]),
)  # fmt: skip
def test_sampled_current_lags_equal_matrix_exponentials(rise, fall, second, delay, period):
    second = 0.0 if second < 1e-5 else second
    actuation = Actuation(
        rise, fall, second, delay, freewheel_time_s=0.04, saturation=1.6, hysteresis_width_A=0.02
    )
    found = sampled_actuation(actuation, period)
    lags = found.lags
    assert found.dead_samples + found.dead_part == pytest.approx(delay / period, abs=1e-9)
    assert 0.0 <= found.dead_part < 1.0
    up, down = (of_two_lags(first, second, period) for first in (rise, fall))
    assert (lags.rise, lags.fall, lags.second) == pytest.approx((up[0], down[0], up[1]), abs=1e-9)
    assert (lags.rise_couple, lags.fall_couple) == pytest.approx((up[2], down[2]), abs=1e-5)
    assert lags.second_ramp == pytest.approx(up[3], abs=1e-5)
    assert lags.freewheel_ratio == pytest.approx(period / 0.04)
    assert (found.inverse_saturation_flux, found.hysteresis_width) == pytest.approx((1.0 / 1.6, 0.02))


def test_sampled_lags_are_correct_if_equal_or_zero():
    """Two equal lags T have the coupling coefficient t/T exp(-t/T). A lag of zero has no effect."""
    period = 2e-3
    same = sampled_actuation(Actuation(0.004, 0.004 * (1.0 + 1e-9), 0.004), period)
    assert same.lags.rise_couple == pytest.approx(0.5 * math.exp(-0.5))
    assert same.lags.fall_couple == pytest.approx(0.5 * math.exp(-0.5), rel=1e-6)
    none = sampled_actuation(Actuation(0.0, 0.0), period)
    lags = none.lags
    assert lags.rise == lags.second == lags.rise_couple == lags.freewheel_ratio == 0.0
    assert none.inverse_saturation_flux == 0.0


@pytest.mark.parametrize("wheel", [0.0, 0.06])
@pytest.mark.parametrize(("delay", "dead"), [(0.0, 0.0), (0.0034, 0.004)])
def test_prediction_horizon_covers_response_time(wheel, delay, dead):
    """The horizon begins after the dead time, rounded up to whole periods, and covers the response time."""
    actuation = Actuation(0.05, 0.045, 0.02, delay, largest_command=2.0, freewheel_time_s=wheel)
    motion = motion_of(1e-3, 1e-3, 1e-6, 30.0, is_harmonic=True)
    found = prediction_of(actuation, 1e-3, motion, -600.0, 12.0)
    without = replace(actuation, delay_s=0.0)
    span, parts = without.response_time(SETTINGS.horizon_ratio), SETTINGS.horizon_steps
    if wheel:
        span, parts = (
            max(span, without.response_time(SETTINGS.freewheel_ratio, 2.0, 0.0)),
            3 + 3 * SETTINGS.freewheel_stretch,
        )
    span = min(span, 122e-3 - dead)  # The delay line has a maximum number of samples.
    assert found.dead == pytest.approx(dead)
    assert horizon_end(found) == pytest.approx(dead + span, rel=1e-9)
    assert found.step == pytest.approx(span / parts)
    up, down = (of_two_lags(first, 0.02, found.step) for first in (0.05, 0.045))
    lags = found.lags
    passed = (lags.rise, lags.fall, lags.second, lags.rise_couple, lags.fall_couple, lags.second_ramp)
    assert passed == pytest.approx((up[0], down[0], up[1], up[2], down[2], up[3]), rel=1e-6)


@pytest.mark.parametrize(("period", "dead"), [(1e-3, 2e-3), (2e-3, 2e-3), (5e-3, 0.0)])
def test_short_dead_time_is_not_predicted(period, dead):
    """A dead time of 1.6 ms is ignored at 200 Hz because the next larger delay, one period, is 5 ms."""
    quick = Actuation(2e-3, 5e-3, 2e-3, 1.6e-3, largest_command=2.0)
    motion = motion_of(period, period, 1e-5, 30.0, is_harmonic=True)
    assert prediction_of(quick, period, motion, 500.0).dead == pytest.approx(dead)


def test_feedback_gains_follow_skogestad_rules():
    """The closed loop has the dead time d as time constant: K = T / (2 k d), integral time min(T, 8 d)."""
    actuation = Actuation(0.03, 0.02, 0.002, 0.001)
    dead, force_per_ampere = 0.001 + 0.002 + 1e-3, 700.0
    for slow in (actuation, replace(actuation, rise_s=0.1)):
        gain, rate = feedback_gains(slow, 1e-3, force_per_ampere)
        assert gain == pytest.approx(slow.rise_s / (force_per_ampere * 2.0 * dead))
        assert gain / rate == pytest.approx(min(slow.rise_s, 8.0 * dead))


def test_safety_times_are_converted_to_sample_counts():
    safety = Safety(stroke_times=7.0, frozen_s=0.03, coast_s=0.11, back_s=0.05, slew_K_s=15.0, recover_s=1.2)
    axes = Axes(period=2e-3, largest=2.0, coldest=280.0, warmest=400.0)
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.009), (-0.2, 0.3), (280.0, 400.0))
    found = safety.faults(axes, envelope, frozen_speed_min=0.01)
    assert (found.displacement_limit, found.speed_limit) == pytest.approx((7.0 * 0.012, 7.0 * 0.3))
    assert (found.frozen_samples, found.coast_samples, found.recovery_samples) == (15, 55, 25)
    heat = Heating(capacity_J_K=900.0, loss_W_K=1.5).config("A", extrapolate=True)
    warm = safety.thermometer(axes, heat)
    assert (warm.recover_samples, warm.nominal) == (600, 340.0)
    assert warm.change_max == pytest.approx(0.03)
    assert warm.hold_samples == round(600.0 / 2e-3)  # The time is the heat capacity divided by the heat loss.


def test_sensor_on_slow_bus_counts_as_stuck_later():
    """A sensor that repeats its readings for 40 ms by design counts as stuck after 2.5 times 40 ms."""
    slow = controllers_for(DOUBLE, displacement_period_s=0.04)["recommended"]
    assert slow.config.faults.frozen_samples == 100
    assert slow.config.motion.holds_readings


@pytest.mark.parametrize(("noise", "density"), [(0.0, SETTINGS.jerk_density), (1e-5, 0.0), (1e-5, math.nan)])
def test_motion_filter_rejects_zero_noise(noise, density):
    with pytest.raises(InputError, match="expected two positive"):
        motion_of(1e-3, 1e-3, noise, density, is_harmonic=False)


def test_sampling_slower_than_lag_is_rejected():
    actuation = Actuation(0.02, 0.02)
    slowest = actuation.response_time(0.95)
    check_sampling(actuation, slowest)
    with pytest.raises(InputError, match=r"Sample at \d+ Hz or faster"):
        check_sampling(actuation, 1.01 * slowest)
