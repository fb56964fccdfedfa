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

__all__ = ["FLAGS", "CompilerMissingError", "library", "peak_of_core", "pointer"]

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
    loaded = ctypes.CDLL(str(built))
    for name in ("peak_multiply_adds", "read_all"):
        getattr(loaded, name).restype = ctypes.c_double
    return loaded


def _call(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CompilerMissingError((done.stderr.splitlines() or ["the compiler failed"])[0])


def pointer(values: NDArray[np.float64] | NDArray[np.int64]) -> ctypes.c_void_p:
    """Return the address of a contiguous array, for a call; it keeps the array alive."""
    assert values.flags.c_contiguous
    return values.ctypes.data_as(ctypes.c_void_p)


def peak_of_core() -> tuple[float, float]:
    """Return a core's best: 1e9 flop/s of multiply-adds, 1e9 bytes/s read from its first cache."""
    from bench.measure import timed

    loaded, rounds, values = library(), 200_000, np.ones(2048)
    spent = timed(
        {
            "flops": lambda: loaded.peak_multiply_adds(ctypes.c_size_t(rounds), ctypes.c_double(0.999)),
            "bytes": lambda: loaded.read_all(ctypes.c_size_t(5000), ctypes.c_size_t(2048), pointer(values)),
        },
        repeats=5,
    )
    flops = 2.0 * 64 * rounds / spent["flops"].cpu_s
    return 1e-9 * flops, 1e-9 * 8.0 * 2048 * 5000 / spent["bytes"].cpu_s
