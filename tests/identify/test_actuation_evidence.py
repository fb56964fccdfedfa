"""The evidence that lags, play and response times are found from: against regression and plain loops."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.prepare import prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import MOTIONS, drive
from mrdamper.identify import actuation
from mrdamper.identify.actuation import (
    Follows,
    _errors,
    _how_reached,
    _IronFits,
    _lagged_force,
    _level_free,
    _mean_over_kinds,
    _moved,
    _play_evidence,
    _PlayEvidence,
    _quadrants,
    _Times,
    _WeighedRun,
    fit_actuation,
)
from mrdamper.identify.step_responses import StepTime
from mrdamper.models.actuation import PLAY_SHARE, Actuation
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import open_drive, simulate
from tests.identify.test_actuation import KNOWN, identified, stepped
from tests.identify.truths import AS_IT_IS, TRUTHS

LAW = TRUTHS["bouc-wen"]


@given(st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_errors_are_those_of_regression_and_none_on_a_bound(seed, logs):
    rng = np.random.default_rng(seed)
    jacobian, residual = rng.standard_normal((30, 4)), rng.standard_normal(30)
    point, low, high = np.array([-1.0, 0.5, 0.0, 2.0]), np.full(4, -3.0), np.full(4, 3.0)
    variance = np.diag(np.linalg.inv(jacobian.T @ jacobian)) * (residual @ residual) / (30 - 4)
    expected = np.sqrt(variance) * np.where(np.arange(4) < logs, np.exp(point), 1.0)
    assert _errors(jacobian, residual, point, low, high, logs=logs) == pytest.approx(expected, rel=1e-6)
    at_ends = np.array([-1.0, -3.0, 3.0, 2.0])
    found = _errors(jacobian, residual, at_ends, low, high, logs=0)
    rest = jacobian[:, [0, 3]]
    variance = np.diag(np.linalg.inv(rest.T @ rest)) * (residual @ residual) / (30 - 2)
    assert np.isnan(found[1:3]).all()
    assert [found[0], found[3]] == pytest.approx(np.sqrt(variance), rel=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_level_and_gain_of_a_force_are_taken_out_by_a_straight_line(seed):
    rng = np.random.default_rng(seed)
    model, measured = rng.standard_normal((2, 20)) + 7.0
    line = np.polyval(np.polyfit(model, measured, 1), model)
    assert _level_free(model, measured) == pytest.approx(measured - line, abs=1e-9)
    assert _level_free(np.ones(20), measured) == pytest.approx(measured - measured.mean())


@given(st.lists(st.sampled_from([0.0, 0.0, 1.0, 2.0]), min_size=2, max_size=30))
def test_how_a_command_was_reached_is_its_last_change(values):
    way, since, now = [], [], (0.0, np.inf)
    for k, value in enumerate(values):
        before = values[max(k - 1, 0)]
        now = (np.sign(before - value), 0.0) if value != before else (now[0], now[1] + 0.5)
        way.append(now[0])
        since.append(now[1])
    found = _how_reached(np.array(values), 0.5)
    assert found[0].tolist() == way
    assert found[1].tolist() == since


@given(st.integers(0, 2**32 - 1), st.integers(2, 5), st.integers(2, 6))
def test_a_mean_over_kinds_has_the_error_of_their_scatter_of_repeats_and_of_maps(seed, kinds, repeats):
    times = np.random.default_rng(seed).uniform(5e-3, 2e-2, (kinds, repeats))
    mean, error, noise = _mean_over_kinds(list(times))
    assert mean == pytest.approx(times.mean())
    pooled = np.sqrt(times.var(axis=1, ddof=1).mean() / times.size)
    assert noise == pytest.approx(pooled)
    scatter = times.mean(axis=1).std(ddof=1) / np.sqrt(kinds)
    assert error**2 - max(scatter, pooled) ** 2 == pytest.approx((0.06 * mean) ** 2)
    alone = _mean_over_kinds([times[0]])
    assert alone[2] == pytest.approx(times[0].std(ddof=1) / np.sqrt(repeats))
    assert alone[1] == pytest.approx(np.hypot(alone[2], 0.06 * times[0].mean()))
    assert np.isnan(_mean_over_kinds([])[:2]).all()


def test_times_are_means_over_kinds_of_step_up_and_down():
    steps = [
        StepTime((0, 1), True, 0.010, 0.011),
        StepTime((0, 1), True, 0.012, 0.013),
        StepTime((1, 2), True, 0.020, 0.024),
        StepTime((2, 1), False, 0.005, 0.006),
    ]
    measured, model = _Times.of(steps), _Times.of(steps, model=True)
    assert (measured.up_s, measured.down_s) == pytest.approx((0.018, 0.006))
    assert (model.up_s, model.down_s) == pytest.approx((0.0155, 0.005))
    assert np.isnan(_Times.of(steps[:3]).down_s)


def test_a_driver_has_one_quadrant_where_falls_to_zero_alone_take_long():
    def steps(to_zero, to_level):
        falls = [StepTime((2, 0), False, 0.0, to_zero), StepTime((2, 1), False, 0.0, to_level)]
        return [*falls, StepTime((0, 2), True, 0.0, 0.010)]

    assert _quadrants(steps(0.030, 0.010), 0.010) == 1
    assert _quadrants(steps(0.011, 0.010), 0.010) == 2
    assert _quadrants(steps(0.030, 0.030), 0.010) == 2, "all falls are slow"
    assert _quadrants(steps(0.030, 0.010), 0.030) == 2, "rises are as slow"
    assert _quadrants(steps(0.030, 0.010)[1:], 0.010) is None
    assert _quadrants(steps(0.030, 0.010), float("nan")) is None


def test_a_lag_is_moved_by_what_the_model_is_early_within_a_factor_of_about_three():
    assert _moved(0.01, 0.004) == pytest.approx(0.014)
    assert _moved(0.01, -0.004) == pytest.approx(0.006)
    assert 0.002 < _moved(0.01, -1.0) < 0.005
    assert 0.02 < _moved(0.01, 1.0) < 0.05
    assert _moved(0.01, float("nan")) == 0.01


def test_the_play_of_a_run_is_a_regression_of_the_error_on_the_force_s_growth():
    """A command that is reached from above is felt as twice the half width more, as the play has it."""
    levels = np.repeat([0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0, 1.0], 500)
    path = drive(MOTIONS["steps"], duration=(len(levels) - 1) / 1e3, rate_Hz=1e3, command=0.0)
    path = replace(path, command=levels)
    from_above, _ = _how_reached(levels, 1e-3)
    force = simulate(LAW, path)
    half = 0.02
    more = (simulate(LAW, replace(path, command=levels + 1e-3)) - force) / 1e-3
    felt = force + np.where(from_above > 0.0, 2.0 * PLAY_SHARE * half * more, 0.0)
    run = prepare_run(
        RigRun("steps", path.time, path.displacement, felt, levels, command_unit="A", motion="steps"),
        AS_IT_IS,
    )
    told = _play_evidence(LAW, run)
    assert told is not None
    assert told.play == pytest.approx(half, rel=0.02)
    assert told.error < 0.05 * half
    assert told.rest == pytest.approx(told.play * told.products, rel=0.01)
    noise = 5.0 * np.random.default_rng(0).standard_normal(len(felt))
    noisy = _play_evidence(LAW, replace(run, force=run.force + noise))
    assert noisy is not None
    assert noisy.error == pytest.approx(5.0 / np.sqrt(noisy.squares), rel=0.1)
    assert abs(noisy.play - half) < 4.0 * noisy.error
    assert _play_evidence(LAW, replace(run, trajectory=replace(path, command=-levels))) is None


def test_what_follows_at_once_is_read_from_the_damper():
    lags = Actuation(0.01, 0.02)
    assert Follows.of(LAW) is None
    assert Follows.of(replace(LAW, actuation=lags)) == Follows(None, lags)
    chain = TRUTHS["chain"]
    shared = replace(
        chain, coefficients={**chain.coefficients, "follow_share": Constant(0.25)}, actuation=lags
    )
    assert Follows.of(shared) == Follows(0.25, lags)


def test_the_force_of_a_lagged_command_is_that_of_a_finer_simulation():
    lags = Actuation(0.006, 0.009, 0.002, 0.003)
    run = stepped(replace(LAW, actuation=lags), noise_N=0.0)
    force = _lagged_force(LAW, lags, open_drive(run.trajectory))
    spread = float(np.std(run.force))
    assert np.sqrt(np.mean((force - run.force)[run.scored_from :] ** 2)) < 5e-3 * spread
    weighed = _WeighedRun.of(run)
    assert weighed.error(LAW, lags) == pytest.approx(
        (_lagged_force(LAW, lags, weighed.drive, 4) - run.force)[run.scored_from :]
        / np.sqrt(np.sum(run.force**2))
    )
    assert not weighed.restless
    moving = np.sin(np.arange(len(run.trajectory)))
    assert _WeighedRun.of(replace(run, trajectory=replace(run.trajectory, command=moving))).restless


def test_errors_of_runs_left_out_are_of_fits_to_the_others():
    lags = Actuation(0.006, 0.009, 0.0, 0.002)
    runs = [stepped(replace(LAW, actuation=lags), noise_N=1.0, seed=seed) for seed in range(2)]
    found = fit_actuation(LAW, runs)
    fits = _IronFits(LAW, found, [_WeighedRun.of(run) for run in runs])
    assert fits.squares(lags, [0, 1]) == pytest.approx(
        sum(float(np.sum(each.error(LAW, lags) ** 2)) for each in fits.runs)
    )
    fitted = fits.fitted(("rise_s", "fall_s"))
    assert fitted.actuation.rise_s == pytest.approx(0.006, rel=0.05)
    assert fitted.actuation.fall_s == pytest.approx(0.009, rel=0.05)
    assert fitted.actuation.wheel_s == fitted.actuation.saturation == 0.0
    assert set(fitted.standard_errors) == {"rise_s", "fall_s"}
    assert 0.0 < fitted.standard_errors["rise_s"] < 1e-3
    few = [fits._fit(fits._start(("rise_s",)), ("rise_s",), [k], 6).actuation for k in (1, 0)]
    alone = sum(fits.squares(each, [k]) for k, each in enumerate(few))
    assert fits.left_out(("rise_s",)) == pytest.approx(alone, rel=1e-9)
    assert alone < 0.01 * fits.squares(Actuation(0.02, 0.02), [0, 1])
    assert not fits.promising


def evidence(play: float, error: float, squares: float = 1e6) -> _PlayEvidence:
    """Return what a run with a play and a standard error of it tells, by 101 samples."""
    products = play * squares
    return _PlayEvidence(squares, products, play * products + 100.0 * squares * error**2, 101)


def test_the_plays_that_do_not_contradict_the_surest_large_one_are_a_weighted_mean(monkeypatch):
    """Two standard errors of the difference decide; one that is large and unsure does not lead."""
    told: dict[Any, _PlayEvidence | None] = {
        "surest": evidence(0.050, 0.002),
        "near": evidence(0.044, 0.0025, 2e6),  # 1.9 errors of the difference below
        "beyond": evidence(0.043, 0.0025, 4e6),  # 2.2 of them
        "unsure": evidence(0.090, 0.025),
        "silent": None,
        "below": evidence(-0.01, 0.001),
    }
    monkeypatch.setattr(actuation, "_play_evidence", lambda damper, run: told[run])
    play, error = actuation._fit_play(LAW, list(told))
    whole = 1e6 * 0.05 + 2e6 * 0.044 + 1e6 * 0.09
    assert play == pytest.approx(whole / 4e6)
    rest = sum(
        each.rest for name, each in told.items() if each is not None and name in {"surest", "near", "unsure"}
    )
    assert error == pytest.approx(np.sqrt((rest - play * whole) / (3 * 101 - 1) / 4e6))
    silent, below = (
        actuation._fit_play(LAW, [each for each in told if each == name]) for name in ("silent", "below")
    )
    assert silent[0] == below[0] == 0.0
    assert np.isnan(silent[1])
    assert below[1] == pytest.approx(0.001, rel=0.01)


def test_iron_is_looked_for_within_its_bounds_and_begins_beside_what_is_known():
    """Widths about the remanence, a wheel from the fall that was measured, or the rise where none was."""
    run = stepped(replace(LAW, actuation=Actuation(0.006, 0.009, 0.0, 0.002)))
    found = replace(
        fit_actuation(LAW, [run]),
        actuation=Actuation(0.006, 0.009, 0.0, 0.002, play=0.06, largest_command=2.0),
    )
    fits = _IronFits(LAW, replace(found, t63_s=0.01, t63_fall_s=0.03), [_WeighedRun.of(run)])
    begun = fits._start(("rise_s", "play", "wide_play", "saturation", "wheel_s"))
    assert begun.play < 0.06 < begun.wide_play
    assert 0.05 * 2.0 < begun.saturation < 30.0 * 2.0
    assert begun.wheel_s > 0.03  # saturated iron falls faster at first
    assert begun.fall_s < 0.009
    plain = fits._start(("rise_s", "fall_s", "wheel_s", "play"))
    assert (plain.wheel_s, plain.saturation, plain.wide_play, plain.play) == (0.03, 0.0, 0.0, 0.06)
    unmeasured = _IronFits(LAW, replace(fits.found, t63_fall_s=np.nan), fits.runs)
    assert unmeasured._start(("wheel_s",)).wheel_s > 0.01
    none = replace(fits.found, actuation=replace(found.actuation, play=0.0, largest_command=0.0))
    assert 0.0 < _IronFits(LAW, none, fits.runs)._start(("wide_play",)).play < 0.05
    assert not _IronFits(LAW, found, fits.runs).promising  # nothing restless, nothing promised


def test_restless_runs_judge_where_there_are_two() -> None:
    run = _WeighedRun.of(stepped(LAW))
    found = identified(KNOWN["slow up"])
    for restless, judging in (("01010", [1, 3]), ("01000", [0, 1, 2, 3, 4]), ("111", [0, 1, 2])):
        runs = [replace(run, restless=each == "1") for each in restless]
        assert _IronFits(LAW, found, runs)._judging == judging
