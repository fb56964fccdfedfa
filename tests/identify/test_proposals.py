"""Tests proposed by a fit: inside what the runs covered, and worth what they promise."""

from __future__ import annotations

import math

import numpy as np

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence.proposals import propose_tests
from mrdamper.identify.predict import whole_envelope
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.simulate import simulate
from tests.identify.truths import AS_IT_IS, TRUTHS, measured

TRUTH = TRUTHS["bouc-wen"]


def test_proposals_keep_inside_the_runs_and_each_takes_off_more() -> None:
    runs = measured(TRUTH, noise=0.02, seed=0)
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, runs)
    tests = propose_tests(problem, fit_variable_projection(problem, seed=0))
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


def test_the_proposed_test_narrows_a_parameter_that_the_runs_leave_open() -> None:
    """From runs at one small stroke, errors after the proposed run are smaller than after any run again."""
    few = measured(TRUTH, noise=0.02, seed=0)[:4]
    damper, free = template("bouc-wen", few)
    problem = FitProblem(damper, free, few)
    result = fit_variable_projection(problem, seed=0)
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
        found = fit_variable_projection(FitProblem(damper, free, runs), first=result.damper, starts=0)
        return math.log(np.prod([e.design_error_percent for e in found.estimates if not e.at_bound]))

    assert doubt((*few, prepare_run(run, AS_IT_IS))) < min(doubt((*few, again)) for again in few)
