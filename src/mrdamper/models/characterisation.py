"""Characteristics of one damper over its envelope: values for report and compare.

The figures themselves are ``models.characteristics``'; here is at which commands, temperatures and speeds
they are taken, in round numbers inside what the damper was identified on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.models.actuation import Actuation
from mrdamper.models.characteristics import (
    GasForce,
    PeakVelocityCurve,
    force_response,
    gas_line,
    picked_from,
    settled_cycles,
    sine_at,
    slow_sine,
)
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K

Value = TypeVar("Value")

_DRAWN = 15  # speeds of a drawn curve,
_DRAWN_PYTHON = 6  # of a law in Python, which is slow
_SLOWEST = 0.02  # of the drawn speeds, as a share of the highest
_ROUND = (1.0, 2.0, 5.0)
_FINER = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
_STEP_SPEED_m_s = 0.03  # of the path on which a force's response is read, where the envelope has it
_LAGS = 8.0  # length of that path after the step, in sums of delay and lags
_SHARES = (0.63, 0.90)
_EVERY_K = 20.0  # round temperatures
_NO_FORCE = 1e-9  # of the force at the strongest command: rounding leaves as much beside a gas force


@dataclass(frozen=True, slots=True, eq=False)
class Scope:
    """Where dampers are looked at. ``temperatures`` [K] holds one None for a damper that knows none."""

    commands: tuple[float, ...]  # [A or V], rising
    temperatures: tuple[float | None, ...]
    speeds: tuple[float, ...]  # of the tables [m/s], rising
    drawn: FloatArray  # speeds of the curves [m/s]
    amplitude: float  # half the stroke of the peak-velocity pick [m]
    motion: Sine  # whose energy is stated

    @property
    def ends(self) -> tuple[int, int]:
        """Places of the weakest and the strongest command."""
        sizes = np.abs(self.commands)
        return int(np.argmin(sizes)), int(np.argmax(sizes))


@dataclass(frozen=True, slots=True)
class Response:
    """Times from a step of the command: of the command at the law, and of the force at constant speed [s].

    A force's time is None where the force does not tell the two commands apart.
    """

    start: float
    end: float
    velocity: float  # [m/s]
    command_t63: float
    command_t90: float
    force_t63: float | None
    force_t90: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Characterisation:
    """One damper's figures; arrays run over temperatures, then commands (then speeds)."""

    scope: Scope
    curves: tuple[tuple[PeakVelocityCurve, ...], ...]  # by temperature, then command
    extension: FloatArray  # peak-velocity pick at the tables' speeds [N]
    retraction: FloatArray  # [N]
    energy: FloatArray  # per cycle of the motion [J]
    equivalent_damping: FloatArray  # [N s/m]
    dynamic_range: FloatArray  # by temperature, then speed [-]; NaN where the weakest command has no force
    responses: tuple[Response, ...]  # up and down; empty when nothing is known
    gas: tuple[GasForce, ...]  # by command, at the first temperature

    @property
    def damping(self) -> FloatArray:
        """Half the step from retraction to extension [N]: the damping force without the gas force."""
        return 0.5 * (self.extension - self.retraction)


def usual_scope(
    damper: Damper,
    envelope: OperatingEnvelope,
    *,
    commands: Sequence[float] | None = None,
    temperatures: Sequence[float] | None = None,
    motion: Sine | None = None,
) -> Scope:
    """Return round numbers inside an envelope.

    Parameters
    ----------
    commands : [A or V]; None: five over the envelope
    temperatures : [K]; None: three round ones over the envelope, or up from the tested one where that is
        the only one (a fluid's laws taken by assumption)
    motion : whose energy is stated; None: of the pick's stroke, at the highest speed of the tables
    """
    low, high = envelope.displacement
    half = 0.5 * (high - low)
    centred = min(-low, high)
    amplitude = round_down(centred if centred > 0.3 * half else half)
    fastest = max(map(abs, envelope.velocity))
    speeds = _round_speeds(fastest)
    if commands is None:
        ends = envelope.command
        commands = (ends[0],) if ends[0] == ends[1] else np.linspace(*ends, 5).tolist()
    count = _DRAWN if damper.law.kernel is not None else _DRAWN_PYTHON
    drawn = fastest * np.linspace(math.sqrt(_SLOWEST), 1.0, count) ** 2
    return Scope(
        commands=tuple(sorted(map(float, commands))),
        temperatures=_temperatures(damper, envelope, temperatures),
        speeds=speeds,
        drawn=drawn,
        amplitude=amplitude,
        motion=motion or Sine(amplitude, speeds[-1] / (2.0 * math.pi * amplitude)),
    )


