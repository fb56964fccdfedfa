"""A fit with its runs, grouped by motion, temperature and current for a report.

If the runs have several temperatures, a run belongs to the group with the nearest temperature, otherwise to
the group with the nearest current. Errors of a group are pooled. Peak forces are measured values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.repeatability import forces_by_phase, is_typical
from mrdamper.data.prepare import PreparedRun, decimate, select_plot_samples
from mrdamper.excitation import Sine
from mrdamper.identify.fit import Identification
from mrdamper.identify.scores import RunError
from mrdamper.jobs.evaluate import PYTHON_RATE_Hz
from mrdamper.models.simulate import simulate_each
from mrdamper.report.figures.style import colour_of, colour_of_temperature


@dataclass(frozen=True, slots=True)
class OperatingPoints:
    """Temperatures [degC], currents [A] or voltages [V] by which runs are grouped."""

    kind: Literal["temperature", "command"]
    values: tuple[float, ...]
    unit: str

    def level_of(self, error: RunError) -> float | None:
        """Return the group value nearest to the temperature (or current) of a run; None if it is unknown."""
        value = error.temperature_degC if self.kind == "temperature" else error.command
        return None if value is None else min(self.values, key=lambda level: abs(level - value))

    def label(self, level: float) -> str:
        return f"{level:.0f} {self.unit}" if self.kind == "temperature" else f"{level:g} {self.unit}"


def levels_of(errors: Sequence[RunError]) -> OperatingPoints:
    """Return the temperatures of the runs if there are two or more, otherwise their currents."""
    known = sorted(e.temperature_degC for e in errors if e.temperature_degC is not None)
    if len(known) == len(errors) and known:
        clusters = [[known[0]]]
        for before, now in pairwise(known):
            if now - before > 1.5:  # Runs whose temperatures differ by up to 1.5 K are one group.
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
    """Return the label of the sine with the most pairs of temperature and current.

    If there are several such sines, the sine with the longest stroke is returned; None without a sine.
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

    velocity: float  # peak velocity [m/s]
    extension: float  # mean force in extension [N]
    retraction: float  # mean force in retraction [N]


def peak_force(run: PreparedRun) -> float | None:
    """Return the peak absolute force of the mean cycle [N]; None if the run has no complete cycle."""
    found = cycles(run)
    if run.period_s is None or not len(found):
        return None
    mean: FloatArray = np.mean(forces_by_phase(run, found.where(is_typical(found.stroke_m))), axis=0)
    return float(np.abs(mean).max())


def pick_of(run: PreparedRun) -> Pick | None:
    """Return the measured force at peak velocity of a run with a sine; None if the motion is not a sine."""
    peak_velocity_ratio_min = 0.95  # Samples above this fraction of the peak velocity are averaged.
    if run.period_s is None or not run.motion.startswith("sine"):
        return None
    velocity, force = run.trajectory.velocity[run.scored_from :], run.force[run.scored_from :]
    peak = math.sqrt(2.0) * float(np.std(velocity))
    ways = [velocity > peak_velocity_ratio_min * peak, velocity < -peak_velocity_ratio_min * peak]
    if not all(way.any() for way in ways):
        return None
    return Pick(peak, *(float(force[way].mean()) for way in ways))


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Measured and modelled force in one cycle (or a few seconds) of a run, with fewer samples for a plot."""

    error: RunError
    over_time: bool  # True if the force is plotted versus time: motion without a period, or current steps
    time_s: FloatArray  # time since the first drawn sample
    displacement_mm: FloatArray
    velocity_mm_s: FloatArray
    measured_N: FloatArray
    modelled_N: FloatArray


@dataclass(frozen=True)
class Campaign:
    """A fit with the errors of its runs, which are grouped by temperature or by current (``levels_of``)."""

    fitted: Identification
    errors: tuple[RunError, ...]

    @cached_property
    def levels(self) -> OperatingPoints:
        return levels_of(self.errors)

    @cached_property
    def runs(self) -> Mapping[str, PreparedRun]:
        return {run.name: run for run in (*self.fitted.training, *self.fitted.held_out)}

    @cached_property
    def commands(self) -> tuple[float, ...]:
        """The constant currents (or voltages) in ascending order."""
        return tuple(sorted({error.command for error in self.errors if error.command is not None}))

    @cached_property
    def highest(self) -> float:
        return max(map(abs, self.commands), default=0.0)

    @cached_property
    def main(self) -> str | None:
        """Label of the sine that was measured at most temperatures and currents; None without a sine."""
        return main_sine(self.errors, self.levels)

    @cached_property
    def warm(self) -> bool:
        """True if the runs have two or more temperatures."""
        return self.levels.kind == "temperature"

    @property
    def command_label(self) -> str:
        return "current, A" if self.fitted.damper.command_unit == "A" else "voltage, V"

    def find_run(self, motion: str, level: float | None, command: float | None) -> RunError | None:
        """Return the run with the median error among runs with this motion, temperature and current."""
        found = [
            error
            for error in self.errors
            if error.motion == motion
            and error.command == command
            and (level is None or self.levels.level_of(error) == level)
        ]
        return sorted(found, key=lambda error: error.nrmse_percent)[len(found) // 2] if found else None

    def traces(self, errors: Sequence[RunError]) -> list[Trace]:
        """Return the second cycle of each run, or the first seconds of a motion without a period.

        The transient has decayed in the second cycle. The runs are simulated together.
        """
        damper, runs = self.fitted.damper, [self.runs[error.name] for error in errors]
        if damper.law.kernel is None:
            runs = [decimate(run, PYTHON_RATE_Hz) for run in runs]
        forces = simulate_each(damper.on_limits(), [run.trajectory for run in runs])
        return [_trace(*each) for each in zip(errors, runs, forces, strict=True)]

    def colour(self, level: float) -> str:
        if self.warm:
            return colour_of_temperature(level, self.levels.values)
        return colour_of(level, self.highest)


def _trace(error: RunError, run: PreparedRun, force: FloatArray) -> Trace:
    loop_point_count = 130  # More points are not visible in a small panel.
    path, over_time = run.trajectory, error.command is None or not run.period_s
    drawn = select_plot_samples(
        run,
        seconds=7.0 if error.command is None else None,  # Runs with current steps are drawn for 7 s.
        points=2 * loop_point_count if over_time else loop_point_count,
    )
    return Trace(
        error=error,
        over_time=over_time,
        time_s=path.time[drawn] - path.time[drawn[0]],
        displacement_mm=1e3 * path.displacement[drawn],
        velocity_mm_s=1e3 * path.velocity[drawn],
        measured_N=run.force[drawn],
        modelled_N=force[drawn],
    )
