"""Calibration of a damper's geometry file by a measured heating curve.

A heating curve determines two numbers, P/C and UA/C: power and conductance to ambient, both divided by the
heat capacity. Therefore two factors are fitted by nonlinear least squares: one of the heat capacity (of
everything but the fins) and one of all convection (of body and fins). The starting temperature is fitted as
well. The power is the card's. An error of the power changes both factors alike and leaves the temperatures
right.

The zone network is fitted because it solves in milliseconds. For another thermal model the difference
between that model and the network along the curve is subtracted from the measurement, and the fit is
repeated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import Load, loads_until
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.temperature_rise import Model, build_network, loads_of, simulate_rise

STEP_MAX_S = 20.0
FACTOR_MIN, FACTOR_MAX = 0.05, 20.0  # A factor outside means that curve and duty do not belong together.
START_RANGE_K = 50.0  # The start is searched within this distance of the first readings.
NOISE_MIN_K = 0.02
NOISE_MAX_K = 2.0
RESIDUAL_MAX_RATIO = 0.03  # A residual above this fraction of the curve's range is another damper's curve.
NEIGHBOUR_CORRELATION_MAX = 0.999
REFERENCE_EXCESS_K = 40.0  # Losses are compared at this excess over ambient.
UNDETERMINED_RATIO = (
    0.7  # A curve that leaves more than this fraction of a prior deviation determines little.
)
OFF_ENVELOPE_K = 1e3  # Residual of a trial whose temperatures leave the tables.


@dataclass(frozen=True, slots=True)
class ModelUncertainty:
    """Relative standard deviations of a geometry file and a card that nothing was measured of.

    They are priors of the calibration, so that a short curve does not move what it cannot determine.
    """

    power: float = 0.10
    capacity: float = 0.10
    loss: float = 0.25
    fluid_wall: float = 0.30
    coil: float = 0.30


PRIOR = ModelUncertainty()


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedDrawing:
    """A geometry whose heating follows a measured curve, and how well the curve determines it."""

    drawing: DamperDrawing  # with the factors
    start_K: float  # of everything at time 0
    covariance: FloatArray  # of start [K], log heat-capacity factor and log film factor, shape (3, 3)
    curve: HeatingCurve
    fitted_K: FloatArray  # at the curve's times, shape (n,)
    notes: tuple[str, ...]

    @property
    def heat_capacity(self) -> float:
        """Factor of the heat capacity."""
        return self.drawing.calibration.heat_capacity

    @property
    def film(self) -> float:
        """Factor of the body's convection."""
        return self.drawing.calibration.film

    @property
    def heat_capacity_error(self) -> float:
        """Standard error of the heat-capacity factor, the card's power taken as exact."""
        return self.heat_capacity * math.sqrt(self.covariance[1, 1])

    @property
    def film_error(self) -> float:
        """Standard error of the film factor."""
        return self.film * math.sqrt(self.covariance[2, 2])

    @property
    def correlation(self) -> float:
        """Correlation of the two factors."""
        return float(self.covariance[1, 2] / math.sqrt(self.covariance[1, 1] * self.covariance[2, 2]))

    @property
    def residual_K(self) -> float:
        """Root mean square of curve less fit."""
        return float(np.sqrt(np.mean((self.curve.temperature - self.fitted_K) ** 2)))

    @property
    def entries(self) -> Mapping[str, Mapping[str, float]]:
        """The entries of the geometry file that hold the calibration, by table."""
        found = {"calibration": {"heat_capacity": self.heat_capacity, "film": self.film}}
        if self.drawing.sink is not None:
            found["sink"] = {"film_multiplier": self.drawing.sink.film_multiplier}
        return MappingProxyType(found)


def calibrate_drawing(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    works: Sequence[LoopWork],
    duty: Duty,
    *,
    model: Model = "network",
    prior: ModelUncertainty = PRIOR,
) -> CalibratedDrawing:
    """Fit a geometry's heat capacity and convection to a measured curve.

    Parameters
    ----------
    curve : time from the start of the duty [s]
    works : of the card's loop, one for each segment of the duty
    duty : at least as long as the curve
    model : thermal model whose curve is to follow the measured one

    Raises
    ------
    InputError
        The curve is longer than the duty, or begins before it.
    ConvergenceError
        The damper under this duty cannot follow the curve.
    """
    if curve.time[0] < 0.0 or curve.time[-1] > duty.duration * (1.0 + 1e-9):
        raise InputError(
            place=curve.name,
            found=f"the curve runs from {curve.time[0]:g} to {curve.time[-1]:g} s, the duty from 0 to "
            f"{duty.duration:g} s",
            expected="a curve within the duty, its time counted from the duty's start",
        )
    loads = loads_until(loads_of(works, drawing, duty), float(curve.time[-1]))
    fit = _NetworkFit(curve, drawing, loads, model, prior)
    found = fit.solve(np.zeros(len(curve)))
    for _ in range(0 if model in ("network", "lumped") else 2):
        found = fit.solve(_model_less_network(found, works, duty, model))
    return found


