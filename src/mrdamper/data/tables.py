"""Tables: what a rig's file holds, column by column, before anybody says what the columns mean.

One reader per format; a new format is one function and one line in ``FORMATS``. Which column is the force
is the business of ``channels``; runs are made in ``readers``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray, is_unit

if TYPE_CHECKING:
    import polars as pl

__all__ = ["FORMATS", "Format", "Table", "read_table"]

_HEAD_LINES = 400  # the data must begin within these
_COMMENT = re.compile(r"^\s*(#|%|//|!)+\s?")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?|nan|[+-]?inf", re.IGNORECASE)
_DELIMITERS = ("\t", ";", ",", " ")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of a file by name, text columns apart; a scalar is a column of one number."""

    names: tuple[str, ...]  # of all columns, in the file's order
    columns: dict[str, FloatArray]
    texts: dict[str, list[str | None]]
    step_s: float | None = None  # sampling interval that the file states beside its columns


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: the suffixes that a folder is searched for, how its first bytes look, its reader."""

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    read: Callable[[Path, bytes], Table]


def read_table(path: Path) -> Table:
    """Return the table in a file, its format recognised by its content."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the file ({error.strerror})") from error
    if not content.strip():
        raise InputError(f"{path}: the file is empty; expected columns of numbers")
    for known in FORMATS:
        if known.recognises(content[:512]):
            table = known.read(path, content)
            break
    else:
        names = ", ".join(known.name for known in FORMATS)
        raise InputError(f"{path}: not a format that is read here ({names}); export the run as CSV")
    if not table.columns or max(len(column) for column in table.columns.values()) < 2:
        raise InputError(f"{path}: no columns of numbers found; expected a header and rows of numbers")
    return table


def _read_text(path: Path, content: bytes) -> Table:
    lines, tail_at = _head(path, content)
    delimiter, first = _find_data(lines)
    if first is None:
        raise InputError(
            f"{path}: no rows of numbers in the first {len(lines)} lines; expected a header and at least two "
            "columns, separated by comma, semicolon, tab or blanks"
        )
    names = _find_header(lines, first, delimiter)
    return _parse(path, content[tail_at[first] :], delimiter, names, first + 1)


def _read_logger(path: Path, content: bytes) -> Table:
    """Read a data logger's text: a header of stated size, then columns with events among them."""
    lines, tail_at = _head(path, content)
    stated: dict[str, str] = {}
    for line in lines:
        key, colon, value = line.partition(":")
        if not colon or "," in key:
            break
        stated[key.strip().lower()] = value.strip()
    try:
        size, step = int(stated["header size"]), float(stated["sampling interval"])
        names = [name.strip() for name in lines[size - 1].split(",")]
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(
            f"{path}: the logger's header lacks {error}; expected 'Header Size' and 'Sampling Interval' lines"
        ) from error
    if len(lines) <= size or not step > 0.0:
        raise InputError(f"{path}: no samples after a header of {size} lines; expected rows of numbers")
    table = _parse(path, content[tail_at[size] :], ",", names, size + 1)
    return replace(table, step_s=step)


def _read_mat(path: Path, content: bytes) -> Table:
    import struct
    import zlib

    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    if content[:4] == b"\x89HDF" or b"MATLAB 7.3" in content[:128]:
        raise InputError(f"{path}: MAT v7.3 (HDF5) is not read here; save it again with save(..., '-v7')")
    damage = (MatReadError, zlib.error, struct.error, ValueError, TypeError, LookupError, ArithmeticError)
    try:
        variables = loadmat(str(path))
    except (
        *damage,
        NotImplementedError,
        EOFError,
        OSError,
        MemoryError,
    ) as error:
        raise InputError(f"{path}: not a readable MAT file ({error}); save it again with '-v7'") from error
    columns = {
        name: np.ravel(value).astype(np.float64)
        for name, value in variables.items()
        if not name.startswith("__")
        and isinstance(value, np.ndarray)
        and value.dtype.kind in "fiub"
        and value.size
        and value.size == max(value.shape)
    }
    return Table(tuple(columns), columns, {})


def _read_parquet(path: Path, content: bytes) -> Table:
    import polars as pl

    try:
        frame = pl.read_parquet(content)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{path}: not a readable Parquet file ({error})") from error
    columns = {name: _floats(frame[name]) for name in frame.columns if frame[name].dtype.is_numeric()}
    texts = {name: frame[name].to_list() for name in frame.columns if frame[name].dtype == pl.String}
    names = tuple(name for name in frame.columns if name in columns or name in texts)
    return Table(names, columns, texts)


def _is_text(head: bytes) -> bool:
    return b"\0" not in head or head.startswith((b"\xff\xfe", b"\xfe\xff"))


# The first that recognises a file reads it.
FORMATS: tuple[Format, ...] = (
    Format("Parquet", (".parquet", ".pq"), lambda head: head.startswith(b"PAR1"), _read_parquet),
    Format("MAT", (".mat",), lambda head: head.startswith((b"MATLAB ", b"\x89HDF")), _read_mat),
    Format("logger text", (".txt",), lambda head: head.lstrip().startswith(b"Header Size:"), _read_logger),
    Format("delimited text", (".csv", ".tsv", ".txt", ".dat", ".asc"), _is_text, _read_text),
)


