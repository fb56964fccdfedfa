"""Readers: from a rig's files to runs in SI and kelvin.

Nothing is guessed. Missing information is a question, and inferred values are kept with their source.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mrdamper.data.channels import ChannelMap, read_channel_map
from mrdamper.data.finding import Finding, Inference
from mrdamper.data.frames import Frame
from mrdamper.data.proposal.channel_files import join_channel_files
from mrdamper.data.proposal.documents import read_documents
from mrdamper.data.proposal.folders import distinct_names, find_files, known_suffixes
from mrdamper.data.proposal.questions import Answer, AskingError, NoRunError, Question, ask_all, with_answers
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.data.tables import NoTableError, read_tables
from mrdamper.data.words.labels import Place
from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import MAP_SUFFIX, PathLike, is_file, is_folder

_OF_ANY_OBJECT = frozenset({".json", ".jsonl"})  # what programs write of anything


@dataclass(frozen=True, slots=True)
class UnreadableFile:
    """A file that cannot be read, and why: what it leaves open, where that alone is missing."""

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
    """Files of runs as they stand: those that could be read, and the others."""

    files: tuple[tuple[Path, RigFile], ...]
    unreadable: tuple[UnreadableFile, ...]
    runs: tuple[Recording, ...]  # of all files
    beside: tuple[Finding, ...] = ()  # files of a folder that hold no run

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was done to the runs while reading, and which files hold none."""
        return (*(finding for _, file in self.files for finding in file.findings), *self.beside)

    @property
    def inferred(self) -> tuple[Inference, ...]:
        """What was taken from words."""
        return tuple(inference for _, file in self.files for inference in file.inferred)

    @property
    def questions(self) -> tuple[Question, ...]:
        """What the files leave open."""
        return tuple(question for file in self.unreadable for question in file.questions)

    def fault(self) -> InputError | None:
        """Return the faults and the questions of all files that cannot be read as one error."""
        return ask_all([each.fault for each in self.unreadable]) if self.unreadable else None


def read_run(path: PathLike, channels: ChannelMap | PathLike | None = None) -> tuple[RigRun, ...]:
    """Return the runs in one file; a logger's file holds several.

    A run has the name of its file, with its command if the file holds several.

    Raises
    ------
    InputError
        The file cannot be read, a column or a unit is missing, or a run has faults.
    """
    return tuple(recording.checked() for recording in read_file(path, channels).recordings)


def read_file(
    path: PathLike, channels: ChannelMap | PathLike | None = None, answers: Sequence[Answer] = ()
) -> RigFile:
    """Return the recordings in one file as they stand, and how the file was understood.

    Without ``channels`` the map that lies beside the file holds (``map_beside``), else the headers alone.

    Raises
    ------
    AskingError
        The file does not say all that is needed; its questions name what.
    InputError
        The file cannot be read.
    """
    return _read_file(Path(path), channels, answers)


def _read_file(
    file: Path,
    channels: ChannelMap | PathLike | None,
    answers: Sequence[Answer],
    stated: Sequence[Place] = (),
) -> RigFile:
    """Return the recordings in one file; ``stated`` are lines of documents about it."""
    if is_folder(file):
        raise InputError(place=file, found="is a folder", expected="a file (read_runs takes folders)")
    chosen = with_answers(load_map(map_beside(file) if channels is None else channels), answers, file.name)
    return runs_in(read_tables(file, chosen.file), chosen, file, stated=stated)


def read_each(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
) -> ReadFiles:
    """Return what frames, files, folders and glob patterns hold, frames first, each file once.

    A folder gives the files in it, and in the folders in it, of the formats read here. Runs of one name are
    told apart by their folders.

    Raises
    ------
    InputError
        A path is not there, or the channel map cannot be read.
    """
    with TemporaryDirectory(prefix="mrdamper-") as space:
        read = _read_all(paths, channels, answers, Path(space))
        for file in read.unreadable:
            _move_out(file.fault, space)
        return read


def _move_out(fault: MrdamperError, space: str) -> None:
    """Replace the place of an unpacked file by that in the archive."""
    for each in fault.faults:
        _move_out(each, space)
    fault.move_to(fault.place.replace(f"{space}/", ""))


