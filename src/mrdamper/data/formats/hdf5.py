"""HDF5, and the MAT files of version 7.3 that are HDF5 inside.

A column is a one-dimensional data set, a field of a compound data set, or a column of a matrix. The
attributes ``unit`` or ``units`` state its unit. References of MATLAB's structures and cells are followed.
External and virtual data sets are not read, because they lead to other files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import (
    UNIT_NAMES,
    StoredArray,
    attribute_lines,
    is_in_part,
    skipped_note,
    table_of_arrays,
)
from mrdamper.data.formats.signals import MOST_ELEMENTS, Signal, find_signal, unit_of_field
from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    MOST_UNPACKED,
    FileOptions,
    Layout,
    Table,
    as_column,
    load_extra,
)

_MATLAB = b"MATLAB 7.3"
_OF_COLUMNS = re.compile(r"column|channel|name|label|header|field", re.IGNORECASE)

Selection = Callable[[Any], Any]  # One column of a data set.
Column = tuple[tuple[str, ...], Selection | None, int]  # path, selection, samples


def is_hdf5(head: bytes) -> bool:
    """Return True if the first bytes are the signature of an HDF5 file or a MAT file of version 7.3."""
    return head.startswith((b"\x89HDF", _MATLAB))


def read_hdf5(path: Path, options: FileOptions) -> Table:
    """Return the columns of an HDF5 file, which are read on use."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with path.open("rb") as stream:
        matlab = stream.read(len(_MATLAB)) == _MATLAB
    what = "MAT v7.3 file" if matlab else "HDF5 file"
    with h5py.File(path, "r") as file:
        search = _Search(h5py, file, path, matlab)
        search.fields((), search.inside(file), _settings(file))
    layout = Layout(what, part=options.part, notes=skipped_note(search.objects))
    columns = [each for each in search.found if not each.is_setting]
    table = table_of_arrays(columns, path, layout, search.texts)
    inside = [each.settings for each in search.found if is_in_part(each.path, table.title)]
    texts = {"/".join(path): text for path, text in search.texts.items() if is_in_part(path, table.title)}
    return replace(table, said=attribute_lines(texts if matlab else _shared(inside)))


