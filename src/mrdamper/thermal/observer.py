"""Temperature of the fluid from what can be measured: an extended Kalman filter on the thermal network.

It sees the coil's resistance, a thermocouple on the body, or both, and is told the mechanical power by the
model. Beside the nodes' temperatures it estimates six factors by which the drawing may be off (``FACTORS``):
power, capacity, losses, the conductance from fluid to body (so that T_fluid = T_body + P/G goes by an
estimated G), that from the coil, and the coil's resistance at 20 degC, which a cold start zeroes.

What it cannot know it says: without current there is no resistance to read, the spread grows, and a small
probing current brings it back; power, capacity and losses share a common factor that no thermometer tells.

An observer is a value; the state is handed back. The time steps may be anything from a control loop's
millisecond to ten seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray, read_only
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.network import ThermalNetwork
from mrdamper.thermal.prediction import TimeToLimit, first_crossing, summarise_times
from mrdamper.thermal.transient import Load

__all__ = [
    "FACTORS",
    "Doubt",
    "ObserverState",
    "TemperatureObserver",
    "ThermalSeen",
    "Thermometers",
    "time_left",
]

FACTORS = ("power", "capacity", "loss", "fluid_body", "coil", "resistance")
"""What the drawing may be off by; the state holds the logarithm of each factor."""

_POWER, _CAPACITY, _LOSS, _BODY, _COIL, _RESISTANCE = range(len(FACTORS))
_ROOM_K = 293.15
_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
_FIRST_STEP_S, _LONGEST_STEP_S, _GROWTH = 2.0, 60.0, 1.4


@dataclass(frozen=True, slots=True)
class Doubt:
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
                raise InputError(f"observer: doubt.{name} is {value}; expected zero or more, finite")


@dataclass(frozen=True, slots=True)
class Thermometers:
    """Standard deviations of the readings, of one sample each.

    The resistance is voltage over current: its noise is relative, and the voltage's over the current.
    """

    resistance: float = 0.01  # relative [-]
    voltage_V: float = 0.005
    body_K: float = 0.5

    def __post_init__(self) -> None:
        if not (self.resistance >= 0.0 and self.voltage_V >= 0.0 and self.body_K > 0.0):
            raise InputError(f"observer: thermometers are {self}; expected positive noise")
        if not self.resistance + self.voltage_V > 0.0:
            raise InputError("observer: the resistance has no noise at all; expected resistance or voltage_V")

    def resistance_error(self, resistance_ohm: float, current_A: float) -> float:
        """Return the standard deviation of a resistance [ohm]; infinite without current."""
        if current_A == 0.0:
            return math.inf
        return math.hypot(self.resistance * resistance_ohm, self.voltage_V / abs(current_A))


@dataclass(frozen=True, slots=True)
class ThermalSeen:
    """What happened since the last step, and what the thermometers say now; None or NaN is no reading."""

    elapsed_s: float
    power_W: float  # mechanical, by the model, mean over the time
    current_A: float  # root mean square over the time
    resistance_ohm: float | None = None
    body_K: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ObserverState:
    """Temperatures of the nodes [K], then the logarithms of the factors; and their covariance."""

    time_s: float
    mean: FloatArray  # shape (n + 6,)
    covariance: FloatArray  # shape (n + 6, n + 6)


@dataclass(frozen=True, slots=True, eq=False)
class TemperatureObserver:
    """An extended Kalman filter on a network.

    ``resistance_20_ohm`` is the drawing's; the true one is estimated. The thermocouple sees the network's
    ``wall``, or the nodes weighted by ``body``.
    """

    network: ThermalNetwork
    resistance_20_ohm: float
    doubt: Doubt = field(default_factory=Doubt)
    thermometers: Thermometers = field(default_factory=Thermometers)
    body: FloatArray | None = None
    _tables: _Tables = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.resistance_20_ohm) and self.resistance_20_ohm > 0.0):
            raise InputError(
                f"observer: resistance_20_ohm is {self.resistance_20_ohm}; expected the coil's at 20 degC, "
                "above zero"
            )
        body = self.network.wall if self.body is None else read_only(self.body)
        if body.shape != (len(self.network.names),) or not math.isclose(float(body.sum()), 1.0, rel_tol=1e-9):
            raise InputError("observer: body is not one weight per node, sum 1")
        object.__setattr__(self, "body", body)
        object.__setattr__(self, "_tables", _Tables(self))

    def start(
        self,
        temperature_K: float | None = None,
        *,
        spread_K: float = 0.5,
        learnt: ObserverState | None = None,
    ) -> ObserverState:
        """Return the state of a damper that has been left alone.

        Parameters
        ----------
        temperature_K : of everything; None: the network's ambient. This is the cold start that zeroes the
            resistance: its error goes into the thermometer
        spread_K : its standard deviation; of a damper that is still warm, give the mean and a wide one
        learnt : an earlier state, whose factors are kept
        """
        n, size = self._tables.nodes, self._tables.nodes + len(FACTORS)
        start = self.network.ambient if temperature_K is None else temperature_K
        if not (math.isfinite(start) and spread_K > 0.0):
            raise InputError(
                f"observer: starts at {start} K, spread {spread_K} K; expected a positive spread"
            )
        mean, covariance = np.zeros(size), np.zeros((size, size))
        mean[:n] = start
        # the nodes are off together, and a little each
        covariance[:n, :n] = spread_K**2 * (0.96 + 0.04 * np.eye(n))
        if learnt is None:
            covariance[n:, n:] = np.diag([getattr(self.doubt, name) ** 2 for name in FACTORS])
        else:
            mean[n:] = learnt.mean[n:]
            covariance[n:, n:] = learnt.covariance[n:, n:]
        return ObserverState(0.0, read_only(mean), read_only(covariance))

    def step(self, state: ObserverState, seen: ThermalSeen) -> ObserverState:
        """Return the state after the time that passed and the readings at its end."""
        if not seen.elapsed_s >= 0.0:
            raise InputError(f"observer: {seen.elapsed_s} s passed; expected zero or more")
        mean, covariance = np.array(state.mean), np.array(state.covariance)
        if seen.elapsed_s > 0.0:
            mean, covariance = self._tables.advance(mean, covariance, seen)
        if _reads(seen.resistance_ohm) and seen.current_A != 0.0:
            mean, covariance = self._see_resistance(mean, covariance, seen)
        if _reads(seen.body_K):
            row = np.zeros(len(mean))
            row[: self._tables.nodes] = self.body
            noise = self.thermometers.body_K
            off = float(seen.body_K or 0.0) - float(row @ mean)
            mean, covariance = _correct(mean, covariance, row, off, noise)
        return ObserverState(state.time_s + seen.elapsed_s, read_only(mean), read_only(covariance))

    def fluid(self, state: ObserverState) -> tuple[float, float]:
        """Return the fluid's mean temperature and its standard deviation [K]."""
        return self._weighted(state, self.network.fluid)

    def coil(self, state: ObserverState) -> tuple[float, float]:
        """Return the coil's temperature and its standard deviation [K]."""
        return self._weighted(state, self.network.coil)

    def wall(self, state: ObserverState) -> tuple[float, float]:
        """Return the wall's mean temperature and its standard deviation [K]."""
        return self._weighted(state, self.network.wall)

    def factors(self, state: ObserverState) -> Mapping[str, tuple[float, float]]:
        """Return each factor and its relative standard deviation."""
        n = self._tables.nodes
        spread = np.sqrt(np.diag(state.covariance)[n:])
        return {
            name: (math.exp(float(state.mean[n + k])), float(spread[k])) for k, name in enumerate(FACTORS)
        }

    def _weighted(self, state: ObserverState, weight: FloatArray) -> tuple[float, float]:
        n = self._tables.nodes
        variance = float(weight @ state.covariance[:n, :n] @ weight)
        return float(weight @ state.mean[:n]), math.sqrt(max(variance, 0.0))

    def _see_resistance(
        self, mean: FloatArray, covariance: FloatArray, seen: ThermalSeen
    ) -> tuple[FloatArray, FloatArray]:
        n = self._tables.nodes
        cold = self.resistance_20_ohm * math.exp(mean[n + _RESISTANCE])
        expected = cold * (1.0 + COPPER_PER_K * (float(self.network.coil @ mean[:n]) - _ROOM_K))
        row = np.zeros(len(mean))
        row[:n] = cold * COPPER_PER_K * self.network.coil
        row[n + _RESISTANCE] = expected
        noise = self.thermometers.resistance_error(expected, seen.current_A)
        return _correct(mean, covariance, row, float(seen.resistance_ohm or 0.0) - expected, noise)