def _read_all(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None,
    answers: Sequence[Answer],
    space: Path,
) -> ReadFiles:
    """Return what frames and files hold; archives are unpacked below ``space``."""
    chosen = None if channels is None else load_map(channels)
    read: list[tuple[Path, RigFile]] = []
    unreadable: list[UnreadableFile] = []
    parts = [paths] if isinstance(paths, str | Path) else list(paths)
    frames = {Path(each.name): each for each in parts if isinstance(each, Frame)}
    named = [each for each in parts if not isinstance(each, Frame)]
    files = find_files(named, space) if named or not frames else []
    given = {Path(each) for each in named}
    folders = {file.parent for file in files if file not in given} | {
        path for path in given if is_folder(path)
    }
    documents = read_documents(files, sorted(folders))
    stating = {document.path for document in documents}
    for path in (*frames, *(path for path in files if path not in stating)):
        try:
            if path in frames:
                read.append((path, frames[path].read(with_answers(load_map(chosen), answers, path.name))))
            else:
                stated = [place for document in documents for place in document.places(path)]
                read.append((path, _read_file(path, chosen, answers, stated)))
        except InputError as error:
            unreadable.append(UnreadableFile(path, error))
    joined, members = join_channel_files([each.path for each in unreadable], load_map(chosen), answers)
    read += joined
    unreadable = [each for each in unreadable if each.path not in members]
    read = [_out_of(space, path, file) for path, file in _named_apart(read)]
    runs = tuple(recording for _, file in read for recording in file.recordings)
    objects = {path.suffix.lower() for path, _ in read} & _OF_ANY_OBJECT
    may_be_runs = bool(read) or any(
        not isinstance(each.fault, NoRunError | NoTableError) for each in unreadable
    )
    beside = [
        each
        for each in unreadable
        if may_be_runs and _is_beside(each, given | {*frames}, {*_OF_ANY_OBJECT} - objects)
    ]
    kept = tuple(each for each in unreadable if each not in beside)
    told = (*(document.finding for document in documents), *map(_left_out, beside))
    return ReadFiles(tuple(read), kept, runs, told)


def _out_of(space: Path, path: Path, file: RigFile) -> tuple[Path, RigFile]:
    """Return a file whose paths in an archive are not those of the unpacked one."""
    shown = path.relative_to(space) if path.is_relative_to(space) else path
    recordings = tuple(replace(each, source=each.source.replace(f"{space}/", "")) for each in file.recordings)
    return shown, replace(file, recordings=recordings)


def _is_beside(file: UnreadableFile, given: set[Path], foreign: set[str]) -> bool:
    """Tell whether a file that nobody named lies beside those of runs and is none.

    ``foreign`` are suffixes of which no file here is a run.
    """
    suffix = file.path.suffix.lower()
    is_unknown = suffix not in known_suffixes() and isinstance(file.fault, AskingError)
    none = isinstance(file.fault, NoRunError | NoTableError) or suffix in foreign or is_unknown
    return none and file.path not in given


def _left_out(file: UnreadableFile) -> Finding:
    return Finding(
        kind="no_run",
        severity="note",
        run=file.path.name,
        found=f"{file.path.name} holds no samples of a damper and is left out",
        effect="What it says, of temperatures perhaps, is not used",
        remedy="Name the file by itself to see what is missed in it",
    )


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


def read_runs(
    paths: PathLike | Iterable[PathLike | Frame],
    channels: ChannelMap | PathLike | None = None,
    answers: Sequence[Answer] = (),
) -> Dataset:
    """Return the runs in files, folders and glob patterns, with what was found and inferred while reading.

    Raises
    ------
    AskingError
        Files leave questions open; it holds the faults and the questions of all of them.
    InputError
        A file cannot be read, or a run has faults.
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
    """Return the channel map that lies beside a file under its name and ``.channels.toml``, if one does.

    It is the file's own, and taken where no other map is given.
    """
    beside = file.with_name(f"{file.name}{MAP_SUFFIX}")
    return beside if is_file(beside) else None


def load_map(channels: ChannelMap | PathLike | None) -> ChannelMap:
    """Return a channel map as given, from its file, or the empty one."""
    if channels is None:
        return ChannelMap()
    return channels if isinstance(channels, ChannelMap) else read_channel_map(channels)
