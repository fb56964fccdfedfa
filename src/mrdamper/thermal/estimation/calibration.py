"""Calibration by a measured heating curve: the two combinations it tells, and a drawing that follows it.

A curve tells P/C and UA/C (power and conductance to ambient, over the heat capacity) and nothing else: twice
the power, capacity and losses give the same curve, and film, emissivity and mountings all make one UA. So two
numbers are claimed, with standard errors and their correlation, and the notes say what is not known.

``fit_heating`` fits the two as constants, without a drawing. ``calibrate_drawing`` takes the power from the
card's loop and lets the network say how power and losses change with temperature; what comes back is the
drawing with ``[calibration]`` entries. The heat capacity in it is right only as far as the card's power is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import least_squares

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.notes import Note
from mrdamper.quantities import REFERENCE_K, to_degC
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.curve_fit import (
    NUISANCE,
    CurveFit,
    inverse_of,
    variance_of,
    with_multipliers,
)
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, lag_signal
from mrdamper.thermal.estimation.uncertainty import ModelUncertainty
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.temperature_rise import Model, build_network, loads_of, simulate_rise

_UNTOLD = 0.5  # relative standard error from which a number is not told by the curve
_HARDLY = 0.7  # of what was believed: a curve that leaves more is said to tell hardly anything
_LEAST_EXCESS_K = 1.0

_TO_COMBINATIONS = np.array([[-1.0, 0.0], [-1.0, 1.0]])
"""From the logarithms of capacity and losses, the power being right, to those of P/C and UA/C."""


@dataclass(frozen=True, slots=True)
class HeatingParameters:
    """What one heating curve tells: P/C and UA/C at a temperature, their standard errors and correlation."""

    power_over_capacity: float  # P/C [K/s]
    conductance_over_capacity: float  # UA/C [1/s]
    power_error: float  # standard error [K/s]
    conductance_error: float  # standard error [1/s]
    correlation: float  # of the two [-]
    at_K: float  # temperature that both hold at: the mean of the curve, weighted by the excess over ambient
    start_K: float  # of the damper at the curve's first time
    residual_K: float  # root mean square of what is left
    noise_K: float  # of the thermometer, from neighbouring samples
    notes: tuple[str, ...]

    @property
    def at_degC(self) -> float:
        """``at_K`` [degC]."""
        return to_degC(self.at_K)


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedDrawing:
    """A drawing that follows a measured curve, and what the curve told."""

    drawing: DamperDrawing
    parameters: HeatingParameters
    heat_capacity_error: float  # relative standard error, the card's power taken as right [-]
    film_error: float  # relative standard error [-]
    spread: FloatArray  # covariance of start [K] and logarithms: capacity, losses (the power being right),
    # fluid to body, coil; shape (5, 5)
    curve: HeatingCurve
    fitted_K: FloatArray  # at the curve's times, shape (n,)

    @property
    def heat_capacity(self) -> float:
        """Multiplier of the heat capacity that is now in the drawing."""
        return self.drawing.calibration.heat_capacity

    @property
    def film(self) -> float:
        """Multiplier of the body's convection that is now in the drawing."""
        return self.drawing.calibration.film

    @property
    def entries(self) -> Mapping[str, Mapping[str, float]]:
        """The entries of a drawing's file that hold the calibration, by table: all that are not 1."""
        own = asdict(self.drawing.calibration)
        found = {"calibration": {name: value for name, value in own.items() if value != 1.0}}
        if self.drawing.sink is not None:
            found["sink"] = {"film_multiplier": self.drawing.sink.film_multiplier}
        return MappingProxyType(found)


