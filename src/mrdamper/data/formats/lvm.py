"""LabVIEW measurement text (.lvm): a header of tags, then segments, each with a header and columns.

Source: NI's "Specification for the LabVIEW Measurement File (.lvm)". Each write to a file makes a segment.
A segment that continues the time of the previous segment belongs to the same recording. Other segments are
separate recordings. If the time column restarts in each segment, the header of a segment states the start.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.data.formats.clocks import Sampling, stated_sampling, with_samplings, with_times
from mrdamper.data.formats.lines.encodings import open_text_bytes
from mrdamper.data.formats.lines.header import split_line, statements
from mrdamper.data.formats.table import FileOptions, Layout, Table
from mrdamper.data.formats.text import parse_rows, read_head
from mrdamper.data.formats.timestamps import moment_of
from mrdamper.data.words.headers import unit_in_brackets
from mrdamper.errors import InputError
from mrdamper.quantities import is_unit

_END = re.compile(rb"(?m)^\*\*\*End_of_Header\*\*\*.*\n?")
# Notes are optional and precede the channel count.
_SEGMENT = re.compile(rb"(?ms)^((?:Notes|Channels)[\t,].*?)^\*\*\*End_of_Header\*\*\*[^\n]*\n([^\n]*)\n?")
_SEPARATORS = {"tab": "\t", "comma": ","}
_X = "X_Value"
_OF_SAMPLES = re.compile(r"(X0|Delta_X|X_Dimension|Y_Unit_Label|Date|Time|Samples|Channels|.*_Version)\b")

Tags = Mapping[str, list[str]]


def read_lvm(path: Path, _options: FileOptions) -> Table:
    """Return the first recording in a LabVIEW measurement file; ``Table.following`` has the later ones."""
    head = read_head(path)
    with open_text_bytes(path) as stream:
        content = stream.read()
    end = _END.search(content)
    if end is None:
        found = f"no ***End_of_Header*** in the first {len(head.lines)} lines; it was cut off: copy it again"
        raise InputError(place=path, found=found)
    file_tags = _tags_of(content[: end.start()], head.encoding)
    headers = [*_SEGMENT.finditer(content, end.end())] or [
        *re.compile(rb"()([^\n]*)\n?").finditer(content, end.end())
    ][:1]
    delimiter = _SEPARATORS.get(file_tags.get("Separator", ["Tab"])[0].lower(), "\t")
    decimal = file_tags.get("Decimal_Separator", ["."])[0] or "."
    if delimiter == decimal:
        raise InputError(place=path, found="commas separate columns and decimals; save the file with tabs")
    if not content[headers[0].end() :].strip():
        raise InputError(place=path, found="no rows after its header", expected="rows of numbers")
    names = split_line(headers[0][2].decode(head.encoding), delimiter)
    tables: list[tuple[Table, Sampling]] = []
    above = 0
    for number, (each, stop) in enumerate(
        zip(headers, [*(other.start() for other in headers[1:]), len(content)], strict=True)
    ):
        above += content.count(b"\n", headers[number - 1].end() if number else 0, each.end())
        if each[2].rstrip() != headers[0][2].rstrip():
            raise InputError(
                place=f"{path}, line {above}",
                found="the columns differ from the columns of the first segment",
                remedy="Split the file there",
            )
        layout = Layout("LabVIEW measurement text", delimiter, decimal, above, notes=head.notes)
        tags = {**file_tags, **_tags_of(each[1], head.encoding)}
        table = _with_clock(parse_rows(path, each.end(), names, layout, stop), tags)
        lines = ["\t".join([name, *cells]) for name, cells in tags.items()]
        said = statements([line for line in lines if not _OF_SAMPLES.match(line)], "\t")
        tables.append((replace(table, said=said), _sampling(tags, 0)))
    filled = [pair for pair in tables if pair[0].rows] or tables[:1]
    begun = filled[0][1]
    found_tables = [table if len(filled) == 1 else _with_time(table, own, begun) for table, own in filled]
    notes = (*head.notes, f"{len(filled)} segments") if len(filled) > 1 else head.notes
    first, *others = [replace(table, start=begun.began) for table in found_tables]
    return replace(first, following=tuple(others), layout=replace(first.layout, notes=notes))


def _tags_of(content: bytes, encoding: str) -> Tags:
    """Return a mapping from each tag to the cells after the tag."""
    tags: dict[str, list[str]] = {}
    for line in content.decode(encoding, "replace").splitlines():
        name, *cells = [cell.strip() for cell in line.split("," if "\t" not in line else "\t")]
        tags[name] = cells or [""]
    return tags


def _sampling(tags: Tags, channel: int) -> Sampling:
    """Return start and step of a channel, by its number. The step is NaN if the header states no step."""
    cells = [
        [cell for cell in tags.get(name, []) if cell] or [""] for name in ("X0", "Delta_X", "Date", "Time")
    ]
    x0, step, date, clock = (given[min(channel, len(given) - 1)] for given in cells)
    settings = {"t offset s": x0.replace(",", "."), "delta x s": step.replace(",", ".")}
    if date:
        # LabVIEW writes more decimals of a second than a time stamp may have.
        settings["start time"] = re.sub(r"([.,]\d{6})\d+", r"\1", f"{date} {clock}")
    return stated_sampling(settings) or Sampling(math.nan, began=moment_of(settings.get("start time", "")))


def _with_clock(table: Table, tags: Tags) -> Table:
    """Return a table with the times and the units that the header states for the channels."""
    columns, units = dict(table.columns), dict(table.units)
    clocks = [name for name in columns if name == _X or name.startswith(f"{_X} (")]
    # The tag Y_Unit_Label has one cell for each column after the first.
    for name, unit in zip(table.names[1:], tags.get("Y_Unit_Label", []), strict=False):
        said = unit_in_brackets(name)
        if unit and name in columns.keys() - clocks and not (said and is_unit(said)):
            units[name] = unit
    if tags.get("X_Dimension", ["Time"])[0] not in {"Time", ""}:
        return replace(table, units=units)
    x = [columns.pop(name) for name in clocks]
    names = tuple(name for name in table.names if name not in clocks)
    # If channels differ in length, the cells at the end of the shorter columns are empty.
    rows = {name: np.flatnonzero(np.isfinite(values)) for name, values in columns.items()}
    ends = {name: int(filled[-1]) + 1 if len(filled) else 0 for name, filled in rows.items()}
    cut = {name: values[: ends[name]] for name, values in columns.items()}
    table = replace(table, names=names, columns=cut, units=units)
    samplings = {name: own for k, name in enumerate(names) if (own := _sampling(tags, k)).step_s > 0.0}
    if len(x) > 1 and any(not np.array_equal(other, x[0], equal_nan=True) for other in x):
        began = {name: own.began_s for name, own in samplings.items() if own.began_s is not None}
        first = min(began.values(), default=0.0)
        each = dict(zip(names, x, strict=False))
        times = {
            name: each[name][: ends[name]] + began.get(name, first) - first for name in each if name in cut
        }
        return with_times(table, times)
    apart = with_samplings(table, samplings)
    if apart.clocks:
        return apart
    if not x or not np.isfinite(x[0]).any():
        return replace(table, step_s=apart.step_s)
    return replace(
        table, names=("time", *names), columns={"time": x[0], **columns}, units={**units, "time": "s"}
    )


def _with_time(table: Table, own: Sampling, first: Sampling) -> Table:
    """Return the table of a segment with a column of times [s].

    ``own`` and ``first`` are the samplings of this segment and of the first segment. If the times begin at
    zero, the delay of this segment after the first segment is added.
    """
    if table.clocks or (table.step_s is None and "time" not in table.columns):
        return table
    uniform = np.asarray(own.offset_s + (table.step_s or 0.0) * np.arange(table.rows), dtype=np.float64)
    time = table.columns.get("time", uniform)
    if own.began_s is not None and first.began_s is not None and len(time) and time[0] == 0.0:
        time = time + (own.began_s - first.began_s)
    names = table.names if "time" in table.names else ("time", *table.names)
    columns = {**table.columns, "time": time}
    return replace(table, names=names, columns=columns, units={**table.units, "time": "s"}, step_s=None)
