"""Estimate the size of each possible cause of the residual (gain, delay, ...), for one run or for all runs.

The *sensitivity* to a cause is the change of the model force per unit of the cause. The size follows from a
linear regression of the residual on the sensitivity. The model parameters have partly adapted to a wrong run.
Therefore the part that the parameters can reproduce is first projected out of residual and sensitivity. To
first order, the size equals the estimate of a fit with the cause as an additional parameter. A run that was
not used in the fit needs no projection, because the parameters have not adapted to this run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, pseudoinverse
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.consistency.settings import SETTINGS
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.windows import FitWindow, one_window
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate, simulate_each
from mrdamper.models.tangents import Tangents

# The rate is high enough that a delay of some milliseconds is several samples even for slow motions.
WINDOW_SETTINGS = FitSettings(rate_Hz=400.0, samples_per_period=math.inf)


@dataclass(frozen=True, slots=True)
class Effect:
    """Estimated size of one cause, and the part of the residual that the cause explains."""

    size: float  # estimated size [unit of the cause]
    standard_error: float  # [unit of the cause], estimated from the unexplained residual
    level: float  # rms of the explained residual / standard deviation of the force
    fraction: float  # explained fraction of the mean squared residual


NO_EFFECT = Effect(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class RunResidual:
    """Residual of one run and its sensitivities to parameters and causes, at the scored samples."""

    model: FloatArray  # simulated force [N]
    residual: FloatArray  # measured minus simulated force [N]
    columns: FloatArray  # d force / d parameter, shape (parameters, n); zero if the run is not fitted
    directions: Mapping[str, FloatArray]  # key: name of the cause; value: d force / d cause, shape (n,)
    weight: float  # factor of a squared force error in the cost of the fit [%^2 / N^2]

    @property
    def force_std_N(self) -> float:
        """Standard deviation of the measured force [N], or 1 if the force is constant."""
        return float(np.std(self.residual + self.model)) or 1.0

    def centred(self, kind: str) -> tuple[FloatArray, FloatArray]:
        """Return residual and sensitivity to a cause, with zero mean unless the cause is an offset."""
        direction = self.directions[kind]
        if kind == "force_offset_of_run":
            return self.residual, direction
        return self.residual - self.residual.mean(), direction - direction.mean()


@dataclass(frozen=True, slots=True, eq=False)
class ResidualAnalysis:
    """Residuals of all runs, and sensitivities of the force to the parameters and to possible causes."""

    runs: tuple[PreparedRun, ...]
    residuals: tuple[RunResidual, ...]
    inverse_curvature: FloatArray  # pseudoinverse of the Gram matrix of ``columns`` of all runs
    gradient: FloatArray  # weighted products of sensitivities and residual; zero at the minimum of the cost

    @property
    def levels(self) -> FloatArray:
        """Standard deviation of the residual of each run, divided by the standard deviation of the force."""
        return np.array([float(np.std(each.residual)) / each.force_std_N for each in self.residuals])

    def run_effects(self, kind: str) -> list[Effect]:
        """Return the effect of one cause, estimated separately for each run."""
        effects = []
        for number, run in enumerate(self.residuals):
            effect = self._effect(kind, {number: 1.0})
            relative_weight = 0.01 * run.force_std_N * math.sqrt(run.weight * len(run.residual))
            effects.append(replace(effect, level=effect.level / relative_weight))
        return effects

    def common_effect(self, kind: str, factors: FloatArray | None = None) -> Effect:
        """Return the effect of a cause with one common size in all runs.

        ``factors``, shape (runs,), multiply the common size in each run. The default is 1 for every run.
        """
        scales = np.ones(len(self.residuals)) if factors is None else factors
        return self._effect(kind, dict(enumerate(scales.tolist())))

    def _effect(self, kind: str, factors: Mapping[int, float]) -> Effect:
        """Return the effect of a cause with one common size in the runs of ``factors``.

        The keys of ``factors`` are indices of runs. The values multiply the common size.
        """
        coupling, full_power, product, total, count = np.zeros(len(self.gradient)), 0.0, 0.0, 0.0, 0
        for number, factor in factors.items():
            run = self.residuals[number]
            residual, direction = run.centred(kind)
            coupling += run.weight * factor * (run.columns @ direction)
            full_power += run.weight * factor**2 * float(direction @ direction)
            product += run.weight * factor * float(direction @ residual)
            total += run.weight * float(residual @ residual)
            count += len(residual)
        power = full_power - float(coupling @ self.inverse_curvature @ coupling)
        product -= float(coupling @ self.inverse_curvature @ self.gradient)
        if power <= SETTINGS.cause_power_ratio_min * full_power or total == 0.0:
            return NO_EFFECT
        size = product / power
        fraction = min(size**2 * power / total, 1.0)
        variance = (1.0 - fraction) * total / power / (count / SETTINGS.correlated_samples)
        # The factor 0.01 is needed because the weights express squared errors in %^2.
        return Effect(size, math.sqrt(variance), 0.01 * abs(size) * math.sqrt(power), fraction)


def analyse_residuals(
    damper: Damper, runs: Sequence[PreparedRun], free: Sequence[str] = (), *, suspect: str = ""
) -> ResidualAnalysis:
    """Return the residuals and sensitivities of runs with constant command.

    ``free`` are the names of the fitted parameters that are not at a bound. ``suspect`` is the name of a run
    that was not fitted, but is compared with the model.
    """
    limited = damper.on_limits()
    fits = [one_window(run, len(runs), WINDOW_SETTINGS) for run in runs]
    names = tuple(free) if damper.law.kernel is not None else ()
    drives = [fit.drive for fit in fits]
    if names:
        tangents = map(Tangents(limited, names, drives).evaluate_run, range(len(fits)))
        models = [(each.force, each.combine @ each.columns) for each in tangents]
    else:
        models = [(force, np.zeros((0, len(force)))) for force in simulate_each(limited, drives)]
    peak = max(float(np.abs(fit.force).max()) for fit in fits)
    residuals = []
    for run, fit, (model, columns) in zip(runs, fits, models, strict=True):
        scored, step = slice(fit.start, None), fit.drive.trajectory.step
        directions = {
            "force_gain": model,
            "force_delay": -np.gradient(model, step),
            "command_label": _command_sensitivity(limited, fit, model),
            "force_saturation": -model * (model / peak) ** 2,
            "force_offset_of_run": np.ones_like(model),
            "force_bandwidth": _time_constant_sensitivity(model, step),
        }
        residuals.append(
            RunResidual(
                model[scored],
                fit.force[scored] - model[scored],
                np.zeros_like(columns[:, scored]) if run.name == suspect else columns[:, scored],
                {kind: values[scored] for kind, values in directions.items()},
                fit.weight,
            )
        )
    count = len(names)
    curvature = sum((r.weight * (r.columns @ r.columns.T) for r in residuals), np.zeros((count, count)))
    gradient = sum((r.weight * (r.columns @ r.residual) for r in residuals), np.zeros(count))
    inverse = pseudoinverse(curvature, SETTINGS.singular_value_ratio_min)
    return ResidualAnalysis(tuple(runs), tuple(residuals), inverse, gradient)


def _command_sensitivity(damper: Damper, fit: FitWindow, model: FloatArray) -> FloatArray:
    """Return the derivative of the force with respect to the command, shape (n,) [N/A or N/V].

    The difference quotient is backward, unless the command would become negative. The derivative is zero if
    the changed command is outside the valid range of the model.
    """
    path, constant = fit.drive.trajectory, fit.drive.constant
    step = -SETTINGS.command_step if float(path.command[0]) > SETTINGS.command_step else SETTINGS.command_step
    moved = replace(path, command=path.command + step)
    drive = replace(fit.drive, trajectory=moved, constant=None if constant is None else constant + step)
    try:
        return (simulate(damper, drive) - model) / step
    except InputError:
        return np.zeros_like(model)


def _time_constant_sensitivity(model: FloatArray, step: float) -> FloatArray:
    """Return the derivative of the force with respect to the time constant of a first-order filter [N/s].

    The derivative is approximated by the forces with a typical time constant and without a filter.
    """
    filtered, _ = core.first_order_lag(model, step, SETTINGS.filter_time_constant_s)
    return (filtered - model) / SETTINGS.filter_time_constant_s
