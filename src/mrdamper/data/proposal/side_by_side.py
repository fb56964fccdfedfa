"""Runs in adjacent columns of one table, each with its own time: ``t, x, F, t, x, F, ...``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.groups import attribute_lines
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Table, Texts
from mrdamper.data.proposal.clocks import unit_by_magnitude
from mrdamper.data.words.headers import means, word_and_unit
from mrdamper.data.words.labels import labels_in
from mrdamper.quantities import QUANTITIES, is_any_unit, roles_of_unit, to_si

_RUN_NUMBER = re.compile(
    r"\W*(?:id|(?:run|test|specimen|trial|experiment|versuch|messung|essai|prueba)\W*(?:no|nr|num|number|id|index)?)\W*",
    re.IGNORECASE,
)
_VALUE = re.compile(r"values?|val|wert|valeur|valor|reading|measurement", re.IGNORECASE)
_UNNAMED = re.compile(r"(column \d+)?")  # name that a reader gives to a column without a name
_COUNTED = re.compile(r" \(\d+\)$")  # number that a reader appends to a repeated name


def side_by_side(table: Table, chosen: ChannelMap) -> tuple[Table, ...]:
    """Return a table for each run, or only the given table if it contains a single run.

    A table contains several runs if the names of its columns repeat, apart from numbers appended by the
    reader, and if each repetition has one time column. The first column may be the time of all runs if
    a current is stated above each other column. The title of a run is the title of the table and the
    text above the names (``0.5 A: F [N]``). Empty columns between runs are removed. The table is not divided
    if a channel map names a column that is not among the repeated names.
    """
    if table.texts or table.clocks or table.stamps:
        return (table,)
    numeric = {name for name, values in table.columns.items() if np.isfinite(values).any()}
    filled = [name for name in table.names if name in numeric or not _UNNAMED.fullmatch(_split_name(name)[1])]
    split = [_split_name(name) for name in filled]
    above, names = [title for title, _ in split], [name for _, name in split]
    width, time = _width(names), filled[:0]
    has_currents = all(len(labels_in(text, "current")) == 1 for text in above[1:])
    if width is None and above[:1] == [""] and has_currents:
        width, time, names = _width(names[1:], common=1), filled[:1], names[1:]
    wanted = [channel.name for channel in chosen.channels.values()]
    if width is None or any(name not in [*time, *names[:width]] for name in wanted):
        return (table,)
    runs = []
    layout = replace(table.layout, notes=(*table.layout.notes, "runs side by side"))
    for first in range(len(time), len(filled), width):
        own = dict(zip(names[:width], filled[first : first + width], strict=True))
        known = np.flatnonzero(np.any([np.isfinite(table.columns[old]) for old in own.values()], axis=0))
        rows = int(known[-1]) + 1 if len(known) else 0
        if rows < SETTINGS.table_rows_min:
            return (table,)
        own = {name: name for name in time} | own
        columns = {name: table.columns[old][:rows] for name, old in own.items()}
        title = " ".join(dict.fromkeys(filter(None, [table.title, *above[first : first + width]])))
        runs.append(replace(table, names=(*own,), columns=columns, rows=rows, title=title, layout=layout))
    return tuple(runs)


def one_force_each(table: Table, chosen: ChannelMap) -> tuple[Table, ...]:
    """Return a table for each force column if the names of the force columns state different currents.

    The title of a run is the old name of its force column. A channel map may name the column ``force [N]``.
    """
    units = {name: word_and_unit(name)[1] for name in table.columns}
    forces = {name: f"force [{unit}]" for name, unit in units.items() if "force" in roles_of_unit(unit)}
    currents = [labels_in(name, "current") for name in forces]
    is_wide = len({*currents}) == len(forces) > 1 and all(len(values) == 1 for values in currents)
    if not is_wide or chosen.channel("force").name not in {None, *forces.values()}:
        return (table,)
    runs = []
    layout = replace(table.layout, notes=(*table.layout.notes, "one column of force for each current"))
    for name, new in forces.items():
        names = {each: each for each in table.names if each not in forces} | {name: new}
        columns = {names[each]: values for each, values in table.columns.items() if each in names}
        runs.append(replace(table, names=(*names.values(),), columns=columns, title=name, layout=layout))
    return tuple(runs)


def wide_of_long(table: Table) -> tuple[Table, ...]:
    """Convert a table with one row per sample and channel to tables with one column per channel.

    In the given table, a column of texts names the channel of each row (at least two roles). One column has
    the values, another column has the times. A further column, such as the run number, may be constant within
    each channel of a run. Each value of this column becomes a separate table. Counters of rows, and numbers
    of single channels, are ignored.
    """
    kinds = {name: dict.fromkeys(cells) for name, cells in table.texts.items() if all(cells)}
    named = [
        name
        for name, kind in kinds.items()
        if 2 <= len(kind) <= SETTINGS.table_columns_max
        and len({role for role in QUANTITIES if any(means(name or "", role) for name in kind)}) > 1
    ]
    of_units = [name for name in named if named[1:] and all(is_any_unit(f"{each}") for each in kinds[name])]
    named = [name for name in named if name not in of_units] or named
    of_time = {name for name in table.columns if "time" in roles_of_unit(word_and_unit(name)[1])}
    varying = [name for name, values in table.columns.items() if len({*values[np.isfinite(values)]}) > 1]
    times = [name for name in varying if means(name, "time") or name in {*of_time, *table.stamps}]
    if len(named) != 1 or len(times) != 1:
        return (table,)
    channels = np.array(table.texts[named[0]])
    numbers = [name for name in varying if name not in times and not is_counter(table.columns[name])]
    values = [name for name in numbers if _VALUE.fullmatch(name.strip("_ "))] or numbers
    unit = word_and_unit(times[0])[1] or table.units.get(times[0], "")
    unit = unit or unit_by_magnitude(table.columns[times[0]])
    if len(values) != 1 or "time" not in roles_of_unit(unit):
        return (table,)
    in_units = (table.texts[name] for name in table.texts if name in of_units or "unit" in name.lower())
    units = next(in_units, None)
    words = [name for name in kinds if name not in named and table.texts[name] is not units]
    numbers = [name for name in numbers if name not in values]
    keys = [[attribute_lines({name: f"{value:g}"})[0] for value in table.columns[name]] for name in numbers]
    keys += [[f"{cell}" for cell in table.texts[name]] for name in words if len(kinds[name]) > 1]
    keys = [key for key in keys if len({*zip(key, channels, strict=True)}) > len({*key})]
    titles = np.array([" ".join(key) for key in zip(*keys, strict=True)] or [table.title] * table.rows)
    seconds = to_si(table.columns[times[0]], unit, "time")
    runs = []
    for title in dict.fromkeys(titles.tolist()):
        rows = {f"{name}": (channels == name) & (titles == title) for name in kinds[named[0]]}
        rows = {name: there for name, there in rows.items() if there.any()}
        columns = {name: table.columns[values[0]][there] for name, there in rows.items()}
        stated = {name: units[int(np.argmax(there))] or "" for name, there in rows.items()} if units else {}
        size = max(map(len, columns.values()))
        is_mixed = any((np.diff(seconds[there]) < 0.0).any() for there in rows.values())
        if size < SETTINGS.table_rows_min or is_mixed:
            return (table,)
        plain = replace(
            table, names=(*columns,), columns=columns, texts={}, stamps={}, units=stated, rows=size
        )
        plain = replace(plain, title=title, start=table.stamps.get(times[0], table.start))
        runs.append(with_times(plain, {name: seconds[there] for name, there in rows.items()}))
    return tuple(runs)


def with_run_numbers(table: Table) -> Table:
    """Return the table with the numbers of runs, such as a column ``Run No.``, as texts."""
    numbered: dict[str, Texts] = {
        name: [f"{value:.0f}" for value in values]
        for name, values in table.columns.items()
        if _RUN_NUMBER.fullmatch(name.replace("_", " ")) and len(values) == table.rows
        if np.all(values == np.round(values)) and not is_counter(values)
    }
    columns = {name: values for name, values in table.columns.items() if name not in numbered}
    return replace(table, columns=columns, texts={**table.texts, **numbered})


def is_counter(values: FloatArray) -> bool:
    """Return True if a column counts the rows."""
    return len(values) > 1 and bool(np.all(np.diff(values) == 1.0))


def _split_name(name: str) -> tuple[str, str]:
    """Split a header such as ``0.5 A: force (2)`` into ``0.5 A`` and ``force``."""
    above, colon, own = name.rpartition(": ")
    return above if colon else "", _COUNTED.sub("", own)


def _width(names: Sequence[str], common: int = 0) -> int | None:
    """Return the number of columns of each run (without ``common`` columns of all runs), None for one run."""
    for width in range(3 - common, len(names) // 2 + 1):  # A run has at least three columns.
        if len(names) % width or any(name != names[k % width] for k, name in enumerate(names)):
            continue
        times = [name for name in names[:width] if "time" in roles_of_unit(word_and_unit(name)[1])]
        return width if len(times) + common == 1 and len(set(names[:width])) == width else None
    return None
