"""A whole run is one batch: rows that come in parts are conditioned to the bits of ``prepare_run``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.batches import Batch
from mrdamper.data.conditioning import Conditioner
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.data.records import RigRun
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
