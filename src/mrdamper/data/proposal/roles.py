"""Roles of a table's columns: proposed by units, decided by words among several, else asked for.

A column that alone has a unit of a role has that role, whatever it is called; a header's word that names
another role forbids it. Among several a measured one goes before its set point, a word of the role before
any other, and a time is what increases. Volts are a command only where their header says so: they may be a
sensor's output, which a scale in the header (``500 N/V``) turns into its quantity.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.data.channels import Channel, ChannelMap
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.questions import ask, ask_all
from mrdamper.data.words.headers import (
    candidates,
    is_ambient,
    is_monitor,
    is_set_point,
    names_by_symbol,
    parse_header,
    says_command,
    speaks_of,
    unit_in_brackets,
    word_and_unit,
)
from mrdamper.data.words.labels import labels_in, rates_in, scales_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, is_unit, roles_of_unit, spell_unit, to_si

__all__ = [
    "Column",
    "clock_time",
    "find_columns",
    "no_column",
    "no_command",
    "require_one_clock",
    "sampling_step",
    "wide_columns",
]

_NEEDED = ("displacement", "force")
_EQUAL = 0.01  # share by which a sampling rate and a time step may differ
_TICKS = (1.0, 1e3, 1e6)  # of a second: what a time column without a unit may count
_TICK_UNITS = ("s", "ms", "us")


@dataclass(frozen=True, slots=True)
class Column:
    """Which column of a file was taken for a role, its unit as the file or the map spells it, and why."""

    role: str
    name: str
    unit: str
    source: str = "header"  # "map", "header", "unit alone", ...
    gain: float | None = None  # SI per unit of the file, where a scale beside the columns says it

    def channel(self, chosen: ChannelMap) -> Channel:
        """Return how the column's numbers lead to SI: as the map says, else by the scale beside it."""
        given = chosen.channel(self.role)
        if self.gain is None or given.gain is not None:
            return given
        return Channel(
            self.role, name=self.name, unit=self.unit, gain=self.gain, offset=given.offset, sign=given.sign
        )


@dataclass(frozen=True, slots=True)
class _Header:
    """What a header says: its word, its unit, and the roles of both."""

    name: str
    word: str
    unit: str
    of_unit: tuple[str, ...]
    of_word: str  # a role that the word names exactly; "" for none


def find_columns(table: Table, chosen: ChannelMap, place: str) -> tuple[Column, ...]:
    """Return which column holds which role: those of the map first, then what headers say; none is read.

    Raises
    ------
    AskingError
        A needed role has no column, several, or none with a unit.
    """
    headers = [_header(table, name, place) for name in table.columns if name not in table.stamps]
    columns: list[Column] = []
    faults: list[InputError] = []
    known: set[str] = set()  # roles that have a column, or a question of their own
    for role in (*(role for role in QUANTITIES if role != "time"), "time"):
        if role == "time":
            headers = _of_fastest_clock(table, headers, columns)
        try:
            column = _column_of(role, table, headers, chosen, place)
            if column is not None and column.source != "map":
                column = _one_of(role, [column, *_namesakes(column, table)], place)
        except InputError as fault:
            faults.append(fault)
            known.add(role)
            continue
        if column is not None:
            columns.append(column)
            known.add(role)
    for role in _NEEDED:
        if role not in known and not (role == "displacement" and "velocity" in known):
            faults.append(no_column(role, table, place))
    if faults:
        raise ask_all(faults)
    return tuple(sorted(columns, key=lambda column: [*QUANTITIES].index(column.role)))


def _namesakes(column: Column, table: Table) -> list[Column]:
    """Return the other columns that have a column's name in the file: readers number them, ``force (4)``."""
    numbered = re.compile(rf"{re.escape(column.name)} \(\d+\)")
    return [replace(column, name=name) for name in table.columns if numbered.fullmatch(name)]


def _of_fastest_clock(table: Table, headers: list[_Header], columns: Sequence[Column]) -> list[_Header]:
    """Return the headers without the times of other clocks than the fastest of the columns taken."""
    clocks = {table.clocks[column.name] for column in columns if column.name in table.clocks}
    if not clocks:
        return headers
    own = {clock: clock_time(table, clock) for clock in {*table.clocks.values()}}
    fastest = max(clocks, key=lambda clock: len(table.columns[own[clock]]))
    others = {*own.values()} - {own[fastest]}
    return [each for each in headers if each.name not in others]


