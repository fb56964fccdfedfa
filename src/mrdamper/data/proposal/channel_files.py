"""Runs with one file per channel: file names in one folder that differ only in the channel word."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.table import Table, distinct_names
from mrdamper.data.proposal.clocks import sampling_step
from mrdamper.data.proposal.column import explained, header_of
from mrdamper.data.proposal.documents import Document
from mrdamper.data.proposal.questions import Answer, with_answers
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.proposal.roles import scaled_column
from mrdamper.data.proposal.side_by_side import is_counter
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import strip_channel
from mrdamper.data.words.labels import rates_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, to_si

_NEEDED = frozenset({"displacement", "force"})
_TOKEN = re.compile(r"[\W_]*(?:\d+|[^\W\d_]+)")  # A number or a word of a file name.


@dataclass(frozen=True, slots=True, eq=False)
class _ChannelFile:
    """A file with one channel."""

    path: Path
    role: str
    column: str
    table: Table
    times: FloatArray  # [s]


def join_channel_files(
    files: Sequence[Path], chosen: ChannelMap, answers: Sequence[Answer], documents: Sequence[Document] = ()
) -> tuple[list[tuple[Path, RigFile]], set[Path]]:
    """Return the runs that are stored as one file per channel, and the files of these runs.

    The names of a run's files are equal except for the name of the channel, or a folder has only the files of
    one run.
    """
    tables: dict[Path, Table] = {}
    for path in files:
        with suppress(InputError, ValueError):
            (tables[path],) = read_tables(path, chosen.file)
    folders: dict[Path, list[_ChannelFile]] = {}
    for path, table in tables.items():
        with suppress(InputError, ValueError, IndexError):
            # A short file of another channel states only its own sampling rate.
            notes = [line for each in documents if each.path not in tables for line in each.notes(path)]
            channel = _channel_of(explained(table, notes), chosen, path)
            folders.setdefault(path.parent, []).append(channel)
    joined: list[tuple[Path, RigFile]] = []
    members: set[Path] = set()
    for folder, channels in folders.items():
        for rest, group in _runs_of(channels).items():
            name = rest or folder.name
            place = folder / name
            own = [channel.path for channel in group]
            stated = {each: None for document in documents for path in own for each in document.places(path)}
            with suppress(InputError):
                chosen_now = with_answers(chosen, answers, place)
                run = runs_in((_join_channels(group),), chosen_now, place, name=name, stated=[*stated])
                joined.append((place, run))
                members |= {*own}
    return joined, members


def _runs_of(channels: Sequence[_ChannelFile]) -> dict[str, list[_ChannelFile]]:
    """Return the files of each run in a folder, by a common part of the file names.

    The common part is the name without the channel word, or the beginning or the end of the name. It is "" if
    all files belong to one run. The part that assigns most files to runs is chosen.
    """
    names = {channel.path: _TOKEN.findall(channel.path.stem) for channel in channels}
    counts = range(1, max(map(len, names.values())))
    ways = [{path: strip_channel(path.stem) for path in names}]
    ways += [{path: "".join(words[:k]) for path, words in names.items()} for k in counts]
    ways += [{path: "".join(words[-k:]).lstrip("_-. ") for path, words in names.items()} for k in counts]
    ways += [dict.fromkeys(names, "")]
    best: dict[str, list[_ChannelFile]] = {}
    for way in ways:
        groups: dict[str, list[_ChannelFile]] = {}
        for channel in channels:
            groups.setdefault(way[channel.path], []).append(channel)
        runs = {
            run: group for run, group in groups.items() if len({each.role for each in group}) == len(group)
        }
        runs = {run: group for run, group in runs.items() if {each.role for each in group} >= _NEEDED}
        if sum(map(len, runs.values())) > sum(map(len, best.values())):
            best = runs
    return best


def _channel_of(table: Table, chosen: ChannelMap, path: Path) -> _ChannelFile:
    """Return the only channel of a table. Columns of times and of sample numbers are no channels.

    Raise ValueError if there is not exactly one channel, IndexError if its role is unknown, InputError if it
    has no times.
    """
    headers = [header_of(table, name) for name in table.columns]
    times = [each for each in headers if "time" in each.of_unit]
    (channel,) = [each for each in headers if each not in times and not is_counter(table.columns[each.name])]
    if times:
        own = to_si(table.columns[times[0].name], times[0].unit, "time")
    else:
        own = np.arange(table.rows, dtype=np.float64) * sampling_step(table, chosen, path.name)
    scaled = [role for role in QUANTITIES if scaled_column(role, table, headers) is not None]
    return _ChannelFile(path, (scaled or channel.of_unit)[0], channel.name, table, own)


def _join_channels(parts: Sequence[_ChannelFile]) -> Table:
    """Return one table of the channels; each channel keeps its time column."""
    first = parts[0].table
    named = dict(zip(distinct_names([part.column for part in parts]), parts, strict=True))
    whole = replace(
        first,
        names=(*named,),
        columns={name: part.table.columns[part.column] for name, part in named.items()},
        units={name: part.table.units.get(part.column, "") for name, part in named.items()},
        # The times of each channel are known, and the files may state different rates.
        said=tuple(dict.fromkeys(line for each in parts for line in each.table.said if not rates_in([line]))),
        step_s=None,
        rows=max(part.table.rows for part in parts),
        layout=replace(first.layout, notes=(*first.layout.notes, f"{len(parts)} files of one channel each")),
    )
    return with_times(whole, {name: part.times for name, part in named.items()})
