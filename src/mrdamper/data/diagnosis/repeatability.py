"""Comparison of the cycles of a prepared run without a model: repeatability, drift, lag."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.cycles import CycleFigures, cycles
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.prepare import PreparedRun


class Drift(NamedTuple):
    """Change of mean displacement, mean force and standard deviation of force from first to last cycle."""

    displacement_m: float
    force_N: float
    spread_percent: float  # Change of the force's standard deviation relative to the first cycle [%].


def repeatability(prepared: PreparedRun) -> float | None:
    """Return the rms deviation of the force from the mean cycle, in % of the force's standard deviation.

    Cycles are aligned by phase. A cycle is ignored if its stroke or duration differs by more than 3 % from
    the median. A cycle is also ignored if its first and last positions differ by more than 3 % of the stroke
    (a ramp). The result is None if the run is not periodic or has fewer than two typical cycles.
    """
    forces = forces_by_phase(prepared, select_typical_cycles(prepared))
    if prepared.period_s is None or len(forces) < 2:
        return None
    deviation = forces - forces.mean(axis=0)
    # The deviations of m cycles from their own mean have m - 1 degrees of freedom at each phase.
    spread = np.sqrt(np.sum(deviation**2) / ((len(forces) - 1) * forces.shape[1]))
    return 100.0 * float(spread / np.std(forces))


def drift(prepared: PreparedRun) -> Drift | None:
    """Return the change from the first to the last typical cycle, None if there are fewer than two."""
    found = select_typical_cycles(prepared)
    if len(found) < 2:
        return None
    first, last = (slice(found.row[k], found.end[k]) for k in (0, -1))
    x, force = prepared.trajectory.displacement, prepared.force
    moved_m, moved_N = (float(values[last].mean() - values[first].mean()) for values in (x, force))
    return Drift(moved_m, moved_N, 100.0 * float(np.std(force[last]) / np.std(force[first]) - 1.0))


def estimate_lag(prepared: PreparedRun, period_s: float) -> float:
    """Return the lag [s] of the force relative to the velocity by cross-correlation over two or more cycles.

    The search covers lags up to a quarter of the period and correlates whole periods. A parabola through the
    maximum and its neighbours resolves fractions of a sample. The hysteresis of the damper and the delay
    between the channels add up in the lag. Therefore compare lags of different runs, or use only the sign.
    """
    path, start = prepared.trajectory, prepared.scored_from
    per_cycle = period_s / path.step
    reach = round(0.25 * per_cycle)
    inner = round(max(1, int((len(path) - start - 2 * reach) / per_cycle)) * per_cycle)
    force = prepared.force[start : start + inner + 2 * reach]
    velocity = path.velocity[start + reach : start + reach + inner]
    correlation = np.correlate(force - force.mean(), velocity - velocity.mean(), mode="valid")
    top = int(np.argmax(correlation))
    shift = 0.0
    if 0 < top < len(correlation) - 1:
        left, middle, right = correlation[top - 1 : top + 2]
        shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return (top - reach + shift) * path.step


def is_typical(values: FloatArray) -> NDArray[np.bool_]:
    """Return True for each stroke or duration that differs from the median by less than 3 %."""
    return np.asarray(np.abs(values / np.median(values) - 1.0) < SETTINGS.cycle_ratio_max)


def forces_by_phase(prepared: PreparedRun, found: CycleFigures) -> FloatArray:
    """Return the force of each cycle interpolated to equal phases, shape (cycles, phases)."""
    phase = np.linspace(0.0, 1.0, SETTINGS.cycle_phase_count, endpoint=False)
    samples = np.arange(len(prepared))
    pairs = zip(found.row.tolist(), found.samples.tolist(), strict=True)
    return np.array([np.interp(start + phase * count, samples, prepared.force) for start, count in pairs])


def select_typical_cycles(prepared: PreparedRun) -> CycleFigures:
    """Return the cycles that end where they start and have the median stroke and duration (within 3 %)."""
    found = cycles(prepared)
    if not len(found):
        return found
    x = prepared.trajectory.displacement
    closed = np.abs(x[found.end] - x[found.row]) < SETTINGS.cycle_ratio_max * np.median(found.stroke_m)
    return found.where(is_typical(found.stroke_m) & is_typical(found.samples.astype(np.float64)) & closed)
