"""Records: one measured run, and a set of runs.

A ``RigRun`` contains the measured channels of a rig in SI and kelvin. The channels are not smoothed, shifted
or resampled here (the module ``prepare`` does it). A run is checked when it is built, and one message lists
all faults.

Sign convention: extension is positive, and a force that resists extension is positive.
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
from mrdamper.schema import finite_or_none, unknown_name

WITHOUT_MOTION = "Without motion no model can be identified: repeat the test with one, or leave the run out"
"""Effect and remedy of a run without motion, for messages."""

CHANNELS = ("time", "displacement", "force", "command", "velocity", "temperature")
LEAST_SAMPLES = 16
_SPEED_MAX_m_s = 10.0  # No damper rig is faster.
_STROKE_MAX_m = 2.0  # No damper rig has a longer stroke.
_BLOCK_STEP_COUNT = 16  # Time steps are averaged in groups of this size to remove jitter.
STROKE_MIN_m = 1e-9  # A displacement with a smaller stroke is numerically constant.
GAP_MIN_STEPS = 5.0  # A time step longer than this multiple of the median step is a gap.


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """The unchecked data of one run in a file, in SI.

    The arrays are read-only float64. They may contain NaN and implausible values. Runs with the same
    ``session`` were recorded with the same zero of the load cell. ``source`` is the path of the file.
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
        for channel in CHANNELS:
            given = getattr(self, channel)
            if given is not None:
                object.__setattr__(self, channel, read_only(given))

    def __len__(self) -> int:
        return len(self.time)

    def checked(self) -> RigRun:
        """Return the run; raise one ``InputError`` with all faults if there are any."""
        return RigRun(**{field.name: getattr(self, field.name) for field in fields(self)})


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RigRun(Recording, Picture):
    """One measured run of one damper on a rig: a recording without faults.

    Arrays have shape (n,), and the time strictly increases. ``motion`` is a label such as "sine 10 mm 2 Hz".
    If the label is empty, ``prepare_run`` classifies the motion.

    Raise InputError if the run has faults. The message lists all faults.
    """

    _picture = "mrdamper.report.figures.runs:plot_runs"
    motion: str = ""

    def __post_init__(self) -> None:
        Recording.__post_init__(self)
        with np.errstate(over="ignore", invalid="ignore"):  # The range checks reject values that overflow.
            faults = _faults(self)
        if faults:
            place = self.name or self.source or "run"
            raise InputError(faults=[fault.prepend_place(place) for fault in faults])

    def checked(self) -> RigRun:
        return self

    def __repr__(self) -> str:
        """Return the run in one line: its duration, rate, and the ranges of its channels."""
        parts = [f"{self.time[-1] - self.time[0]:.3g} s at {(len(self) - 1) / np.ptp(self.time):.4g} Hz"]
        for values, unit in (
            *((1e3 * self.displacement, "mm"), (self.force, "N"), (self.command, self.command_unit)),
            *(() if self.temperature is None else ((self.temperature - ZERO_CELSIUS_K, "degC"),)),
        ):
            low, high = float(values.min()), float(values.max())
            parts.append(f"{low:.3g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}")
        return f"RigRun {self.name!r}: {', '.join(parts)}"

    @property
    def constant_command(self) -> float | None:
        """Return the constant command [A or V], or None if the command changes.

        A measured command is constant if 98 % of its samples differ from its median by at most 2 % (or by
        20 mA or 20 mV). Then its median is returned.
        """
        return steady_command(self.command)

    def between(self, from_s: float | None, to_s: float | None) -> RigRun:
        """Return the samples between two times [s], both included. None means the start or the end."""
        kept = self.time >= (-np.inf if from_s is None else from_s)
        kept &= self.time <= (np.inf if to_s is None else to_s)
        channels = ((name, getattr(self, name)) for name in CHANNELS)
        cut: dict[str, Any] = {name: column[kept] for name, column in channels if column is not None}
        return replace(self, **cut)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Dataset(Picture):
    """Runs with unique names, in the given order, with the findings of the readers."""

    _picture = "mrdamper.report.figures.runs:plot_runs"
    runs: tuple[RigRun, ...]
    findings: tuple[Finding, ...] = ()  # changes by readers, such as removed gaps and filled cells
    inferred: tuple[Inference, ...] = ()  # commands and temperatures from words

    def __post_init__(self) -> None:
        object.__setattr__(self, "runs", tuple(self.runs))
        names = self.names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            sources = ", ".join(run.source or "?" for run in self.runs if run.name == twice[0])
            found = f"run name {twice[0]!r} is used more than once ({sources})"
            raise InputError(found, remedy="rename a file")

    def __len__(self) -> int:
        return len(self.runs)

    def __repr__(self) -> str:
        """Return the text form: one line for each run."""
        return "\n".join([f"Dataset of {len(self)} runs", *(f"  {run!r}" for run in self.runs)])

    def __iter__(self) -> Iterator[RigRun]:
        return iter(self.runs)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(run.name for run in self.runs)

    @property
    def fingerprint(self) -> str:
        """Return the SHA-256 hash of names, units and values of all runs, independent of their order."""
        digest = hashlib.sha256()
        for run in sorted(self.runs, key=lambda run: run.name):
            digest.update(f"{run.name}\0{run.command_unit}\0{len(run)}\0".encode())
            for channel in (getattr(run, name) for name in CHANNELS):
                digest.update(b"\0" if channel is None else np.ascontiguousarray(channel, dtype="<f8").data)
        return digest.hexdigest()

    def select(self, *globs: str) -> Dataset:
        """Return the runs with a name that matches any of the patterns, in the order of this set."""
        for glob in globs:
            if not any(fnmatchcase(name, glob) for name in self.names):
                raise unknown_name(f"pattern {glob!r} matches no run", glob, self.names)
        return self._part(run for run in self.runs if any(fnmatchcase(run.name, glob) for glob in globs))

    def split(self, hold_out: Sequence[str]) -> tuple[Dataset, Dataset]:
        """Return (training, held out): the runs that match a ``hold_out`` pattern are held out."""
        globs = (hold_out,) if isinstance(hold_out, str) else tuple(hold_out)
        held_out = self.select(*globs)
        training = self._part(run for run in self.runs if run not in held_out.runs)
        if self.runs and not training.runs:
            found = f"hold-out {', '.join(globs)} leaves no run to train on"
            raise InputError(found, remedy="hold out fewer runs")
        return training, held_out

    def _part(self, runs: Iterable[RigRun]) -> Dataset:
        """Return some of the runs with the findings about these runs."""
        chosen = tuple(runs)
        names = {run.name for run in chosen}
        return Dataset(
            chosen,
            tuple(item for item in self.findings if item.run in names),
            tuple(item for item in self.inferred if item.run in names),
        )


