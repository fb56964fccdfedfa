"""Actuation (lags, delay, hysteresis and driver) agrees with closed forms and an integrator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from mrdamper.arrays import FloatArray
from mrdamper.models.actuation import TWO_HYSTERESIS_WEIGHTS, Actuation

T63 = 1.0 - math.exp(-1.0)
times = st.floats(1e-4, 0.5)
shares = st.floats(0.02, 0.98)
actuations = st.builds(
    Actuation, *[st.just(0.0) | times] * 2, second_s=st.just(0.0) | times, delay_s=st.just(0.0) | times
)
levels = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=60)


def a_step(samples: int, at: int = 1) -> FloatArray:
    command = np.ones(samples)
    command[:at] = 0.0
    return command


# ----------------------------------------------------------------------------------- closed forms of the lags


@given(tau=times, share=shares)
def test_single_lag_has_logarithmic_response_time(tau, share):
    """The time is -tau ln(1 - share). The step is a ramp over one sample, which adds 2.5e-4 tau."""
    lag = Actuation(tau, tau)
    assert lag.response_time(T63) == pytest.approx(tau, rel=5e-4)
    assert lag.response_time(share) == pytest.approx(-tau * math.log1p(-share), abs=5e-4 * tau)


@given(tau=times, share=shares)
def test_two_equal_lags_match_lambert_w(tau, share):
    """The time solves 1 - (1 + t/tau) exp(-t/tau) = share, by Lambert's W function (2.146 tau for 63 %)."""
    expected = -tau * (1.0 + float(lambertw((share - 1.0) / math.e, -1).real))
    assert Actuation(tau, tau, tau).response_time(share) == pytest.approx(expected, abs=1e-3 * tau)
    assert Actuation(tau, tau, tau).response_time(T63) == pytest.approx(2.1462 * tau, rel=1e-3)


def ramp_through_two_lags(time: FloatArray, a: float, b: float) -> FloatArray:
    """Return the response of two lags to a ramp: t - (a + b) + (a^2 exp(-t/a) - b^2 exp(-t/b))/(a - b)."""
    fading = (a**2 * np.exp(-time / a) - b**2 * np.exp(-time / b)) / (a - b)
    return np.asarray(time - (a + b) + fading, dtype=np.float64)


def test_ramp_through_two_lags_matches_formula():
    """The ramp is 1 A/s. The first lag is linear between samples, which causes an error of step^2/(8a)."""
    a, b, step = 0.030, 0.012, 1e-4
    time = step * np.arange(3000, dtype=np.float64)
    off = Actuation(a, a, b).apply(time, step) - ramp_through_two_lags(time, a, b)
    assert np.abs(off).max() < step**2 / (8.0 * a)


def test_two_current_lags_converge_with_order_two():
    """The first lag has no discretisation error. The second lag interpolates its input linearly."""
    a, b = 0.030, 0.012

    def error(step: float) -> float:
        time = step * np.arange(round(0.3 / step), dtype=np.float64)
        exact = ramp_through_two_lags(time, a, b)
        return float(np.abs(Actuation(a, a, b).apply(time, step) - exact).max())

    assert math.log(error(1e-3) / error(2.5e-4)) / math.log(4.0) == pytest.approx(2.0, abs=0.1)


@given(tau=times, second=times, delay=times)
def test_delay_adds_to_response_time(tau, second, delay):
    without, late = Actuation(tau, 0.5 * tau, second), Actuation(tau, 0.5 * tau, second, delay)
    resolution = 2e-4 * (delay + 10.0 * (tau + second))
    for share in (0.1, T63, 0.9):
        expected = without.response_time(share) + delay
        assert late.response_time(share) == pytest.approx(expected, abs=resolution)


@given(rise=times, fall=times)
def test_rise_and_fall_have_separate_time_constants(rise, fall):
    """The output rises with one time constant and falls with the other, also for negative commands."""
    both = Actuation(rise, fall)
    resolution = 1e-3 * max(rise, fall)
    assert both.response_time(T63, 0.0, 1.0) == pytest.approx(rise, abs=resolution)
    assert both.response_time(T63, 1.0, 0.0) == pytest.approx(fall, abs=resolution)
    assert both.response_time(T63, 0.0, -2.0) == pytest.approx(rise, abs=resolution)
    assert both.response_time(T63, -2.0, -0.5) == pytest.approx(fall, abs=resolution)


@given(rise=times, fall=times, second=times, delay=times)
def test_area_above_step_response_is_total_lag(rise, fall, second, delay):
    """After a unit step up or down, the area between command and output is the sum of lags and delay."""
    both = Actuation(rise, fall, second, delay)
    step = (rise + fall + second + delay) / 500.0
    up = a_step(15_000)
    lacking = step * np.sum(up - both.apply(up, step))
    assert lacking == pytest.approx(rise + second + delay, rel=1e-6, abs=1e-9)
    left = step * np.sum(both.apply(1.0 - up, step) - (1.0 - up))
    assert left == pytest.approx(fall + second + delay, rel=1e-6, abs=1e-9)


