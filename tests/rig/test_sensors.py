"""The sensors: the noise they state, the lag of a thermocouple in closed form, steps, sampling."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.virtual_rig.sensors import Sensors

CLEAN = Sensors(displacement_noise_m=0.0, force_noise_N=0.0, thermocouple_noise_K=0.0)
N = 40_000


def noise(seed=1):
    return np.random.default_rng(seed)


@pytest.mark.parametrize(("read", "size"), [("displacement", 10e-6), ("force", 5.0), ("temperature", 0.3)])
def test_the_noise_is_white_and_as_large_as_stated(read, size):
    """Standard deviation within 4 of its own standard errors, neighbours uncorrelated within 4 of theirs."""
    values = getattr(Sensors(), read)(np.zeros(N), noise())
    assert np.std(values) == pytest.approx(size, rel=4.0 / np.sqrt(2 * N))
    assert abs(np.mean(values[1:] * values[:-1])) < 4.0 * size**2 / np.sqrt(N)


def test_a_thermocouple_lags_a_ramp_by_its_time_constant():
    """After many time constants the reading is the truth of one lag ago; a step comes to 63 % after one."""
    time = np.arange(N) / CLEAN.rate_Hz
    assert CLEAN.temperature(20.0 + 0.5 * time, noise())[-1] == pytest.approx(
        20.0 + 0.5 * (time[-1] - 10.0 * (1.0 - np.exp(-4.0))), abs=0.001
    )
    step = CLEAN.temperature(np.where(time > 0.0, 120.0, 20.0), noise())
    assert step[10_000] == pytest.approx(20.0 + 100.0 * (1.0 - np.exp(-1.0)), abs=1e-6)


def test_a_soaked_thermocouple_reads_the_truth_and_its_offset():
    warm = np.full(50, 60.0)
    assert CLEAN.temperature(warm, noise()) == pytest.approx(warm)
    offset = Sensors(thermocouple_offset_K=-5.0, thermocouple_noise_K=0.0)
    assert offset.temperature(warm, noise()) == pytest.approx(warm - 5.0)


def test_a_converter_writes_whole_steps():
    sensors = Sensors(displacement_step_m=3e-6, force_step_N=2.5)
    for values, step in (
        (sensors.displacement(np.linspace(-1e-3, 1e-3, 999), noise()), 3e-6),
        (sensors.force(np.linspace(-900.0, 900.0, 999), noise()), 2.5),
    ):
        assert values / step == pytest.approx(np.round(values / step), abs=1e-6)


def test_a_logger_takes_every_so_many_samples_of_the_plant():
    ramp = np.arange(100.0)
    read = Sensors(rate_Hz=500.0, displacement_noise_m=0.0, force_noise_N=0.0, thermocouple_noise_K=0.0).read(
        ramp / 100.0, ramp, ramp, noise()
    )
    assert read.force.tolist() == [0.0, 20.0, 40.0, 60.0, 80.0]
    assert read.time == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.008])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rate_Hz": 300.0}, "rate is 300 Hz; expected a whole part of 10000 Hz"),
        ({"rate_Hz": 0.0}, "rate_Hz is 0.0; expected a number in Hz, above 0"),
        ({"rate_Hz": 20_000.0}, "rate is 20000 Hz"),
        ({"force_noise_N": -1.0}, "force_noise_N is -1.0; expected a number in N, at least 0"),
        ({"thermocouple_lag_s": "10"}, "thermocouple_lag_s is '10'"),
    ],
)
def test_sensors_without_sense_are_refused(changed, message):
    with pytest.raises(InputError, match=message):
        Sensors(**changed)
