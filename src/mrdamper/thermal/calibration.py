"""Calibration by a measured heating curve: the two combinations it tells, and a drawing that follows it.

A curve tells P/C and UA/C (power and conductance to ambient, over the heat capacity) and nothing else: twice
the power, capacity and losses give the same curve, and film, emissivity and mountings all make one UA. So two
numbers are claimed, with standard errors and their correlation, and the words say what is not known.

``fit_heating`` fits the two as constants, without a drawing. ``calibrate_drawing`` takes the power from the
card's loop and lets the network say how power and losses change with temperature; what comes back is the
drawing with ``[calibration]`` entries. The heat capacity in it is right only as far as the card's power is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper
from mrdamper.quantities import FloatArray
from mrdamper.thermal.curve import HeatingCurve, lag_signal
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.rise import Model, build_network, heat_with
from mrdamper.thermal.work import LoopWork, tabulate_work

__all__ = ["CalibratedDrawing", "HeatingNumbers", "calibrate_drawing", "calibrate_with", "fit_heating"]

_LONGEST_STEP_S = 20.0
_FACTOR_RANGE = (0.05, 20.0)  # of a multiplier
_UNTOLD = 0.5  # relative standard error from which a number is not told by the curve
_LEAST_EXCESS_K = 1.0
_MOST_CORRELATED = 0.999


@dataclass(frozen=True, slots=True)
class HeatingNumbers:
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
    words: tuple[str, ...]

    @property
    def time_constant_s(self) -> float:
        """C/UA [s]; infinite where nothing is given off."""
        return 1.0 / self.conductance_over_capacity if self.conductance_over_capacity > 0.0 else math.inf


@dataclass(frozen=True, slots=True)
class CalibratedDrawing:
    """A drawing that follows a measured curve, and what the curve told."""

    drawing: DamperDrawing
    numbers: HeatingNumbers
    heat_capacity: float  # multiplier now in the drawing
    film: float  # multiplier of the body's convection now in the drawing
    fin_film: float | None  # of the fins' convection; None without fins
    heat_capacity_error: float  # relative standard error, the card's power taken as right [-]
    film_error: float  # relative standard error [-]
    curve_K: FloatArray  # the fitted curve at the measured times, shape (n,)

    @property
    def entries(self) -> str:
        """The changed entries as TOML."""
        lines = ["[calibration]", f"heat_capacity = {self.heat_capacity:.4g}", f"film = {self.film:.4g}"]
        if self.fin_film is not None:
            lines += ["", "[sink]", f"film_multiplier = {self.fin_film:.4g}"]
        return "\n".join(lines) + "\n"


def fit_heating(curve: HeatingCurve, ambient_K: float) -> HeatingNumbers:
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
        raise ConvergenceError(f"{curve.name}: the fit of P/C and UA/C did not settle ({found.message})")
    covariance = _covariance(np.asarray(found.jac), np.asarray(found.fun))
    numbers = found.x[:2]
    return _told(
        curve, numbers, covariance[:2, :2], _loss_weighted(seen, ambient_K), float(found.x[2]), found.fun, ()
    )


def calibrate_drawing(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    card: ModelCard | Damper,
    duty: Duty | str = DEFAULT_DUTY,
    *,
    model: Model = "zones",
) -> CalibratedDrawing:
    """Return the drawing with the multipliers that make its heating the measured one.

    Two are fitted, besides the start: that of the heat capacity (of everything but the fins), and one of all
    convection, the fins' included, which stands for the whole of UA.

    Parameters
    ----------
    curve : time from the start of the duty [s]
    card : gives the power; an error in it goes into the heat capacity and the film alike
    duty : at least as long as the curve

    Raises
    ------
    InputError
        The curve is longer than the duty, or begins before it.
    ConvergenceError
        No multipliers from 0.05 to 20 follow the curve.
    """
    damper = card.damper if isinstance(card, ModelCard) else card
    plan = duty if isinstance(duty, Duty) else read_duty(duty)
    if plan.command_unit != damper.command_unit:
        raise InputError(
            f"duty {plan.text!r}: its command is in {plan.command_unit}, the card's in "
            f"{damper.command_unit}; expected the same unit"
        )
    works = [tabulate_work(damper, stretch) for stretch in plan.stretches]
    return calibrate_with(curve, drawing, works, plan, model=model)


def calibrate_with(
    curve: HeatingCurve,
    drawing: DamperDrawing,
    works: Sequence[LoopWork],
    duty: Duty,
    *,
    model: Model = "zones",
) -> CalibratedDrawing:
    """Return the same for work that is known already, one ``LoopWork`` for each stretch of the duty."""
    if curve.time[0] < 0.0 or curve.time[-1] > duty.duration * (1.0 + 1e-9):
        raise InputError(
            f"{curve.name}: it runs from {curve.time[0]:g} to {curve.time[-1]:g} s, the duty from 0 to "
            f"{duty.duration:g} s; expected a curve within the duty, its time counted from the duty's start"
        )
    seen = curve.temperature

    def follow(at: FloatArray) -> FloatArray:
        changed = _multiplied(drawing, math.exp(at[0]), math.exp(at[1]))
        try:
            rise = heat_with(
                works, changed, duty, model=model, start_K=float(at[2]), stop_at_limit=False,
                longest_step=_LONGEST_STEP_S,
            )  # fmt: skip
        except EnvelopeError as fault:  # a trial of the search, not the user's
            raise _TooFarError(str(fault)) from fault
        values = {"fluid": rise.fluid, "wall": rise.wall, "coil": rise.coil}[curve.place]
        return lag_signal(curve.time, PchipInterpolator(rise.time, values)(curve.time), curve.lag_s)

    at, residual, jacobian = _least_squares(follow, curve, np.array([0.0, 0.0, float(np.median(seen[:5]))]))
    capacity, film = math.exp(at[0]), math.exp(at[1])
    changed = _multiplied(drawing, capacity, film)
    covariance = _covariance(jacobian, residual)
    middle = _loss_weighted(seen, drawing.surroundings.ambient)
    numbers, slope = _combinations(changed, works, duty, model, middle)
    told = _told(
        curve,
        numbers,
        (slope @ covariance[:2, :2] @ slope.T) * np.outer(numbers, numbers),
        middle,
        float(at[2]),
        residual,
        (
            "The heat capacity is that of the card's power: a power that is 10 % off puts it, and UA, 10 % "
            "off, and leaves the temperatures right.",
            "The errors take the drawing's way of losing heat as right: with other shares of film, radiation "
            "and mountings the same curve gives a UA/C that differs by some per cent.",
        ),
    )
    return CalibratedDrawing(
        drawing=changed,
        numbers=told,
        heat_capacity=changed.calibration.heat_capacity,
        film=changed.calibration.film,
        fin_film=changed.sink.film_multiplier if changed.sink is not None else None,
        heat_capacity_error=float(math.sqrt(covariance[0, 0])),
        film_error=float(math.sqrt(covariance[1, 1])),
        curve_K=seen + residual,
    )


class _TooFarError(Exception):
    """A trial of the search left the temperatures that the network knows."""


def _least_squares(
    follow: Callable[[FloatArray], FloatArray], curve: HeatingCurve, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return log capacity, log film and start, residuals and derivatives (Levenberg, Marquardt)."""
    probe = np.diag([1e-3, 1e-3, 0.1])
    low, high = np.log(_FACTOR_RANGE)
    # a rise that is too high shrinks with more capacity: start where the network can be run
    while True:
        try:
            residual = follow(at) - curve.temperature
            break
        except _TooFarError as fault:
            at = at + np.array([math.log(2.0), 0.0, 0.0])
            if at[0] > high:
                raise ConvergenceError(f"{curve.name}: the network leaves its range: {fault}") from fault
    cost, damping = float(residual @ residual), 1e-3
    for _ in range(50):
        jacobian = np.column_stack(
            [(follow(at + step) - follow(at - step)) / (2.0 * step.sum()) for step in probe]
        )
        normal, pull = jacobian.T @ jacobian, jacobian.T @ residual
        diagonal = np.diag(np.maximum(np.diag(normal), 1e-12))
        while True:
            move = -np.linalg.solve(normal + damping * diagonal, pull)
            move *= min(1.0, 1.0 / float(np.abs(move[:2]).max() + 1e-300))
            trial = at + move
            trial[:2] = np.clip(trial[:2], low, high)
            try:
                new = follow(trial) - curve.temperature
                new_cost = float(new @ new)
            except _TooFarError:
                new, new_cost = residual, math.inf
            if new_cost <= cost or damping > 1e9:
                break
            damping *= 8.0
        settled = float(np.abs(trial - at).max()) < 1e-7 or cost - new_cost < 1e-12 * cost
        if new_cost <= cost:
            at, residual, cost = trial, new, new_cost
        damping = max(damping / 10.0, 1e-9)
        if settled or damping > 1e8:
            break
    if (np.abs(at[:2] - low) < 1e-9).any() or (np.abs(at[:2] - high) < 1e-9).any():
        raise ConvergenceError(
            f"{curve.name}: no multipliers from {_FACTOR_RANGE[0]:g} to {_FACTOR_RANGE[1]:g} follow it "
            f"(heat_capacity {math.exp(at[0]):.3g}, film {math.exp(at[1]):.3g}); expected a curve of this "
            "damper and duty. Check the duty, emissivity and mount_W_K (losses cannot be less than theirs)"
        )
    return at, residual, jacobian


