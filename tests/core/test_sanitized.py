"""The C code under the sanitizers and under every warning that it is promised to be free of."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

CORE = Path(__file__).parents[2] / "src" / "mrdamper" / "core"
WARNINGS = ["-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"]


def compile_with(compiler: Path, *arguments: str | Path) -> None:
    done = subprocess.run([compiler, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.nightly
def test_every_law_runs_clean_under_the_address_and_undefined_sanitizers(tool, tmp_path):
    """Random motions and coefficients to the ends of their ranges; one-sample records; strokes of 10 km."""
    compiler, program = tool("gcc"), tmp_path / "driver"
    flags = ["-std=c99", "-O1", "-g", "-ffp-contract=off", "-fno-omit-frame-pointer"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    source = Path(__file__).with_name("driver.c")
    compile_with(compiler, *flags, *sanitizers, f"-I{CORE / 'kernel'}", source, "-o", program, "-lm")
    done = subprocess.run([program], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "480 runs, 0 forces that are not finite" in done.stdout


@pytest.mark.nightly
@pytest.mark.parametrize("optimised", ["-O1", "-O3"])
def test_the_kernel_compiles_without_a_warning(tool, tmp_path, optimised):
    source = CORE / "kernel" / "kernel.c"
    compile_with(tool("gcc"), "-std=c99", optimised, *WARNINGS, "-c", source, "-o", tmp_path / "kernel.o")


@pytest.mark.parametrize("file", ["module.c", "single.c"])
def test_the_binding_compiles_without_a_warning(tool, tmp_path, file):
    include = sysconfig.get_paths()["include"]
    source = CORE / "binding" / file
    compile_with(
        tool("gcc"),
        "-std=c99",
        "-O2",
        "-DMRD_HAVE_X86_LEVELS",
        *WARNINGS,
        f"-isystem{include}",
        "-c",
        source,
        "-o",
        tmp_path / "module.o",
    )
