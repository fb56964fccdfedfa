"""Causes of a run that does not belong: against least squares, and each recovered from runs that have it.

No law is fitted here: the damper is the truth, and what a run is off by was put into it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.effects import Effect, Residuals, residuals_of
from mrdamper.identify.consistency.runs import (
    _command_levels,
    _departures,
    _peers,
    consistency,
    doubted,
    misfit,
)
from mrdamper.identify.problem import PreparedFit
from mrdamper.models.dependence import Polynomial
from mrdamper.models.simulate import simulate
from tests.identify.truths import TRUTHS, measured

TRUTH = TRUTHS["bouc-wen"]
KINDS = {
    "force_gain": 0.05,
    "force_delay": 2e-4,
    "command_label": 0.02,
    "force_saturation": 0.05,
    "force_offset_of_run": 7.0,
    "force_bandwidth": 1e-4,
}


@pytest.fixture(scope="module")
def clean() -> tuple[PreparedRun, ...]:
    return measured(TRUTH, noise=0.0, seed=0, duration=3.0, rate_Hz=400.0)


@pytest.fixture(scope="module")
def noisy() -> tuple[PreparedRun, ...]:
    return measured(TRUTH, noise=0.02, seed=5, duration=3.0, rate_Hz=400.0)


def changed(run: PreparedRun, kind: str, size: float, most: float) -> PreparedRun:
    """Return a run that has a cause, as a channel that does that would write it."""
    force, path = run.force, run.trajectory
    if kind == "force_gain":
        force = (1.0 + size) * force
    elif kind == "force_delay":
        force = np.interp(path.time - size, path.time, force)
    elif kind == "command_label":
        force = force + simulate(TRUTH, replace(path, command=path.command + size)) - simulate(TRUTH, path)
    elif kind == "force_saturation":
        force = force * (1.0 - size * (force / most) ** 2)
    elif kind == "force_offset_of_run":
        force = force + size
    else:
        pole = np.exp(-path.step / size)
        force = lfilter([1.0 - pole], [1.0, -pole], force, zi=[pole * force[0]])[0]
    return replace(run, force=np.asarray(force))


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"force_bandwidth"}))
@pytest.mark.parametrize("number", [1, 7])
def test_a_cause_is_found_at_its_size_in_its_run_and_nowhere_else(clean, kind, number):
    most = max(float(np.abs(run.force).max()) for run in clean)
    runs = list(clean)
    runs[number] = changed(runs[number], kind, KINDS[kind], most)
    found = residuals_of(TRUTH, runs)
    effect = found.of_run(number, kind)
    assert effect.size == pytest.approx(KINDS[kind], rel=0.1 if kind == "force_saturation" else 0.03)
    assert effect.share > 0.98
    left = (runs[number].force - clean[number].force)[runs[number].scored_from :]
    if kind != "force_offset_of_run":  # an offset of other causes counts for nothing
        left = left - left.mean()
    spread = np.std(runs[number].force[runs[number].scored_from :])
    assert effect.explained == pytest.approx(np.sqrt(np.mean(left**2)) / spread, rel=0.03)
    assert all(found.of_run(k, kind).explained < 1e-9 for k in range(len(runs)) if k != number)
    own = 0.0 if kind == "force_offset_of_run" else float(np.std(left))
    assert found.levels[number] == pytest.approx(own / spread, rel=1e-6, abs=1e-9)


def test_a_filter_of_the_force_of_all_runs_is_found_with_its_time_constant(clean):
    lagged = [changed(run, "force_bandwidth", 0.02, 1.0) for run in clean]
    assert residuals_of(TRUTH, lagged).of_all("force_bandwidth").size == pytest.approx(0.02, rel=1e-6)


def stacked(found: Residuals, kind: str, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residual and columns of the least squares: what moves the parameters, then the cause."""
    rows, columns = [], []
    for run, factor in zip(found.each, factors.tolist(), strict=True):
        root = np.sqrt(run.weight)
        direction = run.directions[kind]
        if kind != "force_offset_of_run":
            direction = direction - direction.mean()
        rows.append(root * run.residual)
        columns.append(root * np.vstack([run.columns, factor * direction]))
    return np.concatenate(rows), np.concatenate(columns, axis=1).T


