"""Recordings from the tables of a file. Columns are converted to SI, divided into runs, repaired and named.

Changes of the data are returned as findings. Values that were read from words are returned as inferences.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import Finding, Inference, no_run
from mrdamper.data.formats.table import Layout, Moment, Table
from mrdamper.data.proposal.clocks import increases, sampling_step, start_of, to_one_clock, with_clocks
from mrdamper.data.proposal.column import Column, explained, headers_of
from mrdamper.data.proposal.commands import (
    COMMAND_UNITS,
    command_of,
    command_role,
    segments_of,
    with_temperature,
)
from mrdamper.data.proposal.documents import lines_by_title, spoiled_tables
from mrdamper.data.proposal.folders import GENERIC_SUFFIXES, format_suffixes, own_name
from mrdamper.data.proposal.formulas import converted
from mrdamper.data.proposal.pieces import Piece, join_pieces, repaired_parts, run_edges, with_stated_signs
from mrdamper.data.proposal.questions import AskingError, NoRunError, ask_all, relocate
from mrdamper.data.proposal.roles import find_columns, skipped_columns
from mrdamper.data.proposal.side_by_side import one_force_each, side_by_side, wide_of_long, with_run_numbers
from mrdamper.data.records import CHANNELS, LEAST_SAMPLES, Recording
from mrdamper.data.words.headers import has_word, means, unit_in_brackets
from mrdamper.data.words.labels import Place, places_of
from mrdamper.data.words.signs import signs_in
from mrdamper.errors import InputError
from mrdamper.files import printable
from mrdamper.quantities import QUANTITIES, is_any_unit, roles_of_unit


@dataclass(frozen=True, slots=True, eq=False)
class RigFile:
    """Recordings of a file, and how the file was interpreted."""

    recordings: tuple[Recording, ...]
    layout: Layout
    columns: tuple[Column, ...]
    chosen: ChannelMap  # Channel map that includes the answers of the user.
    findings: tuple[Finding, ...] = ()  # Changes that the reader made.
    inferred: tuple[Inference, ...] = ()
    starts: tuple[Moment | None, ...] = ()  # Moment of time zero of each recording.


def runs_in(
    tables: Sequence[Table],
    chosen: ChannelMap,
    file: Path,
    *,
    name: str = "",
    stated: Sequence[Place] = (),
    notes: Sequence[str] = (),
) -> RigFile:
    """Return the recordings in the tables of a file.

    A table without force versus time, such as results next to the samples, is skipped and reported. The name
    of the runs is ``name``, or the name of the file. ``stated`` are the lines of documents about the file.
    ``notes`` are all lines of documents, which may explain columns and the sampling rate.
    """
    spoiled = spoiled_tables(tables, notes, file.name)
    omitted = [no_run(tables[k].title, reason, "warning") for k, reason in spoiled.items()]
    explaining = [*notes, *(line for table in tables[:1] for lines in table.lists.values() for line in lines)]
    tables = [
        converted(explained(table, explaining, chosen, file.name), notes, chosen)
        for k, table in enumerate(tables)
        if k not in spoiled
    ]
    parts: list[tuple[list[Piece], Sequence[Column], Sequence[str]]] = []
    faults: list[InputError] = []
    tables = [
        with_clocks(run)
        for table in tables
        for wide in wide_of_long(table)
        for block in side_by_side(wide, chosen)
        for run in one_force_each(with_run_numbers(block), chosen)
    ]
    lists = lines_by_title(tables, notes) if tables else {}
    for table, maps in segments_of(tables, chosen, file.name):
        try:
            parts.append(_part_of(table, chosen, maps, file, stated, lists))
        except InputError as fault:
            if len(tables) > 1 and table.title:
                part = "sheet" if table.layout.format == "Excel file" else "part"
                relocate(fault, file.name, f"{file.name}, {part} {table.title!r}")
            if not _is_other_kind(table, tables):
                faults.append(fault)
    if faults or not parts:
        error = ask_all(faults) if faults else InputError(place=file.name, found="no table holds a run")
        is_foreign = file.suffix.lower() not in format_suffixes() - GENERIC_SUFFIXES
        may_be_run = bool(parts) or any(_may_be_run(each, is_foreign=is_foreign) for each in tables)
        if isinstance(error, AskingError) and not may_be_run:
            raise NoRunError(faults=[error])
        raise error
    remarks = tuple(dict.fromkeys(note for _, _, notes in parts for note in notes))
    if len(parts) < len(tables):
        remarks += (f"{len(tables) - len(parts)} tables without force over time left out",)
    layout = replace(tables[0].layout, notes=(*tables[0].layout.notes, *remarks))
    pieces = [piece for own, _, _ in parts for piece in own]
    pieces = pieces if chosen.segments else join_pieces(pieces)
    read = _make_recordings(pieces, chosen, file, name or own_name(file), layout, tuple(parts[0][1]))
    return replace(read, findings=(*read.findings, *omitted))


def _may_be_run(table: Table, *, is_foreign: bool) -> bool:
    """Return True if a table may contain samples of a damper: a time, and a motion or a force.

    A foreign file has a suffix that rig files do not have. It must have both a motion and a force.
    """
    is_sweep = any(_is_other_quantity(name) and increases(table, name) for name in table.names)
    is_short = table.rows < LEAST_SAMPLES
    if not any(means(name, role) for role in QUANTITIES for name in table.names):
        # Unnamed columns may have any role.
        return not (is_short or is_foreign or is_sweep or all(map(_is_other_quantity, table.names)))
    samples = headers_of(table)
    names = [each.name for each in samples]
    motions = [name for name in names if means(name, "displacement") or means(name, "velocity")]
    has_time = bool(
        table.stamps or table.clocks or table.step_s or any(means(name, "time") for name in table.names)
    )
    if not has_time and (is_short or is_sweep or all(increases(table, name) for name in motions)):
        return False
    # The motion may be in a column without a unit or with the unit V.
    is_unclear = any(not unit_in_brackets(each.name) or "voltage" in each.of_unit for each in samples)
    has_force = any(means(name, "force") for name in names)
    if is_foreign or any(has_word(name, "model") and means(name, "force") for name in table.names):
        return bool(motions) and has_force
    return bool(motions) or (is_unclear and has_force and not is_short)


def _is_other_quantity(name: str) -> bool:
    """Return True if a column is named as a quantity that no run requires, such as a frequency."""
    unit = unit_in_brackets(name)
    is_other_unit = is_any_unit(unit) and not roles_of_unit(unit) and len(unit) > 1
    return is_other_unit or has_word(name, "other")


def _is_other_kind(table: Table, tables: Sequence[Table]) -> bool:
    """Return True if ``table`` has a column that no other table has, and a longer table has other columns."""
    return any(other.names != table.names and other.rows > table.rows for other in tables) and not (
        {column for other in tables if other is not table for column in other.names} >= {*table.names}
    )


def _part_of(
    table: Table,
    chosen: ChannelMap,
    maps: Mapping[int, ChannelMap],
    file: Path,
    stated: Sequence[Place],
    lists: Mapping[str, Sequence[str]],
) -> tuple[list[Piece], Sequence[Column], Sequence[str]]:
    """Return the pieces of a table, its columns, and notes. ``maps`` are the maps of tests by first row."""
    place = file.name
    chosen = maps.get(0, chosen)
    columns = find_columns(table, chosen, place)
    channels, time, interpolated, findings = _channels(table, columns, chosen, place)
    reversed_by_map = any(channel.sign < 0 for channel in chosen.channels.values())
    channels, remarks = with_stated_signs(channels, {} if reversed_by_map else signs_in(table.said))
    role = command_role(columns, chosen, place)
    measured = channels.get(role)
    edges, titles = ([*maps, len(time)], {}) if maps else run_edges(time, table.texts)
    pieces = []
    for number, (first, last) in enumerate(itertools.pairwise(edges)):
        title = next((titles[k] for k in sorted(titles, reverse=True) if k <= first), table.title)
        said = (*table.said, *lists.get(title, ()))
        values = measured[first:last] if measured is not None else None
        texts, own = (*places_of(title, said, file), *stated), maps.get(first, chosen)
        role, command, told = command_of(role, values, last - first, table, own, texts, place)
        others = {name: each[first:last] for name, each in channels.items() if name not in COMMAND_UNITS}
        piece = Piece(
            time=time[first:last],
            channels={**others, "command": command},
            title=title,
            findings=() if number else findings,
            start=start_of(table, float(time[0]), file, [each.text for each in stated]),
            command_unit=COMMAND_UNITS[role],
            told=told,
        )
        pieces.append(with_temperature(piece, chosen, texts))
    notes = [f"{', '.join(interpolated)} interpolated to the fastest clock"] if interpolated else []
    skipped = skipped_columns(table, columns, chosen)
    return pieces, columns, [*notes, *remarks, *([f"not used: {', '.join(skipped)}"] if skipped else [])]


def _channels(
    table: Table, columns: Sequence[Column], chosen: ChannelMap, place: str
) -> tuple[dict[str, FloatArray], FloatArray, tuple[str, ...], tuple[Finding, ...]]:
    """Return channels by role [SI], time [s], roles that were interpolated to one clock, and findings."""
    names = {column.role: column.name for column in columns if column.role != "time"}
    raw, interpolated, findings = to_one_clock(table, names, chosen, place)
    for column in columns:
        raw.setdefault(column.role, table.columns[column.name])
    channels: dict[str, FloatArray] = {}
    for column in columns:
        if not len(raw[column.role]):
            found = f"column {column.name!r} ({column.role}) holds no sample"
            raise InputError(place=place, found=found, remedy="The file may be cut off: copy it again")
        channels[column.role] = column.channel(chosen).to_si(raw[column.role], column.unit, place)
    stated = channels.pop("time", raw.get("time"))
    samples = max(map(len, channels.values()))
    for role in channels.keys() & {*COMMAND_UNITS, "temperature"}:
        known = channels[role][np.isfinite(channels[role])]
        if len(channels[role]) == 1 or len(known) == 1:  # One value applies to all samples.
            channels[role] = np.full(samples, [*known, np.nan][0])
    if stated is not None and len(stated) > 1:
        return channels, stated, interpolated, findings
    # A time column with a single number states the sampling interval.
    step = sampling_step(table, chosen, place) if stated is None else float(stated[0])
    return channels, np.arange(samples, dtype=np.float64) * step, interpolated, findings


def _make_recordings(
    pieces: Sequence[Piece],
    chosen: ChannelMap,
    file: Path,
    own_name: str,
    layout: Layout,
    columns: tuple[Column, ...],
) -> RigFile:
    """Return the recordings from the pieces of a file, with findings, inferences and starts."""
    stem = printable(own_name)
    recordings: list[Recording] = []
    findings: list[Finding] = []
    inferred: list[Inference] = []
    starts: list[Moment | None] = []
    for piece, name in zip(pieces, _names(pieces, chosen, stem), strict=True):
        zero = float(piece.time[0]) if len(pieces) > 1 or chosen.segments else 0.0
        parts = list(repaired_parts(replace(piece, time=piece.time - zero)))
        for number, part in enumerate(parts, 1):
            run = f"{name}_{number}" if len(parts) > 1 else name
            fields: dict[str, Any] = {role: part.channels.get(role) for role in CHANNELS if role != "time"}
            fields |= {"session": chosen.session or stem, "source": printable(str(file))}
            recordings.append(Recording(run, part.time, command_unit=part.command_unit, **fields))
            starts.append(piece.start and piece.start.later(zero))
            findings += [replace(finding, run=run) for finding in part.findings]
            inferred += [Inference(run, *told) for told in part.told]
    found = tuple(findings), tuple(inferred), tuple(starts)
    return RigFile(tuple(recordings), layout, columns, chosen, *found)


def _names(pieces: Sequence[Piece], chosen: ChannelMap, stem: str) -> list[str]:
    """Return the names of runs: the file name, and command, title or number if needed."""
    if len(pieces) == 1 and chosen.segments is None:
        return [stem]
    ends = [piece.title for piece in pieces]
    if chosen.segments or all(piece.told and piece.told[0][0] in COMMAND_UNITS for piece in pieces):
        ends = [f"{piece.channels['command'][0]:.2f}{piece.command_unit}" for piece in pieces]
    elif len({*ends}) < len(ends):
        ends = [f"{number}" for number in range(1, len(pieces) + 1)]
    before = [ends[:k].count(end) for k, end in enumerate(ends)]
    return [f"{stem}_{end}" + (f"_{n + 1}" if n else "") for end, n in zip(ends, before, strict=True)]
