"""A whole run is one batch: rows that come in parts are conditioned to the bits of ``prepare_run``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.batches import Batch
from mrdamper.data.conditioning import (
    Conditioner,
    Grid,
    Rules,
    condition_temperature,
    on_grid,
)
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.data.signals import differentiate, smooth
from mrdamper.excitation import Trajectory
from tests.data.example_runs import make_run

RNG = np.random.default_rng(0)


def plain() -> RigRun:
    return make_run(noise=2e-6, duration=8.0, rest=0.5)


def uneven() -> RigRun:
    """Return a run whose timestamps leave the grid by up to 30 % of a step, and that warms up."""
    run = plain()
    time = run.time + 3e-4 * RNG.uniform(-1.0, 1.0, len(run))
    current = 1.0 + 0.004 * RNG.standard_normal(len(run))
    return replace(run, time=time, command=current, temperature=300.0 + 0.5 * time)


def commanded() -> RigRun:
    run = plain()
    return replace(run, command=np.where(run.time % 2.0 < 1.0, 1.0, 0.2))


def with_velocity() -> RigRun:
    run = plain()
    return replace(run, velocity=np.gradient(run.displacement, run.time))


@pytest.mark.parametrize(
    ("make", "preparation"),
    [
        (plain, Preparation()),
        (uneven, Preparation(thermocouple_lag_s=2.0)),
        (commanded, Preparation(reference="mean")),
        (with_velocity, Preparation(velocity="channel")),
    ],
)
@pytest.mark.parametrize("rows", [17, 1_000, 100_000])
def test_a_segment_in_parts_is_the_run_to_the_bit(make, preparation, rows):
    run = make()
    whole = prepare_run(run, preparation)
    conditioner = Conditioner(whole.rules, temperature_K=None if run.temperature is None else 300.0)
    batch = Batch.of(run)
    for start in range(0, len(batch), rows):
        conditioner.take(batch.part(slice(start, start + rows)))
        assert not list(conditioner.ready())  # it fits into one window
    (path,) = conditioner.rest()
    for channel in ("displacement", "velocity", "acceleration", "command"):
        np.testing.assert_array_equal(getattr(path, channel), getattr(whole.trajectory, channel))
    if run.temperature is not None:
        np.testing.assert_array_equal(path.temperature, whole.trajectory.temperature)
    assert (path.step, path.dead_band) == (whole.trajectory.step, whole.trajectory.dead_band)


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("measured", [False, True])
def test_windows_of_a_long_segment_are_those_of_the_whole(jitter, measured):
    step, n, lag = 0.05, 6_000, 3.0
    rng = np.random.default_rng(1)
    time = 7.0 + step * (np.arange(n) + jitter * rng.uniform(-1.0, 1.0, n))
    command = 1.0 + 0.001 * rng.standard_normal(n)
    command[2_000:2_100] = 2.0  # it is let go for a while
    noise = rng.standard_normal(n)
    temperature = 300.0 + 0.1 * time + 3.0 * np.sin(0.3 * time) + 0.1 * noise
    x, v = 0.01 * np.sin(time) + 1e-6 * noise, 0.01 * np.cos(time)
    batch = Batch(0, time, x, np.zeros(n), command, v, temperature)
    rules = Rules(
        step_s=step, even=not jitter, uneven_s=0.0, cutoff_Hz=5.0, dead_band_m=0.0, reference_m=1e-3,
        command=1.0, measured_velocity=measured, thermocouple_lag_s=lag,
    )  # fmt: skip
    conditioner = Conditioner(rules, temperature_K=300.0, window=1)
    windows: list[Trajectory] = []
    for start in range(0, n, 500):
        conditioner.take(batch.part(slice(start, start + 500)))
        windows += conditioner.ready()
    windows += conditioner.rest()
    assert len(windows) > 2
    path = {
        name: np.concatenate([getattr(each, name) for each in windows])
        for name in ("displacement", "velocity", "acceleration", "command", "temperature")
    }
    grid = Grid(float(time[0]), step)
    whole = on_grid(batch, grid, 0, grid.samples_to(float(time[-1]))) if jitter else batch
    smoothed = smooth(whole.displacement, step, 5.0)
    assert whole.velocity is not None
    assert whole.temperature is not None
    velocity = whole.velocity if measured else smoothed.velocity
    acceleration = differentiate(velocity, step) if measured else smoothed.acceleration
    assert np.allclose(path["displacement"], smoothed.displacement - 1e-3, rtol=0.0, atol=1e-13)
    assert np.allclose(path["velocity"], velocity, rtol=0.0, atol=1e-12)
    assert np.allclose(path["acceleration"], acceleration, rtol=0.0, atol=1e-11)
    expected = condition_temperature(whole.temperature, step, lag)
    millionth_K = 1e-6 * 0.1 * (1.0 + lag / 2.0)  # of the noise, whose slope over a knot of 2 s counts too
    assert np.allclose(path["temperature"], expected, rtol=0.0, atol=millionth_K)
    let_go = path["command"] != 1.0
    assert np.array_equal(path["command"][let_go], whole.command[let_go])
    assert 95 <= np.count_nonzero(let_go) <= 102
