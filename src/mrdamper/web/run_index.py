"""Which runs are in the folder's files: read once each, in a process of their own, and kept in ``.cache``.

A file is known by its name, size and time, and those of its channel map; when one of them changes it is read
again. What is kept may be deleted at any time.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from mrdamper.errors import InputError
from mrdamper.schema import Json, read_record
from mrdamper.web.job_record import write_object
from mrdamper.web.query_worker import Query
from mrdamper.web.worker_client import WorkerClient
from mrdamper.web.workspace import NoSpaceError, NotThereError, WorkFolder, is_full, timestamp

_FORM = "4"  # of what is kept; another number reads everything again
_RIG_LINE = re.compile(rb"# simulated: virtual damper ([\w-]+), seed ")
_MOST_WINDOWS = 64  # of a file
_ROOM = 16 << 20  # bytes


@dataclass(frozen=True, slots=True)
class Kept:
    """A run, and where it is kept."""

    file: Path
    number: int  # in its file
    place: Path

    @property
    def series(self) -> Path:
        """Samples of the run, for drawing."""
        return self.place / f"{self.number}.series"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileRow:
    """A file in the list of measured files."""

    name: str
    bytes: int
    modified: str
    state: Literal["reading", "unreadable", "ready"]
    runs: tuple[str, ...]
    error: str | None
    mapped: bool
    rig: str | None  # preset of the virtual rig that made the file; None: another source


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contents:
    """What a file holds: ``meta.json`` in its folder of the cache.

    Attributes
    ----------
    preview : of the file and its runs, as ``jobs.preview`` makes it
    findings : of each run; None until they have been looked for
    full : the disk was full; not kept
    """

    file: str
    preview: dict[str, Any]
    findings: list[list[dict[str, Any]]] | None = None
    rig: str | None = None
    full: bool = False

    @classmethod
    def unreadable(cls, file: str, why: str, *, full: bool = False) -> _Contents:
        return cls(file=file, preview={"runs": [], "columns": [], "error": f"{file}: {why}"}, full=full)

    @property
    def error(self) -> str | None:
        """Why it cannot be read."""
        error = self.preview["error"]
        return None if error is None else str(error)

    @property
    def run_names(self) -> tuple[str, ...]:
        return tuple(run["name"] for run in self.preview["runs"])

    def runs(self) -> list[Json]:
        """Return the runs as the pages see them: each with its findings, the worst first."""
        rows: list[Json] = []
        for k, run in enumerate(self.preview["runs"]):
            findings = self.findings[k] if self.findings is not None and k < len(self.findings) else []
            rows.append(
                {
                    **run,
                    "findings": findings,
                    "worst": findings[0]["severity"] if findings else None,
                    "checked": self.findings is not None,
                }
            )
        return rows


class SameNameError(InputError):
    """A name that runs of two files have."""


class RunIndex:
    """The runs of one folder."""

    def __init__(
        self,
        folder: WorkFolder,
        formats: tuple[str, ...],
        reader: WorkerClient,
        changed: Callable[[str], None],
    ) -> None:
        self._folder, self._formats, self._changed = folder, formats, changed
        self._reader = reader
        self._known: dict[str, _Contents] = {}  # by key
        self._pending: dict[str, asyncio.Task[None]] = {}

    def key_of(self, file: Path) -> str:
        """Return what changes when a file or its channel map does."""
        parts = [_FORM, file.name]
        for path in (file, self._folder.map_of(file)):
            with suppress(OSError):
                found = path.stat()
                parts += [str(found.st_size), str(found.st_mtime_ns)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]

    def files(self) -> list[FileRow]:
        """Return the files and how they stand; what is new is read from now on."""
        return [self._row(file) for file in self._folder.run_files(self._formats)]

    def _row(self, file: Path) -> FileRow:
        key = self.key_of(file)
        contents = self._look_up(key)
        size, modified = 0, 0.0
        with suppress(OSError):
            found = file.stat()
            size, modified = found.st_size, found.st_mtime
        if contents is not None and contents.full and self._has_room_for(size):
            self._known.pop(key, None)
            contents = None
        if contents is None:
            self._begin(key, file)
        return FileRow(
            name=file.name,
            bytes=size,
            modified=timestamp(modified),
            state="reading" if contents is None else "unreadable" if contents.error else "ready",
            runs=() if contents is None else contents.run_names,
            error=None if contents is None else contents.error,
            rig=None if contents is None else contents.rig,
            mapped=self._folder.map_of(file).is_file(),
        )

    def runs(self) -> Json:
        """Return the runs of the files that have been read."""
        files = self.files()
        ready = [self._folder.runs / row.name for row in files if row.state == "ready"]
        return {
            "runs": [run for file in ready for run in self.runs_of(file)],
            "files": [{"name": row.name, "state": row.state, "error": row.error} for row in files],
            "reading": sum(row.state == "reading" for row in files),
        }

    def runs_of(self, file: Path) -> list[Json]:
        """Return the runs of a file, with what is wrong with them as far as it is known."""
        contents = self._look_up(self.key_of(file))
        return [] if contents is None else contents.runs()

    def knows(self, file: Path) -> bool:
        """Tell whether a file has been read as it is now."""
        return self._look_up(self.key_of(file)) is not None

    async def preview(self, file: Path) -> Json:
        """Return what is in a file, waiting until it has been read."""
        key = self.key_of(file)
        while (contents := self._look_up(key)) is None:
            self._begin(key, file)
            await asyncio.gather(self._pending[key], return_exceptions=True)
            key = self.key_of(file)
        runs = contents.runs()
        return {
            **contents.preview,
            "name": file.name,
            "runs": runs,
            "findings": [finding for run in runs for finding in run["findings"]],
            "checked": contents.findings is not None,
        }

    def usable(self) -> list[str] | None:
        """Return the files whose runs can all be fitted; None while some are being read."""
        files = self.files()
        if any(row.state == "reading" for row in files):
            return None
        ready = [row.name for row in files if row.state == "ready"]
        return [name for name in ready if all(map(_is_usable, self.runs_of(self._folder.runs / name)))]

    async def find(self, name: str, file: str | None) -> Kept:
        """Return a run by its name, waiting for files that are being read."""
        self.files()
        kept = self._find(name, file)
        if kept is None and self._pending:
            await asyncio.gather(*self._pending.values(), return_exceptions=True)
            kept = self._find(name, file)
        if kept is None:
            raise NotThereError(place=f"{name[:60]!r}", found="no run of that name")
        if not kept.series.is_file():
            raise InputError(
                place=f"{name[:60]!r}", found="its channels are of different lengths, and cannot be drawn"
            )
        return kept

    def forget(self, file: Path) -> None:
        """Drop what was kept of a file."""
        key = self.key_of(file)
        self._known.pop(key, None)
        shutil.rmtree(self._folder.cache / key, ignore_errors=True)

    def sweep(self) -> None:
        """Delete what is kept of files that are no more, or have changed since."""
        current = {self.key_of(file) for file in self._folder.run_files(self._formats)} | set(self._pending)
        for place in self._folder.cache.iterdir():
            if place.is_dir() and place.name not in current:
                shutil.rmtree(place, ignore_errors=True)
        self._known = {key: meta for key, meta in self._known.items() if key in current}

    def trim(self, kept: Kept) -> None:
        """Delete the oldest windows of a file, where there are many."""
        found = [*kept.place.glob("*.window"), *kept.place.glob("*.model")]
        if len(found) > _MOST_WINDOWS:
            for old in sorted(found, key=lambda path: path.stat().st_mtime)[: len(found) // 2]:
                old.unlink(missing_ok=True)

    async def close(self) -> None:
        for task in self._pending.values():
            task.cancel()
        await asyncio.gather(*self._pending.values(), return_exceptions=True)

    def _find(self, name: str, file: str | None) -> Kept | None:
        found = []
        names: Iterable[Path] = self._folder.run_files(self._formats)
        for path in names:
            if file is not None and path.name != file:
                continue
            key = self.key_of(path)
            contents = self._look_up(key)
            if contents is not None:
                place = self._folder.cache / key
                found += [Kept(path, k, place) for k, run in enumerate(contents.run_names) if run == name]
        if len(found) > 1:
            said = ", ".join(kept.file.name for kept in found)
            raise SameNameError(
                place=f"{name[:60]!r}", found=f"runs of several files have this name ({said}); say which file"
            )
        return found[0] if found else None

    def _look_up(self, key: str) -> _Contents | None:
        if key in self._known:
            return self._known[key]
        try:
            document = json.loads((self._folder.cache / key / "meta.json").read_text(encoding="utf-8"))
            contents = read_record(_Contents, document, key)
        except (OSError, ValueError, InputError):
            return None
        self._known[key] = contents
        if contents.findings is None and not contents.error:
            file = self._folder.runs / contents.file
            if key not in self._pending and self.key_of(file) == key:
                self._pending[key] = asyncio.create_task(self._check(key, file))
        return contents

    def _begin(self, key: str, file: Path) -> None:
        if key not in self._pending:
            self._pending[key] = asyncio.create_task(self._read(key, file))

    async def _read(self, key: str, file: Path) -> None:
        place = self._folder.cache / key
        try:
            try:
                query = Query("runs", {"path": file, "place": place})
                preview = await self._reader.ask(query)
                contents = _Contents(file=file.name, preview=preview, rig=_rig_of(file))
            except NoSpaceError as fault:
                shutil.rmtree(place, ignore_errors=True)
                contents = _Contents.unreadable(file.name, str(fault), full=True)
            except InputError as fault:
                contents = _Contents.unreadable(file.name, str(fault))
            if self.key_of(file) != key:  # it has changed meanwhile
                shutil.rmtree(place, ignore_errors=True)
                return
            self._write(key, contents)
        finally:
            self._pending.pop(key, None)
            self._changed("files")
        if not self._pending:
            self.sweep()
        if not contents.error:
            self._pending[key] = asyncio.create_task(self._check(key, file))

    async def _check(self, key: str, file: Path) -> None:
        try:
            found = await self._reader.ask(Query("findings", {"path": file}))
        except (InputError, NoSpaceError):
            found = {"findings": []}
        finally:
            self._pending.pop(key, None)
        if self.key_of(file) == key and key in self._known:
            self._write(key, replace(self._known[key], findings=found["findings"]))
            self._changed("files")

    def _write(self, key: str, contents: _Contents) -> None:
        """Keep what is known of a file; on a full disk in memory alone."""
        self._known[key] = contents
        if contents.full:
            return
        place = self._folder.cache / key
        try:
            place.mkdir(parents=True, exist_ok=True)
            write_object(place / "meta.json", asdict(contents))
        except OSError as fault:
            if not is_full(fault):
                raise

    def _has_room_for(self, size: int) -> bool:
        """Tell whether what a full disk stopped may be tried again."""
        return shutil.disk_usage(self._folder.cache).free > 4 * size + _ROOM


def _rig_of(file: Path) -> str | None:
    """Return the preset that the first line of a file of the virtual rig names; None for other files."""
    with file.open("rb") as lines:
        found = _RIG_LINE.match(lines.readline(200))
    return None if found is None else found[1].decode()


def _is_usable(run: Json) -> bool:
    """Whether a run can be fitted."""
    return bool(run["usable"]) and run["worst"] != "fault"
