"""Characteristics: the figures by which damper engineers compare dampers, from a damper alone.

All of them follow from simulation, so that they mean the same for every law: the peak-velocity-pick curve of
a damper dynamometer, energy per cycle and equivalent damping, dynamic range, the force lost to warmth, the
force's response to a step of the command, gas force. What a measured run shows is the business of
``data.cycles``; how far a model is from runs, of ``identify.assess``.

Sign convention: extension positive, a force that resists extension is positive. Where no temperature is
given, it is 20 degC.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, Trajectory, drive
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate, simulate_each
from mrdamper.quantities import REFERENCE_K

_SAMPLES = 400  # of a period; divisible by 4, so that peak velocity and turning points are samples
PERIODS = 3
"""Periods of a cycle that are simulated from rest; the last one is read."""
_STEP_s = 1e-4  # of the path on which a response is read
_MIDDLE = 0.2  # share of the stroke over which the gas force is read
_SLOW_m_s = 1e-3  # peak speed of the sine that shows the gas force


@dataclass(frozen=True, slots=True, eq=False)
class SettledCycle:
    """One period of a sine after the start has died away, from mid-stroke in extension, ends included."""

    motion: Sine
    displacement: FloatArray  # [m], shape (n,)
    velocity: FloatArray  # [m/s], shape (n,)
    force: FloatArray  # [N], shape (n,)

    @property
    def energy_J(self) -> float:
        """Work that the damper takes up in the period: the integral of F dx."""
        return float(np.trapezoid(self.force * self.velocity) * self.motion.period / (len(self.force) - 1))

    @property
    def equivalent_damping_N_s_m(self) -> float:
        """Damping of the linear damper that takes up the same work: energy / (pi omega A^2)."""
        return self.energy_J / (2.0 * math.pi**2 * self.motion.frequency * self.motion.amplitude**2)

    @property
    def peak_N(self) -> float:
        """Largest size of the force, the gas force included."""
        return float(np.abs(self.force).max())

    @property
    def extension_N(self) -> float:
        """Force at the highest velocity in extension."""
        return float(self.force[-1])

    @property
    def retraction_N(self) -> float:
        """Force at the highest velocity in retraction; negative where the damper resists."""
        return float(self.force[len(self.force) // 2])

    @property
    def damping_N(self) -> float:
        """Half the step between the two: the force at the highest velocity without the gas force."""
        return 0.5 * (self.extension_N - self.retraction_N)


def settled_cycle(
    damper: Damper, motion: Sine, command: float, temperature: float | None = None
) -> SettledCycle:
    """Return the last of three periods of a sine that starts from rest.

    Parameters
    ----------
    command : current [A] or voltage [V], constant
    temperature : [K]

    Raises
    ------
    InputError
        The law is not well posed there (``simulate``).
    """
    return settled_cycles(damper, [(motion, command, temperature)])[0]


def settled_cycles(damper: Damper, places: Sequence[tuple[Sine, float, float | None]]) -> list[SettledCycle]:
    """Return ``settled_cycle`` at many places (motion, command, temperature [K]), several at once."""
    paths = [
        drive(
            motion,
            duration=PERIODS * motion.period,
            rate_Hz=_SAMPLES * motion.frequency,
            command=command,
            temperature=_kelvin_or_reference(temperature),
        )
        for motion, command, temperature in places
    ]
    last = slice(-_SAMPLES - 1, None)
    return [
        SettledCycle(motion, path.displacement[last], path.velocity[last], force[last])
        for (motion, *_), path, force in zip(places, paths, simulate_each(damper, paths), strict=True)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class PeakVelocityCurve:
    """Force over peak velocity at one command and temperature: a dynamometer's peak-velocity pick."""

    amplitude: float  # half the stroke [m]
    command: float  # [A or V]
    temperature: float | None  # [K]
    velocity: FloatArray  # peak velocity of each sine [m/s], shape (n,)
    extension: FloatArray  # force at the peak velocity in extension [N], shape (n,)
    retraction: FloatArray  # in retraction, negative where the damper resists [N], shape (n,)

    @property
    def damping(self) -> FloatArray:
        """Half the step between extension and retraction [N]: without the gas force."""
        return 0.5 * (self.extension - self.retraction)


