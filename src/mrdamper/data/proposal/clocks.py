"""Time of a table: its clocks, its sampling rate, and whether both agree with the unit of its column."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.column import Column
from mrdamper.data.proposal.questions import ask
from mrdamper.data.proposal.refusals import listed, perhaps, require_no_text
from mrdamper.data.words.headers import word_and_unit
from mrdamper.data.words.labels import rates_in
from mrdamper.quantities import roles_of_unit, to_si

_EQUAL = 0.01  # share by which a sampling rate and a time step may differ
_TICKS = (1.0, 1e3, 1e6)  # of a second: what a time column without a unit may count
_TICK_UNITS = ("s", "ms", "us")


def clock_time(table: Table, clock: int) -> str:
    """Return the name of a clock's own time: the first column that has it."""
    return next(name for name, other in table.clocks.items() if other == clock)


def with_clocks(table: Table) -> Table:
    """Return a text's table with each column on its clock: behind a time of its own, and as long as that."""
    times = [name for name in table.names if "time" in roles_of_unit(word_and_unit(name)[1])]
    if len(times) < 2 or table.names[0] != times[0] or table.clocks or table.texts:
        return table
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


def sampling_step(table: Table, chosen: ChannelMap, place: str) -> float:
    """Return the sampling interval [s] of a file without a time column, as the map or the file states it."""
    step = table.step_s if chosen.rate_Hz is None else 1.0 / chosen.rate_Hz
    rates = (_rates_of(table) or rates_in([Path(place).stem.replace("_", " ")])) if step is None else ()
    if step is None and len(rates) == 1:
        step = 1.0 / rates[0]
    if step is None:
        require_no_text("time", table, place)
        raise ask(
            "time",
            "rate",
            place,
            found=f"no time column; the columns are: {listed(table.names)}",
            expected=(
                "a header such as time_s, [channel.time] in a channel map (--channels FILE), or rate_Hz at "
                f"its [constant]{perhaps(['time'], table)}"
            ),
            candidates=[f"{rate:g}" for rate in rates],
        )
    return step


def _rates_of(table: Table) -> tuple[float, ...]:
    """Return the sampling rates [Hz] that a table states, in words or as one number (``fs_Hz``)."""
    names = [name for name in table.columns if rates_in([f"{name.replace('_', ' ')}: 1"])]
    single = [(name, table.columns[name]) for name in names]
    stated = [f"{name.replace('_', ' ')}: {values[0]:.12g}" for name, values in single if len(values) == 1]
    return rates_in([*table.said, *stated])


def unit_by_rate(name: str, table: Table) -> str:
    """Return the unit of a time column that a sampling rate above the table proves; "" without one."""
    ticks = _ticks_per_second(name, table)
    return next((u for u, n in zip(_TICK_UNITS, _TICKS, strict=True) if ticks and _is_near(ticks, n)), "")


def require_one_rate(column: Column, table: Table, place: str) -> None:
    """Refuse a time whose unit and whose file's sampling rate differ by a power of a thousand."""
    if not table.said:
        return
    ticks = _ticks_per_second(column.name, table)
    if ticks is None or ticks <= 0.0:
        return
    wrong = ticks * float(to_si(1.0, column.unit, "time"))
    if any(_is_near(wrong, factor) for factor in (1e3, 1e-3, 1e6, 1e-6)):
        raise ask(
            "time",
            "unit",
            place,
            found=f"column {column.name!r} is in {column.unit}, and a sampling rate above it says otherwise",
            expected="one and the same",
            remedy="Give unit at [channel.time], or rate_Hz at [constant] of the channel map",
            candidates=_TICK_UNITS,
        )


def _ticks_per_second(name: str, table: Table) -> float | None:
    """Return how many of a time column's units are a second, by the one rate that the file states."""
    rates = _rates_of(table) if table.step_s is None else (1.0 / table.step_s,)
    steps = np.diff(table.columns[name]) if len(rates) == 1 else np.empty(0)
    return float(np.median(steps)) * rates[0] if len(steps) else None


def increases(table: Table, name: str, *, always: bool = False) -> bool:
    """Tell whether a column grows from nearly every sample to the next, as a time does, or from each."""
    steps = np.diff(table.columns[name])
    share = float(np.mean(steps > 0.0)) if len(steps) else 0.0
    return share == 1.0 if always else share > 0.95


def _is_near(value: float, wanted: float) -> bool:
    return abs(value / wanted - 1.0) < _EQUAL
