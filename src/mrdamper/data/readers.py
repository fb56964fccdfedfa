"""Readers: from a rig's files to runs in SI and kelvin.

The file's tables (``tables``), the roles of their columns (``roles``), what names say (``labels``) and the
channel map (``channels``) meet here. Nothing is guessed: what the file or the map does not say is asked
for, and what was inferred is told with its source.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap, read_channel_map
from mrdamper.data.finding import Finding
from mrdamper.data.proposal.folders import distinct_names, find_files
from mrdamper.data.proposal.pieces import (
    Piece,
    cut_at_gaps,
    filled,
    integrated,
    joined,
    run_edges,
    to_one_clock,
)
from mrdamper.data.proposal.questions import Answer, AskingError, ask_all, with_answers
from mrdamper.data.proposal.roles import Column, find_columns, no_command, sampling_step, wide_columns
from mrdamper.data.records import Dataset, Recording, RigRun, command_slack, steady_command
from mrdamper.data.tables import Layout, Table, read_tables
from mrdamper.data.words.labels import Place, find_label, places_of
from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX, is_file, is_folder, printable
from mrdamper.quantities import CommandUnit

__all__ = [
    "COMMAND_UNITS",
    "ONE_FOR_EACH",
    "Inference",
    "RigFile",
    "command_role",
    "joined_faults",
    "load_map",
    "map_beside",
    "read_file",
    "read_run",
    "read_runs",
    "runs_in",
]

PathLike = str | Path

COMMAND_UNITS: dict[str, CommandUnit] = dict(zip(("current", "voltage"), get_args(CommandUnit), strict=True))
ONE_FOR_EACH = "one for each current"
"""The source of a column of force that has others beside it, each with its current in its name."""
_HELD = ("current", "voltage", "temperature")
_CONTRADICTS = 0.15  # share by which a command in a name and the measured one may differ


@dataclass(frozen=True, slots=True)
class Inference:
    """A value that was taken from words: of which run and role, how much [SI], and where it stands."""

    run: str
    role: str
    value: float
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class RigFile:
    """What one file holds, and how it was understood."""

    recordings: tuple[Recording, ...]
    layout: Layout
    columns: tuple[Column, ...]
    findings: tuple[Finding, ...] = ()  # of what was done while reading
    inferred: tuple[Inference, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The pieces of one table, and how it was understood."""

    pieces: tuple[Piece, ...]
    columns: tuple[Column, ...]
    role: str  # of the command
    notes: tuple[str, ...] = ()


def read_run(path: PathLike, channels: ChannelMap | PathLike | None = None) -> tuple[RigRun, ...]:
    """Return the runs in one file; a logger's file holds several.

    A run is named as its file (and its command, where a file holds several). The command is a channel
    of current or voltage, or else a ``[constant]`` or the ``[segments]`` of the channel map, or stands in a
    title, in lines above the table, or in the name of the file or its folder.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or a run has faults.
    """
    return tuple(recording.checked() for recording in read_file(path, channels).recordings)


def read_file(
    path: PathLike, channels: ChannelMap | PathLike | None = None, answers: Sequence[Answer] = ()
) -> RigFile:
    """Return the recordings in one file as they stand, and how the file was understood.

    Without ``channels`` the map that lies beside the file holds (``map_beside``), else the headers alone.

    Raises
    ------
    AskingError
        The file does not say all that is needed; its questions name what.
    InputError
        The file cannot be read.
    """
    file = Path(path)
    if is_folder(file):
        raise InputError(place=file, found="is a folder", expected="a file (read_runs takes folders)")
    chosen = with_answers(load_map(map_beside(file) if channels is None else channels), answers, file.name)
    return runs_in(read_tables(file, chosen.file), chosen, file)


