"""Batches of rows in SI and kelvin: the form in which records are prepared, counted and simulated.

A whole run is one batch. A long record is a file whose rows no memory holds, read in batches; its columns are
found as ``readers`` finds them, by headers and channel map. A batch is what the file holds, with whatever is
wrong in it: which rows can be used is the business of ``segments``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Rows
from mrdamper.data.proposal.clocks import require_one_clock, sampling_step
from mrdamper.data.proposal.column import Column
from mrdamper.data.proposal.commands import COMMAND_UNITS, command_role
from mrdamper.data.proposal.questions import Answer, with_answers
from mrdamper.data.proposal.refusals import no_column, no_command
from mrdamper.data.proposal.roles import find_columns
from mrdamper.data.readers import load_map, map_beside
from mrdamper.data.records import RigRun
from mrdamper.data.tables import open_rows
from mrdamper.data.words.labels import find_label, places_of
from mrdamper.errors import InputError
from mrdamper.files import is_folder
from mrdamper.quantities import QUANTITIES, CommandUnit

BATCH_ROWS = 1 << 18
"""Rows of a batch, counted from the first row: results do not depend on how a format is cut."""

_READ_ROWS = 1 << 20  # that are asked of a file at a time


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Some rows of a record, as measured; arrays of shape (n,), NaN where the file holds no number."""

    row: int  # of the file, of the first sample
    time: FloatArray  # [s]
    displacement: FloatArray  # [m]
    force: FloatArray  # [N]
    command: FloatArray  # [A or V]
    velocity: FloatArray | None = None  # [m/s]
    temperature: FloatArray | None = None  # [K]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of(cls, run: RigRun) -> Batch:
        """Return a whole run as one batch."""
        return cls(0, run.time, run.displacement, run.force, run.command, run.velocity, run.temperature)

    def part(self, rows: slice) -> Batch:
        """Return some of the rows, which follow on one another."""
        return replace(self.each(lambda column: column[rows]), row=self.row + rows.indices(len(self))[0])

    def each(self, change: Callable[[FloatArray], FloatArray]) -> Batch:
        """Return the batch with every column changed alike."""
        changed: dict[str, Any] = {
            name: None if (column := getattr(self, name)) is None else change(column) for name in _COLUMNS
        }
        return Batch(row=self.row, **changed)

    @classmethod
    def joined(cls, parts: Sequence[Batch]) -> Batch:
        """Return batches that follow on one another as one; a column that one of them lacks falls away."""
        if len(parts) == 1:
            return parts[0]
        whole: dict[str, Any] = {}
        for name in _COLUMNS:
            columns = [column for each in parts if (column := getattr(each, name)) is not None]
            whole[name] = np.concatenate(columns) if len(columns) == len(parts) else None
        return cls(row=parts[0].row, **whole)


_COLUMNS = tuple(field.name for field in fields(Batch))[1:]


