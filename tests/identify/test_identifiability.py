"""What the data cannot tell apart: against closed forms, plain regression, and known degeneracies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import chi2

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.confidence import direction, profiles, resampling
from mrdamper.identify.confidence.direction import Direction, worst_direction
from mrdamper.identify.confidence.profiles import profile
from mrdamper.identify.confidence.resampling import Bootstrap, _draw, _levels, bootstrap
from mrdamper.identify.confidence.sentences import sentence
from mrdamper.identify.problem import FitProblem, FitResult, FreeParameter
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.laws import find_law
from mrdamper.models.simulate import simulate
from mrdamper.runtime.pool import Pool
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.truths import TRUTHS, measured

LINEAR = ("viscosity.value", "stiffness.value", "offset.value")


def fitted(
    truth: Damper, free: Sequence[FreeParameter], *, noise: float = 0.02, seed: int = 0
) -> tuple[FitProblem, FitResult]:
    """Return the fit of some numbers of a damper to its own noisy force, all others known."""
    problem = FitProblem(truth, tuple(free), measured(truth, noise=noise, seed=seed), rate_Hz=1e4)
    return problem, fit_variable_projection(problem, starts=0, first=truth)


def usual(law: str, runs: Sequence[PreparedRun]) -> tuple[FitProblem, FitResult]:
    """Return the fit of a law with its usual free numbers, from the truth."""
    damper, free = template(law, runs)
    problem = FitProblem(damper, free, tuple(runs))
    return problem, fit_variable_projection(problem, starts=0, first=TRUTHS[law])


def linear_problem(seed: int = 0) -> tuple[FitProblem, FitResult]:
    """Viscosity, spring and offset beside a known plastic force: plain linear regression on v, x, 1."""
    known = {"yield_force": Constant(300.0), "yield_velocity": Constant(0.006)}
    searched = {"viscosity": Constant(900.0), "stiffness": Constant(1500.0), "offset": Constant(40.0)}
    free = [
        FreeParameter("viscosity.value", 0.0, 1e4, linear=True),
        FreeParameter("stiffness.value", 0.0, 1e5, linear=True),
        FreeParameter("offset.value", -500.0, 700.0, linear=True),
    ]
    return fitted(Damper(find_law("bingham"), {**known, **searched}), free, seed=seed)


def normal_matrix(problem: FitProblem) -> np.ndarray:
    """Return the curvature of the squared cost from the runs' own velocity and displacement."""
    total = np.zeros((3, 3))
    for run in problem.runs:
        kept = slice(run.scored_from, None)
        path, force = run.trajectory, np.asarray(run.force)[kept]
        columns = np.stack([path.velocity, path.displacement, np.ones(len(path.velocity))])[:, kept]
        total += 1e4 * columns @ columns.T / (np.var(force) * len(force) * len(problem.runs))
    return total


def error_percent(problem: FitProblem, damper: Damper) -> float:
    """Return the fit's error from plain simulations."""
    shares = []
    for run in problem.runs:
        off = (simulate(damper, run.trajectory) - run.force)[run.scored_from :]
        shares.append(np.mean(off**2) / np.var(run.force[run.scored_from :]))
    return 100.0 * float(np.sqrt(np.mean(shares)))


# ---------------------------------------------------------------------------------------- direction


def test_the_worst_direction_of_a_regression_is_the_least_eigenvector_of_its_normal_matrix() -> None:
    problem, result = linear_problem()
    found = worst_direction(problem, result)
    value = {e.name: e.value for e in result.estimates}
    scale = np.array([value["viscosity.value"], value["stiffness.value"], 1200.0])
    least, vectors = np.linalg.eigh(normal_matrix(problem) * np.outer(scale, scale))
    expected = vectors[:, 0] * math.copysign(1.0, vectors[np.argmax(np.abs(vectors[:, 0])), 0])
    got = dict(zip(found.names, found.weights, strict=True))
    assert [got[name] for name in LINEAR] == pytest.approx(expected, abs=1e-6)
    assert found.condition == pytest.approx(least[-1] / least[0], rel=1e-6)
    samples = sum(len(run.force) - run.scored_from for run in problem.runs)
    white = 100.0 * result.cost_percent / np.sqrt(samples * least[0])
    assert white * 0.99 <= found.standard_error_percent <= 1.3 * white


def test_two_numbers_of_which_only_the_ratio_shows_are_named_and_move_by_equal_shares() -> None:
    """Far below its saturation velocity v_s the rate force is F_r v / v_s: F_r and v_s trade one to one."""
    forms = {"yield_force": Constant(300.0), "rho": Constant(2000.0), "kappa": Constant(-0.4)}
    forms |= {"n": Constant(1.2), "viscosity": Constant(500.0), "stiffness": Constant(1500.0)}
    forms |= {"rate_force": Constant(2000.0), "saturation_velocity": Constant(3.0)}
    free = [
        FreeParameter("rate_force.value", 0.0, 1e7, linear=True),
        FreeParameter("saturation_velocity.value", 1e-2, 99.0, "log"),
        FreeParameter("yield_force.value", 0.0, 1e4, linear=True),
        FreeParameter("rho.value", 50.0, 1e6, "log"),
        FreeParameter("n.value", 0.2, 8.0, "log"),
        FreeParameter("stiffness.value", 0.0, 1e5, linear=True),
    ]
    problem, result = fitted(Damper(find_law("bouc-wen-saturating"), forms), free)
    found = worst_direction(problem, result)
    assert set(found.named) == {"rate_force.value", "saturation_velocity.value"}
    shares = dict(zip(found.names, found.weights, strict=True))
    assert shares["rate_force.value"] == pytest.approx(shares["saturation_velocity.value"], rel=0.1)
    assert found.standard_error_percent > 10.0
    assert found.condition > 1e4
    part = {n: d / s for n, d, s in zip(found.names, found.changes, found.scales, strict=True)}
    assert part["rate_force.value"] == pytest.approx(part["saturation_velocity.value"], rel=0.1)
    assert part["rate_force.value"] > 0.2
    assert found.moved_percent < 1.0001 * found.cost_percent
    said = sentence(found)
    assert said.startswith("The data cannot tell ")
    assert said.count("raising the ") == 2


