"""Clocks of channels: the start and the time step of each channel.

TDMS states ``wf_start_time``, ``wf_start_offset`` and ``wf_increment``. LabVIEW text states ``Date``,
``Time``, ``X0`` and ``Delta_X``. HDF5 files and structures have attributes such as ``dt``, ``fs`` and ``t0``.
If all channels have the same start and step, the table stores the step as ``step_s``. Otherwise the table
gets a column of times for each different clock.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Moment, Table, as_text
from mrdamper.data.formats.timestamps import moment_of

LABVIEW_EPOCH_s = -2082844800.0  # 1904-01-01, which LabVIEW writes if the start is not known

_STEP = re.compile(
    r"(wf ?|x ?|time ?)?incr(ement)?|(sampling )?d[tx]|ts|delta ?[tx]|((sampl\w*|scan|time) ?)?interval"
    r"|(sampl\w*|scan|time) ?(period|step|time)|abtast(zeit|intervall|schritt)"
    r"|[xht] ?(step|resolution|interval)"
)
_RATE = re.compile(
    r"fs|f s|rate|(sampl\w*|scan|acqui\w*|data|daq) ?(rate|freq\w*)|(abtast|mess)(rate|frequenz)"
)
_START = re.compile(
    r"(wf )?(start|begin)( ?time)?|[tx] ?0|(t|x|time) start|(trigger|first( sample)?) time|timestamp"
)
_OFFSET = re.compile(r"(wf start|start|time|t) offset")
_UNITS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "hz": 1.0, "khz": 1e3}
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[ed][-+]?\d+)?)\s*([a-zµ]*)\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Sampling:
    """Start and time step of a channel.

    ``began`` is None if the file states no start. The first sample is taken ``offset_s`` after ``began``.
    """

    step_s: float
    offset_s: float = 0.0
    began: Moment | None = None
    has_unit: bool = True  # False: the file states no unit, and seconds or hertz are assumed

    @property
    def is_plausible(self) -> bool:
        """Return True if the step has a unit in the file, or is between 1 us and 20 ms."""
        return self.has_unit or 1e-6 <= self.step_s <= 0.02


def is_setting_of_time(name: str) -> bool:
    """Return True if an attribute name means a start time, a time step or a sampling rate."""
    words, _ = _words(name)
    return any(form.fullmatch(words) for form in (_STEP, _RATE, _START, _OFFSET))


def stated_sampling(settings: Mapping[str, object]) -> Sampling | None:
    """Return the start and time step that attributes state, None if they state neither a step nor a rate.

    A later attribute overrides an earlier attribute because the attributes of a channel follow the attributes
    of its groups. The unit of a time axis (s or ms) does not apply to a sampling rate.
    """
    step, has_unit, offset, began = math.nan, True, 0.0, None
    for name, value in settings.items():
        words, unit = _words(name)
        unit = unit or f"{settings.get(f'{name}_unit', settings.get(f'{name}_units', ''))}".lower()
        if _STEP.fullmatch(words) or _RATE.fullmatch(words):
            number, scale = _number(value, unit)
            if number > 0.0:
                factor = scale or 1.0
                is_rate = _RATE.fullmatch(words)  # Its factor is 1 (Hz) or 1e3 (kHz).
                step = 1.0 / (number * max(factor, 1.0)) if is_rate else number * factor
                has_unit = scale is not None or words.startswith("wf ")
        elif _OFFSET.fullmatch(words):
            number, scale = _number(value, unit)
            offset = number * (scale or 1.0) if math.isfinite(number) else offset
        elif _START.fullmatch(words):
            began = _moment(value, unit)
    if not math.isfinite(step):
        return None
    return Sampling(step, offset, began, has_unit)


def with_samplings(table: Table, stated: Mapping[str, Sampling | None]) -> Table:
    """Return a table with the clocks of its columns: one step for all, or a column of times for each clock.

    ``stated`` has the sampling that the file states for a column. A column of one number has no clock.
    """
    channels = {name: len(values) for name, values in table.columns.items() if len(values) > 1}
    known = {name: each for name in channels if (each := stated.get(name)) is not None}
    if not known or not min(known.values(), key=lambda each: each.step_s).is_plausible:
        return table
    begun = [each.began.later(each.offset_s) for each in known.values() if each.began is not None]
    start = min((each for each in begun if each.has_date), key=lambda each: each.day_first_s, default=None)
    # If the file states at most one start, all channels begin together. If it states several starts, the
    # channels without a start are omitted.
    begins = {name: each.began.day_first_s for name, each in known.items() if each.began is not None}
    if len({*begins.values()}) > 1:
        known = {name: known[name] for name in begins}
    else:
        begins = dict.fromkeys(known, 0.0)
    starts = {name: begins[name] + each.offset_s for name, each in known.items()}
    zero, rows = min(starts.values()), np.arange(max(channels.values()), dtype=np.float64)
    times = {name: starts[name] - zero + known[name].step_s * rows[: channels[name]] for name in known}
    clocked = with_times(replace(table, start=start), times)
    clocks = dict(clocked.clocks)
    # A channel without a stated clock uses the only clock that has as many samples.
    for name in channels.keys() - known.keys():
        fitting = {clocked.clocks[other] for other in known if channels[other] == channels[name]}
        if len(fitting) == 1:
            clocks[name] = fitting.pop()
    if len({*clocks.values()}) == 1 and clocks.keys() >= channels.keys():
        return replace(table, start=start, step_s=next(iter(known.values())).step_s)
    return replace(clocked, clocks=clocks)


def with_times(
    table: Table, times: Mapping[str, FloatArray], titles: Mapping[str, str] | None = None
) -> Table:
    """Return a table with an additional time column for each different clock.

    ``titles`` has the name of the clock of each column. Without titles, the clocks are numbered.
    """
    clocks: dict[str, FloatArray] = {}
    clock_of: dict[str, str] = {}
    for name, values in times.items():
        step_s = np.ptp(values) / (len(values) - 1) if len(values) > 1 else 0.0
        tolerance_s = SETTINGS.clock_tolerance_steps * step_s
        equal = (clock for clock, other in clocks.items() if len(other) == len(values))
        same = (clock for clock in equal if (np.abs(clocks[clock] - values) <= tolerance_s).all())
        clock_of[name] = next(same, titles[name] if titles else f"clock {len(clocks) + 1}")
        clocks.setdefault(clock_of[name], values)
    if len(clocks) == 1 and not titles and "time" not in table.names:
        clocks, clock_of = {"time": clocks["clock 1"]}, dict.fromkeys(clock_of, "time")
    numbers = {clock: number for number, clock in enumerate(clocks)}
    names, units = (*table.names, *clocks), {**dict.fromkeys(clocks, "s"), **table.units}
    return replace(
        table,
        names=names,
        columns={**table.columns, **clocks},
        units={name: units[name] for name in names if name in units},
        clocks=numbers | {name: numbers[clock] for name, clock in clock_of.items()},
        recorded_apart=True,
    )


def _words(name: str) -> tuple[str, str]:
    """Return the words of an attribute's name in lower case, and the unit at its end."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = re.sub(r"[^a-zµ0-9]+", " ", apart.lower()).split()
    unit = words.pop() if len(words) > 1 and words[-1] in _UNITS else ""
    return " ".join(words), unit


def _number(value: object, unit: str) -> tuple[float, float | None]:
    """Return the number in a value (or NaN), and the factor of its unit to s or Hz (None: no unit)."""
    match = _NUMBER.fullmatch(f"{as_text(value)}")
    if match is None:
        return math.nan, None
    return float(re.sub("[dD]", "e", match[1])), _UNITS.get(match[2].lower() or unit)


def _moment(value: object, unit: str) -> Moment | None:
    """Return the moment that a value states as a date with time of day or as a number, else None."""
    number, scale = _number(value, unit)
    if math.isfinite(number):
        seconds = number * (scale or 1.0)
        return Moment(seconds, seconds, has_date=seconds > SETTINGS.unix_time_min_s, is_utc=True)
    moment = moment_of(f"{as_text(value)}")
    if moment is None or moment.day_first_s == LABVIEW_EPOCH_s:
        return None
    # npTDMS gives times as datetime64 in UTC.
    return replace(moment, is_utc=moment.is_utc or isinstance(value, np.datetime64))
