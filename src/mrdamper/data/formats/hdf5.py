"""HDF5, and the MAT files of version 7.3 that are HDF5 inside.

A column is a data set of one dimension, a field of a compound one, or a column of a matrix
(``column 1 of data``); attributes ``unit`` or ``units`` tell its unit. Only what the file itself stores is
read: external and virtual data sets would lead to other files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    FileOptions,
    Layout,
    OnUse,
    Table,
    as_column,
    decoding,
    load_extra,
    plain_names,
    require_room,
)
from mrdamper.quantities import FloatArray

__all__ = ["is_hdf5", "read_hdf5"]

_MATLAB = b"MATLAB 7.3"
_REMEDY = "save it again, or export the run as CSV"
_MOST_RATIO = 2000  # of numbers to stored bytes: deflate reaches 1032

Selection = Callable[[Any, slice], Any]  # of a data set, some rows


def is_hdf5(head: bytes) -> bool:
    """Tell whether the first bytes are those of an HDF5 file, or of a MAT file that is one."""
    return head.startswith((b"\x89HDF", _MATLAB))


def read_hdf5(path: Path, options: FileOptions) -> Table:
    """Return the columns of an HDF5 file, read when asked for."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with path.open("rb") as stream:
        matlab = stream.read(len(_MATLAB)) == _MATLAB
    what = "MAT v7.3 file" if matlab else "HDF5 file"
    with decoding(path, what, _REMEDY), h5py.File(path, "r") as file:
        found = _find_columns(h5py, file, options.part)
    names = plain_names([leaf for leaf, *_ in found])
    readers = {
        name: partial(_read, path, what, address, selection)
        for name, (_, address, selection, _, _) in zip(names, found, strict=True)
    }
    for name, (*_, size) in zip(names, found, strict=True):
        require_room(size, path, name)
    return Table(
        names=tuple(names),
        columns=OnUse(readers),
        texts={},
        layout=Layout(what, part=options.part),
        rows=max((size for *_, size in found), default=0),
        units={name: unit for name, (*_, unit, _) in zip(names, found, strict=True) if unit},
        read_rows=partial(
            _rows, path, what, {name: each[1:3] for name, each in zip(names, found, strict=True)}
        ),
    )


Found = tuple[tuple[str, ...], str, Selection | None, str, int]  # path, address, selection, unit, samples


def _find_columns(h5py: Any, file: Any, part: str) -> list[Found]:  # noqa: ANN401 - h5py has no types
    found: list[Found] = []

    def look(address: str, item: Any) -> None:  # noqa: ANN401 - h5py has no types
        inside = tuple(address.split("/"))
        if (
            not isinstance(item, h5py.Dataset)
            or inside[0].startswith("#")
            or (part and part not in inside[:-1])
        ):
            return
        if item.external or item.is_virtual or item.attrs.get("MATLAB_class", b"") in {b"char", b"cell"}:
            return
        stored = item.id.get_storage_size()
        if not item.size or item.size * item.dtype.itemsize > _MOST_RATIO * max(stored, 1):
            return
        unit = _unit(item)
        if item.dtype.names:
            for name in item.dtype.names:
                if item.ndim == 1 and item.dtype[name].kind in "fiub" and item.dtype[name].shape == ():
                    found.append(((*inside, name), address, partial(_field, name), unit, item.size))
        elif item.dtype.kind not in "fiub":
            return
        elif item.size == max(item.shape, default=1):
            found.append((inside, address, None, unit, item.size))
        elif item.ndim == 2 and min(item.shape) <= MOST_COLUMNS:
            across = int(np.argmin(item.shape))
            for k in range(item.shape[across]):
                title = (*inside[:-1], f"column {k + 1} of {inside[-1]}")
                found.append((title, address, partial(_line, across, k), unit, item.shape[1 - across]))

    file.visititems(look)
    return found


def _field(name: str, data: Any, rows: slice) -> Any:  # noqa: ANN401 - h5py has no types
    return data[rows][name]


def _line(across: int, k: int, data: Any, rows: slice) -> Any:  # noqa: ANN401 - h5py has no types
    return data[rows, k] if across == 1 else data[k, rows]


def _whole(data: Any, rows: slice) -> Any:  # noqa: ANN401 - h5py has no types
    """Return rows of a data set of one dimension, which may have others of length one."""
    if data.ndim == 0:
        return data[()]
    along = int(np.argmax(data.shape))
    return data[tuple(rows if axis == along else slice(None) for axis in range(data.ndim))]


def _read(path: Path, what: str, address: str, selection: Selection | None) -> FloatArray:
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with decoding(path, what, _REMEDY), h5py.File(path, "r") as file:
        return as_column(np.asarray((selection or _whole)(file[address], slice(None))))[0]


def _rows(
    path: Path,
    what: str,
    places: Mapping[str, tuple[str, Selection | None]],
    names: Sequence[str],
    start: int,
    count: int,
) -> list[FloatArray]:
    """Return some rows of columns."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with decoding(path, what, _REMEDY), h5py.File(path, "r") as file:
        return [
            as_column(np.asarray((selection or _whole)(file[address], slice(start, start + count))))[0]
            for address, selection in (places[name] for name in names)
        ]


def _unit(item: Any) -> str:  # noqa: ANN401 - h5py has no types
    for key in ("unit", "units", "Unit", "Units"):
        given = item.attrs.get(key)
        if isinstance(given, bytes):
            return given.decode("utf-8", "replace")
        if isinstance(given, str):
            return given
    return ""
