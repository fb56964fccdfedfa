"""The cells of one column in one block of a text: as they stand, as numbers, and which are none.

Polars is loaded with the first block that is not of plain numbers alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import MISSING_MARKS, Texts
from mrdamper.data.formats.timestamps import Timestamps

if TYPE_CHECKING:
    import polars as pl

__all__ = ["AROUND", "Cells"]

AROUND = ' \t"'  # stands around a cell's text


class Cells:
    """One column of one block.

    ``bad`` counts the cells that are filled and no numbers, ``filled`` those that are filled.
    """

    def __init__(self, frame: pl.DataFrame, name: str) -> None:
        self._text, self._parsed = frame[name], frame[f"{name} parsed"]
        self._lines, self._wrong = frame["row"], frame[f"{name} wrong"]
        self.bad = int(self._wrong.sum())
        self.filled = len(self._parsed) - self._parsed.null_count() + self.bad

    @staticmethod
    def asked(name: str, decimal: str) -> list[pl.Expr]:
        """Return what is asked about the column of a name: its cells, as numbers, and which are none."""
        import polars as pl

        text = pl.col(name).str.strip_chars(AROUND)
        spelled = text
        if decimal == ",":
            spelled = text.str.replace(".", "?", literal=True).str.replace(",", ".", literal=True)
        parsed = spelled.cast(pl.Float64, strict=False)
        wrong = (~text.is_in(("", *MISSING_MARKS))).fill_null(value=False) & parsed.is_null()
        return [text, parsed.alias(f"{name} parsed"), wrong.alias(f"{name} wrong")]

    @property
    def mostly_text(self) -> bool:
        """Tell whether more than half of the filled cells are no numbers."""
        return self.bad > 0.5 * self.filled

    def numbers(self) -> FloatArray:
        """Return the numbers, NaN where there is none."""
        return np.array(self._parsed.fill_null(float("nan")).to_numpy(), dtype=np.float64)

    def texts(self) -> Texts:
        """Return the cells as they stand, without blanks and quotation marks around them."""
        return self._text.to_list()

    def first_bad(self) -> tuple[int, str]:
        """Return the line of the first cell that is no number, and the cell."""
        k = int(self._wrong.arg_max() or 0)
        return int(self._lines[k]), str(self._text[k])[:40]

    def hold_times(self, reader: Timestamps, at_least: float = 0.0) -> bool:
        """Take the cells as times of day or dates, if at least a share of them are; tell whether."""
        import polars as pl

        if at_least and not reader.may_be(self._text.head(100).to_list()):
            return False
        found = pl.Series(reader.seconds(self._text), nan_to_null=True)
        if found.len() - found.null_count() < at_least * self.filled:
            return False
        self._wrong = (self._wrong | self._parsed.is_not_null()) & found.is_null()
        self._parsed, self.bad = found, int(self._wrong.sum())
        return True
