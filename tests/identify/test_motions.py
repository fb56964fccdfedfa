"""Cross-validation holds out whole motions, runs of one current, or sections of a single run."""

from __future__ import annotations

from mrdamper.identify.motions import block_count, folds_of, motion_groups
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.templates import template
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs

RUNS = simulate_runs(REFERENCE_DAMPERS["series-valve"], noise=0.01, seed=0)


def test_each_motion_is_held_out_once() -> None:
    """Each run is held out once, together with all other runs of its motion."""
    groups, folds = motion_groups(RUNS), folds_of(RUNS)
    assert sorted(k for fold in folds for k in fold.runs) == list(range(len(RUNS)))
    for group in groups:
        assert sum(set(group) <= set(fold.runs) for fold in folds) == 1
        assert len({RUNS[k].motion for k in group}) == 1


def test_runs_with_extreme_currents_are_never_held_out() -> None:
    alike = [RUNS[k] for k in motion_groups(RUNS)[0]]
    levels = sorted(float(run.trajectory.command.mean()) for run in alike)
    held_out = [float(alike[k].trajectory.command.mean()) for fold in folds_of(alike) for k in fold.runs]
    assert sorted(held_out) == levels[1:-1]


def test_each_run_section_belongs_to_one_fold() -> None:
    """A single run has several sections. Each section is held out once and fitted in all other folds."""
    runs = RUNS[:1]
    folds = folds_of(runs)
    damper, free = template("bingham", runs, one_command=True)
    windows = FitProblem(damper, free, runs).windows(blocks=block_count(folds))
    assert all(fold.runs == (0,) for fold in folds)
    for window in windows:
        assert sum(fold.holds_out(window) for fold in folds) == 1
        assert sum(window in fold.training(windows) for fold in folds) == len(folds) - 1


def test_motion_groups_ignore_order_of_runs() -> None:
    def names(runs):
        return {frozenset(runs[k].name for k in group) for group in motion_groups(runs)}

    assert names(RUNS) == names(RUNS[::-1])
