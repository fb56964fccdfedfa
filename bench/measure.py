"""How the benchmarks measure: medians of interleaved repeats, and what machine they ran on.

A row may carry the figures that were asked for; they end a benchmark as a table of asked and measured.
"""

from __future__ import annotations

import platform
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

__all__ = ["Asked", "Row", "asked_table", "interleaved", "machine", "table"]


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
    """One line of a benchmark. ``ratio`` is to the first contender of the same kind."""

    contender: str
    cpu_s: float | None = None
    ns_per_sample: float | None = None
    ratio: float | None = None
    accuracy: str = ""
    bar: str = ""
    asked: tuple[Asked, ...] = ()

    def as_json(self) -> dict[str, object]:
        answer = {key: value for key, value in asdict(self).items() if value not in (None, "", ())}
        if self.asked:
            answer["asked"] = [asdict(each) | {"is_met": each.is_met} for each in self.asked]
        return answer


def interleaved(jobs: Mapping[str, Callable[[], object]], repeats: int = 7) -> dict[str, float]:
    """Return the median CPU time [s] of each job, the jobs taking turns; the first turn is not counted."""
    spent: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(repeats + 1):
        for name, job in jobs.items():
            begin = time.process_time()
            job()
            if turn:
                spent[name].append(time.process_time() - begin)
    return {name: statistics.median(times) for name, times in spent.items()}


def machine() -> dict[str, object]:
    """Return what the figures depend on."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line
        ]
        model = f"{names[0]} ({len(names)} logical)" if names else model
    packages = {name: version(name) for name in ("mrdamper", "numpy", "scipy")}
    return {"processor": model, "system": platform.platform(), "python": sys.version.split()[0], **packages}


def table(title: str, rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""

    def number(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}g}" if value < 1000 else f"{value:,.0f}"

    lines = [
        f"## {title}",
        "",
        "| contender | CPU s | ns per sample | ratio | accuracy | bar |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = (
            row.contender,
            number(row.cpu_s, 3),
            number(row.ns_per_sample, 3),
            number(row.ratio, 3),
            row.accuracy,
            row.bar,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


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
