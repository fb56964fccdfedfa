"""How far a card was identified, and what is said of runs beyond that; which of them it was identified on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import EnvelopeWarning, InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.evaluate import (
    all_assumed,
    beyond_envelope,
    prepare_for,
    row,
    whole_envelope,
)
from mrdamper.identify.evaluate import evaluate as errors_of
from mrdamper.identify.scores import score_run
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.models.dependence import Constant, TemperatureDependent
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS
from tests.models.test_card import a_card

SEEN = OperatingEnvelope(
    command=(0.0, 2.0), displacement=(-0.01, 0.01), velocity=(-0.1, 0.1), temperature=(293.15, 333.15),
    acceleration=(-2.0, 1.0), frequency=(0.5, 4.0),
)  # fmt: skip
LAW = REFERENCE_DAMPERS["bouc-wen"]


def run_of(
    motion: Sine, *, name: str = "run", command: float = 1.0, celsius: float | None = 20.0, session: str = ""
) -> RigRun:
    path = drive(motion, duration=6.0, rate_Hz=500.0, command=command)
    return RigRun(
        name=name,
        time=path.time,
        displacement=path.displacement,
        force=simulate(LAW, path),
        command=path.command,
        command_unit="A",
        temperature=None if celsius is None else np.full(len(path), celsius + 273.15),
        session=session,
    )


@pytest.mark.parametrize(
    ("what", "inside", "outside"),
    [
        ("command", (0.0, 2.09), (0.0, 2.11)),
        ("command", (-0.09, 2.0), (-0.11, 2.0)),
        ("displacement", (-0.0104, 0.0104), (-0.0106, 0.0)),
        ("velocity", (-0.1, 0.104), (-0.1, 0.106)),
        ("acceleration", (-2.49, 1.49), (0.0, 1.51)),
        ("acceleration", (-2.49, 1.49), (-2.51, 0.0)),
        ("frequency", (0.26, 4.9), (0.24, 4.0)),
        ("frequency", (0.26, 4.9), (0.5, 5.1)),
        ("temperature", (288.2, 338.1), (288.1, 333.15)),
        ("temperature", (288.2, 338.1), (293.15, 338.2)),
    ],
)
def test_a_quantity_may_leave_what_was_seen_by_a_little(
    what: str, inside: tuple[float, float], outside: tuple[float, float]
) -> None:
    """5 % of the largest, 25 % of an acceleration, 5 K, an octave below and a quarter above a frequency."""
    card = a_card(envelope=SEEN)
    assert beyond_envelope(card, {"one": {what: inside}, "two": {what: inside}}) == []
    (note,) = beyond_envelope(card, {"one": {what: inside}, "two": {what: outside}})
    assert note.kind == f"beyond_{what}"
    assert "in 1 of 2 runs (the first: two)" in note
    assert beyond_envelope(card, {"two": {}}) == []
    (alone,) = beyond_envelope(card, {"two": {what: outside}})
    assert "in two; the card" in alone


def test_what_is_told_is_the_most_of_all_runs_beyond_in_the_field_s_units() -> None:
    card = a_card(envelope=SEEN)
    runs = {
        "a": {"displacement": (-0.02, 0.0), "temperature": (293.15, 373.15)},
        "b": {"displacement": (0.0, 0.03), "temperature": (253.15, 293.15)},
        "c": {"displacement": (-0.009, 0.009), "velocity": (-0.5, 0.25), "acceleration": (-9.0, 4.0)},
        "d": {"frequency": (0.1, 8.0), "command": (-1.0, 3.0)},
    }
    volts, far, fast, hard, often, warm = beyond_envelope(card, runs)
    assert "command is -1 to 3 A in 1 of 4 runs (the first: d); the card was identified on 0 to 2 A" in volts
    assert "velocity is -500 to 250 mm/s" in fast
    assert "acceleration is -9 to 4 m/s2" in hard
    assert "frequency is 0.1 to 8 Hz" in often
    assert (
        "displacement is -20 to 30 mm in 2 of 4 runs (the first: a); the card was identified on -10 to 10 mm"
        in far
    )
    assert "temperature is -20 to 100 degC" in warm
    assert "identified on 20 to 60 degC" in warm


def test_the_envelope_of_runs_is_the_least_and_most_of_what_all_of_them_have() -> None:
    """Of a sine of stroke a at f: a, a 2 pi f, a (2 pi f)^2, f."""
    runs = [
        prepare_run(run_of(Sine(4e-3, 2.0), command=0.5, celsius=30.0), NO_SMOOTHING),
        prepare_run(run_of(Sine(9e-3, 0.5), command=1.5), NO_SMOOTHING),
    ]
    seen = whole_envelope(runs)
    assert seen.command == (0.5, 1.5)
    assert seen.temperature == pytest.approx((293.15, 303.15))
    assert seen.displacement == pytest.approx((-9e-3, 9e-3), rel=0.01)
    assert seen.velocity == pytest.approx((-4e-3 * 4.0 * np.pi, 4e-3 * 4.0 * np.pi), rel=0.01)
    most = 4e-3 * (4.0 * np.pi) ** 2
    assert seen.acceleration == pytest.approx((-most, most), rel=0.02)
    assert seen.frequency == pytest.approx((0.5, 2.0), rel=0.1)
    cold = prepare_run(run_of(Sine(4e-3, 2.0), celsius=None), NO_SMOOTHING)
    assert whole_envelope([*runs, cold]).temperature is None
    assert whole_envelope([cold, *runs]).temperature is None


def test_runs_beyond_warn_at_the_line_that_asks() -> None:
    far = a_card(envelope=replace(SEEN, command=(0.0, 0.5)), preparation={}, excerpt=None)
    with pytest.warns(EnvelopeWarning, match="command is 1 to 1 A") as told:
        errors_of(far, [run_of(Sine(5e-3, 1.0))])
    assert told[0].filename == __file__


def test_a_run_is_training_where_name_and_error_are_those_of_the_card() -> None:
    runs = [run_of(Sine(5e-3, 1.0), name="same"), run_of(Sine(5e-3, 1.0), name="other")]
    card = a_card(preparation={}, excerpt=None)
    (found, _) = errors_of(card.damper, runs)
    for rmse, split in ((found.rmse_N, "training"), (found.rmse_N * (1.0 + 1e-3), "held_out")):
        rows = ({"name": "same", "split": "training", "rmse_N": rmse, "nrmse_percent": 1.0},)
        known = replace(card, evidence=replace(card.evidence, runs=rows))
        assert [each.split for each in errors_of(known, runs)] == [split, "held_out"]


def test_a_model_of_measured_temperature_asks_for_it_and_one_of_assumed_takes_20_degC() -> None:
    warm = TemperatureDependent(Constant(800.0), Arrhenius(1200.0))
    runs = [run_of(Sine(5e-3, 1.0), name=name, celsius=None) for name in "abc"]
    damper = replace(LAW, coefficients={**LAW.coefficients, "viscosity": warm})
    assert not all_assumed(damper)
    with pytest.raises(InputError, match=r"a \(and 2 more of 3 runs\): has no temperature channel"):
        prepare_for(damper, runs, NO_SMOOTHING)
    with pytest.raises(InputError, match="a: has no temperature channel"):
        prepare_for(damper, [*runs[:1], run_of(Sine(5e-3, 1.0))], NO_SMOOTHING)
    assumed = replace(damper, coefficients={**damper.coefficients, "viscosity": replace(warm, assumed=True)})
    assert all_assumed(assumed)
    for run in prepare_for(assumed, runs, NO_SMOOTHING):
        assert run.trajectory.temperature is not None
        np.testing.assert_array_equal(run.trajectory.temperature, 293.15)
    both = {**assumed.coefficients, "stiffness": TemperatureDependent(Constant(1500.0), Arrhenius(1.0))}
    assert not all_assumed(replace(assumed, coefficients=both))
    assert not all_assumed(LAW)


def test_the_energy_of_a_run_is_that_of_a_whole_cycle_and_of_all_where_there_is_none() -> None:
    """A sine's, at any length that holds whole cycles; of a random motion the work over all of it."""
    run = prepare_run(run_of(Sine(5e-3, 1.0)), NO_SMOOTHING)
    error = score_run(LAW, run)
    path, start = run.trajectory, run.scored_from
    work = run.force * path.velocity * path.step
    cycle = round(run.period_s / path.step) if run.period_s else 0
    assert cycle == 500
    count = (len(work) - start) // cycle
    assert count >= 4
    assert error.energy_measured_J == pytest.approx(
        work[start : start + count * cycle].sum() / count, rel=1e-9
    )
    assert error.energy_model_J == pytest.approx(error.energy_measured_J, rel=1e-3)
    aperiodic = score_run(LAW, replace(run, period_s=None))
    assert aperiodic.energy_measured_J == pytest.approx(work[start:].sum(), rel=1e-9)


def test_a_row_of_an_error_has_the_contract_s_keys_first_and_a_band_where_there_is_one() -> None:
    run = prepare_run(run_of(Sine(5e-3, 1.0)), NO_SMOOTHING)
    error = score_run(LAW, run)
    plain, band = row(error), row(replace(error, in_band_percent=91.0))
    errors = ("rmse_N", "nrmse_percent", "nrmse_whole_percent", "nrmse_offset_free_percent")
    keys = ["name", "split", *errors, "command", "command_unit", "current_A", "temperature_degC"]
    assert [*plain][:10] == keys
    assert "in_band_percent" not in plain
    assert band == plain | {"in_band_percent": 91.0}
    assert (plain["command"], plain["current_A"]) == (1.0, 1.0)
    volts = row(replace(error, command_unit="V"))
    assert (volts["command"], volts["current_A"]) == (1.0, None)