def test_lag_matches_adaptive_integrator():
    """The equation is a' = (c - a)/lag, with lag = rise if |c| > |a|, else fall. The command crosses zero.

    The lag is selected once per sample, so the error decreases with the step.
    """
    rise, fall, omega = 0.02, 0.05, 2.0 * math.pi * 3.0

    def rate(t: float, a: np.ndarray) -> np.ndarray:
        c = 0.3 + math.sin(omega * t)
        return (c - a) / (rise if abs(c) > abs(a[0]) else fall)

    every = 2.5e-4 * np.arange(3200)
    exact = solve_ivp(rate, (0.0, 0.8), [0.3], t_eval=every, rtol=1e-9, atol=1e-11, max_step=1e-4).y[0]

    def error(step: float) -> float:
        stride = round(step / 2.5e-4)
        found = Actuation(rise, fall).apply(0.3 + np.sin(omega * every[::stride]), step)
        return float(np.abs(found - exact[::stride]).max())

    coarse, fine = error(2e-3), error(2.5e-4)
    assert coarse < 0.02
    assert fine < 0.3 * coarse


# ------------------------------------------------------------------------------- free-wheeling and saturation


def test_freewheeling_current_decays_exponentially():
    """The current falls from 2 A as 2 exp(-t / 25 ms) until it reaches the command. A rise is unaffected."""
    actuation, step = Actuation(0.004, 0.0, freewheel_time_s=0.025), 1e-4
    time = step * np.arange(2000)
    to_zero, to_level = np.zeros(2000), np.ones(2000)
    to_zero[0] = to_level[0] = 2.0
    free = 2.0 * np.exp(-time / 0.025)
    np.testing.assert_allclose(actuation.apply(to_zero, step), free, rtol=1e-12)
    np.testing.assert_allclose(actuation.apply(to_level, step), np.maximum(free, 1.0), rtol=1e-12)
    np.testing.assert_array_equal(
        actuation.apply(0.5 + to_level[::-1], step),
        replace(actuation, freewheel_time_s=0.0).apply(0.5 + to_level[::-1], step),
    )
    assert actuation.response_time(0.9, 1.0, 0.0) == pytest.approx(0.025 * math.log(10.0), rel=1e-3)


def test_freewheeling_in_saturated_iron_matches_integrator():
    """An adaptive integrator solves T phi' = -I, phi = I / (1 + I / I_s) with the free-wheeling time T."""
    wheel, bend = 0.08, 1.6
    actuation, step = Actuation(0.004, 0.0, freewheel_time_s=wheel, saturation=bend), 2e-4
    time = step * np.arange(500)
    command = np.zeros(500)
    command[0] = 5.0
    solved = solve_ivp(
        lambda _, i: -i * (1.0 + i / bend) ** 2 / wheel,
        (0.0, time[-1]),
        [5.0],
        t_eval=time,
        rtol=1e-9,
        atol=1e-12,
    )
    applied = actuation.apply(command, step)
    np.testing.assert_allclose(applied, solved.y[0], rtol=2e-4)
    finer = actuation.apply(np.repeat(command, 2)[1:], 0.5 * step)[::2]
    errors = [np.abs(found - solved.y[0]).max() for found in (applied, finer)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)  # The error has second order.
    assert actuation.response_time(0.5, 5.0, 0.0) < 0.3 * actuation.response_time(0.5, 0.5, 0.0)


def test_hysteresis_of_saturated_iron_follows_flux():
    """The output exceeds a falling command by half of the flux change, but at most by the width."""
    actuation = Actuation(0.0, 0.0, hysteresis_width_A=0.1, saturation=1.0)
    felt = actuation.apply(np.array([0.0, 5.0, 1.0, 5.0, 4.0, 4.5]), 1e-3)
    fall = 5.0 / 6.0 - 4.0 / 5.0  # Half of this flux change is smaller than the width.
    back = 5.0 / 6.0 - 4.5 / 5.5
    np.testing.assert_allclose(felt, [0.0, 5.0, 1.1, 5.0, 4.0 + 0.5 * fall, 4.5 + 0.5 * back], rtol=1e-12)


