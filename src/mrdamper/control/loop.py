"""The sampled closed loop: a controller once per sample, the damper's own finer steps in between.

At sample k (time k P) the sensors are read and the controller gives a current, which the driver limits to
0 .. highest, rounds to its converter's step and holds until the next sample, later by the command's delay.
The damper is a ``Plant``: it moves on along the motion, which is prescribed. Nothing here knows which
physics it has. The same scenario, damper and controller give the same run, bit for bit.

Controllers made from cards on a virtual damper run in one call in C (``core/binding/closed_loop.c``), their
dampers abreast; any other pair sample by sample in Python, with the same bits.

Arrays at the plant's steps, shape (n,), hold the value at the end of each: time h, 2 h, ..., n h.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mrdamper import core
from mrdamper.arrays import BoolArray, FloatArray, read_only
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
from mrdamper.core import Tracker
from mrdamper.errors import InputError
from mrdamper.excitation import motion_from_text
from mrdamper.quantities import ZERO_CELSIUS_K

_ABREAST = 64  # loops of one call in C
_MOST_KEPT = 300_000  # samples of a motion that is kept: 7 MB
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
    sampled = _sampled if count <= _MOST_KEPT else _sampled.__wrapped__
    time, displacement, velocity = sampled(scenario.motion, count, step_s)
    return ReferenceTrajectory(
        step_s=step_s,
        time=time,
        displacement=displacement,
        velocity=velocity,
        target=np.ascontiguousarray(scenario.target.force(time, velocity)),
        scored_from=round(scenario.unscored_s / step_s),
    )


@lru_cache(maxsize=8)
def _sampled(motion: str, count: int, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time [s], displacement [m] and velocity [m/s] of a motion, read-only, each of shape (count,).

    A target is looked at many times on one motion: at each temperature, for its size, for its reach.
    """
    path, time = motion_from_text(motion), step_s * np.arange(1.0, count + 1.0)
    return read_only(time), read_only(path.displacement(time)), read_only(path.velocity(time))


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
    """Run a controller on a copy of the plant, in the state that it has; see ``run_loops``."""
    return run_loops(plant, [controller], [scenario], course)[0][0]


def run_loops(
    plant: Plant,
    controllers: Sequence[Controller],
    scenarios: Sequence[Scenario],
    course: ReferenceTrajectory | None = None,
) -> list[list[LoopRun]]:
    """Run each controller in each scenario, on copies of the plant in the state that it has.

    Scenarios that differ in seed, sensors and disturbance alone; dampers in C are stepped abreast, each to
    the bits that it has alone. ``course`` is the scenarios' at the plant's steps, where it is known already.

    Raises
    ------
    InputError
        Scenarios of two motions; a sampling period or a delay that does not fit, or a controller that gives a
        current which is not a finite number.
    """
    first = scenarios[0]
    if course is None:
        course = reference_trajectory(first, plant.step_s)
    elif course.step_s != plant.step_s or len(course) != round(first.duration_s / plant.step_s):
        raise InputError(
            place="course",
            found=f"{len(course)} steps of {1e3 * course.step_s:g} ms",
            expected=f"the scenario's, of {1e3 * plant.step_s:g} ms",
        )
    for other in scenarios[1:]:
        like = replace(first, seed=other.seed, sensors=other.sensors, disturbance=other.disturbance)
        if like != other:
            raise InputError(
                place=f"scenario {other.name!r}",
                found="another motion, target or temperature",
                expected=f"those of {first.name!r}: only seed, sensors and disturbance may differ",
            )
    prepared = _Prepared(plant.step_s, course)
    loops = [prepared.loop(controller, each) for controller in controllers for each in scenarios]
    _close_loops(plant, loops, course)
    runs = [loop.run(course) for loop in loops]
    return [runs[k : k + len(scenarios)] for k in range(0, len(runs), len(scenarios))]


@dataclass(slots=True, eq=False)
class _Loop:
    """A controller in a scenario: what it is told, and what came of it."""

    controller: Controller
    scenario: Scenario
    settings: LoopSettings
    wanted: FloatArray  # force now and ahead [N], shape (2, samples)
    sensed: _Sensed
    force: FloatArray  # [N], of the damper
    given: FloatArray  # commands [A]: those on their way at first, then one per sample

    @property
    def tracker(self) -> Tracker | None:
        """The controller in C, where it has one."""
        return self.controller.compiled if isinstance(self.controller, CompiledController) else None

    def run(self, course: ReferenceTrajectory) -> LoopRun:
        every, apart = self.settings.every, self.settings.apart
        held = np.empty((len(self.given), every))
        held[:] = self.given[:, None]  # ten times as fast as np.repeat
        applied = held.ravel()[every - apart :][: len(course)]
        force = self.settings.force_gain * self.force + self.settings.force_offset_N
        return LoopRun(self.controller.name, self.scenario, course, force, applied, every)


