"""MTS 793 text (Basic and Multipurpose TestWare): a file that describes itself on its first line.

``MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A``: program, module, language, version, delimiter (0 blank, 1 comma, 2 tab),
decimal sign, then signs of date and time. Below come acquisitions, one after the other:

    Data Acquisition            Time:   3.05   Sec   3/29/2016 1:54:32 PM
    Running Time    Axial Displacement    Axial Force
    Sec             mm                    kN
    0.0009765625    -1.25                 0.318

An acquisition whose time does not go on from the one before begins a new recording. (The layout is that of
published files; the maker's manual was not read.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from mrdamper.data.formats.lines.encodings import encoding_of
from mrdamper.data.formats.lines.header import count_numbers, find_header, split_line
from mrdamper.data.formats.table import FileOptions, Layout, Table, Texts, parts_of
from mrdamper.data.formats.text import lines_of, parse_rows, read_head
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError

_DELIMITERS: Mapping[str, str] = MappingProxyType({"0": " ", "1": ",", "2": "\t"})
_BEGINS_A_NUMBER = frozenset(b"0123456789+-.,")


@dataclass(slots=True)
class _Acquisition:
    """Where one acquisition lies in the file."""

    header: list[bytes]
    lines_above: int  # lines of the file before its first row
    start: int  # byte of its first row
    stop: int  # and the one after its last


def is_mts(head: bytes) -> bool:
    """Tell whether the first bytes are those of an MTS 793 text."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"MTS793|")


def read_mts(path: Path, _options: FileOptions) -> Table:
    """Return the table of an MTS 793 text, its acquisitions one after the other."""
    line = next((line for line in read_head(path).lines if line.strip()), "")
    fields = line.strip().split("|")
    if len(fields) < 6 or fields[4] not in _DELIMITERS or fields[5] not in {".", ","}:
        raise InputError(
            place=path,
            found=f"line 1 is {line[:60]!r}",
            expected="MTS793|...|delimiter|decimal|... with 0, 1 or 2 and a point or a comma",
            remedy="Export the file again",
        )
    delimiter, decimal = _DELIMITERS[fields[4]], fields[5]
    if delimiter == decimal:
        raise InputError(
            place=path, found="line 1 says that commas separate columns and decimals; export with tabs"
        )
    found = _find_acquisitions(path, delimiter)
    if not found:
        raise InputError(
            place=path, found="an MTS 793 text without a row of numbers; record or export it again"
        )
    tables = [_read_acquisition(path, each, delimiter, decimal) for each in found]
    first_columns = tables[0].columns.keys()
    for each, table in zip(found[1:], tables[1:], strict=True):
        if table.names != tables[0].names:
            raise InputError(
                place=f"{path}, line {each.lines_above}",
                found=(
                    f"the columns {', '.join(table.names)} are not those of the first acquisition "
                    f"({', '.join(tables[0].names)})"
                ),
                expected="the same",
                remedy="Split the file there",
            )
        for name in first_columns ^ table.columns.keys():
            raise InputError(
                place=f"{path}, line {each.lines_above}",
                found=f"column {name!r} holds numbers in one acquisition and text in another",
                expected="numbers",
                remedy="Correct the cells, or split the file there",
            )
    return _joined(found, tables)


def _find_acquisitions(path: Path, delimiter: str) -> list[_Acquisition]:
    """Return the acquisitions that hold rows; a line of two numbers is one, whatever it begins with."""
    found: list[_Acquisition] = []
    header: list[bytes] = []  # since the last row
    at = 0
    with path.open("rb") as stream:
        for number, line in lines_of(stream, path):
            text = line.strip()
            if text and (text[0] in _BEGINS_A_NUMBER or _holds_numbers(line, delimiter)):
                if header or not found:
                    found.append(_Acquisition(header, number - 1, at, at))
                    header = []
                found[-1].stop = at + len(line)
            elif text:
                header.append(line)
            at += len(line)
    return found


def _holds_numbers(line: bytes, delimiter: str) -> bool:
    return count_numbers(split_line(line.decode("utf-8", "replace"), delimiter)) > 1


def _read_acquisition(path: Path, each: _Acquisition, delimiter: str, decimal: str) -> Table:
    with path.open("rb") as stream:
        stream.seek(each.start)
        row = stream.readline()
    encoding = encoding_of(path, b"".join(each.header))
    lines = [line.decode(encoding, "replace").rstrip("\r\n") for line in (*each.header, row)]
    return parse_rows(
        path,
        each.start,
        find_header(lines, len(lines) - 1, delimiter),
        Layout("MTS 793 text", delimiter, decimal, each.lines_above),
        each.stop,
    )


def _joined(found: list[_Acquisition], tables: list[Table]) -> Table:
    first = tables[0]
    if len(tables) == 1:
        return first
    columns = {name: np.concatenate([table.columns[name] for table in tables]) for name in first.columns}
    texts: dict[str, Texts] = {name: [] for name in first.texts}
    begins: Texts = []
    for each, table in zip(found, tables, strict=True):
        for name, cells in texts.items():
            cells.extend(table.texts[name])
        said = [line for line in each.header if line.startswith(b"Data ")] or each.header or [b""]
        begins += [said[0].decode("utf-8", "replace").strip(), *[None] * (table.rows - 1)]
    edges = np.cumsum([0, *(table.rows for table in tables)])
    time = next((name for name in columns if (parse_header(name) or ("",))[0] == "time"), None)
    parts = parts_of(None if time is None else columns[time], edges.tolist())
    return replace(
        first,
        names=(*first.names, "acquisition"),
        columns=columns,
        texts={**texts, "acquisition": begins},
        rows=int(edges[-1]),
        parts=parts,
        layout=replace(first.layout, notes=(f"{len(tables)} acquisitions",)),
    )
