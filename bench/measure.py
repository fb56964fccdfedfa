"""How the benchmarks measure: interleaved turns, told as medians between their minimum and maximum.

A row may carry the figures that were asked for; they end a benchmark as a table of asked, measured and met. A
peer that is not installed keeps its row, as a gap; one that is quick and wrong keeps it too, without a ratio.
"""

from __future__ import annotations

import os
import platform
import resource
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

from mrdamper.core import _kernel

__all__ = [
    "Asked",
    "Row",
    "Timing",
    "absent",
    "asked_table",
    "cpu_clock",
    "judged",
    "machine",
    "side_by_side",
    "table",
    "timed",
]

PACKAGES = ("numpy", "scipy", "numba", "pymoo")


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
class Timing:
    """CPU and wall time [s] of a job in each of its turns."""

    cpu: tuple[float, ...]
    wall: tuple[float, ...]

    @classmethod
    def of(cls, turns: Sequence[tuple[float, float]]) -> Timing:
        """Return the times of turns, each its CPU and wall time [s]."""
        return cls(tuple(cpu for cpu, _ in turns), tuple(wall for _, wall in turns))

    @property
    def cpu_s(self) -> float:
        return median(self.cpu)

    @property
    def wall_s(self) -> float:
        return median(self.wall)

    def over(self, other: Timing, share: float = 1.0) -> tuple[float, ...]:
        """Return the CPU time of each turn over another job's in that turn, which did ``share`` as much."""
        return tuple(share * mine / theirs for mine, theirs in zip(self.cpu, other.cpu, strict=True))


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a benchmark.

    ``ratios`` are, turn by turn, to the first contender of the same group (the table that the row is in);
    ``error`` is what a contender errs by, as a number; ``state`` "" for a contender that counts, "absent" for
    one that could not run, "disqualified" for one less accurate than the problem asks.
    """

    contender: str
    timing: Timing | None = None
    ns_per_sample: float | None = None
    ratios: tuple[float, ...] = ()
    accuracy: str = ""
    asked: tuple[Asked, ...] = ()
    group: str = ""
    error: float | None = None
    state: str = ""


def cpu_clock() -> float:
    """Return the CPU time [s] of this process, its threads and the programs that it waited for."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in spent)


def timed(jobs: Mapping[str, Callable[[], object]], repeats: int = 5) -> dict[str, Timing]:
    """Return the times of each job, the jobs taking turns (A B A B); the first turn is not counted."""
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in jobs}
    for _ in range(repeats + 1):
        for name, job in jobs.items():
            start, begin = time.perf_counter(), cpu_clock()
            job()
            spent[name].append((cpu_clock() - begin, time.perf_counter() - start))
    return {name: Timing.of(turns[1:]) for name, turns in spent.items()}


def side_by_side(
    group: str, jobs: Mapping[str, Callable[[], object]], samples: Mapping[str, int], repeats: int = 5
) -> list[Row]:
    """Return a timed row of each job; time per sample is what is compared with the first."""
    spent = timed(jobs, repeats)
    first = next(iter(spent))
    return [
        Row(
            name,
            each,
            1e9 * each.cpu_s / samples[name],
            each.over(spent[first], samples[first] / samples[name]),
            group=group,
        )
        for name, each in spent.items()
    ]


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
    return replace(row, ratios=(), accuracy=said, state="disqualified")


def machine() -> str:
    """Return what the figures depend on."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line
        ]
        model = f"{names[0]} ({len(names)} logical)" if names else model
    packages = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    python = f"Python {platform.python_version()} on {sys.platform}"
    return f"{model}, kernel {_kernel.level()}, load {os.getloadavg()[0]:.1f}; {python}, {packages}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def table(title: str, rows: Sequence[Row]) -> str:
    """Return the rows as Markdown: one table for each group."""
    lines = [f"## {title}"]
    for group in dict.fromkeys(row.group for row in rows):
        chosen = [row for row in rows if row.group == group]
        lines += ["", *([f"{group}:", ""] if group else []), *_table(chosen)]
    return "\n".join(lines)


def _table(rows: Sequence[Row]) -> list[str]:
    columns: dict[str, Callable[[Row], str]] = {
        "contender": lambda row: row.contender,
        "CPU s": lambda row: _spread(row.timing.cpu) if row.timing else "",
        "wall s": lambda row: _number(row.timing.wall_s) if row.timing else "",
        "ns per sample": lambda row: "" if row.ns_per_sample is None else _number(row.ns_per_sample),
        "ratio": lambda row: "out" if row.state == "disqualified" else _spread(row.ratios),
        "accuracy": lambda row: row.accuracy,
    }
    cells = {name: [cell(row) for row in rows] for name, cell in columns.items()}
    shown = {name: each for name, each in cells.items() if name == "contender" or any(each)}
    body = zip(*shown.values(), strict=True)
    return [
        f"| {' | '.join(shown)} |",
        f"|{'---|' * len(shown)}",
        *("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in body),
    ]


def _number(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def _spread(values: Sequence[float]) -> str:
    """Return a median with the minimum and the maximum of all turns, to three digits."""
    if not values or min(values) == max(values):
        return _number(values[0]) if values else ""
    return f"{_number(median(values))} ({_number(min(values))} to {_number(max(values))})"


def asked_table(rows: Sequence[Row]) -> str:
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
