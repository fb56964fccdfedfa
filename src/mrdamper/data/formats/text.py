"""Delimited text: delimiter, decimal sign and header are found by looking, and reported.

Rows are parsed in blocks, so that a file of gigabytes needs the memory of its numbers and little more.
"""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.cells import Cells
from mrdamper.data.formats.table import FileOptions, Layout, Rows, Table, Texts
from mrdamper.data.formats.timestamps import Timestamps
from mrdamper.errors import InputError
from mrdamper.quantities import is_unit

if TYPE_CHECKING:
    import polars as pl

__all__ = [
    "Head",
    "count_numbers",
    "find_data",
    "find_decimal",
    "find_header",
    "is_text",
    "lines_of",
    "open_text",
    "parse_rows",
    "read_head",
    "read_text",
    "split_line",
]

_HEAD_BYTES = 1 << 20
_SMALL_BYTES = 1 << 20  # of numbers alone
_HEAD_LINES = 400  # the data must begin within these
_BLOCK = 1 << 25  # bytes that are parsed at a time
_COMMENT = re.compile(r"^\s*(#|%|//|!)+\s?")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?|nan|[+-]?inf", re.IGNORECASE)
_WHOLE = re.compile(r"[+-]?\d+")
_DELIMITERS = ("\t", ";", ",", " ")
_UTF8, _WINDOWS, _CHINESE = "utf-8-sig", "cp1252", "gb18030"
_READ_AS = {_WINDOWS: ("not UTF-8: read as Windows-1252",), _CHINESE: ("not UTF-8: read as GB 18030",)}
_NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\x81\x8d\x8f\x90\x9d]")  # in Windows-1252
_MOST_LETTERS = 0.05  # beyond ASCII, of a text of numbers
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class Head:
    """The first lines of a text, and the byte at which each begins (and the one after the last)."""

    lines: tuple[str, ...]
    starts: tuple[int, ...]
    notes: tuple[str, ...] = ()  # on how it was read


def is_text(head: bytes) -> bool:
    """Tell whether the first bytes of a file are text, of whatever encoding."""
    return b"\0" not in head or head.startswith(_UTF16) or _wide(head)


@dataclass(frozen=True, slots=True)
class _Found:
    """How a delimited text is laid out: its columns' names, and where its rows begin."""

    start: int  # byte
    names: tuple[str, ...]
    layout: Layout


def read_text(path: Path, options: FileOptions) -> Table:
    """Return the table in a delimited text."""
    found = _look(path, options)
    return parse_rows(path, found.start, found.names, found.layout)


def open_text(path: Path, options: FileOptions) -> Rows:
    """Return a delimited text whose rows are read a block at a time; how many there are is not known."""
    found = _look(path, options)
    order = tuple(_distinct(found.names))
    stamps: dict[int, Timestamps] = {}
    first = next(iter(_number_blocks(path, found, order, stamps=stamps)), ([], []))
    numbers = {name: column for name, column in zip(order, first[0], strict=True) if column is not None}
    table = Table(
        names=order,
        columns=numbers,  # of the first block
        texts={name: [] for name in order if name not in numbers},
        layout=found.layout,
        rows=0,
        units={order[k]: "s" for k in stamps},
        stamps=frozenset(order[k] for k in stamps),
    )

    def read(names: Sequence[str], start: int, _: int) -> Iterator[list[FloatArray]]:
        places = [order.index(name) for name in names]
        passed = 0
        for columns, _texts in _number_blocks(path, found, order, wanted=places):
            part = [column for column in (columns[k] for k in places) if column is not None]
            after = passed + len(part[0])
            if after > start:
                skip = max(0, start - passed)
                yield [column[skip:] for column in part]
            passed = after

    return Rows(table, read)


def _look(path: Path, options: FileOptions) -> _Found:
    head = read_head(path)
    delimiter, first = find_data(head.lines, options.delimiter)
    if first is None:
        raise InputError(
            place=path,
            found=f"no rows of numbers in the first {len(head.lines)} lines",
            expected="a header and at least two columns, separated by comma, semicolon, tab or blanks",
        )
    names = find_header(head.lines, first, delimiter)
    _refuse_two_commas(path, head.lines, first, delimiter)
    decimal = options.decimal or find_decimal(path, head.lines[first:], delimiter)
    layout = Layout("delimited text", delimiter, decimal, first, notes=head.notes)
    return _Found(head.starts[first], tuple(names), layout)


