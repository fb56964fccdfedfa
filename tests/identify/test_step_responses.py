"""Responses to steps of the command: of forces whose share is known at every sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import MOTIONS, drive
from mrdamper.identify.step_responses import SHARE, crossing, measured_times, stepped_run
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
