"""A channel that has its own time, and the tables that such channels make.

Channels of one name belong to recordings one after the other; each different time is a clock of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import MOST_WHOLE, Layout, Table
from mrdamper.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class Waveform:
    """One channel: samples over its own time."""

    name: str
    unit: str
    time: FloatArray  # [time_unit], shape (n,)
    time_unit: str
    values: FloatArray  # [unit], shape (n,)
    said: tuple[str, ...] = ()  # lines of the header that may name the run or its settings


def read_bytes(path: Path, what: str) -> bytes:
    """Return the content of a file that is read whole.

    Raises
    ------
    InputError
        More than 256 MB.
    """
    if path.stat().st_size > MOST_WHOLE:
        found = f"a {what} of more than {MOST_WHOLE >> 20} MB"
        raise InputError(place=path, found=found, remedy="Export the run as CSV")
    return path.read_bytes()


def tables_of(waveforms: Iterable[Waveform], layout: Layout) -> Table:
    """Return the table of one recording after the other; those after the first follow it."""
    recordings: list[list[Waveform]] = []
    seen: dict[str, int] = {}
    for waveform in waveforms:
        number = seen[waveform.name] = seen.get(waveform.name, -1) + 1
        if number == len(recordings):
            recordings.append([])
        recordings[number].append(waveform)
    first, *others = (_table(each, layout) for each in recordings)
    return replace(first, following=tuple(others))


def cut_off(path: Path, what: str) -> InputError:
    """Return the error of a file that ends too early."""
    return InputError(
        place=path, found=f"{what} was cut off", expected="a whole file", remedy="Copy it again"
    )


def _table(waveforms: Sequence[Waveform], layout: Layout) -> Table:
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    clocks: dict[str, int] = {}
    times: list[FloatArray] = []
    for waveform in waveforms:
        clock = next((k for k, time in enumerate(times) if np.array_equal(time, waveform.time)), len(times))
        if clock == len(times):
            times.append(waveform.time)
            name = "time" if not clock else f"time ({clock + 1})"
            columns[name], units[name], clocks[name] = waveform.time, waveform.time_unit, clock
        columns[waveform.name], clocks[waveform.name] = waveform.values, clock
        if waveform.unit:
            units[waveform.name] = waveform.unit
    return Table(
        names=tuple(columns),
        columns=columns,
        texts={},
        layout=layout,
        rows=max(map(len, columns.values())),
        units=units,
        clocks=clocks,
        said=tuple(dict.fromkeys(line for waveform in waveforms for line in waveform.said)),
    )
