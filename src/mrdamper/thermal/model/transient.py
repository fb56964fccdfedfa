"""Running a thermal network through time: ROS2, with the energy in and out carried as extra states.

A step (``stepping``) is one factorisation and two solves. The method keeps linear invariants, and "heat
stored + energy out - energy in" is one: the account closes to rounding, whatever the step.

Between two steps of its grid a source or a loss is a cubic of temperature, its derivative exact, so that the
Jacobian is too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg.lapack import dgetrf, dgetrs

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, EnvelopeError
from mrdamper.quantities import ZERO_CELSIUS_K, to_degC
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import GAMMA, EnergyAccount, Load, march

__all__ = ["Heating", "heat_up", "steady_state"]


@dataclass(frozen=True, slots=True, eq=False)
class Heating(EnergyAccount):
    """A network's course: temperatures, powers and energies at the ends of the steps taken.

    Columns of ``flow`` and ``energy`` are the network's losses, then mechanical power, then coil heat.
    """

    network: ThermalNetwork
    time: FloatArray  # [s], shape (k,)
    temperature: FloatArray  # [K], shape (k, n)
    flow: FloatArray  # [W], shape (k, m + 2)
    energy: FloatArray  # since the start [J], shape (k, m + 2)
    stopped: bool  # the fluid reached the temperature at which to stop

    @property
    def fluid(self) -> FloatArray:
        """Mean temperature of the fluid [K], shape (k,)."""
        return np.asarray(self.temperature @ self.network.fluid)

    @property
    def coil(self) -> FloatArray:
        return np.asarray(self.temperature @ self.network.coil)

    @property
    def wall(self) -> FloatArray:
        return np.asarray(self.temperature @ self.network.wall)

    @property
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""
        return np.asarray((self.temperature - self.temperature[0]) @ self.network.capacity)


def heat_up(
    network: ThermalNetwork,
    loads: Sequence[Load],
    *,
    start: float | FloatArray | None = None,
    longest_step: float = 60.0,
    stop_at: float = math.inf,
) -> Heating:
    """Run a network through loads, one after the other.

    Parameters
    ----------
    start : temperature at the start [K], one or per node; None: ambient
    longest_step : steps grow from 1 s to this [s] after each change of load; it bounds the first one too
    stop_at : the fluid's mean temperature at which the run ends [K]

    Raises
    ------
    EnvelopeError
        A node leaves the temperatures at which its losses are known.
    """
    state = np.empty(len(network.names))
    state[:] = network.ambient if start is None else start
    return Heating(
        network, *march(_Stepper(network), loads, state, longest_step=longest_step, stop_at=stop_at)
    )


def steady_state(network: ThermalNetwork, load: Load, *, start: float | None = None) -> FloatArray:
    """Return the temperatures that a load ends in [K], shape (n,), by Newton's method.

    Raises
    ------
    ConvergenceError
        There is no steady state (nothing is given off), or the iteration did not reach it.
    EnvelopeError
        A node leaves the temperatures at which its losses are known.
    """
    if not network.watts.any():
        raise ConvergenceError("steady state: nothing carries the heat away; there is none")
    stepper = _Stepper(network)
    stepper.take(load)
    state: FloatArray = np.full(len(network.names), network.ambient + 50.0 if start is None else start)
    for _ in range(60):
        rate, jacobian = stepper.rate_and_jacobian(state)
        move = np.linalg.solve(jacobian, -rate)
        largest = float(np.abs(move).max())
        state = np.asarray(state + move * min(1.0, 50.0 / max(largest, 1e-300)))
        if largest < 1e-9:
            return state
    raise ConvergenceError("steady state: Newton's method did not settle to 1e-9 K in 60 steps")


class _Stepper:
    """ROS2 on a network with one load at a time: tables of losses and sources, one step after another."""

    def __init__(self, network: ThermalNetwork) -> None:
        self.network = network
        n, losses = len(network.names), len(network.loss_node)
        self.columns = losses + 2
        # temperatures that losses and sources go by, and where their heat goes
        self._seen = np.zeros((self.columns, n))
        self._seen[range(losses), network.loss_node] = 1.0
        self._seen[-2], self._seen[-1] = network.fluid, network.coil
        into = np.zeros((n, self.columns))
        into[network.loss_node, range(losses)] = -1.0
        into[:, -2], into[:, -1] = network.mechanical, network.electrical
        laplacian = network.conductance - np.diag(network.conductance.sum(axis=1))
        self._linear = laplacian / network.capacity[:, None]
        self._into = into / network.capacity[:, None]
        self._low, self._width = float(network.grid[0]), float(network.grid[1] - network.grid[0])
        self._cubics = np.zeros((len(network.grid) - 1, 4, self.columns))
        if losses:
            spline = CubicSpline(network.grid, network.watts.T)
            self._cubics[:, :, :losses] = spline.c.transpose(1, 0, 2)
        self._column = np.arange(self.columns)
        self._unit = np.eye(n)

    def take(self, load: Load) -> None:
        """Put the sources of a load into the tables."""
        grid = self.network.grid
        self._cubics[:, :, -2] = CubicSpline(grid, load.power_on(grid)).c.T
        knots = grid[:-1]
        self._cubics[:, :2, -1] = 0.0
        self._cubics[:, 2, -1] = load.coil_W * COPPER_PER_K
        self._cubics[:, 3, -1] = load.coil_W * (1.0 + COPPER_PER_K * (knots - 293.15))

    def _look_up(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where the columns' temperatures lie: cubics, shape (columns, 4), and offsets [K]."""
        at = (self._seen @ state - self._low) / self._width
        place = at.astype(np.intp)
        if not (at.min() >= 0.0 and at.max() < len(self._cubics)):
            self._refuse(state)
        cubics = self._cubics[place, :, self._column]
        return cubics, (at - place) * self._width, at

    def _refuse(self, state: FloatArray) -> None:
        seen = self._seen @ state
        worst = int(np.argmax(np.where(np.isfinite(seen), np.abs(seen - self.network.ambient), np.inf)))
        low, high = self.network.grid[0] - ZERO_CELSIUS_K, self.network.grid[-1] - ZERO_CELSIUS_K
        raise EnvelopeError(
            f"heating: a node is at {to_degC(seen[worst]):.4g} degC; expected {low:.0f} to {high:.0f} degC. "
            "Lower the duty, check the drawing's dimensions, or stop at the fluid's limit"
        )

    def fluid(self, state: FloatArray) -> float:
        """Return the fluid's mean temperature [K]."""
        return float(self.network.fluid @ state)

    def flow(self, state: FloatArray) -> FloatArray:
        """Return losses and sources at a state [W], shape (columns,)."""
        cubics, offset, _ = self._look_up(state)
        return _horner(cubics, offset)

    def rate_and_jacobian(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dT/dt [K/s] and its derivative by T."""
        cubics, offset, _ = self._look_up(state)
        rate = self._linear @ state + self._into @ _horner(cubics, offset)
        return rate, self._linear + (self._into * _slope(cubics, offset)) @ self._seen

    def step(self, state: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
        """Return the state after a step [s], and the energies that went through each column in it [J]."""
        cubics, offset, _ = self._look_up(state)
        flow, slope = _horner(cubics, offset), _slope(cubics, offset)
        jacobian = self._linear + (self._into * slope) @ self._seen
        shrunk = GAMMA * size
        factors, pivots, _ = dgetrf(self._unit - shrunk * jacobian, overwrite_a=True)
        first, _ = dgetrs(factors, pivots, self._linear @ state + self._into @ flow)
        middle = state + size * first
        flow_middle = self.flow(middle)
        right = self._linear @ middle + self._into @ flow_middle - 2.0 * first
        second, _ = dgetrs(factors, pivots, right)
        bend = shrunk * slope
        energy_first = flow + bend * (self._seen @ first)
        energy_second = flow_middle - 2.0 * energy_first + bend * (self._seen @ second)
        return (
            state + size * (1.5 * first + 0.5 * second),
            size * (1.5 * energy_first + 0.5 * energy_second),
        )


def _horner(cubics: FloatArray, offset: FloatArray) -> FloatArray:
    value = cubics[:, 0] * offset
    for power in (1, 2):
        value += cubics[:, power]
        value *= offset
    value += cubics[:, 3]
    return value


def _slope(cubics: FloatArray, offset: FloatArray) -> FloatArray:
    return np.asarray((3.0 * cubics[:, 0] * offset + 2.0 * cubics[:, 1]) * offset + cubics[:, 2])