def characterise(damper: Damper, scope: Scope) -> Characterisation:
    """Return a damper's figures at the places of a scope."""
    commands, temperatures, speeds = scope.commands, scope.temperatures, scope.speeds
    peaks, parts, amplitude = np.concatenate([scope.drawn, speeds]), len(scope.drawn), scope.amplitude
    motions = [*(sine_at(peak, amplitude) for peak in peaks.tolist()), scope.motion]
    slow = [(slow_sine(amplitude), command, temperatures[0]) for command in commands]
    places = [(each, command, kelvin) for kelvin in temperatures for command in commands for each in motions]
    found = iter(settled_cycles(damper, [*slow, *places]))
    gas = tuple(gas_line(cycle) for cycle in islice(found, len(slow)))
    curves, picks, cycles = [], [], []
    for kelvin in temperatures:
        at_temperature = []
        for command in commands:
            of_speed, cycle = list(islice(found, len(peaks))), next(found)
            drawn = of_speed[:parts]
            at_temperature.append(picked_from(drawn, peaks[:parts], amplitude, command, kelvin))
            rest = picked_from(of_speed[parts:], peaks[parts:], amplitude, command, kelvin)
            picks.append((rest.extension, rest.retraction))
            cycles.append((cycle.energy_J, cycle.equivalent_damping_N_s_m))
        curves.append(tuple(at_temperature))
    shape = (len(temperatures), len(commands))
    extension = np.array([pick[0] for pick in picks]).reshape(*shape, len(speeds))
    retraction = np.array([pick[1] for pick in picks]).reshape(*shape, len(speeds))
    damping = 0.5 * (extension - retraction)
    weak, strong = scope.ends
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = damping[:, strong] / damping[:, weak]
        ratio[~(damping[:, weak] > _NO_FORCE * damping[:, strong])] = np.nan
    return Characterisation(
        scope=scope,
        curves=tuple(curves),
        extension=extension,
        retraction=retraction,
        energy=np.array([energy for energy, _ in cycles]).reshape(shape),
        equivalent_damping=np.array([damping for _, damping in cycles]).reshape(shape),
        dynamic_range=ratio,
        responses=responses(damper, scope),
        gas=gas,
    )


def responses(damper: Damper, scope: Scope) -> tuple[Response, ...]:
    """Return the response from the weakest command to the strongest and back; empty without any lag."""
    low, high = (scope.commands[place] for place in scope.ends)
    lags = damper.actuation
    if lags is None and damper.command_lag_s > 0.0:
        lags = Actuation(damper.command_lag_s, damper.command_lag_s)
    if lags is None or low == high:
        return ()
    stroke = 2.0 * scope.amplitude
    window = _LAGS * (lags.delay_s + max(lags.rise_s, lags.fall_s, lags.wheel_s) + lags.second_s)
    speed = min(_STEP_SPEED_m_s, scope.speeds[-1], 0.5 * stroke / window)
    found = []
    for start, end in ((low, high), (high, low)):
        of_command = [lags.response_time(share, start, end) for share in _SHARES]
        try:
            way = force_response(
                damper, start, end, velocity=speed, stroke=stroke, temperature=scope.temperatures[0]
            )
            of_force: list[float | None] = [way.time_to(share) for share in _SHARES]
        except InputError:  # a law that does not follow the command, or not on this path
            of_force = [None, None]
        found.append(Response(start, end, speed, *of_command, *of_force))
    return tuple(found)


def round_down(value: float, factors: Sequence[float] = _ROUND) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above a positive value."""
    decade = 10.0 ** math.floor(math.log10(value) + 1e-12)
    factor = max(factor for factor in factors if factor * decade <= value * (1.0 + 1e-9))
    return float(f"{factor * decade:.6g}")


def spread_out(values: Sequence[Value], most: int) -> tuple[Value, ...]:
    """Return at most so many of the values, evenly by place, both ends among them."""
    if len(values) <= most:
        return tuple(values)
    places = np.unique(np.linspace(0, len(values) - 1, most).round().astype(int))
    return tuple(values[place] for place in places)


def in_degrees(temperature: float | None) -> float | None:
    """Return degrees Celsius of a temperature [K]."""
    return None if temperature is None else temperature - ZERO_CELSIUS_K


def _round_speeds(fastest: float) -> tuple[float, ...]:
    """Return four round speeds [m/s], the last one near the fastest."""
    speeds = [round_down(fastest, _FINER)]
    while len(speeds) < 4:
        speeds.insert(0, round_down(speeds[0] * 0.75))
    return tuple(speeds)


def _temperatures(
    damper: Damper, envelope: OperatingEnvelope, given: Sequence[float] | None
) -> tuple[float | None, ...]:
    if not damper.temperature_dependent:
        return (None,)
    if given is not None:
        return tuple(sorted(map(float, given)))
    tested = envelope.temperature or (REFERENCE_K, REFERENCE_K)
    span = tested
    if (
        tested[1] - tested[0] < _EVERY_K / 4.0
    ):  # one temperature; the rest is assumed, and warmth matters most
        span = (tested[0], max((damper.temperature_range or tested)[1], tested[0]))
    if span[1] - span[0] < _EVERY_K / 4.0:
        return (span[0],)
    low, high = span[0] - 1.0, span[1] + 1.0  # a rig's 20 degC is 20.3
    first = math.ceil((low - REFERENCE_K) / _EVERY_K)
    last = math.floor((high - REFERENCE_K) / _EVERY_K)
    if last <= first:
        return tuple(span)
    return spread_out([REFERENCE_K + _EVERY_K * step for step in range(first, last + 1)], 3)
