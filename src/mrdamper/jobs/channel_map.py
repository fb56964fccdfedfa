"""Write channel maps: TOML files that assign columns of a file to quantities.

A written channel map records how files were read. The user can correct and archive the channel map.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.channels import Channel, ChannelMap
from mrdamper.data.finding import Inference
from mrdamper.data.proposal.recordings import RigFile
from mrdamper.data.readers import ReadFiles
from mrdamper.errors import InputError
from mrdamper.files import parse_toml, toml_text
from mrdamper.quantities import QUANTITIES, to_degC
from mrdamper.schema import write_record

_KEYS = {"current": "current_A", "voltage": "voltage_V", "temperature": "temperature_degC"}


@dataclass(frozen=True, slots=True)
class WrittenMap:
    """Channel map that records how files were read."""

    document: Mapping[str, Any]
    comments: tuple[str, ...]  # differences between the files, which the map cannot express

    @property
    def text(self) -> str:
        """Return the map as TOML."""
        return channels_toml(self.document, self.comments)


def write_map(files: ReadFiles) -> WrittenMap:
    """Return a channel map for all files. Its comments list the differences between the files."""
    channels: dict[str, dict[str, Any]] = {}
    comments: list[str] = []
    read = [file for _, file in files.files]
    for role in QUANTITIES:
        found = {_entry(file, role) for file in read} - {None}
        if len(found) == 1:
            channels[role] = dict(found.pop() or ())
        elif found:
            names = ", ".join(sorted(f"{dict(each)['name']!r}" for each in found if each))
            comments.append(f"{role}: {names}, as the header of each file says")
    constant = _constants(
        [each for name, file in files.files for each in _file_constants(name, file)], comments
    )
    if read and "time" not in channels and (rate := _rate(read)) is not None:
        constant |= {"rate_Hz": rate}
    tables = {"channel": channels, "constant": constant, **_common_tables(files, comments)}
    document = {name: table for name, table in tables.items() if table}
    return WrittenMap(document, tuple(comments))


def _common_tables(files: ReadFiles, comments: list[str]) -> dict[str, dict[str, Any]]:
    """Return channel-map tables that are equal in all files; list others in comments."""
    shared: dict[str, dict[str, Any]] = {}
    for name, of in _TABLES.items():
        found = {path.name: of(file.chosen) for path, file in files.files}
        tables = list(found.values())
        if tables and all(table == tables[0] for table in tables):
            shared[name] = tables[0]
            continue
        for file, table in found.items():
            said = ", ".join(f"{key} = {value}" for key, value in table.items())
            comments.append(f"{file}: [{name}] {said or 'none'}")
    return shared


_TABLES: Mapping[str, Callable[[ChannelMap], dict[str, Any]]] = {
    "segments": lambda chosen: {} if chosen.segments is None else write_record(chosen.segments),
    "session": lambda chosen: {"name": chosen.session} if chosen.session else {},
    "file": lambda chosen: write_record(chosen.file),
}
"""Functions that return the tables of a channel map about the whole file: segments, session and format."""


def _file_constants(path: Path, file: RigFile) -> list[Inference]:
    given = [Inference(path.name, role, value, "map") for role, value in file.chosen.constant.items()]
    return [*file.inferred, *given]


def _entry(file: RigFile, role: str) -> tuple[tuple[str, Any], ...] | None:
    """Return the TOML table of a quantity (role); None if the file lacks the quantity."""
    column = next((each for each in file.columns if each.role == role), None)
    if column is None:
        return None
    given, usual = column.channel(file.chosen), Channel(role)
    entry = (("name", column.name), ("unit", column.unit))
    more = ((key, getattr(given, key)) for key in ("gain", "offset", "sign"))
    return (*entry, *((key, value) for key, value in more if value != getattr(usual, key)))


def _constants(inferred: Sequence[Inference], comments: list[str]) -> dict[str, float]:
    """Return constants that are equal in all runs; write other constants to comments."""
    constant: dict[str, float] = {}
    for role, key in _KEYS.items():
        found = [each for each in inferred if each.role == role]
        values = {each.run: to_degC(each.value) if role == "temperature" else each.value for each in found}
        if len(set(values.values())) == 1:
            constant[key] = round(next(iter(values.values())), 9)
        else:
            comments += [
                f"{each.run}: {key} = {values[each.run]:g}, from the {each.source}" for each in found
            ]
    return constant


def _rate(read: Sequence[RigFile]) -> float | None:
    """Return the sampling rate [Hz] if all runs have the same rate, otherwise None."""
    steps = {float(f"{np.median(np.diff(each.time)):.6g}") for file in read for each in file.recordings}
    step = steps.pop() if len(steps) == 1 else 0.0
    return float(f"{1.0 / step:.6g}") if step > 0.0 else None


def channels_toml(document: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """Return a channel map as TOML text.

    Raises
    ------
    InputError
        If ``document`` is not a valid channel map.
    """
    ChannelMap.from_dict(document, "channel map")
    title = ["channel map, written by mrdamper", *(" ".join(line.split()) for line in comments)]
    text = toml_text(document, "\n".join(title))
    if ChannelMap.from_dict(parse_toml(text)) != ChannelMap.from_dict(document):
        raise InputError(
            "it cannot be written as TOML", place="channel map", expected="plain texts and numbers"
        )
    return text
