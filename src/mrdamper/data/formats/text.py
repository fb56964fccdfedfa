"""Delimited text: delimiter, decimal sign and header are detected and reported."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, groupby, zip_longest
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.clocks import with_samplings
from mrdamper.data.formats.lines.blocks import find_blocks
from mrdamper.data.formats.lines.cells import cells_of_lines, is_number, with_dates
from mrdamper.data.formats.lines.encodings import Text, read_lines, utf16_of
from mrdamper.data.formats.lines.header import (
    DELIMITERS,
    count_numbers,
    find_data,
    find_decimal,
    read_header,
    refuse_two_commas,
    split_line,
    statements,
)
from mrdamper.data.formats.lines.properties import Header
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import (
    FileOptions,
    Layout,
    Moment,
    NoTableError,
    Table,
    Texts,
    distinct_names,
)
from mrdamper.data.words.headers import word_and_unit
from mrdamper.data.words.labels import CONDITIONS, labels_in
from mrdamper.errors import InputError
from mrdamper.quantities import spell_unit

_COUNT = re.compile(r"\b(?:sample count|npts)\s*[:=]\s*(\d+)", re.IGNORECASE)
_SIGN_APART = re.compile(r"(?<!\S)[+-](?=\s)")
_LONE_SIGN = re.compile(r"(^|\s)([+-])[ \t]+(?=[\d.])")


def is_text(head: bytes) -> bool:
    """Return True if the first bytes of a file are text in any encoding."""
    return b"\0" not in head or bool(utf16_of(head))


def read_text(path: Path | Text, options: FileOptions) -> Table:
    """Return the first table in a delimited text; later tables are in its ``following``."""
    text = read_lines(path)
    head = text.lines[: SETTINGS.header_lines_max]
    if re.match(r"\s*<(!doctype|html|\?xml)", head[0], re.IGNORECASE):
        raise InputError(place=text.place, found="is a web page or XML", remedy="Download the file itself")
    for form in (_with_joined_signs, _transposed, _without_notes_beside):
        if (table := form(text, head, options)) is not None:
            return table
    delimiter, first = find_data(head, options.delimiter)
    if first is None:
        # If the only line consists of column names, it is the header of a record without samples.
        lines = [line for line in head if line.strip() and not line.startswith("#")]
        widths = [len(split_line(line, sign)) for line in lines for sign in DELIMITERS[:-1]]
        is_empty_record = len(lines) == 1 and max(widths) >= SETTINGS.empty_record_columns_min
        raise (InputError if is_empty_record else NoTableError)(
            place=text.place,
            found=f"no rows of numbers in the first {len(head)} lines",
            expected="a header and at least two columns, separated by comma, semicolon, tab, bar or blanks",
        )
    rows = [split_line(line, delimiter) for line in text.lines[first:][-3:]]
    widths = [*map(len, rows)]
    if len(rows) == 3 and 0 < widths[2] < widths[0] == widths[1] and is_number(rows[2][0]):
        text = replace(text, lines=text.lines[:-1], notes=(*text.notes, "incomplete last row omitted"))
    header = read_header(head, first, delimiter)
    refuse_two_commas(text.place, head, first, delimiter)
    decimal = options.decimal or find_decimal(text.place, head[first:], delimiter)
    layout = Layout("delimited text", delimiter, decimal, first, notes=text.notes)
    # A text without comments between the rows is first read as one table, which is fast.
    if not any(line.startswith("#") for line in text.lines[first:]):
        with suppress(InputError):  # The invalid cell may be in a line of words between two blocks.
            table = _table(text, header, layout)
            # A last row without numbers may be a line of words.
            if not all(np.isnan(values[-1]) for values in table.columns.values()):
                return table
    table, *others = _tables_of_blocks(text, header, layout)
    return replace(table, following=tuple(others))


def _table(text: Text, header: Header, layout: Layout, stop: int | None = None) -> Table:
    """Return the table of the rows up to the line ``stop`` or the end, with factors of the header."""
    table = replace(parse_rows(text, header.names, layout, stop), said=header.said)
    stated_rows = [int(stated[1]) for line in header.said if (stated := _COUNT.search(line))]
    if stop is None and table.rows < max(stated_rows, default=0):
        found = f"holds {table.rows} samples where its header states {max(stated_rows)}: it was cut off"
        remedy = "Copy it again, or correct the number if the rest is not wanted"
        raise InputError(place=text.place, found=found, remedy=remedy)
    if header.sampling is not None:
        table = with_samplings(table, dict.fromkeys(table.columns, header.sampling))
    table = _converted(table, header.spans, "converted with the spans or the equation above the table")
    scaled = {name: scale for name, scale in header.scales.items() if name in table.columns}
    if len(scaled) < 2 or any((table.columns[name] % 1.0).any() for name in scaled):
        return replace(table, scales={name: factor for name, (factor, _) in scaled.items()})
    for name, (factor, offset) in scaled.items():
        counts = np.array([table.columns[name].min(), table.columns[name].max()])
        # The offset may be the count of zero because the values would otherwise have one sign.
        if np.prod(counts * factor + offset) > 0.0 and counts[0] < offset < counts[1]:
            found = f"the offset {offset:g} of {name!r} may belong to the counts or to the values"
            remedy = "Write the equation above the table, such as 'value = (count - offset) * factor'"
            raise InputError(place=text.place, found=found, remedy=remedy)
    return _converted(table, scaled, "counts multiplied by the factors above the table")


def _converted(table: Table, scales: Mapping[str, tuple[float, float]], note: str) -> Table:
    """Return a table with some columns multiplied by a factor and shifted by an offset."""
    columns = {name: table.columns[name] * a + b for name, (a, b) in scales.items() if name in table.columns}
    notes = (*table.layout.notes, note) if columns else table.layout.notes
    return replace(table, columns={**table.columns, **columns}, layout=replace(table.layout, notes=notes))


def _tables_of_blocks(text: Text, header: Header, layout: Layout) -> list[Table]:
    """Return the table of each block of rows."""
    first, delimiter = layout.header_lines or 0, layout.delimiter
    blocks, trailer = find_blocks(text.lines, first, delimiter)
    long = [block for block in blocks if block.rows >= SETTINGS.table_rows_min]
    headings = {block.above[-1] for block in long if block.above}  # The last page of a listing may be short.
    long = [block for block in blocks if block in long or headings.intersection(block.above[-1:])]
    if not long or (len(blocks) == 1 and not trailer):
        return [_table(text, header, layout)]
    notes, above = layout.notes, [line for line in text.lines[:first] if line.strip()]
    # Above the first block are lines that describe the file, then lines that describe the block. Above a
    # later block are only lines of the second type. Their largest number is assumed for the first block too.
    count = len(above) - max((len(block.above) for block in long[1:]), default=len(above))
    shared = above[: max(count, 0)]
    about_file = {*statements(shared, delimiter)}
    # The last line about the file may state a current. Without a blank line between this line and the column
    # names, the current may apply only to the first block.
    near = [line for line in statements(shared[-1:], delimiter) if labels_in(line, "current")]
    is_near = bool(near) and all(map(str.strip, text.lines[text.lines.index(shared[-1]) : first]))
    stated: list[str] = []
    if trailer:
        notes += (f"{len(trailer)} line{'s' if len(trailer) > 1 else ''} of words below the rows",)
        if len(blocks) == 1:
            lines = (*trailer, "", *text.lines[: first + 1])
            header = read_header(lines, len(lines) - 1, delimiter)
    if len(long) > 1:
        notes += (f"{len(long)} blocks of rows",)
        stated = [line for line in header.said if line in about_file]
        header = replace(header, said=tuple(line for line in header.said if line not in about_file))
    tables: list[Table] = []
    for block in long:
        if block.above:
            lines = (*block.above, text.lines[block.first])
            own = read_header(lines, len(lines) - 1, delimiter)
            is_bare = not own.named and len(own.names) == len(header.names)
            header = replace(header, said=own.said) if is_bare else own
        rows = replace(layout, header_lines=block.first, notes=notes)
        own_lines = header.said or (near if is_near else ())
        restated = [role for role in CONDITIONS if any(labels_in(line, role) for line in own_lines)]
        inherited = (line for line in stated if not any(labels_in(line, role) for role in restated))
        whole = replace(header, said=(*inherited, *header.said))
        tables.append(_table(text, whole, rows, block.stop))
    return tables


def _with_joined_signs(text: Text, head: Sequence[str], options: FileOptions) -> Table | None:
    """Return the table of a text with blanks between signs and digits, else None.

    A sign may also be a mark of a missing value. All rows then have the same number of cells with it.
    """
    if not any(_SIGN_APART.search(line) for line in head):
        return None
    joined = [_LONE_SIGN.sub(r"\1\2", line) for line in text.lines]
    apart = [_SIGN_APART.sub("0", line) for line in head]
    counts, others = (
        {len(fields) for line in lines if 1 < count_numbers(fields := line.split()) == len(fields)}
        for lines in (joined[: len(head)], apart)
    )
    return read_text(replace(text, lines=joined), options) if len(counts) == 1 < len(others) else None


def _transposed(text: Text, _head: Sequence[str], options: FileOptions) -> Table | None:
    """Return the table of a text if each row is a channel (perhaps its name, then samples), else None.

    Several blocks of such rows, each below its own lines, are the blocks of one text.
    """
    if len(text.lines) > SETTINGS.table_columns_max:
        return None
    longest = max(text.lines, key=len)
    delimiter = options.delimiter or max(
        DELIMITERS, key=lambda sign: count_numbers(split_line(longest, sign))
    )
    rows = [row for line in text.lines if any(row := split_line(line.rstrip(f"{delimiter} "), delimiter))]
    long = [row for row in rows if len(row) > max(SETTINGS.table_columns_max, len(rows))]
    kinds = {(is_number(row[0]), is_number(row[-1])) for row in long}
    if len(long) < 2 or kinds not in ({(True, True)}, {(False, True)}):
        return None
    blocks = (
        [*(zip_longest(*group, fillvalue="") if is_long else group), []]
        for is_long, group in groupby(rows, key=lambda row: row in long)
    )
    return _rearranged(text, chain(*blocks), options, "a row for each channel")


def _without_notes_beside(text: Text, head: Sequence[str], options: FileOptions) -> Table | None:
    """Return the table of a text with columns of notes next to the samples, else None.

    Notes are entries (label, value). Their columns are to the left of the samples, or to the right behind an
    empty column. The rows in the second half of the searched lines have no entries.
    """
    delimiter = options.delimiter or max(DELIMITERS[:-1], key=lambda sign: sum(sign in line for line in head))
    rows = [split_line(line, delimiter) for line in head]
    late = [k for row in rows[len(rows) // 2 :] for k, cell in enumerate(row) if cell]
    first, last = min(late, default=0), max(late, default=0) + 1
    entries = [cells for row in rows if len(cells := [cell for cell in row[:first] + row[last:] if cell]) > 1]
    are_apart = not any(row[last : last + 1] not in ([], [""]) for row in rows)
    if len(entries) < 2 or not are_apart or not all(cells[0][:1].isalpha() for cells in entries):
        return None
    cut = (split_line(line, delimiter)[first:last] for line in text.lines)
    return _rearranged(text, [*entries, [], *cut], options, "notes next to the samples")


def _rearranged(text: Text, cells: Iterable[Sequence[str]], options: FileOptions, note: str) -> Table:
    """Return the table of rearranged cells."""
    again = replace(text, lines=[*map("\t".join, cells)])
    table = read_text(again, FileOptions(delimiter="\t", decimal=options.decimal))
    return replace(table, layout=replace(table.layout, notes=(*table.layout.notes, note)))


def parse_rows(text: Text, names: Sequence[str], layout: Layout, stop: int | None = None) -> Table:
    """Return the columns of the rows below the header up to the line ``stop`` or the end.

    A column is numeric if at least half of its filled cells are numbers. Columns of times of day or dates are
    converted to seconds. Raise InputError with the line number if a numeric column has an invalid cell.
    """
    order = distinct_names(names)
    first = layout.header_lines or 0
    lines = text.lines[first:stop]
    numbers = _parse_numbers(lines, layout, order)
    words: dict[str, Texts] = {}
    stamps: dict[str, Moment] = {}
    if numbers is None:
        numbers = {}
        cells = with_dates(cells_of_lines(lines, layout, len(order), first + 1))
        for name, given in zip(order, cells, strict=True):
            column, moment = given.as_times() if given.mostly_text else (given, None)
            if column.mostly_text:
                words[name] = given.texts
                continue
            if column.bad:
                row, cell = column.first_bad()
                found = f"column {name!r} holds {cell!r} ({column.bad} such cells)"
                expected, remedy = "a time" if moment else "a number", "Correct the cell, or omit its row"
                place = f"{text.place}, line {row}"
                raise InputError(place=place, found=found, expected=expected, remedy=remedy)
            numbers[name] = column.numbers
            stamps |= {name: moment} if moment else {}
    for clock in stamps:
        _add_milliseconds(numbers, clock, order[order.index(clock) + 1 :][:1])
    return Table(
        names=tuple(name for name in order if name in numbers or name in words),
        columns=numbers,
        texts=words,
        layout=layout,
        rows=max(map(len, (numbers | words).values())),
        units=dict.fromkeys(stamps, "s"),
        stamps=stamps,
    )


def _add_milliseconds(numbers: dict[str, FloatArray], clock: str, beside: Sequence[str]) -> None:
    """Add the milliseconds in the column next to a clock of whole seconds to this clock."""
    for name in beside if clock in numbers else ():
        part = numbers.get(name, np.empty(0))
        falls, steps = np.diff(part) < 0.0, np.diff(numbers[clock])
        is_part = len(part) and np.all((part >= 0.0) & (part < 1000.0)) and falls.any()
        is_whole = not (numbers[clock] % 1.0).any() and np.all(steps[falls] > 0.0)
        if is_part and is_whole and spell_unit(word_and_unit(name)[1], "time") == "ms":
            numbers[clock] = numbers[clock] + 1e-3 * (numbers.pop(name) - part[0])


def _parse_numbers(
    lines: Sequence[str], layout: Layout, names: Sequence[str]
) -> dict[str, FloatArray] | None:
    """Return the columns of rows, which NumPy parses quickly, or None if a cell is not a number."""
    has_thousands = layout.decimal == "," and any("." in line for line in lines)
    if not any(map(str.strip, lines)) or layout.decimal == layout.delimiter or has_thousands:
        return None
    if layout.decimal == ",":
        lines = [line.replace(",", ".") for line in lines]
    delimiter = None if layout.delimiter == " " else layout.delimiter
    with suppress(ValueError):  # A cell is not a number, or the rows have more or fewer cells than names.
        columns = np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2).T
        return dict(zip(names, map(np.ascontiguousarray, columns), strict=True))
    return None
