"""Record of a job: request, state, times and progress, in the folder of the job.

    job.json        request, state and times; written by the server and by the process of the job
    progress.json   the last progress step
    answer.json     the output of ``mrdamper KIND --json``

A restarted server needs only these files. A small file (.reserve) occupies disk space while the job runs. The
file is deleted before the final state is written, so that the final state fits even on a full disk.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from mrdamper.errors import InputError
from mrdamper.jobs.sweep.store import RESULTS_FILE
from mrdamper.schema import Json, read_record
from mrdamper.web.workspace import NotThereError, is_text, now, write_whole

GRACE_S = 3.0
"""Time from interrupting a job to killing its processes [s]."""

SERVER_STOPPED = "the server was stopped before the job was done"

EndState = Literal["done", "failed", "cancelled", "interrupted"]

_ID = re.compile(r"([a-z]+)-(\d{3,6})")
_OWN = frozenset({"job.json", "progress.json", "answer.json"})
_FILES_MAX_COUNT = 500
_RESERVE_SIZE_BYTES = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Content of ``job.json``."""

    id: str
    kind: str
    options: dict[str, Any]  # validated options of the request
    state: Literal["queued", "running"] | EndState = "queued"
    asked_at: str
    started_at: str | None = None
    ended_at: str | None = None
    message: str | None = None  # reason why the job ended
    card: str | None = None  # name of the card that the job writes
    resumed: int = 0  # how many times the job was resumed
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
        """Create the record of a job request. If a file cannot be written, remove the record."""
        self.folder.mkdir()
        try:
            self._queue(Job(id=self.id, kind=kind, options=dict(options), asked_at=now(), card=card))
        except OSError:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def reopen(self) -> None:
        """Set the state of a job that ended early to ``queued``."""
        job = self.read()
        (self.folder / "answer.json").unlink(missing_ok=True)
        again = replace(job, state="queued", started_at=None, ended_at=None, message=None)
        self._queue(replace(again, resumed=job.resumed + 1))

    def read(self) -> Job:
        """Return the content of ``job.json``; raise NotThereError if the file is invalid."""
        try:
            found = json.loads((self.folder / "job.json").read_text(encoding="utf-8"))
            return replace(read_record(Job, found, self.id), id=self.id)
        except (OSError, ValueError, InputError) as fault:
            raise NotThereError(place=f"{self.id!r}", found="no job of that name") from fault

    def begin(self) -> None:
        """Record the start of the job in this process."""
        self._write(replace(self.read(), state="running", started_at=now(), pid=os.getpid()))

    def end(self, state: EndState, message: str | None = None) -> None:
        """Record the end of the job."""
        (self.folder / ".reserve").unlink(missing_ok=True)
        self._write(replace(self.read(), state=state, ended_at=now(), message=message))

    def is_resumable(self, job: Job) -> bool:
        """Return True for a sweep that ended early and has finished some tasks."""
        ended_early = job.has_ended and job.state != "done"
        return job.kind == "sweep" and ended_early and bool(_size(self.folder / RESULTS_FILE))

    def content(self, name: str) -> Any:  # noqa: ANN401 - any JSON
        """Return the content of a JSON file of the job; None if the file is missing."""
        with suppress(OSError, ValueError):
            return json.loads((self.folder / name).read_text(encoding="utf-8"))
        return None

    def shown(self) -> Json:
        """Return the record as JSON for the pages."""
        job = self.read()
        progress = None if job.has_ended else self.content("progress.json")
        more = {"progress": progress, "files": self._files(), "resumable": self.is_resumable(job)}
        return asdict(job) | more

    def _files(self) -> list[Json]:
        """Return path and size of output files; files that disappear are omitted."""
        rows = []
        for folder, _, names in os.walk(self.folder):
            for path in (Path(folder) / name for name in names):
                name, size = path.relative_to(self.folder), _size(path)
                is_hidden = any(part.startswith(".") for part in name.parts)
                if size is not None and str(name) not in _OWN and not is_hidden and is_text(str(name)):
                    rows.append({"path": name.as_posix(), "bytes": size})
        return sorted(rows, key=lambda row: str(row["path"]))[:_FILES_MAX_COUNT]

    def _queue(self, job: Job) -> None:
        (self.folder / ".reserve").write_bytes(b"." * _RESERVE_SIZE_BYTES)
        self._write(job)

    def _write(self, job: Job) -> None:
        write_object(self.folder / "job.json", asdict(job))


def _size(path: Path) -> int | None:
    """Return the size of a file [bytes]; None if it is missing or a link."""
    with suppress(OSError):
        found = path.lstat()
        return found.st_size if stat.S_ISREG(found.st_mode) else None
    return None


def write_object(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object atomically."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text)


def job_ids(results: Path) -> list[str]:
    """Return the ids of all jobs, newest first."""
    names = [path.name for path in results.iterdir() if (path / "job.json").is_file()]
    return sorted(filter(_number, names), key=lambda name: (_number(name), name), reverse=True)


def new_id(results: Path, kind: str) -> str:
    """Return a new job id, such as fit-004, with a larger number than all other ids."""
    # Jobs in the trash keep their ids because they can be restored.
    thrown = results.parent.glob(f".trash/*/{results.name}/*")
    numbers = [_number(path.name) for path in (*results.iterdir(), *thrown)]
    return f"{kind}-{max(numbers, default=0) + 1:03d}"


def _number(job_id: str) -> int:
    """Return the number in a job id; 0 if the text is not a job id."""
    found = _ID.fullmatch(job_id)
    return int(found[2]) if found else 0
