"""A drive of a quarter car over a segment of road, its damper commanded by a controller.

The demand knows the states, and from them the demand at a controller's preview: nobody knows the road ahead,
but the car's free motion over some milliseconds is a good guess. The damper's controller has its own sensors.
Between two steps of the damper its force and the end stop's are held and the car moves exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray, read_only, rms
from mrdamper.control.loop import steps_per_sample
from mrdamper.control.protocol import Controller, Measurement, Reference
from mrdamper.control.vehicle.car import CarDamper, Demand, QuarterCar
from mrdamper.control.vehicle.comfort import weighted
from mrdamper.control.vehicle.roads import Heights
from mrdamper.errors import InputError
from mrdamper.excitation import Road
from mrdamper.quantities import ZERO_CELSIUS_K

_MOST_TRAVEL_M = 1.0
_CHUNK_S = 5.0  # of road that is worked out at once


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A car, what is asked of its damper, the damper, and who commands it.

    Without a damper the demand itself acts, held between samples: the ideal one. A damper without a
    controller gets ``held_A``: no current, the passive car, or a setting of it.
    """

    car: QuarterCar
    demand: Demand
    damper: CarDamper | None = None
    controller: Controller | None = None
    highest_A: float = 2.0
    held_A: float = 0.0

    def __post_init__(self) -> None:
        if self.damper is None and self.controller is not None:
            raise InputError(
                place="vehicle", found="a controller without a damper", expected="both, or the damper alone"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSegment:
    """A segment of road and what the sensors add to it."""

    road: Heights = field(default_factory=Road)
    duration_s: float = 60.0
    unscored_s: float = 2.0
    temperature_degC: float = 20.0  # of fluid and coil, held
    thermometer_degC: float | None = None  # what the thermometer says but for noise; None: the same
    seed: int = 5
    displacement_noise_m: float = 10e-6
    velocity_noise_m_s: float = 3e-3  # of the speed by whose sign the demand is clipped
    temperature_noise_K: float = 0.3

    def __post_init__(self) -> None:
        if not 0.0 <= self.unscored_s < self.duration_s < math.inf:
            raise InputError(
                place="segment",
                found=f"lasts {self.duration_s:g} s, of which {self.unscored_s:g} s are not scored",
                expected="something to score",
            )


@dataclass(frozen=True, slots=True, eq=False)
class Ride:
    """A segment of road: figures of the scored part, and the series at the damper's steps, shape (n,)."""

    body_acceleration_m_s2: float  # rms
    weighted_acceleration_m_s2: float  # rms, by W_k of ISO 2631-1: comfort
    tyre_load_N: float  # rms, about the static load: road holding
    rattle_m: float  # rms of x_b - x_w
    most_rattle_m: float  # either way
    end_stop_N: float  # most, of either stop
    heat_W: float  # mean mechanical power that the damper takes up
    current_rms_A: float
    force_error_N: float | None  # rms of force less demand at the samples; None without a controller
    step_s: float
    states: FloatArray  # z, shape (n, 4)
    force: FloatArray  # of the damper [N], held over the step that leads to the states
    body: FloatArray  # acceleration of the body [m/s^2] at its end, the force still held
    road: FloatArray  # road speed over that step [m/s]
    memory: _Memory


@dataclass(frozen=True, slots=True, eq=False)
class _Memory:
    """What goes on into the next segment."""

    time: float
    states: tuple[float, float, float, float]
    force: float
    damper: CarDamper | None
    controller: Any


def drive_car(vehicle: Vehicle, segment: RoadSegment, *, after: Ride | None = None) -> Ride:
    """Drive a segment of road, from rest or where the ride ``after`` ended; the damper given is copied.

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
    samples = max(round(segment.duration_s / period), 1)
    speeds = _road_speeds(segment.road, start.time, samples * every, step).tolist()

    (a11, a12, a13, a14), (a21, a22, a23, a24), (a31, a32, a33, a34), (a41, a42, a43, a44) = car.advance(
        step
    )[0].tolist()
    (b1, b2, b3, b4), (c1, c2, c3, c4) = (each.tolist() for each in car.advance(step)[1:])
    now, later = _demand_rows(vehicle, 0.0), _demand_rows(vehicle, getattr(controller, "preview_s", 0.0))
    by_acceleration = vehicle.demand.by_acceleration
    z1, z2, z3, z4 = start.states
    force, warm, k = start.force, segment.temperature_degC, 0
    current = 0.0 if controller is not None else min(vehicle.held_A, vehicle.highest_A)
    stroke, stop, pushed = car.stroke_m, car.stop_N_m, start.force + float(car.stop_force(np.array(z1)))
    series: list[tuple[float, ...]] = []
    errors: list[float] = []
    currents: list[float] = []
    for velocity_error, x_error, kelvin in _readings(segment, start.time, samples):
        at = (z1, z2, z3, z4, velocity_error, pushed)
        wanted = _wanted(now, by_acceleration, *at)
        if controller is not None:
            errors.append(force - wanted)
            felt = force if controller.needs_force else None
            ahead = _wanted(later, by_acceleration, *at) if controller.preview_s > 0.0 else None
            state, current = controller.step(
                state, Reference(wanted, ahead), Measurement(z1 + x_error, kelvin, felt)
            )
            current = min(max(current, 0.0), vehicle.highest_A)
        currents.append(current)
        if damper is None:
            force = wanted
        for rise in speeds[k : k + every]:
            pushed = force
            if not -stroke <= z1 <= stroke:
                pushed += stop * (z1 - stroke if z1 > 0.0 else z1 + stroke)
            z1, z2, z3, z4 = (
                a11 * z1 + a12 * z2 + a13 * z3 + a14 * z4 + b1 * pushed + c1 * rise,
                a21 * z1 + a22 * z2 + a23 * z3 + a24 * z4 + b2 * pushed + c2 * rise,
                a31 * z1 + a32 * z2 + a33 * z3 + a34 * z4 + b3 * pushed + c3 * rise,
                a41 * z1 + a42 * z2 + a43 * z3 + a44 * z4 + b4 * pushed + c4 * rise,
            )
            series.append((z1, z2, z3, z4, force, pushed))
            if damper is not None:
                force = damper.advance(z1, z2 - z4, current, warm)
        k += every
        if not -_MOST_TRAVEL_M < z1 < _MOST_TRAVEL_M:
            raise InputError(
                place="ride",
                found=f"the damper's travel is {z1:g} m after {k * step:.2f} s; the car is not held",
                remedy="Check the demand's gains, and that the damper is of a car's size",
            )
    memory = _Memory(start.time + samples * period, (z1, z2, z3, z4), force, damper, state)
    skip = round(segment.unscored_s / period)
    return _scored(
        car,
        start,
        memory,
        skip * every,
        step=step,
        series=np.array(series),
        road=np.array(speeds),
        currents=np.array(currents[skip:]),
        errors=np.array(errors[skip:]),
    )


def _scored(  # noqa: PLR0913 - what a drive has left behind
    car: QuarterCar,
    start: _Memory,
    memory: _Memory,
    skip: int,
    *,
    step: float,
    series: FloatArray,
    road: FloatArray,
    currents: FloatArray,
    errors: FloatArray,
) -> Ride:
    """Return the ride, its figures those of the steps from ``skip`` on."""
    scored = series[skip:]
    # the force is held over a step: its work is force times the change of length
    lengths = np.diff(series[:, 0], prepend=start.states[0])[skip:]
    body = -(car.spring_N_m * series[:, 0] + series[:, 5]) / car.body_kg
    return Ride(
        body_acceleration_m_s2=rms(body[skip:]),
        weighted_acceleration_m_s2=rms(weighted(body, step)[skip:]),
        tyre_load_N=car.tyre_N_m * rms(scored[:, 2]),
        rattle_m=rms(scored[:, 0]),
        most_rattle_m=float(np.abs(scored[:, 0]).max()),
        end_stop_N=float(np.abs(car.stop_force(scored[:, 0])).max()),
        heat_W=float(scored[:, 4] @ lengths) / (step * len(scored)),
        current_rms_A=rms(currents),
        force_error_N=rms(errors) if len(errors) else None,
        step_s=step,
        states=series[:, :4],
        force=series[:, 4],
        body=body,
        road=road,
        memory=memory,
    )


_Row = tuple[float, float, float, float]


def _demand_rows(vehicle: Vehicle, ahead_s: float) -> tuple[_Row, _Row, _Row]:
    """Return what turns states into demand [N], damper speed [m/s], spring force [N] a time ahead.

    The car's free motion is taken: what the damper takes from it meanwhile, the road gives back on average.
    """
    free = vehicle.car.advance(ahead_s)[0]
    rows = (vehicle.demand.gains, (0.0, 1.0, 0.0, -1.0), (vehicle.car.spring_N_m, 0.0, 0.0, 0.0))
    demand, speed, spring = map(tuple, (np.array(rows) @ free).tolist())
    return demand, speed, spring


def _wanted(
    rows: tuple[_Row, _Row, _Row],
    by_acceleration: bool,  # noqa: FBT001
    z1: float, z2: float, z3: float, z4: float, velocity_error: float, pushed: float,
) -> float:  # fmt: skip
    """Return the demand [N] where the damper can give it, else 0; ``pushed`` is its force and the stop's."""
    (g1, g2, g3, g4), (q1, q2, q3, q4), (r1, r2, r3, r4) = rows
    wanted = g1 * z1 + g2 * z2 + g3 * z3 + g4 * z4
    speed = q1 * z1 + q2 * z2 + q3 * z3 + q4 * z4 + velocity_error
    if not wanted * speed > 0.0:
        return 0.0
    if by_acceleration and (r1 * z1 + r2 * z2 + r3 * z3 + r4 * z4 + pushed) * speed > 0.0:
        return 0.0
    return wanted


def _readings(segment: RoadSegment, start: float, samples: int) -> Iterator[tuple[float, float, float]]:
    """Return the noise of velocity [m/s] and displacement [m], and the temperature that is read [K]."""
    noise = np.random.default_rng((segment.seed, round(1e3 * start)))
    shown = segment.temperature_degC if segment.thermometer_degC is None else segment.thermometer_degC
    velocity, x, kelvin = (noise.standard_normal(samples) for _ in range(3))
    return zip(
        (segment.velocity_noise_m_s * velocity).tolist(),
        (segment.displacement_noise_m * x).tolist(),
        (shown + ZERO_CELSIUS_K + segment.temperature_noise_K * kelvin).tolist(),
        strict=True,
    )


@lru_cache(maxsize=64)  # one car after the other drives the same road: half of the time of a drive
def _road_speeds(road: Heights, start: float, count: int, step: float) -> FloatArray:
    """Return the road's mean speed [m/s] over each step, worked out piece by piece: a road has many tones."""
    chunk = max(round(_CHUNK_S / step), 1)
    heights = [
        road.displacement(start + step * np.arange(first, min(first + chunk, count + 1)))
        for first in range(0, count + 1, chunk)
    ]
    return read_only(np.diff(np.concatenate(heights)) / step)
