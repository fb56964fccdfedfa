"""Candidates of a selection: a law with some of its groups, its fit, and its errors on what was left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.models.damper import Damper

__all__ = ["Candidate", "Fitted", "Judged"]


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

    ``squares`` are the squared errors [%^2] of each fold's runs, NaN where the fold does not hold the run.
    """

    fitted: Fitted
    squares: FloatArray  # (folds, runs)
    dampers: tuple[Damper, ...]  # of the fits without each fold
    cpu_s: float

    @property
    def by_run(self) -> FloatArray:
        """The errors [%] of the runs that were left out, once each."""
        known = ~np.isnan(self.squares).all(axis=0)
        return np.asarray(np.sqrt(np.nansum(self.squares[:, known], axis=0)))

    @property
    def percent(self) -> float:
        """The root of the mean squared error [%] on what was left out."""
        return float(np.sqrt(np.mean(self.by_run**2)))

    def gain_over(self, other: Judged) -> tuple[float, float]:
        """Return by how much of the other's error this one's is lower, and the mean fall over its error.

        The second is Student's t of the falls of squared error, over the folds.
        """
        falls = np.nansum(other.squares - self.squares, axis=1)
        spread = float(np.std(falls, ddof=1)) / np.sqrt(len(falls)) if len(falls) > 1 else np.inf
        t = float(np.mean(falls)) / spread if spread > 0.0 else np.inf * np.sign(float(np.mean(falls)))
        return 1.0 - self.percent / other.percent, t
