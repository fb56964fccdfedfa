"""HDF5, and the MAT files of version 7.3 that are HDF5 inside.

A column is a data set of one dimension, a field of a compound one, or a column of a matrix
(``column 1 of data``); attributes ``unit`` or ``units`` tell its unit. In a MAT file arrays of structures
and cells are lists of references, which are followed; a structure of one signal and its name is a column of
that name (``signals``). Only what the file itself stores is read: external and virtual data sets would lead
to other files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.groups import attribute_lines, is_in_part, recordings_in, units_beside
from mrdamper.data.formats.signals import MOST_ELEMENTS, Signal, find_signal, unit_of_field
from mrdamper.data.formats.table import (
    MOST_COLUMNS,
    MOST_UNPACKED,
    FileOptions,
    Layout,
    OnUse,
    Table,
    as_column,
    load_extra,
    plain_names,
    require_room,
)

_MATLAB = b"MATLAB 7.3"
_OF_COLUMNS = re.compile(r"column|channel|name|label|header|field", re.IGNORECASE)

Selection = Callable[[Any], Any]  # One column of a data set.


def is_hdf5(head: bytes) -> bool:
    """Tell whether the first bytes are those of an HDF5 file, or of a MAT file that is one."""
    return head.startswith((b"\x89HDF", _MATLAB))


def read_hdf5(path: Path, options: FileOptions) -> Table:
    """Return the columns of an HDF5 file, read when asked for."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with path.open("rb") as stream:
        matlab = stream.read(len(_MATLAB)) == _MATLAB
    what = "MAT v7.3 file" if matlab else "HDF5 file"
    with h5py.File(path, "r") as file:
        search = _Search(h5py, file, matlab)
        search.fields((), search.inside(file))
        found = [each for each in search.found if is_in_part(each[0], options.part)]
        others = recordings_in([each[0] for each in found if each[-1] > 1])
        part = others[0] if others else options.part  # one table of each
        found = [each for each in found if is_in_part(each[0], part)]
        texts = {"/".join(path): text for path, text in search.texts.items() if is_in_part(path, part)}
        said = attribute_lines(texts if matlab else _attributes(file, [each[0] for each in found]))
    names = plain_names([leaf for leaf, *_ in found])
    places = {name: each[1:3] for name, each in zip(names, found, strict=True)}
    for name, (*_, size) in zip(names, found, strict=True):
        require_room(size, path, name)
    return Table(
        names=tuple(names),
        columns=OnUse({name: partial(_read, path, *place) for name, place in places.items()}),
        texts={},
        layout=Layout(what, part=options.part),
        rows=max((size for *_, size in found), default=0),
        title=part,
        said=said,
        more=others[1:],
        units=units_beside([each[0][-1] for each in found], search.texts, part)
        | {name: unit for name, (*_, unit, _) in zip(names, found, strict=True) if unit},
    )


Found = tuple[tuple[str, ...], str, Selection | None, str, int]  # path, address, selection, unit, samples


