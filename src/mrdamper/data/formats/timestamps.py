"""Times of day and dates in texts.

Examples: ``10:15:02.250``, ``2026-11-21T10:15:02.250``, ``21.11.2026 10:15:02,250 PM``.

They are converted to seconds from the first. An offset from UTC (``+02:00``, ``Z``) is subtracted. A time of
day that falls by more than half a day has passed midnight. Only differences of dates are used. A date begins
with the year, or it has points and begins with the day. Dates of another form must all be equal, because
11/12/2026 has two meanings.
"""

from __future__ import annotations

import math
import re
from datetime import date

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Texts

_TIME = re.compile(
    r"^(?:([0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4})[T ,] *)?"
    r"([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:(?:[.,]|:(?=[0-9]{3}\b))([0-9]{1,9}))? *([AaPp][Mm])?"
    r" *(?:Z|(?:UTC|GMT)?(?:([+-])([0-9]{1,2})(?::?([0-9]{2}))?)?)$"
)
_PM = ("pm", "PM", "Pm", "pM")
_DAY_S = 86400.0


def is_time(cell: str) -> bool:
    """Return True if a cell is a time of day, or a date with a time of day."""
    return _TIME.match(cell) is not None


class Timestamps:
    """Reader of the cells of one column, block by block."""

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None  # Day, and seconds of this day.
        self._last_s, self._midnights = -np.inf, 0
        self._only = ""  # A date of another form.

    def seconds(self, cells: Texts) -> FloatArray:
        """Return seconds from the first time of all blocks, NaN if a cell is not a time."""
        dates, read = _parts(cells)
        hours, minutes, whole, rest, twelve, pm, offset_s = read
        hours = np.where(twelve > 0.0, hours % 12.0 + 12.0 * pm, hours)
        of_day = 3600.0 * hours + 60.0 * minutes + whole + rest
        of_day[~((hours < 24.0) & (minutes < 60.0) & (whole < 61.0))] = np.nan
        of_day -= offset_s
        days = self._days(dates, of_day)
        there = np.flatnonzero(np.isfinite(of_day) & np.isfinite(days))
        if self._first is None and len(there):
            self._first = int(days[there[0]]), float(of_day[there[0]])
        first = self._first or (0, 0.0)
        return np.asarray(_DAY_S * (days - first[0]) + (of_day - first[1]), dtype=np.float64)

    def _days(self, dates: Texts, of_day: FloatArray) -> FloatArray:
        """Return the day number of each cell. Without dates, it is the number of midnights passed."""
        found = dict.fromkeys(dates)
        if not found.keys() - {None}:
            there = np.flatnonzero(np.isfinite(of_day))
            days = np.zeros(len(of_day))
            if len(there):
                steps = np.diff(of_day[there], prepend=self._last_s)
                days[there] = self._midnights + np.cumsum(steps < -0.5 * _DAY_S)
                self._last_s, self._midnights = float(of_day[there[-1]]), int(days[there[-1]])
            return days
        day_of = {text: self._day(text) for text in found}
        return np.array([day_of[text] for text in dates])

    def _day(self, text: str | None) -> float:
        """Return the day number of a date, NaN if its meaning is ambiguous."""
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


def _parts(cells: Texts) -> tuple[Texts, list[FloatArray]]:
    """Return dates, hours, minutes, seconds, fractions, 12-hour and pm flags, and UTC offsets [s]."""
    nothing = (None,) * 9
    found = [match.groups() if cell and (match := _TIME.match(cell)) else nothing for cell in cells]
    read = np.array(
        [
            (*(math.nan if each is None else float(each) for each in (h, m, s)), float(f"0.{rest or 0}"),
             float(half is not None), float(half in _PM),
             (-1.0 if sign == "-" else 1.0) * (3600.0 * float(away or 0) + 60.0 * float(beside or 0)))
            for _, h, m, s, rest, half, sign, away, beside in found
        ]
    )  # fmt: skip
    return [groups[0] for groups in found], list(read.reshape(-1, 7).T)