@pytest.mark.parametrize("kind", ["force_gain", "force_delay", "command_label", "force_offset_of_run"])
def test_a_size_is_that_of_least_squares_in_which_the_parameters_move_too(noisy, kind):
    """Also away from the least of the cost: the damper is not fitted to these runs."""
    free = ("viscosity.c0", "yield_force.c1", "rho.value")
    found = residuals_of(TRUTH, noisy, free)
    one = np.zeros(len(noisy))
    one[4] = 1.0
    ramp = np.linspace(-0.5, 0.5, len(noisy))
    for factors, effect in (
        (one, found.of_run(4, kind)),
        (np.ones(len(noisy)), found.of_all(kind)),
        (ramp, found.of_all(kind, ramp)),
    ):
        residual, columns = stacked(found, kind, factors)
        solved = np.linalg.lstsq(columns, residual, rcond=None)[0]
        assert effect.size == pytest.approx(solved[-1], rel=1e-6)
        without = np.linalg.lstsq(columns[:, :-1], residual, rcond=None)[0]
        gained = np.sum((residual - columns[:, :-1] @ without) ** 2)
        gained -= np.sum((residual - columns @ solved) ** 2)
        scale = found.each[4].weight if factors is one else 1.0
        total = 0.0
        for k, run in enumerate(found.each):
            if factors is one and k != 4:
                continue
            left = run.residual if kind == "force_offset_of_run" else run.residual - run.residual.mean()
            total += (1.0 if factors is one else run.weight) * float(left @ left)
        assert effect.share == pytest.approx(gained / scale / total, rel=1e-5)
        # the usual standard error of a regression, for a tenth of the samples
        count = sum(len(run.residual) for k, run in enumerate(found.each) if factors is not one or k == 4)
        power = np.linalg.inv(columns.T @ columns)[-1, -1] * scale
        usual = np.sqrt((1.0 - effect.share) * total * power / (count / 10.0))
        assert effect.error == pytest.approx(usual, rel=1e-5)


def test_the_columns_are_how_the_force_changes_with_the_parameters(noisy):
    free = ("viscosity.c0", "rho.value")
    found = residuals_of(TRUTH, noisy, free, without=noisy[2].name)
    for number in (0, 5):
        fit = PreparedFit.of(noisy[number], 400.0, len(noisy))
        assert found.each[number].weight == pytest.approx(fit.weight)
        for name, column in zip(free, found.each[number].columns, strict=True):
            value = TRUTH.parameters[name]
            ends = [
                simulate(TRUTH.with_parameters({name: value * (1.0 + way)}), fit.drive)
                for way in (1e-4, -1e-4)
            ]
            slope = ((ends[0] - ends[1]) / (2e-4 * value))[fit.start :]
            assert column == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max())
    assert not found.each[2].columns.any(), "a run that was left out has not bent the fit"


def test_a_law_in_python_and_a_fit_of_nothing_have_no_columns(clean):
    found = residuals_of(TRUTH, clean)
    assert (found.inverse.shape, found.slope.shape) == ((0, 0), (0,))
    assert found.of_all("force_gain").explained < 1e-9


# --------------------------------------------------------------------------------- one run among others


