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

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.clocks import Sampling, stated_sampling, with_times
from mrdamper.data.formats.lines.encodings import read_lines
from mrdamper.data.formats.lines.header import split_line, statements
from mrdamper.data.formats.table import FileOptions, Layout, Moment, Table
from mrdamper.data.formats.text import parse_rows
from mrdamper.data.formats.timestamps import moment_of
from mrdamper.data.words.headers import unit_in_brackets
from mrdamper.errors import InputError
from mrdamper.quantities import is_unit

_END = re.compile(r"(?m)^\*\*\*End_of_Header\*\*\*.*\n?")
# Notes are optional and precede the channel count.
_SEGMENT = re.compile(r"(?ms)^((?:Notes|Channels)[\t,].*?)^\*\*\*End_of_Header\*\*\*[^\n]*\n([^\n]*)\n?")
_NAMES = re.compile(r"()([^\n]*)\n?")
_SEPARATORS = {"tab": "\t", "comma": ","}
_X = "X_Value"
_OF_SAMPLES = re.compile(r"(X0|Delta_X|X_Dimension|Y_Unit_Label|Date|Time|Samples|Channels|.*_Version)\b")

Tags = Mapping[str, list[str]]


def read_lvm(path: Path, _options: FileOptions) -> Table:
    """Return the first recording in a LabVIEW measurement file; ``Table.following`` has the later ones."""
    text = read_lines(path)
    content = "\n".join(text.lines)
    end = _END.search(content)
    if end is None:
        found = "no ***End_of_Header***; it was cut off: copy it again"
        raise InputError(place=path, found=found)
    file_tags = _tags_of(content[: end.start()])
    headers = [*_SEGMENT.finditer(content, end.end())] or [*_NAMES.finditer(content, end.end())][:1]
    delimiter = _SEPARATORS.get(file_tags.get("Separator", ["Tab"])[0].lower(), "\t")
    decimal = file_tags.get("Decimal_Separator", ["."])[0] or "."
    if delimiter == decimal:
        raise InputError(place=path, found="commas separate columns and decimals; save the file with tabs")
    if not content[headers[0].end() :].strip():
        raise InputError(place=path, found="no rows after its header", expected="rows of numbers")
    names = split_line(headers[0][2], delimiter)
    tables: list[Table] = []
    stops = [*(content.count("\n", 0, other.start()) for other in headers[1:]), None]
    for header, stop in zip(headers, stops, strict=True):
        above = content.count("\n", 0, header.end())
        if header[2].rstrip() != headers[0][2].rstrip():
            found = "the columns differ from the columns of the first segment"
            raise InputError(place=f"{path}, line {above}", found=found, remedy="Split the file there")
        tags = {**file_tags, **_tags_of(header[1])}
        lines = ["\t".join([name, *cells]) for name, cells in tags.items() if not _OF_SAMPLES.match(name)]
        layout = Layout("LabVIEW measurement text", delimiter, decimal, above, notes=text.notes)
        table = parse_rows(text, names, layout, stop)
        if table.rows:
            start = tables[0].start if tables else None
            tables.append(_with_clock(replace(table, said=statements(lines, "\t")), tags, start))
    return replace(tables[0], following=tuple(tables[1:]))


def _tags_of(content: str) -> Tags:
    """Return a mapping from each tag to the cells after the tag."""
    tags: dict[str, list[str]] = {}
    for line in content.splitlines():
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


def _with_clock(table: Table, tags: Tags, first: Moment | None) -> Table:
    """Return a table with the units and the times that the header states for the channels.

    ``first`` is the start of the first segment. If the times of a later segment begin at zero, the delay of
    this segment is added.
    """
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
    samplings = {name: _sampling(tags, k) for k, name in enumerate(names)}
    begun = [each.began for each in samplings.values() if each.began is not None]
    start = first or min(begun, key=lambda each: each.day_first_s, default=None)
    times: dict[str, FloatArray] = {}
    for k, (name, values) in enumerate(columns.items()):
        # If channels differ in length, the cells at the end of the shorter columns are empty.
        size = 1 + int(max(np.flatnonzero(np.isfinite(values)), default=-1))
        columns[name], sampling = values[:size], samplings[name]
        time = x[min(k, len(x) - 1)][:size] if x else np.empty(0)
        continues = bool(np.isfinite(time).any()) and time[0] != 0.0
        if not np.isfinite(time).any():
            time = sampling.offset_s + sampling.step_s * np.arange(size, dtype=np.float64)
        if np.isfinite(time).any():
            delay = sampling.began.day_first_s - start.day_first_s if sampling.began and start else 0.0
            times[name] = time if continues else time + delay
    clocked = with_times(replace(table, names=names, columns=columns, units=units, start=start), times)
    return replace(clocked, clocks={}) if "time" in clocked.clocks else clocked  # "time" is the only clock.