def accepted_runs(recordings: Iterable[Recording]) -> list[RigRun]:
    """Return a run for each recording that has no faults."""
    runs = []
    for recording in recordings:
        with suppress(InputError):
            runs.append(recording.checked())
    return runs


def steady_command(command: FloatArray) -> float | None:
    """Return the constant command [A or V] as defined in ``RigRun.constant_command``, or None."""
    first = float(command[0])
    if bool((command == first).all()):
        return first
    low, middle, high = np.quantile(command, (0.01, 0.5, 0.99)).tolist()
    return middle + 0.0 if max(high - middle, middle - low) <= command_slack(middle) else None


def with_steady_commands(runs: Iterable[RigRun]) -> tuple[RigRun, ...]:
    """Return the runs. A command that is constant except for noise is replaced by its median.

    A command is constant except for noise if its standard deviation is at most 8 % of the largest command of
    all runs, and if the medians of sixteen parts of the run differ by at most 4 % of the largest command.
    """
    runs = tuple(runs)
    largest = max((float(np.quantile(np.abs(run.command), 0.99)) for run in runs), default=0.0)
    found = []
    for run in runs:
        levels = [float(np.median(part)) for part in np.array_split(run.command, 16)]
        is_noise = np.std(run.command) <= 0.08 * largest and max(levels) - min(levels) <= 0.04 * largest
        steady = run.constant_command is None and is_noise
        found.append(replace(run, command=np.full(len(run), np.median(run.command))) if steady else run)
    return tuple(found)


def command_slack(command: float) -> float:
    """Return the tolerance [A or V] of a constant command: 2 %, but at least 20 mA or 20 mV."""
    return max(0.02 * abs(command), 0.02)


