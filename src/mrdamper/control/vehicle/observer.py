"""What a car asks of its damper at a sample: its states from a vehicle's sensors, and the demand of them.

The step is in C (``core/kernel/vehicle.c``), the same that an export ships. Its observer is the steady Kalman
filter of the quarter car whose force between body and wheel is what the body's acceleration a says,
S = -m_b (a - b): damper, spring, end stops and top mount need not be known, nor the temperature. With the
states of ``car`` and the accelerometer's bias b:

    (x_b - x_w)' = x_b' - x_w',                  x_b'' = a - b
    (x_w - x_r)' = x_w' - x_r',              m_w x_w'' = -m_b (a - b) - k_t (x_w - x_r),    b' = -b / T

The road's speed x_r' is white, as ISO 8608 has it. What is corrected by is the stroke, and the wheel's
acceleration where it is measured; its bias is a state then, too. A bias does not drift: rattle space and tyre
deflection have a mean of zero, and so have the speeds. Behind an elastic top mount the stroke lacks what its
spring gives to the damper's force, S - k_s (x_b - x_w).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntFlag
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.control.vehicle.car import Demand, QuarterCar, check_positive
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.excitation import ROAD_ROUGHNESS

_DESIGN_CLASS, _DESIGN_SPEED_M_S = "B", 20.0  # a good road: of the ride's own the car knows nothing
_ROUGHNESS_WAVENUMBER = 0.1  # [1/m], of the roughness
_BIAS_TIME_s = 600.0  # in which a bias changes: it follows the sensor's temperature
_LEAST_BIAS_M_S2 = 1e-3
_MAY_BE_ZERO = ("body_bias_m_s2", "wheel_bias_m_s2", "stroke_bias_m", "wheel_accelerometer")
_STANDING_s = 20.0  # with the sensors on, before a drive
_COAST_S = 0.1  # without a reading before nothing is wanted


class VehicleFlag(IntFlag):
    """What a step had to say about its readings (``core/kernel/vehicle.h``)."""

    NO_BODY_ACCELERATION = 1
    NO_WHEEL_ACCELERATION = 2
    NO_STROKE = 4
    UNKNOWN = 8  # for too long: nothing is wanted, the states begin anew
    FAULT = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSensors:
    """What a vehicle's sensors add to what they measure; noise rms, a bias is constant."""

    body_noise_m_s2: float = 0.05
    body_bias_m_s2: float = 0.2
    wheel_accelerometer: bool = False
    wheel_noise_m_s2: float = 0.5
    wheel_bias_m_s2: float = 0.5
    stroke_noise_m: float = 10e-6
    stroke_bias_m: float = 0.0

    def __post_init__(self) -> None:
        check_positive(self, "vehicle sensors", zero=_MAY_BE_ZERO)


class ObserverMatrices(NamedTuple):
    """The observer of a sampled car: n states, 5, or 6 where the wheel has an accelerometer."""

    predict: FloatArray  # (n, n)
    before: FloatArray  # (n,), of the body's acceleration at the period's begin
    present: FloatArray  # (n,), ... at its end
    stroke: FloatArray  # (n + 1,), the damper's stroke, of states and body's acceleration
    wheel: FloatArray  # (n + 1,), the wheel's acceleration, of the same
    gain: FloatArray  # (n, 2), of stroke and wheel's acceleration


def observer_matrices(
    car: QuarterCar, sensors: VehicleSensors, period_s: float, mount: TopMount | None = None
) -> ObserverMatrices:
    """Return the steady Kalman filter for a car, its sensors and a sampling period."""
    from scipy.linalg import expm

    heavier, stiffer = car.body_kg / car.wheel_kg, car.tyre_N_m / car.wheel_kg
    biases = (sensors.body_bias_m_s2, *((sensors.wheel_bias_m_s2,) if sensors.wheel_accelerometer else ()))
    n = 4 + len(biases)
    unit = np.eye(n)
    system = np.zeros((n, n))
    system[0, [1, 3]] = 1.0, -1.0
    system[1, 4] = -1.0
    system[2, 3] = 1.0
    system[3, [2, 4]] = -stiffer, heavier
    system[4:, 4:] = -np.eye(len(biases)) / _BIAS_TIME_s
    by_body = unit[1] - heavier * unit[3]
    # a straight line between two readings: the exponential of the system with the reading and its slope
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n], whole[n, n + 1] = system, by_body, 1.0
    exact = expm(period_s * whole)
    predict, present = exact[:n, :n], exact[:n, n + 1] / period_s
    # one-sided spectrum of the road's speed [m^2/s]; an intensity is two-sided
    spectrum = (2.0 * np.pi * _ROUGHNESS_WAVENUMBER) ** 2 * ROAD_ROUGHNESS[_DESIGN_CLASS] * _DESIGN_SPEED_M_S
    slow = [2.0 * max(bias, _LEAST_BIAS_M_S2) ** 2 / _BIAS_TIME_s for bias in biases]
    intensity = np.diag([0.0, 0.0, 0.5 * spectrum, 0.0, *slow])
    intensity += period_s * sensors.body_noise_m_s2**2 * np.outer(by_body, by_body)
    # Van Loan: the covariance that a period adds
    loan = expm(period_s * np.block([[-system, intensity], [np.zeros((n, n)), system.T]]))
    gives = 0.0 if mount is None else 1.0 / mount.stiffness_N_m
    through = gives * car.body_kg
    stroke = np.append((1.0 + gives * car.spring_N_m) * unit[0] - through * unit[4], through)
    wheel = np.append(heavier * unit[4] - stiffer * unit[2] + sum(unit[5:]), -heavier)
    seen, noises = [stroke[:n]], [np.hypot(sensors.stroke_noise_m, through * sensors.body_noise_m_s2)]
    if sensors.wheel_accelerometer:
        seen.append(wheel[:n])
        noises.append(np.hypot(sensors.wheel_noise_m_s2, heavier * sensors.body_noise_m_s2))
    gain = np.zeros((n, 2))
    gain[:, : len(seen)] = _steady_gain(predict, predict @ loan[:n, n:], np.array(seen), np.array(noises))
    return ObserverMatrices(predict, exact[:n, n] - present, present, stroke, wheel, gain)


