"""The channel map that ``map`` wrote: the answer's keys, the TOML of a terminal, its file."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from mrdamper.errors import InputError
from mrdamper.jobs.channel_map import WrittenMap
from mrdamper.report.base import DONE, Outcome, Report, WrittenFile
from mrdamper.schema import Json


def _answer(result: WrittenMap) -> Json:
    return {
        "map": result.text,
        "channel_map": dict(result.document),
        "comments": list(result.comments),
        "questions": [dict(question.to_dict()) for question in result.questions],
        "unreadable": [{"path": str(each.path), "error": each.error} for each in result.unreadable],
    }


def _show(result: WrittenMap, console: Console) -> None:
    console.print(result.text, markup=False, highlight=False, soft_wrap=True)


def _write(result: WrittenMap, path: Path) -> None:
    path.write_text(result.text, encoding="utf-8")


def _outcome(result: WrittenMap) -> Outcome:
    if result.unreadable:
        return Outcome(exit_code=InputError.exit_code, said=tuple(each.error for each in result.unreadable))
    return DONE


REPORT: Report[WrittenMap] = Report(
    answer=_answer,
    show=_show,
    summary=lambda result: result.text.splitlines(),
    files=(WrittenFile(name="channels.toml", key="file", write=_write),),
    outcome=_outcome,
)
