"""A fit proposes tests in the measured range that reduce the uncertainty more than repeated runs."""

from __future__ import annotations

import math
import re

import numpy as np

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence.proposals import propose_tests
from mrdamper.identify.evaluate import operating_envelope
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs

TRUTH = REFERENCE_DAMPERS["bouc-wen"]


def read(test: str) -> tuple[float, float, float, float]:
    """Return amplitude [m], frequency [Hz], current [A] and reduction of the error [%] of a proposed test."""
    pattern = r"run a sine of (\S+) mm at (\S+) Hz, (\S+) A: .* by (\d+) %"
    found = re.fullmatch(pattern, test)
    assert found
    amplitude_mm, frequency_Hz, current_A, reduction_percent = map(float, found.groups())
    return 1e-3 * amplitude_mm, frequency_Hz, current_A, reduction_percent


def test_proposed_tests_stay_in_measured_range() -> None:
    runs = simulate_runs(TRUTH, noise=0.02, seed=0)
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, runs)
    tests = [read(test) for test in propose_tests(problem, fit_variable_projection(problem))]
    seen = operating_envelope(runs)
    assert len(tests) == 3
    for amplitude, frequency, current, _ in tests:
        assert amplitude <= seen.displacement[1] * 1.05
        assert seen.command[0] <= current <= seen.command[1]
        assert 2.0 * math.pi * frequency * amplitude <= 1.1 * max(map(abs, seen.velocity))
    reductions = [reduction for *_, reduction in tests]
    assert 0.0 < reductions[0] <= reductions[1] <= reductions[2] < 100.0


def test_proposed_test_reduces_parameter_errors() -> None:
    """All runs have a small stroke. The proposed run reduces the errors more than any repetition of a run."""
    few = simulate_runs(TRUTH, noise=0.02, seed=0)[:4]
    damper, free = template("bouc-wen", few)
    problem = FitProblem(damper, free, few)
    result = fit_variable_projection(problem)
    amplitude, frequency, current, _ = read(propose_tests(problem, result, count=1)[0])
    path = drive(Sine(amplitude, frequency), duration=4.0 / frequency, rate_Hz=500.0, command=current)
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

    def mean_log_error(runs: tuple[PreparedRun, ...]) -> float:
        found = fit_variable_projection(FitProblem(damper, free, runs), dampers=[result.damper])
        return math.log(np.prod([e.design_error_percent for e in found.estimates if not e.at_bound]))

    assert mean_log_error((*few, prepare_run(run, NO_SMOOTHING))) < min(
        mean_log_error((*few, again)) for again in few
    )
