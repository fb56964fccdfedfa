"""What a job's result can be turned into: each report module fills one ``Report``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Generic

from rich.markup import escape

from mrdamper.errors import ConvergenceError
from mrdamper.notes import note_kinds
from mrdamper.report.page import FirstScreen, Page, Result, Tile
from mrdamper.report.sections import table_of
from mrdamper.runtime.outputs import write_json, write_table
from mrdamper.schema import Json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

__all__ = [
    "BEST_SO_FAR",
    "DONE",
    "FirstScreen",
    "Outcome",
    "Page",
    "Place",
    "Report",
    "Tile",
    "WrittenFile",
    "answer_of",
    "course_report",
    "interrupted",
    "picture_file",
    "print_notes",
    "table_of",
    "write_report",
]


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


@dataclass(frozen=True, slots=True)
class Place:
    """A folder or file: where it is written until all are, and where it will lie."""

    stage: Path
    path: Path

    def __truediv__(self, name: str) -> Place:
        return Place(self.stage / name, self.path / name)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFile(Generic[Result]):
    """One of the files that a result is written to, or a folder of them."""

    name: str | Callable[[Result], str]  # empty: ``write`` is given the folder itself
    key: str = ""  # of the answer, under which its path stands; empty: it is not told
    write: Callable[[Result, Path], object] | None = None  # None: the answer itself, as JSON
    write_in: Callable[[Result, Place], object] | None = None  # in its stead, where a part's answer has paths
    streamed: bool = False  # the job itself has written it as it went
    when: Callable[[Result], bool] = lambda _: True
    folder: str = ""  # of ``Report.beside``; empty: the one that the user names
    output: str = ""  # of the job's outputs, which have an option each; empty: none

    def where(self, result: Result, places: Mapping[str, Place]) -> Place | None:
        """Return the place of this file: that of its output, else its name in a folder; None: nowhere."""
        if self.output and self.output in places:
            return places[self.output]
        if self.folder not in places or not self.when(result):
            return None
        place = places[self.folder] / (self.name if isinstance(self.name, str) else self.name(result))
        return None if self.streamed and not place.stage.exists() else place


def _wrote(_: object, answer: Json, console: Console) -> None:
    """Print where the files are that a person would open."""
    paths = [
        answer[key]
        for key in ("report", "file", "picture", "drawing", "channel_map")
        if answer.get(key) is not None
    ]
    if paths:
        console.print(f"wrote {' and '.join(paths)}", markup=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report(Generic[Result]):
    """The faces of one job's result.

    Attributes
    ----------
    answer : the object that ``--json`` prints; its keys are documented
    show : prints tables and notes to a terminal
    wrote : prints what was written, after them; it is given the answer, too
    summary : a few lines that answer the user's question; None: those of the page's first screen
    page : the HTML page, with the first screen that every report has; None where there is nothing to draw
    files : what is written into the folder that the user names beside the page, all or nothing
    beside : further folders, by name: each follows from the one that the user names
    in_folder : further keys of the answer, which follow from that folder
    lists_files : the answer's ``files`` names all that was written
    curves : further keys of the answer, for the plots of a web page
    rows : the result as a table, one mapping a row; None where rows make no sense
    outcome : how the job ended, where that is not always well
    """

    answer: Callable[[Result], Json]
    show: Callable[[Result, Console], None]
    wrote: Callable[[Result, Json, Console], None] = _wrote
    summary: Callable[[Result], Sequence[str]] | None = None
    page: Page[Result] | None = None
    files: tuple[WrittenFile[Result], ...] = ()
    beside: Mapping[str, Callable[[Path], Path]] = field(default_factory=dict)
    in_folder: Callable[[Result, Path], Json] = lambda _, __: {}
    lists_files: bool = False
    curves: Callable[[Result], Json] = lambda _: {}
    rows: Callable[[Result], Rows] | None = None
    outcome: Callable[[Result], Outcome] = lambda _: DONE

    @property
    def figure(self) -> Callable[[Result], Figure | None] | None:
        """The picture that answers the question; None where there is none."""
        return None if self.page is None else self.page.figure

    def lines(self, result: Result) -> Sequence[str]:
        """Return a few lines that answer the user's question."""
        if self.summary is not None:
            return self.summary(result)
        return () if self.page is None else self.page.first(result).lines

    def for_page(self, result: Result) -> Json:
        """Return what a web page shows of a result beside its answer: curves, first screen, tables."""
        shown = {} if self.page is None else {"shown": self.page.shown(result)}
        return {**self.curves(result), **shown}

    @property
    def written(self) -> tuple[WrittenFile[Result], ...]:
        """All that is written, the page first."""
        if self.page is None:
            return self.files
        page = WrittenFile(
            name=self.page.name,
            key="report",
            write=self.page.write,
            when=self.page.when,
            output=self.page.output,
        )
        return (page, *self.files)