def test_runs_of_one_damper_are_not_blamed(noisy):
    assert consistency(TRUTH, noisy) == ()
    assert doubted(TRUTH, noisy) == ()
    assert misfit(TRUTH, noisy, without="") == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize(
    ("kind", "size", "value", "words"),
    [
        ("force_gain", 0.2, 1.2, "its force is 1."),
        ("force_gain", -0.15, 0.85, "its force is 0.8"),
        ("force_delay", 4e-3, 4e-3, "ms later"),
        ("force_offset_of_run", 60.0, 60.0, "shifted by +"),
    ],
)
@pytest.mark.parametrize("number", [2, 6])
def test_one_run_that_is_off_is_named_with_its_cause_and_size(noisy, number, kind, size, value, words):
    most = float(np.abs(noisy[number].force).max())
    runs = list(noisy)
    runs[number] = changed(runs[number], kind, size, most)
    (finding,) = consistency(TRUTH, runs)
    assert (finding.run, finding.kind, finding.severity) == (runs[number].name, kind, "warning")
    assert finding.size == pytest.approx(value, rel=0.25)
    assert sure(finding)
    assert words in finding.found
    assert finding.channel == "force"
    assert finding.unit == {"force_delay": "s", "force_offset_of_run": "N"}.get(kind, "")
    assert doubted(TRUTH, runs)[0] == runs[number].name
    assert misfit(TRUTH, runs, without=runs[number].name) == pytest.approx(0.02, rel=0.06)
    off = runs[number].force - noisy[number].force
    assert misfit(TRUTH, runs, without="") > 0.02 or off.std() < 1e-6 * off.mean()


def test_one_run_does_not_tell_a_wrong_command_from_a_gain_and_both_are_said(noisy):
    for number, kind in ((1, "command_label"), (3, "force_gain")):
        runs = list(noisy)
        runs[number] = changed(runs[number], kind, 0.25, 1.0)
        (finding,) = consistency(TRUTH, runs)
        found = residuals_of(TRUTH, runs)
        assert f"{-found.of_run(number, 'command_label').size:+.3f} A" in finding.found
        assert f"{1.0 + found.of_run(number, 'force_gain').size:.3f}" in finding.found
        assert "(one run cannot tell)" in finding.found


def wide(finding: Any) -> float:
    """Return the width of a finding's interval over its size."""
    return float((finding.high - finding.low) / abs(finding.size))


def test_two_runs_whose_commands_were_exchanged_are_told_of_both(noisy):
    runs = list(noisy)
    one, other = 6, 7  # of one motion, at 1 A and 2 A
    assert runs[one].motion == runs[other].motion
    runs[one], runs[other] = (replace(runs[a], force=runs[b].force) for a, b in ((one, other), (other, one)))
    found = consistency(TRUTH, runs)
    assert {(each.run, each.kind) for each in found} == {
        (runs[one].name, "labels_exchanged"),
        (runs[other].name, "labels_exchanged"),
    }
    sizes = {each.run: each.size for each in found}
    assert sizes == {runs[one].name: pytest.approx(1.0), runs[other].name: pytest.approx(-1.0)}
    assert all(0.0 < wide(each) < 4.0 for each in found)
    assert any(runs[other].name in each.found for each in found)


def test_few_runs_say_nothing_of_each_other(noisy):
    five = [replace(noisy[0], force=2.0 * noisy[0].force), *noisy[1:5]]
    assert consistency(TRUTH, five) == ()
    assert doubted(TRUTH, five) == ()
    assert consistency(TRUTH, [replace(noisy[0], force=2.0 * noisy[0].force), *noisy[1:6]]) != ()


# --------------------------------------------------------------------------------- what several runs have


def told(runs):
    found = {each.kind: each for each in consistency(TRUTH, runs) if not each.run}
    assert all(sure(each) for each in found.values())
    return found


def sure(finding: Any) -> bool:
    """Tell whether a size is in the middle of its interval, which is that of some percent of it."""
    assert finding.size - finding.low == pytest.approx(finding.high - finding.size)
    return 0.0 < wide(finding) < 0.25


def test_a_delay_of_all_runs_is_told_once_and_not_of_each(noisy):
    for ms, word in ((5.0, "late"), (-5.0, "early")):
        found = told([changed(run, "force_delay", 1e-3 * ms, 1.0) for run in noisy])
        assert list(found) == ["common_delay"]
        assert found["common_delay"].size == pytest.approx(1e-3 * ms, rel=0.2)
        assert f"ms {word}" in found["common_delay"].found


