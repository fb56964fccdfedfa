"""A fit with its runs, grouped by motion, temperature and current for the sections of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.fit import Identification
from mrdamper.identify.scores import RunError
from mrdamper.report.figures.fit import Trace
from mrdamper.report.figures.palette import colour_of, colour_of_temperature
from mrdamper.report.identification.groups import OperatingPoints, levels_of, main_sine
from mrdamper.report.identification.traces import trace_of


@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a legend."""

    label: str
    colour: str


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure with its heading and legend."""

    title: str
    caption: str
    svg: str
    keys: tuple[Key, ...] = ()


@dataclass(frozen=True)
class Campaign:
    """A fit with the errors of its runs, and their levels of temperature or current."""

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
        """The sine that was tested at most levels and currents."""
        return main_sine(self.errors, self.levels)

    @cached_property
    def warm(self) -> bool:
        """True if the runs have two or more temperatures."""
        return self.levels.kind == "temperature"

    def find_run(self, motion: str, level: float | None, command: float | None) -> RunError | None:
        """Return the run with the median error of a motion, level and current."""
        found = [
            error
            for error in self.errors
            if error.motion == motion
            and error.command == command
            and (level is None or self.levels.level_of(error) == level)
        ]
        return sorted(found, key=lambda error: error.nrmse_percent)[len(found) // 2] if found else None

    def trace(self, error: RunError, seconds: float | None = None) -> Trace:
        loop_point_count = 130  # A small panel needs no more points.
        return trace_of(
            self.fitted.damper, self.runs[error.name], error, seconds=seconds, points=2 * loop_point_count
            if seconds or not self.runs[error.name].period_s
            else loop_point_count
        )  # fmt: skip

    def colour(self, level: float) -> str:
        if self.warm:
            return colour_of_temperature(level, self.levels.values)
        return colour_of(level, self.highest)


def command_keys(campaign: Campaign) -> tuple[Key, ...]:
    """Return the legend of the current colours."""
    unit = campaign.errors[0].command_unit
    return tuple(
        Key(f"{command:g} {unit}", colour_of(command, campaign.highest)) for command in campaign.commands
    )
