"""What a search is made of, each against a short computation of its own: sums, conditions, steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import cycle
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.descent import Box, Descents
from mrdamper.identify.search.objective import (
    Eliminated,
    Objective,
    _bounded_least_squares,
    _by_active_sets,
    _by_least_distance,
    _needed,
    solve_scaled,
)
from mrdamper.identify.search.variable_projection import (
    _joined,
    _Place,
    _Settled,
    fit_variable_projection,
)
from mrdamper.identify.templates import template
from mrdamper.models.simulate import simulate
from tests.identify.truths import TRUTHS, measured
from tests.support.examples import examples

NONE = np.empty((1, 0))


def objective_of(*, noise: float = 0.02, sessions: str = "") -> Objective:
    """Return the objective of some runs of a Bouc-Wen damper, one of them under a command that varies."""
    *runs, last = measured(TRUTHS["bouc-wen"], noise=noise, seed=0, duration=2.0)[:5]
    swept = replace(last.trajectory, command=np.linspace(0.0, 1.0, len(last.trajectory)))
    runs.append(replace(last, trajectory=swept, force=simulate(TRUTHS["bouc-wen"], swept)))
    named = [
        replace(run, run=replace(run.run, session=each))
        for run, each in zip(runs, cycle(sessions or "a"), strict=False)
    ]
    damper, free = template("bouc-wen", named)
    problem = FitProblem(damper, free, tuple(named), bool(sessions), rate_Hz=1e4)
    return Objective(problem, problem.prepare())


# ------------------------------------------------------------------------------------------------ sums


def test_sums_are_those_of_differences_of_forces() -> None:
    """Columns by central differences, ones for the session of a run, and the error; offsets are pulled."""
    objective = objective_of(sessions="ab")
    names, offsets = (*objective.nonlinear, *objective.linear), np.array([[30.0, -7.0]])
    values = np.array([[1500.0, -0.2, 1.3]]), objective.candidate_of(objective.problem.template)[1]
    damper = objective.problem.template.with_parameters(
        dict(zip(names, np.concatenate(values, axis=1)[0].tolist(), strict=True))
    )
    sums = np.zeros((len(names) + 3, len(names) + 3))
    for run in objective.runs:
        columns = []
        for name in names:
            step = 1e-5 * max(abs(damper.parameters[name]), 1e-2)
            above, below = (
                simulate(damper.with_parameters({name: damper.parameters[name] + way * step}), run.drive)
                for way in (1.0, -1.0)
            )
            columns.append((above - below) / (2.0 * step))
        in_session = [np.full(len(run.force), float(run.session == each)) for each in "ab"]
        shift = offsets[0, "ab".index(run.session)]
        whole = np.array([*columns, *in_session, run.force - simulate(damper, run.drive) - shift])
        sums += run.weight * (whole[:, run.start :] @ whole[:, run.start :].T)
    pull = 1e-6 * np.mean(np.diag(sums)[-3:-1])
    light = np.array([[pull, 0.0, 0.0], [0.0, pull, 0.0], [0.0, 0.0, 0.0]])
    light[:2, 2] = light[2, :2] = -pull * offsets[0]
    light[2, 2] = pull * float(np.sum(offsets**2))
    sums[-3:, -3:] += light
    found = objective.sums(*values, offsets)[0]
    size = np.sqrt(np.diag(sums))
    np.testing.assert_allclose(found / np.outer(size, size), sums / np.outer(size, size), atol=5e-5)
    np.testing.assert_allclose(found, found.T, rtol=1e-12)
    np.testing.assert_allclose(found[-3:, -3:], sums[-3:, -3:], rtol=1e-12)
    inner = objective.sums(*values, offsets, tangents=False)[0]
    np.testing.assert_allclose(inner, found[3:, 3:], rtol=1e-9, atol=1e-9 * np.abs(found[3:, 3:]).max())


@pytest.mark.parametrize("tangents", [True, False])
def test_without_noise_nothing_is_left_of_a_guess_a_thousand_times_off(tangents: bool) -> None:
    """The cost is a difference of sums a million times as large: it is found again from a better guess."""
    objective = objective_of(noise=0.0)
    truth = TRUTHS["bouc-wen"].parameters
    nonlinear = np.array([[truth[name] for name in objective.nonlinear]])
    linear = np.array([[truth[name] for name in objective.linear]])
    objective.evaluations = 0
    found = objective.eliminate(nonlinear, 1e3 * linear, NONE, tangents=tangents)
    assert objective.evaluations == 2
    assert found.cost[0] < 1e-12
    np.testing.assert_allclose(found.linear, linear, rtol=1e-4, atol=0.02)
    assert found.drift[0] < 1e-4  # of the better guess
    assert (found.gram is None) != tangents
    if found.gram is not None:
        assert abs(found.gram[0, -1, -1] - found.cost[0]) < 1e-12


def test_a_damper_s_sums_are_those_of_its_numbers_without_offsets_where_none_are_given() -> None:
    objective = objective_of(sessions="ab")
    damper = objective.problem.template
    names = (*objective.nonlinear, *objective.linear)
    candidate = objective.candidate_of(damper)
    for offsets in ({}, {"b": 12.0}):
        given = np.array([[offsets.get("a", 0.0), offsets.get("b", 0.0)]])
        found, together = objective.gram(damper, names, offsets), objective.sums(*candidate, given)[0]
        np.testing.assert_allclose(found, together, rtol=1e-9, atol=1e-9 * np.abs(together).max())


def test_with_linear_numbers_alone_one_pass_is_the_fit() -> None:
    objective = objective_of()
    free = tuple(each for each in objective.problem.free if each.linear)
    found = fit_variable_projection(replace(objective.problem, free=free), starts=4)
    (start,) = found.starts
    assert (start.evaluations, start.converged) == (1, True)
    best = objective.eliminate(*objective.candidate_of(found.damper), NONE)
    assert found.cost_percent == pytest.approx(np.sqrt(best.cost[0]))


def test_a_guess_that_leaves_nothing_stands() -> None:
    objective = objective_of(noise=0.0)
    truth = TRUTHS["bouc-wen"].parameters
    nonlinear, linear = (
        np.array([[truth[name] for name in names]]) for names in (objective.nonlinear, objective.linear)
    )
    found = objective.eliminate(nonlinear, linear, NONE)
    assert found.cost[0] < 1e-12
    np.testing.assert_allclose(found.linear, linear, rtol=1e-4, atol=0.02)
    assert found.drift[0] < 1e-6


def test_what_is_left_after_elimination_are_the_sums_at_what_was_found() -> None:
    """Tangents of a law that is linear in these are the same at any of them; those of the others are not."""
    objective = objective_of(sessions="ab")
    nonlinear, linear = objective.candidate_of(objective.problem.template)
    found = objective.eliminate(nonlinear, linear, np.zeros((1, 2)))
    assert found.gram is not None
    again = objective.sums(nonlinear, found.linear, found.session_offsets)[0]
    scale = np.abs(again[3:, 3:]).max()
    np.testing.assert_allclose(found.gram[0, 3:-1, 3:-1], again[3:-1, 3:-1], rtol=1e-9)
    np.testing.assert_allclose(found.gram[0, 3:, -1], again[3:, -1], atol=1e-9 * scale)
    np.testing.assert_allclose(found.gram[0], found.gram[0].T, rtol=1e-9, atol=1e-12 * scale)
    assert found.cost[0] == pytest.approx(again[-1, -1], rel=1e-9)
    before = objective.sums(nonlinear, linear, np.zeros((1, 2)))[0, 3:-1, 3:-1]
    moved = np.concatenate([found.linear - linear, found.session_offsets], axis=1)[0]
    count = len(objective.linear)
    force = found.linear[0] @ before[:count, :count] @ found.linear[0]
    assert found.drift[0] == pytest.approx(np.sqrt(moved @ before @ moved / force), rel=1e-9)


def test_projected_matrices_are_those_of_residuals_free_of_the_linear_columns() -> None:
    """From the tangents themselves, which ``lstsq`` frees of the linear ones."""
    objective = objective_of(sessions="ab")
    nonlinear, linear = objective.candidate_of(objective.problem.template)
    found = objective.eliminate(nonlinear, linear, np.zeros((1, 2)))
    sums = objective.sums(nonlinear, found.linear, found.session_offsets)
    columns = np.linalg.cholesky(sums[0] + 1e-9 * np.diag(np.diag(sums[0]))).T  # of the same sums
    inner, moving, error = columns[:, 3:-1], columns[:, :3], columns[:, -1]
    follow = -np.linalg.lstsq(inner, moving, rcond=None)[0]
    left = moving + inner @ follow
    hessian, gradient, found_follow = objective.projected(sums, found.linear)
    size = np.sqrt(np.diag(left.T @ left))
    np.testing.assert_allclose(
        hessian[0] / np.outer(size, size), left.T @ left / np.outer(size, size), atol=1e-5
    )
    np.testing.assert_allclose(gradient[0] / size, left.T @ error / size, atol=1e-4)
    shares = np.sqrt(np.diag(inner.T @ inner))[:, None] / size
    np.testing.assert_allclose(
        found_follow[0] * shares, follow * shares, atol=1e-3 * np.abs(follow * shares).max()
    )


def test_along_a_condition_that_holds_with_equality_linear_numbers_stay_on_it() -> None:
    """A viscosity of none at all: whatever the others do, it goes along the edge or stays."""
    objective = objective_of()
    nonlinear, linear = objective.candidate_of(objective.problem.template)
    at = [k for k, name in enumerate(objective.linear) if name.startswith("viscosity.")]
    linear[:, at] = 0.0
    sums = objective.sums(nonlinear, linear, NONE)
    rows, floor = objective.conditions
    held = np.abs(rows[:, at]).any(axis=1)
    assert held.any()
    np.testing.assert_array_equal(floor[held], 0.0)
    follow = objective.projected(sums, linear)[2][0]
    free = objective.projected(sums, linear + 1.0)[2][0]  # inside
    assert np.abs(rows[held] @ follow).max() < 1e-5 * np.abs(rows[held] @ free).max()


# ------------------------------------------------------------------------------------------ conditions


@given(seed=st.integers(0, 2**32 - 1))
@examples(20)
def test_both_ways_to_an_admissible_point_end_there(seed: int) -> None:
    """In any units of cost and coordinates: the nearest in the matrix' metric, and both admissible."""
    rng = np.random.default_rng(seed)
    units, of_cost = 10.0 ** rng.uniform(-3.0, 3.0, 4), 10.0 ** rng.uniform(-6.0, 6.0)
    root = rng.standard_normal((8, 4))
    matrix = of_cost * (root.T @ root) / np.outer(units, units)
    rows, free = rng.standard_normal((3, 4)) / units, rng.standard_normal(4) * units
    floor = rows @ free + rng.uniform(-0.5, 1.5, 3)
    sets, settled = _by_active_sets(matrix[None], free[None], rows, (rows @ free - floor)[None])
    distance = _by_least_distance(matrix, free, rows, floor)
    if settled[0]:
        np.testing.assert_allclose(distance / units, sets[0] / units, atol=1e-6)
    found = _bounded_least_squares(matrix[None], (matrix @ free)[None], rows, floor[None])[0]
    np.testing.assert_allclose(found / units, distance / units, atol=1e-6)
    pull = matrix @ (found - free) / of_cost  # of the active ones alone, and pushing
    active = rows @ found - floor < 1e-6
    push = np.linalg.lstsq((rows[active] * units).T, pull * units, rcond=None)[0]
    np.testing.assert_allclose((rows[active] * units).T @ push, pull * units, atol=1e-5)
    assert (push > -1e-6).all()
    assert (rows @ found - floor > -1e-7).all()


