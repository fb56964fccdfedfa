"""A quarter car on a road: a semi-active demand for force, and a damper that has to follow it.

States z = (x_b - x_w, x_b', x_w - x_r, x_w'): rattle space, body speed, tyre deflection, wheel speed, about
the car at rest; extension of the damper is x_b - x_w, and its force F resists extension:

    m_b x_b'' = -k_s (x_b - x_w) - F
    m_w x_w'' =  k_s (x_b - x_w) + F - k_t (x_w - x_r)

A demand is a linear feedback F* = gains . z, taken only where the damper can give it (F* v > 0), else zero:
skyhook, groundhook, a mixture of both, or the linear-quadratic regulator of body acceleration, clipped. The
demand knows the states, and from them the demand at a controller's preview: nobody knows the road ahead, but
the car's free motion over some milliseconds is a good guess. The damper's controller has its own sensors.
Between two steps of the damper its force is held and the car moves exactly.

The damper warms by what it dissipates, as two bodies, fluid and housing (``TwoBodies``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.loop import steps_per_sample
from mrdamper.control.protocol import Controller, Measurement, Reference
from mrdamper.errors import InputError
from mrdamper.excitation import Motion, Road
from mrdamper.quantities import ZERO_CELSIUS_K

__all__ = [
    "CarDamper",
    "Demand",
    "Journey",
    "LongDrive",
    "QuarterCar",
    "Ride",
    "Stretch",
    "Thermometer",
    "TwoBodies",
    "Vehicle",
    "drive_car",
    "groundhook",
    "hybrid",
    "linear_quadratic",
    "skyhook",
    "warm_up",
]

_MOST_TRAVEL_M = 1.0
_CHUNK_S = 5.0  # of road that is worked out at once


class CarDamper(Protocol):
    """A damper that moves on by single steps, since the car's motion depends on its force."""

    @property
    def step_s(self) -> float: ...

    def advance(
        self, displacement: float, velocity: float, current: float, temperature_degC: float, /
    ) -> float:
        """Move on by one step; return the force [N] at its end."""
        ...

    def copy(self) -> CarDamper: ...


def _check_positive(record: object, place: str, *, zero: tuple[str, ...] = ()) -> None:
    for each in fields(record):  # type: ignore[arg-type]  # dataclasses only
        value = getattr(record, each.name)
        if not (math.isfinite(value) and (value > 0.0 or (value == 0.0 and each.name in zero))):
            raise InputError(f"{place}: {each.name} is {value!r}; expected a positive number")


