"""What a job's result can be turned into: each report module fills one ``Report``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from mrdamper.errors import ConvergenceError
from mrdamper.runtime.outputs import write_json
from mrdamper.schema import Json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

__all__ = ["BEST_SO_FAR", "DONE", "Outcome", "Report", "WrittenFile", "interrupted", "write_report"]

Result = TypeVar("Result")

Rows = Sequence[Mapping[str, object]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a job ended: the exit code of its command, and what that says on standard error."""

    exit_code: int = 0
    said: tuple[str, ...] = ()


DONE = Outcome()
BEST_SO_FAR = "what was written is the best so far, marked as cancelled"


def interrupted(left: str = BEST_SO_FAR) -> Outcome:
    """Return the outcome of a job that an interrupt has cut short; ``left`` is what there is of it."""
    return Outcome(exit_code=ConvergenceError.exit_code, said=(f"interrupted: {left}",))


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFile(Generic[Result]):
    """One of the files that a result is written to."""

    name: str
    key: str = ""  # of the answer, under which its path stands; empty: it is not told
    write: Callable[[Result, Path], None] | None = None  # None: the answer itself, as JSON
    streamed: bool = False  # the job itself has written it as it went
    when: Callable[[Result], bool] = lambda _: True


@dataclass(frozen=True, slots=True, kw_only=True)
class Report(Generic[Result]):
    """The faces of one job's result.

    Attributes
    ----------
    answer : the object that ``--json`` prints; its keys are documented
    show : prints tables and notes to a terminal
    summary : a few lines that answer the user's question, without a figure
    files : what is written into the folder that the user names, all or nothing
    figure : the picture that answers the question; None where there is none
    rows : the result as a table, one mapping a row; None where rows make no sense
    outcome : how the job ended, where that is not always well
    """

    answer: Callable[[Result], Json]
    show: Callable[[Result, Console], None]
    summary: Callable[[Result], Sequence[str]]
    files: tuple[WrittenFile[Result], ...] = ()
    figure: Callable[[Result], Figure] | None = None
    rows: Callable[[Result], Rows] | None = None
    outcome: Callable[[Result], Outcome] = lambda _: DONE


def write_report(
    report: Report[Result], result: Result, beside: Path, out: Path, head: Mapping[str, object]
) -> Json:
    """Write a result's files into ``beside``, of what will lie in ``out``; return the answer with paths."""
    files = [
        file
        for file in report.files
        if file.when(result) and (not file.streamed or (beside / file.name).exists())
    ]
    answer = {
        **head,
        **report.answer(result),
        **{file.key: str(out / file.name) for file in files if file.key},
    }
    for file in files:
        if file.streamed:
            continue
        if file.write is None:
            write_json(beside / file.name, answer)
        else:
            file.write(result, beside / file.name)
    return answer
