"""Figures of every cycle of a motion: energy, forces, stiffness, temperature.

Rows come in batches; a whole run is one (:func:`cycles`). What is held is the head of a record, from which
the rules are chosen, and then the samples since the last lower turning point: memory does not grow with the
record, and a cycle's figures do not depend on how its rows came. Nothing is smoothed or resampled.

No cycle crosses a break of the record (``segments``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core import TurningPoints
from mrdamper.data.batches import Batch
from mrdamper.data.finding import Finding
from mrdamper.data.motion import SWING
from mrdamper.data.prepare import PreparedRun
from mrdamper.data.segments import HEAD_ROWS, Count, Head, Segmenter, STILL_m
from mrdamper.errors import InputError

LONGEST_CYCLE = 1 << 22
"""Samples after which a cycle whose end is not in sight is left out."""


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

    @property
    def end(self) -> NDArray[np.int64]:
        """Row of sample b: of the last sample, which is the first of the next cycle."""
        return self.row + self.samples

    @property
    def stroke_m(self) -> FloatArray:
        return 2.0 * self.amplitude_m

    def where(self, chosen: NDArray[np.bool_]) -> CycleFigures:
        """Return some of the cycles."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence[CycleFigures]) -> CycleFigures:
        """Return the cycles of several, in order."""
        if len(parts) == 1:
            return parts[0]
        none = {f.name: np.empty(0, np.int64 if f.name in _WHOLE else np.float64) for f in fields(cls)}
        return cls(
            **{name: np.concatenate([none[name], *(getattr(part, name) for part in parts)]) for name in none}
        )


_WHOLE = ("row", "samples")  # counted


def cycles(prepared: PreparedRun) -> CycleFigures:
    """Return the cycles of a prepared run after the start of its score; a cycle's row is its first sample.

    To-and-fro below 5 % of the range of displacement, or below the dead band, does not begin a cycle.
    """
    samples = prepared.samples
    least_stroke_m = max(SWING * float(np.ptp(samples.displacement)), prepared.dead_band_m)
    found = SegmentCycles(0, least_stroke_m, longest_cycle=len(samples)).step_batch(samples)
    return found.where(found.row >= prepared.scored_from)


class CycleCounter:
    """Cycles of a record: give it the batches, in order, then close it.

    Parameters
    ----------
    name : of the record, for messages
    least_stroke_m : a smaller to-and-fro does not begin a cycle; None: 5 % of the range of displacement in
        the first ``head_rows`` rows that move
    longest_cycle : samples after which a cycle whose end is not in sight is left out
    """

    def __init__(
        self,
        name: str,
        *,
        least_stroke_m: float | None = None,
        head_rows: int = HEAD_ROWS,
        longest_cycle: int = LONGEST_CYCLE,
    ) -> None:
        if least_stroke_m is not None and not 0.0 < least_stroke_m < math.inf:
            raise InputError(place="least stroke", found=f"{least_stroke_m:g} m", expected="more than 0")
        self._name = name
        self._given, self._longest = least_stroke_m, longest_cycle
        self.least_stroke_m: float | None = None  # None until the head is read
        self.rows = 0
        self.cycles = 0
        self.broken = 0  # cycles left out because the record breaks in them
        self._energy = 0.0
        self._head = Head(head_rows)
        self._segmenter, self._long = Segmenter(), Count()
        self._segment: SegmentCycles | None = None

    @property
    def step_s(self) -> float | None:
        """The usual step; None until the head is read."""
        return self._segmenter.step_s

    def step_batch(self, batch: Batch) -> CycleFigures:
        """Take the next rows; return the cycles that are certain now."""
        self.rows += len(batch)
        done: list[CycleFigures] = []
        while len(batch) and self.least_stroke_m is None:
            batch = self._head.take(batch)
            if self._head.full:
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
                place=self._name,
                found=f"none of its {self.rows} rows follows on another",
                expected=(
                    "time that increases, and numbers of a possible size in displacement, force and command "
                    "(their units?)"
                ),
            )
        return left

    def _begin(self) -> CycleFigures:
        """Choose the rules from the head and count in it; a head at rest is passed."""
        head = self._head.release()
        moved = self._segmenter.measure(head)
        if self.step_s is None or not (moved or self._given):
            self._segmenter.skip(head)
            return CycleFigures.joined([])
        self.least_stroke_m = self._given or max(SWING * moved, STILL_m)
        return self._count(head)

    def _count(self, batch: Batch) -> CycleFigures:
        done = []
        for fresh, part in self._segmenter.step_batch(batch):
            if fresh or self._segment is None:
                self.broken += self._segment is not None and self._segment.inside
                least_stroke_m = self.least_stroke_m or STILL_m
                self._segment = SegmentCycles(
                    part.row, least_stroke_m, longest_cycle=self._longest, too_long=self._long
                )
            done.append(self._segment.step_batch(part))
        found = CycleFigures.joined(done)
        self.cycles += len(found)
        self._energy += float(found.energy_J.sum())
        return found

    def findings(self) -> list[Finding]:
        """Return what is wrong with the record, and what it did to the cycles."""
        long = self._long
        found = [
            *self._segmenter.findings(),
            *long.finding(
                "long_cycle", "displacement", f"{long.times} cycles have more than {self._longest} samples",
                "Cut long rests out of the record", float(long.times), "cycles",
            ),
        ]  # fmt: skip
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
                )
            )
        return [replace(each, run=self._name) for each in found]


