"""TDMS (LabVIEW): channels in groups, with their units, read on use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import StoredArray, attribute_lines, table_of_arrays
from mrdamper.data.formats.table import (
    FileOptions,
    Layout,
    OnUse,
    Table,
    Texts,
    as_column,
    load_extra,
    shortest_names,
)
from mrdamper.errors import InputError

_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
_NUMBERS, _WORDS = "fiubmM", "OSU"  # values of NumPy's ``dtype.kind``


def read_tdms(path: Path, options: FileOptions) -> Table:
    """Return the channels of a TDMS file, each with its start time and time step."""
    with _opened(path) as file:
        every = [
            (_stored_array(path, channel, {**file.properties, **group.properties}), channel.dtype.kind)
            for group in file.groups()
            for channel in group.channels()
            if options.part in {"", group.name}
        ]
        attributes = {group.name: {**file.properties, **group.properties} for group in file.groups()}
        cut = bool(file.file_status.incomplete_final_segment)
    found = [pair for pair in every if pair[0].size]
    fault = "" if found or options.part else "holds no sample: it is empty, or cut off"
    if cut and (len(found) < len(every) or not every):
        empty = ", ".join([each.name for each, _ in every if not each.size][:5])
        fault = f"is cut off before the first sample of {empty or 'its first channel'}"
    if fault:
        remedy = "Copy it again, or record again"
        raise InputError(place=path.name, found=f"the TDMS file {fault}", remedy=remedy)
    arrays = [each for each, kind in found if kind in _NUMBERS]
    layout = Layout("TDMS file", part=options.part, notes=("cut off while recording",) if cut else ())
    table = table_of_arrays(arrays, path, layout, {})
    groups = {each.path[0] for each in arrays}
    title = table.title or (groups.pop() if len(groups) == 1 else "")
    inside = [(each, kind) for each, kind in found if title in {"", each.path[0]}]
    words = [each.path for each, kind in inside if kind in _WORDS]
    texts = dict(zip(shortest_names(words), words, strict=True))
    columns, names = iter(table.names), iter(texts)
    order = [next(names if kind in _WORDS else columns) for _, kind in inside if kind in _NUMBERS + _WORDS]
    return replace(
        table,
        names=(*order, *columns),
        texts=OnUse({name: partial(_words, path, *where) for name, where in texts.items()}),
        title=title,
        said=attribute_lines(attributes.get(title, {})),
    )


def _stored_array(path: Path, channel: Any, outer: Mapping[str, object]) -> StoredArray:  # noqa: ANN401
    """Return a channel as an array. ``outer`` are the properties of file and group."""
    named = next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), "")
    return StoredArray(
        (channel.group_name, channel.name),
        len(channel),
        partial(_numbers, path, channel.group_name, channel.name),
        "s" if channel.dtype.kind in "mM" else named,
        {**outer, **channel.properties},
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    nptdms = load_extra("nptdms", "npTDMS", "TDMS files")
    with (
        path.open("rb") as stream,  # npTDMS would leave a damaged file open.
        nptdms.TdmsFile.open(stream) as file,
    ):
        yield file


def _numbers(path: Path, group: str, channel: str) -> FloatArray:
    """Return the samples of a channel. Times are in seconds from the first time."""
    with _opened(path) as file:
        return as_column(np.asarray(file[group][channel][:]))[0]


def _words(path: Path, group: str, channel: str) -> Texts:
    with _opened(path) as file:
        return [None if cell is None else str(cell) for cell in file[group][channel][:]]
