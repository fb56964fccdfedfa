"""Early prediction: from the first minutes of an unknown damper's curve, what it will be later.

No drawing, no card: the two-node model (``two_node``) with its priors, and Bayes' rule. The curve is averaged
over short bins; what the two nodes of the model cannot follow is a third source of error beside noise and
ignorance (``Misfit``). Four hundred dampers are drawn: for each, errors of the curve and of the priors are
drawn, and the damper is the one that fits best with those errors put in (randomised maximum likelihood; exact
for a linear model). Every answer is a share of those dampers: a temperature with its interval, the time to a
limit with infinity among the outcomes.

It holds while the duty and the surroundings stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Option, check_ranges
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, lag_signal
from mrdamper.thermal.estimation.sampling import (
    TimeToLimit,
    draw_evenly,
    first_crossing,
    interval_of,
    summarise_times,
)
from mrdamper.thermal.estimation.two_node import PARAMETERS, PRIOR, simulate_two_node
from mrdamper.thermal.estimation.uncertainty import PredictionInterval

_LOOK_STEP_S = 20.0
_BIN_S = 10.0  # averaged over
_MOST_BINS = 120
_START_SPREAD_K = 2.0  # of the start about the first readings
_LEAST_NOISE_K = 1e-3
_FIRST_ITERATIONS = 60
_ITERATIONS = 10
_WORST_SCORE = 4.0  # of the best fit; 1 is expected
_SETTLED = 0.01  # fall of twice the log-likelihood that is not worth another step
_LONGEST_MOVE = 1.5  # [spreads]
_PROBE = 1e-3  # step of the derivatives, in spreads of the priors


@dataclass(frozen=True, slots=True)
class Misfit:
    """What two nodes cannot follow: an error that is a share of the rise and changes within ``time_s``."""

    share: float  # of the rise so far [-]
    floor_K: float = 0.02
    time_s: float = 120.0


_MISFITS: Mapping[str, Misfit] = MappingProxyType(
    {"fluid": Misfit(0.0017), "wall": Misfit(0.003), "coil": Misfit(0.003)}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionOptions:
    """What is asked of a prediction; times are on the curve's clock."""

    until: Annotated[float, Option("end of the predicted curve", key="until_s", unit="s", above=0.0)] = 1800.0
    limit: Annotated[
        float,
        Option("temperature whose time is asked", key="limit_degC", unit="degC", least=-50.0, most=400.0),
    ] = 403.15  # [K]: the limit of many MR fluids
    look: Annotated[
        float, Option("how far after the curve the limit is looked for", key="look_s", unit="s", above=0.0)
    ] = 14400.0
    probability: Annotated[float, Option("that the intervals hold", above=0.0, below=1.0)] = 0.90
    dampers: Annotated[int, Option("drawn", least=20)] = 400
    seed: Annotated[int, Option("of the draws", least=0)] = 0

    def __post_init__(self) -> None:
        check_ranges(self, "prediction")


@dataclass(frozen=True, slots=True, eq=False)
class TemperaturePrediction:
    """What the first minutes of a curve say of the rest, at the place of the thermometer."""

    curve: HeatingCurve
    ambient: float  # [K]
    interval: PredictionInterval
    parameters: Mapping[str, tuple[float, float, float]]  # of ``two_node.PRIOR``: median, low, high


@dataclass(frozen=True, slots=True, eq=False)
class EarlyPrediction:
    """What is known of a damper after the first minutes of its curve: dampers that fit it.

    Arrays are read-only; ``parameters`` holds what each damper is, per heat capacity (``two_node.PRIOR``).
    """

    curve: HeatingCurve
    ambient: float  # [K]
    parameters: Mapping[str, FloatArray]  # each shape (k,)
    start: FloatArray  # [K], shape (k,)
    off: FloatArray  # the model's error in units of the misfit [-], shape (k,)
    misfit: Misfit

    def temperature(self, time_s: float, *, probability: float = 0.90) -> tuple[float, float, float]:
        """Return median and both ends of the interval of the temperature at a time [K].

        The time is on the curve's clock, the temperature that of the place where the curve was measured.
        """
        return _interval(self.temperatures(np.array([time_s]))[0], probability)

    def temperatures(self, time: FloatArray) -> FloatArray:
        """Return the temperature of each damper at rising times [K], shape (t, k), the misfit included.

        The misfit of a damper is the same share of its rise at all times.
        """
        first = float(self.curve.time[0])
        if not (time > first).all():
            raise InputError(
                place="prediction", found=f"the curve starts at {first:g} s", expected="a later time"
            )
        values = simulate_two_node(self.parameters, self.start, self.ambient, np.append(first, time))[1:]
        spread = np.hypot(self.misfit.floor_K, self.misfit.share * np.abs(values - self.start))
        return np.asarray(values + spread * self.off)

    def time_to(self, limit_K: float, *, probability: float = 0.90, look_s: float = 14400.0) -> TimeToLimit:
        """Return when a temperature is reached, on the curve's clock.

        ``look_s`` is how far after the curve's last time is looked.
        """
        first, last = float(self.curve.time[0]), float(self.curve.time[-1])
        time = np.linspace(first, last + look_s, round((last - first + look_s) / _LOOK_STEP_S) + 2)
        values = np.vstack([self.start, self.temperatures(time[1:])])
        return summarise_times(first_crossing(time, values, limit_K), limit_K, probability, time[-1])


