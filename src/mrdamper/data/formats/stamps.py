"""Times as clocks show them: ``10:15:02.250``, ``2026-11-21T10:15:02.250``, ``21.11.2026 10:15:02,250 PM``.

They become seconds from the first. A time of day that falls by more than half a day has passed midnight. Of a
date only the differences count: it begins with the year, or has points and begins with the day. Dates of
another form (11/12/2026 has two meanings) must all be the same.
"""

from __future__ import annotations

import re
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from mrdamper.data.formats.table import Texts
from mrdamper.quantities import FloatArray

if TYPE_CHECKING:
    import polars as pl

__all__ = ["Stamps"]

_FORM = (
    r"^(?:(\d{1,4}[-./]\d{1,2}[-./]\d{1,4})[T ,]\s*)?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?"
    r"\s*([AaPp][Mm])?(?:Z|[+-]\d{2}:?\d{2})?$"
)
_TIME = re.compile(_FORM)
_LOOKED_AT = 100  # cells
_DAY_S = 86400.0


class Stamps:
    """Reads the cells of one column, a block at a time."""

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None  # day, seconds of that day
        self._last_s, self._midnights = -np.inf, 0
        self._only = ""  # a date of another form

    @classmethod
    def in_texts(cls, cells: Texts) -> FloatArray | None:
        """Return the times in a whole column, None where a cell that is filled holds something else."""
        import polars as pl

        filled = np.array([bool(cell and cell.strip()) for cell in cells], dtype=bool)
        found = cls().seconds(pl.Series(cells, dtype=pl.String).str.strip_chars())
        return found if filled.any() and np.isfinite(found[filled]).all() else None

    def seconds(self, cells: pl.Series) -> FloatArray:
        """Return seconds from the first time of all blocks; not a number where a cell is no time."""
        import polars as pl

        parts = cells.to_frame("cell").select_seq(pl.col("cell").str.extract_groups(_FORM)).unnest("cell")
        share = pl.concat_str(pl.lit("0."), pl.col("5").fill_null("0"))
        read = parts.select_seq(
            *(pl.col(f"{k}").cast(pl.Float64) for k in (2, 3, 4)),
            share.cast(pl.Float64).alias("share"),
            pl.col("6").is_not_null().alias("twelve"),
            (pl.col("6").str.to_lowercase() == "pm").fill_null(value=False).alias("pm"),
        )
        hours, minutes, whole, rest, twelve, pm = (column.to_numpy() for column in read)
        hours = np.where(twelve, hours % 12.0 + 12.0 * pm, hours)
        of_day = 3600.0 * hours + 60.0 * minutes + whole + rest
        of_day[~((hours < 24.0) & (minutes < 60.0) & (whole < 61.0))] = np.nan
        days = self._days(parts["1"], of_day)
        there = np.flatnonzero(np.isfinite(of_day) & np.isfinite(days))
        if self._first is None and len(there):
            self._first = int(days[there[0]]), float(of_day[there[0]])
        first = self._first or (0, 0.0)
        return np.asarray(_DAY_S * (days - first[0]) + (of_day - first[1]), dtype=np.float64)

    @staticmethod
    def may_be(cells: Texts) -> bool:
        """Tell whether one of the first cells is a time: most texts are none, which costs little to see."""
        return any(cell and _TIME.match(cell) for cell in cells[:_LOOKED_AT])

    def _days(self, dates: pl.Series, of_day: FloatArray) -> FloatArray:
        """Return the day of each cell, counted from any; without dates, how often midnight has passed."""
        found = dates.unique(maintain_order=True).to_list()
        if found == [None] or not found:
            there = np.flatnonzero(np.isfinite(of_day))
            days = np.zeros(len(of_day))
            if len(there):
                steps = np.diff(of_day[there], prepend=self._last_s)
                days[there] = self._midnights + np.cumsum(steps < -0.5 * _DAY_S)
                self._last_s, self._midnights = float(of_day[there[-1]]), int(days[there[-1]])
            return days
        day_of = {text: self._day(text) for text in found}
        if len(found) == 1:
            return np.full(len(of_day), day_of[found[0]])
        return np.array([day_of[text] for text in dates.to_list()])

    def _day(self, text: str | None) -> float:
        """Return the number of a date; not a number where its meaning is not sure."""
        if text is None:
            return np.nan
        parts = text.replace("/", "-").replace(".", "-").split("-")
        numbers = [int(part) for part in parts]
        try:
            if len(parts[0]) == 4:
                return float(date(*numbers).toordinal())
            if len(parts[2]) == 4 and "." in text:
                return float(date(*reversed(numbers)).toordinal())
        except ValueError:
            return np.nan
        self._only = self._only or text
        return 0.0 if text == self._only else np.nan
