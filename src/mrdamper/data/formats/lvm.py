"""LabVIEW measurement text (.lvm): a header of tags, then segments, each with a header and columns.

Source: NI's "Specification for the LabVIEW Measurement File (.lvm)". Each write to a file makes a segment.
A segment that continues the time of the previous segment belongs to the same recording. Other segments are
separate recordings. If x restarts in each segment, a segment starts at its stated date and time of day.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.clocks import Sampling, with_samplings, with_times
from mrdamper.data.formats.lines.header import split_line
from mrdamper.data.formats.table import FileOptions, Layout, Moment, Table
from mrdamper.data.formats.text import Head, lines_of, parse_rows, read_head
from mrdamper.data.formats.timestamps import moment_of
from mrdamper.data.words.headers import unit_in_brackets
from mrdamper.errors import InputError
from mrdamper.quantities import is_unit

_FIRST = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ","}
_X = "X_Value"

Tags = Mapping[str, list[str]]


@dataclass(frozen=True, slots=True)
class _Segment:
    """The position of one segment's rows in the file, and its tags."""

    tags: Tags
    labels: bytes
    start: int  # bytes
    stop: int
    lines_above: int


def is_lvm(head: bytes) -> bool:
    """Return True if the first bytes are the start of a LabVIEW measurement text."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(_FIRST.encode())


def read_lvm(path: Path, _options: FileOptions) -> Table:
    """Return the first segment of a LabVIEW measurement file; ``following`` contains later segments."""
    head = read_head(path)
    tags, labels_at = _head_tags(path, head)
    delimiter = _SEPARATORS.get(tags.get("Separator", ["Tab"])[0].lower(), "\t")
    decimal = tags.get("Decimal_Separator", ["."])[0] or "."
    if delimiter == decimal:
        raise InputError(place=path, found="commas separate columns and decimals; save the file with tabs")
    names = split_line(head.lines[labels_at], delimiter)
    layout = Layout("LabVIEW measurement text", delimiter, decimal, labels_at + 1, notes=head.notes)
    segments = list(_segments(path, head.starts[labels_at], labels_at + 1, tags))
    pieces = []
    for each in segments:
        if each.labels != segments[0].labels:
            raise InputError(
                place=f"{path}, line {each.lines_above}",
                found="the columns are not those of the first segment",
                remedy="Split the file there",
            )
        table = parse_rows(path, each.start, names, replace(layout, header_lines=each.lines_above), each.stop)
        pieces.append((each, _with_clock(table, each.tags)))
    filled = [piece for piece in pieces if piece[1].rows] or pieces[:1]
    begun = _stamp(filled[0][0].tags)
    first, *others = [table if len(filled) == 1 else _with_time(table, each, begun) for each, table in filled]
    notes = (*first.layout.notes, f"{len(filled)} segments") if others else first.layout.notes
    first, *others = [replace(table, start=begun) for table in (first, *others)]
    return replace(first, following=tuple(others), layout=replace(first.layout, notes=notes))


def _head_tags(path: Path, head: Head) -> tuple[Tags, int]:
    """Return the tags of the file and of the first segment, and the line index of the column labels."""
    ends = [k for k, line in enumerate(head.lines) if line.startswith(_END)]
    if not ends:
        raise InputError(
            place=path, found=f"no {_END} in the first {len(head.lines)} lines; it was cut off: copy it again"
        )
    end = ends[:2][-1]  # The second end is the end of the first segment's header.
    if end + 2 >= len(head.lines):
        raise InputError(place=path, found="no rows after its header", expected="rows of numbers")
    return _tags_of(head.lines[:end]), end + 1


def _tags_of(lines: tuple[str, ...] | list[str]) -> Tags:
    """Return a mapping from each tag to the cells after the tag."""
    tags: dict[str, list[str]] = {}
    for line in lines:
        name, *cells = [cell.strip() for cell in line.split("," if "\t" not in line else "\t")]
        tags[name] = cells or [""]
    return tags


def _segments(path: Path, labels_start: int, lines_above: int, tags: Tags) -> Iterator[_Segment]:
    """Generate the segments; ``tags`` are the tags of the first segment."""
    header: list[bytes] | None = None  # The header of the next segment while it is read.
    ended = False
    with path.open("rb") as stream:
        stream.seek(labels_start)
        labels = stream.readline()
        at = labels_start + len(labels)
        now = _Segment(tags, labels.rstrip(), at, at, lines_above)
        for number, line in lines_of(stream, path, lines_above + 1):
            at += len(line)
            # Notes are optional and precede the channel count.
            if header is None and re.match(rb"(Notes|Channels)[\t,]", line) is not None:
                yield replace(now, stop=at - len(line))
                header, ended = [line], False
            elif header is None:
                continue
            elif ended:
                said = [each.decode("utf-8", "replace") for each in header]
                now = _Segment({**tags, **_tags_of(said)}, line.rstrip(), at, at, number)
                header = None
            elif line.startswith(_END.encode()):
                ended = True
            elif len(header) < 200:
                header.append(line)
            else:
                raise InputError(
                    place=f"{path}, line {number}",
                    found="the header of a segment does not end; copy it again",
                )
    if header is None:
        yield replace(now, stop=at)


def _with_clock(table: Table, tags: Tags) -> Table:
    """Return a table with the times and the units that the header states for the channels."""
    columns, units = dict(table.columns), dict(table.units)
    clocks = [name for name in columns if name == _X or name.startswith(f"{_X} (")]
    # There is one cell above each column.
    for name, unit in zip(table.names[1:], tags.get("Y_Unit_Label", []), strict=False):
        said = unit_in_brackets(name)
        if unit and name in columns.keys() - clocks and not (said and is_unit(said)):
            units[name] = unit
    if tags.get("X_Dimension", ["Time"])[0] not in {"Time", ""}:
        return replace(table, units=units)
    x = [columns.pop(name) for name in clocks]
    names = tuple(name for name in table.names if name not in clocks)
    table = replace(table, names=names, columns=columns, units=units)
    samplings = dict(zip(names, _samplings(tags, len(names)), strict=False))
    whole = _without_empty_ends(table)
    if len(x) > 1 and any(not np.array_equal(other, x[0], equal_nan=True) for other in x):
        return with_times(whole, _channel_times(whole, dict(zip(names, x, strict=False)), samplings))
    apart = with_samplings(whole, samplings)
    if apart.clocks:
        return apart
    if not x or not np.isfinite(x[0]).any():
        return replace(table, step_s=apart.step_s)
    return replace(
        table, names=("time", *names), columns={"time": x[0], **columns}, units={**units, "time": "s"}
    )


def _channel_times(
    table: Table, x: Mapping[str, FloatArray], samplings: Mapping[str, Sampling]
) -> dict[str, FloatArray]:
    """Return the times [s] of columns with separate x columns, relative to the earliest start."""
    began = {name: samplings[name].began_s if name in samplings else None for name in x}
    first = min((each for each in began.values() if each is not None), default=0.0)
    return {
        name: x[name][: len(table.columns[name])] + ((began[name] or first) - first)
        for name in x
        if name in table.columns
    }


def _samplings(tags: Tags, columns: int) -> list[Sampling]:
    """Return start and step of each channel, in the order of the columns."""
    cells = {
        name: [cell for cell in tags.get(name, []) if cell] for name in ("X0", "Delta_X", "Date", "Time")
    }
    samplings = []
    for k in range(columns):
        own = {name: [given[min(k, len(given) - 1)]] for name, given in cells.items() if given}
        step, begun = _number(own, "Delta_X", 0.0), _stamp(own)
        if not step > 0.0:
            break
        samplings.append(Sampling(step, _number(own, "X0", 0.0), begun))
    return samplings


def _without_empty_ends(table: Table) -> Table:
    """Return a table without the empty cells at the ends of columns: channels may differ in length."""
    rows = {name: np.flatnonzero(np.isfinite(values)) for name, values in table.columns.items()}
    columns = {
        name: table.columns[name][: int(filled[-1]) + 1 if len(filled) else 0]
        for name, filled in rows.items()
    }
    return replace(table, columns=columns)


def _with_time(table: Table, segment: _Segment, begun: Moment | None) -> Table:
    """Return the table of a segment with a column of times [s].

    If the times of a segment begin at zero, the start of the segment relative to the first segment is added.
    """
    if table.clocks or (table.step_s is None and "time" not in table.columns):
        return table
    x0, now = _number(segment.tags, "X0", 0.0), _stamp(segment.tags)
    uniform = np.asarray(x0 + (table.step_s or 0.0) * np.arange(table.rows), dtype=np.float64)
    time = table.columns.get("time", uniform)
    if begun is not None and now is not None and len(time) and time[0] == 0.0:
        time = time + (now.day_first_s - begun.day_first_s)
    names = table.names if "time" in table.names else ("time", *table.names)
    columns = {**table.columns, "time": time}
    return replace(table, names=names, columns=columns, units={**table.units, "time": "s"}, step_s=None)


def _stamp(tags: Tags) -> Moment | None:
    """Return the stated date and time of day of a segment."""
    time = re.sub(r"([.,]\d{6})\d+", r"\1", tags.get("Time", [""])[0])  # A stamp has up to nine digits.
    begun = moment_of(f"{tags.get('Date', [''])[0]} {time}")
    return begun if begun is not None and begun.has_date else None


def _number(tags: Tags, name: str, otherwise: float) -> float:
    try:
        number = float(tags[name][0].replace(",", "."))
    except (KeyError, ValueError):
        return otherwise
    return number if np.isfinite(number) else otherwise
