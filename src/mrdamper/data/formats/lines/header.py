"""The first lines of a text or a sheet: delimiter, decimal sign, first row, names of columns."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from mrdamper.data.formats.groups import attribute_lines
from mrdamper.data.formats.lines.cells import is_number, number_in
from mrdamper.data.formats.lines.properties import Header, find_properties, name_in, property_of
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import is_missing
from mrdamper.data.formats.timestamps import days_of, is_time
from mrdamper.data.words.headers import (
    are_all_per_cent,
    is_per_cent,
    speaks_of,
    unit_in_brackets,
    word_and_unit,
)
from mrdamper.data.words.labels import CONDITIONS, labels_in, ranges_in, span_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, is_any_unit, roles_of_unit

_COMMENT = re.compile(r"^\s*(#|%|//|!)+\s?")
_SPARSE = re.compile(r"(events?|markers?|comments?|remarks?|notes?)", re.IGNORECASE)
_LEAD = re.compile(r"^\s*[^\W\d]+(?:\s+[^\W\d]+)?\s*[:=]\s*")  # label of a list, "columns: "
_THOUSANDS = re.compile(r"[+-]?\d{1,3},\d{3}")
_DECIMAL = re.compile(r"([+-]?\d+),(\d+)")
_PAIR = re.compile(r"\s*(?:[:=;\t]+|,)\s*")  # separates a label from its value
_WHOLE = re.compile(r"[+-]?\d+")
_SETTING = re.compile(
    r"\s*[-*]?\s*[\"']?([^\W\d][^:=]*?)[\"']?\s*[:=]\s*[\"']?"
    r"([+-]?\d[\d.,]*(?:[eEdD][+-]?\d+)?)[\"']?,?\s*"
)  # A setting: "Current_A=0.5".
_MARK = re.compile(r"\s*(\w[\w ]*:|\[[\w ]+\]|[\"']?[^\W\d]+[\"']?)\s*")  # A title of the samples: "[Data]".
DELIMITERS = ("\t", ";", ",", "|", " ")


def find_data(lines: Sequence[str], wanted: str = "") -> tuple[str, int | None]:
    """Return the delimiter and the index of the first row of numbers, None if no row was found.

    A row has two or more numbers, and is followed by another row. Ten consecutive rows have priority over
    fewer rows, because a short table of results may be above the samples.
    """
    found: list[tuple[tuple[bool, bool, int, int], str, int]] = []
    for rank, delimiter in enumerate((wanted,) if wanted else DELIMITERS):
        long = _first_row(lines, delimiter, SETTINGS.table_rows_min)
        k = _first_row(lines, delimiter, 2) if long is None else long
        if k is not None and not (delimiter == "," and _are_decimals(lines, k)):
            fields = split_line(lines[k], delimiter)
            numbers, filled = count_numbers(fields), sum(map(bool, fields))
            found.append(((long is not None, numbers == filled, numbers, -rank), delimiter, k))
    if found:
        return max(found)[1:]
    count = SETTINGS.table_rows_min
    alone = [k for k in range(len(lines) - count + 1) if all(map(is_number, lines[k : k + count]))]
    last = max((k + 1 for k, line in enumerate(lines) if not is_number(line.strip() or "0")), default=0)
    if _describes_one_channel(lines[:last]) and len(lines) - last > 1:  # One channel may have few samples.
        alone += [k for k in range(last, len(lines)) if lines[k].strip()]
    return wanted or ("\t" if alone else ","), next(iter(alone), None)  # A text with one column.


def _are_decimals(lines: Sequence[str], first: int) -> bool:
    """Return True if commas in lines such as ``1,20`` are decimal signs, not delimiters.

    The header then describes one column, or there are cells ``-0`` or ``05``, which are no whole numbers.
    False if the parts before the comma increase by equal steps: these parts are times or indices.
    """
    filled = [line.strip() for line in lines[first:] if line.strip()]
    cells = [match for line in filled if (match := _DECIMAL.fullmatch(line))]
    steps = {b - a for a, b in pairwise(int(cell[1]) for cell in cells)}
    if len(cells) < len(filled) or (len(steps) == 1 and steps != {0}):
        return False
    are_even = len({len(cell[2]) for cell in cells}) == 1
    has_zeros = any("-0," in cell[0] or (are_even and cell[2][:-1].startswith("0")) for cell in cells)
    return has_zeros or _describes_one_channel(lines[:first])


def _describes_one_channel(lines: Sequence[str]) -> bool:
    """Return True if the lines above a table state one name and one unit as entries ``Unit: kN``."""
    entries = [cells for line in lines if len(cells := _PAIR.split(line.strip(), maxsplit=1)) == 2]
    values = {property_of(name): value.strip() for name, value in entries if value.strip()}
    return ("name" in values or name_in(lines) != "") and is_any_unit(values.get("unit", ""))


def holds_samples(lines: Sequence[str], delimiter: str) -> bool:
    """Return True if there are ten consecutive rows of numbers. Fewer rows are a table of results."""
    return _first_row(lines, delimiter, SETTINGS.table_rows_min) is not None


def _first_row(lines: Sequence[str], delimiter: str, wanted: int) -> int | None:
    """Return the index of the first of ``wanted`` consecutive rows of numbers, or None.

    A single row is enough at the end of a text. Two rows belong to different tables if a cell is a number in
    one row and a word in the other row.
    """
    if delimiter != " " and not any(delimiter in line for line in lines):
        return None
    rows: list[int] = []
    words: list[bool | None] = []  # For each cell of the first row: True if it is a word.
    for k, line in enumerate(lines):
        if not line.strip() and wanted == SETTINGS.table_rows_min:
            continue
        fields = split_line(line, delimiter)
        numbers = count_numbers(fields) if len(fields) > 1 else 0
        is_property = 2 <= numbers < len(fields) and bool(property_of(fields[0]))
        is_prose = delimiter == " " and 2 * numbers <= len(fields)
        if numbers < 2 or is_prose or _COMMENT.match(line) or is_property or _is_of_units(fields, numbers):
            rows = []
            continue
        kinds = [_is_word(cell) for cell in fields]
        if rows and any({*pair} == {True, False} for pair in zip(words, kinds, strict=False)):
            rows = []
        words = kinds if not rows else words
        rows.append(k)
        if len(rows) == wanted:
            return rows[0]
    return rows[0] if wanted != SETTINGS.table_rows_min and rows == [len(lines) - 1] else None


def _is_word(cell: str) -> bool | None:
    """Return True for a word, False for a number, None for an empty cell or a mark of a missing value."""
    if is_missing(cell):
        return None
    return False if is_number(cell) else cell[:1].isalpha() or None


def read_header(lines: Sequence[str], first: int, delimiter: str) -> Header:
    """Return the header above the row with index ``first``: the names of the columns, and the other lines.

    Columns in per cent, V or mA whose span has two stated ends get the unit of the span. Any other unit next
    to a name is the unit of the range if all channels are in per cent.
    """
    header = _read_header(lines, first, delimiter)
    in_per_cent = any(map(are_all_per_cent, header.said))
    names, spans = [*header.names], {**header.spans}
    for k, name in enumerate(names):
        base = names[k] = (span_in(name) or (name,))[0]
        word = re.sub(r"\s*[\[(][^\])]*[\])]$", "", base)
        own = base[len(word) :].strip(" []()")
        said = [line for line in header.said if re.search(rf"(?<!\w){re.escape(word)}(?!\w)", line)]
        found = {span[1:] for line in (name, *said) if word and (span := span_in(line)) is not None}
        factor, offset, raw, unit = found.pop() if len(found) == 1 else (1.0, 0.0, "", "")
        is_raw = own == raw or (raw == "%" and (is_per_cent(own) or (in_per_cent and not own)))
        if is_raw and roles_of_unit(unit):
            names[k] = f"{word} [{unit}]"
            spans[names[k]] = factor, offset
            continue
        word, own = word_and_unit(base)
        roles = [role for role in QUANTITIES if role in roles_of_unit(own) or speaks_of(word, role)]
        if in_per_cent and ({*roles} - {"time"} or any(map(ranges_in, said))):
            names[k] = f"{word} [%]"
    scales = {} if in_per_cent else header.scales
    return replace(header, names=tuple(names), scales=scales, spans=spans)


def _read_header(lines: Sequence[str], first: int, delimiter: str) -> Header:
    """Return the header above a row: names and units directly above it, or a list of the channels."""
    cells = split_line(lines[first], delimiter)
    bare = [_COMMENT.sub("", line) for line in lines[:first]]
    table = [_cells_above(line, delimiter, len(cells)) for line in bare]
    header = _header_of_rows(lines, first, delimiter)
    stated = find_properties(table, bare, cells)
    # The rows above complete names state conditions, such as "Current;0.5;A", even if each column has a row.
    units = [(name, word_and_unit(name)[1]) for name in header.names]
    roles = {role for name, unit in units for role in roles_of_unit(unit) if speaks_of(name, role)}
    are_units = all(unit or is_any_unit(unit_in_brackets(name)) for name, unit in units)
    is_complete = are_units and roles >= {"displacement", "force"}
    if stated is None or (is_complete and not (stated.scales or stated.spans)):
        return header
    return replace(stated, said=statements(lines[:first], delimiter))


def _header_of_rows(lines: Sequence[str], first: int, delimiter: str) -> Header:
    """Return the header from the rows of names and units directly above a row.

    Units in a row below (or above) the names are added to the names: ``name [unit]``. A row above the names
    may state a command, such as the current of several columns. The command is added in front of the names
    of these columns: ``0.5 A: name [unit]``. A command applies up to the column of the next command.
    """
    cells = split_line(lines[first], delimiter)
    named = split_line(lines[first - 1], delimiter) if first else []
    if len(named) == len(cells) + 1 and _SPARSE.fullmatch(named[-1]):
        cells = [*cells, ""]  # The first row has no cell in the column of events.
    count = len(cells)
    filled = max((k + 1 for k, cell in enumerate(cells) if cell), default=count)
    rows: list[tuple[int, list[str]]] = []
    for k in range(first - 1, -1, -1):
        line = [cell for cell in split_line(lines[k], delimiter) if cell]
        # An entry is a cell such as "dt = 3 ms".
        is_entries = not rows and bool(line) and all("=" in cell for cell in line)
        fields = None if is_entries else _header_fields(lines[k], delimiter, count, filled)
        if fields:
            rows.append((k, fields))
        elif rows or (line and not (is_entries or is_comment(lines[k]) or _MARK.fullmatch(lines[k]))):
            break
    if not rows:
        plain = tuple(f"column {k + 1}" for k in range(count))
        return Header(plain, statements(lines[:first], delimiter), named=False)
    # Labels are removed from rows such as "Names: Time;Force" and "Units: s;N".
    leads = [[k for k, text in enumerate(fields) if _LEAD.match(text)] for _, fields in rows]
    if leads.count([0]) > 1:
        rows = [(k, [_LEAD.sub("", fields[0]), *fields[1:]]) for k, fields in rows]
    used = {rows[0][0]}
    _, names = rows.pop(0)
    units: list[str] | None = None
    for turned in (False, True):  # False: units below the names. True: units above the names.
        if rows and units is None:
            words = [text.strip("[]()") for text in (rows[0][1] if turned else names)]
            known = [text for text in words if not count_numbers([text])]
            if _are_units(known) and not (turned and _are_units([text.strip("[]()") for text in names])):
                units = words
                above, other = rows.pop(0)
                used.add(above)
                names = names if turned else other
    # Names such as "ms, mm, N, mA" are only units.
    roles = [role for name in names for role in roles_of_unit(name)]
    if units is None and "displacement" in roles and roles.count("force") == 1:
        units = [name.strip("[]()") if roles_of_unit(name) else "" for name in names]
        names = [f"column {k + 1}" if unit else names[k] for k, unit in enumerate(units)]
    settings: list[str] = []
    if units is not None:
        both = list(zip(names, units, strict=True))
        # Oscilloscopes write the time step in the row of units.
        settings = [f"{name}: {unit} s" for name, unit in both if count_numbers([unit])]
        names = [f"{name} [{unit}]" if unit and not count_numbers([unit]) else name for name, unit in both]
    while rows and (conditions := _conditions(rows[0][1])):
        used.add(rows.pop(0)[0])
        now = ""
        for k, cell in enumerate(conditions):
            now = cell or now
            names[k] = f"{now}: {names[k]}" if now else names[k]
    others = [lines[k] for k in range(first) if k not in used]
    return Header(tuple(names), (*statements(others, delimiter), *settings))


def _conditions(cells: Sequence[str]) -> list[str]:
    """Return the conditions of the runs in a row above the names, empty for any other row.

    The cells state current or temperature with its unit, or a label states them in front of the numbers.
    """
    if not any(labels_in(cells[0], role) for role in CONDITIONS):
        label, unit = word_and_unit(cells[0])
        cells = ["", *(f"{label}: {cell} {unit}" if is_number(cell) else cell for cell in cells[1:])]
    filled = [cell for cell in cells if cell]
    are_conditions = any(all(labels_in(cell, role) for cell in filled) for role in CONDITIONS)
    return [*cells] if len(filled) > 1 and are_conditions else []


def _cells_above(line: str, delimiter: str, count: int) -> list[str]:
    """Return the cells of a line above a table, without empty cells at the end."""
    cells = _PAIR.split(line.strip(), maxsplit=1) if count == 1 else split_line(line, delimiter)
    return cells[: max((k + 1 for k, cell in enumerate(cells) if cell), default=0)]


def _header_fields(line: str, delimiter: str, count: int, filled: int) -> list[str] | None:
    """Return the fields of a line if there is a field for each column, else None."""
    bare = _COMMENT.sub("", line)
    fields = split_line(bare, delimiter)
    if is_comment(line) and len(fields) != count > 1:  # A list of names: "columns: time [s], force [N]".
        lists = (split_line(_LEAD.sub("", bare), sign) for sign in DELIMITERS[:-1])
        fields = next((names for names in lists if len(names) == count and all(names)), fields)
    for text in (bare, _LEAD.sub("", bare)) if delimiter == " " else ():
        if len(fields) != count:
            fields = re.split(r"\s{2,}|\t", text.strip())
        if len(fields) != count:  # A blank before a unit is no delimiter: "Time (s) Force (N)".
            fields = re.findall(r"[^\s(\[]+\s*[(\[][^)\]]*[)\]]|\S+", text)
    if len(fields) not in {count, filled} or not any(fields):
        return None
    return fields + [""] * (count - len(fields))


def statements(lines: Sequence[str], delimiter: str) -> tuple[str, ...]:
    """Return the lines above a table that are not empty, with cells separated by blanks."""
    cells = [split_line(_COMMENT.sub("", line), delimiter) for line in lines]
    joined = [line_of(fields) for fields in cells]
    said = [with_unit(line[: SETTINGS.note_length_max]) for line in joined if line]
    return (*said, *_results(cells))[-SETTINGS.note_lines_max :]


def line_of(row: Sequence[str]) -> str:
    """Return the cells of a row as a line. A name, a unit and a number are written as ``name: 0.5 A``.

    The unit may be a cell, or the end of the name: ``Current, A;0.5``.
    """
    cells = [cell.strip() for cell in row if cell.strip()]
    numbers = [cell for cell in cells if is_number(cell)]
    words = [cell for cell in cells if cell not in numbers]
    units = [cell for cell in words if roles_of_unit(cell)]
    name = unit = ""
    if len(numbers) == len(units) == 1 and len(words) == 2:
        name, unit = words[words[0] == units[0]], units[0].strip("[]()")
        unit = unit if word_and_unit(f"{name}_{unit}")[1] else ""  # The A in "Damper;A;3" is no unit.
    elif len(numbers) == len(words) == 1 and cells[1] in numbers and "," in cells[0]:
        name, unit = word_and_unit(cells[0])
    return f"{name}: {numbers[0]} {unit}" if name and unit else " ".join(cells)


def _results(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines such as ``Coil current: 0.5 A`` from a table of three rows: names, units and values."""
    found = []
    for names, units, values, below in zip(rows, rows[1:], rows[2:], [*rows[3:], []], strict=False):
        words = [text.strip("[]()") for text in units]
        alone = not count_numbers(names) and count_numbers(below) < 2
        if len(names) == len(words) == len(values) > 1 and alone and _are_units(words):
            each = zip(names, values, words, strict=True)
            found += [f"{name}: {value} {unit}" for name, value, unit in each if name and unit]
    return found


