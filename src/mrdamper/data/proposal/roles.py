"""Assignment of roles to table columns by units and words; unclear roles result in a question.

If only one column has a unit of a role, it has this role, unless its header names a different role. Among
several columns, a measured column has priority over its set point, and a column named after the role has
priority over the remaining columns. A time column must increase. A column in volts is a command only if the
header names a command, because the column may be the output of a sensor. A scale in the header (``500 N/V``)
converts a sensor output to its quantity.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from mrdamper.data.channels import Channel, ChannelMap
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal import clocks
from mrdamper.data.proposal.column import (
    Column,
    Header,
    column_list,
    header_of,
    headers_of,
    meant_without_unit,
    no_column,
    no_scale,
    no_unit,
    other_unit,
)
from mrdamper.data.proposal.commands import command_shares
from mrdamper.data.proposal.questions import ask, ask_all
from mrdamper.data.words.headers import (
    has_word,
    is_per_cent,
    names_by_symbol,
    says_command,
    speaks_of,
    unit_in_brackets,
)
from mrdamper.data.words.labels import ranges_in, scales_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, roles_of_unit, to_si

_NEEDED = ("displacement", "force")


def find_columns(table: Table, chosen: ChannelMap, place: str) -> tuple[Column, ...]:
    """Return the column of each role. The channel map has priority over the headers.

    Raise AskingError if a required role has no column, several columns, or no column with a unit.
    """
    headers = headers_of(table)
    columns: list[Column] = []
    faults: list[InputError] = []
    for role in (*(role for role in QUANTITIES if role != "time"), "time"):
        channel = chosen.channel(role)
        own_time = clocks.fastest_time(table, [column.name for column in columns]) if role == "time" else None
        try:
            if own_time is not None and channel.find(table.names, place) is None:
                unit = channel.unit or header_of(table, own_time).unit
                if not unit:
                    raise no_unit("time", place, own_time)
                columns.append(Column("time", own_time, unit, "clock"))
                continue
            column = column_of(role, table, headers, chosen, place)
            if column is None:
                if role in _NEEDED:
                    raise no_column(role, table, place)
                continue
            if column.source != "map":
                # A reader appends a number to a repeated name: ``force (4)``.
                again = re.compile(rf"{re.escape(column.name)} \(\d+\)")
                names = [column.name, *filter(again.fullmatch, table.columns)]
                column = _select_one(role, [replace(column, name=name) for name in names], place)
            if column.name in table.scales and channel.gain is None:
                raise _unclear_factor(column, table.scales[column.name], place)
            if not channel.unit and (other := other_unit(table, column)):
                found = f"column {column.name!r} is in {column.unit}, but a document states {other}"
                raise no_unit(role, place, column.name, found)
            columns.append(column)
        except InputError as fault:
            faults.append(fault)
    if faults:
        raise ask_all(faults)
    return tuple(sorted(columns, key=lambda column: [*QUANTITIES].index(column.role)))


def _unclear_factor(column: Column, factor: float, place: str) -> InputError:
    """Return the error for a column that may or may not include a stated factor."""
    unit = column.unit or QUANTITIES[column.role].unit
    applied, raw = f"1 {unit}", f"{factor:g} {unit}"
    found = (
        f"the factor {factor:g} of {column.name!r} above the table may have been applied to the column: "
        f"answer {column.role}.scale={applied} if it was, {column.role}.scale={raw} if not"
    )
    return ask(column.role, "scale", place, found, (applied, raw))


def column_of(
    role: str, table: Table, headers: Sequence[Header], chosen: ChannelMap, place: str
) -> Column | None:
    """Return the column of a role, None if it is missing."""
    channel = chosen.channel(role)
    position = channel.find(table.names, place)
    if position is not None:
        return _column_of_map(table, channel, table.names[position], place)
    if role == "time" and chosen.rate_Hz is None and table.step_s is None:
        # If the first and the last time stamp are equal, the column repeats the start time of the record.
        stamps = [name for name in table.stamps if table.columns[name][0] != table.columns[name][-1]]
        stamps = [name for name in stamps if not clocks.is_coarse_clock(table, name, chosen, place)]
        named = [each for each in headers if each.of_word == "time" and "time" in each.of_unit]
        if stamps and not named:
            return _select_one("time", [Column("time", name, "s", "times of day") for name in stamps], place)
    of_unit = [each for each in headers if role in each.of_unit and each.of_word in {"", role}]
    if role == "voltage":
        of_unit = [each for each in of_unit if each.of_word or says_command(each.word)]
    if of_unit:
        best = _best(role, of_unit, table)
        source = "header" if best[0].of_word == role else "unit alone"
        column = _select_one(role, [Column(role, each.name, each.unit, source) for each in best], place)
        expected = clocks.unit_by_rate(column.name, table) if role == "time" and table.said else ""
        if expected and to_si(1.0, expected, role) != to_si(1.0, column.unit, role):
            found = f"column {column.name!r} is in {column.unit}, but the sampling rate above it contradicts"
            raise no_unit(role, place, column.name, found)
        return Column(role, column.name, channel.unit or column.unit, column.source)
    return _column_without_unit(role, table, headers, chosen, place)


def _column_of_map(table: Table, channel: Channel, name: str, place: str) -> Column:
    role, is_moment = channel.role, name in table.stamps
    if name in table.texts or (is_moment and role != "time"):
        found = f"channel.{role}: column {name!r} holds {'times' if is_moment else 'text'}"
        raise InputError(place=place, found=found, expected="numbers")
    stated = "s" if is_moment else header_of(table, name).unit or table.units.get(name, "")
    unit = channel.unit or stated or unit_in_brackets(name)
    if not unit and role != "time":
        raise no_unit(role, place, name)
    return Column(role, name, unit, "map")


def _best(role: str, found: Sequence[Header], table: Table) -> Sequence[Header]:
    """Return the columns that match a role best. Several columns lead to a question."""
    left, is_time, is_warm = list(found), role == "time", role == "temperature"
    preferences: tuple[Callable[[Header], bool], ...] = (
        lambda each: is_time and clocks.increases(table, each.name, always=True),
        lambda each: is_warm and not has_word(each.word, "ambient"),
        lambda each: is_warm and has_word(each.word, "fluid"),
        lambda each: is_warm and has_word(each.word, "damper"),
        lambda each: not has_word(each.word, "set point"),
        lambda each: each.of_word == role,
        lambda each: each.of_word == role and not names_by_symbol(each.name),
        lambda each: speaks_of(each.word, role),
        lambda each: role in clocks.MEASURED and not has_word(each.word, "filtered"),
        lambda each: is_time and clocks.increases(table, each.name),
    )
    for is_better in preferences:
        left = [each for each in left if is_better(each)] or left
    return left


def _column_without_unit(
    role: str, table: Table, headers: Sequence[Header], chosen: ChannelMap, place: str
) -> Column | None:
    """Return the column with a header that names the role, but has no unit of the role; None if missing.

    The unit comes from the map, a stated scale, or the sampling rate. Raise AskingError if a required column
    has no unit.
    """
    channel = chosen.channel(role)
    worded = [each for each in headers if each.of_word == role and role not in each.of_unit]
    scaled = scaled_column(role, table, headers)
    if scaled is not None and channel.gain is None and not channel.unit:
        return scaled
    if not worded and channel.gain is not None:
        shares = command_shares(table) if role == "current" and channel.unit == "%" else ()
        worded = [
            each
            for each in headers
            if each.name in shares
            or ("voltage" in each.of_unit and speaks_of(each.word, role))
            or ("voltage" in each.of_unit and role == "current" and has_word(each.word, "sensor output"))
        ]
    meant = meant_without_unit(role, headers)
    if not worded and meant is not None and channel.unit:
        return Column(role, meant.name, channel.unit, "its word, and an answer")
    if role == "time" and meant is not None and (unit := clocks.unit_by_magnitude(table.columns[meant.name])):
        return Column(role, meant.name, unit, "size of its numbers")
    if not worded:
        if role in chosen.channels and channel.name is None and not channel.unit:
            found = f"neither channel.{role} nor a header names a column; the columns are: "
            raise InputError(place=place, found=found + column_list(table.names))
        return None
    left = [each for each in worded if not has_word(each.word, "set point")] or worded
    left = [each for each in left if not names_by_symbol(each.name)] or left
    if len(left) > 1 and not _is_needed(role, headers):
        return None
    column = _select_one(role, [Column(role, each.name, each.unit) for each in left], place)
    unit = channel.unit or column.unit
    if not unit and role == "time":
        unit = clocks.unit_by_rate(column.name, table)
    is_volts = "voltage" in roles_of_unit(unit)
    if channel.unit or role in roles_of_unit(unit) or (is_volts and channel.gain is not None):
        return Column(role, column.name, unit, "header" if column.unit else "sampling rate")
    if not _is_needed(role, headers):
        return None
    if not is_volts:
        raise no_unit(role, place, column.name, f"unit {unit!r} is not a unit of {role}" if unit else "")
    scales = dict.fromkeys((line, scale) for line in table.said for scale in scales_in(line))
    stated = [line for line, (_, scale_unit) in scales if role in roles_of_unit(scale_unit)]
    raise no_scale(role, [column.name], place, stated)


def _is_needed(role: str, headers: Sequence[Header]) -> bool:
    """Return True if a run requires a role (current or voltage), so that an unclear column is a question."""
    if role == "current":
        return not any("voltage" in each.of_unit and says_command(each.word) for each in headers)
    if role == "voltage":
        return not any("current" in each.of_unit for each in headers)
    return role not in {"velocity", "temperature"}


def skipped_columns(table: Table, columns: Sequence[Column], chosen: ChannelMap) -> list[str]:
    """Return the columns of unknown unit that may belong to a role without a column."""
    taken = {column.name for column in columns} | {*table.stamps}
    roles = {*QUANTITIES} - {column.role for column in columns} - chosen.constant.keys()
    headers = [header_of(table, name) for name in table.columns if name not in taken]
    return [
        f"{each.name!r} ({role}, unknown unit)"
        for role in QUANTITIES
        for each in headers
        if role in roles and not each.unit
        if each.of_word == role or (not each.of_word and speaks_of(each.word, role))
    ]


def scaled_column(role: str, table: Table, headers: Sequence[Header]) -> Column | None:
    """Return the column of a role with a scale in its header or above the table.

    A scale is a quantity per volt or per cent. Return None unless there is exactly one column and one scale.
    """
    found: set[tuple[str, str, float]] = set()
    volts = [each for each in headers if "voltage" in each.of_unit or not each.of_unit]
    lines = (*table.said, *(each.name for each in volts))
    for line in (each for each in lines if scales_in(each) or ranges_in(each)):
        meant = [each for each in volts if _mentions(line, each)]
        if len(meant) != 1:  # One line may state the scales of several columns.
            meant = [each for each in meant or volts if each.of_word == role or speaks_of(each.word, role)]
        if len(meant) != 1:
            continue
        stated = table.units.get(meant[0].name, "") or unit_in_brackets(meant[0].name)
        share = is_per_cent(stated or meant[0].name) and line != meant[0].name
        for number, unit in ranges_in(line) if share else scales_in(line):
            if role in roles_of_unit(unit):
                gain = number * float(to_si(1.0, unit, role))
                if "voltage" in meant[0].of_unit:  # The column may be in millivolts.
                    gain *= float(to_si(1.0, meant[0].unit, "voltage"))
                found.add((meant[0].name, *(("%", gain / 100.0) if share else ("V", gain))))
    if len(found) != 1:
        return None
    name, unit, gain = found.pop()
    return Column(role, name, unit, "scale in the file", gain)


def _mentions(line: str, header: Header) -> bool:
    """Return True if a line contains the name of a column as a separate word.

    In a row of a table, the number or letter of the column is sufficient: ``| A | load cell | 400 N/V |``.
    """
    word = re.sub(r"\s*[\[(][^\])]*[\])]$", "", header.word.lower())
    numbered = re.fullmatch(r"[^\W\d_]+[ _]?(\d+|\b[a-z])", word)
    if numbered and re.match(rf"[\s|*`]*{numbered[1]}[\s*`]*[|\t;]", line.lower()):
        return True
    at = line.lower().find(word) if word else -1
    after = line[at + len(word) : at + len(word) + 1]
    return at >= 0 and not after.isalnum()


def _select_one(role: str, left: Sequence[Column], place: str) -> Column:
    if len(left) > 1:
        names = [column.name for column in left]
        raise ask(role, "column", place, f"columns {', '.join(map(repr, names))} all hold {role}", names)
    return left[0]
