"""The sampled closed loop: one controller step per sample, and several plant steps between two samples.

At sample k (time k P, with the sampling period P) the sensors are read and the controller returns a current.
The driver rounds the current to its resolution and limits it to the range from 0 to the highest current.
After the command delay, the driver applies this current for one sampling period. The damper is a ``Plant``
that follows the prescribed motion. Any simulated damper can be used. The same scenario, damper and controller
give bit-identical runs.

Loops of a controller from ``controllers`` and a virtual damper run in C (``core/binding/closed_loop.c``). One
call computes several loops in parallel. All other loops run in Python, sample by sample. C and Python give
bit-identical results.

Arrays of plant values have the shape (n,). With the plant time step h, they contain the values at the times
h, 2 h, ..., n h.
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

LOOP_COUNT_MAX = 64  # max number of loops in one call of the C code
CACHED_SAMPLE_COUNT_MAX = 300_000  # A cached motion with this number of time steps needs 7 MB.
_SENSORS: tuple[Sensor, ...] = ("displacement", "temperature", "force")


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceTrajectory:
    """Prescribed motion and target force at the time steps of the simulated damper, shape (n,)."""

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
    """Force and current of a closed loop at the time steps of the simulated damper (plant)."""

    controller: str
    scenario: Scenario
    course: ReferenceTrajectory
    force: FloatArray  # [N] force of the damper, without sensor noise
    current: FloatArray  # [A] current of the driver
    steps_per_sample: int

    @property
    def error(self) -> FloatArray:
        """Return the tracking error [N]: damper force minus target."""
        return self.force - self.course.target


def reference_trajectory(scenario: Scenario, step_s: float) -> ReferenceTrajectory:
    """Return motion and target force of a scenario at the time steps of a plant."""
    count = round(scenario.duration_s / step_s)
    sampled = _sampled if count <= CACHED_SAMPLE_COUNT_MAX else _sampled.__wrapped__
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

    The result is cached because one motion is often used with many targets.
    """
    path, time = motion_from_text(motion), step_s * np.arange(1.0, count + 1.0)
    return read_only(time), read_only(path.displacement(time)), read_only(path.velocity(time))


