"""Energy, forces, stiffness and temperature of every cycle of a prepared run or of a record as measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points
from mrdamper.data.motion import REVERSAL_MIN_RATIO
from mrdamper.data.prepare import PreparedRun
from mrdamper.data.records import GAP_MIN_STEPS, Recording, channels_of
from mrdamper.quantities import QUANTITIES

STROKE_MIN_m = 50e-6  # A smaller motion is considered noise of the displacement sensor.
OUTLIERS_PERCENT = 0.1  # The range of displacement excludes this percentage of samples at each end.


@dataclass(frozen=True, slots=True, eq=False)
class CycleFigures:
    """Values of m cycles, arrays of shape (m,).

    A cycle lasts from one lower turning point of displacement (sample a) to the next (sample b)::

        energy     W = sum_(a <= k < b) (F_k + F_k+1) / 2 * (x_k+1 - x_k) + (F_a + F_b) / 2 * (x_a - x_b)
        stiffness  K = (F_u - (F_a + F_b) / 2) / (x_u - (x_a + x_b) / 2),   u the upper turning point between

    The energy is the trapezoidal rule, closed by a straight line from b to a at the mean of the end forces.
    The stiffness is the secant through the extremes of displacement. Means include the samples a <= k < b, so
    that no sample counts twice.
    """

    row: NDArray[np.int64]  # Index of the first sample of a cycle (sample a above) in the run.
    start_s: FloatArray
    period_s: FloatArray
    amplitude_m: FloatArray  # Half the range of displacement.
    energy_J: FloatArray
    stiffness_N_per_m: FloatArray
    highest_force_N: FloatArray
    lowest_force_N: FloatArray
    temperature_K: FloatArray  # Mean over the cycle; NaN if not measured.
    command: FloatArray  # Mean over the cycle [A or V].
    samples: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.row)

    @property
    def end(self) -> NDArray[np.int64]:
        """Return the index of sample b: the first sample of the next cycle."""
        return self.row + self.samples

    @property
    def stroke_m(self) -> FloatArray:
        return 2.0 * self.amplitude_m

    def where(self, chosen: NDArray[np.bool_]) -> CycleFigures:
        """Return the cycles for which ``chosen`` is True."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    @classmethod
    def concatenate(cls, parts: Sequence[CycleFigures]) -> CycleFigures:
        """Return one object with the cycles of all parts, in order."""
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})


class CountedRecord(NamedTuple):
    """The cycles of a measured record. The record may have missing rows and time gaps (breaks)."""

    figures: CycleFigures
    stroke_min_m: float  # A smaller reversal does not begin a cycle.
    breaks: int  # Number of missing rows and time gaps.


def cycles(prepared: PreparedRun) -> CycleFigures:
    """Return the cycles of a prepared run that begin at or after the first scored sample.

    A reversal below 5 % of the range of displacement, or below the dead band, does not begin a cycle.
    """
    path = prepared.trajectory
    stroke_min_m = max(REVERSAL_MIN_RATIO * float(np.ptp(path.displacement)), path.dead_band)
    warm = np.full(len(path), math.nan) if path.temperature is None else path.temperature
    channels = (path.time, path.displacement, prepared.force, path.command, warm)
    found = _count(channels, stroke_min_m)
    return found.where(found.row >= prepared.scored_from)


def count_record(run: Recording, stroke_min_m: float | None = None) -> CountedRecord:
    """Return the cycles of a record as measured; no cycle crosses a break.

    A reversal below ``stroke_min_m`` does not begin a cycle (None: 5 % of the range of displacement).
    """
    if stroke_min_m is None:
        known = run.displacement[np.isfinite(run.displacement)]
        ends = [OUTLIERS_PERCENT, 100.0 - OUTLIERS_PERCENT]
        range_m = float(np.ptp(np.percentile(known, ends))) if len(known) else 0.0
        stroke_min_m = max(REVERSAL_MIN_RATIO * range_m, STROKE_MIN_m)
    parts, segments = [], _unbroken_segments(run)
    warm = np.full(len(run), math.nan) if run.temperature is None else run.temperature
    channels = (run.time, run.displacement, run.force, run.command, warm)
    for first, stop in segments or [(0, 0)]:
        found = _count([values[first:stop] for values in channels], stroke_min_m)
        parts.append(replace(found, row=found.row + first))
    return CountedRecord(CycleFigures.concatenate(parts), stroke_min_m, max(len(segments) - 1, 0))


def _unbroken_segments(run: Recording) -> list[tuple[int, int]]:
    """Return the row indices (first, last + 1) of each part that has only valid rows and no time gap."""
    valid = np.isfinite(run.time)
    for role, values in channels_of(run).items():
        if role not in {"time", "velocity", "temperature"}:
            valid &= (values >= QUANTITIES[role].low) & (values <= QUANTITIES[role].high)
    steps = np.diff(run.time)
    forward = steps[steps > 0.0]
    if not len(forward):
        return []
    goes_on = valid[:-1] & valid[1:] & (steps > 0.0) & (steps <= GAP_MIN_STEPS * float(np.median(forward)))
    return [(first, stop + 1) for first, stop in true_segments(goes_on)]


def true_segments(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, last + 1) of each group of consecutive flags that are True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def _count(channels: Sequence[FloatArray], stroke_min_m: float) -> CycleFigures:
    """Return the cycles in time, displacement, force, command and temperature without a break, shape (n,)."""
    time, x, force, command, temperature = channels
    turns = turning_points(x, stroke_min_m)
    if len(turns) > 1 and x[turns[0]] > x[turns[1]]:
        turns = turns[1:]
    a, u, b = turns[0:-2:2], turns[1:-1:2], turns[2::2]
    n, stop = b - a, b.max(initial=0)

    def sums(values: FloatArray) -> FloatArray:
        return np.add.reduceat(values[:stop], a)

    def extremes(values: FloatArray) -> list[FloatArray]:
        return [func(func.reduceat(values[:stop], a), values[b]) for func in (np.minimum, np.maximum)]

    known = np.isfinite(temperature)
    with np.errstate(invalid="ignore"):
        mean_temperature = sums(np.where(known, temperature, 0.0)) / sums(known.astype(np.float64))
    ends = 0.5 * (force[a] + force[b])
    (x_min, x_max), (force_min, force_max) = extremes(x), extremes(force)
    return CycleFigures(
        row=a.astype(np.int64),
        start_s=time[a],
        period_s=time[b] - time[a],
        amplitude_m=0.5 * (x_max - x_min),
        energy_J=sums(0.5 * (force[1:] + force[:-1]) * np.diff(x)) + ends * (x[a] - x[b]),
        stiffness_N_per_m=(force[u] - ends) / (x[u] - 0.5 * (x[a] + x[b])),
        highest_force_N=force_max,
        lowest_force_N=force_min,
        temperature_K=mean_temperature,
        command=sums(command) / n,
        samples=n.astype(np.int64),
    )
