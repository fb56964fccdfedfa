"""The kernel's table algorithm and Runge-Kutta in time, compiled by numba: what one would write by hand.

Bouc-Wen of a yield force alone, squared errors of many candidates on one record. The tables share the method
and no line with the kernel: the universal curve u' = 1 - k u^n, u(0) = 0, is a cubic Hermite table on two
uniform grids, a fine one near zero where u^n bends; a knot comes from the last by a Taylor step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba
import numpy as np

from mrdamper.arrays import FloatArray

__all__ = ["rk4_errors", "table_errors"]

FINE, COARSE = 128, 256  # cells up to NEAR, and from there to the end
NEAR = 0.25
ORDER = 6

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function; it may reorder sums."""
    made: F = numba.njit(fastmath=True, error_model="numpy")(function)
    return made


@compiled
def near_zero(tau: float, k: float, n: float) -> float:
    """Return the curve at a small tau: three terms of its series in tau^n."""
    q, a = k * tau**n, 1.0 / (n + 1.0)
    b = n * a / (2.0 * n + 1.0)
    c = -(0.5 * n * (n - 1.0) * a * a + n * b) / (3.0 * n + 1.0)
    return tau * (1.0 + q * (-a + q * (b + q * c)))


@compiled
def taylor(u: FloatArray, p: FloatArray, h: float, k: float, n: float) -> float:
    """Return u after h, from u[0] and p[0] = u[0]^n: Taylor coefficients from u p' = n p u'."""
    u[1] = 1.0 - k * p[0]
    for j in range(1, ORDER):
        total = 0.0
        for i in range(1, j + 1):
            total += (n * i - (j - i)) * u[i] * p[j - i]
        p[j] = total / (j * u[0])
        u[j + 1] = -k * p[j] / (j + 1)
    out = u[ORDER]
    for j in range(ORDER - 1, -1, -1):
        out = out * h + u[j]
    return out


@compiled
def spacing(n: float) -> float:
    """Return the coarse cells per unit of tau."""
    return COARSE / (26.0 / n + 2.0)


@compiled
def build(cells: FloatArray, work: FloatArray, k: float, n: float, to_one: bool) -> int:  # noqa: FBT001
    """Fill a table and return its cells; the falling branch ends where it reaches 1."""
    u, power, tau = 0.0, 0.0, 0.0
    for i in range(FINE + COARSE):
        if to_one and u >= 1.0:
            return i
        h = NEAR / FINE if i < FINE else 1.0 / spacing(n)
        work[0, 0], work[1, 0] = u, power
        after = near_zero(tau + h, k, n) if i < 8 else taylor(work[0], work[1], h, k, n)
        after = after if to_one else min(after, 1.0)
        slope, rise = 1.0 - k * power, after - u
        power = after**n
        end = 1.0 - k * power
        cells[i, 0], cells[i, 1] = u, slope * h
        cells[i, 2], cells[i, 3] = 3.0 * rise - (2.0 * slope + end) * h, (slope + end) * h - 2.0 * rise
        u, tau = after, tau + h
    return FINE + COARSE


@compiled
def look_up(cells: FloatArray, coarse: float, tau: float) -> float:
    """Return the curve at a tau from 0; beyond the table, its end."""
    at = min(tau, (NEAR + COARSE / coarse) * (1.0 - 1e-12))
    cell = at * (FINE / NEAR) if at < NEAR else FINE + (at - NEAR) * coarse
    i = np.uint32(cell)
    part = cell - i
    return cells[i, 0] + part * (cells[i, 1] + part * (cells[i, 2] + part * cells[i, 3]))


@compiled
def inverse(cells: FloatArray, count: int, coarse: float, u: float) -> float:
    """Return the tau at which the curve is u."""
    low, high = 0, count
    while high - low > 1:
        middle = (low + high) // 2
        if cells[middle, 0] <= u:
            low = middle
        else:
            high = middle
    a, b, c, d = cells[low]
    part = 0.5
    for _ in range(30):
        slope = b + part * (2.0 * c + part * 3.0 * d)
        if not slope > 0.0:
            break
        to = min(max(part - (a + part * (b + part * (c + part * d)) - u) / slope, 0.0), 1.0)
        change, part = abs(to - part), to
        if change < 1e-14:
            break
    return (low + part) * (NEAR / FINE) if low < FINE else NEAR + (low - FINE + part) / coarse


@compiled
def table_errors(
    x: FloatArray, measured: FloatArray, first: np.ndarray, turns: FloatArray, sides: FloatArray,
    values: FloatArray, errors: FloatArray, force: FloatArray,
) -> None:  # fmt: skip
    """Write the sums of squared errors [N^2] of candidates, and the first one's force [N].

    Pieces of motion: first[pieces + 1], turns[pieces + 1], sides[pieces]; a candidate: size, rho, kappa, n.
    """
    rise, fall = np.empty((FINE + COARSE, 4)), np.empty((FINE + COARSE, 4))
    work = np.empty((2, ORDER + 1))
    for j in range(len(values)):
        size, rho, kappa, n = values[j]
        coarse = spacing(n)
        up, down = build(rise, work, 1.0, n, False), build(fall, work, kappa, n, True)  # noqa: FBT003
        start, total = 0.0, 0.0
        for q in range(len(sides)):
            side, i = sides[q], first[q]
            while i < first[q + 1]:  # falling: w < 0 in the direction of motion
                tau = start + rho * side * (x[i] - turns[q])
                if tau >= 0.0:
                    break
                f = -size * side * look_up(fall, coarse, -tau)
                total += (measured[i] - f) ** 2
                if j == 0:
                    force[i] = f
                i += 1
            for m in range(i, first[q + 1]):
                f = size * side * look_up(rise, coarse, start + rho * side * (x[m] - turns[q]))
                total += (measured[m] - f) ** 2
                if j == 0:
                    force[m] = f
            last = start + rho * abs(turns[q + 1] - turns[q])
            w = look_up(rise, coarse, last) if last >= 0.0 else -look_up(fall, coarse, -last)
            start = inverse(rise, up, coarse, -w) if w <= 0.0 else -inverse(fall, down, coarse, w)
        errors[j] = total


@compiled
def rate(w: float, v: float, rho: float, kappa: float, n: float) -> float:
    """Return w' [1/s] at a velocity [m/s]."""
    k = 1.0 if w * v >= 0.0 else kappa
    return rho * v * (1.0 - k * (abs(w) + 1e-300) ** n)


@compiled
def rk4_errors(
    velocity: FloatArray, measured: FloatArray, h: float, rows: FloatArray, force: FloatArray
) -> FloatArray:
    """Return the sums of squared errors [N^2] by Runge-Kutta of order 4, a step a sample."""
    size, rho, kappa, n = rows
    w, errors = np.zeros(len(size)), np.zeros(len(size))
    for i in range(len(measured)):
        if i:
            v0, v1, v2 = velocity[2 * i - 2], velocity[2 * i - 1], velocity[2 * i]
            for j in range(len(size)):
                a = rate(w[j], v0, rho[j], kappa[j], n[j])
                b = rate(w[j] + 0.5 * h * a, v1, rho[j], kappa[j], n[j])
                c = rate(w[j] + 0.5 * h * b, v1, rho[j], kappa[j], n[j])
                d = rate(w[j] + h * c, v2, rho[j], kappa[j], n[j])
                w[j] += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        force[i] = size[0] * w[0]
        for j in range(len(size)):
            errors[j] += (measured[i] - size[j] * w[j]) ** 2
    return errors
