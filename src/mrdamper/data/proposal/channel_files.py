"""Runs with one file per channel: file names in one folder that differ only in the channel word."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.clocks import sampling_step
from mrdamper.data.proposal.column import header_of
from mrdamper.data.proposal.documents import Document
from mrdamper.data.proposal.questions import Answer, with_answers
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import strip_channel
from mrdamper.errors import InputError
from mrdamper.quantities import to_si

_NEEDED = frozenset({"displacement", "force"})


def join_channel_files(
    files: Sequence[Path], chosen: ChannelMap, answers: Sequence[Answer], documents: Sequence[Document] = ()
) -> tuple[list[tuple[Path, RigFile]], set[Path]]:
    """Return the runs that are stored as one file per channel, and the files of these runs.

    The names of a run's files are equal except for the channel word, or a folder has only the files of one
    run.
    """
    groups: dict[tuple[Path, str], dict[str, tuple[Path, Table, str, FloatArray]]] = {}
    for path in files:
        with suppress(InputError, ValueError, IndexError):
            (table,) = read_tables(path, chosen.file)
            role, name, times = _channel_of(table, chosen, path)
            for key in ((path.parent, strip_channel(path.stem)), (path.parent, "")):
                group = groups.setdefault(key, {})
                again = "" if group.get(role, (path,))[0] == path else " again"
                group[f"{role}{again}"] = (path, table, name, times)
    joined: list[tuple[Path, RigFile]] = []
    members: set[Path] = set()
    for (folder, rest), group in groups.items():
        is_new = not members & {path for path, *_ in group.values()}
        if group.keys() >= _NEEDED and is_new and not any(role.endswith("again") for role in group):
            name = rest or folder.name
            place = folder / name
            table = _join_channels([(table, column, times) for _, table, column, times in group.values()])
            own = {path for path, *_ in group.values()}
            stated = {each: None for document in documents for path in own for each in document.places(path)}
            with suppress(InputError):
                chosen_now = with_answers(chosen, answers, place)
                joined.append((place, runs_in((table,), chosen_now, place, name=name, stated=[*stated])))
                members |= own
    return joined, members


def _channel_of(table: Table, chosen: ChannelMap, path: Path) -> tuple[str, str, FloatArray]:
    """Return role, name and times [s] of the only channel of a table.

    Raise ValueError if there is not exactly one channel, IndexError if its role is unknown, InputError if it
    has no times.
    """
    headers = [header_of(table, name, path.name) for name in table.columns]
    times = [each for each in headers if "time" in each.of_unit]
    (channel,) = [each for each in headers if each not in times] if len(headers) <= 2 else []
    if times:
        own = to_si(table.columns[times[0].name], times[0].unit, "time")
    else:
        own = np.arange(table.rows, dtype=np.float64) * sampling_step(table, chosen, path.name)
    return channel.of_unit[0], channel.name, own


def _join_channels(parts: Sequence[tuple[Table, str, FloatArray]]) -> Table:
    """Return one table of the channels; each channel keeps its time column."""
    first = parts[0][0]
    columns = {name: table.columns[name] for table, name, _ in parts}
    whole = replace(
        first,
        names=(*columns,),
        columns=columns,
        units={name: table.units[name] for table, name, _ in parts if name in table.units},
        said=tuple(dict.fromkeys(line for table, *_ in parts for line in table.said)),
        step_s=None,
        rows=max(map(len, columns.values())),
        layout=replace(first.layout, notes=(*first.layout.notes, f"{len(parts)} files of one channel each")),
    )
    return with_times(whole, {name: times for _, name, times in parts})