def test_the_stated_change_is_real() -> None:
    """The sentence's figures hold in plain simulations: the fit does get worse by no more than the noise."""
    problem, _ = usual("bouc-wen", measured(TRUTHS["bouc-wen"], noise=0.02, seed=0))
    problem = replace(problem, rate_Hz=1e4)
    result = fit_variable_projection(problem, starts=0, first=TRUTHS["bouc-wen"])
    found = worst_direction(problem, result)
    values = {e.name: e.value for e in result.estimates}
    moved = {name: values[name] + d for name, d in zip(found.names, found.changes, strict=True)}
    assert found.cost_percent == pytest.approx(error_percent(problem, result.damper), rel=1e-9)
    assert found.moved_percent == pytest.approx(
        error_percent(problem, result.damper.with_parameters(moved)), rel=1e-9
    )
    samples = sum(len(run.force) - run.scored_from for run in problem.runs)
    rise = found.moved_percent**2 / found.cost_percent**2 - 1.0
    assert 0.3 / samples < rise < 3.0 / samples
    assert f"{found.standard_error_percent:.2g} %" in sentence(found)


@pytest.mark.parametrize("current", [1.0, 2.0])
def test_at_one_current_a_line_over_current_is_one_number_too_many(current: float) -> None:
    """c0 + c1 I at one current I is one force: what c0 gains c1 loses, newton for newton, without end."""
    runs = [r for r in measured(TRUTHS["bingham"], noise=0.02, seed=0) if r.run.constant_command == current]
    offset = Polynomial((40.0, 10.0))
    truth = replace(TRUTHS["bingham"], coefficients={**TRUTHS["bingham"].coefficients, "offset": offset})
    free = (
        FreeParameter("offset.c0", -500.0, 500.0, linear=True),
        FreeParameter("offset.c1", -500.0, 500.0, linear=True),
        FreeParameter("yield_velocity.value", 1e-4, 1.0, "log"),
    )
    problem = FitProblem(truth, free, tuple(runs))
    found = worst_direction(problem, fit_variable_projection(problem, starts=0, first=truth))
    assert set(found.named) == {"offset.c0", "offset.c1"}
    assert found.standard_error_percent == math.inf
    change = dict(zip(found.names, found.changes, strict=True))
    assert change["offset.c0"] == pytest.approx(-current * change["offset.c1"], rel=1e-6)
    assert abs(change["offset.c0"]) > 100.0
    weights = dict(zip(found.names, found.weights, strict=True))  # both over bounds of 1000 N
    assert weights["offset.c0"] == pytest.approx(-current * weights["offset.c1"], rel=1e-6)
    assert np.sum(np.square(found.weights)) == pytest.approx(1.0)
    assert found.moved_percent == pytest.approx(found.cost_percent, rel=1e-6)
    assert "cannot tell offset.c0 from offset.c1" in sentence(found) or (
        "cannot tell offset.c1 from offset.c0" in sentence(found)
    )


def test_a_number_of_a_term_that_is_not_there_is_said_to_be_unknown() -> None:
    """Without breakaway friction the velocity over which it fades shows nowhere."""
    forms = {**TRUTHS["bingham"].coefficients, "breakaway_friction": Constant(0.0)}
    free = [
        FreeParameter("stribeck_velocity.value", 1e-4, 0.1, "log"),
        FreeParameter("yield_velocity.value", 1e-4, 1.0, "log"),
    ]
    problem, result = fitted(replace(TRUTHS["bingham"], coefficients=forms), free)
    found = worst_direction(problem, result)
    assert found.named == ("stribeck_velocity.value",)
    assert found.standard_error_percent == math.inf
    assert sentence(found).startswith("The data do not pin down stribeck_velocity.value: raising it by ")


def test_a_step_ends_before_the_bound_and_before_the_fit_notices() -> None:
    """A knee passed within a sample: kappa, loose by +-0.034 about 0.004, cannot go beyond 0.02."""
    steep = {**TRUTHS["bouc-wen"].coefficients, "rho": Constant(5e7), "kappa": Constant(0.0)}
    free = [FreeParameter("kappa.value", -0.02, 0.02), FreeParameter("yield_force.c0", 0.0, 1e3, linear=True)]
    problem, result = fitted(replace(TRUTHS["bouc-wen"], coefficients=steep), free)
    found = worst_direction(problem, result)
    change = dict(zip(found.names, found.changes, strict=True))["kappa.value"]
    assert found.standard_error_percent > 50.0
    assert 0.0 < change <= 0.02 - result.estimates[0].value
    assert found.moved_percent < 1.0001 * found.cost_percent