def clock_time(table: Table, clock: int) -> str:
    """Return the name of a clock's own time: the first column that has it."""
    return next(name for name, other in table.clocks.items() if other == clock)


def wide_columns(table: Table) -> tuple[tuple[str, float], ...]:
    """Return the columns of force of a table that has one for each current, with that current [A].

    Each holds one current in its name, and no two the same.
    """
    forces = [name for name in table.columns if "force" in roles_of_unit(word_and_unit(name)[1])]
    named = [(name, labels_in(name, "current")) for name in forces]
    if len(forces) < 2 or any(len(values) != 1 for _, values in named):
        return ()
    found = tuple((name, values[0]) for name, values in named)
    return found if len({value for _, value in found}) == len(found) else ()


def sampling_step(table: Table, chosen: ChannelMap, place: str) -> float:
    """Return the sampling interval [s] of a file without a time column, as the map or the file states it."""
    step = table.step_s if chosen.rate_Hz is None else 1.0 / chosen.rate_Hz
    rates = rates_in(table.said) if step is None else ()
    if step is None and len(rates) == 1:
        step = 1.0 / rates[0]
    if step is None:
        _require_no_text("time", table, place)
        raise ask(
            "time",
            "rate",
            place,
            found=f"no time column; the columns are: {_listed(table.names)}",
            expected=(
                "a header such as time_s, [channel.time] in a channel map (⟦--channels FILE⟧), or rate_Hz at "
                f"its [constant]{_perhaps(['time'], table)}"
            ),
            candidates=[f"{rate:g}" for rate in rates],
        )
    return step


def _require_no_text(role: str, table: Table, place: str) -> None:
    """Refuse a column of texts whose header says that it is what is missed."""
    for name, cells in table.texts.items():
        header = parse_header(name)
        if header is not None and header[0] == role:
            cell = next((cell for cell in cells if cell), "")
            raise InputError(
                place=place,
                found=f"column {name!r} ({role}) holds text, such as {cell[:40]!r}",
                expected="numbers, without units or separators of thousands in the cells",
                remedy="Export the file again",
            )


def _header(table: Table, name: str, place: str) -> _Header:
    exact = parse_header(name)
    word, unit = word_and_unit(name)
    if exact is not None and unit and exact[1] != unit:  # "Travel_WA100 [mm]"
        exact = (exact[0], unit) if exact[0] in roles_of_unit(unit) else None
    if exact is not None:
        unit = _unit(table, name, exact, place)
    unit = unit or table.units.get(name, "")
    return _Header(name, word, unit, roles_of_unit(unit), _exact_role(exact, word))


def _exact_role(exact: tuple[str, str] | None, word: str) -> str:
    if exact is not None:
        return exact[0]
    named = parse_header(word)
    return named[0] if named is not None else ""


def _column_of(
    role: str, table: Table, headers: Sequence[_Header], chosen: ChannelMap, place: str
) -> Column | None:
    """Return the column of a role; None where there is none."""
    channel = chosen.channel(role)
    position = channel.find(table.names, place)
    if position is not None:
        return _column_of_map(table, channel, table.names[position], headers, place)
    if role == "time" and chosen.rate_Hz is None and table.step_s is None:
        stamps = [name for name in table.names if name in table.stamps]
        named = [each for each in headers if each.of_word == "time" and "time" in each.of_unit]
        if stamps and not named:
            return _one_of("time", [Column("time", name, "s", "times of day") for name in stamps], place)
    of_unit = [each for each in headers if role in each.of_unit and each.of_word in {"", role}]
    if role == "voltage":
        of_unit = [each for each in of_unit if each.of_word or says_command(each.word)]
    if of_unit:
        best = _best(role, of_unit, table)
        source = "header" if best[0].of_word == role else "unit alone"
        column = _one_of(role, [Column(role, each.name, each.unit, source) for each in best], place)
        if role == "time":
            _require_one_rate(column, table, place)
        return Column(role, column.name, channel.unit or column.unit, column.source)
    return _column_without_unit(role, table, headers, chosen, place)


