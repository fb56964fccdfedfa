"""Run a controller in C with given readings, compiled for this machine or for a bare Cortex-M in QEMU.

QEMU counts instructions (``-icount``) instead of clock cycles, so that the counts are reproducible. The
program needs no operating system: it has its own start-up code and linker script, and its only library
functions are memory copies.

The files of the kernel and the generated tables (``c_tables``) are compiled as one file, as in an export. The
compiler then treats the numbers as constants and removes unused branches.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.codegen.structs import Nested, Pointer, Table, Value, track_members
from mrdamper.control.config import compile_options
from mrdamper.control.controllers import ForceController

__all__ = [
    "BOARDS",
    "CLEAN",
    "Board",
    "Replay",
    "Sizes",
    "c_tables",
    "hash_of",
    "on_board",
    "on_host",
    "sizes",
]

KERNEL = Path(core.__file__).parent / "kernel"
SOURCES = Path(__file__).parent / "bare_metal"
CLEAN = (
    "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wcast-qual", "-pedantic",
    "-Werror",
)  # fmt: skip
"""Warnings under which the kernel and its tables compile without one."""

_TICKS_PER_INSTRUCTION = 1024.0 / 40.0  # In QEMU, an instruction takes 1024 ns and a timer tick takes 40 ns.


@dataclass(frozen=True, slots=True)
class Board:
    """A machine that QEMU simulates, and the compiler options for its processor."""

    machine: str
    flags: tuple[str, ...]


BOARDS = {
    "M4F": Board("mps2-an386", ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
    "M7": Board("mps2-an500", ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16")),
}


@dataclass(frozen=True, slots=True)
class Replay:
    """Instructions per step (only in QEMU, otherwise 0), stack size, and hash of the outputs."""

    least: float  # Instructions of the shortest step
    mean: float
    most: float
    longest_step: int
    stack_bytes: int  # Stack of the program that steps the controller
    hash: int  # hash of all commands and flags
    outside: int  # Number of steps whose command is NaN or outside its limits


def c_tables(controller: ForceController, *, single: bool = True) -> str:
    """Return C code that defines the values and tables of a controller as the constant ``track``."""
    kind, suffix = (np.float32, "f") if single else (np.float64, "")
    arrays: list[str] = []

    def number(value: float) -> str:
        return f"{float(kind(value)).hex()}{suffix}"

    def text(name: str, value: Value) -> str:
        if isinstance(value, Table):
            numbers = ", ".join(number(each) for each in np.ravel(value.values))
            arrays.append(f"static const mrd_real {name}[] = {{{numbers}}};\n")
            return name
        if isinstance(value, Nested):
            return struct(f"{name}_", value.members)
        if isinstance(value, Pointer):
            if value.members is None:
                return "NULL"
            arrays.append(f"static const {value.kind} {name} = {struct(f'{name}_', value.members)};\n")
            return f"&{name}"
        if isinstance(value, tuple):
            return f"{{{', '.join(map(str, value))}}}"
        return str(value) if isinstance(value, int) else number(value)

    def struct(prefix: str, members: Mapping[str, Value]) -> str:
        lines = (f".{name} = {text(prefix + name, value)}" for name, value in members.items())
        return "{\n    " + ",\n    ".join(lines) + "}"

    whole = struct("of_", track_members(controller))
    return "\n".join(
        [
            *(f"#define {name} {value}" for name, value in compile_options(controller.config).items()),
            '#include "controller.h"\n',
            *arrays,
            f"static const mrd_track track = {whole};\n",
        ]
    )


@dataclass(frozen=True, slots=True)
class Sizes:
    """Memory that a controller needs on a target [bytes]."""

    code: int
    tables: int
    stack: int  # Largest stack frame of a function, without the functions that it calls


def on_board(
    controller: ForceController, rows: FloatArray, board: Board, *, flags: tuple[str, ...] = ("-O2",)
) -> Replay:
    """Step a controller through rows (as in ``ForceController.run``) on a board in single precision."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write(controller, rows, place, single=True)
        linker = ("-nostartfiles", "-T", str(SOURCES / "mps2.ld"), "-Wl,--gc-sections")
        _compile(
            ("arm-none-eabi-gcc", *board.flags, *flags, "-ffunction-sections", *linker),
            place, len(rows), "startup.c", single=True,
        )  # fmt: skip
        said = _run(
            "qemu-system-arm", "-M", board.machine, "-nographic", "-icount", "shift=10",
            "-semihosting-config", "enable=on,target=native", "-kernel", str(place / "replay"),
        )  # fmt: skip
    return _read(said, len(rows))


