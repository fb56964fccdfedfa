"""The sampled closed loop: a controller once per sample, the damper's own finer steps in between.

At sample k (time k P) the sensors are read and the controller gives a current, which the driver limits to
0 .. highest, rounds to its converter's step and holds until the next sample, later by the command's delay.
The damper is a ``Plant``: it moves on along the motion, which is prescribed. Nothing here knows which
physics it has. The same scenario, damper and controller give the same run, bit for bit.

A controller made from a card on a virtual damper runs in one call in C (``core/binding/closed_loop.c``), any
other pair sample by sample in Python, with the same bits.

Arrays at the plant's steps, shape (n,), hold the value at the end of each: time h, 2 h, ..., n h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.control.protocol import (
    FASTEST_HZ,
    SLOWEST_HZ,
    CompiledController,
    CompiledPlant,
    Controller,
    LoopSettings,
    Measurement,
    Plant,
    Reference,
)
from mrdamper.control.scenario import Scenario, Sensing, Sensor
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K

__all__ = [
    "LoopRun",
    "ReferenceTrajectory",
    "reference_trajectory",
    "run_loop",
    "steps_per_sample",
]

_SENSORS: tuple[Sensor, ...] = ("displacement", "temperature", "force")


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceTrajectory:
    """What a scenario prescribes at the steps of a plant, shape (n,)."""

    step_s: float
    time: FloatArray  # [s]
    displacement: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    target: FloatArray  # [N]
    scored_from: int

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, slots=True, eq=False)
class LoopRun:
    """What a controller did to a damper, at the plant's steps."""

    controller: str
    scenario: Scenario
    course: ReferenceTrajectory
    force: FloatArray  # [N], of the damper, without the sensor's noise
    current: FloatArray  # [A], that the driver gets
    steps_per_sample: int

    @property
    def error(self) -> FloatArray:
        """Force less target [N]."""
        return self.force - self.course.target


def reference_trajectory(scenario: Scenario, step_s: float) -> ReferenceTrajectory:
    """Return motion and target of a scenario at the steps of a plant."""
    count = round(scenario.duration_s / step_s)
    time = step_s * np.arange(1.0, count + 1.0)
    path = scenario.path
    return ReferenceTrajectory(
        step_s=step_s,
        time=time,
        displacement=np.ascontiguousarray(path.displacement(time)),
        velocity=np.ascontiguousarray(path.velocity(time)),
        target=np.ascontiguousarray(scenario.force(time)),
        scored_from=round(scenario.unscored_s / step_s),
    )


def steps_per_sample(period_s: float, step_s: float) -> int:
    """Return the plant's steps in one sample of a controller.

    Raises
    ------
    InputError
        Outside 100 Hz to 5 kHz, or not a whole number of steps.
    """
    if not (math.isfinite(period_s) and 0.999 / FASTEST_HZ <= period_s <= 1.001 / SLOWEST_HZ):
        raise InputError(
            place="sampling",
            found=f"the period is {1e3 * period_s:g} ms",
            expected=(
                f"{1e3 / FASTEST_HZ:g} to {1e3 / SLOWEST_HZ:g} ms ({SLOWEST_HZ:g} Hz to {FASTEST_HZ:g} Hz)"
            ),
        )
    steps = round(period_s / step_s)
    if steps < 1 or abs(steps * step_s - period_s) > 1e-6 * period_s:
        raise InputError(
            place="sampling",
            found=f"the period is {1e3 * period_s:g} ms",
            expected=(
                f"a whole number of the plant's steps of {1e3 * step_s:g} ms, such as "
                f"{1e3 * max(steps, 1) * step_s:g} ms"
            ),
        )
    return steps


