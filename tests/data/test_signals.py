"""Smoothing and differentiation of signals agree with closed forms and known noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.motion import describe_motion, velocity_band
from mrdamper.data.signals import (
    differentiate,
    knot_spacing,
    measure_spectrum,
    smooth,
)
from mrdamper.excitation import Chirp, Harmonics, Sine, Triangle

MAINS_Hz = [times * mains + 0.3 for mains in (50.0, 60.0) for times in (1, 2, 3, 4, 5)]


@given(power=st.integers(0, 6), at=st.integers(0, 29))
def test_differentiation_is_exact_for_polynomials(power, at):
    t = np.linspace(0.0, 1.0, 30)
    slope = power * t[at] ** max(power - 1, 0)
    assert differentiate(t**power, t[1])[at] == pytest.approx(slope, abs=1e-9)


def test_differentiation_has_sixth_order():
    errors = []
    for rate in (40.0, 80.0, 160.0):
        t = np.arange(4 * rate + 1) / rate
        errors.append(np.max(np.abs(differentiate(np.sin(7.0 * t), 1 / rate) - 7.0 * np.cos(7.0 * t))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([6.0, 6.0], abs=0.5)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
@pytest.mark.parametrize("sigma", [2e-6, 2e-5])
def test_noise_of_signal_is_measured(rate, sigma):
    """The result is a median over a quarter of the frequencies. Its standard error is 2.5 %."""
    t = np.arange(20 * rate + 1) / rate
    noise = sigma * np.random.default_rng(1).standard_normal(len(t))
    x = Chirp(0.002, 0.5, 15.0, 20.0).displacement(t) + noise
    assert measure_spectrum(x, 1 / rate).noise == pytest.approx(sigma, rel=0.05)


def test_periodic_rounding_counts_as_noise():
    """The sine has 500 samples per period, so the rounding errors repeat in each period."""
    x = np.round(0.01 * np.sin(4 * np.pi * np.arange(7001) / 1000.0), 6)
    assert measure_spectrum(x, 1e-3).noise == pytest.approx(1e-6 / np.sqrt(12.0), rel=0.1)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_clean_sine_is_not_smoothed(rate):
    """A sine with 39 or 195 samples per cycle is not smoothed, and its velocity error is below 1e-4."""
    sine = Sine(0.002, 200.0 / 39)
    t = np.arange(5 * rate + 1) / rate
    x = sine.displacement(t)
    cutoff = measure_spectrum(x, 1 / rate).cut_off()
    moved = smooth(x, 1 / rate, cutoff)
    assert cutoff == pytest.approx(rate / 2)
    assert np.array_equal(moved.displacement, x)
    peak = np.max(np.abs(sine.velocity(t)))
    assert np.max(np.abs(moved.velocity - sine.velocity(t))) < 1e-4 * peak
    assert np.max(np.abs(moved.acceleration - sine.acceleration(t))) < 1e-3 * np.max(
        np.abs(sine.acceleration(t))
    )


@pytest.mark.parametrize(
    ("motion", "velocity_noise"),
    [
        (Sine(0.010, 2.0), 0.1e-3),
        (Sine(0.005, 3.0), 0.1e-3),
        (Chirp(0.002, 0.5, 15.0, 10.0), 0.2e-3),
        (Harmonics((0.004, 0.002, 0.001), (0.7, 2.3, 5.1), (0.1, 1.0, 2.0)), 0.2e-3),
    ],
)
def test_smoothing_limits_velocity_noise(motion, velocity_noise):
    """Without smoothing, steps of 3 um cause 2 mm/s rms at 1 kHz. The first and last 20 ms are ignored."""
    t = np.arange(10_001) / 1000.0
    rng = np.random.default_rng(3)
    measured = 3e-6 * np.round((motion.displacement(t) + 1.5e-6 * rng.standard_normal(len(t))) / 3e-6)
    moved = smooth(measured, 1e-3, measure_spectrum(measured, 1e-3).cut_off())
    error = moved.velocity - motion.velocity(t)
    assert np.std(differentiate(measured, 1e-3) - motion.velocity(t)) > 1.5e-3
    assert np.std(error[20:-20]) < velocity_noise
    assert np.max(np.abs(error)) < 100 * velocity_noise


@pytest.mark.system
@given(
    start=st.floats(-3.0, 3.0),
    slope=st.floats(-3.0, 3.0),
    bend=st.floats(-3.0, 3.0),
    spacing=st.integers(2, 40),
)
def test_smoothing_preserves_cubics_up_to_ends(start, slope, bend, spacing):
    """Smoothing penalises fourth differences, which are zero for a cubic."""
    t = np.linspace(-1.0, 1.0, 401)
    x = start + slope * t + bend * t**3
    moved = smooth(x, t[1] - t[0], 0.5 / (spacing * (t[1] - t[0])))
    assert moved.displacement == pytest.approx(x, abs=1e-7)
    assert moved.velocity == pytest.approx(slope + 3 * bend * t**2, abs=1e-5)
    assert moved.acceleration == pytest.approx(6 * bend * t, abs=1e-3)


@pytest.mark.system
@given(shift=st.floats(-0.1, 0.1), scale=st.floats(0.1, 10.0))
def test_smoothing_is_linear_and_symmetric_in_time(shift, scale):
    x = np.random.default_rng(4).standard_normal(500)
    once = smooth(x, 1e-3, 60.0)
    moved = smooth(scale * x + shift, 1e-3, 60.0)
    assert moved.displacement == pytest.approx(scale * once.displacement + shift, abs=1e-9)
    assert moved.velocity == pytest.approx(scale * once.velocity, abs=1e-6)
    knots = knot_spacing(1e-3, 60.0)
    whole = x[: knots * 60 + 1]  # With knots at both ends, the fit is the same forwards and backwards.
    forwards, backwards = smooth(whole, 1e-3, 60.0), smooth(whole[::-1], 1e-3, 60.0)
    assert backwards.displacement[::-1] == pytest.approx(forwards.displacement, abs=0.2)


def test_smoothed_velocity_and_acceleration_are_consistent():
    x = np.cumsum(np.random.default_rng(5).standard_normal(2000)) * 1e-4
    moved = smooth(x, 1e-3, 25.0)
    slope, bend = differentiate(moved.displacement, 1e-3), differentiate(moved.velocity, 1e-3)
    assert np.max(np.abs(slope - moved.velocity)) < 1e-4 * np.std(moved.velocity)
    assert np.max(np.abs(bend - moved.acceleration)) < 1e-2 * np.std(moved.acceleration)


def test_mains_hum_hardly_changes_cutoff_frequency():
    t = np.arange(40_001) / 1000.0
    rng = np.random.default_rng(6)
    clean = Chirp(0.002, 0.5, 10.0, 40.0).displacement(t) + 2e-6 * rng.standard_normal(len(t))
    hum = 1e-6 * np.sin(2 * np.pi * np.outer(MAINS_Hz, t)).sum(axis=0)
    without, with_hum = (measure_spectrum(x, 1e-3).cut_off() for x in (clean, clean + hum))
    assert with_hum == pytest.approx(without, rel=0.2)
    assert with_hum < 100.0


@given(
    amplitude=st.sampled_from([0.002, 0.015, 0.04]),
    frequency=st.sampled_from([0.25, 0.5, 1.0, 2.0, 3.5, 12.0]),
    periods=st.integers(2, 20),
    is_sine=st.booleans(),
)
def test_periodic_motion_label_has_amplitude_and_frequency(amplitude, frequency, periods, is_sine):
    step = 1.0 / (200.0 * frequency)
    t = step * np.arange(200 * periods + 1)
    motion = Sine(amplitude, frequency) if is_sine else Triangle(amplitude, 4.0 * amplitude * frequency)
    found = describe_motion(0.1 + motion.displacement(t), step)
    assert found.label == f"{'sine' if is_sine else 'triangle'} {1e3 * amplitude:g} mm {frequency:g} Hz"
    assert (found.period_s, found.half_period_s) == pytest.approx(
        (1.0 / frequency, 0.5 / frequency), rel=0.01
    )


def test_irregular_motion_label_names_kind():
    """The motions are a single stroke, a sweep, a period with several strokes, and band-limited noise."""
    step = 1e-3
    t = step * np.arange(20_001)
    once = describe_motion(0.03 * np.linspace(0.0, 1.0, 501), step)
    assert (once.label, once.period_s, once.half_period_s) == ("single stroke 15 mm", None, 0.25)
    swept = describe_motion(Chirp(0.002, 2.0, 10.0, 20.0).displacement(t), step)
    assert (swept.label, swept.period_s) == ("chirp 2 mm 2-10 Hz", None)
    several = Harmonics((4e-3, 5e-3, 3e-3), (0.5, 1.5, 2.5), (0.3, 1.9, 4.1)).displacement(t)
    again = describe_motion(several, step)
    assert again.label.startswith("periodic")
    assert again.label.endswith(" 0.5 Hz")
    assert again.period_s == pytest.approx(2.0)
    assert again.half_period_s == pytest.approx(1.0)
    # With equal speeds of all tones, 90 % of the power is between 3.3 and 8.7 Hz.
    tones = np.arange(3.0, 9.01, 0.05)
    phases = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, len(tones))
    speed = np.cos(2.0 * np.pi * np.outer(t[:-1], tones) + phases).sum(axis=1)
    assert velocity_band(speed + 7.0, step) == pytest.approx((3.3, 8.7), abs=0.051)
    noise = describe_motion(np.cumsum(speed) * step, step)
    assert noise.label.startswith("random")
    assert noise.period_s is None
