"""Readers: from a rig's files to runs in SI and kelvin.

The file's table (``tables``) and the channel map (``channels``) meet here. Nothing is guessed: what the
file or the map does not say is asked for.
"""

from __future__ import annotations

import errno
import glob
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import (
    Channel,
    ChannelMap,
    candidates,
    names_by_symbol,
    parse_header,
    read_channel_map,
    unit_in_brackets,
)
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.data.tables import FORMATS, Layout, Table, read_table
from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX, is_file, is_folder, is_there, printable
from mrdamper.quantities import QUANTITIES, CommandUnit, is_unit, spell_unit

__all__ = [
    "COMMAND_UNITS",
    "Column",
    "RigFile",
    "command_role",
    "find_columns",
    "find_files",
    "joined_faults",
    "load_map",
    "map_beside",
    "read_file",
    "read_run",
    "read_runs",
    "runs_in",
    "sampling_step",
]

PathLike = str | Path

_NEEDED = ("displacement", "force")
COMMAND_UNITS: dict[str, CommandUnit] = dict(zip(("current", "voltage"), get_args(CommandUnit), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class _Command:
    values: FloatArray  # one per sample [A or V]
    unit: CommandUnit


@dataclass(frozen=True, slots=True, eq=False)
class _Channels:
    """The channels that a file's columns hold, by role [SI]."""

    displacement: FloatArray
    force: FloatArray
    time: FloatArray | None = None
    velocity: FloatArray | None = None
    temperature: FloatArray | None = None
    current: FloatArray | None = None
    voltage: FloatArray | None = None

    def command(self, role: str) -> FloatArray | None:
        return self.current if role == "current" else self.voltage


@dataclass(frozen=True, slots=True)
class Column:
    """Which column of a file was taken for a role, and its unit as the file or the map spells it."""

    role: str
    name: str
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class RigFile:
    """What one file holds, and how it was understood."""

    recordings: tuple[Recording, ...]
    layout: Layout
    columns: tuple[Column, ...]


def read_run(path: PathLike, channels: ChannelMap | PathLike | None = None) -> tuple[RigRun, ...]:
    """Return the runs in one file; a logger's file holds several.

    A run is named as its file (and its command, where a file holds several). The command is a channel
    of current or voltage, or else a ``[constant]`` or the ``[segments]`` of the channel map.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or a run has faults.
    """
    return tuple(recording.checked() for recording in read_file(path, channels).recordings)


def read_file(path: PathLike, channels: ChannelMap | PathLike | None = None) -> RigFile:
    """Return the recordings in one file as they stand, and how the file was understood.

    Without ``channels`` the map that lies beside the file holds (``map_beside``), else the headers alone.

    Raises
    ------
    InputError
        The file cannot be read, or a column or a unit is missing.
    """
    file = Path(path)
    if is_folder(file):
        raise InputError(place=file, found="is a folder", expected="a file (read_runs takes folders)")
    chosen = load_map(map_beside(file) if channels is None else channels)
    return runs_in(read_table(file, chosen.file), chosen, file)


def runs_in(table: Table, chosen: ChannelMap, file: Path) -> RigFile:
    """Return the recordings in a file's table."""
    place = file.name
    found, columns = _find_channels(table, chosen, place)
    time = _time(table, found, chosen, place)
    parts = _split(table, chosen, len(time), place)
    recordings = []
    for number, (part, command) in enumerate(parts):
        if command is None:
            given = _command(found, chosen, part, command_role(columns, chosen, table, place))
        else:
            given = command
        name = printable(file.stem)
        if command is not None:
            same = [other.values[0] for _, other in parts[:number] if other is not None]
            again = same.count(command.values[0])
            name += f"_{command.values[0]:.2f}{command.unit}" + (f"_{again + 1}" if again else "")
        elif len(parts) > 1:
            name += f"_{number + 1}"
        temperature = found.temperature
        if temperature is None and (constant := chosen.constant.get("temperature")) is not None:
            temperature = np.full(len(time), constant)
        recordings.append(
            Recording(
                name=name,
                time=time[part] - time[part][0] if len(parts) > 1 or chosen.segments else _cut(time, part),
                displacement=_cut(found.displacement, part),
                force=_cut(found.force, part),
                command=given.values,
                command_unit=given.unit,
                velocity=None if found.velocity is None else _cut(found.velocity, part),
                temperature=None if temperature is None else temperature[part],
                session=chosen.session or printable(file.stem),
                source=printable(str(file)),
            )
        )
    return RigFile(tuple(recordings), table.layout, columns)


def read_runs(paths: PathLike | Iterable[PathLike], channels: ChannelMap | PathLike | None = None) -> Dataset:
    """Return the runs in files, folders and glob patterns, in the order given, each file once.

    A folder gives the files in it (not below it) of the formats read here. The faults of all files are
    in one message.
    """
    chosen = None if channels is None else load_map(channels)
    runs: list[RigRun] = []
    faults: list[str] = []
    for file in find_files([paths] if isinstance(paths, str | Path) else list(paths)):
        try:
            runs += read_run(file, chosen)
        except InputError as error:
            faults.append(str(error))
    if faults:
        raise InputError(joined_faults(faults))
    return Dataset(tuple(runs))


def map_beside(file: Path) -> Path | None:
    """Return the channel map that lies beside a file under its name and ``.channels.toml``, if one does.

    It is the file's own, and taken where no other map is given.
    """
    beside = file.with_name(f"{file.name}{MAP_SUFFIX}")
    return beside if is_file(beside) else None


def joined_faults(faults: Sequence[str], most: int = 8) -> str:
    """Return the faults of many files as one message: the first few, and how many more there are."""
    more = [f"... and {len(faults) - most} more like these"] if len(faults) > most else []
    return "\n".join([*faults[:most], *more])


def load_map(channels: ChannelMap | PathLike | None) -> ChannelMap:
    """Return a channel map as given, from its file, or the empty one."""
    if channels is None:
        return ChannelMap()
    return channels if isinstance(channels, ChannelMap) else read_channel_map(channels)


def find_files(paths: Sequence[PathLike]) -> list[Path]:
    """Return the files that paths, folders and patterns name, each once, in the order given."""
    suffixes = {suffix for known in FORMATS for suffix in known.suffixes}
    files: dict[Path, None] = {}
    if not paths:
        raise InputError(found="no paths given", expected="files, folders or patterns")
    for given in paths:
        path = Path(given)
        if is_folder(path):
            inside = sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes)
            inside = [file for file in inside if file.is_file()]
            if not inside:
                raise InputError(
                    place=path, found="no runs in this folder", expected=", ".join(sorted(suffixes))
                )
        elif is_there(path):
            inside = [path]
        elif glob.has_magic(str(given)):
            inside = sorted(Path(name) for name in glob.glob(str(given), recursive=True))  # noqa: PTH207
            inside = [file for file in inside if file.is_file()]
            if not inside:
                raise InputError(place=given, found="the pattern matches no file")
        else:
            raise InputError(place=path, found=_why_absent(path))
        files |= dict.fromkeys(inside)
    return list(files)


def _why_absent(path: Path) -> str:
    try:
        path.stat()
    except OSError as error:
        if error.errno not in {errno.ENOENT, errno.ENOTDIR, errno.ELOOP}:
            return f"cannot be read: {error.strerror}"
    return "no such file or folder"


def _find_channels(table: Table, chosen: ChannelMap, place: str) -> tuple[_Channels, tuple[Column, ...]]:
    """Return the channels of a file in SI, by role."""
    columns = find_columns(table, chosen, place)
    found: dict[str, FloatArray] = {}
    for column in columns:
        values = table.columns[column.name]
        if not len(values):
            raise InputError(
                place=place,
                found=f"column {column.name!r} ({column.role}) holds no sample",
                expected="numbers",
                remedy="The file may be cut off: copy it again",
            )
        found[column.role] = chosen.channel(column.role).to_si(values, column.unit, place)
    return _Channels(**found), columns


def find_columns(table: Table, chosen: ChannelMap, place: str) -> tuple[Column, ...]:
    """Return which column holds which role: those of the map first, then what headers say; none is read."""
    said: dict[str, list[Column]] = {}
    for name in table.columns:
        header = parse_header(name)
        if header is not None and name not in table.stamps:
            said.setdefault(header[0], []).append(Column(header[0], name, _unit(table, name, header, place)))
    if chosen.rate_Hz is None and table.step_s is None:
        said.setdefault("time", [Column("time", name, "s") for name in table.names if name in table.stamps])
    columns: list[Column] = []
    for role in QUANTITIES:
        channel = chosen.channel(role)
        column = _column_of(table, channel, said.get(role, ()), place)
        if column is None and role in chosen.channels:
            raise InputError(
                place=place,
                found=(
                    f"neither channel.{role} nor a header names a column; the columns are: "
                    f"{_listed(table.names)}"
                ),
            )
        if column is not None:
            columns.append(Column(role, column.name, channel.unit or column.unit))
    for role in _NEEDED:
        if role not in {column.role for column in columns}:
            _require_no_text(role, table, place)
            raise InputError(
                place=place,
                found=(
                    f"no {role} column; the columns are: {_listed(table.names)}. Expected a header such as "
                    f"{role}_{QUANTITIES[role].unit}, or [channel.{role}] in a channel map (⟦--channels "
                    f"FILE⟧){_perhaps([role], table)}"
                ),
            )
    _require_one_clock(table, columns, place)
    return tuple(columns)


def _require_no_text(role: str, table: Table, place: str) -> None:
    """Refuse a column of texts whose header says that it is what is missed."""
    for name, cells in table.texts.items():
        header = parse_header(name)
        if header is not None and header[0] == role:
            cell = next((cell for cell in cells if cell), "")
            raise InputError(
                place=place,
                found=f"column {name!r} ({role}) holds text, such as {cell[:40]!r}",
                expected="numbers, without units or separators of thousands in the cells",
                remedy="Export the file again",
            )


def _perhaps(roles: Iterable[str], table: Table) -> str:
    """Return the end of a message: which column may be the one that is missed, as a map names it."""
    found = [(role, name) for role in roles for name in candidates(role, [*table.columns])]
    lines = " or ".join(f"[channel.{role}] name = {name!r}" for role, name in found[:3])
    return f"; perhaps {lines}" if found else ""


def _require_one_clock(table: Table, columns: Sequence[Column], place: str) -> None:
    """Refuse channels that were sampled by clocks of their own: nothing is resampled here."""
    if len({table.clocks[column.name] for column in columns if column.name in table.clocks}) > 1:
        which = ", ".join(f"{column.role} {column.name!r}" for column in columns)
        raise InputError(
            place=place,
            found=f"the channels ({which}) have clocks of their own",
            expected="one for all",
            remedy=(
                "Name a group that holds all of them at [file] part in the channel map, or write the file "
                "again with one raster"
            ),
        )


def _column_of(table: Table, channel: Channel, said: Sequence[Column], place: str) -> Column | None:
    """Return the column of a role: the one that the map names, or else the one whose header says so."""
    role = channel.role
    position = channel.find(table.names, place)
    if position is not None:
        name = table.names[position]
        if name in table.texts:
            raise InputError(
                place=place, found=f"channel.{role}: column {name!r} holds text", expected="numbers"
            )
        if name in table.stamps and role != "time":
            raise InputError(
                place=place, found=f"channel.{role}: column {name!r} holds times", expected="numbers"
            )
        return next(
            (column for column in said if column.name == name),
            Column(role, name, table.units.get(name, "") or unit_in_brackets(name)),
        )
    left = [column for column in said if column.unit] or said
    if len(left) > 1:  # "Force (V)" beside "Force (N)" is what the sensor gave
        left = [column for column in left if is_unit(column.unit, [role])] or left
    if len(left) > 1:  # a word says more than a symbol: "F [N]" beside "Force [N]"
        left = [column for column in left if not names_by_symbol(column.name)] or left
    if len(left) > 1:
        columns = ", ".join(repr(column.name) for column in left)
        raise InputError(
            place=place,
            found=f"columns {columns} all hold {role}",
            expected="one",
            remedy=f"Name it at [channel.{role}] in the channel map",
        )
    return left[0] if left else None


def _unit(table: Table, name: str, header: tuple[str, str], place: str) -> str:
    """Return the unit of a column; a header and a file that state different ones are an error.

    What is no unit at all, as the brackets of ``Force (Trigger)``, does not speak against one that is.
    """
    role, of_header = header
    stated = table.units.get(name, "")
    if not (stated and of_header) or spell_unit(stated, role) == spell_unit(of_header, role):
        return of_header or stated
    units = [word for word in (of_header, stated) if is_unit(word)]
    if len(units) == 2:
        raise InputError(
            place=place,
            found=f"column {name!r} states {stated!r} as its unit beside the name",
            expected="one and the same",
            remedy="Correct the file",
        )
    return units[0] if units else of_header


def _listed(names: Sequence[str], most: int = 24) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _time(table: Table, found: _Channels, chosen: ChannelMap, place: str) -> FloatArray:
    """Return time [s] of each sample: a column, or from a stated sampling interval or rate."""
    samples = len(found.displacement)
    stated = found.time
    if stated is not None and len(stated) > 1:
        return stated
    # a time of one number is the sampling interval
    step = sampling_step(table, chosen, place) if stated is None else float(stated[0])
    return np.arange(samples, dtype=np.float64) * step


def sampling_step(table: Table, chosen: ChannelMap, place: str) -> float:
    """Return the sampling interval [s] of a file without a time column, as the map or the file states it."""
    step = table.step_s if chosen.rate_Hz is None else 1.0 / chosen.rate_Hz
    if step is None:
        _require_no_text("time", table, place)
        raise InputError(
            place=place,
            found=(
                f"no time column; the columns are: {_listed(table.names)}. Expected a header such as time_s, "
                "[channel.time] in a channel map (⟦--channels FILE⟧), or rate_Hz at its "
                f"[constant]{_perhaps(['time'], table)}"
            ),
        )
    return step


def _split(table: Table, chosen: ChannelMap, samples: int, place: str) -> list[tuple[slice, _Command | None]]:
    """Return the rows of each run in a file, and its command when the map gives one for each."""
    if chosen.segments is None:
        edges = [*(table.parts or (0,)), samples]
        return [(slice(a, b), None) for a, b in itertools.pairwise(edges)]
    split, commands = chosen.segments.split, chosen.segments.commands
    begins = {
        row
        for cells in table.texts.values()
        for row, cell in enumerate(cells)
        if cell is not None and split in cell and row > 0
    }
    edges = [0, *sorted(begins), samples]
    if len(edges) - 1 != len(commands):
        raise InputError(
            place=place,
            found=(
                f"{split!r} splits the file into {len(edges) - 1} tests and [segments] of the channel map "
                f"gives {len(commands)} commands"
            ),
            expected="as many",
            remedy="Check the events and the list",
        )
    unit = COMMAND_UNITS[chosen.segments.role]
    return [
        (slice(a, b), _Command(np.full(b - a, command), unit))
        for a, b, command in zip(edges[:-1], edges[1:], commands, strict=True)
    ]


def _cut(values: FloatArray, part: slice) -> FloatArray:
    """Return a part of a channel; the whole of a large one is handed on and not copied."""
    if part.start or (part.stop or len(values)) < len(values):
        return values[part]
    values.setflags(write=False)
    return values


def command_role(columns: Iterable[Column], chosen: ChannelMap, table: Table, place: str) -> str:
    """Return the role of a file's command: current or voltage, a column's before a constant's."""
    measured = {column.role for column in columns}
    for role in COMMAND_UNITS:
        if role in chosen.constant and role in measured:
            raise InputError(
                place=place, found=f"{role} is a column and a constant of the channel map; leave one out"
            )
    for known in (measured, chosen.constant):
        for role in COMMAND_UNITS:
            if role in known:
                return role
    for role in COMMAND_UNITS:
        _require_no_text(role, table, place)
    raise InputError(
        place=place,
        found="no current or voltage",
        expected=(
            "a column such as current_A or voltage_V, or the same at [constant] in a channel map "
            f"(⟦--channels FILE⟧){_perhaps(COMMAND_UNITS, table)}"
        ),
    )


def _command(found: _Channels, chosen: ChannelMap, part: slice, role: str) -> _Command:
    measured = found.command(role)
    if measured is None:
        measured = np.full(len(found.displacement), chosen.constant[role])
    return _Command(_cut(measured, part), COMMAND_UNITS[role])