def _column_of_map(
    table: Table, channel: Channel, name: str, headers: Sequence[_Header], place: str
) -> Column:
    role = channel.role
    if name in table.texts:
        raise InputError(place=place, found=f"channel.{role}: column {name!r} holds text", expected="numbers")
    if name in table.stamps and role != "time":
        raise InputError(
            place=place, found=f"channel.{role}: column {name!r} holds times", expected="numbers"
        )
    header = next((each for each in headers if each.name == name), None)
    stated = "s" if name in table.stamps else table.units.get(name, "")
    unit = channel.unit or (header.unit if header else "") or stated or unit_in_brackets(name)
    return Column(role, name, unit, "map")


def _best(role: str, found: Sequence[_Header], table: Table) -> Sequence[_Header]:
    """Return the columns of a unit that are left when words have spoken; each is asked where any remains."""
    left = list(found)
    sieves = [
        [each for each in left if not is_set_point(each.word)],
        [each for each in left if each.of_word == role],
        [each for each in left if each.of_word == role and not names_by_symbol(each.name)],
        [each for each in left if speaks_of(each.word, role)],
    ]
    if role == "temperature":
        sieves.insert(0, [each for each in left if not is_ambient(each.word)])
    for sieve in sieves:
        kept = [each for each in left if each in sieve]
        left = kept or left
    if role == "time" and len(left) > 1:
        left = [each for each in left if _increases(table, each.name)] or left
    return left


def _column_without_unit(
    role: str, table: Table, headers: Sequence[_Header], chosen: ChannelMap, place: str
) -> Column | None:
    """Return the column that only a word names: with a scale, or a rate, that proves its unit."""
    channel = chosen.channel(role)
    worded = [each for each in headers if each.of_word == role and role not in each.of_unit]
    scaled = _scaled(role, table, headers)
    if scaled is not None and channel.gain is None and not channel.unit:
        return scaled
    if not worded and channel.gain is not None:
        worded = [each for each in headers if "voltage" in each.of_unit and _may_measure(each, role)]
    meant = _meant_without_unit(role, headers)
    if not worded and meant is not None and channel.unit:
        return Column(role, meant.name, channel.unit, "its word, and an answer")
    if not worded:
        if role in chosen.channels and channel.name is None and not channel.unit:
            raise _no_column_of_map(role, table, place)
        return None
    left = [each for each in worded if not is_set_point(each.word)] or worded
    left = [each for each in left if not names_by_symbol(each.name)] or left
    column = _one_of(role, [Column(role, each.name, each.unit) for each in left], place)
    unit = channel.unit or column.unit
    if not unit and role == "time":
        unit = _unit_by_rate(column.name, table)
    if not unit and role == "velocity":
        return None  # it is not needed
    if not unit:
        raise _no_unit(role, place, column.name)
    if "voltage" in roles_of_unit(unit) and channel.gain is None:
        if _is_needed(role, headers):
            raise _no_scale(role, [column.name], place)
        return None
    return Column(role, column.name, unit, "header" if column.unit else "sampling rate")


def _meant_without_unit(role: str, headers: Sequence[_Header]) -> _Header | None:
    """Return the one column without a unit whose symbol, or a part of whose name, is of a role."""
    symbol = QUANTITIES[role].symbol
    found = [
        each
        for each in headers
        if not each.unit
        and each.of_word in {"", role}
        and (each.word == symbol or speaks_of(each.word, role))
    ]
    return found[0] if len(found) == 1 else None


def _may_measure(header: _Header, role: str) -> bool:
    """Tell whether a column of volts may be the sensor of a role, whose scale an answer gives."""
    return speaks_of(header.word, role) or (role == "current" and is_monitor(header.word))


def _is_needed(role: str, headers: Sequence[_Header]) -> bool:
    """Tell whether a run cannot do without a role that a sensor gives in volts."""
    if role == "current":
        return not any("voltage" in each.of_unit and says_command(each.word) for each in headers)
    return role in _NEEDED


