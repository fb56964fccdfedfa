"""Excel workbooks (.xlsx, .xlsm): each sheet that holds rows of numbers, or the one that is named.

A workbook is an archive, which can unpack to more than the memory. The unpacked size and the number of cells
are counted before the workbook is read.
"""

from __future__ import annotations

import copy
import re
import sys
import zipfile
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.lines.header import Header, find_data, find_decimal, holds_samples, read_header
from mrdamper.data.formats.table import (
    MISSING_MARKS,
    MOST_HEADER_LINES,
    FileOptions,
    Layout,
    Table,
    Texts,
    distinct_names,
    load_extra,
)
from mrdamper.data.formats.timestamps import Timestamps
from mrdamper.errors import InputError

_MOST_UNPACKED = 1 << 29  # bytes
_MOST_PARTS = 2000  # files in the archive
_MOST_CELLS = 32_000_000  # from the first to the last one, empty ones too
_PIECE = 1 << 20
_REMEDY = "save it again as .xlsx, or export the run as CSV"
_CELL = re.compile(rb"\br\s*=\s*[\"']([A-Za-z]{1,9})(\d{1,12})[\"']")

Row = list[Any]


def is_workbook(head: bytes) -> bool:
    """Tell whether the first bytes are those of an archive, as a workbook is."""
    return head.startswith(b"PK\x03\x04")


def read_workbook(path: Path, options: FileOptions) -> Table:
    """Return the table on a sheet of a workbook."""
    _require_harmless(path)
    calamine = load_extra("python_calamine", "python-calamine", "Excel files")
    book = calamine.CalamineWorkbook.from_path(path)
    names = list(book.sheet_names)
    if options.part and options.part not in names:
        raise InputError(
            place=path, found=f"no sheet {options.part!r}; the sheets are: {', '.join(map(repr, names))}"
        )
    found = []
    for name in [options.part] if options.part else names:
        rows = book.get_sheet_by_name(name).iter_rows()
        above = list(islice(rows, MOST_HEADER_LINES))
        lines = ["\t".join(map(_spelled, row)) for row in above]
        first = find_data(lines, "\t")[1]
        if first is not None:
            spelled = [cell for row in above[first:] for cell in row if isinstance(cell, str)]
            found.append((name, lines, first, chain(above[first:], rows), spelled))
    found = [each for each in found if holds_samples(each[1], "\t")] or found
    if not found:
        raise InputError(
            place=path,
            found=f"no sheet with rows of numbers in {', '.join(map(repr, names))}",
            expected="one",
        )
    name, lines, first, rows, spelled = found[0]
    decimal = options.decimal or find_decimal(path, spelled, "\t")
    table = _table(path, name, read_header(lines, first, "\t"), first, rows, decimal)
    return replace(table, more=tuple(name for name, *_ in found[1:]))


def _table(path: Path, sheet: str, header: Header, first: int, rows: Iterator[Row], decimal: str) -> Table:
    order = distinct_names(header.names)
    numbers: dict[int, array[float]] = {}
    words: dict[int, Texts] = {}
    starts: dict[int, datetime] = {}  # of columns of times
    count, below = 0, 0  # rows, and rows of words since the last one
    for at, given in enumerate(rows, first + 1):
        row = [*given, *[None] * len(order)]  # a row may be shorter than the header
        if not count:
            texts = {
                k
                for k, cell in enumerate(row)
                if isinstance(cell, str) and cell and _number(cell, decimal) is None
            }
            numbers = {k: array("d") for k in range(len(order)) if k not in texts}
            words = {k: [] for k in range(len(order)) if k in texts}
            starts = {k: start for k in numbers if (start := _moment(row[k])) is not None}
        if all(cell in {"", None} for cell in row):
            continue
        if count and _is_of_words(row, numbers, decimal):
            below += 1
            continue
        if below and below < count:
            raise InputError(
                place=f"{path}, sheet {sheet!r}, row {at}",
                found="numbers go on below rows of words",
                expected="one table on a sheet",
                remedy="Put each table on a sheet of its own",
            )
        count += 1
        for k, column in numbers.items():
            value = _seconds(row[k], starts[k]) if k in starts else _number(row[k], decimal)
            if value is None:
                wanted = "time" if k in starts else "number"
                raise InputError(
                    place=f"{path}, sheet {sheet!r}, row {at}",
                    found=f"column {order[k]!r} holds {str(row[k])[:40]!r}",
                    expected=f"a {wanted}",
                    remedy="Correct the cell, or leave it out with its row",
                )
            column.append(value)
        for k, cells in words.items():
            cells.append(None if row[k] is None else str(row[k]))
    columns = {k: np.array(column, dtype=np.float64) for k, column in numbers.items()}
    columns |= {k: times for k, cells in words.items() if (times := Timestamps.in_texts(cells)) is not None}
    stamps = frozenset(order[k] for k in {*starts, *words} & {*columns})
    return Table(
        names=tuple(order),
        columns={order[k]: column for k, column in columns.items()},
        texts={order[k]: cells for k, cells in words.items() if k not in columns},
        layout=Layout(
            "Excel file",
            header_lines=first,
            part=sheet,
            notes=(f"{below} row{'s' if below > 1 else ''} of words below the numbers",) if below else (),
        ),
        rows=count,
        units=dict.fromkeys(stamps, "s"),
        stamps=stamps,
        title=sheet,
        said=header.said,
    )


