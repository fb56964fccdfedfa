"""Least squares of a drawing's heating against a measured curve.

The network's multipliers are searched within wide bounds, with or without priors. What the found
multipliers tell of P/C and UA/C is the business of ``calibration``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, EnvelopeError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, lag_signal
from mrdamper.thermal.estimation.uncertainty import REFERENCE_EXCESS_K, ModelUncertainty
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import Load, loads_until
from mrdamper.thermal.model.transient import Heating, simulate_network
from mrdamper.thermal.temperature_rise import Model, build_network

_LONGEST_STEP_S = 20.0
_FACTOR_RANGE = (0.05, 20.0)  # of a multiplier
_START_RANGE_K = 50.0  # of the start about the first readings
_AT_EDGE = 0.01  # of the range's logarithm
_MOST_CORRELATED = 0.999
_LEAST_NOISE_K = 0.02
_TINY_K = 1e-9
_MOST_NOISE_K = 2.0  # of a thermometer
_MOST_LEFT = 0.03  # of a curve's range that a drawing may be off it
_INCREDIBLE = 5.0  # deviations of what was believed
_SURE = 1e-6  # stands for no uncertainty at all [-]
_FAR_OFF_K = 1e3  # stands for a trial that leaves the temperatures that the network knows

NUISANCE: Mapping[str, str] = MappingProxyType(
    {"fluid_wall": "fluid_body", "fluid_core": "fluid_body", "core_axial": "fluid_body", "coil": "coil"}
)
"""Multipliers that are fitted too where a model uncertainty is given, and each one's prior."""


