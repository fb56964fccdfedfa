"""Segments of a record: which of its rows count, and where it breaks off.

A row counts when time, displacement, force and command are numbers of a possible size. Rows that do not
count, times that do not increase and gaps break the record: what follows is a segment of its own. Decided row
by row, so that it does not matter how the rows come.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import Batch
from mrdamper.data.finding import Finding
from mrdamper.data.records import GAP
from mrdamper.quantities import QUANTITIES

HEAD_ROWS = 1 << 18
"""Rows from which rules are chosen that then hold to the record's end; a rest before the motion is passed."""

STILL_m = 50e-6  # a motion below is none
_OUTLIERS = 0.1  # per cent at either end that do not count in a range


@dataclass(slots=True)
class Count:
    """How often something was met: where first and last, and how large at most."""

    times: int = 0
    from_s: float = math.nan
    to_s: float = math.nan
    most: float = 0.0

    def add(self, at_s: FloatArray, sizes: FloatArray | None = None) -> None:
        if not len(at_s):
            return
        self.times += len(at_s)
        known = at_s[np.isfinite(at_s)]
        if len(known):
            self.from_s = float(known[0]) if math.isnan(self.from_s) else self.from_s
            self.to_s = float(known[-1])
        if sizes is not None:
            self.most = max(self.most, float(sizes.max()))

    def finding(
        self, kind: str, channel: str, said: str, remedy: str, size: float, unit: str
    ) -> list[Finding]:
        """Return what was met as a finding on a record of cycles; nothing when it never was."""
        if not self.times:
            return []
        ends = [None if math.isnan(t) else t for t in (self.from_s, self.to_s)]
        return [
            Finding(
                kind=kind,
                severity="warning",
                channel=channel,
                size=size,
                unit=unit,
                from_s=ends[0],
                to_s=ends[1],
                found=said,
                effect="The cycles it touches are left out",
                remedy=remedy,
            )
        ]


@dataclass(slots=True)
class Head:
    """The first rows of a record, held back until rules are chosen from them."""

    rows: int = HEAD_ROWS
    _parts: list[Batch] = field(default_factory=list)
    _held: int = 0

    def __bool__(self) -> bool:
        return self._held > 0

    @property
    def full(self) -> bool:
        return self._held >= self.rows

    def take(self, batch: Batch) -> Batch:
        """Take as many rows as there is room for; return the others."""
        part = batch.part(slice(0, self.rows - self._held))
        self._parts.append(part)
        self._held += len(part)
        return batch.part(slice(len(part), None))

    def release(self) -> Batch:
        """Return the rows that are held, and hold none."""
        whole = Batch.joined(self._parts)
        self._parts, self._held = [], 0
        return whole


@dataclass(slots=True)
class Segmenter:
    """Rows in, parts of segments out; it counts what breaks the record.

    ``step_s`` is the usual step, by which a gap is one; None: there are no gaps yet.
    """

    step_s: float | None = None
    missing: Count = field(default_factory=Count)
    back: Count = field(default_factory=Count)
    gaps: Count = field(default_factory=Count)
    _last_row: int = -1
    _last_s: float = math.nan  # that counted

    def measure(self, head: Batch) -> float:
        """Return the range of the motion [m] in a head; the usual step is taken from it, unless it is known.

        0.0 where the head is at rest, or where no row follows on another.
        """
        counted = usable(head)
        if self.step_s is None:
            self.step_s = usual_step(head.time[counted])
        return 0.0 if self.step_s is None else moved_by(head.displacement[counted])

    def skip(self, batch: Batch) -> None:
        """Take rows of which nothing is wanted but what breaks the record."""
        for _ in self.step_batch(batch):
            pass

    def step_batch(self, batch: Batch) -> Iterator[tuple[bool, Batch]]:
        """Give the parts of a batch without a break in them, each with whether a break is before it."""
        counted = usable(batch)
        self.missing.add(batch.time[~counted])
        numbers = np.flatnonzero(counted)
        if not len(numbers):
            return
        time = batch.time[numbers]
        rows = batch.row + numbers
        steps = np.diff(time, prepend=self._last_s)
        jumps = np.diff(rows, prepend=self._last_row) > 1
        if self._last_row < 0:
            jumps[0], steps[0] = True, 0.0
        late = ~jumps & ~(steps > 0.0)
        gap = ~jumps & (steps > GAP * (self.step_s or math.inf))
        self.back.add(time[late], -steps[late])
        self.gaps.add(time[gap], steps[gap])
        self._last_row, self._last_s = int(rows[-1]), float(time[-1])
        breaks = np.flatnonzero(jumps | late | gap)
        edges = [0, *breaks[breaks > 0].tolist(), len(numbers)]
        fresh = bool(len(breaks)) and breaks[0] == 0
        for low, high in pairwise(edges):
            yield fresh, batch.part(slice(int(numbers[low]), int(numbers[high - 1]) + 1))
            fresh = True

    def findings(self) -> list[Finding]:
        """Return what breaks the record."""
        missing, back, gaps = self.missing, self.back, self.gaps
        return [
            *missing.finding(
                "missing_rows", "",
                f"{missing.times} rows lack a number in time, displacement, force or command, or hold one of "
                "an impossible size",
                "Look at what the recorder wrote there", float(missing.times), "rows",
            ),
            *back.finding(
                "time_back", "time",
                f"Time does not increase at {back.times} rows; it goes back by up to {back.most:.6g} s",
                "Recordings that were put together belong in files of their own", back.most, "s",
            ),
            *gaps.finding(
                "gap", "time", f"{gaps.times} gaps in time, the longest of {gaps.most:.6g} s",
                "Look for lost samples, or pauses of the rig", gaps.most, "s",
            ),
        ]  # fmt: skip


def usable(batch: Batch) -> NDArray[np.bool_]:
    """Return which rows count, shape (n,)."""
    counted = np.isfinite(batch.time)
    for values, role in (
        (batch.displacement, "displacement"),
        (batch.force, "force"),
        (batch.command, "voltage"),
    ):
        quantity = QUANTITIES[role]  # of a command the wider range
        counted &= (values >= quantity.low) & (values <= quantity.high)
    return np.asarray(counted)


def usual_step(time: FloatArray) -> float | None:
    """Return the median of the steps [s] that go on; None where none does."""
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else None


def moved_by(displacement: FloatArray) -> float:
    """Return the range [m] of a displacement but for outliers; 0.0 where it is that of a rest."""
    if not len(displacement):
        return 0.0
    low, high = np.percentile(displacement, [_OUTLIERS, 100.0 - _OUTLIERS])
    return float(high - low) if high - low >= STILL_m else 0.0
