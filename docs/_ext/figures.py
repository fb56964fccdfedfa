"""Directives that read figures from files, so that no page holds a figure that a command did not print.

``claims`` makes the table of the paper's claims from ``build/demo/summary.json`` (``make demo``); ``bench``
that of a benchmark from ``bench/results.json`` (``python -m bench --out bench/results.json``). Where the file
is missing, the page says how to make it.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
SUMMARY = ROOT / "build" / "demo" / "summary.json"
RESULTS = ROOT / "bench" / "results.json"
_VERDICTS = ("reproduced", "better", "short", "inconsistent", "not_checkable")


def claims_table(summary: dict[str, Any]) -> str:
    """Return the claims of a demo's summary as a Markdown table, verdicts counted above it."""
    claims = summary["claims"]
    count = Counter(claim["verdict"] for claim in claims)
    said = ", ".join(f"{count[verdict]} {verdict.replace('_', ' ')}" for verdict in _VERDICTS)
    lines = [
        f"{len(claims)} rows: {said}. Printed by mrdamper {summary['versions']['mrdamper']}.",
        "",
        "| row | the paper says | paper | here | unit | verdict | why |",
        "|---|---|---|---|---|---|---|",
    ]
    for claim in claims:
        cells = (
            claim["row"],
            claim["says"],
            _figure(claim["paper"]),
            _figure(claim["ours"]),
            claim["unit"],
            claim["verdict"].replace("_", " "),
            claim["why"],
        )
        lines.append("| " + " | ".join(str(cell).replace("|", r"\|") for cell in cells) + " |")
    return "\n".join(lines)


def bench_table(results: dict[str, Any], name: str) -> str:
    """Return one benchmark's rows as Markdown tables: the contenders, and what was asked of them."""
    rows = results[name]
    keys = [key for key in ("cpu_s", "ns_per_sample", "ratio", "accuracy") if any(key in row for row in rows)]
    lines = [f"| contender | {' | '.join(keys)} |", "|---" * (len(keys) + 1) + "|"]
    for row in rows:
        cells = [row["contender"], *(_figure(row.get(key)) for key in keys)]
        lines.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
    asked = [each for row in rows for each in row.get("asked", ())]
    if asked:
        lines += ["", "| figure | asked | measured | met |", "|---|---|---|---|"]
    for each in asked:
        side = "at least" if each["at_least"] else "at most"
        figures = f"{side} {each['bar']:.4g} {each['unit']} | {each['measured']:.4g} {each['unit']}"
        lines.append(f"| {each['figure']} | {figures} | {'yes' if each['is_met'] else 'NO'} |")
    return "\n".join(lines)


def _figure(value: float | str | None) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, int | float) else str(value)


class Claims(SphinxDirective):
    """The paper's claims, from the demo's summary."""

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(SUMMARY))
        summary = json.loads(SUMMARY.read_text(encoding="utf-8")) if SUMMARY.is_file() else {}
        if not summary.get("claims"):
            return parsed(self, "*The table is made from the demo's summary: `make demo`, then `make docs`.*")
        return parsed(self, claims_table(summary))


class Bench(SphinxDirective):
    """One benchmark, from the kept results."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(RESULTS))
        name = self.arguments[0]
        results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
        if name not in results:
            return parsed(self, f"*No kept results. `python -m bench {name}` prints them.*")
        return parsed(self, bench_table(results, name))


def parsed(directive: SphinxDirective, markdown: str) -> list[nodes.Node]:
    """Return the nodes of a text in the page's own markup."""
    place = nodes.Element()
    directive.state.nested_parse(StringList(markdown.splitlines()), directive.content_offset, place)
    return place.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directives."""
    app.add_directive("claims", Claims)
    app.add_directive("bench", Bench)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
