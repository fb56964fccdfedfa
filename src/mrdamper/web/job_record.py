"""A job's record: what was asked, how it stands, when, and what it has said so far, as files beside its own.

    job.json        one object, written whole: by the server when it asks and stops, by the worker as it goes
    progress.jsonl  one line for each thing said while it runs
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
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mrdamper.runtime.checkpoint import place_of
from mrdamper.schema import Json
from mrdamper.web.workspace import NotThereError, now

__all__ = ["ENDED", "JobRecord", "job_ids", "new_id", "write_whole"]

ENDED = frozenset({"done", "failed", "cancelled", "interrupted"})

_ID = re.compile(r"([a-z]+)-(\d{3,6})")
_OWN = frozenset({"job.json", "progress.jsonl", "answer.json"})
_TAIL = 4096  # bytes in which the last line of progress is looked for
_MOST_FILES = 500
_RESERVE = ".reserve"
_RESERVED = 8192  # bytes


class JobRecord:
    """The files of one job."""

    def __init__(self, results: Path, job_id: str) -> None:
        if not _ID.fullmatch(job_id):
            raise NotThereError(f"{job_id[:60]!r}: no job of that name")
        self.id = job_id
        self.folder = results / job_id

    def open(self, kind: str, options: Mapping[str, Any], card: str | None) -> None:
        """Write down what was asked, or nothing at all."""
        self.folder.mkdir()
        try:
            self._reserve()
            self._write(
                {
                    "id": self.id,
                    "kind": kind,
                    "options": dict(options),
                    "state": "queued",
                    "asked_at": now(),
                    "started_at": None,
                    "ended_at": None,
                    "message": None,
                    "card": card,
                    "resumed": 0,
                }
            )
        except OSError:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def reopen(self) -> None:
        """Write down that a job which ended early is asked for again, to go on from there."""
        found = self.read()
        self._reserve()
        (self.folder / "answer.json").unlink(missing_ok=True)
        again = {"state": "queued", "started_at": None, "ended_at": None, "message": None}
        self._write(found | again | {"resumed": int(found.get("resumed") or 0) + 1})

    def read(self) -> Json:
        """Return the record; one that cannot be read counts as none."""
        try:
            found = json.loads((self.folder / "job.json").read_text(encoding="utf-8"))
        except (OSError, ValueError) as fault:
            raise NotThereError(f"{self.id!r}: no job of that name") from fault
        if not isinstance(found, dict) or found.get("id") != self.id or "state" not in found:
            raise NotThereError(f"{self.id!r}: no job of that name")
        return found

    def begin(self) -> None:
        self._write(self.read() | {"state": "running", "started_at": now(), "pid": os.getpid()})

    def end(self, state: str, message: str | None = None) -> None:
        (self.folder / _RESERVE).unlink(missing_ok=True)
        self._write(self.read() | {"state": state, "ended_at": now(), "message": message})

    def left(self, found: Json) -> Path | None:
        """Return what a job that ended early has finished so far, for kinds that can go on from there.

        A fit may be done, and have been stopped before all that was to follow it.
        """
        if found["state"] not in ENDED or (found["state"] == "done" and found["kind"] == "sweep"):
            return None
        place = self._kept(found)
        return place if place is not None and _size(place) else None

    def forget(self) -> None:
        """Delete the job's files, and what it has left to go on with."""
        left = self.left(self.read())
        shutil.rmtree(self.folder, ignore_errors=True)
        if left is not None:
            left.unlink(missing_ok=True)

    def _kept(self, found: Json) -> Path | None:
        """Return where a job of this kind keeps what it has finished."""
        if found["kind"] == "sweep":
            return self.folder / "sweep.jsonl"
        if found["kind"] == "sink":
            return place_of(self.folder)
        card = found.get("card")
        if found["kind"] == "identify" and isinstance(card, str) and Path(card).name == card:
            return place_of(self.folder.parent.parent / "cards" / card)
        return None

    def said(self) -> Json | None:
        """Return the last line of progress."""
        try:
            with (self.folder / "progress.jsonl").open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - _TAIL))
                lines = file.read().splitlines()
        except OSError:
            return None
        for line in reversed(lines):
            try:
                found = json.loads(line)
            except ValueError:  # cut, or being written
                continue
            if isinstance(found, dict) and found.get("event") == "progress":
                return found
        return None

    def answer(self) -> Json | None:
        try:
            found = json.loads((self.folder / "answer.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def row(self) -> Json:
        """Return the record for a list: without the names of the runs' files, which may be thousands."""
        found = self.shown()
        options = dict(found["options"])
        files = options.pop("files", None)
        return {**found, "options": options, "file_count": None if files is None else len(files)}

    def shown(self) -> Json:
        """Return the record as the pages see it."""
        found, said = self.read(), self.said()
        progress = None if said is None else {key: said.get(key) for key in ("done", "of", "text")}
        return {
            **found,
            "progress": progress,
            "files": self.files(),
            "resumable": self.left(found) is not None,
        }

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
            if str(name) not in _OWN and not any(part.startswith(".") for part in name.parts)
        ][:_MOST_FILES]

    def _reserve(self) -> None:
        (self.folder / _RESERVE).write_bytes(b"." * _RESERVED)

    def _write(self, value: Json) -> None:
        write_whole(self.folder / "job.json", value)


def _size(path: Path) -> int | None:
    """Return the bytes of a file, None where there is none; a link is none."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None


def write_whole(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object so that whoever reads it sees the old one or the new one."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    handle, name = tempfile.mkstemp(prefix=".record-", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def job_ids(results: Path) -> list[str]:
    """Return the jobs there are, the newest first."""
    found = [path for path in results.iterdir() if _ID.fullmatch(path.name) and (path / "job.json").is_file()]
    return [
        path.name for path in sorted(found, key=lambda path: (_number(path.name), path.name), reverse=True)
    ]


def new_id(results: Path, kind: str) -> str:
    """Return an id that no job has had; numbers run over all kinds, so that they tell the order."""
    numbers = [_number(path.name) for path in results.iterdir() if _ID.fullmatch(path.name)]
    return f"{kind}-{max(numbers, default=0) + 1:03d}"


def _number(job_id: str) -> int:
    found = _ID.fullmatch(job_id)
    return int(found[2]) if found else 0
