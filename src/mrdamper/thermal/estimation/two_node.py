r"""A damper's heating in a few parameters, all per heat capacity: the model of a damper nobody has drawn.

Two nodes: what the fluid's temperature reaches at once (fluid, wall, fins), which takes the heat in and gives
it off, and a core behind it, which only stores.

.. math::
    \phi\,\dot T = q\,p(T) - u\,e\,\Bigl(\frac{e^2+\delta^2}{40^2+\delta^2}\Bigr)^{m/2}
    - \kappa (T - T_c), \qquad (1-\phi)\,\dot T_c = \kappa (T - T_c), \quad e = T - T_a

with q = P/C at ambient temperature and u = UA/C at 40 K above it. The power falls with temperature: a share
v as a fluid's viscosity does (Arrhenius, 1400 K), the rest along a straight line of slope s. The loss rises
with the exponent m: about 0.25 in still air and by radiation, 0 in a wind and through mountings. Scaling
power, capacity and losses together changes nothing: nothing absolute is in here, and nothing absolute comes
out.

Which values are likely is ``PRIOR``, a proposal for laboratory and car dampers with or without fins; its
share, settling and lags are what the model needs to follow zone networks of such dampers. What a measured
curve says to it is the business of ``prediction``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.estimation.uncertainty import REFERENCE_EXCESS_K
from mrdamper.thermal.model.stepping import Solver, growing_steps, rosenbrock_step

_VISCOSITY_K = 1400.0
_SMOOTH_K = 5.0  # delta: keeps the film's power smooth through ambient
_LEAST_POWER = 0.05  # of the power at ambient
_FIRST_STEP, _GROWTH, _LONGEST = 2.0, 1.3, 40.0  # [s]


@dataclass(frozen=True, slots=True)
class Prior:
    """What is believed of a number before a curve is seen: a normal law of it, its logarithm or logit."""

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


def _log(middle: float, factor: float, unit: str, description: str) -> Prior:
    return Prior(math.log(middle), math.log(factor), "log", unit, description)


PRIOR: Mapping[str, Prior] = MappingProxyType(
    {
        "heating": _log(0.05, 3.0, "K/s", "P/C at ambient temperature"),
        "loss": _log(1.0 / 1200.0, 2.0, "1/s", "UA/C at 40 K above ambient"),
        "viscous": Prior(-0.9, 0.7, "logit", "-", "share of the power that falls as a viscosity"),
        "slope": Prior(0.001, 0.0007, "line", "1/K", "fall of the rest of the power"),
        "exponent": Prior(0.12, 0.08, "line", "-", "growth of the loss coefficient with the excess"),
        "share": Prior(1.0, 0.8, "logit", "-", "share of the capacity that is at the fluid's temperature"),
        "settling": _log(20.0, 3.0, "s", "time constant between fluid and core"),
        "lag": _log(4.0, 2.0, "s", "time constant of the thermometer, where it is not known"),
        "body lag": _log(12.0, 2.2, "s", "the same of one on the body, with the way through the wall"),
    }
)
"""Beliefs about a damper that nobody has drawn; of the two lags, the one of the thermometer's place holds."""

PARAMETERS = tuple(name for name in PRIOR if "lag" not in name)
"""What ``simulate_two_node`` asks for."""


def simulate_two_node(
    parameters: Mapping[str, FloatArray], start: FloatArray, ambient: float, time: FloatArray
) -> FloatArray:
    """Return the temperature of k dampers at given times [K], shape (t, k).

    Parameters
    ----------
    parameters : each of ``PARAMETERS``, shape (k,)
    start : temperature of everything at the first time [K], shape (k,)
    ambient : [K]
    time : rising [s], shape (t,), at least two

    Notes
    -----
    Steps of 2 s that grow to 40 s, and cubic Hermite polynomials between them.
    """
    system = _TwoNodeSystem(parameters, ambient)
    steps = growing_steps(float(time[-1] - time[0]), _FIRST_STEP, _LONGEST, growth=_GROWTH)
    grid = float(time[0]) + np.append(0.0, np.cumsum(steps))
    states = [np.stack([start, start])]
    for size in np.diff(grid).tolist():
        states.append(rosenbrock_step(system, states[-1], size))
    whole = np.stack(states, axis=1)
    return _hermite(grid, whole[0], system.rate(whole)[0], time)


class _TwoNodeSystem:
    """Heat balances of k dampers as a ``stepping.System``; states: fluid, then core, shape (2, ..., k)."""

    def __init__(self, parameters: Mapping[str, FloatArray], ambient: float) -> None:
        self._share = share = parameters["share"]
        exchange = share * (1.0 - share) / parameters["settling"]
        self._to_fluid, self._to_core = exchange / share, exchange / (1.0 - share)
        self._balance = _balance(parameters, ambient)

    def rate(self, state: FloatArray) -> FloatArray:
        """Return dT/dt [K/s], shape of the state."""
        return self._rate(state, self._balance(state[0])[0])

    def inertia(self, rate: FloatArray) -> FloatArray:
        """Return the rate: the capacity is divided out."""
        return rate

    def linearise(self, state: FloatArray, shrunk: float) -> tuple[FloatArray, Solver]:
        """Return the rate at a state, and the solver of (1 - shrunk J) x = b, of two unknowns."""
        gain, slope = self._balance(state[0])
        a11, a12 = 1.0 + shrunk * (self._to_fluid - slope / self._share), -shrunk * self._to_fluid
        a21, a22 = -shrunk * self._to_core, 1.0 + shrunk * self._to_core
        over = 1.0 / (a11 * a22 - a12 * a21)

        def solve(right: FloatArray) -> FloatArray:
            one, other = right
            return np.stack([(a22 * one - a12 * other) * over, (a11 * other - a21 * one) * over])

        return self._rate(state, gain), solve

    def _rate(self, state: FloatArray, gain: FloatArray) -> FloatArray:
        apart = state[0] - state[1]
        return np.stack([gain / self._share - self._to_fluid * apart, self._to_core * apart])


def _balance(
    parameters: Mapping[str, FloatArray], ambient: float
) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    """Return the function that gives power less loss over the capacity [K/s], and its slope [1/s]."""
    q, u, v, s, m = (parameters[name] for name in PARAMETERS[:5])
    bottom = REFERENCE_EXCESS_K**2 + _SMOOTH_K**2

    def balance(fluid: FloatArray) -> tuple[FloatArray, FloatArray]:
        viscous = v * np.exp(_VISCOSITY_K * (1.0 / fluid - 1.0 / ambient))
        excess = fluid - ambient
        power = viscous + (1.0 - v) * (1.0 - s * excess)
        falls = -viscous * _VISCOSITY_K / fluid**2 - (1.0 - v) * s
        held = power < _LEAST_POWER
        square = excess**2 + _SMOOTH_K**2
        film = u * (square / bottom) ** (0.5 * m)
        return (
            q * np.where(held, _LEAST_POWER, power) - film * excess,
            q * np.where(held, 0.0, falls) - film * (1.0 + m * excess**2 / square),
        )

    return balance


def _hermite(grid: FloatArray, values: FloatArray, rates: FloatArray, time: FloatArray) -> FloatArray:
    place = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, len(grid) - 2)
    h = (grid[place + 1] - grid[place])[:, None]
    x = (time - grid[place])[:, None] / h
    return np.asarray(
        values[place] * (1.0 + 2.0 * x) * (1.0 - x) ** 2
        + values[place + 1] * (3.0 - 2.0 * x) * x**2
        + h * x * (1.0 - x) * (rates[place] * (1.0 - x) - rates[place + 1] * x)
    )
