"""A controller's C, built for this machine or a bare Cortex-M under QEMU, and stepped through given readings.

QEMU counts instructions (``-icount``): the figures repeat exactly, and they are not cycles. Code and readings
are those of a target without a system: own start-up, own linker script, no library but memory copies. What is
compiled are the kernel's own files; only the tables are generated (``c_tables``).
"""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper import core
from mrdamper.control.controllers import ForceController
from mrdamper.quantities import FloatArray

__all__ = ["BOARDS", "CLEAN", "Board", "Replay", "c_tables", "on_board", "on_host", "sizes", "stack_usage"]

KERNEL = Path(core.__file__).parent / "kernel"
SOURCES = Path(__file__).parent / "bare_metal"
CLEAN = (
    "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wcast-qual", "-pedantic", "-Werror",
)  # fmt: skip
"""Warnings under which the kernel and its tables compile without one."""

_TICKS_PER_INSTRUCTION = 1024.0 / 40.0  # 2^10 ns an instruction, a timer of 25 MHz
_OCTAVES = (
    "loading", "unloading", "from_loading", "from_unloading", "from_unloaded", "viscous", "sliding",
    "breakaway", "built_up",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Board:
    """A machine that QEMU has, and how to compile for its processor."""

    machine: str
    flags: tuple[str, ...]


BOARDS = {
    "M4F": Board("mps2-an386", ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
    "M7": Board("mps2-an500", ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16")),
}


@dataclass(frozen=True, slots=True)
class Replay:
    """What a replay says. Instructions are zero on the host, where none are counted."""

    least: float  # instructions of the shortest step
    mean: float
    most: float
    longest_step: int
    stack_bytes: int  # of everything, the replay included
    hash: int  # of the bits of all commands and flags
    outside: int  # steps whose command is no number within 0 and the largest


def c_tables(controller: ForceController, *, single: bool = True) -> str:
    """Return C that defines the constant ``track``: a controller's numbers and tables.

    The one place to change when the export room writes them.
    """
    kind = np.float32 if single else np.float64
    suffix = "f" if single else ""

    def number(value: float) -> str:
        return f"{float(kind(value)).hex()}{suffix}"

    def array(name: str, values: FloatArray) -> str:
        body = ", ".join(number(value) for value in np.ravel(values))
        return f"static const mrd_real {name}[{values.size}] = {{{body}}};\n"

    tables = controller.tables
    out = ['#include "controller.h"\n\nextern const mrd_track track;\n']
    out += [array("currents", tables.currents), array("factors", tables.factor), array("columns", tables.column)]
    out += [array(f"{name}_cells", o.cell) for name, o in zip(_OCTAVES, tables.octaves, strict=True)]
    fields = [f".{name} = {number(value)}" for name, value in controller.numbers.items()]
    fields += [f".currents = {len(tables.currents)}", f".pieces = {len(tables.factor)}"]
    fields += [f".levels = {tables.levels}", ".current = currents", ".factor = factors", ".column = columns"]
    fields.append(f".eighth = {{{', '.join(map(str, tables.eighths))}}}")
    fields.append(f".row = {{{', '.join(map(str, tables.rows))}}}")
    fields.append(f".begin = {{{', '.join(map(str, tables.begin))}}}")
    for name, o in zip(_OCTAVES, tables.octaves, strict=True):
        head = f"{number(o.offset)}, {number(o.top)}, {o.bits}, {len(o.cell)}"
        fields.append(f".{name} = {{{head}, {name}_cells}}")
    out.append("const mrd_track track = {\n    " + ",\n    ".join(fields) + "};\n")
    return "\n".join(out)


def on_board(
    controller: ForceController, rows: FloatArray, board: Board, *, flags: tuple[str, ...] = ("-O2",)
) -> Replay:
    """Return what a bare processor makes of the rows (as ``ForceController.run`` takes them), in float."""
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
    """Return what this machine makes of the rows, in float or double; ``flags`` may ask for sanitizers."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write(controller, rows, place, single=single)
        _compile((compiler, *flags), place, len(rows), "host.c", single=single)
        said = _run(str(place / "replay"))
    return _read(said, len(rows))


def sizes(controller: ForceController, board: Board, *, flags: tuple[str, ...] = ("-O2",)) -> dict[str, int]:
    """Return bytes of code (with its constants) and of tables on a board."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write(controller, np.empty((0, 5)), place, single=True)
        found = {}
        for name, source in (("code", KERNEL / "controller.c"), ("tables", place / "tables.c")):
            compile_one = ("arm-none-eabi-gcc", *board.flags, *flags, "-std=c99", "-DMRD_SINGLE", "-c")
            _run(*compile_one, f"-I{KERNEL}", str(source), "-o", str(place / f"{name}.o"))
            words = _run("arm-none-eabi-size", str(place / f"{name}.o")).splitlines()[1].split()
            found[name] = int(words[0]) + int(words[1])
    return found


def stack_usage(board: Board, *, flags: tuple[str, ...] = ("-O2",)) -> dict[str, int]:
    """Return bytes of stack of each function that the compiler left, its callees not counted."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "controller.o"
        _run(
            "arm-none-eabi-gcc", *board.flags, *flags, "-std=c99", "-DMRD_SINGLE", "-fstack-usage", "-c",
            str(KERNEL / "controller.c"), "-o", str(out),
        )  # fmt: skip
        lines = out.with_suffix(".su").read_text(encoding="utf-8").splitlines()
    return {line.split()[0].rpartition(":")[2]: int(line.split()[1]) for line in lines}


def _write(controller: ForceController, rows: FloatArray, place: Path, *, single: bool) -> None:
    (place / "tables.c").write_text(c_tables(controller, single=single), encoding="utf-8")
    np.ascontiguousarray(rows, dtype=np.float32 if single else np.float64).tofile(place / "rows.bin")


def _compile(command: tuple[str, ...], place: Path, steps: int, machine: str, *, single: bool) -> None:
    number = ("-DMRD_SINGLE",) if single else ()
    files = [SOURCES / machine, SOURCES / "replay.c", SOURCES / "rows.S", KERNEL / "controller.c"]
    _run(
        *command, "-std=c99", "-ffp-contract=off", *number, f"-DSTEPS={steps}", f"-I{KERNEL}",
        f"-Wa,-I{place}", *map(str, files), str(place / "tables.c"), "-o", str(place / "replay"),
    )  # fmt: skip


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout or done.stderr  # where QEMU puts what the board says


def _read(said: str, steps: int) -> Replay:
    least, total, most, which, stack, bits, outside = map(int, said.split())
    each = _TICKS_PER_INSTRUCTION
    return Replay(least / each, total / each / steps, most / each, which, stack, bits, outside)
