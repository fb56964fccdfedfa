"""A job's record: what was asked, how it stands, when, and what it has said so far, as files beside its own.

    job.json        one object, written whole: by the server when it asks and stops, by the worker as it goes
    progress.jsonl  one line for each message and step of progress
    answer.json     what ``mrdamper KIND --json`` prints

What stands in these files is all there is: a server that starts again knows as much as the one before. A few
bytes are held back from the beginning, so that the end of a job can be written down on a full disk, too.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from mrdamper.errors import InputError
from mrdamper.runtime.checkpoint import place_of
from mrdamper.schema import Json, finite_or_none, read_record
from mrdamper.web.workspace import NotThereError, is_text, now, write_whole

EndState = Literal["done", "failed", "cancelled", "interrupted"]

_ID = re.compile(r"([a-z]+)-(\d{3,6})")
_OWN = frozenset({"job.json", "progress.jsonl", "answer.json"})
_TAIL = 4096  # bytes in which the last line of progress is looked for
_MOST_FILES = 500
_RESERVE = ".reserve"
_RESERVED = 8192  # bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What ``job.json`` holds.

    Attributes
    ----------
    options : as they were asked for, checked
    message : said at its end
    card : name of the card that it writes
    resumed : how often it was asked to go on
    pid : of the process that does it, or did
    """

    id: str
    kind: str
    options: dict[str, Any]
    state: Literal["queued", "running"] | EndState = "queued"
    asked_at: str
    started_at: str | None = None
    ended_at: str | None = None
    message: str | None = None
    card: str | None = None
    resumed: int = 0
    pid: int | None = None

    @property
    def has_ended(self) -> bool:
        """Whether nothing more is done for it."""
        return self.state not in {"queued", "running"}


