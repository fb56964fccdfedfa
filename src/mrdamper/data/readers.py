"""Readers: from a rig's files to runs in SI and kelvin.

The file's table (``tables``) and the channel map (``channels``) meet here. Nothing is guessed: what the
file or the map does not say is asked for.
"""

from __future__ import annotations

import glob
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from mrdamper.data.channels import Channel, ChannelMap, parse_header, read_channel_map
from mrdamper.data.records import CommandUnit, Dataset, RigRun
from mrdamper.data.tables import FORMATS, Table, read_table
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, FloatArray

__all__ = ["read_run", "read_runs"]

PathLike = str | Path

_NEEDED = ("displacement", "force")
_COMMAND_UNITS: dict[str, CommandUnit] = dict(zip(("current", "voltage"), get_args(CommandUnit), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class _Command:
    values: FloatArray  # one per sample [A or V]
    unit: CommandUnit


def read_run(path: PathLike, channels: ChannelMap | PathLike | None = None) -> tuple[RigRun, ...]:
    """Return the runs in one file; a logger's file holds several.

    A run is named as its file (and its command, where a file holds several). The command is a channel
    of current or voltage, or else a ``[constant]`` or the ``[segments]`` of the channel map.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or a run has faults.
    """
    file = Path(path)
    if file.is_dir():
        raise InputError(f"{file}: is a folder; expected a file (read_runs takes folders)")
    chosen = _load_map(channels)
    table = read_table(file)
    place = file.name
    found = _find_channels(table, chosen, place)
    time = _time(table, found, chosen, place)
    parts = _split(table, chosen, len(time), place)
    runs = []
    for number, (part, command) in enumerate(parts):
        given = _command(found, chosen, part, place) if command is None else command
        name = file.stem
        if command is not None:
            same = [other.values[0] for _, other in parts[:number] if other is not None]
            again = same.count(command.values[0])
            name += f"_{command.values[0]:.2f}{command.unit}" + (f"_{again + 1}" if again else "")
        temperature = found.get("temperature")
        if temperature is None and "temperature" in chosen.constant:
            temperature = np.full(len(time), chosen.constant["temperature"])
        elapsed = time[part] - time[part][0] if chosen.segments else time[part]
        runs.append(
            RigRun(
                name=name,
                time=elapsed,
                displacement=found["displacement"][part],
                force=found["force"][part],
                command=given.values,
                command_unit=given.unit,
                velocity=found["velocity"][part] if "velocity" in found else None,
                temperature=None if temperature is None else temperature[part],
                session=chosen.session or file.stem,
                source=str(file),
            )
        )
    return tuple(runs)


def read_runs(paths: PathLike | Iterable[PathLike], channels: ChannelMap | PathLike | None = None) -> Dataset:
    """Return the runs in files, folders and glob patterns, in the order given, each file once.

    A folder gives the files in it (not below it) of the formats read here. The faults of all files are
    told at once.
    """
    chosen = _load_map(channels)
    runs: list[RigRun] = []
    faults: list[str] = []
    for file in _find_files([paths] if isinstance(paths, str | Path) else list(paths)):
        try:
            runs += read_run(file, chosen)
        except InputError as error:
            faults.append(str(error))
    if faults:
        raise InputError(told_at_once(faults))
    return Dataset(tuple(runs))


def told_at_once(faults: Sequence[str], most: int = 8) -> str:
    """Return the faults of many files as one message: the first few, and how many more there are."""
    more = [f"... and {len(faults) - most} more like these"] if len(faults) > most else []
    return "\n".join([*faults[:most], *more])


def _load_map(channels: ChannelMap | PathLike | None) -> ChannelMap:
    if channels is None:
        return ChannelMap()
    return channels if isinstance(channels, ChannelMap) else read_channel_map(channels)


def _find_files(paths: Sequence[PathLike]) -> list[Path]:
    suffixes = {suffix for known in FORMATS for suffix in known.suffixes}
    files: dict[Path, None] = {}
    if not paths:
        raise InputError("no paths given; expected files, folders or patterns")
    for given in paths:
        path = Path(given)
        if path.is_dir():
            inside = sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes)
            inside = [file for file in inside if file.is_file()]
            if not inside:
                raise InputError(f"{path}: no runs in this folder; expected {', '.join(sorted(suffixes))}")
        elif path.exists():
            inside = [path]
        elif glob.has_magic(str(given)):
            inside = sorted(Path(name) for name in glob.glob(str(given), recursive=True))  # noqa: PTH207
            inside = [file for file in inside if file.is_file()]
            if not inside:
                raise InputError(f"{given}: the pattern matches no file")
        else:
            raise InputError(f"{path}: no such file or folder")
        files |= dict.fromkeys(inside)
    return list(files)


def _find_channels(table: Table, chosen: ChannelMap, place: str) -> dict[str, FloatArray]:
    """Return the channels of a file in SI, by role: those of the map first, then what headers say."""
    names = table.names
    said: dict[str, list[tuple[str, str]]] = {}
    for name in table.columns:
        header = parse_header(name)
        if header is not None:
            said.setdefault(header[0], []).append((name, header[1]))
    found: dict[str, FloatArray] = {}
    for role in QUANTITIES:
        channel = chosen.channels.get(role, Channel(role))
        position = channel.find(names, place)
        if position is not None:
            name = names[position]
            if name in table.texts:
                raise InputError(f"{place}: channel.{role}: column {name!r} holds text; expected numbers")
            header_unit = next((unit for other, unit in said.get(role, ()) if other == name), "")
            found[role] = channel.to_si(table.columns[name], header_unit, place)
            continue
        with_unit = [pair for pair in said.get(role, ()) if pair[1]] or said.get(role, [])
        if len(with_unit) > 1:
            columns = ", ".join(repr(name) for name, _ in with_unit)
            raise InputError(
                f"{place}: columns {columns} all hold {role}; expected one. Name it at [channel.{role}] in "
                "the channel map"
            )
        if with_unit:
            name, unit = with_unit[0]
            found[role] = channel.to_si(table.columns[name], unit, place)
        elif role in chosen.channels:
            raise InputError(
                f"{place}: neither channel.{role} nor a header names a column; the columns are: "
                f"{', '.join(names)}"
            )
    for role in _NEEDED:
        if role not in found:
            raise InputError(
                f"{place}: no {role} column; the columns are: {', '.join(names)}. Expected a header such as "
                f"{role}_{QUANTITIES[role].unit}, or [channel.{role}] in a channel map (--channels FILE)"
            )
    return found


def _time(table: Table, found: dict[str, FloatArray], chosen: ChannelMap, place: str) -> FloatArray:
    """Return time [s] of each sample: a column, or from a stated sampling interval or rate."""
    samples = len(found["displacement"])
    stated = found.get("time")
    if stated is not None and len(stated) > 1:
        return stated
    step = table.step_s
    if stated is not None:  # a time of one number is the sampling interval
        step = float(stated[0])
    elif chosen.rate_Hz is not None:
        step = 1.0 / chosen.rate_Hz
    if step is None:
        raise InputError(
            f"{place}: no time column; the columns are: {', '.join(table.names)}. Expected a header such as "
            "time_s, [channel.time] in a channel map (--channels FILE), or rate_Hz at its [constant]"
        )
    return np.arange(samples, dtype=np.float64) * step


def _split(table: Table, chosen: ChannelMap, samples: int, place: str) -> list[tuple[slice, _Command | None]]:
    """Return the stretch of each run in a file, and its command when the map gives one for each."""
    if chosen.segments is None:
        return [(slice(0, samples), None)]
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
            f"{place}: {split!r} splits the file into {len(edges) - 1} tests and [segments] of the channel "
            f"map gives {len(commands)} commands; expected as many. Check the events and the list"
        )
    unit = _COMMAND_UNITS[chosen.segments.role]
    return [
        (slice(a, b), _Command(np.full(b - a, command), unit))
        for a, b, command in zip(edges[:-1], edges[1:], commands, strict=True)
    ]


def _command(found: dict[str, FloatArray], chosen: ChannelMap, part: slice, place: str) -> _Command:
    samples = len(found["displacement"][part])
    for role in _COMMAND_UNITS:
        if role in chosen.constant and role in found:
            raise InputError(f"{place}: {role} is a column and a constant of the channel map; leave one out")
    for role, unit in _COMMAND_UNITS.items():
        if role in found:
            return _Command(found[role][part], unit)
    for role, unit in _COMMAND_UNITS.items():
        if role in chosen.constant:
            return _Command(np.full(samples, chosen.constant[role]), unit)
    raise InputError(
        f"{place}: no current or voltage; expected a column such as current_A or voltage_V, or the same at "
        "[constant] in a channel map (--channels FILE)"
    )
