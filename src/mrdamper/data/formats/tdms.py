"""TDMS (LabVIEW): channels in groups, with their units and clocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from mrdamper.data.formats.groups import StoredArray, attribute_lines, read_values, table_of_arrays, unit_in
from mrdamper.data.formats.table import FileOptions, Layout, Table, load_extra
from mrdamper.errors import InputError


def read_tdms(path: Path, options: FileOptions) -> Table:
    """Return the channels of a TDMS file, each with its start time and time step."""
    nptdms = load_extra("nptdms", "npTDMS", "TDMS files")
    with (
        path.open("rb") as stream,  # npTDMS would leave a damaged file open.
        nptdms.TdmsFile.open(stream) as file,
    ):
        groups = [group for group in file.groups() if options.part in {"", group.name}]
        channels = [channel for group in groups for channel in group.channels()]
        if not (options.part or any(map(len, channels))):
            found = "the TDMS file holds no sample: it is empty, or cut off"
            raise InputError(place=path.name, found=found, remedy="Copy it again, or record again")
        attributes = {group.name: {**file.properties, **group.properties} for group in groups}
        arrays = [
            _stored_array(channel, attributes[channel.group_name])
            for channel in channels
            if len(channel) and channel.dtype.kind in "fiubmM"
        ]
        notes = ("cut off while recording",) if file.file_status.incomplete_final_segment else ()
        table = table_of_arrays(arrays, path, Layout("TDMS file", part=options.part, notes=notes), {})
    names = {each.path[0] for each in arrays}
    title = table.title or (names.pop() if len(names) == 1 else "")
    return replace(table, title=title, said=attribute_lines(attributes.get(title, {})))


def _stored_array(channel: Any, outer: Mapping[str, object]) -> StoredArray:  # noqa: ANN401
    """Return a channel as an array. ``outer`` are the properties of file and group."""
    named = unit_in(channel.properties) or f"{channel.properties.get('NI_UnitDescription', '')}"
    return StoredArray(
        (channel.group_name, channel.name),
        len(channel),
        partial(read_values, channel),
        "s" if channel.dtype.kind in "mM" else named,
        {**outer, **channel.properties},
    )
