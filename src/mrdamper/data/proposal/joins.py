"""Joins of files: one file for each channel of a run, and temperature logs of a separate, slow logger.

A run gets the temperature of a log if exactly one log covers the run. Times are compared only if run and log
state a date, because a log without a date may be from a different day.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import Finding
from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.table import Moment, Table, distinct_names
from mrdamper.data.proposal.clocks import MEASURED, increases, sampling_step, start_of, unit_by_magnitude
from mrdamper.data.proposal.column import Header, explained, header_of, headers_of
from mrdamper.data.proposal.documents import Document
from mrdamper.data.proposal.questions import Answer, with_answers
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.proposal.roles import column_of, scaled_column
from mrdamper.data.proposal.side_by_side import is_counter
from mrdamper.data.records import GAP_MIN_STEPS, Recording
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import has_word, strip_channel
from mrdamper.data.words.labels import rates_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, to_si

_NEEDED = frozenset({"displacement", "force"})
_TOKEN = re.compile(r"[\W_]*(?:\d+|[^\W\d_]+)")  # A number or a word of a file name.
_STEP_MAX_S = 3600.0  # A log with a longer step has no value during a run.


@dataclass(frozen=True, slots=True, eq=False)
class _ChannelFile:
    """A file with one channel."""

    path: Path
    role: str
    column: str
    table: Table
    times: FloatArray  # [s]


def join_channel_files(
    files: Sequence[Path], chosen: ChannelMap, answers: Sequence[Answer], documents: Sequence[Document] = ()
) -> tuple[list[tuple[Path, RigFile]], set[Path]]:
    """Return the runs that are stored as one file per channel, and the files of these runs.

    The names of a run's files are equal except for the name of the channel, or a folder has only the files of
    one run.
    """
    tables: dict[Path, Table] = {}
    for path in files:
        with suppress(InputError, ValueError):
            (tables[path],) = read_tables(path, chosen.file)
    folders: dict[Path, list[_ChannelFile]] = {}
    for path, table in tables.items():
        with suppress(InputError, ValueError, IndexError):
            # A short file of another channel states only its own sampling rate.
            notes = [line for each in documents if each.path not in tables for line in each.notes(path)]
            channel = _channel_of(explained(table, notes, chosen, path.name), chosen, path)
            folders.setdefault(path.parent, []).append(channel)
    joined: list[tuple[Path, RigFile]] = []
    members: set[Path] = set()
    for folder, channels in folders.items():
        for rest, group in _runs_of(channels).items():
            name = rest or folder.name
            place = folder / name
            own = {channel.path: None for channel in group}
            stated = {each: None for document in documents for path in own for each in document.places(path)}
            with suppress(InputError):
                answered = with_answers(chosen, answers, place)
                run = runs_in((_join_channels(group),), answered, place, name=name, stated=[*stated])
                joined.append((place, run))
                members |= own.keys()
    return joined, members


def _runs_of(channels: Sequence[_ChannelFile]) -> dict[str, list[_ChannelFile]]:
    """Return the files of each run in a folder, by a common part of the file names.

    The common part is the name without the channel word, or the beginning or the end of the name. It is "" if
    all files belong to one run. The part that assigns most files to runs is chosen.
    """
    names = {channel.path: _TOKEN.findall(channel.path.stem) for channel in channels}
    counts = range(1, max(map(len, names.values())))
    parts = [*(slice(k) for k in counts), *(slice(-k, None) for k in counts), slice(0)]
    ways = [{path: strip_channel(path.stem) for path in names}]
    ways += [{path: "".join(words[part]).lstrip("_-. ") for path, words in names.items()} for part in parts]
    best: dict[str, list[_ChannelFile]] = {}
    for way in ways:
        groups: dict[str, list[_ChannelFile]] = {}
        for channel in channels:
            groups.setdefault(way[channel.path], []).append(channel)
        roles = {run: [each.role for each in group] for run, group in groups.items()}
        whole = [run for run, own in roles.items() if len({*own}) == len(own) and {*own} >= _NEEDED]
        best = max(best, {run: groups[run] for run in whole}, key=lambda runs: sum(map(len, runs.values())))
    return best


def _channel_of(table: Table, chosen: ChannelMap, path: Path) -> _ChannelFile:
    """Return the only channel of a table. Columns of times and of sample numbers are no channels.

    Raise ValueError if there is not exactly one channel, IndexError if its role is unknown, InputError if it
    has no times.
    """
    headers = [header_of(table, name) for name in table.columns]
    times = [each for each in headers if "time" in each.of_unit]
    others = [each for each in headers if each not in times and np.isfinite(table.columns[each.name]).any()]
    (channel,) = [each for each in others if not is_counter(table.columns[each.name])]
    if times:
        own = to_si(table.columns[times[0].name], times[0].unit, "time")
    else:
        own = np.arange(table.rows, dtype=np.float64) * sampling_step(table, chosen, path.name)
    scaled = [role for role in QUANTITIES if scaled_column(role, table, headers) is not None]
    return _ChannelFile(path, (scaled or channel.of_unit)[0], channel.name, table, own)


def _join_channels(parts: Sequence[_ChannelFile]) -> Table:
    """Return one table of the channels; each channel keeps its time column."""
    first = parts[0].table
    named = dict(zip(distinct_names([part.column for part in parts]), parts, strict=True))
    whole = replace(
        first,
        names=(*named,),
        columns={name: part.table.columns[part.column] for name, part in named.items()},
        units={name: part.table.units.get(part.column, "") for name, part in named.items()},
        # The times of each channel are known, and the files may state different rates.
        said=tuple(dict.fromkeys(line for each in parts for line in each.table.said if not rates_in([line]))),
        step_s=None,
        rows=max(part.table.rows for part in parts),
        layout=replace(first.layout, notes=(*first.layout.notes, f"{len(parts)} files of one channel each")),
    )
    return with_times(whole, {name: part.times for name, part in named.items()})


Run = tuple[Path, Recording, Moment | None]  # File, recording, and the moment of its time zero.
Files = Sequence[tuple[Path, RigFile]]
_Log = tuple[Moment, FloatArray, FloatArray]  # Start, times after the start [s], and temperatures [K].


def join_temperature_logs(
    read: Files, others: Sequence[Path], chosen: ChannelMap, answers: Sequence[Answer]
) -> tuple[Files, dict[Path, Finding]]:
    """Return all files of ``read`` with temperatures from logs, and a finding for each log.

    A temperature is added to each recording that exactly one log covers. ``others`` are files that may be
    logs.
    """
    runs = [(path, *pair) for path, file in read for pair in zip(file.recordings, file.starts, strict=True)]
    counts: dict[Path, int] = {}  # Number of runs that each log may cover.
    reasons: dict[Path, str] = {}
    joined: list[tuple[Path, int, FloatArray]] = []
    for path in others if runs else ():
        below = [run for run, (file, *_) in enumerate(runs) if path.parent in file.parents]
        beside = [run for run, (file, *_) in enumerate(runs) if path.parent.parent in file.parents]
        try:
            log = _read_log(path, with_answers(chosen, answers, path))
        except InputError as fault:
            counts[path], reasons[path] = 0, fault.found
            continue
        if log is None:
            continue
        counts[path] = len(below or beside)
        for run in below or beside:
            try:
                joined.append((path, run, _temperature_of(runs[run], log, runs)))
            except InputError as fault:
                reasons.setdefault(path, fault.found)
    often = Counter(run for _, run, _ in joined)
    reasons |= {path: "another log covers the same runs" for path, run, _ in joined if often[run] > 1}
    warm = {run: kelvin for _, run, kelvin in joined if often[run] == 1}
    order = count()
    files = []
    for path, file in read:
        warmed = (replace(one, temperature=warm.get(next(order), one.temperature)) for one in file.recordings)
        files.append((path, replace(file, recordings=tuple(warmed))))
    used = Counter(path for path, run, _ in joined if run in warm)
    return files, {path: _finding(path, used[path], counts[path], reasons.get(path, "")) for path in counts}


def _read_log(path: Path, chosen: ChannelMap) -> _Log | None:
    """Return the log in a file, None if the file is not a temperature log.

    Raise InputError if the log has no date, no increasing times, or not exactly one damper temperature.
    """
    try:
        table = read_tables(path, chosen.file)[0]
        headers = headers_of(table)
    except InputError:
        return None
    roles = {role for each in headers for role in (*each.of_unit, each.of_word)}
    if "temperature" not in roles or roles & MEASURED:
        return None
    place = path.name
    time = _times(table, headers, chosen, place)
    start = start_of(table, float(time[0]), path)
    if start is None:
        return None
    if not start.has_date:
        raise InputError(found="it states no date")
    column = column_of("temperature", table, headers, chosen, place)
    if column is None or has_word(column.name, "ambient") or has_word(path.stem, "ambient"):
        raise InputError(found="it has no temperature of the damper with a unit")
    kelvin = column.channel(chosen).to_si(table.columns[column.name], column.unit, place)
    limits = QUANTITIES["temperature"]
    valid = np.isfinite(time) & (kelvin > limits.low) & (kelvin < limits.high)
    if valid.sum() < 2 or np.any(np.diff(time[valid]) <= 0.0):
        raise InputError(found="it has no increasing times with plausible temperatures")
    return start, time[valid], kelvin[valid]


def _times(table: Table, headers: Sequence[Header], chosen: ChannelMap, place: str) -> FloatArray:
    """Return the times of a log [s], NaN without times and without a time step."""
    stamps = sorted(table.stamps, key=lambda name: not table.stamps[name].has_date)
    if stamps:
        return table.columns[stamps[0]]
    column = column_of("time", table, headers, chosen, place)
    if column is None:
        counts = (each.name for each in headers if not each.unit and increases(table, each.name, always=True))
        units = ((name, unit_by_magnitude(table.columns[name], _STEP_MAX_S)) for name in counts)
        name, unit = next((pair for pair in units if pair[1]), ("", ""))
        if unit:
            return to_si(table.columns[name], unit, "time")
        return np.arange(table.rows, dtype=np.float64) * float(table.step_s or np.nan)
    return column.channel(chosen).to_si(table.columns[column.name], column.unit, place)


def _temperature_of(run: Run, log: _Log, runs: Sequence[Run]) -> FloatArray:
    """Return the temperatures [K] of a log during a run. Raise InputError if it does not cover the run."""
    path, recording, start = run
    begin, seconds, kelvin = log
    if recording.temperature is not None:
        raise InputError(found="the runs state their own temperature")
    if start is None or not start.has_date:
        raise InputError(found=f"the runs state no {'date' if start else 'start time'}")
    begins = [other.day_first_s + one.time[0] for _, one, other in runs if other and one is not recording]
    apart = np.abs(np.array(begins) - start.day_first_s - recording.time[0])
    if np.any(apart < 0.5 * np.ptp(recording.time)):
        raise InputError(found="several runs state the same start time")
    if start.is_utc != begin.is_utc:
        raise InputError(found="only one of runs and log states UTC, the other local time of an unknown zone")
    for late_s in (start.day_first_s - begin.day_first_s, start.month_first_s - begin.month_first_s):
        if _is_covered(recording.time + late_s, seconds):
            return np.interp(recording.time + late_s, seconds, kelvin)
    raise InputError(found=f"its times do not cover {path.name}")


def _is_covered(time: FloatArray, log: FloatArray) -> bool:
    """Return True if a log has no gap and covers all times, except for one log step at either end."""
    step = float(np.median(np.diff(log)))
    first, last = np.searchsorted(log, (time[0], time[-1]))
    inside = np.diff(log[max(first - 1, 0) : last + 1])
    is_inside = log[0] - step <= time[0] and time[-1] <= log[-1] + step
    return bool(is_inside and inside.max(initial=0.0) <= GAP_MIN_STEPS * step)


def _finding(path: Path, joined: int, count: int, reason: str) -> Finding:
    """Return the finding of a log that is used for some of the runs."""
    found = f"{path.name} is a temperature log that is not used: {reason}"
    if joined:
        rest = f" Not used for the others: {reason}" if joined < count else ""
        found = f"{path.name} is the temperature of {joined} of {count} runs, interpolated in time.{rest}"
    effect = "An error of a clock becomes an error of the temperature" if joined else "The log has no effect"
    remedy = "State date, time of day and offset from UTC in the log and in the runs, if missing"
    finding = Finding("temperature_log", found, effect, remedy, channel="temperature", run=path.name)
    return finding if 0 < joined < count else replace(finding, severity="note")
