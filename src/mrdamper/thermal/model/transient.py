"""Time integration of thermal networks.

Heat sources and losses are piecewise cubic functions of temperature. Therefore their derivatives and the
Jacobian of a time step (``stepping``) are exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg.lapack import dgetrf, dgetrs

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K, to_degC
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.network import PATHS, ThermalNetwork
from mrdamper.thermal.model.stepping import EnergyAccount, Load, Part, Solver, integrate


@dataclass(frozen=True, slots=True, eq=False)
class Heating(EnergyAccount):
    """Result of a network simulation: temperatures, heat flows and energies at the end of each time step.

    The columns of ``flow`` and ``energy`` are the m losses of the network, then mechanical power, then coil
    heat.
    """

    network: ThermalNetwork
    time: FloatArray  # [s], shape (k,)
    temperature: FloatArray  # temperature of each node [K], shape (k, n)
    flow: FloatArray  # losses and heat sources [W], shape (k, m + 2)
    energy: FloatArray  # losses and heat sources, integrated since the start [J], shape (k, m + 2)
    stopped: bool  # True if the simulation stopped because the fluid reached a given temperature

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

    def hottest(self, part: Part) -> FloatArray:
        """Return the temperature of the node that contains the hottest point of a part [K], shape (k,).

        A network does not resolve the hottest point itself.
        """
        network = self.network
        weights = {"gap": network.mechanical, "coil": network.coil, "seal": network.wall}[part]
        return np.asarray(self.temperature @ weights)

    @property
    def columns(self) -> Mapping[str, Sequence[int]]:
        """Return the columns of ``flow`` and ``energy`` for each loss path; unused paths are omitted."""
        paths = self.network.loss_path
        return {path: [k for k, each in enumerate(paths) if each == path] for path in PATHS if path in paths}

    @property
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""
        return np.asarray((self.temperature - self.temperature[0]) @ self.network.capacity)


def simulate_network(
    network: ThermalNetwork,
    loads: Sequence[Load],
    *,
    start: float | FloatArray | None = None,
    longest_step: float = 60.0,
    stop_at: float = math.inf,
) -> Heating:
    """Simulate a network with consecutive loads.

    Parameters
    ----------
    start : initial temperature of all nodes, or of each node [K]; None: ambient temperature
    longest_step : maximum time step [s]; steps grow from 1 s to this value
    stop_at : mean fluid temperature at which the simulation stops [K]

    Raises
    ------
    EnvelopeError
        If the temperature of a node is outside the tables of heat losses.
    """
    state = np.empty(len(network.names))
    state[:] = network.ambient if start is None else start
    system = NetworkSystem(network)
    return Heating(network, *integrate(system, loads, state, longest_step=longest_step, stop_at=stop_at))


class NetworkSystem:
    """Implements ``stepping.System`` for a network.

    A state contains the n node temperatures [K], then the integrated losses and heat sources since the start
    [J].
    """

    def __init__(self, network: ThermalNetwork) -> None:
        self.network, self.nodes = network, len(network.names)
        n, losses = self.nodes, len(network.loss_node)
        self.columns = losses + 2
        # ``_seen`` times the node temperatures is the temperature on which each loss or source depends.
        # ``into`` times the losses and sources is the heat flow into each node.
        self._seen = np.zeros((self.columns, n))
        self._seen[range(losses), network.loss_node] = 1.0
        self._seen[-2], self._seen[-1] = network.fluid, network.coil
        into = np.zeros((n, self.columns))
        into[network.loss_node, range(losses)] = -1.0
        into[:, -2], into[:, -1] = network.mechanical, network.electrical
        laplacian = network.conductance - np.diag(network.conductance.sum(axis=1))
        stored = network.capacity[:, None]
        self._linear, self._into = laplacian / stored, into / stored
        self._low, self._width = float(network.grid[0]), float(network.grid[1] - network.grid[0])
        self._cubics = np.zeros((len(network.grid) - 1, 4, self.columns))
        if losses:
            spline = CubicSpline(network.grid, network.watts.T)
            self._cubics[:, :, :losses] = spline.c.transpose(1, 0, 2)
        self._column = np.arange(self.columns)
        self._unit = np.eye(n)

    def take(self, load: Load) -> None:
        """Set the load: store its heat sources as piecewise cubic functions of temperature."""
        grid = self.network.grid
        self._cubics[:, :, -2] = CubicSpline(grid, load.power(grid)).c.T
        knots = grid[:-1]
        self._cubics[:, :2, -1] = 0.0
        self._cubics[:, 2, -1] = load.coil_W * COPPER_PER_K
        self._cubics[:, 3, -1] = load.coil_W * (1.0 + COPPER_PER_K * (knots - REFERENCE_K))

    def _look_up(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients and arguments [K] of polynomials for losses and sources."""
        at = (nodes @ self._seen.T - self._low) / self._width
        place = at.astype(np.intp)
        if not (at.min() >= 0.0 and at.max() < len(self._cubics)):
            self._refuse(nodes)
        return self._cubics[place, :, self._column], (at - place) * self._width

    def _refuse(self, nodes: FloatArray) -> None:
        seen = self._seen @ nodes
        worst = int(np.argmax(np.where(np.isfinite(seen), np.abs(seen - self.network.ambient), np.inf)))
        low, high = self.network.grid[0] - ZERO_CELSIUS_K, self.network.grid[-1] - ZERO_CELSIUS_K
        at = to_degC(seen[worst])
        # A temperature far outside the table results from a time step with much too large power.
        swung = not 2.0 * low - high < at < 2.0 * high - low or at < low < to_degC(self.network.ambient)
        runaway = "temperatures run away: the power is far above the losses of this damper"
        raise EnvelopeError(
            place="heating",
            found=runaway if swung else f"a node is at {at:.4g} degC",
            expected=f"{low:.0f} to {high:.0f} degC",
            remedy="Reduce the load, check the dimensions in the geometry file, or stop at the fluid limit",
        )

    def fluid(self, state: FloatArray) -> float:
        """Return the mean fluid temperature [K]."""
        return float(self.network.fluid @ state[: self.nodes])

    def balance(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the state unchanged. The energy balance closes because heat capacities are constant."""
        return after

    def rate(self, state: FloatArray) -> FloatArray:
        """Return the time derivative of the state: rates of the temperatures [K/s], then heat flows [W]."""
        nodes = state[: self.nodes]
        return self._rate(nodes, _horner(*self._look_up(nodes)))

    def inertia(self, rate: FloatArray) -> FloatArray:
        """Return the rate unchanged, because the equation is already divided by the heat capacities."""
        return rate

    def linearise(self, state: FloatArray, shrunk: float) -> tuple[FloatArray, Solver]:
        """Return the time derivative, and the solver of (1 - ``shrunk`` J) x = b.

        ``shrunk`` is gamma times the time step [s], as in ``stepping.System``. J is the Jacobian.
        """
        n = self.nodes
        rate, slope, jacobian = self._expand(state[:n])
        factors, pivots, _ = dgetrf(self._unit - shrunk * jacobian, overwrite_a=True)
        bend = shrunk * slope

        def with_energies(right: FloatArray) -> FloatArray:
            move = np.asarray(dgetrs(factors, pivots, right[:n])[0])
            return np.concatenate([move, right[n:] + bend * (move @ self._seen.T)])

        return rate, with_energies

    def rate_and_jacobian(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dT/dt of the nodes [K/s] at given temperatures, and the Jacobian of dT/dt [1/s]."""
        rate, _, jacobian = self._expand(nodes)
        return rate[: self.nodes], jacobian

    def _expand(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return time derivative of the state, slopes of heat flows, and Jacobian.

        A slope [W/K] is the derivative of a loss or source with respect to its temperature. The Jacobian
        [1/s] is the derivative of dT/dt with respect to the node temperatures.
        """
        cubics, offset = self._look_up(nodes)
        slope = _slope(cubics, offset)
        jacobian = self._linear + (self._into * slope) @ self._seen
        return self._rate(nodes, _horner(cubics, offset)), slope, jacobian

    def _rate(self, nodes: FloatArray, flow: FloatArray) -> FloatArray:
        return np.concatenate([self._linear @ nodes + self._into @ flow, flow])


def _horner(cubics: FloatArray, offset: FloatArray) -> FloatArray:
    value = cubics[..., 0] * offset
    for power in (1, 2):
        value += cubics[..., power]
        value *= offset
    value += cubics[..., 3]
    return value


def _slope(cubics: FloatArray, offset: FloatArray) -> FloatArray:
    return np.asarray((3.0 * cubics[..., 0] * offset + 2.0 * cubics[..., 1]) * offset + cubics[..., 2])
