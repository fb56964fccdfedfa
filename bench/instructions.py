"""Instructions of the kernel, counted by callgrind: what guards its speed where times cannot be trusted.

``instructions.c`` is compiled in its baseline form and run under valgrind, once for each of its parts. The
committed figures are in ``instructions.json``; ``python -m bench --instructions`` renews them. They hold for
the compiler and C library that are named there: another one may count otherwise, and is told apart.
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.cards import card_of
from bench.controller import DAMPER
from mrdamper.codegen.c_code import c_files
from mrdamper.codegen.target import target_of

__all__ = ["check", "renew"]

HERE = Path(__file__).parent
KERNEL = HERE.parent / "src" / "mrdamper" / "core" / "kernel"
COMMITTED = HERE / "instructions.json"
PARTS = ("simulate", "fit", "controller")
GROWTH = 1.10
FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
# The mathematics library chooses its functions by processor: here always those for the plainest one.
PLAIN = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}


def build(folder: Path, compiler: str = "gcc") -> Path:
    """Compile the program in a folder; return it."""
    target = target_of(card_of(DAMPER), content="controller", precision="double", name="guard")
    for name, text in c_files(target).items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    program = folder / "instructions"
    sources = [HERE / "instructions.c", folder / "guard.c", folder / "guard_tables.c"]
    _ran([compiler, *FLAGS, f"-I{KERNEL}", f"-I{folder}", *map(str, sources), "-o", str(program), "-lm"])
    return program


def count(program: Path, part: str, valgrind: str = "valgrind") -> int:
    """Return the instructions inside one part of the program."""
    out = program.with_name(f"{part}.callgrind")
    options = [f"--toggle-collect=part_{part}", f"--callgrind-out-file={out}"]
    _ran([valgrind, "--quiet", "--tool=callgrind", *options, str(program)])
    found = re.search(r"^(?:totals|summary): (\d+)", out.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise RuntimeError(f"callgrind wrote no total for {part}")
    return int(found[1])


def toolchain(compiler: str = "gcc") -> dict[str, str]:
    """Return what the counts depend on beside the sources."""
    version = _ran([compiler, "-dumpfullversion"]).strip()
    return {
        "compiler": f"{compiler} {version}",
        "library": " ".join(platform.libc_ver()),
        "machine": platform.machine(),
    }


def committed() -> dict[str, Any]:
    """Return the figures that the counts are held against."""
    kept: dict[str, Any] = json.loads(COMMITTED.read_text(encoding="utf-8"))
    return kept


def renew() -> None:
    """Count anew, print old and new, and write the committed figures."""
    found = _counted()
    COMMITTED.write_text(
        json.dumps({"toolchain": toolchain(), "instructions": found}, indent=1) + "\n", encoding="utf-8"
    )
    print(f"written: {COMMITTED}")


def check() -> str | None:
    """Count anew; return a message where a part takes more than ``GROWTH`` of the committed figure."""
    if toolchain() != committed()["toolchain"]:
        print(f"not compared: the counts are those of {committed()['toolchain']}, and this is {toolchain()}")
        return None
    kept, found = committed()["instructions"], _counted()
    grown = [part for part in PARTS if found[part] > GROWTH * kept[part]]
    meant = "if that is meant: python -m bench --instructions"
    return f"more than {GROWTH:g} x the instructions: {', '.join(grown)}; {meant}" if grown else None


def _counted() -> dict[str, int]:
    """Return the instructions of each part, printed beside the committed ones."""
    old = committed()["instructions"] if COMMITTED.is_file() else {}
    with tempfile.TemporaryDirectory(prefix="mrdamper-count-") as folder:
        program = build(Path(folder))
        found = {part: count(program, part) for part in PARTS}
    for part, instructions in found.items():
        before = f", was {old[part]:,} ({instructions / old[part]:.3f} x)" if part in old else ""
        print(f"{part}: {instructions:,} instructions{before}")
    return found


def _ran(command: Sequence[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **PLAIN})
    if done.returncode:
        raise RuntimeError(f"{command[0]} failed: {(done.stderr.splitlines() or ['no message'])[0]}")
    return done.stdout
