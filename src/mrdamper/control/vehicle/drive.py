"""A drive of a quarter car over a segment of road, its damper commanded by a controller.

The demand knows the states, or what a vehicle's sensors tell of them (``observer``), and from them the demand
at a controller's preview: nobody knows the road ahead, but the car's free motion over some milliseconds is a
good guess. The damper's controller has its own sensors.
Between two steps of the damper its force and the end stop's are held and the car moves exactly. Behind a top
mount (``mount``) the damper has a stroke of its own, which is what its sensor reads.
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
from mrdamper.control.vehicle.mount import MountedDamper, TopMount
from mrdamper.control.vehicle.observer import DemandStep, VehicleSensors
from mrdamper.control.vehicle.roads import Heights
from mrdamper.errors import InputError
from mrdamper.excitation import Road
from mrdamper.quantities import ZERO_CELSIUS_K

_MOST_TRAVEL_M = 1.0
_PERIOD_s = 1e-3  # without a controller
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
    mount: TopMount | None = None  # between the damper's rod and the body; None: the rod is bolted to it
    sensors: VehicleSensors | None = None  # that tell the demand the states; None: it knows them

    def __post_init__(self) -> None:
        if self.damper is None and self.controller is not None:
            raise InputError(
                place="vehicle", found="a controller without a damper", expected="both, or the damper alone"
            )

    def begin(self) -> _Memory:
        """Return the car at rest."""
        damper = self.damper
        if damper is not None and self.mount is not None:
            damper = MountedDamper(damper, self.mount)
        state = None if self.controller is None else self.controller.start()
        return _Memory(0.0, (0.0, 0.0, 0.0, 0.0), 0.0, damper, state, self.asked().stand())

    def asked(self) -> DemandStep:
        """Return what asks for a force at each sample."""
        return DemandStep(
            self.car,
            self.demand,
            period_s=_PERIOD_s if self.controller is None else self.controller.period_s,
            preview_s=0.0 if self.controller is None else self.controller.preview_s,
            sensors=VehicleSensors() if self.sensors is None else self.sensors,
            mount=self.mount,
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
    displacement_noise_m: float = 10e-6  # of the damper's stroke, where the vehicle has no sensors for states
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
    mount_heat_W: float  # ... and the top mount
    current_rms_A: float
    force_error_N: float | None  # rms of force less demand at the samples; None without a controller
    state_errors: tuple[float, ...] | None  # rms of the estimates' errors by state; None: they are known
    step_s: float
    states: FloatArray  # z, shape (n, 4)
    stroke: FloatArray  # of the damper [m]; without a top mount the rattle space
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
    observer: bytes

    @property
    def stroke(self) -> float:
        """Return the damper's stroke [m]."""
        return self.states[0] - (self.damper.deflection if isinstance(self.damper, MountedDamper) else 0.0)


def drive_car(vehicle: Vehicle, segment: RoadSegment, *, after: Ride | None = None) -> Ride:
    """Drive a segment of road, from rest or where the ride ``after`` ended; the damper given is copied.

    Raises
    ------
    InputError
        A sampling period that does not fit, or a car that is not held: its travel leaves +-1 m.
    """
    car, controller, sensors = vehicle.car, vehicle.controller, vehicle.sensors
    start, asked = vehicle.begin() if after is None else after.memory, vehicle.asked()
    damper, state, observed = (
        None if start.damper is None else start.damper.copy(),
        start.controller,
        start.observer,
    )
    period, step = asked.period_s, 1e-4 if damper is None else damper.step_s
    every = steps_per_sample(period, step)
    samples = max(round(segment.duration_s / period), 1)
    speeds = _road_speeds(segment.road, start.time, samples * every, step).tolist()
    (a11, a12, a13, a14), (a21, a22, a23, a24), (a31, a32, a33, a34), (a41, a42, a43, a44) = car.advance(
        step
    )[0].tolist()
    (b1, b2, b3, b4), (c1, c2, c3, c4) = (each.tolist() for each in car.advance(step)[1:])
    z1, z2, z3, z4 = start.states
    force, warm, k = start.force, segment.temperature_degC, 0
    mounted = damper if isinstance(damper, MountedDamper) else None
    give = 0.0 if mounted is None else mounted.deflection
    current = 0.0 if controller is not None else min(vehicle.held_A, vehicle.highest_A)
    stroke, stop, pushed = car.stroke_m, car.stop_N_m, start.force + float(car.stop_force(np.array(z1)))
    log = _Log()
    for velocity_error, x_error, kelvin, body_error, wheel_error in _readings(
        vehicle, segment, start.time, samples
    ):
        length = z1 - give + x_error
        if sensors is None:
            wanted, ahead = asked.of_states((z1, z2, z3, z4), velocity_error, pushed)
        else:
            between = car.spring_N_m * z1 + pushed
            body, wheel = -between / car.body_kg, (between - car.tyre_N_m * z3) / car.wheel_kg
            observed, wanted, ahead = asked.step(observed, body + body_error, wheel + wheel_error, length)
            log.estimates.append(asked.believes(observed))
            log.states.append((z1, z2, z3, z4))
        if controller is not None:
            log.errors.append(force - wanted)
            reference = Reference(wanted, ahead if controller.preview_s > 0.0 else None)
            felt = force if controller.needs_force else None
            state, current = controller.step(state, reference, Measurement(length, kelvin, felt))
            current = min(max(current, 0.0), vehicle.highest_A)
        log.currents.append(current)
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
            held = force
            if damper is not None:
                force = damper.advance(z1, z2 - z4, current, warm)
            if mounted is not None:
                give = mounted.deflection
            log.series.append((z1, z2, z3, z4, held, pushed, z1 - give))
        k += every
        _check_travel(z1, k * step)
    memory = _Memory(start.time + samples * period, (z1, z2, z3, z4), force, damper, state, observed)
    return _scored(
        car, start, memory, log, step=step, every=every, skip=round(segment.unscored_s / period), road=speeds
    )