def answer_of(report: Report[Result], result: Result) -> Json:
    """Return a result's answer, kind and fields of its notes beside their texts."""
    answer = report.answer(result)
    kinds = note_kinds(answer.get("notes", ()))
    return {**answer, "note_kinds": kinds} if kinds else answer


def write_report(
    report: Report[Result], result: Result, places: Mapping[str, Place], head: Mapping[str, object]
) -> Json:
    """Write a result's files; return the answer, with their paths.

    Parameters
    ----------
    places : the folder that the user named, under the empty name, and further folders and outputs by their
        names; what has no place is not written
    head : what the answer begins with
    """
    found = ((file, file.where(result, places)) for file in report.written)
    files = [(file, place) for file, place in found if place is not None]
    written: list[str] = []
    for file, place in files:
        if file.write_in is not None:
            file.write_in(result, place)
        elif file.write is not None and not file.streamed:
            file.write(result, place.stage)
            written += [str(place.path / each.relative_to(place.stage)) for each in _files_of(place.stage)]
    answer: Json = {
        **head,
        **answer_of(report, result),
        **{file.key: str(place.path) for file, place in files if file.key},
        **(report.in_folder(result, places[""].path) if "" in places else {}),
        **({"files": written} if report.lists_files else {}),
    }
    for file, place in files:
        if file.write is None and file.write_in is None and not file.streamed:
            write_json(place.stage, answer)
    return answer


def picture_file(name: str, draw: Callable[[Result], Figure], label: str) -> WrittenFile[Result]:
    """Return the file of a picture (SVG) that a report writes beside its page."""

    def write(result: Result, path: Path) -> None:
        from mrdamper.report.figures.style import drawing_style, svg_of  # loads Matplotlib: only where drawn

        with drawing_style():
            path.write_text(svg_of(draw(result), label), encoding="utf-8")

    return WrittenFile(name=name, key="picture", write=write)


def course_report(
    name: str,
    *,
    answer: Callable[[Result], Json],
    show: Callable[[Result, Console], None],
    summary: Callable[[Result], Sequence[str]],
    first: Callable[[Result], FirstScreen],
    picture: Callable[[Result], Figure],
    label: str,
    rows: Callable[[Result], Rows],
) -> Report[Result]:
    """Return the report of a result that is a course: the page and a CSV file have its rows."""
    return Report(
        answer=answer,
        show=show,
        summary=summary,
        page=Page(
            name=f"{name}.html",
            first=first,
            picture=picture,
            label=label,
            sections=lambda found: table_of(rows(found)),
        ),
        files=(
            picture_file(f"{name}.svg", picture, label),
            WrittenFile(name=f"{name}.json", key="file"),
            WrittenFile(name=f"{name}.csv", write=lambda found, path: write_table(path, rows(found))),
        ),
        rows=rows,
    )


def _files_of(path: Path) -> Iterable[Path]:
    return sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else (path,)


def print_notes(notes: Iterable[str], console: Console) -> None:
    """Print what a reader of a result should know, one line each."""
    for note in notes:
        console.print(f"- {escape(note)}")
