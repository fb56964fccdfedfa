"""MAT files up to version 7.2, and text files of Octave (``save -text``). ``hdf5`` reads version 7.3."""

from __future__ import annotations

import io
import math
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.table import FileOptions, Table, require_held
from mrdamper.data.formats.variables import table_of_variables

# Smallest size of an element by kind [bytes]. A number has at least one byte.
_LEAST_BYTES = dict.fromkeys(("struct", "cell", "object"), 8)


def is_mat(head: bytes) -> bool:
    """Return True if the first bytes are the signature of a MAT file of version 4 to 7.2."""
    return (head.startswith(b"MATLAB ") and not head.startswith(b"MATLAB 7.3")) or _is_version_4(head)


def _is_version_4(head: bytes) -> bool:
    """Return True if the first bytes are a header of version 4: type, shape, and a name that ends in zero."""
    for order in "<>":
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[:20].ljust(20, b"\xff"))
        name = head[20 : 20 + length] if 1 < length <= 64 else b""
        if kind % 1000 in range(53) and kind < 5000 and imaginary in {0, 1} and min(rows, columns) >= 0:
            return re.fullmatch(rb"[A-Za-z]\w*\0", name) is not None
    return False


def read_mat(path: Path, options: FileOptions) -> Table:
    """Return the columns of a MAT file. Objects of MATLAB classes are omitted.

    Each variable is read separately because SciPy returns no name and no size of an object.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatlabOpaque, varmats_from_mat

    variables: dict[str, Any] = {}
    with path.open("rb") as stream:
        head = stream.read(84)
        stream.seek(0)
        parts = [("", io.BytesIO(stream.read()))] if _is_version_4(head) else varmats_from_mat(stream)
    part: Any  # whosmat and loadmat also read buffers, although the type stubs of SciPy allow only paths.
    for name, part in parts:
        with suppress(TypeError):  # whosmat fails for an object, which has no shape.
            for _, shape, kind in whosmat(part):
                count = math.prod(abs(int(n)) for n in shape)  # A size in a damaged file can be negative.
                require_held(count, _LEAST_BYTES.get(kind, 1), path, name)
        part.seek(0)
        read = loadmat(part, simplify_cells=True)
        for key, value in read.items():
            if key.startswith("__"):
                continue
            is_object = isinstance(value, MatlabOpaque)
            variables[value.ravel()[0]["s0"].decode("utf-8", "replace") if is_object else key] = value
    return table_of_variables(variables, path, options, "MAT file")


def read_octave(path: Path, options: FileOptions) -> Table:
    """Return the variables of a text file of Octave as columns."""
    lines = iter(path.read_text(encoding="utf-8").splitlines())
    variables: dict[str, Any] = {}
    while name := _tag(lines, "name"):
        variables[name] = _value(lines)
    return table_of_variables(variables, path, options, "Octave text")


def _tag(lines: Iterator[str], key: str) -> str:
    """Return the value in the next line ``# key: value``, "" at the end of the file."""
    begin = f"# {key}:"
    return next((line.removeprefix(begin).strip() for line in lines if line.startswith(begin)), "")


def _value(lines: Iterator[str]) -> Any:  # noqa: ANN401 - any value
    """Return the next value in the file: a variable, a cell element or a structure field."""
    kind = _tag(lines, "type")
    if kind.endswith("string"):
        texts = [next(lines) for _ in range(int(_tag(lines, "elements"))) if _tag(lines, "length")]
        return texts[0] if len(texts) == 1 else texts
    if kind == "cell":
        count = int(_tag(lines, "rows")) * int(_tag(lines, "columns"))
        return [_value(lines) for _ in range(count) if _tag(lines, "name")]
    if kind == "scalar struct":
        return {_tag(lines, "name"): _value(lines) for _ in range(int(_tag(lines, "length")))}
    if kind == "matrix":
        rows, columns = int(_tag(lines, "rows")), int(_tag(lines, "columns"))
        return np.array([next(lines).split() for _ in range(rows)], dtype=np.float64).reshape(rows, columns)
    return float(next(lines)) if kind in {"scalar", "bool"} else None