class CurveFit:
    """Least squares of a drawing's heating against a curve.

    What is fitted: the start [K], then logarithms of multipliers: the heat capacity's, that of all
    convection, and with a model uncertainty those that mend the network's first minutes (``NUISANCE``). The
    priors of them, and of capacity and losses, are then residuals of variance 1.
    """

    def __init__(
        self,
        curve: HeatingCurve,
        drawing: DamperDrawing,
        loads: Sequence[Load],
        model: Model,
        model_uncertainty: ModelUncertainty | None,
    ) -> None:
        self._curve, self._drawing, self._model = curve, drawing, model
        self._loads = loads_until(loads, float(curve.time[-1]))
        self._nuisance = tuple(NUISANCE) if model_uncertainty is not None else ()
        self._size = 3 + len(self._nuisance)
        # before the curve: covariance of log capacity and losses (a power that is off shows in
        # both), nuisance parameters
        self._prior = np.zeros((0, 0))
        if model_uncertainty is not None:
            self._prior = np.diag(
                [model_uncertainty.capacity**2, model_uncertainty.loss**2]
                + [getattr(model_uncertainty, NUISANCE[name]) ** 2 for name in self._nuisance]
            )
            self._prior[:2, :2] += model_uncertainty.power**2
            self._prior += _SURE**2 * np.eye(len(self._prior))
        self._whiten = np.linalg.inv(np.linalg.cholesky(self._prior))
        as_drawn = np.zeros(self._size)
        self._drawn = self._logarithms(as_drawn, self._network(as_drawn))

    def drawing(self, at: FloatArray) -> DamperDrawing:
        """Return the drawing with the multipliers at a point."""
        nuisance = dict(zip(self._nuisance, np.exp(at[3:]).tolist(), strict=True))
        return with_multipliers(self._drawing, math.exp(at[1]), math.exp(at[2]), nuisance)

    def solve(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
        """Return the point of least squares, its covariance, and what it leaves of the curve [K].

        Last comes the covariance of the two multipliers' logarithms before the curve; None without priors.
        """
        at, deviation = self._first_point(), max(self._curve.noise_K, _LEAST_NOISE_K)
        at, residual, jacobian = self._search(at, deviation)
        found = max(math.sqrt(variance_of(residual, 3)), _TINY_K)
        if self._nuisance:  # once more, with the deviation that was found beside the priors
            deviation = found
            at, residual, jacobian = self._search(at, deviation)
            found = max(math.sqrt(variance_of(residual, 3)), _TINY_K)
        self._check(at, residual)
        jacobian[: len(residual)] *= deviation / found
        priors = jacobian[len(residual) :, 1:3]
        beforehand = inverse_of(priors.T @ priors) if self._nuisance else None
        return at, inverse_of(jacobian.T @ jacobian), residual, beforehand

    def _search(self, first: FloatArray, deviation: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the point, what it leaves of the curve [K], and the derivatives of all residuals."""
        low, high = (np.full(self._size, math.log(factor)) for factor in _FACTOR_RANGE)
        low[0], high[0] = first[0] - _START_RANGE_K, first[0] + _START_RANGE_K

        def miss(at: FloatArray) -> FloatArray:
            network = self._network(at)
            return np.append(self._off(at, network) / deviation, self._prior_residuals(at, network))

        found = least_squares(
            miss, first, jac="2-point", bounds=(low, high), x_scale=[1.0, *[0.1] * (self._size - 1)],
            xtol=1e-9, ftol=1e-11, gtol=1e-11,
        )  # fmt: skip
        at = np.asarray(found.x)
        if (np.minimum(at - low, high - at)[1:3] < _AT_EDGE).any():
            raise ConvergenceError(
                place=self._curve.name,
                found=_cooling(self._curve)
                + (
                    f"no multipliers from {_FACTOR_RANGE[0]:g} to {_FACTOR_RANGE[1]:g} follow it "
                    f"(heat_capacity {math.exp(at[1]):.3g}, film {math.exp(at[2]):.3g})"
                ),
                expected="a curve of this damper and duty",
                remedy="Check the duty, and emissivity and mount_W_K: losses cannot be less than theirs",
            )
        return at, np.asarray(found.fun)[: len(self._curve)] * deviation, np.array(found.jac)

    def _check(self, at: FloatArray, residual: FloatArray) -> None:
        """Refuse a curve that is not this damper's under this duty."""
        curve = self._curve
        left = float(np.sqrt(np.mean(residual**2)))
        most = max(
            3.0 * min(curve.noise_K, _MOST_NOISE_K), _MOST_LEFT * float(np.ptp(curve.temperature)), 1.0
        )
        if left > most:
            raise ConvergenceError(
                place=curve.name,
                found=_cooling(curve) + f"this damper under this duty is {left:.2g} K off it at best",
                expected=f"{most:.2g} K or less",
                remedy="Check the duty, that time counts from its start, and the sensor",
            )
        off = self._prior_residuals(at, self._network(at))
        if off.size and float(np.abs(off).max()) > _INCREDIBLE:
            raise ConvergenceError(
                place=curve.name,
                found=_cooling(curve)
                + (
                    f"it takes a heat capacity {math.exp(at[1]):.3g} times and a film {math.exp(at[2]):.3g} "
                    "times the drawing's"
                ),
                expected="a curve of this damper and duty",
                remedy="Check the duty, that time counts from its start, and the drawing's lengths",
            )

    def _first_point(self) -> FloatArray:
        """Return where the search starts: the drawing, with more capacity where its network cannot be run."""
        at = np.zeros(self._size)
        at[0] = float(np.median(self._curve.temperature[:5]))
        while True:
            try:
                self._course(at, self._network(at))
            except EnvelopeError as fault:  # a rise that is too high shrinks with more capacity
                at[1] += math.log(2.0)
                if at[1] > math.log(_FACTOR_RANGE[1]):
                    raise ConvergenceError(
                        place=self._curve.name, found=f"the network leaves its range: {fault}"
                    ) from fault
            else:
                return at

    def _network(self, at: FloatArray) -> ThermalNetwork:
        return build_network(self.drawing(at), self._model)

    def _course(self, at: FloatArray, network: ThermalNetwork) -> Heating:
        return simulate_network(network, self._loads, start=float(at[0]), longest_step=_LONGEST_STEP_S)

    def _off(self, at: FloatArray, network: ThermalNetwork) -> FloatArray:
        """Return how far a point's curve is off the measured one [K], shape (n,)."""
        curve = self._curve
        try:
            course = self._course(at, network)
        except EnvelopeError:  # a trial of the search, not the user's
            return np.full(len(curve), _FAR_OFF_K)
        values = {"fluid": course.fluid, "wall": course.wall, "coil": course.coil}[curve.place]
        shown = PchipInterpolator(course.time, values)(np.minimum(curve.time, course.time[-1]))
        return lag_signal(curve.time, shown, curve.lag_s) - curve.temperature

    def _logarithms(self, at: FloatArray, network: ThermalNetwork) -> FloatArray:
        """Return what there are priors of: nothing without a model uncertainty."""
        if not self._nuisance:
            return np.zeros(0)
        warm = network.ambient + REFERENCE_EXCESS_K
        lost = sum(float(np.interp(warm, network.grid, row)) for row in network.watts)
        return np.append(np.log([network.total_capacity, max(lost, 1e-300)]), at[3:])

    def _prior_residuals(self, at: FloatArray, network: ThermalNetwork) -> FloatArray:
        return np.asarray(self._whiten @ (self._logarithms(at, network) - self._drawn))


def _cooling(curve: HeatingCurve) -> str:
    """Say that a curve falls under load, where it does: the fault is rather in it than in the drawing."""
    first, last = (float(np.median(part)) for part in np.array_split(curve.temperature, 4)[::3])
    if first - last < max(3.0 * curve.noise_K, 0.5):
        return ""
    return f"the curve cools by {first - last:.3g} K under load; "


def with_multipliers(
    drawing: DamperDrawing, capacity: float, film: float, nuisance: Mapping[str, float] | None = None
) -> DamperDrawing:
    """Return the drawing with heat capacity, all convection and the nuisance parameters multiplied."""
    given = drawing.calibration
    changed = replace(
        given,
        heat_capacity=given.heat_capacity * capacity,
        film=given.film * film,
        **{name: getattr(given, name) * factor for name, factor in (nuisance or {}).items()},
    )
    sink = drawing.sink
    if sink is not None:
        sink = replace(sink, film_multiplier=sink.film_multiplier * film)
    return replace(drawing, calibration=changed, sink=sink)


def variance_of(residual: FloatArray, parameters: int) -> float:
    """Return the variance of what is left of a fit, raised for residuals that follow each other.

    By the factor (1 + r)/(1 - r) with r the correlation of neighbouring residuals, as for a first order
    autoregression; it also counts what the model cannot follow.
    """
    total = float(residual @ residual)
    follow = float(residual[1:] @ residual[:-1]) / total if total > 0.0 else 0.0
    follow = min(max(follow, 0.0), _MOST_CORRELATED)
    return total / max(len(residual) - parameters, 1) * (1.0 + follow) / (1.0 - follow)


def inverse_of(precision: FloatArray) -> FloatArray:
    """Return a covariance from its inverse, whose entries may be of very different size."""
    scale = np.sqrt(np.diag(precision))
    scale = np.where(scale == 0.0, 1.0, scale)
    joint = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(precision / joint, hermitian=True) / joint)