def _steady_gain(predict: FloatArray, added: FloatArray, seen: FloatArray, noises: FloatArray) -> FloatArray:
    """Return the gain of the steady Kalman filter; readings are scaled by their noise."""
    from scipy.linalg import solve_discrete_are

    scaled, own = seen / noises[:, None], np.eye(len(noises))
    before = solve_discrete_are(predict.T, scaled.T, 0.5 * (added + added.T), own)
    return np.asarray(before @ scaled.T @ np.linalg.inv(scaled @ before @ scaled.T + own) / noises)


@dataclass(frozen=True, slots=True, eq=False)
class DemandStep:
    """Readings of a vehicle in, wanted force now and at the preview out; its state is bytes.

    Without a reading for 0.1 s nothing is wanted, and the states begin anew. To the preview the car's free
    motion is taken: what the damper takes from it meanwhile, the road gives back on average.
    """

    car: QuarterCar
    demand: Demand
    period_s: float = 1e-3
    preview_s: float = 0.0
    sensors: VehicleSensors = field(default_factory=VehicleSensors)
    mount: TopMount | None = None
    single: bool = False
    tables: Mapping[str, FloatArray] = field(init=False, repr=False)  # of the kernel's struct, in its order
    _native: core.VehicleStep = field(init=False, repr=False)

    def __post_init__(self) -> None:
        made = observer_matrices(self.car, self.sensors, self.period_s, self.mount)
        tables = {**made._asdict(), "ahead": self.car.advance(self.preview_s)[0]}
        object.__setattr__(self, "tables", MappingProxyType(tables))
        numbers = (self.car.body_kg, self.car.spring_N_m, *self.demand.gains)
        native = core.VehicleStep(
            np.concatenate([numbers, *map(np.ravel, tables.values())]),
            self.sensors.wheel_accelerometer,
            self.demand.by_acceleration,
            self.coast_samples,
            single=self.single,
        )
        object.__setattr__(self, "_native", native)

    @property
    def coast_samples(self) -> int:
        """Samples without a reading before nothing is wanted."""
        return max(round(_COAST_S / self.period_s), 1)

    def start(self) -> bytes:
        """Return the state before the first sample: at rest."""
        return self._native.start()

    def stand(self) -> bytes:
        """Return the state of a car that has stood still with its sensors on: it knows their biases."""
        still = (self.sensors.body_bias_m_s2, self.sensors.wheel_bias_m_s2, self.sensors.stroke_bias_m)
        return self.run(self.start(), np.tile(still, (round(_STANDING_s / self.period_s), 1)))[0]

    def step(
        self, state: bytes, body_m_s2: float, wheel_m_s2: float, stroke_m: float, /
    ) -> tuple[bytes, float, float]:
        """Return the next state, and the wanted force [N] now and at the preview; NaN: no reading."""
        return self._native.step(state, body_m_s2, wheel_m_s2, stroke_m)

    def of_states(
        self, states: tuple[float, float, float, float], off_m_s: float, pushed_N: float
    ) -> tuple[float, float]:
        """Return the wanted force [N] of true states, now and at the preview.

        Parameters
        ----------
        off_m_s : error of the damper's speed by whose sign the demand is clipped
        pushed_N : force of damper and end stops
        """
        return self._native.demand(*states, off_m_s, pushed_N)

    def run(self, state: bytes, rows: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Take many steps at once; return the last state, the wanted forces [N], shape (n, 2), and the flags.

        ``rows`` holds accelerations of body and wheel [m/s^2] and the stroke [m], shape (n, 3).
        """
        inputs = np.ascontiguousarray(rows, dtype=np.float64)
        wanted, flags = np.empty((len(inputs), 2)), np.empty(len(inputs))
        return self._native.run(state, inputs, wanted, flags), wanted, flags.astype(np.int64)

    def believes(self, state: bytes) -> tuple[float, float, float, float, float, float]:
        """Return the estimated states, and biases of the body's and the wheel's accelerometer [m/s^2]."""
        return self._native.read(state)
