"""TDMS (LabVIEW): channels in groups, with their units, read on use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
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


def read_tdms(path: Path, options: FileOptions) -> Table:
    """Return the channels of a TDMS file, each with its start time and time step."""
    with _opened(path) as file:
        every = [
            _Channel(group.name, channel.name, len(channel), channel.dtype.kind, dict(channel.properties))
            for group in file.groups()
            for channel in group.channels()
            if options.part in {"", group.name}
        ]
        attributes = {group.name: {**file.properties, **group.properties} for group in file.groups()}
        cut = bool(file.file_status.incomplete_final_segment)
    found = [each for each in every if each.size]
    if cut and (len(found) < len(every) or not every):
        empty = ", ".join([each.name for each in every if not each.size][:5])
        raise InputError(
            place=path.name,
            found=f"the TDMS file is cut off before the first sample of {empty or 'its first channel'}",
            remedy="Copy it again, or record again",
        )
    if not found and not options.part:
        raise InputError(
            place=path.name,
            found="the TDMS file holds no sample: it is empty, or cut off",
            remedy="Copy it again, or record again",
        )
    numbers = [each for each in found if each.kind in "fiubmM"]
    layout = Layout("TDMS file", part=options.part, notes=("cut off while recording",) if cut else ())
    arrays = [
        StoredArray(
            (each.group, each.name),
            each.size,
            partial(_numbers, path, each.group, each.name),
            _unit(each.kind, each.properties),
            {**attributes[each.group], **each.properties},
        )
        for each in numbers
    ]
    table = table_of_arrays(arrays, path, layout, {})
    groups = {each.group for each in numbers}
    title = table.title or (groups.pop() if len(groups) == 1 else "")
    inside = [each for each in found if title in {"", each.group}]
    words = [each for each in inside if each.kind in "OSU"]
    texts = dict(zip(shortest_names([(each.group, each.name) for each in words]), words, strict=True))
    columns, names = iter(table.names), iter(texts)
    order = [next(names if each.kind in "OSU" else columns) for each in inside if each in numbers + words]
    return replace(
        table,
        names=(*order, *columns),
        texts=OnUse({name: partial(_words, path, each.group, each.name) for name, each in texts.items()}),
        title=title,
        said=attribute_lines(attributes.get(title, {})),
    )


@dataclass(frozen=True, slots=True)
class _Channel:
    """A channel of a TDMS file without its samples."""

    group: str
    name: str
    size: int
    kind: str  # The dtype kind of its numbers in NumPy.
    properties: Mapping[str, object]


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with npTDMS."""
    nptdms = load_extra("nptdms", "npTDMS", "TDMS files")
    with (
        path.open("rb") as stream,  # npTDMS leaves it open if the file is damaged.
        nptdms.TdmsFile.open(stream) as file,
    ):
        yield file


def _numbers(path: Path, group: str, channel: str) -> FloatArray:
    """Return the samples of a channel. Times are in seconds from the first."""
    with _opened(path) as file:
        return as_column(np.asarray(file[group][channel][:]))[0]


def _words(path: Path, group: str, channel: str) -> Texts:
    with _opened(path) as file:
        return [None if cell is None else str(cell) for cell in file[group][channel][:]]


def _unit(kind: str, properties: Mapping[str, object]) -> str:
    if kind in "mM":
        return "s"
    return next((str(properties[key]) for key in _UNITS if properties.get(key)), "")
