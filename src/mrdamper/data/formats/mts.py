"""MTS 793 text (Basic and Multipurpose TestWare): a delimited text whose first line describes it.

``MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A``: program, module, language, version, delimiter (0 blank, 1 comma, 2 tab),
decimal sign, then signs of date and time. Acquisitions follow one another, each with its own lines above the
rows. The layout is taken from published files, not from the maker's manual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.data.formats.text import read_head, read_text
from mrdamper.errors import InputError

_DELIMITERS: Mapping[str, str] = MappingProxyType({"0": " ", "1": ",", "2": "\t"})


def is_mts(head: bytes) -> bool:
    """Return True if the first bytes are the start of an MTS 793 text."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"MTS793|")


def read_mts(path: Path, _options: FileOptions) -> Table:
    """Return the first acquisition of an MTS 793 text; the others follow it."""
    line = next((line for line in read_head(path).lines if line.strip()), "")
    fields = line.strip().split("|")
    if len(fields) < 6 or fields[4] not in _DELIMITERS or fields[5] not in {".", ","}:
        raise InputError(
            place=path,
            found=f"line 1 is {line[:60]!r}",
            expected="MTS793|...|delimiter|decimal|... with 0, 1 or 2 and a point or a comma",
            remedy="Export the file again",
        )
    if _DELIMITERS[fields[4]] == fields[5]:
        raise InputError(
            place=path, found="line 1 says that commas separate columns and decimals; export with tabs"
        )
    table = read_text(path, FileOptions(delimiter=_DELIMITERS[fields[4]], decimal=fields[5]))
    return replace(table, layout=replace(table.layout, format="MTS 793 text"))