@dataclass(frozen=True, slots=True, eq=False)
class LongRecord:
    """A record in a file: what its columns are, and its rows in batches.

    ``constant`` are roles that the channel map states for the whole record [SI]; ``step_s`` is the sampling
    interval of a file without a time column; ``rows`` is None where only reading tells how many there are.
    """

    path: Path
    understood: str
    columns: tuple[Column, ...]
    channels: ChannelMap
    constant: dict[str, float]
    command_role: str
    step_s: float | None
    rows: int | None
    source: Rows
    flip_force: bool = False  # turn the sign of the force, of a cell that counts compression as positive

    @property
    def command_unit(self) -> CommandUnit:
        return COMMAND_UNITS[self.command_role]

    def batches(self, start: int = 0, rows: int = BATCH_ROWS) -> Iterator[Batch]:
        """Give the rows from ``start`` on, so many in each batch but the last.

        Raises
        ------
        InputError
            The file cannot be read, or a cell is no number.
        """
        taken = [column for column in self.columns if not (column.role == "time" and self.step_s is not None)]
        roles = {column.role: k for k, column in enumerate(taken)}
        place = self.path.name
        row = start
        for raw in _regular(self._raw([column.name for column in taken], start), rows):
            si = [
                column.channel(self.channels).to_si(raw[k], column.unit, place)
                for k, column in enumerate(taken)
            ]
            n = len(raw[0])

            held = {role: np.full(n, value) for role, value in self.constant.items()}
            channels = held | {role: si[k] for role, k in roles.items()}
            time = channels.get("time")
            if time is None:
                time = np.arange(row, row + n, dtype=np.float64) * np.float64(self.step_s or 0.0)
            displacement, force, command = (
                channels[role] for role in ("displacement", "force", self.command_role)
            )
            yield Batch(
                row,
                time,
                displacement,
                -force if self.flip_force else force,
                command,
                channels.get("velocity"),
                channels.get("temperature"),
            )
            row += n

    def _raw(self, names: list[str], start: int) -> Iterator[list[FloatArray]]:
        """Give rows as the file gives them, the next ones being read while these are worked on."""
        parts = self.source.read(names, start, _READ_ROWS)
        reader = ThreadPoolExecutor(1, thread_name_prefix="mrdamper-rows")
        try:
            ahead: Future[list[FloatArray] | None] = reader.submit(next, parts, None)
            while (part := ahead.result()) is not None:
                ahead = reader.submit(next, parts, None)
                yield part
        finally:
            reader.shutdown(wait=True, cancel_futures=True)


def open_record(
    path: str | Path, channels: ChannelMap | str | Path | None = None, answers: Sequence[Answer] = ()
) -> LongRecord:
    """Return a long record; of its rows only the first few are read.

    Without ``channels`` the map that lies beside the file holds, else the headers alone.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or the map splits the file into tests.
    """
    file = Path(path)
    if is_folder(file):
        raise InputError(place=file, found="is a folder", expected="the file of one record")
    chosen = with_answers(load_map(map_beside(file) if channels is None else channels), answers, file.name)
    place = file.name
    if chosen.segments is not None:
        raise InputError(
            place=place,
            found="[segments] of the channel map split the file into tests",
            expected="one record",
            remedy="Split the file, or leave the table out",
        )
    source = open_rows(file, chosen.file)
    table = source.table
    columns = find_columns(table, chosen, place)
    require_one_clock(table, columns, place)
    command = command_role(columns, chosen, place)
    constant = {role: value for role, value in chosen.constant.items() if role in QUANTITIES}
    texts = places_of(table.title, table.said, file)
    for role in ("temperature",) if command else ("current", "voltage", "temperature"):
        label = find_label(texts, role)
        if label is not None and len(label.values) == 1 and role not in {each.role for each in columns}:
            constant.setdefault(role, label.values[0])
            command = command or (role if role in COMMAND_UNITS else "")
    if not command or not any(column.role == "displacement" for column in columns):
        raise no_command(table, place) if not command else no_column("displacement", table, place)
    timed = any(column.role == "time" for column in columns)
    step = None if timed else sampling_step(table, chosen, place)
    for column in columns:  # a unit that is none is said before hours of reading
        column.channel(chosen).to_si(np.zeros(1), column.unit, place)
    rows = table.rows or None
    return LongRecord(file, table.layout.in_words(), columns, chosen, constant, command, step, rows, source)


def _regular(parts: Iterator[list[FloatArray]], rows: int) -> Iterator[list[FloatArray]]:
    """Give the same rows again, so many at a time."""
    waiting: list[list[FloatArray]] = []
    held = 0
    for part in parts:
        waiting.append(part)
        held += len(part[0])
        if held < rows:
            continue
        whole = waiting[0] if len(waiting) == 1 else [np.concatenate(c) for c in zip(*waiting, strict=True)]
        at = 0
        for at in range(0, held - rows + 1, rows):
            yield [column[at : at + rows] for column in whole]
        at += rows
        waiting, held = ([[column[at:] for column in whole]], held - at) if at < held else ([], 0)
    if held:
        yield [np.concatenate(c) for c in zip(*waiting, strict=True)]
