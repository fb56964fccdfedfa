"""HBM catman binary (.bin): a header for each channel, then the samples of one channel after the other.

Layout: that of the reader apread 1.1.3 (L. Bohmann, MIT licence; ``apread/apreader.py`` and
``apread/entries.py``); the maker's manual was not read. Channels of one length belong together, and one of
them, in a unit of time, is their time. Without one, or with two that differ, the file is refused: the
interval in a channel's header has no unit that this source states.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions, Layout, Table, require_room
from mrdamper.data.formats.waveforms.channel import Waveform, cut_off, read_bytes, tables_of
from mrdamper.errors import InputError
from mrdamper.quantities import roles_of_unit

_WHAT = "catman file"
_REMEDY = "Export the channels as text (ASCII) in catman"
_IDENTITIES = range(5009, 5030)  # of the versions whose layout this is
_SHORTEST = 200  # bytes before the samples
_RESERVED = 32  # texts behind the comment
_EXPORT_FORMAT = 140  # place of the samples' form in a channel's extended header
_FORMS = {b"\0": "<f8", b"\1": "<f4", b"\2": "<u2"}
_ENDS = "<2d"  # least and greatest value
_STEPS = 32767.0  # of two-byte samples between their least and greatest value


@dataclass(frozen=True, slots=True)
class _Channel:
    """Header of a channel."""

    name: str
    unit: str
    length: int
    form: bytes


class _Cursor:
    """A place in the bytes of a file."""

    def __init__(self, content: bytes, path: Path) -> None:
        self.content, self.path, self.at = content, path, 0

    def take(self, size: int) -> bytes:
        """Return the next bytes."""
        if not 0 <= size <= len(self.content) - self.at:
            raise cut_off(self.path, f"the {_WHAT}")
        self.at += size
        return self.content[self.at - size : self.at]

    def number(self, form: str) -> int:
        """Return a whole number: "h" of two bytes, "i" of four, "b" of one."""
        return int(struct.unpack(f"<{form}", self.take(struct.calcsize(form)))[0])

    def text(self, form: str = "h") -> str:
        """Return a text behind its length."""
        data = self.take(self.number(form))
        try:
            return data.decode("utf-8").strip("\0 ")
        except UnicodeDecodeError:
            return data.decode("cp1252", "replace").strip("\0 ")


def is_catman(head: bytes) -> bool:
    """Tell whether the first bytes are those of a catman file."""
    if len(head) < 8:
        return False
    identity, begin, comment = struct.unpack("<hih", head[:8])
    return identity in _IDENTITIES and begin > _SHORTEST and 0 <= comment < begin


def read_catman(path: Path, _options: FileOptions) -> Table:
    """Return the table of a catman file's channels, one clock for each length."""
    cursor = _Cursor(read_bytes(path, _WHAT), path)
    cursor.take(2)
    begin = cursor.number("i")
    comment = cursor.text()
    for _ in range(_RESERVED):
        cursor.text()
    count = cursor.number("h")
    cursor.take(4 + 4 * max(count, 0) + 4)
    channels = [_channel(cursor) for _ in range(count)]
    cursor.at = begin
    held = [(each, _samples(each, cursor)) for each in channels if each.length > 0]
    waveforms = [
        waveform
        for length in dict.fromkeys(each.length for each, _ in held)
        for waveform in _with_time([row for row in held if row[0].length == length], comment, path)
    ]
    if not waveforms:
        raise InputError(place=path, found="no channels of numbers", expected=f"a {_WHAT} with some")
    return tables_of(waveforms, Layout(_WHAT))


def _channel(cursor: _Cursor) -> _Channel:
    """Read the header of a channel."""
    cursor.take(2)
    length = cursor.number("i")
    require_room(length, cursor.path, "of a channel")
    name, unit, _ = cursor.text(), cursor.text(), cursor.text()
    kind = cursor.number("h")  # 0: numbers, 1: texts, 2: objects
    cursor.take(2 + 8)
    extended = cursor.take(cursor.number("i"))
    form = extended[_EXPORT_FORMAT:][:1]
    if length > 0 and (kind != 0 or form not in _FORMS):
        raise InputError(place=cursor.path, found=f"channel {name!r} holds no plain numbers", remedy=_REMEDY)
    cursor.take(2)  # linearisation, scale
    cursor.take(8 * cursor.number("b"))
    cursor.take(2)
    cursor.text()
    cursor.text("i")
    return _Channel(name, unit, length, form)


def _samples(channel: _Channel, cursor: _Cursor) -> FloatArray:
    """Read the samples of a channel, in its unit."""
    kind = np.dtype(_FORMS[channel.form])
    ends = cursor.take(struct.calcsize(_ENDS)) if kind.kind == "u" else b""
    raw = np.frombuffer(cursor.take(kind.itemsize * channel.length), dtype=kind)
    if not ends:
        return raw.astype(np.float64)
    least, greatest = struct.unpack(_ENDS, ends)
    with np.errstate(over="ignore", invalid="ignore"):  # checks tell what is not finite
        return np.asarray(least + raw * ((greatest - least) / _STEPS), dtype=np.float64)


def _with_time(held: Sequence[tuple[_Channel, FloatArray]], comment: str, path: Path) -> list[Waveform]:
    """Return channels of one length over the one of them that is their time."""
    times = [row for row in held if "time" in roles_of_unit(row[0].unit)]
    others = [row for row in held if "time" not in roles_of_unit(row[0].unit)]
    if not others:
        return []
    if not times or any(not np.array_equal(values, times[0][1]) for _, values in times):
        named = ", ".join(repr(channel.name) for channel, _ in (times or others)[:5])
        raise InputError(
            place=path,
            found=f"{'several times' if times else 'no channel of time'} beside channels of "
            f"{held[0][0].length} samples ({named})",
            expected="one, in s or ms",
            remedy="Export the channels of each rate with their time, in a file of their own",
        )
    clock, time = times[0]
    said = (f"comment: {comment}",) if comment else ()
    return [
        Waveform(channel.name, channel.unit, time, clock.unit, values, said) for channel, values in others
    ]
