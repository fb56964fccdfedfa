"""TDMS (LabVIEW): channels in groups, with their units; read when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import attribute_lines, recordings_in
from mrdamper.data.formats.table import (
    FileOptions,
    Layout,
    OnUse,
    Table,
    Texts,
    as_column,
    load_extra,
    plain_names,
    require_room,
)
from mrdamper.errors import InputError

_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")


def is_tdms(head: bytes) -> bool:
    """Tell whether the first bytes are those of a TDMS file."""
    return head.startswith(b"TDSm")


def read_tdms(path: Path, options: FileOptions) -> Table:
    """Return the channels of a TDMS file; a sampling interval is told when all channels share it."""
    with _opened(path) as file:
        every = [
            (group.name, channel.name, len(channel), channel.dtype.kind, dict(channel.properties))
            for group in file.groups()
            for channel in group.channels()
            if options.part in {"", group.name}
        ]
        attributes = {group.name: {**file.properties, **group.properties} for group in file.groups()}
        cut = bool(file.file_status.incomplete_final_segment)
    found = [row for row in every if row[2]]
    if cut and (len(found) < len(every) or not every):
        raise _cut_before([row[1] for row in every if not row[2]], path)
    if not found and not options.part:
        raise InputError(
            place=path.name,
            found="the TDMS file holds no sample: it is empty, or cut off",
            expected="a whole file",
            remedy="Copy it again, or record again",
        )
    others = recordings_in([(group, channel) for group, channel, *_ in found])
    if others:  # one table of each
        found = [each for each in found if each[0] == others[0]]
    group = found[0][0] if found and len({each[0] for each in found}) == 1 else options.part
    names = plain_names([(group, channel) for group, channel, *_ in found])
    rows = dict(zip(names, found, strict=True))
    for name, (_, _, length, _, _) in rows.items():
        require_room(length, path, name)
    numbers = {name: row for name, row in rows.items() if row[3] in "fiubmM"}
    words = {name: row for name, row in rows.items() if row[3] in "OSU"}
    return Table(
        names=tuple(name for name in names if name in numbers or name in words),
        columns=OnUse({name: partial(_numbers, path, row[0], row[1]) for name, row in numbers.items()}),
        texts=OnUse({name: partial(_words, path, row[0], row[1]) for name, row in words.items()}),
        title=group,
        said=attribute_lines(attributes.get(group, {})),
        more=others[1:],
        layout=Layout("TDMS file", part=options.part, notes=("cut off while recording",) if cut else ()),
        rows=max((row[2] for row in numbers.values()), default=0),
        step_s=_step([row[4] for row in numbers.values() if row[2] > 1]),
        units={name: unit for name, row in numbers.items() if (unit := _unit(row[3], row[4]))},
    )


def _cut_before(names: Sequence[str], path: Path) -> InputError:
    first = f"the first sample of {', '.join(names[:5])}" if names else "its first channel"
    return InputError(
        place=path.name,
        found=f"the TDMS file is cut off before {first}",
        expected="a whole file",
        remedy="Copy it again, or record again",
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with npTDMS."""
    nptdms = load_extra("nptdms", "npTDMS", "TDMS files")
    with (
        path.open("rb") as stream,  # npTDMS leaves it open if the file is damaged.
        nptdms.TdmsFile.open(stream) as file,
    ):
        yield file


def _numbers(path: Path, group: str, channel: str) -> FloatArray:
    """Return the samples of a channel; times count from the first."""
    with _opened(path) as file:
        return as_column(np.asarray(file[group][channel][:]))[0]


def _words(path: Path, group: str, channel: str) -> Texts:
    with _opened(path) as file:
        return [None if cell is None else str(cell) for cell in file[group][channel][:]]


def _unit(kind: str, properties: dict[str, object]) -> str:
    if kind in "mM":
        return "s"
    return next((str(properties[key]) for key in _UNITS if properties.get(key)), "")


def _step(properties: list[dict[str, object]]) -> float | None:
    steps = {each.get("wf_increment") for each in properties}
    step = steps.pop() if len(steps) == 1 else None
    return float(step) if isinstance(step, int | float) and step > 0.0 else None
