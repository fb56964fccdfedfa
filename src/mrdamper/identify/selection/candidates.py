"""Candidates of the model selection: a law with terms, its fit, and its cross-validation errors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.models.damper import Damper


@dataclass(frozen=True, slots=True)
class Candidate:
    """A law with a set of terms (optional groups of coefficients)."""

    law: str
    terms: tuple[str, ...]

    @property
    def title(self) -> str:
        return " + ".join((self.law, *self.terms))

    def with_term(self, name: str) -> Candidate:
        return replace(self, terms=(*self.terms, name))

    def without_term(self, name: str) -> Candidate:
        return replace(self, terms=tuple(term for term in self.terms if term != name))


@dataclass(frozen=True, slots=True, eq=False)
class FittedCandidate:
    """A candidate (law with terms) fitted to all windows, and the training error [%] of the fit."""

    candidate: Candidate
    damper: Damper
    free_parameters: int
    training_rms_percent: float
    cpu_s: float


@dataclass(frozen=True, slots=True, eq=False)
class ValidatedCandidate:
    """A fitted candidate (law with terms) with its errors on held-out windows.

    The total error is the mean of two errors: on runs with constant current, and on runs with changing
    current. The two kinds of runs have equal weight because most laboratory runs have constant current, but a
    controller changes the current all the time. Arrays have one value per held-out window, except
    ``changing_percent_by_run``.
    """

    fitted: FittedCandidate  # fit to all windows
    dampers: tuple[Damper, ...]  # one fit per held-out fold, in the order of the folds
    squared_errors: FloatArray  # error of each window [%^2]
    fractions: FloatArray  # weight of each window
    folds: NDArray[np.intp]  # index of the fold that holds out the window
    runs: NDArray[np.intp]  # index of the run of each window
    cpu_s: float
    changing_percent_by_run: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def cv_percent_by_run(self) -> FloatArray:
        """Error [%] of each held-out run with constant current."""
        total = np.bincount(self.runs, weights=self.fractions * self.squared_errors)
        weight = np.bincount(self.runs, weights=self.fractions)
        return np.asarray(np.sqrt(total[weight > 0.0] / weight[weight > 0.0]))

    @property
    def cv_rms_percent(self) -> float:
        """Root of the mean squared error [%] of held-out windows and of runs with changing current."""
        means = [float(self.fractions @ self.squared_errors / self.fractions.sum())]
        if self.changing_percent_by_run.size:
            means.append(float(np.mean(self.changing_percent_by_run**2)))
        return float(np.sqrt(np.mean(means)))

    @property
    def training_percent_max(self) -> float:
        """Training error [%] above which another candidate is hardly ever better.

        The reason is that a cross-validation error is rarely smaller than the training error.
        """
        return self.cv_rms_percent * (np.sqrt(2.0) if self.changing_percent_by_run.size else 1.0)

    @property
    def cv_mean_percent(self) -> float:
        """Mean error [%] of held-out runs. The forward selection compares terms by this error.

        The root mean square is not used because a few runs with large errors for all candidates would
        dominate it. Examples are runs at zero current, in which only friction acts.
        """
        weights, errors_percent, _ = self._run_errors()
        means = [float(weights @ errors_percent)]
        if self.changing_percent_by_run.size:
            means.append(float(self.changing_percent_by_run.mean()))
        return float(np.mean(means))

    def _run_errors(self) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
        """Return weight, error [%] and fold number for each combination of a held-out run and a fold."""
        pairs = np.stack([self.runs, self.folds])
        _, first, part = np.unique(pairs, axis=1, return_index=True, return_inverse=True)
        part = part.reshape(-1)
        weights = np.bincount(part, weights=self.fractions)
        squares = np.bincount(part, weights=self.fractions * self.squared_errors) / weights
        return weights / weights.sum(), np.sqrt(squares), self.folds[first]

    def gain_relative_to(self, other: ValidatedCandidate) -> tuple[float, float]:
        """Return the relative decrease of the mean error versus ``other``, and its t statistic.

        The t statistic is computed from the error differences of the folds and of the runs with changing
        current. The variance is estimated separately for folds and for runs.
        """
        weights, errors_percent, folds = self._run_errors()
        differences = weights * (other._run_errors()[1] - errors_percent)
        by_fold = np.bincount(folds, weights=differences)
        changing = other.changing_percent_by_run - self.changing_percent_by_run
        mean, variance = 0.0, 0.0
        for samples in (by_fold, changing / max(changing.size, 1)):
            if samples.size:
                mean += float(samples.sum())
                spread = float(np.var(samples, ddof=1)) if samples.size > 1 else np.inf
                variance += spread * samples.size
        t = mean / np.sqrt(variance) if variance > 0.0 else np.inf * np.sign(mean)
        return 1.0 - self.cv_mean_percent / other.cv_mean_percent, float(t)
