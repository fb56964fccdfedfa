"""A model replayed over a record in batches is the model on the whole run, however the rows come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.data.streaming import Batch
from mrdamper.errors import InputError
from mrdamper.identify.replay import Replay
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial, Tempered
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius, Linear
from mrdamper.quantities import FloatArray

RATE_Hz = 200.0
HEAD = 4_000  # rows

WARM = Damper(
    LAWS["bouc-wen"],
    {
        "viscosity": Tempered(Constant(5e3), Arrhenius(1435.5)),
        "stiffness": Constant(1000.0),
        "yield_force": Tempered(Polynomial((60.0, 500.0)), Linear(1e-3)),
        "rho": Constant(4e3),
        "kappa": Constant(0.2),
        "n": Constant(1.5),
        "offset": Constant(20.0),
    },
    command_lag_s=0.02,
)


def record(samples: int, seed: int = 0, *, noise_m: float = 2e-6) -> Batch:
    """Return a record that begins at rest: sines of two frequencies, warmth that drifts, noise on all."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / RATE_Hz
    moving = np.clip(time - 0.5, 0.0, None)
    x = 8e-3 * np.sin(2 * np.pi * 1.3 * moving) + 2e-3 * np.sin(2 * np.pi * 0.31 * moving)
    warm = 300.0 + 0.2 * time + 3.0 * np.sin(0.05 * time)
    force = 900.0 * np.tanh(20.0 * np.gradient(x, 1.0 / RATE_Hz)) + 30.0
    return Batch(
        0,
        time,
        x + noise_m * rng.standard_normal(samples),
        force + 5.0 * rng.standard_normal(samples),
        np.full(samples, 1.0) + 1e-3 * rng.standard_normal(samples),
        None,
        warm + 0.1 * rng.standard_normal(samples),
    )


def stepped(batch: Batch) -> Batch:
    """Return the record with a current that goes up and down by steps."""
    current = np.where(batch.time % 4.0 < 2.0, 1.0, 0.2)
    return replace(batch, command=current)


def replayed(
    batch: Batch, rows: int, preparation: Preparation | None = None, damper: Damper = WARM, head: int = HEAD
) -> tuple[Replay, FloatArray]:
    replay = Replay(damper, preparation or Preparation(), "record", "A", head_rows=head)
    found = []
    for start in range(0, len(batch), rows):
        found += replay.feed(batch.part(slice(start, start + rows)))
    found += replay.close()
    joined = Batch.joined(found)
    np.testing.assert_array_equal(joined.time, batch.time)
    assert joined.modelled is not None
    return replay, joined.modelled


def prepared(batch: Batch, preparation: Preparation | None = None) -> PreparedRun:
    run = RigRun(
        name="record",
        time=batch.time,
        displacement=batch.displacement,
        force=batch.force,
        command=batch.command,
        command_unit="A",
        temperature=batch.temperature,
    )
    return prepare_run(run, preparation)


def told(replay: Replay) -> Preparation:
    """Return the rules that the replay chose, as a preparation of the whole."""
    assert replay.rules is not None
    return Preparation(cutoff_Hz=replay.rules.cutoff_Hz, dead_band_m=replay.rules.dead_band_m)


@pytest.mark.parametrize("change", [lambda b: b, stepped])
def test_a_record_within_the_head_is_the_run_that_predict_prepares_to_the_bit(change) -> None:
    batch = change(record(HEAD))
    _, found = replayed(batch, 333)
    np.testing.assert_array_equal(found, simulate(WARM, prepared(batch).trajectory))


@pytest.mark.parametrize("change", [lambda b: b, stepped])
def test_a_longer_record_is_that_of_the_whole_run_by_the_rules_of_its_head(change) -> None:
    """Windows with overlap: nothing of their ends is left."""
    batch = change(record(10 * HEAD))
    replay, found = replayed(batch, 7_777)
    whole = simulate(WARM, prepared(batch, told(replay)).trajectory)
    np.testing.assert_allclose(found, whole, rtol=0.0, atol=1e-6)
    print(np.abs(found-whole).max(), np.abs(whole).max(), replay.rules)


@given(rows=st.integers(2, 9_000), seed=st.integers(0, 20))
@settings(max_examples=15, deadline=None)
def test_the_force_does_not_depend_on_the_batches(rows: int, seed: int) -> None:
    batch = stepped(record(6 * HEAD, seed))
    rng = np.random.default_rng(seed)
    batch.force[rng.integers(0, len(batch), 2)] = np.nan
    batch.temperature[rng.integers(0, len(batch), 50)] = np.nan
    batch.time[rng.integers(HEAD, len(batch)) :] += 100.0
    _, parts = replayed(batch, rows)
    _, whole = replayed(batch, len(batch))
    np.testing.assert_array_equal(parts, whole)
    assert np.isnan(whole).sum() < 2 + 4 * 16
