"""Folds of a cross-validation: whole motions, levels of the command, blocks of time."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper import core
from mrdamper.identify.motions import folds_of, motion_groups
from mrdamper.identify.problem import PreparedFit
from tests.identify.truths import TRUTHS, measured

RUNS = measured(TRUTHS["series-valve"], noise=0.01, seed=0)


def test_every_run_is_left_out_once_and_with_all_that_move_alike() -> None:
    groups, folds = motion_groups(RUNS), folds_of(RUNS)
    assert sorted(k for fold in folds for k in fold.runs) == list(range(len(RUNS)))
    for group in groups:
        assert sum(set(group) <= set(fold.runs) for fold in folds) == 1
    assert {len({RUNS[k].motion for k in group}) for group in groups} == {1}


def test_of_one_motion_commands_inside_the_range_are_left_out_and_of_one_run_blocks_of_time() -> None:
    alike = [RUNS[k] for k in motion_groups(RUNS)[0]]
    levels = sorted(float(run.trajectory.command.mean()) for run in alike)
    left = [float(alike[k].trajectory.command.mean()) for fold in folds_of(alike) for k in fold.runs]
    assert len(left) < 2 or (min(left) > levels[0] and max(left) < levels[-1])
    blocks = folds_of(RUNS[:1])
    assert [fold.block[0] for fold in blocks] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8])
    assert all(fold.runs == (0,) and not fold.whole for fold in blocks)


def test_without_a_block_of_time_the_sums_are_those_of_the_samples_outside() -> None:
    """The sums of the signed runs equal a sum over the samples that neither block nor guard hold."""
    run = PreparedFit.of(RUNS[0], 200.0, 1)
    column = np.sin(np.arange(len(run.force)))[None]
    for fold in folds_of(RUNS[:1]):
        signed = sum(part.weight * core.gram(column, part.start)[0, 0] for part in fold.training([run]))
        block = fold.scored(run.start, len(run.force))
        outside = np.ones(len(run.force), dtype=bool)
        guard = round(0.02 * (len(run.force) - run.start))
        outside[max(block.start - guard, run.start) : block.stop + guard] = False
        outside[: run.start] = False
        assert signed == pytest.approx(run.weight * float(np.sum(column[0][outside] ** 2)), rel=1e-9)
        assert not outside[block].any()


def test_the_groups_do_not_depend_on_the_order_of_the_runs() -> None:
    named = lambda runs: {frozenset(runs[k].name for k in g) for g in motion_groups(runs)}  # noqa: E731
    assert named(RUNS) == named(RUNS[::-1])
