"""The cells of one column in one block of a text: as they stand, as numbers, and which are none.

Two ways to the same answer (a test compares them): ``FewCells`` for blocks of some kB, in Python, sooner than
Polars is loaded; ``ManyCells`` for all others, by Polars.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Texts
from mrdamper.data.formats.timestamps import Stamps

if TYPE_CHECKING:
    import polars as pl

__all__ = ["Cells", "FewCells", "ManyCells"]

_AROUND = ' \t"'  # stands around a cell's text
_FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|[+-]?(?:inf|infinity|nan)", re.IGNORECASE
)


class Cells(ABC):
    """One column of one block."""

    bad: int  # cells that are filled, and no numbers
    filled: int

    @property
    def mostly_text(self) -> bool:
        """Tell whether more than half of the filled cells are no numbers."""
        return self.bad > 0.5 * self.filled

    @abstractmethod
    def numbers(self) -> FloatArray:
        """Return the numbers, NaN where there is none."""

    @abstractmethod
    def texts(self) -> Texts:
        """Return the cells as they stand, without blanks and quotation marks around them."""

    @abstractmethod
    def first_bad(self) -> tuple[int, str]:
        """Return the line of the first cell that is no number, and the cell."""

    @abstractmethod
    def hold_times(self, reader: Stamps, at_least: float = 0.0) -> bool:
        """Take the cells as times of day or dates, if at least a share of them are; tell whether."""


class FewCells(Cells):
    """Cells in a list, None where nothing stands."""

    def __init__(self, cells: Sequence[str | None], lines: Sequence[int], decimal: str) -> None:
        self._texts = [None if cell is None else cell.strip(_AROUND) for cell in cells]
        self._lines = lines
        self._numbers = np.array([_number(text, decimal) for text in self._texts], dtype=np.float64)
        none = np.isnan(self._numbers)
        self._wrong = [
            bool(text) and here and not _is_nan(text)
            for text, here in zip(self._texts, none.tolist(), strict=True)
        ]
        self.bad = sum(self._wrong)
        self.filled = sum(map(bool, self._texts))

    def numbers(self) -> FloatArray:
        return self._numbers

    def texts(self) -> Texts:
        return self._texts

    def first_bad(self) -> tuple[int, str]:
        k = self._wrong.index(True)
        return self._lines[k], str(self._texts[k])[:40]

    def hold_times(self, reader: Stamps, at_least: float = 0.0) -> bool:
        if at_least and not reader.may_be(self._texts):
            return False
        found = reader.seconds(self._texts)
        there = np.isfinite(found)
        if np.count_nonzero(there) < at_least * self.filled:
            return False
        self._numbers = found
        self._wrong = [bool(text) and not here for text, here in zip(self._texts, there, strict=True)]
        self.bad = sum(self._wrong)
        return True


def _number(text: str | None, decimal: str) -> float:
    spelled = _spelled(text, decimal) if text else ""
    return float(spelled) if _FLOAT.fullmatch(spelled) else float("nan")


def _is_nan(text: str | None) -> bool:
    return text is not None and text.lower() in {"nan", "+nan", "-nan"}


def _spelled(text: str, decimal: str) -> str:
    """Return a number as programs spell it; where commas are decimal, a point would separate thousands."""
    return text.replace(".", "?", 1).replace(",", ".", 1) if decimal == "," else text


class ManyCells(Cells):
    """Cells as Polars has them."""

    def __init__(self, frame: pl.DataFrame, name: str) -> None:
        self._text, self._parsed = frame[name], frame[f"{name} parsed"]
        self._lines, self._wrong = frame["row"], frame[f"{name} wrong"]
        self.bad = int(self._wrong.sum())
        self.filled = len(self._parsed) - self._parsed.null_count() + self.bad

    @staticmethod
    def asked(name: str, decimal: str) -> list[pl.Expr]:
        """Return what is asked about the column of a name: its cells, as numbers, and which are none."""
        import polars as pl

        text = pl.col(name).str.strip_chars(_AROUND)
        spelled = text
        if decimal == ",":
            spelled = text.str.replace(".", "?", literal=True).str.replace(",", ".", literal=True)
        parsed = spelled.cast(pl.Float64, strict=False)
        wrong = (text != "").fill_null(value=False) & parsed.is_null()
        return [text, parsed.alias(f"{name} parsed"), wrong.alias(f"{name} wrong")]

    def numbers(self) -> FloatArray:
        return np.array(self._parsed.fill_null(float("nan")).to_numpy(), dtype=np.float64)

    def texts(self) -> Texts:
        return self._text.to_list()

    def first_bad(self) -> tuple[int, str]:
        k = int(self._wrong.arg_max() or 0)
        return int(self._lines[k]), str(self._text[k])[:40]

    def hold_times(self, reader: Stamps, at_least: float = 0.0) -> bool:
        import polars as pl

        if at_least and not reader.may_be(self._text.head(100).to_list()):
            return False
        found = pl.Series(reader.seconds(self._text), nan_to_null=True)
        if found.len() - found.null_count() < at_least * self.filled:
            return False
        self._wrong = (self._wrong | self._parsed.is_not_null()) & found.is_null()
        self._parsed, self.bad = found, int(self._wrong.sum())
        return True