@dataclass(frozen=True, slots=True, kw_only=True)
class QuarterCar:
    """Body, wheel, spring and tyre of a quarter of a car; its damper is not a part of it."""

    body_kg: float = 320.0
    wheel_kg: float = 40.0
    spring_N_m: float = 20e3
    tyre_N_m: float = 200e3

    def __post_init__(self) -> None:
        _check_positive(self, "quarter car")

    @property
    def system(self) -> FloatArray:
        """A of z' = A z + b F + c x_r', shape (4, 4)."""
        body, wheel = self.body_kg, self.wheel_kg
        spring, tyre = self.spring_N_m, self.tyre_N_m
        return np.array(
            [
                [0.0, 1.0, 0.0, -1.0],
                [-spring / body, 0.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
                [spring / wheel, 0.0, -tyre / wheel, 0.0],
            ]
        )

    @property
    def by_force(self) -> FloatArray:
        """b, shape (4,)."""
        return np.array([0.0, -1.0 / self.body_kg, 0.0, 1.0 / self.wheel_kg])

    @property
    def by_road(self) -> FloatArray:
        """c, shape (4,)."""
        return np.array([0.0, 0.0, -1.0, 0.0])

    def energy(self, states: FloatArray) -> FloatArray:
        """Return what springs and masses hold [J] in states, shape (..., 4)."""
        weights = np.array([self.spring_N_m, self.body_kg, self.tyre_N_m, self.wheel_kg])
        return np.asarray(0.5 * (states**2) @ weights)

    def advance(self, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, b, c of the exact step with force and road speed held over it."""
        from scipy.linalg import expm

        whole = np.zeros((6, 6))
        whole[:4, :4], whole[:4, 4], whole[:4, 5] = self.system, self.by_force, self.by_road
        exact = np.asarray(expm(step_s * whole), dtype=np.float64)
        return exact[:4, :4], exact[:4, 4], exact[:4, 5]


@dataclass(frozen=True, slots=True)
class Demand:
    """A wanted force F* = gains . z [N], where F* v > 0, else zero; v = x_b' - x_w' as it is seen."""

    name: str
    gains: tuple[float, float, float, float]  # [N/m, N s/m, N/m, N s/m]

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.gains)):
            raise InputError(f"demand {self.name!r}: gains are {self.gains}; expected four finite numbers")


def skyhook(damping: float = 2500.0) -> Demand:
    """Return the demand of a damper [N s/m] between body and sky."""
    return Demand("skyhook", (0.0, damping, 0.0, 0.0))


def groundhook(damping: float = 2500.0) -> Demand:
    """Return the demand of a damper [N s/m] between wheel and ground."""
    return Demand("groundhook", (0.0, 0.0, 0.0, -damping))


def hybrid(damping: float = 2500.0, share: float = 0.5) -> Demand:
    """Return the mixture of skyhook (``share``) and groundhook (the rest) of a damping [N s/m]."""
    return Demand("hybrid", (0.0, share * damping, 0.0, (share - 1.0) * damping))


def linear_quadratic(car: QuarterCar, *, rattle: float = 5e2, tyre: float = 1e4) -> Demand:
    """Return the regulator of least mean x_b''^2 + rattle (x_b - x_w)^2 + tyre (x_w - x_r)^2.

    Parameters
    ----------
    rattle, tyre : weights [1/s^4]
    """
    from scipy.linalg import solve_continuous_are

    # x_b'' = row . z + entry F: the cost has cross terms between state and force
    row, entry = car.system[1], float(car.by_force[1])
    weights = np.outer(row, row) + np.diag([rattle, 0.0, tyre, 0.0])
    cross, cost = (row * entry)[:, None], np.array([[entry**2]])
    b = car.by_force[:, None]
    riccati = solve_continuous_are(car.system, b, weights, cost, s=cross)
    gains = -(b.T @ riccati + cross.T)[0] / cost[0, 0]
    first, second, third, fourth = (float(gain) for gain in gains)
    return Demand("linear-quadratic", (first, second, third, fourth))


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A car, what is asked of its damper, the damper, and who commands it.

    Without a damper the demand itself acts, held between samples: the ideal one. A damper without a
    controller gets no current: the passive car.
    """

    car: QuarterCar
    demand: Demand
    damper: CarDamper | None = None
    controller: Controller | None = None
    highest_A: float = 2.0

    def __post_init__(self) -> None:
        if self.damper is None and self.controller is not None:
            raise InputError("vehicle: a controller without a damper; expected both, or the damper alone")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of road and what the sensors add to it."""

    road: Motion = field(default_factory=Road)
    duration_s: float = 60.0
    unscored_s: float = 2.0
    temperature_degC: float = 20.0  # of fluid and coil, held
    seen_degC: float | None = None  # what the thermometer says but for noise; None: the same
    seed: int = 5
    displacement_noise_m: float = 10e-6
    velocity_noise_m_s: float = 3e-3  # of the speed by whose sign the demand is clipped
    temperature_noise_K: float = 0.3

    def __post_init__(self) -> None:
        if not 0.0 <= self.unscored_s < self.duration_s < math.inf:
            raise InputError(
                f"stretch: lasts {self.duration_s:g} s, of which {self.unscored_s:g} s are not scored; "
                "expected something to score"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Ride:
    """A stretch of road: figures of the scored part, and the series at the damper's steps, shape (n,)."""

    body_acceleration_m_s2: float  # rms: comfort
    tyre_load_N: float  # rms, about the static load: road holding
    rattle_m: float  # rms of x_b - x_w
    heat_W: float  # mean mechanical power that the damper takes up
    current_rms_A: float
    force_error_N: float | None  # rms of force less demand at the samples; None without a controller
    step_s: float
    states: FloatArray  # z, shape (n, 4)
    force: FloatArray  # [N], held over the step that leads to the states
    road: FloatArray  # road speed over that step [m/s]
    memory: _Memory


@dataclass(frozen=True, slots=True, eq=False)
class _Memory:
    """What goes on into the next stretch."""

    time: float
    states: tuple[float, float, float, float]
    force: float
    damper: CarDamper | None
    controller: Any


def drive_car(vehicle: Vehicle, stretch: Stretch, *, after: Ride | None = None) -> Ride:
    """Drive a stretch of road, from rest or where the ride ``after`` ended; the damper given is copied.

    Raises
    ------
    InputError
        A sampling period that does not fit, or a car that is not held: its travel leaves +-1 m.
    """
    car, controller = vehicle.car, vehicle.controller
    start = _Memory(0.0, (0.0, 0.0, 0.0, 0.0), 0.0, vehicle.damper, None) if after is None else after.memory
    damper = None if start.damper is None else start.damper.copy()
    state = controller.start() if controller is not None and after is None else start.controller
    period = 1e-3 if controller is None else controller.period_s
    step = 1e-4 if damper is None else damper.step_s
    every = steps_per_sample(period, step)
    samples = max(round(stretch.duration_s / period), 1)
    speeds = _road_speeds(stretch.road, start.time, samples * every, step)

    (a11, a12, a13, a14), (a21, a22, a23, a24), (a31, a32, a33, a34), (a41, a42, a43, a44) = car.advance(
        step
    )[0].tolist()
    (b1, b2, b3, b4), (c1, c2, c3, c4) = (each.tolist() for each in car.advance(step)[1:])
    g1, g2, g3, g4 = vehicle.demand.gains
    (p1, p2, p3, p4), (q1, q2, q3, q4) = _look_ahead(vehicle)
    z1, z2, z3, z4 = start.states
    force, current, warm, k = start.force, 0.0, stretch.temperature_degC, 0
    series: list[tuple[float, float, float, float, float]] = []
    errors: list[float] = []
    currents: list[float] = []
    for velocity_error, x_error, kelvin in _readings(stretch, start.time, samples):
        wanted = g1 * z1 + g2 * z2 + g3 * z3 + g4 * z4
        if not wanted * (z2 - z4 + velocity_error) > 0.0:
            wanted = 0.0
        if controller is not None:
            errors.append(force - wanted)
            felt = force if controller.needs_force else None
            ahead = None
            if controller.preview_s > 0.0:
                ahead = p1 * z1 + p2 * z2 + p3 * z3 + p4 * z4
                if not ahead * (q1 * z1 + q2 * z2 + q3 * z3 + q4 * z4 + velocity_error) > 0.0:
                    ahead = 0.0
            state, current = controller.step(
                state, Reference(wanted, ahead), Measurement(z1 + x_error, kelvin, felt)
            )
            current = min(max(current, 0.0), vehicle.highest_A)
        currents.append(current)
        if damper is None:
            force = wanted
        for speed in speeds[k : k + every]:
            z1, z2, z3, z4 = (
                a11 * z1 + a12 * z2 + a13 * z3 + a14 * z4 + b1 * force + c1 * speed,
                a21 * z1 + a22 * z2 + a23 * z3 + a24 * z4 + b2 * force + c2 * speed,
                a31 * z1 + a32 * z2 + a33 * z3 + a34 * z4 + b3 * force + c3 * speed,
                a41 * z1 + a42 * z2 + a43 * z3 + a44 * z4 + b4 * force + c4 * speed,
            )
            series.append((z1, z2, z3, z4, force))
            if damper is not None:
                force = damper.advance(z1, z2 - z4, current, warm)
        k += every
        if not -_MOST_TRAVEL_M < z1 < _MOST_TRAVEL_M:
            raise InputError(
                f"ride: the damper's travel is {z1:g} m after {k * step:.2f} s; the car is not held. Check "
                "the demand's gains, and that the damper is of a car's size"
            )
    memory = _Memory(start.time + samples * period, (z1, z2, z3, z4), force, damper, state)
    skip = round(stretch.unscored_s / period)
    table, before = np.array(series), np.array(start.states)
    scored = table[skip * every :]
    # the force is held over a step: its work is force times the change of length
    lengths = np.diff(table[:, 0], prepend=before[0])[skip * every :]
    return Ride(
        body_acceleration_m_s2=_rms((car.spring_N_m * scored[:, 0] + scored[:, 4]) / car.body_kg),
        tyre_load_N=car.tyre_N_m * _rms(scored[:, 2]),
        rattle_m=_rms(scored[:, 0]),
        heat_W=float(scored[:, 4] @ lengths) / (step * len(scored)),
        current_rms_A=_rms(np.array(currents[skip:])),
        force_error_N=_rms(np.array(errors[skip:])) if errors else None,
        step_s=step,
        states=table[:, :4],
        force=table[:, 4],
        road=np.array(speeds),
        memory=memory,
    )


def _look_ahead(vehicle: Vehicle) -> tuple[list[float], list[float]]:
    """Return what turns states into demand [N] and damper speed [m/s] at the controller's preview.

    The car's free motion is taken: what the damper takes from it meanwhile, the road gives back on average.
    """
    preview = 0.0 if vehicle.controller is None else vehicle.controller.preview_s
    free = vehicle.car.advance(preview)[0]
    return (np.array(vehicle.demand.gains) @ free).tolist(), (np.array([0.0, 1.0, 0.0, -1.0]) @ free).tolist()


def _readings(stretch: Stretch, start: float, samples: int) -> Iterator[tuple[float, float, float]]:
    """Return the noise of velocity [m/s] and displacement [m], and the temperature that is read [K]."""
    noise = np.random.default_rng((stretch.seed, round(1e3 * start)))
    seen = stretch.temperature_degC if stretch.seen_degC is None else stretch.seen_degC
    velocity, x, kelvin = (noise.standard_normal(samples) for _ in range(3))
    return zip(
        (stretch.velocity_noise_m_s * velocity).tolist(),
        (stretch.displacement_noise_m * x).tolist(),
        (seen + ZERO_CELSIUS_K + stretch.temperature_noise_K * kelvin).tolist(),
        strict=True,
    )


# --------------------------------------------------------------------------------------------- warming up


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies:
    """A damper as fluid and housing, with constant conductances.

    .. math:: C_f T_f' = P - G (T_f - T_h),  C_h T_h' = G (T_f - T_h) - G_a (T_h - T_a)
    """

    fluid_J_K: float = 150.0
    housing_J_K: float = 950.0
    between_W_K: float = 6.0
    ambient_W_K: float = 2.0

    def __post_init__(self) -> None:
        _check_positive(self, "two bodies", zero=("ambient_W_K",))

    def warm(
        self, temperatures: tuple[float, float], power_W: float, time_s: float, ambient_degC: float = 20.0
    ) -> tuple[float, float]:
        """Return the temperatures of fluid and housing [degC] after a time at constant power, exactly."""
        from scipy.linalg import expm

        between, out = self.between_W_K, self.ambient_W_K
        system = np.zeros((3, 3))
        system[0] = [-between / self.fluid_J_K, between / self.fluid_J_K, power_W / self.fluid_J_K]
        system[1, :2] = [between / self.housing_J_K, -(between + out) / self.housing_J_K]
        above = np.array([temperatures[0] - ambient_degC, temperatures[1] - ambient_degC, 1.0])
        fluid, housing, _ = (expm(time_s * system) @ above).tolist()
        return float(fluid) + ambient_degC, float(housing) + ambient_degC


Thermometer = Callable[[float, float, float], float]
"""What a controller is told [degC]: of the fluid's and the housing's temperature [degC] and the power [W]."""


def _fluid_itself(fluid: float, _housing: float, _power: float) -> float:
    return fluid


@dataclass(frozen=True, slots=True, kw_only=True)
class LongDrive:
    """A drive of which one stretch in every ``every_s`` is driven; its power warms the damper all the while.

    The current is cut off while the thermometer says more than ``cut_off_degC``, until it says less than
    ``back_degC``. The damper never gets hotter than ``hottest_degC``: a drive that reaches that says so by
    staying there.
    """

    duration_s: float = 1800.0
    every_s: float = 60.0
    stretch_s: float = 6.0
    bodies: TwoBodies = field(default_factory=TwoBodies)
    ambient_degC: float = 20.0
    hottest_degC: float = 150.0
    cut_off_degC: float | None = None
    back_degC: float = 110.0
    coil_ohm: float = 5.0  # at 20 degC
    copper_per_K: float = 0.00393
    thermometer: Thermometer = _fluid_itself

    def __post_init__(self) -> None:
        if not 0.0 < self.stretch_s <= self.every_s <= self.duration_s < math.inf:
            raise InputError(
                f"long drive: stretches of {self.stretch_s:g} s every {self.every_s:g} s over "
                f"{self.duration_s:g} s; expected in this order"
            )
        if self.cut_off_degC is not None and not self.back_degC < self.cut_off_degC:
            raise InputError(
                f"long drive: the current is cut off at {self.cut_off_degC:g} degC and comes back at "
                f"{self.back_degC:g} degC; expected back below it"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Journey:
    """A long drive, a row per stretch, shape (m,); temperatures are those at its beginning."""

    time: FloatArray  # [s]
    fluid_degC: FloatArray
    housing_degC: FloatArray
    told_degC: FloatArray  # to the controller
    heat_W: FloatArray  # mechanical
    coil_W: FloatArray
    is_cut_off: FloatArray  # 1 where the current was cut off
    body_acceleration_m_s2: FloatArray
    tyre_load_N: FloatArray
    force_error_N: FloatArray  # NaN without a controller


def warm_up(vehicle: Vehicle, plan: LongDrive, stretch: Stretch | None = None) -> Journey:
    """Drive for long; the temperatures and the length of ``stretch`` are the plan's to set."""
    base = Stretch() if stretch is None else stretch
    skip = min(1.0, 0.2 * plan.stretch_s)
    at, power, is_cut = (plan.ambient_degC, plan.ambient_degC), 0.0, False
    ride: Ride | None = None
    rows: list[tuple[float, ...]] = []
    for k in range(round(plan.duration_s / plan.every_s)):
        told = plan.thermometer(*at, power)
        if plan.cut_off_degC is not None:
            is_cut = told > (plan.back_degC if is_cut else plan.cut_off_degC)
        now = replace(
            base, duration_s=plan.stretch_s, unscored_s=skip, temperature_degC=at[0], seen_degC=told
        )
        commanded = replace(vehicle, highest_A=0.0) if is_cut else vehicle
        ride = drive_car(commanded, now, after=ride)
        resistance = plan.coil_ohm * (1.0 + plan.copper_per_K * (at[0] - 20.0))
        coil = ride.current_rms_A**2 * resistance
        power = ride.heat_W + coil
        error = math.nan if ride.force_error_N is None else ride.force_error_N
        figures = (ride.body_acceleration_m_s2, ride.tyre_load_N, error)
        rows.append((k * plan.every_s, *at, told, ride.heat_W, coil, float(is_cut), *figures))
        fluid, housing = plan.bodies.warm(at, power, plan.every_s, plan.ambient_degC)
        at = min(fluid, plan.hottest_degC), min(housing, plan.hottest_degC)
    return Journey(*np.ascontiguousarray(np.array(rows).T))


def _road_speeds(road: Motion, start: float, count: int, step: float) -> list[float]:
    """Return the road's mean speed [m/s] over each step, worked out piece by piece: a road has many tones."""
    chunk = max(round(_CHUNK_S / step), 1)
    heights = [
        road.displacement(start + step * np.arange(first, min(first + chunk, count + 1)))
        for first in range(0, count + 1, chunk)
    ]
    return list((np.diff(np.concatenate(heights)) / step).tolist())


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
