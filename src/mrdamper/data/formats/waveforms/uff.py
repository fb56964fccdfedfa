"""Universal files (.unv, .uff), data sets 58 and 58b: one function of time each, which is one channel.

Layout: eleven lines of header between lines of ``-1``, then values of fixed width, or bytes (58b). Channels
of one name belong to recordings one after the other. Data sets of other numbers, spectra and complex values
are passed over. (The layout is that of published descriptions, from memory; no maker's file was at hand.)
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions, Layout, Table, require_room
from mrdamper.data.formats.waveforms.channel import Waveform, cut_off, read_bytes, tables_of
from mrdamper.errors import InputError

_BEGINS = re.compile(rb"\s*-1\s*\r?\n\s*\d+")
_HEADER = 11  # lines
_REAL = {2: (13, "f4"), 4: (20, "f8")}  # ordinate's type: width of its text, and of its bytes
_TIME_RESPONSE = 1
_WORDS = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 13: "force"}


def is_uff(head: bytes) -> bool:
    """Tell whether the first bytes are those of a universal file."""
    return _BEGINS.match(head) is not None


def read_uff(path: Path, _options: FileOptions) -> Table:
    """Return the table of a universal file's functions of time, further recordings as tables that follow."""
    channels = list(_channels(read_bytes(path, "universal file"), path))
    if not channels:
        raise InputError(
            place=path, found="no functions of time (data sets 58)", expected="one for each channel"
        )
    return tables_of(channels, Layout("universal file"))


def _channels(content: bytes, path: Path) -> Iterator[Waveform]:
    """Give the functions of time of a file."""
    stream = io.BytesIO(content)
    while _lines_to_edge(stream) is not None:
        number = stream.readline().decode("ascii", "replace").split()
        if number[:1] not in (["58"], ["58b"]):
            _lines_to_edge(stream)
            continue
        lines = [stream.readline().decode("utf-8", "replace").rstrip("\r\n") for _ in range(_HEADER)]
        data = stream.read(_bytes_of(number, path)) if number[0] == "58b" else b""
        below = _lines_to_edge(stream)
        if below is None:
            raise cut_off(path, "data set 58")
        channel = _channel(lines, number, data or below, path)
        if channel is not None:
            yield channel


def _lines_to_edge(stream: io.BytesIO) -> bytes | None:
    """Return what stands before the next edge of a data set; None where none comes."""
    lines: list[bytes] = []
    for line in stream:
        if line.rstrip() == b"    -1":
            return b"".join(lines)
        lines.append(line)
    return None


def _channel(lines: Sequence[str], number: Sequence[str], data: bytes, path: Path) -> Waveform | None:
    """Return the channel of a data set; None where it is no real function of time."""
    try:
        kind = int(lines[5][:5])
        form, points, even = (int(lines[6][k : k + 10]) for k in (0, 10, 20))
        start, step = (float(lines[6][k : k + 13].replace("D", "E")) for k in (30, 43))
        of_unit = int(lines[8][:10])
    except ValueError as error:
        raise InputError(place=path, found=f"a header of data set 58 is damaged ({error})") from error
    if kind != _TIME_RESPONSE or form not in _REAL:
        return None
    require_room(points, path, lines[0].strip())
    width, real = _REAL[form]
    count = points if even == 1 else 2 * points
    if number[0] == "58b":
        if even != 1 and form == 4:
            raise InputError(
                place=path, found="binary pairs of two precisions", remedy="Export the run as text"
            )
        order = ">" if number[1:2] == ["2"] else "<"
        kept = max(0, min(count, len(data) // np.dtype(real).itemsize))
        values = np.frombuffer(data, f"{order}{real}", kept).astype(np.float64)
    else:
        values = _numbers(data, width, pairs=even != 1 and form == 4, path=path)
    if len(values) < count or points < 1:
        raise cut_off(path, "data set 58")
    values = values[:count]
    label, unit = lines[8][26:46].strip(), lines[8][47:67].strip()
    time = np.asarray(start + step * np.arange(points) if even == 1 else values[::2], dtype=np.float64)
    name = label if label not in {"", "NONE"} else (lines[0].strip() or _WORDS.get(of_unit, ""))
    time_unit = lines[7][47:67].strip()
    return Waveform(
        name=name if name != "NONE" else _WORDS.get(of_unit, "channel"),
        unit="" if unit == "NONE" else unit,
        time=time,
        time_unit="s" if time_unit in {"", "NONE"} else time_unit,
        values=values if even == 1 else values[1::2],
        said=tuple(line.strip() for line in lines[:5] if line.strip() not in {"", "NONE"}),
    )


def _numbers(data: bytes, width: int, *, pairs: bool, path: Path) -> FloatArray:
    """Return numbers of fixed width, between which no blank need stand; pairs are of 13 and 20 characters."""
    found: list[float] = []
    widths = (13, 20) if pairs else (width,)
    for line in data.decode("ascii", "replace").splitlines():
        at, k = 0, 0
        while at < len(line.rstrip()):
            cell = line[at : at + widths[k % len(widths)]].strip().replace("D", "E")
            try:
                found.append(float(cell))
            except ValueError as error:
                raise InputError(place=path, found=f"{cell[:20]!r} is no number of data set 58") from error
            at += widths[k % len(widths)]
            k += 1
    return np.array(found, dtype=np.float64)


def _bytes_of(number: Sequence[str], path: Path) -> int:
    """Return how many bytes the data of a binary data set have, which its first line says."""
    try:
        return max(int(number[4]), 0)
    except (IndexError, ValueError) as error:
        raise InputError(place=path, found="a binary data set 58 does not say its size") from error
