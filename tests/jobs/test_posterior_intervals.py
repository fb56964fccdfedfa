"""Intervals from posterior samples end at the results of extreme dampers among these samples.

The posterior has 21 evenly spaced values of one parameter, the viscosity. All tested results are monotonic in
the viscosity. The 5th and 95th percentiles are therefore the results of the second smallest and second
largest viscosity.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mrdamper
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.card_draws import CardDraws, write_draws
from mrdamper.models.card_schema import read_card, write_card
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from tests.support.cards import rig_damper, write_card_of

TRUTH = rig_damper(lag=None)
NAME = "viscosity.c0"
LEVELS = TRUTH.parameters[NAME] * np.linspace(0.8, 1.2, 21)
MOTION = "sine:10mm:0.5Hz:1A:3s"


def with_viscosity(value: float) -> Damper:
    return TRUTH.with_parameters({NAME: value})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("posterior")
    card = read_card(write_card_of(place / "card.json", TRUTH))
    write_draws(CardDraws((NAME,), LEVELS[:, None]), card.damper, place / "posterior.npz")
    for name, value in (("low", LEVELS[1]), ("high", LEVELS[-2])):
        write_card_of(place / f"{name}.json", with_viscosity(value))
    return place


def a_run(damper: Damper) -> RigRun:
    path = drive(Sine(10e-3, 0.5), duration=6.0, rate_Hz=500.0, command=1.0)
    path = replace(path, temperature=np.full(len(path), 313.15))
    return RigRun(
        name="new",
        time=path.time,
        displacement=path.displacement,
        force=simulate(damper, path),
        command=path.command,
        command_unit="A",
        temperature=path.temperature,
    )


def test_simulated_force_interval_equals_extreme_dampers(folder: Path):
    found, low, high = (
        mrdamper.simulate(folder / f"{name}.json", MOTION, posterior=samples)
        for name, samples in (("card", 21), ("low", 0), ("high", 0))
    )
    ends = np.sort([low.force, high.force], axis=0)
    assert found.interval is not None
    assert np.allclose(found.interval, ends, atol=1e-9 * np.abs(ends).max())
    assert (ends[1] - ends[0]).max() > 50.0


@pytest.mark.parametrize("where", [0.82, 1.0, 1.17])
def test_force_interval_contains_force_of_sampled_damper(folder: Path, where: float):
    """The run is simulated with a viscosity inside the range of the posterior samples."""
    runs = Dataset((a_run(with_viscosity(where * TRUTH.parameters[NAME])),))
    result = mrdamper.evaluate(folder / "card.json", runs, posterior=21)
    (force,) = result.forces
    inside = (force.low_N - 1.0 <= force.measured_N) & (force.measured_N <= force.high_N + 1.0)
    assert inside.mean() > 0.95
    assert force.rmse_N[0] <= force.rmse_N[1]
    (viscosity,) = (each for each in result.coefficients if each.name == "viscosity")
    # The interval has a constant width because only the coefficient c0 is sampled.
    assert np.ptp(viscosity.high - viscosity.low) == pytest.approx(0.0, abs=1e-6)
    assert (viscosity.high - viscosity.low)[0] == pytest.approx(LEVELS[-2] - LEVELS[1])


def test_tracking_force_interval_ends_at_extreme_viscosities(folder: Path):
    result = mrdamper.track(
        folder / "card.json",
        targets=["sine-900N-1Hz"],
        temperatures_degC=(60.0,),
        controllers=("paper",),
        posterior=21,
        jobs=1,
    )
    (traced,) = result.traced
    (error,) = traced.posterior
    assert error.rmse_N[0] < error.rmse_N[1] <= error.max_N[1]
    course, run = traced.course, traced.runs[0]
    path = drive(
        run.scenario.path, duration=run.scenario.duration_s, rate_Hz=1.0 / course.step_s, command=0.0
    )
    count = len(course)
    path = replace(
        path,
        displacement=course.displacement,
        velocity=course.velocity,
        acceleration=path.acceleration[-count:],
        command=run.current,
        temperature=np.full(count, 333.15),
    )
    scored = slice(course.scored_from, None)
    ends = np.sort(
        [simulate(with_viscosity(level), path)[scored] for level in (LEVELS[1], LEVELS[-2])], axis=0
    )
    assert np.allclose([error.low_N[scored], error.high_N[scored]], ends, atol=1.0)


def test_posterior_of_another_card_is_rejected(folder: Path, tmp_path: Path):
    def refused(card: Any, *words: str) -> None:
        with pytest.raises(InputError) as fault:
            mrdamper.simulate(card, MOTION, posterior=5)
        assert all(word in str(fault.value) for word in words), str(fault.value)

    refused(folder / "low.json", "posterior.npz", "belong to another card", "Fit again")
    alone = tmp_path / "card.json"
    alone.write_bytes((folder / "card.json").read_bytes())
    refused(alone, "posterior.npz", "No such file", "Fit again")
    refused(replace(read_card(alone), file=""), "card", "was not read from a file")


def test_interval_requires_posterior_option(tmp_path: Path):
    path = write_card_of(tmp_path / "card.json", TRUTH)
    write_card(read_card(path), path)
    assert mrdamper.simulate(path, MOTION).interval is None
