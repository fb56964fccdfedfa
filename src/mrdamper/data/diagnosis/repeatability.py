"""How alike the cycles of a prepared run are, before any law: repeatability, drift, lag.

Sign convention: extension positive, a force that resists extension is positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.cycles import CycleFigures, cycles
from mrdamper.data.prepare import PreparedRun

_ALIKE = 0.03  # share by which a cycle may differ from the median one, and its end from its start
_PHASES = 200  # points of a cycle at which cycles are compared


@dataclass(frozen=True, slots=True)
class Drift:
    """How mean displacement, mean force and the spread of force move from the first to the last cycle."""

    displacement_m: float
    force_N: float
    spread_percent: float  # change of the force's standard deviation, in % of the first cycle's


def repeatability(prepared: PreparedRun) -> float | None:
    """Return the rms deviation of the force from the mean cycle, in % of the force's standard deviation.

    Cycles are laid over each other by phase. Left out are those that differ by more than 3 % in stroke or
    duration from the median cycle, or end that far from where they began (the ramps at start and end).
    None when the run is not periodic or has fewer than two alike cycles.
    """
    if prepared.period_s is None:
        return None
    forces = forces_by_phase(prepared, alike_cycles(prepared))
    if len(forces) < 2:
        return None
    deviation = forces - forces.mean(axis=0)
    # the mean is made of the same cycles: m - 1 of m are free
    spread = np.sqrt(np.sum(deviation**2) / ((len(forces) - 1) * forces.shape[1]))
    return 100.0 * float(spread / np.std(forces))


def drift(prepared: PreparedRun) -> Drift | None:
    """Return the change from the first to the last alike cycle; None with fewer than two cycles."""
    found = alike_cycles(prepared)
    if len(found) < 2:
        return None
    ends = [
        (prepared.trajectory.displacement[start:end], prepared.force[start:end])
        for start, end in ((found.row[k], found.end[k]) for k in (0, -1))
    ]
    (x0, f0), (x1, f1) = ends
    return Drift(
        displacement_m=float(x1.mean() - x0.mean()),
        force_N=float(f1.mean() - f0.mean()),
        spread_percent=100.0 * float(np.std(f1) / np.std(f0) - 1.0),
    )


def estimate_lag(prepared: PreparedRun, period_s: float) -> float:
    """Return by how much the force of two cycles or more follows the velocity [s], by their correlation.

    Searched within a quarter of the period, over whole periods; a parabola through the three largest values
    gives the fraction of a sample. The lag of a damper contains its own hysteresis, not only the delay
    between the channels: compare it between runs, or with zero.
    """
    path = prepared.trajectory
    per_cycle = period_s / path.step
    reach = round(0.25 * per_cycle)
    inner = round(max(1, int((len(path) - prepared.scored_from - 2 * reach) / per_cycle)) * per_cycle)
    force = prepared.force[prepared.scored_from : prepared.scored_from + inner + 2 * reach]
    velocity = path.velocity[prepared.scored_from + reach : prepared.scored_from + reach + inner]
    correlation = np.correlate(force - force.mean(), velocity - velocity.mean(), mode="valid")
    top = int(np.argmax(correlation))
    shift = 0.0
    if 0 < top < len(correlation) - 1:
        left, middle, right = correlation[top - 1 : top + 2]
        shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return (top - reach + shift) * path.step


def alike(values: FloatArray) -> NDArray[np.bool_]:
    """Return which strokes or durations of cycles differ by less than 3 % from the median one."""
    return np.asarray(np.abs(values / np.median(values) - 1.0) < _ALIKE)


def forces_by_phase(prepared: PreparedRun, found: CycleFigures) -> FloatArray:
    """Return the force of cycles over phase, shape (cycles, phases)."""
    phase = np.linspace(0.0, 1.0, _PHASES, endpoint=False)
    samples = np.arange(len(prepared))
    pairs = zip(found.row.tolist(), found.samples.tolist(), strict=True)
    return np.array([np.interp(start + phase * count, samples, prepared.force) for start, count in pairs])


def alike_cycles(prepared: PreparedRun) -> CycleFigures:
    """Return the cycles that are like the median one in stroke and duration, and end where they began."""
    found = cycles(prepared)
    if not len(found):
        return found
    x = prepared.trajectory.displacement
    closed = np.abs(x[found.end] - x[found.row]) < _ALIKE * np.median(found.stroke_m)
    return found.where(alike(found.stroke_m) & alike(found.samples.astype(np.float64)) & closed)
