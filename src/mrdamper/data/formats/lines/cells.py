"""The cells of one column in one block of a text, as texts and as numbers."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Layout, Moment, Texts, is_missing
from mrdamper.data.formats.timestamps import days_of, moment_of, seconds_of

_AROUND = ' \t"'  # Blanks and quotation marks around a cell are not part of its text.
_NOT_FINITE = re.compile(r"[+-]?(?:∞|inf|infinity|nan)", re.IGNORECASE)


def _form(point: str, group: str) -> re.Pattern[str]:
    """Return the pattern of a number: sign, digits before and after the point, exponent.

    Groups of thousands are accepted only before a decimal sign, or if a number has at least two of them,
    because 1,234 may mean 1.234.
    """
    grouped = rf"[0-9]{{1,3}}(?:[{group}'\s][0-9]{{3}})"
    return re.compile(
        rf"([+-]?)\s*({grouped}+(?=[{point}])|{grouped}{{2,}}|[0-9]*)(?:[{point}]([0-9]*))?"
        r"(?:[eEdD]([+-]?[0-9]+))?"
    )


_PLAIN = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?")
_FORMS = {".": _form(".", ","), ",": _form(",", ".")}


def number_in(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, such as ``1.0D+02``, ``- 1.5`` or ``1,234.5``, else None."""
    found = _FORMS["," if decimal == "," else "."].fullmatch(cell)
    if found is None:
        return float(cell.replace("∞", "inf")) if _NOT_FINITE.fullmatch(cell) else None
    sign, whole, part, power = found.groups()
    digits = re.sub(r"[^0-9]", "", whole)
    return float(f"{sign}{digits or 0}.{part or 0}e{power or 0}") if digits or part else None


def is_number(cell: str) -> bool:
    """Return True if a cell is a number, with either decimal sign."""
    return bool(_PLAIN.fullmatch(cell)) or any(number_in(cell, sign) is not None for sign in ".,")


class Cells:
    """The cells of one column in one block of rows.

    Parameters
    ----------
    texts : cells, None if empty
    numbers : number in each cell, None if the cell is not a number
    lines : line of each cell in the file, from 1
    """

    def __init__(self, texts: Texts, numbers: Sequence[float | None], lines: Sequence[int]) -> None:
        self.texts, self._lines = texts, lines
        self.numbers: FloatArray = np.array(numbers, dtype=np.float64)  # NaN if a cell is not a number
        is_filled = [cell is not None and not is_missing(cell) for cell in texts]
        self._is_wrong = [full and number is None for full, number in zip(is_filled, numbers, strict=True)]
        self.filled, self.bad = sum(is_filled), sum(self._is_wrong)
        self.mostly_text = self.bad > 0.5 * self.filled

    def first_bad(self) -> tuple[int, str]:
        """Return the line number and the text of the first cell that is not a number."""
        k = self._is_wrong.index(True)
        return self._lines[k], f"{self.texts[k]}"[:40]

    def with_dates(self, dates: Texts) -> Cells:
        """Return the cells with a date in front of each time, from the cell of ``dates`` in the same row."""
        texts: Texts = [time and f"{date} {time}" for date, time in zip(dates, self.texts, strict=True)]
        return Cells(texts, [None] * len(texts), self._lines)

    def as_times(self) -> tuple[Cells, Moment | None]:
        """Convert the cells to seconds from the first time stamp; NaN for a cell that is no time."""
        seconds, first = seconds_of(self.texts)
        numbers = [None if math.isnan(each) else each for each in seconds.tolist()]
        return Cells(self.texts, numbers, self._lines), first


def with_dates(columns: Sequence[Cells]) -> list[Cells]:
    """Return columns in which times of day are combined with the dates of an adjacent column."""
    found = [*columns]
    for k, column in enumerate(columns):
        first = moment_of(next(filter(None, column.texts), "")) if column.mostly_text else None
        if first is None or first.has_date:
            continue
        for beside in (*columns[max(k - 1, 0) : k], *columns[k + 1 : k + 2]):
            if beside.texts and not any(math.isnan(days_of(date)[0]) for date in {*beside.texts}):
                found[k] = column.with_dates(beside.texts)
    return found


def cells_of_lines(lines: Sequence[str], layout: Layout, count: int, first_line: int) -> list[Cells]:
    """Return the columns of a block without empty rows and comments."""
    delimiter = layout.delimiter
    if delimiter == " ":
        delimiter = "\t"
        lines = [re.sub(r"[ \t]+", "\t", line.strip(" \t")) for line in lines]
    rows: list[list[str | None]] = []
    numbers: list[int] = []
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    number = first_line
    for row in reader:
        cells = [cell.strip(_AROUND) or None for cell in row[:count]]
        if any(cells) and not row[0].startswith("#"):
            rows.append([*cells, *[None] * (count - len(cells))])
            numbers.append(number)
        number = first_line + reader.line_num
    columns = zip(*rows, strict=True) if rows else [()] * count
    return [
        Cells(
            [*column], [None if cell is None else number_in(cell, layout.decimal) for cell in column], numbers
        )
        for column in columns
    ]
