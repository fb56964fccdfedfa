"""Motions: runs that move alike, and the folds of a cross-validation that leaves whole motions out.

Errors on a motion that a law was fitted to say little about another one. So what an error, a coefficient or
a choice between laws is worth is found on motions that were left out; runs of one motion at other commands
and temperatures go together. Where all runs move alike, commands are left out, and where these are too few,
blocks of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.problem import PreparedFit

MOST_FOLDS = 5
_ALIKE = 1.3  # greatest ratio of the standard deviations of displacement and velocity inside one motion
_SAME_COMMAND = 0.03  # of the largest: commands no further apart are one level
_GUARD = 0.02  # of a run, on either side of a block of time: neither trained on nor scored


@dataclass(frozen=True, slots=True)
class Fold:
    """Runs that are left out together, by their places; of each of them the given share of its samples.

    ``block`` is (0, 1) for whole runs, else the part of the scored samples that is left out.
    """

    label: str
    runs: tuple[int, ...]
    block: tuple[float, float] = (0.0, 1.0)

    @property
    def whole(self) -> bool:
        """Whether whole runs are left out."""
        return self.block == (0.0, 1.0)

    def scored(self, start: int, stop: int) -> slice:
        """Return the samples that are left out of a run that counts from ``start`` to ``stop``."""
        first, last = (start + round(share * (stop - start)) for share in self.block)
        return slice(first, last)

    def training(self, runs: Sequence[PreparedFit]) -> tuple[PreparedFit, ...]:
        """Return the runs of a fit without what is left out.

        The run that holds a block of time counts whole, less all from the block on, and again all behind it:
        sums over samples are then those outside the block (and its guard), and every state is simulated from
        the start.
        """
        left = set(self.runs)
        if self.whole:
            return tuple(run for k, run in enumerate(runs) if k not in left)
        found: list[PreparedFit] = []
        for k, run in enumerate(runs):
            found.append(run)
            if k in left:
                stop = len(run.force)
                block, guard = self.scored(run.start, stop), round(_GUARD * (stop - run.start))
                found.append(replace(run, start=max(block.start - guard, run.start), weight=-run.weight))
                if block.stop + guard < stop:
                    found.append(replace(run, start=block.stop + guard))
        return tuple(found)


def motion_groups(runs: Sequence[PreparedRun]) -> tuple[tuple[int, ...], ...]:
    """Return the places of runs that move alike, the slowest motion first.

    Two runs move alike while the standard deviations of their displacement and of their velocity differ by
    less than 30 %.
    """
    sizes = [
        np.log([np.std(getattr(run.trajectory, what)) for what in ("velocity", "displacement")])
        for run in runs
    ]
    groups: list[list[int]] = []
    for k in sorted(range(len(runs)), key=lambda k: (*sizes[k].tolist(), k)):
        near = (g for g in groups if np.abs(sizes[k] - sizes[g[0]]).max() < np.log(_ALIKE))
        group = next(near, None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    return tuple(tuple(sorted(group)) for group in groups)


def folds_of(runs: Sequence[PreparedRun]) -> tuple[Fold, ...]:
    """Return what is left out, one fold after the other, each run (or each block of time) once.

    Several motions: whole motions, at most ``MOST_FOLDS``, slow and fast ones dealt out in turn. One motion
    at four levels of the command or more: the levels between the least and the largest. Else: as many blocks
    of time, the same ones of every run.
    """
    groups = motion_groups(runs)
    if len(groups) == 1:
        groups = _inner_levels(runs)
        if len(groups) < 2:
            ends = np.linspace(0.0, 1.0, MOST_FOLDS + 1).tolist()
            places = tuple(range(len(runs)))
            return tuple(
                Fold(f"block {k + 1} of {MOST_FOLDS} in time", places, (ends[k], ends[k + 1]))
                for k in range(MOST_FOLDS)
            )
        labels = [f"{run.trajectory.command.mean():.3g} {run.run.command_unit}" for run in runs]
    else:
        labels = [run.motion for run in runs]
    count = min(MOST_FOLDS, len(groups))
    dealt = [groups[k::count] for k in range(count)]
    return tuple(
        Fold(
            ", ".join(dict.fromkeys(labels[group[0]] for group in together)),
            tuple(sorted(k for group in together for k in group)),
        )
        for together in dealt
    )


def _inner_levels(runs: Sequence[PreparedRun]) -> tuple[tuple[int, ...], ...]:
    """Return the places of the runs at each level of the command but the least and the largest."""
    held = [(run.run.constant_command, k) for k, run in enumerate(runs)]
    known = sorted((command, k) for command, k in held if command is not None)
    if not known:
        return ()
    at = np.array([command for command, _ in known])
    cuts = np.flatnonzero(np.diff(at) > _SAME_COMMAND * np.abs(at).max()) + 1
    levels = np.split(np.array([k for _, k in known]), cuts)
    return tuple(tuple(sorted(level.tolist())) for level in levels[1:-1])
