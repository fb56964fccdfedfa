"""Start-up: CPU of a fresh process, the bare interpreter's taken off."""

from __future__ import annotations

import resource
import subprocess
import sys
from functools import partial
from statistics import median

from bench.measure import Row

__all__ = ["run"]

JOBS = {
    "python -c pass": ["-c", "pass"],
    "import mrdamper": ["-c", "import mrdamper"],
    "mrdamper --help": [
        "-c",
        "import sys; sys.argv = ['mrdamper', '--help']; from mrdamper.app.cli import main; main()",
    ],
}
BARS = {"import mrdamper": "30 ms beside the interpreter", "mrdamper --help": "200 ms"}


def _cpu(arguments: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *arguments], check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run() -> list[Row]:
    """Return CPU of starting; the import is net of the interpreter, the command is whole."""
    spent: dict[str, list[float]] = {name: [] for name in JOBS}
    failed: dict[str, str] = {}
    for turn in range(12):
        for name, job in {name: partial(_cpu, arguments) for name, arguments in JOBS.items()}.items():
            try:
                value = job()
            except RuntimeError as fault:
                failed[name] = str(fault)
                continue
            if turn:
                spent[name].append(value)
    bare = median(spent["python -c pass"])
    rows = []
    for name, times in spent.items():
        if name in failed:
            rows.append(Row(name, accuracy=f"did not run: {failed[name]}", bar=BARS.get(name, "")))
            continue
        cpu = median(times) - (bare if name.startswith("import") else 0.0)
        rows.append(Row(name, cpu, ratio=median(times) / bare, bar=BARS.get(name, "")))
    return rows