def test_a_filter_of_all_runs_is_told_with_its_frequency(noisy):
    found = told([changed(run, "force_bandwidth", 0.02, 1.0) for run in noisy])
    assert list(found) == ["common_bandwidth"]
    assert found["common_bandwidth"].size == pytest.approx(0.02, rel=0.1)
    assert "filtered at about 8 Hz" in found["common_bandwidth"].found


@pytest.mark.parametrize(("gain", "word"), [(0.1, "more"), (-0.1, "less")])
def test_a_session_of_another_gain_is_told_by_its_name(noisy, gain, word):
    sessions = ["first", "second", "first"] * 4
    runs = [
        replace(run, run=replace(run.run, session=name)) for run, name in zip(noisy, sessions, strict=True)
    ]
    runs = [changed(run, "force_gain", gain, 1.0) if run.run.session == "second" else run for run in runs]
    (finding,) = consistency(TRUTH, runs)
    assert sure(finding)
    assert (finding.kind, finding.run) in {("session_gain", "second"), ("session_gain", "first")}
    expected = 1.0 + gain if finding.run == "second" else 1.0 - gain
    assert finding.size == pytest.approx(expected, abs=0.01)
    assert " % " + (word if finding.run == "second" else {"more": "less", "less": "more"}[word]) in (
        finding.found
    )


def test_two_heaps_of_gains_and_of_delays_are_two_groups(noisy):
    odd = [k for k in range(len(noisy)) if k in (1, 4, 6, 11)]
    runs = [changed(run, "force_gain", 0.2, 1.0) if k in odd else run for k, run in enumerate(noisy)]
    (finding,) = consistency(TRUTH, runs)
    assert sure(finding)
    assert finding.kind == "two_groups"
    assert finding.size == pytest.approx(1.2, abs=0.02)
    assert "the 4 runs" in finding.found
    assert all(noisy[k].name in finding.found for k in odd)
    late = [changed(run, "force_delay", 12e-3, 1.0) if k in odd else run for k, run in enumerate(noisy)]
    found = {each.kind: each for each in consistency(TRUTH, late)}
    assert found["group_delay"].size == pytest.approx(12e-3, rel=0.2)
    assert sure(found["group_delay"])
    assert "12 ms later" in found["group_delay"].found or "ms later" in found["group_delay"].found


@pytest.mark.parametrize(("rise", "word"), [(0.2, "grows"), (-0.2, "falls")])
def test_a_force_that_drifts_over_the_campaign_is_told_as_drift(noisy, rise, word):
    order = np.random.default_rng(7).permutation(len(noisy))
    ramp = np.linspace(-0.5, 0.5, len(noisy))
    runs = [changed(noisy[k], "force_gain", rise * u, 1.0) for k, u in zip(order, ramp, strict=True)]
    (finding,) = consistency(TRUTH, runs)
    assert sure(finding)
    assert finding.kind == "campaign_drift"
    assert finding.size == pytest.approx(rise, rel=0.1)
    assert f"the force {word} by 20 %" in finding.found or f"the force {word} by" in finding.found


# --------------------------------------------------------------------------------- what is usual


def test_the_levels_of_a_command_are_those_further_apart_than_its_noise(noisy):
    commands = [0.0, 0.02, 1.0, 1.03, 2.0, 0.05, 1.98]
    runs = [
        replace(run, trajectory=replace(run.trajectory, command=np.full(len(run.force), command)),
                run=replace(run.run, command=np.full(len(run.run.force), command)))
        for run, command in zip(noisy, commands, strict=False)
    ]  # fmt: skip
    assert _command_levels(runs).tolist() == [0, 0, 1, 1, 2, 0, 2]


