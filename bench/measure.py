"""How the benchmarks measure: medians of interleaved repeats, and what machine they ran on.

A row may carry the figures that were asked for; they end a benchmark as a table of asked and measured. A peer
that is not installed keeps its row, as a gap; one that is quick and wrong keeps it too, without a ratio.
"""

from __future__ import annotations

import os
import platform
import resource
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

__all__ = [
    "Asked",
    "Row",
    "Timing",
    "absent",
    "asked_table",
    "cpu_clock",
    "judged",
    "machine",
    "table",
    "timed",
]

PACKAGES = ("mrdamper", "numpy", "scipy", "numba", "jax", "diffrax", "scikit-sundae", "pymoo", "pygad", "cma",
            "lmfit", "fmpy")  # fmt: skip
PROGRAMS = {
    **{"cc": "--version", "octave": "--version", "FreeFem++": "-nw", "ccx": "-v", "valgrind": "--version"},
    **{"arm-none-eabi-gcc": "--version", "qemu-system-arm": "--version"},
}


@dataclass(frozen=True, slots=True)
class Asked:
    """A figure that was asked for, and what was measured."""

    figure: str
    bar: float
    measured: float
    unit: str = "N"
    at_least: bool = False  # else at most

    @property
    def is_met(self) -> bool:
        return bool(self.measured >= self.bar if self.at_least else self.measured <= self.bar)


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a benchmark. ``ratio`` is to the first contender of the same kind.

    ``spread`` is the middle half of the repeats' CPU times over their median; ``error`` what a contender errs
    by, as a number; ``group`` the table that the row is in; ``state`` "" for a contender that counts,
    "absent" for one that could not run, "disqualified" for one less accurate than the problem asks.
    """

    contender: str
    cpu_s: float | None = None
    ns_per_sample: float | None = None
    ratio: float | None = None
    accuracy: str = ""
    bar: str = ""
    asked: tuple[Asked, ...] = ()
    group: str = ""
    wall_s: float | None = None
    spread: tuple[float, float] | None = None
    error: float | None = None
    state: str = ""

    def as_json(self) -> dict[str, object]:
        answer = {key: value for key, value in asdict(self).items() if value not in (None, "", ())}
        if self.asked:
            answer["asked"] = [asdict(each) | {"is_met": each.is_met} for each in self.asked]
        return answer


@dataclass(frozen=True, slots=True)
class Timing:
    """CPU and wall time [s] of a job, medians of its repeats, and the middle half of the CPU times."""

    cpu_s: float
    wall_s: float
    low_s: float
    high_s: float

    @property
    def spread(self) -> tuple[float, float]:
        """Lower and upper quartile over the median."""
        return (self.low_s / self.cpu_s, self.high_s / self.cpu_s) if self.cpu_s else (1.0, 1.0)


def cpu_clock() -> float:
    """Return the CPU time [s] of this process, its threads and the programs that it waited for."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in spent)


def timed(jobs: Mapping[str, Callable[[], object]], repeats: int = 7) -> dict[str, Timing]:
    """Return the times of each job, the jobs taking turns (A B A B); the first turn is not counted."""
    cpu: dict[str, list[float]] = {name: [] for name in jobs}
    wall: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(repeats + 1):
        for name, job in jobs.items():
            start, begin = time.perf_counter(), cpu_clock()
            job()
            if turn:
                cpu[name].append(cpu_clock() - begin)
                wall[name].append(time.perf_counter() - start)
    found = {}
    for name, times in cpu.items():
        low, _, high = statistics.quantiles(times, n=4, method="inclusive") if repeats > 1 else 3 * times
        found[name] = Timing(statistics.median(times), statistics.median(wall[name]), low, high)
    return found


def absent(contender: str, reason: object, group: str = "") -> Row:
    """Return the row of a contender that could not run: a gap that is seen."""
    return Row(contender, accuracy=f"absent: {reason}", group=group, state="absent")


def judged(row: Row, limit: float) -> Row:
    """Return the row as it is when its error is within the limit, else disqualified: without a ratio.

    An error that is not a number is not within any limit.
    """
    if row.error is None or row.error <= limit:
        return row
    said = f"{row.accuracy}; disqualified: more than {limit:.0e}"
    return replace(row, ratio=None, accuracy=said, state="disqualified")


def machine() -> dict[str, object]:
    """Return what the figures depend on."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line
        ]
        model = f"{names[0]} ({len(names)} logical)" if names else model
    from bench import peers
    from mrdamper.core import _kernel

    return {
        "processor": model,
        "system": platform.platform(),
        "python": sys.version.split()[0],
        "kernel": _kernel.level(),
        "load": round(os.getloadavg()[0], 1),
        "packages": {name: _version(name) for name in PACKAGES},
        "peers": peers.versions(),
        "programs": {name: _program(name, flag) for name, flag in PROGRAMS.items()},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def _program(name: str, flag: str) -> str:
    found = shutil.which(name)
    if found is None:
        return "absent"
    done = subprocess.run([found, flag], capture_output=True, text=True, check=False)
    lines = [line.strip() for line in done.stdout.splitlines() if any(map(str.isdigit, line))]
    return (lines or ["there"])[0]


def table(title: str, rows: list[Row]) -> str:
    """Return the rows as Markdown: one table for each group."""
    lines = [f"## {title}"]
    for group in dict.fromkeys(row.group for row in rows):
        chosen = [row for row in rows if row.group == group]
        lines += ["", *([f"{group}:", ""] if group else []), *_table(chosen)]
    return "\n".join(lines)


def _table(rows: list[Row]) -> list[str]:
    columns: dict[str, Callable[[Row], str]] = {
        "contender": lambda row: row.contender,
        "CPU s": lambda row: number(row.cpu_s),
        "middle half": lambda row: "" if row.spread is None else "{:.2f} to {:.2f} x".format(*row.spread),
        "wall s": lambda row: number(row.wall_s),
        "ns per sample": lambda row: number(row.ns_per_sample),
        "ratio": lambda row: "out" if row.state == "disqualified" else number(row.ratio),
        "accuracy": lambda row: row.accuracy,
        "bar": lambda row: row.bar,
    }
    cells = {name: [cell(row) for row in rows] for name, cell in columns.items()}
    shown = {name: each for name, each in cells.items() if name == "contender" or any(each)}
    body = zip(*shown.values(), strict=True)
    return [
        f"| {' | '.join(shown)} |",
        f"|{'---|' * len(shown)}",
        *("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in body),
    ]


def number(value: float | None) -> str:
    """Return a figure to three digits, "" for none."""
    return "" if value is None else f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def asked_table(rows: list[Row]) -> str:
    """Return what was asked, what was measured and whether that is enough, as a Markdown table."""
    asked = [each for row in rows for each in row.asked]
    if not asked:
        return ""
    lines = ["", "| figure | asked | measured | met |", "|---|---|---|---|"]
    for each in asked:
        side = "at least" if each.at_least else "at most"
        values = f"{side} {each.bar:.4g} {each.unit} | {each.measured:.4g} {each.unit}"
        lines.append(f"| {each.figure} | {values} | {'yes' if each.is_met else 'NO'} |")
    met = sum(each.is_met for each in asked)
    return "\n".join([*lines, "", f"{met} of {len(asked)} met"])
