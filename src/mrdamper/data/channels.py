"""Channel maps: which column of a file holds which role, in what unit; TOML that people write.

A header that says ``quantity_unit`` (``force_N``, ``displacement_mm``), ``Force (N)``, ``Force [N]`` or
``Force / N`` is its own map. Everything else is told by a file:

    [channel.force]        # roles: time, displacement, velocity, force, current, voltage, temperature
    name = "CHANNEL1"      # or pattern = "*Load*", or index = 4 (columns are counted from 1)
    unit = "V"             # of the file
    gain = 980.665         # see below
    offset = 0.0
    sign = 1               # or -1
    [constant]             # what the file does not hold
    voltage_V = 3.212      # quantity_unit; or rate_Hz for a file without a time column
    [segments]             # several tests in one file
    split = "Resume"       # a new test begins where a text column holds this
    current_A = [0, 0.25, 0.5, 0.75, 1]
    [session]
    name = "13 May"        # runs that share one tare of the force cell; else one session per file
    [file]                 # when looking at the file does not tell
    part = "Run 3"         # sheet of a workbook, group of a TDMS, MDF, HDF5 or MAT file
    delimiter = ";"        # of a text
    decimal = ","          # "." or ","

Without a gain, a channel is sign x (raw + offset), raw converted from ``unit`` to SI and the offset in SI.
With a gain, it is sign x (raw x gain + offset), which must lead from ``unit`` (of the file, V for a
transducer) to the SI unit of the role. A unit is never guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.records import nearest_names
from mrdamper.errors import InputError
from mrdamper.files import read_toml
from mrdamper.quantities import QUANTITIES, find_quantity, is_unit, spell_unit, to_si

__all__ = [
    "Channel",
    "ChannelMap",
    "Segments",
    "candidates",
    "names_by_symbol",
    "parse_header",
    "read_channel_map",
    "unit_in_brackets",
]

_COMMANDS = ("current", "voltage")
_NOTED = re.compile(r"(.+?)\s*[\[({].*[\])}]\s*[\[({]([^\[({]*)[\])}]")  # a note, then the unit
_BRACKETS = re.compile(r"(.+?)\s*[\[({](.*)[\])}]")
_SLASH, _LINE = re.compile(r"(.+?)\s+/\s*(.+)"), re.compile(r"([^_]+)_(.+)")
_FORMS = (_NOTED, _BRACKETS, _SLASH, _LINE, re.compile(r"(.+)()"))
_FORMS_WITH_UNIT = (
    *(_BRACKETS, re.compile(r"(.+?)\s*/\s*(.+)"), _LINE),
    *(re.compile(r"(.+?)\s*,\s*(.+)"), re.compile(r"(.+?)\s+in\s+(.+)", re.IGNORECASE)),
)
_NARROW = str.maketrans("（）［］／", "()[]/")


@dataclass(frozen=True, slots=True)
class Channel:
    """Where a role is found in a file, and how its numbers lead to SI."""

    role: str
    name: str | None = None
    pattern: str | None = None
    index: int | None = None  # counted from 1
    unit: str = ""
    gain: float | None = None
    offset: float = 0.0
    sign: int = 1

    def __post_init__(self) -> None:
        quantity = find_quantity(self.role)
        given = [key for key in ("name", "pattern", "index") if getattr(self, key) is not None]
        if len(given) > 1:
            raise InputError(f"channel.{self.role}: {' and '.join(given)} are given; give one of them")
        if self.sign not in {1, -1}:
            raise InputError(f"channel.{self.role}: sign is {self.sign}; expected 1 or -1")
        if self.gain is not None and not (math.isfinite(self.gain) and self.gain != 0.0):
            raise InputError(f"channel.{self.role}: gain is {self.gain}; expected a finite number, not zero")
        if self.gain is not None and self.unit and spell_unit(self.unit, self.role) != quantity.unit:
            try:
                to_si(0.0, self.unit, self.role)
            except InputError:
                return
            raise InputError(
                f"channel.{self.role}: a gain stands beside {self.unit!r}, which is a unit of {self.role} "
                f"already; a gain leads to {quantity.unit}. Leave it out, or give unit {quantity.unit!r}"
            )

    def find(self, names: Sequence[str], place: str) -> int | None:
        """Return the position of the channel's column; None when the map leaves that to the header."""
        where = f"{place}: channel.{self.role}"
        if self.index is not None:
            if not 1 <= self.index <= len(names):
                raise InputError(
                    f"{where}: index is {self.index}; expected 1 to {len(names)}, counted from 1"
                )
            return self.index - 1
        wanted = self.name if self.name is not None else self.pattern
        if wanted is None:
            return None
        if self.name is not None:
            found = [k for k, name in enumerate(names) if name == wanted]
        else:
            found = [k for k, name in enumerate(names) if fnmatchcase(name, wanted)]
        if len(found) > 1:
            raise InputError(f"{where}: {wanted!r} is {len(found)} columns; expected one. Give its index")
        if not found:
            near = ", ".join(map(repr, nearest_names(wanted, names)))
            raise InputError(f"{where}: no column {wanted!r}; the nearest are: {near}")
        return found[0]

    def to_si(self, raw: FloatArray, header_unit: str, place: str) -> FloatArray:
        """Return the channel in SI from the file's numbers; ``header_unit`` when the map gives none."""
        unit = self.unit or header_unit
        if not unit:
            choices = ", ".join(QUANTITIES[self.role].units)
            raise InputError(
                f"{place}: {self.role} has no unit; expected one in the header (such as {self.role}_"
                f"{QUANTITIES[self.role].unit}), or `unit` at [channel.{self.role}] in a channel map "
                f"(--channels FILE): {choices}"
            )
        if self.gain is not None:
            with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by its size
                return self.sign * (raw * self.gain + self.offset)
        try:
            values = to_si(raw, unit, self.role)
        except InputError as error:
            hint = "" if self.unit else f". Give [channel.{self.role}] in the channel map"
            raise InputError(f"{place}: {error}{hint}") from error
        return values if self.sign == 1 and self.offset == 0.0 else self.sign * (values + self.offset)


