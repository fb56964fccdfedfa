"""Reading of rig files: the result is runs in SI units and kelvin.

Readers do not guess. Missing information leads to a question, and inferred values are kept with their source.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mrdamper.data.channels import ChannelMap, read_channel_map
from mrdamper.data.finding import Finding, Inference, no_run
from mrdamper.data.formats.table import NoTableError
from mrdamper.data.frames import Frame
from mrdamper.data.proposal.documents import read_documents
from mrdamper.data.proposal.folders import GENERIC_SUFFIXES, distinct_names, find_files
from mrdamper.data.proposal.joins import join_channel_files, join_temperature_logs
from mrdamper.data.proposal.questions import (
    Answer,
    AskingError,
    NoRunError,
    Question,
    ask_all,
    relocate,
    with_answers,
)
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.data.tables import read_tables
from mrdamper.data.words.labels import Place
from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX, PathLike, is_file, is_folder
from mrdamper.runtime.pool import ONE_CORE, Pool

_PARALLEL_FILES_MIN = 12  # Starting processes takes longer than reading fewer files in one process.


@dataclass(frozen=True, slots=True)
class UnreadableFile:
    """An unreadable file, its error, and the questions that request the missing information."""

    path: Path
    fault: InputError

    @property
    def error(self) -> str:
        return str(self.fault)

    @property
    def questions(self) -> tuple[Question, ...]:
        return self.fault.questions if isinstance(self.fault, AskingError) else ()


@dataclass(frozen=True, slots=True, eq=False)
class ReadFiles:
    """The result of reading files: unchecked runs, and the unreadable files."""

    files: tuple[tuple[Path, RigFile], ...]
    unreadable: tuple[UnreadableFile, ...]
    runs: tuple[Recording, ...]  # the runs of all files
    beside: tuple[Finding, ...] = ()  # findings on documents and on files without a run

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Return the findings on changes that readers made to runs, and on documents and other files."""
        return (*(finding for _, file in self.files for finding in file.findings), *self.beside)

    @property
    def inferred(self) -> tuple[Inference, ...]:
        """Return currents and temperatures that were read from names and texts, with their source."""
        return tuple(inference for _, file in self.files for inference in file.inferred)

    def fault(self) -> InputError | None:
        """Return an error with the faults and questions of unreadable files, None if all are readable."""
        return ask_all([item.fault for item in self.unreadable]) if self.unreadable else None


def read_file(
    path: PathLike,
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
    stated: Sequence[Place] = (),
    notes: Sequence[str] = (),
) -> RigFile:
    """Return the unchecked recordings in one file, and the interpretation of the file.

    If ``channels`` is None, the map next to the file (``map_beside``) is used. If there is no such map, only
    the headers state the columns. Raise AskingError with questions if information is missing, InputError if
    the file is not readable.

    Parameters
    ----------
    stated : lines of documents about the file
    notes : all lines of documents, which may explain columns and the sampling rate
    """
    file = Path(path)
    if is_folder(file):
        raise InputError(place=file, found="is a folder", expected="a file (read_runs takes folders)")
    chosen = with_answers(load_map(map_beside(file) if channels is None else channels), answers, file)
    return runs_in(read_tables(file, chosen.file), chosen, file, stated=stated, notes=notes)


def read_each(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
) -> ReadFiles:
    """Return the content of data frames, then of files, folders and glob patterns.

    Folders and their subfolders are searched for files of the supported formats. A file that is given twice
    is read once. If runs have equal names, the names get the names of the folders as prefixes.

    Raise InputError if a path does not exist, or the channel map is not readable.
    """
    with TemporaryDirectory(prefix="mrdamper-") as space:
        read = _read_all(paths, channels, answers, Path(space))
        for file in read.unreadable:
            relocate(file.fault, f"{space}/", "")  # Messages show no temporary folder.
        return read


