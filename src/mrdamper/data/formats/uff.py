"""Universal files (.unv, .uff): each function of time (data set 58 or 58b) is one channel, read by pyuff.

Channels with the same name belong to successive recordings. Spectra, complex values and other data sets are
ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.clocks import with_times
from mrdamper.data.formats.table import FileOptions, Layout, Table, load_extra
from mrdamper.errors import InputError
from mrdamper.quantities import to_si

_DATA_SET = 58
_TIME_RESPONSE = 1
_REAL = (2, 4)  # Data types of real numbers in single and double precision.
_QUANTITIES = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 13: "force"}


def read_uff(path: Path, _options: FileOptions) -> Table:
    """Return the table of the first recording of a universal file; later recordings are in ``following``."""
    recordings: list[dict[str, dict[str, Any]]] = []
    for name, data in _channels(path):
        free = next((recording for recording in recordings if name not in recording), None)
        if free is None:
            recordings.append(free := {})
        free[name] = data
    if not recordings:
        found = "no functions of time (data sets 58)"
        raise InputError(place=path, found=found, expected="one for each channel")
    first, *others = map(_table, recordings)
    return replace(first, following=tuple(others))


def _channels(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Generate name and data set of each channel: the real functions of time."""
    pyuff = load_extra("pyuff", "pyuff", "universal files")
    file = pyuff.UFF(str(path))
    for number, kind in enumerate(file.get_set_types()):
        data = file.read_sets(number) if kind == _DATA_SET else {}
        if data.get("func_type") != _TIME_RESPONSE or data["ord_data_type"] not in _REAL:
            continue
        if not 0 < int(data["num_pts"]) <= len(data["data"]):
            found = "data set 58 was cut off"
            raise InputError(place=path, found=found, expected="a whole file", remedy="Copy it again")
        quantity = _QUANTITIES.get(data["ordinate_spec_data_type"], "channel")
        yield _text(data["ordinate_axis_lab"]) or _text(data["id1"]) or quantity, data


def _text(given: object) -> str:
    """Return a header text without padding. NONE means an empty text in this format."""
    text = f"{given}".strip()
    return "" if text == "NONE" else text


def _table(channels: Mapping[str, Mapping[str, Any]]) -> Table:
    counts = {name: int(data["num_pts"]) for name, data in channels.items()}
    units = {name: _text(data["ordinate_axis_units_lab"]) for name, data in channels.items()}
    texts = [_text(data[f"id{k}"]) for data in channels.values() for k in range(1, 6)]
    table = Table(
        names=tuple(channels),
        columns={name: np.asarray(channels[name]["data"][:n], np.float64) for name, n in counts.items()},
        texts={},
        layout=Layout("universal file"),
        rows=max(counts.values()),
        units={name: unit for name, unit in units.items() if unit},
        said=tuple(dict.fromkeys(filter(None, texts))),
    )
    times = {
        name: to_si(data["x"][: counts[name]], _text(data["abscissa_axis_units_lab"]) or "s", "time")
        for name, data in channels.items()
    }
    return with_times(table, times)