def peak_velocity_pick(
    damper: Damper,
    velocities: Sequence[float] | FloatArray,
    *,
    amplitude: float,
    command: float,
    temperature: float | None = None,
) -> PeakVelocityCurve:
    """Return the force at the peak velocity of sines of one stroke at rising frequencies.

    The usual test of a damper dynamometer: the force is read at mid-stroke, where the velocity peaks and
    the acceleration is zero.

    Parameters
    ----------
    velocities : peak velocities 2 pi f A [m/s], positive, shape (n,)
    amplitude : half the stroke [m]
    command : current [A] or voltage [V], constant
    temperature : [K]

    Raises
    ------
    InputError
        A velocity or the amplitude is not positive and finite, or the law is not well posed there.
    """
    peaks = np.atleast_1d(np.asarray(velocities, dtype=np.float64))
    _require_positive(amplitude=amplitude, **{"peak velocity": float(np.min(peaks, initial=np.inf))})
    places = [(sine_at(peak, amplitude), command, temperature) for peak in peaks.tolist()]
    return picked_from(settled_cycles(damper, places), peaks, amplitude, command, temperature)


def picked_from(
    cycles: Sequence[SettledCycle],
    peaks: FloatArray,
    amplitude: float,
    command: float,
    temperature: float | None,
) -> PeakVelocityCurve:
    """Return the curve of cycles of one stroke, command and temperature [K] by peak velocity [m/s]."""
    return PeakVelocityCurve(
        amplitude,
        float(command),
        temperature,
        peaks,
        np.array([cycle.extension_N for cycle in cycles]),
        np.array([cycle.retraction_N for cycle in cycles]),
    )


def dynamic_range(
    damper: Damper,
    velocity: float,
    *,
    amplitude: float,
    high: float,
    low: float = 0.0,
    temperature: float | None = None,
) -> float:
    """Return the damping force at the high command over that at the low one [-], at one peak velocity.

    Both are peak-velocity picks without the gas force.

    Parameters
    ----------
    velocity : peak velocity of the sine [m/s]
    amplitude : half its stroke [m]
    high, low : commands [A or V]
    temperature : [K]

    Raises
    ------
    InputError
        As ``peak_velocity_pick``; or the damper does not resist at the low command.
    """
    forces = [
        peak_velocity_pick(
            damper, [velocity], amplitude=amplitude, command=command, temperature=temperature
        ).damping[0]
        for command in (high, low)
    ]
    if not forces[1] > 0.0:
        raise InputError(
            place="dynamic range",
            found=(
                f"the damping force at {low:g} {damper.command_unit} and {velocity:g} m/s is {forces[1]:g} N"
            ),
            expected="a positive force to divide by",
        )
    return float(forces[0] / forces[1])


def force_loss(
    damper: Damper,
    motion: Sine,
    command: float,
    temperatures: Sequence[float] | FloatArray,
    *,
    reference: float = REFERENCE_K,
) -> FloatArray:
    """Return the share of the peak force that is lost against the reference temperature [-], shape (n,).

    .. math:: loss = 1 - F_{peak}(T) / F_{peak}(T_{ref})

    Parameters
    ----------
    motion : the sine whose peak force is compared
    command : current [A] or voltage [V], constant
    temperatures : [K], shape (n,)
    reference : [K]
    """
    before = settled_cycle(damper, motion, command, reference).peak_N
    after = [settled_cycle(damper, motion, command, float(kelvin)).peak_N for kelvin in temperatures]
    return np.asarray(1.0 - np.array(after) / before)


@dataclass(frozen=True, slots=True, eq=False)
class ForceResponse:
    """The force's way from one command's level to another's at constant speed, from the step on."""

    time: FloatArray  # from the step of the command [s], shape (n,)
    share: FloatArray  # of the way from the old level to the new one [-], shape (n,)

    def time_to(self, share: float) -> float:
        """Return the time [s] at which the force first reaches a share (0.63, 0.9) of its way.

        Raises
        ------
        InputError
            It does not get there on the path.
        """
        risen = np.maximum.accumulate(self.share)
        if not 0.0 < share <= risen[-1]:
            raise InputError(
                place="force response",
                found=(
                    f"a share of {share:g} is not reached within {self.time[-1]:.3g} s (it comes to "
                    f"{risen[-1]:.3g})"
                ),
                expected="above 0 and below 1, on a path that is long enough",
            )
        first = int(np.argmax(risen >= share))
        if first == 0:
            return 0.0
        before, after = risen[first - 1], risen[first]
        return float(self.time[first - 1] + (share - before) / (after - before) * np.diff(self.time[:2])[0])


