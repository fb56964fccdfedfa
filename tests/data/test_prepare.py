"""Each rule of the preparation of runs is tested with known reference values."""

import json
import math
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.prepare import Preparation, decimate, prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import Chirp, Harmonics, Sine, Triangle
from tests.support.campaigns import SINE, fields_of_run, make_run

NOISY: dict[str, Any] = {"noise": 1.5e-6, "quantum": 3e-6}


def test_smoothing_does_not_change_clean_motion():
    prepared = prepare_run(make_run(SINE))
    path = prepared.trajectory
    assert prepared.cutoff_Hz == pytest.approx(500.0)
    assert path.step == pytest.approx(1e-3)
    assert path.displacement == pytest.approx(SINE.displacement(path.time), abs=1e-9)
    assert path.velocity == pytest.approx(SINE.velocity(path.time), abs=1e-4 * 0.126)
    assert path.acceleration == pytest.approx(SINE.acceleration(path.time), abs=1e-3 * 1.6)
    assert set(path.command) == {0.5}


def test_smoothing_preserves_noisy_motion():
    prepared = prepare_run(make_run(SINE, rest=0.3, **NOISY))
    since = np.maximum(prepared.trajectory.time - 0.3, 0.0)
    moving = prepared.trajectory.time > 0.4  # Smoothing rounds the velocity jump at 0.3 s.
    assert 10.0 < prepared.cutoff_Hz < 250.0
    assert np.std(prepared.trajectory.velocity[moving] - SINE.velocity(since)[moving]) < 0.6e-3
    assert np.std(prepared.trajectory.velocity[:250]) < 0.6e-3


@pytest.mark.system
@given(start=st.floats(-0.5, 0.5), rest=st.floats(0.1, 1.0))
def test_displacement_is_zero_at_rest(start, rest):
    fields = fields_of_run(SINE, rest=rest, duration=2.0, noise=2e-6)
    fields["displacement"] = fields["displacement"] + start
    run = make_run(changed=fields)
    at_start = prepare_run(run).trajectory.displacement
    assert np.mean(at_start[: int(500 * rest)]) == pytest.approx(0.0, abs=2e-6)
    as_measured = prepare_run(run, Preparation(reference="none")).trajectory.displacement
    assert at_start - as_measured == pytest.approx(-start, abs=2e-6)
    centred = prepare_run(run, Preparation(reference="mean")).trajectory.displacement
    assert np.mean(centred) == pytest.approx(0.0, abs=1e-12)


@given(rest=st.floats(0.05, 2.0))
def test_error_evaluation_begins_after_half_period(rest):
    prepared = prepare_run(make_run(SINE, rest=rest, duration=3.0))
    # The motion has left its rest after 2 % of the range of 20 mm.
    left_rest = np.arcsin(0.02 * 0.02 / 0.010) / (2 * np.pi * 2.0)
    expected = rest + left_rest + 0.25
    assert prepared.scored_from * 1e-3 == pytest.approx(expected, abs=3e-3)


@pytest.mark.parametrize(
    ("motion", "label"),
    [
        (Sine(0.010, 2.0), "sine 10 mm 2 Hz"),
        (Sine(0.025, 0.244), "sine 25 mm 0.25 Hz"),  # The label shows the simplest number within 2.5 %.
        (Triangle(0.005, 0.02), "triangle 5 mm 1 Hz"),
        (Chirp(0.002, 0.5, 15.0, 20.0), "chirp 2 mm 1-15 Hz"),
        (Harmonics((0.010, 0.006), (1.0, 3.0), (0.0, 0.4)), "periodic 13 mm 1 Hz"),
    ],
)
@pytest.mark.parametrize("how", [{}, {"noise": 1.5e-6, "quantum": 3e-6}, {"noise": 2e-5}])
def test_motion_label_has_amplitude_and_frequency(motion, label, how):
    assert prepare_run(make_run(motion, duration=20.0, **how)).motion == label


def test_random_motion_label_has_frequency_band():
    rng = np.random.default_rng(0)
    frequencies = 1.0 + 4.0 * rng.random(40)
    tones = Harmonics(tuple(0.002 * rng.random(40)), tuple(frequencies), tuple(6.28 * rng.random(40)))
    kind, size, unit, band, _ = prepare_run(make_run(tones, duration=30.0)).motion.split()
    assert (kind, unit) == ("random", "mm")
    low, high = map(float, band.split("-"))
    assert float(size) > 1.0
    assert 0.9 <= low < high <= 5.5


