"""Times of day and dates in texts.

Examples: ``10:15:02.250``, ``2026-11-21T10:15:02.250``, ``21.11.2026 10:15:02,250 PM``.

Times are converted to seconds from the first time. An offset from UTC (``+02:00``, ``Z``) is subtracted. If
the time of day decreases by more than half a day, midnight has passed. A date such as 11/12/2026 has two
readings: day first or month first. All such dates in a file must be the same date, unless another date in
the file has only one valid reading.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from contextlib import suppress
from datetime import date

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import Moment, Texts

# First letters of the names of the months in English, German, French, Spanish, Portuguese, Italian, Dutch,
# Polish, Czech, Hungarian, Turkish and Russian.
_NAMES_OF_MONTHS = (
    "jan gen ene sty led oca янв|feb fév fev lut úno şub фев|mar mär mrz maa bře már мар|apr avr abr "
    "kwi dub ápr nis апр|may mai mei mag maj kvě máj мая май|jun juin giu cze jún haz июн|jul juil lug "
    "lip júl tem июл|aug aoû ago sie srp ağu авг|sep set wrz zář sze eyl сен|oct okt ott out paź říj "
    "eki окт|nov lis kas ноя|dec dez dic déc gru pro ara дек"
)
_MONTHS = {
    begin: number for number, names in enumerate(_NAMES_OF_MONTHS.split("|"), 1) for begin in names.split()
}
_MONTH = rf"(?:{'|'.join(_MONTHS)})[^\W\d_]*\.?"
_DATE = (
    r"(?:[0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4}\.?|[0-9]{4}\. [0-9]{1,2}\. [0-9]{1,2}\.?"
    r"|[0-9]{4}[年년] ?[0-9]{1,2}[月월] ?[0-9]{1,2}[日일]"
    rf"|[0-9]{{1,4}}[-./ ]{{1,2}}(?:de )?{_MONTH}[-./, ]{{1,2}}(?:de )?[0-9]{{1,4}}"
    rf"|{_MONTH} [0-9]{{1,2}},? [0-9]{{4}})"
)
_CLOCK = (
    r"([0-9]{1,2})[:h时時시] ?([0-9]{2})[:m分분] ?([0-9]{2})(?:(?:[.,]|:(?=[0-9]{3}\b))([0-9]{1,9}))?[秒초]?"
    r" *([AaPp][Mm])? *(Z|UTC|GMT)?(?:([+-])([0-9]{1,2})(?::?([0-9]{2}))?)?"
)
_TIME = re.compile(rf"^(?:({_DATE})(?:[T ,:] *|(?<=[日일])))?{_CLOCK}$", re.IGNORECASE)
_DATE_INSIDE = re.compile(
    rf"(?<![0-9.]){_DATE}(?![0-9.]*[0-9])|(?<![0-9])20[0-9]{{6}}(?![0-9])", re.IGNORECASE
)
_CLOCK_INSIDE = re.compile(rf"(?<![0-9:]){_CLOCK}(?![0-9:])")
_HALF = re.compile(r" *(?:([ap])\. ?m\.|(上午|午前|오전)|(下午|午後|오후)) *", re.IGNORECASE)
_DOTTED = re.compile(r"(?<=[0-9.] )([0-9]{1,2})\.([0-9]{2})\.([0-9]{2})(?![0-9])")
DAY_S = 86400.0
_NO_DAY = (math.nan, math.nan)
# Words in a line with a date above a table. They show the event: the start of the record, the record in
# general, or a different event, such as a calibration.
_START = re.compile(r"start|beg[ai]n|trigger|\bt ?0\b|anfang|d[ée]but|inicio|开始", re.IGNORECASE)
_RECORD = re.compile(r"dat[eu]|time|zeit|record|measur|mess|acqui|fecha|hora|heure|日期|时间", re.IGNORECASE)
_OTHER = re.compile(
    r"\b(end|due|fin|ende)\b|stop|finish|export|print|[ck]alib|creat|erstell|modif|save|valid", re.IGNORECASE
)


def is_time(cell: str) -> bool:
    """Return True if a cell is a time of day, or a date with a time of day."""
    return _groups_of(cell) is not None


def _groups_of(cell: str) -> tuple[str | None, ...] | None:
    """Return the parts of a time of day with or without a date, None for any other cell.

    Also accepted: points in a time of day after a date (``4.3.2021 10.22.57``), and words for am and pm in
    other languages.
    """
    match = _TIME.match(cell)
    if match is None and sum(map(str.isdecimal, cell)) > 5:
        if half := _HALF.search(cell):
            cell = f"{_HALF.sub(' ', cell).strip()} {half[1] or ('A' if half[2] else 'P')}M"
        match = _TIME.match(_DOTTED.sub(r"\1:\2:\3", cell))
    return None if match is None else match.groups()


def _seconds_of_day(groups: tuple[str | None, ...]) -> float:
    """Return the time of day [s] minus its offset from UTC, NaN if it is invalid."""
    hour, minute, second, fraction = (float(text or 0) for text in (*groups[1:4], f"0.{groups[4] or 0}"))
    if groups[5]:
        hour = hour % 12.0 + 12.0 * (groups[5].lower() == "pm")
    if hour >= 24.0 or minute >= 60.0 or second >= 61.0:
        return math.nan
    offset_s = 3600.0 * float(groups[8] or 0) + 60.0 * float(groups[9] or 0)
    seconds = 3600.0 * hour + 60.0 * minute + second + fraction
    return seconds + offset_s if groups[7] == "-" else seconds - offset_s


def days_of(text: str | None) -> tuple[float, float]:
    """Return the days from 1970 to a date, read with the day first and with the month first.

    The two values are equal if only one reading is valid, and NaN if the text is not a date.
    """
    day, month = _readings_of(text)
    return (month if math.isnan(day) else day), (day if math.isnan(month) else month)


def _readings_of(text: str | None) -> tuple[float, float]:
    """Return the days from 1970 to a date for both readings, NaN if a reading is invalid."""
    if not text or _DATE_INSIDE.fullmatch(text) is None:
        return _NO_DAY
    text = re.sub(r"^(\d{4})(\d\d)(\d\d)$", r"\1-\2-\3", text)
    numbers = re.findall(r"[0-9]+", text)
    name = re.search(_MONTH, text, re.IGNORECASE)
    if name is not None:
        begins = (begin for begin in _MONTHS if name[0].lower().startswith(begin))
        numbers.insert(1, f"{_MONTHS[max(begins, key=len)]}")
    first, second, third = numbers
    orders = [(third, second, first), (third, first, second)][: 1 if "." in text or name else 2]
    orders = [(first, second, third)] if len(first) == 4 else orders
    days = [math.nan] * len(orders)
    for k, order in enumerate(orders):
        with suppress(ValueError):
            days[k] = float((date(*map(int, order)) - date(1970, 1, 1)).days)
    return (days[0], days[-1]) if len(orders[0][0]) == 4 else _NO_DAY


def moment_of(text: str) -> Moment | None:
    """Return the time stamp in a text (a time of day, perhaps with a date), None if it has no time of day."""
    return seconds_of([text.strip()])[1]


def start_in(lines: Iterable[str]) -> Moment | None:
    """Return the only start of a record that lines state, else None. Other times of the record come last."""
    lines = [line for line in lines if not _OTHER.search(line)]
    groups = [" ; ".join(line for line in lines if form.search(line)) for form in (_START, _RECORD)]
    clocks, dates = (
        next((found for text in groups if (found := {each[0].strip() for each in form.finditer(text)})), ())
        for form in (_CLOCK_INSIDE, _DATE_INSIDE)
    )
    return moment_of(" ".join((*dates, *clocks))) if len(clocks) == 1 and len(dates) < 2 else None


def date_in(texts: Iterable[str]) -> tuple[float, float] | None:
    """Return the two readings [days since 1970] of the date in texts, None unless there is exactly one."""
    found = {
        days_of(each[0]) for text in texts if not _OTHER.search(text) for each in _DATE_INSIDE.finditer(text)
    } - {_NO_DAY}
    return found.pop() if len(found) == 1 else None


def seconds_of(cells: Texts) -> tuple[FloatArray, Moment | None]:
    """Return the time [s] of each cell since the first time stamp (NaN: no time), and this time stamp."""
    found = [_groups_of(cell) if cell else None for cell in cells]
    of_day = np.array([math.nan if each is None else _seconds_of_day(each) for each in found])
    dates = [each[0] if each else None for each in found]
    days, reading = _days(dates, of_day)
    valid = np.flatnonzero(np.isfinite(of_day) & np.isfinite(days))
    if not len(valid):
        return np.full(len(cells), math.nan), None
    k = int(valid[0])
    day = days_of(dates[k])
    has_date = not math.isnan(day[0])
    readings = day if reading is None else (day[reading],) * 2
    first, second = (DAY_S * (each if has_date else 0.0) + float(of_day[k]) for each in readings)
    is_utc = any((found[k] or ())[6:8])
    seconds = DAY_S * (days - days[k]) + (of_day - of_day[k])
    return seconds, Moment(first, second, has_date=has_date, is_utc=is_utc)


def _days(dates: Texts, of_day: FloatArray) -> tuple[FloatArray, int | None]:
    """Return the day number of each cell, and the reading of the dates (None: unclear).

    Without dates, the day number is the number of midnights passed. If the reading is unclear, all cells must
    have the same date.
    """
    read = {text: _readings_of(text) for text in dates if text}
    if not read:
        days, valid = np.zeros(len(of_day)), np.isfinite(of_day)
        days[valid] = np.cumsum(np.diff(of_day[valid], prepend=-np.inf) < -0.5 * DAY_S)
        return days, None
    known = np.array([pair for pair in read.values() if not np.isnan(pair).all()]).reshape(-1, 2)
    # A date with a day above 12 has only one reading. This reading applies to all dates of the file.
    whole = np.flatnonzero(np.isfinite(known).all(axis=0)).tolist()
    if len(known) and (len(whole) == 1 or np.array_equal(known[:, 0], known[:, 1])):
        return np.array([read[text][whole[0]] if text else math.nan for text in dates]), whole[0]
    # A date whose year has two digits is unclear as well.
    unclear = [
        text for text, pair in read.items() if not (np.isnan(pair).all() and re.search(r"\d{4}", text))
    ]
    return np.where([bool(text) and text in unclear[:1] for text in dates], 1.0, math.nan), None
