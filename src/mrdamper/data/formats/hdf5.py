"""HDF5 files, and MAT files of version 7.3, which are HDF5 files.

A column is a data set, a field of a compound data set, or a row or column of a matrix. The attributes
``unit`` or ``units`` state its unit. References of MATLAB's structures and cells are followed. External and
virtual data sets are not read, because they lead to other files.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import FileOptions, Table, as_text, load_extra
from mrdamper.data.formats.variables import OF_COLUMNS, table_of_variables, words_in

_MATLAB = b"MATLAB 7.3"


def read_hdf5(path: Path, options: FileOptions) -> Table:
    """Return the columns of an HDF5 file."""
    h5py = load_extra("h5py", "h5py", "HDF5 files and MAT files of version 7.3")
    with path.open("rb") as stream:
        matlab = stream.read(len(_MATLAB)) == _MATLAB
    with h5py.File(path, "r") as file:
        variables = _Tree(h5py, file, matlab).structure(file)
        return table_of_variables(variables, path, options, "MAT v7.3 file" if matlab else "HDF5 file")


class _Structure(dict[str, Any]):
    """Values in a group by name. ``settings`` are the attributes of the group."""

    settings: Mapping[str, object]


class _DataSet:
    """Numbers of a data set, or of one field of a compound data set, which are read on access."""

    def __init__(self, item: Any, field: str = "") -> None:  # noqa: ANN401 - h5py has no types
        self._item, self._field = item, field
        self.shape, self.ndim, self.size = item.shape, item.ndim, item.size
        self.dtype = item.dtype[field] if field else item.dtype
        self.settings = _settings(item)
        attributes = sorted(item.attrs.items(), key=lambda each: "unit" in each[0].lower())  # Names first.
        named = [np.ravel(given).tolist() for key, given in attributes if OF_COLUMNS.search(key)]
        lists = [f"{each[0]}".split(",") if len(each) == 1 else each for each in named]
        self.words = [words for each in lists if not any(map(str.isdigit, words := words_in(each)))]

    def __getitem__(self, selection: Any) -> Any:  # noqa: ANN401 - as an array
        return self._item[()][self._field][selection] if self._field else self._item[selection]


class _Tree:
    """Converter of groups to values by name, which follows MATLAB's references."""

    def __init__(self, h5py: Any, file: Any, matlab: bool) -> None:  # noqa: ANN401, FBT001 - no types
        self._h5py, self._file, self._matlab = h5py, file, matlab
        self._seen: set[int] = set()  # Addresses that were read already, because links can be circular.

    def structure(self, group: Any) -> Any:  # noqa: ANN401 - h5py has no types
        """Return the members of a group that are stored in the file; a list for an array of structures."""
        # MATLAB stores the targets of references in a group "#refs#".
        names = [name for name in group if not (self._matlab and name.startswith("#"))]
        links = {name: group.get(name, getlink=True) for name in names}
        members = {name: group[name] for name, at in links.items() if isinstance(at, self._h5py.HardLink)}
        listed = [self._refers(item) and "MATLAB_class" not in item.attrs for item in members.values()]
        if listed and all(listed) and len({item.size for item in members.values()}) == 1:
            rows = zip(*(self._referred(item) for item in members.values()), strict=True)
            return [
                {name: self._value(item) for name, item in zip(members, row, strict=True)} for row in rows
            ]
        settings = _settings(group)  # A group of conditions may have only attributes.
        found = _Structure({name: self._value(item) for name, item in members.items()} or settings)
        found.settings = settings
        return found

    def _value(self, item: Any) -> Any:  # noqa: ANN401 - h5py has no types
        """Return the value of a group or a data set, None if it is stored elsewhere or already read."""
        if self._matlab and item is not None and "MATLAB_object_decode" in item.attrs:
            return SimpleNamespace(classname=as_text(item.attrs.get("MATLAB_class", b"")))
        if isinstance(item, self._h5py.Group):
            return self.structure(item) if self._is_new(item) else None
        if not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return None
        if self._refers(item):
            return [self._value(inner) for inner in self._referred(item)] if self._is_new(item) else None
        if item.dtype.kind == "u" and item.attrs.get("MATLAB_class") == b"char":
            return "".join(map(chr, np.ravel(item[()]).tolist()))
        if item.dtype.names:
            inside = {name: item.dtype[name] for name in item.dtype.names if item.ndim == 1}
            return {name: _DataSet(item, name) for name, each in inside.items() if not each.shape}
        if item.dtype.kind in "SO" and item.size <= SETTINGS.table_columns_max and not self._matlab:
            words = np.ravel(item[()]).tolist()
            return as_text(words[0]) if len(words) == 1 else words
        return _DataSet(item)

    def _refers(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        """Return True if a data set has references: a MATLAB cell array, or a field of a structure array."""
        if not self._matlab or not isinstance(item, self._h5py.Dataset) or not _is_stored(item):
            return False
        return self._h5py.check_ref_dtype(item.dtype) is self._h5py.Reference

    def _referred(self, item: Any) -> list[Any]:  # noqa: ANN401 - h5py has no types
        # MATLAB stores an array transposed. Row order in the file is MATLAB's order, column by column.
        given = np.ravel(item[()])[: SETTINGS.element_count_max]
        return [self._file[reference] if reference else None for reference in given]

    def _is_new(self, item: Any) -> bool:  # noqa: ANN401 - h5py has no types
        address = self._h5py.h5o.get_info(item.id).addr
        new = address not in self._seen
        self._seen.add(address)
        return new


def _is_stored(item: Any) -> bool:  # noqa: ANN401 - h5py has no types
    """Return True if the file contains the numbers of a data set.

    False for external and virtual data sets, for an empty array of MATLAB, which stores only its shape, and
    for an array that is implausibly large for its stored bytes.
    """
    if item.external or item.is_virtual or not item.size or item.attrs.get("MATLAB_empty"):
        return False
    return bool(item.nbytes <= SETTINGS.unpacked_ratio_max * item.id.get_storage_size())


def _settings(item: Any) -> dict[str, object]:  # noqa: ANN401 - h5py has no types
    """Return the attributes of a group or a data set that have a single value."""
    return {key: as_text(np.ravel(value)[0]) for key, value in item.attrs.items() if np.size(value) == 1}
