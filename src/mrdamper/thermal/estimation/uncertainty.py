"""How far a drawing may be off, and what that leaves open about its heating.

Six factors (``FACTORS``) stand for all that may be off: power, capacity, losses, the conductance from fluid
to body, that from the coil, and the coil's resistance at 20 degC. ``ModelUncertainty`` says how large each
may be; ``UncertainNetwork`` runs dampers with such factors ahead, many at once. The observer learns the
factors from thermometers, ``prediction_interval`` takes them as believed or as a measured curve tells them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import InputError
from mrdamper.thermal.estimation.sampling import (
    TimeToLimit,
    draw_evenly,
    first_crossing,
    interval_of,
    summarise_times,
)
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import Load, rosenbrock_step
from mrdamper.thermal.model.transient import NetworkSystem

FACTORS = ("power", "capacity", "loss", "fluid_body", "coil", "resistance")
"""What the drawing may be off by; states hold the logarithm of each factor."""

POWER, CAPACITY, LOSS, BODY, COIL, RESISTANCE = range(len(FACTORS))
REFERENCE_EXCESS_K = 40.0
"""Over ambient: where losses of different dampers are compared [K]."""

_FIRST_STEP_S, _LONGEST_STEP_S, _GROWTH = 2.0, 60.0, 1.4
_MOST_STEPS = 300  # of the longest, in a load that goes on for days
_BEYOND_LIMIT_K = 100.0  # where dampers are held: nothing is asked of them there


@dataclass(frozen=True, slots=True)
class ModelUncertainty:
    """How far the drawing and the model may be off: relative standard deviations, and random walks."""

    power: float = 0.10
    capacity: float = 0.10
    loss: float = 0.25
    fluid_body: float = 0.30
    coil: float = 0.30
    resistance: float = 0.02
    drift_per_sqrt_h: float = 0.02  # of each factor but the resistance [1/sqrt(h)]
    node_K_per_sqrt_s: float = 0.02  # of each node [K/sqrt(s)]

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    place="model uncertainty", found=f"{name} is {value}", expected="zero or more, finite"
                )

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the factors' logarithms, shape (6, 6)."""
        return np.diag([getattr(self, name) ** 2 for name in FACTORS])


@dataclass(frozen=True, slots=True, eq=False)
class PredictionInterval:
    """What a heating curve may be: the interval of the temperature, and of the times to limits."""

    time: FloatArray  # since the start [s], shape (t,)
    median: FloatArray  # of the fluid, or where a thermometer sits [K], shape (t,)
    low: FloatArray  # with ``high``, holds it with the probability, at each time [K], shape (t,)
    high: FloatArray
    probability: float
    to_limits: tuple[TimeToLimit, ...]  # one for each point that was watched

    @property
    def to_limit(self) -> TimeToLimit:
        """The time to the first of the limits: the fluid's."""
        return self.to_limits[0]