class _Prepared:
    """What loops on one motion are told; what several are told alike is worked out once."""

    def __init__(self, step_s: float, course: ReferenceTrajectory) -> None:
        self._step, self._course = step_s, course
        self._read: dict[tuple[Scenario, int], _Sensed] = {}
        self._wanted: dict[tuple[int, float], FloatArray] = {}

    def loop(self, controller: Controller, scenario: Scenario) -> _Loop:
        every = steps_per_sample(controller.period_s, self._step)
        samples, period = -(-len(self._course) // every), every * self._step
        if (scenario, every) not in self._read:
            self._read[scenario, every] = _read_sensors(scenario, period, samples)
        settings = _settings(controller, scenario, every, self._step)
        wanted = np.full((2, samples), np.nan)
        wanted[0] = self._ahead(scenario, every, 0.0)
        if controller.preview_s > 0.0:
            wanted[1] = self._ahead(scenario, every, controller.preview_s)
        return _Loop(
            controller,
            scenario,
            settings,
            wanted,
            self._read[scenario, every],
            np.empty(len(self._course)),
            np.empty(settings.late + 1 + samples),
        )

    def _ahead(self, scenario: Scenario, every: int, ahead_s: float) -> FloatArray:
        """Return the wanted force [N] at the samples, a time ahead of each."""
        if (every, ahead_s) not in self._wanted:
            now = every * self._step * np.arange(-(-len(self._course) // every))
            self._wanted[every, ahead_s] = np.asarray(scenario.force(now + ahead_s))
        return self._wanted[every, ahead_s]


def _settings(controller: Controller, scenario: Scenario, every: int, step_s: float) -> LoopSettings:
    disturbance = scenario.disturbance
    late, apart = divmod(round(disturbance.command_delay_s / step_s), every)
    return LoopSettings(
        every=every,
        late=late,
        apart=apart,
        reads_force=controller.needs_force,
        force_gain=disturbance.force_gain,
        force_offset_N=disturbance.force_offset_N,
        highest_A=scenario.highest_A,
        command_step_A=disturbance.command_step_A,
        force_step_N=scenario.sensors.force_step_N,
    )


def _close_loops(plant: Plant, loops: Sequence[_Loop], course: ReferenceTrajectory) -> None:
    """Fill force and commands of loops on one motion: abreast in C those that can, the others in Python.

    In Python are users' own controllers and dampers, and what C refuses, which Python puts into words.
    """
    abreast: dict[tuple[int, int], list[_Loop]] = {}
    for loop in loops:
        if loop.tracker is None or not isinstance(plant, CompiledPlant):
            _loop_in_python(plant, loop, course)
        else:
            abreast.setdefault((loop.settings.every, loop.settings.apart), []).append(loop)
    for alike in abreast.values():
        for begin in range(0, len(alike), _ABREAST):
            some = alike[begin : begin + _ABREAST]
            if not _loops_in_c(plant, some, course):
                for loop in some:
                    _loop_in_python(plant, loop, course)


def _loops_in_c(plant: Plant, loops: Sequence[_Loop], course: ReferenceTrajectory) -> bool:
    """Fill loops that share a motion and keep the same time; False where C refuses one."""
    members = tuple(
        (
            loop.tracker,
            loop.controller.start(),
            loop.settings,
            loop.sensed.rows(loop.wanted),
            loop.sensed.frozen,
            loop.force,
            loop.given,
        )
        for loop in loops
        if loop.tracker is not None
    )
    if not isinstance(plant, CompiledPlant):
        return False
    held = plant.hold(loops[0].scenario.temperature_degC, len(members))
    return core.follow(held, course.displacement, course.velocity, members)


def _loop_in_python(plant: Plant, loop: _Loop, course: ReferenceTrajectory) -> None:
    """Do what C does, bit for bit, of any controller and damper."""
    settings, sensed, controller = loop.settings, loop.sensed, loop.controller
    degrees, force = loop.scenario.temperature_degC, loop.force
    every, late, apart = settings.every, settings.late, settings.apart
    x, v, advance = course.displacement, course.velocity, plant.copy().advance_many
    now, later = loop.wanted.tolist()
    displacement, temperature = sensed.displacement.tolist(), sensed.temperature.tolist()
    sensor = _ForceSensor(sensed, settings.force_step_N)
    given = loop.given  # commands on their way: sample k begins with given[k], given[k + 1] arrives
    given[: late + 1] = 0.0
    arrives = (np.arange(len(course)) - apart) // every + 1
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
        given[late + 1 + k] = _driven(current, settings)
        if settings.reads_force:
            part = slice(k * every, (k + 1) * every)
            force[part] = advance(x[part], v[part], given[arrives[part]], degrees)
            felt = settings.force_gain * float(force[part][-1]) + settings.force_offset_N
    if not settings.reads_force:  # which the damper cannot change: it moves on in one go
        force[:] = advance(x, v, given[arrives], degrees)


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
    force_noise: FloatArray  # [N], and offset; NaN where the sensor gives nothing
    frozen: FloatArray  # 1 where the force sensor says its last value again, else 0

    def rows(self, wanted: FloatArray) -> FloatArray:
        """Return the inputs of a controller in C, with the wanted force now and ahead, shape (n, 5)."""
        columns = (*wanted, self.displacement, self.temperature, self.force_noise)
        return np.ascontiguousarray(np.transpose(columns))


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
    force = sensing.force_offset_N + sensing.force_noise_N * white["force"]
    if sensing.displacement_step_m > 0.0:
        x = sensing.displacement_step_m * np.round(x / sensing.displacement_step_m)
    held = max(1, round(sensing.displacement_hold_s / period_s))
    x = np.repeat(x[::held], held)[:samples]
    read: dict[Sensor, FloatArray] = {"displacement": x, "temperature": kelvin, "force": force}
    for sensor, values in read.items():
        for each in sensing.dropouts:
            if each.sensor == sensor and each.fault == "shifted":
                values[(time >= each.start_s) & (time < each.end_s)] += each.shift
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