def steps_per_sample(period_s: float, step_s: float) -> int:
    """Return the number of plant time steps in one sampling period of a controller.

    Raises
    ------
    InputError
        If the sampling rate is outside 100 Hz to 5 kHz, or the period is not a whole number of plant steps.
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
    """Run a controller on a copy of the simulated damper (plant).

    The run begins in the state of the given plant.
    """
    return run_loops(plant, [controller], [scenario], course)[0][0]


def run_loops(
    plant: Plant,
    controllers: Sequence[Controller],
    scenarios: Sequence[Scenario],
    course: ReferenceTrajectory | None = None,
) -> list[list[LoopRun]]:
    """Run each controller in each scenario; return one list of runs per controller.

    Every run uses a copy of the plant (simulated damper), which starts in the plant's state. The scenarios
    may differ only in seed, sensors and disturbance. The result does not depend on the number of loops that
    run in parallel. ``course`` is the motion and target at the time steps of the plant; if None, it is
    computed from the scenario.

    Raises
    ------
    InputError
        If the scenarios have different motions, a sampling period or a delay is invalid, or a controller
        returns a current that is not finite.
    """
    first = scenarios[0]
    if course is None:
        course = reference_trajectory(first, plant.step_s)
    elif course.step_s != plant.step_s or len(course) != round(first.duration_s / plant.step_s):
        raise InputError(
            place="course",
            found=f"{len(course)} steps of {1e3 * course.step_s:g} ms",
            expected=f"the period of the scenario, {1e3 * plant.step_s:g} ms",
        )
    for other in scenarios[1:]:
        like = replace(first, seed=other.seed, sensors=other.sensors, disturbance=other.disturbance)
        if like != other:
            raise InputError(
                place=f"scenario {other.name!r}",
                found="another motion, target or temperature",
                expected=f"the values of {first.name!r}; only seed, sensors and disturbance may differ",
            )
    prepared = _Prepared(plant.step_s, course)
    loops = [prepared.loop(controller, each) for controller in controllers for each in scenarios]
    _close_loops(plant, loops, course)
    runs = [loop.run(course) for loop in loops]
    return [runs[k : k + len(scenarios)] for k in range(0, len(runs), len(scenarios))]


@dataclass(slots=True, eq=False)
class _Loop:
    """One closed loop: a controller, a scenario, and the inputs and results of the loop."""

    controller: Controller
    scenario: Scenario
    settings: LoopSettings
    wanted: FloatArray  # wanted force [N] at each sample (first row) and after the preview time (second row)
    sensed: _Sensed
    force: FloatArray  # [N] force of the damper
    given: FloatArray  # commands [A]: zero during the delay, then one command per sample

    @property
    def tracker(self) -> Tracker | None:
        return self.controller.compiled if isinstance(self.controller, CompiledController) else None

    def run(self, course: ReferenceTrajectory) -> LoopRun:
        every, apart = self.settings.every, self.settings.apart
        held = np.empty((len(self.given), every))
        held[:] = self.given[:, None]  # Broadcasting is ten times as fast as np.repeat.
        applied = held.ravel()[every - apart :][: len(course)]
        force = self.settings.force_gain * self.force + self.settings.force_offset_N
        return LoopRun(self.controller.name, self.scenario, course, force, applied, every)


class _Prepared:
    """Factory of closed loops with one motion. Shared inputs are computed only once."""

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
        wanted[0] = self._target_ahead(scenario, every, 0.0)
        if controller.preview_s > 0.0:
            wanted[1] = self._target_ahead(scenario, every, controller.preview_s)
        return _Loop(
            controller,
            scenario,
            settings,
            wanted,
            self._read[scenario, every],
            np.empty(len(self._course)),
            np.empty(settings.late + 1 + samples),
        )

    def _target_ahead(self, scenario: Scenario, every: int, ahead_s: float) -> FloatArray:
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
    """Compute the forces and commands of loops with one motion, in parallel in C if possible.

    User-defined controllers and dampers run in Python. If the C code rejects a loop, Python repeats the loop
    and raises an error with a message.
    """
    abreast: dict[tuple[int, int], list[_Loop]] = {}
    for loop in loops:
        if loop.tracker is None or not isinstance(plant, CompiledPlant):
            _loop_in_python(plant, loop, course)
        else:
            abreast.setdefault((loop.settings.every, loop.settings.apart), []).append(loop)
    for alike in abreast.values():
        for begin in range(0, len(alike), LOOP_COUNT_MAX):
            some = alike[begin : begin + LOOP_COUNT_MAX]
            if not _loops_in_c(plant, some, course):
                for loop in some:
                    _loop_in_python(plant, loop, course)


def _loops_in_c(plant: Plant, loops: Sequence[_Loop], course: ReferenceTrajectory) -> bool:
    """Run loops with equal motion and timing in C. Return False if the C code rejects one of the loops."""
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
    """Run one loop in Python, for any controller and damper. The result is bit-identical to the C code."""
    settings, sensed, controller = loop.settings, loop.sensed, loop.controller
    degrees, force = loop.scenario.temperature_degC, loop.force
    every, late, apart = settings.every, settings.late, settings.apart
    x, v, advance = course.displacement, course.velocity, plant.copy().advance_many
    now, later = loop.wanted.tolist()
    displacement, temperature = sensed.displacement.tolist(), sensed.temperature.tolist()
    sensor = _ForceSensor(sensed, settings.force_step_N)
    # During sample k, the damper first receives given[k], and after ``apart`` time steps given[k + 1].
    given = loop.given
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
        given[late + 1 + k] = _driver_current(current, settings)
        if settings.reads_force:
            part = slice(k * every, (k + 1) * every)
            force[part] = advance(x[part], v[part], given[arrives[part]], degrees)
            felt = settings.force_gain * float(force[part][-1]) + settings.force_offset_N
    if not settings.reads_force:  # No reading depends on the damper, so one call computes the whole run.
        force[:] = advance(x, v, given[arrives], degrees)


def _driver_current(current: float, settings: LoopSettings) -> float:
    if settings.command_step_A > 0.0:
        current = settings.command_step_A * round(current / settings.command_step_A)
    return min(max(current, 0.0), settings.highest_A)


@dataclass(frozen=True, slots=True, eq=False)
class _Sensed:
    """Sensor readings at the samples, shape (n,).

    The damper force is computed during the run. Therefore only noise and offset of its readings are stored.
    """

    displacement: FloatArray  # [m]
    temperature: FloatArray  # [K]
    force_noise: FloatArray  # [N] noise and offset; NaN: no reading
    frozen: FloatArray  # 1 if the force sensor is stuck and repeats its last value, otherwise 0

    def rows(self, wanted: FloatArray) -> FloatArray:
        columns = (*wanted, self.displacement, self.temperature, self.force_noise)
        return np.ascontiguousarray(np.transpose(columns))


class _ForceSensor:
    """Force sensor. It stores the last reading because a stuck sensor repeats this reading."""

    __slots__ = ("_frozen", "_last", "_noise", "_step")

    def __init__(self, sensed: _Sensed, step: float) -> None:
        self._noise: list[float] = sensed.force_noise.tolist()
        self._frozen: list[float] = sensed.frozen.tolist()
        self._step = step
        self._last = 0.0

    def read(self, k: int, true: float) -> float:
        """Return the force reading [N] at sample k; NaN if the sensor has no reading."""
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
        for inside in _dropout_masks(sensing, sensor, "missing", time):
            values[inside] = np.nan
    for values, of in ((x, "displacement"), (kelvin, "temperature")):
        for inside in _dropout_masks(sensing, of, "frozen", time):
            values[inside] = values[max(int(np.argmax(inside)) - 1, 0)]
    frozen = np.zeros(samples)
    for inside in _dropout_masks(sensing, "force", "frozen", time):
        frozen[inside] = 1.0
    return _Sensed(x, kelvin, force, frozen)


def _dropout_masks(sensing: Sensing, sensor: str, fault: str, time: FloatArray) -> list[BoolArray]:
    spans = [(e.start_s, e.end_s) for e in sensing.dropouts if e.sensor == sensor and e.fault == fault]
    found = [(time >= start) & (time < end) for start, end in spans]
    return [inside for inside in found if inside.any()]
