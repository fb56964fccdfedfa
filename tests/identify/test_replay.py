"""A model replayed over a record in batches is the model on the whole run, however the rows come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import Batch
from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.identify.replay import Replay
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius, Linear
from tests.support.examples import examples

RATE_Hz = 50.0
HEAD = 4_003  # rows: no whole number of knots, neither of the displacement nor of the temperature
CHANNELS = ("time", "displacement", "force", "command", "temperature")

WARM = Damper(
    LAWS["bouc-wen"],
    {
        "viscosity": TemperatureDependent(Constant(5e3), Arrhenius(1435.5)),
        "stiffness": Constant(1000.0),
        "yield_force": TemperatureDependent(Polynomial((60.0, 500.0)), Linear(1e-3)),
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


def held(batch: Batch) -> Batch:
    """Return the record at one current, to the last digit."""
    return replace(batch, command=np.ones(len(batch)))


def stepped(batch: Batch) -> Batch:
    """Return the record with a current that goes up and down by steps."""
    current = np.where(batch.time % 4.0 < 2.0, 1.0, 0.2)
    return replace(batch, command=current)


def replayed(
    batch: Batch, rows: int, preparation: Preparation | None = None, damper: Damper = WARM, head: int = HEAD
) -> tuple[Replay, FloatArray]:
    replay = Replay(damper, preparation or Preparation(), "record", "A", head_rows=head)
    found: list[Batch] = []
    for start in range(0, len(batch), rows):
        found += replay.step_batch(batch.part(slice(start, start + rows)))
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
        velocity=batch.velocity,
        temperature=batch.temperature,
    )
    return prepare_run(run, preparation)


def told(replay: Replay) -> Preparation:
    """Return the rules that the replay chose, as a preparation of the whole."""
    assert replay.rules is not None
    return Preparation(cutoff_Hz=replay.rules.cutoff_Hz, dead_band_m=replay.rules.dead_band_m)


@pytest.mark.parametrize("change", [lambda batch: batch, stepped])
def test_a_record_within_the_head_is_the_run_that_predict_prepares_to_the_bit(
    change: Callable[[Batch], Batch],
) -> None:
    batch = change(record(HEAD))
    _, found = replayed(batch, 333)
    np.testing.assert_array_equal(found, simulate(WARM, prepared(batch).trajectory))


@pytest.mark.parametrize("change", [held, stepped])
def test_a_longer_record_is_that_of_the_whole_run_by_the_rules_of_its_head(
    change: Callable[[Batch], Batch],
) -> None:
    """Windows with overlap: to 1e-9 of the force (what is left is the temperature's)."""
    batch = change(record(8 * HEAD))
    replay, found = replayed(batch, 7_777)
    assert replay.rules is not None
    assert replay.rules.spacing > 1  # it does smooth
    whole = simulate(WARM, prepared(batch, told(replay)).trajectory)
    np.testing.assert_allclose(found, whole, rtol=0.0, atol=1e-9 * np.abs(whole).max())


def test_of_the_ends_of_windows_nothing_is_left() -> None:
    """The same without temperature, to the rounding."""
    cold = Damper(
        WARM.law, {**WARM.coefficients, "viscosity": Constant(5e3), "yield_force": Polynomial((60.0, 500.0))}
    )
    batch = replace(stepped(record(8 * HEAD)), temperature=None)
    replay, found = replayed(batch, 7_777, damper=cold)
    assert replay.rules is not None
    assert replay.rules.spacing > 1
    whole = simulate(cold, prepared(batch, told(replay)).trajectory)
    np.testing.assert_allclose(found, whole, rtol=0.0, atol=1e-12 * np.abs(whole).max())


def test_a_record_that_is_resampled_is_the_whole_run_that_is_resampled() -> None:
    batch = held(record(8 * HEAD))
    time = batch.time.copy()
    time[2::5] += 8e-4 * np.random.default_rng(0).uniform(-1.0, 1.0, len(time[2::5]))
    batch = replace(batch, time=time)
    replay, found = replayed(batch, 1_000)
    assert replay.rules is not None
    assert not replay.rules.even
    path = prepared(batch, told(replay)).trajectory
    at_rows = np.interp(batch.time, path.step * np.arange(len(path)), simulate(WARM, path))
    np.testing.assert_allclose(found, at_rows, rtol=0.0, atol=1e-8 * np.abs(at_rows).max())


def test_lost_samples_are_bridged_as_in_a_whole_run() -> None:
    whole = held(record(6 * HEAD))
    there = np.ones(len(whole), dtype=bool)
    there[[3 * HEAD, 4 * HEAD + 1, 4 * HEAD + 2]] = False
    columns = {name: getattr(whole, name)[there] for name in CHANNELS}
    batch = replace(whole, **columns)
    replay, found = replayed(batch, 1_111)
    path = prepared(batch, told(replay)).trajectory
    assert len(path) == len(whole)
    expected = simulate(WARM, path)[there]  # on a step whose last digits are others
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


def test_what_is_held_does_not_grow_with_the_record() -> None:
    batch = held(record(12 * HEAD))
    replay = Replay(WARM, Preparation(), "record", "A", head_rows=HEAD)
    waiting, out = [], 0
    for start in range(0, len(batch), HEAD):
        out += sum(map(len, replay.step_batch(batch.part(slice(start, start + HEAD)))))
        waiting.append(start + HEAD - out)
    assert max(waiting) <= 6 * HEAD  # a window and its reach: 34 s of knots of the temperature's smoothing


def test_behind_a_break_the_model_begins_anew() -> None:
    batch = held(record(5 * HEAD))
    broken = 3 * HEAD + 10
    batch.force[broken] = np.nan
    replay, found = replayed(batch, 999, Preparation(reference="none"))
    assert np.flatnonzero(np.isnan(found)).tolist() == [broken]
    assert replay.segments == 2
    rest = prepared(batch.part(slice(broken + 1, None)), replace(told(replay), reference="none"))
    alone = simulate(WARM, rest.trajectory)
    np.testing.assert_allclose(found[broken + 1 :], alone, rtol=0.0, atol=1e-9 * np.abs(alone).max())


def test_another_pace_of_sampling_is_followed() -> None:
    """A recorder that goes over to half the rate: the same motion at the rows that are left."""
    whole = held(record(6 * HEAD, noise_m=0.0))
    there = np.ones(len(whole), dtype=bool)
    there[3 * HEAD + 1 :: 2] = False
    batch = replace(whole, **{name: getattr(whole, name)[there] for name in CHANNELS})
    replay, found = replayed(batch, 1_000)
    _, full = replayed(whole, 1_000)
    assert replay.pace == pytest.approx(1.0)
    inner = slice(None, -5)  # ends are smoothed as ends
    most = 2e-3 * np.abs(full).max()
    np.testing.assert_allclose(found[inner], full[there][inner], rtol=0.0, atol=most)


def test_a_measured_velocity_and_a_tare_are_taken_where_the_card_says_so() -> None:
    batch = held(record(4 * HEAD))
    batch = replace(batch, velocity=np.gradient(batch.displacement, batch.time))
    asked = Preparation(velocity="channel", force_offset_N=25.0, reference="none")
    replay, found = replayed(batch, 1_000, asked)
    chosen = told(replay)
    whole = prepared(
        batch, replace(asked, cutoff_Hz=chosen.cutoff_Hz, dead_band_m=chosen.dead_band_m)
    ).trajectory
    expected = simulate(WARM, whole) + 25.0  # beside a load cell that shows its tare
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_what_the_preparation_of_the_card_cuts_off_has_no_force() -> None:
    batch = held(record(3 * HEAD))
    _, found = replayed(batch, 1_000, Preparation(from_s=1.0, to_s=50.0))
    there = (batch.time >= 1.0) & (batch.time <= 50.0)
    np.testing.assert_array_equal(np.isfinite(found), there)


def test_a_rest_before_the_motion_is_passed() -> None:
    moving = held(record(2 * HEAD))
    rest = 3 * HEAD + 5
    columns = {
        name: np.concatenate([np.full(rest, getattr(moving, name)[0]), getattr(moving, name)])
        for name in CHANNELS
    }
    columns["time"] = np.arange(rest + len(moving)) / RATE_Hz
    replay, found = replayed(Batch(0, **columns), 1_234)
    assert np.isnan(found[: 3 * HEAD]).all()
    assert np.isfinite(found[3 * HEAD :]).all()
    assert replay.segments == 1


def test_a_head_that_is_no_run_yet_waits_for_more() -> None:
    """A rest nearly as long as the head: one reversal is not enough to choose rules by."""
    moving = held(record(3 * HEAD))
    rest = HEAD - 40  # 0.3 s of motion are left to the head
    columns = {
        name: np.concatenate([np.full(rest, getattr(moving, name)[0]), getattr(moving, name)])
        for name in CHANNELS
    }
    columns["time"] = np.arange(rest + len(moving)) / RATE_Hz
    _, found = replayed(Batch(0, **columns), 777)
    assert np.isfinite(found).all()


def test_rules_come_from_the_next_head_where_the_sensor_jumps_in_the_first() -> None:
    batch = held(record(4 * HEAD))
    batch.displacement[HEAD // 2] += 0.5
    replay, found = replayed(batch, 777)
    assert replay.rules is not None
    assert replay.rules.cutoff_Hz == prepared(batch.part(slice(HEAD, 2 * HEAD))).cutoff_Hz
    assert np.isfinite(found).all()
    short = batch.part(slice(0, HEAD))
    with pytest.raises(InputError, match=rf"rows 0 to {HEAD - 1}[^$]*a jump of the sensor"):
        replayed(short, 777)


def test_temperature_that_is_missing_is_asked_for_and_one_that_has_holes_is_held() -> None:
    batch = held(record(HEAD))
    with pytest.raises(InputError, match=r"record: has no temperature channel.*temperature_degC = 20"):
        replayed(replace(batch, temperature=None), 1_000)
    nothing = np.full(len(batch), np.nan)
    with pytest.raises(InputError, match="temperature is never a number of 223 to 453 K"):
        replayed(replace(batch, temperature=nothing), 1_000)
    holes = batch.temperature.copy() if batch.temperature is not None else nothing
    holes[5:400] = 1e9
    _, found = replayed(replace(batch, temperature=holes), 1_000)
    assert np.isfinite(found).all()


def test_a_command_of_another_unit_is_refused() -> None:
    with pytest.raises(InputError, match="the command is in V, the model's in A"):
        Replay(WARM, Preparation(), "record", "V")


def test_what_a_run_would_be_refused_for_is_said_with_its_rows() -> None:
    batch = held(record(HEAD))
    with pytest.raises(InputError, match=rf"rows 0 to {HEAD - 1}[^$]*opposite signs"):
        replayed(replace(batch, force=-batch.force), 1_000)


@given(rows=st.integers(20, 9_000), seed=st.integers(0, 20))
@examples(5)
def test_the_force_does_not_depend_on_the_batches(rows: int, seed: int) -> None:
    batch = stepped(record(3 * HEAD, seed))
    rng = np.random.default_rng(seed)
    batch.force[rng.integers(0, len(batch), 2)] = np.nan
    if batch.temperature is not None:
        batch.temperature[rng.integers(0, len(batch), 50)] = np.nan
    batch.time[rng.integers(HEAD, len(batch)) :] += 100.0
    _, parts = replayed(batch, rows)
    _, whole = replayed(batch, len(batch))
    np.testing.assert_array_equal(parts, whole)
    assert np.isnan(whole).sum() < 2 + 4 * 16