def _faults(run: RigRun) -> list[InputError]:
    channels = channels_of(run)
    shapes = {name: array.shape for name, array in channels.items()}
    if not run.name:
        return [InputError("has no name", remedy="Pass a name")]
    if run.command_unit not in {"A", "V"}:
        return [InputError(f"command unit is {run.command_unit!r}", expected="'A' or 'V'")]
    if {*shapes.values()} != {(len(run),)}:
        sizes = ", ".join(f"{name} {'x'.join(map(str, shape))}" for name, shape in shapes.items())
        found, remedy = f"channels differ in length ({sizes})", "Cut all channels to the same samples"
        return [InputError(found, expected="one value of each per sample", remedy=remedy)]
    if len(run) < LEAST_SAMPLES:
        found, remedy = f"has {len(run)} samples", "Record a longer run, or leave the file out"
        return [InputError(found, expected=f"at least {LEAST_SAMPLES}", remedy=remedy)]
    if missing := [*find_missing_numbers(run)]:
        return [InputError(each.found, remedy=each.remedy) for each in missing]
    of_time = [InputError(each.found, remedy=each.remedy) for each in find_time_faults(run.time)]
    faults = of_time or _motion_faults(run)
    if np.ptp(run.force) < 1e-6:  # A force with a smaller range is numerically constant.
        found = f"force never changes ({run.force[0]:g} N at every sample)"
        remedy = "Check which column holds the force"
        faults.append(InputError(found, expected="a load cell's signal", remedy=remedy))
    sizes_found = (each for each in find_implausible_sizes(run) if each.channel != "displacement")
    return faults + [InputError(each.found, remedy=each.remedy) for each in sizes_found]


def channels_of(recording: Recording) -> dict[str, FloatArray]:
    """Return the channels of a recording by role."""
    roles = {"command": "current" if recording.command_unit == "A" else "voltage"}
    channels = ((roles.get(name, name), getattr(recording, name)) for name in CHANNELS)
    return {role: values for role, values in channels if values is not None}


def find_missing_numbers(recording: Recording) -> Iterator[Finding]:
    """Generate findings on channels that contain NaN or infinity."""
    for role, values in channels_of(recording).items():
        bad = np.flatnonzero(~np.isfinite(values))
        if not len(bad):
            continue
        found = f"{role} is {values[bad[0]]} at sample {bad[0]} ({len(bad)} such samples)"
        effect = "No fit can use the run: an error over such samples has no value"
        remedy = "Fill the empty cells in the source, or cut the segment out of the file"
        from_s, to_s = (finite_or_none(recording.time[k]) for k in bad[[0, -1]])
        missing = Finding("missing_numbers", found, effect, remedy, severity="fault", channel=role)
        yield replace(missing, size=float(len(bad)), unit="samples", from_s=from_s, to_s=to_s)


def find_implausible_sizes(recording: Recording) -> Iterator[Finding]:
    """Generate findings on channels outside the range of a damper on a rig."""
    for role, values in channels_of(recording).items():
        low, high, unit = QUANTITIES[role].low, QUANTITIES[role].high, QUANTITIES[role].unit
        outside = np.flatnonzero(~((values >= low) & (values <= high)))
        if not len(outside):
            continue
        k, few = int(outside[0]), len(outside) < 0.01 * len(values)
        worst = float(values[outside][np.argmax(np.abs(values[outside]))])
        sizes, hint = (f"{worst:.4g} {unit}", f"{low:g} to {high:g} {unit}"), ""
        if role == "temperature":
            unit_found = "K" if worst > 533.0 else "degF"
            hint = f"It looks like {'degC given as K' if worst < 200.0 else f'{unit_found} given as degC'}. "
            allowed = f"{to_degC(low):.0f} to {to_degC(high):.0f} degC"
            sizes = f"{to_degC(worst):.4g} degC ({sizes[0]})", allowed
        kind = "outliers" if few else "implausible_size"
        found = f"{role} is {sizes[0]} at worst, outside {sizes[1]} ({len(outside)} samples from {k} on)"
        effect = "A single such sample outweighs the rest of the run in a fit"
        remedy = f"{hint}Check the column's unit and gain in the channel map"
        if few:
            remedy = "Cut the samples out of the file, or repair the sensor's wiring"
        wrong = Finding(kind, found, effect, remedy, severity="fault", channel=role, size=worst, unit=unit)
        yield wrong.between(*recording.time[outside[[0, -1]]])


