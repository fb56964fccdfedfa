"""Group runs with the same motion, and define the folds of a cross-validation over motions.

The error on a fitted motion does not predict the error on a new motion. Therefore whole motions are held
out, with all their currents and temperatures. If all runs have the same motion, currents are held out
instead. If there are too few currents, time blocks (sections of each run) are held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import level_numbers
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.windows import FitWindow
from mrdamper.models.force_band import LeftOut


@dataclass(frozen=True, slots=True)
class Fold:
    """Data that are held out together: whole runs, or one time block (section) of each run."""

    runs: tuple[int, ...]  # indices of the runs
    block: int | None = None  # index of the time block; None: whole runs are held out

    def holds_out(self, window: FitWindow) -> bool:
        """Return True if the window belongs to the data that the fold holds out."""
        return window.run in self.runs and self.block in (None, window.block)

    def training(self, windows: Sequence[FitWindow]) -> tuple[FitWindow, ...]:
        """Return the windows that the fold does not hold out."""
        return tuple(window for window in windows if not self.holds_out(window))


def fold_content(runs: Sequence[PreparedRun], folds: Sequence[Fold]) -> LeftOut:
    """Return the kind of data that the folds hold out: motions, commands or parts of each run."""
    if len(motion_groups(runs)) > 1:
        return "motions"
    return "commands" if folds[0].block is None else "blocks of time"


def block_count(folds: Sequence[Fold]) -> int:
    """Return the number of time blocks into which folds divide a run; 1 if they hold out whole runs."""
    return 1 if folds[0].block is None else len(folds)


def motion_groups(runs: Sequence[PreparedRun]) -> tuple[tuple[int, ...], ...]:
    """Return one tuple of run indices for each motion, the slowest motion first.

    Two runs have the same motion if the standard deviations of their displacement and of their velocity
    differ by less than 30 %.
    """
    sizes = [np.log([np.std(run.trajectory.velocity), np.std(run.trajectory.displacement)]) for run in runs]
    groups: list[list[int]] = []
    distance_max = np.log(NUMERICS.fold_motion_ratio)
    for k in sorted(range(len(runs)), key=lambda k: (*sizes[k].tolist(), k)):
        group = next((g for g in groups if np.abs(sizes[k] - sizes[g[0]]).max() < distance_max), [])
        if not group:
            groups.append(group)
        group.append(k)
    return tuple(tuple(sorted(group)) for group in groups)


def folds_of(runs: Sequence[PreparedRun]) -> tuple[Fold, ...]:
    """Return the folds of a cross-validation; each run or time block is in at most one fold.

    If there are several motions, whole motions are distributed among at most ``fold_count_max`` folds, so
    that each fold has slow and fast motions. If there are a single motion and at least four currents, all
    runs at one current are held out together. The smallest and the largest current are never held out.
    Otherwise each run is divided into ``fold_count_max`` time blocks, and each fold holds out one block of
    every run.
    """
    groups, count = motion_groups(runs), NUMERICS.fold_count_max
    if len(groups) == 1:
        groups = _inner_levels(runs)
        if len(groups) < 2:
            return tuple(Fold(tuple(range(len(runs))), block) for block in range(count))
    count = min(count, len(groups))
    dealt = (groups[first::count] for first in range(count))
    return tuple(Fold(tuple(sorted(k for group in part for k in group))) for part in dealt)


def _inner_levels(runs: Sequence[PreparedRun]) -> tuple[tuple[int, ...], ...]:
    """Return one tuple of run indices for each constant current except the smallest and the largest."""
    known = {k: held for k, run in enumerate(runs) if (held := run.run.constant_command) is not None}
    commands = np.array(list(known.values()))
    numbers = level_numbers(commands, NUMERICS.same_current_ratio * np.abs(commands).max(initial=0.0))
    inner = range(1, numbers.max(initial=0))
    return tuple(tuple(np.array(list(known))[numbers == level].tolist()) for level in inner)
