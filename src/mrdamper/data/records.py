"""Records: one measured run, and a set of runs.

A ``RigRun`` is what a rig wrote, in SI and kelvin, as it was measured: nothing is smoothed, shifted or
resampled here (that is ``prepare``). It is checked when built; all faults found stand in one message.

Sign convention: extension positive, a force that resists extension is positive.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.core import turning_points
from mrdamper.data.finding import Finding, Inference
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, ZERO_CELSIUS_K, CommandUnit, to_degC
from mrdamper.results import Picture
from mrdamper.schema import unknown_name

WITHOUT_MOTION = (
    "Without motion neither viscosity nor yield force nor yield displacement can be identified: repeat the "
    "test with one (a sine of 5 mm at 1 Hz, say), or leave the run out"
)
"""What a run without motion lacks, and the test that would have it."""

_CHANNELS = ("time", "displacement", "force", "command", "velocity", "temperature")
LEAST_SAMPLES = 16
_MOST_SHOWN = 8  # runs of a set that is printed
_SPEED = 10.0  # faster than any damper's rig [m/s]
_STROKE = 2.0  # longer than any damper's rig [m]
_FEWEST_VALUES = 8  # of a displacement: fewer are the flicker of a sensor at rest
_SWING = 0.1  # a reversal comes back by more than this share of the stroke
_LEVEL_PARTS = 16  # of a run, whose median commands tell a level with noise from one that moves
_BLOCK = 16  # time steps over which jitter must average out
FORCE_RANGE_MIN_N = 1e-6  # Numerically constant below this range.
STROKE_MIN_m = 1e-9  # as above
GAP_MIN_STEPS = 5.0  # a time step this many times the usual one is a gap


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What a file holds of one run, in SI, before anybody asked whether it can be used.

    Arrays are read-only float64, and may hold anything. ``session`` names runs that share one tare of the
    force cell; ``source`` is the file.
    """

    name: str
    time: FloatArray  # [s]
    displacement: FloatArray  # [m]
    force: FloatArray  # [N]
    command: FloatArray  # [A or V]
    command_unit: CommandUnit
    velocity: FloatArray | None = None  # [m/s]
    temperature: FloatArray | None = None  # [K]
    session: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for channel in _CHANNELS:
            given = getattr(self, channel)
            if given is not None:
                object.__setattr__(self, channel, read_only(given))

    def __len__(self) -> int:
        return len(self.time)

    def checked(self) -> RigRun:
        """Return the run, if it is one; else one ``InputError`` with every fault found."""
        return RigRun(**{field.name: getattr(self, field.name) for field in fields(self)})


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RigRun(Recording, Picture):
    """One run of one damper on a rig, as measured: a recording without faults.

    Arrays have shape (n,), the time strictly increases. ``motion`` is a label such as "sine 10 mm 2 Hz" (""
    means not known yet: ``prepare_run`` finds it).

    Raises
    ------
    InputError
        One message with every fault found.
    """

    motion: str = ""

    def __post_init__(self) -> None:
        Recording.__post_init__(self)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is a fault of its size
            faults = _faults(self)
        if faults:
            place = self.name or self.source or "run"
            raise InputError(faults=[fault.at_place(place) for fault in faults])

    def checked(self) -> RigRun:
        return self

    def __repr__(self) -> str:
        """Return the run in a line: its length, and what it goes through."""
        said = [f"{self.time[-1] - self.time[0]:.3g} s at {(len(self) - 1) / np.ptp(self.time):.4g} Hz"]
        for values, unit in (
            *((1e3 * self.displacement, "mm"), (self.force, "N"), (self.command, self.command_unit)),
            *(() if self.temperature is None else ((self.temperature - ZERO_CELSIUS_K, "degC"),)),
        ):
            low, high = float(values.min()), float(values.max())
            said.append(f"{low:.3g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}")
        return f"RigRun {self.name!r}: {', '.join(said)}"

    @property
    def constant_command(self) -> float | None:
        """The command [A or V] when it keeps still, else None.

        A measured one keeps still while 98 % of its samples stay within 2 % of its median (or within 20 mA
        or 20 mV) on either side: its median, then.
        """
        return steady_command(self.command)

    def between(self, from_s: float | None, to_s: float | None) -> RigRun:
        """Return the samples from one time to another, both included; None: from the start, to the end."""
        kept = np.ones(len(self), dtype=bool)
        if from_s is not None:
            kept &= self.time >= from_s
        if to_s is not None:
            kept &= self.time <= to_s
        cut: dict[str, Any] = {
            name: column[kept] for name in _CHANNELS if (column := getattr(self, name)) is not None
        }
        return replace(self, **cut)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Dataset(Picture):
    """Runs with unique names, in the order given, and what is known of how their files were read."""

    runs: tuple[RigRun, ...]
    findings: tuple[Finding, ...] = ()  # of what was done while reading: gaps cut, numbers filled in, ...
    inferred: tuple[Inference, ...] = ()  # commands and temperatures that stood in words

    def __post_init__(self) -> None:
        object.__setattr__(self, "runs", tuple(self.runs))
        names = self.names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            sources = ", ".join(run.source or "?" for run in self.runs if run.name == twice[0])
            raise InputError(
                f"run name {twice[0]!r} is used more than once ({sources})", remedy="rename a file"
            )

    def __len__(self) -> int:
        return len(self.runs)

    def __repr__(self) -> str:
        """Return the first runs, a line each."""
        lines = [f"  {run!r}" for run in self.runs[:_MOST_SHOWN]]
        more = len(self) - len(lines)
        return "\n".join(
            [f"Dataset of {len(self)} runs", *lines, *([f"  ... and {more} more"] if more else [])]
        )

    def __iter__(self) -> Iterator[RigRun]:
        return iter(self.runs)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(run.name for run in self.runs)

    @property
    def fingerprint(self) -> str:
        """SHA-256 over names, units and values of all runs, whatever their order."""
        digest = hashlib.sha256()
        for run in sorted(self.runs, key=lambda run: run.name):
            digest.update(f"{run.name}\0{run.command_unit}\0{len(run)}\0".encode())
            for channel in (
                run.time,
                run.displacement,
                run.force,
                run.command,
                run.velocity,
                run.temperature,
            ):
                digest.update(b"\0" if channel is None else np.ascontiguousarray(channel, dtype="<f8").data)
        return digest.hexdigest()

    def select(self, *globs: str) -> Dataset:
        """Return the runs whose name matches any of the patterns, in the order they are kept."""
        for glob in globs:
            if not any(fnmatchcase(name, glob) for name in self.names):
                raise unknown_name(f"pattern {glob!r} matches no run", glob, self.names)
        chosen = (run for run in self.runs if any(fnmatchcase(run.name, glob) for glob in globs))
        return self._part(chosen)

    def split(self, hold_out: Sequence[str]) -> tuple[Dataset, Dataset]:
        """Return (training, held out): the runs that match a ``hold_out`` pattern are held out."""
        globs = (hold_out,) if isinstance(hold_out, str) else tuple(hold_out)
        held_out = self.select(*globs)
        training = self._part(run for run in self.runs if run not in held_out.runs)
        if self.runs and not training.runs:
            raise InputError(
                f"hold-out {', '.join(globs)} leaves no run to train on", remedy="hold out fewer runs"
            )
        return training, held_out

    def _part(self, runs: Iterable[RigRun]) -> Dataset:
        """Return some of the runs, with what is known of their reading."""
        chosen = tuple(runs)
        names = {run.name for run in chosen}
        return Dataset(
            chosen,
            tuple(each for each in self.findings if each.run in names),
            tuple(each for each in self.inferred if each.run in names),
        )


