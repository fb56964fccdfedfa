"""Load cycles: motion and command of a damper versus time, divided into segments.

A load cycle is a text or a CSV table. The text ``sine:15mm:1Hz:2A:1800s`` contains motion, command and
duration. A CSV table has one of these two sets of columns:

    time_s, amplitude_mm, frequency_Hz, current_A       each row is a sine that lasts until the next row
    time_s, displacement_mm, current_A                  the measured motion, with a uniform time step

The module ``dissipation`` computes the power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Table
from mrdamper.data.signals import differentiate
from mrdamper.data.tables import read_table
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError
from mrdamper.excitation import Motion, Sine, Trajectory, drive, motion_from_text
from mrdamper.files import is_file
from mrdamper.quantities import QUANTITIES, to_si
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.stirring import Stroke

DEFAULT_DUTY = "sine:15mm:1Hz:2A:1800s"
"""The load cycle of the reference paper: 15 mm, 1 Hz, 2 A for 30 minutes."""

_EXPECTED = 'MOTION:COMMAND:DURATION, such as "sine:15mm:1Hz:2A:1800s", or a CSV file'


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A part of a load cycle with constant mean power.

    ``path`` is a short part of the motion, for which the force is simulated (None: at rest). The mean power
    is computed from the samples from index ``counted_from``, without the transient at the beginning.
    """

    duration: float  # [s]
    path: Trajectory | None
    counted_from: int
    command: float  # root mean square of the command [A or V]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.duration) and self.duration > 0.0):
            raise InputError(found=f"a duration is {self.duration:g} s", expected="a positive, finite number")
        if not math.isfinite(self.command):
            raise InputError(found=f"a command is {self.command}", expected="a finite number")


@dataclass(frozen=True, slots=True, eq=False)
class Duty:
    """A load cycle: consecutive segments, the unit of their commands, and a description (``text``)."""

    segments: tuple[Segment, ...]
    command_unit: str  # "A" or "V"
    text: str

    def __post_init__(self) -> None:
        largest = max((each.command for each in self.segments), default=0.0)
        most = QUANTITIES["current" if self.command_unit == "A" else "voltage"].high
        if largest > most:
            raise InputError(
                place=f"duty {self.text!r}",
                found=f"the command is {largest:.4g} {self.command_unit}",
                expected=f"at most {most:g} {self.command_unit}, the limit of a damper coil",
            )
        if self.duration > SETTINGS.duration_max_s:
            raise InputError(
                place=f"duty {self.text!r}",
                found=f"it lasts {self.duration:.3g} s",
                expected=f"at most {SETTINGS.duration_max_s:g} s (11 days)",
                remedy="A damper reaches its steady temperature after some hours",
            )

    @property
    def duration(self) -> float:
        """Return the total duration of the load cycle [s]."""
        return math.fsum(segment.duration for segment in self.segments)


def read_duty(text: str | Path) -> Duty:
    """Return the load cycle that a text describes, or the load cycle in a CSV file.

    Raises
    ------
    InputError
        If the text is invalid, or the table lacks a column.
    """
    words = str(text).split(":")
    if Path(text).suffix.lower() == ".csv" or (len(words) < 3 and is_file(text)):
        return _duty_of_table(read_table(Path(text)), Path(text).name)
    motion, command, unit, seconds = motion_at_command(str(text))
    return Duty((segment_of(motion, command, seconds),), unit, str(text))


def motion_at_command(text: str) -> tuple[Motion, float, str, float]:
    """Return motion, command, unit of the command (A or V) and duration [s] of a text.

    The format of the text is ``MOTION:COMMAND:DURATION``.

    Raises
    ------
    InputError
        If the text has a different format or an unknown motion.
    """
    words = text.split(":")
    try:
        if len(words) > 1 and _is_command(words[-1]):
            raise InputError(
                f"there is no duration after the command {words[-1]}", remedy="add one, such as :1800s"
            )
        if len(words) < 3:
            raise InputError("there are fewer than three parts", expected=_EXPECTED)
        seconds = _number(words[-1], "time")
        command, unit = _command(words[-2])
        return motion_from_text(":".join(words[:-2])), command, unit, seconds
    except InputError as fault:
        told = fault.prepend_place(f"duty {text!r}")
        if not told.expected:
            told = InputError(told.found, place=told.place, expected=_EXPECTED, remedy=told.remedy)
        raise told from fault


def stroke_of(duty: Duty) -> Stroke:
    """Return the sine motion that moves as much fluid per time as a load cycle.

    Each segment is replaced by a sine with equal root mean squares of displacement and velocity. The
    returned amplitude is the mean amplitude of these sines, weighted by the length of their paths. Rests of
    the load cycle reduce the returned frequency.
    """
    path, gone = 0.0, 0.0
    for each in duty.segments:
        if each.path is None:
            continue
        x, v = each.path.displacement[each.counted_from :], each.path.velocity[each.counted_from :]
        amplitude, speed = math.sqrt(2.0) * float(np.std(x)), float(np.sqrt(np.mean(v**2)))
        path += each.duration * speed
        gone += each.duration * speed * amplitude
    if gone == 0.0:
        return Stroke(0.0, 0.0)
    amplitude = gone / path
    return Stroke(amplitude, path / duty.duration / (math.sqrt(2.0) * math.pi * amplitude))


