"""MAT files up to version 7.2, and texts of Octave. ``hdf5`` reads version 7.3."""

from __future__ import annotations

import io
import math
import re
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.lines.encodings import read_lines
from mrdamper.data.formats.table import FileOptions, Table, require_held
from mrdamper.data.formats.variables import table_of_variables
from mrdamper.errors import InputError


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
    """Return the columns of a MAT file. Objects of MATLAB classes are omitted."""
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatlabOpaque, varmats_from_mat

    # Each variable is read separately because SciPy returns no name and no size of an object.
    variables: dict[str, Any] = {}
    with path.open("rb") as stream:
        head = stream.read(84)
        stream.seek(0)
        parts = [("", io.BytesIO(stream.read()))] if _is_version_4(head) else varmats_from_mat(stream)
    part: Any  # whosmat and loadmat also read buffers, although the type stubs of SciPy allow only paths.
    for name, part in parts:
        with suppress(TypeError):  # whosmat fails for an object, which has no shape.
            for _, shape, _ in whosmat(part):
                count = math.prod(abs(int(n)) for n in shape)  # A size in a damaged file can be negative.
                require_held(count, 1, path, name)  # An element has at least one byte.
        part.seek(0)
        read = loadmat(part, simplify_cells=True)
        for key, value in read.items():
            if key.startswith("__"):
                continue
            is_object = isinstance(value, MatlabOpaque)
            variables[value.ravel()[0]["s0"].decode("utf-8", "replace") if is_object else key] = value
    return table_of_variables(variables, path, options, "MAT file")


def read_octave(path: Path, options: FileOptions) -> Table:
    """Return the columns of the matrices, ranges and numbers in a text of Octave."""
    variables: dict[str, Any] = {}
    for part in re.split(r"(?m)^# name: ", "\n".join(read_lines(path).lines))[1:]:
        name, kind, *lines = part.splitlines()
        rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
        if re.fullmatch("# type: (?:global )?(?:float )?(?:matrix|scalar)", kind):
            variables[name] = np.array(rows, dtype=np.float64)
        elif kind.endswith("range"):
            base, limit, step = map(float, rows[0][:3])
            variables[name] = np.arange(base, limit + 0.5 * step, step)
        elif kind.endswith("string"):
            variables[name] = " ".join(rows[0])
        else:
            raise InputError(place=path, found=f"{name!r} is of {kind[2:]!r}", remedy="Save with option -v7")
    return table_of_variables(variables, path, options, "text of Octave")
