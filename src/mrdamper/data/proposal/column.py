"""Header of a table column, the column chosen for a role, and questions about a missing column or unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

from mrdamper.data.channels import Channel, ChannelMap
from mrdamper.data.formats.lines.cells import is_number
from mrdamper.data.formats.table import SKIPPED, Table, distinct_names
from mrdamper.data.formats.timestamps import date_in
from mrdamper.data.proposal.questions import Topic, ask
from mrdamper.data.words.headers import (
    begins_with_symbol,
    has_word,
    is_per_cent,
    legend_in,
    means,
    parse_header,
    raw_signal,
    speaks_of,
    weight_unit,
    word_and_unit,
)
from mrdamper.data.words.labels import ranges_in, rates_in, scales_in
from mrdamper.data.words.signs import signs_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, is_unit, roles_of_unit, spell_unit, to_si


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a file for a role: name, unit as spelled in file or map, and reason for the choice."""

    role: str
    name: str
    unit: str
    source: str = "header"  # Reason for the choice, such as "map", "header" or "unit alone".
    gain: float | None = None  # Factor from the file's unit to SI, if the file states a scale.

    def channel(self, chosen: ChannelMap) -> Channel:
        """Return the conversion of the column to SI: from the map, else from the scale in the file."""
        given = chosen.channel(self.role)
        if self.gain is None or given.gain is not None:
            return given
        return replace(given, name=self.name, unit=self.unit, gain=self.gain)


@dataclass(frozen=True, slots=True)
class Header:
    """Word and unit of a column's header. ``of_unit`` are the roles with this unit."""

    name: str
    word: str
    unit: str
    of_unit: tuple[str, ...]
    of_word: str  # Role that the word names exactly, "" if the word is not the name of a role.


def header_of(table: Table, name: str) -> Header:
    """Return the parsed header of a column. A missing unit is replaced by the unit stated in the file.

    Text in brackets that is not a unit, as in ``Force (Trigger)``, is ignored.
    """
    exact = parse_header(name)
    word, unit = word_and_unit(name)
    if exact is not None and unit and exact[1] != unit:  # "Travel_WA100 [mm]": WA100 is no unit.
        exact = (exact[0], unit) if exact[0] in roles_of_unit(unit) else None
    stated = weight_unit(word, table.units.get(name, ""))
    if exact is not None:
        unit = exact[1] if is_unit(exact[1]) or not is_unit(stated) else stated
    unit = unit or (stated if roles_of_unit(stated) else "")
    named = exact or parse_header(word)
    return Header(name, word, unit, roles_of_unit(unit), named[0] if named is not None else "")


def other_unit(table: Table, column: Column) -> str:
    """Return the unit that the file or a document states next to the unit of a column, "" if equal."""
    stated = table.other_units.get(column.name) or table.units.get(column.name, "")
    if not (is_unit(stated) and is_unit(column.unit)):
        return ""
    units = [spell_unit(unit, column.role) for unit in (stated, column.unit)]
    return stated if units[0] != units[1] else ""


def headers_of(table: Table) -> list[Header]:
    """Return the headers of columns that may be samples.

    Times of day and results of models are omitted, and also statistics if a role has several of them.
    """
    names = [name for name in table.columns if not (name in table.stamps or has_word(name, "model"))]
    headers = [header_of(table, name) for name in names]
    results = [each for each in headers if has_word(each.word, "statistic")]
    roles = [(*each.of_unit, each.of_word) for each in results]
    return [each for each in headers if each not in results or roles.count((*each.of_unit, each.of_word)) < 2]


