"""The series valve's chain carried from step to step, slowly and from its own formulas: for the card plant.

Shares no table with the controllers: powers, tanh and square roots are the library's, the valve's velocity is
solved to convergence. Implicit Euler, for steps of 0.1 ms; extension positive, SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError

__all__ = ["carry_chain"]

_ROUNDS = 200
_REST = 1e-18  # [m/s], too slow to tell from rest
_SLOWEST = 1e-6  # [m/s], below which the dashpot's power is a straight line, as in the kernel


def carry_chain(
    state: tuple[float, float],
    x: FloatArray,
    v: FloatArray,
    travel: FloatArray,
    step_s: float,
    c: Mapping[str, FloatArray | float],
) -> tuple[tuple[float, float], FloatArray]:
    """Return the state after the samples, and the chain's force [N] at each, shape (n,).

    Parameters
    ----------
    state : travel of the spring [m] and velocity of the valve [m/s]
    x, v, travel : displacement [m] and velocity [m/s] at the samples, travel to each from the one before [m]
    c : the law's coefficients, constant or one per sample
    """
    rows = {
        name: np.broadcast_to(np.asarray(row, dtype=np.float64), x.shape).tolist() for name, row in c.items()
    }
    force = np.empty(len(x))
    e, q = state
    for i, (place, speed, way) in enumerate(zip(x.tolist(), v.tolist(), travel.tolist(), strict=True)):
        one = {name: row[i] for name, row in rows.items()}
        q = _valve_velocity(one, place, speed, e + way, step_s, q)
        e += way - step_s * q
        force[i] = _valve(one, place, e, q)[0]
    return (e, q), force


def _valve(c: Mapping[str, float], x: float, e: float, q: float) -> tuple[float, float]:
    """Return the valve's force [N] and its slope in q [N s/m], the spring's travel held."""
    amplitude = c["yield_force"] * (1.0 + c["position_gain"] * x)
    side, size, m = math.tanh(q / c["yield_velocity"]), abs(q), c["thinning_exponent"]
    power = c["thinning"] * size**m
    slope = (1.0 - side * side) / c["yield_velocity"] + m * power / max(size, _REST)
    force = c["offset"] + c["stiffness"] * (x - e) + amplitude * (side + math.copysign(power, q))
    return force, amplitude * slope


def _compliance(c: Mapping[str, float], e: float, rate: float) -> tuple[float, float, float]:
    """Return the force of spring and dashpot [N] and its slopes in e [N/m] and in its rate [N s/m]."""
    k, d, r, m = c["gap_stiffness"], c["gap"], c["gap_corner"], c["leak_exponent"]
    pulled, pushed = math.hypot(e - d, r), math.hypot(e + d, r)
    force = 0.5 * k * (2.0 * e + pulled - pushed)
    slope = 0.5 * k * (2.0 + (e - d) / pulled - (e + d) / pushed)
    per = c["leak_damping"] * max(abs(rate), _SLOWEST) ** (m - 1.0)
    return force + per * rate, slope, per * (m if abs(rate) > _SLOWEST else 1.0)


def _valve_velocity(c: Mapping[str, float], x: float, v: float, e: float, h: float, guess: float) -> float:
    """Return the valve's velocity [m/s] after a step of h; ``e`` is the spring's travel if it stood still."""
    low, high, q = -math.inf, math.inf, guess
    enough = 1e-9 * (c["yield_force"] + 1.0)
    for rounds in range(1, _ROUNDS):
        valve, by_valve = _valve(c, x, e - h * q, q)
        spring, by_spring, by_rate = _compliance(c, e - h * q, v - q)
        balance = valve - spring
        if abs(balance) <= enough:
            return q
        if balance > 0.0:
            high = q
        else:
            low = q
        moved = q - balance / (by_valve + h * (c["stiffness"] + by_spring) + by_rate)
        if (
            not low < moved < high or rounds % 3 == 0
        ):  # near rest the power is steep and Newton's steps are short
            grown = q - math.copysign(4.0 * abs(q) + 1e-6, balance)
            moved = 0.5 * (low + high) if math.isfinite(low + high) else grown
        if moved == q or high - low < _REST:
            return q
        q = moved
    raise ConvergenceError(
        "the series valve's velocity was not found", place="plant", expected=f"it in {_ROUNDS} rounds"
    )