def read_head(path: Path) -> Head:
    """Return the first lines of a text; what has no usual encoding or line ends is an ``InputError``."""
    with path.open("rb") as stream:
        content = stream.read(_HEAD_BYTES)
    if content.startswith(_UTF16) or _wide(content[:512]):
        raise InputError(
            place=path, found="the text is UTF-16", expected="UTF-8", remedy="Save the file as UTF-8"
        )
    if re.match(rb"\s*<(!doctype|html|\?xml)", content[:64], re.IGNORECASE):
        raise InputError(
            place=path,
            found="is a web page or XML",
            expected="columns of numbers",
            remedy="Download the file itself",
        )
    if b"\n" not in content and content.count(b"\r") > 1:
        raise InputError(
            place=path,
            found="lines end in CR alone, as on old Macs",
            expected="LF or CR LF",
            remedy="Save it with such lines",
        )
    whole = len(content) < _HEAD_BYTES
    ends = [match.end() for match in re.finditer(rb"\n", content)]
    edges = [0, *ends] if (ends and ends[-1] == len(content)) or not whole else [0, *ends, len(content)]
    edges = edges[: _HEAD_LINES + 1]
    if len(edges) < 2:
        raise InputError(
            place=path,
            found=f"the first line has more than {_HEAD_BYTES} bytes",
            expected="rows of numbers",
        )
    encoding = _encoding(path, content[: edges[-1]])
    if content.startswith(b"\xef\xbb\xbf"):
        edges[0] = 3
    lines = tuple(content[a:b].decode(encoding).rstrip("\r\n") for a, b in itertools.pairwise(edges))
    return Head(lines, tuple(edges), _READ_AS.get(encoding, ()))


def lines_of(stream: BinaryIO, path: Path, first: int = 1) -> Iterator[tuple[int, bytes]]:
    """Give the lines of a text from where it stands, each with its number; the ``first`` one's is given.

    Raises
    ------
    InputError
        A line does not end.
    """
    for number, line in enumerate(iter(partial(stream.readline, _HEAD_BYTES), b""), first):
        if len(line) == _HEAD_BYTES:
            raise InputError(place=f"{path}, line {number}", found="does not end", expected="rows of numbers")
        yield number, line


def parse_rows(
    path: Path, start: int, names: Sequence[str], layout: Layout, stop: int | None = None
) -> Table:
    """Return the columns of the rows from byte ``start`` on, to byte ``stop`` or the end.

    A column is numbers when at least half of its filled cells in the first block are; a cell of it that is
    none is an error with its line.
    """
    order = _distinct(names)
    kept: list[list[FloatArray]] = [[] for _ in order]
    texts: list[Texts] = [[] for _ in order]
    found = _Found(start, tuple(names), layout)
    is_number: list[bool] | None = None
    stamps: dict[int, Timestamps] = {}
    for columns, words_of in _number_blocks(path, found, order, stop, stamps=stamps):
        is_number = [column is not None for column in columns]
        for k, column in enumerate(columns):
            if column is not None:
                kept[k].append(column)
            else:
                texts[k] += words_of[k]
    is_number = is_number or [True] * len(order)
    numbers = {
        title: np.concatenate(blocks) if blocks else np.empty(0)
        for title, blocks, wanted in zip(order, kept, is_number, strict=True)
        if wanted
    }
    words = {title: cells for title, cells, n in zip(order, texts, is_number, strict=True) if not n}
    return Table(
        names=tuple(order),
        columns=numbers,
        texts=words,
        layout=layout,
        rows=max([*map(len, numbers.values()), *map(len, words.values())], default=0),
        units={order[k]: "s" for k in stamps},
        stamps=frozenset(order[k] for k in stamps),
    )


def _number_blocks(
    path: Path,
    found: _Found,
    order: Sequence[str],
    stop: int | None = None,
    wanted: Sequence[int] = (),
    stamps: dict[int, Timestamps] | None = None,
) -> Iterator[tuple[list[FloatArray | None], list[Texts]]]:
    """Give the columns of each block: numbers, or None and its cells where the first block has texts.

    Of the columns of numbers all are parsed, or the ``wanted`` ones; cells that are none are an error.
    Columns of times of day or dates are numbers, too; they are put into ``stamps``.
    """
    is_number: list[bool] | None = None
    layout, stamps = found.layout, {} if stamps is None else stamps
    for content, first_line in _blocks(path, found.start, stop, (layout.header_lines or 0) + 1):
        plain = _plain_numbers(content, layout, len(order))
        if plain is not None and is_number is None:
            is_number = [True] * len(plain)
            yield plain, [[] for _ in plain]
            continue
        columns = _parse_block(path, content, layout, len(order), first_line, wanted if is_number else ())
        for k, column in enumerate(columns):
            if column is not None and k in stamps:
                column.hold_times(stamps[k])
            elif column is not None and is_number is None and column.mostly_text:
                reader = Timestamps()
                if column.hold_times(reader, at_least=0.5):
                    stamps[k] = reader
        if is_number is None:
            is_number = [column is not None and not column.mostly_text for column in columns]
        numbers: list[FloatArray | None] = []
        texts: list[Texts] = []
        for k, column in enumerate(columns):
            numeric = column is not None and is_number[k]
            if column is not None and numeric and column.bad and (not wanted or k in wanted):
                row, cell = column.first_bad()
                wanted_cell = "time" if k in stamps else "number"
                raise InputError(
                    place=f"{path}, line {row}",
                    found=f"column {order[k]!r} holds {cell!r} ({column.bad} such cells)",
                    expected=f"a {wanted_cell}",
                    remedy="Correct the cell, or leave it out with its row",
                )
            numbers.append(column.numbers() if column is not None and numeric else None)
            texts.append([] if column is None or numeric else column.texts())
        yield numbers, texts


