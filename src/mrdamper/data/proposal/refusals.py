"""Errors for a table in which a role has no column, unit or scale. Each error contains a question."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import COMMANDS
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import SKIPPED, Table
from mrdamper.data.proposal.column import Header, header_of, meant_without_unit
from mrdamper.data.proposal.questions import Topic, ask
from mrdamper.data.words.headers import (
    begins_with_symbol,
    candidates,
    has_word,
    is_command_share,
    parse_header,
    says_command,
    speaks_of,
    word_and_unit,
)
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, roles_of_unit


def no_column(role: str, table: Table, place: str) -> InputError:
    """Return the error that requests the column of a role."""
    require_no_text(role, table, place)
    names = candidates(role, [*table.columns])
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


def no_command(
    table: Table, place: str, found: str = "no current or voltage", values: Sequence[str] = ()
) -> InputError:
    """Return the error that requests the command."""
    for role in COMMANDS:
        require_no_text(role, table, place)
    volts = [name for name in table.columns if "voltage" in roles_of_unit(word_and_unit(name)[1])]
    # If two columns have the same word, such as "force", the column in volts is a sensor output.
    often = Counter(word_and_unit(name)[0] for name in table.columns)
    volts = [name for name in volts if parse_header(name) is None and often[word_and_unit(name)[0]] == 1]
    monitors = [
        name
        for name in volts
        if has_word(name, "sensor output") or speaks_of(word_and_unit(name)[0], "current")
    ]
    if monitors and not values:
        return no_scale("current", monitors, place)
    shares = command_shares(table)
    if shares and not volts and not values:
        found = f"{' and '.join(map(repr, shares))} is a command in per cent of an unknown current"
        return ask("current", "scale", place, f"{found} (answer such as 2 A/100%)", shares)
    headers = [header_of(table, name) for name in table.columns if name not in table.stamps]
    unclear = [] if values else [each.name for each in headers if _may_be_command(each)]
    bare = None if volts or len(unclear) > 1 else meant_without_unit("current", headers)
    listed_columns = f"; {' or '.join(map(repr, unclear))} may hold it" if unclear else ""
    columns = [*volts, *(name for name in unclear if name not in volts)]
    topic: Topic = (
        "unit" if bare is not None and not values else "column" if columns and not values else "value"
    )
    choices = values or (QUANTITIES["current"].units if bare is not None else columns)
    return ask("current", topic, place, found + listed_columns, choices)


def varying_commands(table: Table) -> list[str]:
    """Return the columns that may be a current, by name or unit, and change."""
    headers = [header_of(table, name) for name in table.columns if name not in table.stamps]
    return [
        each.name
        for each in headers
        if "current" in each.of_unit or (_may_be_command(each) and _names_current(each))
        if _level_changes(table.columns[each.name])
    ]


def _may_be_command(header: Header) -> bool:
    """Return True if a column has no unit, and the name of a current, a voltage or a set point."""
    if header.unit or header.of_word not in {"", *COMMANDS}:
        return False
    if any(speaks_of(header.word, role) for role in QUANTITIES if role not in COMMANDS):
        return False
    named = _names_current(header) or speaks_of(header.word, "voltage")
    return named or says_command(header.word) or has_word(header.word, "set point")


def _names_current(header: Header) -> bool:
    return speaks_of(header.word, "current") or begins_with_symbol(header.word, "current")


def _level_changes(values: FloatArray) -> bool:
    """Return True if the medians of parts of a column differ by more than 20 % of its largest value."""
    parts = np.array_split(values[np.isfinite(values)], SETTINGS.level_part_count)
    levels = [float(np.median(part)) for part in parts if len(part)]
    return bool(levels) and np.ptp(levels) > 0.2 * float(np.nanmax(np.abs(values)))


def command_shares(table: Table) -> list[str]:
    """Return the columns with a command in per cent."""
    return [name for name in table.columns if is_command_share(name, table.units.get(name, ""))]


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
