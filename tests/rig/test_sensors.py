"""Sensors of the virtual rig have the specified noise, quantisation and sampling."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.virtual_rig.sensors import Sensors

N = 40_000


def noise(seed=1):
    return np.random.default_rng(seed)


@pytest.mark.parametrize(("read", "size"), [("displacement", 10e-6), ("force", 5.0), ("temperature", 0.3)])
def test_sensor_noise_is_white_with_specified_deviation(read, size):
    """The standard deviation and the correlation of neighbours agree within four standard errors."""
    values = getattr(Sensors(), read)(np.zeros(N), noise())
    assert np.std(values) == pytest.approx(size, rel=4.0 / np.sqrt(2 * N))
    assert abs(np.mean(values[1:] * values[:-1])) < 4.0 * size**2 / np.sqrt(N)


def test_quantised_reading_is_multiple_of_step():
    sensors = Sensors(displacement_step_m=3e-6, force_step_N=2.5)
    for values, step in (
        (sensors.displacement(np.linspace(-1e-3, 1e-3, 999), noise()), 3e-6),
        (sensors.force(np.linspace(-900.0, 900.0, 999), noise()), 2.5),
    ):
        assert values / step == pytest.approx(np.round(values / step), abs=1e-6)


def test_logger_records_every_nth_sample():
    ramp = np.arange(100.0)
    read = Sensors(rate_Hz=500.0, displacement_noise_m=0.0, force_noise_N=0.0, thermocouple_noise_K=0.0).read(
        ramp / 100.0, ramp, ramp, noise()
    )
    assert read.force.tolist() == [0.0, 20.0, 40.0, 60.0, 80.0]
    assert read.time == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.008])
