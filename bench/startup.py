"""Start-up: CPU of a fresh process, the bare interpreter's taken off an import; other libraries beside it."""

from __future__ import annotations

import resource
import subprocess
import sys
from functools import partial
from statistics import median, quantiles

from bench.measure import Asked, Row, absent

__all__ = ["run"]

JOBS = {
    "python -c pass": ["-c", "pass"],
    "import mrdamper": ["-c", "import mrdamper"],
    "mrdamper --help": [
        "-c",
        "import sys; sys.argv = ['mrdamper', '--help']; from mrdamper.app.cli import main; main()",
    ],
}
PEERS = ("scipy.integrate", "control", "sysidentpy", "pybamm", "pybop", "jax", "numba", "diffrax")
MOST_S = {"import mrdamper": 0.030, "mrdamper --help": 0.200}


def _cpu(arguments: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *arguments], check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run() -> list[Row]:
    """Return CPU of starting; an import is net of the interpreter, the command is whole."""
    jobs = JOBS | {f"import {name}": ["-c", f"import {name}"] for name in PEERS}
    spent: dict[str, list[float]] = {name: [] for name in jobs}
    failed: dict[str, str] = {}
    for turn in range(8):
        for name, job in {name: partial(_cpu, arguments) for name, arguments in jobs.items()}.items():
            if name in failed:
                continue
            try:
                value = job()
            except RuntimeError as fault:
                failed[name] = str(fault)
                continue
            if turn:
                spent[name].append(value)
    bare = median(spent["python -c pass"])
    return [absent(name, failed[name]) if name in failed else _row(name, spent[name], bare) for name in jobs]


def _row(name: str, times: list[float], bare: float) -> Row:
    less = bare if name.startswith("import") else 0.0
    cpu = median(times) - less
    low, _, high = quantiles(times, n=4, method="inclusive")
    spread = ((low - less) / cpu, (high - less) / cpu) if cpu > 0.0 else None
    most = MOST_S.get(name)
    asked = () if most is None else (Asked(f"{name}, CPU", 1e3 * most, 1e3 * cpu, "ms"),)
    return Row(name, cpu, ratio=median(times) / bare, asked=asked, spread=spread)
