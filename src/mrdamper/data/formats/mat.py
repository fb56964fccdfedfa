"""MAT files up to version 7.2: variables, fields of structures, and columns of matrices.

A structure's field ``run.force`` is a column. A matrix has the columns ``column 1 of data`` and so on. A
structure that holds one signal and its name is a column of that name (``signals``). Version 7.3 is HDF5 and
read there.
"""

from __future__ import annotations

import io
import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.data.formats.groups import (
    UNIT_NAMES,
    StoredArray,
    attribute_lines,
    is_in_part,
    skipped_note,
    table_of_arrays,
)
from mrdamper.data.formats.signals import MOST_ELEMENTS, find_signal, unit_of_field
from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    MOST_SAMPLES,
    MOST_UNPACKED,
    FileOptions,
    Layout,
    Table,
    as_column,
    require_held,
    require_room,
)
from mrdamper.errors import InputError

# Bytes of one element; a number has at least one.
_LEAST_BYTES = dict.fromkeys(("struct", "cell", "object"), 8)


def is_mat(head: bytes) -> bool:
    """Return True if the first bytes are the signature of a MAT file of version 4 to 7.2."""
    return (head.startswith(b"MATLAB ") and not head.startswith(b"MATLAB 7.3")) or _is_version_4(head)


def _is_version_4(head: bytes) -> bool:
    """Return True if the first bytes are a type, a shape, and the length of a name that ends with zero."""
    for order in "<>":
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[:20].ljust(20, b"\xff"))
        name = head[20 : 20 + length] if 1 < length <= 64 else b""
        if kind % 1000 in range(53) and kind < 5000 and imaginary in {0, 1} and min(rows, columns) >= 0:
            return re.fullmatch(rb"[A-Za-z]\w*\0", name) is not None
    return False


def read_mat(path: Path, options: FileOptions) -> Table:
    """Return the columns of a MAT file without its objects of MATLAB's classes.

    Each variable is read by itself because SciPy has no name and no size for an object.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatlabOpaque, varmats_from_mat

    variables: dict[str, Any] = {}
    with path.open("rb") as stream:
        head = stream.read(84)
        stream.seek(0)
        parts = [("", io.BytesIO(stream.read()))] if _is_version_4(head) else varmats_from_mat(stream)
    part: Any  # The stubs of SciPy allow only paths here, SciPy itself reads buffers.
    for name, part in parts:
        try:
            held = whosmat(part)
        except TypeError:  # An object has no shape.
            require_room(part.getbuffer().nbytes * MOST_UNPACKED, path, name)
            held = []
        for _, shape, kind in held:
            count = math.prod(abs(int(n)) for n in shape)  # Damaged sizes can be negative.
            require_room(count, path, name)
            require_held(count, _LEAST_BYTES.get(kind, 1), path, name)
        part.seek(0)
        read = loadmat(part, simplify_cells=True)
        for key, value in read.items():
            if key.startswith("__"):
                continue
            is_object = isinstance(value, MatlabOpaque)
            variables[value.ravel()[0]["s0"].decode("utf-8", "replace") if is_object else key] = value
    return table_of_variables(variables, path, options, "MAT file")


def table_of_variables(
    variables: Mapping[str, Any], path: Path, options: FileOptions, kind: str, skipped: Sequence[str] = ()
) -> Table:
    """Return the columns of a file's variables: arrays, and structures and cells of these."""
    found = _Variables()
    found.collect((), dict(variables))
    if sum(each.size for each in found.arrays) > MOST_SAMPLES:
        raise InputError(place=path, found=f"holds more than {MOST_SAMPLES} numbers; split the file")
    layout = Layout(kind, part=options.part, notes=skipped_note([*skipped, *found.objects]))
    table = table_of_arrays([each for each in found.arrays if not each.is_setting], path, layout, found.texts)
    said = {"/".join(path): text for path, text in found.texts.items() if is_in_part(path, table.title)}
    return replace(table, said=attribute_lines(said))


class _Variables:
    """Search for arrays and texts in structures and cells."""

    def __init__(self) -> None:
        self.arrays: list[StoredArray] = []
        self.texts: dict[tuple[str, ...], str] = {}
        self.objects: list[str] = []  # Objects of MATLAB's classes, which only MATLAB reads.

    def collect(
        self,
        path: tuple[str, ...],
        value: Any,  # noqa: ANN401 - a value of loadmat
        unit: str = "",
        settings: Mapping[str, object] = MappingProxyType({}),
    ) -> None:
        """Collect the arrays in a value; ``settings`` are single values of the structures around it."""
        if isinstance(value, dict):
            self._collect_fields(path, value, settings)
            return
        class_name = _class_name(value)
        if class_name:
            self.objects.append(f"{'/'.join(path)} ({class_name})")
            return
        if isinstance(value, str):
            self.texts[path] = value
            return
        if isinstance(value, np.ndarray) and value.dtype == object:
            value = [*value.flat]
        if isinstance(value, list):
            for k, inner in enumerate(value[:MOST_ELEMENTS]):
                self.collect((*path[:-1], f"{path[-1]}({k + 1})"), inner, settings=settings)
            return
        if isinstance(value, bool | int | float):
            value = np.array([value])
        if not _is_numbers(value):
            return
        if value.size == max(value.shape, default=1):
            self._add(path, value, unit, settings)
        elif value.ndim == 2 and min(value.shape) <= MOST_COLUMNS:
            across = value if value.shape[0] >= value.shape[1] else value.T
            for k in range(across.shape[1]):
                self._add((*path[:-1], f"column {k + 1} of {path[-1]}"), across[:, k], unit, settings)

    def _collect_fields(
        self, path: tuple[str, ...], value: Mapping[str, Any], outer: Mapping[str, object]
    ) -> None:
        fields = {str(name): inner for name, inner in value.items() if not str(name).startswith("__")}
        own = {name: inner for name, inner in fields.items() if isinstance(inner, str | int | float)}
        settings = {name: inner for name, inner in outer.items() if name not in UNIT_NAMES} | own
        arrays = {name: inner for name, inner in fields.items() if _is_numbers(inner)}
        texts = {name: inner for name, inner in fields.items() if isinstance(inner, str)}
        signal = find_signal(texts, {name: inner.shape for name, inner in arrays.items()})
        if signal is None:
            for name, inner in fields.items():
                self.collect((*path, name), inner, unit_of_field(name, fields), settings)
            return
        self._add((*path, signal.name), arrays[signal.field], signal.unit, settings)
        if signal.time:
            self._add((*path, signal.time), arrays[signal.time], "s", settings)
        self.texts |= {(*path, name): text for name, text in texts.items()}

    def _add(
        self,
        path: tuple[str, ...],
        values: Any,  # noqa: ANN401 - an array of numbers
        unit: str,
        settings: Mapping[str, object],
    ) -> None:
        column = as_column(values)[0]
        self.arrays.append(StoredArray(path, len(column), lambda: column, unit, settings))


def _class_name(value: Any) -> str:  # noqa: ANN401 - a value of loadmat
    """Return the class of a MATLAB object or function, "" for any other value."""
    if type(value).__name__ == "MatlabFunction":
        return "function"
    if {"s1", "s2"} <= {*(getattr(getattr(value, "dtype", None), "names", None) or ())}:
        return f"{value.ravel()[0]['s2'].decode('utf-8', 'replace')} object"
    return f"{value.classname} object" if hasattr(value, "classname") else ""


def _is_numbers(value: Any) -> bool:  # noqa: ANN401 - a value of loadmat
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 0
