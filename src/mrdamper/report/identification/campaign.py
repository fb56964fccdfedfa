"""A fit with its runs, grouped by motion, temperature and current for the sections of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate, select_plot_samples
from mrdamper.identify.fit import Identification
from mrdamper.identify.scores import RunError
from mrdamper.jobs.intervals import PYTHON_RATE_Hz
from mrdamper.models.simulate import simulate_each
from mrdamper.report.figures.style import colour_of, colour_of_temperature
from mrdamper.report.identification.groups import OperatingPoints, levels_of, main_sine


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
        """Label of the sine with runs at the largest number of levels and currents; None without a sine."""
        return main_sine(self.errors, self.levels)

    @cached_property
    def warm(self) -> bool:
        """True if the runs have two or more temperatures."""
        return self.levels.kind == "temperature"

    @property
    def command_label(self) -> str:
        return "current, A" if self.fitted.damper.command_unit == "A" else "voltage, V"

    def find_run(self, motion: str, level: float | None, command: float | None) -> RunError | None:
        """Return the run with the median error among all runs with this motion, level and current."""
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
        seconds=7.0 if error.command is None else None,  # drawn duration of current steps [s]
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