def force_response(
    damper: Damper,
    start: float,
    end: float,
    *,
    velocity: float = 0.03,
    stroke: float = 0.012,
    temperature: float | None = None,
) -> ForceResponse:
    """Return how the force follows a step of the command at mid-stroke of a path at constant speed.

    The force between the levels that the damper has on the same path at each command held: springs and
    the gas force take no part. Lags and delay are the damper's actuation (or its command lag); without
    any the response is at once.

    Parameters
    ----------
    start, end : commands before and after the step [A or V]
    velocity : of the path, in extension [m/s]
    stroke : length of the path [m]; half of it is there for the hysteresis to settle first
    temperature : [K]

    Raises
    ------
    InputError
        Start and end give the same force.
    """
    _require_positive(velocity=velocity, stroke=stroke)
    half = max(round(0.5 * stroke / velocity / _STEP_s), 2)
    displacement = velocity * _STEP_s * np.arange(-half, half + 1, dtype=np.float64)
    flat = np.zeros(len(displacement))

    def along(command: FloatArray) -> FloatArray:
        path = Trajectory(
            step=_STEP_s,
            displacement=displacement,
            velocity=flat + velocity,
            acceleration=flat,
            command=command,
            temperature=flat + _kelvin_or_reference(temperature),
        )
        return simulate(damper, path)[half:]

    # The command is linear between samples: the step is half a sample wide on either side of its time.
    stepped = np.where(np.arange(len(flat)) < half, float(start), float(end))
    stepped[half] = 0.5 * (start + end)
    before, after = along(flat + start), along(flat + end)
    way = after - before
    if not np.abs(way).min() > 1e-9 * max(float(np.abs(after).max()), 1e-300):
        raise InputError(
            place="force response",
            found=f"the force at {start:g} and at {end:g} {damper.command_unit} is the same",
            expected="two commands that tell apart",
        )
    return ForceResponse(_STEP_s * np.arange(half + 1, dtype=np.float64), (along(stepped) - before) / way)


@dataclass(frozen=True, slots=True)
class GasForce:
    """Force without motion: the gas preload at mid-stroke and the rate of the gas spring."""

    offset_N: float  # at zero displacement
    spring_rate_N_m: float


def gas_force(
    damper: Damper, *, amplitude: float, command: float = 0.0, temperature: float | None = None
) -> GasForce:
    """Return the middle line of a slow sine's loop, over the middle fifth of its stroke.

    At one displacement the mean of extension and retraction: friction and hysteresis drop out where they
    have settled, so that the stroke should be ten yield displacements long or more. A model cannot tell a
    zero error of the force cell from a gas preload: both are its offset.

    Parameters
    ----------
    amplitude : half the stroke [m]
    command : current [A] or voltage [V], constant
    temperature : [K]
    """
    _require_positive(amplitude=amplitude)
    return gas_line(settled_cycle(damper, slow_sine(amplitude), command, temperature))


def gas_line(cycle: SettledCycle) -> GasForce:
    """Return the middle line of a settled cycle's loop, as ``gas_force`` has it of a slow one."""
    quarter = _SAMPLES // 4
    # extension: the last quarter period and the first; retraction passes the same places backwards
    extending = np.concatenate([cycle.force[-quarter - 1 : -1], cycle.force[: quarter + 1]])
    places = np.concatenate([cycle.displacement[-quarter - 1 : -1], cycle.displacement[: quarter + 1]])
    retracting = cycle.force[quarter : 3 * quarter + 1][::-1]
    middle = np.abs(places) <= _MIDDLE * cycle.motion.amplitude
    mean = 0.5 * (extending + retracting)[middle]
    rate, offset = np.polyfit(places[middle], mean, 1)
    return GasForce(float(offset), float(rate))


def slow_sine(amplitude: float) -> Sine:
    """Return the sine of half a stroke [m] whose loop shows the gas force."""
    return sine_at(_SLOW_m_s, amplitude)


def sine_at(peak_velocity: float, amplitude: float) -> Sine:
    """Return the sine of half a stroke [m] that reaches a peak velocity [m/s]."""
    return Sine(amplitude, peak_velocity / (2.0 * math.pi * amplitude))


def _kelvin_or_reference(temperature: float | None) -> float:
    return REFERENCE_K if temperature is None else float(temperature)


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise InputError(
                place="characteristics", found=f"{name} is {value}", expected="a positive, finite number"
            )