class _Search:
    """Looks for columns in groups, and in what the structures and cells of MATLAB refer to."""

    def __init__(self, h5py: Any, file: Any, matlab: bool) -> None:  # noqa: ANN401, FBT001 - no types
        self._h5py, self._file, self._matlab = h5py, file, matlab
        self._seen: set[int] = set()  # groups and lists of references: links can form rings
        self.found: list[Found] = []
        self.texts: dict[tuple[str, ...], str] = {}  # of MATLAB, by their path

    def inside(self, group: Any) -> dict[str, Any]:  # noqa: ANN401 - h5py has no types
        """Return the members of a group that the file itself stores."""
        names = [name for name in group if not (self._matlab and name.startswith("#"))]  # #refs#
        links = {name: group.get(name, getlink=True) for name in names}
        return {name: group[name] for name, link in links.items() if isinstance(link, self._h5py.HardLink)}

    def fields(self, path: tuple[str, ...], members: Mapping[str, Any]) -> None:
        """Look at the members of a group, or at the fields of a structure."""
        signal = self._signal(members) if self._matlab else None
        if signal is not None:
            item = members[signal.field]
            self.found.append(((*path, signal.name), item.name, None, signal.unit, item.size))
            return
        for name, item in members.items():
            self._look((*path, name), item, unit_of_field(name, members) if self._matlab else "")

    def _look(self, path: tuple[str, ...], item: Any, unit: str = "") -> None:  # noqa: ANN401
        if isinstance(item, self._h5py.Group):
            if self._is_new(item):
                self._group(path, self.inside(item))
        elif not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return
        elif self._refers(item):
            if self._is_new(item):
                for k, inner in enumerate(self._referred(item)):
                    self._look(_element(path, k), inner)
        elif _is_char(item):
            self.texts[path] = _text(item)
        else:
            self.found.extend(_columns(path, item, _unit(item) or unit))

    def _group(self, path: tuple[str, ...], members: Mapping[str, Any]) -> None:
        """Look into a group: an array of structures is one of as many references for each field."""
        listed = [self._refers(item) and "MATLAB_class" not in item.attrs for item in members.values()]
        if not listed or not all(listed) or len({item.size for item in members.values()}) > 1:
            self.fields(path, members)
            return
        rows = zip(*(self._referred(item) for item in members.values()), strict=True)
        for k, row in enumerate(rows):
            self.fields(_element(path, k), dict(zip(members, row, strict=True)))

    def _signal(self, members: Mapping[str, Any]) -> Signal | None:
        sets = {name: item for name, item in members.items() if isinstance(item, self._h5py.Dataset)}
        sets = {name: item for name, item in sets.items() if _is_stored(item)}
        texts = {name: _text(item) for name, item in sets.items() if _is_char(item)}
        numbers = {name: item.shape for name, item in sets.items() if item.dtype.kind in "fiub"}
        return find_signal(texts, {name: numbers[name] for name in numbers.keys() - texts.keys()})

    def _refers(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        """Tell whether a data set is one of MATLAB's lists of references: cells, or a field of structures."""
        if not self._matlab or not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return False
        return self._h5py.check_ref_dtype(item.dtype) is self._h5py.Reference

    def _referred(self, item: Any) -> list[Any]:  # noqa: ANN401 - h5py has no types
        # MATLAB counts along columns, which are the rows of what it stores
        given = np.ravel(item[()])[:MOST_ELEMENTS]
        return [self._file[reference] if reference else None for reference in given]

    def _is_new(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        address = self._h5py.h5o.get_info(item.id).addr
        new = address not in self._seen
        self._seen.add(address)
        return new


def _attributes(file: Any, paths: Sequence[tuple[str, ...]]) -> dict[str, object]:  # noqa: ANN401
    """Return the attributes of the file and of the groups in which all the columns lie."""
    found: dict[str, object] = dict(file.attrs)
    beside = zip(*(path[:-1] for path in paths), strict=False)  # the groups of each depth
    common = [names[0] for names in takewhile(lambda names: len({*names}) == 1, beside)]
    for depth in range(1, len(common) + 1):
        found |= dict(file["/".join(common[:depth])].attrs)
    return {key: value for key, value in found.items() if np.ndim(value) == 0}  # type: ignore[arg-type]


def _element(path: tuple[str, ...], k: int) -> tuple[str, ...]:
    return (*path[:-1], f"{path[-1]}({k + 1})")


def _is_stored(item: Any) -> bool:  # noqa: ANN401 - h5py has no types
    """Tell whether the file itself holds the numbers that a data set states; MATLAB's [] holds its shape."""
    if item.external or item.is_virtual or not item.size or item.attrs.get("MATLAB_empty"):
        return False
    return bool(item.nbytes <= MOST_UNPACKED * item.id.get_storage_size())


def _is_char(item: Any) -> bool:  # noqa: ANN401 - h5py has no types
    """Tell whether a data set is a text of MATLAB's."""
    return bool(item.dtype.kind == "u" and item.attrs.get("MATLAB_class") == b"char")


def _text(item: Any) -> str:  # noqa: ANN401 - h5py has no types
    return "".join(map(chr, np.ravel(item[()]).tolist()))


def _columns(path: tuple[str, ...], item: Any, unit: str) -> Iterator[Found]:  # noqa: ANN401 - no types
    """Return the columns of a data set."""
    if item.dtype.names:
        for name in item.dtype.names:
            if item.ndim == 1 and item.dtype[name].kind in "fiub" and item.dtype[name].shape == ():
                yield (*path, name), item.name, partial(_field, name), unit, item.size
    elif item.dtype.kind not in "fiub":
        return
    elif item.size == max(item.shape, default=1):
        yield path, item.name, None, unit, item.size
    elif item.ndim == 2 and min(item.shape) <= MOST_COLUMNS:
        across = int(np.argmin(item.shape))
        stated = _names_of_columns(item, item.shape[across])
        for k in range(item.shape[across]):
            title = (*path[:-1], stated[k] if stated else f"column {k + 1} of {path[-1]}")
            yield title, item.name, partial(_line, across, k), unit, item.shape[1 - across]


def _names_of_columns(item: Any, count: int) -> list[str]:  # noqa: ANN401 - h5py has no types
    """Return the names that an attribute of a matrix gives its columns; empty without one."""
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


def _unit(item: Any) -> str:  # noqa: ANN401 - h5py has no types
    for key in ("unit", "units", "Unit", "Units"):
        given = item.attrs.get(key)
        if isinstance(given, bytes):
            return given.decode("utf-8", "replace")
        if isinstance(given, str):
            return given
    return ""