def run_loop(
    plant: Plant, controller: Controller, scenario: Scenario, course: ReferenceTrajectory | None = None
) -> LoopRun:
    """Run a controller on a copy of the plant, in the state that it has.

    ``course`` is the scenario's at the plant's steps, where it is known already (``reference_trajectory``);
    scenarios that differ in seed, sensors or disturbance have the same.

    Raises
    ------
    InputError
        A sampling period or a delay that does not fit, or a controller that gives a current which is not a
        finite number.
    """
    if course is None:
        course = reference_trajectory(scenario, plant.step_s)
    elif course.step_s != plant.step_s or len(course) != round(scenario.duration_s / plant.step_s):
        raise InputError(
            place="course",
            found=f"{len(course)} steps of {1e3 * course.step_s:g} ms",
            expected=f"the scenario's, of {1e3 * plant.step_s:g} ms",
        )
    every = steps_per_sample(controller.period_s, plant.step_s)
    samples = -(-len(course) // every)
    sensed = _read_sensors(scenario, every * plant.step_s, samples)
    settings = _settings(controller, scenario, every, plant.step_s)
    now = every * plant.step_s * np.arange(samples)
    wanted = np.full((2, samples), np.nan)
    wanted[0] = scenario.force(now)
    if controller.preview_s > 0.0:
        wanted[1] = scenario.force(now + controller.preview_s)
    found = _loop_in_c(plant, controller, course, wanted, sensed, settings, scenario.temperature_degC)
    if found is None:
        found = _loop_in_python(
            plant, controller, course, wanted, sensed, settings, scenario.temperature_degC
        )
    force, given = found
    applied = np.repeat(given, every)[every - settings.apart :][: len(course)]
    return LoopRun(controller.name, scenario, course, settings.force_gain * force, applied, every)


def _settings(controller: Controller, scenario: Scenario, every: int, step_s: float) -> LoopSettings:
    disturbance = scenario.disturbance
    late, apart = divmod(round(disturbance.command_delay_s / step_s), every)
    return LoopSettings(
        every=every,
        late=late,
        apart=apart,
        reads_force=controller.needs_force,
        force_gain=disturbance.force_gain,
        highest_A=scenario.highest_A,
        command_step_A=disturbance.command_step_A,
        force_step_N=scenario.sensors.force_step_N,
    )


def _loop_in_c(
    plant: Plant,
    controller: Controller,
    course: ReferenceTrajectory,
    wanted: FloatArray,
    sensed: _Sensed,
    settings: LoopSettings,
    temperature_degC: float,
) -> tuple[FloatArray, FloatArray] | None:
    """Return the damper's force [N] and the commands [A]; None where the loop must run in Python.

    That is with a user's own controller or damper, and after a refusal, which Python puts into words.
    """
    if not (isinstance(controller, CompiledController) and isinstance(plant, CompiledPlant)):
        return None
    columns = (*wanted, sensed.displacement, sensed.temperature, sensed.force_noise)
    rows = np.ascontiguousarray(np.transpose(columns))
    return controller.follow(
        plant.hold(temperature_degC), settings, course.displacement, course.velocity, rows, sensed.frozen
    )


def _loop_in_python(
    plant: Plant,
    controller: Controller,
    course: ReferenceTrajectory,
    wanted: FloatArray,
    sensed: _Sensed,
    settings: LoopSettings,
    temperature_degC: float,
) -> tuple[FloatArray, FloatArray]:
    """Return what ``_loop_in_c`` does, bit for bit, of any controller and damper."""
    every, late, apart = settings.every, settings.late, settings.apart
    x, v, advance = course.displacement, course.velocity, plant.copy().advance_many
    now, later = wanted.tolist()
    displacement, temperature = sensed.displacement.tolist(), sensed.temperature.tolist()
    sensor = _ForceSensor(sensed, settings.force_step_N)
    force, count = np.empty(len(course)), len(course)
    given = [0.0] * (late + 1)  # commands on their way: sample k begins with given[k], given[k + 1] arrives
    state, felt = controller.start(), 0.0
    for k in range(len(now)):
        measurement = Measurement(
            displacement[k], temperature[k], sensor.read(k, felt) if settings.reads_force else None
        )
        reference = Reference(now[k], later[k] if controller.preview_s > 0.0 else None)
        state, current = controller.step(state, reference, measurement)
        if not math.isfinite(current):
            raise InputError(
                place=f"controller {controller.name!r}",
                found=f"its current is {current} at sample {k}",
                expected="a finite number",
            )
        given.append(_driven(current, settings))
        begin, end = k * every, min((k + 1) * every, count)
        switch = min(begin + apart, end)
        if begin < switch:
            force[begin:switch] = advance(x[begin:switch], v[begin:switch], given[k], temperature_degC)
        if switch < end:
            force[switch:end] = advance(x[switch:end], v[switch:end], given[k + 1], temperature_degC)
        felt = settings.force_gain * float(force[end - 1])
    return force, np.array(given)


def _driven(current: float, settings: LoopSettings) -> float:
    """Return what the driver makes of a current: its converter's step, and its limits."""
    if settings.command_step_A > 0.0:
        current = settings.command_step_A * round(current / settings.command_step_A)
    return min(max(current, 0.0), settings.highest_A)


@dataclass(frozen=True, slots=True, eq=False)
class _Sensed:
    """What the sensors say at the samples, shape (n,); of the force, which is not known ahead, its noise."""

    displacement: FloatArray  # [m]
    temperature: FloatArray  # [K]
    force_noise: FloatArray  # [N]; NaN where the sensor gives nothing
    frozen: FloatArray  # 1 where the force sensor says its last value again, else 0


class _ForceSensor:
    """Reads the force, which is not known ahead; it remembers what it said, for the time when it freezes."""

    __slots__ = ("_frozen", "_last", "_noise", "_step")

    def __init__(self, sensed: _Sensed, step: float) -> None:
        self._noise: list[float] = sensed.force_noise.tolist()
        self._frozen: list[float] = sensed.frozen.tolist()
        self._step = step
        self._last = 0.0

    def read(self, k: int, true: float) -> float:
        """Return the force [N] at sample k; NaN where the sensor gives nothing."""
        if not self._frozen[k]:
            read = true + self._noise[k]
            if self._step > 0.0 and math.isfinite(read):
                read = self._step * round(read / self._step)
            self._last = read
        return self._last


def _read_sensors(scenario: Scenario, period_s: float, samples: int) -> _Sensed:
    sensing = scenario.sensors
    time = period_s * np.arange(samples, dtype=np.float64)
    noise = dict(zip(_SENSORS, np.random.default_rng(scenario.seed).spawn(len(_SENSORS)), strict=True))
    white = {sensor: noise[sensor].standard_normal(samples) for sensor in _SENSORS}
    x = scenario.path.displacement(time - sensing.displacement_delay_s)
    x = x + sensing.displacement_noise_m * white["displacement"]
    offset = scenario.temperature_degC + sensing.temperature_offset_K + ZERO_CELSIUS_K
    kelvin = offset + sensing.temperature_noise_K * white["temperature"]
    force = sensing.force_noise_N * white["force"]
    if sensing.displacement_step_m > 0.0:
        x = sensing.displacement_step_m * np.round(x / sensing.displacement_step_m)
    held = max(1, round(sensing.displacement_hold_s / period_s))
    x = np.repeat(x[::held], held)[:samples]
    read: dict[Sensor, FloatArray] = {"displacement": x, "temperature": kelvin, "force": force}
    for sensor, values in read.items():
        values[noise[sensor].random(samples) < sensing.lost_share] = np.nan
        for inside in _faults(sensing, sensor, "missing", time):
            values[inside] = np.nan
    for values, of in ((x, "displacement"), (kelvin, "temperature")):
        for inside in _faults(sensing, of, "frozen", time):
            values[inside] = values[max(int(np.argmax(inside)) - 1, 0)]
    frozen = np.zeros(samples)
    for inside in _faults(sensing, "force", "frozen", time):
        frozen[inside] = 1.0
    return _Sensed(x, kelvin, force, frozen)


def _faults(sensing: Sensing, sensor: str, fault: str, time: FloatArray) -> list[BoolArray]:
    """Return where a sensor has a fault, for each of its dropouts that the run reaches."""
    spans = [(e.start_s, e.end_s) for e in sensing.dropouts if e.sensor == sensor and e.fault == fault]
    found = [(time >= start) & (time < end) for start, end in spans]
    return [inside for inside in found if inside.any()]
