"""Runs grouped by motion, temperature and current: pooled errors and measured peak forces.

A run belongs to the level that is closest to the mean temperature (or current) of the run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.repeatability import forces_by_phase, is_typical
from mrdamper.data.prepare import PreparedRun
from mrdamper.excitation import Sine
from mrdamper.identify.scores import RunError


@dataclass(frozen=True, slots=True)
class OperatingPoints:
    """Levels of temperature [degC] or current [A] (voltage [V]) by which a report groups the runs."""

    kind: Literal["temperature", "command"]
    values: tuple[float, ...]
    unit: str

    def level_of(self, error: RunError) -> float | None:
        """Return the level nearest to the temperature (or current) of a run; None if the run has no value."""
        value = error.temperature_degC if self.kind == "temperature" else error.command
        return None if value is None else min(self.values, key=lambda level: abs(level - value))

    def label(self, level: float) -> str:
        return f"{level:.0f} {self.unit}" if self.kind == "temperature" else f"{level:g} {self.unit}"


def levels_of(errors: Sequence[RunError]) -> OperatingPoints:
    """Return the temperatures of the runs as levels if there are two or more, otherwise the currents."""
    known = sorted(e.temperature_degC for e in errors if e.temperature_degC is not None)
    if len(known) == len(errors) and known:
        clusters = [[known[0]]]
        for before, now in pairwise(known):
            if now - before > 1.5:  # max gap within a level [K]
                clusters.append([])
            clusters[-1].append(now)
        if len(clusters) > 1:
            return OperatingPoints("temperature", tuple(float(np.median(c)) for c in clusters), "°C")
    commands = sorted({e.command for e in errors if e.command is not None})
    return OperatingPoints("command", tuple(commands) or (0.0,), errors[0].command_unit)


def pooled_rms(errors: Sequence[RunError]) -> float:
    """Return the root mean square of the RMS errors of the runs [N]."""
    return rms(np.array([error.rmse_N for error in errors]))


def main_sine(errors: Sequence[RunError], levels: OperatingPoints) -> str | None:
    """Return the label of the sine with the most pairs of level and current; None without a sine.

    If several sines have the same number of pairs, the sine with the longest stroke is returned.
    """
    counts: dict[str, set[tuple[float | None, float | None]]] = {}
    for error in errors:
        if error.motion.startswith("sine") and error.command is not None:
            counts.setdefault(error.motion, set()).add((levels.level_of(error), error.command))
    if not counts:
        return None
    return max(counts, key=lambda motion: (len(counts[motion]), _stroke_in(motion), motion))


def sine_of(runs: Sequence[PreparedRun]) -> Sine | None:
    """Return the sine with the median amplitude and period of the runs; None if no run is periodic."""
    periods = [run.period_s for run in runs if run.period_s]
    swings = [0.5 * float(np.ptp(run.trajectory.displacement[run.scored_from :])) for run in runs]
    return Sine(float(np.median(swings)), 1.0 / float(np.median(periods))) if periods else None


def _stroke_in(motion: str) -> float:
    """Return the amplitude in the label of a motion, such as 10 for ``sine 10 mm 1 Hz``, for sorting."""
    parts = motion.split()
    return float(parts[1]) if len(parts) > 1 and parts[1].replace(".", "", 1).isdigit() else 0.0


@dataclass(frozen=True, slots=True)
class Pick:
    """Measured mean force at the peak velocity of a sine, in extension and in retraction."""

    velocity: float  # [m/s]
    extension: float  # [N]
    retraction: float  # [N]


def peak_force(run: PreparedRun) -> float | None:
    """Return the peak absolute force of the mean cycle [N]; None if the run has no complete cycle."""
    found = cycles(run)
    if run.period_s is None or not len(found):
        return None
    mean: FloatArray = np.mean(forces_by_phase(run, found.where(is_typical(found.stroke_m))), axis=0)
    return float(np.abs(mean).max())


def pick_of(run: PreparedRun) -> Pick | None:
    """Return the measured force at peak velocity of a run with a sine, or None for other motions."""
    peak_velocity_ratio_min = 0.95  # Samples above this fraction of the peak velocity are averaged.
    if run.period_s is None or not run.motion.startswith("sine"):
        return None
    velocity, force = run.trajectory.velocity[run.scored_from :], run.force[run.scored_from :]
    peak = math.sqrt(2.0) * float(np.std(velocity))
    ways = [velocity > peak_velocity_ratio_min * peak, velocity < -peak_velocity_ratio_min * peak]
    if not all(way.any() for way in ways):
        return None
    return Pick(peak, *(float(force[way].mean()) for way in ways))