def find_data(lines: Sequence[str], wanted: str = "") -> tuple[str, int | None]:
    """Return the delimiter and the first line of data: two numbers or more, and as many in the next line."""
    best: tuple[bool, int, int] | None = None
    found: tuple[str, int | None] = (wanted or ",", None)
    for rank, delimiter in enumerate((wanted,) if wanted else _DELIMITERS):
        for k, line in enumerate(lines):
            if (delimiter not in line and delimiter != " ") or _COMMENT.match(line):
                continue
            fields = split_line(line, delimiter)
            numbers = count_numbers(fields)
            following = "".join(lines[k + 1 : k + 2]) or line
            if numbers < 2 or count_numbers(split_line(following, delimiter)) < 2:
                continue
            score = (numbers == len(fields), numbers, -rank)
            if best is None or score > best:
                best, found = score, (delimiter, k)
            break
    return found


def find_header(lines: Sequence[str], first: int, delimiter: str) -> list[str]:
    """Return the names of the columns; a row of units under the header joins it as ``name [unit]``."""
    count = len(split_line(lines[first], delimiter))
    rows: list[list[str]] = []
    for line in reversed(lines[:first]):
        fields = split_line(_COMMENT.sub("", line), delimiter)
        if delimiter == " " and len(fields) != count:
            fields = re.split(r"\s{2,}|\t", _COMMENT.sub("", line).strip())
        if len(fields) == count and any(fields):
            rows.append(fields)
        elif rows or line.strip():
            break
    if not rows:
        return [f"column {k + 1}" for k in range(count)]
    units = [text.strip("[]()") for text in rows[0]]
    if len(rows) > 1 and _are_units(units):
        return [f"{name} [{unit}]" if unit else name for name, unit in zip(rows[1], units, strict=True)]
    return rows[0]


def _are_units(words: Sequence[str]) -> bool:
    """Tell whether a row under the names is one of units: two at least, and half of what it holds."""
    filled = [word for word in words if word and word != "-"]
    known = sum(is_unit(word) for word in filled)
    return known >= min(2, len(filled)) and 2 * known >= len(filled) > 0


