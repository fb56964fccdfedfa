"""Time of a table: clocks, sampling rate, and unit of the time column.

Channels on several clocks are interpolated to the times of the fastest clock in their common time span.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import Finding
from mrdamper.data.formats.clocks import stated_sampling, with_times
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Moment, Table
from mrdamper.data.formats.timestamps import DAY_S, date_in, start_in
from mrdamper.data.proposal.column import (
    column_list,
    header_of,
    meant_without_unit,
    no_unit,
    require_no_text,
)
from mrdamper.data.proposal.questions import ask
from mrdamper.data.words.headers import word_and_unit
from mrdamper.data.words.labels import rates_in
from mrdamper.errors import InputError
from mrdamper.quantities import roles_of_unit, to_si

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6}  # Possible units of a time column, in ticks per second.
# Counts of time since a fixed day: unit, plausible first and last count (up to 2099), counts per second.
_EPOCHS = (
    *((unit, 1e9 * ticks, 4.1e9 * ticks, ticks) for unit, ticks in {**_TICKS, "ns": 1e9}.items()),
    *(("d", first, first + 47_481, 1 / DAY_S) for first in (25_569, 719_529)),  # days of Excel and of MATLAB
)
# A line may have several entries: "NPTS = 1500, DT = 5.0D-03 SEC".
_ENTRIES = re.compile(r"([^\W\d][^:=,;]*?)\s*[:=]\s*([^:=]*?)\s*(?=[,;]?\s[^\W\d][^:=,;\d]*[:=]|[,;]?$)")
_STEP_MIN_S, _STEP_MAX_S = 5e-4, 0.05  # A longer time step may show that the assumed unit is too large.
MEASURED = frozenset({"displacement", "force", "velocity"})
"""Roles that are not extrapolated. Values of other roles hold one step before and after their samples."""


def fastest_time(table: Table, names: Iterable[str]) -> str | None:
    """Return the name of the time column of the fastest clock of the columns, None if they have no clock."""
    clocks = sorted({table.clocks[name] for name in names if name in table.clocks})
    return min(
        (_time_of(table, clock) for clock in clocks),
        key=lambda time: _step_s(_seconds(table, time)),
        default=None,
    )


def to_one_clock(
    table: Table, names: Mapping[str, str], chosen: ChannelMap, place: str
) -> tuple[dict[str, FloatArray], tuple[str, ...], tuple[Finding, ...]]:
    """Return the columns at the times of the fastest clock, the roles of interpolated columns, and findings.

    ``names`` are the names of the columns by role, except time. If the table has several clocks, the result
    includes ``time``. Raise AskingError if the channels of one recording overlap for less than 90 % of it.
    Raise InputError if the channels have no common time, or one of them has no clock.
    """
    own = {role: table.clocks[name] for role, name in names.items() if name in table.clocks}
    columns = {role: table.columns[name] for role, name in names.items()}
    fastest = fastest_time(table, names.values())
    if fastest is None or len({*own.values()}) < 2:
        return columns, (), ()
    main = table.clocks[fastest]
    times = {clock: _seconds(table, _time_of(table, clock)) for clock in {*own.values()}}
    spans: dict[str, tuple[float, float]] = {}  # First and last time with values of each channel [s].
    for role, clock in own.items():
        hold = 0.0 if role in MEASURED else _step_s(times[clock])
        spans[role] = float(times[clock][0]) - hold, float(times[clock][-1]) + hold
    first, last = max(begin for begin, _ in spans.values()), min(end for _, end in spans.values())
    slack = SETTINGS.clock_tolerance_steps * _step_s(times[main])
    findings = _findings_of_common_time(spans, last - first, slack, table, chosen, place)
    kept = (times[main] >= first - slack) & (times[main] <= last + slack)
    found = {"time": table.columns[fastest][kept]}
    for role, values in columns.items():
        if role in own:
            same = own[role] == main
            found[role] = values[kept] if same else np.interp(times[main][kept], times[own[role]], values)
        elif len(values) == 1 or np.ptp(values) == 0.0:
            found[role] = np.full(len(found["time"]), values[0])
        else:
            fault = f"column {names[role]!r} ({role}) states no start and no step; other channels do"
            raise InputError(place=place, found=fault, remedy="Export the run with a time column")
    return found, tuple(role for role, clock in own.items() if clock != main), findings


def _time_of(table: Table, clock: int) -> str:
    """Return the name of the first column of a clock, which contains the times."""
    return next(name for name, other in table.clocks.items() if other == clock)


def _seconds(table: Table, name: str) -> FloatArray:
    """Return a time column in seconds, unchanged if its unit is unknown."""
    unit = table.units.get(name, "") or word_and_unit(name)[1]
    return to_si(table.columns[name], unit if "time" in roles_of_unit(unit) else "s", "time")


def _step_s(times: FloatArray) -> float:
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def _findings_of_common_time(
    spans: Mapping[str, tuple[float, float]],
    common_s: float,
    slack_s: float,
    table: Table,
    chosen: ChannelMap,
    place: str,
) -> tuple[Finding, ...]:
    """Return the finding on channels that start at different times or are partly unused.

    Raise InputError if the channels have no common time. Raise AskingError if the common time is short and
    the channels belong to one recording.
    """
    listed = ", ".join(f"{role} {begin:.4g} s to {end:.4g} s" for role, (begin, end) in spans.items())
    measured = [span for role, span in spans.items() if role in MEASURED]
    whole_s = max(end - begin for begin, end in measured)
    if common_s <= slack_s:
        remedy = "Correct the start times in the file, or export one recording by itself"
        raise InputError(place=place, found=f"the channels have no time in common ({listed})", remedy=remedy)
    used = f"{common_s:.4g} s of {whole_s:.4g} s"
    is_short = common_s < 0.9 * whole_s  # The user must confirm a shorter common time of one recording.
    if is_short and not (table.recorded_apart or chosen.file.common_time):
        found = f"the channels have only {used} in common ({listed})"
        raise ask("time", "part", place, found, ("common",))
    late_s = max(begin for begin, _ in spans.values()) - min(begin for begin, _ in measured)
    # If the channels leave at most 1 % of the recording unused, nothing is reported.
    if whole_s - common_s <= 0.01 * whole_s and not (table.recorded_apart and late_s > slack_s):
        return ()
    found, effect = f"the {used} that all channels have in common are used ({listed})", "The rest is not used"
    remedy = "Nothing, if the start times in the file are right"
    finding = Finding("common_time", found, effect, remedy, channel="time", size=whole_s - common_s, unit="s")
    return (finding if is_short else replace(finding, severity="note"),)


def with_clocks(table: Table) -> Table:
    """Assign the nearest time column to the left to each column of a text's table.

    Equal time columns are merged. A single time column with blanks between the samples of slower channels
    becomes a clock for each rate.
    """
    # A reader appends a number to a repeated name: "time (2)".
    plain = {name: re.sub(r" \(\d+\)$", "", name) for name in table.names}
    times = [name for name in table.columns if "time" in roles_of_unit(word_and_unit(plain[name])[1])]
    alone = times or [name for name in table.columns if table.units.get(name) == "s"]
    if len(alone) == 1:
        return _with_slow_channels(table, alone[0])
    if len(times) < 2 or table.names[0] != times[0] or table.clocks or table.texts:
        return table
    if all(np.array_equal(table.columns[name], table.columns[times[0]]) for name in times):
        kept = [name for name in table.names if name not in times[1:]]
        return replace(table, names=(*kept,), columns={name: table.columns[name] for name in kept})
    clocks: dict[str, int] = {}
    for name in table.names:
        clocks[name] = times.index(name) if name in times else [*clocks.values()][-1]
    there = {name: np.isfinite(values) for name, values in table.columns.items()}
    rows = {name: int(known.sum()) for name, known in there.items()}
    alike = all(
        rows[name] == rows[times[clock]] and there[name][: rows[name]].all() for name, clock in clocks.items()
    )
    if not alike or len({rows[name] for name in times}) == 1 or min(rows.values()) < 2:
        return table
    columns = {name: values[: rows[name]] for name, values in table.columns.items()}
    return replace(table, columns=columns, clocks=clocks)


def _with_slow_channels(table: Table, time: str) -> Table:
    """Return a table in which the columns with regular blanks between their samples have own clocks.

    At least half of the cells of such a column are blank, and its samples have equal steps of time.
    """
    seconds, columns = _seconds(table, time), dict(table.columns)
    times = {name: seconds for name, values in columns.items() if len(values) == len(seconds)}
    for name in times if not table.clocks and np.isfinite(seconds).all() else ():
        there = np.isfinite(columns[name])
        steps = np.diff(seconds[there])
        # Rounded times and one row more or less between two samples change a step by less than a half.
        if len(steps) > 1 and 2 * there.sum() <= len(there) + 1 and np.ptp(steps) < 0.5 * np.median(steps):
            columns[name], times[name] = columns[name][there], seconds[there]
    if all(own is seconds for own in times.values()):
        return table
    del times[time]
    return replace(with_times(replace(table, columns=columns), times), recorded_apart=False)


def stated_step(table: Table, chosen: ChannelMap, place: str) -> tuple[float | None, tuple[float, ...]]:
    """Return the sampling interval [s], and the sampling rates [Hz] stated in words.

    The interval comes from the map, the file, or the rate in words. Without a rate, or if the words state
    several rates, the interval is None.
    """
    if chosen.rate_Hz is not None or table.step_s is not None:
        return (table.step_s if chosen.rate_Hz is None else 1.0 / chosen.rate_Hz), ()
    rates = _rates_of(table, rates_in([Path(place).stem.replace("_", " ")]))
    if rates:
        return (1.0 / rates[0] if len(rates) == 1 else None), rates
    stated = stated_sampling({name: value for line in table.said for name, value in _ENTRIES.findall(line)})
    return (stated.step_s if stated is not None and stated.is_plausible else None), ()


def is_coarse_clock(table: Table, name: str, chosen: ChannelMap, place: str) -> bool:
    """Return True if times repeat, but their duration agrees with the stated sampling interval."""
    times = table.columns[name]
    step, _ = stated_step(table, chosen, place)
    if step is None or not (np.diff(times) == 0.0).any():
        return False
    return abs(float(times[-1] - times[0]) - step * (len(times) - 1)) <= float(np.diff(times).max())


def sampling_step(table: Table, chosen: ChannelMap, place: str) -> float:
    """Return the sampling interval [s] of a file without a time column, from the map or the file."""
    step, rates = stated_step(table, chosen, place)
    if step is None:
        require_no_text("time", table, place)
        meant = meant_without_unit("time", [header_of(table, name) for name in table.columns])
        if meant is not None and increases(table, meant.name):
            raise no_unit("time", place, meant.name)
        candidates = [f"{rate:g}" for rate in rates]
        found = f"no time column; the columns are: {column_list(table.names)}"
        if len(rates) > 1:
            found = f"no time column, and the stated sampling rates differ: {' Hz, '.join(candidates)} Hz"
        raise ask("time", "rate", place, found, candidates)
    return step


def start_of(table: Table, first_s: float, path: Path, stated: Sequence[str] = ()) -> Moment | None:
    """Return the time stamp of time zero of a table, None if neither its times nor its lines state one.

    ``first_s`` is the time of the first row. If the file states no start, the lines ``stated`` of documents
    are used. The date of a time of day is searched there, too, and in the names of file and folder.
    """
    stamps = [moment.later(-first_s) for moment in table.stamps.values()]
    lines = start_in(table.said) or start_in(stated)
    moments = [each for each in (*stamps, table.start, lines) if each is not None]
    if not moments:
        is_unix_time = SETTINGS.unix_time_min_s < first_s < SETTINGS.unix_time_max_s
        return Moment(0.0, 0.0, is_utc=True) if is_unix_time else None
    moment = next((each for each in moments if each.has_date), moments[0])
    days = next(filter(None, map(date_in, (table.said, stated, [path.stem], [path.parent.name]))), None)
    if moment.has_date or days is None:
        return moment
    day_first_s, month_first_s = moment.day_first_s + DAY_S * days[0], moment.month_first_s + DAY_S * days[1]
    return Moment(day_first_s, month_first_s, is_utc=moment.is_utc)


def _rates_of(table: Table, others: Sequence[float] = ()) -> tuple[float, ...]:
    """Return the different sampling rates [Hz] of a table in words or numbers (``fs_Hz``), and ``others``."""
    single = {name: values[0] for name, values in table.columns.items() if len(values) == 1}
    stated = [f"{name.replace('_', ' ')}: {value:.12g}" for name, value in single.items()]
    return (*dict.fromkeys((*rates_in([*table.said, *stated]), *others)),)


def unit_by_rate(name: str, table: Table) -> str:
    """Return the time unit that agrees with the only stated sampling rate within 1 %, else ""."""
    rates = _rates_of(table) if table.step_s is None else (1.0 / table.step_s,)
    steps = np.diff(table.columns[name]) if len(rates) == 1 else np.empty(0)
    ticks = float(np.median(steps)) * rates[0] if len(steps) else 0.0
    return next((unit for unit, rate in _TICKS.items() if abs(ticks / rate - 1.0) < 0.01), "")


def unit_by_magnitude(times: FloatArray, step_max_s: float = _STEP_MAX_S) -> str:
    """Return the time unit of a count since 1970 (or days of Excel or MATLAB), "" for any other column.

    The time step must be possible in this unit, and in no other unit: on a rig, or up to ``step_max_s``.
    """
    counts = np.unique(times[np.isfinite(times)])
    step = float(np.median(np.diff(counts))) if len(counts) > 1 else 0.0
    fitting = (
        unit
        for unit, low, high, ticks in _EPOCHS
        if _STEP_MIN_S <= step / ticks <= step_max_s and low <= counts[0] and counts[-1] < high
    )
    return next(fitting, "")


def increases(table: Table, name: str, *, always: bool = False) -> bool:
    """Return True if a column increases at more than 95 % of the steps (at every step if ``always``)."""
    steps = np.diff(table.columns[name]) if name in table.columns else np.empty(0)
    share = float(np.mean(steps > 0.0)) if len(steps) else 0.0
    return share == 1.0 if always else share > 0.95