def test_with_a_tare_for_the_only_session_the_laws_own_offset_is_anybodys_guess() -> None:
    """Only a pull of a millionth holds the tare: the same fit, a thousand times the error of the offset."""
    problem, result = linear_problem()
    assert worst_direction(problem, result).names[0] == "stiffness.value"
    loose = replace(problem, session_offsets=True)
    found = worst_direction(loose, fit_variable_projection(loose, starts=0, first=result.damper))
    assert found.named == ("offset.value",)
    offset = next(e for e in result.estimates if e.name == "offset.value")
    assert found.standard_error_percent * 12.0 == pytest.approx(1e3 * offset.standard_error, rel=0.1)
    assert found.changes[0] == pytest.approx(1e3 * offset.standard_error, rel=0.1)


# ------------------------------------------------------------------------------------------ profile


@pytest.mark.parametrize("name", LINEAR)
def test_the_profile_of_a_regression_is_its_parabola(name: str) -> None:
    """Squared cost = least + (value - best)^2 / (H^-1)_ii, H from the runs' own velocity and displacement."""
    problem, result = linear_problem()
    found = profile(problem, result, name)
    i = LINEAR.index(name)
    softness = np.linalg.inv(normal_matrix(problem))[i, i]
    estimate = next(e for e in result.estimates if e.name == name)
    expected = result.cost_percent**2 + (np.array(found.values) - estimate.value) ** 2 / softness
    assert np.square(found.costs_percent) == pytest.approx(expected, rel=1e-9)
    half = 1.959964 * estimate.standard_error
    assert found.interval == pytest.approx((estimate.value - half, estimate.value + half), rel=1e-4)
    assert found.ends == ("closed", "closed")
    assert len(found.values) >= 7


def test_white_noise_counts_every_sample_and_noise_that_lasts_counts_far_fewer() -> None:
    """Over half-cycle blocks: between the number of half cycles and that of raw samples."""
    problem, result = linear_problem()
    white = profile(problem, result, "stiffness.value", points=3)
    assert 0.6 * white.samples < white.effective_samples <= 1.01 * white.samples
    lasting = replace(problem, runs=tuple(rough(run, 0.02, seed) for seed, run in enumerate(problem.runs)))
    again = fit_variable_projection(lasting, starts=0, first=result.damper)
    few = profile(lasting, again, "stiffness.value", points=3)
    assert few.blocks < few.effective_samples < 0.2 * few.samples


def rough(run: PreparedRun, noise: float, seed: int, correlated_over: float = 20.0) -> PreparedRun:
    """Return the run with noise added that hangs together over so many samples."""
    keep = math.exp(-1.0 / correlated_over)
    drawn = np.random.default_rng(seed).standard_normal(len(run.force) + 300)
    lasting = lfilter([math.sqrt(1.0 - keep**2)], [1.0, -keep], drawn)[300:]
    return replace(run, force=np.asarray(run.force) + noise * np.std(run.force) * lasting)


@pytest.mark.parametrize(
    ("lower", "upper", "ends"), [(-0.05, 0.9, ("bound", "closed")), (-0.05, 0.05, ("bound", "bound"))]
)
def test_an_interval_that_meets_a_bound_is_open_there_and_says_so(
    lower: float, upper: float, ends: tuple[str, str]
) -> None:
    """A knee passed within a sample leaves kappa loose by +-0.07; bounds nearer than that are met first."""
    steep = {**TRUTHS["bouc-wen"].coefficients, "rho": Constant(5e7), "kappa": Constant(0.0)}
    free = [
        FreeParameter("kappa.value", lower, upper),
        FreeParameter("yield_force.c0", 0.0, 1e3, linear=True),
    ]
    problem, result = fitted(replace(TRUTHS["bouc-wen"], coefficients=steep), free)
    found = profile(problem, result, "kappa.value")
    assert found.ends == ends
    assert found.interval[0] == lower
    assert (found.interval[1] == upper) is (ends[1] == "bound")
    assert found.costs_percent[0] < found.threshold_percent
    assert "open at the lower end" in sentence(found)
    assert ("open at the upper end" in sentence(found)) is (ends[1] == "bound")


def test_the_profile_of_a_direction_is_that_of_its_heaviest_number_with_the_others_following() -> None:
    problem, result = usual("bouc-wen", measured(TRUTHS["bouc-wen"], noise=0.02, seed=0))
    worst = worst_direction(problem, result)
    found = profile(problem, result, worst, points=3)
    assert found.name == worst.names[0]
    weights = dict(zip(worst.names, worst.weights, strict=True))
    for name in worst.named[1:]:
        path = found.others[name]
        assert np.sign(path[-1] - path[0]) == np.sign(weights[name])


