"""The fit problem (template damper, free parameters, runs) and the results of a fit.

The cost is the mean over runs of squared ``nrmse_percent`` (RMS error in percent of the standard deviation of
the force of the run). A run at 0 A therefore has the same weight as a run at full current.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import Preparation, PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.settings import DEFAULT_SETTINGS, NUMERICS, FitSettings
from mrdamper.identify.windows import FitWindow, changing_sample_count, representative_windows, run_windows
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Bipolynomial
from mrdamper.quantities import REFERENCE_K


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """A parameter of the damper that is fitted, with its bounds.

    If the force is linear in the parameter (``linear``), linear least squares computes the parameter in each
    step (variable projection). The valid range of the coefficient then replaces the bounds. ``scale`` states
    whether the search varies the parameter or its logarithm.
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
        """Return the search coordinate of a value: the value or its logarithm."""
        return np.log(value) if self.scale == "log" else np.asarray(value, dtype=np.float64)


@dataclass(frozen=True)
class FitProblem:
    """A fit problem: template (damper with start values), free parameters, runs and settings."""

    template: Damper
    free: tuple[FreeParameter, ...]
    runs: tuple[PreparedRun, ...]
    settings: FitSettings = DEFAULT_SETTINGS

    @cached_property
    def nonlinear(self) -> tuple[FreeParameter, ...]:
        """Free parameters with a nonlinear effect on the force. The search varies these parameters."""
        return tuple(free for free in self.free if not free.linear)

    @cached_property
    def linear(self) -> tuple[FreeParameter, ...]:
        """Free parameters with a linear effect on the force. Linear least squares computes their values."""
        return tuple(free for free in self.free if free.linear)

    @cached_property
    def conditions(self) -> tuple[FloatArray, FloatArray]:
        """A and b of the conditions A c >= b that keep the coefficients of the law valid.

        The vector c contains the linear parameters. The conditions apply on a grid of commands and
        temperatures.
        """
        template, names = self.template, [free.name for free in self.linear]
        grid = np.unique(np.linspace(*envelope_of(self.runs).command, NUMERICS.condition_command_count))
        span = template.temperature_range or (REFERENCE_K, REFERENCE_K)
        kelvin = np.unique(np.linspace(*span, NUMERICS.condition_temperature_count))
        rows, floor = [np.zeros((0, len(names)))], [np.zeros(0)]
        for name, law in template.coefficients.items():
            members = [i for i, number in enumerate(names) if number.partition(".")[0] == name]
            least = template.law[name].lower
            if not members or not np.isfinite(least):
                continue
            at = [law.parameter_names.index(names[i].partition(".")[2]) for i in members]
            commands, temperatures = (
                each.ravel()
                for each in np.meshgrid(
                    grid if law.kind != "constant" else grid[:1],
                    kelvin if isinstance(law, Bipolynomial) else [REFERENCE_K],
                )
            )
            # Parameters that are not fitted contribute the part ``fixed`` to the coefficient.
            held = [0.0 if i in at else number for i, number in enumerate(law.parameters)]
            fixed = law.with_parameters(held).value(commands, temperatures)
            gradients = law.gradient(commands, temperatures)[at].T
            needed = gradients.any(axis=1)
            rows.append(np.zeros((int(needed.sum()), len(names))))
            rows[-1][:, members] = gradients[needed]
            floor.append((least - fixed)[needed])
        return np.concatenate(rows), np.concatenate(floor)

    def windows(self, samples_max: float = math.inf, blocks: int = 1) -> tuple[FitWindow, ...]:
        """Return windows (sections) of the runs: all data, or at most ``samples_max`` simulated samples.

        By default, all data are used unless the runs with changing current are too long (see
        ``FitSettings``). ``blocks`` is the number of equal time blocks of each run. No window extends over
        two blocks.
        """
        if changing_sample_count(self.runs, self.settings) > self.settings.changing_samples_max:
            samples_max = min(samples_max, self.settings.changing_samples_max)
        if samples_max == math.inf and blocks == 1:
            return run_windows(self.runs, self.settings)
        return representative_windows(self.runs, self.settings, samples_max=samples_max, blocks=blocks)


@dataclass(frozen=True, slots=True)
class Estimate:
    """A fitted parameter and its uncertainty.

    ``standard_error`` allows for residuals that are correlated within half a cycle. It is NaN if the
    parameter is at a bound. ``design_error_percent`` is the relative standard error that the runs would give
    if the residuals were independent noise.
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
        """True if the design error is below 30 %."""
        return self.design_error_percent < 30.0


@dataclass(frozen=True, slots=True)
class Start:
    """Result of the search from one initial parameter set; ``cost_percent`` is the RMS error [%]."""

    index: int
    cost_percent: float
    converged: bool


@dataclass(frozen=True)
class SearchResult:
    """Result of a search: the fitted damper and the estimates of its parameters.

    ``covariance`` includes the model errors that differ between motions. If ``covariance`` is None, the
    covariance follows from the standard errors and ``correlation``.
    """

    damper: Damper
    method: str
    cost_percent: float
    estimates: tuple[Estimate, ...]
    correlation: FloatArray
    starts: tuple[Start, ...]
    seed: int
    cancelled: bool
    converged: bool = True
    notes: tuple[str, ...] = ()
    covariance: FloatArray | None = None


@dataclass(frozen=True)
class FittedDamper:
    """Result of a search together with the training runs and the held-out runs."""

    result: SearchResult
    training: tuple[PreparedRun, ...]
    held_out: tuple[PreparedRun, ...]
    preparation: Preparation

    @property
    def damper(self) -> Damper:
        return self.result.damper


def canonical(damper: Damper) -> Damper:
    """Return the damper with the two parallel hysteretic elements of ``double-bouc-wen`` in a unique order.

    The element with the larger rho at zero current becomes the first. The force does not depend on the order.
    Other laws are returned unchanged.
    """
    forms = dict(damper.coefficients)
    if damper.law.name != "double-bouc-wen" or forms["rho"].value(0.0) >= forms["second_rho"].value(0.0):
        return damper
    for one, other in (("rho", "second_rho"), ("yield_force", "second_force")):
        if forms[one].parameter_names != forms[other].parameter_names:
            return damper
        forms[one], forms[other] = forms[other], forms[one]
    return replace(damper, coefficients=forms)


def envelope_of(runs: Sequence[PreparedRun]) -> OperatingEnvelope:
    """Return the ranges of command, displacement, velocity and temperature in the runs."""

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
