"""What a person sees of a check: one line for each run, then what was found, worst first."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

__all__ = ["show_check"]

_COLOUR = {"fault": "red", "warning": "yellow", "note": "cyan"}


def show_check(answer: Mapping[str, Any]) -> None:
    """Print how files were understood, the runs, and the findings."""
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 110)
    for words, paths in _by_layout(answer["files"]).items():
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        console.print(f"{escape(paths[0])}{more}: {escape(words)}")
    table = Table(title="Runs")
    table.add_column("run", overflow="fold")
    for name in ("samples", "Hz", "s", "stroke mm", "force N"):
        table.add_column(name, justify="right")
    table.add_column("findings", overflow="fold")
    for run in answer["runs"]:
        cells = (run["rate_Hz"], run["duration_s"], run["stroke_mm"], run["force_range_N"])
        found = escape(", ".join(run["findings"])) or "-"
        colour = _COLOUR.get(run["worst"])
        table.add_row(
            escape(run["name"]),
            str(run["samples"]),
            *("-" if cell is None else f"{cell:.4g}" for cell in cells),
            f"[{colour}]{found}[/{colour}]" if colour else found,
        )
    console.print(table)
    for finding, names in _by_kind(answer["findings"]):
        colour, others = _COLOUR[finding["severity"]], names - 1
        more = f" (and in {others} more run{'s' if others > 1 else ''})" if others else ""
        console.print(
            f"[{colour}]{finding['severity']}[/{colour}] {escape(finding['run'])}: {escape(finding['found'])}"
            f"{more}. {escape(finding['effect'])}. {escape(finding['remedy'])}."
        )
    counts = ", ".join(
        f"{number} {severity}{'s' if number != 1 else ''}" for severity, number in answer["counts"].items()
    )
    verdict = "the runs can be fitted" if answer["usable"] else "not to be fitted as they are"
    console.print(f"[bold]{verdict}[/bold]: {counts}")
    if "report" in answer:
        console.print(f"wrote {escape(answer['report'])}")


def _by_kind(findings: list[Mapping[str, Any]]) -> list[tuple[Mapping[str, Any], int]]:
    """Return the largest finding of each kind, and in how many runs there is one; worst first."""
    groups: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for finding in findings:
        key = (finding["severity"], finding["kind"], finding["channel"] or "")
        groups.setdefault(key, []).append(finding)
    order = sorted(groups, key=lambda key: list(_COLOUR).index(key[0]))
    return [(max(groups[key], key=lambda f: abs(f["size"] or 0.0)), len(groups[key])) for key in order]


def _by_layout(files: list[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return the files by how they were understood, columns and all."""
    found: dict[str, list[str]] = {}
    for file in files:
        columns = ", ".join(f"{each['role']} {each['name']!r} in {each['unit']}" for each in file["columns"])
        found.setdefault(f"{file['understood']}; {columns}", []).append(file["path"])
    return found
