"""Calibrate the geometry of a damper with a measured heating curve.

A heating curve determines two ratios: power divided by heat capacity, and conductance to ambient divided by
heat capacity. Therefore two factors are fitted by nonlinear least squares: a factor on the heat capacity
(without fins), and a factor on all convection (body and fins). The initial temperature is also fitted. The
power is not fitted because the damper model computes the power. If the computed power is wrong, the two
factors have the same relative error, and the simulated temperatures are still correct.

The zone network is fitted because its simulation takes only milliseconds. To calibrate a different thermal
model, the temperature difference between this model and the network is subtracted from the measured curve.
Then the fit is repeated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import Load, loads_until
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.temperature_rise import Model, build_network, loads_of, simulate_rise


@dataclass(frozen=True, slots=True)
class ModelUncertainty:
    """Relative standard deviations of thermal properties before a calibration.

    The calibration uses these standard deviations as priors. Without priors, the fit to a short heating
    curve would change a factor on which the curve hardly depends.
    """

    power: float = 0.10
    capacity: float = 0.10
    loss: float = 0.25
    fluid_wall: float = 0.30
    coil: float = 0.30


PRIOR = ModelUncertainty()


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedDrawing:
    """A geometry that was calibrated with a measured heating curve, and the uncertainty of the calibration.

    The *film factor* is the factor on all convection.
    """

    drawing: DamperDrawing  # calibrated geometry
    start_K: float  # fitted uniform temperature at time 0
    # Covariance of initial temperature [K], logarithm of heat-capacity factor and logarithm of film factor.
    covariance: FloatArray  # shape (3, 3)
    curve: HeatingCurve
    fitted_K: FloatArray  # fitted temperature at the times of the curve, shape (n,)
    notes: tuple[str, ...]

    @property
    def heat_capacity(self) -> float:
        """Factor on the heat capacity of the damper without fins [-]."""
        return self.drawing.calibration.heat_capacity

    @property
    def film(self) -> float:
        """Factor on the convection of the body [-]."""
        return self.drawing.calibration.film

    @property
    def heat_capacity_error(self) -> float:
        """Standard error of the heat-capacity factor, if the computed power is exact."""
        return self.heat_capacity * math.sqrt(self.covariance[1, 1])

    @property
    def film_error(self) -> float:
        """Standard error of the film factor, if the computed mechanical power is exact."""
        return self.film * math.sqrt(self.covariance[2, 2])

    @property
    def correlation(self) -> float:
        """Correlation of heat-capacity factor and film factor."""
        return float(self.covariance[1, 2] / math.sqrt(self.covariance[1, 1] * self.covariance[2, 2]))

    @property
    def residual_K(self) -> float:
        """Return the root mean square of measured minus fitted temperature."""
        return float(np.sqrt(np.mean((self.curve.temperature - self.fitted_K) ** 2)))

    @property
    def entries(self) -> dict[str, dict[str, float]]:
        """Return the calibrated values by table and key of the geometry file."""
        sink = self.drawing.sink
        found = {"calibration": {"heat_capacity": self.heat_capacity, "film": self.film}}
        return found if sink is None else found | {"sink": {"film_multiplier": sink.film_multiplier}}


def calibrate_drawing(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    works: Sequence[LoopWork],
    duty: Duty,
    *,
    model: Model = "network",
) -> CalibratedDrawing:
    """Fit heat capacity and convection of a geometry to a measured curve.

    Parameters
    ----------
    curve : measured curve; its time begins at the start of the load cycle [s]
    works : mean mechanical power versus temperature for each segment of the load cycle
    duty : load cycle, at least as long as the curve
    model : thermal model to calibrate

    Raises
    ------
    InputError
        If the curve is longer than the load cycle or begins before it.
    ConvergenceError
        If no geometry reproduces the curve in this load cycle.
    """
    if curve.time[0] < 0.0 or curve.time[-1] > duty.duration * (1.0 + 1e-9):
        raise InputError(
            place=curve.name,
            found=f"the curve runs from {curve.time[0]:g} to {curve.time[-1]:g} s, the duty from 0 to "
            f"{duty.duration:g} s",
            expected="a curve within the duty, its time counted from the duty's start",
        )
    loads = loads_until(loads_of(works, drawing, duty), float(curve.time[-1]))
    fit = _NetworkFit(curve, drawing, loads, model)
    found = fit.solve(np.zeros(len(curve)))
    for _ in range(2 if model == "reduced" else 0):
        found = fit.solve(_model_minus_network(found, works, duty, model))
    return found


def with_factors(drawing: DamperDrawing, capacity: float, film: float) -> DamperDrawing:
    """Return the geometry with additional factors on its heat capacity and on all convection."""
    own, sink = drawing.calibration, drawing.sink
    if sink is not None:
        sink = replace(sink, film_multiplier=sink.film_multiplier * film)
    own = replace(own, heat_capacity=own.heat_capacity * capacity, film=own.film * film)
    return replace(drawing, calibration=own, sink=sink)


def residual_variance(residual: FloatArray, parameters: int) -> float:
    """Return the variance of residuals times (1 + r) / (1 - r); r is the correlation of adjacent residuals.

    The factor is exact for a first-order autoregression. Because an error of the model also correlates
    adjacent residuals, the factor accounts for a part of this error.
    """
    total = float(residual @ residual)
    correlation = float(residual[1:] @ residual[:-1]) / total if total > 0.0 else 0.0
    correlation = min(max(correlation, 0.0), SETTINGS.neighbour_correlation_max)
    return total / max(len(residual) - parameters, 1) * (1.0 + correlation) / (1.0 - correlation)


class _NetworkFit:
    """Least-squares fit of a thermal network to a measured heating curve.

    The parameters are the initial temperature [K] and the logarithms of heat-capacity factor and film factor.
    """

    def __init__(
        self, curve: HeatingCurve, drawing: DamperDrawing, loads: Sequence[Load], model: Model
    ) -> None:
        self._curve, self._drawing, self._loads, self._model = curve, drawing, loads, model
        # An error of the power changes the fitted heat capacity and losses by the same factor.
        covariance = np.diag([PRIOR.capacity**2, PRIOR.loss**2]) + PRIOR.power**2
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        self._as_drawn = self._logarithms(self._network(np.zeros(3)))

    def solve(self, offset: FloatArray) -> CalibratedDrawing:
        """Return the calibration for the measured curve minus an offset [K], shape (n,)."""
        curve, count = self._curve, len(self._curve)
        measured, noise = curve.temperature - offset, max(curve.noise_K, SETTINGS.reading_noise_min_K)
        point = np.array([float(np.median(measured[:5])), 0.0, 0.0])
        factor_min, factor_max = SETTINGS.calibration_factor_range
        low = np.array([point[0] - SETTINGS.start_range_K, *[math.log(factor_min)] * 2])
        high = np.array([point[0] + SETTINGS.start_range_K, *[math.log(factor_max)] * 2])
        # The noise determines the weight of the curve relative to the priors. The second fit uses the noise
        # that follows from the residuals of the first fit.
        for _ in range(2):

            def residuals(at: FloatArray, noise: float = noise) -> FloatArray:
                network = self._network(at)
                prior = self._whiten @ (self._logarithms(network) - self._as_drawn)
                return np.append((self._course(at, network) - measured) / noise, prior)

            found = least_squares(
                residuals, point, bounds=(low, high), x_scale=[1.0, 0.1, 0.1], xtol=1e-9, ftol=1e-11
            )
            point, weighted = np.asarray(found.x), noise
            off = np.asarray(found.fun)[:count] * noise
            noise = max(math.sqrt(residual_variance(off, 3)), 1e-9)
        self._check(point, off)
        jacobian = np.array(found.jac)
        jacobian[:count] *= weighted / noise
        covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        return CalibratedDrawing(
            drawing=with_factors(self._drawing, math.exp(point[1]), math.exp(point[2])),
            start_K=float(point[0]),
            covariance=read_only(covariance),
            curve=curve,
            fitted_K=read_only(curve.temperature + off),
            notes=curve.notes,
        )

    def _network(self, at: FloatArray) -> ThermalNetwork:
        return build_network(with_factors(self._drawing, math.exp(at[1]), math.exp(at[2])), self._model)

    def _logarithms(self, network: ThermalNetwork) -> FloatArray:
        """Return the logarithms of heat capacity and heat loss, for which priors exist."""
        warm = network.ambient + SETTINGS.reference_excess_K
        lost = sum(float(np.interp(warm, network.grid, row)) for row in network.watts)
        return np.log([network.total_capacity, max(lost, 1e-300)])

    def _course(self, at: FloatArray, network: ThermalNetwork) -> FloatArray:
        """Return the simulated temperature of the thermometer at the times of the curve [K], shape (n,)."""
        curve, stop = self._curve, float(network.grid[-1]) - SETTINGS.trial_margin_K
        start, most = float(at[0]), SETTINGS.calibration_step_max_s
        course = simulate_network(network, self._loads, start=start, longest_step=most, stop_at=stop)
        values: FloatArray = getattr(course, curve.place)
        return np.asarray(PchipInterpolator(course.time, values)(np.minimum(curve.time, course.time[-1])))

    def _check(self, point: FloatArray, off: FloatArray) -> None:
        """Raise ConvergenceError if the residual is too large or a factor is at a bound."""
        curve, factors, left = self._curve, np.exp(point[1:]), float(np.sqrt(np.mean(off**2)))
        noise, span = min(curve.noise_K, SETTINGS.reading_noise_max_K), float(np.ptp(curve.temperature))
        most = max(3.0 * noise, SETTINGS.residual_ratio_max * span, 1.0)
        low, high = SETTINGS.calibration_factor_range
        bounded = (factors < 1.01 * low).any() or (factors > 0.99 * high).any()
        if bounded or left > most:
            raise ConvergenceError(
                place=curve.name,
                found=f"this damper under this duty is {left:.2g} K off it at best, with heat_capacity "
                f"{factors[0]:.3g} and film {factors[1]:.3g}",
                expected=f"{most:.2g} K or less, and factors from {low:g} to {high:g}",
                remedy="Check the duty, that time counts from its start, sensor, emissivity and mount_W_K",
            )


def _model_minus_network(
    found: CalibratedDrawing, works: Sequence[LoopWork], duty: Duty, model: Model
) -> FloatArray:
    """Return thermometer temperature by ``model`` minus thermometer by network [K].

    The result has one value for each time of the measured curve.
    """
    curves = [
        simulate_rise(works, found.drawing, duty, model=each, start_K=found.start_K, stop_at_limit=False)
        for each in (model, "network")
    ]
    one, other = (np.interp(found.curve.time, each.time, getattr(each, found.curve.place)) for each in curves)
    return np.asarray(one - other)