def runs_in(tables: Sequence[Table], chosen: ChannelMap, file: Path) -> RigFile:
    """Return the recordings in a file's tables.

    A table that holds no force over time, as one of results beside those of samples, is left out and told.
    """
    parts: list[_Part] = []
    faults: list[InputError] = []
    for table in tables:
        try:
            parts.append(_part_of(table, chosen, file))
        except InputError as fault:
            if len(tables) == 1 or not _is_beside(table, tables):
                faults.append(fault)
    if faults or not parts:
        raise ask_all(faults) if faults else InputError(place=file.name, found="no table holds a run")
    layout = tables[0].layout
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    if len(parts) < len(tables):
        notes += (f"{len(tables) - len(parts)} tables without force over time left out",)
    if len(parts) > 1 and tables[0].title:
        notes += (f"{len(parts)} parts",)
    layout = replace(layout, notes=(*layout.notes, *notes))
    pieces = [(piece, part.role) for part in parts for piece in part.pieces]
    recordings, findings, inferred = _named(pieces, chosen, file)
    return RigFile(recordings, layout, parts[0].columns, findings, inferred)


def _is_beside(table: Table, tables: Sequence[Table]) -> bool:
    """Tell whether a table that cannot be read is another kind of table: its columns are not the others'."""
    return any(other.names != table.names and other.rows > table.rows for other in tables) and not (
        {column for other in tables if other is not table for column in other.names} >= {*table.names}
    )


def _part_of(table: Table, chosen: ChannelMap, file: Path) -> _Part:
    """Return the pieces of one table."""
    place = file.name
    wide = () if "force" in chosen.channels else wide_columns(table)
    if wide:
        return _wide_part(table, chosen, file, wide)
    columns = find_columns(table, chosen, place)
    channels, time, slow = _channels(table, columns, chosen, place)
    role = command_role(columns, chosen, place)
    measured = channels.pop(role) if role in channels else None
    for other in COMMAND_UNITS:
        channels.pop(other, None)
    edges, titles = run_edges(time, table.parts, table.texts if chosen.segments is None else {})
    commands: list[float | None] = []
    if chosen.segments is not None:
        edges, commands = _segments(table, chosen, len(time), place)
        role = chosen.segments.role
    pieces = []
    for number, (first, last) in enumerate(itertools.pairwise(edges)):
        title = next((titles[k] for k in sorted(titles, reverse=True) if k <= first), "")
        held = commands[number] if commands else None
        values = measured[first:last] if measured is not None and held is None else None
        piece = Piece(
            time=time[first:last],
            channels={name: each[first:last] for name, each in channels.items()},
            title=title or table.title,
        )
        place_texts = places_of(title or table.title, table.said, file)
        role_now, values, told = _command(
            role, values, held, len(piece.time), table, chosen, place_texts, place
        )
        piece, told = _with_temperature(piece, told, chosen, place_texts)
        pieces.append(replace(piece, channels={**piece.channels, "command": values}, told=told))
        role = role_now
    whole = joined(pieces) if chosen.segments is None else pieces
    notes = (f"{', '.join(slow)} interpolated to the fastest clock",) if slow else ()
    return _Part(tuple(whole), columns, role, notes)


def _wide_part(table: Table, chosen: ChannelMap, file: Path, wide: Sequence[tuple[str, float]]) -> _Part:
    """Return a piece for each column of force of a table that has one for each current."""
    pieces: list[Piece] = []
    columns: tuple[Column, ...] = ()
    names = {name for name, _ in wide}
    for name, current in wide:
        others = {key: values for key, values in table.columns.items() if key not in names - {name}}
        kept = tuple(each for each in table.names if each not in names - {name})
        said = replace(chosen, constant={**chosen.constant, "current": current})
        part = _part_of(replace(table, columns=others, names=kept), said, file)
        columns = columns or tuple(
            replace(each, source=ONE_FOR_EACH) if each.role == "force" else each for each in part.columns
        )
        pieces += [replace(piece, told=(("current", current, f"column {name!r}"),)) for piece in part.pieces]
    return _Part(tuple(pieces), columns, "current", (f"{len(wide)} columns of force, {ONE_FOR_EACH}",))