def on_host(
    controller: ForceController,
    rows: FloatArray,
    *,
    single: bool = True,
    flags: tuple[str, ...] = ("-O2",),
    compiler: str = "gcc",
) -> Replay:
    """Step a controller through rows on this machine. ``flags`` are compiler options (sanitizers)."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write(controller, rows, place, single=single)
        _compile((compiler, *flags), place, len(rows), "host.c", single=single)
        said = _run(str(place / "replay"))
    return _read(said, len(rows))


def hash_of(command: FloatArray, flags: NDArray[np.int64], *, single: bool = True) -> int:
    """Return the hash of commands and flags, computed as in ``replay.c``."""
    columns = [("command", np.float32 if single else np.float64), ("flags", np.int32)]
    rows = np.empty(len(command), dtype=columns)
    rows["command"], rows["flags"] = command, flags
    out = 0xCBF29CE484222325
    for byte in rows.tobytes():
        out = (out ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return out


def sizes(controller: ForceController, board: Board, *, flags: tuple[str, ...] = ("-O2",)) -> Sizes:
    """Compile for a board and return the sizes of code, tables and largest stack frame [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write(controller, np.empty((0, 5)), place, single=True)
        out = place / "one.o"
        _run(
            "arm-none-eabi-gcc", *board.flags, *flags, "-std=c99", "-DMRD_SINGLE", "-fstack-usage",
            f"-I{KERNEL}", f"-I{place}", "-c", str(SOURCES / "one.c"), "-o", str(out),
        )  # fmt: skip
        symbols = [line.split() for line in _run("arm-none-eabi-nm", "-S", str(out)).splitlines()]
        held = [(kind.lower(), int(size, 16)) for _, size, kind, _ in (s for s in symbols if len(s) == 4)]
        stacks = [int(line.split()[1]) for line in out.with_suffix(".su").read_text().splitlines()]
    code, tables = (sum(size for kind, size in held if kind == wanted) for wanted in "tr")
    return Sizes(code, tables, max(stacks))


def _write(controller: ForceController, rows: FloatArray, place: Path, *, single: bool) -> None:
    (place / "tables.c").write_text(c_tables(controller, single=single), encoding="utf-8")
    np.ascontiguousarray(rows, dtype=np.float32 if single else np.float64).tofile(place / "rows.bin")


def _compile(command: tuple[str, ...], place: Path, steps: int, machine: str, *, single: bool) -> None:
    number = ("-DMRD_SINGLE",) if single else ()
    files = [SOURCES / name for name in (machine, "replay.c", "rows.S", "one.c")]
    _run(
        *command, "-std=c99", "-ffp-contract=off", *number, f"-DSTEPS={steps}", f"-I{KERNEL}",
        f"-I{place}", f"-Wa,-I{place}", *map(str, files), "-o", str(place / "replay"),
    )  # fmt: skip


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout or done.stderr  # The board in QEMU prints to standard error.


def _read(said: str, steps: int) -> Replay:
    least, total, most, which, stack, bits, outside = map(int, said.split())
    each = _TICKS_PER_INSTRUCTION
    return Replay(least / each, total / each / steps, most / each, which, stack, bits, outside)
