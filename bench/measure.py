"""Measure CPU times for the benchmarks, and print the results as tables.

The compared jobs run alternately (A B A B), because the speed of the machine varies. Tables contain median,
minimum and maximum. Rows can have limits. Then a table of all limits and measured values is printed last. A
program that is not installed has a row without values.
"""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

from mrdamper import core

REPEATS = 5
PACKAGES = ("numpy", "scipy", "pymoo")


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit of a measured quantity, and the measured value."""

    quantity: str
    limit: float
    measured: float
    unit: str = "N"
    is_minimum: bool = False

    @property
    def is_met(self) -> bool:
        return self.measured >= self.limit if self.is_minimum else self.measured <= self.limit


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a benchmark.

    Attributes
    ----------
    cpu_s : CPU time of each repetition [s]
    ratios : CPU time of each repetition divided by the CPU time of the first program of the group
    """

    contender: str
    cpu_s: tuple[float, ...] = ()
    ns_per_sample: float | None = None
    ratios: tuple[float, ...] = ()
    accuracy: str = ""
    limits: tuple[Limit, ...] = ()
    group: str = ""


def timed(jobs: Mapping[str, Callable[[], object]], repeats: int = REPEATS) -> dict[str, tuple[float, ...]]:
    """Run jobs alternately; return the CPU times [s] of each job without the first."""
    spent: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repeats + 1):
        for name, job in jobs.items():
            begin = time.process_time()
            job()
            spent[name].append(time.process_time() - begin)
    return {name: tuple(turns[1:]) for name, turns in spent.items()}


def ratios_of(mine: Sequence[float], other: Sequence[float], work: float = 1.0) -> tuple[float, ...]:
    """Return ``work`` times the ratio of the CPU times of two jobs in each repetition."""
    return tuple(work * a / b for a, b in zip(mine, other, strict=True))


def side_by_side(
    group: str, jobs: Mapping[str, Callable[[], object]], samples: Mapping[str, int]
) -> list[Row]:
    """Measure jobs; return a row for each job with ratios relative to the first job."""
    spent = timed(jobs)
    first = next(iter(spent))
    return [
        Row(
            name,
            turns,
            1e9 * median(turns) / samples[name],
            ratios_of(turns, spent[first], samples[first] / samples[name]),
            group=group,
        )
        for name, turns in spent.items()
    ]


def absent(contender: str, reason: object, group: str = "") -> Row:
    """Return the row of a program that could not be run."""
    return Row(contender, accuracy=f"absent: {reason}", group=group)


def machine() -> str:
    """Return the conditions of a measurement: processor, load, and versions of programs and libraries."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        lines = [line for line in info.read_text().splitlines() if "model name" in line]
        model = f"{lines[0].partition(': ')[2]} ({len(lines)} logical)" if lines else model
    packages = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    python = f"Python {platform.python_version()} on {sys.platform}"
    return f"{model}, kernel {core.level()}, load {os.getloadavg()[0]:.1f}; {python}, {packages}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def table(title: str, rows: Sequence[Row]) -> str:
    """Return the rows as Markdown, one table for each group."""
    lines = [f"## {title}"]
    for group in dict.fromkeys(row.group for row in rows):
        lines += ["", *([f"{group}:", ""] if group else [])]
        lines += ["| contender | CPU s | ns per sample | ratio | accuracy |", "|---|---|---|---|---|"]
        for row in rows:
            if row.group == group:
                ns = "" if row.ns_per_sample is None else _number(row.ns_per_sample)
                cells = (row.contender, _spread(row.cpu_s), ns, _spread(row.ratios), row.accuracy)
                lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _number(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def _spread(values: Sequence[float]) -> str:
    if not values or min(values) == max(values):
        return _number(values[0]) if values else ""
    return f"{_number(median(values))} ({_number(min(values))} to {_number(max(values))})"


def limit_table(rows: Sequence[Row]) -> str:
    """Return a Markdown table of the limits, the measured values, and the results (met or not met)."""
    limits = [limit for row in rows for limit in row.limits]
    if not limits:
        return ""
    lines = ["", "| quantity | limit | measured | met |", "|---|---|---|---|"]
    for each in limits:
        side = "at least" if each.is_minimum else "at most"
        values = f"{side} {each.limit:.4g} {each.unit} | {each.measured:.4g} {each.unit}"
        lines.append(f"| {each.quantity} | {values} | {'yes' if each.is_met else 'NO'} |")
    return "\n".join([*lines, "", f"{sum(each.is_met for each in limits)} of {len(limits)} met"])
