"""The short fits of a selection: which runs they see, where they begin, where they end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem, FreeParameter, PreparedFit
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.selection.runs import enough_of
from mrdamper.identify.selection.starts import (
    asymmetry_percent,
    carried,
    descend,
    in_sizes,
    least,
    level_of,
    moved,
)
from mrdamper.identify.temperature import settle_temperature
from mrdamper.identify.templates import template
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from tests.identify.truths import AS_IT_IS, TRUTHS, measured

LAW = TRUTHS["bouc-wen"]


def run_of(
    *,
    name: str = "",
    motion: Sine | None = None,
    seconds: float = 4.0,
    command: float = 1.0,
    celsius: float | None = None,
    shift_N: float = 0.0,
    gain: float = 1.0,
) -> PreparedRun:
    path = drive(motion or Sine(5e-3, 1.0), duration=seconds, rate_Hz=200.0, command=command)
    run = RigRun(
        name=name or f"{motion} {command:g} {celsius}",
        time=path.time,
        displacement=path.displacement,
        force=gain * simulate(LAW, path) + shift_N,
        command=path.command,
        command_unit="A",
        temperature=None if celsius is None else np.full(len(path), celsius + 273.15),
    )
    return prepare_run(run, AS_IT_IS)


def fixed_force(run: PreparedRun, force: FloatArray) -> PreparedRun:
    return replace(run, force=np.asarray(force, dtype=np.float64))


# ------------------------------------------------------------------------------------------- which runs


def test_few_samples_are_left_as_they_are_and_of_many_three_periods_of_each_run() -> None:
    """At 200 Hz: up to 20,000 samples nothing is cut; a run without a period keeps five seconds."""
    few = [run_of(seconds=19.99, motion=Sine(5e-3, 2.0), name=str(k)) for k in range(5)]
    assert sum(map(len, few)) > 19_900
    kept = enough_of(few)
    assert [len(run) for run in kept] == [len(run) for run in few]
    many = [*few, replace(few[0], period_s=None), run_of(seconds=20.0, motion=Sine(5e-3, 0.25))]
    cut = enough_of(many)
    assert [run.name for run in cut] == [run.name for run in many]
    for run, seconds in zip(cut, (*[1.5] * 5, 5.0, 12.0), strict=True):
        assert (len(run) - run.scored_from) * run.trajectory.step == pytest.approx(seconds, abs=0.01)


def test_of_too_many_runs_every_motion_command_and_temperature_stays_and_the_samples_are_enough() -> None:
    grid = [
        run_of(motion=Sine(5e-3, f), command=i, celsius=c, seconds=30.0, name=f"{f} {i} {c} {k}")
        for f in (0.2, 0.3)
        for i in (0.0, 1.0, 2.0)
        for c in (20.0, 60.0)
        for k in range(2)
    ]
    kept = enough_of(grid)
    samples = sum(map(len, kept))
    longest = max(map(len, kept))
    assert 30_000 - longest <= samples <= 30_000
    assert [run.name for run in kept] == [
        run.name for run in grid if run.name in {each.name for each in kept}
    ]
    for place in range(3):
        assert {run.name.split()[place] for run in kept} == {run.name.split()[place] for run in grid}


def test_auto_leaves_temperature_out_where_runs_do_not_tell_it() -> None:
    cold, warm, none = run_of(celsius=20.0), run_of(celsius=60.0), run_of()
    assert settle_temperature([cold, warm], "auto") == ((cold, warm), "auto", "")
    assert settle_temperature([cold, none], "vft") == ((cold, none), "vft", "")
    assert settle_temperature([none], "auto") == ((none,), "auto", "")
    runs, kind, told = settle_temperature([cold, cold, none], "auto")
    assert (len(runs), kind) == (3, "none")
    assert "one temperature in the runs (20 degC)" in told
    for lacking, left in ((1, 2), (2, 2), (3, 5)):
        runs, kind, told = settle_temperature([cold, warm, *[none] * lacking], "auto")
        assert (len(runs), kind) == (left, "auto" if left == 2 else "none")
        assert f"{lacking} of {2 + lacking} runs have no temperature" in told


# ---------------------------------------------------------------------------------- problems and excerpts


def test_an_excerpt_is_half_a_period_in_coarse_steps_and_never_less_than_32_samples() -> None:
    for run, seconds in (
        (run_of(motion=Sine(5e-3, 0.5), seconds=8.0), 1.0),
        (replace(run_of(seconds=20.0), period_s=None), 2.0),
        (run_of(motion=Sine(5e-3, 10.0)), 32 / 200.0),
    ):
        whole, excerpt = (PreparedFit.of(run, 200.0, 3, excerpt=short) for short in (False, True))
        assert excerpt.start == whole.start == run.scored_from
        assert (len(excerpt.force) - excerpt.start) / 200.0 == pytest.approx(seconds, abs=0.01)
        spread = float(np.std(run.force[run.scored_from :]))
        for each in (whole, excerpt):
            weight = 1e4 / (3.0 * spread**2 * (len(each.force) - each.start))
            assert each.weight == pytest.approx(weight, rel=1e-12)


def test_a_parameter_has_a_coordinate_and_bounds_that_are_a_range() -> None:
    for scale, value in (("log", 20.0), ("linear", -3.0)):
        free = FreeParameter("a", *((1.0, 100.0) if scale == "log" else (-5.0, 5.0)), scale)  # type: ignore[arg-type]
        assert free.to_physical(float(free.to_search(value))) == pytest.approx(value)
    assert FreeParameter("a", 1.0, 9.0, "log").to_search(math.e) == pytest.approx(1.0)
    for wrong in (("linear", 1.0, 1.0), ("linear", 2.0, 1.0), ("log", 0.0, 1.0), ("log", -1.0, 1.0)):
        with pytest.raises(InputError, match="lower < upper, and lower > 0 on a log scale"):
            FreeParameter("a", wrong[1], wrong[2], wrong[0])


# --------------------------------------------------------------------------------- levels and asymmetry


def test_a_level_that_grows_with_temperature_is_found_and_what_it_is_worth() -> None:
    """A gas of 100 N and 2 N/K: without its growth the mean square of what each run misses is left."""
    runs = [run_of(celsius=c, command=i) for c in (10.0, 30.0, 70.0) for i in (0.5, 2.0)]
    centred = [fixed_force(run, run.force - whole_mean(run)) for run in runs]
    lifted = [
        fixed_force(run, run.force + 100.0 + 2.0 * (c - 20.0))
        for run, c in zip(centred, (10.0, 10.0, 30.0, 30.0, 70.0, 70.0), strict=True)
    ]
    level = level_of(lifted)
    assert level is not None
    assert level.force == pytest.approx(100.0, abs=0.1)
    assert level.slope == pytest.approx(2.0, abs=0.01)
    spreads = np.array([float(np.std(periods(run))) for run in lifted])
    means = np.array([whole_mean(run) for run in lifted])
    constant = np.sum(means / spreads**2) / np.sum(spreads**-2)
    missed = 100.0 * np.sqrt(np.mean(((means - constant) / spreads) ** 2))
    assert level.told_percent == pytest.approx(missed, rel=1e-3)
    same = level_of(centred)
    assert same is not None
    assert same.told_percent < 0.1
    assert level_of([*lifted, run_of()]) is None


def periods(run: PreparedRun) -> FloatArray:
    """Return the scored force over whole periods."""
    assert run.period_s is not None
    force, period = run.force[run.scored_from :], round(run.period_s / run.trajectory.step)
    return force[: len(force) // period * period]


def whole_mean(run: PreparedRun) -> float:
    return float(np.mean(periods(run)))


def test_a_damper_that_is_stronger_one_way_is_told_and_a_gas_is_not() -> None:
    runs = [
        run_of(command=i, motion=Sine(5e-3, f), celsius=c)
        for i in (0.0, 1.0, 2.0)
        for f in (1.0, 2.0)
        for c in (20.0, 60.0)
    ]
    gas = [fixed_force(run, run.force + 80.0 + (40.0 if k % 2 else 0.0)) for k, run in enumerate(runs)]
    strong = [fixed_force(run, np.where(run.force > 0.0, 1.5 * run.force, run.force)) for run in runs]
    assert asymmetry_percent(gas) < 5.0
    assert asymmetry_percent(strong) > 10.0


# ----------------------------------------------------------------------------------- starts and descents


@pytest.fixture(scope="module")
def problem() -> FitProblem:
    runs = measured(LAW, noise=0.02, seed=0, duration=2.0)[:6]
    damper, free = template("bouc-wen", runs)
    return FitProblem(damper, free, runs)


def cost_of(objective: Objective, damper: object) -> float:
    found = objective.candidate_of(damper)  # type: ignore[arg-type]
    return float(objective.eliminate(*found, np.empty((1, 0)), tangents=False).cost[0])


def far_from(problem: FitProblem) -> Sequence[object]:
    return [
        problem.template.with_parameters({"rho.value": rho, "n.value": n})
        for rho, n in ((200.0, 3.0), (9e3, 1.0))
    ]


def test_rounds_of_a_descent_end_where_one_no_longer_brings_enough(problem: FitProblem) -> None:
    objective = Objective(problem, problem.prepare())
    starts = far_from(problem)
    errors = [descend(problem, objective, starts, 1, rounds)[1] for rounds in range(1, 9)]  # type: ignore[arg-type]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]
    shares = [later / former for former, later in pairwise(errors)]
    for falls in (0.9 * min(shares), 0.5 * (min(shares) + max(shares)), 1.0):
        ended = next((k for k, share in enumerate(shares, 1) if share > falls), len(shares))
        found = descend(problem, objective, starts, 1, len(errors), falls)[1]  # type: ignore[arg-type]
        assert found == errors[ended]


def test_of_several_dampers_the_least_is_the_one_of_the_least_cost(problem: FitProblem) -> None:
    objective = Objective(problem, problem.prepare())
    several = [*far_from(problem), problem.template]
    costs = [cost_of(objective, each) for each in several]
    assert least(objective, several) is several[int(np.argmin(costs))]  # type: ignore[arg-type]
    assert least(objective, several[:1]) is several[0]  # type: ignore[arg-type]
    error = descend(problem, objective, several, 3)[1]  # type: ignore[arg-type]
    assert error <= np.sqrt(min(costs))


def test_a_descent_that_finds_no_finite_cost_is_told(
    problem: FitProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    objective = Objective(problem, problem.prepare())
    monkeypatch.setattr(
        "mrdamper.identify.selection.starts._finite", lambda costs: np.full(np.shape(costs), np.inf)
    )
    with pytest.raises(ConvergenceError, match="no descent reached a finite cost"):
        descend(problem, objective, [problem.template], 1)


def test_what_is_moved_is_what_is_not_the_law_s_default_and_it_is_carried_over() -> None:
    runs = measured(LAW, noise=0.0, seed=0, duration=1.0)[:4]
    onto, free = template("bouc-wen", runs)
    assert set(LAW.coefficients) >= set(moved(LAW)) >= {"viscosity", "yield_force", "rho", "kappa", "n"}
    plain = replace(
        LAW, coefficients={**LAW.coefficients, "stiffness": Constant(0.0), "kappa": Constant(0.0)}
    )
    assert {"stiffness", "kappa"} & set(moved(plain)) <= {"kappa"} | {
        c.name for c in LAW.law.coefficients if c.default != 0.0
    }
    found = carried(LAW, onto, free)
    for each in free:
        if each.name in LAW.parameters:
            assert found.parameters[each.name] == LAW.parameters[each.name]
    steady = replace(LAW, coefficients={**LAW.coefficients, "yield_force": Constant(321.0)})
    level = carried(steady, onto, free).coefficients["yield_force"]
    assert isinstance(level, Polynomial)
    np.testing.assert_allclose(level.value(np.array([0.0, 1.0, 2.0])), 321.0)


def test_a_new_group_that_begins_from_nothing_begins_in_three_sizes() -> None:
    from mrdamper.identify.groups import groups_of

    for law in ("bouc-wen", "chain"):
        for group in groups_of(LAWS[law]).values():
            entry, start = group.entries[0], group.entries[0].start or 0.0
            coefficient = LAWS[law][entry.name]
            found = in_sizes(law, [group], {"other": 1.0})
            grows = bool(start) and coefficient.default == 0.0 and not coefficient.linear
            assert len(found) == (3 if grows else 1)
            if grows:
                assert [each[entry.name] / start for each in found] == pytest.approx([1.0, 0.1, 0.01])
                given = in_sizes(law, [group], {entry.name: 7.0})
                assert [each[entry.name] for each in given] == pytest.approx([7.0, 0.7, 0.07])
            assert all(each["other"] == 1.0 for each in found)
