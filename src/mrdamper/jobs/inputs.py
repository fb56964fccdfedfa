"""What jobs read: runs in files and folders, files as they are, cards of users' own laws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mrdamper.data.batches import LongRecord, open_record
from mrdamper.data.channels import read_channel_map
from mrdamper.data.proposal.folders import distinct_names, find_files
from mrdamper.data.proposal.questions import AskingError, Question, parse_answers
from mrdamper.data.readers import RigFile, joined_faults, read_file, read_runs
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.python_law import load_python_law

__all__ = ["ReadFiles", "UnreadableFile", "read_card_of_law", "read_dataset", "read_files", "read_record"]

Paths = str | Path | Iterable[str | Path | RigRun]


def read_dataset(
    given: Paths,
    channels: Path | None = None,
    *,
    answer: Sequence[str] | None = None,
    flip_force: bool = False,
) -> Dataset:
    """Return the runs in files and folders; runs that are given as themselves are taken as they are.

    Parameters
    ----------
    channels : channel map, for all files; None: the one beside each file, or its headers alone
    answer : answers to questions that files leave open, such as ``force.unit=kN``
    flip_force : turn the sign of the force, for load cells that count compression as positive

    Raises
    ------
    InputError
        A file cannot be read, or there is no run at all.
    """
    parts = _parts(given)
    runs = tuple(each for each in parts if isinstance(each, RigRun))
    if not (parts and len(runs) == len(parts)):
        paths = [each for each in parts if not isinstance(each, RigRun)]
        dataset = read_runs(paths, channels, parse_answers(answer or ()))
        runs = (*runs, *dataset)
    if not runs:
        raise InputError(f"{', '.join(map(str, parts))}: no runs found; expected files such as run.csv")
    if flip_force:
        runs = tuple(replace(run, force=-run.force) for run in runs)
    return given if isinstance(given, Dataset) and not flip_force else Dataset(runs)


def _parts(given: Paths) -> list[str | Path | RigRun]:
    return [given] if isinstance(given, str | Path) else list(given)


@dataclass(frozen=True, slots=True)
class UnreadableFile:
    """A file that cannot be read, and why: what it leaves open, where that alone is missing."""

    path: Path
    error: str
    questions: tuple[Question, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ReadFiles:
    """Files of runs as they stand: those that could be read, and the others."""

    files: tuple[tuple[Path, RigFile], ...]
    unreadable: tuple[UnreadableFile, ...]
    runs: tuple[Recording | RigRun, ...]  # of all files


def read_files(
    given: Paths, channels: Path | None = None, *, answer: Sequence[str] | None = None
) -> ReadFiles:
    """Return what files and folders hold, whether or not it can be used.

    Raises
    ------
    InputError
        No file could be read, and none leaves a question open; or a path is not there.
    """
    answers = parse_answers(answer or ())
    parts = _parts(given)
    runs: list[Recording | RigRun] = [each for each in parts if isinstance(each, RigRun)]
    paths = [each for each in parts if not isinstance(each, RigRun)]
    chosen = None if channels is None else read_channel_map(channels)
    read: list[tuple[Path, RigFile]] = []
    unreadable: list[UnreadableFile] = []
    for path in find_files(paths) if paths or not runs else []:
        try:
            read.append((path, read_file(path, chosen, answers)))
        except InputError as error:
            asked = error.questions if isinstance(error, AskingError) else ()
            unreadable.append(UnreadableFile(path, str(error), asked))
    if not read and not runs and not any(each.questions for each in unreadable):
        raise InputError(joined_faults([each.error for each in unreadable]))
    read = _named_apart(read)
    runs += [recording for _, file in read for recording in file.recordings]
    return ReadFiles(tuple(read), tuple(unreadable), tuple(runs))


def _named_apart(read: Sequence[tuple[Path, RigFile]]) -> list[tuple[Path, RigFile]]:
    """Return files whose runs have names that folders tell apart."""
    runs = [recording for _, file in read for recording in file.recordings]
    names = iter(distinct_names([run.name for run in runs], [run.source for run in runs]))
    named = []
    for path, file in read:
        new = {recording.name: next(names) for recording in file.recordings}
        recordings = tuple(replace(each, name=new[each.name]) for each in file.recordings)
        findings = tuple(replace(each, run=new[each.run]) for each in file.findings)
        inferred = tuple(replace(each, run=new[each.run]) for each in file.inferred)
        named.append((path, replace(file, recordings=recordings, findings=findings, inferred=inferred)))
    return named


def read_record(
    path: str | Path,
    channels: Path | None = None,
    *,
    answer: Sequence[str] | None = None,
    flip_force: bool = False,
) -> LongRecord:
    """Return a record that no memory holds; of its rows only the first few are read.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or the map splits the file into tests.
    """
    return replace(open_record(path, channels, parse_answers(answer or ())), flip_force=flip_force)


def read_card_of_law(path: str | Path, law: str | None = None) -> ModelCard:
    """Return a card, which may have been identified with a user's own law.

    Parameters
    ----------
    law : ``file.py:Class`` of that law, which is run; a card of one of our laws does not need it

    Raises
    ------
    InputError
        The card or the law cannot be read.
    """
    if law is None:
        return read_card(path)
    own = load_python_law(law)
    try:
        return read_card(path)
    except InputError:  # it was identified with the user's own law
        return read_card(path, python_law=own)
