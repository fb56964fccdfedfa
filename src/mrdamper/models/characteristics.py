"""Characteristics for comparisons of dampers.

All characteristics are computed by simulation, so that dampers with different hysteresis models can be
compared. They are the peak-velocity-pick curve of a damper dynamometer, the energy per cycle and the
equivalent damping. Further characteristics are the dynamic range, the gas force, and the response to a step
of the command. ``default_scope`` chooses commands, temperatures and speeds inside an operating envelope, most
of them round numbers.

Extension is positive, and a force that resists extension is positive. The default temperature is 20 degC.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.simulate import simulate_each
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K

Value = TypeVar("Value")

PERIOD_COUNT = 3
"""Number of periods of a sine that are simulated from rest; only the last period is evaluated."""

TEMPERATURE_STEP_K = 20.0
FORCE_RATIO_MIN = 1e-9  # A ratio of two forces below this value is caused only by rounding errors.


@dataclass(frozen=True, slots=True, eq=False)
class SteadyCycle:
    """Motion and force in a period of a sine, which begins at mid-stroke in extension."""

    motion: Sine
    velocity: FloatArray  # [m/s], shape (n,)
    force: FloatArray  # [N], shape (n,)

    @property
    def energy_J(self) -> float:
        """Dissipated work: the integral of F dx over the period."""
        return float(np.trapezoid(self.force * self.velocity) * self.motion.period / (len(self.force) - 1))

    @property
    def peak_N(self) -> float:
        """Largest absolute force, gas force included."""
        return float(np.abs(self.force).max())

    @property
    def extension_N(self) -> float:
        """Force at the highest velocity in extension."""
        return float(self.force[-1])

    @property
    def retraction_N(self) -> float:
        """Force at the highest velocity in retraction; negative if the damper resists."""
        return float(self.force[len(self.force) // 2])


def steady_cycle(
    damper: Damper, motion: Sine, command: float, temperature: float | None = None
) -> SteadyCycle:
    """Simulate three periods of a sine from rest; return the last period.

    Command and temperature [K] are constant.
    """
    return steady_cycles(damper, [(motion, command, temperature)])[0]


def steady_cycles(damper: Damper, cases: Sequence[tuple[Sine, float, float | None]]) -> list[SteadyCycle]:
    """Return ``steady_cycle`` of each case (motion, command [A or V], temperature [K])."""
    samples_per_period = 400  # a multiple of 4, so that the velocity has its peak at a sample
    paths = [
        drive(
            motion,
            duration=PERIOD_COUNT * motion.period,
            rate_Hz=samples_per_period * motion.frequency,
            command=command,
            temperature=REFERENCE_K if temperature is None else temperature,
        )
        for motion, command, temperature in cases
    ]
    last = slice(-samples_per_period - 1, None)
    return [
        SteadyCycle(motion, path.velocity[last], force[last])
        for (motion, *_), path, force in zip(cases, paths, simulate_each(damper, paths), strict=True)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class PeakVelocityCurve:
    """Force versus peak velocity of a sine, as measured on a damper dynamometer."""

    command: float  # [A or V]
    velocity: FloatArray  # peak velocity of each sine [m/s], shape (n,)
    extension: FloatArray  # force at the peak velocity in extension [N], shape (n,)
    retraction: FloatArray  # force at the peak velocity in retraction [N], negative if the damper resists

    @property
    def damping(self) -> FloatArray:
        """Half the difference of the forces in extension and retraction [N], which excludes the gas force."""
        return 0.5 * (self.extension - self.retraction)


def peak_velocity_pick(
    damper: Damper,
    velocities: Sequence[float] | FloatArray,
    *,
    amplitude: float,
    command: float,
    temperature: float | None = None,
) -> PeakVelocityCurve:
    """Return forces at mid-stroke of sines with equal stroke and different speeds.

    Parameters
    ----------
    velocities : peak velocities 2 pi f A [m/s], positive, shape (n,)
    amplitude : half the stroke [m], positive
    command : current [A] or voltage [V], constant
    temperature : [K]
    """
    peaks = np.atleast_1d(np.asarray(velocities, dtype=np.float64))
    cases = [(_sine_at(peak, amplitude), command, temperature) for peak in peaks.tolist()]
    cycles = steady_cycles(damper, cases)
    extension, retraction = ([getattr(c, name) for c in cycles] for name in ("extension_N", "retraction_N"))
    return PeakVelocityCurve(command, peaks, np.array(extension), np.array(retraction))


@dataclass(frozen=True, slots=True, eq=False)
class Scope:
    """Commands, temperatures and speeds at which dampers are evaluated.

    If the damper does not depend on temperature, ``temperatures`` [K] is ``(None,)``.
    """

    commands: tuple[float, ...]  # [A or V], rising
    temperatures: tuple[float | None, ...]
    speeds: tuple[float, ...]  # rising speeds for the columns of tables [m/s]
    curve_speeds: FloatArray  # speeds for the points of curves [m/s]
    amplitude: float  # half the stroke of the sines in the peak-velocity pick [m]
    motion: Sine  # sine for which the energy per cycle is computed

    @property
    def ends(self) -> tuple[int, int]:
        """Indices of the commands with the smallest and the largest absolute value."""
        sizes = np.abs(self.commands)
        return int(np.argmin(sizes)), int(np.argmax(sizes))


@dataclass(frozen=True, slots=True)
class Response:
    """Times after a command step at which 63 % and 90 % of the change are reached [s].

    ``command_t63`` refers to the effective command, ``force_t63`` to the damping force at constant velocity.
    ``force_t63`` and ``force_t90`` are missing (None) if the force does not depend on the command.
    """

    start: float  # command before the step [A or V]
    end: float
    command_t63: float
    command_t90: float
    force_t63: float | None
    force_t90: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Characterisation:
    """Characteristics of one damper, as arrays versus temperature, command and speed.

    Arrays of quantities that do not depend on speed have no speed axis.
    """

    scope: Scope
    curves: tuple[tuple[PeakVelocityCurve, ...], ...]
    extension: FloatArray  # force in extension at ``scope.speeds`` [N]
    retraction: FloatArray  # force in retraction at ``scope.speeds`` [N], negative if the damper resists
    energy: FloatArray  # energy per cycle of ``scope.motion`` [J]
    responses: tuple[Response, ...]  # responses to a rising and a falling step; empty if there is no lag

    @property
    def damping(self) -> FloatArray:
        """Damping force without the gas force [N]."""
        return 0.5 * (self.extension - self.retraction)

    @property
    def gas_N(self) -> FloatArray:
        """Gas force [N], by temperature and command: mean of extension and retraction at the lowest speed."""
        return 0.5 * (self.extension + self.retraction)[..., 0]

    @property
    def equivalent_damping(self) -> FloatArray:
        """Damping coefficient of a linear damper with the same energy, E / (pi omega A^2) [N s/m]."""
        motion = self.scope.motion
        return self.energy / (2.0 * math.pi**2 * motion.frequency * motion.amplitude**2)

    @property
    def dynamic_range(self) -> FloatArray:
        """Ratio of damping forces at the strongest and weakest command [-], by temperature and speed."""
        weakest, strongest = (self.damping[:, index] for index in self.scope.ends)
        valid = weakest > FORCE_RATIO_MIN * strongest
        return np.where(valid, strongest / np.where(valid, weakest, 1.0), np.nan)


def default_scope(
    damper: Damper,
    envelope: OperatingEnvelope,
    *,
    commands: Sequence[float] | None = None,
    temperatures: Sequence[float] | None = None,
    motion: Sine | None = None,
) -> Scope:
    """Return commands, temperatures and speeds for an evaluation inside an envelope.

    Parameters
    ----------
    commands : [A or V]; None: five evenly spaced values from lowest to highest command of the envelope
    temperatures : [K]; None: up to three values in the temperature range of the runs. If all runs had one
        temperature, the range from this temperature to the highest temperature of the damper model is used
    motion : motion for the energy; None: a sine with the amplitude of the peak-velocity pick and the highest
        speed
    """
    low, high = envelope.displacement
    half = 0.5 * (high - low)
    centred = min(-low, high)
    amplitude = _round_down(centred if centred > 0.3 * half else half, (1.0, 2.0, 5.0))
    fastest = max(map(abs, envelope.velocity))
    speeds = [_round_down(fastest, (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0))]
    while len(speeds) < 4:
        speeds.insert(0, _round_down(speeds[0] * 0.75, (1.0, 2.0, 5.0)))
    if commands is None:
        commands = sorted(set(np.linspace(*envelope.command, 5).tolist()))
    count = 15 if damper.law.kernel is not None else 6  # Laws in Python are slow.
    return Scope(
        commands=tuple(sorted(map(float, commands))),
        temperatures=_temperatures(damper, envelope, temperatures),
        speeds=tuple(speeds),
        curve_speeds=fastest * np.linspace(math.sqrt(0.02), 1.0, count) ** 2,  # 2 to 100 %
        amplitude=amplitude,
        motion=motion or _sine_at(speeds[-1], amplitude),
    )


def characterise(damper: Damper, scope: Scope) -> Characterisation:
    """Return the characteristics of a damper at the commands, temperatures and speeds in ``scope``."""

    def picks(speeds: Sequence[float] | FloatArray) -> tuple[tuple[PeakVelocityCurve, ...], ...]:
        return tuple(
            tuple(
                peak_velocity_pick(
                    damper, speeds, amplitude=scope.amplitude, command=command, temperature=kelvin
                )
                for command in scope.commands
            )
            for kelvin in scope.temperatures
        )

    table = picks(scope.speeds)
    cases = [(scope.motion, command, kelvin) for kelvin in scope.temperatures for command in scope.commands]
    energy = np.array([cycle.energy_J for cycle in steady_cycles(damper, cases)])
    return Characterisation(
        scope=scope,
        curves=picks(scope.curve_speeds),
        extension=np.array([[curve.extension for curve in row] for row in table]),
        retraction=np.array([[curve.retraction for curve in row] for row in table]),
        energy=energy.reshape(len(scope.temperatures), len(scope.commands)),
        responses=_responses(damper, scope),
    )


def _responses(damper: Damper, scope: Scope) -> tuple[Response, ...]:
    """Return the responses to steps from the weakest to the strongest command and back.

    The result is empty if the damper has no lag. At constant velocity, the force depends only on the
    effective command. Therefore a fraction of the force change is first converted to a fraction of the change
    of the effective command. Then the time is computed at which the effective command reaches this fraction.
    """
    response_fractions = (0.63, 0.90)
    static_command_count = 21  # number of commands at which the force without lag is computed
    low, high = (scope.commands[index] for index in scope.ends)
    lags = damper.actuation
    if lags is None and damper.command_lag_s > 0.0:
        lags = Actuation(damper.command_lag_s, damper.command_lag_s)
    if lags is None or low == high:
        return ()
    found = []
    fractions = np.linspace(0.0, 1.0, static_command_count)
    for start, end in ((low, high), (high, low)):
        cases = [
            (
                _sine_at(scope.speeds[-1], scope.amplitude),
                start + fraction * (end - start),
                scope.temperatures[0],
            )
            for fraction in fractions.tolist()
        ]
        force = np.array([c.extension_N - c.retraction_N for c in steady_cycles(damper, cases)])
        times: list[float | None] = [None, None]
        if abs(force[-1] - force[0]) > FORCE_RATIO_MIN * float(np.abs(force).max()):
            change = np.maximum.accumulate((force - force[0]) / (force[-1] - force[0]))
            reached = np.interp(response_fractions, change, fractions)
            times = [lags.response_time(float(fraction), start, end) for fraction in reached]
        command = [lags.response_time(fraction, start, end) for fraction in response_fractions]
        found.append(Response(start, end, command[0], command[1], times[0], times[1]))
    return tuple(found)


def pick_evenly(values: Sequence[Value], most: int) -> tuple[Value, ...]:
    """Return at most ``most`` of the values, evenly spaced by index."""
    if len(values) <= most:
        return tuple(values)
    indices = np.unique(np.linspace(0, len(values) - 1, most).round().astype(int))
    return tuple(values[index] for index in indices)


def in_degrees(temperature: float | None) -> float | None:
    """Return a temperature [K] in degrees Celsius."""
    return None if temperature is None else temperature - ZERO_CELSIUS_K


def _sine_at(peak_velocity: float, amplitude: float) -> Sine:
    if not (0.0 < amplitude < math.inf and 0.0 < peak_velocity < math.inf):
        raise InputError(
            place="characteristics",
            found=f"peak velocity is {peak_velocity} m/s and amplitude is {amplitude} m",
            expected="positive, finite numbers",
        )
    return Sine(amplitude, peak_velocity / (2.0 * math.pi * amplitude))


def _round_down(value: float, factors: Sequence[float]) -> float:
    """Return the largest product of a factor and a power of ten that is not above a positive value."""
    decade = 10.0 ** math.floor(math.log10(value) + 1e-12)
    factor = max(factor for factor in factors if factor * decade <= value * (1.0 + 1e-9))
    return float(f"{factor * decade:.6g}")


def _temperatures(
    damper: Damper, envelope: OperatingEnvelope, given: Sequence[float] | None
) -> tuple[float | None, ...]:
    if not damper.temperature_dependent:
        return (None,)
    if given is not None:
        return tuple(sorted(map(float, given)))
    low, high = envelope.temperature or (REFERENCE_K, REFERENCE_K)
    if high - low < TEMPERATURE_STEP_K / 4.0:
        # All runs have one temperature. Higher temperatures are then the most useful because dampers heat up.
        high = max((damper.temperature_range or (low, high))[1], low)
    if high - low < TEMPERATURE_STEP_K / 4.0:
        return (low,)
    # Runs at nominally 20 degC may have 20.3 degC. Therefore the range is extended by 1 K on both sides.
    first = math.ceil((low - 1.0 - REFERENCE_K) / TEMPERATURE_STEP_K)
    last = math.floor((high + 1.0 - REFERENCE_K) / TEMPERATURE_STEP_K)
    if last <= first:
        return (low, high)
    return pick_evenly([REFERENCE_K + TEMPERATURE_STEP_K * step for step in range(first, last + 1)], 3)