def accepted_runs(recordings: Iterable[Recording]) -> list[RigRun]:
    """Return the recordings without faults as runs."""
    runs = []
    for recording in recordings:
        with suppress(InputError):
            runs.append(recording.checked())
    return runs


def steady_command(command: FloatArray) -> float | None:
    """Return the command [A or V] when it keeps still as ``RigRun.constant_command`` says, else None."""
    first = float(command[0])
    if bool((command == first).all()):
        return first
    low, middle, high = np.quantile(command, (0.01, 0.5, 0.99)).tolist()
    return middle + 0.0 if max(high - middle, middle - low) <= command_slack(middle) else None


def with_steady_commands(runs: Iterable[RigRun]) -> tuple[RigRun, ...]:
    """Return runs with each command that is a level and noise alone replaced by its median.

    Noise is judged by its size beside the largest command of all the runs: a standard deviation of at most
    8 %, about a level that does not move by more than 4 % from one sixteenth of the run to another.
    """
    runs = tuple(runs)
    largest = max((float(np.quantile(np.abs(run.command), 0.99)) for run in runs), default=0.0)
    return tuple(
        replace(run, command=np.full(len(run), np.median(run.command)))
        if run.constant_command is None and _only_noise(run.command, largest)
        else run
        for run in runs
    )


