"""MDF (ASAM, versions 3 and 4): channels in groups, each group with its own clock.

Samples that the file marks as invalid are NaN. A file that scales a channel by a formula is rejected, because
asammdf would run the formula as code.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import StoredArray, table_of_arrays
from mrdamper.data.formats.table import (
    FileOptions,
    Layout,
    Table,
    as_column,
    distinct_names,
    load_extra,
    require_held,
)
from mrdamper.data.formats.timestamps import moment_of
from mrdamper.errors import InputError


def read_mdf(path: Path, options: FileOptions) -> Table:
    """Return the channels of an MDF file."""
    asammdf = load_extra("asammdf", "asammdf", "MDF files")
    for kind in (asammdf.blocks.mdf_v3.MDF3, asammdf.blocks.mdf_v4.MDF4):
        kind.__del__ = _close  # The original prints a traceback for a file that could not be opened.
    with (
        path.open("rb") as stream,  # asammdf would unpack archives next to a file that it opens by name.
        asammdf.MDF(stream, process_bus_logging=False) as file,
    ):
        _require_no_formula(file, path)
        table = table_of_arrays(_arrays(file, path), path, Layout("MDF file", part=options.part), {})
        start = moment_of(file.header.start_time.isoformat())
    clocks = table.clocks or dict.fromkeys(table.names, 0)
    return replace(table, clocks=clocks, recorded_apart=False, start=start)


def _close(file: Any) -> None:  # noqa: ANN401 - asammdf's file
    with suppress(Exception):
        file.close()


def _require_no_formula(file: Any, path: Path) -> None:  # noqa: ANN401 - asammdf's file
    for channel in (channel for group in file.groups for channel in group.channels):
        if said := _formula(channel.conversion):
            found = f"channel {str(channel.name)!r} is scaled by the formula {said[:60]!r}"
            remedy = "Formulas are not run: export the run with its values scaled"
            raise InputError(place=path, found=found, remedy=remedy)


def _formula(conversion: Any) -> str:  # noqa: ANN401 - asammdf's conversion
    """Return the formula in a conversion or in a conversion to which it refers."""
    own = str(getattr(conversion, "formula", "") or "")
    others = getattr(conversion, "referenced_blocks", None) or {}
    return own or next((said for each in others.values() if (said := _formula(each))), "")


def _arrays(file: Any, path: Path) -> Iterator[StoredArray]:  # noqa: ANN401 - asammdf's file
    """Generate the times and the channels of each group with samples."""
    named = [str(getattr(group.channel_group, "acq_name", "") or "") for group in file.groups]
    titles = distinct_names([name or f"group {g + 1}" for g, name in enumerate(named)])
    for g, (title, group) in enumerate(zip(titles, file.groups, strict=True)):
        samples = int(group.channel_group.cycles_nr)
        if samples < 1:
            continue
        require_held(samples, int(group.channel_group.samples_byte_nr), path, title)
        yield StoredArray((title, "time"), samples, partial(_samples, file, g, None), "s", is_clock=True)
        for k, channel in enumerate(group.channels):
            if k != file.masters_db.get(g):
                unit = str(file.get_channel_unit(group=g, index=k) or "")
                yield StoredArray((title, str(channel.name)), samples, partial(_samples, file, g, k), unit)


def _samples(file: Any, group: int, channel: int | None) -> FloatArray:  # noqa: ANN401 - asammdf's file
    """Return the samples of a channel (None: the times), NaN if invalid or not a number."""
    if channel is None:
        return as_column(np.asarray(file.get_master(group)))[0]
    every = {"samples_only": True, "ignore_invalidation_bits": True}  # Invalid samples are kept.
    read, invalid = file.get(group=group, index=channel, **every)
    if read.dtype.kind not in "fiubmM":
        return np.full(len(read), np.nan)
    values = as_column(read)[0]
    if invalid is not None:
        values[np.asarray(invalid, dtype=bool)] = np.nan
    return values
