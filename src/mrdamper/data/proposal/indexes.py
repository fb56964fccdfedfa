"""Indexes: small tables that name the files beside them, with the command and the temperature of each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.data.finding import Finding
from mrdamper.data.formats.excel import is_workbook
from mrdamper.data.formats.table import Table
from mrdamper.data.formats.text import is_text
from mrdamper.data.proposal.questions import Answer
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError

_MOST_BYTES, _HEAD_BYTES = 1 << 17, 1 << 11
_CELLS = re.compile(r"[,;|\t\r\n]")
_SAID = frozenset({"current", "voltage", "temperature"})


@dataclass(frozen=True, slots=True)
class Index:
    """A table that names files, and what it says of each."""

    path: Path
    answers: Mapping[Path, tuple[Answer, ...]]

    @property
    def finding(self) -> Finding:
        """What was taken from it."""
        return Finding(
            kind="index",
            severity="note",
            channel="",
            run=self.path.name,
            found=f"{self.path.name} says command or temperature of {len(self.answers)} files beside it",
            effect="They hold where a file does not say its own",
            remedy="Nothing, if it is right",
        )


def read_indexes(files: Sequence[Path]) -> tuple[Index, ...]:
    """Return the indexes among files: a column of words names others of their folder, or these' stems."""
    folders: dict[Path, dict[str, Path]] = {}
    for path in files:
        folders.setdefault(path.parent, {}).update({path.stem: path, path.name: path})
    found = []
    for path in files:
        others = folders[path.parent]
        if not _may_name(path, others):
            continue
        with suppress(InputError):
            answers = {
                file: said for table in read_tables(path) for file, said in _answers(table, others).items()
            }
            if answers:
                found.append(Index(path, answers))
    return tuple(found)


def _may_name(path: Path, others: Mapping[str, Path]) -> bool:
    """Tell by the first bytes of a small file whether a cell may name another; a workbook may."""
    try:
        if not path.is_file() or path.stat().st_size > _MOST_BYTES:  # a pipe would be waited for
            return False
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError:  # what cannot be read is told where it is read
        return False
    if not is_text(head):
        return is_workbook(head)
    cells = (cell.strip(' "') for cell in _CELLS.split(head.decode("utf-8", "replace")))
    return any(others.get(cell, path) != path for cell in cells)


def _answers(table: Table, others: Mapping[str, Path]) -> dict[Path, tuple[Answer, ...]]:
    """Return what the rows of a table say of the files that most of them name."""
    lists = [[others.get(cell or "") for cell in cells] for cells in table.texts.values()]
    named = next((files for files in lists if 2 * sum(map(bool, files)) > len(files)), [])
    columns = [(header, table.columns[name]) for name in table.columns if (header := parse_header(name))]
    columns = [(header, values) for header, values in columns if header[0] in _SAID and header[1]]
    said = {
        file: tuple(
            Answer(role, "value", f"{values[row]:.9g} {unit}")
            for (role, unit), values in columns
            if np.isfinite(values[row])
        )
        for row, file in enumerate(named)
        if file is not None
    }
    return {file: answers for file, answers in said.items() if answers}
