"""Run fuzzing targets: ``python -m fuzz [NAME ...] [-runs=N] [OPTION ...]``. Without a name, list them.

The name ``all`` runs every target. Arguments that begin with a dash are options of the fuzzer (libFuzzer or
atheris). The fuzzer stores its inputs in build/fuzz/NAME. An input that shows a fault is written to
build/fuzz/NAME.crash-*. When you fix the fault, copy this input to fuzz/corpus/NAME.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from typing import NoReturn

BUILD = Path("build/fuzz")
CORPUS = Path(__file__).with_name("corpus")
KERNEL = Path(__file__).parents[1] / "src/mrdamper/core/kernel"
PYTHON_TARGETS = ("text", "card", "channel-map")
TARGETS = ("kernel", *PYTHON_TARGETS)
INPUT_MAX_BYTES = 4096
COMPILE = (
    *("clang", "-std=c99", "-gline-tables-only", "-O1", "-ffp-contract=off", "-fno-omit-frame-pointer"),
    *("-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"),
    "-fno-sanitize-coverage=trace-cmp",  # Traced comparisons take half of the time, without benefit here.
)


def main(arguments: list[str]) -> int:
    """Run the requested targets; return 1 if one of them found a fault."""
    options = [argument for argument in arguments if argument.startswith("-")]
    names = [argument for argument in arguments if not argument.startswith("-")]
    names = list(TARGETS) if names == ["all"] else names
    if not names or not set(names) <= set(TARGETS):
        print("targets:", *TARGETS)
        return 2 if names else 0
    failed = [name for name in names if not run_target(name, options)]
    if failed:
        print(f"Faults found by {', '.join(failed)}. The inputs are in {BUILD}/.")
    return bool(failed)


def run_target(name: str, options: list[str]) -> bool:
    """Run one target in a separate process; return True if it found no fault."""
    inputs, log = BUILD / name, BUILD / f"{name}.log"
    inputs.mkdir(parents=True, exist_ok=True)
    for path in (CORPUS / name).glob("*"):
        shutil.copyfile(path, inputs / path.name)
    limits = [
        f"-max_len={INPUT_MAX_BYTES}",
        "-timeout=120",
        "-rss_limit_mb=4096",
        f"-artifact_prefix={inputs}.",
    ]
    words = [*limits, "-print_final_stats=1", *options, str(inputs)]
    with tempfile.TemporaryDirectory(prefix="mrdamper-fuzz-") as folder:
        process = os.fork()
        if process == 0:
            tempfile.tempdir = folder
            stream = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(stream, 1)
            os.dup2(stream, 2)
            try:
                _fuzz_kernel(words) if name == "kernel" else _fuzz_python(name, inputs, words)
            except BaseException:
                traceback.print_exc()
            # exit() of the C library calls the handler of the fuzzer, which saves the failing input.
            ctypes.CDLL(None).exit(1)
        status = os.waitpid(process, 0)[1]
    done = [line for line in log.read_text(errors="replace").splitlines() if line.startswith("Done ")]
    is_sound = status == 0 and bool(done)
    print(f"{name}: {done[-1] if is_sound else f'stopped, see {log}'}", flush=True)
    return is_sound


def _fuzz_kernel(words: list[str]) -> NoReturn:
    program = BUILD / "kernel.run"
    sources = [str(Path(__file__).with_name("laws.c")), str(KERNEL / "implicit_run.c")]
    subprocess.run([*COMPILE, f"-I{KERNEL}", *sources, "-o", str(program), "-lm"], check=True)
    seeds = BUILD / "kernel"
    for law in range(10):
        (seeds / f"seed-{law}").write_bytes(
            bytes([law, 4 * (law % 2), 9, *((37 * k) % 256 for k in range(600))])
        )
    os.execv(program, [str(program), *words])


def _fuzz_python(name: str, inputs: Path, words: list[str]) -> None:
    os.environ.setdefault("POLARS_MAX_THREADS", "1")
    import atheris

    sys.meta_path.insert(0, _SourceFinder)
    with atheris.instrument_imports(include=["mrdamper"]):
        targets = import_module("fuzz.targets")
    take, seeds = targets.TARGETS[name]
    for k, seed in enumerate(seeds()):
        (inputs / f"seed-{k}").write_bytes(seed)
    atheris.Setup([sys.argv[0], *words], take)
    atheris.Fuzz()


class _SourceFinder:
    """Find the package's modules in ``src``, because atheris cannot instrument an editable installation."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, _target: object = None) -> ModuleSpec | None:
        if name.partition(".")[0] != "mrdamper":
            return None
        folders = [str(Path(__file__).parents[1] / "src")] if path is None else path
        specs = (FileFinder(folder, (SourceFileLoader, [".py"])).find_spec(name) for folder in folders)
        return next((spec for spec in specs if spec is not None), None)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
