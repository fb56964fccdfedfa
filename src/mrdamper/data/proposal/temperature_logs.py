"""Temperature logs: files of a slow logger that state date and time of day, next to runs that state theirs.

A run gets the temperature of the only log that covers it. Times are compared only if both state a date,
because a log of another day would be as plausible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import Finding
from mrdamper.data.formats.table import Moment, Table
from mrdamper.data.proposal.clocks import start_of
from mrdamper.data.proposal.column import Header, headers_of
from mrdamper.data.proposal.questions import Answer, with_answers
from mrdamper.data.proposal.recordings import RigFile
from mrdamper.data.proposal.roles import column_of
from mrdamper.data.records import GAP_MIN_STEPS, Recording
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import is_ambient
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES

_OF_RUNS = frozenset({"displacement", "velocity", "force"})
# Differences between local time and UTC [h], beginning with 0.
_ZONES_h = (*range(15), *range(-12, 0), -9.5, -3.5, 3.5, 4.5, 5.5, 6.5, 9.5, 10.5)
AMBIGUITY_MAX_K = 1.0  # Time zones that lead to temperatures within this range need not be known.


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """Times [s] after a start, which increase, and temperatures [K]."""

    start: Moment
    time: FloatArray
    temperature: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    path: Path
    recording: Recording
    start: Moment | None  # Moment of time zero.


def join_temperature_logs(
    read: Sequence[tuple[Path, RigFile]],
    others: Sequence[Path],
    chosen: ChannelMap,
    answers: Sequence[Answer],
) -> tuple[list[tuple[Path, RigFile]], dict[Path, Finding]]:
    """Return the files with the temperatures of logs, and a finding for each log.

    Parameters
    ----------
    others : files without runs
    """
    runs = [
        _Run(path, recording, start)
        for path, file in read
        for recording, start in zip(file.recordings, file.starts, strict=True)
    ]
    joined: dict[int, dict[Path, FloatArray]] = {k: {} for k in range(len(runs))}
    near: dict[Path, list[int]] = {}
    reasons: dict[Path, str] = {}
    for path in others if runs else ():
        try:
            log = _read_log(path, with_answers(chosen, answers, path.name))
        except InputError as fault:
            near[path], reasons[path] = [], fault.found
            continue
        if log is None:
            continue
        inside = [k for k, run in enumerate(runs) if path.parent in run.path.parents]
        near[path] = inside or [k for k, run in enumerate(runs) if path.parent.parent in run.path.parents]
        for k in near[path]:
            try:
                joined[k][path] = _temperature_of(runs[k], log, runs)
            except InputError as fault:
                reasons.setdefault(path, fault.found)
    for path, inside in near.items():
        if any(len(joined[k]) > 1 for k in inside):
            reasons[path] = "another log covers the same runs"
    only = {k: next(iter(logs.values())) for k, logs in joined.items() if len(logs) == 1}
    findings = {
        path: _finding(
            path, sum(path in joined[k] for k in inside if k in only), len(inside), reasons.get(path, "")
        )
        for path, inside in near.items()
    }
    recordings = iter([replace(run.recording, temperature=only[k]) if k in only else run.recording
                       for k, run in enumerate(runs)])  # fmt: skip
    return [
        (path, replace(file, recordings=tuple(next(recordings) for _ in file.recordings)))
        for path, file in read
    ], findings


def _read_log(path: Path, chosen: ChannelMap) -> _Log | None:
    """Return the log in a file, None if the file is not a temperature log.

    Raises
    ------
    InputError
        If the log has no date, or not exactly one temperature of the damper.
    """
    try:
        table = read_tables(path, chosen.file)[0]
        headers = headers_of(table, path.name)
    except InputError:
        return None
    roles = {role for each in headers for role in (*each.of_unit, each.of_word)}
    if "temperature" not in roles or roles & _OF_RUNS:
        return None
    place = path.name
    time = _times(table, headers, chosen, place)
    start = start_of(table, float(time[0]), path)
    if start is None:
        return None
    if not start.has_date:
        raise InputError(found="it states no date")
    column = column_of("temperature", table, headers, chosen, place)
    if column is None or is_ambient(column.name) or is_ambient(path.stem):
        raise InputError(found="it has no temperature of the damper with a unit")
    kelvin = column.channel(chosen).to_si(table.columns[column.name], column.unit, place)
    valid = (
        np.isfinite(time)
        & (kelvin > QUANTITIES["temperature"].low)
        & (kelvin < QUANTITIES["temperature"].high)
    )
    if valid.sum() < 2 or np.any(np.diff(time[valid]) <= 0.0):
        raise InputError(found="it has no increasing times with plausible temperatures")
    return _Log(start, time[valid], kelvin[valid])


def _times(table: Table, headers: Sequence[Header], chosen: ChannelMap, place: str) -> FloatArray:
    """Return the times of a log [s]."""
    dated = sorted(table.stamps, key=lambda name: not table.stamps[name].has_date)
    if dated:
        return table.columns[dated[0]]
    column = column_of("time", table, headers, chosen, place)
    if column is None:
        return np.arange(table.rows) * (table.step_s or np.nan)
    return column.channel(chosen).to_si(table.columns[column.name], column.unit, place)


def _temperature_of(run: _Run, log: _Log, runs: Sequence[_Run]) -> FloatArray:
    """Return the temperatures [K] of a log at the times of a run.

    Raises
    ------
    InputError
        If the clocks of run and log cannot be compared, or if the log does not cover the run.
    """
    if run.recording.temperature is not None:
        raise InputError(found="the runs state their own temperature")
    if run.start is None or not run.start.has_date:
        raise InputError(found=f"the runs state no {'date' if run.start else 'start time'}")
    duration = float(np.ptp(run.recording.time))
    if any(
        abs(other - _begin(run)) < 0.5 * duration
        for each in runs
        if each is not run and (other := _begin(each))
    ):
        raise InputError(found="several runs state the same start time")
    same_clock = run.start.is_utc == log.start.is_utc
    found: list[FloatArray] = []
    for zone in _ZONES_h[: 1 if same_clock else None]:
        for reading in ("day_first_s", "month_first_s"):
            shift = getattr(run.start, reading) - getattr(log.start, reading) + 3600.0 * zone
            if _is_covered(run.recording.time + shift, log.time):
                found.append(np.interp(run.recording.time + shift, log.time, log.temperature))
        if not found:
            raise InputError(found="its times do not cover them")
    if np.ptp(found, axis=0).max() > AMBIGUITY_MAX_K:
        stating, other = ("the runs", "it") if run.start.is_utc else ("it", "the runs")
        raise InputError(found=f"{stating} state UTC and {other} local time of an unknown zone")
    return found[0]


def _begin(run: _Run) -> float:
    """Return the begin of a run [s since 1970], NaN if it is unknown."""
    return np.nan if run.start is None else run.start.day_first_s + float(run.recording.time[0])


def _is_covered(time: FloatArray, log: FloatArray) -> bool:
    """Return True if a log covers times, up to one of its steps at the ends and without a gap."""
    step = float(np.median(np.diff(log)))
    if not (log[0] - step <= time[0] and time[-1] <= log[-1] + step):
        return False
    first, last = np.searchsorted(log, (time[0], time[-1]))
    inside = np.diff(log[max(first - 1, 0) : last + 1])
    return not len(inside) or float(inside.max()) <= GAP_MIN_STEPS * step


def _finding(path: Path, joined: int, count: int, reason: str) -> Finding:
    """Return the finding of a log that is used for some of the runs."""
    if not joined:
        return Finding(
            kind="temperature_log",
            severity="note",
            run=path.name,
            found=f"{path.name} is a temperature log that is not used: {reason}",
            effect="The runs have no temperature of this log",
            remedy="State date, time of day and offset from UTC in the log and in the runs, or list the "
            "temperatures of the runs in a table",
        )
    others = "" if joined == count else f"; not used for the others: {reason}"
    return Finding(
        kind="temperature_log",
        severity="note" if joined == count else "warning",
        channel="temperature",
        run=path.name,
        found=f"{path.name} is the temperature of {joined} of {count} runs, interpolated in time{others}",
        effect="An error of a clock becomes an error of the temperature",
        remedy="Nothing, if both clocks were right",
    )