def explained(table: Table, notes: Sequence[str], chosen: ChannelMap, file: str) -> Table:
    """Add names, units, scales and sampling rate from the lines ``notes`` of documents to a table of a file.

    Only missing names and units are added. Numbered entries or a list in a line name the columns if there
    is an entry for each. A line that begins with the name of a column explains it. Names are not replaced if
    the channel map has names. A rate or a unit that contradicts the file is added and leads to a question.
    """
    is_mapped = any(channel.name or channel.pattern for channel in chosen.channels.values())
    legend = [entry for line in notes for entry in legend_in(line)]
    bare = {number: word for number, word, unit in legend if number and not unit}
    legend = [entry for entry in legend if entry[2]]
    numbered = {(number, f"{word} [{unit}]") for number, word, unit in legend if number is not None}
    roles = {role for number, _, unit in legend if number is not None for role in roles_of_unit(unit)}
    legend += [entry for line in table.said for entry in legend_in(line) if entry[2]]
    unnamed = [name for name in table.names if name not in table.columns or len(table.columns[name]) > 1]
    count = len(unnamed)
    lists = {names for names in _lists_in(notes, file) if len(names) == count}
    # Further entries of a list of columns may have no unit.
    others = {*range(1, count + 1)} & bare.keys() - {number for number, _ in numbered}
    others = others if roles >= {"displacement", "force"} else set()
    for entries in (sorted(numbered), sorted(numbered | {(number, bare[number]) for number in others})):
        if [number for number, _ in entries] in ([*range(count)], [*range(1, count + 1)]):
            lists.add(tuple(name for _, name in entries))
    is_named = len(lists) == 1 and not is_mapped and all(name.startswith("column ") for name in unnamed)
    table = renamed(table, dict(zip(unnamed, lists.pop(), strict=True))) if is_named else table
    remarks: tuple[str, ...] = (f"columns from a document: {', '.join(table.names)}",) if is_named else ()
    units, other_units, meant = dict[str, str](), dict[str, str](), dict[str, str]()
    headers = [header_of(table, name) for name in table.columns]
    # A table of results in a document may have other units than the samples.
    sentences = (line for line in notes if not re.search(r"[\t;]", line))
    in_sentences = [each for line in sentences if re.search(r"[:=]|\bin\b", line) for each in legend_in(line)]
    for header in headers:
        meanings = _meanings(header.name, [*table.said, *notes])
        own = [unit for _, word, unit in legend if _means_same(word, header)] + [each[1] for each in meanings]
        if not header.unit and len({*own}) == 1 and header.of_word in {"", *roles_of_unit(own[0])}:
            units[header.name] = own[0]
            if len(meanings) == 1 and not is_mapped:
                meant[header.name] = f"{meanings[0][0]} [{own[0]}]"
        stated = [unit for _, word, unit in in_sentences if _means_same(word, header)]
        for role in header.of_unit if header.unit and header.of_word in {"", *header.of_unit} else ():
            same = {unit: to_si(1.0, unit, role) for unit in stated if role in roles_of_unit(unit)}
            if same and to_si(1.0, header.unit, role) not in same.values():
                other_units[header.name] = next(iter(same))
    is_raw = any("voltage" in roles_of_unit(units.get(each.name, each.unit)) for each in headers)
    in_per_cent = any(is_per_cent(units.get(each.name, each.name)) for each in headers)
    own_rates = [*rates_in(table.said)] + ([1.0 / table.step_s] if table.step_s else [])
    rates = [line for line in notes if rates_in([line])]
    # The sampling rate of the file and the rate in a document agree within 1 %.
    if any(abs(rate / own - 1.0) < 0.01 for rate in rates_in(rates) for own in own_rates):
        rates = []
    dates = [line for line in notes if date_in([line])]
    scales = [line for line in notes if (is_raw and scales_in(line)) or (in_per_cent and ranges_in(line))]
    said = [*table.said, *rates, *scales]
    said += [] if signs_in(table.said) else [line for line in notes if signs_in([line])]
    said += dates if date_in(dates) and not date_in(table.said) else []
    remarks += (f"units from words: {', '.join(units)}",) if units else ()
    if rates and not own_rates and not any(each.of_word == "time" for each in headers):
        remarks += (f"sampling rate from a document: {rates[0].strip()!r}",)
    said += [f"sampling rate: {1.0 / table.step_s:.9g} Hz"] if rates and table.step_s else []
    layout = replace(table.layout, notes=(*table.layout.notes, *remarks))
    table = replace(table, layout=layout, said=tuple(said), step_s=None if rates else table.step_s)
    return renamed(replace(table, units={**table.units, **units}, other_units=other_units), meant)


def renamed(table: Table, names: Mapping[str, str]) -> Table:
    """Return a table with other names of some columns. Repeated names are numbered."""
    order = distinct_names([names.get(name, name) for name in table.names])
    new = dict(zip(table.names, order, strict=True))
    fields: dict[str, Any] = {
        part: {new.get(name, name): value for name, value in getattr(table, part).items()}
        for part in ("columns", "texts", "units", "other_units", "clocks", "stamps", "scales")
    }
    return replace(table, names=tuple(order), **fields)


def _lists_in(notes: Sequence[str], file: str) -> list[tuple[str, ...]]:
    """Return the columns in lines such as ``time (s), force (N)``, except lines on results or other files.

    The line may state the order: ``M = [t F x], t in s, x in mm, F in N``.
    """
    found = []
    for line in notes:
        files = re.findall(r"[\w*?#.-]+\.[A-Za-z]\w{0,4}\b", line)
        order = re.search(r"=\s*\[([^\W\d][^\]=]*)\]", line)
        rest = line.replace(order[0], "; ") if order else line
        entries = [entry for entry in legend_in(rest, words_max=9) if entry[0] is None]
        roles = {role for _, _, unit in entries for role in roles_of_unit(unit)}
        is_other = bool(files) and not any(fnmatchcase(file, name) for name in files)
        if not is_other and {"displacement", "force"} <= roles and not has_word(line, "statistic"):
            names = [(word, f"{word} [{unit}]") for _, word, unit in entries]
            words = order[1].replace(",", " ").replace(";", " ").split() if order else []
            found.append(
                tuple(dict(names).get(word, word) for word in words) or tuple(name for _, name in names)
            )
    return found


