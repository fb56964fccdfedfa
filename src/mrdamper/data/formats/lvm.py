"""LabVIEW measurement text (.lvm): a header of tags, a header of the segment, then columns.

After NI's "Specification for the LabVIEW Measurement File (.lvm)". Of several segments, each of which could
have columns and clocks of its own, none is chosen: a file holds one here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.data.formats.table import FileOptions, Layout, Table
from mrdamper.data.formats.text import Head, parse_rows, read_head, split_line
from mrdamper.errors import InputError

__all__ = ["is_lvm", "read_lvm"]

_FIRST = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ","}
_X = "X_Value"


def is_lvm(head: bytes) -> bool:
    """Tell whether the first bytes are those of a LabVIEW measurement text."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(_FIRST.encode())


def read_lvm(path: Path, _options: FileOptions) -> Table:
    """Return the table of a LabVIEW measurement text."""
    head = read_head(path)
    tags, labels_at = _tags(path, head)
    delimiter = _SEPARATORS.get(tags.get("Separator", ["Tab"])[0].lower(), "\t")
    decimal = tags.get("Decimal_Separator", ["."])[0] or "."
    if delimiter == decimal:
        raise InputError(f"{path}: commas separate columns and decimals; save the file with tabs")
    names = split_line(head.lines[labels_at], delimiter)
    table = parse_rows(
        path,
        head.starts[labels_at + 1],
        names,
        Layout("LabVIEW measurement text", delimiter, decimal, labels_at + 1, notes=head.notes),
    )
    return _with_clock(path, table, tags, names)


def _tags(path: Path, head: Head) -> tuple[Mapping[str, list[str]], int]:
    """Return what the tags say (a cell of the first column apart), and the line of the columns' labels."""
    ends = [k for k, line in enumerate(head.lines) if line.startswith(_END)]
    if not ends:
        raise InputError(
            f"{path}: no {_END} in the first {len(head.lines)} lines; it was cut off: copy it again"
        )
    if len(ends) > 2:
        raise InputError(f"{path}: holds {len(ends) - 1} segments; expected one. Save each in its own file")
    if ends[-1] + 2 >= len(head.lines):
        raise InputError(f"{path}: no rows after its header; expected rows of numbers")
    tags: dict[str, list[str]] = {}
    for line in head.lines[: ends[-1]]:
        name, *cells = [cell.strip() for cell in line.split("," if "\t" not in line else "\t")]
        tags[name] = cells or [""]
    return tags, ends[-1] + 1


def _with_clock(path: Path, table: Table, tags: Mapping[str, list[str]], names: list[str]) -> Table:
    """Name the columns of x as what they are, with units that the header states."""
    columns, units = dict(table.columns), dict(table.units)
    for name, unit in zip([each for each in names if each != _X], tags.get("Y_Unit_Label", []), strict=False):
        if unit and name in columns and not name.endswith((")", "]")):
            units[name] = unit
    clocks = [name for name in columns if name == _X or name.startswith(f"{_X} (")]
    times = [columns[name] for name in clocks]
    if any(not np.array_equal(other, times[0], equal_nan=True) for other in times[1:]):
        raise InputError(f"{path}: its channels have clocks of their own; expected one for all. Save X once")
    if tags.get("X_Dimension", ["Time"])[0] not in {"Time", ""}:
        return replace(table, units=units)
    for name in clocks:
        del columns[name]
    if times and np.isfinite(times[0]).any():
        columns, units["time"] = {"time": times[0], **columns}, "s"
    return replace(
        table,
        names=(
            *(["time"] if "time" in columns else []),
            *(name for name in table.names if name not in clocks),
        ),
        columns=columns,
        units=units,
        step_s=None if "time" in columns else _step(tags),
    )


def _step(tags: Mapping[str, list[str]]) -> float | None:
    try:
        step = float(tags["Delta_X"][0].replace(",", "."))
    except (KeyError, ValueError):
        return None
    return step if 0.0 < step < np.inf else None