def _shared(settings: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """Return the attributes and single values that apply to all columns."""
    first = settings[0] if settings else {}
    return {name: value for name, value in first.items() if all(each.get(name) == value for each in settings)}


class _Search:
    """Search for columns in groups and in the references of MATLAB's structures and cells."""

    def __init__(self, h5py: Any, file: Any, path: Path, matlab: bool) -> None:  # noqa: ANN401, FBT001 - no types
        self._h5py, self._file, self._path, self._matlab = h5py, file, path, matlab
        self._seen: set[int] = set()  # Groups and lists of references: links can be circular.
        self.found: list[StoredArray] = []
        self.texts: dict[tuple[str, ...], str] = {}  # Texts of MATLAB by their path.
        self.objects: list[str] = []  # Objects of MATLAB's classes, which only MATLAB reads.

    def inside(self, group: Any) -> dict[str, Any]:  # noqa: ANN401 - h5py has no types
        """Return the members of a group that the file itself stores."""
        names = [name for name in group if not (self._matlab and name.startswith("#"))]  # #refs#
        links = {name: group.get(name, getlink=True) for name in names}
        return {name: group[name] for name, link in links.items() if isinstance(link, self._h5py.HardLink)}

    def fields(
        self, path: tuple[str, ...], members: Mapping[str, Any], settings: Mapping[str, object]
    ) -> None:
        """Search the members of a group, or the fields of a structure."""
        values = {name: value for name, item in members.items() if (value := self._single(item)) is not None}
        settings = {**settings, **values}
        signal = self._signal(members) if self._matlab else None
        if signal is not None:
            self._add((*path, signal.name), members[signal.field], signal.unit, settings)
            if signal.time:
                self._add((*path, signal.time), members[signal.time], "s", settings)
            return
        for name, item in members.items():
            unit = unit_of_field(name, members) if self._matlab else ""
            self._look((*path, name), item, unit, settings)

    def _look(self, path: tuple[str, ...], item: Any, unit: str, settings: Mapping[str, object]) -> None:  # noqa: ANN401
        outer = {name: value for name, value in settings.items() if name not in UNIT_NAMES}
        if self._matlab and item is not None and "MATLAB_object_decode" in item.attrs:
            self.objects.append(
                f"{'/'.join(path)} ({_as_plain_value(item.attrs.get('MATLAB_class', b''))} object)"
            )
        elif isinstance(item, self._h5py.Group):
            if self._is_new(item):
                self._group(path, self.inside(item), {**outer, **_settings(item)})
        elif not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return
        elif self._refers(item):
            if self._is_new(item):
                for k, inner in enumerate(self._referred(item)):
                    self._look(_element(path, k), inner, "", outer)
        elif _is_char(item):
            self.texts[path] = _text(item)
        else:
            self._add(path, item, unit, settings)

    def _add(self, path: tuple[str, ...], item: Any, unit: str, settings: Mapping[str, object]) -> None:  # noqa: ANN401
        """Add the columns of a data set."""
        own = _settings(item)
        unit = next((f"{own[key]}" for key in UNIT_NAMES if key in own), unit)
        for place, selection, size in _columns(path, item):
            read = partial(_read, self._path, item.name, selection)
            self.found.append(StoredArray(place, size, read, unit, {**settings, **own}))

    def _single(self, item: Any) -> object:  # noqa: ANN401 - h5py has no types
        """Return a member of a group as a number or a text, None for any other member."""
        if not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return None
        if self._matlab and _is_char(item):
            return _text(item)
        is_single = item.size == 1 and item.dtype.kind in ("fiub" if self._matlab else "fiubSO")
        return _as_plain_value(np.ravel(item[()])[0]) if is_single else None

    def _group(
        self, path: tuple[str, ...], members: Mapping[str, Any], settings: Mapping[str, object]
    ) -> None:
        """Search a group. An array of structures has one list of references for each field."""
        listed = [self._refers(item) and "MATLAB_class" not in item.attrs for item in members.values()]
        if not listed or not all(listed) or len({item.size for item in members.values()}) > 1:
            self.fields(path, members, settings)
            return
        rows = zip(*(self._referred(item) for item in members.values()), strict=True)
        for k, row in enumerate(rows):
            self.fields(_element(path, k), dict(zip(members, row, strict=True)), settings)

    def _signal(self, members: Mapping[str, Any]) -> Signal | None:
        sets = {name: item for name, item in members.items() if isinstance(item, self._h5py.Dataset)}
        sets = {name: item for name, item in sets.items() if _is_stored(item)}
        texts = {name: _text(item) for name, item in sets.items() if _is_char(item)}
        numbers = {name: item.shape for name, item in sets.items() if item.dtype.kind in "fiub"}
        return find_signal(texts, {name: numbers[name] for name in numbers.keys() - texts.keys()})

    def _refers(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        """Return True if a data set is a list of references: MATLAB's cells, or a field of structures."""
        if not self._matlab or not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return False
        return self._h5py.check_ref_dtype(item.dtype) is self._h5py.Reference

    def _referred(self, item: Any) -> list[Any]:  # noqa: ANN401 - h5py has no types
        # MATLAB counts along columns, which are rows in the file.
        given = np.ravel(item[()])[:MOST_ELEMENTS]
        return [self._file[reference] if reference else None for reference in given]

    def _is_new(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        address = self._h5py.h5o.get_info(item.id).addr
        new = address not in self._seen
        self._seen.add(address)
        return new


def _element(path: tuple[str, ...], k: int) -> tuple[str, ...]:
    return (*path[:-1], f"{path[-1]}({k + 1})")


def _is_stored(item: Any) -> bool:  # noqa: ANN401 - h5py has no types
    """Return True if the numbers of a data set are in the file itself. MATLAB's [] stores only its shape."""
    if item.external or item.is_virtual or not item.size or item.attrs.get("MATLAB_empty"):
        return False
    return bool(item.nbytes <= MOST_UNPACKED * item.id.get_storage_size())


def _is_char(item: Any) -> bool:  # noqa: ANN401 - h5py has no types
    """Return True if a data set is a text of MATLAB."""
    return bool(item.dtype.kind == "u" and item.attrs.get("MATLAB_class") == b"char")


def _text(item: Any) -> str:  # noqa: ANN401 - h5py has no types
    return "".join(map(chr, np.ravel(item[()]).tolist()))


def _columns(path: tuple[str, ...], item: Any) -> Iterator[Column]:  # noqa: ANN401 - no types
    """Return the columns of a data set."""
    if item.dtype.names:
        for name in item.dtype.names:
            if item.ndim == 1 and item.dtype[name].kind in "fiub" and item.dtype[name].shape == ():
                yield (*path, name), partial(_field, name), item.size
    elif item.dtype.kind not in "fiub":
        return
    elif item.size == max(item.shape, default=1):
        yield path, None, item.size
    elif item.ndim == 2 and min(item.shape) <= MOST_COLUMNS:
        across = int(np.argmin(item.shape))
        stated = _names_of_columns(item, item.shape[across])
        for k in range(item.shape[across]):
            title = (*path[:-1], stated[k] if stated else f"column {k + 1} of {path[-1]}")
            yield title, partial(_line, across, k), item.shape[1 - across]


def _names_of_columns(item: Any, count: int) -> list[str]:  # noqa: ANN401 - h5py has no types
    """Return the names of a matrix's columns from its attribute; empty without this attribute."""
    for key, given in item.attrs.items():
        listed = np.ravel(given) if np.ndim(given) else f"{given}".split(",")
        names = [each.decode() if isinstance(each, bytes) else f"{each}".strip() for each in listed]
        if _OF_COLUMNS.search(key) and len(set(names)) == count and not any(map(str.isdigit, names)):
            return names
    return []


def _field(name: str, data: Any) -> Any:  # noqa: ANN401 - h5py has no types
    return data[()][name]


def _line(across: int, k: int, data: Any) -> Any:  # noqa: ANN401 - h5py has no types
    return data[:, k] if across == 1 else data[k, :]


def _read(path: Path, address: str, selection: Selection | None) -> FloatArray:
    """Return one column of a data set."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with h5py.File(path, "r") as file:
        data = file[address]
        return as_column(np.asarray(data[()] if selection is None else selection(data)))[0]


def _settings(item: Any) -> dict[str, object]:  # noqa: ANN401 - h5py has no types
    """Return the attributes of a group or a data set that have a single value."""
    return {
        key: _as_plain_value(np.ravel(value)[0]) for key, value in item.attrs.items() if np.size(value) == 1
    }


def _as_plain_value(value: Any) -> Any:  # noqa: ANN401 - h5py has no types
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value
