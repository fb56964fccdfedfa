"""How large each cause would have to be in a run, or in all of them, to explain what a fit leaves.

The residual of each run is compared with the change of the model's force per unit of a cause (its
sensitivity). What the law's own parameters can imitate is projected out of both, so that a size is, to first
order, what a fit with this one more parameter would give: a run that has bent the fit towards itself is
seen at its full size.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from mrdamper.arrays import FloatArray, pseudoinverse
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.problem import PreparedFit
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, simulate, simulate_each
from mrdamper.models.tangents import Tangents

_RATE_Hz = 400.0  # of the samples that are compared: a delay of some ms is to be seen
_STEP_COMMAND = 0.02  # of the difference that stands for a derivative
_POLE_s = 0.02  # time constant of a force channel with a bandwidth of 8 Hz
_SINGULAR = 1e-9


@dataclass(frozen=True, slots=True)
class Effect:
    """How large one cause would have to be, and how much of the residual it explains."""

    size: float
    error: float  # standard error, from the residual that it leaves
    explained: float  # rms of the part of the residual that it explains, over the force's spread
    share: float  # of the residual's mean square


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """One run at the rate of the comparison: all arrays over the scored samples."""

    model: FloatArray  # [N]
    residual: FloatArray  # [N]
    columns: FloatArray  # d force / d parameter, shape (parameters, n)
    directions: Mapping[str, FloatArray]  # d force / d cause
    weight: float

    @property
    def spread(self) -> float:
        return float(np.std(self.residual + self.model)) or 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """What a fit leaves of each run, with the sensitivities of its parameters and of the causes."""

    runs: tuple[PreparedRun, ...]
    each: tuple[_Run, ...]
    inverse: FloatArray  # of the fit's curvature, shape (parameters, parameters)
    slope: FloatArray  # of the fit's cost, zero at its minimum

    @property
    def levels(self) -> FloatArray:
        """The rms residual of each run over its force's spread; a constant offset does not count."""
        return np.array([float(np.std(run.residual)) / run.spread for run in self.each])

    def of_run(self, number: int, kind: str) -> Effect:
        """Return the effect that one cause has in one run."""
        run = self.each[number]
        residual, direction = _centred(run, kind)
        bent = run.weight * (run.columns @ direction)
        power = float(direction @ direction) - float(bent @ self.inverse @ bent) / run.weight
        product = float(direction @ residual) - float(bent @ self.inverse @ self.slope) / run.weight
        left = float(residual @ residual)
        if power <= 1e-9 * float(direction @ direction) or left == 0.0:
            return Effect(0.0, 0.0, 0.0, 0.0)
        size, count = product / power, len(residual)
        share = min(size**2 * power / left, 1.0)
        # half a cycle of residual hangs together: some ten samples are one
        error = float(np.sqrt((1.0 - share) * left / power / (count / 10.0)))
        return Effect(size, error, abs(size) * float(np.sqrt(power / count)) / run.spread, share)

    def of_all(self, kind: str, factors: FloatArray | None = None) -> Effect:
        """Return the effect of a cause that all runs have alike, or each by its factor, shape (runs,)."""
        times = np.ones(len(self.each)) if factors is None else factors
        bent, power, product, left, count = np.zeros(len(self.slope)), 0.0, 0.0, 0.0, 0
        for run, factor in zip(self.each, times.tolist(), strict=True):
            residual, direction = _centred(run, kind)
            bent += run.weight * factor * (run.columns @ direction)
            power += run.weight * factor**2 * float(direction @ direction)
            product += run.weight * factor * float(direction @ residual)
            left += run.weight * float(residual @ residual)
            count += len(residual)
        power -= float(bent @ self.inverse @ bent)
        product -= float(bent @ self.inverse @ self.slope)
        if power <= 0.0 or left == 0.0:
            return Effect(0.0, 0.0, 0.0, 0.0)
        size = product / power
        share = min(size**2 * power / left, 1.0)
        error = float(np.sqrt((1.0 - share) * left / power / (count / 10.0)))
        return Effect(size, error, 0.01 * abs(size) * float(np.sqrt(power)), share)


