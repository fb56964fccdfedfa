"""Declaration of the outputs of a command: JSON, terminal output, page and files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Generic

from rich.markup import escape

from mrdamper.errors import ConvergenceError
from mrdamper.report.page import Page, Result, sentence
from mrdamper.runtime.outputs import write_json, write_table
from mrdamper.schema import Json, json_value

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

Rows = Sequence[Mapping[str, object]]
NOTE_COUNT_MAX = 3  # More notes on the terminal would move the values of the result out of sight.


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Exit code of a command, and messages for standard error."""

    exit_code: int = 0
    messages: tuple[str, ...] = ()


DONE = Outcome()
BEST_SO_FAR = "The written files have the best result so far and are marked as cancelled."
NO_FILES = "No files were written. Use --out DIR to write a report."


def interrupted(remaining: str = BEST_SO_FAR) -> Outcome:
    """Return the outcome of an interrupted job; ``remaining`` states which files remain."""
    return Outcome(exit_code=ConvergenceError.exit_code, messages=(f"Interrupted. {remaining}",))


@dataclass(frozen=True, slots=True)
class Place:
    """Temporary and final path of a folder or file that a job writes.

    Attributes
    ----------
    stage : temporary path, used until all files are complete
    path : final path
    """

    stage: Path
    path: Path

    def __truediv__(self, name: str) -> Place:
        return Place(self.stage / name, self.path / name)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFile(Generic[Result]):
    """Declaration of a file, or a folder of files, to which a result is written.

    Attributes
    ----------
    name : name of the file; if empty, ``write`` receives the folder
    key : key of the path in the JSON object of the command; if empty, the JSON object omits the path
    write : function that writes the file; if None, the file contains the JSON object of the command
    write_in : function that replaces ``write`` if the final path is needed, too
    when : returns False if a result has no such file
    folder : key of a further folder in ``Report.beside``; if empty, the file is in the user's folder
    output : option that sets the path of the file, such as ``write_map``; if empty, there is no such option
    """

    name: str | Callable[[Result], str]
    key: str = ""
    write: Callable[[Result, Path], object] | None = None
    write_in: Callable[[Result, Place], object] | None = None
    when: Callable[[Result], bool] = lambda _: True
    folder: str = ""
    output: str = ""

    def where(self, result: Result, places: Mapping[str, Place]) -> Place | None:
        """Return the path of this file, or None if it is not written."""
        if self.output and self.output in places:
            return places[self.output]
        if self.folder not in places or not self.when(result):
            return None
        return places[self.folder] / (self.name if isinstance(self.name, str) else self.name(result))