class JobRecord:
    """The files of one job."""

    def __init__(self, results: Path, job_id: str) -> None:
        if not _ID.fullmatch(job_id):
            raise NotThereError(place=f"{job_id[:60]!r}", found="no job of that name")
        self.id = job_id
        self.folder = results / job_id

    def open(self, kind: str, options: Mapping[str, Any], card: str | None) -> None:
        """Write down what was asked, or nothing at all."""
        self.folder.mkdir()
        try:
            self._reserve()
            self._write(Job(id=self.id, kind=kind, options=dict(options), asked_at=now(), card=card))
        except OSError:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def reopen(self) -> None:
        """Write down that a job which ended early is asked for again, to go on from there."""
        job = self.read()
        self._reserve()
        (self.folder / "answer.json").unlink(missing_ok=True)
        again = replace(job, state="queued", started_at=None, ended_at=None, message=None)
        self._write(replace(again, resumed=job.resumed + 1))

    def read(self) -> Job:
        """Return the record; one that cannot be read counts as none."""
        try:
            found = _plain_json((self.folder / "job.json").read_text(encoding="utf-8"))
            job = read_record(Job, found, self.id)
        except (OSError, ValueError, RecursionError, InputError) as fault:
            raise NotThereError(place=f"{self.id!r}", found="no job of that name") from fault
        if job.id != self.id:
            raise NotThereError(place=f"{self.id!r}", found="no job of that name")
        return job

    def begin(self) -> None:
        """Write down that this process does the job."""
        self._write(replace(self.read(), state="running", started_at=now(), pid=os.getpid()))

    def end(self, state: EndState, message: str | None = None) -> None:
        """Write down how the job has ended."""
        (self.folder / _RESERVE).unlink(missing_ok=True)
        self._write(replace(self.read(), state=state, ended_at=now(), message=message))

    def left(self, job: Job) -> Path | None:
        """Return the file of a job's finished pieces of work, if the job can be resumed."""
        if not job.has_ended or (job.state == "done" and job.kind == "sweep"):
            return None
        place = self._kept(job)
        return place if place is not None and _size(place) else None

    def belongings(self) -> list[Path]:
        """Return the job's folder, and what it has left beside a card to go on with."""
        left = self.left(self.read())
        return [self.folder] if left is None or left.is_relative_to(self.folder) else [self.folder, left]

    def _kept(self, job: Job) -> Path | None:
        """Return where a job of this kind keeps what it has finished."""
        if job.kind == "sweep":
            return self.folder / "sweep.jsonl"
        if job.kind == "heatsink":
            return place_of(self.folder)
        return None

    def last_progress(self) -> Json | None:
        """Return the last line of progress."""
        try:
            with (self.folder / "progress.jsonl").open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - _TAIL))
                lines = file.read().splitlines()
        except OSError:
            return None
        for line in reversed(lines):
            try:
                found = _plain_json(line)
            except (ValueError, RecursionError):  # cut, or being written
                continue
            if isinstance(found, dict) and found.get("event") == "progress":
                return found
        return None

    def answer(self) -> Json | None:
        """Return the job's answer; None where there is none yet."""
        try:
            found = _plain_json((self.folder / "answer.json").read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return None
        return found if isinstance(found, dict) else None

    def row(self) -> Json:
        """Return the record for a list: without the names of the runs' files, which may be thousands."""
        job = self.read()
        files = job.options.get("files")
        options = {name: value for name, value in job.options.items() if name != "files"}
        shown = self._shown(replace(job, options=options), resumable=self.left(job) is not None)
        return shown | {"file_count": len(files) if isinstance(files, list) else None}

    def shown(self) -> Json:
        """Return the record as the pages see it."""
        job = self.read()
        return self._shown(job, resumable=self.left(job) is not None)

    def _shown(self, job: Job, *, resumable: bool) -> Json:
        last = self.last_progress()
        progress = None if last is None else {key: last.get(key) for key in ("done", "of", "text")}
        return asdict(job) | {"progress": progress, "files": self.files(), "resumable": resumable}

    def files(self) -> list[Json]:
        """Return the job's own files; those that a running job has put elsewhere meanwhile are none."""
        found: dict[Path, int] = {}
        for folder, _, names in os.walk(self.folder):
            for name in names:
                size = _size(Path(folder) / name)
                if size is not None:
                    found[(Path(folder) / name).relative_to(self.folder)] = size
        return [
            {"path": name.as_posix(), "bytes": found[name]}
            for name in sorted(found)
            if str(name) not in _OWN
            and not any(part.startswith(".") for part in name.parts)
            and is_text(str(name))
        ][:_MOST_FILES]

    def _reserve(self) -> None:
        (self.folder / _RESERVE).write_bytes(b"." * _RESERVED)

    def _write(self, job: Job) -> None:
        write_object(self.folder / "job.json", asdict(job))


def _plain_json(text: str | bytes) -> Any:  # noqa: ANN401 - whatever somebody has written
    """Return what a file holds, with null for numbers that are not finite."""
    return json.loads(
        text, parse_float=lambda said: finite_or_none(float(said)), parse_constant=lambda _: None
    )


def _size(path: Path) -> int | None:
    """Return the bytes of a file, None where there is none; a link is none."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None


def write_object(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object whole or not at all."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text, ".record-")


def job_ids(results: Path) -> list[str]:
    """Return the jobs there are, the newest first."""
    found = [path for path in results.iterdir() if _ID.fullmatch(path.name) and (path / "job.json").is_file()]
    return [
        path.name for path in sorted(found, key=lambda path: (_number(path.name), path.name), reverse=True)
    ]


def new_id(results: Path, kind: str) -> str:
    """Return an id that no job has had; numbers run over all kinds, so that they tell the order."""
    thrown = results.parent.glob(f".trash/*/{results.name}/*")  # may be put back
    numbers = [_number(path.name) for path in (*results.iterdir(), *thrown) if _ID.fullmatch(path.name)]
    return f"{kind}-{max(numbers, default=0) + 1:03d}"


def _number(job_id: str) -> int:
    found = _ID.fullmatch(job_id)
    return int(found[2]) if found else 0
