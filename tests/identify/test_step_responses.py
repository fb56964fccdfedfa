"""Responses to steps of the command: of forces whose share is known at every sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import MOTIONS, drive
from mrdamper.identify.step_responses import (
    SHARE,
    _Maps,
    _sliding,
    crossing,
    measured_times,
    stepped_run,
)
from mrdamper.models.simulate import simulate
from tests.identify.truths import AS_IT_IS, TRUTHS

LAW = TRUTHS["bouc-wen"]
RATE_Hz = 1000.0
LEVELS = (0.0, 1.0, 0.0, 2.0, 1.0, 2.0, 0.0)
HELD = 430  # samples of each
TAU_s = 0.004


def since_step(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the level before, that after and the time since the last step, at each sample."""
    number = np.minimum(np.arange(count) // HELD, len(LEVELS) - 1)
    levels = np.array(LEVELS)
    return levels[np.maximum(number - 1, 0)], levels[number], (np.arange(count) - HELD * number) / RATE_Hz


def blended(*, bend_N: float = 0.0, remembered_N: float = 0.0) -> tuple[PreparedRun, FloatArray]:
    """Return a run whose force goes from level to level as one lag does, and its share at each sample.

    ``bend_N`` is a parabola over position, of another size in each direction and at each level;
    ``remembered_N`` is added where a level was reached from above.
    """
    count = HELD * len(LEVELS)
    path = drive(MOTIONS["steps"], duration=(count - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=0.0)
    before, after, time = since_step(count)
    share = np.where(np.arange(count) < HELD, 1.0, 1.0 - np.exp(-time / TAU_s))
    x = path.displacement / np.abs(path.displacement).max()
    way = np.sign(path.velocity)
    fell = {level: np.zeros(count) for level in LEVELS}
    for k in range(1, len(LEVELS)):
        fell[LEVELS[k]][HELD * k :] = LEVELS[k] < LEVELS[k - 1]

    def force(level: float, late: int) -> FloatArray:
        held = simulate(LAW, replace(path, command=np.full(count, level)))
        seen = fell[level][np.maximum(np.arange(count) - late, 0)]
        return np.asarray(held + bend_N * (level + 0.5 * way) * (1.0 + x - 0.4 * x**2) + remembered_N * seen)

    total = np.zeros(count)
    for level in set(LEVELS):
        total += np.where(after == level, share * force(level, 0), 0.0)
        total += np.where(before == level, (1.0 - share) * force(level, HELD), 0.0)
    run = RigRun(
        name="steps",
        time=path.time,
        displacement=path.displacement,
        force=total,
        command=after,
        command_unit="A",
        motion="steps",
    )
    return prepare_run(run, AS_IT_IS), share


@pytest.mark.parametrize("bend_N", [0.0, 25.0])
def test_the_share_of_a_step_that_the_force_has_gone_is_the_lag_s_own(bend_N):
    run, share = blended(bend_N=bend_N)
    found = stepped_run(LAW, run)
    assert found is not None
    path = run.trajectory
    _, after, time = since_step(len(path))
    assert len(found.responses) >= 3
    for response, (low, high) in zip(found.responses, found.levels, strict=True):
        window = response.window
        assert response.share == pytest.approx(share[window], abs=1e-6)
        assert time[window.start] == 0.0, "from the step on"
        assert 0.04 <= (window.stop - window.start) / RATE_Hz <= 0.15
        assert len(set(np.sign(path.velocity[window]).tolist())) == 1
        number = window.start // HELD
        assert window.start == HELD * number
        assert response.upwards == (LEVELS[number] > LEVELS[number - 1]) == (high > low)
        assert len(response.size) == window.stop - window.start
        apart = simulate(LAW, replace(path, command=np.full(len(path), LEVELS[number])))
        apart -= simulate(LAW, replace(path, command=np.full(len(path), LEVELS[number - 1])))
        if not bend_N:
            assert response.size == pytest.approx(apart[window], rel=1e-4)
        assert found.held[high][window] - found.held[low][window] == pytest.approx(apart[window])
    assert np.array_equal(after, path.command)


def test_what_the_iron_remembers_of_a_level_from_above_is_part_of_its_level():
    run, share = blended(remembered_N=40.0)
    found = stepped_run(LAW, run)
    assert found is not None
    for response in found.responses:
        assert response.share == pytest.approx(share[response.window], abs=1e-3)


def test_a_step_takes_as_long_as_the_lag_that_made_it():
    run, _ = blended()
    found = stepped_run(LAW, run)
    assert found is not None
    own = measured_times([found, found], lambda each: each.run.force)
    assert len(own) == 2 * len(found.responses)
    for each in own:
        assert each.model_s == pytest.approx(each.measured_s, rel=1e-6)
        assert each.measured_s == pytest.approx(TAU_s, rel=0.03)
    at_once = measured_times([found], lambda each: simulate(LAW, each.drive))
    assert {each.model_s for each in at_once} <= {0.0}
    assert [each.levels for each in own[: len(found.levels)]] == list(found.levels)


def test_a_run_tells_nothing_that_is_held_or_whose_commands_do_not_last():
    run, _ = blended()
    path = run.trajectory
    held = replace(run, trajectory=replace(path, command=np.ones(len(path))))
    assert stepped_run(LAW, held) is None
    quick = np.where(np.arange(len(path)) // 150 % 2 == 0, 0.0, 1.0)
    assert stepped_run(LAW, replace(run, trajectory=replace(path, command=quick))) is None
    without = LAW.with_parameters({"yield_force.c1": 0.0, "yield_force.c2": 0.0})
    still = {"viscosity.c1": 0.0, "viscosity.c2": 0.0, "stiffness.c1": 0.0, "stiffness.c2": 0.0}
    offset = {"offset.c1": 0.0, "offset.c2": 0.0}
    assert stepped_run(without.with_parameters({**still, **offset}), run) is None


@pytest.mark.parametrize("step", [1e-3, 0.004])
@pytest.mark.parametrize("late", [3.4, 11.0, 20.75])
def test_the_time_of_a_straight_rise_is_where_it_crosses(step, late):
    """A line crosses 63 % exactly where it does; noise about it does not move that far."""
    share = np.clip(SHARE + 0.05 * (np.arange(40) - late), 0.0, 1.0)
    assert crossing(share, step) == pytest.approx(step * late, rel=1e-6)
    noise = 0.01 * np.random.default_rng(0).standard_normal(40)
    assert crossing(share + noise, step) == pytest.approx(step * late, abs=0.6 * step)


def test_the_time_of_an_exponential_is_its_time_constant_and_of_none_there_is_none():
    time = 1e-4 * np.arange(1000)
    assert crossing(1.0 - np.exp(-time / 0.01), 1e-4) == pytest.approx(0.01, rel=0.03)
    assert pytest.approx(1.0 - np.exp(-1.0)) == SHARE
    assert np.isnan(crossing(np.full(20, 0.5), 1e-3))
    assert crossing(np.full(20, 0.9), 1e-3) == 0.0
    dip = np.array([0.1, 0.3, 0.2, 0.9, 0.4, 1.0])  # through 63 % within one sample
    assert 2e-3 < crossing(dip, 1e-3) < 3e-3


# --------------------------------------------------------------------------------- what tells, and what not


def switched(levels: Sequence[float] | FloatArray, samples: Sequence[int], **changed: Any) -> PreparedRun:
    """Return a run of a triangle of 24 mm at 30 mm/s whose command goes through levels, at 1 kHz."""
    command = np.repeat(levels, samples)
    path = drive(MOTIONS["steps"], duration=(len(command) - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=0.0)
    path = replace(path, command=command)
    force = simulate(LAW, path)
    run = RigRun("steps", path.time, path.displacement, force, command, command_unit="A", motion="steps")
    return replace(prepare_run(run, AS_IT_IS), **{"scored_from": 0, **changed})


def windows(run: PreparedRun) -> list[tuple[int, int]]:
    found = stepped_run(LAW, run)
    return [] if found is None else [(each.window.start, each.window.stop) for each in found.responses]


def test_a_response_lasts_150_ms_at_most_and_40_at_least_and_ends_before_the_motion_or_the_command_turns():
    """A step counts from 15 % of the stroke after a turn of the motion on, and ends 3 % before the next."""
    rng = np.random.default_rng(4)
    samples = [500, 460, *rng.integers(210, 420, 30).tolist(), 39, 40, 41, 100, 300, 300]
    samples = [n for pair in zip(samples, [*samples[18:], *samples[:18]], strict=True) for n in pair]
    run = switched(np.resize([0.0, 2.0], len(samples)), samples)
    x, count = run.trajectory.displacement, len(run)
    way = np.sign(run.trajectory.velocity)
    gone = 0.5 + 0.5 * way * x / 0.012  # share of the stroke since the last turn
    cuts = [*np.cumsum(samples).tolist()]
    expected = []
    for first, end in pairwise(cuts):
        stop = first
        while stop < min(end, first + 150) and 0.15 < gone[stop] < 0.97 and way[stop] == way[first]:
            stop += 1
        if stop - first >= 40:
            expected.append((first, stop))
    assert {150, 40} <= {b - a for a, b in expected}
    assert any(b - a not in (150, 40, 41, 100) for a, b in expected), "where the motion turns"
    assert windows(run) == expected
    assert count == cuts[-1]


def test_near_a_turn_and_before_it_is_scored_a_motion_is_not_under_way():
    """A stroke of 100: more than 15 behind and 3 ahead of it; the first samples of a run are not scored."""
    x = np.abs((np.arange(801) + 50) % 200 - 100.0)
    velocity = np.append(np.diff(x), np.diff(x)[-1])
    path = SimpleNamespace(displacement=x, velocity=velocity, __len__=lambda: 801)
    run: Any = SimpleNamespace(trajectory=Path(path), scored_from=130)
    found = _sliding(run)
    expected = [k >= 130 and (15 < (k + 50) % 100 < 97) for k in range(750)]
    assert found[:750].tolist() == expected


class Path:
    def __init__(self, given: Any) -> None:
        self.displacement, self.velocity = given.displacement, given.velocity

    def __len__(self) -> int:
        return len(self.displacement)


def test_a_level_needs_twenty_settled_samples_in_its_direction():
    run, _ = blended()
    count = len(run)
    held = {0: np.zeros(count), 1: np.ones(count)}
    way = np.sign(run.trajectory.velocity)
    there = np.flatnonzero(way > 0.0)
    for samples in (19, 20):
        settled = np.zeros(count, dtype=bool)
        settled[there[:samples]] = True
        maps = _Maps(run, held, np.zeros(count), np.zeros(count, dtype=bool), settled)
        assert (maps.level(0, 1.0, fell=False) is None) == (samples < 20)
        assert maps.level(0, -1.0, fell=False) is None
        assert maps.level(1, 1.0, fell=False) is None


@pytest.mark.parametrize("fell", [False, True])
def test_a_map_is_the_law_and_the_parabola_that_fits_what_it_misses(fell):
    run, _ = blended()
    rng, count = np.random.default_rng(0), len(run)
    x, way = run.trajectory.displacement, np.sign(run.trajectory.velocity)
    law, from_above = rng.standard_normal(count), np.arange(count) > 1500
    settled = way == way[700]
    maps = _Maps(run, {3: law}, np.full(count, 3), from_above, settled)
    found = maps.level(3, way[700], fell=fell)
    columns = np.column_stack([np.ones(count), x, x**2, from_above])
    fit = np.linalg.lstsq(columns[settled] / [1.0, 0.01, 1e-4, 1.0], (run.force - law)[settled], rcond=None)[
        0
    ]
    fit = fit / [1.0, 0.01, 1e-4, 1.0]
    columns[:, 3] = fell
    assert found == pytest.approx(law + columns @ fit, rel=1e-6, abs=1e-6)
    alike = _Maps(run, {3: law}, np.full(count, 3), np.full(count, fell), settled).level(
        3, way[700], fell=fell
    )
    fit = np.polyfit(x[settled] / 0.01, (run.force - law)[settled], 2)
    assert alike == pytest.approx(law + np.polyval(fit, x / 0.01), rel=1e-6, abs=1e-6)


def test_a_change_of_less_than_a_twentieth_of_the_range_is_no_step():
    samples = [500, 460, 480, 490, 470, 450, 500, 510]
    levels = np.resize([0.0, 2.0], len(samples))
    run = switched(levels, samples)
    plain = windows(run)
    assert len(plain) > 3
    starts = {first for first, _ in plain}
    for change, steps in ((0.095, 0), (0.115, 1)):
        command = run.trajectory.command.copy()
        command[200:350] += change
        command[0] = 0.0
        other = replace(run, trajectory=replace(run.trajectory, command=command))
        found = {first for first, _ in windows(other)}
        assert starts <= found | {500}
        assert not {200, 350} & found or steps
    assert (
        windows(replace(run, trajectory=replace(run.trajectory, command=0.0 * run.trajectory.command))) == []
    )


def test_a_command_that_creeps_has_no_steps():
    run = switched([0.0, 2.0], [1000, 1000])
    creeping = replace(run.trajectory, command=np.linspace(0.0, 2.0, len(run)))
    assert stepped_run(LAW, replace(run, trajectory=creeping)) is None


@pytest.mark.parametrize(("samples", "tells"), [(199, False), (200, True)])
def test_commands_that_last_twice_as_long_as_a_force_settles_tell(samples, tells):
    assert bool(windows(switched(np.resize([0.0, 2.0], 60), [samples] * 60))) == tells


def test_levels_that_are_a_twentieth_of_the_range_apart_are_one_and_it_is_held_at_their_mean():
    levels = [0.0, 2.0, 0.02, 2.03, 0.0, 1.98, 0.04, 2.0]
    run = switched(levels, [500, 460, 480, 490, 470, 450, 500, 510])
    found = stepped_run(LAW, run)
    assert found is not None
    assert len(found.held) == 2
    for force, level in zip(
        (found.held[min(found.held)], found.held[max(found.held)]), (0.015, 2.0025), strict=True
    ):
        held = replace(run.trajectory, command=np.full(len(run), level))
        assert force == pytest.approx(simulate(LAW, held))
    assert {each.upwards for each in found.responses} == {True, False}


def test_a_step_tells_that_moves_the_force_by_three_percent_of_its_largest():
    """The largest force is that of another part of the run."""
    run = switched(np.resize([0.0, 0.13], 16), [430] * 16)
    apart = simulate(LAW, replace(run.trajectory, command=np.full(len(run), 0.13)))
    apart -= simulate(LAW, replace(run.trajectory, command=np.zeros(len(run))))
    apart = np.abs(apart[_sliding(run)])
    for largest, tells in ((0.97 * apart.min(), True), (1.03 * apart.max(), False)):
        force = run.force.copy()
        force[5] = largest / 0.03
        assert force[5] > np.abs(run.force).max()
        assert bool(windows(replace(run, force=force))) == tells


@given(
    st.lists(
        st.sampled_from([0.1, 0.3, 0.49, 0.5, 0.55, 0.6, 0.62, SHARE, 0.64, 0.7, 0.77, 0.8, 0.9]), max_size=9
    )
)
def test_the_time_of_a_step_is_read_from_the_rising_samples_between_a_half_and_three_quarters(shares):
    share = np.array(shares)
    above = [k for k, value in enumerate(shares) if value >= SHARE]
    if not above or above[0] == 0:
        expected = 0.0 if above else np.nan
    else:
        first, last = above[0] - 1, above[0]
        while first > 0 and shares[first] > shares[first - 1] > 0.5:
            first -= 1
        while last < len(shares) - 1 and shares[last] < shares[last + 1] < 0.77:
            last += 1
        near, at = share[first : last + 1] - SHARE, np.arange(first, last + 1)
        slope = np.cov(near, at)[0, 1] / np.var(near, ddof=1)
        expected = 1e-3 * (at.mean() - slope * near.mean()) if slope > 0.0 else 1e-3 * above[0]
    assert crossing(share, 1e-3) == pytest.approx(expected, rel=1e-9, nan_ok=True)
