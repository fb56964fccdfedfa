"""MAT files up to version 7.2: variables, fields of structures, and columns of matrices.

A structure's field ``run.force`` is a column of its own; a matrix gives ``column 1 of data`` and so on. A
structure that holds one signal and its name is a column of that name (``signals``). Version 7.3 is HDF5 and
read there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import attribute_lines, is_in_part, recordings_in, units_beside
from mrdamper.data.formats.signals import MOST_ELEMENTS, find_signal, unit_of_field
from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    MOST_SAMPLES,
    FileOptions,
    Layout,
    Table,
    as_column,
    plain_names,
    require_held,
    require_room,
)
from mrdamper.errors import InputError

_LEAST_BYTES = dict.fromkeys(("struct", "cell", "object"), 8)  # of one element; of a number, one


def is_mat(head: bytes) -> bool:
    """Tell whether the first bytes are those of a MAT file of version 5 to 7.2."""
    return head.startswith(b"MATLAB ") and not head.startswith(b"MATLAB 7.3")


def read_mat(path: Path, options: FileOptions) -> Table:
    """Return the columns of a MAT file."""
    from scipy.io import loadmat, whosmat

    held = []
    for name, shape, kind in whosmat(str(path)):
        count = math.prod(abs(int(n)) for n in shape)  # Damaged sizes can be negative.
        require_room(count, path, name)
        require_held(count, _LEAST_BYTES.get(kind, 1), path, name)
        held.append(name)
    variables = loadmat(str(path), simplify_cells=True)
    return table_of_variables({name: variables.get(name) for name in held}, path, options, "MAT file")


def table_of_variables(variables: Mapping[str, Any], path: Path, options: FileOptions, kind: str) -> Table:
    """Return the columns of a file's variables: arrays, and structures and cells of these."""
    found: list[_Found] = []
    for name, value in variables.items():
        _collect((name,), value, found)
    found = [each for each in found if is_in_part(each.path, options.part)]
    others = recordings_in([each.path for each in found if len(each.column) > 1])
    part = others[0] if others else options.part  # one table of each
    found = [each for each in found if is_in_part(each.path, part)]
    texts = _texts(dict(variables))
    stated = units_beside([each.path[-1] for each in found], texts, part)
    names = plain_names([each.path for each in found])
    columns = {name: each.column for name, each in zip(names, found, strict=True)}
    if sum(map(len, columns.values())) > MOST_SAMPLES:
        raise InputError(place=path, found=f"holds more than {MOST_SAMPLES} numbers; split the file")
    return Table(
        names=tuple(names),
        columns=columns,
        texts={},
        layout=Layout(kind, part=options.part),
        rows=max(map(len, columns.values()), default=0),
        units=stated | {name: each.unit for name, each in zip(names, found, strict=True) if each.unit},
        title=part,
        said=attribute_lines(
            {"/".join(path): text for path, text in texts.items() if is_in_part(path, part)}
        ),
        more=others[1:],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    path: tuple[str, ...]
    column: FloatArray
    unit: str = ""


def _collect(
    path: tuple[str, ...],
    value: Any,  # noqa: ANN401 - what loadmat made
    found: list[_Found],
    unit: str = "",
) -> None:
    if isinstance(value, dict):
        if signal := _signal(path, value):
            found.append(signal)
            return
        for name, inner in value.items():
            if not str(name).startswith("__"):
                _collect((*path, str(name)), inner, found, unit_of_field(str(name), value))
        return
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = [*value.flat]
    if isinstance(value, list):
        for k, inner in enumerate(value[:MOST_ELEMENTS]):
            _collect((*path[:-1], f"{path[-1]}({k + 1})"), inner, found)
        return
    if isinstance(value, bool | int | float):
        value = np.array([value])
    if not _is_numbers(value):
        return
    if value.size == max(value.shape, default=1):
        found.append(_Found(path, as_column(value)[0], unit))
    elif value.ndim == 2 and min(value.shape) <= MOST_COLUMNS:
        across = value if value.shape[0] >= value.shape[1] else value.T
        for k in range(across.shape[1]):
            found.append(_Found((*path[:-1], f"column {k + 1} of {path[-1]}"), as_column(across[:, k])[0]))


def _texts(value: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], str]:  # noqa: ANN401
    """Return the texts in structures, by their path."""
    if isinstance(value, str):
        return {path: value}
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = [*value.flat]
    if isinstance(value, list) and path:
        inside = [
            ((*path[:-1], f"{path[-1]}({k + 1})"), inner) for k, inner in enumerate(value[:MOST_ELEMENTS])
        ]
    elif isinstance(value, dict):
        inside = [((*path, str(key)), inner) for key, inner in value.items() if not str(key).startswith("__")]
    else:
        return {}
    return {place: text for where, inner in inside for place, text in _texts(inner, where).items()}


def _signal(path: tuple[str, ...], fields: Mapping[str, Any]) -> _Found | None:
    """Return the column of a structure that holds one signal and its name."""
    texts = {str(key): value for key, value in fields.items() if isinstance(value, str)}
    arrays = {str(key): value for key, value in fields.items() if _is_numbers(value)}
    signal = find_signal(texts, {key: value.shape for key, value in arrays.items()})
    if signal is None:
        return None
    return _Found((*path, signal.name), as_column(arrays[signal.field])[0], signal.unit)


def _is_numbers(value: Any) -> bool:  # noqa: ANN401 - what loadmat made
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 0
