"""The operating envelope contains the motion of all runs, and an evaluation recognises training runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.evaluate import (
    all_assumed,
    operating_envelope,
    prepare_for,
)
from mrdamper.identify.evaluate import evaluate as errors_of
from mrdamper.models.dependence import Constant, TemperatureDependent
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS
from tests.models.test_card import a_card

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


def test_envelope_contains_motion_of_all_runs() -> None:
    """A sine has the largest displacement a, velocity 2 pi f a, acceleration (2 pi f)^2 a and frequency f."""
    runs = [
        prepare_run(run_of(Sine(4e-3, 2.0), command=0.5, celsius=30.0), NO_SMOOTHING),
        prepare_run(run_of(Sine(9e-3, 0.5), command=1.5), NO_SMOOTHING),
    ]
    seen = operating_envelope(runs)
    assert seen.command == (0.5, 1.5)
    assert seen.temperature == pytest.approx((293.15, 303.15))
    assert seen.displacement == pytest.approx((-9e-3, 9e-3), rel=0.01)
    assert seen.velocity == pytest.approx((-4e-3 * 4.0 * np.pi, 4e-3 * 4.0 * np.pi), rel=0.01)
    most = 4e-3 * (4.0 * np.pi) ** 2
    assert seen.acceleration == pytest.approx((-most, most), rel=0.02)
    assert seen.frequency == pytest.approx((0.5, 2.0), rel=0.1)
    cold = prepare_run(run_of(Sine(4e-3, 2.0), celsius=None), NO_SMOOTHING)
    assert operating_envelope([*runs, cold]).temperature is None
    assert operating_envelope([cold, *runs]).temperature is None


def test_training_runs_of_card_are_recognised() -> None:
    runs = [run_of(Sine(5e-3, 1.0), name="same"), run_of(Sine(5e-3, 1.0), name="other")]
    card = a_card(preparation={})
    (found, _) = errors_of(card.damper, runs)
    for rmse, split in ((found.rmse_N, "training"), (found.rmse_N * (1.0 + 1e-3), "held_out")):
        rows = ({"name": "same", "split": "training", "rmse_N": rmse, "nrmse_percent": 1.0},)
        known = replace(card, evidence=replace(card.evidence, runs=rows))
        assert [each.split for each in errors_of(known, runs)] == [split, "held_out"]


def test_temperature_dependent_damper_requires_measured_temperature() -> None:
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
