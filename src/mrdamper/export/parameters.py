"""The block of parameters of an export: what may be changed on a target without building anew, and is kept.

A block is a plain struct in memory: version and length, the values in the order of this list, a checksum. The
values are the FMU's tunable ones, but for those that would switch a mode which the code does not have.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterator
from dataclasses import dataclass

from mrdamper.export.target import Target
from mrdamper.export.variables import Variable, tunables_of
from mrdamper.export.vehicle_struct import DEMAND_GAINS

_HEAD_BYTES = 8  # version and length
_MOST_GAIN = 1e7  # of a demand, either way [N/m], [N s/m]
REAL_BYTES = {"float": 4, "double": 8}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One value of the block: the FMU's variable, the part it belongs to, and where it lies."""

    variable: Variable
    part: str  # model, controller, thermal or vehicle
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
    for variable in (*tunables_of(target), *_demand_gains(target)):
        learnt = variable.place.startswith("memory.")
        part, _, member = variable.place.removeprefix("memory.").partition("." if learnt else "_data.")
        lowest = variable.low
        if not learnt and part in target.parts and target.modes([member]) != fixed:
            if variable.kind == "boolean" or not (variable.start or 0.0) > 0.0:
                continue
            lowest = max(lowest, 0.0)  # below, it would switch its mode off
        if variable.kind == "real":
            offset = _HEAD_BYTES + len(found) * REAL_BYTES[target.precision]
            found.append(Parameter(variable, part, member, learnt, offset, lowest))
    return tuple(found)


def _demand_gains(target: Target) -> Iterator[Variable]:
    """Return the gains of a vehicle's demand, which no FMU has: its wanted force is the master's."""
    if target.vehicle is None:
        return
    states = ("rattle space", "speed of the body", "tyre deflection", "speed of the wheel")
    for member, gain, state in zip(DEMAND_GAINS, target.vehicle.demand.gains, states, strict=True):
        yield Variable(
            name=f"demand_{member}", description=f"wanted force of the {state}", kind="real",
            causality="parameter", variability="tunable", unit="N.s/m" if "speed" in state else "N/m",
            start=gain, low=-_MOST_GAIN, high=_MOST_GAIN, place=f"vehicle_data.{member}",
        )  # fmt: skip


def layout_version(target: Target) -> str:
    """Return the version of a target's block: 32 bits of its layout, of the card and of the number type."""
    text = "\n".join(f"{each.variable.name} {each.offset}" for each in parameters_of(target))
    digest = hashlib.sha256(f"{target.fingerprint} {target.precision} {text}".encode()).hexdigest()
    return f"0x{digest[:8]}"


def parameter_table(target: Target) -> str:
    """Return the block as CSV: name, offset, type, unit, limits, value as identified, and what it is."""
    lines = io.StringIO()
    rows = csv.writer(lines, lineterminator="\n")
    rows.writerow(
        ["name", "offset_bytes", "type", "unit", "lowest", "highest", "as_identified", "description"]
    )
    count = len(parameters_of(target))
    real = REAL_BYTES[target.precision]
    rows.writerow(["version", 0, "uint32", "", "", "", layout_version(target), "of the layout and the card"])
    size = _HEAD_BYTES + (count + 1) * real if target.precision == "double" else _HEAD_BYTES + 4 * count + 4
    rows.writerow(["length", 4, "uint32", "bytes", "", "", size, "of the whole block"])
    for each in parameters_of(target):
        v = each.variable
        rows.writerow(
            [
                v.name, each.offset, target.precision, v.unit, f"{each.lowest:.9g}", f"{v.high:.9g}",
                f"{v.start:.9g}", v.description,
            ]
        )  # fmt: skip
    last = _HEAD_BYTES + count * real
    rows.writerow(["crc", last, "uint32", "", "", "", "", "CRC-32 (IEEE 802.3) of all bytes before it"])
    return lines.getvalue()