def _check_travel(travel_m: float, time_s: float) -> None:
    if not -_MOST_TRAVEL_M < travel_m < _MOST_TRAVEL_M:
        raise InputError(
            place="ride",
            found=f"the damper's travel is {travel_m:g} m after {time_s:.2f} s; the car is not held",
            remedy="Check the demand's gains, and that the damper is of a car's size",
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """What a drive leaves behind: at the damper's steps, and at the samples."""

    series: list[tuple[float, ...]] = field(default_factory=list)  # states, forces of damper and all, stroke
    errors: list[float] = field(default_factory=list)  # of the force [N]
    currents: list[float] = field(default_factory=list)
    estimates: list[tuple[float, ...]] = field(default_factory=list)
    states: list[tuple[float, ...]] = field(default_factory=list)


def _scored(
    car: QuarterCar,
    start: _Memory,
    memory: _Memory,
    log: _Log,
    *,
    step: float,
    every: int,
    skip: int,
    road: list[float],
) -> Ride:
    """Return the ride, its figures those of the samples from ``skip`` on."""
    series, errors, skipped = np.array(log.series), log.errors[skip:], skip
    skip *= every
    scored = series[skip:]
    # the force is held over a step: its work is force times the change of length
    begins = start.states[0], start.stroke
    rattle, stroke = (
        np.diff(series[:, k], prepend=each)[skip:] for k, each in zip((0, 6), begins, strict=True)
    )
    power = scored[:, 4] / (step * len(scored))
    body = -(car.spring_N_m * series[:, 0] + series[:, 5]) / car.body_kg
    return Ride(
        body_acceleration_m_s2=rms(body[skip:]),
        weighted_acceleration_m_s2=rms(weighted(body, step)[skip:]),
        tyre_load_N=car.tyre_N_m * rms(scored[:, 2]),
        rattle_m=rms(scored[:, 0]),
        most_rattle_m=float(np.abs(scored[:, 0]).max()),
        end_stop_N=float(np.abs(car.stop_force(scored[:, 0])).max()),
        heat_W=float(power @ stroke),
        mount_heat_W=float(power @ (rattle - stroke)),
        current_rms_A=rms(np.array(log.currents[skipped:])),
        force_error_N=rms(np.array(errors)) if errors else None,
        state_errors=_state_errors(log, skipped),
        step_s=step,
        states=series[:, :4],
        stroke=series[:, 6],
        force=series[:, 4],
        body=body,
        road=np.array(road),
        memory=memory,
    )


def _state_errors(log: _Log, skip: int) -> tuple[float, ...] | None:
    """Return the rms error of each estimated state, in its unit."""
    if not log.estimates:
        return None
    off = np.array(log.estimates)[skip:, :4] - np.array(log.states)[skip:]
    return tuple(rms(column) for column in off.T)


def _readings(
    vehicle: Vehicle, segment: RoadSegment, start: float, samples: int
) -> Iterator[tuple[float, float, float, float, float]]:
    """Return what a sample's sensors say.

    Errors of damper speed [m/s] and stroke [m], the temperature that is read [K], errors of the accelerations
    of body and wheel [m/s^2].
    """
    noise = np.random.default_rng((segment.seed, round(1e3 * start)))
    shown = segment.temperature_degC if segment.thermometer_degC is None else segment.thermometer_degC
    velocity, x, kelvin, body, wheel = (noise.standard_normal(samples) for _ in range(5))
    sensors = vehicle.sensors or VehicleSensors()
    stroke_noise = sensors.stroke_noise_m if vehicle.sensors else segment.displacement_noise_m
    return zip(
        (segment.velocity_noise_m_s * velocity).tolist(),
        (sensors.stroke_bias_m + stroke_noise * x).tolist(),
        (shown + ZERO_CELSIUS_K + segment.temperature_noise_K * kelvin).tolist(),
        (sensors.body_bias_m_s2 + sensors.body_noise_m_s2 * body).tolist(),
        (sensors.wheel_bias_m_s2 + sensors.wheel_noise_m_s2 * wheel).tolist(),
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
