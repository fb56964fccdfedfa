"""Command and temperature of a run: measured, constant in the channel map, or stated in words.

Words (``words.labels``) are used only if neither a column nor a map has the value. The source is recorded.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import COMMANDS, ChannelMap
from mrdamper.data.finding import Finding
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.column import (
    Column,
    Header,
    header_of,
    meant_without_unit,
    no_scale,
    require_no_text,
)
from mrdamper.data.proposal.pieces import Piece
from mrdamper.data.proposal.questions import ask
from mrdamper.data.records import command_slack, steady_command
from mrdamper.data.words.headers import (
    begins_with_symbol,
    has_word,
    is_command_share,
    parse_header,
    says_command,
    speaks_of,
    word_and_unit,
)
from mrdamper.data.words.labels import Place, find_label, ranges_in
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, CommandUnit, roles_of_unit

COMMAND_UNITS: dict[str, CommandUnit] = dict(zip(("current", "voltage"), get_args(CommandUnit), strict=True))


def command_role(columns: Iterable[Column], chosen: ChannelMap, place: str) -> str:
    """Return the role of the command: "current", "voltage" or "". A constant has priority over a column."""
    measured = {column.role for column in columns}
    if both := {*COMMAND_UNITS} & measured & chosen.constant.keys():
        found = f"{both.pop()} is a column and a constant of the channel map; leave one out"
        raise InputError(place=place, found=found)
    known = [role for roles in (chosen.constant, measured) for role in COMMAND_UNITS if role in roles]
    return known[0] if known else ""


def command_of(
    role: str,
    measured: FloatArray | None,
    samples: int,
    table: Table,
    chosen: ChannelMap,
    texts: Sequence[Place],
    place: str,
) -> tuple[str, FloatArray, tuple[tuple[str, float, str], ...]]:
    """Return the command: role, values, and (role, value, source) if words state it.

    The sources in order of priority are the measured column, the constant of the map, and the nearest text
    with a command.
    """
    if measured is not None:
        _require_agreement(role, measured, table, texts, place)
        return role, measured, ()
    if role in chosen.constant:
        _require_no_varying_column(role, chosen.constant[role], table, place)
        return role, np.full(samples, chosen.constant[role]), ()
    label = find_label(texts, "current") or find_label(texts, "voltage")
    if label is None:
        raise no_command(table, place)
    unit = COMMAND_UNITS[label.role]
    values = [f"{value:g} {unit}" for each in (label, *label.others) for value in each.values]
    if len(values) > 1:
        raise ask("current", "value", place, label.in_words(unit), values)
    _require_no_varying_column(label.role, label.values[0], table, place)
    return label.role, np.full(samples, label.values[0]), ((label.role, label.values[0], label.source),)


def _require_no_varying_column(role: str, value: float, table: Table, place: str) -> None:
    """Raise AskingError if the command is stated as constant, but a column named as a current varies."""
    for header in (header_of(table, name) for name in table.columns if name not in table.stamps):
        may_be_current = "current" in header.of_unit or (_may_be_command(header) and _names_current(header))
        values = table.columns[header.name]
        if may_be_current and _level_changes(values):
            low, high = np.nanquantile(values, (0.0, 1.0)).tolist()
            found = f"the {role} is stated as {value:g} {COMMAND_UNITS[role]} throughout, and column "
            found += f"{header.name!r} varies from {low:.4g} to {high:.4g}: answer "
            found += f"current.column={header.name}, or remove it from the file"
            raise ask("current", "column", place, found, [header.name])


def _require_agreement(
    role: str, measured: FloatArray, table: Table, texts: Sequence[Place], place: str
) -> None:
    """Raise AskingError if a constant measured command differs from a command in words about the file.

    A line above the table is used only if it is an entry ``name: value``. If the names of several entries are
    names of columns, the entries describe the columns and are not used.
    """
    entries = [
        each for each in texts if each.source == "header" and re.fullmatch(r"[^:=]+[:=][^:=]+", each.text)
    ]
    columns = {word_and_unit(name)[0] for name in table.columns}
    if sum(re.split("[:=]", each.text)[0].strip() in columns for each in entries) > 1:
        entries = []
    others = (each for each in texts if each.source != "header" and not each.source.startswith("folder"))
    label = find_label([*entries, *others], role)
    held = steady_command(measured) if label is not None and np.isfinite(measured).all() else None
    if label is None or held is None:
        return
    unit = COMMAND_UNITS[role]
    for each in (label, *label.others):
        # A command in words may differ by 15 % from the measured command.
        gaps = [abs(value - held) for value in each.values]
        if len(gaps) == 1 and gaps[0] > max(0.15 * abs(held), 5 * command_slack(held)):
            values = [f"{each.values[0]:g} {unit}", f"{held:.4g} {unit}"]
            found = f"{replace(each, others=()).in_words(unit)}, and the {role} measured is {values[1]}"
            raise ask("current", "value", place, found, values)


def with_temperature(piece: Piece, chosen: ChannelMap, texts: Sequence[Place]) -> Piece:
    """Add a constant temperature from the map or from words. Contradictory temperatures give a finding."""
    if "temperature" in piece.channels:
        return piece
    value = chosen.constant.get("temperature")
    label = find_label(texts, "temperature") if value is None else None
    if label is not None and (len(label.values) != 1 or label.others):
        kind, effect = "contradictory_temperatures", "None of the temperatures is used"
        remedy = "Correct the texts, or answer temperature.value=VALUE"
        finding = Finding(kind, label.in_words("degC"), effect, remedy, channel="temperature")
        return replace(piece, findings=(*piece.findings, finding))
    if label is not None:
        value = label.values[0]
        piece = replace(piece, told=(*piece.told, ("temperature", value, label.source)))
    if value is None:
        return piece
    return replace(piece, channels={**piece.channels, "temperature": np.full(len(piece.time), value)})


def segments_of(
    tables: Sequence[Table], chosen: ChannelMap, place: str
) -> list[tuple[Table, dict[int, ChannelMap]]]:
    """Return each table, and the maps of its tests by first row, {} if the map has no segments."""
    segments = chosen.segments
    if segments is None:
        return [(table, {}) for table in tables]
    split, starts = segments.split, []
    for table in tables:
        columns = table.texts.values()
        begins = {row for texts in columns for row, text in enumerate(texts) if split in (text or "")}
        starts.append(sorted({0, *begins}))
    count, constants = sum(map(len, starts)), segments.constants
    if count != len(constants):
        found = f"{split!r} splits the file into {count} tests, [segments] has {len(constants)}"
        raise InputError(place=place, found=found, remedy="Check the events and the list")
    maps = (replace(chosen, segments=None, constant={**chosen.constant, **each}) for each in constants)
    return [(table, {row: next(maps) for row in rows}) for table, rows in zip(tables, starts, strict=True)]


def no_command(table: Table, place: str) -> InputError:
    """Return the error that requests the command."""
    for role in COMMANDS:
        require_no_text(role, table, place)
    words = {name: word_and_unit(name) for name in table.columns}
    # If two columns have the same word, such as "force", the column in volts is a sensor output.
    often = Counter(word for word, _ in words.values())
    alone = [name for name, (word, _) in words.items() if often[word] == 1 and parse_header(name) is None]
    volts = [name for name in alone if "voltage" in roles_of_unit(words[name][1])]
    monitors = [each for each in volts if has_word(each, "sensor output") or speaks_of(each, "current")]
    if monitors:
        return no_scale("current", monitors, place)
    shares = command_shares(table)
    if shares and not volts:
        found = f"{' and '.join(map(repr, shares))} is a command in per cent of an unknown current"
        stated = [f"{each!r}" for each in table.said if "A" in (unit for _, unit in ranges_in(each))]
        found += f"; several are stated: {', '.join(stated)}" if len(stated) > 1 else ""
        return ask("current", "scale", place, f"{found} (answer such as 2 A/100%)", shares)
    headers = [header_of(table, name) for name in table.columns if name not in table.stamps]
    unclear = [each.name for each in headers if _may_be_command(each)]
    may_hold = f"; {' or '.join(map(repr, unclear))} may hold it" if unclear else ""
    found = f"no current or voltage{may_hold}"
    if not volts and len(unclear) < 2 and meant_without_unit("current", headers) is not None:
        return ask("current", "unit", place, found, QUANTITIES["current"].units)
    columns = [*dict.fromkeys([*volts, *unclear])]
    return ask("current", "column" if columns else "value", place, found, columns)


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
