"""imc FAMOS (.raw, .dat): keys between ``|`` and ``;``, each with its length, samples in a key of their own.

Layout: that of the parser IMCtermite 2.1.18 (Record Evolution, MIT licence; ``lib/imc_object.hpp`` and
``lib/imc_channel.hpp``); the maker's manual was not read. Read are channels of numbers at even steps, and
pairs of a channel and its own abscissa, in one buffer each. What that parser passes over, and what changes
the values, is refused: other byte orders, interleaved samples, channels of several events.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions, Layout, Table
from mrdamper.data.formats.waveforms.channel import Waveform, cut_off, read_bytes, tables_of
from mrdamper.errors import InputError

_WHAT = "FAMOS file"
_REMEDY = "Export the channels as CSV"
_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8", 11: "<u2"}
_KEY = re.compile(rb"\|(\w+),\d+,(\d+),")  # its name, its version, the length of what follows
_CUT = re.compile(rb"\|[\w,]*\Z")
_INTEL = "1"
_REAL, _XY_KINDS = {"1"}, {"2", "3"}  # kinds of data fields
# Places of the lengths of texts, which may hold commas, among the parameters behind a key's own length.
_TEXTS = {"CT": (1, 3), "CD": (2,), "CR": (4,), "CN": (3,)}


@dataclass(slots=True)
class _Component:
    """What the keys of a component said; each is a list of parameters."""

    step: Sequence[str] = ()  # CD
    packing: Sequence[str] = ()  # CP
    buffer: Sequence[str] = ()  # Cb
    scale: Sequence[str] = ()  # CR


@dataclass(slots=True)
class _Field:
    """A data field while its keys are read: one component, or samples and their abscissa."""

    kind: str = "1"
    step: Sequence[str] = ()  # CD before the first component
    components: list[_Component] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


def is_famos(head: bytes) -> bool:
    """Tell whether the first bytes are those of a FAMOS file."""
    return head.startswith(b"|CF,")


def read_famos(path: Path, _options: FileOptions) -> Table:
    """Return the table of a FAMOS file's channels, further recordings as tables that follow."""
    content = read_bytes(path, _WHAT)
    try:
        fields, samples, said = _fields(content, path)
        with np.errstate(over="ignore", invalid="ignore"):  # checks tell what is not finite
            waveforms = [_waveform(each, samples, said, path) for each in fields if each.names]
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(place=path, found=f"a damaged {_WHAT} ({error})", remedy=_REMEDY) from error
    if not waveforms:
        raise InputError(place=path, found="no channels of numbers", expected=f"a {_WHAT} with some")
    return tables_of(waveforms, Layout(_WHAT))


def _keys(content: bytes, path: Path) -> Iterator[tuple[str, bytes]]:
    """Give the keys of a file with what stands behind their length."""
    at = 0
    while (start := content.find(b"|", at)) >= 0:
        key = _KEY.match(content, start)
        if key is None:
            raise cut_off(path, f"the {_WHAT}") if _CUT.match(content, start) else _damaged(path, start)
        at = key.end() + int(key[2])
        if at >= len(content):
            raise cut_off(path, f"the {_WHAT}")
        if not content.startswith(b";", at):
            raise _damaged(path, start)
        yield key[1].decode("ascii"), content[key.end() : at]


def _fields(content: bytes, path: Path) -> tuple[list[_Field], Mapping[int, bytes], tuple[str, ...]]:
    """Return the data fields of a file, its buffers by number, and what its texts say."""
    fields: list[_Field] = []
    samples: dict[int, bytes] = {}
    said: list[str] = []
    encoding = "cp1252"
    for key, data in _keys(content, path):
        if key == "CS":
            number, _, binary = data.partition(b",")
            samples[int(number)] = binary
            continue
        found = _parameters(key, data, encoding)
        if key == "CF":  # |CF,version,1,processor;
            _require(found[0] == _INTEL, "samples in another byte order", path)
        elif key == "NL":
            encoding = _code_page(found[0])
        elif key == "CT":
            said.append(f"{found[2]}: {found[4]}")
        elif key == "CG":
            fields.append(_Field(kind=found[1]))
        elif key == "CC" and fields:
            fields[-1].components.append(_Component(step=fields[-1].step))
        elif fields:
            _add(fields[-1], key, found)
    return fields, samples, tuple(said)