def test_run_with_time_jitter_is_resampled():
    fields = fields_of_run(SINE)
    shaken = np.random.default_rng(8).uniform(-0.2e-3, 0.2e-3, len(fields["time"]))
    fields["time"] = fields["time"] + shaken
    fields["displacement"] = SINE.displacement(fields["time"])
    fields["force"] = 1000.0 * np.tanh(SINE.velocity(fields["time"]) / 0.01)
    fields["temperature"] = 300.0 + fields["time"]
    run = make_run(changed=fields)
    prepared = prepare_run(run, Preparation(reference="none", cutoff_Hz=math.inf))
    at = run.time[0] + prepared.trajectory.time
    assert prepared.trajectory.step == pytest.approx(float(np.median(np.diff(run.time))))
    assert prepared.trajectory.displacement == pytest.approx(SINE.displacement(at), abs=1e-8)
    assert prepared.trajectory.temperature == pytest.approx(300.0 + at, abs=1e-3)
    assert prepared.force == pytest.approx(1000.0 * np.tanh(SINE.velocity(at) / 0.01), abs=5.0)


def test_rounded_timestamps_are_not_jitter():
    """Time stamps rounded to 1 ms are irregular at 512 Hz, although the samples are uniform."""
    fields = fields_of_run(SINE, rate_Hz=512.0)
    exact = prepare_run(make_run(changed=fields))
    fields["time"] = np.round(fields["time"], 3)
    prepared = prepare_run(make_run(changed=fields))
    assert prepared.trajectory.step == pytest.approx(1 / 512.0, rel=1e-6)
    assert np.array_equal(prepared.trajectory.displacement, exact.trajectory.displacement)


def test_run_with_reversed_force_is_rejected():
    run = make_run(SINE)
    flipped = make_run(SINE, changed={"force": 50.0 - run.force})
    with pytest.raises(
        InputError, match=r"opposite signs \(correlation -0\.\d\d\).*Put `sign = -1` at \[channel\.force\]"
    ):
        prepare_run(flipped)


@given(preload=st.floats(-500.0, 500.0), stiffness=st.floats(-2e4, 2e4))
def test_force_sign_check_ignores_preload(preload, stiffness):
    run = make_run(SINE, duration=2.0)
    prepare_run(
        make_run(SINE, duration=2.0, changed={"force": run.force + preload + stiffness * run.displacement})
    )


@given(rate=st.floats(50.0, 1500.0))
def test_decimation_keeps_samples_and_minimum_rate(rate):
    full = prepare_run(make_run(SINE, duration=2.0, **NOISY))
    fewer = decimate(full, rate)
    factor = round(fewer.trajectory.step / full.trajectory.step)
    assert fewer.trajectory.rate_Hz >= min(rate, 1000.0) * (1 - 1e-6)
    assert full.trajectory.rate_Hz / (factor + 1) < rate
    assert np.array_equal(fewer.trajectory.velocity, full.trajectory.velocity[::factor])
    assert np.array_equal(fewer.force, full.force[::factor])
    assert full.scored_from <= fewer.scored_from * factor < full.scored_from + factor


@pytest.mark.parametrize(
    "preparation",
    [
        Preparation(),
        Preparation(cutoff_Hz=40.0, dead_band_m=1e-5, reference="mean"),
        Preparation(cutoff_Hz=math.inf, from_s=1.0, to_s=2.0, force_offset_N=-3.0, thermocouple_lag_s=4.0),
    ],
)
def test_preparation_settings_survive_json(preparation):
    text = json.dumps(preparation.to_dict(), allow_nan=False)
    assert Preparation.from_dict(json.loads(text)) == preparation
    assert Preparation.from_dict(MappingProxyType(preparation.to_dict())) == preparation


def test_displacement_is_centred_without_initial_rest():
    """Runs of one campaign that start at different phases have the same zero of displacement."""
    for phase in (0.3, 1.2, 0.5 * math.pi, 2.0):
        run = make_run(Harmonics((0.01,), (2.0,), (phase,)), duration=5.0)
        x = prepare_run(run).trajectory.displacement
        assert np.max(x) == pytest.approx(0.01, rel=1e-3)
        assert np.min(x) == pytest.approx(-0.01, rel=1e-3)