def segment_of(motion: Motion, command: float, duration: float) -> Segment:
    """Return a segment with a motion at constant command [A or V] for a duration [s].

    The power of a periodic motion is computed from its third period, which has at least 1000 samples. For
    any other motion, the power is computed from its first two minutes. Their first 5 % are ignored.
    """
    period = getattr(motion, "period", None)
    if period is None:
        length = min(duration, SETTINGS.motion_time_s)
        path = drive(motion, duration=length, rate_Hz=1000.0, command=command)
        return Segment(duration, path, len(path) // 20, abs(command))
    samples = round(min(max(1000.0 * period, 1000.0), 20000.0))
    path = drive(motion, duration=3.0 * period, rate_Hz=samples / period, command=command)
    return Segment(duration, path, 2 * samples, abs(command))


def _command(text: str) -> tuple[float, str]:
    """Return the value and the unit (A or V) of a command such as ``2A``."""
    for role, unit in (("current", "A"), ("voltage", "V")):
        try:
            return _number(text, role), unit
        except InputError:
            continue
    raise InputError(
        found=f"the command is {text!r}", expected="a current or voltage with its unit, such as 2A"
    )


def _is_command(text: str) -> bool:
    try:
        _command(text)
    except InputError:
        return False
    return True


def _number(text: str, role: str) -> float:
    """Return the SI value of a text such as ``2A``; ``role`` names the quantity."""
    digits = len(text) - len(text.lstrip("0123456789.+-eE"))
    # A letter e after the digits can belong to an exponent or to the unit. Therefore several splits into
    # value and unit are tried.
    for cut in range(digits, 0, -1):
        try:
            value = float(text[:cut])
        except ValueError:
            continue
        return float(to_si(value, text[cut:].strip(), role))
    raise InputError(found=f"{role} is {text!r}", expected="a number and its unit")


# -------------------------------------------------------------------------------------------------- tables


def _duty_of_table(table: Table, place: str) -> Duty:
    columns = _columns(table, place)
    unit = "A" if "current" in columns else "V"
    time, command = (columns[name] for name in ("time", "current" if unit == "A" else "voltage"))
    steps = np.diff(time)
    if not (steps > 0.0).all():
        raise InputError(place=place, found="time does not rise from row to row", expected="rising times")
    if "amplitude" in columns:
        segments = []
        sines = (columns[name].tolist() for name in ("amplitude", "frequency"))
        # The last row only contains the time at which the last segment stops. Its motion is ignored.
        for duration, level, amplitude, frequency in zip(steps.tolist(), command.tolist(), *sines):  # noqa: B905
            if amplitude == 0.0:
                segments.append(Segment(duration, None, 0, abs(level)))
            else:
                segments.append(segment_of(Sine(abs(amplitude), frequency), level, duration))
        return Duty(tuple(segments), unit, place)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if np.abs(steps - step).max() > SETTINGS.step_deviation_ratio_max * step or len(time) < 8:
        raise InputError(
            place=place,
            found=(
                "the time step varies, or there are less than 8 rows; a displacement is expected on a "
                "uniform step"
            ),
            remedy="Resample it, or give amplitude_mm and frequency_Hz instead",
        )
    return Duty(_chunks(step, columns["displacement"], command), unit, place)


def _columns(table: Table, place: str) -> dict[str, FloatArray]:
    """Return the columns of a load cycle in SI units, by the name of the quantity."""
    found: dict[str, FloatArray] = {}
    for name, values in table.columns.items():
        word, _, unit = name.strip().partition("_")
        if word.lower() == "amplitude":
            found["amplitude"] = to_si(values, unit, "displacement")
        elif word.lower() == "frequency":
            if unit != "Hz":
                raise InputError(place=place, found=f"column {name!r}", expected="frequency_Hz")
            found["frequency"] = values
        elif (known := parse_header(name)) is not None:
            found[known[0]] = to_si(values, known[1], known[0])
    motion = "amplitude" if "amplitude" in found else "displacement"
    needed = ["time", motion, *(["frequency"] if motion == "amplitude" else [])]
    lacking = [role for role in needed if role not in found]
    if not {"current", "voltage"} & found.keys():
        lacking.append("current")
    if lacking:
        raise InputError(
            place=place,
            found=f"no column of {', '.join(lacking)}",
            expected="time_s, amplitude_mm and frequency_Hz (or displacement_mm), current_A",
        )
    for role, values in found.items():
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(
                place=place, found=f"{role} is {values[row]} in row {row + 1}", expected="finite numbers"
            )
    return found


def _chunks(step: float, displacement: FloatArray, command: FloatArray) -> tuple[Segment, ...]:
    """Return a measured motion as segments of a load cycle, each about 20 s long."""
    velocity = differentiate(displacement, step)
    acceleration = differentiate(velocity, step)
    count = max(1, round((len(displacement) - 1) * step / SETTINGS.measured_motion_time_s))
    cuts = np.linspace(0, len(displacement) - 1, count + 1).round().astype(int)
    segments = []
    for low, high in pairwise(cuts):
        part = slice(low, high + 1)
        path = Trajectory(step, displacement[part], velocity[part], acceleration[part], command[part])
        square = float(np.sqrt(np.mean(command[part] ** 2)))
        segments.append(Segment(float(high - low) * step, path, 0, square))
    return tuple(segments)