def _multiplied(drawing: DamperDrawing, capacity: float, film: float) -> DamperDrawing:
    """Return the drawing with its heat capacity and all its convection multiplied."""
    given = drawing.calibration
    changed = replace(given, heat_capacity=given.heat_capacity * capacity, film=given.film * film)
    sink = drawing.sink
    if sink is not None:
        sink = replace(sink, film_multiplier=sink.film_multiplier * film)
    return replace(drawing, calibration=changed, sink=sink)


def _combinations(
    drawing: DamperDrawing, works: Sequence[LoopWork], duty: Duty, model: Model, at_K: float
) -> tuple[FloatArray, FloatArray]:
    """Return P/C and UA/C with everything at one temperature, and their relative slopes."""
    ambient = drawing.surroundings.ambient
    off = max(abs(at_K - ambient), _LEAST_EXCESS_K) * (1.0 if at_K >= ambient else -1.0)
    # the stretch that heats most
    warm = [float(work.power_at(at_K)) for work in works]
    k = int(np.argmax(warm))
    watts = warm[k] + _coil_watts(drawing, duty, k, at_K)

    def numbers(capacity: float, film: float) -> FloatArray:
        network = build_network(_multiplied(drawing, capacity, film), model)
        lost = sum(float(np.interp(ambient + off, network.grid, row)) for row in network.watts)
        return np.array([watts, lost / off]) / network.total_capacity

    h = 1e-4
    here = numbers(1.0, 1.0)
    by_capacity = (numbers(math.exp(h), 1.0) - numbers(math.exp(-h), 1.0)) / (2.0 * h)
    by_film = (numbers(1.0, math.exp(h)) - numbers(1.0, math.exp(-h))) / (2.0 * h)
    size = np.where(here == 0.0, 1.0, here)
    return here, np.column_stack([by_capacity / size, by_film / size])