def _head(path: Path, content: bytes) -> tuple[list[str], list[int]]:
    """Return the first lines of a text, and where each begins in the content."""
    ends = [match.end() for match in re.finditer(rb"\r\n|\n|\r", content[: 1 << 20])][:_HEAD_LINES]
    starts = [0, *ends]
    pieces = [content[a:b] for a, b in zip(starts, [*ends, len(content)], strict=True)][:_HEAD_LINES]
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: byte {error.start} is not UTF-8 text (0x{content[error.start]:02x}); "
            "save the file as UTF-8"
        ) from error
    if len(pieces) > 1 and not pieces[-1]:
        pieces.pop()
    return [piece.decode("utf-8-sig").rstrip("\r\n") for piece in pieces], starts


def _split(line: str, delimiter: str) -> list[str]:
    parts = line.split() if delimiter == " " else line.split(delimiter)
    return [part.strip().strip('"').strip() for part in parts]


def _find_data(lines: Sequence[str]) -> tuple[str, int | None]:
    """Return the delimiter and the first line of data: two numbers or more, and as many in the next line."""
    best: tuple[bool, int, int] | None = None
    found: tuple[str, int | None] = (",", None)
    for rank, delimiter in enumerate(_DELIMITERS):
        for k, line in enumerate(lines):
            if _COMMENT.match(line) or not line.strip():
                continue
            fields = _split(line, delimiter)
            following = _split("".join(lines[k + 1 : k + 2]) or line, delimiter)
            numbers = _count_numbers(fields)
            if numbers < 2 or _count_numbers(following) < 2:
                continue
            score = (numbers == len(fields), numbers, -rank)
            if best is None or score > best:
                best, found = score, (delimiter, k)
            break
    return found


def _count_numbers(fields: Sequence[str]) -> int:
    return sum(_NUMBER.fullmatch(text) is not None for text in fields)


def _find_header(lines: Sequence[str], first: int, delimiter: str) -> list[str]:
    """Return the names of the columns; a row of units under the header joins it as ``name [unit]``."""
    count = len(_split(lines[first], delimiter))
    rows: list[list[str]] = []
    for line in reversed(lines[:first]):
        fields = _split(_COMMENT.sub("", line), delimiter)
        if delimiter == " " and len(fields) != count:
            fields = re.split(r"\s{2,}|\t", _COMMENT.sub("", line).strip())
        if len(fields) == count and any(fields):
            rows.append(fields)
        elif rows or line.strip():
            break
    if not rows:
        return [f"column {k + 1}" for k in range(count)]
    units = [text.strip("[]()") for text in rows[0]]
    if len(rows) > 1 and all(not unit or unit == "-" or is_unit(unit) for unit in units):
        return [f"{name} [{unit}]" if unit else name for name, unit in zip(rows[1], units, strict=True)]
    return rows[0]


def _parse(path: Path, content: bytes, delimiter: str, names: Sequence[str], first_line: int) -> Table:
    """Return the columns of rows of text; a cell that is no number in a column of numbers is an error."""
    import polars as pl

    if delimiter == " ":
        content = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", content)
        content, delimiter = re.sub(rb"[ \t]+", b"\t", content), "\t"
    schema = {f"{k}": pl.String for k in range(len(names))}
    try:
        frame = pl.read_csv(
            content,
            has_header=False,
            schema=schema,
            separator=delimiter,
            comment_prefix="#",
            truncate_ragged_lines=True,
        )
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path}: not a table of numbers ({str(error).splitlines()[0]})") from error
    frame = frame.with_row_index("row", first_line).filter(~pl.all_horizontal(pl.exclude("row").is_null()))
    columns: dict[str, FloatArray] = {}
    texts: dict[str, list[str | None]] = {}
    order: list[str] = []
    for k, given in enumerate(names):
        name = given or f"column {k + 1}"
        name = f"{name} ({k + 1})" if name in order else name
        order.append(name)
        text = frame[f"{k}"].str.strip_chars(' \t"')
        filled = text.is_not_null() & (text != "")
        numbers = text.str.replace(",", ".", literal=True) if delimiter != "," else text
        parsed = numbers.cast(pl.Float64, strict=False)
        bad = filled & parsed.is_null()
        if np.count_nonzero(bad) > 0.5 * np.count_nonzero(filled):
            texts[name] = text.to_list()
        elif bad.any():
            row = int(bad.arg_max() or 0)
            raise InputError(
                f"{path}, line {frame['row'][row]}: column {name!r} holds {text[row]!r} ({bad.sum()} such "
                "cells); expected a number. Correct the cell, or leave it out with its row"
            )
        else:
            columns[name] = _floats(parsed)
    return Table(tuple(order), columns, texts)


def _floats(series: pl.Series) -> FloatArray:
    import polars as pl

    return np.array(series.cast(pl.Float64).fill_null(float("nan")).to_numpy(), dtype=np.float64)
