"""Time integration of all thermal models: loads, Rosenbrock step, growing steps, energy balance.

A model is a ``System`` M dy/dt = f(y). Its state y contains temperatures, then the heat flows of all losses
and of the two sources (mechanical power, coil heat), integrated since the start. A time step conserves every
linear combination of states that is constant in the exact solution. "Heat stored + energy out - energy in" is
such a combination. Therefore the energy balance has only rounding errors.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol

import numpy as np
from scipy.optimize import brentq

from mrdamper.arrays import FloatArray

Part = Literal["gap", "coil", "seal"]
"""Parts with a temperature limit."""

Solver = Callable[[FloatArray], FloatArray]
"""Function that solves a linear system for one right-hand side."""

_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # This coefficient makes the Rosenbrock method L-stable.

FIRST_STEP_S = 1.0
"""First time step after a change of load. It is short because fluid layer and coil settle within seconds."""

STEP_GROWTH_RATIO = 1.4  # ratio of two consecutive time steps
TIME_TOLERANCE_S = 1e-9  # A shorter time counts as zero.
STEP_TOLERANCE_S = 1e-7  # tolerance of the time at which a given temperature is reached


@dataclass(frozen=True, slots=True)
class Load:
    """Heat sources for a duration: mechanical power as a function of fluid temperature, and coil heat.

    ``power`` is a function of the fluid temperature [K], any shape, and returns the mechanical power [W].
    ``coil_W`` is the coil heat at 20 degC. The coil heat increases with temperature like the resistance of
    copper.
    """

    duration: float  # duration of the load [s]
    power: Callable[[FloatArray], FloatArray]
    coil_W: float = 0.0

    def scaled(self, factor: float) -> Load:
        """Return the load with its mechanical power multiplied by a factor."""
        return replace(self, power=lambda kelvin: np.asarray(factor * self.power(kelvin)))


def loads_until(loads: Sequence[Load], time_s: float) -> list[Load]:
    """Return the loads before a time [s]; the last load is shortened."""
    kept, left = [], time_s
    for load in loads:
        if left <= TIME_TOLERANCE_S:
            break
        kept.append(replace(load, duration=min(load.duration, left)))
        left -= load.duration
    return kept


class System(Protocol):
    """A thermal model M dy/dt = f(y) under one load at a time.

    A state contains n temperatures (or reduced unknowns), then the integrated heat of the losses and sources.
    """

    nodes: int  # number n of temperatures

    def take(self, load: Load) -> None:
        """Set the heat sources of a load."""

    def rate(self, state: FloatArray) -> FloatArray:
        """Return the right-hand side f(y) at a state, with the shape of the state."""

    def linearise(self, state: FloatArray, shrunk: float) -> tuple[FloatArray, Solver]:
        """Return f(y) at a state, and a function that solves (M - ``shrunk`` df/dy) x = b for x.

        ``shrunk`` is the time step [s] times gamma, a coefficient of the Rosenbrock method.
        """

    def inertia(self, rate: FloatArray) -> FloatArray:
        """Return the product of M and a time derivative of the state."""

    def fluid(self, state: FloatArray) -> float:
        """Return the mean fluid temperature of a state [K]."""

    def balance(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the state after a step, corrected so that the energy balance closes."""


def rosenbrock_step(system: System, state: FloatArray, size: float) -> FloatArray:
    r"""Return the state after a time step [s] by the Rosenbrock method ROS2; the shape is unchanged.

    .. math::
        (M - \gamma h J) k_1 &= f(y), \quad (M - \gamma h J) k_2 = f(y + h k_1) - 2 M k_1 \\
        y &\leftarrow y + h (3 k_1 + k_2) / 2, \quad \gamma = 1 - 1/\sqrt{2}

    Notes
    -----
    The order is 2 for any matrix J, so a system can omit parts of J. The method has two stages and is
    L-stable. Source: Verwer, Spee, Blom & Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456-1480; the order is
    tested.
    """
    rate, solve = system.linearise(state, _GAMMA * size)
    first = solve(rate)
    second = solve(system.rate(state + size * first) - 2.0 * system.inertia(first))
    return state + size * (1.5 * first + 0.5 * second)


class Solution(NamedTuple):
    """Results at the start and at the end of each time step."""

    time: FloatArray  # [s], shape (k,)
    temperature: FloatArray  # first n unknowns of the system, shape (k, n)
    flow: FloatArray  # losses, then the two heat sources [W], shape (k, m)
    energy: FloatArray  # losses and heat sources, integrated since the start [J], shape (k, m)
    stopped: bool  # True if the integration stopped because the fluid reached a given temperature