def _only_noise(command: FloatArray, largest: float) -> bool:
    levels = [float(np.median(part)) for part in np.array_split(command, _LEVEL_PARTS)]
    return float(np.std(command)) <= 0.08 * largest and max(levels) - min(levels) <= 0.04 * largest


def command_slack(command: float) -> float:
    """Return by how much [A or V] a command that keeps still may be measured off: 2 %, or 20 mA (mV)."""
    return max(0.02 * abs(command), 0.02)


def _faults(run: RigRun) -> list[InputError]:
    """Return every fault of a run, without the name of the run."""
    faults: list[InputError] = []
    if not run.name:
        faults.append(InputError("has no name", remedy="Pass a name"))
    if run.command_unit not in {"A", "V"}:
        faults.append(InputError(f"command unit is {run.command_unit!r}", expected="'A' or 'V'"))
    channels: dict[str, FloatArray] = {
        "time": run.time,
        "displacement": run.displacement,
        "force": run.force,
        "command": run.command,
    }
    channels |= {"velocity": run.velocity} if run.velocity is not None else {}
    channels |= {"temperature": run.temperature} if run.temperature is not None else {}
    shapes = {name: array.shape for name, array in channels.items()}
    if any(len(shape) != 1 for shape in shapes.values()) or len(set(shapes.values())) != 1:
        sizes = ", ".join(f"{name} {'x'.join(map(str, shape))}" for name, shape in shapes.items())
        fault = InputError(
            f"channels differ in length ({sizes})",
            expected="one value of each per sample",
            remedy="Cut all channels to the same samples",
        )
        return [*faults, fault]
    if len(run.time) < LEAST_SAMPLES:
        fault = InputError(
            f"has {len(run.time)} samples",
            expected=f"at least {LEAST_SAMPLES}",
            remedy="Record a longer run, or leave the file out",
        )
        return [*faults, fault]
    missing = [_not_finite(name, array) for name, array in channels.items() if not np.isfinite(array).all()]
    if missing:
        return [*faults, *missing]
    faults += [
        InputError(each.found, expected="even steps of time", remedy=each.remedy)
        for each in find_time_faults(run.time)
    ]
    if not faults:
        faults += _motion_faults(run)
    if np.ptp(run.force) < FORCE_RANGE_MIN_N:
        faults.append(
            InputError(
                f"force never changes ({run.force[0]:g} N at every sample)",
                expected="a load cell's signal",
                remedy="Check which column holds the force",
            )
        )
    command = "current" if run.command_unit == "A" else "voltage"
    for role, array in channels.items():
        if role != "displacement":
            faults += _range_faults(command if role == "command" else role, array)
    return faults


def _not_finite(name: str, array: FloatArray) -> InputError:
    bad = np.flatnonzero(~np.isfinite(array))
    return InputError(
        f"{name} is {array[bad[0]]} at sample {bad[0]} ({len(bad)} such samples)",
        expected="finite numbers",
        remedy="Fill the empty cells, or cut the segment out of the file",
    )


def find_time_faults(time: FloatArray) -> list[Finding]:
    """Return the fault of times [s] that run backward or stand still, have gaps, or change their rate."""
    steps = np.diff(time)
    if not len(steps) or not np.isfinite(time).all():
        return []
    backward = np.flatnonzero(~(steps > 0.0))
    if len(backward):
        k, still = int(backward[0]), bool((steps[backward] == 0.0).all())
        finding = Finding(
            kind="time_not_increasing",
            severity="fault",
            channel="time",
            size=float(len(backward)),
            unit="places",
            from_s=float(time[k]),
            to_s=float(time[backward[-1]]),
            found=f"time does not increase at {len(backward)} places: it "
            f"{'stands still' if still else 'goes back'}, first after sample {k} "
            f"({time[k]:.6g} s to {time[k + 1]:.6g} s)",
            effect="Velocity there is infinite or has the wrong sign, and the run is refused",
            remedy="Split the file where time restarts; write more digits of time, or give rate_Hz at "
            "[constant] of the channel map instead of the column",
        )
        return [finding]
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP_MIN_STEPS * usual)
    changed = changes_of_pace(steps, len(gaps))
    if changed is not None:
        at, before, after = changed
        finding = Finding(
            kind="mixed_sampling",
            severity="fault",
            channel="time",
            size=before / after,
            from_s=float(time[at]),
            found=f"mixed sampling: the time step is {before:.4g} s at the start and {after:.4g} s from "
            f"about sample {at}",
            effect="One smoothing cannot suit both parts, and the run is refused",
            remedy="Split the file there, or record at one rate",
        )
        return [finding]
    if not len(gaps):
        return []
    k = int(gaps[0])
    finding = Finding(
        kind="gap",
        severity="fault",
        channel="time",
        size=float(steps[gaps].max()),
        unit="s",
        from_s=float(time[k]),
        to_s=float(time[gaps[-1] + 1]),
        found=f"time has a gap of {steps[k]:.6g} s after sample {k}, where the usual step is {usual:.6g} s "
        f"({len(gaps)} such places)",
        effect="The state of the hysteresis is lost in a gap, and the run is refused",
        remedy="Split the file at the gap, or cut it out with its cycle",
    )
    return [finding]


