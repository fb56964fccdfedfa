"""Candidates of a selection: a law with some of its groups, its fit, and its errors on what was left out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.models.damper import Damper


@dataclass(frozen=True, slots=True)
class Candidate:
    """A law with the groups that are switched on."""

    law: str
    groups: tuple[str, ...]

    @property
    def title(self) -> str:
        return " + ".join((self.law, *self.groups))

    def with_group(self, name: str) -> Candidate:
        return replace(self, groups=(*self.groups, name))

    def without(self, name: str) -> Candidate:
        return replace(self, groups=tuple(group for group in self.groups if group != name))


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A candidate fitted to all runs: its damper, and its errors on them [%]."""

    candidate: Candidate
    damper: Damper
    free_parameters: int
    training_percent: float  # the root of the mean square over the runs
    training_median: float
    cpu_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A fitted candidate's errors on what was left out.

    ``squares`` are the squared errors [%^2] of each fold's runs, NaN where the fold does not hold the run;
    ``changing`` those of runs whose command changes, by the fit to the others and the lags of these.
    Constant and changing commands count alike, however many runs there are of each: a laboratory holds its
    commands, a controller never does.
    """

    fitted: Fitted
    squares: FloatArray  # (folds, runs)
    dampers: tuple[Damper, ...]  # of the fits without each fold
    cpu_s: float
    changing: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def by_run(self) -> FloatArray:
        """The errors [%] of the runs that were left out, once each."""
        return np.asarray(np.sqrt(np.concatenate([self._held, self.changing])))

    @property
    def percent(self) -> float:
        """The root of the mean squared error [%] on what was left out."""
        parts = [part.mean() for part in (self._held, self.changing) if part.size]
        return float(np.sqrt(np.mean(parts)))

    @property
    def highest_training_percent(self) -> float:
        """The error [%] on the runs of held command above which no candidate comes to less on all."""
        return self.percent * (np.sqrt(2.0) if self.changing.size else 1.0)

    @property
    def _held(self) -> FloatArray:
        """The squared errors [%^2] of the runs whose command is held."""
        known = ~np.isnan(self.squares).all(axis=0)
        return np.asarray(np.nansum(self.squares[:, known], axis=0))

    def gain_over(self, other: Judged) -> tuple[float, float]:
        """Return by how much of the other's error this one's is lower, and the mean fall over its error.

        The second is Student's t of the falls of squared error, over the folds and the runs of changing
        command, each kind with its own spread.
        """
        mean, variance = 0.0, 0.0
        for falls, runs in (
            (np.nansum(other.squares - self.squares, axis=1), self._held.size),
            (other.changing - self.changing, self.changing.size),
        ):
            if falls.size:
                mean += float(falls.sum()) / runs
                spread = float(np.var(falls, ddof=1)) if falls.size > 1 else np.inf
                variance += spread * falls.size / runs**2
        t = mean / np.sqrt(variance) if variance > 0.0 else np.inf * np.sign(mean)
        return 1.0 - self.percent / other.percent, float(t)