@given(seed=st.integers(0, 2**32 - 1), above=st.booleans(), first=st.sampled_from([0.0, -1.0, 1.0]))
@examples(20)
def test_conditions_that_are_left_out_follow_from_the_others(seed: int, above: bool, first: float) -> None:
    rng = np.random.default_rng(seed)
    rows = np.column_stack([rng.uniform(0.5, 2.0, 9), rng.uniform(-2.0, 2.0, 9)])
    rows[0, 0] = first
    rows[1] = 0.0
    floor = np.where(np.arange(9) == 3, 0.5 * above, 0.0)
    kept = _needed(rows, floor)
    assert 1 not in kept
    assert len(kept) == (2 if first > 0.0 and not above else 8)
    for x in rng.standard_normal((200, 2)):
        assert np.all(rows[kept] @ x >= floor[kept]) == np.all((rows @ x >= floor)[np.arange(9) != 1])


def test_a_singular_system_has_the_least_solution_and_a_regular_one_its_own() -> None:
    rng = np.random.default_rng(0)
    root = rng.standard_normal((2, 5, 3))
    matrix, right = np.swapaxes(root, 1, 2) @ root, rng.standard_normal((2, 3, 2))
    sized = np.diag([1e4, 1.0, 1e-4])
    found = solve_scaled(sized @ matrix @ sized, sized @ right)
    np.testing.assert_allclose(sized @ found, np.linalg.solve(matrix, right), rtol=1e-8)


