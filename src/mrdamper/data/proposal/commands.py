"""Command and temperature of a run: measured, constant in the channel map, or stated in words.

Words (``words.labels``) are used only if neither a column nor a map has the value. The source is recorded.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import Finding
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.column import Column
from mrdamper.data.proposal.pieces import Piece
from mrdamper.data.proposal.questions import ask
from mrdamper.data.proposal.refusals import no_command, varying_commands
from mrdamper.data.records import command_slack, steady_command
from mrdamper.data.words.headers import word_and_unit
from mrdamper.data.words.labels import Place, find_label
from mrdamper.errors import InputError
from mrdamper.quantities import CommandUnit

COMMAND_UNITS: dict[str, CommandUnit] = dict(zip(("current", "voltage"), get_args(CommandUnit), strict=True))


def command_role(columns: Iterable[Column], chosen: ChannelMap, place: str) -> str:
    """Return the role of the command: "current", "voltage", or "" if missing.

    A constant in the channel map has priority over a column.
    """
    measured = {column.role for column in columns}
    for role in COMMAND_UNITS:
        if role in chosen.constant and role in measured:
            raise InputError(
                place=place, found=f"{role} is a column and a constant of the channel map; leave one out"
            )
    for known in (chosen.constant, measured):
        for role in COMMAND_UNITS:
            if role in known:
                return role
    return ""


def command_of(
    role: str,
    measured: FloatArray | None,
    held: float | None,
    samples: int,
    table: Table,
    chosen: ChannelMap,
    texts: Sequence[Place],
    place: str,
) -> tuple[str, FloatArray, tuple[tuple[str, float, str], ...]]:
    """Return the command: role, values, and (role, value, source) if words state it.

    The sources in order of priority are: ``held`` (the map's command for a section of the file), the
    measured column, the constant of the map, and the nearest text with a command.
    """
    if held is not None:
        return role, np.full(samples, held), ()
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
        raise no_command(table, place, label.in_words(unit), values)
    _require_no_varying_column(label.role, label.values[0], table, place)
    return label.role, np.full(samples, label.values[0]), ((label.role, label.values[0], label.source),)


def _require_no_varying_column(role: str, value: float, table: Table, place: str) -> None:
    """Raise AskingError if the command is stated as constant, but a column named as a current varies."""
    for name in varying_commands(table):
        low, high = np.nanquantile(table.columns[name], (0.0, 1.0)).tolist()
        found = (
            f"the {role} is stated as {value:g} {COMMAND_UNITS[role]} throughout, and column {name!r} varies "
            f"from {low:.4g} to {high:.4g}: answer current.column={name}, or remove it from the file"
        )
        raise ask("current", "column", place, found, [name])


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
            raise no_command(table, place, found, values)


def with_temperature(
    piece: Piece, told: tuple[tuple[str, float, str], ...], chosen: ChannelMap, texts: Sequence[Place]
) -> tuple[Piece, tuple[tuple[str, float, str], ...]]:
    """Add a constant temperature from the map or from words if there is no temperature column.

    ``told`` has (role, value, source) of each value from words. Return the piece and ``told``, which then
    includes a temperature from words. Contradictory temperatures are not used and give a finding.
    """
    if "temperature" in piece.channels:
        return piece, told
    value = chosen.constant.get("temperature")
    if value is None:
        label = find_label(texts, "temperature")
        if label is None:
            return piece, told
        if len(label.values) != 1 or label.others:
            finding = Finding(
                kind="contradictory_temperatures",
                channel="temperature",
                found=label.in_words("degC"),
                effect="None of the temperatures is used",
                remedy="Correct the texts, or answer temperature.value=VALUE",
            )
            return replace(piece, findings=(*piece.findings, finding)), told
        value = label.values[0]
        told = (*told, ("temperature", value, label.source))
    warm = np.full(len(piece.time), value)
    return replace(piece, channels={**piece.channels, "temperature": warm}), told


def segments_of(
    table: Table, chosen: ChannelMap, samples: int, place: str
) -> tuple[list[int], list[float | None]]:
    """Return the limits of the tests in a file, and the command of each test.

    The limits are the first row of each test, followed by the number of rows of the file.
    """
    assert chosen.segments is not None
    split, commands = chosen.segments.split, chosen.segments.commands
    begins = {
        row
        for cells in table.texts.values()
        for row, cell in enumerate(cells)
        if cell is not None and split in cell and row > 0
    }
    edges = [0, *sorted(begins), samples]
    if len(edges) - 1 != len(commands):
        found = f"{split!r} splits the file into {len(edges) - 1} tests, [segments] has {len(commands)}"
        raise InputError(place=place, found=found, remedy="Check the events and the list")
    return edges, list(commands)
