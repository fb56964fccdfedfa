"""Jobs that follow posterior draws: their intervals against the same job on the dampers at the ends.

One parameter is drawn, the viscosity, at 21 even levels. All that is looked at rises or falls with it, so
that the 5th and 95th percentile are, without interpolation, what the second and the second to last damper do.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mrdamper
from mrdamper.cli.commands import parameters_of
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


def test_simulated_forces_span_those_of_the_dampers_at_the_ends(folder: Path):
    found, low, high = (
        mrdamper.simulate(folder / f"{name}.json", MOTION, posterior=samples)
        for name, samples in (("card", 21), ("low", 0), ("high", 0))
    )
    ends = np.sort([low.force, high.force], axis=0)
    assert found.interval is not None
    assert np.allclose(found.interval, ends, atol=1e-9 * np.abs(ends).max())
    assert (ends[1] - ends[0]).max() > 50.0


@pytest.mark.parametrize("where", [0.82, 1.0, 1.17])
def test_a_run_of_a_damper_among_the_draws_lies_in_the_interval(folder: Path, where: float):
    """The card has not seen the run; the truth is any damper that its draws hold."""
    runs = Dataset((a_run(with_viscosity(where * TRUTH.parameters[NAME])),))
    result = mrdamper.evaluate(folder / "card.json", runs, posterior=21)
    (force,) = result.forces
    inside = (force.low_N - 1.0 <= force.measured_N) & (force.measured_N <= force.high_N + 1.0)
    assert inside.mean() > 0.95
    assert force.rmse_N[0] <= force.rmse_N[1]
    (viscosity,) = (each for each in result.coefficients if each.name == "viscosity")
    assert np.ptp(viscosity.high - viscosity.low) == pytest.approx(0.0, abs=1e-6)  # the constant term alone
    assert (viscosity.high - viscosity.low)[0] == pytest.approx(LEVELS[-2] - LEVELS[1])


def test_tracked_forces_span_those_of_the_dampers_at_the_ends(folder: Path):
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


def test_draws_that_are_not_of_the_card_are_refused_with_place_and_remedy(folder: Path, tmp_path: Path):
    def refused(card: Any, *words: str) -> None:
        with pytest.raises(InputError) as fault:
            mrdamper.simulate(card, MOTION, posterior=5)
        assert all(word in str(fault.value) for word in words), str(fault.value)

    refused(folder / "low.json", "posterior.npz", "those of another card", "Fit again")
    alone = tmp_path / "card.json"
    alone.write_bytes((folder / "card.json").read_bytes())
    refused(alone, "posterior.npz", "No such file", "Fit again")
    refused(replace(read_card(alone), file=""), "card", "was not read from a file")


def test_reports_show_the_interval_as_picture_and_number(folder: Path, tmp_path: Path):
    card = folder / "card.json"
    found = mrdamper.evaluate(card, Dataset((a_run(TRUTH),)), posterior=9)
    found.save(tmp_path / "evaluate")
    page = (tmp_path / "evaluate" / "evaluate.html").read_text(encoding="utf-8")
    assert "with their intervals of 90 percent" in page
    assert "With 90 % the parameters leave" in page
    answer = mrdamper.registry.JOBS["evaluate"].reported.answer(found)
    assert answer["posterior"]["interval_width_N"] == found.forces[0].width_N
    assert answer["runs"][0]["rmse_interval_N"] == list(found.forces[0].rmse_N)


def test_without_the_option_nothing_is_read(tmp_path: Path):
    path = write_card_of(tmp_path / "card.json", TRUTH)
    write_card(read_card(path), path)
    assert mrdamper.simulate(path, MOTION).interval is None


def test_a_motion_in_words_stays_words_on_the_command_line():
    """What no reader takes from a path must not become one: ``sine:10mm:...`` was sought as a file."""
    (motion,) = (each for each in parameters_of(mrdamper.registry.JOBS["simulate"]) if each.name == "motion")
    assert motion.type.convert(MOTION, None, None) == MOTION
