"""Temperature of the fluid from what can be measured: an extended Kalman filter on the thermal network.

It sees the coil's resistance, a thermocouple on the body, or both, and takes the mechanical power from the
model. Beside the nodes' temperatures it estimates the factors by which the drawing may be off (``FACTORS``):
among them the conductance from fluid to body, so that T_fluid = T_body + P/G goes by an estimated G, and the
coil's resistance at 20 degC, which a cold start zeroes.

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

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.estimation.sampling import TimeToLimit
from mrdamper.thermal.estimation.uncertainty import (
    BODY,
    CAPACITY,
    COIL,
    FACTORS,
    LOSS,
    POWER,
    RESISTANCE,
    ModelUncertainty,
    UncertainNetwork,
    WatchedPoint,
)
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.stepping import Load


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
            raise InputError(place="observer", found=f"thermometers are {self}", expected="positive noise")
        if not self.resistance + self.voltage_V > 0.0:
            raise InputError(
                place="observer",
                found="the resistance has no noise at all",
                expected="resistance or voltage_V",
            )

    def resistance_error(self, resistance_ohm: float, current_A: float) -> float:
        """Return the standard deviation of a resistance [ohm]; infinite without current."""
        if current_A == 0.0:
            return math.inf
        return math.hypot(self.resistance * resistance_ohm, self.voltage_V / abs(current_A))


@dataclass(frozen=True, slots=True)
class ThermalMeasurement:
    """What happened since the last step, and what the thermometers say now; None or NaN is no reading."""

    elapsed_s: float
    power_W: float  # mechanical, by the model, mean over the time
    current_A: float  # root mean square over the time
    resistance_ohm: float | None = None
    body_K: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ThermalRecord:
    """A series of ``ThermalMeasurement``: a row says what happened since the row before; read-only.

    Power and current of the first row are not used: nothing happened before it.
    """

    time: FloatArray  # rising [s], shape (n,)
    power: FloatArray  # mechanical [W], shape (n,)
    current: FloatArray  # [A], shape (n,)
    resistance: FloatArray | None = None  # of the coil [ohm], NaN where nothing was read, shape (n,)
    body: FloatArray | None = None  # thermocouple on the body [K], NaN where nothing was read, shape (n,)

    def __post_init__(self) -> None:
        for name in ("time", "power", "current", "resistance", "body"):
            values = getattr(self, name)
            if values is None:
                continue
            object.__setattr__(self, name, read_only(values))
            if values.shape != self.time.shape:
                raise InputError(
                    place="thermal record",
                    found=f"{name} has shape {values.shape}, time {self.time.shape}",
                    expected="the same",
                )
        if self.time.ndim != 1 or not len(self.time) or not (np.diff(self.time) > 0.0).all():
            raise InputError(
                place="thermal record", found="time does not rise", expected="seconds in order, none twice"
            )
        if not (np.isfinite(self.power).all() and np.isfinite(self.current).all()):
            raise InputError(
                place="thermal record",
                found="a power or current is not finite",
                expected="W and A in every row",
            )
        if self.resistance is None and self.body is None:
            raise InputError(
                place="thermal record", found="expected the coil's resistance, a body temperature, or both"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverOptions:
    """How a damper starts, how far its drawing may be off, and how good its thermometers are."""

    start_K: float | None = None  # of everything; None: ambient
    start_spread_K: float = 0.5
    model_uncertainty: ModelUncertainty = field(default_factory=ModelUncertainty)
    thermometers: Thermometers = field(default_factory=Thermometers)


@dataclass(frozen=True, slots=True, eq=False)
class ObservedTemperatures:
    """Temperatures and their standard deviations over a record [K], shape (n,) each."""

    time: FloatArray  # [s]
    fluid: FloatArray
    fluid_error: FloatArray
    coil: FloatArray
    coil_error: FloatArray
    wall: FloatArray
    wall_error: FloatArray
    factors: Mapping[str, tuple[float, float]]  # of the drawing at the end, with relative standard deviations
    state: ObserverState  # at the end, to go on from


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
    model_uncertainty: ModelUncertainty = field(default_factory=ModelUncertainty)
    thermometers: Thermometers = field(default_factory=Thermometers)
    body: FloatArray | None = None
    uncertain: UncertainNetwork = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.resistance_20_ohm) and self.resistance_20_ohm > 0.0):
            raise InputError(
                place="observer",
                found=f"resistance_20_ohm is {self.resistance_20_ohm}",
                expected="the coil's at 20 degC, above zero",
            )
        body = self.network.wall if self.body is None else read_only(self.body)
        if body.shape != (len(self.network.names),) or not math.isclose(float(body.sum()), 1.0, rel_tol=1e-9):
            raise InputError(place="observer", found="body is not one weight per node, sum 1")
        object.__setattr__(self, "body", body)
        object.__setattr__(self, "uncertain", UncertainNetwork(self.network))

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
        n, size = self.uncertain.nodes, self.uncertain.nodes + len(FACTORS)
        start = self.network.ambient if temperature_K is None else temperature_K
        if not (math.isfinite(start) and spread_K > 0.0):
            raise InputError(
                place="observer",
                found=f"starts at {start} K, spread {spread_K} K",
                expected="a positive spread",
            )
        mean, covariance = np.zeros(size), np.zeros((size, size))
        mean[:n] = start
        # the nodes are off together, and a little each
        covariance[:n, :n] = spread_K**2 * (0.96 + 0.04 * np.eye(n))
        if learnt is None:
            covariance[n:, n:] = self.model_uncertainty.covariance
        else:
            mean[n:] = learnt.mean[n:]
            covariance[n:, n:] = learnt.covariance[n:, n:]
        return ObserverState(0.0, read_only(mean), read_only(covariance))

    def step(self, state: ObserverState, seen: ThermalMeasurement) -> ObserverState:
        """Return the state after the time that passed and the readings at its end."""
        if not seen.elapsed_s >= 0.0:
            raise InputError(place="observer", found=f"{seen.elapsed_s} s passed", expected="zero or more")
        mean, covariance = np.array(state.mean), np.array(state.covariance)
        if seen.elapsed_s > 0.0:
            mean, covariance = self._advance(mean, covariance, seen)
        if _reads(seen.resistance_ohm) and seen.current_A != 0.0:
            mean, covariance = self._see_resistance(mean, covariance, seen)
        if _reads(seen.body_K):
            row = np.zeros(len(mean))
            row[: self.uncertain.nodes] = self.body
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
        n = self.uncertain.nodes
        spread = np.sqrt(np.diag(state.covariance)[n:])
        return {
            name: (math.exp(float(state.mean[n + k])), float(spread[k])) for k, name in enumerate(FACTORS)
        }

    def _weighted(self, state: ObserverState, weight: FloatArray) -> tuple[float, float]:
        n = self.uncertain.nodes
        variance = float(weight @ state.covariance[:n, :n] @ weight)
        return float(weight @ state.mean[:n]), math.sqrt(max(variance, 0.0))

    def _advance(
        self, mean: FloatArray, covariance: FloatArray, seen: ThermalMeasurement
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance after the time that passed: Euler, implicit in the temperatures."""
        n, network, uncertain, h = self.uncertain.nodes, self.network, self.uncertain, seen.elapsed_s
        nodes, factor = mean[:n], np.exp(mean[n:])
        stored = factor[CAPACITY] / h * network.capacity
        lost, lost_slope = uncertain.losses(nodes)
        joule = factor[RESISTANCE] * seen.current_A**2 * self.resistance_20_ohm
        by_coil = joule * COPPER_PER_K * np.outer(network.electrical, network.coil)
        driven = factor[POWER] * seen.power_W * network.mechanical
        matrix = (
            -uncertain.rest - factor[BODY] * uncertain.of_body - factor[COIL] * uncertain.of_coil - by_coil
        )
        matrix[np.diag_indices(n)] += stored + factor[LOSS] * lost_slope
        inverse = np.linalg.inv(matrix)
        heated = joule * (1.0 - COPPER_PER_K * REFERENCE_K) * network.electrical
        right = stored * nodes + driven + heated - factor[LOSS] * (lost - lost_slope * nodes)
        new = inverse @ right
        move = new - nodes
        by_factor = np.empty((n, len(FACTORS)))
        by_factor[:, POWER] = driven
        by_factor[:, CAPACITY] = -stored * move
        by_factor[:, LOSS] = -factor[LOSS] * (lost + lost_slope * move)
        by_factor[:, BODY] = factor[BODY] * (uncertain.of_body @ new)
        by_factor[:, COIL] = factor[COIL] * (uncertain.of_coil @ new)
        by_factor[:, RESISTANCE] = heated + by_coil @ new
        slope = np.eye(len(mean))
        slope[:n, :n] = inverse * stored
        slope[:n, n:] = inverse @ by_factor
        ahead = slope @ covariance @ slope.T
        ahead[np.diag_indices_from(ahead)] += h * self._walk()
        return np.concatenate([new, mean[n:]]), ahead

    def _walk(self) -> FloatArray:
        """Return the variance by which each of a state's numbers wanders in a second."""
        drift = np.full(len(FACTORS), self.model_uncertainty.drift_per_sqrt_h**2 / 3600.0)
        drift[RESISTANCE] = 0.0
        return np.append(np.full(self.uncertain.nodes, self.model_uncertainty.node_K_per_sqrt_s**2), drift)

    def _see_resistance(
        self, mean: FloatArray, covariance: FloatArray, seen: ThermalMeasurement
    ) -> tuple[FloatArray, FloatArray]:
        n = self.uncertain.nodes
        cold = self.resistance_20_ohm * math.exp(mean[n + RESISTANCE])
        expected = cold * (1.0 + COPPER_PER_K * (float(self.network.coil @ mean[:n]) - REFERENCE_K))
        row = np.zeros(len(mean))
        row[:n] = cold * COPPER_PER_K * self.network.coil
        row[n + RESISTANCE] = expected
        noise = self.thermometers.resistance_error(expected, seen.current_A)
        return _correct(mean, covariance, row, float(seen.resistance_ohm or 0.0) - expected, noise)


