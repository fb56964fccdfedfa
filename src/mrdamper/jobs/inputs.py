"""What jobs read: runs in files and folders, files as they are, cards of users' own laws."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from mrdamper.data.batches import LongRecord, open_record
from mrdamper.data.channels import read_channel_map
from mrdamper.data.readers import RigFile, find_files, joined_faults, read_file, read_runs
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.python_law import load_python_law

__all__ = ["ReadFiles", "UnreadableFile", "read_card_of_law", "read_dataset", "read_files", "read_record"]

Paths = str | Path | Iterable[str | Path | RigRun]


def read_dataset(given: Paths, channels: Path | None = None, *, flip_force: bool = False) -> Dataset:
    """Return the runs in files and folders; runs that are given as themselves are taken as they are.

    Parameters
    ----------
    channels : channel map, for all files; None: the one beside each file, or its headers alone
    flip_force : turn the sign of the force, for load cells that count compression as positive

    Raises
    ------
    InputError
        A file cannot be read, or there is no run at all.
    """
    parts = _parts(given)
    runs = tuple(each for each in parts if isinstance(each, RigRun))
    if not (parts and len(runs) == len(parts)):
        dataset = read_runs([each for each in parts if not isinstance(each, RigRun)], channels)
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
    """A file that cannot be read, and why."""

    path: Path
    error: str


@dataclass(frozen=True, slots=True, eq=False)
class ReadFiles:
    """Files of runs as they stand: those that could be read, and the others."""

    files: tuple[tuple[Path, RigFile], ...]
    unreadable: tuple[UnreadableFile, ...]
    runs: tuple[Recording | RigRun, ...]  # of all files


def read_files(given: Paths, channels: Path | None = None) -> ReadFiles:
    """Return what files and folders hold, whether or not it can be used.

    Raises
    ------
    InputError
        No file could be read, or a path is not there.
    """
    parts = _parts(given)
    runs: list[Recording | RigRun] = [each for each in parts if isinstance(each, RigRun)]
    paths = [each for each in parts if not isinstance(each, RigRun)]
    chosen = None if channels is None else read_channel_map(channels)
    read: list[tuple[Path, RigFile]] = []
    unreadable: list[UnreadableFile] = []
    for path in find_files(paths) if paths or not runs else []:
        try:
            read.append((path, read_file(path, chosen)))
        except InputError as error:
            unreadable.append(UnreadableFile(path, str(error)))
    if not read and not runs:
        raise InputError(joined_faults([each.error for each in unreadable]))
    runs += [recording for _, file in read for recording in file.recordings]
    return ReadFiles(tuple(read), tuple(unreadable), tuple(runs))


def read_record(path: str | Path, channels: Path | None = None, *, flip_force: bool = False) -> LongRecord:
    """Return a record that no memory holds; of its rows only the first few are read.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or the map splits the file into tests.
    """
    return replace(open_record(path, channels), flip_force=flip_force)


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
