"""The block of parameters of an export: what may be changed on a target without building anew, and is kept.

A block is a plain struct in memory: version and length, the values in the order of this list, a checksum. The
values are the FMU's tunable ones, but for those that would switch a mode which the code does not have.
"""

from __future__ import annotations

import csv
import hashlib
import io
import struct
import zlib
from dataclasses import dataclass

import numpy as np

from mrdamper.codegen.target import Target
from mrdamper.codegen.variable import Variable
from mrdamper.codegen.variables import tunables_of

_HEAD_BYTES = 8  # version and length
REAL_BYTES = {"float": 4, "double": 8}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One value of the block: the FMU's variable, the part it belongs to, and where it lies."""

    variable: Variable
    part: str  # model, controller or thermal
    member: str  # of the part's data or state, in C
    learnt: bool  # it is of the state: a gain that may be learnt
    offset: int  # in the block [bytes]
    lowest: float

    @property
    def label(self) -> str:
        """Name of its index in C, after the export's prefix."""
        return self.variable.name.upper()


def parameters_of(target: Target) -> tuple[Parameter, ...]:
    """Return the values of a target's block, in their order."""
    found: list[Parameter] = []
    fixed = target.modes()
    for variable in tunables_of(target):
        learnt = variable.place.startswith("memory.")
        part, _, member = variable.place.removeprefix("memory.").partition("." if learnt else "_data.")
        lowest = variable.low
        if not learnt and part in target.parts and target.modes([member]) != fixed:
            if variable.kind == "boolean" or not (variable.start or 0.0) > 0.0:
                continue
            lowest = max(lowest, 0.0)  # below, it would switch its mode off
        if variable.kind != "boolean":
            offset = _HEAD_BYTES + len(found) * REAL_BYTES[target.precision]
            found.append(Parameter(variable, part, member, learnt, offset, lowest))
    return tuple(found)


def layout_version(target: Target) -> str:
    """Return the version of a target's block: 32 bits of its layout, of the card and of the number type."""
    text = "\n".join(f"{each.variable.name} {each.offset}" for each in parameters_of(target))
    digest = hashlib.sha256(f"{target.fingerprint} {target.precision} {text}".encode()).hexdigest()
    return f"0x{digest[:8]}"


def parameter_block(target: Target) -> bytes:
    """Return the block as identified, as a little-endian target has it in memory: what ``_restore`` takes."""
    numbers = [each.variable.start for each in parameters_of(target)]
    values = np.array(numbers, f"<f{REAL_BYTES[target.precision]}").tobytes()
    checked = struct.pack("<II", int(layout_version(target), 16), _length(target)) + values
    return (checked + struct.pack("<I", zlib.crc32(checked))).ljust(_length(target), b"\0")


def parameter_table(target: Target) -> str:
    """Return the block as CSV: name, offset, type, unit, limits, value as identified, and what it is."""
    lines = io.StringIO()
    rows = csv.writer(lines, lineterminator="\n")
    rows.writerow(
        ["name", "offset_bytes", "type", "unit", "lowest", "highest", "as_identified", "description"]
    )
    rows.writerow(["version", 0, "uint32", "", "", "", layout_version(target), "of the layout and the card"])
    rows.writerow(["length", 4, "uint32", "bytes", "", "", _length(target), "of the whole block"])
    for each in parameters_of(target):
        v = each.variable
        rows.writerow(
            [
                v.name, each.offset, target.precision, v.unit, f"{each.lowest:.9g}", f"{v.high:.9g}",
                f"{v.start:.9g}" if target.single else repr(v.start), v.description,
            ]
        )  # fmt: skip
    last = _length(target) - REAL_BYTES[target.precision]
    rows.writerow(["crc", last, "uint32", "", "", "", "", "CRC-32 (IEEE 802.3) of all bytes before it"])
    return lines.getvalue()


def _length(target: Target) -> int:
    """Return the length of a block [bytes]: after the values the checksum, filled up to one more of them."""
    return _HEAD_BYTES + (len(parameters_of(target)) + 1) * REAL_BYTES[target.precision]