# ----------------------------------------------------------------------------------------------- steps


Residuals = Callable[
    [FloatArray], tuple[FloatArray, FloatArray]
]  # of numbers: what is left, and its tangents


@dataclass
class Plain:
    """What descents ask an objective for: squares of residuals, no linear numbers beside them.

    Of tangents ``off`` by a factor it is said how far, and ``sums`` has them right.
    """

    residuals: Residuals
    free: tuple[FreeParameter, ...]
    off: float = 1.0
    asked: int = 0

    @property
    def problem(self) -> SimpleNamespace:
        return SimpleNamespace(nonlinear=self.free)

    def sums(
        self, values: FloatArray, linear: FloatArray, offsets: FloatArray, off: float = 1.0
    ) -> FloatArray:
        self.asked += len(values)
        found = []
        for point in values:
            left, tangents = self.residuals(point)
            columns = np.column_stack([off * tangents, -left])
            found.append(columns.T @ columns)
        return np.array(found)

    def eliminate(self, values: FloatArray, linear: FloatArray, offsets: FloatArray) -> Eliminated:
        gram = self.sums(values, linear, offsets, self.off)
        drift = np.full(len(values), abs(self.off - 1.0))
        return Eliminated(gram[:, -1, -1].copy(), linear, offsets, gram, drift)

    def projected(self, gram: FloatArray, linear: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        n = len(self.free)
        return gram[:, :n, :n], gram[:, :n, -1], np.empty((len(gram), 0, n))


def decay(point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an exponential decay of height 3 and rate 0.5 less that of other numbers, and its tangents."""
    t = np.linspace(0.0, 6.0, 40)
    height, rate = point
    shape = np.exp(-rate * t)
    left = height * shape - 3.0 * np.exp(-0.5 * t)
    return left, np.column_stack([shape, -height * t * shape])


DECAY = (FreeParameter("height", 0.01, 100.0, "log"), FreeParameter("rate", 0.0, 5.0))
STARTS = np.column_stack([np.log([0.02, 0.5, 50.0, 90.0]), [4.5, 0.1, 3.0, 0.0]])


def descents(objective: Plain, points: FloatArray, most: int = 100) -> Descents:
    none = np.empty((len(points), 0))
    return Descents(objective, points, none, none, most=most)  # type: ignore[arg-type]


@pytest.mark.parametrize("off", [1.0, 1.01, 1.3, -1.0])
def test_descents_from_anywhere_end_at_the_truth_whatever_tangents_they_were_given(off: float) -> None:
    """Where tangents are said to be off, they are asked for again."""
    objective = Plain(decay, DECAY, off)
    found = descents(objective, STARTS)
    found.run()
    assert found.converged.all()
    np.testing.assert_allclose(found.points, [[np.log(3.0), 0.5]] * len(STARTS), atol=1e-4)
    assert (found.costs < 1e-6).all()
    assert found.evaluations.sum() == objective.asked
    assert found.iterations.max() <= 25


def test_a_descent_goes_down_in_steps_of_a_length_and_stays_in_its_box() -> None:
    found = descents(Plain(decay, DECAY), STARTS)
    box = Box.of(found._objective.problem)
    while not found.done.all():
        before, cost, made = found.points.copy(), found.costs.copy(), found.iterations.copy()
        done = found.done.copy()
        accepted = found.advance()
        step = np.abs(found.points - before)
        assert (found.costs[accepted] < cost[accepted]).all()
        np.testing.assert_array_equal(found.points[~accepted], before[~accepted])
        np.testing.assert_array_equal(found.iterations - made, accepted)
        assert not (accepted & done).any()
        assert (step <= np.array([1.5, 0.3 * 5.0]) * (1.0 + 1e-12)).all()
        assert (found.points >= box.low).all()
        assert (found.points <= box.high).all()


@given(seed=st.integers(0, 2**32 - 1))
@examples(20)
def test_in_a_box_a_descent_ends_where_bounded_least_squares_do(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, wanted = rng.standard_normal((9, 4)), 3.0 * rng.standard_normal(9)
    free = tuple(FreeParameter(str(k), -1.0, 0.8) for k in range(4))
    best = lsq_linear(matrix, wanted, (-1.0, 0.8), method="bvls", tol=1e-12)
    found = descents(Plain(lambda x: (matrix @ x - wanted, matrix), free), rng.uniform(-1.0, 0.8, (3, 4)))
    found.run()
    np.testing.assert_allclose(found.costs, 2.0 * best.cost, rtol=1e-5)
    at_bound = Box.of(found._objective.problem).at_bound(found.points)
    np.testing.assert_array_equal(at_bound, np.repeat((best.active_mask != 0)[None], 3, axis=0))


def test_a_descent_that_was_cut_goes_on_as_if_it_had_not_been() -> None:
    cut, whole = (descents(Plain(decay, DECAY), STARTS, most) for most in (2, 5))
    cut.run()
    assert cut.iterations.max() == 2
    assert not cut.converged.any()
    cut.go_on(3)
    whole.run()
    np.testing.assert_array_equal(cut.points, whole.points)
    np.testing.assert_array_equal(cut.iterations, whole.iterations)


def test_a_descent_with_nothing_to_search_is_done() -> None:
    found = descents(Plain(lambda x: (np.ones(3), np.empty((3, 0))), ()), np.empty((2, 0)))
    assert found.converged.all()
    np.testing.assert_array_equal(found.costs, 3.0)


def test_values_and_points_are_each_other_and_none_is_outside() -> None:
    box = Box.of(Plain(decay, DECAY).problem)  # type: ignore[arg-type]
    np.testing.assert_allclose(box.to_search(box.to_physical(STARTS)), STARTS, rtol=1e-12)
    outside = np.array([[0.0, -1.0], [1e9, 9.0], [1.0, 2.5]])
    np.testing.assert_allclose(
        box.to_physical(box.to_search(outside)), [[0.01, 0.0], [100.0, 5.0], [1.0, 2.5]]
    )
    np.testing.assert_array_equal(box.at_bound(box.to_search(outside)), [[True] * 2, [True] * 2, [False] * 2])


def settled(*point: float, cost: float = 4.0) -> _Settled:
    place = _Place(np.array(point), np.zeros(1), np.zeros(0), cost, 3, converged=True)
    return _Settled(place, np.diag([1.0, 100.0]), 0)


def test_a_start_joins_the_first_one_before_it_that_has_its_cost_at_its_place() -> None:
    """Near is what costs next to nothing by the curvature there: far along a flat valley, near across."""
    ends = [
        settled(0.0, 0.0),
        settled(0.0, 0.5),  # across the valley: another place
        settled(1e-3, 0.0),  # the first one's
        settled(1e-3, 0.0, cost=4.5),  # its place at another cost
        settled(0.0, 0.5, cost=4.0 * (1.0 + 1e-6)),  # the second one's
        settled(2e-3, 0.0),  # the first one's, and not that of the third, which has joined
    ]
    places = _joined(ends, [5, 6, 7, 8, 9, 10], 20)
    assert [place.joined for place in places] == [None, None, 20, None, 21, 20]
    assert [place.evaluations for place in places] == [5, 6, 7, 8, 9, 10]
    assert not any(
        place.converged for place in places
    )  # on short stretches: the whole runs are still to come
    tenfold = [
        replace(each, place=replace(each.place, cost=100.0 * each.place.cost), hessian=100.0 * each.hessian)
        for each in ends
    ]
    assert [place.joined for place in _joined(tenfold, [0] * 6, 20)] == [None, None, 20, None, 21, 20]
