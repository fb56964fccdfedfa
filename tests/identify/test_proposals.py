"""Tests proposed by a fit: inside what the runs covered, and worth what they promise."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence import proposals
from mrdamper.identify.confidence.proposals import ProposedTest, _candidates, _proposed, propose_tests
from mrdamper.identify.evaluate import whole_envelope
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs

TRUTH = REFERENCE_DAMPERS["bouc-wen"]


def test_proposed_tests_stay_inside_runs() -> None:
    runs = simulate_runs(TRUTH, noise=0.02, seed=0)
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, runs)
    tests = propose_tests(problem, fit_variable_projection(problem))
    seen = whole_envelope(runs)
    assert len(tests) == 3
    for test in tests:
        assert test.amplitude_mm <= 1e3 * seen.displacement[1] * 1.01
        assert seen.command[0] <= test.command <= seen.command[1]
        speed = 2e-3 * math.pi * test.frequency_Hz * test.amplitude_mm
        assert speed <= 1.05 * max(map(abs, seen.velocity))
    taken = [test.reduction_percent for test in tests]
    assert 0.0 < taken[0] <= taken[1] <= taken[2] < 100.0
    assert tests[0].sentence.startswith("run a sine of")


def test_proposed_test_narrows_uncertain_parameter() -> None:
    """From runs at one small stroke, errors after the proposed run are smaller than after any run again."""
    few = simulate_runs(TRUTH, noise=0.02, seed=0)[:4]
    damper, free = template("bouc-wen", few)
    problem = FitProblem(damper, free, few)
    result = fit_variable_projection(problem)
    best = propose_tests(problem, result, count=1)[0]
    path = drive(
        Sine(1e-3 * best.amplitude_mm, best.frequency_Hz),
        duration=4.0 / best.frequency_Hz,
        rate_Hz=500.0,
        command=best.command,
    )
    force = simulate(TRUTH, path)
    noise = 0.02 * float(np.std(force)) * np.random.default_rng(1).standard_normal(len(force))
    run = RigRun(
        name="proposed",
        time=path.time,
        displacement=path.displacement,
        force=force + noise,
        command=path.command,
        command_unit="A",
    )

    def doubt(runs: tuple[PreparedRun, ...]) -> float:
        found = fit_variable_projection(FitProblem(damper, free, runs), dampers=[result.damper])
        return math.log(np.prod([e.design_error_percent for e in found.estimates if not e.at_bound]))

    assert doubt((*few, prepare_run(run, NO_SMOOTHING))) < min(doubt((*few, again)) for again in few)


def seen(**ends: tuple[float, float] | None) -> Any:
    """Return an envelope of a stroke of 2 m and one frequency at which a metre is 1 m/s and 1 m/s^2."""
    one = 1.0 / (2.0 * math.pi)
    usual = {"displacement": (-1.5, 0.5), "velocity": (-1.0, 0.9), "acceleration": (-0.5, 1.0)}
    more = {"frequency": (one, one), "command": (0.5, 1.5), "temperature": None}
    return SimpleNamespace(**{**usual, **more, **ends})


@pytest.mark.parametrize(
    ("ends", "shares"),
    [
        ({}, [1.0, 0.5, 0.2]),
        ({"velocity": (-0.3, 0.985)}, [1.0, 0.5, 0.2]),
        ({"velocity": (-0.3, 0.975)}, [0.5, 0.2]),
        ({"acceleration": (-0.92, 0.0)}, [1.0, 0.5, 0.2]),
        ({"acceleration": (-0.90, 0.0)}, [0.5, 0.2]),
        ({"velocity": (-6.6, 0.0)}, [1.0, 0.5, 0.2]),
        ({"velocity": (-6.7, 0.0)}, [1.0, 0.5]),
    ],
)
def test_candidates_respect_velocity_and_acceleration(monkeypatch, ends, shares) -> None:
    """Two percent beyond the top speed and ten beyond the acceleration, and not below 3 % of the speed."""
    monkeypatch.setattr(proposals, "whole_envelope", lambda _: seen(**ends))
    found = _candidates(SimpleNamespace(runs=()), TRUTH)  # type: ignore[arg-type]
    assert sorted({amplitude for amplitude, *_ in found}, reverse=True) == pytest.approx(shares)
    assert {command for _, _, command, _ in found} == {0.5, 1.0, 1.5}
    assert {kelvin for *_, kelvin in found} == {None}


def test_candidates_cover_frequencies_and_temperatures(monkeypatch) -> None:
    warm = {
        "frequency": (1e-3, 4e-3),
        "temperature": (290.0, 330.0),
        "velocity": (-0.02, 0.02),
        "command": (1.0, 1.0),
    }
    monkeypatch.setattr(proposals, "whole_envelope", lambda _: seen(**warm))
    depends: Any = SimpleNamespace(temperature_dependent=True)
    found = _candidates(SimpleNamespace(runs=()), depends)  # type: ignore[arg-type]
    assert sorted({frequency for _, frequency, *_ in found}) == pytest.approx([1e-3, 2e-3, 4e-3])
    assert [kelvin for *_, kelvin in found] == [290.0, 330.0] * (len(found) // 2)
    assert {command for _, _, command, _ in found} == {1.0}
    depends.temperature_dependent = False
    assert {kelvin for *_, kelvin in _candidates(SimpleNamespace(runs=()), depends)} == {None}  # type: ignore[arg-type]


def test_proposed_test_is_rounded() -> None:
    test = _proposed((0.0123456, 1.23456, 0.98765, 293.4), "A", 12.3456)
    assert test == ProposedTest(12.3, 1.23, 0.988, "A", 20.2, 12.3)
    assert test.sentence == (
        "run a sine of 12 mm at 1.2 Hz, 0.988 A and 20 degC: it reduces the uncertainty of the force "
        "due to the parameters by 12 %"
    )
    assert " 0.988 V: it reduces" in _proposed((0.0123456, 1.23456, 0.98765, None), "V", 0.0).sentence


def test_parameters_on_bounds_need_no_test() -> None:
    few = simulate_runs(TRUTH, noise=0.02, seed=0)[:4]
    damper, free = template("bouc-wen", few)
    problem = FitProblem(damper, free, few)
    result = fit_variable_projection(problem, dampers=[TRUTH])
    stuck = replace(result, estimates=tuple(replace(each, at_bound="upper") for each in result.estimates))
    assert propose_tests(problem, stuck) == ()
    candidates = len(_candidates(problem, result.damper))
    found = propose_tests(problem, result, count=candidates + 5)
    assert len(found) == candidates
    assert [each.reduction_percent for each in found] == sorted(each.reduction_percent for each in found)
    assert propose_tests(problem, result, count=2) == found[:2]
