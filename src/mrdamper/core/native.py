"""Access to compiled extensions, choice of the instruction set, and C pointers."""

from __future__ import annotations

from itertools import count, takewhile
from typing import Any, Final

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.core._kernel import ffi as double_ffi
from mrdamper.core._kernel import lib as double_lib
from mrdamper.core._single import ffi as single_ffi
from mrdamper.core._single import lib as single_lib

__all__ = ["DOUBLE", "SINGLE", "Build", "doubles", "ffi", "level", "levels", "lib", "use_level"]


class Build:
    """The C extension for float or double; ``api`` has the functions in use."""

    __slots__ = ("api", "ffi", "levels", "lib", "real", "state", "state_size")

    def __init__(self, ffi: Any, lib: Any, real: type[np.floating[Any]]) -> None:  # noqa: ANN401 made by cffi
        self.ffi, self.lib, self.real = ffi, lib, real
        self.state = self.ffi.typeof("mrd_track_state *")
        self.state_size = self.ffi.sizeof(self.state.item)
        found = takewhile(bool, map(self.lib.mrd_level, count()))
        self.levels: dict[str, Any] = {self.ffi.string(api.name).decode(): api for api in found}
        self.api = [*self.levels.values()][-1]


DOUBLE: Final = Build(double_ffi, double_lib, np.float64)
SINGLE: Final = Build(single_ffi, single_lib, np.float32)
ffi: Any = DOUBLE.ffi
lib: Any = DOUBLE.lib

_FLOAT64 = np.dtype(np.float64)
_DOUBLES = ffi.typeof("double[]")


def levels() -> tuple[str, ...]:
    """Return the instruction sets that this machine can run, slowest first."""
    return tuple(DOUBLE.levels)


def level() -> str:
    """Return the instruction set in use."""
    return next(name for name, api in DOUBLE.levels.items() if api == DOUBLE.api)


def use_level(name: str) -> None:
    """Use an instruction set for all later calls (tests and benchmarks).

    Raises
    ------
    ValueError
        If the machine or the compiled extension does not support this instruction set.
    """
    if name not in DOUBLE.levels:
        raise ValueError(f"this machine or build has no instruction set level {name!r}")
    DOUBLE.api = DOUBLE.levels[name]


def doubles(array: FloatArray, name: str, *, write: bool = False) -> Any:  # noqa: ANN401 - a pointer of cffi
    """Return a ``double *`` to an array. The pointer keeps the array alive.

    Raises
    ------
    TypeError
        If the numbers are not float64.
    ValueError
        If the array is not contiguous, or if it is read-only but C writes to it.
    """
    # Comparison with ``is`` is twice as fast as ``==``. It fails for an array that was unpickled, because its
    # dtype is a copy of np.float64's dtype.
    dtype = array.dtype
    if dtype is not _FLOAT64 and dtype != _FLOAT64:
        raise TypeError(f"{name} must be contiguous float64")
    return ffi.from_buffer(_DOUBLES, array, write)
