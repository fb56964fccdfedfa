"""Index of the runs in the folder. Each file is read once, in its own process, and cached in ``.cache``.

Name, size and time of a file and of its channel map are its key. If one of them changes, the file is read
again. The cache may be deleted at any time.
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

_CACHE_FORMAT = "4"  # A new number makes all files be read again.
_RIG_LINE = re.compile(rb"# simulated: virtual damper ([\w-]+), seed ")
_WINDOWS_MAX_COUNT = 64  # Cached windows of a file.
_FREE_SIZE_MIN_BYTES = 16 << 20


@dataclass(frozen=True, slots=True)
class Kept:
    """A cached run."""

    file: Path
    number: int  # Index of the run in its file.
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
    rig: str | None  # Preset of the virtual rig that simulated the file; None: another source.


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contents:
    """Content of a file: ``meta.json`` in its folder of the cache.

    Attributes
    ----------
    preview : preview of the file and its runs by ``jobs.previews``
    findings : findings of each run; None before the check
    rig : preset of the virtual rig that simulated the file
    full : the disk was full, so that the content is not cached
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
        """Reason why the file cannot be read."""
        error = self.preview["error"]
        return None if error is None else str(error)

    @property
    def run_names(self) -> tuple[str, ...]:
        return tuple(run["name"] for run in self.preview["runs"])

    def runs(self) -> list[Json]:
        """Return the runs for the pages, each with its findings, worst first."""
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
    """Runs of two files have the same name."""


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
        self._known: dict[str, _Contents] = {}  # Contents by key.
        self._pending: dict[str, asyncio.Task[None]] = {}

    def key_of(self, file: Path) -> str:
        """Return the cache key of a file; it changes with the file and its channel map."""
        parts = [_CACHE_FORMAT, file.name]
        for path in (file, self._folder.map_of(file)):
            with suppress(OSError):
                found = path.stat()
                parts += [str(found.st_size), str(found.st_mtime_ns)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]

    def files(self) -> list[FileRow]:
        """Return the files with their states, and start reading new files."""
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
        """Return the runs of a file with the findings so far."""
        contents = self._look_up(self.key_of(file))
        return [] if contents is None else contents.runs()

    def knows(self, file: Path) -> bool:
        """Return True if the present version of a file has been read."""
        return self._look_up(self.key_of(file)) is not None

    async def preview(self, file: Path) -> Json:
        """Return the preview of a file after it has been read."""
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
        """Return the files whose runs can all be fitted; None while files are being read."""
        files = self.files()
        if any(row.state == "reading" for row in files):
            return None
        ready = [row.name for row in files if row.state == "ready"]
        return [name for name in ready if all(map(_is_usable, self.runs_of(self._folder.runs / name)))]

    async def find(self, name: str, file: str | None) -> Kept:
        """Return a run by its name, after all files have been read if necessary."""
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
        """Delete the cached content of a file."""
        key = self.key_of(file)
        self._known.pop(key, None)
        shutil.rmtree(self._folder.cache / key, ignore_errors=True)

    def sweep(self) -> None:
        """Delete the cached content of files that were removed or changed."""
        current = {self.key_of(file) for file in self._folder.run_files(self._formats)} | set(self._pending)
        for place in self._folder.cache.iterdir():
            if place.is_dir() and place.name not in current:
                shutil.rmtree(place, ignore_errors=True)
        self._known = {key: meta for key, meta in self._known.items() if key in current}

    def trim(self, kept: Kept) -> None:
        """Delete the older half of a file's windows if there are too many."""
        found = [*kept.place.glob("*.window"), *kept.place.glob("*.model")]
        if len(found) > _WINDOWS_MAX_COUNT:
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
            if self.key_of(file) != key:  # The file was changed during reading.
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
        """Cache the content of a file; on a full disk only in memory."""
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
        """Return True if the disk has space to read a file again."""
        return shutil.disk_usage(self._folder.cache).free > 4 * size + _FREE_SIZE_MIN_BYTES


def _rig_of(file: Path) -> str | None:
    """Return the preset that the first line of a file of the virtual rig names; None for other files."""
    with file.open("rb") as lines:
        found = _RIG_LINE.match(lines.readline(200))
    return None if found is None else found[1].decode()


def _is_usable(run: Json) -> bool:
    """Return True if a run can be fitted."""
    return bool(run["usable"]) and run["worst"] != "fault"