def _channels(
    table: Table, columns: Sequence[Column], chosen: ChannelMap, place: str
) -> tuple[dict[str, FloatArray], FloatArray, tuple[str, ...]]:
    """Return the channels of a table in SI by role, its time [s], and roles that were interpolated."""
    names = {column.role: column.name for column in columns if column.role != "time"}
    raw, slow = to_one_clock(table, names, place)
    for column in columns:
        if column.role not in raw:
            raw[column.role] = table.columns[column.name]
    channels: dict[str, FloatArray] = {}
    for column in columns:
        if not len(raw[column.role]):
            raise InputError(
                place=place,
                found=f"column {column.name!r} ({column.role}) holds no sample",
                expected="numbers",
                remedy="The file may be cut off: copy it again",
            )
        channels[column.role] = column.channel(chosen).to_si(raw[column.role], column.unit, place)
    stated = channels.pop("time", raw.get("time"))
    samples = max(map(len, channels.values()))
    for role in _HELD:
        if role in channels and len(channels[role]) == 1:  # said once for the whole table
            channels[role] = np.full(samples, channels[role][0])
    if stated is not None and len(stated) > 1:
        return channels, stated, slow
    # a time of one number is the sampling interval
    step = sampling_step(table, chosen, place) if stated is None else float(stated[0])
    return channels, np.arange(samples, dtype=np.float64) * step, slow


def command_role(columns: Iterable[Column], chosen: ChannelMap, place: str) -> str:
    """Return the role of a file's command, a column's before a constant's; "" where neither is there."""
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
    return ""


def _command(
    role: str,
    measured: FloatArray | None,
    held: float | None,
    samples: int,
    table: Table,
    chosen: ChannelMap,
    texts: Sequence[Place],
    place: str,
) -> tuple[str, FloatArray, tuple[tuple[str, float, str], ...]]:
    """Return role and values of the command of a piece, and where a label said it.

    Measured, or held as the map says, or else as the nearest place says that speaks of one.
    """
    if held is not None:
        return role, np.full(samples, held), ()
    if measured is not None:
        _require_agreement(role, measured, table, texts, place)
        return role, measured, ()
    if role in chosen.constant:
        return role, np.full(samples, chosen.constant[role]), ()
    label = find_label(texts, "current") or find_label(texts, "voltage")
    if label is None:
        raise no_command(table, place)
    unit = COMMAND_UNITS[label.role]
    if len(label.values) > 1:
        values = [f"{value:g} {unit}" for value in label.values]
        raise no_command(
            table, place, f"the {label.source} {label.text!r} says {' and '.join(values)}", values
        )
    return label.role, np.full(samples, label.values[0]), ((label.role, label.values[0], label.source),)


def _require_agreement(
    role: str, measured: FloatArray, table: Table, texts: Sequence[Place], place: str
) -> None:
    """Ask where a file's name states one command and the measured one keeps still at another."""
    label = find_label([each for each in texts if each.source in {"title", "file name"}], role)
    held = steady_command(measured) if label is not None and np.isfinite(measured).all() else None
    if label is None or held is None or len(label.values) != 1:
        return
    said = label.values[0]
    if abs(said - held) > max(_CONTRADICTS * abs(held), 5 * command_slack(held)):
        unit = COMMAND_UNITS[role]
        values = [f"{said:g} {unit}", f"{held:.4g} {unit}"]
        found = f"the {label.source} {label.text!r} says {values[0]}, and the {role} measured is {values[1]}"
        raise no_command(table, place, found, values)


def _with_temperature(
    piece: Piece, told: tuple[tuple[str, float, str], ...], chosen: ChannelMap, texts: Sequence[Place]
) -> tuple[Piece, tuple[tuple[str, float, str], ...]]:
    """Return a piece with the temperature that the map or a label states, where no column has it."""
    if "temperature" in piece.channels:
        return piece, told
    value = chosen.constant.get("temperature")
    if value is None:
        label = find_label(texts, "temperature")
        if label is None or len(label.values) != 1:
            return piece, told
        value = label.values[0]
        told = (*told, ("temperature", value, label.source))
    warm = np.full(len(piece.time), value)
    return replace(piece, channels={**piece.channels, "temperature": warm}), told