def test_what_a_run_is_compared_with_is_of_its_command_and_its_motion(noisy):
    """The size that is usual there is taken out, one run of many that is off moves it by nothing."""
    rng = np.random.default_rng(0)
    place = np.arange(12)
    usual = np.array([0.1, 0.5, -0.2, 0.3])[place % 4] + np.array([0.0, 0.4, -0.3])[place // 4]
    sizes = usual + 0.01 * rng.standard_normal(12)
    sizes[6] += 3.0
    counts = np.ones(12, dtype=bool)
    departures, scatter = _departures(sizes, np.full(12, 2.0), _peers(noisy), counts)
    assert departures[6] == pytest.approx(6.0, rel=0.03)
    assert np.abs(np.delete(departures, 6)).max() < 0.1
    assert 0.002 < scatter < 0.05
    # six equal ones: as many departures as levels vanish, and those of all runs are compared
    flat = 0.01 * rng.standard_normal(12)
    assert _departures(flat, np.ones(12), np.ones((12, 1)), counts)[1] == pytest.approx(
        1.4826 * np.median(np.sort(np.abs(flat - np.median(flat)))[1:]), rel=0.2
    )


def test_peers_are_those_of_one_command_and_motion_or_what_stands_for_them(noisy):
    cells = {(run.motion, run.run.constant_command) for run in noisy}
    assert np.linalg.matrix_rank(_peers(noisy)) == 3 + 4 - 1
    again = [*noisy, *noisy, *noisy]  # at three temperatures
    design = _peers(again)
    assert design.shape == (36, len(cells))
    assert design.sum(axis=1).tolist() == [1.0] * 36
    assert design.sum(axis=0).tolist() == [3.0] * len(cells)
    own = [replace(run, motion=run.name) for run in again]  # each motion once: a slope with the speed
    own = [replace(run, motion=f"{run.motion} {k}") for k, run in enumerate(own)]
    design = _peers(own)
    assert np.linalg.matrix_rank(design) == 8
    speed = np.log([np.std(run.trajectory.velocity) for run in own])
    for level in range(4):
        of = design[:, level] == 1.0
        assert design[of, 4 + level] == pytest.approx(speed[of] - speed[of].mean())
        assert not design[~of, 4 + level].any()
    assert _peers(noisy[:4]).tolist() == [[1.0]] * 4


# --------------------------------------------------------------------------------- commands and nothing


def test_the_change_with_the_command_is_a_difference_also_where_a_coefficient_comes_to_its_limit(clean):
    """A step of 0.02 A towards less, or towards more from 0 A, where this viscosity would be negative."""
    falling = {**TRUTH.coefficients, "viscosity": Polynomial((10.0, -1000.0, 2000.0))}
    damper = replace(TRUTH, coefficients=falling)
    runs = [run for run in clean if run.run.constant_command in (0.0, 1.0)]
    for run, found in zip(runs, residuals_of(damper, runs).each, strict=True):
        step = -0.02 if run.run.constant_command else 0.02
        path = PreparedFit.of(run, 400.0, 6).drive.trajectory
        beside = simulate(damper.on_limits(), replace(path, command=path.command + step))
        slope = (beside - simulate(damper, path))[run.scored_from :] / step
        assert found.directions["command_label"] == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_of_a_run_that_is_met_exactly_or_a_cause_that_moves_nothing_nothing_is_said(clean):
    found = residuals_of(TRUTH, clean)
    nothing = Effect(0.0, 0.0, 0.0, 0.0)
    still = replace(found.each[0], residual=np.zeros_like(found.each[0].residual))
    flat = replace(found.each[0], directions={kind: 0.0 * each for kind, each in still.directions.items()})
    for each in (still, flat):
        alone = replace(found, runs=found.runs[:1], each=(each,))
        assert alone.of_run(0, "force_gain") == alone.of_all("force_gain") == nothing
    own = replace(found.each[0], columns=found.each[0].directions["force_gain"][None] * 2.0)
    taken = own.directions["force_gain"] - own.directions["force_gain"].mean()
    own = replace(own, columns=2.0 * taken[None])
    inverse = np.array([[1.0 / (own.weight * 4.0 * float(taken @ taken))]])
    absorbed = replace(found, runs=found.runs[:1], each=(own,), inverse=inverse, slope=np.zeros(1))
    assert absorbed.of_run(0, "force_gain") == nothing, "what the parameters can imitate"
