"""The hand-written C contenders (``reference.c``, ``rk4.c``), compiled for this machine when asked for.

``-O3 -march=native -ffast-math``, which the kernel never has; linked without the latter, since a library so
linked would switch the arithmetic of the whole process.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["FLAGS", "CompilerMissingError", "library", "pointer"]

HERE = Path(__file__).parent
FLAGS = ("-O3", "-march=native", "-ffast-math")


class CompilerMissingError(RuntimeError):
    """There is no C compiler, or it does not take the sources."""


@cache
def library() -> ctypes.CDLL:
    """Return the compiled contenders.

    Raises
    ------
    CompilerMissingError
        No compiler, or it failed.
    """
    compiler = next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)
    if compiler is None:
        raise CompilerMissingError("no C compiler (cc, gcc or clang)")
    folder = HERE.parent / "build" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    built = folder / "contenders.so"
    objects = []
    for name in ("reference", "rk4"):
        objects.append(str(folder / f"{name}.o"))
        _call(compiler, *FLAGS, "-fPIC", "-std=c99", "-c", str(HERE / f"{name}.c"), "-o", objects[-1])
    _call(compiler, "-shared", *objects, "-o", str(built), "-lm")
    return ctypes.CDLL(str(built))


def _call(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CompilerMissingError((done.stderr.splitlines() or ["the compiler failed"])[0])


def pointer(values: NDArray[np.float64] | NDArray[np.int64]) -> ctypes.c_void_p:
    """Return the address of a contiguous array, for a call; it keeps the array alive."""
    assert values.flags.c_contiguous
    return values.ctypes.data_as(ctypes.c_void_p)