def _segments(
    table: Table, chosen: ChannelMap, samples: int, place: str
) -> tuple[list[int], list[float | None]]:
    """Return the edges of the tests in a file, and the command that the map gives for each."""
    assert chosen.segments is not None
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
    return edges, list(commands)


def _named(
    pieces: Sequence[tuple[Piece, str]], chosen: ChannelMap, file: Path
) -> tuple[tuple[Recording, ...], tuple[Finding, ...], tuple[Inference, ...]]:
    """Return recordings of the pieces of a file, what was done to them, and what was inferred."""
    stem = printable(file.stem)
    names = _names(pieces, chosen, stem)
    recordings: list[Recording] = []
    findings: list[Finding] = []
    inferred: list[Inference] = []
    for (piece, role), name in zip(pieces, names, strict=True):
        time = piece.time - piece.time[0] if len(pieces) > 1 or chosen.segments else piece.time
        parts = list(cut_at_gaps(filled(replace(piece, time=time))))
        for number, each in enumerate(parts, 1):
            part = each if "displacement" in each.channels else integrated(each)
            run = f"{name}_{number}" if len(parts) > 1 else name
            recordings.append(_recording(part, run, COMMAND_UNITS[role], chosen.session or stem, file))
            findings += [replace(finding, run=run) for finding in part.findings]
            inferred += [Inference(run, *told) for told in part.told]
    return tuple(recordings), tuple(findings), tuple(inferred)


def _recording(piece: Piece, name: str, unit: CommandUnit, session: str, file: Path) -> Recording:
    for values in (piece.time, *piece.channels.values()):
        if values.base is None:
            values.setflags(write=False)  # handed on, not copied
    return Recording(
        name=name,
        time=piece.time,
        displacement=piece.channels["displacement"],
        force=piece.channels["force"],
        command=piece.channels["command"],
        command_unit=unit,
        velocity=piece.channels.get("velocity"),
        temperature=piece.channels.get("temperature"),
        session=session,
        source=printable(str(file)),
    )


def _names(pieces: Sequence[tuple[Piece, str]], chosen: ChannelMap, stem: str) -> list[str]:
    """Return the names of the runs in a file: its own, with commands, titles or numbers of several."""
    if len(pieces) == 1 and chosen.segments is None:
        return [stem]
    titles = [piece.title for piece, _ in pieces]
    if chosen.segments is not None or all(
        piece.told and piece.told[0][0] in COMMAND_UNITS for piece, _ in pieces
    ):
        ends = [f"{piece.channels['command'][0]:.2f}{COMMAND_UNITS[role]}" for piece, role in pieces]
    elif len(set(titles)) == len(titles):
        ends = titles
    else:
        return [f"{stem}_{number}" for number in range(1, len(pieces) + 1)]
    names = []
    for number, end in enumerate(ends):
        again = ends[:number].count(end)
        names.append(f"{stem}_{end}" + (f"_{again + 1}" if again else ""))
    return names


def read_runs(
    paths: PathLike | Iterable[PathLike],
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
) -> Dataset:
    """Return the runs in files, folders and glob patterns, in the order given, each file once.

    A folder gives the files in it, and in the folders in it, of the formats read here. The faults and the
    questions of all files are in one error.
    """
    chosen = None if channels is None else load_map(channels)
    runs: list[RigRun] = []
    faults: list[InputError] = []
    for file in find_files([paths] if isinstance(paths, str | Path) else list(paths)):
        try:
            runs += [each.checked() for each in read_file(file, chosen, answers).recordings]
        except InputError as error:
            faults.append(error)
    if faults:
        questions = [question for fault in faults for question in getattr(fault, "questions", ())]
        text = joined_faults([str(fault) for fault in faults])
        raise AskingError(text, questions=questions) if questions else InputError(text)
    names = distinct_names([run.name for run in runs], [run.source for run in runs])
    return Dataset(
        tuple(
            run if run.name == name else replace(run, name=name)
            for run, name in zip(runs, names, strict=True)
        )
    )


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
