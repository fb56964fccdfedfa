"""Figures of every cycle of a record that comes in batches: energy, forces, stiffness, temperature.

What is held is the head of the record, from which the rules are chosen, and then the samples since the last
lower turning point: memory does not grow with the record, and a cycle's figures do not depend on how its
rows came. Nothing is smoothed and nothing is resampled.

No cycle crosses a break of the record (``stretches``). Where a model's force comes with the rows
(``identify.replay``), its figures stand beside the measured ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core import TurningPoints
from mrdamper.data.diagnosis.finding import Finding
from mrdamper.data.segments import HEAD_ROWS, Count, Splitter, STILL_m, moved_by, usable, usual_step
from mrdamper.data.streaming import Batch
from mrdamper.errors import InputError

__all__ = ["LONGEST_CYCLE", "CycleCounter", "CycleFigures", "ModelFigures"]

LONGEST_CYCLE = 1 << 22
"""Samples after which a cycle whose end is not in sight is left out."""

_SWING = 0.05  # of the head's range: smaller to-and-fro does not begin a cycle


@dataclass(frozen=True, slots=True, eq=False)
class ModelFigures:
    """What a model's force comes to over cycles, arrays of shape (m,); NaN where a sample has none.

    Energy and extremes as those of the measured force, over the same samples and the same displacement. The
    error is the model's force less the measured one, over a <= k < b.
    """

    energy_J: FloatArray
    highest_force_N: FloatArray
    lowest_force_N: FloatArray
    error_N: FloatArray  # RMS
    mean_error_N: FloatArray


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
    mean_force_N: FloatArray
    force_spread_N: FloatArray  # standard deviation
    model: ModelFigures | None = None

    def __len__(self) -> int:
        return len(self.row)

    @classmethod
    def joined(cls, parts: Sequence[CycleFigures]) -> CycleFigures:
        """Return the cycles of several, in order."""
        if len(parts) == 1:
            return parts[0]
        none = {f.name: np.empty(0, np.int64 if f.name in _WHOLE else np.float64) for f in fields(cls)}
        columns = {
            name: np.concatenate([none[name], *(getattr(part, name) for part in parts)])
            for name in none
            if name != "model"
        }
        models = [part.model for part in parts if part.model is not None]
        joined = {
            f.name: np.concatenate([getattr(model, f.name) for model in models])
            for f in fields(ModelFigures)
            if models
        }
        return cls(**columns, model=ModelFigures(**joined) if models else None)


_WHOLE = ("row", "samples")  # counted


class CycleCounter:
    """Rows in, cycles out.

    Parameters
    ----------
    name : of the record, for messages
    force_sign : -1.0 for load cells that count compression as positive
    least_stroke_m : a smaller to-and-fro does not begin a cycle; None: 5 % of the range of displacement in
        the first ``head_rows`` rows that move
    longest_cycle : samples after which a cycle whose end is not in sight is left out
    """

    def __init__(
        self,
        name: str,
        *,
        force_sign: float = 1.0,
        least_stroke_m: float | None = None,
        head_rows: int = HEAD_ROWS,
        longest_cycle: int = LONGEST_CYCLE,
    ) -> None:
        if least_stroke_m is not None and not 0.0 < least_stroke_m < math.inf:
            raise InputError(f"least stroke: {least_stroke_m:g} m; expected more than 0")
        self._name, self._sign = name, force_sign
        self._given, self._head_rows, self._longest = least_stroke_m, head_rows, longest_cycle
        self.least_stroke_m: float | None = None  # None until the head is read
        self.rows = 0
        self.cycles = 0
        self.broken = 0  # cycles left out because the record breaks in them
        self._energy = 0.0
        self._head: list[Batch] = []
        self._waiting = 0  # rows in it
        self._splitter, self._long = Splitter(), Count()
        self._turns = TurningPoints(0.0)
        self._events: list[int] = []  # turning points from the last lower one on: lower, upper, ...
        self._held: list[FloatArray] = []  # columns of samples, shape (5 or 6, n) each
        self._base = 0  # sample of the stretch that the held ones begin with
        self._row = 0  # of the stretch's first sample

    @property
    def step_s(self) -> float | None:
        """The usual step; None until the head is read."""
        return self._splitter.step_s

    def feed(self, batch: Batch) -> CycleFigures:
        """Take the next rows; return the cycles that are certain now."""
        self.rows += len(batch)
        done: list[CycleFigures] = []
        while len(batch) and self._waits():
            room = self._head_rows - self._waiting
            self._head.append(batch.part(slice(0, room)))
            self._waiting += len(self._head[-1])
            batch = batch.part(slice(room, None))
            if self._waiting == self._head_rows:
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
                "increases, and numbers of a possible size in displacement, force and command (their units?)"
            )
        return left

    def _waits(self) -> bool:
        return self.least_stroke_m is None

    def _begin(self) -> CycleFigures:
        """Choose the rules from the head and count in it; a head at rest is passed."""
        head = Batch.joined(self._head)
        self._head, self._waiting = [], 0
        counted = usable(head)
        if self._splitter.step_s is None:
            self._splitter.step_s = usual_step(head.time[counted])
            if self._splitter.step_s is None:
                self._splitter.missing.add(head.time[~counted])
                return CycleFigures.joined([])
        moved = moved_by(head.displacement[counted])
        if self._given is not None:
            self.least_stroke_m = self._given
        elif moved:
            self.least_stroke_m = max(_SWING * moved, STILL_m)
        else:
            for _ in self._splitter.feed(head):
                pass
            return CycleFigures.joined([])
        self._turns = TurningPoints(self.least_stroke_m)
        return self._count(head)

    def _count(self, batch: Batch) -> CycleFigures:
        done = []
        for fresh, part in self._splitter.feed(batch):
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

    def _advance(self, part: Batch) -> CycleFigures:
        """Return the cycles that end with the next samples of a stretch."""
        warm = part.temperature if part.temperature is not None else np.full(len(part), math.nan)
        if not self._turns.taken:
            self._row = part.row
        columns = [part.time, part.displacement, self._sign * part.force, part.command, warm]
        self._held.append(np.stack([*columns, *([] if part.modelled is None else [part.modelled])]))
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
        columns = self._held[0] if len(self._held) == 1 else np.concatenate(self._held, axis=1)
        lows = np.array(self._events[0::2]) - self._base
        highs = np.array(self._events[1::2]) - self._base
        self._events = self._events[2 * (len(lows) - 1) :]
        a, b, u = lows[:-1], lows[1:], highs[: len(lows) - 1]
        counted = (a >= 0) & (b - a <= self._longest)
        self._long.add(columns[0, b[~counted]])
        if not counted.any():
            return CycleFigures.joined([])
        a, b, u = a[counted], b[counted], u[counted]
        first, last = int(a[0]), int(b[-1])
        time, x, force, command, warm, *modelled = columns[:, first : last + 1]
        a, b, u = a - first, b - first, u - first
        over = _Over(x, a, b)
        n = b - a
        xa, xb, fa, fb = x[a], x[b], force[a], force[b]
        known = np.isfinite(warm)
        with np.errstate(invalid="ignore"):
            mean_warm = over.sums(np.where(known, warm, 0.0)) / over.sums(known.astype(np.float64))
        mean = over.sums(force) / n
        square = over.sums(force * force) / n
        return CycleFigures(
            row=(self._row + self._base + first + a).astype(np.int64),
            start_s=time[a],
            period_s=time[b] - time[a],
            amplitude_m=0.5 * (over.most(x) - over.least(x)),
            energy_J=over.energy(force),
            stiffness_N_per_m=(force[u] - 0.5 * (fa + fb)) / (x[u] - 0.5 * (xa + xb)),
            highest_force_N=over.most(force),
            lowest_force_N=over.least(force),
            temperature_K=mean_warm,
            command=over.sums(command) / n,
            samples=n.astype(np.int64),
            mean_force_N=mean,
            force_spread_N=np.sqrt(np.maximum(square - mean * mean, 0.0)),
            model=_of_model(over, modelled[0], force, n) if modelled else None,
        )

    def _let_go(self) -> None:
        """Forget the samples before the cycle that is open, or before where one may begin."""
        taken = self._turns.taken
        needed = taken
        begins = [*self._events[:1], *([] if (low := self._turns.pending_low) is None else [low])]
        for sample in begins:
            if taken - sample <= self._longest:
                needed = sample
                break
        while self._held and self._base + self._held[0].shape[1] <= needed:
            self._base += self._held.pop(0).shape[1]
        if self._held and self._base < needed:
            self._held[0] = self._held[0][:, needed - self._base :].copy()
            self._base = needed

    def findings(self) -> list[Finding]:
        """Return what is wrong with the record, and what it did to the cycles."""
        long = self._long
        found = [
            *self._splitter.findings(),
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


def _of_model(over: _Over, modelled: FloatArray, force: FloatArray, n: NDArray[np.intp]) -> ModelFigures:
    error = modelled - force
    return ModelFigures(
        energy_J=over.energy(modelled),
        highest_force_N=over.most(modelled),
        lowest_force_N=over.least(modelled),
        error_N=np.sqrt(over.sums(error * error) / n),
        mean_error_N=over.sums(error) / n,
    )