@dataclass(frozen=True, slots=True)
class Segments:
    """Several tests in one file: a new one begins where a text column holds ``split``."""

    split: str
    role: str  # current or voltage
    commands: tuple[float, ...]  # of each segment [A or V]


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """What a channel map says; the empty one leaves everything to the header."""

    channels: Mapping[str, Channel] = field(default_factory=lambda: MappingProxyType({}))
    constant: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))  # role -> SI
    rate_Hz: float | None = None
    segments: Segments | None = None
    session: str = ""
    file: FileOptions = field(default_factory=FileOptions)

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], place: str = "channel map") -> ChannelMap:
        """Return the map that a TOML document holds; an unknown key names the nearest known ones."""
        _check_keys(given, ("channel", "constant", "segments", "session", "file"), place)
        channels = {}
        keys = ("name", "pattern", "index", "unit", "gain", "offset", "sign")
        for role, table in _table(given, "channel", place).items():
            if role not in QUANTITIES:
                _refuse_key(role, tuple(QUANTITIES), f"{place}: channel")
            if not isinstance(table, dict):
                raise InputError(f"{place}: channel.{role} is {table!r}; expected a table [channel.{role}]")
            _check_keys(table, keys, f"{place}: channel.{role}")
            _check_kinds(table, f"{place}: channel.{role}")
            try:
                channels[role] = Channel(role, **table)
            except InputError as error:
                raise InputError(f"{place}: {error}") from error
        constant, rate = {}, None
        for key, value in _table(given, "constant", place).items():
            where = f"{place}: constant.{key}"
            if key == "rate_Hz":
                rate = _number(value, where)
                if not rate > 0.0:
                    raise InputError(f"{where} is {rate:g}; expected a positive number")
                continue
            role, unit = _quantity_unit(key, f"{place}: constant", (*_COMMANDS, "temperature"))
            constant[role] = _to_si(_number(value, where), unit, role, where)
        session = _table(given, "session", place)
        _check_keys(session, ("name",), f"{place}: session")
        name = session.get("name", "")
        if not isinstance(name, str):
            raise InputError(f"{place}: session.name is {name!r}; expected a text")
        segments = _segments(given["segments"], place) if "segments" in given else None
        options = _file_options(_table(given, "file", place), f"{place}: file")
        return cls(MappingProxyType(channels), MappingProxyType(constant), rate, segments, name, options)


def read_channel_map(path: str | Path) -> ChannelMap:
    """Return the channel map in a TOML file."""
    return ChannelMap.from_dict(read_toml(path, "channel map"), Path(path).name)


def parse_header(header: str) -> tuple[str, str] | None:
    """Return (role, unit) of a header that speaks for itself, unit "" when it names a role only, or None.

    A word with a unit of its role beside it may stand in more ways than one with brackets: ``Force, N``,
    ``Kraft in N``, ``Force (filtered) [N]``; and with such a unit a symbol will do, as ``F [N]``.
    """
    text = header.translate(_NARROW).strip()
    for form in _FORMS:
        match = form.fullmatch(text)
        if match and (role := _role_of(match[1])) is not None:
            return role, match[2].strip()
    for form in _FORMS_WITH_UNIT:
        match = form.fullmatch(text)
        if match is None:
            continue
        word, unit = match[1].strip(), match[2].strip()
        role = _role_of(word) or next((q.role for q in QUANTITIES.values() if word == q.symbol), None)
        if role is not None and unit and is_unit(unit, [role]):
            return role, unit
    return None