def _scaled(role: str, table: Table, headers: Sequence[_Header]) -> Column | None:
    """Return the column whose scale stands in its header or above the table."""
    found: dict[str, float] = {}
    volts = [each for each in headers if "voltage" in each.of_unit or not each.of_unit]
    for line in (*table.said, *(each.name for each in volts)):
        for number, unit in scales_in(line):
            if role not in roles_of_unit(unit):
                continue
            meant = [each for each in volts if _mentions(line, each)]
            meant = meant or [each for each in volts if each.of_word == role or speaks_of(each.word, role)]
            if len(meant) == 1:
                found[meant[0].name] = number * float(to_si(1.0, unit, role))
    if len(found) != 1:
        return None
    name, gain = next(iter(found.items()))
    return Column(role, name, "V", "scale beside it", gain)


def _mentions(line: str, header: _Header) -> bool:
    """Tell whether a line names a column, as a word by itself."""
    word = header.word.lower()
    at = line.lower().find(word) if word else -1
    after = line[at + len(word) : at + len(word) + 1]
    return at >= 0 and not after.isalnum()


def _one_of(role: str, left: Sequence[Column], place: str) -> Column:
    if len(left) > 1:
        columns = ", ".join(repr(column.name) for column in left)
        raise ask(
            role,
            "column",
            place,
            found=f"columns {columns} all hold {role}",
            expected="one",
            remedy=f"Name it at [channel.{role}] in the channel map",
            candidates=[column.name for column in left],
        )
    return left[0]


def require_one_clock(table: Table, columns: Sequence[Column], place: str) -> None:
    """Refuse channels of a long record that were sampled by clocks of their own: it is not resampled."""
    if len({table.clocks[column.name] for column in columns if column.name in table.clocks}) > 1:
        which = ", ".join(f"{column.role} {column.name!r}" for column in columns)
        raise InputError(
            place=place,
            found=f"the channels ({which}) have clocks of their own",
            expected="one for all",
            remedy=(
                "Name a group that holds all of them at [file] part in the channel map, or write the file "
                "again with one raster"
            ),
        )


def no_column(role: str, table: Table, place: str) -> InputError:
    """Return the error that asks for the column of a role."""
    _require_no_text(role, table, place)
    names = candidates(role, [*table.columns])
    bare = _meant_without_unit(role, [_header(table, name, place) for name in table.columns])
    scale = [name for name in table.columns if "voltage" in roles_of_unit(word_and_unit(name)[1])]
    return ask(
        role,
        "unit" if bare is not None else "scale" if not names and scale else "column",
        place,
        found=f"no {role} column; the columns are: {_listed(table.names)}",
        expected=(
            f"a header such as {role}_{QUANTITIES[role].unit}, or [channel.{role}] in a channel map "
            f"(⟦--channels FILE⟧){_perhaps([role], table)}"
        ),
        candidates=QUANTITIES[role].units if bare is not None else names or scale or list(table.columns),
    )


def _no_column_of_map(role: str, table: Table, place: str) -> InputError:
    return InputError(
        place=place,
        found=(
            f"neither channel.{role} nor a header names a column; the columns are: {_listed(table.names)}"
        ),
    )


def _no_unit(role: str, place: str, name: str) -> InputError:
    choices = QUANTITIES[role].units
    return ask(
        role,
        "unit",
        place,
        found=f"{role} has no unit",
        expected=(
            f"one in the header (such as {role}_{QUANTITIES[role].unit}) of column {name!r}, or `unit` at "
            f"[channel.{role}] in a channel map (⟦--channels FILE⟧): {', '.join(choices)}"
        ),
        candidates=choices,
    )


def _no_scale(role: str, names: Sequence[str], place: str) -> InputError:
    columns = ", ".join(map(repr, names))
    return ask(
        role,
        "scale",
        place,
        found=f"{role} is in volts ({columns}) and nothing says how many {QUANTITIES[role].unit} one volt is",
        expected=f"a line such as 'scale: 10 {QUANTITIES[role].units[-1]}/V' above the table, or `gain`",
        remedy=f"Give gain and unit = 'V' at [channel.{role}] in the channel map",
        candidates=names,
    )


