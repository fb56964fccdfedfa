"""The directive ``claims``: the table of the claims of the reference paper, with the values of the demo.

The values come from ``build/demo/summary.json`` (``make demo``). If the file is missing, the page states the
command that writes it.
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
_DOUBT = "**The paper contradicts itself or physics.** "
SUMMARY = ROOT / "build" / "demo" / "summary.json"


def claims_table(summary: dict[str, Any]) -> str:
    """Return the claims in the summary of a demo as a Markdown table, with the number of each origin."""
    claims = summary["claims"]
    count = Counter(claim["origin"] for claim in claims)
    origins = ", ".join(f"{number} {origin}" for origin, number in sorted(count.items()))
    lines = [
        f"{len(claims)} rows: {origins}. Printed by mrdamper {summary['versions']['mrdamper']}.",
        "",
        "| row | the paper says | paper | here | unit | origin | verdict | why |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for claim in claims:
        cells = (
            claim["row"],
            claim["statement"],
            _figure(claim["paper"]),
            _figure(claim["ours"]),
            claim["unit"],
            claim["origin"],
            claim["verdict"] or "",
            _DOUBT * claim["contradiction"] + claim["why"],
        )
        lines.append("| " + " | ".join(str(cell).replace("|", r"\|") for cell in cells) + " |")
    return "\n".join(lines)


def _figure(value: float | str | None) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, int | float) else str(value)


class Claims(SphinxDirective):
    """The claims of the reference paper, from the summary of the demo."""

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(SUMMARY))
        summary = json.loads(SUMMARY.read_text(encoding="utf-8")) if SUMMARY.is_file() else {}
        if not summary.get("claims"):
            return parsed(
                self, "*The table needs the summary of the demo: run `make demo`, then `make docs`.*"
            )
        return parsed(self, claims_table(summary))


def parsed(directive: SphinxDirective, markdown: str) -> list[nodes.Node]:
    """Return the nodes of a Markdown text."""
    place = nodes.Element()
    directive.state.nested_parse(StringList(markdown.splitlines()), directive.content_offset, place)
    return place.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("claims", Claims)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