def names_by_symbol(header: str) -> bool:
    """Tell whether a header names its role by one letter."""
    return re.match(r"\s*[A-Za-z](?![^\W\d_])", header) is not None


def unit_in_brackets(header: str) -> str:
    """Return the unit in the brackets at the end of a header, whatever it is the unit of; "" without."""
    match = re.fullmatch(r".*[\[({]([^\[({]*)[\])}]\s*", header.translate(_NARROW))
    return match[1].strip() if match else ""


def candidates(role: str, headers: Sequence[str]) -> list[str]:
    """Return the headers that may mean a role: by a word or its symbol, else by their unit; for messages."""
    quantity = QUANTITIES[role]
    words = [word for word in quantity.headers if len(word) > (2 if word.isascii() else 1)]
    named = [
        header
        for header in headers
        if header.strip() == quantity.symbol or any(word in header.lower() for word in words)
    ]
    units = {
        header: unit_in_brackets(header) or header.rpartition("_")[2]
        for header in headers
        if parse_header(header) is None  # "Force (V)" is no voltage
    }
    return named or [header for header, unit in units.items() if is_unit(unit, [role])]


def _role_of(word: str) -> str | None:
    word = word.strip() if len(word.strip()) == 1 else word.strip().lower()
    return next((role for role, quantity in QUANTITIES.items() if word in quantity.headers), None)


def _quantity_unit(key: str, place: str, roles: Sequence[str]) -> tuple[str, str]:
    """Return role and unit of a key such as voltage_V."""
    role, _, unit = key.partition("_")
    if role not in roles or not unit:
        _refuse_key(key, [f"{role}_{QUANTITIES[role].unit}" for role in roles], place)
    return role, unit


def _segments(table: object, place: str) -> Segments:
    where = f"{place}: segments"
    if not isinstance(table, dict):
        raise InputError(f"{where} is {table!r}; expected a table [segments]")
    split = table.get("split")
    if not isinstance(split, str) or not split:
        raise InputError(f"{where}.split is {split!r}; expected the text that begins a new test ('Resume')")
    lists = [key for key in table if key != "split"]
    if len(lists) != 1:
        found = ", ".join(lists) or "no command"
        raise InputError(f"{where}: {found}; expected one list, current_A or voltage_V")
    role, unit = _quantity_unit(lists[0], where, _COMMANDS)
    values = table[lists[0]]
    if not isinstance(values, list) or not values:
        raise InputError(f"{where}.{lists[0]} is {values!r}; expected a list with the command of each test")
    numbers = (_number(value, f"{where}.{lists[0]}") for value in values)
    return Segments(split, role, tuple(_to_si(number, unit, role, where) for number in numbers))


def _file_options(table: Mapping[str, Any], place: str) -> FileOptions:
    _check_keys(table, ("part", "delimiter", "decimal"), place)
    for key, value in table.items():
        if not isinstance(value, str) or not value:
            raise InputError(f"{place}.{key} is {value!r}; expected a text")
    if table.get("delimiter", ",") not in {",", ";", "\t", " "}:
        raise InputError(
            f"{place}.delimiter is {table['delimiter']!r}; expected a comma, a semicolon, a tab or a blank"
        )
    if table.get("decimal", ".") not in {".", ","}:
        raise InputError(f"{place}.decimal is {table['decimal']!r}; expected '.' or ','")
    if table.get("decimal") == table.get("delimiter") == ",":
        raise InputError(f"{place}: a comma is delimiter and decimal sign; expected two signs")
    return FileOptions(**table)


def _table(given: Mapping[str, Any], key: str, place: str) -> dict[str, Any]:
    table = given.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{place}: {key} is {table!r}; expected a table [{key}]")
    return table


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where} is {value!r}; expected a finite number")
    return float(value)


def _to_si(value: float, unit: str, role: str, where: str) -> float:
    try:
        return float(to_si(value, unit, role))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _check_keys(table: Mapping[str, object], known: Sequence[str], place: str) -> None:
    for key in table:
        if key not in known:
            _refuse_key(key, known, place)


def _refuse_key(key: str, known: Sequence[str], place: str) -> NoReturn:
    near = ", ".join(nearest_names(key, known))
    raise InputError(f"{place}: {key!r} is not known; the nearest are: {near}")


def _check_kinds(table: Mapping[str, object], place: str) -> None:
    for key, value in table.items():
        if key in {"name", "pattern", "unit"} and not isinstance(value, str):
            raise InputError(f"{place}.{key} is {value!r}; expected a text")
        if key in {"gain", "offset"}:
            _number(value, f"{place}.{key}")
        if key in {"index", "sign"} and (isinstance(value, bool) or not isinstance(value, int)):
            raise InputError(f"{place}.{key} is {value!r}; expected a whole number")