def _read_all(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None,
    answers: Sequence[Answer],
    space: Path,
) -> ReadFiles:
    """Return the content of frames and files; unpack archives into the folder ``space``."""
    own_map, chosen = channels is None, load_map(channels)  # own_map: maps next to the files are used
    read: list[tuple[Path, RigFile]] = []
    unreadable: list[UnreadableFile] = []
    parts = [paths] if isinstance(paths, str | Path) else list(paths)
    frames = {Path(item.name): item for item in parts if isinstance(item, Frame)}
    named = [item for item in parts if not isinstance(item, Frame)]
    files = find_files(named, space) if named or not frames else []
    given = {Path(item) for item in named}
    roots = {space, *(path for path in given if is_folder(path))}
    folders = {file.parent for file in files if file not in given} | {
        folder for file in files for folder in file.parents if not roots.isdisjoint((folder, *folder.parents))
    }
    documents = read_documents(files, sorted(folders))
    lists = {document.path for document in documents if document.lines}
    # The copy of a list next to an archive states conditions of the unpacked files.
    copied = {path.name for path in lists if path.is_relative_to(space)}
    stating = {file for file in files if file in lists or file.name in copied}
    if len(stating) == len(files):  # If all files are documents, the user gets the errors of reading them.
        stating = set()

    rejected = {file: why for each in documents for file, why in each.rejected.items() if file not in given}

    def read_one(path: Path) -> RigFile | InputError:
        try:
            if path in frames:
                return frames[path].read(with_answers(chosen, answers, path))
            stated = [place for document in documents for place in document.places(path)]
            notes = [line for document in documents for line in document.notes(path)]
            return read_file(path, None if own_map else chosen, answers, stated, notes)
        except InputError as error:
            return error

    chosen_files = [*frames, *(path for path in files if path not in {*stating, *rejected})]
    # A fork of a process in which Polars has started threads would wait for these threads for ever.
    is_parallel = len(chosen_files) >= _PARALLEL_FILES_MIN and "polars" not in sys.modules
    pool = Pool() if is_parallel else ONE_CORE
    for path, found in zip(chosen_files, pool.map(read_one, chosen_files), strict=True):
        if isinstance(found, RigFile):
            read.append((path, found))
            continue
        if path.is_relative_to(space) or [each.name for each in files].count(path.name) > 1:
            relocate(found, path.name, f"{path}")
        unreadable.append(UnreadableFile(path, found))
    joined, members = join_channel_files([item.path for item in unreadable], chosen, answers, documents)
    unread = [item.path for item in unreadable if item.path not in members]
    warmed, logs = join_temperature_logs([*read, *joined], unread, chosen, answers)
    unreadable = [item for item in unreadable if item.path not in {*members, *logs}]
    ignored = _ignored_files(unreadable, [path for path, _ in warmed], given | {*frames})
    faulty = tuple(replace(item, path=_shown(item.path, space)) for item in unreadable if item not in ignored)
    named_files = tuple(_with_distinct_names(warmed, space))
    runs = tuple(recording for _, file in named_files for recording in file.recordings)
    beside = {file.path.name: no_run(file.path.name, "has no samples of a damper") for file in ignored}
    beside |= {document.path.name: document.finding for document in documents if document.lines}
    left_out = [no_run(path.name, reason, "warning") for path, reason in rejected.items()]
    return ReadFiles(named_files, faulty, runs, (*beside.values(), *left_out, *logs.values()))


def _shown(path: Path | str, space: Path) -> Path:
    """Return a path without the temporary folder ``space``."""
    return Path(f"{path}".replace(f"{space}/", ""))


def _ignored_files(
    unreadable: Sequence[UnreadableFile], read: Sequence[Path], given: set[Path]
) -> list[UnreadableFile]:
    """Return the files that were found in a folder and contain no run, or [] if all files are such files.

    A file of a series is not ignored if another file of the series was ``read``. Paths that the user gave are
    never ignored. A file with a generic suffix, such as .json, may be of any program.
    """
    foreign = {*GENERIC_SUFFIXES} - {path.suffix.lower() for path in read}
    series = {path.with_name(re.sub(r"\d+", "#", path.name)) for path in read}
    ignored = []
    for file in unreadable:
        has_no_run = isinstance(file.fault, NoRunError | NoTableError)
        is_object = file.path.suffix.lower() in foreign and not isinstance(file.fault, AskingError)
        is_of_series = file.path.with_name(re.sub(r"\d+", "#", file.path.name)) in series  # "run_#.csv"
        if (has_no_run or is_object) and file.path not in given and not is_of_series:
            ignored.append(file)
    return ignored if read or len(ignored) < len(unreadable) else []


def _with_distinct_names(read: Sequence[tuple[Path, RigFile]], space: Path) -> list[tuple[Path, RigFile]]:
    """Return the files with unique names of runs, and sources without the temporary folder ``space``."""
    runs = [recording for _, file in read for recording in file.recordings]
    names = iter(distinct_names([run.name for run in runs], [run.source for run in runs]))
    named = []
    for path, file in read:
        new = {each.name: next(names) for each in file.recordings}
        shown = replace(
            file,
            recordings=tuple(
                replace(each, name=new[each.name], source=f"{_shown(each.source, space)}")
                for each in file.recordings
            ),
            findings=tuple(replace(each, run=new.get(each.run, each.run)) for each in file.findings),
            inferred=tuple(replace(each, run=new[each.run]) for each in file.inferred),
        )
        named.append((_shown(path, space), shown))
    return named


def read_runs(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
) -> Dataset:
    """Return the runs in files, folders and glob patterns, with findings and inferred values.

    Raise AskingError if information is missing. The error contains the faults and the questions of all files.
    Raise InputError if a file is not readable, or a run has faults.
    """
    read = read_each(paths, channels, answers)
    runs: list[RigRun] = []
    unreadable = [*read.unreadable]
    for recording in read.runs:
        try:
            runs.append(recording.checked())
        except InputError as error:
            unreadable.append(UnreadableFile(Path(recording.source), error))
    fault = replace(read, unreadable=tuple(unreadable)).fault()
    if fault is not None:
        raise fault
    return Dataset(tuple(runs), read.findings, read.inferred)


def map_beside(file: Path) -> Path | None:
    """Return the path of the channel map next to a file, named ``file.channels.toml``, None if missing."""
    path = file.with_name(f"{file.name}{MAP_SUFFIX}")
    return path if is_file(path) else None


def load_map(channels: ChannelMap | PathLike | None) -> ChannelMap:
    """Return the given channel map, the map in the file at the given path, or an empty map for None."""
    if channels is None:
        return ChannelMap()
    return channels if isinstance(channels, ChannelMap) else read_channel_map(channels)