def _add(into: _Field, key: str, found: Sequence[str]) -> None:
    """Add what a key says to the data field, or to the component, that it stands in."""
    if key == "CD" and not into.components:
        into.step = found
    elif key == "CN":
        into.names.append(found[4].strip())
    elif into.components:
        component = into.components[-1]
        if key == "CD":
            component.step = found
        elif key == "CP":
            component.packing = found
        elif key == "Cb":
            component.buffer = found
        elif key == "CR":
            component.scale = found


def _parameters(key: str, data: bytes, encoding: str) -> list[str]:
    """Return a key's parameters; a text that its length announces may hold commas."""
    found: list[str] = []
    rest = data
    while True:
        if len(found) - 1 in _TEXTS.get(key, ()) and found[-1].isdigit():
            size = int(found[-1])
            part, rest = rest[:size], rest[size:]
            last = not rest.startswith(b",")
            rest = rest[1:]
        else:
            part, comma, rest = rest.partition(b",")
            last = not comma
        found.append(part.decode(encoding, "replace"))
        if last:
            return found


def _waveform(each: _Field, samples: Mapping[int, bytes], said: tuple[str, ...], path: Path) -> Waveform:
    name = each.names[0]
    components = each.components
    known = each.kind in _REAL if len(components) == 1 else each.kind in _XY_KINDS and len(components) == 2
    _require(known and len(each.names) == 1, f"{name!r} is no channel of real numbers", path)
    values = _values(components[0], samples, name, path)
    time: FloatArray
    if len(components) == 2:
        time, time_unit = _values(components[1], samples, name, path), _unit(components[1])
        if len(time) != len(values):
            raise cut_off(path, f"{name!r}")
    else:
        step = components[0].step
        _require(len(step) > 3, f"{name!r} states no sampling interval", path)
        time = float(components[0].buffer[9]) + float(step[0]) * np.arange(len(values), dtype=np.float64)
        time_unit = step[3]
    return Waveform(name or "channel", _unit(components[0]), time, time_unit, values, said)


def _values(component: _Component, samples: Mapping[int, bytes], name: str, path: Path) -> FloatArray:
    """Return the samples of a component in its unit."""
    packing, buffer = component.packing, component.buffer
    _require(buffer[0] == "1", f"{name!r} was recorded in several buffers", path)
    kind = _TYPES.get(int(packing[2]), "")
    _require(kind != "", f"{name!r} holds no plain numbers (type {packing[2]})", path)
    size = np.dtype(kind).itemsize
    even = int(packing[1]) == size and int(packing[3]) == 8 * size and packing[5] == "0"
    _require(even and int(packing[7]) in {0, size}, f"the samples of {name!r} are interleaved", path)
    begin, held, filled = int(buffer[4]), int(buffer[5]), int(buffer[7])
    _require(int(buffer[6]) == 0, f"{name!r} is in a ring buffer", path)
    data = samples.get(int(buffer[3]), b"")[begin : begin + min(held, filled)]
    if len(data) < min(held, filled) or not data:
        raise cut_off(path, f"{name!r}")
    raw = np.frombuffer(data[: len(data) // size * size], dtype=kind).astype(np.float64)
    if not component.scale:
        return raw
    factor, offset = float(component.scale[1]), float(component.scale[2])
    if component.scale[0] == "1":
        return raw * factor + offset
    plain = factor in {0.0, 1.0} and offset == 0.0
    _require(plain, f"{name!r} states a factor and that it has none", path)
    return raw


def _unit(component: _Component) -> str:
    return component.scale[5].strip() if len(component.scale) > 5 else ""


def _code_page(number: str) -> str:
    try:
        "".encode(f"cp{int(number)}")
    except (LookupError, ValueError):
        return "cp1252"
    return f"cp{int(number)}"


def _require(given: bool, found: str, path: Path) -> None:  # noqa: FBT001 - a condition
    if not given:
        raise InputError(place=path, found=found, expected=f"a {_WHAT} of plain channels", remedy=_REMEDY)


def _damaged(path: Path, at: int) -> InputError:
    return InputError(place=path, found=f"a damaged {_WHAT} (at byte {at})", remedy=_REMEDY)
