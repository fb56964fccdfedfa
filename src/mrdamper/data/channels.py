"""Channel maps: TOML files of the user with the column and the unit of each role (such as force).

docs/rig_files.md describes the tables of the file and has an example.

Without a gain, the value of a channel is sign x (raw + offset), with raw converted from ``unit`` to SI and
the offset in SI. With a gain, the value is sign x (raw x gain + offset). The gain then converts from ``unit``
(the unit in the file, such as V for a transducer) to the SI unit of the role. A unit is never guessed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
from operator import eq
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions
from mrdamper.errors import InputError
from mrdamper.files import read_toml
from mrdamper.quantities import QUANTITIES, find_quantity, is_unit, spell_unit, to_si
from mrdamper.schema import read_record, unknown_name

COMMANDS = ("current", "voltage")  # roles of the command of a damper


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelTable:
    """The table [channel.ROLE] of a channel map: the column of a role in a file, and its conversion to SI."""

    name: str | None = None
    """Name of the column."""
    pattern: str | None = None
    """Pattern of the column's name, with * and ?."""
    index: int | None = None
    """Position of the column, counted from 1."""
    unit: str = ""
    """Unit of the numbers in the file; empty if the header contains it."""
    gain: float | None = None
    """Factor from the numbers in the file to the SI unit of the role."""
    offset: float = 0.0
    """Offset that is added before the sign is applied [SI]."""
    sign: Literal[1, -1] = 1


@dataclass(frozen=True, slots=True)
class Channel(ChannelTable):
    """A role (such as force) with the settings of its table in the channel map."""

    role: str

    def __post_init__(self) -> None:
        quantity = find_quantity(self.role)
        place = f"channel.{self.role}"
        given = [key for key in ("name", "pattern", "index") if getattr(self, key) is not None]
        if len(given) > 1:
            raise InputError(place=place, found=f"{' and '.join(given)} are given; give one of them")
        if self.gain is None:
            return
        if not (math.isfinite(self.gain) and self.gain != 0.0):
            found = f"gain is {self.gain}"
            raise InputError(place=place, found=found, expected="a finite number, not zero")
        if spell_unit(self.unit, self.role) != quantity.unit and is_unit(self.unit, [self.role]):
            found = f"a gain to {quantity.unit} and {self.unit!r}, a unit of {self.role}"
            remedy = f"Leave the gain out, or give unit {quantity.unit!r}"
            raise InputError(place=place, found=found, remedy=remedy)

    def find(self, names: Sequence[str], place: str) -> int | None:
        """Return the index (from 0) of the column that the map states, None if it states no column."""
        where = f"{place}: channel.{self.role}"
        if self.index is not None:
            if not 1 <= self.index <= len(names):
                expected = f"1 to {len(names)}, counted from 1"
                raise InputError(place=where, found=f"index is {self.index}", expected=expected)
            return self.index - 1
        wanted = self.pattern if self.name is None else self.name
        if wanted is None:
            return None
        fits = fnmatchcase if self.name is None else eq
        found = [k for k, name in enumerate(names) if fits(name, wanted)]
        if len(found) > 1:
            found_words = f"{wanted!r} is {len(found)} columns"
            raise InputError(place=where, found=found_words, remedy="Give its index")
        if not found:
            raise unknown_name(f"no column {wanted!r}", wanted, map(repr, names), where)
        return found[0]

    def to_si(self, raw: FloatArray, header_unit: str, place: str) -> FloatArray:
        """Return the values of the channel in SI. ``header_unit`` applies if the map states no unit."""
        unit = self.unit or header_unit
        if self.gain is not None:
            with np.errstate(over="ignore", invalid="ignore"):  # The range check rejects an overflow.
                return self.sign * (raw * self.gain + self.offset)
        try:
            values = to_si(raw, unit, self.role)
        except InputError as error:
            hint = "" if self.unit else f". Give [channel.{self.role}] in the channel map"
            raise InputError(place=place, found=f"{error}{hint}") from error
        return values if self.sign == 1 and self.offset == 0.0 else self.sign * (values + self.offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """Several tests in one file, with either the current or the voltage of each test."""

    split: str
    """A test begins at each row in which a text column contains this text."""
    current_A: tuple[float, ...] = ()
    voltage_V: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.split or bool(self.current_A) == bool(self.voltage_V):
            expected = "split (a text), and one list, current_A or voltage_V"
            raise InputError("the tests of the file are not defined", expected=expected)

    @property
    def constants(self) -> list[dict[str, float]]:
        """Return the command of each test by its role [A or V]."""
        currents = [{"current": value} for value in self.current_A]
        return currents or [{"voltage": value} for value in self.voltage_V]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Session:
    name: str = ""
    """Runs with the same session name have the same zero (tare) of the load cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    """The content of a channel map file."""

    channel: Mapping[str, ChannelTable] = field(default_factory=dict)
    constant: Mapping[str, float] = field(default_factory=dict)
    """Constant values. A key is a quantity with its unit (``current_A``), or ``rate_Hz``."""
    segments: Segments | None = None
    session: _Session = field(default_factory=_Session)
    file: FileOptions = field(default_factory=FileOptions)


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """Settings of a channel map. Headers determine all columns that are not in it."""

    channels: Mapping[str, Channel] = field(default_factory=lambda: MappingProxyType({}))
    constant: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))  # role -> value in SI
    rate_Hz: float | None = None
    segments: Segments | None = None
    session: str = ""
    file: FileOptions = field(default_factory=FileOptions)

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], place: str = "channel map") -> ChannelMap:
        """Return the channel map of a TOML document. Raise InputError with one line for each fault."""
        document = read_record(_Document, given, place)
        constant = dict(document.constant)
        rate = constant.pop("rate_Hz", None)
        try:
            if rate is not None and not rate > 0.0:
                raise InputError(f"constant.rate_Hz is {rate:g}", expected="a positive number")
            channels = {role: Channel(role, **asdict(table)) for role, table in document.channel.items()}
            held = dict(_in_si(key, value) for key, value in constant.items())
        except InputError as error:
            raise error.prepend_place(place) from None
        own = MappingProxyType(channels), MappingProxyType(held), rate, document.segments
        return cls(*own, document.session.name, document.file)

    def channel(self, role: str) -> Channel:
        """Return the channel of a role. If the map has no table for the role, all settings are defaults."""
        return self.channels.get(role) or Channel(role)


def read_channel_map(path: str | Path) -> ChannelMap:
    """Return the channel map in a TOML file."""
    return ChannelMap.from_dict(read_toml(path, "channel map"), Path(path).name)


def _in_si(key: str, value: float) -> tuple[str, float]:
    """Return the role of a constant such as ``voltage_V``, and its value in SI."""
    role, _, unit = key.partition("_")
    roles = (*COMMANDS, "temperature")
    if role not in roles or not unit:
        known = [f"{role}_{QUANTITIES[role].unit}" for role in roles]
        raise unknown_name(f"constant has no key {key!r}", key, known)
    try:
        return role, float(to_si(value, unit, role))
    except InputError as error:
        raise error.prepend_place(f"constant.{key}") from None
