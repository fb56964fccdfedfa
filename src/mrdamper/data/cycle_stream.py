"""Figures of every cycle of a record that comes in batches: energy, forces, stiffness, temperature.

What is held is the head of the record, from which the rules are chosen, and then the samples since the last
lower turning point: memory does not grow with the record, and a cycle's figures do not depend on how its
rows came. Nothing is smoothed and nothing is resampled.

A row counts when time, displacement, force and command are numbers. Rows that do not count, times that do not
increase and gaps break the record: no cycle crosses a break.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mrdamper.data.diagnosis.finding import Finding
from mrdamper.data.records import GAP
from mrdamper.data.reversals import TurningPoints
from mrdamper.data.streaming import Batch
from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray

__all__ = ["HEAD_ROWS", "LONGEST_CYCLE", "CycleCounter", "CycleFigures"]

HEAD_ROWS = 1 << 18
"""Rows from which the usual step and the least stroke are chosen; a rest before the motion is passed."""

LONGEST_CYCLE = 1 << 22
"""Samples after which a cycle whose end is not in sight is left out."""

_SWING = 0.05  # of the head's range: smaller to-and-fro does not begin a cycle
_STILL_m = 50e-6  # a motion below is none
_OUTLIERS = 0.1  # per cent at either end that do not count in the head's range


@dataclass(frozen=True, slots=True, eq=False)
class CycleFigures:
    """Figures of cycles, arrays of shape (m,).

    A cycle lasts from one lower turning point of displacement (sample a) to the next (sample b)::

        energy     W = sum_(a <= k < b) (F_k + F_k+1) / 2 * (x_k+1 - x_k) + (F_a + F_b) / 2 * (x_a - x_b)
        stiffness  K = (F_u - (F_a + F_b) / 2) / (x_u - (x_a + x_b) / 2),   u the upper turning point between

    that is the trapezoidal rule, closed by a straight line at the mean of the end forces, and the secant
    through the extremes of displacement. Means are over a <= k < b, so that no sample counts twice.
    """

    row: NDArray[np.int64]  # of the file, of sample a
    start_s: FloatArray
    period_s: FloatArray
    amplitude_m: FloatArray  # half the range of displacement
    energy_J: FloatArray
    stiffness_N_per_m: FloatArray
    highest_force_N: FloatArray
    lowest_force_N: FloatArray
    temperature_K: FloatArray  # mean; NaN where no sample has one
    command: FloatArray  # mean [A or V]
    samples: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.row)

    @classmethod
    def joined(cls, parts: Sequence[CycleFigures]) -> CycleFigures:
        """Return the cycles of several, in order."""
        if len(parts) == 1:
            return parts[0]
        whole = [0, 10]  # row, samples
        none = [np.empty(0, np.int64 if k in whole else np.float64) for k in range(len(fields(cls)))]
        columns = [[none[k], *(getattr(p, f.name) for p in parts)] for k, f in enumerate(fields(cls))]
        return cls(*(np.concatenate(column) for column in columns))


@dataclass(slots=True)
class _Count:
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


class CycleCounter:
    """Rows in, cycles out.

    Parameters
    ----------
    name : of the record, for messages
    force_sign : -1.0 for load cells that count compression as positive
    least_stroke_m : a smaller to-and-fro does not begin a cycle; None: 5 % of the range of displacement in
        the first ``HEAD_ROWS`` rows that move
    """

    def __init__(self, name: str, *, force_sign: float = 1.0, least_stroke_m: float | None = None) -> None:
        if least_stroke_m is not None and not 0.0 < least_stroke_m < math.inf:
            raise InputError(f"least stroke: {least_stroke_m:g} m; expected more than 0")
        self._name, self._sign = name, force_sign
        self._given = least_stroke_m
        self.least_stroke_m: float | None = None  # None until the head is read
        self.step_s: float | None = None  # usual
        self.rows = 0
        self.cycles = 0
        self.broken = 0  # cycles left out because the record breaks in them
        self._energy = 0.0
        self._head: list[Batch] = []
        self._waiting = 0  # rows in it
        self._last_row, self._last_s = -1, math.nan  # that counted
        self._missing, self._back, self._gaps, self._long = _Count(), _Count(), _Count(), _Count()
        self._turns = TurningPoints(0.0)
        self._events: list[int] = []  # turning points from the last lower one on: lower, upper, ...
        self._held: list[FloatArray] = []  # columns of samples, shape (5, n) each
        self._base = 0  # sample of the stretch that the held ones begin with
        self._row = 0  # of the stretch's first sample

    def feed(self, batch: Batch) -> CycleFigures:
        """Take the next rows; return the cycles that are certain now."""
        self.rows += len(batch)
        done: list[CycleFigures] = []
        while len(batch) and self._waits():
            room = HEAD_ROWS - self._waiting
            self._head.append(_cut(batch, slice(0, room)))
            self._waiting += len(self._head[-1])
            batch = _cut(batch, slice(room, None))
            if self._waiting == HEAD_ROWS:
                done.append(self._begin())
        if len(batch):
            done.append(self._count(batch))
        return CycleFigures.joined(done)

    def close(self) -> CycleFigures:
        """Return what is left: the record ends here, and its last cycle is not one.

        Raises
        ------
        InputError
            Time never increases, or no row can be used.
        """
        left = self._begin() if self._head else CycleFigures.joined([])
        if self.step_s is None:
            raise InputError(
                f"{self._name}: none of its {self.rows} rows follows on another; expected time that "
                "increases and numbers in displacement, force and command. Look at it with: mrdamper check"
            )
        return left

    def _waits(self) -> bool:
        return self.least_stroke_m is None

    def _begin(self) -> CycleFigures:
        """Choose the rules from the head and count in it; a head at rest is passed."""
        head = _joined(self._head)
        self._head, self._waiting = [], 0
        usable = _usable(head)
        time, x = head.time[usable], head.displacement[usable]
        if self.step_s is None:
            steps = np.diff(time)
            steps = steps[steps > 0.0]
            if not len(steps):
                self._missing.add(head.time[~usable])
                return CycleFigures.joined([])
            self.step_s = float(np.median(steps))
        low, high = np.percentile(x, [_OUTLIERS, 100.0 - _OUTLIERS]) if len(x) else (0.0, 0.0)
        if self._given is not None:
            self.least_stroke_m = self._given
        elif high - low >= _STILL_m:
            self.least_stroke_m = max(_SWING * float(high - low), _STILL_m)
        else:
            for _ in self._stretches(head):
                pass
            return CycleFigures.joined([])
        self._turns = TurningPoints(self.least_stroke_m)
        return self._count(head)

    def _count(self, batch: Batch) -> CycleFigures:
        done = []
        for fresh, part in self._stretches(batch):
            if fresh:
                self._break_off()
            done.append(self._advance(part))
        found = CycleFigures.joined(done)
        self.cycles += len(found)
        self._energy += float(found.energy_J.sum())
        return found

    def _break_off(self) -> None:
        if self._events:
            self.broken += 1
        self._turns = TurningPoints(self._turns.dead_band)
        self._events, self._held, self._base = [], [], 0

    def _stretches(self, batch: Batch) -> Iterator[tuple[bool, Batch]]:
        """Give the parts of a batch without a break in them, each with whether a break is before it."""
        usable = _usable(batch)
        self._missing.add(batch.time[~usable])
        numbers = np.flatnonzero(usable)
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
        self._back.add(time[late], -steps[late])
        self._gaps.add(time[gap], steps[gap])
        self._last_row, self._last_s = int(rows[-1]), float(time[-1])
        breaks = np.flatnonzero(jumps | late | gap)
        edges = [0, *breaks[breaks > 0].tolist(), len(numbers)]
        fresh = bool(len(breaks)) and breaks[0] == 0
        for low, high in pairwise(edges):
            yield fresh, _cut(batch, slice(int(numbers[low]), int(numbers[high - 1]) + 1))
            fresh = True

    def _advance(self, part: Batch) -> CycleFigures:
        """Return the cycles that end with the next samples of a stretch."""
        warm = part.temperature if part.temperature is not None else np.full(len(part), math.nan)
        if not self._turns.taken:
            self._row = part.row
        self._held.append(
            np.stack([part.time, part.displacement, self._sign * part.force, part.command, warm])
        )
        for sample, side in self._turns.feed(part.displacement):
            if self._events or side < 0:
                self._events.append(sample)
        done = CycleFigures.joined([])
        if len(self._events) > 2:
            done = self._figures()
        self._let_go()
        return done

    def _figures(self) -> CycleFigures:
        """Return the figures of the whole cycles among the turning points, which then are forgotten."""
        columns = self._held[0] if len(self._held) == 1 else np.concatenate(self._held, axis=1)
        lows = np.array(self._events[0::2]) - self._base
        highs = np.array(self._events[1::2]) - self._base
        self._events = self._events[2 * (len(lows) - 1) :]
        a, b, u = lows[:-1], lows[1:], highs[: len(lows) - 1]
        counted = (a >= 0) & (b - a <= LONGEST_CYCLE)
        self._long.add(columns[0, b[~counted]])
        if not counted.any():
            return CycleFigures.joined([])
        a, b, u = a[counted], b[counted], u[counted]
        first, last = int(a[0]), int(b[-1])
        time, x, force, command, warm = columns[:, first : last + 1]
        a, b, u = a - first, b - first, u - first
        # sums over [a, b) of each: the parts between two cycles, where one was left out, fall away
        edges = np.unique(np.concatenate([a, b[:-1]]))
        place = np.searchsorted(edges, a)

        def sums(values: FloatArray) -> FloatArray:
            return np.asarray(np.add.reduceat(values[:last_sample], edges)[place])

        last_sample = len(x) - 1
        n = b - a
        xa, xb, fa, fb = x[a], x[b], force[a], force[b]
        work = 0.5 * (force[1:] + force[:-1]) * np.diff(x)
        known = np.isfinite(warm)
        with np.errstate(invalid="ignore"):
            mean_warm = sums(np.where(known, warm, 0.0)) / sums(known.astype(np.float64))
        high_x = np.maximum(np.maximum.reduceat(x[:-1], edges)[place], xb)
        low_x = np.minimum(np.minimum.reduceat(x[:-1], edges)[place], xb)
        return CycleFigures(
            row=(self._row + self._base + first + a).astype(np.int64),
            start_s=time[a],
            period_s=time[b] - time[a],
            amplitude_m=0.5 * (high_x - low_x),
            energy_J=sums(work) + 0.5 * (fa + fb) * (xa - xb),
            stiffness_N_per_m=(force[u] - 0.5 * (fa + fb)) / (x[u] - 0.5 * (xa + xb)),
            highest_force_N=np.maximum(np.maximum.reduceat(force[:-1], edges)[place], fb),
            lowest_force_N=np.minimum(np.minimum.reduceat(force[:-1], edges)[place], fb),
            temperature_K=mean_warm,
            command=sums(command) / n,
            samples=n.astype(np.int64),
        )

    def _let_go(self) -> None:
        """Forget the samples before the cycle that is open, or before where one may begin."""
        taken = self._turns.taken
        needed = taken
        begins = [*self._events[:1], *([] if (low := self._turns.pending_low) is None else [low])]
        for sample in begins:
            if taken - sample <= LONGEST_CYCLE:
                needed = sample
                break
        while self._held and self._base + self._held[0].shape[1] <= needed:
            self._base += self._held.pop(0).shape[1]
        if self._held and self._base < needed:
            self._held[0] = self._held[0][:, needed - self._base :].copy()
            self._base = needed

    def findings(self) -> list[Finding]:
        """Return what is wrong with the record, and what it did to the cycles."""
        found = []
        out = "The cycles it touches are left out"

        def add(
            kind: str, channel: str, count: _Count, said: str, remedy: str, size: float, unit: str
        ) -> None:
            if count.times:
                ends = [None if math.isnan(t) else t for t in (count.from_s, count.to_s)]
                found.append(
                    Finding(
                        kind=kind,
                        severity="warning",
                        channel=channel,
                        size=size,
                        unit=unit,
                        from_s=ends[0],
                        to_s=ends[1],
                        found=said,
                        effect=out,
                        remedy=remedy,
                        run=self._name,
                    )
                )

        missing, back, gaps, long = self._missing, self._back, self._gaps, self._long
        add(
            "missing_rows", "", missing,
            f"{missing.times} rows lack a number in time, displacement, force or command",
            "Look at what the recorder wrote there", float(missing.times), "rows",
        )  # fmt: skip
        add(
            "time_back", "time", back,
            f"Time does not increase at {back.times} rows; it goes back by up to {back.most:.6g} s",
            "Recordings that were put together belong in files of their own", back.most, "s",
        )  # fmt: skip
        add(
            "gap", "time", gaps,
            f"{gaps.times} gaps in time, the longest of {gaps.most:.6g} s",
            "Look for lost samples, or pauses of the rig", gaps.most, "s",
        )  # fmt: skip
        add(
            "long_cycle", "displacement", long,
            f"{long.times} cycles have more than {LONGEST_CYCLE} samples",
            "Cut long rests out of the record", float(long.times), "cycles",
        )  # fmt: skip
        if self.cycles and self._energy < 0.0:
            found.append(
                Finding(
                    kind="force_sign",
                    severity="fault",
                    channel="force",
                    size=self._energy,
                    unit="J",
                    found=f"The cycles give off {-self._energy:.4g} J in all, where a damper takes up energy",
                    effect="Energies and stiffness have the wrong sign",
                    remedy="Turn the force with --flip-force",
                    run=self._name,
                )
            )
        if not self.cycles:
            least = self.least_stroke_m
            found.append(
                Finding(
                    kind="no_cycles",
                    severity="fault",
                    channel="displacement",
                    found="No whole cycle was found"
                    + ("; the record is at rest" if least is None else f" of more than {1e3 * least:.4g} mm"),
                    effect="There are no figures",
                    remedy="Look at displacement and its unit; --least-stroke-mm counts smaller cycles",
                    run=self._name,
                )
            )
        return found


def _usable(batch: Batch) -> NDArray[np.bool_]:
    """Return which rows count, shape (n,)."""
    usable = np.isfinite(batch.time) & np.isfinite(batch.displacement)
    return np.asarray(usable & np.isfinite(batch.force) & np.isfinite(batch.command))


def _cut(batch: Batch, rows: slice) -> Batch:
    low = rows.indices(len(batch))[0]
    return Batch(
        batch.row + low,
        batch.time[rows],
        batch.displacement[rows],
        batch.force[rows],
        batch.command[rows],
        None,
        None if batch.temperature is None else batch.temperature[rows],
    )


def _joined(parts: Sequence[Batch]) -> Batch:
    if len(parts) == 1:
        return parts[0]
    warm = [part.temperature for part in parts if part.temperature is not None]
    return Batch(
        parts[0].row,
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.displacement for part in parts]),
        np.concatenate([part.force for part in parts]),
        np.concatenate([part.command for part in parts]),
        None,
        np.concatenate(warm) if len(warm) == len(parts) else None,
    )