def wrote_sentence(_: object, answer: Json) -> list[str]:
    """Return the line "Wrote ..." with the paths of the main files."""
    paths = [
        answer[key] for key in ("report", "file", "drawing", "channel_map") if answer.get(key) is not None
    ]
    return [f"Wrote {' and '.join(paths)}." if paths else NO_FILES]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report(Generic[Result]):
    """Declaration of all outputs of a command.

    The user's folder is the folder that the user names, for example by ``--out``. The *answer* is the JSON
    object. The functions receive the result of the command.

    Attributes
    ----------
    fields : returns the values of the answer by key; the keys are documented
    show : prints the result to a terminal, the most important values first
    closing : returns the last lines on a terminal; the first line names the written files
    summary : returns a few lines with the main values; None: the values at the top of the page
    page : the HTML page; None if there is no page
    files : further files in the user's folder; either all of them are written or none
    beside : further folders by name; a function computes each path from the user's folder
    in_folder : returns further keys of the answer that depend on the user's folder
    lists_files : True if the answer lists all written files under the key ``files``
    curves : returns data for the plots of the browser interface
    rows : returns the result as a table, with one mapping for each row; None if the result has no rows
    outcome : returns exit code and messages
    """

    fields: Callable[[Result], Mapping[str, object]]
    show: Callable[[Result, Console], None]
    closing: Callable[[Result, Json], Sequence[str]] = wrote_sentence
    summary: Callable[[Result], Sequence[str]] | None = None
    page: Page[Result] | None = None
    files: tuple[WrittenFile[Result], ...] = ()
    beside: Mapping[str, Callable[[Path], Path]] = field(default_factory=dict)
    in_folder: Callable[[Result, Path], Json] = lambda _, __: {}
    lists_files: bool = False
    curves: Callable[[Result], Mapping[str, object]] = lambda _: {}
    rows: Callable[[Result], Rows] | None = None
    outcome: Callable[[Result], Outcome] = lambda _: DONE

    @property
    def figure(self) -> Callable[[Result], Figure | None] | None:
        """The main figure of the page, or None if the page has no figure."""
        return None if self.page is None else self.page.picture

    def answer(self, result: Result) -> Json:
        """Return the object that ``--json`` prints, without the paths of the files."""
        answer: Json = json_value(self.fields(result))
        return answer

    def lines(self, result: Result) -> Sequence[str]:
        """Return a few lines with the main values of the result."""
        if self.summary is not None:
            return self.summary(result)
        return () if self.page is None else self.page.first(result).lines

    def for_page(self, result: Result) -> Json:
        """Return the data that only the browser interface needs: curves and page content."""
        shown = {} if self.page is None else {"shown": self.page.web_json(result)}
        return {**json_value(self.curves(result)), **shown}

    @property
    def output_files(self) -> tuple[WrittenFile[Result], ...]:
        """All files of a result, the page first."""
        if self.page is None:
            return self.files
        page = self.page
        return (WrittenFile(name=page.name, key="report", write=page.write, when=page.when), *self.files)


def write_report(
    report: Report[Result], result: Result, places: Mapping[str, Place], head: Mapping[str, object]
) -> Json:
    """Write the files of a result and return the answer with their paths.

    Parameters
    ----------
    places : paths of the user's folder (empty name), of further folders (``Report.beside``), and of files
        with an own option. Other files are not written.
    head : entries before the other entries of the answer
    """
    found = ((file, file.where(result, places)) for file in report.output_files)
    files = [(file, place) for file, place in found if place is not None]
    written: list[str] = []
    for file, place in files:
        if file.write_in is not None:
            file.write_in(result, place)
        elif file.write is not None:
            file.write(result, place.stage)
            written += [str(place.path / each.relative_to(place.stage)) for each in _files_of(place.stage)]
    answer: Json = {
        **head,
        **report.answer(result),
        **{file.key: str(place.path) for file, place in files if file.key},
        **(report.in_folder(result, places[""].path) if "" in places else {}),
        **({"files": written} if report.lists_files else {}),
    }
    for file, place in files:
        if file.write is None and file.write_in is None:
            write_json(place.stage, answer)
    return answer


def csv_file(name: str, rows: Callable[[Result], Rows]) -> WrittenFile[Result]:
    """Return the declaration of a CSV file with the rows of a result."""
    return WrittenFile(name=name, write=lambda result, path: write_table(path, rows(result)))


def text_file(name: str, text: Callable[[Result], str], *, key: str = "") -> WrittenFile[Result]:
    """Return the declaration of a file with a text of a result."""
    return WrittenFile(
        name=name, key=key, write=lambda result, path: path.write_text(text(result), encoding="utf-8")
    )


def _files_of(path: Path) -> Iterable[Path]:
    return sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else (path,)


def print_notes(notes: Iterable[str], console: Console) -> None:
    """Print the first notes on a result. The report contains all notes."""
    sentences = [sentence(note) for note in notes]
    for note in sentences[:NOTE_COUNT_MAX]:
        console.print(f"Note: {escape(note)}")
    if len(sentences) > NOTE_COUNT_MAX:
        console.print(f"The report has {len(sentences) - NOTE_COUNT_MAX} more notes.")
