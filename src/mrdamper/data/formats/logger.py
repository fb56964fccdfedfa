"""The text of a data logger: a header of stated size, then columns with events among them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrdamper.data.formats.table import FileOptions, Layout, Table
from mrdamper.data.formats.text import parse_rows, read_head
from mrdamper.errors import InputError


def is_logger(head: bytes) -> bool:
    """Return True if the first bytes are the start of a logger's text."""
    return head.lstrip().startswith(b"Header Size:")


def read_logger(path: Path, _options: FileOptions) -> Table:
    """Return the table of a logger. Raise InputError if there are fewer samples than stated."""
    head = read_head(path)
    stated: dict[str, str] = {}
    for line in head.lines:
        key, colon, value = line.partition(":")
        if not colon or "," in key:
            break
        stated[key.strip().lower()] = value.strip()
    try:
        size, step = int(stated["header size"]), float(stated["sampling interval"])
        count = int(stated.get("sample count", "0"))
        names = [name.strip() for name in head.lines[size - 1].split(",")]
        start = head.starts[size]
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(
            place=path,
            found=f"the logger's header lacks {error}",
            expected="'Header Size' and 'Sampling Interval' lines",
        ) from error
    table = parse_rows(path, start, names, Layout("logger text", ",", ".", size, notes=head.notes))
    if table.rows < count:
        raise InputError(
            place=path,
            found=f"holds {table.rows} samples where its header states {count}: it was cut off",
            remedy="Copy it again, or correct 'Sample Count' if the rest is not wanted",
        )
    return replace(table, step_s=step)