def count_numbers(fields: Sequence[str]) -> int:
    """Return how many of the fields are numbers."""
    return sum(_NUMBER.fullmatch(text) is not None for text in fields)


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the fields of a line."""
    parts = line.split() if delimiter == " " else line.split(delimiter)
    return [part.strip().strip('"').strip() for part in parts]


# ------------------------------------------------------------------------------------------- blocks


def _blocks(path: Path, start: int, stop: int | None, first_line: int) -> Iterator[tuple[bytes, int]]:
    """Give whole lines of a file in blocks, each with the number of its first line."""
    rest, end = b"", path.stat().st_size if stop is None else stop
    with path.open("rb") as stream:
        stream.seek(start)
        while piece := stream.read(min(_BLOCK, end - stream.tell())):
            if b"\0" in piece:
                raise InputError(
                    place=path,
                    found=f"holds zero bytes after about line {first_line}",
                    expected="text",
                    remedy="The file was cut off while it was written: cut the rest off, or record again",
                )
            content = rest + piece
            cut = content.rfind(b"\n") + 1
            if not cut and len(content) >= _BLOCK:
                raise InputError(
                    place=path, found=f"line {first_line} does not end", expected="rows of numbers"
                )
            if cut:
                yield content[:cut], first_line
                first_line += content.count(b"\n", 0, cut)
            rest = content[cut:]
    if rest.strip():
        yield rest, first_line


def _plain_numbers(content: bytes, layout: Layout, count: int) -> list[FloatArray | None] | None:
    """Return the columns of a small block of numbers and nothing else, read sooner than Polars is loaded."""
    if len(content) > _SMALL_BYTES or not content.strip() or b"#" in content or b'"' in content:
        return None
    if layout.decimal == ",":
        if b"." in content or layout.delimiter == ",":
            return None
        content = content.replace(b",", b".")
    delimiter = None if layout.delimiter == " " else layout.delimiter
    try:
        columns = np.loadtxt(io.BytesIO(content), delimiter=delimiter, comments=None, ndmin=2).T
    except ValueError:
        return None
    return [np.ascontiguousarray(column) for column in columns] if len(columns) == count else None


def _parse_block(
    path: Path, content: bytes, layout: Layout, count: int, first_line: int, wanted: Sequence[int] = ()
) -> Sequence[Cells | None]:
    """Return the columns of a block, all of them or those that are wanted."""
    if layout.delimiter == " ":
        content = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", content)
        content, layout = re.sub(rb"[ \t]+", b"\t", content), replace(layout, delimiter="\t")
    frame = _frame(path, content, layout, count, first_line)
    names = [f"{k}" for k in range(count)]
    return [
        Cells(frame.select_seq("row", *Cells.asked(name, layout.decimal)), name)
        if not wanted or k in wanted
        else None
        for k, name in enumerate(names)
    ]


def _frame(path: Path, content: bytes, layout: Layout, count: int, first_line: int) -> pl.DataFrame:
    """Return the rows of a block that hold anything, with their lines; columns are texts, named by number."""
    import polars as pl

    # the line of names: a first row may be short
    numbered = layout.delimiter.join(f"{k}" for k in range(count)).encode() + b"\n"
    try:
        frame = pl.read_csv(
            numbered + content,
            schema={f"{k}": pl.String for k in range(count)},
            separator=layout.delimiter,
            comment_prefix="#",
            truncate_ragged_lines=True,
        )
    except pl.exceptions.PolarsError as error:
        if (encoding := _encoding(path, content)) != _UTF8:
            return _frame(path, content.decode(encoding).encode(), layout, count, first_line)
        raise InputError(
            place=path, found=f"not a table of numbers ({str(error).splitlines()[0]})"
        ) from error
    return frame.with_row_index("row", first_line).filter(~pl.all_horizontal(pl.exclude("row").is_null()))


# ------------------------------------------------------------------------------------------- looking


def find_decimal(path: Path, rows: Sequence[str], delimiter: str) -> str:
    """Return the decimal sign of the rows, "" when none has one; both signs are an error."""
    fields = [text for line in rows for text in split_line(line, delimiter) if _NUMBER.fullmatch(text)]
    found = {sign for sign in ".," if any(sign in text for text in fields)}
    if len(found) > 1:
        examples = " and ".join(repr(next(text for text in fields if sign in text)) for sign in ".,")
        raise InputError(
            place=path,
            found=f"numbers have decimal points and decimal commas ({examples})",
            expected="one of them",
            remedy="Export the numbers without separators of thousands",
        )
    return found.pop() if found else ""


def _refuse_two_commas(path: Path, lines: Sequence[str], first: int, delimiter: str) -> None:
    """Refuse commas that separate columns and decimals alike: 0,5,1,25 is two numbers or four."""
    fields = split_line(lines[first], delimiter)
    above = next((line for line in reversed(lines[:first]) if line.strip()), "")
    names = split_line(_COMMENT.sub("", above), delimiter)
    if delimiter != "," or len(names) < 2 or count_numbers(names) or len(fields) <= len(names):
        return
    if all(_WHOLE.fullmatch(text) for text in fields):
        raise InputError(
            place=path,
            found=(
                f"{len(names)} names and {len(fields)} fields in line {first + 1}: commas seem to separate "
                "both columns and decimals"
            ),
            remedy="Export with semicolons, or with decimal points",
        )


def _wide(head: bytes) -> bool:
    """Tell whether bytes look like UTF-16 without a mark: every other one is zero."""
    half = len(head) // 2
    return (
        half > 8 and max(head[0::2].count(0), head[1::2].count(0)) > 0.9 * half and head.count(0) < 1.2 * half
    )


def _encoding(path: Path, content: bytes) -> str:
    """Return the encoding of a text: UTF-8, else a Chinese one or Windows-1252 where it may well be that."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        letters = len(content) - len(content.translate(None, bytes(range(128, 256))))
        if _NO_TEXT.search(content) is None and _is_chinese(content):
            return _CHINESE
        if _NO_TEXT.search(content) is None and letters <= _MOST_LETTERS * len(content):
            return _WINDOWS
        raise InputError(
            place=path,
            found=(
                f"byte {error.start} is not UTF-8 text (0x{content[error.start]:02x}); save the file as UTF-8"
            ),
        ) from error
    return _UTF8


def _is_chinese(content: bytes) -> bool:
    """Tell whether all bytes beyond ASCII are pairs of GB 2312, two at least: umlauts stand alone."""
    try:
        return len(content) - len(content.decode("gb2312")) > 1
    except UnicodeDecodeError:
        return False


def _distinct(names: Sequence[str]) -> list[str]:
    order: list[str] = []
    for k, given in enumerate(names):
        name = given or f"column {k + 1}"
        order.append(f"{name} ({k + 1})" if name in order else name)
    return order
