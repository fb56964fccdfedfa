"""Least-squares fit of parameters of an actuation, in particular to the force over whole runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate


class SearchParameter(NamedTuple):
    """A parameter of an actuation in a search; ``scale`` and ``margin`` are logarithmic if ``is_log``."""

    name: str
    lower: float
    upper: float
    scale: float
    is_log: bool
    margin: float = 0.0  # The search starts at least so far from the bounds.


class ParameterFit(NamedTuple):
    """The fitted actuation, the standard errors of its fitted parameters, and half the sum of squares."""

    actuation: Actuation
    standard_errors: dict[str, float]
    cost: float


def fit_parameters(
    residual: Callable[[Actuation], FloatArray],
    start: Actuation,
    parameters: Sequence[SearchParameter],
    tolerances: tuple[float, float],
    difference_step: float,
    evaluation_count_max: int | None = None,
) -> ParameterFit:
    """Fit parameters of an actuation by nonlinear least squares. The others keep their values.

    The search ends if the relative change of the parameters or of the cost is below its tolerance.
    ``difference_step`` is the relative step of the derivatives. Standard errors are for independent
    residuals, and NaN for parameters on a bound.
    """
    from scipy.optimize import least_squares  # It takes a quarter of a second to load.

    names, lower, upper, scales, logs, margins = map(np.array, zip(*parameters, strict=True))
    values = np.array([getattr(start, name) for name in names])
    values[logs] = np.log(np.maximum(values, lower)[logs])
    lower[logs], upper[logs] = np.log(lower[logs]), np.log(upper[logs])

    def actuation(point: FloatArray) -> Actuation:
        numbers = np.where(logs, np.exp(point), point).tolist()
        return replace(start, **dict(zip(names.tolist(), numbers, strict=True)))

    def residual_at(point: FloatArray) -> FloatArray:
        return residual(actuation(point))

    result = least_squares(
        residual_at,
        np.clip(values, lower + margins, upper - margins),
        bounds=(lower, upper),
        x_scale=scales,
        diff_step=np.full(len(names), difference_step),
        xtol=tolerances[0],
        ftol=tolerances[1],
        max_nfev=evaluation_count_max,
    )
    span, errors = upper - lower, np.full(len(names), np.nan)
    free = (result.x > lower + 1e-6 * span) & (result.x < upper - 1e-6 * span)
    if free.any():
        jacobian = np.asarray(result.jac)[:, free]
        variance = float(result.fun @ result.fun) / max(len(result.fun) - int(free.sum()), 1)
        covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
        errors[free] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors[logs] *= np.exp(result.x[logs])
    return ParameterFit(
        actuation(result.x), dict(zip(names.tolist(), errors.tolist(), strict=True)), result.cost
    )


def lagged_force(still: Damper, lags: Actuation | None, drive: Drive, oversampling: int) -> FloatArray:
    """Return the force [N] of a damper behind an actuation. The command jumps at its samples."""
    if lags is None:
        return simulate(still, drive)
    path = drive.trajectory
    applied = lags.applied(np.repeat(path.command, oversampling), path.step / oversampling)[::oversampling]
    return simulate(still, replace(drive, trajectory=replace(path, command=applied), constant=None))


class WholeRuns:
    """Whole runs for a fit. Each run is weighted by the root of the sum of its squared force."""

    def __init__(self, still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings) -> None:
        self._still, self._settings = still, settings
        self._runs = [(run, open_drive(run.trajectory), rms(run.force) * math.sqrt(len(run))) for run in runs]

    def error(self, actuation: Actuation) -> FloatArray:
        """Return the weighted force errors at the scored samples of all runs, shape (n,)."""
        errors = []
        for run, drive, size_N in self._runs:
            force = lagged_force(self._still, actuation, drive, self._settings.run_oversampling)
            errors.append(((force - run.force) / size_N)[run.scored_from :])
        return np.concatenate(errors)

    def fit(
        self,
        start: Actuation,
        names: Sequence[str],
        largest: float,
        evaluation_count_max: int | None = None,
        difference_step: float = 1e-3,
    ) -> ParameterFit:
        """Fit the parameters with these names; ``largest`` is the largest command [A or V]."""
        lag = self._settings.lag_min_s, self._settings.lag_max_s, 0.3, True
        loop = 0.0, largest, 0.02 * largest, False
        saturation = (
            self._settings.saturation_min * largest,
            self._settings.saturation_max * largest,
            0.3,
            True,
        )
        kinds = {"play": loop, "wide_play": loop, "saturation": saturation}
        parameters = [SearchParameter(name, *kinds.get(name, lag)) for name in names]
        tolerances = 1e-3, 1e-4
        return fit_parameters(
            self.error, start, parameters, tolerances, difference_step, evaluation_count_max
        )