def _is_of_words(row: Row, numbers: Mapping[int, object], decimal: str) -> bool:
    """Tell whether the first column of numbers holds a word here, or no column of numbers holds one."""
    cells = [row[k] for k in numbers]
    if not cells:
        return False
    if isinstance(cells[0], str) and cells[0].strip() and cells[0] not in MISSING_MARKS:
        return _number(cells[0], decimal) is None and cells[0].lstrip("'")[:1].isalpha()
    return not any(
        isinstance(cell, int | float | datetime | time | timedelta)
        or (isinstance(cell, str) and cell and _number(cell, decimal) is not None)
        for cell in cells
    )


def _moment(cell: object) -> datetime | None:
    """Return the moment in a cell, a time of day or a duration as one of the first day; else None."""
    if isinstance(cell, datetime):
        return cell
    if isinstance(cell, time):
        return datetime.combine(date.min, cell)
    return datetime.combine(date.min, time()) + cell if isinstance(cell, timedelta) else None


def _seconds(cell: object, start: datetime) -> float | None:
    """Return the time of a cell after the first, NaN for an empty one, None when it holds something else."""
    if cell is None or cell == "":
        return float("nan")
    moment = _moment(cell)
    return None if moment is None else (moment - start).total_seconds()


def _number(cell: object, decimal: str) -> float | None:
    """Return the number in a cell, NaN for an empty one, None when it is something else."""
    if cell is None or cell == "":
        return float("nan")
    if isinstance(cell, bool) or not isinstance(cell, int | float | str):
        return None
    if isinstance(cell, str):
        if cell.strip() in MISSING_MARKS:
            return float("nan")
        try:
            return float(cell.replace(",", ".") if decimal == "," else cell)
        except ValueError:
            return None
    return float(cell)


def _spelled(cell: object) -> str:
    return "" if cell is None else f"{cell}".replace("\t", " ").replace("\n", " ")


def _other_archive(names: set[str]) -> str:
    """Tell what a ZIP archive without a workbook is, and what to do with it."""
    if "content.xml" in names:
        return "an OpenDocument file: save its sheet as .xlsx or CSV"
    return "a ZIP archive without a workbook; expected .xlsx. Unpack it first"


def _require_harmless(path: Path) -> None:
    """Refuse an archive that is no workbook, or unpacks to more than any run needs."""
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        names = {member.filename for member in members}
        if "xl/workbook.xml" not in names:
            raise InputError(place=path, found=f"is {_other_archive(names)}")
        if len(members) > _MOST_PARTS:
            raise InputError(
                place=path,
                found=f"holds {len(members)} parts",
                expected=f"an Excel file of at most {_MOST_PARTS}",
            )
        if sum(member.file_size for member in members) > _MOST_UNPACKED:
            raise InputError(
                place=path,
                found=f"unpacks to more than {_MOST_UNPACKED >> 20} MB",
                expected="one run",
                remedy="Export it as CSV",
            )
        for member in members:
            _require_true_size(path, archive, member)


def _require_true_size(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Refuse a member that unpacks to more than it states, and a sheet whose cells span too much."""
    if member.compress_type not in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
        raise InputError(place=path, found=f"{member.filename} is packed in an unusual way; {_REMEDY}")
    sheet = member.filename.startswith("xl/worksheets/")
    tail, row, column, size = b"", 0, 0, 0
    for piece in _pieces(archive, member):
        size += len(piece)
        if size > member.file_size:
            raise InputError(
                place=path,
                found=(
                    f"{member.filename} unpacks to more than the {member.file_size} bytes that it states "
                    f"(damaged, or a trap); {_REMEDY}"
                ),
            )
        if not sheet:
            continue
        for letters, digits in set(_CELL.findall(tail + piece)):
            row, column = max(row, int(digits)), max(column, _column_number(letters))
        tail = piece[-40:]
        if row * column > _MOST_CELLS:
            raise InputError(
                place=path,
                found=f"{member.filename} spans {row} rows and {column} columns",
                expected=f"at most {_MOST_CELLS} cells",
                remedy="Delete what lies far from the table, or export it as CSV",
            )


def _pieces(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Iterator[bytes]:
    """Give what a member really unpacks to, piece by piece, whatever size its entry states."""
    whole: Any = copy.copy(member)
    whole.file_size, whole.CRC = sys.maxsize, None  # else its stream would end at the stated size
    with archive.open(whole) as stream:
        while piece := stream.read(_PIECE):
            yield piece


def _column_number(letters: bytes) -> int:
    number = 0
    for letter in letters.upper():
        number = 26 * number + letter - 64
    return number