_USUAL = ObserverOptions()


def build_observer(drawing: DamperDrawing, options: ObserverOptions = _USUAL) -> TemperatureObserver:
    """Return the observer of a drawn damper; raise ``InputError`` where its coil has no resistance."""
    return TemperatureObserver(
        zone_network(drawing),
        drawing.coil.resistance,
        model_uncertainty=options.model_uncertainty,
        thermometers=options.thermometers,
    )


def observe_temperature(
    drawing: DamperDrawing, record: ThermalRecord, options: ObserverOptions = _USUAL
) -> ObservedTemperatures:
    """Return the temperatures of a drawn damper over a record, by the observer.

    Raises
    ------
    InputError
        The drawing's coil has no resistance.
    """
    observer = build_observer(drawing, options)
    state = observer.start(options.start_K, spread_K=options.start_spread_K)
    elapsed = np.diff(record.time, prepend=record.time[0])
    found = []
    for k, seconds in enumerate(elapsed.tolist()):
        measured = ThermalMeasurement(
            seconds,
            float(record.power[k]),
            float(record.current[k]),
            None if record.resistance is None else float(record.resistance[k]),
            None if record.body is None else float(record.body[k]),
        )
        state = observer.step(state, measured)
        found.append((*observer.fluid(state), *observer.coil(state), *observer.wall(state)))
    fluid, fluid_error, coil, coil_error, wall, wall_error = np.array(found).T
    return ObservedTemperatures(
        record.time, fluid, fluid_error, coil, coil_error, wall, wall_error, observer.factors(state), state
    )


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

    Dampers are drawn from the state, temperatures and factors together (so the uncertainty of the capacity is
    in the interval), and run ahead.

    Parameters
    ----------
    load : what heats from now on; its duration is how far is looked, and what is not reached until then is
        "not reached", infinity. Its ``coil_W`` goes with the drawing's resistance
    """
    fluid = WatchedPoint(observer.network.fluid, limit_K, np.zeros(1), np.zeros(1))
    return observer.uncertain.look_ahead(
        state.mean, state.covariance, [load], [fluid], probability=probability, dampers=dampers, seed=seed
    ).to_limit


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