def integrate(
    system: System,
    loads: Sequence[Load],
    start: FloatArray,
    *,
    first_step: float = FIRST_STEP_S,
    longest_step: float,
    stop_at: float = math.inf,
) -> Solution:
    """Integrate a system from initial temperatures with consecutive loads.

    Parameters
    ----------
    start : initial values of the first n unknowns, shape (n,)
    first_step, longest_step : after each change of load, steps grow from the first to the second value [s]
    stop_at : mean fluid temperature at which the integration stops [K]
    """
    system.take(loads[0])
    n = system.nodes
    state = np.concatenate([start, np.zeros_like(system.rate(start)[n:])])
    times, states, flows = [0.0], [state], [system.rate(state)[n:]]
    stopped = system.fluid(state) >= stop_at
    for k, load in enumerate(loads):
        if stopped:
            break
        if k > 0:
            system.take(load)
        for step in growing_steps(load.duration, min(first_step, longest_step), longest_step):
            size, new = step, _step(system, state, step)
            stopped = system.fluid(new) >= stop_at
            if stopped:
                size = _size_to(system, state, step, stop_at)
                new = _step(system, state, size)
            state = new
            times.append(times[-1] + size)
            states.append(state)
            flows.append(system.rate(state)[n:])
            if stopped:
                break
    found = np.array(states)
    return Solution(np.array(times), found[:, :n], np.array(flows), found[:, n:], stopped)


def _step(system: System, state: FloatArray, size: float) -> FloatArray:
    return system.balance(state, rosenbrock_step(system, state, size))


def growing_steps(
    duration: float, first: float, longest: float, *, growth: float = STEP_GROWTH_RATIO
) -> list[float]:
    """Return time steps [s] that grow from ``first`` to ``longest``; their sum is the duration."""
    steps, left, step = [], duration, first
    while step < longest and left > step:
        steps.append(step)
        left -= step
        step = min(step * growth, longest)
    count = max(math.ceil(left / longest - 1e-9), 1)
    return steps + [left / count] * count


def _size_to(system: System, state: FloatArray, step: float, stop_at: float) -> float:
    """Return the time step [s], at most ``step``, after which the fluid has the temperature ``stop_at``."""

    def temperature_margin(size: float) -> float:
        return stop_at - system.fluid(_step(system, state, size))

    return float(brentq(temperature_margin, 0.0, step, xtol=STEP_TOLERANCE_S))


class EnergyAccount(ABC):
    """Base class of simulation results: heat flows and energies by path, and error of the balance."""

    __slots__ = ()

    flow: FloatArray  # losses, then the two heat sources [W], shape (k, m + 2)
    energy: FloatArray  # losses and heat sources, integrated since the start [J], shape (k, m + 2)

    @property
    @abstractmethod
    def columns(self) -> Mapping[str, Sequence[int]]:
        """Return the columns of ``flow`` and ``energy`` for each loss path; unused paths are omitted."""

    @property
    @abstractmethod
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""

    @property
    def mechanical_W(self) -> FloatArray:
        return np.asarray(self.flow[:, -2])

    @property
    def coil_W(self) -> FloatArray:
        return np.asarray(self.flow[:, -1])

    @property
    def paths_W(self) -> Mapping[str, FloatArray]:
        """Return the heat loss of each path versus time [W], shape (k,)."""
        found = {path: self.flow[:, list(which)].sum(axis=1) for path, which in self.columns.items()}
        return MappingProxyType(found)

    @property
    def energy_J(self) -> Mapping[str, float]:
        """Return energies by name: mechanical, coil, out (losses), stored, loss paths."""
        last = self.energy[-1]
        found = {
            "mechanical": float(last[-2]),
            "coil": float(last[-1]),
            "out": float(self.energy_out[-1]),
            "stored": float(self.stored[-1]),
        }
        found |= {path: float(last[list(which)].sum()) for path, which in self.columns.items()}
        return MappingProxyType(found)

    @property
    def energy_in(self) -> FloatArray:
        """Sum of mechanical work and coil heat since the start [J], shape (k,)."""
        return np.asarray(self.energy[:, -2:].sum(axis=1))

    @property
    def energy_out(self) -> FloatArray:
        """Return the sum of all heat losses since the start [J], shape (k,)."""
        return np.asarray(self.energy[:, :-2].sum(axis=1))

    @property
    def closure(self) -> float:
        """Return the largest absolute error of the energy balance, divided by the largest energy [-]."""
        miss = np.abs(self.energy_in - self.energy_out - self.stored).max()
        size = max(np.abs(part).max() for part in (self.energy_in, self.energy_out, self.stored))
        return float(miss / size) if size > 0.0 else 0.0
