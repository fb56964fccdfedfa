"""Universal files (.unv, .uff): each function of time (data set 58 or 58b) is one channel, read by pyuff.

Channels with the same name belong to successive recordings. Spectra, complex values and other data sets are
ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.table import FileOptions, Layout, Table, load_extra
from mrdamper.errors import InputError
from mrdamper.quantities import to_si

_DATA_SET = 58
_TIME_RESPONSE = 1
_REAL = (2, 4)  # Data types of real numbers in single and double precision.
_QUANTITIES = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 13: "force"}


@dataclass(frozen=True, slots=True, eq=False)
class _Channel:
    """Samples of one channel and their times, arrays of shape (n,)."""

    name: str
    unit: str
    time: FloatArray  # [s]
    values: FloatArray  # [unit]
    said: tuple[str, ...]  # texts of the header


def read_uff(path: Path, _options: FileOptions) -> Table:
    """Return the table of the first recording of a universal file; later recordings are in ``following``."""
    channels = list(_channels(path))
    if not channels:
        raise InputError(
            place=path, found="no functions of time (data sets 58)", expected="one for each channel"
        )
    recordings: list[list[_Channel]] = []
    count: dict[str, int] = {}
    for channel in channels:
        number = count[channel.name] = count.get(channel.name, -1) + 1
        if number == len(recordings):
            recordings.append([])
        recordings[number].append(channel)
    first, *others = map(_table, recordings)
    return replace(first, following=tuple(others))


def _channels(path: Path) -> Iterator[_Channel]:
    """Generate the channels: real functions of time."""
    pyuff = load_extra("pyuff", "pyuff", "universal files")
    file = pyuff.UFF(str(path))
    for number, kind in enumerate(file.get_set_types()):
        data = file.read_sets(number) if kind == _DATA_SET else {}
        if data.get("func_type") != _TIME_RESPONSE or data["ord_data_type"] not in _REAL:
            continue
        count = int(data["num_pts"])
        if not 0 < count <= len(data["data"]):
            found = "data set 58 was cut off"
            raise InputError(place=path, found=found, expected="a whole file", remedy="Copy it again")
        title, label = _text(data["id1"]), _text(data["ordinate_axis_lab"])
        yield _Channel(
            name=label or title or _QUANTITIES.get(data["ordinate_spec_data_type"], "channel"),
            unit=_text(data["ordinate_axis_units_lab"]),
            time=to_si(data["x"][:count], _text(data["abscissa_axis_units_lab"]) or "s", "time"),
            values=np.asarray(data["data"][:count], dtype=np.float64),
            said=tuple(text for key in ("id1", "id2", "id3", "id4", "id5") if (text := _text(data[key]))),
        )


def _text(given: object) -> str:
    """Return a header text without padding. NONE means an empty text in this format."""
    text = f"{given}".strip()
    return "" if text == "NONE" else text


def _table(channels: Sequence[_Channel]) -> Table:
    columns = {channel.name: channel.values for channel in channels}
    table = Table(
        names=tuple(columns),
        columns=columns,
        texts={},
        layout=Layout("universal file"),
        rows=max(map(len, columns.values())),
        units={channel.name: channel.unit for channel in channels if channel.unit},
        said=tuple(dict.fromkeys(text for channel in channels for text in channel.said)),
    )
    return with_times(table, {channel.name: channel.time for channel in channels})
