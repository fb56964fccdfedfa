"""The result of each format reader: columns by name, and the layout of the file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.errors import InputError, MissingExtraError

SKIPPED = "skipped: "
"""First word of a note in a layout that lists values which cannot be read."""
# Error values of spreadsheets differ by language: #N/A, #N/D, #VALUE!, #WERT!
_MISSING = re.compile(
    r"|-+|\*+|#(?:N[AV]|YOK|[^\W\d]+/\S+|\w+[!?])"
    r"|(?i:n/?a|n/d|null|none|over(?:flow|range|load)?|ovl|ol|error|invalid|no data)"
)

Texts = list[str | None]


@dataclass(frozen=True, slots=True)
class FileOptions:
    """Options of a channel map for the reading of a file; "" means automatic detection."""

    part: str = ""  # sheet of a workbook, group of a TDMS, MDF, HDF5 or MAT file
    delimiter: str = ""
    decimal: str = ""  # "." or ","
    common_time: bool = False  # True: use only the time span that all channels cover

    def __post_init__(self) -> None:
        if self.delimiter not in {"", ",", ";", "\t", "|", " "}:
            expected = "a comma, a semicolon, a tab, a bar or a blank"
            raise InputError(found=f"delimiter is {self.delimiter!r}", expected=expected)
        if self.decimal not in {"", ".", ","} or self.decimal == self.delimiter == ",":
            found = f"decimal is {self.decimal!r} and delimiter is {self.delimiter!r}"
            raise InputError(found=found, expected="'.' or ',', which is not the delimiter")


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a file as the reader detected it."""

    format: str
    delimiter: str = ""
    decimal: str = ""
    header_lines: int | None = None  # Lines before the first row of numbers.
    part: str = ""
    notes: tuple[str, ...] = ()

    def in_words(self) -> str:
        """Return the layout as text for the user."""
        named = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "blanks"}
        lines = self.header_lines
        words = (
            self.format,
            self.delimiter and f"separated by {named.get(self.delimiter, repr(self.delimiter))}",
            self.decimal and f"decimal {'comma' if self.decimal == ',' else 'point'}",
            "" if lines is None else f"{lines} header line{'' if lines == 1 else 's'}",
            self.part and f"part {self.part!r}",
        )
        return ", ".join([*filter(None, words), *self.notes])


class NoTableError(InputError):
    """Error of a readable file without columns of numbers, such as notes or settings."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A time stamp [s]: since 1970, or since midnight if the date is missing.

    In an ambiguous date, such as 11/12/2026, the day or the month can come first. For any other date,
    ``day_first_s`` and ``month_first_s`` are equal.
    """

    day_first_s: float
    month_first_s: float
    has_date: bool = True
    is_utc: bool = False  # False: local time

    def later(self, seconds: float) -> Moment:
        """Return the time stamp shifted by a number of seconds."""
        readings = (self.day_first_s + seconds, self.month_first_s + seconds)
        return Moment(*readings, has_date=self.has_date, is_utc=self.is_utc)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of a file by name. Text columns are separate. A scalar is a column of one number."""

    names: tuple[str, ...]  # Names of all columns in the order of the file.
    columns: Mapping[str, FloatArray]
    texts: Mapping[str, Texts]
    layout: Layout
    rows: int  # Length of the longest column.
    step_s: float | None = None  # Sampling interval that the file states apart from the columns.
    # Units that the file states separately from the names of the columns.
    units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    other_units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))  # of documents
    # column -> number of its clock. Columns with the same number have the same times.
    clocks: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    recorded_apart: bool = False  # True: the channels may begin and end at different times
    # Columns that were converted from times of day or dates, with the moment of their first value.
    stamps: Mapping[str, Moment] = field(default_factory=lambda: MappingProxyType({}))
    start: Moment | None = None  # Moment of time zero.
    title: str = ""  # Title of the sheet, group or structure.
    said: tuple[str, ...] = ()  # Lines above the table, or attributes as lines "name: value".
    # Factors that the file states for columns and that were not applied.
    scales: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    more: tuple[str, ...] = ()  # Names of other sheets or groups with tables, for ``FileOptions.part``.
    following: tuple[Table, ...] = ()  # Further tables of the same part.
    # name of a sheet without samples, such as a list of runs -> lines of the sheet
    lists: Mapping[str, Sequence[str]] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: suffixes for the search in folders, a test of the first bytes, and the reader."""

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], object]
    read: Callable[[Path, FileOptions], Table]


def is_missing(cell: str) -> bool:
    """Return True if a cell is empty, or contains a text of spreadsheets or loggers for a missing value."""
    return _MISSING.fullmatch(cell) is not None


def load_extra(module: str, package: str, what: str) -> Any:  # noqa: ANN401 - a foreign module
    """Return the module of an optional library, or raise an error that names the install command."""
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError.for_package(what, package, "rig-files") from error


def shortest_names(paths: Sequence[Sequence[str]]) -> list[str]:
    """Return the last part of each path if it is unique, else the whole path."""
    often = Counter(path[-1] for path in paths)
    return distinct_names([path[-1] if often[path[-1]] == 1 else "/".join(path) for path in paths])


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return the names of columns. An empty or repeated name gets the number of its column."""
    order: list[str] = []
    for k, given in enumerate(names):
        name = given or f"column {k + 1}"
        order.append(f"{name} ({k + 1})" if name in order else name)
    return order


def require_held(samples: int, size: int, path: Path, name: str) -> None:
    """Raise InputError if the file is too small for the stated samples. Call before memory is allocated."""
    if not 0 <= samples * size <= SETTINGS.unpacked_ratio_max * path.stat().st_size:
        found = f"{name!r} states {samples} samples of {size} bytes, more than its file holds"
        raise InputError(place=path, found=found, remedy="Copy the file again")


def as_text(value: Any) -> Any:  # noqa: ANN401 - any value
    """Return bytes as text, and any other value unchanged."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def as_column(values: NDArray[Any]) -> tuple[FloatArray, str]:
    """Return values as float64, and the unit of their type. Dates become seconds from the first date."""
    flat = np.ravel(values)
    flat = flat - flat[:1] if flat.dtype.kind == "M" else flat
    if flat.dtype.kind == "m":
        return flat.astype("timedelta64[ns]").astype(np.float64) * 1e-9, "s"
    return flat.astype(np.float64), ""