def changes_of_pace(steps: FloatArray, gaps: int) -> tuple[int, float, float] | None:
    """Return where the usual time step [s] changes by a quarter, from what and to what; None when never."""
    blocks = len(steps) // _BLOCK
    if not blocks:
        return None
    pace = steps[: blocks * _BLOCK].reshape(blocks, _BLOCK).mean(axis=1)  # jitter and rounding average out
    changed = np.abs(pace / pace[:1] - 1.0) > 0.25
    if not (np.any(changed[1:] & changed[:-1]) and np.count_nonzero(changed) > gaps):
        return None
    block = int(np.flatnonzero(changed[1:] & changed[:-1])[0])
    return block * _BLOCK, float(pace[0]), float(pace[block + 1])


def _motion_faults(run: RigRun) -> list[InputError]:
    stroke = float(np.ptp(run.displacement))
    if stroke < STROKE_MIN_m:
        return [
            InputError(
                f"displacement never changes ({run.displacement[0]:g} m at every sample)",
                expected="a motion",
                remedy=f"Check which column holds the displacement. {WITHOUT_MOTION}",
            )
        ]
    speeds = np.abs(np.diff(run.displacement)) / np.diff(run.time)
    fastest = int(np.argmax(speeds))
    if speeds[fastest] > _SPEED or stroke > _STROKE:
        hint = "It looks like mm read as m: give the channel's unit as mm"
        if stroke <= _STROKE and np.count_nonzero(speeds > _SPEED) < 0.01 * len(speeds):
            hint = "It looks like a jump of the sensor: cut the segment out of the file"
        return [
            InputError(
                f"displacement moves at {speeds[fastest]:.3g} m/s at sample {fastest}, with a stroke of "
                f"{stroke:.3g} m",
                expected=f"at most {_SPEED:g} m/s and {_STROKE:g} m",
                remedy=hint,
            )
        ]
    values = len(np.unique(run.displacement))
    if values < _FEWEST_VALUES:
        return [
            InputError(
                f"displacement takes only {values} values, {stroke:.2g} m apart at most",
                expected="a motion far above the sensor's resolution",
                remedy="Cut the run where the rig moves, or record a larger stroke",
            )
        ]
    reversals = len(turning_points(run.displacement, _SWING * stroke))
    if reversals < 2:
        return [
            InputError(
                f"displacement has {reversals} reversal{'' if reversals == 1 else 's'}",
                expected="at least 2",
                remedy="Hysteresis shows only when the motion goes to and fro: record at least one cycle",
            )
        ]
    return []


def _range_faults(role: str, array: FloatArray) -> list[InputError]:
    quantity = QUANTITIES[role]
    outside = np.flatnonzero(~((array >= quantity.low) & (array <= quantity.high)))
    if not len(outside):
        return []
    k = int(outside[0])
    if role == "temperature":
        return [
            InputError(
                f"temperature is {to_degC(array[k]):.4g} degC ({array[k]:.4g} K) at sample {k} "
                f"({len(outside)} such samples)",
                expected=f"{to_degC(quantity.low):.0f} to {to_degC(quantity.high):.0f} degC",
                remedy=f"{_looks_like(float(array[k]))}: check the column's unit in the channel map",
            )
        ]
    return [
        InputError(
            f"{role} is {array[k]:g} {quantity.unit} at sample {k} ({len(outside)} such samples)",
            expected=f"{quantity.low:g} to {quantity.high:g} {quantity.unit}",
            remedy="Check the column's unit in the channel map",
        )
    ]


def _looks_like(kelvin: float) -> str:
    """Say what a temperature that cannot be may have been."""
    if kelvin < 200.0:
        return "It looks like degC given as K"
    return "It looks like K given as degC" if kelvin > 533.0 else "It looks like degF given as degC"