def fit_heating(curve: HeatingCurve, ambient_K: float) -> HeatingParameters:
    """Return P/C and UA/C of a curve as constants (one node, constant power and conductance).

    T = T_a + (T_0 - T_a) exp(-b t) + a/b (1 - exp(-b t)) with a = P/C and b = UA/C.

    The start T_0 is fitted too, so that the curve may begin anywhere. Of a damper whose power falls and whose
    film rises with temperature these are means over the curve: see ``calibrate_drawing`` for a drawn one, and
    ``prediction`` for what the curve will do.

    Raises
    ------
    ConvergenceError
        No such curve fits.
    """
    time, seen = curve.time - curve.time[0], curve.temperature
    span = float(time[-1])

    def model(at: FloatArray) -> FloatArray:
        # (1 - exp(-x)) / x is 1 at x = 0; noise may take b below zero
        fall = at[1] * time
        gained = np.where(fall == 0.0, 1.0, -np.expm1(-fall) / np.where(fall == 0.0, 1.0, fall))
        course = at[2] + (at[0] - at[1] * (at[2] - ambient_K)) * time * gained
        return lag_signal(time, np.asarray(course), curve.lag_s)

    first = float(np.median(seen[:5]))
    slope = (float(np.median(seen[-5:])) - first) / span
    guess = np.array([slope + (first - ambient_K) / span, 1.0 / span, first])
    scale = np.array([max(abs(slope), 1e-6), 1.0 / span, 1.0])

    def miss(at: FloatArray) -> FloatArray:
        return model(at) - seen

    found = least_squares(miss, guess, jac="3-point", x_scale=scale, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    if not (found.success and np.isfinite(found.x).all()):
        raise ConvergenceError(
            place=curve.name, found=f"the fit of P/C and UA/C did not settle ({found.message})"
        )
    jacobian, residual = np.asarray(found.jac), np.asarray(found.fun)
    covariance = inverse_of(jacobian.T @ jacobian) * variance_of(residual, 3)
    values = found.x[:2]
    return _parameters_of(
        curve, values, covariance[:2, :2], _loss_weighted(seen, ambient_K), float(found.x[2]), residual, ()
    )


def calibrate_drawing(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    works: Sequence[LoopWork],
    duty: Duty,
    *,
    model: Model = "network",
    model_uncertainty: ModelUncertainty | None = None,
) -> CalibratedDrawing:
    """Return the drawing with the multipliers that make its heating the measured one.

    Two are fitted, besides the start: that of the heat capacity (of everything but the fins), and one of all
    convection, the fins' included, which stands for the whole of UA.

    Parameters
    ----------
    curve : time from the start of the duty [s]
    works : the power, one for each segment of the duty; an error in it goes into heat capacity and film alike
    duty : at least as long as the curve
    model_uncertainty : how far P/C and UA/C may be off the drawing's, so that a short curve is enough to go
        on with; None: the curve alone decides

    Raises
    ------
    InputError
        The curve is longer than the duty, or begins before it.
    ConvergenceError
        No multipliers from 0.05 to 20 follow the curve.
    """
    if curve.time[0] < 0.0 or curve.time[-1] > duty.duration * (1.0 + 1e-9):
        raise InputError(
            place=curve.name,
            found=(
                f"it runs from {curve.time[0]:g} to {curve.time[-1]:g} s, the duty from 0 to "
                f"{duty.duration:g} s"
            ),
            expected="a curve within the duty, its time counted from the duty's start",
        )
    loads = loads_of(works, drawing, duty)
    fit = CurveFit(curve, drawing, loads, model, model_uncertainty)
    at, covariance, residual, beforehand = fit.solve()
    changed = fit.drawing(at)
    middle = _loss_weighted(curve.temperature, drawing.surroundings.ambient)
    values, slope = _combinations(changed, loads, model, middle)
    relative = slope @ covariance[1:3, 1:3] @ slope.T
    parameters = _parameters_of(
        curve,
        values,
        relative * np.outer(values, values),
        middle,
        float(at[0]),
        residual,
        (
            "The heat capacity is that of the card's power: a power that is 10 % off puts it, and UA, 10 % "
            "off, and leaves the temperatures right.",
            "The errors take the drawing's way of losing heat as right: with other shares of film, radiation "
            "and mountings the same curve gives a UA/C that differs by some per cent.",
            *_nuisance_notes(relative, slope, beforehand),
        ),
    )
    return CalibratedDrawing(
        drawing=changed,
        parameters=parameters,
        heat_capacity_error=float(math.sqrt(covariance[1, 1])),
        film_error=float(math.sqrt(covariance[2, 2])),
        spread=read_only(_spread(covariance, slope)),
        curve=curve,
        fitted_K=read_only(curve.temperature + residual),
    )


def calibrate_by_model(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    works: Sequence[LoopWork],
    duty: Duty,
    *,
    model: Model,
    model_uncertainty: ModelUncertainty | None = None,
) -> CalibratedDrawing:
    """Return the drawing with which a model's curve is the measured one; see ``calibrate_drawing``.

    The network is fitted to the measured curve less what the model and the network differ by, twice.
    """
    found = calibrate_drawing(curve, drawing, works, duty, model=model, model_uncertainty=model_uncertainty)
    for _ in range(0 if model in ("network", "lumped") else 2):
        off = _model_less_network(found, works, duty, model)
        shifted = replace(curve, temperature=curve.temperature - off)
        again = calibrate_drawing(
            shifted, drawing, works, duty, model=model, model_uncertainty=model_uncertainty
        )
        found = replace(again, curve=curve, fitted_K=read_only(again.fitted_K + off))
    return found


def _model_less_network(
    found: CalibratedDrawing, works: Sequence[LoopWork], duty: Duty, model: Model
) -> FloatArray:
    """Return how much warmer than by the network the thermometer's place is by a model [K], shape (n,)."""
    start = found.parameters.start_K
    curves = [
        simulate_rise(works, found.drawing, duty, model=each, start_K=start, stop_at_limit=False)
        for each in (model, "network")
    ]
    one, other = (np.interp(found.curve.time, each.time, getattr(each, found.curve.place)) for each in curves)
    return np.asarray(one - other)


def _nuisance_notes(relative: FloatArray, slope: FloatArray, beforehand: FloatArray | None) -> list[Note]:
    """Say which parameters are nuisance, and which of P/C and UA/C the curve hardly told."""
    if beforehand is None:
        return []
    form = "The multipliers {names} mend the network's first minutes; nothing is claimed of them."
    said = [Note("nuisance", form, names=", ".join(NUISANCE))]
    before, after = (np.sqrt(np.diag(each)) for each in (slope @ beforehand @ slope.T, relative))
    form = (
        "The curve hardly tells {name} yet: known to {before:.0f} % before it, to {after:.0f} % with it; "
        "what it leaves open is the drawing's."
    )
    return said + [
        Note("hardly_told", form, name=name, before=100.0 * old, after=100.0 * new)
        for name, old, new in zip(("P/C", "UA/C"), before, after, strict=True)
        if new > _HARDLY * old
    ]


def _spread(covariance: FloatArray, slope: FloatArray) -> FloatArray:
    """Return the covariance of start, log capacity, log losses (the power being right), fluid to body, coil.

    ``slope`` leads from the two multipliers to P/C and UA/C.
    """
    turned = np.zeros((5, len(covariance)))
    turned[0, 0] = 1.0
    turned[1:3, 1:3] = np.linalg.inv(_TO_COMBINATIONS) @ slope
    if len(covariance) > 3:
        names = list(NUISANCE)
        turned[3, 3 + names.index("fluid_wall")] = turned[4, 3 + names.index("coil")] = 1.0
    return np.asarray(turned @ covariance @ turned.T)


def _combinations(
    drawing: DamperDrawing, loads: Sequence[Load], model: Model, at_K: float
) -> tuple[FloatArray, FloatArray]:
    """Return P/C and UA/C with everything at one temperature, and their relative slopes.

    The power is that of the load that heats most; slopes are by the logarithms of the two multipliers.
    """
    off = at_K - drawing.surroundings.ambient
    off = math.copysign(max(abs(off), _LEAST_EXCESS_K), off)
    growth = 1.0 + COPPER_PER_K * (at_K - REFERENCE_K)
    watts = max(float(load.power(np.array(at_K))) + load.coil_W * growth for load in loads)

    def combinations(capacity: float, film: float) -> FloatArray:
        network = build_network(with_multipliers(drawing, capacity, film), model)
        lost = sum(float(np.interp(network.ambient + off, network.grid, row)) for row in network.watts)
        return np.array([watts, lost / off]) / network.total_capacity

    h = 1e-4
    here = combinations(1.0, 1.0)
    by_capacity = (combinations(math.exp(h), 1.0) - combinations(math.exp(-h), 1.0)) / (2.0 * h)
    by_film = (combinations(1.0, math.exp(h)) - combinations(1.0, math.exp(-h))) / (2.0 * h)
    size = np.where(here == 0.0, 1.0, here)
    return here, np.column_stack([by_capacity / size, by_film / size])


def _loss_weighted(seen: FloatArray, ambient: float) -> float:
    """Return the mean temperature, weighted by how far off ambient it is: where UA is told best [K]."""
    excess = np.abs(seen - ambient)
    return float(excess @ seen / excess.sum()) if excess.any() else ambient


def _parameters_of(
    curve: HeatingCurve,
    values: FloatArray,
    covariance: FloatArray,
    at_K: float,
    start_K: float,
    residual: FloatArray,
    more: tuple[str, ...],
) -> HeatingParameters:
    errors = np.sqrt(np.diag(covariance))
    joint = float(errors[0] * errors[1])
    correlation = float(covariance[0, 1]) / joint if joint > 0.0 else 0.0
    left = float(np.sqrt(np.mean(residual**2)))
    noise = curve.noise_K
    notes = [
        Note(
            "two_numbers",
            "One heating curve tells P/C and UA/C; power, heat capacity and conductance each, or film, "
            "emissivity and mountings apart, it does not tell.",
        ),
        *more,
    ]
    for name, value, error in zip(("P/C", "UA/C"), values, errors, strict=True):
        if not error < _UNTOLD * abs(value):
            form = (
                "The curve is too short or too noisy for {name}: its standard error is {percent:.0f} % of it."
            )
            percent = 100.0 * error / abs(value) if value else math.inf
            notes.append(Note("not_known", form, name=name, percent=percent))
    if left > 2.0 * noise and left > 0.05:
        form = (
            "The fit leaves {left_K:.2g} K, the thermometer's noise is {noise_K:.2g} K: the model does not "
            "follow the curve, and the errors count that only in part."
        )
        notes.append(Note("fit_leaves", form, left_K=left, noise_K=noise))
    notes += curve.notes
    return HeatingParameters(
        power_over_capacity=float(values[0]),
        conductance_over_capacity=float(values[1]),
        power_error=float(errors[0]),
        conductance_error=float(errors[1]),
        correlation=correlation,
        at_K=at_K,
        start_K=start_K,
        residual_K=left,
        noise_K=noise,
        notes=tuple(notes),
    )
