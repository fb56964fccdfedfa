"""The cells of one column in one block of a text: as they stand, as numbers, and which are none.

Polars takes a block apart, and is loaded with the first one that is not of plain numbers alone; where it is
not installed, Python gives the same answers, and slower.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import MISSING_MARKS, Layout, Texts
from mrdamper.data.formats.timestamps import Timestamps

if TYPE_CHECKING:
    import polars as pl

_AROUND = ' \t"'  # stands around a cell's text
_MISSING = ("", *MISSING_MARKS)
_FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|[+-]?(?:inf|infinity|nan)", re.IGNORECASE
)


class Cells:
    """One column of one block.

    ``bad`` counts the cells that are filled and no numbers, ``filled`` those that are filled.
    """

    def __init__(
        self,
        texts: pl.Series | Texts,  # without blanks and quotation marks around them
        numbers: FloatArray,  # NaN where a cell is none
        filled: NDArray[np.bool_],
        wrong: NDArray[np.bool_],  # filled, and no number
        lines: pl.Series | Sequence[int],
    ) -> None:
        self._texts, self._numbers, self._lines = texts, numbers, lines
        self._filled, self._wrong = filled, wrong
        self.filled, self.bad = int(filled.sum()), int(wrong.sum())

    @property
    def mostly_text(self) -> bool:
        """Tell whether more than half of the filled cells are no numbers."""
        return self.bad > 0.5 * self.filled

    def numbers(self) -> FloatArray:
        """Return the numbers, NaN where there is none."""
        return self._numbers

    def texts(self) -> Texts:
        """Return the cells as they stand, without blanks and quotation marks around them."""
        return list(self._texts)

    def first_bad(self) -> tuple[int, str]:
        """Return the line of the first cell that is no number, and the cell."""
        k = int(np.argmax(self._wrong))
        return int(self._lines[k]), str(self._texts[k])[:40]

    def as_times(self, reader: Timestamps) -> Cells:
        """Return the cells as times of day or dates: numbers are seconds, and any other cell is wrong."""
        found = reader.seconds(self._texts)
        return Cells(self._texts, found, self._filled, self._filled & np.isnan(found), self._lines)


def cells_of_frame(frame: pl.DataFrame, name: str, decimal: str) -> Cells:
    """Return a column of a frame of texts; its column ``row`` holds the lines."""
    import polars as pl

    text = pl.col(name).str.strip_chars(_AROUND)
    spelled = text
    if decimal == ",":
        spelled = text.str.replace(".", "?", literal=True).str.replace(",", ".", literal=True)
    number = spelled.cast(pl.Float64, strict=False)
    filled = ~text.is_in(_MISSING).fill_null(value=True)
    read = frame.select_seq(
        text.alias("text"),
        number.fill_null(float("nan")).alias("number"),
        filled.alias("filled"),
        (filled & number.is_null()).alias("wrong"),
    )
    numbers, there, wrong = (read[each].to_numpy() for each in ("number", "filled", "wrong"))
    return Cells(read["text"], np.array(numbers), there, wrong, frame["row"])


def cells_of_text(content: str, layout: Layout, count: int, first_line: int) -> list[Cells]:
    """Return the columns of a block's text; rows that hold nothing and comments are left out."""
    rows: list[list[str | None]] = []
    lines: list[int] = []
    reader = csv.reader(io.StringIO(content, newline=""), delimiter=layout.delimiter)
    number = first_line
    for row in reader:
        cells = [cell or None for cell in row[:count]]
        if any(cells) and not row[0].startswith("#"):
            rows.append([*cells, *[None] * (count - len(cells))])
            lines.append(number)
        number = first_line + reader.line_num
    return [_cells([row[k] for row in rows], lines, layout.decimal) for k in range(count)]


def _cells(column: Sequence[str | None], lines: Sequence[int], decimal: str) -> Cells:
    texts = [None if cell is None else cell.strip(_AROUND) for cell in column]
    numbers = [None if cell is None else _number(cell, decimal) for cell in texts]
    filled = np.array([cell is not None and cell not in _MISSING for cell in texts], dtype=bool)
    none = np.array([number is None for number in numbers], dtype=bool)
    return Cells(texts, np.array(numbers, dtype=np.float64), filled, filled & none, lines)


def _number(cell: str, decimal: str) -> float | None:
    """Return the number that a cell is; None where it is none."""
    spelled = cell.replace(".", "?", 1).replace(",", ".", 1) if decimal == "," else cell
    return float(spelled) if _FLOAT.fullmatch(spelled) else None