@dataclass(frozen=True, slots=True, eq=False)
class WatchedPoint:
    """A point whose limit is asked for: a mean of nodes, and how much hotter than it the point is."""

    weights: FloatArray  # of the nodes, shape (n,)
    limit_K: float
    time: FloatArray  # [s], shape (k,)
    above: FloatArray  # the mean at these times, held beyond them [K], shape (k,)

    def temperature(self, time: FloatArray, nodes: FloatArray) -> FloatArray:
        """Return the point's temperature [K], shape (t, d), from nodes of shape (t, d, n)."""
        return np.asarray(nodes @ self.weights + np.interp(time, self.time, self.above)[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class UncertainNetwork:
    """A network with its conductances taken apart, so that factors may stand before each kind; made once."""

    network: ThermalNetwork
    watts: FloatArray = field(init=False, repr=False)  # losses of each node over the grid, shape (n, g)
    of_coil: FloatArray = field(init=False, repr=False)  # minus Laplacians of the three kinds of
    of_body: FloatArray = field(init=False, repr=False)  # conductances: from the coil, fluid to wall,
    rest: FloatArray = field(init=False, repr=False)  # all others, shape (n, n) each

    def __post_init__(self) -> None:
        network = self.network
        watts = np.zeros((len(network.names), len(network.grid)))
        for node, row in zip(network.loss_node, network.watts, strict=True):
            watts[node] += row
        fluid, wall, coil = network.fluid > 0.0, network.wall > 0.0, network.coil > 0.0
        of_coil = coil[:, None] != coil[None, :]
        of_body = ((fluid[:, None] & wall[None, :]) | (wall[:, None] & fluid[None, :])) & ~of_coil
        for name, which in (("of_coil", of_coil), ("of_body", of_body), ("rest", ~(of_coil | of_body))):
            conductance = np.where(which, network.conductance, 0.0)
            object.__setattr__(self, name, read_only(conductance - np.diag(conductance.sum(axis=1))))
        object.__setattr__(self, "watts", read_only(watts))

    @property
    def nodes(self) -> int:
        """Number of nodes; a state is their temperatures, then the logarithms of the factors."""
        return len(self.network.names)

    def losses(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the nodes give off [W] and the slopes [W/K], in the nodes' shape (..., n)."""
        grid = self.network.grid
        width = float(grid[1] - grid[0])
        at = (nodes - grid[0]) / width
        place = np.clip(at.astype(np.intp), 0, len(grid) - 2)
        node = np.arange(self.nodes)
        below = self.watts[node, place]
        slope = (self.watts[node, place + 1] - below) / width
        return below + slope * (at - place) * width, slope

    def _system(self, factor: FloatArray) -> NetworkSystem:
        """Return the heat balance of k dampers with factors, shape (k, 6)."""
        losses = len(self.network.loss_node)
        body, coil = factor[:, BODY, None, None], factor[:, COIL, None, None]
        return NetworkSystem(
            self.network,
            capacity=factor[:, CAPACITY, None] * self.network.capacity,
            laplacian=self.rest + body * self.of_body + coil * self.of_coil,
            gain=factor[:, [LOSS] * losses + [POWER, RESISTANCE]],
        )

    def look_ahead(
        self,
        mean: FloatArray,
        covariance: FloatArray,
        loads: Sequence[Load],
        watched: Sequence[WatchedPoint],
        *,
        misfit: float = 0.0,
        probability: float = 0.90,
        dampers: int = 200,
        seed: int = 0,
    ) -> PredictionInterval:
        """Return what dampers drawn from a state do under loads.

        Parameters
        ----------
        mean, covariance : of a state [K, then -], shape (n + 6,) and (n + 6, n + 6)
        loads : what heats from now on; how long they last is how far is looked
        watched : the fluid's mean, then the points whose limits are asked for (none: the fluid's); dampers
            beyond a limit go on
        misfit : standard deviation of what no factor mends, as a share of the rise [-]
        """
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        *normal, off = draw_evenly(np.random.default_rng(seed), len(mean) + 1, dampers)
        states = mean + (root @ np.array(normal)).T
        hottest = max(point.limit_K for point in watched) + _BEYOND_LIMIT_K
        time, nodes = self.run_ahead(states, loads, hottest_K=hottest)
        nodes = nodes + misfit * off[:, None] * (nodes - nodes[0])
        looked = math.fsum(load.duration for load in loads)
        fluid, *points = (point.temperature(time, nodes) for point in watched)
        reached = tuple(
            summarise_times(first_crossing(time, course, point.limit_K), point.limit_K, probability, looked)
            for course, point in zip(points or [fluid], watched[1:] or watched, strict=True)
        )
        return PredictionInterval(time, *interval_of(fluid, probability), probability, reached)

    def run_ahead(
        self, states: FloatArray, loads: Sequence[Load], *, hottest_K: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return times [s], shape (t,), and the nodes' temperatures of k dampers [K], shape (t, k, n).

        Parameters
        ----------
        states : shape (k, n + 6)
        hottest_K : nodes are held at this temperature
        """
        n = self.nodes
        system = self._system(np.exp(states[:, n:]))
        state = np.hstack([states[:, :n], np.zeros((len(states), system.columns))])
        longest = max(_LONGEST_STEP_S, math.fsum(load.duration for load in loads) / _MOST_STEPS)
        step, time, nodes = _FIRST_STEP_S, [0.0], [state[:, :n]]
        for load in loads:
            system.take(load)
            end = time[-1] + load.duration
            while time[-1] < end - 1e-9:
                size = min(step, end - time[-1])
                state = rosenbrock_step(system, state, size)
                state[:, :n] = np.minimum(state[:, :n], hottest_K)
                time.append(time[-1] + size)
                nodes.append(state[:, :n])
                step = min(step * _GROWTH, longest)
        return np.array(time), np.array(nodes)
