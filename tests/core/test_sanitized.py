"""The C code of kernel and binding compiles without warnings."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

CORE = Path(__file__).parents[2] / "src" / "mrdamper" / "core"
WARNINGS = ["-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"]


def compile_with(compiler: Path, *arguments: str | Path) -> None:
    done = subprocess.run([compiler, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.nightly
@pytest.mark.parametrize("optimised", ["-O1", "-O3"])
@pytest.mark.parametrize("file", ["kernel.c", "implicit_run.c"])
def test_kernel_compiles_without_warning(tool, tmp_path, file, optimised):
    source = CORE / "kernel" / file
    compile_with(tool("gcc"), "-std=c99", optimised, *WARNINGS, "-c", source, "-o", tmp_path / "kernel.o")


@pytest.mark.nightly
@pytest.mark.parametrize("file", ["levels.c", "steps.c", "closed_loop.c", "single.c"])
def test_python_binding_compiles_without_warning(tool, tmp_path, file):
    options = ["-DMRD_SINGLE"] if file == "single.c" else ["-DMRD_HAVE_X86_LEVELS"]
    source, include = CORE / "binding" / file, f"-I{CORE / 'kernel'}"
    compile_with(
        tool("gcc"), "-std=c99", "-O2", *options, *WARNINGS, include, "-c", source, "-o", tmp_path / "part.o"
    )