def test_a_value_without_any_fit_ends_the_profile_there(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, result = linear_problem()
    best = result.estimates[0].value

    def none_below(held: FitProblem, **options: object) -> FitResult:
        if held.template.parameters["viscosity.value"] < best:
            raise ConvergenceError("no start reached a finite cost")
        return fit_variable_projection(held, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(direction, "fit_variable_projection", none_below)
    found = profile(problem, result, "viscosity.value")
    assert found.ends == ("no fit", "closed")
    assert found.interval[0] == best
    assert "open at the lower end, where a value without any fit was reached first" in sentence(found)


def test_a_number_that_is_not_there_and_a_number_of_places_without_a_middle_are_refused() -> None:
    problem, result = linear_problem()
    with pytest.raises(InputError, match=r"no parameter 'gap'; expected one of: viscosity\.value"):
        profile(problem, result, "gap")
    with pytest.raises(InputError, match="4 points"):
        profile(problem, result, "viscosity.value", points=4)


def test_an_interrupted_profile_keeps_what_it_has() -> None:
    problem, result = linear_problem()

    def stop_at_third(progress: ProgressUpdate) -> None:
        if progress.done == 1:
            raise KeyboardInterrupt

    found = profile(problem, result, "viscosity.value", on_progress=stop_at_third)
    assert found.cancelled
    assert len(found.values) == 2
    assert found.ends == ("span", "span")


def test_the_share_of_a_held_number_counts_in_the_laws_conditions() -> None:
    """800 - 390 I is nowhere negative up to 2 A; with 800 held, -390 is found, not cut off at zero."""
    viscosity = Polynomial((800.0, -390.0))
    truth = replace(
        TRUTHS["bingham"], coefficients={**TRUTHS["bingham"].coefficients, "viscosity": viscosity}
    )
    _, result = fitted(truth, [FreeParameter("viscosity.c1", -1e4, 1e4, linear=True)])
    estimate = result.estimates[0]
    assert abs(estimate.value + 390.0) < 4.0 * estimate.standard_error
    pushed, _ = fitted(truth, [FreeParameter("viscosity.c1", -1e4, 1e4, linear=True)])
    less = tuple(
        replace(r, force=np.asarray(r.force) - 300.0 * r.run.command[0] * r.trajectory.velocity)
        for r in pushed.runs
    )
    edge = fit_variable_projection(replace(pushed, runs=less), starts=0, first=truth)
    assert edge.damper.parameters["viscosity.c1"] == pytest.approx(-400.0, rel=1e-6)


@pytest.mark.release
@pytest.mark.parametrize("correlated_over", [0.0, 20.0])
def test_nineteen_of_twenty_intervals_hold_the_truth(correlated_over: float) -> None:
    """Coverage of the 95 % interval over 300 campaigns, within three binomial standard deviations.

    Counted over white noise, and over noise that hangs together over 40 ms.
    """
    clean = measured(TRUTHS["bouc-wen"], noise=0.0, seed=0)
    held = []
    for seed in range(300):
        runs = tuple(
            rough(run, 0.02, 1000 * seed + i, correlated_over or 1e-3) for i, run in enumerate(clean)
        )
        problem, result = usual("bouc-wen", runs)
        low, high = profile(problem, result, "n.value", points=5).interval
        held.append(low <= TRUTHS["bouc-wen"].parameters["n.value"] <= high)
    assert np.mean(held) == pytest.approx(0.95, abs=3.0 * math.sqrt(0.95 * 0.05 / len(held)))


# ---------------------------------------------------------------------------------------- bootstrap


@pytest.mark.system
def test_the_bootstrap_scatters_as_the_standard_errors_say() -> None:
    """Independent noise, four campaigns of twelve runs: within a factor 1.6 each, 1.25 in the median.

    Sixty draws alone leave 9 %; forty-eight unequal runs some more.
    """
    runs = tuple(
        replace(run, run=replace(run.run, name=f"{run.run.name} {seed}"))
        for seed in range(4)
        for run in measured(TRUTHS["dahl"], noise=0.02, seed=seed)
    )
    problem, result = usual("dahl", runs)
    found = bootstrap(problem, result, draws=60, seed=1, stratified=True)
    assert (found.draws, found.failed, found.cancelled) == (60, 0, False)
    spread = found.standard_deviation
    ratio = np.array([spread[e.name] / e.standard_error for e in result.estimates])
    assert np.all((ratio > 1.0 / 1.6) & (ratio < 1.6)), dict(zip(spread, ratio, strict=True))
    assert 1.0 / 1.25 < np.median(ratio) < 1.25
    for e in result.estimates:
        low, high = found.percentiles[e.name]
        assert low < e.value < high
        assert 2.0 < (high - low) / spread[e.name] < 4.5  # 3.3 for a normal scatter


def test_a_run_drawn_twice_is_the_same_as_two_runs() -> None:
    problem, result = usual("dahl", measured(TRUTHS["dahl"], noise=0.02, seed=0))
    found = bootstrap(problem, result, draws=1, seed=5)
    counts = _draw(np.random.default_rng(5), len(problem.runs), [])
    assert counts.max() > 1
    repeated = tuple(run for run, n in zip(problem.runs, counts, strict=True) for _ in range(n))
    again = fit_variable_projection(replace(problem, runs=repeated), starts=0, first=result.damper)
    for value, e in zip(found.values[0], again.estimates, strict=True):
        assert value == pytest.approx(e.value, abs=1e-3 * e.standard_error)


@given(
    seed=st.integers(0, 2**32 - 1),
    levels=st.lists(st.integers(0, 4), min_size=2, max_size=15),
    other=st.lists(st.integers(0, 3), min_size=15, max_size=15),
)
def test_a_stratified_draw_holds_every_level_and_as_many_runs_as_there_are(
    seed: int, levels: list[int], other: list[int]
) -> None:
    members = [
        np.flatnonzero(np.array(key[: len(levels)]) == level)
        for key in (levels, other)
        for level in sorted(set(key[: len(levels)]))
    ]
    counts = _draw(np.random.default_rng(seed), len(levels), members)
    assert counts.min() >= 0
    assert counts.sum() == len(levels)
    assert all(counts[m].sum() >= 1 for m in members)


def test_levels_are_commands_and_temperatures() -> None:
    """Twelve runs at four currents; at 20, 22 and 60 degC there are two temperatures more."""
    runs = measured(TRUTHS["dahl"], noise=0.02, seed=0)
    assert [len(m) for m in _levels(runs)] == [3, 3, 3, 3]
    warm = [
        replace(run, trajectory=replace(run.trajectory, temperature=np.full(len(run), kelvin)))
        for run, kelvin in zip(runs, [293.15, 295.15, 333.15] * 4, strict=True)
    ]
    assert sorted(len(m) for m in _levels(warm)) == [3, 3, 3, 3, 4, 8]


def test_one_run_at_each_current_is_nothing_to_draw_from() -> None:
    runs = measured(TRUTHS["dahl"], noise=0.02, seed=0)[:4]
    problem, result = usual("dahl", runs)
    with pytest.raises(InputError, match="nothing to draw from 4 runs"):
        bootstrap(problem, result, stratified=True)


@pytest.mark.system
def test_the_bootstrap_has_the_same_bits_on_one_core_and_on_two() -> None:
    problem, result = linear_problem()
    one, two = (bootstrap(problem, result, draws=6, seed=2, pool=Pool(jobs)).values for jobs in (1, 2))
    assert np.array_equal(one, two)


def test_an_interrupted_bootstrap_keeps_its_draws_and_says_how_many() -> None:
    problem, result = linear_problem()

    def stop_after_five(progress: ProgressUpdate) -> None:
        if progress.done == 5:
            raise KeyboardInterrupt

    found = bootstrap(problem, result, draws=50, on_progress=stop_after_five)
    assert found.cancelled
    assert found.draws == 5
    assert sentence(found).startswith("5 of 50 draws of runs, interrupted: ")
    assert np.isfinite(list(found.standard_deviation.values())).all()


def test_the_same_seed_draws_the_same_runs() -> None:
    problem, result = linear_problem()
    one, two, other = (bootstrap(problem, result, draws=3, seed=seed).values for seed in (2, 2, 3))
    assert np.array_equal(one, two)
    assert not np.allclose(one, other)


def test_a_direction_of_three_is_said_in_one_sentence() -> None:
    found = Direction(
        names=("a.value", "b.value", "c.value"),
        weights=(0.8, -0.5, 0.33),
        scales=(2.0, 4.0, 10.0),
        relative=(True, True, False),
        units=("N", "N s/m", "-"),
        changes=(0.4, -0.4, 0.5),
        standard_error_percent=25.0,
        condition=1e6,
        cost_percent=2.0,
        moved_percent=2.00011,
        others_follow=True,
    )
    assert sentence(found) == (
        "The data cannot tell a.value, b.value and c.value apart: raising a.value by 20 %, lowering b.value "
        "by 10 % and raising c.value by 0.5, the others following, changes the fit by less than the noise "
        "(error 2.0000 % before, 2.0001 % after)."
    )
    stuck = replace(found, changes=(0.0, 0.0, 0.0))
    assert sentence(stuck) == "The data cannot tell a.value, b.value and c.value apart."


# ------------------------------------------------------------------------------- steps, sizes, sentences


def test_a_step_along_the_direction_is_one_standard_error_and_the_others_follow_as_regression_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The step may raise the cost by twice what a standard error does."""
    problem, result = linear_problem()
    walk, allowed = direction._walk, list[float]()

    def walked(*given: Any) -> tuple[dict[str, float], float]:
        allowed.append(given[-1])
        return walk(*given)

    monkeypatch.setattr(direction, "_walk", walked)
    found = worst_direction(problem, result)
    order = [LINEAR.index(name) for name in found.names]
    matrix = normal_matrix(problem)[np.ix_(order, order)]
    inverse = np.linalg.inv(matrix)
    step = 0.01 * found.standard_error_percent * found.weights[0] * found.scales[0]
    assert found.changes == pytest.approx(step * inverse[0] / inverse[0, 0], rel=1e-3)
    rise = found.moved_percent**2 - found.cost_percent**2
    assert rise == pytest.approx(step**2 / inverse[0, 0], rel=1e-3)
    assert found.cost_percent == pytest.approx(result.cost_percent)
    error, weights, scales = (
        0.01 * found.standard_error_percent,
        np.array(found.weights),
        np.array(found.scales),
    )
    noise = error**2 / (weights @ (inverse / np.outer(scales, scales)) @ weights)
    assert allowed == pytest.approx([2.0 * noise])
    alone = np.where([name in found.named for name in found.names], weights * scales * error, 0.0)
    assert found.others_follow == (alone @ matrix @ alone > 2.0 * noise)
    assert np.sum(weights**2) == pytest.approx(1.0)
    stuck = tuple(replace(each, at_bound="lower") for each in result.estimates)
    with pytest.raises(InputError, match="every parameter of the fit rests on a bound"):
        worst_direction(problem, replace(result, estimates=stuck))
    one = worst_direction(problem, replace(result, estimates=(*stuck[:2], result.estimates[2])))
    assert (one.names, one.weights) == (("offset.value",), (1.0,))
    assert one.condition == pytest.approx(1.0)
    assert not one.others_follow


def test_blocks_are_half_cycles_of_what_is_scored() -> None:
    problem, _ = linear_problem()
    expected = 0
    for run in problem.prepare():
        turned = np.diff(np.signbit(run.drive.trajectory.velocity[run.start :]).astype(int))
        expected += 1 + int(np.count_nonzero(turned))
    assert direction.half_cycles(problem.prepare()) == expected
    assert direction.half_cycles(problem.prepare()[:1]) == 8  # of four periods, from half a period on
    run = problem.prepare()[0]
    turns = [first for first, _, _ in run.drive.record.pieces]
    assert direction.half_cycles([replace(run, start=turns[-3])]) == 3, "from a turn on"


@pytest.mark.parametrize(
    ("bounds", "scale", "value", "expected"),
    [
        ((1.0, 1e4), "log", 30.0, (30.0, True)),
        ((0.0, 100.0), "linear", 2e-3, (2e-3, True)),
        ((0.0, 100.0), "linear", 5e-4, (100.0, False)),
        ((0.0, 100.0), "linear", 0.0, (100.0, False)),
        ((-100.0, 0.0), "linear", -3.0, (3.0, True)),
        ((-40.0, 60.0), "linear", 30.0, (100.0, False)),
        ((1e-9, 1e4), "log", 1e-8, (1e-8, True)),
    ],
)
def test_a_change_is_measured_in_the_value_or_through_zero_in_the_width_of_the_bounds(
    bounds: tuple[float, float], scale: Literal["linear", "log"], value: float, expected: tuple[float, bool]
) -> None:
    assert direction._scale(FreeParameter("x", *bounds, scale), value) == expected


def test_the_heaviest_are_named_down_to_a_quarter_and_four_at_most() -> None:
    heavy = direction._heavy
    assert heavy(np.array([-1.0, 0.26, -0.24, 0.25])).tolist() == [True, True, False, True]
    assert heavy(np.array([0.6, -1.0, 0.9, 0.7, -0.8])).tolist() == [False, True, True, True, True]
    assert heavy(np.array([0.5])).tolist() == [True]


def test_a_parameter_moves_in_the_coordinate_in_which_it_is_searched() -> None:
    logarithmic, plain = FreeParameter("x", 1.0, 1e3, "log"), FreeParameter("x", -5.0, 5.0)
    assert direction._moved(logarithmic, 20.0, 2.0) == pytest.approx(20.0 * math.exp(0.1))
    assert direction._moved(logarithmic, 20.0, -2.0) == pytest.approx(20.0 * math.exp(-0.1))
    assert direction._moved(plain, 2.0, -0.5) == 1.5
    assert math.isfinite(direction._moved(logarithmic, 1.0, 1e6))


@pytest.mark.parametrize("points", [3, 5, 9])
def test_a_profile_has_even_places_over_its_span_on_both_sides_and_says_where_it_ends(points: int) -> None:
    problem, result = linear_problem()
    estimate = result.estimates[1]
    updates: list[ProgressUpdate] = []
    found = profile(problem, result, estimate.name, points=points, span=1.0, on_progress=updates.append)
    expected = estimate.value + estimate.standard_error * np.linspace(-1.0, 1.0, points)
    assert found.values == pytest.approx(expected)
    assert found.ends == ("span", "span")
    assert found.interval == pytest.approx((expected[0], expected[-1]))
    prepared = problem.prepare()
    assert found.samples == sum(len(run.force) - run.start for run in prepared)
    assert found.blocks == direction.half_cycles(prepared)
    softness = np.linalg.inv(normal_matrix(problem))[1, 1]
    assert found.effective_samples == pytest.approx(
        result.cost_percent**2 * softness / estimate.standard_error**2, rel=1e-6
    )
    rise = result.cost_percent**2 * chi2.ppf(0.95, 1) / found.effective_samples
    assert found.threshold_percent**2 - result.cost_percent**2 == pytest.approx(rise, rel=1e-6)
    assert set(found.others) == {"viscosity.value", "offset.value"}
    assert all(len(path) == points for path in found.others.values())
    assert [(update.done, update.total) for update in updates] == [(k, points) for k in range(points)]
    assert "span that was looked at was reached first" in sentence(found)


def test_a_profile_on_a_logarithm_has_places_in_even_ratios_and_its_ends_rise_by_just_what_is_allowed() -> (
    None
):
    problem, result = usual("bouc-wen", measured(TRUTHS["bouc-wen"], noise=0.02, seed=0)[:6])
    estimate = next(e for e in result.estimates if e.name == "n.value")
    found = profile(problem, result, "n.value", points=5, span=1.5)
    ratio = np.diff(np.log(found.values))
    assert ratio == pytest.approx(np.full(4, 0.75 * estimate.standard_error / estimate.value), rel=1e-6)
    wide = profile(problem, result, "n.value", points=3, span=4.0)
    assert wide.ends == ("closed", "closed")
    for end in wide.interval:
        held = direction.fit_held(
            problem, result.damper, next(f for f in problem.free if f.name == "n.value"), end,
            problem.prepare(), first=result.damper,
        )  # fmt: skip
        rise = held.cost_percent**2 - min(wide.costs_percent) ** 2
        allowed = wide.threshold_percent**2 - min(wide.costs_percent) ** 2
        assert rise == pytest.approx(allowed, rel=0.05)


def test_a_profile_goes_on_from_a_checkpoint_with_no_fit_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, result = linear_problem()
    kept: dict[str, Any] = {}
    checkpoint: Any = SimpleNamespace(recall=kept.get, keep=kept.__setitem__)
    first = profile(problem, result, "offset.value", points=3, checkpoint=checkpoint)
    assert len(kept) == len(first.values)
    monkeypatch.setattr(direction, "fit_variable_projection", None)
    assert profile(problem, result, "offset.value", points=3, checkpoint=checkpoint) == first


def test_a_profile_is_refused_on_a_bound_over_no_span_and_without_a_fit_at_its_own_value(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, result = linear_problem()
    stuck = replace(result, estimates=(replace(result.estimates[0], at_bound="upper"), *result.estimates[1:]))
    with pytest.raises(InputError, match="rests on its upper bound"):
        profile(problem, stuck, "viscosity.value")
    for points, span in ((1, 3.0), (2, 3.0), (3, 0.0), (3, math.nan)):
        with pytest.raises(InputError, match=f"{points} points over"):
            profile(problem, result, "viscosity.value", points=points, span=span)

    def stopped(*_: object, **__: object) -> FitResult:
        raise KeyboardInterrupt

    monkeypatch.setattr(profiles, "fit_held", stopped)
    with pytest.raises(KeyboardInterrupt):
        profile(problem, result, "viscosity.value")

    def none(*_: object, **__: object) -> FitResult:
        raise InputError("no admissible coefficients")

    monkeypatch.setattr(profiles, "fit_held", none)
    with pytest.raises(ConvergenceError, match="its own fitted value"):
        profile(problem, result, "viscosity.value")


def test_a_bootstrap_states_spread_and_percentiles_of_its_draws_and_nothing_of_one() -> None:
    values = np.random.default_rng(0).standard_normal((40, 2)) * [1.0, 0.1] + [5.0, -2.0]
    found = Bootstrap(("a.value", "b.value"), values, asked=42, failed=2, cancelled=False)
    assert found.standard_deviation["a.value"] == pytest.approx(np.std(values[:, 0], ddof=1))
    assert found.percentiles["b.value"] == pytest.approx(tuple(np.quantile(values[:, 1], [0.05, 0.95])))
    percent = 100.0 * np.std(values, axis=0, ddof=1) / np.abs(np.median(values, axis=0))
    assert sentence(found) == (
        f"40 of 42 draws of runs, 2 failed: from draw to draw a.value scatters most, by {percent[0]:.2g} % "
        f"(standard deviation), half of all parameters by less than {np.median(percent):.2g} %."
    )
    for count in (0, 1):
        few = replace(found, values=values[:count])
        assert np.isnan([*few.standard_deviation.values(), *np.ravel(list(few.percentiles.values()))]).all()
        assert sentence(few) == f"{count} of 42 draws of runs, 2 failed: too few to state a spread."
    two = replace(found, values=values[:2], failed=0)
    assert two.standard_deviation["a.value"] == pytest.approx(
        abs(values[0, 0] - values[1, 0]) / math.sqrt(2.0)
    )
    assert sentence(two).startswith("2 of 42 draws of runs: from draw to draw ")
    nothing = replace(found, values=values * [1.0, 0.0])
    assert "from draw to draw b.value scatters most" in sentence(nothing)


def test_draws_without_a_fit_are_counted_and_the_others_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, result = linear_problem()
    made: list[None] = []

    def failing(*given: Any, **options: Any) -> FitResult:
        made.append(None)
        if len(made) % 3 == 0:
            raise ConvergenceError("no start reached a finite cost")
        found = fit_variable_projection(*given, **options)
        return replace(found, cancelled=True) if len(made) == 11 else found

    monkeypatch.setattr(resampling, "fit_variable_projection", failing)
    updates: list[ProgressUpdate] = []
    found = bootstrap(problem, result, draws=7, on_progress=updates.append)
    assert (found.draws, found.failed, found.asked, found.cancelled) == (5, 2, 7, False)
    assert [(update.done, update.total) for update in updates] == [(k, 7) for k in range(1, 8)]
    stopped = bootstrap(problem, result, draws=7)
    assert (stopped.draws, stopped.failed, stopped.cancelled) == (2, 1, True)


def with_levels(commands: Sequence[float | None], kelvin: Sequence[float]) -> list[Any]:
    return [
        SimpleNamespace(
            run=SimpleNamespace(constant_command=command),
            trajectory=SimpleNamespace(temperature=None if math.isnan(degrees) else np.full(3, degrees)),
        )
        for command, degrees in zip(commands, kelvin, strict=True)
    ]


def test_levels_are_three_percent_of_the_largest_command_and_five_kelvin_apart() -> None:
    none = [math.nan] * 5
    just = _levels(with_levels([0.0, 0.03, 1.0], [300.0, 305.0, 311.0]))
    assert [each.tolist() for each in just] == [[0, 1], [0, 1], [2], [2]]
    levels = _levels(with_levels([2.0, 0.0, 0.055, 1.0, 1.065], none))
    assert [each.tolist() for each in levels] == [[0], [1, 2], [3], [4]]
    levels = _levels(with_levels([1.0, None, 1.0, None, 1.0], [300.0, 304.0, 308.9, 314.5, math.nan]))
    assert [each.tolist() for each in levels] == [[0, 1, 2], [0, 2, 4], [1, 3], [3]]
    assert [each.tolist() for each in _levels(with_levels([None] * 5, none))] == [[0, 1, 2, 3, 4]]


def test_a_bootstrap_needs_two_runs_and_with_levels_one_that_is_not_alone_at_its_own() -> None:
    problem, result = linear_problem()
    few = bootstrap(replace(problem, runs=problem.runs[:5]), result, draws=1, stratified=True)
    assert few.draws == 1
    with pytest.raises(InputError, match=r"each is the only one at its command or temperature"):
        bootstrap(replace(problem, runs=problem.runs[:4]), result, draws=1, stratified=True)
    assert bootstrap(replace(problem, runs=problem.runs[:2]), result, draws=1).draws == 1
    with pytest.raises(InputError, match=r"nothing to draw from 1 runs \(one is not enough\)"):
        bootstrap(replace(problem, runs=problem.runs[:1]), result, draws=1)


def test_a_direction_of_one_and_of_two_and_a_profile_are_said_in_one_sentence() -> None:
    one = Direction(
        names=("a.value", "b.value"), weights=(1.0, 0.1), scales=(2.0, 4.0), relative=(True, False),
        units=("N", "N s/m"), changes=(-0.5, 0.0), standard_error_percent=250.0, condition=1e6,
        cost_percent=2.0, moved_percent=2.1, others_follow=False,
    )  # fmt: skip
    noise = "(error 2.000 % before, 2.100 % after)."
    assert sentence(one) == (
        "The data do not pin down a.value: lowering it by 25 % changes the fit by less than the noise "
        + noise
    )
    two = replace(one, weights=(0.8, 0.6), changes=(250.0, 1e7), standard_error_percent=9.9)
    assert sentence(two) == (
        "The data tell all parameters apart; the least certain is the combination of a.value and b.value, "
        "known to 9.9 %: raising the first by 12500 % and raising the second by 1e+07 N s/m changes the fit "
        f"no more than the noise {noise}"
    )
    assert sentence(replace(two, standard_error_percent=10.0)).startswith(
        "The data cannot tell a.value from b.value"
    )
    still = replace(two, changes=(0.0, 0.0))
    assert sentence(still).endswith("known to 9.9 %.")
    assert (
        sentence(replace(still, standard_error_percent=10.0)) == "The data cannot tell a.value from b.value."
    )
    alike = sentence(replace(one, moved_percent=2.0 + 1e-9))
    assert "(error 2.0000000 % before, 2.0000000 % after)" in alike
    found = profiles.Profile(
        name="a.value", unit="N", values=(1.0, 2.0, 3.0), costs_percent=(3.0, 2.0, 3.0), others={},
        threshold_percent=2.5, interval=(1.25, 2.75), ends=("closed", "closed"), effective_samples=41.6,
        blocks=12, samples=900,
    )  # fmt: skip
    counted = "with 95 % confidence (42 effective samples of 900, 12 half cycles)"
    said = f"a.value lies between 1.25 and 2.75 N {counted}"
    assert sentence(found) == f"{said}."
    assert sentence(replace(found, unit="-", ends=("bound", "span"))) == (
        f"{said.replace(' N ', ' ')}; the interval is open at the lower end, where the bound of the search "
        "was reached first and open at the upper end, where the end of the span that was looked at was "
        "reached first."
    )


@pytest.mark.parametrize(
    ("lower", "upper", "places", "ends"),
    [
        (-0.5, 2.0, [-0.5, -0.25, 0.0, 0.5, 1.0], ("bound", "span")),
        (-9.0, 0.4, [-1.0, -0.5, 0.0, 0.2, 0.4], ("span", "bound")),
        (-9.0, -0.1, [-1.0, -0.5, 0.0, 0.5, 1.0], ("span", "span")),
    ],
)
def test_places_of_a_profile_end_at_a_bound_unless_the_fit_is_beyond_it(
    lower: float, upper: float, places: Sequence[float], ends: tuple[str, str]
) -> None:
    """In standard errors about the fit. Its own bound does not keep what the force is linear in."""
    problem, result = linear_problem()
    value, error = result.estimates[2].value, result.estimates[2].standard_error
    free = replace(problem.free[2], lower=value + lower * error, upper=value + upper * error)
    bounded = replace(problem, free=(*problem.free[:2], free))
    found = profile(bounded, result, "offset.value", points=5, span=1.0)
    assert (np.array(found.values) - value) / error == pytest.approx(places, abs=1e-9)
    assert found.ends == ends
    assert found.interval == (found.values[0], found.values[-1])


@pytest.mark.parametrize("upper", [1.3, 0.11])
def test_a_step_that_leaves_the_bounds_is_halved_until_it_keeps_them(upper: float) -> None:
    """And until the fit does not notice more than is allowed; where none does, nothing moves."""
    problem, result = linear_problem()
    value, error = result.estimates[2].value, result.estimates[2].standard_error
    free = replace(problem.free[2], upper=value + upper * error)
    bounded = replace(problem, free=(*problem.free[:2], free))
    runs, softness = problem.prepare(), np.linalg.inv(normal_matrix(problem))[2, 2]
    moved, cost = direction._walk(bounded, result, runs, "offset.value", error, math.inf)
    step = next(step for step in 0.5 ** np.arange(12) if step <= upper) * error
    assert moved["offset.value"] == pytest.approx(value + step)
    assert cost - result.cost_percent**2 == pytest.approx(step**2 / softness, rel=1e-3)
    for allowed, expected in ((0.26, 0.5), (0.24, 0.25)):
        limit = allowed * error**2 / softness
        moved, _ = direction._walk(problem, result, runs, "offset.value", error, limit)
        assert moved["offset.value"] == pytest.approx(value + expected * error)
    still, cost = direction._walk(problem, result, runs, "offset.value", error, -1.0)
    assert (still, cost) == ({e.name: e.value for e in result.estimates}, result.cost_percent**2)
