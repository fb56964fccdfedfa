"""What ``cite`` found: the answer's keys, works as text and BibTeX."""

from __future__ import annotations

from rich.console import Console

from mrdamper.jobs.cite import CiteResult
from mrdamper.report.base import Report
from mrdamper.schema import Json


def _answer(result: CiteResult) -> Json:
    return {"law": result.law, "citations": _rows(result), "notes": list(result.notes)}


def _rows(result: CiteResult) -> list[Json]:
    return [
        {
            "key": each.source.key,
            "for": each.reason,
            "text": each.source.text(),
            "bibtex": each.source.bibtex(),
        }
        for each in result.citations
    ]


def _show(result: CiteResult, console: Console) -> None:
    """Print what to cite, as sentences and then as BibTeX that a file can take."""
    lines = [f"{each.reason}: {each.source.text()}" for each in result.citations]
    lines += [f"- {note}" for note in result.notes]
    lines += [f"\n{each.source.bibtex()}" for each in result.citations]
    for line in lines:
        console.print(line, markup=False, soft_wrap=True)


REPORT: Report[CiteResult] = Report(
    answer=_answer,
    show=_show,
    summary=lambda result: [f"{each.reason}: {each.source.text()}" for each in result.citations],
    rows=_rows,
)
