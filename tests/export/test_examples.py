"""Examples with exported code run: a bare Cortex-M at 1 kHz in QEMU, and a C++ program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mrdamper.codegen.target import target_of
from mrdamper.thermal.compact import compact_model
from mrdamper.thermal.drawing_file import read_drawing
from tests.export.exports import STRICT, card_of, ran, write
from tests.support.cards import DOUBLE
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "examples"
CORTEX_M = EXAMPLES / "cortex_m"
CORTEX = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
UNITS = ["damper.c", "damper_tables.c", "damper_thermal.c"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a folder with the C code of a target that has model, controller and thermal model."""
    target = replace(target_of(card_of(DOUBLE)), thermal=compact_model(read_drawing("paper")))
    return write(target, tmp_path_factory.mktemp("example") / "out")


def test_cortex_example_runs_at_one_kilohertz(folder, tool, tmp_path):
    """The program on the simulated board completes every step in time. Its outputs are correct.

    A timer interrupts the program every millisecond. QEMU executes 31 million instructions per second.
    """
    units = [str(folder / name) for name in UNITS]
    flags = [*STRICT, f"-I{folder}", f"-I{CORTEX_M}"]
    ran(
        tool("arm-none-eabi-gcc"), *CORTEX, *flags, "-nostartfiles", "-T", CORTEX_M / "board.ld",
        "-Wl,--gc-sections", CORTEX_M / "board.c", CORTEX_M / "loop.c", *units, "-o", tmp_path / "board",
    )  # fmt: skip
    done = [
        tool("qemu-system-arm"), "-M", "mps2-an386", "-nographic", "-icount", "shift=5,sleep=off",
        "-semihosting-config", "enable=on,target=native", "-kernel", str(tmp_path / "board"),
    ]  # fmt: skip
    board = ran("sh", "-c", '"$@" 2>&1', "sh", *done)
    ran(tool("gcc"), *flags, CORTEX_M / "host.c", CORTEX_M / "loop.c", *units, "-o", tmp_path / "host")
    assert board == ran(tmp_path / "host")
    steps, late = (int(each, 16) for each in board.split()[:2])
    assert (steps, late) == (3000, 0)


@pytest.mark.nightly
def test_compilers_give_identical_outputs(folder, tool, tmp_path):
    """The outputs are compared for GCC and Clang, each with and without optimisation."""
    sources = [CORTEX_M / "host.c", CORTEX_M / "loop.c", *(folder / name for name in UNITS)]
    printed = set()
    for compiler in ("gcc", "clang"):
        for level in ("-O0", "-O2"):
            flags = [*STRICT, level, f"-I{folder}", f"-I{CORTEX_M}"]
            ran(tool(compiler), *flags, *sources, "-o", tmp_path / "host")
            printed.add(ran(tmp_path / "host"))
    assert len(printed) == 1


@pytest.mark.parametrize("compiler", one_by_day(["g++", "clang++"]))
def test_cpp_example_runs_with_each_compiler(folder, tool, tmp_path, compiler):
    ran(tool("gcc"), "-std=c99", "-O2", "-c", *(folder / name for name in UNITS), cwd=tmp_path)
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-pedantic", "-Werror"]
    objects = [name.replace(".c", ".o") for name in UNITS]
    source = EXAMPLES / "controller.cpp"
    ran(tool(compiler), "-std=c++17", *warnings, f"-I{folder}", source, *objects, "-o", "user", cwd=tmp_path)
    printed = ran("./user", cwd=tmp_path)
    assert printed.startswith("largest command ")
    assert 0.1 < float(printed.split()[-1]) <= 2.0