class SegmentCycles:
    """Cycles of rows without a break in them; the last lower turning point begins the cycle that is open.

    Parameters
    ----------
    row : of the file, of the segment's first sample
    least_stroke_m : a smaller to-and-fro does not begin a cycle
    longest_cycle : samples after which a cycle whose end is not in sight is left out
    too_long : counts those
    """

    def __init__(
        self, row: int, least_stroke_m: float, *, longest_cycle: int, too_long: Count | None = None
    ) -> None:
        self._row, self._longest = row, longest_cycle
        self._too_long = Count() if too_long is None else too_long
        self._turns = TurningPoints(least_stroke_m)
        self._events: list[int] = []  # turning points from the last lower one on: lower, upper, ...
        self._held: list[Batch] = []
        self._base = 0  # sample of the segment that the held ones begin with

    @property
    def inside(self) -> bool:
        """Tell whether a cycle is open."""
        return bool(self._events)

    @property
    def held(self) -> int:
        """Samples in memory."""
        return sum(map(len, self._held))

    def step_batch(self, part: Batch) -> CycleFigures:
        """Take the next samples; return the cycles that end with them."""
        self._held.append(part)
        turns, sides = self._turns.step_batch(part.displacement)
        known = 0 if self._events or not len(sides) or sides[0] < 0 else 1  # a lower one is the first
        self._events += turns[known:].tolist()
        done = CycleFigures.joined([])
        if len(self._events) > 2:
            done = self._figures()
        self._let_go()
        return done

    def _figures(self) -> CycleFigures:
        """Return the figures of the whole cycles among the turning points, which then are forgotten."""
        samples = Batch.joined(self._held)
        lows = np.array(self._events[0::2]) - self._base
        highs = np.array(self._events[1::2]) - self._base
        self._events = self._events[2 * (len(lows) - 1) :]
        a, b, u = lows[:-1], lows[1:], highs[: len(lows) - 1]
        counted = (a >= 0) & (b - a <= self._longest)
        self._too_long.add(samples.time[b[~counted]])
        if not counted.any():
            return CycleFigures.joined([])
        a, b, u = a[counted], b[counted], u[counted]
        first = int(a[0])
        row = (self._row + self._base + a).astype(np.int64)
        inner = samples.part(slice(first, int(b[-1]) + 1))
        return _figures_of(inner, row, a - first, b - first, u - first)

    def _let_go(self) -> None:
        """Forget the samples before the cycle that is open, or before where one may begin."""
        taken = self._turns.taken
        needed = taken
        begins = [*self._events[:1], *([] if (low := self._turns.pending_low) is None else [low])]
        for sample in begins:
            if taken - sample <= self._longest:
                needed = sample
                break
        while self._held and self._base + len(self._held[0]) <= needed:
            self._base += len(self._held.pop(0))
        if self._base < needed:
            self._held[0] = self._held[0].part(slice(needed - self._base, None)).each(np.copy)
            self._base = needed


def _figures_of(
    samples: Batch,
    row: NDArray[np.int64],
    a: NDArray[np.intp],
    b: NDArray[np.intp],
    u: NDArray[np.intp],
) -> CycleFigures:
    """Return the figures of cycles from samples a to b with the upper turning points u between."""
    over = _Over(samples.displacement, a, b)
    n = b - a
    x, force = samples.displacement, samples.force
    mean_temperature = np.full(len(n), math.nan)
    if samples.temperature is not None:
        known = np.isfinite(samples.temperature)
        with np.errstate(invalid="ignore"):
            summed = over.sums(np.where(known, samples.temperature, 0.0))
            mean_temperature = summed / over.sums(known.astype(np.float64))
    return CycleFigures(
        row=row,
        start_s=samples.time[a],
        period_s=samples.time[b] - samples.time[a],
        amplitude_m=0.5 * (over.most(x) - over.least(x)),
        energy_J=over.energy(force),
        stiffness_N_per_m=(force[u] - 0.5 * (force[a] + force[b])) / (x[u] - 0.5 * (x[a] + x[b])),
        highest_force_N=over.most(force),
        lowest_force_N=over.least(force),
        temperature_K=mean_temperature,
        command=over.sums(samples.command) / n,
        samples=n.astype(np.int64),
    )


class _Over:
    """Sums and extremes over cycles a <= k < b of samples, b belonging to the next one."""

    def __init__(self, x: FloatArray, a: NDArray[np.intp], b: NDArray[np.intp]) -> None:
        # the parts between two cycles, where one was left out, fall away
        self._edges = np.unique(np.concatenate([a, b[:-1]]))
        self._place = np.searchsorted(self._edges, a)
        self._a, self._b, self._x = a, b, x
        self._moves = np.diff(x)

    def sums(self, values: FloatArray) -> FloatArray:
        return self._reduced(np.add.reduceat, values)

    def most(self, values: FloatArray) -> FloatArray:
        """Return the largest, that of b among them."""
        return np.maximum(self._reduced(np.maximum.reduceat, values), values[self._b])

    def least(self, values: FloatArray) -> FloatArray:
        """Return the least, that of b among them."""
        return np.minimum(self._reduced(np.minimum.reduceat, values), values[self._b])

    def energy(self, force: FloatArray) -> FloatArray:
        """Return the energy [J] of a force by the formula of ``CycleFigures``."""
        work = self.sums(0.5 * (force[1:] + force[:-1]) * self._moves)
        ends = 0.5 * (force[self._a] + force[self._b])
        return np.asarray(work + ends * (self._x[self._a] - self._x[self._b]))

    def _reduced(self, how: Callable[..., FloatArray], values: FloatArray) -> FloatArray:
        return np.asarray(how(values[: len(self._moves)], self._edges)[self._place])
