"""Bootstrap over runs: spread of the parameters, stratification, interrupts, and the same seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.confidence import resampling
from mrdamper.identify.confidence.resampling import Bootstrap, _draw, _levels, bootstrap
from mrdamper.identify.problem import SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.runtime.pool import Pool
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs
from tests.identify.small_problems import fitted_default, linear_problem


@pytest.mark.system
def test_bootstrap_spread_matches_standard_errors() -> None:
    """Independent noise, four campaigns of twelve runs: within a factor 1.6 each, 1.25 in the median.

    Sixty draws alone leave 9 %; forty-eight unequal runs some more.
    """
    runs = tuple(
        replace(run, run=replace(run.run, name=f"{run.run.name} {seed}"))
        for seed in range(4)
        for run in simulate_runs(REFERENCE_DAMPERS["dahl"], noise=0.02, seed=seed)
    )
    problem, result = fitted_default("dahl", runs)
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


def test_run_drawn_twice_equals_two_runs() -> None:
    problem, result = fitted_default("dahl", simulate_runs(REFERENCE_DAMPERS["dahl"], noise=0.02, seed=0))
    found = bootstrap(problem, result, draws=1, seed=5)
    counts = _draw(np.random.default_rng(5), len(problem.runs), [])
    assert counts.max() > 1
    repeated = tuple(run for run, n in zip(problem.runs, counts, strict=True) for _ in range(n))
    again = fit_variable_projection(replace(problem, runs=repeated), dampers=[result.damper])
    for value, e in zip(found.values[0], again.estimates, strict=True):
        assert value == pytest.approx(e.value, abs=1e-3 * e.standard_error)


@given(
    seed=st.integers(0, 2**32 - 1),
    levels=st.lists(st.integers(0, 4), min_size=2, max_size=15),
    other=st.lists(st.integers(0, 3), min_size=15, max_size=15),
)
def test_stratified_draw_contains_every_level(seed: int, levels: list[int], other: list[int]) -> None:
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
    runs = simulate_runs(REFERENCE_DAMPERS["dahl"], noise=0.02, seed=0)
    assert [len(m) for m in _levels(runs)] == [3, 3, 3, 3]
    warm = [
        replace(run, trajectory=replace(run.trajectory, temperature=np.full(len(run), kelvin)))
        for run, kelvin in zip(runs, [293.15, 295.15, 333.15] * 4, strict=True)
    ]
    assert sorted(len(m) for m in _levels(warm)) == [3, 3, 3, 3, 4, 8]


def test_bootstrap_with_single_levels_is_rejected() -> None:
    runs = simulate_runs(REFERENCE_DAMPERS["dahl"], noise=0.02, seed=0)[:4]
    problem, result = fitted_default("dahl", runs)
    with pytest.raises(InputError, match="nothing to draw from 4 runs"):
        bootstrap(problem, result, stratified=True)


@pytest.mark.system
def test_bootstrap_is_independent_of_worker_count() -> None:
    problem, result = linear_problem()
    one, two = (bootstrap(problem, result, draws=6, seed=2, pool=Pool(jobs)).values for jobs in (1, 2))
    assert np.array_equal(one, two)


def test_interrupted_bootstrap_keeps_finished_draws() -> None:
    problem, result = linear_problem()

    def stop_after_five(progress: ProgressUpdate) -> None:
        if progress.done == 5:
            raise KeyboardInterrupt

    found = bootstrap(problem, result, draws=50, on_progress=stop_after_five)
    assert found.cancelled
    assert found.draws == 5
    assert found.sentence.startswith("Bootstrap: 5 of 50 fits, interrupted. ")
    assert np.isfinite(list(found.standard_deviation.values())).all()


def test_same_seed_draws_same_runs() -> None:
    problem, result = linear_problem()
    one, two, other = (bootstrap(problem, result, draws=3, seed=seed).values for seed in (2, 2, 3))
    assert np.array_equal(one, two)
    assert not np.allclose(one, other)


def test_bootstrap_spread_needs_two_draws() -> None:
    values = np.random.default_rng(0).standard_normal((40, 2)) * [1.0, 0.1] + [5.0, -2.0]
    found = Bootstrap(("a.value", "b.value"), values, asked=42, failed=2, cancelled=False)
    assert found.standard_deviation["a.value"] == pytest.approx(np.std(values[:, 0], ddof=1))
    assert found.percentiles["b.value"] == pytest.approx(tuple(np.quantile(values[:, 1], [0.05, 0.95])))
    percent = 100.0 * np.std(values, axis=0, ddof=1) / np.abs(np.median(values, axis=0))
    assert found.sentence == (
        "Bootstrap: 40 of 42 fits, 2 failed. a.value has the largest standard deviation "
        f"({percent[0]:.2g} %), the median of all parameters is {np.median(percent):.2g} %."
    )
    for count in (0, 1):
        few = replace(found, values=values[:count])
        assert np.isnan([*few.standard_deviation.values(), *np.ravel(list(few.percentiles.values()))]).all()
        assert few.sentence.endswith(f"{count} of 42 fits, 2 failed. At least two are needed for a spread.")
    two = replace(found, values=values[:2], failed=0)
    assert two.standard_deviation["a.value"] == pytest.approx(
        abs(values[0, 0] - values[1, 0]) / math.sqrt(2.0)
    )
    assert two.sentence.startswith("Bootstrap: 2 of 42 fits. ")
    nothing = replace(found, values=values * [1.0, 0.0])
    assert "b.value has the largest standard deviation" in nothing.sentence


def test_failed_draws_are_counted_and_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, result = linear_problem()
    made: list[None] = []

    def failing(*given: Any, **options: Any) -> SearchResult:
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


def test_levels_are_separated_by_their_tolerance() -> None:
    none = [math.nan] * 5
    just = _levels(with_levels([0.0, 0.03, 1.0], [300.0, 305.0, 311.0]))
    assert [each.tolist() for each in just] == [[0, 1], [0, 1], [2], [2]]
    levels = _levels(with_levels([2.0, 0.0, 0.055, 1.0, 1.065], none))
    assert [each.tolist() for each in levels] == [[0], [1, 2], [3], [4]]
    levels = _levels(with_levels([1.0, None, 1.0, None, 1.0], [300.0, 304.0, 308.9, 314.5, math.nan]))
    assert [each.tolist() for each in levels] == [[0, 1, 2], [0, 2, 4], [1, 3], [3]]
    assert [each.tolist() for each in _levels(with_levels([None] * 5, none))] == [[0, 1, 2, 3, 4]]


def test_bootstrap_needs_runs_to_exchange() -> None:
    problem, result = linear_problem()
    few = bootstrap(replace(problem, runs=problem.runs[:5]), result, draws=1, stratified=True)
    assert few.draws == 1
    with pytest.raises(InputError, match=r"each is the only one at its command or temperature"):
        bootstrap(replace(problem, runs=problem.runs[:4]), result, draws=1, stratified=True)
    assert bootstrap(replace(problem, runs=problem.runs[:2]), result, draws=1).draws == 1
    with pytest.raises(InputError, match=r"nothing to draw from 1 runs \(one is not enough\)"):
        bootstrap(replace(problem, runs=problem.runs[:1]), result, draws=1)
