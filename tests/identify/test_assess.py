"""Scores: what the figures mean, on runs whose error is known in advance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.assess import Kind, assess, cross_validate, passivity, score_run, summary
from mrdamper.identify.confidence.sentences import sentence
from mrdamper.identify.problem import FitProblem, FitResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial, Constant, Polynomial
from mrdamper.models.laws import find_law
from mrdamper.runtime.progress import ProgressUpdate
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


# --------------------------------------------------------------------------------- passivity in closed form


def bingham(**values: float | Polynomial) -> Damper:
    """Return viscosity, friction and the like; friction turns round within a thousandth of the top speed."""
    forms = {
        name: value if isinstance(value, Polynomial) else Constant(value) for name, value in values.items()
    }
    return Damper(
        find_law("bingham"), {"yield_force": Constant(0.0), "yield_velocity": Constant(1e-5), **forms}
    )


def test_the_passivity_figure_is_that_of_the_worst_cycle_in_the_envelope() -> None:
    """A dashpot's loop is an ellipse: pi/4 of the box. What adds force but no work is worst somewhere.

    A spring at the whole stroke, a mass at a hundredth of it and full speed, an offset at a fifth of that.
    """
    runs = measured(TRUTHS["bingham"], noise=0.0, seed=0)
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


# --------------------------------------------------------------------------------- what is left out


@pytest.mark.parametrize(
    ("folds", "sizes"), [(None, [1] * 12), (5, [3, 3, 2, 2, 2]), (20, [1] * 12), (1, [12])]
)
def test_runs_are_left_out_in_folds_each_once_and_progress_is_told(
    folds: int | None, sizes: list[int]
) -> None:
    runs = measured(TRUTHS[LAW], noise=0.02, seed=0)
    updates: list[ProgressUpdate] = []
    seen: list[int] = []

    def fit(some: Sequence[PreparedRun]) -> Damper:
        seen.append(len(some))
        return TRUTHS[LAW]

    left = cross_validate(fit, runs, "run", folds=folds, on_progress=updates.append)
    assert [len(each.errors) for each in left] == sizes
    assert seen == [12 - size for size in sizes]
    assert sorted(error.name for each in left for error in each.errors) == sorted(run.name for run in runs)
    assert [(update.done, update.total) for update in updates] == [
        (k + 1, len(sizes)) for k in range(len(sizes))
    ]
    assert updates[0].text == f"without run {left[0].left_out}"
    assert {error.split for each in left for error in each.errors} == {"held_out"}


def test_inner_temperatures_are_left_out_and_where_there_are_none_nothing_is() -> None:
    runs = measured(TRUTHS[LAW], noise=0.02, seed=0)

    def at(kelvin: Sequence[float]) -> list[PreparedRun]:
        return [
            replace(
                run,
                trajectory=replace(run.trajectory, temperature=np.full(len(run), kelvin[k % len(kelvin)])),
            )
            for k, run in enumerate(runs)
        ]

    def left(given: Sequence[PreparedRun], kind: Kind) -> list[str]:
        return [each.left_out for each in cross_validate(lambda _: TRUTHS[LAW], given, kind)]

    warm = at([323.15, 283.15, 293.15, 295.15, 308.15])
    assert left(warm, "temperature") == ["20 degC", "35 degC"]
    assert left(at([293.15, 294.15]), "temperature") == []
    assert left(at([293.15, 323.15]), "temperature") == []
    two = [run for run in runs if run.run.constant_command in (0.0, 2.0)]
    assert left(two, "current") == []
    assert left(two[::2], "current") == []
    assert left(runs[:4], "motion") == []
    stepping = replace(
        runs[0], run=replace(runs[0].run, command=np.linspace(0.0, 2.0, len(runs[0].run.command)))
    )
    assert left([stepping, *runs[1:]], "current") == ["0.5 A", "1 A"]
    with pytest.raises(InputError, match="no run has a temperature to leave out"):
        left(runs, "temperature")
    with pytest.raises(InputError, match="give the problem that was fitted"):
        assess(fitted(runs)[1], runs, leave_out=["run"])


# --------------------------------------------------------------------------------- words


def fitted(runs: Sequence[PreparedRun]) -> tuple[FitProblem, FitResult]:
    damper, free = template(LAW, runs)
    problem = FitProblem(damper, free, tuple(runs))
    return problem, fit_variable_projection(problem, starts=0, first=TRUTHS[LAW])


@pytest.fixture(scope="module")
def truth() -> tuple[FitProblem, FitResult]:
    return fitted(measured(TRUTHS[LAW], noise=0.02, seed=0))


def said(result: FitResult, problem: FitProblem, word: str) -> list[str]:
    return [each for each in assess(result, problem.runs).words if word in each]


@pytest.mark.parametrize(
    ("percent", "words"), [(29.9, None), (30.1, "30 %"), (999.4, "999 %"), (1000.0, "over 1000 %")]
)
def test_a_number_that_the_design_leaves_open_by_thirty_percent_is_named(truth, percent, words) -> None:
    problem, result = truth
    sound = [replace(each, design_error_percent=5.0) for each in result.estimates]
    loose = replace(sound[0], design_error_percent=percent)
    found = said(replace(result, estimates=(loose, *sound[1:])), problem, "not identifiable")
    assert len(found) == (words is not None)
    if words:
        assert found[0].startswith(
            f"{loose.name} is not identifiable from these runs (standard error {words} by design)"
        )


def test_what_was_asked_to_be_left_out_and_is_not_there_is_told(truth) -> None:
    problem, result = truth
    two = replace(
        problem, runs=tuple(run for run in problem.runs if run.run.constant_command in (0.0, 2.0))[:2]
    )
    words = assess(result, two.runs, problem=two, leave_out=("current", "motion")).words
    assert "Nothing was left out by motion: the runs have one alone." in words
    (told,) = [each for each in words if each.startswith("Nothing was left out by current: ")]
    assert told.endswith("the least and the largest stay, and the runs have none between them.")


def test_a_number_on_a_bound_is_named_with_the_bound(truth) -> None:
    problem, result = truth
    for side in ("lower", "upper"):
        one = replace(result.estimates[-1], at_bound=side, lower=-7.0, upper=9.0, unit="N")
        (found,) = said(replace(result, estimates=(*result.estimates[:-1], one)), problem, "rests on")
        assert found.startswith(f"{one.name} rests on its {side} bound ({-7 if side == 'lower' else 9} N)")


def test_pairs_that_are_traded_are_named_from_095_on_the_worst_four_first(truth) -> None:
    problem, result = truth
    names = [each.name for each in result.estimates]
    assert said(result, problem, "traded") == []
    owners = [name.partition(".")[0] for name in names]
    pairs = [(i, j) for i in range(len(names)) for j in range(i + 1, len(names)) if owners[i] != owners[j]]
    for count in (1, 4, 5, 7):
        correlation = np.eye(len(names))
        correlation[0, 1] = correlation[1, 0] = 0.999  # of one polynomial: always are
        values = {pairs[3 * k]: (-1.0) ** k * (0.96 + 0.005 * k) for k in range(count)}
        for (i, j), value in values.items():
            correlation[i, j] = correlation[j, i] = value
        correlation[pairs[40]] = 0.949
        correlation[pairs[41]] = np.nan
        found = said(replace(result, correlation=correlation), problem, "traded")
        worst = sorted(values, key=lambda pair: -abs(values[pair]))[:4]
        assert found == [
            f"{names[i]} and {names[j]} are traded against each other (correlation {values[i, j]:.2f})."
            for i, j in worst
        ]
        more = said(replace(result, correlation=correlation), problem, "more pairs")
        assert more == [f"So are {count - 4} more pairs of parameters: see the matrix of correlations."] * (
            count > 4
        )


def test_a_model_that_returns_work_and_a_fit_that_was_interrupted_are_said(truth) -> None:
    problem, result = truth
    assert said(result, problem, "not passive") == said(result, problem, "interrupted") == []
    assert len(said(replace(result, cancelled=True), problem, "The fit was interrupted")) == 1
    assert assess(replace(result, cancelled=True), problem.runs, problem=problem).direction is None
    pushing = bingham(viscosity=Polynomial((500.0, -10.0)), mass=50.0)
    least = passivity(pushing, problem.runs)
    assert least > 0.0
    assert said(replace(result, damper=pushing), problem, "not passive") == []


@pytest.mark.parametrize(("level", "held"), [(0.0, True), (1e-4, True), (0.2, True), (3.0, False)])
def test_a_coefficient_is_at_its_limit_within_three_thousandths_of_its_range(
    truth, level: float, held: bool
) -> None:
    """A stiffness from its level at 2 A to 100 more at 0 A."""
    problem, result = truth
    forms = {**result.damper.coefficients, "stiffness": Polynomial((level + 100.0, -50.0))}
    found = said(
        replace(result, damper=replace(result.damper, coefficients=forms)), problem, "held at the law's limit"
    )
    assert [each.partition(" ")[0] for each in found] == ["stiffness"] * held
    if held:
        assert "stiffness is held at the law's limit (0) near 2 A: left alone" in found[0]


def test_what_is_asked_for_is_there_and_what_is_not_is_none(truth) -> None:
    problem, result = truth
    plain = assess(result, problem.runs[:6], problem.runs[6:])
    assert [each.split for each in plain.runs] == ["training"] * 6 + ["held_out"] * 6
    assert (plain.direction, plain.profile, plain.bootstrap, plain.left_out) == (None, None, None, ())
    assert plain.passivity_min == passivity(result.damper, problem.runs[:6])
    directed = assess(result, problem.runs, problem=problem)
    assert directed.direction is not None
    assert (directed.profile, directed.bootstrap) == (None, None)
    assert directed.words[-1] == sentence(directed.direction)
    drawn = assess(result, problem.runs, problem=problem, draws=1)
    assert drawn.bootstrap is not None
    assert drawn.bootstrap.asked == 1
    assert drawn.words[-1] == sentence(drawn.bootstrap)


def test_a_coefficient_that_reaches_its_limit_when_warm_is_named_with_the_temperature(truth) -> None:
    problem, result = truth
    runs = [
        replace(
            run, trajectory=replace(run.trajectory, temperature=np.full(len(run), 293.15 + 40.0 * (k % 2)))
        )
        for k, run in enumerate(problem.runs)
    ]
    forms = {**result.damper.coefficients, "stiffness": Bipolynomial((100.0, -2.5, 0.0, 0.0))}
    warm = replace(result, damper=replace(result.damper, coefficients=forms))
    words = [each for each in assess(warm, runs).words if "held at the law's limit" in each]
    assert [each.partition(":")[0] for each in words] == [
        "stiffness is held at the law's limit (0) near 0 A and 60 degC"
    ]
