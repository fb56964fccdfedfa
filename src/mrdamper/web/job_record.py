"""Record of a job: request, state, times and progress, in the folder of the job.

    job.json        one object; the server writes request and cancellation, the worker writes start and end
    progress.jsonl  one line for each message and progress step
    answer.json     the output of ``mrdamper KIND --json``

A restarted server needs only these files. A small reserve file is created with the record, so that the end of
a job can be written on a full disk.
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
from mrdamper.jobs.sweep.store import RESULTS_FILE
from mrdamper.schema import Json, finite_or_none, read_record
from mrdamper.web.workspace import NotThereError, is_text, now, write_whole

GRACE_S = 3.0
"""Time between the interrupt and the kill of a job."""

EndState = Literal["done", "failed", "cancelled", "interrupted"]

_ID = re.compile(r"([a-z]+)-(\d{3,6})")
_OWN = frozenset({"job.json", "progress.jsonl", "answer.json"})
_TAIL_SIZE_BYTES = 4096  # The last progress line is shorter.
_FILES_MAX_COUNT = 500
_RESERVE = ".reserve"
_RESERVE_SIZE_BYTES = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Content of ``job.json``.

    Attributes
    ----------
    options : validated options of the request
    message : reason of the end
    card : name of the card that the job writes
    resumed : number of resumes
    pid : id of the process
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
        """Return True if the job has ended."""
        return self.state not in {"queued", "running"}


class JobRecord:
    """The files of one job."""

    def __init__(self, results: Path, job_id: str) -> None:
        if not _ID.fullmatch(job_id):
            raise NotThereError(place=f"{job_id[:60]!r}", found="no job of that name")
        self.id = job_id
        self.folder = results / job_id

    def open(self, kind: str, options: Mapping[str, Any], card: str | None) -> None:
        """Create the record of a request; remove it if a file cannot be written."""
        self.folder.mkdir()
        try:
            self._reserve()
            self._write(Job(id=self.id, kind=kind, options=dict(options), asked_at=now(), card=card))
        except OSError:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def reopen(self) -> None:
        """Queue the record of a job again that ended early."""
        job = self.read()
        self._reserve()
        (self.folder / "answer.json").unlink(missing_ok=True)
        again = replace(job, state="queued", started_at=None, ended_at=None, message=None)
        self._write(replace(again, resumed=job.resumed + 1))

    def read(self) -> Job:
        """Return the record; raise NotThereError if it is missing or invalid."""
        try:
            found = _plain_json((self.folder / "job.json").read_text(encoding="utf-8"))
            job = read_record(Job, found, self.id)
        except (OSError, ValueError, RecursionError, InputError) as fault:
            raise NotThereError(place=f"{self.id!r}", found="no job of that name") from fault
        if job.id != self.id:
            raise NotThereError(place=f"{self.id!r}", found="no job of that name")
        return job

    def begin(self) -> None:
        """Write the start of the job and the id of this process."""
        self._write(replace(self.read(), state="running", started_at=now(), pid=os.getpid()))

    def end(self, state: EndState, message: str | None = None) -> None:
        """Write the end of the job."""
        (self.folder / _RESERVE).unlink(missing_ok=True)
        self._write(replace(self.read(), state=state, ended_at=now(), message=message))

    def is_resumable(self, job: Job) -> bool:
        """Return True for a sweep that ended early and has finished some tasks."""
        ended_early = job.has_ended and job.state != "done"
        return job.kind == "sweep" and ended_early and bool(_size(self.folder / RESULTS_FILE))

    def last_progress(self) -> Json | None:
        """Return the last line of progress."""
        try:
            with (self.folder / "progress.jsonl").open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - _TAIL_SIZE_BYTES))
                lines = file.read().splitlines()
        except OSError:
            return None
        for line in reversed(lines):
            try:
                found = _plain_json(line)
            except (ValueError, RecursionError):  # The line is incomplete.
                continue
            if isinstance(found, dict) and found.get("event") == "progress":
                return found
        return None

    def answer(self) -> Json | None:
        """Return the answer of the job; None if it has no answer yet."""
        try:
            found = _plain_json((self.folder / "answer.json").read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return None
        return found if isinstance(found, dict) else None

    def row(self) -> Json:
        """Return the record for a list, without the names of the run files, which may be thousands."""
        job = self.read()
        files = job.options.get("files")
        options = {name: value for name, value in job.options.items() if name != "files"}
        shown = self._shown(replace(job, options=options), resumable=self.is_resumable(job))
        return shown | {"file_count": len(files) if isinstance(files, list) else None}

    def shown(self) -> Json:
        """Return the record for the pages."""
        job = self.read()
        return self._shown(job, resumable=self.is_resumable(job))

    def _shown(self, job: Job, *, resumable: bool) -> Json:
        last = self.last_progress()
        progress = None if last is None else {key: last.get(key) for key in ("done", "of", "text")}
        return asdict(job) | {"progress": progress, "files": self.files(), "resumable": resumable}

    def files(self) -> list[Json]:
        """Return path and size of the job's files; files that a running job has moved are ignored."""
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
        ][:_FILES_MAX_COUNT]

    def _reserve(self) -> None:
        (self.folder / _RESERVE).write_bytes(b"." * _RESERVE_SIZE_BYTES)

    def _write(self, job: Job) -> None:
        write_object(self.folder / "job.json", asdict(job))


def _plain_json(text: str | bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Return the JSON value of a text, with None for numbers that are not finite."""
    return json.loads(
        text, parse_float=lambda said: finite_or_none(float(said)), parse_constant=lambda _: None
    )


def _size(path: Path) -> int | None:
    """Return the size of a file [bytes]; None if it is missing or a link."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None


def write_object(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object atomically."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text, ".record-")


def job_ids(results: Path) -> list[str]:
    """Return the ids of all jobs, newest first."""
    found = [path for path in results.iterdir() if _ID.fullmatch(path.name) and (path / "job.json").is_file()]
    return [
        path.name for path in sorted(found, key=lambda path: (_number(path.name), path.name), reverse=True)
    ]


def new_id(results: Path, kind: str) -> str:
    """Return an unused id; all kinds share one count, so that the numbers show the order."""
    thrown = results.parent.glob(f".trash/*/{results.name}/*")  # Removed jobs can be restored.
    numbers = [_number(path.name) for path in (*results.iterdir(), *thrown) if _ID.fullmatch(path.name)]
    return f"{kind}-{max(numbers, default=0) + 1:03d}"


def _number(job_id: str) -> int:
    found = _ID.fullmatch(job_id)
    return int(found[2]) if found else 0