_USUAL = PredictionOptions()


def predict_temperature(
    curve: HeatingCurve, ambient_K: float, options: PredictionOptions = _USUAL
) -> TemperaturePrediction:
    """Return the temperature that an unknown damper will have, from the first minutes of its heating curve.

    Parameters
    ----------
    curve : from when the duty began (or later: the damper need not be at ambient), a minute or more
    ambient_K : air temperature [K], 223 to 373

    Raises
    ------
    InputError
        Less than a minute of curve, an ambient that cannot be, or a time that is not after the curve's first.
    ConvergenceError
        No damper within the priors fits the curve.
    """
    known = predict_early(curve, ambient_K, dampers=options.dampers, seed=options.seed)
    first = float(curve.time[0])
    if not options.until > first:
        raise InputError(
            place="prediction",
            found=f"it should end at {options.until:g} s, the curve starts at {first:g} s",
            expected="a later end",
        )
    time = np.linspace(first, options.until, round((options.until - first) / _LOOK_STEP_S) + 2)[1:]
    probability = options.probability
    return TemperaturePrediction(
        curve,
        ambient_K,
        PredictionInterval(
            time,
            *interval_of(known.temperatures(time), probability),
            probability,
            (known.time_to(options.limit, probability=probability, look_s=options.look),),
        ),
        MappingProxyType({name: _interval(values, probability) for name, values in known.parameters.items()}),
    )


def _interval(values: FloatArray, probability: float) -> tuple[float, float, float]:
    middle, low, high = interval_of(values, probability)
    return float(middle), float(low), float(high)


def predict_early(
    curve: HeatingCurve,
    ambient_K: float,
    *,
    dampers: int = 400,
    seed: int = 0,
) -> EarlyPrediction:
    """Return what the start of a heating curve says of the rest.

    Parameters
    ----------
    curve : from when the duty began (or later: the damper need not be at ambient)
    ambient_K : air temperature [K]
    dampers : how many are drawn

    Raises
    ------
    InputError
        Less than a minute of curve, or an ambient that cannot be.
    ConvergenceError
        No damper within the priors fits the curve.
    """
    if not 223.15 <= ambient_K <= 373.15:
        raise InputError(
            place="prediction", found=f"ambient is {ambient_K - ZERO_CELSIUS_K:g} degC", expected="-50 to 100"
        )
    if float(curve.time[-1] - curve.time[0]) < 60.0:
        raise InputError(
            place=curve.name,
            found=f"it lasts {curve.time[-1] - curve.time[0]:.0f} s",
            expected="a minute or more to predict from",
        )
    problem = _Problem(curve, ambient_K, _MISFITS[curve.place])
    middle = problem.most_probable()
    rng = np.random.default_rng(seed)
    drawn = draw_evenly(rng, problem.rows + 1, dampers, problem.size + 1)
    errors, off = drawn[:-1], drawn[-1]
    parameters, start = problem.parameters(problem.fit(np.repeat(middle, dampers, axis=1), errors))
    return EarlyPrediction(
        curve,
        ambient_K,
        MappingProxyType({name: read_only(values) for name, values in parameters.items()}),
        read_only(start),
        read_only(off),
        problem.misfit,
    )