def test_flux_of_saturated_iron_follows_lags():
    """A flux with two equal lags rises as 1 - (1 + t/tau) exp(-t/tau) after a step of the command."""
    tau, bend, step = 0.008, 1.5, 2e-5
    actuation = Actuation(tau, tau, tau, saturation=bend)
    time = step * np.arange(3000)
    left = (1.0 + time / tau) * np.exp(-time / tau)
    end = 4.0 / (1.0 + 4.0 / bend)
    command = np.full(3000, 4.0)
    command[0] = 0.0
    for levels, flux in ((command, end * (1.0 - left)), (4.0 - command, end * left)):
        late = np.interp(time - 0.5 * step, time, flux)  # The command is a ramp in the first sample.
        found = actuation.flux(actuation.apply(levels, step))
        np.testing.assert_allclose(found[1:], late[1:], atol=1e-5 * end)


@given(level=st.floats(0.0, 4.0), bend=st.floats(0.1, 50.0))
def test_flux_and_current_are_inverse_functions(level, bend):
    iron, size = Actuation(0.0, 0.0, saturation=bend), np.array([level])
    np.testing.assert_allclose(iron.current(iron.flux(size)), size, rtol=1e-10)
    np.testing.assert_array_equal(Actuation(0.0, 0.0).current(size), size)
    np.testing.assert_allclose(Actuation(0.0, 0.0, saturation=1e9).flux(size), size, rtol=1e-7)


def test_narrow_and_wide_hysteresis_superpose():
    """A falling command first opens the narrow loop fully. A small rise closes only the narrow loop."""
    narrow, wide = TWO_HYSTERESIS_WEIGHTS
    commands = np.array([0.0, 2.0, 1.9, 1.5, 0.0, 0.3, 2.0])
    felt = Actuation(0.0, 0.0, hysteresis_width_A=0.1, wide_hysteresis_width_A=0.4).apply(commands, 1e-3)
    of_narrow = np.array([0.0, 0.0, 0.1, 0.2, 0.2, 0.0, 0.0])
    of_wide = np.array([0.0, 0.0, 0.1, 0.5, 0.8, 0.5, 0.0])
    np.testing.assert_allclose(felt - commands, narrow * of_narrow + wide * of_wide, atol=1e-12)


@given(actuation=actuations, command=levels, step=st.floats(1e-4, 0.1))
def test_applied_current_has_no_overshoot(actuation, command, step):
    """The applied current is always within the range of past commands."""
    at = np.array(command)
    felt = actuation.apply(at, step)
    assert np.all(felt <= np.maximum.accumulate(at) + 1e-12)
    assert np.all(felt >= np.minimum.accumulate(at) - 1e-12)


@given(actuation=actuations, command=levels, size=st.sampled_from([0.25, 2.0, -1.0, -4.0]))
def test_applied_current_is_proportional_to_command(actuation, command, size):
    """The output is proportional to the command because rise and fall depend only on its absolute value.

    Scaling by powers of two is exact.
    """
    at = np.array(command)
    np.testing.assert_array_equal(
        actuation.apply(size * at, 1e-3), size * actuation.apply(at, 1e-3), strict=True
    )


# ---------------------------------------------------------------------------------------- magnetic hysteresis

slow = np.concatenate([np.linspace(0.0, 2.0, 2001), np.linspace(2.0, 0.5, 1501), np.linspace(0.5, 1.0, 501)])


@pytest.mark.parametrize("width", [0.01, 0.08])
def test_hysteresis_adds_width_to_falling_command(width):
    """After a reversal, the output falls half as fast as the command until they differ by the width."""
    felt = Actuation(0.0, 0.0, hysteresis_width_A=width).apply(slow, 1e-3)
    np.testing.assert_allclose(felt[:2001], slow[:2001], atol=1e-12)
    away = 2001 + int(2e3 * width) + 1
    np.testing.assert_allclose(felt[away:3502], slow[away:3502] + width, atol=1e-12)
    turn = slice(2001, 2001 + int(1e3 * width))
    np.testing.assert_allclose(2.0 - felt[turn], 0.5 * (2.0 - slow[turn]), atol=1e-12)


@given(levels=levels, width=st.floats(1e-3, 0.2))
def test_magnetic_hysteresis_is_bounded_and_even(levels, width):
    """Hysteresis increases the absolute value of the output. Mirrored commands give mirrored outputs."""
    command = np.repeat(np.abs(levels), 3)
    with_hysteresis = Actuation(0.004, 0.006, 0.002, hysteresis_width_A=width).apply(command, 1e-3)
    without = Actuation(0.004, 0.006, 0.002).apply(command, 1e-3)
    assert (with_hysteresis - without >= -1e-12).all()
    assert (with_hysteresis - without <= width + 1e-12).all()
    mirrored = Actuation(0.004, 0.006, 0.002, hysteresis_width_A=width).apply(-command, 1e-3)
    np.testing.assert_allclose(mirrored, -with_hysteresis, atol=1e-12)
