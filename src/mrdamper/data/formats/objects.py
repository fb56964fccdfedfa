"""JSON files, files with one JSON object per line, and NumPy archives. All contain values by name.

In JSON, lists of numbers are columns and lists of objects are rows. If an object has a list of rows, lists of
words in the same object are the names and units of the columns. Pickled objects in an archive are never
opened.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.lines.encodings import read_lines
from mrdamper.data.formats.table import FileOptions, Table, require_held
from mrdamper.data.formats.variables import table_of_variables


def read_npz(path: Path, options: FileOptions) -> Table:
    """Return the arrays of an archive (``numpy.savez``) as columns."""
    with (
        path.open("rb") as stream,  # NumPy would leave a damaged archive open.
        np.load(stream, allow_pickle=False) as archive,
    ):
        pickled: list[str] = []
        for name in archive.files:
            with archive.zip.open(f"{name}.npy") as member:
                first = np.lib.format.read_magic(member) == (1, 0)
                read = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
                shape, _, kind = read(member)
            require_held(math.prod(shape), kind.itemsize, path, name)
            if kind.hasobject:
                pickled.append(name)
        variables = {name: _as_plain_value(archive[name]) for name in archive.files if name not in pickled}
    skipped = [f"{name} (pickled objects)" for name in pickled]
    return table_of_variables(variables, path, options, "NumPy archive", skipped)


def read_json(path: Path, options: FileOptions) -> Table:
    """Return the columns of a JSON file, or of a file with one JSON object per line."""
    lines = read_lines(path).lines
    try:
        whole = json.loads("\n".join(lines))
    except json.JSONDecodeError:
        whole = [json.loads(line) for line in lines if line.strip()]
    arrays = _arrays(whole)
    variables = arrays if isinstance(arrays, dict) else {"": arrays}
    return table_of_variables(variables, path, options, "JSON file")


def _as_plain_value(value: Any) -> Any:  # noqa: ANN401 - any array
    """Return a NumPy array as the MAT reader would: a text as str, a record as a mapping of its fields."""
    if value.dtype.names:
        return {name: np.asarray(value[name]) for name in value.dtype.names}
    return str(value) if value.dtype.kind == "U" and value.ndim == 0 else value


def _arrays(value: Any) -> Any:  # noqa: ANN401 - of JSON
    """Return a JSON value in which lists of numbers and tables are converted to arrays."""
    if isinstance(value, dict):
        return {str(key): _arrays(each) for key, each in value.items()}
    if not isinstance(value, list) or not value:
        return value
    records = [row for row in value if isinstance(row, dict)]
    inner = [each for row in records for each in row.values()]
    if len(records) == len(value) and not any(isinstance(each, dict | list) for each in inner):
        keys = list(dict.fromkeys(key for row in value for key in row))
        return {str(key): _arrays([row.get(key) for row in value]) for key in keys}
    if all(each is None or isinstance(each, int | float) for each in value):
        return np.array([np.nan if each is None else float(each) for each in value])
    rows = [_arrays(row) for row in value]
    if all(isinstance(row, np.ndarray) and row.ndim == 1 for row in rows) and len({*map(len, rows)}) == 1:
        return np.array(rows)
    return value if all(isinstance(each, str) for each in value) else rows
