"""Read tables from the sheets of Excel and OpenDocument workbooks (.xlsx, .xlsm, .xlsb, .xls, .ods).

A workbook is a zip archive, except .xls. The unpacked content can be larger than the memory. Therefore the
unpacked size is checked before the workbook is read.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from itertools import chain, islice
from pathlib import Path
from typing import Any

from mrdamper.data.formats.lines.encodings import Text
from mrdamper.data.formats.lines.header import find_data, find_decimal, holds_samples
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import FileOptions, NoTableError, Table, load_extra
from mrdamper.data.formats.text import read_text
from mrdamper.errors import InputError

ZIP_SIGNATURE = b"PK\x03\x04"
WORKBOOK_SIGNATURES = (ZIP_SIGNATURE, b"\xd0\xcf\x11\xe0")  # The second one is that of .xls files.

Row = list[Any]


def read_workbook(path: Path, options: FileOptions) -> Table:
    """Return the table on the named sheet or the first with samples; ``more`` names the others."""
    book = _open(path)
    names = list(book.sheet_names)
    if options.part and options.part not in names:
        sheets_found = ", ".join(map(repr, names))
        raise InputError(place=path, found=f"no sheet {options.part!r}; the sheets are: {sheets_found}")
    found = []
    sheets: dict[str, list[str]] = {}
    for name in [options.part] if options.part else names:
        rows = book.get_sheet_by_name(name).iter_rows()
        above = list(islice(rows, SETTINGS.header_lines_max))
        sheets[name] = lines = ["\t".join(map(_spelled, row)) for row in above]
        if find_data(lines, "\t")[1] is not None:
            found.append((name, lines, chain(above, rows)))
    # A sheet that contains the names of several other sheets is a list of runs.
    cells = {name: "\t".join(lines).split("\t") for name, lines in sheets.items()}
    listing = {name for name in sheets if len({*cells[name]} & ({*names} - {name})) > 1}
    found = [each for each in found if each[0] not in listing and holds_samples(each[1], "\t")] or found
    if not found:
        fault = f"no sheet with rows of numbers in {', '.join(map(repr, names))}"
        raise NoTableError(place=path, found=fault, expected="one")
    name, lines, every = found[0]
    lists = {other: above for other, above in sheets.items() if other not in {each[0] for each in found}}
    more = tuple(other for other, *_ in found[1:])
    return replace(_table(path, name, list(every), options), more=more, lists=lists)


def sheet_lines(path: Path) -> list[str]:
    """Return all rows of an Excel or OpenDocument file, with tabs between the cells."""
    book = _open(path)
    sheets = [_merged_rows(book.get_sheet_by_name(name)) for name in book.sheet_names]
    return ["\t".join(map(_spelled, row)) for rows in sheets for row in rows]


def _merged_rows(sheet: Any) -> list[Row]:  # noqa: ANN401 - python-calamine has no types
    """Return the rows of a sheet. The value of merged cells is repeated in each row of the first column."""
    rows = [list(row) for row in sheet.iter_rows()]
    left = (sheet.start or (0, 0))[1]  # The rows begin at the first column with a value.
    width = len(rows[0]) if rows else 0
    for (first, column), (last, _) in sheet.merged_cell_ranges or ():
        # Merged cells may be outside of the filled area.
        for row in rows[first + 1 : last + 1] if 0 <= column - left < width else ():
            row[column - left] = rows[first][column - left]
    return rows


def _open(path: Path) -> Any:  # noqa: ANN401 - python-calamine has no types
    _require_harmless(path)
    calamine = load_extra("python_calamine", "python-calamine", "Excel files")
    return calamine.CalamineWorkbook.from_path(path)


def _table(path: Path, sheet: str, rows: Sequence[Row], options: FileOptions) -> Table:
    words = [cell for row in rows[: SETTINGS.header_lines_max] for cell in row if isinstance(cell, str)]
    decimal = options.decimal or find_decimal(f"{path}", words, "\t") or "."
    lines = ["\t".join(_spelled(cell, decimal) for cell in row) for row in rows]
    table = read_text(Text(f"{path}, sheet {sheet!r}", lines), FileOptions(delimiter="\t", decimal=decimal))
    own: dict[str, Any] = {"format": "Excel file", "delimiter": "", "decimal": "", "part": sheet}
    first, *others = (
        replace(each, layout=replace(each.layout, **own), title=sheet) for each in (table, *table.following)
    )
    return replace(first, following=tuple(others))


def _spelled(cell: object, decimal: str = ".") -> str:
    """Return a cell as text; a duration is written like a time of day."""
    if isinstance(cell, timedelta):
        cell = datetime.combine(date.min, time()) + cell
    if isinstance(cell, datetime | time):
        return cell.isoformat()
    text = "" if cell is None else f"{cell}".replace("\t", " ").replace("\n", " ").replace('"', "")
    return text.replace(".", decimal) if isinstance(cell, float) else text


def _require_harmless(path: Path) -> None:
    """Raise InputError if an archive is not a workbook, or if its unpacked size is too large."""
    with path.open("rb") as stream:
        if stream.read(len(ZIP_SIGNATURE)) != ZIP_SIGNATURE:
            return  # A sheet of a .xls file has at most 65,536 rows and 256 columns.
    with zipfile.ZipFile(path) as archive:
        if {"xl/workbook.xml", "xl/workbook.bin", "content.xml"}.isdisjoint(archive.namelist()):
            found = "is a ZIP archive without a workbook"
            raise NoTableError(place=path, found=found, remedy="Unpack it first")
        if sum(member.file_size for member in archive.infolist()) > SETTINGS.workbook_unpacked_max_bytes:
            found = f"unpacks to more than {SETTINGS.workbook_unpacked_max_bytes >> 20} MB"
            raise InputError(place=path, found=found, remedy="Export it as CSV")