class _Problem:
    """Residuals of a binned curve and of the priors, all of them of variance 1.

    Coordinates: ``two_node.PARAMETERS``, the thermometer's lag, the start; in spreads from the means.
    """

    def __init__(self, curve: HeatingCurve, ambient: float, misfit: Misfit) -> None:
        self.curve, self.ambient, self.misfit = curve, ambient, misfit
        self.time, self.seen, count = _bins(curve)
        self.size = len(PARAMETERS) + 2
        self._lag = PRIOR["body lag" if curve.place == "wall" else "lag"]
        self.rows = len(self.time) + self.size
        first = max(3, round(0.02 * len(curve)))
        self.start = float(np.median(curve.temperature[: min(first, 9)]))
        noise = max(curve.noise_K, _LEAST_NOISE_K)
        rise = np.hypot(misfit.floor_K, misfit.share * np.abs(self.seen - self.start))
        near = np.exp(-np.abs(self.time[:, None] - self.time[None, :]) / misfit.time_s)
        covariance = rise[:, None] * near * rise[None, :] + np.diag(noise**2 / count)
        # an explicit inverse of a small triangle: many right-hand sides cost one product
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def parameters(self, at: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return parameters and start temperatures at coordinates, shape (size, k)."""
        values = {name: PRIOR[name].value(at[k]) for k, name in enumerate(PARAMETERS)}
        return values, np.asarray(self.start + _START_SPREAD_K * at[-1])

    def residuals(self, at: FloatArray) -> FloatArray:
        """Return the residuals at coordinates, shape (rows, k)."""
        values, start = self.parameters(at)
        time = np.append(self.curve.time[0], self.time)
        lag = self.curve.lag_s or self._lag.value(at[-2])
        shown = lag_signal(time, simulate_two_node(values, start, self.ambient, time), lag)
        return np.vstack([self._whiten @ (shown[1:] - self.seen[:, None]), at])

    def most_probable(self) -> FloatArray:
        """Return the most probable coordinates, shape (size, 1); refuse a curve that no damper follows."""
        best = self.fit(np.zeros((self.size, 1)), np.zeros((self.rows, 1)), iterations=_FIRST_ITERATIONS)
        off = self.residuals(best)[: len(self.time), 0]
        score = float(np.sqrt(np.mean(off**2)))
        if not score < _WORST_SCORE:
            raise ConvergenceError(
                place=self.curve.name,
                found=f"no damper follows it (off by {score:.0f} times its errors)",
                expected=(
                    "the start of a heating curve at a constant duty, from when the duty began, and the "
                    "air's temperature"
                ),
            )
        return best

    def fit(self, start: FloatArray, errors: FloatArray, *, iterations: int = _ITERATIONS) -> FloatArray:
        """Return the coordinates whose residuals come nearest to the errors drawn, column by column.

        Levenberg and Marquardt's method on k problems at once, shapes (size, k) and (rows, k).
        """
        best = start.copy()
        residual = self.residuals(best) - errors
        cost, damping = (residual**2).sum(axis=0), np.ones(best.shape[1])
        for _ in range(iterations):
            slope = self._slope(best, residual + errors)
            normal, pull = slope @ slope.transpose(0, 2, 1), slope @ residual.T[:, :, None]
            # the priors are among the residuals: the matrix is at least 1 on its diagonal
            move = -np.linalg.solve(normal + damping[:, None, None] * np.eye(self.size), pull)[:, :, 0].T
            move *= np.minimum(1.0, _LONGEST_MOVE / np.abs(move).max(axis=0))
            trial = self.residuals(best + move) - errors
            new = (trial**2).sum(axis=0)
            better = new < cost
            settled = np.where(better, cost - new, 0.0) < _SETTLED
            best = np.where(better, best + move, best)
            residual = np.where(better, trial, residual)
            cost = np.where(better, new, cost)
            damping = np.where(better, np.maximum(damping / 10.0, 1e-6), damping * 5.0)
            if settled.all() and better.any():
                break
        return best

    def _slope(self, at: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the residuals' derivatives, shape (k, size, rows)."""
        k = at.shape[1]
        moved = (at[:, None, :] + _PROBE * np.eye(self.size)[:, :, None]).reshape(self.size, -1)
        change = self.residuals(moved).reshape(-1, self.size, k) - residual[:, None, :]
        return np.ascontiguousarray((change / _PROBE).transpose(2, 1, 0))


def _bins(curve: HeatingCurve) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean times, mean temperatures and counts of the samples after the first, bin by bin."""
    length = float(curve.time[-1] - curve.time[0])
    width = max(_BIN_S, length / _MOST_BINS)
    number = np.minimum(((curve.time[1:] - curve.time[0]) / width).astype(int), int(length / width))
    _, which, count = np.unique(number, return_inverse=True, return_counts=True)
    time = np.bincount(which, curve.time[1:]) / count
    seen = np.bincount(which, curve.temperature[1:]) / count
    return time, seen, count.astype(np.float64)