def with_factors(drawing: DamperDrawing, capacity: float, film: float) -> DamperDrawing:
    """Return the geometry with its heat capacity and all of its convection multiplied."""
    own, sink = drawing.calibration, drawing.sink
    if sink is not None:
        sink = replace(sink, film_multiplier=sink.film_multiplier * film)
    own = replace(own, heat_capacity=own.heat_capacity * capacity, film=own.film * film)
    return replace(drawing, calibration=own, sink=sink)


def residual_variance(residual: FloatArray, parameters: int) -> float:
    """Return the variance of residuals, raised for correlation of neighbours.

    The factor (1 + r) / (1 - r), with r the correlation of neighbouring residuals, is that of a first-order
    autoregression. It also covers part of what the model cannot follow.
    """
    total = float(residual @ residual)
    correlation = float(residual[1:] @ residual[:-1]) / total if total > 0.0 else 0.0
    correlation = min(max(correlation, 0.0), NEIGHBOUR_CORRELATION_MAX)
    return total / max(len(residual) - parameters, 1) * (1.0 + correlation) / (1.0 - correlation)


class _NetworkFit:
    """Least squares of start [K], log heat-capacity factor and log film factor against a curve."""

    def __init__(
        self,
        curve: HeatingCurve,
        drawing: DamperDrawing,
        loads: Sequence[Load],
        model: Model,
        prior: ModelUncertainty,
    ) -> None:
        self._curve, self._drawing, self._loads, self._model = curve, drawing, loads, model
        # An error of the power appears in capacity and losses alike.
        covariance = np.diag([prior.capacity**2, prior.loss**2]) + prior.power**2
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        self._as_drawn = self._logarithms(self._network(np.zeros(3)))

    def solve(self, offset: FloatArray) -> CalibratedDrawing:
        """Return the calibration by the curve less an offset [K], shape (n,)."""
        curve, count = self._curve, len(self._curve)
        measured = curve.temperature - offset
        point, noise = self._first_point(), max(curve.noise_K, NOISE_MIN_K)
        start = float(np.median(measured[:5]))
        low, high = (np.full(3, math.log(factor)) for factor in (FACTOR_MIN, FACTOR_MAX))
        low[0], high[0] = start - START_RANGE_K, start + START_RANGE_K
        point[0] = start
        for _ in range(2):  # The second time with the deviation that was found, which weighs the priors.

            def residuals(at: FloatArray, noise: float = noise) -> FloatArray:
                network = self._network(at)
                off = self._course(at, network) - measured
                prior = self._whiten @ (self._logarithms(network) - self._as_drawn)
                return np.append(off / noise, prior)

            found = least_squares(
                residuals, point, bounds=(low, high), x_scale=[1.0, 0.1, 0.1], xtol=1e-9, ftol=1e-11,
                gtol=1e-11
            )  # fmt: skip
            point, weighted = np.asarray(found.x), noise
            off = np.asarray(found.fun)[:count] * noise
            noise = max(math.sqrt(residual_variance(off, 3)), 1e-9)
        self._check(point, off, low, high)
        jacobian = np.array(found.jac)
        jacobian[:count] *= weighted / noise
        return CalibratedDrawing(
            drawing=with_factors(self._drawing, math.exp(point[1]), math.exp(point[2])),
            start_K=float(point[0]),
            covariance=read_only(np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)),
            curve=curve,
            fitted_K=read_only(curve.temperature + off),
            notes=self._notes(off, jacobian, count),
        )

    def _network(self, at: FloatArray) -> ThermalNetwork:
        return build_network(with_factors(self._drawing, math.exp(at[1]), math.exp(at[2])), self._model)

    def _logarithms(self, network: ThermalNetwork) -> FloatArray:
        """Return the logarithms of heat capacity and losses, which the priors refer to."""
        warm = network.ambient + REFERENCE_EXCESS_K
        lost = sum(float(np.interp(warm, network.grid, row)) for row in network.watts)
        return np.log([network.total_capacity, max(lost, 1e-300)])

    def _course(self, at: FloatArray, network: ThermalNetwork) -> FloatArray:
        """Return the temperature at the thermometer's place at the curve's times [K], shape (n,)."""
        curve = self._curve
        try:
            course = simulate_network(network, self._loads, start=float(at[0]), longest_step=STEP_MAX_S)
        except EnvelopeError:  # A trial of the search left the tables. That is not the user's fault.
            return curve.temperature + OFF_ENVELOPE_K
        values = {"fluid": course.fluid, "wall": course.wall, "coil": course.coil}[curve.place]
        return np.asarray(PchipInterpolator(course.time, values)(np.minimum(curve.time, course.time[-1])))

    def _first_point(self) -> FloatArray:
        """Return the geometry as drawn, with more heat capacity if its network leaves the tables."""
        point = np.array([float(np.median(self._curve.temperature[:5])), 0.0, 0.0])
        while (self._course(point, self._network(point)) - self._curve.temperature >= OFF_ENVELOPE_K).all():
            point[1] += math.log(2.0)
            if point[1] > math.log(FACTOR_MAX):
                raise ConvergenceError(
                    place=self._curve.name,
                    found="the damper under this duty leaves the temperatures at which losses are known",
                    remedy="Check the duty and the geometry",
                )
        return point

    def _check(self, point: FloatArray, off: FloatArray, low: FloatArray, high: FloatArray) -> None:
        """Raise ConvergenceError if the curve is not this damper's under this duty."""
        curve = self._curve
        first, last = (float(np.median(part)) for part in np.array_split(curve.temperature, 4)[::3])
        cools = first - last > max(3.0 * curve.noise_K, 0.5)
        cooling = f"the curve cools by {first - last:.3g} K under load; " if cools else ""
        if (np.minimum(point - low, high - point)[1:] < 0.01).any():
            raise ConvergenceError(
                place=curve.name,
                found=f"{cooling}no factors from {FACTOR_MIN:g} to {FACTOR_MAX:g} follow it (heat_capacity "
                f"{math.exp(point[1]):.3g}, film {math.exp(point[2]):.3g})",
                expected="a curve of this damper and duty",
                remedy="Check the duty, and emissivity and mount_W_K: losses cannot be less than theirs",
            )
        left = float(np.sqrt(np.mean(off**2)))
        most = max(
            3.0 * min(curve.noise_K, NOISE_MAX_K), RESIDUAL_MAX_RATIO * float(np.ptp(curve.temperature)), 1.0
        )
        if left > most:
            raise ConvergenceError(
                place=curve.name,
                found=f"{cooling}this damper under this duty is {left:.2g} K off it at best",
                expected=f"{most:.2g} K or less",
                remedy="Check the duty, that time counts from its start, and the sensor",
            )

    def _notes(self, off: FloatArray, jacobian: FloatArray, count: int) -> tuple[str, ...]:
        """Return what a reader of the factors should know."""
        notes: list[str] = [
            "The heat capacity refers to the card's power. A power that is 10 % off changes both factors by "
            "10 % and leaves the temperatures right.",
        ]
        with_curve = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)[1:, 1:]
        priors = jacobian[count:, 1:]
        before = np.linalg.pinv(priors.T @ priors, hermitian=True)
        notes += [
            (f"The curve hardly determines the {name} factor. Most of its uncertainty is the prior's.")
            for name, after, prior in zip(
                ("heat-capacity", "film"), np.diag(with_curve), np.diag(before), strict=True
            )
            if after > UNDETERMINED_RATIO**2 * prior
        ]
        left, noise = float(np.sqrt(np.mean(off**2))), self._curve.noise_K
        if left > max(2.0 * noise, 0.05):
            notes.append(
                f"The fit leaves {left:.2g} K, the thermometer's noise is {noise:.2g} "
                "K. The errors include this difference only in part."
            )
        return (*notes, *self._curve.notes)


def _model_less_network(
    found: CalibratedDrawing, works: Sequence[LoopWork], duty: Duty, model: Model
) -> FloatArray:
    """Return model less network at the thermometer's place and the curve's times [K], shape (n,)."""
    curves = [
        simulate_rise(works, found.drawing, duty, model=each, start_K=found.start_K, stop_at_limit=False)
        for each in (model, "network")
    ]
    one, other = (np.interp(found.curve.time, each.time, getattr(each, found.curve.place)) for each in curves)
    return np.asarray(one - other)
