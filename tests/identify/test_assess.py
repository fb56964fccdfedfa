"""Scores: what the figures mean, on runs whose error is known in advance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.identify.assess import assess, cross_validate, passivity, score_run, summary
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import find_law
from tests.identify.truths import TRUTHS, measured

LAW = "bouc-wen"


def test_the_score_of_the_truth_is_the_noise() -> None:
    runs = measured(TRUTHS[LAW], noise=0.05, seed=1)
    assert np.median([score_run(TRUTHS[LAW], run).nrmse_percent for run in runs]) == pytest.approx(
        5.0, rel=0.03
    )


def test_a_constant_offset_shows_in_the_score_and_not_in_the_offset_free_one() -> None:
    run = measured(TRUTHS[LAW], noise=0.0, seed=0)[2]
    spread = float(np.std(run.force[run.scored_from :]))
    error = score_run(TRUTHS[LAW], replace(run, force=np.asarray(run.force) + 0.1 * spread))
    assert error.nrmse_percent == pytest.approx(10.0, abs=0.1)
    assert error.nrmse_offset_free_percent == pytest.approx(0.0, abs=0.1)
    assert error.rmse_N == pytest.approx(0.1 * spread, rel=0.01)


def test_what_happens_before_half_a_period_counts_only_in_the_whole_run() -> None:
    run = measured(TRUTHS[LAW], noise=0.0, seed=0)[2]
    force = np.array(run.force)
    force[: run.scored_from] += 500.0
    error = score_run(TRUTHS[LAW], replace(run, force=force))
    assert error.nrmse_percent == pytest.approx(0.0, abs=1e-6)
    assert error.nrmse_whole_percent > 10.0


def test_of_a_force_twice_its_own_a_model_misses_half() -> None:
    """Every score is a share of the spread of what was measured: of the scored part, or of the whole run."""
    run = measured(TRUTHS[LAW], noise=0.0, seed=0)[2]
    force = np.asarray(run.force)
    error = score_run(TRUTHS[LAW], replace(run, force=2.0 * force))
    assert error.nrmse_offset_free_percent == pytest.approx(50.0, rel=1e-6)
    assert error.nrmse_whole_percent == pytest.approx(
        50.0 * np.sqrt(np.mean(force**2)) / np.std(force), rel=1e-6
    )
    of_grams = score_run(TRUTHS[LAW], replace(run, force=1e-4 * force))
    assert of_grams.nrmse_offset_free_percent == pytest.approx(1e2 * (1e4 - 1.0), rel=1e-6)


def test_the_energy_of_a_cycle_is_the_area_of_its_loop() -> None:
    """Sine through the model of its own truth: model and measured energy agree, and both are work taken."""
    run = next(r for r in measured(TRUTHS[LAW], noise=0.0, seed=0) if r.run.name == "sine 5 mm 1 Hz 2 A")
    error = score_run(TRUTHS[LAW], run)
    path = run.trajectory
    one = slice(run.scored_from, run.scored_from + round(1.0 / path.step) + 1)
    area = float(np.trapezoid(run.force[one], path.displacement[one]))
    assert error.energy_measured_J == pytest.approx(area, rel=0.01)
    assert error.energy_model_J == pytest.approx(error.energy_measured_J, rel=1e-9)


def test_zero_command_stands_apart_in_the_summary() -> None:
    runs = measured(TRUTHS[LAW], noise=0.02, seed=0)
    errors = [score_run(TRUTHS[LAW], run) for run in runs]
    worse = [replace(e, nrmse_percent=99.0) if e.command == 0.0 else e for e in errors]
    assert summary(worse)["worst"] == 99.0
    assert summary(worse)["worst_above_zero"] < 3.0


def test_every_motion_is_left_out_once_and_inner_currents_only() -> None:
    runs = measured(TRUTHS[LAW], noise=0.02, seed=0)
    seen: list[int] = []

    def fit(some: object) -> object:
        seen.append(len(some))  # type: ignore[arg-type]
        return TRUTHS[LAW]

    motions = cross_validate(fit, runs, "motion")  # type: ignore[arg-type]
    assert [left.left_out for left in motions] == ["harmonics", "sine 10 mm 2 Hz", "sine 5 mm 1 Hz"]
    assert seen == [8, 8, 8]
    assert sum(len(left.errors) for left in motions) == len(runs)
    currents = cross_validate(fit, runs, "current")  # type: ignore[arg-type]
    assert [left.left_out for left in currents] == ["0.5 A", "1 A"]


def test_dry_friction_takes_four_times_amplitude_times_force_in_every_cycle() -> None:
    """The closed form behind the passivity figure: a rectangle of 2 A by 2 F has ratio one."""
    runs = measured(TRUTHS["bingham"], noise=0.0, seed=0)
    dry = Damper(find_law("bingham"), {"yield_force": Constant(500.0), "yield_velocity": Constant(1e-6)})
    assert passivity(dry, runs) == pytest.approx(1.0, rel=0.01)


def test_numbers_that_the_runs_cannot_tell_are_said_in_words() -> None:
    """Bouc-Wen data in which the yield displacement is passed within a sample: n and kappa show nowhere."""
    steep = replace(TRUTHS[LAW], coefficients={**TRUTHS[LAW].coefficients, "rho": Constant(5e5)})
    runs = measured(steep, noise=0.02, seed=0)
    damper, free = template(LAW, runs)
    problem = FitProblem(damper, free, runs)
    result = fit_variable_projection(problem, starts=2, seed=0)
    words = " ".join(assess(result, runs, problem=problem).words)
    assert "n.value" in words or "kappa.value" in words


def test_an_energy_that_is_off_by_more_than_15_percent_is_said() -> None:
    runs = measured(TRUTHS[LAW], noise=0.0, seed=0)
    damper, free = template(LAW, runs)
    result = fit_variable_projection(FitProblem(damper, free, runs), starts=1, seed=0)
    run = next(r for r in runs if r.run.name == "sine 5 mm 1 Hz 2 A")
    for times, off in ((1.25, "-20 %"), (1.1, ""), (0.9, ""), (0.8, "+25 %")):
        words = assess(result, runs, [replace(run, force=times * np.asarray(run.force))]).words
        said = [word for word in words if "energy per cycle" in word]
        assert said == ([f"{run.run.name}: energy per cycle is off by {off}."] if off else [])


def test_a_coefficient_held_at_its_limit_is_named() -> None:
    """Data that ask for a negative spring: the fit stops at none and says so."""
    runs = [
        replace(run, force=np.asarray(run.force) - 9000.0 * run.trajectory.displacement)
        for run in measured(TRUTHS[LAW], noise=0.02, seed=0)
    ]
    damper, free = template(LAW, runs)
    result = fit_variable_projection(FitProblem(damper, free, tuple(runs)), starts=1, seed=0)
    words = assess(result, runs).words
    assert any(word.startswith("stiffness is held at the law's limit (0)") for word in words)
    assert result.damper.coefficients["stiffness"].value(np.linspace(0.0, 2.0, 41)).min() >= 0.0


def test_a_model_in_amperes_is_not_scored_on_a_run_in_volts() -> None:
    run = measured(TRUTHS[LAW], noise=0.0, seed=0)[0]
    with pytest.raises(InputError, match="the command is in V"):
        score_run(TRUTHS[LAW], replace(run, run=replace(run.run, command_unit="V")))