def with_unit(line: str) -> str:
    """Rewrite an entry such as ``Current_A=0.5`` as ``Current_A: 0.5 A``. Other lines are unchanged."""
    found = _SETTING.fullmatch(line)
    number = number_in(found[2], "," if "," in found[2] else ".") if found else None
    return attribute_lines({found[1]: f"{number:.9g}"})[0] if found and number is not None else line


def _are_units(words: Sequence[str]) -> bool:
    """Return True if a row has at least two units, and units in at least half of its cells."""
    filled = [word for word in words if word and word != "-"]
    known = sum(is_any_unit(word) for word in filled)
    return known >= min(2, len(filled)) and 2 * known >= len(filled) > 0


def _is_of_units(fields: Sequence[str], numbers: int) -> bool:
    """Return True if a row has units before numbers, such as ``Sequence,mm,N,0.0,0.5``."""
    words = [text for text in fields if text and not count_numbers([text])] if numbers < len(fields) else []
    return len(words) > 1 and fields[0] == words[0] and _are_units(words)


def is_comment(line: str) -> bool:
    """Return True if a line begins with a comment sign."""
    # "#NV" is a missing value.
    return _COMMENT.match(line) is not None and not line.lstrip().startswith("#N")


def count_numbers(fields: Sequence[str]) -> int:
    """Return the number of numeric fields. A time of day in the first field or after a date also counts."""
    is_dated = len(fields) > 1 and not math.isnan(days_of(fields[0])[0]) and is_time(fields[1])
    return (is_dated or is_time(fields[0] if fields else "")) + sum(map(is_number, fields))


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the fields of a line."""
    if delimiter == " ":
        parts = line.split()
    elif '"' in line:
        parts = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        parts = line.split(delimiter)
    return [part.strip().strip('"').strip() for part in parts]


def find_decimal(place: str, rows: Sequence[str], delimiter: str) -> str:
    """Return the decimal sign of the rows, "" if no number has decimals.

    If a cell has both signs, as in 1,234.5, the last sign is the decimal sign. Two equal signs in a cell
    separate thousands. Raise InputError if the rows contradict each other.
    """
    fields = [text for line in rows for text in split_line(line, delimiter) if is_number(text)]
    found: set[str] = set()
    for text in fields:
        signs = re.sub("[^.,]", "", text)
        # Equal signs are separators of thousands.
        found.add(signs[-1:] if len({*signs}) != 1 or len(signs) == 1 else ".,".replace(signs[0], ""))
    found.discard("")
    if len(found) > 1:
        examples = " and ".join(repr(next(text for text in fields if sign in text)) for sign in ".,")
        raise InputError(
            place=place,
            found=f"numbers have decimal points and decimal commas ({examples})",
            expected="one of them",
            remedy="Export the numbers without separators of thousands",
        )
    return found.pop() if found else ""


def refuse_two_commas(place: str, lines: Sequence[str], first: int, delimiter: str) -> None:
    """Raise InputError if a comma may be a delimiter or a decimal sign: 0,5,1,25 is two numbers or four.

    A cell "1,234" in quotation marks is 1.234 or 1234 unless a different cell shows the meaning of the comma.
    """
    if delimiter != ",":
        return
    quoted = [
        cell for line in lines[first:] for cell in split_line(line, ",") if "," in cell and is_number(cell)
    ]
    if quoted and all(_THOUSANDS.fullmatch(cell) for cell in quoted):
        found = f"commas separate columns and perhaps thousands ({quoted[0]!r})"
        remedy = "Export the numbers without separators of thousands"
        raise InputError(place=place, found=found, expected="numbers as 1234.5", remedy=remedy)
    fields = split_line(lines[first], delimiter)
    above = next((line for line in reversed(lines[:first]) if line.strip()), "")
    names = split_line(_COMMENT.sub("", above), delimiter)
    if len(names) < 2 or count_numbers(names) or len(fields) <= len(names):
        return
    if all(_WHOLE.fullmatch(text) for text in fields):
        line = f"{len(names)} names and {len(fields)} fields in line {first + 1}: commas may be decimals"
        remedy = "Export with semicolons, or with decimal points"
        raise InputError(place=place, found=line, remedy=remedy)
