"""Measured runs are validated, and data sets can be selected and split."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError
from tests.support.campaigns import fields_of_run, make_run


def _with(field, change):
    fields = fields_of_run()
    values = fields[field].copy()
    fields[field] = change(values)
    return fields


def _set(sample, value):
    def change(values):
        values[sample] = value
        return values

    return change


def test_valid_run_is_not_changed():
    fields = fields_of_run()
    run = RigRun(**fields)
    assert np.array_equal(run.displacement, fields["displacement"])
    assert len(run) == len(fields["time"])
    assert "-10 to 10 mm" in repr(run)
    with pytest.raises(ValueError, match="read-only"):
        run.force[0] = 0.0


@pytest.mark.parametrize(
    ("field", "change", "message"),
    [
        (
            "time",
            _set(100, 0.099),
            r"run: time does not increase at 1 places: it stands still, first after sample 99",
        ),
        (
            "displacement",
            lambda x: 0 * x + 0.1,
            r"run: displacement never changes \(0\.1 m at every",
        ),
        (
            "displacement",
            lambda x: np.linspace(0.0, 0.1, len(x)),
            r"displacement has 0 reversals; expected",
        ),
        ("displacement", _set(50, 0.2), r"It looks like a jump of the sensor"),
        (
            "time",
            lambda t: np.where(t < 2.0, t, 2.0 + 5 * (t - 2.0)),
            r"mixed sampling: the time step is 0\.001",
        ),
        ("force", lambda f: f[:-1], r"channels differ in length \(time 5001, displacement 5001, force 5000"),
    ],
)
def test_invalid_run_message_has_remedy(field, change, message):
    with pytest.raises(InputError, match=message):
        RigRun(**_with(field, change))


def test_celsius_in_kelvin_column_is_rejected():
    told = r"run: temperature is -248.1 degC \(25 K\) .* -50 to 180 degC .* It looks like degC given as K"
    with pytest.raises(InputError, match=told):
        make_run(changed={"temperature": np.full(5001, 25.0)})


@given(seed=st.integers(0, 1000), share=st.floats(0.0, 0.3))
def test_run_with_time_jitter_is_valid(seed, share):
    fields = fields_of_run(duration=1.0)
    shaken = np.random.default_rng(seed).uniform(-share, share, len(fields["time"]))
    fields["time"] = fields["time"] + 0.001 * shaken
    RigRun(**fields)


def _set_of(*names):
    return Dataset(tuple(make_run(changed={"name": name}, duration=1.0) for name in names))


def test_selected_runs_keep_dataset_order():
    runs = _set_of("sine_2Hz_1A", "sine_2Hz_0A", "chirp_1A")
    assert runs.select("*1A").names == ("sine_2Hz_1A", "chirp_1A")
    assert runs.select("chirp*", "*0A").names == ("sine_2Hz_0A", "chirp_1A")
    with pytest.raises(InputError, match=r"'sine_2hz_1A' matches no run; did you mean sine_2Hz_1A"):
        runs.select("sine_2hz_1A")


def test_split_of_dataset_is_complete():
    runs = _set_of("a_0A", "a_1A", "b_0A", "b_1A")
    training, held_out = runs.split(["b_*"])
    assert training.names == ("a_0A", "a_1A")
    assert held_out.names == ("b_0A", "b_1A")
    assert runs.split([])[0].names == runs.names
    with pytest.raises(InputError, match=r"hold-out \* leaves no run to train on"):
        runs.split(["*"])


def test_dataset_fingerprint_ignores_order():
    runs = _set_of("a", "b")
    assert runs.fingerprint == Dataset(runs.runs[::-1]).fingerprint
    assert len(runs.fingerprint) == 64
    other = Dataset((runs.runs[0], make_run(changed={"name": "b"}, duration=1.0, noise=1e-9)))
    assert other.fingerprint != runs.fingerprint
    assert _set_of("a", "c").fingerprint != runs.fingerprint


def test_displacement_with_only_three_values_is_rejected() -> None:
    flicker = 3e-6 * np.random.default_rng(0).integers(-1, 2, 5001)
    with pytest.raises(InputError, match="takes only 3 values"):
        make_run(changed={"displacement": flicker.astype(np.float64)})
