"""Conditioning of the temperature of a run removes noise, keeps drift, and compensates the sensor lag."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.data.signals import condition_temperature


def times(duration: float, rate: float = 200.0) -> FloatArray:
    return np.arange(round(duration * rate), dtype=np.float64) / rate


def noise(count: int, size: float, seed: int = 0) -> FloatArray:
    return np.asarray(size * np.random.default_rng(seed).standard_normal(count))


def measured_by_a_slow_sensor(true: FloatArray, step: float, lag: float) -> FloatArray:
    """Return the readings of a first-order sensor, if the true temperature is linear between samples."""
    shown = np.empty_like(true)
    shown[0] = true[0]
    decay = np.exp(-step / lag)
    for k in range(1, len(true)):
        slope = (true[k] - true[k - 1]) / step
        shown[k] = true[k] - slope * lag + (shown[k - 1] - true[k - 1] + slope * lag) * decay
    return shown


@given(level=st.floats(250.0, 420.0), size=st.floats(0.0, 1.0), seed=st.integers(0, 99))
def test_noisy_constant_temperature_becomes_its_mean(level, size, seed):
    """The conditioned temperature is constant. Its error is at most five standard errors of the mean."""
    time = times(20.0)
    found = condition_temperature(level + noise(len(time), size, seed), 1 / 200.0)
    assert len(found) == len(time)
    assert np.ptp(found) == 0.0
    assert abs(found[0] - level) < 5.0 * size / np.sqrt(len(time)) + 1e-9


@pytest.mark.parametrize("step", [0.1, 1.0], ids=["short", "long"])
def test_temperature_noise_is_not_drift(step):
    """Noise of 5 K in 40 samples can look like a drift. This drift remains in at most 1 % of the runs."""
    runs = [condition_temperature(300.0 + noise(40, 5.0, seed), step) for seed in range(1000)]
    assert sum(np.ptp(run) > 0.0 for run in runs) <= 10


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("rate", [50.0, 1000.0])
def test_linear_warming_is_followed_within_0_3_K(seed, rate):
    """With noise of 0.3 K, the largest error, ends included, is 0.18 K at 50 Hz and 0.05 K at 1 kHz."""
    time = times(60.0, rate)
    true = 300.0 + 20.0 * time / 60.0
    found = condition_temperature(true + noise(len(time), 0.3, seed), 1.0 / rate)
    assert np.abs(found - true).max() < 0.3
    assert np.std(found - true) < 0.06


def test_exponential_warming_is_followed_within_0_3_K():
    """The temperature approaches its final value with a time constant of 20 s."""
    time = times(60.0)
    true = 300.0 + 20.0 * -np.expm1(-time / 20.0)
    found = condition_temperature(true + noise(len(time), 0.3), 1 / 200.0)
    assert np.abs(found - true).max() < 0.3
    straight = np.polyval(np.polyfit(time, true, 1), time)
    assert np.abs(straight - true).max() > 2.0  # A straight line would have errors of more than 2 K.


def test_temperature_follows_warming_and_cooling():
    """A straight line fitted to the run has no slope, but the means of the eighths of the run differ."""
    time = times(60.0)
    true = 300.0 + 10.0 * np.sin(np.pi * time / 60.0)
    found = condition_temperature(true + noise(len(time), 0.3), 1 / 200.0)
    assert np.abs(found - true).max() < 0.3
    small = condition_temperature(300.0 + 0.9 * np.sin(np.pi * time / 60.0), 1 / 200.0)
    assert np.ptp(small) == 0.0


@given(slope=st.floats(0.2, 2.0), lag=st.floats(0.0, 10.0), sign=st.sampled_from([-1.0, 1.0]))
def test_sensor_lag_at_constant_rate_is_compensated(slope, lag, sign):
    """At a constant rate, the sensor reads T - lag dT/dt instead of the true temperature T."""
    for duration in (8.0, 40.0):
        time = times(duration, 100.0)
        true = 330.0 + sign * slope * time
        shown = true - lag * sign * slope
        np.testing.assert_allclose(condition_temperature(shown, 0.01, lag), true, atol=2e-3)
        np.testing.assert_allclose(condition_temperature(shown, 0.01), shown, atol=2e-3)


def test_sensor_lag_at_changing_rate_is_compensated():
    """The sensor has a time constant of 4 s. Compensation reduces its error from 2.7 K to 0.003 K."""
    time = times(60.0)
    true = 300.0 + 20.0 * -np.expm1(-time / 20.0)
    shown = measured_by_a_slow_sensor(true, 1 / 200.0, 4.0)
    follows = time > 2.0
    assert np.abs(shown - true)[follows].max() > 2.5
    found = condition_temperature(shown, 1 / 200.0, 4.0)
    assert np.abs(found - true)[follows].max() < 0.02


@given(offset=st.floats(-40.0, 40.0), seed=st.integers(0, 20), rise=st.floats(0.0, 30.0))
def test_temperature_offset_shifts_conditioned_temperature(offset, seed, rise):
    time = times(30.0, 50.0)
    shown = 320.0 + rise * time / 30.0 + noise(len(time), 0.2, seed)
    expected = condition_temperature(shown, 0.02) + offset
    np.testing.assert_allclose(condition_temperature(shown + offset, 0.02), expected, atol=1e-6)


@given(seed=st.integers(0, 20), rise=st.floats(2.0, 30.0))
def test_temperature_conditioning_is_symmetric_in_time(seed, rise):
    time = times(30.0, 50.0)
    shown = 320.0 + rise * time / 30.0 + noise(len(time), 0.2, seed)
    backwards = condition_temperature(shown[::-1].copy(), 0.02)[::-1]
    np.testing.assert_allclose(backwards, condition_temperature(shown, 0.02), atol=0.02)
