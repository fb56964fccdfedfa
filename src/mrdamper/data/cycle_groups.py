"""Groups of cycles: what is kept of a long record's figures for the page and the summary."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.schema import Json

MOST_GROUPS = 2048
"""Of cycles, in the page and the summary; at twice as many, two neighbours become one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureSummary:
    """A figure over the cycles; first and last are means of the first and the last group."""

    mean: float
    least: float
    most: float
    first: float
    last: float
    slope: float | None  # a cycle, by least squares through the groups; None where there is one group only

    @property
    def trend_per_1000_cycles(self) -> float | None:
        return None if self.slope is None else 1000.0 * self.slope


@dataclass(slots=True)
class Groups:
    """Cycles in groups of equal size, in order: of each figure its mean, least and most.

    Group k holds the cycles from k * size + 1 on; the last may be shorter. A figure that a cycle lacks (NaN)
    does not count in its group. A group's figures do not depend on how the cycles came.
    """

    names: tuple[str, ...]  # of the figures
    size: int = 1
    count: FloatArray = field(default_factory=lambda: np.empty(0))  # cycles in each
    known: FloatArray = field(init=False)  # (groups, figures): cycles that have the figure
    mean: FloatArray = field(init=False)  # NaN where none has
    least: FloatArray = field(init=False)
    most: FloatArray = field(init=False)
    _waiting: list[FloatArray] = field(default_factory=list)  # cycles of a group that is not whole

    def __post_init__(self) -> None:
        none = np.empty((0, len(self.names)))
        self.known, self.mean, self.least, self.most = none, none, none, none

    def feed(self, values: FloatArray) -> None:
        """Take the figures of the next cycles, shape (m, figures)."""
        self._waiting.append(values)
        if sum(map(len, self._waiting)) < self.size:
            return
        every = np.concatenate(self._waiting)
        while len(every) >= self.size:
            room = (2 * MOST_GROUPS - len(self.count)) * self.size
            whole = min(len(every), room) // self.size * self.size
            self._take(every[:whole], self.size)
            every = every[whole:]
            if len(self.count) == 2 * MOST_GROUPS:
                self._halve()
        self._waiting = [every]

    def close(self) -> None:
        """There are no more cycles."""
        left = np.concatenate(self._waiting) if self._waiting else np.empty((0, len(self.names)))
        self._waiting = []
        if len(left):
            self._take(left, len(left))

    @property
    def number(self) -> FloatArray:
        """Mean number of the cycles in each group, the first cycle being 1; shape (groups,)."""
        return np.asarray(self.size * np.arange(len(self.count)) + 0.5 * (self.count + 1.0))

    def summary(self, name: str) -> FigureSummary | None:
        """Return a figure over all cycles; None where no cycle has it."""
        k = self.names.index(name)
        there = self.known[:, k] > 0.0
        if not there.any():
            return None
        mean, weight, number = self.mean[there, k], self.known[there, k], self.number[there]
        from_mean = number - np.average(number, weights=weight)
        slope = None
        if len(mean) > 1:
            slope = float(np.sum(weight * from_mean * mean) / np.sum(weight * from_mean**2))
        return FigureSummary(
            mean=float(np.average(mean, weights=weight)),
            least=float(np.nanmin(self.least[:, k])),
            most=float(np.nanmax(self.most[:, k])),
            first=float(mean[0]),
            last=float(mean[-1]),
            slope=slope,
        )

    def total(self, name: str) -> float:
        """Return the sum of a figure over the cycles that have it."""
        k = self.names.index(name)
        return float(np.nan_to_num(self.mean[:, k]) @ self.known[:, k])

    def curves(self) -> Json:
        """Return each figure's mean as lists; its least and most where groups are of several cycles.

        ``cycle`` is the mean number of a group's cycles; None stands where a figure is not known.
        """
        sides = {"mean": self.mean, "least": self.least, "most": self.most}
        shown = sides if self.size > 1 else {"mean": self.mean}
        return {
            "cycle": self.number.tolist(),
            "figures": {
                name: {side: _listed(values[:, k]) for side, values in shown.items()}
                for k, name in enumerate(self.names)
                if self.known[:, k].any()
            },
        }

    def _take(self, values: FloatArray, size: int) -> None:
        parts = values.reshape(-1, size, len(self.names))
        there = np.isfinite(parts)
        known = there.sum(axis=1, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            mean = np.where(there, parts, 0.0).sum(axis=1) / known
        least = np.where(there, parts, np.inf).min(axis=1)
        most = np.where(there, parts, -np.inf).max(axis=1)
        lacking = known == 0.0
        least[lacking] = most[lacking] = np.nan
        self.count = np.concatenate([self.count, np.full(len(parts), float(size))])
        self.known = np.concatenate([self.known, known])
        self.mean = np.concatenate([self.mean, mean])
        self.least = np.concatenate([self.least, least])
        self.most = np.concatenate([self.most, most])

    def _halve(self) -> None:
        sums = np.nan_to_num(self.mean) * self.known
        self.known = self.known[0::2] + self.known[1::2]
        with np.errstate(invalid="ignore"):
            self.mean = (sums[0::2] + sums[1::2]) / self.known
        self.least = np.fmin(self.least[0::2], self.least[1::2])
        self.most = np.fmax(self.most[0::2], self.most[1::2])
        self.size *= 2
        self.count = np.full(len(self.mean), float(self.size))


def _listed(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]
