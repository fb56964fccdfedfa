"""Error scores of runs and the passivity number of dampers equal values in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.assess import assess, passivity
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.scores import score_run, summary
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.laws import find_law
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs

LAW = "bouc-wen"


def remarks(result: SearchResult, runs: Sequence[PreparedRun]) -> tuple[str, ...]:
    """Return the notes of the assessment of a fit to runs."""
    fitted: Any = SimpleNamespace(result=result, damper=result.damper, training=runs, held_out=())
    return assess(fitted).words


def test_error_of_reference_damper_equals_noise() -> None:
    runs = simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.05, seed=1)
    assert np.median([score_run(REFERENCE_DAMPERS[LAW], run).nrmse_percent for run in runs]) == pytest.approx(
        5.0, rel=0.03
    )


def test_offset_free_error_ignores_constant_offset() -> None:
    run = simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.0, seed=0)[2]
    spread = float(np.std(run.force[run.scored_from :]))
    error = score_run(REFERENCE_DAMPERS[LAW], replace(run, force=np.asarray(run.force) + 0.1 * spread))
    assert error.nrmse_percent == pytest.approx(10.0, abs=0.1)
    assert error.nrmse_offset_free_percent == pytest.approx(0.0, abs=0.1)
    assert error.rmse_N == pytest.approx(0.1 * spread, rel=0.01)


def test_error_of_doubled_force_is_half() -> None:
    """Errors are relative to the standard deviation of the measured force in the same samples."""
    run = simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.0, seed=0)[2]
    force = np.asarray(run.force)
    error = score_run(REFERENCE_DAMPERS[LAW], replace(run, force=2.0 * force))
    assert error.nrmse_offset_free_percent == pytest.approx(50.0, rel=1e-6)
    assert error.nrmse_whole_percent == pytest.approx(
        50.0 * np.sqrt(np.mean(force**2)) / np.std(force), rel=1e-6
    )
    of_grams = score_run(REFERENCE_DAMPERS[LAW], replace(run, force=1e-4 * force))
    assert of_grams.nrmse_offset_free_percent == pytest.approx(1e2 * (1e4 - 1.0), rel=1e-6)


def test_energy_per_cycle_is_loop_area() -> None:
    """The simulated sine has no noise, so the modelled and the measured energy are equal."""
    run = next(
        r
        for r in simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.0, seed=0)
        if r.run.name == "sine 5 mm 1 Hz 2 A"
    )
    error = score_run(REFERENCE_DAMPERS[LAW], run)
    path = run.trajectory
    one = slice(run.scored_from, run.scored_from + round(1.0 / path.step) + 1)
    area = float(np.trapezoid(run.force[one], path.displacement[one]))
    assert error.energy_measured_J == pytest.approx(area, rel=0.01)
    assert error.energy_model_J == pytest.approx(error.energy_measured_J, rel=1e-9)


def test_summary_separates_runs_at_zero_current() -> None:
    runs = simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.02, seed=0)
    errors = [score_run(REFERENCE_DAMPERS[LAW], run) for run in runs]
    worse = [replace(e, nrmse_percent=99.0) if e.command == 0.0 else e for e in errors]
    assert summary(worse)["worst"] == 99.0
    assert summary(worse)["worst_above_zero"] < 3.0


def test_unidentifiable_parameters_are_named_in_notes() -> None:
    """The damper yields within a sample, so its runs do not determine the Bouc-Wen parameters n and kappa."""
    steep = replace(
        REFERENCE_DAMPERS[LAW], coefficients={**REFERENCE_DAMPERS[LAW].coefficients, "rho": Constant(5e5)}
    )
    runs = simulate_runs(steep, noise=0.02, seed=0)
    damper, free = template(LAW, runs)
    problem = FitProblem(damper, free, runs)
    result = fit_variable_projection(problem, starts=2)
    words = " ".join(remarks(result, runs))
    assert "n.value" in words or "kappa.value" in words


# Passivity, compared with closed forms


def bingham(**values: float | Polynomial) -> Damper:
    """Return a damper with viscosity and friction. Friction is constant above 0.1 % of the maximum speed."""
    forms = {
        name: value if isinstance(value, Polynomial) else Constant(value) for name, value in values.items()
    }
    return Damper(
        find_law("bingham"), {"yield_force": Constant(0.0), "yield_velocity": Constant(1e-5), **forms}
    )


def test_passivity_number_matches_formula() -> None:
    """The force loop of a viscous damper is an ellipse with pi/4 of the area of the enclosing rectangle.

    The passivity number is the dissipated energy divided by the area of the rectangle. A spring, a mass and
    an offset enlarge the rectangle but dissipate no energy. The spring has the largest effect at full stroke,
    the mass at 1 % of the stroke and the offset at 20 % of the maximum speed.
    """
    runs = simulate_runs(REFERENCE_DAMPERS["bingham"], noise=0.0, seed=0)
    stroke = max(np.abs(run.trajectory.displacement).max() for run in runs)
    speed = max(np.abs(run.trajectory.velocity).max() for run in runs)
    ellipse, c = np.pi / 4.0, 500.0
    for damper, expected in (
        (bingham(viscosity=c), ellipse),
        (bingham(yield_force=100.0, stiffness=5e3), 100.0 / (100.0 + 5e3 * stroke)),
        (bingham(viscosity=c, mass=2.0), ellipse / np.hypot(1.0, 2.0 * speed / (0.01 * stroke) / c)),
        (bingham(viscosity=c, offset=30.0), ellipse / (1.0 + 30.0 / (c * 0.2 * speed))),
        (
            bingham(viscosity=Polynomial((c, -960.0, 480.0)), offset=30.0),
            ellipse / (1.0 + 30.0 / (20.0 * 0.2 * speed)),
        ),
        (
            bingham(viscosity=Polynomial((230.0, -840.0, 840.0)), offset=30.0),
            ellipse / (1.0 + 30.0 / (20.0 * 0.2 * speed)),
        ),
        (bingham(), 0.0),
    ):
        assert passivity(damper, runs) == pytest.approx(expected, rel=5e-3)


# Notes on a fit


def fitted(runs: Sequence[PreparedRun]) -> tuple[FitProblem, SearchResult]:
    damper, free = template(LAW, runs)
    problem = FitProblem(damper, free, tuple(runs))
    return problem, fit_variable_projection(problem, dampers=[REFERENCE_DAMPERS[LAW]])


@pytest.fixture(scope="module")
def truth() -> tuple[FitProblem, SearchResult]:
    return fitted(simulate_runs(REFERENCE_DAMPERS[LAW], noise=0.02, seed=0))


def said(result: SearchResult, problem: FitProblem, word: str) -> list[str]:
    return [each for each in remarks(result, problem.runs) if word in each]


def test_notes_report_damper_that_is_not_passive(truth) -> None:
    problem, result = truth
    assert said(result, problem, "not passive") == []
    pushing = bingham(viscosity=Polynomial((500.0, -10.0)), mass=50.0)
    least = passivity(pushing, problem.runs)
    assert least > 0.0
    assert said(replace(result, damper=pushing), problem, "not passive") == []