def no_command(
    table: Table, place: str, found: str = "no current or voltage", values: Sequence[str] = ()
) -> InputError:
    """Return the error that asks for the command."""
    for role in ("current", "voltage"):
        _require_no_text(role, table, place)
    volts = [name for name in table.columns if "voltage" in roles_of_unit(word_and_unit(name)[1])]
    volts = [name for name in volts if parse_header(name) is None and not _has_companion(name, table)]
    monitors = [name for name in volts if is_monitor(name) or speaks_of(word_and_unit(name)[0], "current")]
    bare = _meant_without_unit("current", [_header(table, name, place) for name in table.columns])
    if monitors and not values:
        return _no_scale("current", monitors, place)
    return ask(
        "current",
        "column" if volts and not values else "unit" if bare is not None and not values else "value",
        place,
        found=found,
        expected=(
            "a column such as current_A or voltage_V, or the same at [constant] in a channel map "
            f"(⟦--channels FILE⟧){_perhaps(('current', 'voltage'), table)}"
        ),
        candidates=values or volts or (QUANTITIES["current"].units if bare is not None else ()),
    )


def _has_companion(name: str, table: Table) -> bool:
    """Tell whether another column has the same word and another unit: volts are its sensor's."""
    word = word_and_unit(name)[0]
    return any(word_and_unit(other)[0] == word for other in table.columns if other != name)


def _unit_by_rate(name: str, table: Table) -> str:
    """Return the unit of a time column that a sampling rate above the table proves; "" without one."""
    ticks = _ticks_per_second(name, table)
    return next((u for u, n in zip(_TICK_UNITS, _TICKS, strict=True) if ticks and _is_near(ticks, n)), "")


def _ticks_per_second(name: str, table: Table) -> float | None:
    """Return how many of a time column's units are a second, by the one rate that the file states."""
    rates = rates_in(table.said) if table.step_s is None else (1.0 / table.step_s,)
    steps = np.diff(table.columns[name]) if len(rates) == 1 else np.empty(0)
    return float(np.median(steps)) * rates[0] if len(steps) else None


def _require_one_rate(column: Column, table: Table, place: str) -> None:
    """Refuse a time whose unit and whose file's sampling rate differ by a power of a thousand."""
    if not table.said:
        return
    ticks = _ticks_per_second(column.name, table)
    if ticks is None or ticks <= 0.0:
        return
    wrong = ticks * float(to_si(1.0, column.unit, "time"))
    if any(_is_near(wrong, factor) for factor in (1e3, 1e-3, 1e6, 1e-6)):
        raise ask(
            "time",
            "unit",
            place,
            found=f"column {column.name!r} is in {column.unit}, and a sampling rate above it says otherwise",
            expected="one and the same",
            remedy="Give unit at [channel.time], or rate_Hz at [constant] of the channel map",
            candidates=_TICK_UNITS,
        )


def _is_near(value: float, wanted: float) -> bool:
    return abs(value / wanted - 1.0) < _EQUAL


def _increases(table: Table, name: str) -> bool:
    values = table.columns[name]
    steps = np.diff(values)
    return bool(len(steps)) and float(np.mean(steps > 0.0)) > 0.95


def _perhaps(roles: Iterable[str], table: Table) -> str:
    """Return the end of a message: which column may be the one that is missed, as a map names it."""
    found = [(role, name) for role in roles for name in candidates(role, [*table.columns])]
    lines = " or ".join(f"[channel.{role}] name = {name!r}" for role, name in found[:3])
    return f"; perhaps {lines}" if found else ""


def _unit(table: Table, name: str, header: tuple[str, str], place: str) -> str:
    """Return the unit of a column; a header and a file that state different ones are an error.

    What is no unit at all, as the brackets of ``Force (Trigger)``, does not speak against one that is.
    """
    role, of_header = header
    stated = table.units.get(name, "")
    if not (stated and of_header) or spell_unit(stated, role) == spell_unit(of_header, role):
        return of_header or stated
    units = [word for word in (of_header, stated) if is_unit(word)]
    if len(units) == 2:
        raise InputError(
            place=place,
            found=f"column {name!r} states {stated!r} as its unit beside the name",
            expected="one and the same",
            remedy="Correct the file",
        )
    return units[0] if units else of_header


def _listed(names: Sequence[str], most: int = 24) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