def find_time_faults(time: FloatArray) -> Iterator[Finding]:
    """Generate a finding on times [s] that do not increase, have gaps or two rates."""
    steps = np.diff(time)
    if not len(steps) or not np.isfinite(time).all():
        return
    backward = np.flatnonzero(~(steps > 0.0))
    if len(backward):
        k, how = int(backward[0]), "goes back" if (steps[backward] < 0.0).any() else "stands still"
        first = f"first after sample {k} ({time[k]:.6g} s to {time[k + 1]:.6g} s)"
        found = f"time does not increase at {len(backward)} places: it {how}, {first}"
        effect = "Velocity there is infinite or has the wrong sign, and the run is refused"
        remedy = "Split the file there, write more digits of time, or give rate_Hz in the channel map instead"
        wrong = Finding("time_not_increasing", found, effect, remedy, severity="fault", channel="time")
        yield replace(wrong, size=float(len(backward)), unit="places").between(*time[backward[[0, -1]]])
        return
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP_MIN_STEPS * median)
    if (changed := changes_of_pace(steps, len(gaps))) is not None:
        at, before, after = changed
        found = f"mixed sampling: the time step is {before:.4g} s, and {after:.4g} s from about sample {at}"
        effect = "One smoothing cannot suit both parts, and the run is refused"
        remedy = "Split the file there, or record at one rate"
        mixed = Finding("mixed_sampling", found, effect, remedy, severity="fault", channel="time")
        yield replace(mixed, size=before / after, from_s=float(time[at]))
    elif len(gaps):
        k = int(gaps[0])
        usual = f"the usual step is {median:.6g} s ({len(gaps)} such places)"
        found = f"time has a gap of {steps[k]:.6g} s after sample {k}, where {usual}"
        effect = "The state of the hysteresis is lost in a gap, and the run is refused"
        remedy = "Split the file at the gap, or cut it out with its cycle"
        gap = Finding("gap", found, effect, remedy, severity="fault", channel="time", unit="s")
        yield replace(gap, size=float(steps[gaps].max())).between(time[k], time[gaps[-1] + 1])


def changes_of_pace(steps: FloatArray, gaps: int) -> tuple[int, float, float] | None:
    """Return the index at which the mean time step [s] changes by over 25 %, and the steps before and after.

    Return None if the mean time step does not change. ``gaps`` is the number of time gaps in the run.
    """
    blocks = len(steps) // _BLOCK_STEP_COUNT
    pace = steps[: blocks * _BLOCK_STEP_COUNT].reshape(blocks, _BLOCK_STEP_COUNT).mean(axis=1)
    changed = np.abs(pace / pace[:1] - 1.0) > 0.25
    both = np.flatnonzero(changed[1:] & changed[:-1])
    if not len(both) or np.count_nonzero(changed) <= gaps:
        return None
    block = int(both[0])
    return block * _BLOCK_STEP_COUNT, float(pace[0]), float(pace[block + 1])


def _motion_faults(run: RigRun) -> list[InputError]:
    stroke = float(np.ptp(run.displacement))
    if stroke < STROKE_MIN_m:
        found = f"displacement never changes ({run.displacement[0]:g} m at every sample)"
        remedy = f"Check which column holds the displacement. {WITHOUT_MOTION}"
        return [InputError(found, expected="a motion", remedy=remedy)]
    speeds = np.abs(np.diff(run.displacement)) / np.diff(run.time)
    fastest = int(np.argmax(speeds))
    if speeds[fastest] > _SPEED_MAX_m_s or stroke > _STROKE_MAX_m:
        remedy = "It looks like mm read as m: give the channel's unit as mm"
        if stroke <= _STROKE_MAX_m and np.count_nonzero(speeds > _SPEED_MAX_m_s) < 0.01 * len(speeds):
            remedy = "It looks like a jump of the sensor: cut the segment out of the file"
        found = f"displacement moves at {speeds[fastest]:.3g} m/s at sample {fastest}"
        expected = f"at most {_SPEED_MAX_m_s:g} m/s and {_STROKE_MAX_m:g} m"
        return [InputError(f"{found}, with a stroke of {stroke:.3g} m", expected=expected, remedy=remedy)]
    values = len(np.unique(run.displacement))
    if values < 8:  # A sensor at rest has few values.
        found = f"displacement takes only {values} values, {stroke:.2g} m apart at most"
        remedy = "Cut the run where the rig moves, or record a larger stroke"
        return [InputError(found, expected="a motion far above the sensor's resolution", remedy=remedy)]
    # A motion back by less than 10 % of the stroke is not a reversal.
    reversals = len(turning_points(run.displacement, 0.1 * stroke))
    if reversals < 2:
        found = f"displacement has {reversals} reversals"
        remedy = "Hysteresis shows only when the motion goes to and fro: record at least one cycle"
        return [InputError(found, expected="at least 2", remedy=remedy)]
    return []
