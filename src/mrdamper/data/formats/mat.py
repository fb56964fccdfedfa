"""MAT files up to version 7.2: variables, fields of structures, and columns of matrices.

A structure's field ``run.force`` is a column of its own; a matrix gives ``column 1 of data`` and so on.
Version 7.3 is HDF5 and read there.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    MOST_SAMPLES,
    FileOptions,
    Layout,
    Table,
    as_column,
    decoding,
    plain_names,
    require_held,
    require_room,
)
from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray

__all__ = ["is_mat", "read_mat"]

_LEAST_BYTES = dict.fromkeys(("struct", "cell", "object"), 8)  # of one element; of a number, one
_DEEPEST = 6  # structures in structures


def is_mat(head: bytes) -> bool:
    """Tell whether the first bytes are those of a MAT file of version 5 to 7.2."""
    return head.startswith(b"MATLAB ") and not head.startswith(b"MATLAB 7.3")


def read_mat(path: Path, options: FileOptions) -> Table:
    """Return the columns of a MAT file."""
    from scipy.io import loadmat, whosmat

    with decoding(path, "MAT file", "save it again with '-v7'"):
        held = []
        for name, shape, kind in whosmat(str(path)):
            count = math.prod(abs(int(n)) for n in shape)  # damaged sizes can be negative
            require_room(count, path, name)
            require_held(count, _LEAST_BYTES.get(kind, 1), path, name)
            held.append(name)
        variables = loadmat(str(path), simplify_cells=True)
    found: list[tuple[tuple[str, ...], FloatArray]] = []
    for name in held:
        _collect((name,), variables.get(name), found)
    if options.part:
        found = [pair for pair in found if options.part in pair[0][:-1]]
    names = plain_names([path for path, _ in found])
    columns = dict(zip(names, (column for _, column in found), strict=True))
    if sum(map(len, columns.values())) > MOST_SAMPLES:
        raise InputError(f"{path}: holds more than {MOST_SAMPLES} numbers; split the file")
    return Table(
        names=tuple(names),
        columns=columns,
        texts={},
        layout=Layout("MAT file", part=options.part),
        rows=max(map(len, columns.values()), default=0),
    )


def _collect(path: tuple[str, ...], value: Any, found: list[tuple[tuple[str, ...], FloatArray]]) -> None:  # noqa: ANN401 - what loadmat made
    if isinstance(value, dict) and len(path) < _DEEPEST:
        for name, inner in value.items():
            if not str(name).startswith("__"):
                _collect((*path, str(name)), inner, found)
        return
    if isinstance(value, bool | int | float):
        value = np.array([value])
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub" or not value.size:
        return
    if value.size == max(value.shape, default=1):
        found.append((path, as_column(value)[0]))
    elif value.ndim == 2 and min(value.shape) <= MOST_COLUMNS:
        across = value if value.shape[0] >= value.shape[1] else value.T
        for k in range(across.shape[1]):
            found.append(((*path[:-1], f"column {k + 1} of {path[-1]}"), as_column(across[:, k])[0]))
