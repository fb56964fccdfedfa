"""The fitting problem: a damper as template, the parameters that may move, the runs to reproduce.

The cost is the mean over runs of the squared error in percent of the run's own force spread (squared
``nrmse_percent``), so that a run at 0 A weighs as much as one at full current.

What comes out is a value too: ``FitResult`` holds no solver and no data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate, shortened
from mrdamper.errors import InputError
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.simulate import Drive, open_drive


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One parameter of the template that a fit may move, and how far.

    ``linear`` says that the force is linear in it: a fit then eliminates it, and the bounds of the
    coefficient that it belongs to are kept instead of its own. ``scale`` is the coordinate of search.
    """

    name: str
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "linear"
    linear: bool = False

    def __post_init__(self) -> None:
        if not self.lower < self.upper or (self.scale == "log" and not self.lower > 0.0):
            raise InputError(
                place=f"free parameter {self.name}",
                found=f"bounds {self.lower:g} to {self.upper:g} on a {self.scale} scale",
                expected="lower < upper, and lower > 0 on a log scale",
            )

    def to_search(self, value: float | FloatArray) -> FloatArray:
        """Return the search coordinate of a value."""
        return np.log(value) if self.scale == "log" else np.asarray(value, dtype=np.float64)

    def to_physical(self, coordinate: float) -> float:
        """Return the value at a search coordinate."""
        return math.exp(coordinate) if self.scale == "log" else float(coordinate)


@dataclass(frozen=True)
class FitProblem:
    """A fitting problem. Scaling lives in ``FreeParameter`` and is applied in one place, the search.

    ``session_offsets`` lets each session have its own constant force (a tare that shifted); it is
    reported and never applied to runs of another session. ``rate_Hz`` is the sampling inside the fit,
    not below 200 Hz where the data have it; scoring is at full rate.
    """

    template: Damper
    free: tuple[FreeParameter, ...]
    runs: tuple[PreparedRun, ...]
    session_offsets: bool = False
    rate_Hz: float = 200.0

    def __post_init__(self) -> None:
        if not self.runs:
            raise InputError("no training runs", expected="runs to fit", remedy="Hold out fewer")
        known = {*self.template.parameters, LAG}
        for free in self.free:
            if free.name not in known:
                raise InputError(
                    f"there is no parameter {free.name!r} to set free", place=self.template.law.name
                )
        if len({free.name for free in self.free}) != len(self.free):
            raise InputError("a parameter is set free twice", expected="each once")

    @cached_property
    def nonlinear(self) -> tuple[FreeParameter, ...]:
        """The parameters that are searched for."""
        return tuple(free for free in self.free if not free.linear)

    @cached_property
    def linear(self) -> tuple[FreeParameter, ...]:
        """The parameters that are eliminated by least squares."""
        return tuple(free for free in self.free if free.linear)

    def prepare(self, *, excerpt: bool = False) -> tuple[PreparedFit, ...]:
        """Return the runs decimated and opened for the kernel; ``excerpt`` keeps the first period of each."""
        return tuple(PreparedFit.of(run, self.rate_Hz, len(self.runs), excerpt=excerpt) for run in self.runs)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedFit:
    """One training run inside a fit: its drive, its force, and its weight in the cost."""

    drive: Drive
    force: FloatArray  # [N], raw
    start: int  # first scored sample
    weight: float  # of a squared newton in the cost [%^2 / N^2]
    session: str

    @classmethod
    def of(cls, run: PreparedRun, rate: float, runs: int, *, excerpt: bool = False) -> PreparedFit:
        """Return a run at the fit's rate.

        An excerpt ends half a period after the first scored sample and takes implicit steps twice as long.
        """
        spread = float(np.std(run.force[run.scored_from :]))
        if not spread > 0.0:
            raise InputError(place=run.run.name, found="the force does not change after the motion starts")
        coarse = decimate(run, rate)
        start, step = coarse.scored_from, coarse.trajectory.step
        longest = core.LONGEST_STEP
        if excerpt:
            seconds = 0.5 * run.period_s if run.period_s else 0.1 * step * len(coarse)
            coarse = shortened(coarse, start + max(int(seconds / step), 32))
            longest *= 2.0
        trajectory, force = coarse.trajectory, coarse.force
        weight = 1e4 / (spread**2 * (len(force) - start) * runs)
        drive = open_drive(trajectory, longest_step=longest)
        return cls(drive, np.ascontiguousarray(force), start, weight, run.run.session)


@dataclass(frozen=True, slots=True)
class Estimate:
    """One fitted parameter with what the data say about it.

    ``standard_error`` allows for errors that hang together in time (blocks of half a cycle); it is NaN
    where the parameter sits on a bound. ``design_error_percent`` is the relative standard error that
    independent noise of the residual's size would leave: the design's own share, known before a fit.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    design_error_percent: float
    lower: float
    upper: float
    at_bound: Literal["", "lower", "upper"]
    linear: bool

    @property
    def identifiable(self) -> bool:
        """Whether the design pins the parameter down to better than 30 %."""
        return self.design_error_percent < 30.0


@dataclass(frozen=True, slots=True)
class Start:
    """The outcome of one start of the search; the cost is in percent (root of the mean squared error).

    ``joined`` is the former start whose place this one came to on short stretches of the runs: from there on
    their ways are one.
    """

    index: int
    cost_percent: float
    evaluations: int
    converged: bool
    joined: int | None = None


@dataclass(frozen=True)
class FitResult:
    """A fitted damper and how the fit went."""

    damper: Damper
    method: str
    cost_percent: float
    estimates: tuple[Estimate, ...]
    correlation: FloatArray
    starts: tuple[Start, ...]
    offsets_N: Mapping[str, float]
    history: tuple[float, ...]
    seed: int
    cpu_s: float
    cancelled: bool
    notes: tuple[str, ...] = ()


def canonical(damper: Damper) -> Damper:
    """Return the damper with its first hysteretic element the quicker one (larger rho without command).

    Two elements in parallel may change places without changing the force.
    """
    forms = dict(damper.coefficients)
    if damper.law.name != "double-bouc-wen" or forms["rho"].value(0.0) >= forms["second_rho"].value(0.0):
        return damper
    for one, other in (("rho", "second_rho"), ("yield_force", "second_force")):
        if (
            type(forms[one]) is not type(forms[other])
            or forms[one].parameter_names != forms[other].parameter_names
        ):
            return damper
        forms[one], forms[other] = forms[other], forms[one]
    return replace(damper, coefficients=forms)


def envelope_of(runs: Sequence[PreparedRun]) -> OperatingEnvelope:
    """Return the range of command, displacement, velocity and temperature that the runs cover."""

    def span(values: Sequence[FloatArray]) -> tuple[float, float]:
        return min(float(v.min()) for v in values), max(float(v.max()) for v in values)

    tracks = [run.trajectory for run in runs]
    kelvin = [t.temperature for t in tracks if t.temperature is not None]
    return OperatingEnvelope(
        command=span([t.command for t in tracks]),
        displacement=span([t.displacement for t in tracks]),
        velocity=span([t.velocity for t in tracks]),
        temperature=span(kelvin) if len(kelvin) == len(tracks) else None,
    )