def _coil_watts(drawing: DamperDrawing, duty: Duty, k: int, at_K: float) -> float:
    command, coil = duty.stretches[k].command, drawing.coil
    amperes = command if duty.command_unit == "A" else command * (coil.amperes_per_volt or 0.0)
    return amperes**2 * coil.resistance_at(at_K)


def _loss_weighted(seen: FloatArray, ambient: float) -> float:
    """Return the mean temperature, weighted by how far off ambient it is: where UA is told best [K]."""
    excess = np.abs(seen - ambient)
    return float(excess @ seen / excess.sum()) if excess.any() else ambient


def _covariance(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of a fit, raised for residuals that follow each other.

    By the factor (1 + r)/(1 - r) with r the correlation of neighbouring residuals, as for a first order
    autoregression; it also counts what the model cannot follow.
    """
    n, size = jacobian.shape
    variance = float(residual @ residual) / max(n - size, 1)
    total = float(residual @ residual)
    follow = float(residual[1:] @ residual[:-1]) / total if total > 0.0 else 0.0
    follow = min(max(follow, 0.0), _MOST_CORRELATED)
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale == 0.0, 1.0, scale)
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), hermitian=True)
    return np.asarray(inverse / np.outer(scale, scale) * variance * (1.0 + follow) / (1.0 - follow))


def _told(
    curve: HeatingCurve,
    numbers: FloatArray,
    covariance: FloatArray,
    at_K: float,
    start_K: float,
    residual: FloatArray,
    more: tuple[str, ...],
) -> HeatingNumbers:
    errors = np.sqrt(np.diag(covariance))
    joint = float(errors[0] * errors[1])
    correlation = float(covariance[0, 1]) / joint if joint > 0.0 else 0.0
    left = float(np.sqrt(np.mean(residual**2)))
    noise = curve.noise_K
    words = [
        "One heating curve tells P/C and UA/C; power, heat capacity and conductance each, or film, "
        "emissivity and mountings apart, it does not tell.",
        *more,
    ]
    for name, value, error in zip(("P/C", "UA/C"), numbers, errors, strict=True):
        if not error < _UNTOLD * abs(value):
            words.append(
                f"The curve is too short or too noisy for {name}: its standard error is "
                f"{100.0 * error / abs(value) if value else math.inf:.0f} % of it."
            )
    if left > 2.0 * noise and left > 0.05:
        words.append(
            f"The fit leaves {left:.2g} K, the thermometer's noise is {noise:.2g} K: the model does not "
            "follow the curve, and the errors count that only in part."
        )
    words += curve.notes
    return HeatingNumbers(
        power_over_capacity=float(numbers[0]),
        conductance_over_capacity=float(numbers[1]),
        power_error=float(errors[0]),
        conductance_error=float(errors[1]),
        correlation=correlation,
        at_K=at_K,
        start_K=start_K,
        residual_K=left,
        noise_K=noise,
        words=tuple(words),
    )
