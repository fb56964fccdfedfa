"""Runs that stand side by side in one table, each with a time of its own: ``t, x, F, t, x, F, ...``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import LEAST_ROWS, Table
from mrdamper.data.words.headers import word_and_unit
from mrdamper.quantities import roles_of_unit

_COUNTED = re.compile(r" \(\d+\)$")  # a name that readers counted, for it stands in the table before
_FEWEST = 3  # columns of a run


def side_by_side(table: Table, chosen: ChannelMap) -> tuple[Table, ...]:
    """Return a table for each run; the table itself where it is that of one.

    The names repeat, numbers behind them left out, and among each run's there is one time. What stands above
    its names (``0.5 A: F [N]``) is its title, behind the table's. Empty columns between runs go. A map
    must name columns as they repeat.
    """
    if table.texts or table.clocks or table.stamps:
        return (table,)
    filled = [name for name in table.names if _split(name)[1] or np.isfinite(table.columns[name]).any()]
    split = [_split(name) for name in filled]
    above, names = [title for title, _ in split], [name for _, name in split]
    width = _width(names)
    wanted = [channel.name for channel in chosen.channels.values()]
    if width is None or any(name not in names[:width] for name in wanted):
        return (table,)
    runs = []
    for first in range(0, len(names), width):
        own = filled[first : first + width]
        columns = {name: table.columns[old] for name, old in zip(names[:width], own, strict=True)}
        known = np.flatnonzero(np.any([np.isfinite(values) for values in columns.values()], axis=0))
        rows = int(known[-1]) + 1 if len(known) else 0
        if rows < LEAST_ROWS:
            return (table,)
        runs.append(
            replace(
                table,
                names=(*columns,),
                columns={name: values[:rows] for name, values in columns.items()},
                rows=rows,
                title=" ".join(dict.fromkeys(filter(None, [table.title, *above[first : first + width]]))),
                layout=replace(table.layout, notes=(*table.layout.notes, "runs side by side")),
            )
        )
    return tuple(runs)


def _split(name: str) -> tuple[str, str]:
    """Return what stands above a column's name, and the name without a reader's number."""
    above, colon, own = name.rpartition(": ")
    return above if colon else "", _COUNTED.sub("", own)


def _width(names: Sequence[str]) -> int | None:
    """Return how many columns a run has; None where there is one run."""
    for width in range(_FEWEST, len(names) // 2 + 1):
        if len(names) % width or any(name != names[k % width] for k, name in enumerate(names)):
            continue
        times = [name for name in names[:width] if "time" in roles_of_unit(word_and_unit(name)[1])]
        return width if len(times) == 1 and len(set(names[:width])) == width else None
    return None