def _meanings(name: str, notes: Sequence[str]) -> list[tuple[str, str]]:
    """Return the different (words, unit) in lines such as ``s  stroke of the rod, mm`` on column ``s``.

    The line may be the row of a codebook: ``3,s,mm,"stroke, rod out positive"``. The words must name a
    quantity of the unit.
    """
    form = re.compile(
        rf"\W*(?:\d{{1,2}}\W+)?{re.escape(name)}[`'\"*]*"
        r"(?:\s*(?:[:=]|->?|\u2013)\s+|\s*[|,;\t]|\s{2,}|(?<=\w \d)\s)(.*)"
    )
    # A line may explain several numbered columns: "Channel 1 stroke (mm)  Channel 2 load (N)".
    if numbered := re.fullmatch(r"(.*\w )\d", name):
        notes = [part for line in notes for part in re.split(rf"(?=\b{re.escape(numbered[1])}\d)", line)]
    found: dict[tuple[str, str], None] = {}
    for match in filter(None, map(form.fullmatch, notes)):
        if signal := raw_signal(match[1]):
            found[signal] = None
            continue
        cells = [*filter(None, re.split(r"\s*[][,;|()\t\"]\s*|\s+in\s+|\s{2,}", match[1].strip()))]
        units = [cell for cell in cells if roles_of_unit(cell)]
        texts = [cell for cell in cells if cell not in units and not is_number(cell)]
        is_meant = any(speaks_of(" ".join(texts), role) for unit in units for role in roles_of_unit(unit))
        if len(units) == 1 and is_meant and not any(text[0].isdigit() for text in texts):
            found[" ".join(texts), units[0]] = None
    return [*found]


def _means_same(word: str, header: Header) -> bool:
    """Return True if a word is the name of a column, or a name of the column's role, perhaps in plural."""
    same = re.sub(r"[\W_]+", "", word).lower() == re.sub(r"[\W_]+", "", header.word).lower()
    return same or (bool(header.of_word) and word.lower().rstrip("s") in QUANTITIES[header.of_word].headers)


def meant_without_unit(role: str, headers: Sequence[Header]) -> Header | None:
    """Return the only header without unit that may mean a role; measured columns precede set points."""
    bare = [each for each in headers if not each.unit and each.of_word in {"", role}]
    found = [each for each in bare if begins_with_symbol(each.word, role) or speaks_of(each.word, role)]
    found = [each for each in found if not has_word(each.word, "set point")] or found
    return found[0] if len(found) == 1 else None


def no_column(role: str, table: Table, place: str) -> InputError:
    """Return the error that requests the column of a role."""
    require_no_text(role, table, place)
    names = [name for name in table.columns if means(name, role)]
    bare = meant_without_unit(role, [header_of(table, name) for name in table.columns])
    scale = [name for name in table.columns if "voltage" in roles_of_unit(word_and_unit(name)[1])]
    skipped = "".join(f"; {note}" for note in table.layout.notes if note.startswith(SKIPPED))
    topic: Topic = "unit" if bare is not None else "scale" if not names and scale else "column"
    found = f"no {role} column; the columns are: {column_list(table.names)}{skipped}"
    choices = QUANTITIES[role].units if bare is not None else names or scale or list(table.columns)
    return ask(role, topic, place, found, choices)


def no_unit(role: str, place: str, name: str, found: str = "") -> InputError:
    """Return the error that requests the unit of a column. ``found`` is the fault, "": no unit."""
    return ask(role, "unit", place, found or f"{role} has no unit (column {name!r})", QUANTITIES[role].units)


def no_scale(role: str, names: Sequence[str], place: str, stated: Sequence[str] = ()) -> InputError:
    """Return the error that requests the scale of a sensor per volt. ``stated`` are the stated scales."""
    columns = ", ".join(map(repr, names))
    state = f"is stated several times: {', '.join(map(repr, stated))}" if len(stated) > 1 else "is missing"
    found = f"{role} is in volts ({columns}) and the scale in {QUANTITIES[role].unit} per volt {state}"
    return ask(role, "scale", place, found, names)


def require_no_text(role: str, table: Table, place: str) -> None:
    """Raise InputError if the column that the header assigns to a role contains text instead of numbers."""
    for name, cells in table.texts.items():
        header = parse_header(name)
        if header is not None and header[0] == role:
            cell = next((cell for cell in cells if cell), "")
            found = f"column {name!r} ({role}) holds text, such as {cell[:40]!r}"
            expected = "numbers, without units or separators of thousands in the cells"
            raise InputError(place=place, found=found, expected=expected, remedy="Export the file again")


def column_list(names: Sequence[str]) -> str:
    """Return the names of up to 24 columns as one line."""
    more = f" and {len(names) - 24} more" if len(names) > 24 else ""
    return ", ".join(names[:24]) + more
