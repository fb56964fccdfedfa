"""The cells of a block where Polars is not installed: the same answers by Python alone, and slower."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.lines.cells import AROUND
from mrdamper.data.formats.table import MISSING_MARKS, Layout, Texts
from mrdamper.data.formats.timestamps import Timestamps

__all__ = ["PlainCells", "plain_columns"]

_MISSING = {"", *MISSING_MARKS}
_NAN = re.compile(r"[+-]?nan", re.IGNORECASE)
_FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|[+-]?(?:inf|infinity|nan)", re.IGNORECASE
)


class PlainCells:
    """One column of one block, with what ``Cells`` has."""

    def __init__(self, cells: Sequence[str | None], lines: Sequence[int], decimal: str) -> None:
        self._text = [None if cell is None else cell.strip(AROUND) for cell in cells]
        self._lines = lines
        self._parsed = np.array([_number(cell, decimal) for cell in self._text], dtype=np.float64)
        said_none = np.array([bool(cell and _NAN.fullmatch(cell)) for cell in self._text], dtype=bool)
        self._there = ~np.isnan(self._parsed) | said_none
        known = np.array([cell not in _MISSING and cell is not None for cell in self._text], dtype=bool)
        self._wrong = known & ~self._there
        self.bad = int(self._wrong.sum())
        self.filled = int(self._there.sum()) + self.bad

    @property
    def mostly_text(self) -> bool:
        """Tell whether more than half of the filled cells are no numbers."""
        return self.bad > 0.5 * self.filled

    def numbers(self) -> FloatArray:
        """Return the numbers, NaN where there is none."""
        return self._parsed.copy()

    def texts(self) -> Texts:
        """Return the cells as they stand, without blanks and quotation marks around them."""
        return [*self._text]

    def first_bad(self) -> tuple[int, str]:
        """Return the line of the first cell that is no number, and the cell."""
        k = int(np.argmax(self._wrong))
        return self._lines[k], str(self._text[k])[:40]

    def hold_times(self, reader: Timestamps, at_least: float = 0.0) -> bool:
        """Take the cells as times of day or dates, if at least a share of them are; tell whether."""
        if at_least and not reader.may_be(self._text[:100]):
            return False
        found = reader.seconds(self.texts())
        if np.isfinite(found).sum() < at_least * self.filled:
            return False
        self._wrong = (self._wrong | self._there) & np.isnan(found)
        self._parsed, self._there, self.bad = found, ~np.isnan(found), int(self._wrong.sum())
        return True


def plain_columns(content: str, layout: Layout, count: int, first_line: int) -> list[PlainCells]:
    """Return the columns of a block's text; rows that hold nothing and comments are left out."""
    rows: list[list[str | None]] = []
    lines: list[int] = []
    reader = csv.reader(io.StringIO(content, newline=""), delimiter=layout.delimiter)
    number = first_line
    for row in reader:
        cells = [cell or None for cell in row[:count]]
        if any(cells) and not (row[0] or "").startswith("#"):
            rows.append([*cells, *[None] * (count - len(cells))])
            lines.append(number)
        number = first_line + reader.line_num
    columns = zip(*rows, strict=True) if rows else [()] * count
    return [PlainCells(column, lines, layout.decimal) for column in columns]


def _number(cell: str | None, decimal: str) -> float:
    """Return the number that a cell is; not a number where it is none."""
    if cell is None:
        return np.nan
    spelled = cell.replace(".", "?", 1).replace(",", ".", 1) if decimal == "," else cell
    return float(spelled) if _FLOAT.fullmatch(spelled) else np.nan