def residuals_of(
    damper: Damper, runs: Sequence[PreparedRun], free: Sequence[str] = (), *, without: str = ""
) -> Residuals:
    """Return what a damper leaves of runs of one command each.

    Parameters
    ----------
    free : its parameters that were fitted to the runs, without those on a bound; a law in Python takes none
    without : the run that was left out of the fit, which it has not bent
    """
    limited = damper.on_limits()
    fits = [PreparedFit.of(run, _RATE_Hz, len(runs)) for run in runs]
    names = tuple(free) if damper.law.kernel is not None else ()
    tangents = Tangents(limited, names, [fit.drive for fit in fits]) if names else None
    most = max((float(np.abs(fit.force).max()) for fit in fits), default=1.0)
    plain = [] if tangents is not None else simulate_each(limited, [fit.drive for fit in fits])
    beside = _at_other_commands(limited, fits)
    each = []
    for number, fit in enumerate(fits):
        span, path = slice(fit.start, None), fit.drive.trajectory
        if tangents is None:
            model, columns = plain[number], np.zeros((0, len(fit.force)))
        else:
            found = tangents.along(number)
            model, columns = found.force, found.combine @ found.columns
        if runs[number].name == without:
            columns = np.zeros_like(columns)
        directions = {
            "force_gain": model,
            "force_delay": -np.gradient(model, path.step),
            "command_label": _per_command(fit, model, beside[number]),
            "force_saturation": -model * (model / most) ** 2,
            "force_offset_of_run": np.ones_like(model),
            "force_bandwidth": _per_time_constant(model, path.step),
        }
        each.append(
            _Run(
                model[span],
                fit.force[span] - model[span],
                columns[:, span],
                {kind: values[span] for kind, values in directions.items()},
                fit.weight,
            )
        )
    count = len(names)
    curvature = sum((run.weight * (run.columns @ run.columns.T) for run in each), np.zeros((count, count)))
    slope = sum((run.weight * (run.columns @ run.residual) for run in each), np.zeros(count))
    return Residuals(tuple(runs), tuple(each), pseudoinverse(curvature, _SINGULAR), slope)


def _centred(run: _Run, kind: str) -> tuple[FloatArray, FloatArray]:
    """Return residual and direction; but for an offset itself, a constant force counts for nothing."""
    direction = run.directions[kind]
    if kind == "force_offset_of_run":
        return run.residual, direction
    return run.residual - run.residual.mean(), direction - direction.mean()


def _at_other_commands(damper: Damper, fits: Sequence[PreparedFit]) -> list[FloatArray | None]:
    """Return the force [N] of each run at a command a step away; None beyond what the law is posed at."""
    drives = []
    for fit in fits:
        path, constant, step = fit.drive.trajectory, fit.drive.constant, _step(fit)
        moved = replace(path, command=path.command + step)
        drives.append(
            replace(fit.drive, trajectory=moved, constant=None if constant is None else constant + step)
        )
    try:
        return list(simulate_each(damper, drives))
    except InputError:
        return [_posed(damper, drive) for drive in drives]


def _posed(damper: Damper, drive: Drive) -> FloatArray | None:
    try:
        return simulate(damper, drive)
    except InputError:
        return None


def _step(fit: PreparedFit) -> float:
    """Return the step of a command that stands for a derivative: towards less where there is room."""
    return -_STEP_COMMAND if float(fit.drive.trajectory.command[0]) > _STEP_COMMAND else _STEP_COMMAND


def _per_command(fit: PreparedFit, model: FloatArray, beside: FloatArray | None) -> FloatArray:
    """Return d force / d command."""
    return np.zeros_like(model) if beside is None else (beside - model) / _step(fit)


def _per_time_constant(model: FloatArray, step: float) -> FloatArray:
    """Return the change of the force through one pole over the pole's time constant, at one that is usual."""
    pole = float(np.exp(-step / _POLE_s))
    driven = ((1.0 - pole) * model).tolist()
    # SciPy's filter does the same, and takes half a second to load
    filtered = accumulate(driven, lambda last, now: now + pole * last, initial=float(model[0]))
    return np.asarray((np.fromiter(filtered, np.float64)[1:] - model) / _POLE_s)
