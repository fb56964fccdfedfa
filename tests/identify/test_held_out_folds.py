"""Refits without one motion give the expected error, the force band and standard errors of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, Trajectory, drive
from mrdamper.identify.confidence.held_out_folds import (
    force_band,
    refit_without_folds,
    with_changing_current,
    with_errors_between_motions,
)
from mrdamper.identify.motions import folds_of, motion_groups
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.card_schema import card_from_json, card_to_json
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand, MotionSize
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs
from tests.models.test_card import a_card as card

BAND = ForceBand(
    share=0.9, factor=0.1, run_share=0.15, base_N=20.0, expected_nrmse_percent=3.0, worst_nrmse_percent=9.0,
    left_out="motions", folds=4,
)  # fmt: skip


def recorded(name: str, path: Trajectory, force: FloatArray) -> RigRun:
    return RigRun(
        name=name,
        time=path.time,
        displacement=path.displacement,
        force=force,
        command=path.command,
        command_unit="A",
    )


def fitted(law: str, truth: str, noise: float) -> tuple[FitProblem, SearchResult]:
    """Fit a law to runs of the reference damper of the law ``truth``."""
    runs = simulate_runs(REFERENCE_DAMPERS[truth], noise=noise, seed=0)
    damper, free = template(law, runs)
    problem = FitProblem(damper, free, runs)
    return problem, fit_variable_projection(problem, starts=1)


def test_expected_error_of_correct_model_equals_noise() -> None:
    problem, result = fitted("dahl", "dahl", noise=0.02)
    left = refit_without_folds(problem, result)
    assert left is not None
    band = force_band(left)
    assert band.expected_nrmse_percent == pytest.approx(2.0, rel=0.1)
    assert (band.left_out, band.folds) == ("motions", 3)


def test_force_band_of_wrong_model_covers_new_motion() -> None:
    """The band contains the error of a law without the elastic element of the reference damper."""
    problem, result = fitted("bingham", "dahl", noise=0.01)
    left = refit_without_folds(problem, result)
    assert left is not None
    band = force_band(left)
    path = drive(Sine(7e-3, 1.4), duration=3.0, rate_Hz=500.0, command=1.0)
    force, truth = simulate(result.damper, path), simulate(REFERENCE_DAMPERS["dahl"], path)
    assert 0.8 < band.coverage(force[500:], truth[500:]) <= 1.0
    narrow = replace(band, factor=0.1 * band.factor)
    assert narrow.coverage(force[500:], truth[500:]) < 0.8


def test_standard_errors_of_wrong_model_cover_refitted_parameters() -> None:
    """A refit without some motions changes each parameter by less than three standard errors.

    The standard errors then include the differences between motions. With standard errors from the residuals
    alone, at least one parameter changes by more.
    """
    problem, result = fitted("bingham", "dahl", noise=0.01)
    left = refit_without_folds(problem, result)
    assert left is not None
    wide = {e.name: e.standard_error for e in with_errors_between_motions(problem, result, left).estimates}
    for each in result.estimates:
        assert wide[each.name] >= (1.0 - 1e-9) * each.standard_error or np.isnan(each.standard_error)
    apart = {
        e.name: max(abs(damper.parameters[e.name] - e.value) for damper in left.dampers)
        for e in result.estimates
        if not np.isnan(e.standard_error)
    }
    assert all(apart[name] < 3.0 * wide[name] for name in apart)
    alone = {e.name: e.standard_error for e in result.estimates}
    assert any(apart[name] > 3.0 * alone[name] for name in apart), "the residuals alone would do"


def test_force_band_widens_away_from_fitted_motions() -> None:
    """A motion with half the amplitude has the distance ln 2 = 0.69 from the nearest fitted motion."""
    path, small = (
        drive(Sine(amplitude, 1.0), duration=2.0, rate_Hz=500.0, command=1.0) for amplitude in (8e-3, 4e-3)
    )
    near = MotionSize.from_motion(path)
    far = MotionSize(10.0 * near.displacement_m, near.velocity_m_s)
    band = replace(BAND, motions=(far, near), usual_distance=0.3, widening=1.5)
    assert band.widened(path) == 1.0
    assert band.widened(small) == pytest.approx(1.0 + 1.5 * (np.log(2.0) - 0.3))
    assert BAND.widened(small) == 1.0
    force = np.array([-500.0, 0.0, 500.0])
    assert band.half_width(force, band.widened(small)) == pytest.approx(
        band.widened(small) * BAND.half_width(force)
    )
    assert card_from_json(card_to_json(card(force_band=band))).force_band == band


def test_fit_to_all_motions_is_better_than_refits() -> None:
    """If the law is wrong, each motion requires different parameters.

    The fit to all motions then has a smaller expected error than refits without a motion. With the correct
    law, both errors are equal.
    """
    shares = {}
    for law in ("bingham", "dahl"):
        left = refit_without_folds(*fitted(law, "dahl", noise=0.01))
        assert left is not None
        shares[law] = left.expected_ratio
        missed = np.median([run.nrmse_percent for fold in left.errors for run in fold])
        assert force_band(left).expected_nrmse_percent == pytest.approx(left.expected_ratio * missed)
    assert shares["bingham"] < 0.99
    assert 0.99 < shares["dahl"] <= 1.0


def test_expected_error_matches_burman_correction() -> None:
    """The expected error agrees with simulations of all refitted dampers on all runs."""
    problem, result = fitted("bingham", "dahl", noise=0.01)
    left = refit_without_folds(problem, result)
    assert left is not None

    def square(damper: Damper, runs: Sequence[int]) -> list[float]:
        found = []
        for k in runs:
            run = problem.runs[k]
            kept, force = slice(run.scored_from, None), simulate(damper, run.trajectory)
            found.append(float(1e4 * np.mean((force - run.force)[kept] ** 2) / np.var(run.force[kept])))
        return found

    folds = [fold.runs for fold in folds_of(problem.runs)]
    every = range(len(problem.runs))
    out = np.mean(
        [each for fold, damper in zip(folds, left.dampers, strict=True) for each in square(damper, fold)]
    )
    more = np.mean([np.mean(square(damper, every)) for damper in left.dampers]) - np.mean(
        square(result.damper, every)
    )
    assert left.expected_ratio == pytest.approx(np.sqrt((out - more) / out), rel=1e-3)
    found = [run.nrmse_percent**2 for fold in left.errors for run in fold]
    assert np.mean(found) == pytest.approx(out, rel=1e-3)
    sizes = [MotionSize.from_motion(run.trajectory) for run in problem.runs]
    away = [sizes[k].distance([sizes[j] for j in every if j not in fold]) for fold in folds for k in fold]
    assert left.distance == pytest.approx(np.mean(away))
    assert set(left.motions) == {sizes[group[0]] for group in motion_groups(problem.runs)}
    assert force_band(left).widening == 1.5


def test_single_motion_is_divided_into_time_blocks() -> None:
    problem, result = fitted("dahl", "dahl", noise=0.02)
    two = replace(problem, runs=problem.runs[2:4])
    left = refit_without_folds(two, result)
    assert left is not None
    assert (left.kind, len(left.dampers), left.motions, left.distance) == ("blocks of time", 5, (), 0.0)
    for fold in left.errors:
        assert sum(len(run.force) for run in fold) == pytest.approx(
            sum(len(run.force) - run.start for run in two.windows()) / 5, abs=3
        )
    assert force_band(left).widening == 0.0
    alone = with_errors_between_motions(two, result, left).estimates
    for each, before in zip(alone, result.estimates, strict=True):
        values = np.array([damper.parameters[each.name] for damper in left.dampers])
        jackknife = 2.131847 / 1.644854 * np.sqrt(4 / 5 * np.sum((values - np.mean(values)) ** 2))
        assert each.standard_error == pytest.approx(max(jackknife, before.standard_error), rel=1e-5)


def test_force_band_covers_runs_with_changing_current() -> None:
    """A model without lag has larger errors at changing current. The widened band contains 90 % of them."""
    model, path = REFERENCE_DAMPERS["dahl"], drive(Sine(0.01, 1.0), duration=6.0, rate_Hz=500.0, command=0.0)
    truth = replace(model, command_lag_s=0.03)
    rng = np.random.default_rng(4)
    runs = []
    for k in range(3):
        command = np.repeat(rng.uniform(0.0, 2.0, 40), 75)[: len(path)]
        changing = replace(path, command=np.resize(command, len(path)))
        runs.append(prepare_run(recorded(f"random {k}", changing, simulate(truth, changing))))
    *known, new = runs
    force = simulate(model, new.trajectory)
    coverages = [
        band.coverage(force, new.force, band.widened(new.trajectory))
        for band in (BAND, with_changing_current(BAND, model, known))
    ]
    assert coverages[0] < 0.8
    assert 0.85 < coverages[1] < 0.98
    assert with_changing_current(BAND, truth, known).changing_current_ratio == 1.0
