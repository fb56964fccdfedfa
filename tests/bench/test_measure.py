"""How the benchmarks measure and judge: a wrong answer is out, a gap is seen, an exponent is a slope."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from bench import integrators
from bench.growth import exponent
from bench.measure import Row, absent, judged, table, timed
from bench.problem import LIMIT, STIFF, Problem
from bench.simulation import Contender, _side_by_side


def test_jobs_take_turns_and_the_first_turn_is_not_counted():
    order = []
    found = timed({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, repeats=3)
    assert order == ["a", "b"] * 4
    assert found["a"].low_s <= found["a"].cpu_s <= found["a"].high_s


@pytest.mark.parametrize("error", [2e-3, float("inf"), float("nan")])
def test_a_quick_wrong_answer_is_disqualified_and_says_so(error):
    row = judged(Row("quick", 1e-9, ratio=0.01, accuracy="wrong", error=error), 1e-3)
    assert (row.state, row.ratio) == ("disqualified", None)
    assert "disqualified" in row.accuracy
    assert "| out |" in table("t", [row, Row("first", 1.0, ratio=1.0)])


def test_an_answer_at_the_limit_counts():
    row = Row("right", 1.0, ratio=1.0, error=1e-3)
    assert judged(row, 1e-3) is row


def test_a_contender_that_is_absent_keeps_its_row():
    def missing(problem):
        raise ImportError("No module named 'elsewhere'")

    small = Problem(candidates=1, samples=200)
    ours, theirs = _side_by_side(
        "g",
        small,
        [Contender("kernel", integrators.kernel, 1, 200), Contender("theirs", missing, 1, 200)],
        full=False,
    )
    assert theirs == absent("theirs", "No module named 'elsewhere'", "g")
    assert ours.ratio == 1.0


def test_a_cubic_cost_has_exponent_three_whatever_small_sizes_cost():
    sizes = [1.0, 10.0, 1e3, 1e4, 1e5]
    assert exponent(sizes, [7.0, 7.0, *(1e-9 * n**3 for n in sizes[2:])]) == pytest.approx(3.0)


# ------------------------------------------------------------------------------- the contenders are honest


@pytest.fixture(scope="module")
def compiled(tool):
    tool("cc")


@pytest.mark.usefixtures("compiled")
def test_the_plain_table_kernel_agrees_with_ours_on_every_candidate():
    """The C beside the kernel solves the same problem; the first candidate is the measured one."""
    problem = Problem(candidates=24, samples=3_000)
    found = integrators.reference_errors(problem)
    expected = integrators.kernel_errors(problem)
    assert expected[0] < 1e-9 < expected[1:].min()
    assert found == pytest.approx(expected, rel=2e-5, abs=1e-9)


@pytest.mark.usefixtures("compiled")
def test_runge_kutta_in_c_converges_where_the_closed_form_is():
    problem = Problem(candidates=2, samples=2_000)
    coarse, fine = (problem.error(integrators.rk4_c(problem, n)()) for n in (1, 16))
    assert fine < 1e-6
    assert coarse > 30.0 * fine


@pytest.mark.usefixtures("compiled")
def test_runge_kutta_at_1_khz_leaves_a_textbook_damper_and_is_out():
    problem = Problem(STIFF, candidates=1, samples=1_000)
    assert problem.error(integrators.rk4_c(problem)()) > 100.0 * LIMIT
    assert problem.error(integrators.kernel(problem)()) < 1e-6


def test_scipy_confirms_the_closed_form():
    problem = Problem(candidates=1, samples=600)
    assert problem.error(integrators.odeint(problem, 1e-9)()) < 1e-6


def test_a_force_that_is_not_finite_errs_without_bound():
    problem = Problem(candidates=1, samples=50)
    assert problem.error(np.full(50, np.nan)) == float("inf")


def test_octave_is_a_gap_where_it_is_not_there(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ImportError, match="octave"):
        integrators.octave_lsode(Problem(candidates=1, samples=10))