def time_left(
    observer: TemperatureObserver,
    state: ObserverState,
    load: Load,
    limit_K: float,
    *,
    probability: float = 0.90,
    dampers: int = 200,
    seed: int = 0,
) -> TimeToLimit:
    """Return in how long the fluid's mean temperature reaches a limit under a load.

    Dampers are drawn from the state, temperatures and factors together (so the doubt about the capacity is
    in the interval), and run ahead.

    Parameters
    ----------
    load : what heats from now on; its duration is how far is looked, and what is not reached until then is
        "not reached", infinity. Its ``coil_W`` goes with the drawing's resistance
    """
    tables = observer._tables  # noqa: SLF001  # of this module
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(state.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = state.mean + rng.standard_normal((dampers, len(state.mean))) @ root.T
    time, fluid = tables.ahead(drawn, load, limit_K)
    return summarise_times(first_crossing(time, fluid, limit_K), limit_K, probability, load.duration)


class _Tables:
    """A network's numbers as the filter wants them: made once."""

    def __init__(self, observer: TemperatureObserver) -> None:
        network, doubt = observer.network, observer.doubt
        n = self.nodes = len(network.names)
        self.network = network
        self.resistance = observer.resistance_20_ohm
        self.low, self.width = float(network.grid[0]), float(network.grid[1] - network.grid[0])
        self.watts = np.zeros((n, len(network.grid)))
        for node, row in zip(network.loss_node, network.watts, strict=True):
            self.watts[node] += row
        fluid, wall, coil = network.fluid > 0.0, network.wall > 0.0, network.coil > 0.0
        of_coil = (coil[:, None] | coil[None, :]) & ~(coil[:, None] & coil[None, :])
        of_body = ((fluid[:, None] & wall[None, :]) | (wall[:, None] & fluid[None, :])) & ~of_coil
        self.of_coil = _laplacian(np.where(of_coil, network.conductance, 0.0))
        self.of_body = _laplacian(np.where(of_body, network.conductance, 0.0))
        self.rest = _laplacian(np.where(of_coil | of_body, 0.0, network.conductance))
        drift = np.full(len(FACTORS), doubt.drift_per_sqrt_h**2 / 3600.0)
        drift[_RESISTANCE] = 0.0
        self.walk = np.append(np.full(n, doubt.node_K_per_sqrt_s**2), drift)  # variance per second
        self.node = np.arange(n)

    def losses(self, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the nodes give off [W] and the slopes [W/K], in the nodes' shape (..., n)."""
        at = (nodes - self.low) / self.width
        place = np.clip(at.astype(np.intp), 0, self.watts.shape[1] - 2)
        below = self.watts[self.node, place]
        slope = (self.watts[self.node, place + 1] - below) / self.width
        return below + slope * (at - place) * self.width, slope

    def advance(
        self, mean: FloatArray, covariance: FloatArray, seen: ThermalSeen
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance after the time that passed: Euler, implicit in the temperatures."""
        n, network, h = self.nodes, self.network, seen.elapsed_s
        nodes, factor = mean[:n], np.exp(mean[n:])
        stored = factor[_CAPACITY] / h * network.capacity
        lost, lost_slope = self.losses(nodes)
        joule = factor[_RESISTANCE] * seen.current_A**2 * self.resistance
        by_coil = joule * COPPER_PER_K * np.outer(network.electrical, network.coil)
        driven = factor[_POWER] * seen.power_W * network.mechanical
        matrix = -self.rest - factor[_BODY] * self.of_body - factor[_COIL] * self.of_coil - by_coil
        matrix[self.node, self.node] += stored + factor[_LOSS] * lost_slope
        inverse = np.linalg.inv(matrix)
        heated = joule * (1.0 - COPPER_PER_K * _ROOM_K) * network.electrical
        right = stored * nodes + driven + heated - factor[_LOSS] * (lost - lost_slope * nodes)
        new = inverse @ right
        move = new - nodes
        by_factor = np.empty((n, len(FACTORS)))
        by_factor[:, _POWER] = driven
        by_factor[:, _CAPACITY] = -stored * move
        by_factor[:, _LOSS] = -factor[_LOSS] * (lost + lost_slope * move)
        by_factor[:, _BODY] = factor[_BODY] * (self.of_body @ new)
        by_factor[:, _COIL] = factor[_COIL] * (self.of_coil @ new)
        by_factor[:, _RESISTANCE] = heated + by_coil @ new
        slope = np.eye(len(mean))
        slope[:n, :n] = inverse * stored
        slope[:n, n:] = inverse @ by_factor
        ahead = slope @ covariance @ slope.T
        ahead[np.diag_indices_from(ahead)] += h * self.walk
        return np.concatenate([new, mean[n:]]), ahead

    def ahead(self, drawn: FloatArray, load: Load, limit_K: float) -> tuple[FloatArray, FloatArray]:
        """Return times [s], shape (t,), and the fluid's temperature of k dampers [K], shape (t, k): ROS2."""
        n, network = self.nodes, self.network
        nodes, factor = drawn[:, :n].copy(), np.exp(drawn[:, n:])
        capacity = factor[:, _CAPACITY, None] * network.capacity
        joule = factor[:, _RESISTANCE, None] * load.coil_W
        linear = (
            self.rest
            + factor[:, _BODY, None, None] * self.of_body
            + factor[:, _COIL, None, None] * self.of_coil
            + joule[:, :, None] * COPPER_PER_K * np.outer(network.electrical, network.coil)
        )
        heated = joule * (1.0 - COPPER_PER_K * _ROOM_K) * network.electrical
        watts = np.asarray(load.power(network.grid), dtype=np.float64)
        if watts.shape != network.grid.shape or not np.isfinite(watts).all():
            raise InputError("time left: the power is not finite, or not one number per temperature")
        slopes = np.gradient(watts, network.grid)
        share = factor[:, _POWER, None]

        def rate(at: FloatArray) -> FloatArray:
            driven = share * np.interp(at @ network.fluid, network.grid, watts)[:, None] * network.mechanical
            lost = factor[:, _LOSS, None] * self.losses(at)[0]
            flow = (linear @ at[:, :, None])[:, :, 0] + heated + driven - lost
            return np.asarray(flow / capacity)

        times, fluid, step = [0.0], [nodes @ network.fluid], _FIRST_STEP_S
        while times[-1] < load.duration - 1e-9:
            h = min(step, load.duration - times[-1])
            jacobian = linear.copy()
            jacobian[:, self.node, self.node] -= factor[:, _LOSS, None] * self.losses(nodes)[1]
            falls = share[:, 0] * np.interp(nodes @ network.fluid, network.grid, slopes)
            jacobian += falls[:, None, None] * np.outer(network.mechanical, network.fluid)
            matrix = np.eye(n) - _GAMMA * h * jacobian / capacity[:, :, None]
            inverse = np.linalg.inv(matrix)
            first = (inverse @ rate(nodes)[:, :, None])[:, :, 0]
            second = (inverse @ (rate(nodes + h * first) - 2.0 * first)[:, :, None])[:, :, 0]
            nodes = nodes + h * (1.5 * first + 0.5 * second)
            times.append(times[-1] + h)
            fluid.append(nodes @ network.fluid)
            # beyond the limit nothing more is asked; keep within the tables
            nodes = np.minimum(nodes, limit_K + 100.0)
            step = min(step * _GROWTH, _LONGEST_STEP_S)
            if (np.max(fluid, axis=0) >= limit_K).all():
                break
        return np.array(times), np.array(fluid)


def _laplacian(conductance: FloatArray) -> FloatArray:
    return np.asarray(conductance - np.diag(conductance.sum(axis=1)))


def _reads(reading: float | None) -> bool:
    return reading is not None and math.isfinite(reading)


def _correct(
    mean: FloatArray, covariance: FloatArray, row: FloatArray, off: float, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance after one reading (Joseph's form: it stays symmetric and positive)."""
    toward = covariance @ row
    gain = toward / (float(row @ toward) + noise**2)
    left = np.eye(len(mean)) - np.outer(gain, row)
    return mean + gain * off, left @ covariance @ left.T + noise**2 * np.outer(gain, gain)
