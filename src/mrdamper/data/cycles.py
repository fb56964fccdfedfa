"""What a prepared run shows by itself, before any law: cycles, repeatability, drift, lag.

Sign convention: extension positive, a force that resists extension is positive; the energy of a closed
cycle, the integral of F dx, is then what the damper took up.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points
from mrdamper.data.prepare import PreparedRun

__all__ = ["Cycle", "Drift", "cycles", "drift", "estimate_lag", "repeatability"]

_SWING = 0.05  # of the range: smaller to-and-fro does not begin a cycle
_LIKE = 0.03  # share by which a cycle may differ from the median one, and its end from its start
_PHASES = 200  # points of a cycle at which cycles are compared


@dataclass(frozen=True, slots=True)
class Cycle:
    """One cycle, from where displacement is least to where it is least again."""

    start: int  # first sample
    stop: int  # last sample, the first of the next cycle
    duration_s: float
    stroke_m: float
    energy_J: float  # taken up by the damper
    peak_N: float  # largest |force|


@dataclass(frozen=True, slots=True)
class Drift:
    """How mean displacement, mean force and the spread of force move from the first to the last cycle."""

    displacement_m: float
    force_N: float
    spread_percent: float  # change of the force's standard deviation, in % of the first cycle's


def cycles(prepared: PreparedRun) -> tuple[Cycle, ...]:
    """Return the cycles after the start of the score, each with its energy and peak force.

    A cycle lasts from one lower turning point to the next. The small gap in displacement between its ends is
    closed by a straight line at the mean of the two end forces, so that a static force adds no energy.
    """
    path, force = prepared.trajectory, prepared.force
    found = []
    lows = _lower_turns(prepared)
    for start, stop in pairwise(lows):
        x, f = path.displacement[start : stop + 1], force[start : stop + 1]
        closing = 0.5 * (f[-1] + f[0]) * (x[0] - x[-1])
        found.append(
            Cycle(
                start=start,
                stop=stop,
                duration_s=(stop - start) * path.step,
                stroke_m=float(np.ptp(x)),
                energy_J=float(np.trapezoid(f, x) + closing),
                peak_N=float(np.max(np.abs(f))),
            )
        )
    return tuple(found)


def repeatability(prepared: PreparedRun) -> float | None:
    """Return the rms deviation of the force from the mean cycle, in % of the force's standard deviation.

    Cycles are laid over each other by phase. Left out are those that differ by more than 3 % in stroke or
    duration from the median cycle, or end that far from where they began (the ramps at start and end).
    None when the run is not periodic or has fewer than two alike cycles.
    """
    if prepared.period_s is None:
        return None
    forces = _alike(prepared)
    if len(forces) < 2:
        return None
    deviation = forces - forces.mean(axis=0)
    # the mean is made of the same cycles: m - 1 of m are free
    spread = np.sqrt(np.sum(deviation**2) / ((len(forces) - 1) * forces.shape[1]))
    return 100.0 * float(spread / np.std(forces))


def drift(prepared: PreparedRun) -> Drift | None:
    """Return the change from the first to the last alike cycle; None with fewer than two cycles."""
    found = _alike_cycles(prepared)
    if len(found) < 2:
        return None
    ends = [
        (prepared.trajectory.displacement[c.start : c.stop], prepared.force[c.start : c.stop])
        for c in (found[0], found[-1])
    ]
    (x0, f0), (x1, f1) = ends
    return Drift(
        displacement_m=float(x1.mean() - x0.mean()),
        force_N=float(f1.mean() - f0.mean()),
        spread_percent=100.0 * float(np.std(f1) / np.std(f0) - 1.0),
    )


def estimate_lag(prepared: PreparedRun) -> float:
    """Return by how much the force follows the velocity [s], where their correlation is largest.

    Searched within a quarter of the period (of the median cycle when there is none), over whole periods;
    a parabola through the three largest values gives the fraction of a sample. The lag of a damper contains
    its own hysteresis, not only the delay between the channels: compare it between runs, or with zero.
    """
    path = prepared.trajectory
    period = prepared.period_s
    if period is None:
        found = cycles(prepared)
        period = float(np.median([c.duration_s for c in found])) if found else len(path) * path.step
    samples = len(path) - prepared.scored_from
    reach = max(1, min(samples // 4, round(0.25 * period / path.step)))
    inner = samples - 2 * reach
    whole = int(inner * path.step / period)
    if prepared.period_s is not None and whole:
        inner = round(whole * period / path.step)
    force = prepared.force[prepared.scored_from : prepared.scored_from + inner + 2 * reach]
    velocity = path.velocity[prepared.scored_from + reach : prepared.scored_from + reach + inner]
    correlation = np.correlate(force - force.mean(), velocity - velocity.mean(), mode="valid")
    top = int(np.argmax(correlation))
    shift = 0.0
    if 0 < top < len(correlation) - 1:
        left, middle, right = correlation[top - 1 : top + 2]
        shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return (top - reach + shift) * path.step


def _lower_turns(prepared: PreparedRun) -> list[int]:
    x = prepared.trajectory.displacement
    turns = turning_points(x, max(_SWING * float(np.ptp(x)), prepared.dead_band_m))
    after = [int(k) for k in turns if k >= prepared.scored_from]
    if len(after) < 2:
        return []
    return after[0::2] if x[after[0]] < x[after[1]] else after[1::2]


def _alike_cycles(prepared: PreparedRun) -> list[Cycle]:
    found = cycles(prepared)
    if not found:
        return []
    stroke = float(np.median([c.stroke_m for c in found]))
    duration = float(np.median([c.duration_s for c in found]))
    x = prepared.trajectory.displacement
    return [
        c
        for c in found
        if abs(c.stroke_m / stroke - 1.0) < _LIKE
        and abs(c.duration_s / duration - 1.0) < _LIKE
        and abs(x[c.stop] - x[c.start]) < _LIKE * stroke
    ]


def _alike(prepared: PreparedRun) -> FloatArray:
    """Return the force of alike cycles over phase, shape (cycles, phases)."""
    phase = np.linspace(0.0, 1.0, _PHASES, endpoint=False)
    return np.array(
        [
            np.interp(c.start + phase * (c.stop - c.start), np.arange(len(prepared)), prepared.force)
            for c in _alike_cycles(prepared)
        ]
    )
