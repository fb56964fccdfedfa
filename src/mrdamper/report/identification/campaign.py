"""A campaign: a fit with its runs by motion, temperature and command, as the report's sections look at it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.fit import Identification
from mrdamper.identify.scores import RunError
from mrdamper.report.figures.fit import Trace
from mrdamper.report.figures.palette import colour_of, colour_of_warmth
from mrdamper.report.identification.groups import OperatingPoints, levels_of, main_sine
from mrdamper.report.identification.traces import trace_of

MOST_COLUMNS = 7  # panels beside each other
_POINTS = 130  # of a small loop


@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a legend."""

    label: str
    colour: str


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure, what stands above it, and its legend."""

    title: str
    said: str
    svg: str
    keys: tuple[Key, ...] = ()


@dataclass(frozen=True)
class Campaign:
    """A fit with the errors of its runs, and the levels (temperatures, else commands) they fall into."""

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
        """The constant commands, rising."""
        return tuple(sorted({error.command for error in self.errors if error.command is not None}))

    @cached_property
    def highest(self) -> float:
        return max(map(abs, self.commands), default=0.0)

    @cached_property
    def main(self) -> str | None:
        """The sine that was run at most levels and commands."""
        return main_sine(self.errors, self.levels)

    @cached_property
    def warm(self) -> bool:
        """Whether the runs are at two temperatures or more."""
        return self.levels.kind == "temperature"

    def at(self, motion: str, level: float | None, command: float | None) -> RunError | None:
        """Return the run of one motion, level and command; of several the one in the middle by error."""
        found = [
            error
            for error in self.errors
            if error.motion == motion
            and error.command == command
            and (level is None or self.levels.of(error) == level)
        ]
        return sorted(found, key=lambda error: error.nrmse_percent)[len(found) // 2] if found else None

    def trace(self, error: RunError, seconds: float | None = None) -> Trace:
        return trace_of(
            self.fitted.damper, self.runs[error.name], error, seconds=seconds, points=2 * _POINTS
            if seconds or not self.runs[error.name].period_s
            else _POINTS
        )  # fmt: skip

    def colour(self, level: float) -> str:
        if self.warm:
            return colour_of_warmth(level, self.levels.values)
        return colour_of(level, self.highest)


def command_keys(campaign: Campaign) -> tuple[Key, ...]:
    """Return the legend of the commands' colours."""
    unit = campaign.errors[0].command_unit
    return tuple(
        Key(f"{command:g} {unit}", colour_of(command, campaign.highest)) for command in campaign.commands
    )
