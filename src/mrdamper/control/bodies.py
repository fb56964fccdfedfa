"""Two bodies from a warm-up: how the fluid's heat reaches the body, without a thermometer in the fluid.

    C_f dT_f/dt = P - G (T_f - T_b)
    C_b dT_b/dt = G (T_f - T_b) - h (T_b - T_a)

Body temperature and power tell three numbers of four: the fluid's capacity C_f must be given (its volume,
density and specific heat; a tenth wrong makes G a tenth wrong). What tells G is how long the body's warmth
is late behind the power, about C_f / G: log at least once in a third of that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError

__all__ = ["Bodies", "identify_bodies", "warm_bodies"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bodies:
    """Fluid and body; the standard errors are relative, 0 where a number was given."""

    conductance_W_K: float  # G, between fluid and body
    fluid_capacity_J_K: float
    body_capacity_J_K: float
    loss_W_K: float  # h, to the surroundings
    errors: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of G, body capacity, loss


def warm_bodies(
    bodies: Bodies, time: FloatArray, power: FloatArray, *, ambient: float, sensor_lag_s: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return fluid's and body's temperature [K], shape (n,), both starting at ambient.

    ``power`` [W] at a sample is held until the next. The body's is read through a lag, if one is given.
    """
    step = np.diff(time)
    c_f, c_b = bodies.fluid_capacity_J_K, bodies.body_capacity_J_K
    g, h = bodies.conductance_W_K, bodies.loss_W_K
    system = np.array([[-g / c_f, g / c_f, 0.0], [g / c_b, -(g + h) / c_b, 0.0], [0.0, 0.0, 0.0]])
    if sensor_lag_s > 0.0:
        system[2] = [0.0, 1.0 / sensor_lag_s, -1.0 / sensor_lag_s]
    drive = np.array([1.0 / c_f, 0.0, 0.0])
    state, rows = np.zeros(3), [np.zeros(3)]
    maps: dict[float, tuple[FloatArray, FloatArray]] = {}
    for dt, watts in zip(np.round(step, 9).tolist(), power[:-1].tolist(), strict=True):
        if dt not in maps:
            maps[dt] = _flow(system, drive, dt)
        over, by = maps[dt]
        state = over @ state + by * watts
        rows.append(state)
    found = np.array(rows) + ambient
    return found[:, 0], found[:, 2 if sensor_lag_s > 0.0 else 1]


def identify_bodies(
    time: FloatArray,
    body: FloatArray,
    power: FloatArray,
    *,
    fluid_capacity_J_K: float,
    ambient: float | None = None,
    sensor_lag_s: float = 0.0,
) -> Bodies:
    """Return the two bodies of a damper that warmed up from rest, soaked.

    Parameters
    ----------
    time : [s], rising, shape (n,)
    body : the thermocouple's reading [K], shape (n,)
    power : mechanical and electrical power [W], held from each sample to the next, shape (n,)
    ambient : [K]; None: the first reading
    sensor_lag_s : of the thermocouple [s]: it would count as part of C_f / G

    Raises
    ------
    InputError
        Fewer than ten samples, lengths that differ, a warm-up of less than 5 K.
    ConvergenceError
        The search found no finite answer.
    """
    from scipy.optimize import least_squares

    if not len(time) == len(body) == len(power) or len(time) < 10 or not (np.diff(time) > 0.0).all():
        raise InputError(
            f"warm-up: lengths are {len(time)}, {len(body)}, {len(power)}; expected one and the same, at "
            "least 10, and a time that rises"
        )
    if not (math.isfinite(fluid_capacity_J_K) and fluid_capacity_J_K > 0.0):
        raise InputError(
            f"warm-up: the fluid's capacity is {fluid_capacity_J_K} J/K; expected a positive number"
        )
    rest = float(body[0]) if ambient is None else ambient
    if not np.ptp(body) >= 5.0:
        raise InputError(
            f"warm-up: the body's temperature moves by {np.ptp(body):.2g} K; expected at least 5 K, or the "
            "heat's way cannot be told from the noise. Log a longer drive"
        )

    def made(point: FloatArray) -> Bodies:
        g, c_b, h = np.exp(point).tolist()
        return Bodies(
            conductance_W_K=g, fluid_capacity_J_K=fluid_capacity_J_K, body_capacity_J_K=c_b, loss_W_K=h
        )

    def wrong(point: FloatArray) -> FloatArray:
        return warm_bodies(made(point), time, power, ambient=rest, sensor_lag_s=sensor_lag_s)[1] - body

    mean, span = float(np.mean(power)), float(time[-1] - time[0])
    c_b = max(mean * span / float(np.ptp(body)) - fluid_capacity_J_K, fluid_capacity_J_K)
    start = np.log([fluid_capacity_J_K / 20.0, c_b, 0.2 * mean / float(np.ptp(body))])
    found = least_squares(wrong, start, bounds=(start - 7.0, start + 7.0), x_scale=0.3)
    if not np.isfinite(found.cost):
        raise ConvergenceError("warm-up: no finite error; check that power and temperature belong together")
    noise = 2.0 * found.cost / max(len(time) - 3, 1)
    jacobian = np.asarray(found.jac)
    spread = np.sqrt(np.maximum(np.diag(noise * np.linalg.pinv(jacobian.T @ jacobian)), 0.0))
    best = made(found.x)
    return Bodies(
        conductance_W_K=best.conductance_W_K,
        fluid_capacity_J_K=fluid_capacity_J_K,
        body_capacity_J_K=best.body_capacity_J_K,
        loss_W_K=best.loss_W_K,
        errors=(float(spread[0]), float(spread[1]), float(spread[2])),
    )


def _flow(system: FloatArray, drive: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the exact map of a linear system over a step with its input held."""
    from scipy.linalg import expm

    n = len(drive)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = system, drive
    moved = expm(whole * step)
    return moved[:n, :n], moved[:n, n]
