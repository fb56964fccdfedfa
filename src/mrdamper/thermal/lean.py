"""A damper's heating in a few numbers, all of them per heat capacity: the model of a damper nobody has drawn.

Two nodes: the fluid (with what follows it at once), which takes the heat in, and the body, which gives it off.

.. math::
    \\phi\\,\\dot T_f = q\\,p(T_f) - \\kappa (T_f - T_b), \\qquad
    (1-\\phi)\\,\\dot T_b = \\kappa (T_f - T_b) - u\\,e\\,\\Bigl(\\frac{e^2+\\delta^2}{40^2+\\delta^2}\\Bigr)^{m/2},
    \\quad e = T_b - T_a

with q = P/C at ambient temperature and u = UA/C at 40 K above it. The power falls with temperature: a share v
as a fluid's viscosity does (Arrhenius, 1400 K), the rest along a straight line of slope s. The loss rises with
the exponent m (0.25: natural convection and radiation; 0: forced air and mountings). Scaling power, capacity
and losses together changes nothing: nothing absolute is in here, and nothing absolute comes out.

How likely which numbers are is ``PRIOR``, a proposal for passenger-car and laboratory dampers; what a measured
curve says to that is the business of ``prediction``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from mrdamper.quantities import FloatArray

__all__ = ["NUMBERS", "PRIOR", "Belief", "LeanCourse", "heat_lean"]

_VISCOSITY_K = 1400.0
_AT_EXCESS_K = 40.0
_SMOOTH_K = 5.0  # delta: keeps the film's power smooth through ambient
_LEAST_POWER = 0.05  # of the power at ambient
_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
_FIRST_STEP, _GROWTH, _LONGEST = 2.0, 1.3, 40.0  # [s]


@dataclass(frozen=True, slots=True)
class Belief:
    """What is believed of a number before a curve is seen: normal, of its logarithm or logit where it says so."""

    mean: float
    spread: float
    scale: str  # "line", "log" or "logit"
    unit: str
    description: str

    def value(self, coordinate: FloatArray) -> FloatArray:
        """Return the number [unit] at a coordinate of mean 0 and spread 1."""
        raw = self.mean + self.spread * coordinate
        if self.scale == "log":
            return np.exp(raw)
        return np.asarray(1.0 / (1.0 + np.exp(-raw)) if self.scale == "logit" else raw)


def _log(middle: float, factor: float, unit: str, description: str) -> Belief:
    return Belief(math.log(middle), math.log(factor), "log", unit, description)


PRIOR: Mapping[str, Belief] = MappingProxyType(
    {
        "heating": _log(0.05, 3.0, "K/s", "P/C at ambient temperature"),
        "loss": _log(1.0 / 1200.0, 2.2, "1/s", "UA/C at 40 K above ambient"),
        "viscous": Belief(-0.9, 0.8, "logit", "-", "share of the power that falls as a viscosity"),
        "slope": Belief(0.001, 0.0007, "line", "1/K", "fall of the rest of the power"),
        "exponent": Belief(0.14, 0.07, "line", "-", "growth of the loss coefficient with the excess"),
        "share": Belief(0.4, 0.8, "logit", "-", "share of the capacity that is at the fluid's temperature"),
        "settling": _log(40.0, 2.5, "s", "time constant between fluid and body"),
        "lag": _log(4.0, 2.0, "s", "time constant of the thermometer, where it is not known"),
    }
)
"""Beliefs about a damper that nobody has drawn, in the order of ``NUMBERS``."""

NUMBERS = tuple(PRIOR)


@dataclass(frozen=True, slots=True, eq=False)
class LeanCourse:
    """Courses of k dampers at once, over the times asked for."""

    time: FloatArray  # [s], shape (t,)
    fluid: FloatArray  # [K], shape (t, k)
    body: FloatArray  # [K], shape (t, k)


def heat_lean(
    numbers: Mapping[str, FloatArray], start: FloatArray, ambient: float, time: FloatArray
) -> LeanCourse:
    """Run k dampers from the first of the times to the last.

    Parameters
    ----------
    numbers : each of ``NUMBERS`` but ``lag``, shape (k,)
    start : temperature of fluid and body at the first time [K], shape (k,)
    ambient : [K]
    time : times to return, rising [s], shape (t,)

    Notes
    -----
    ROS2 with steps of 2 s growing to 40 s, and cubic Hermite polynomials between them.
    """
    q, u, v, s, m, share, settling = (numbers[name] for name in NUMBERS[:7])
    exchange = share * (1.0 - share) / settling
    weights = (1.0 / share, 1.0 / (1.0 - share))
    bottom = _AT_EXCESS_K**2 + _SMOOTH_K**2

    def look(fluid: FloatArray, body: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return gain and loss [K/s], and their derivatives by their temperatures."""
        viscous = v * np.exp(_VISCOSITY_K * (1.0 / fluid - 1.0 / ambient))
        power = viscous + (1.0 - v) * (1.0 - s * (fluid - ambient))
        falls = -viscous * _VISCOSITY_K / fluid**2 - (1.0 - v) * s
        held = power < _LEAST_POWER
        power, falls = np.where(held, _LEAST_POWER, power), np.where(held, 0.0, falls)
        excess = body - ambient
        square = excess**2 + _SMOOTH_K**2
        film = u * (square / bottom) ** (0.5 * m)
        return q * power, film * excess, q * falls, film * (1.0 + m * excess**2 / square)

    def rates(
        fluid: FloatArray, body: FloatArray, gain: FloatArray, loss: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        across = exchange * (fluid - body)
        return (gain - across) * weights[0], (across - loss) * weights[1]

    grid = _steps(float(time[0]), float(time[-1]))
    size = (len(grid), len(start))
    fluids, bodies, fluid_rates, body_rates = (np.empty(size) for _ in range(4))
    fluid, body = start.copy(), start.copy()
    for k in range(len(grid)):
        gain, loss, gain_slope, loss_slope = look(fluid, body)
        rate_f, rate_b = rates(fluid, body, gain, loss)
        fluids[k], bodies[k], fluid_rates[k], body_rates[k] = fluid, body, rate_f, rate_b
        if k + 1 == len(grid):
            break
        h = grid[k + 1] - grid[k]
        # I - gamma h J, solved by hand
        g = _GAMMA * h
        a11 = 1.0 - g * (gain_slope - exchange) * weights[0]
        a12 = -g * exchange * weights[0]
        a21 = -g * exchange * weights[1]
        a22 = 1.0 + g * (exchange + loss_slope) * weights[1]
        over = 1.0 / (a11 * a22 - a12 * a21)
        k1f, k1b = (a22 * rate_f - a12 * rate_b) * over, (a11 * rate_b - a21 * rate_f) * over
        gain, loss, _, _ = look(fluid + h * k1f, body + h * k1b)
        rate_f, rate_b = rates(fluid + h * k1f, body + h * k1b, gain, loss)
        rate_f, rate_b = rate_f - 2.0 * k1f, rate_b - 2.0 * k1b
        k2f, k2b = (a22 * rate_f - a12 * rate_b) * over, (a11 * rate_b - a21 * rate_f) * over
        fluid = fluid + h * (1.5 * k1f + 0.5 * k2f)
        body = body + h * (1.5 * k1b + 0.5 * k2b)
    return LeanCourse(
        time, _hermite(grid, fluids, fluid_rates, time), _hermite(grid, bodies, body_rates, time)
    )


def _steps(first: float, last: float) -> FloatArray:
    """Return times that start with short steps, growing."""
    times, step = [first], _FIRST_STEP
    while times[-1] + step < last:
        times.append(times[-1] + step)
        step = min(step * _GROWTH, _LONGEST)
    return np.array([*times, last]) if last > times[-1] else np.array(times)


def _hermite(grid: FloatArray, values: FloatArray, rates: FloatArray, time: FloatArray) -> FloatArray:
    place = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, len(grid) - 2)
    h = (grid[place + 1] - grid[place])[:, None]
    x = (time - grid[place])[:, None] / h
    return np.asarray(
        values[place] * (1.0 + 2.0 * x) * (1.0 - x) ** 2
        + values[place + 1] * (3.0 - 2.0 * x) * x**2
        + h * x * (1.0 - x) * (rates[place] * (1.0 - x) - rates[place + 1] * x)
    )
