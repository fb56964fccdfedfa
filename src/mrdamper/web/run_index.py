"""Which runs are in the folder's files: read once each, in a process of their own, and kept in ``.cache``.

A file is known by its name, size and time, and those of its channel map; when one of them changes it is read
again. What is kept may be deleted at any time.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mrdamper.errors import InputError
from mrdamper.schema import Json
from mrdamper.web.job_record import write_whole
from mrdamper.web.query_worker import Query
from mrdamper.web.worker_client import WorkerClient
from mrdamper.web.workspace import NoSpaceError, NotThereError, WorkFolder, is_full, timestamp

__all__ = ["Kept", "RunIndex", "SameNameError"]

_FORM = "1"  # of what is kept; another number reads everything again
_MOST_WINDOWS = 64  # of a file
_ROOM = 16 << 20  # bytes
_READ, _CHECK = 5, 9  # urgency, behind whoever waits


@dataclass(frozen=True, slots=True)
class Kept:
    """A run, and where it is kept."""

    file: Path
    number: int  # in its file
    place: Path

    @property
    def series(self) -> Path:
        return self.place / f"{self.number}.series"


class SameNameError(InputError):
    """A name that runs of two files have."""


class RunIndex:
    """The runs of one folder."""

    def __init__(
        self,
        folder: WorkFolder,
        formats: tuple[str, ...],
        reader: WorkerClient,
        checker: WorkerClient,
        changed: Callable[[str], None],
    ) -> None:
        self._folder, self._formats, self._changed = folder, formats, changed
        self._reader, self._checker = reader, checker
        self._known: dict[str, Json] = {}  # by key
        self._pending: dict[str, asyncio.Task[None]] = {}

    def key_of(self, file: Path) -> str:
        """Return what changes when a file or its channel map does."""
        parts = [_FORM, file.name]
        for path in (file, self._folder.map_of(file)):
            with suppress(OSError):
                found = path.stat()
                parts += [str(found.st_size), str(found.st_mtime_ns)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]

    def files(self) -> list[Json]:
        """Return the files and how they stand; what is new is read from now on."""
        rows = []
        for file in self._folder.run_files(self._formats):
            key = self.key_of(file)
            meta = self._look_up(key)
            size, modified = 0, 0.0
            with suppress(OSError):
                found = file.stat()
                size, modified = found.st_size, found.st_mtime
            if meta is not None and meta.get("full") and self._has_room_for(size):
                self._known.pop(key, None)
                meta = None
            if meta is None:
                self._begin(key, file)
            error = None if meta is None else meta["error"]
            rows.append(
                {
                    "name": file.name,
                    "bytes": size,
                    "modified": timestamp(modified),
                    "state": "reading" if meta is None else "unreadable" if error else "ready",
                    "runs": [] if meta is None else [run["name"] for run in meta["runs"]],
                    "error": error,
                    "mapped": self._folder.map_of(file).is_file(),
                }
            )
        return rows

    def runs(self) -> Json:
        """Return the runs of the files that have been read."""
        files = self.files()
        runs: list[Json] = []
        for row in files:
            if row["state"] == "ready":
                runs += self.runs_of(self._folder.runs / row["name"])
        short = [{key: row[key] for key in ("name", "state", "error")} for row in files]
        return {"runs": runs, "files": short, "reading": sum(row["state"] == "reading" for row in files)}

    def runs_of(self, file: Path) -> list[Json]:
        """Return the runs of a file, with what is wrong with them as far as it is known."""
        meta = self._look_up(self.key_of(file))
        if meta is None:
            return []
        found = meta.get("findings")
        rows = []
        for k, run in enumerate(meta["runs"]):
            mine = found[k] if found is not None and k < len(found) else []
            rows.append(
                {
                    **run,
                    "findings": mine,
                    "worst": mine[0]["severity"] if mine else None,
                    "checked": found is not None,
                }
            )
        return rows

    def knows(self, file: Path) -> bool:
        """Tell whether a file has been read as it is now."""
        return self._look_up(self.key_of(file)) is not None

    async def look(self, file: Path) -> Json:
        """Return what is in a file, waiting until it has been read."""
        key = self.key_of(file)
        while (meta := self._look_up(key)) is None:
            self._begin(key, file)
            await asyncio.gather(self._pending[key], return_exceptions=True)
            key = self.key_of(file)
        runs = self.runs_of(file)
        return {
            **{name: value for name, value in meta.items() if name != "file"},
            "name": file.name,
            "runs": runs,
            "findings": [finding for run in runs for finding in run["findings"]],
            "checked": meta["findings"] is not None,
        }

    def usable(self) -> list[str] | None:
        """Return the files whose runs can all be fitted; None while some are being read."""
        files = self.files()
        if any(row["state"] == "reading" for row in files):
            return None
        ready = [row["name"] for row in files if row["state"] == "ready"]
        return [
            name
            for name in ready
            if all(
                run["usable"] and run["worst"] != "fault" for run in self.runs_of(self._folder.runs / name)
            )
        ]

    async def find(self, name: str, file: str | None) -> Kept:
        """Return a run by its name, waiting for files that are being read."""
        self.files()
        kept = self._find(name, file)
        if kept is None and self._pending:
            await asyncio.gather(*self._pending.values(), return_exceptions=True)
            kept = self._find(name, file)
        if kept is None:
            raise NotThereError(f"{name[:60]!r}: no run of that name")
        if not kept.series.is_file():
            raise InputError(f"{name[:60]!r}: its channels are of different lengths, and cannot be drawn")
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
            meta = self._look_up(key)
            if meta is not None:
                found += [
                    Kept(path, k, self._folder.cache / key)
                    for k, run in enumerate(meta["runs"])
                    if run["name"] == name
                ]
        if len(found) > 1:
            said = ", ".join(kept.file.name for kept in found)
            raise SameNameError(
                f"{name[:60]!r}: runs of several files have this name ({said}); say which file"
            )
        return found[0] if found else None

    def _look_up(self, key: str) -> Json | None:
        if key in self._known:
            return self._known[key]
        try:
            meta = json.loads((self._folder.cache / key / "meta.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        self._known[key] = meta
        if meta.get("findings") is None and not meta["error"]:
            file = self._folder.runs / meta["file"]
            if key not in self._pending and self.key_of(file) == key:
                self._pending[key] = asyncio.create_task(self._check(key, file))
        return self._known[key]

    def _begin(self, key: str, file: Path) -> None:
        if key not in self._pending:
            self._pending[key] = asyncio.create_task(self._read(key, file))

    async def _read(self, key: str, file: Path) -> None:
        place = self._folder.cache / key
        try:
            try:
                query = Query("runs", {"path": file, "place": place})
                meta = await self._reader.ask(query, urgency=_READ)
            except NoSpaceError as fault:
                shutil.rmtree(place, ignore_errors=True)
                meta = {"runs": [], "columns": [], "error": f"{file.name}: {fault}", "full": True}
            except InputError as fault:
                meta = {"runs": [], "columns": [], "error": f"{file.name}: {fault}"}
            meta |= {"file": file.name, "findings": None}
            if self.key_of(file) != key:  # it has changed meanwhile
                shutil.rmtree(place, ignore_errors=True)
                return
            self._write(key, meta)
        finally:
            self._pending.pop(key, None)
            self._changed("files")
        if not self._pending:
            self.sweep()
        if not meta["error"]:
            self._pending[key] = asyncio.create_task(self._check(key, file))

    async def _check(self, key: str, file: Path) -> None:
        try:
            found = await self._checker.ask(Query("findings", {"path": file}), urgency=_CHECK)
        except (InputError, NoSpaceError):
            found = {"findings": []}
        finally:
            self._pending.pop(key, None)
        if self.key_of(file) == key and key in self._known:
            self._write(key, {**self._known[key], **found})
            self._changed("files")

    def _write(self, key: str, meta: Json) -> None:
        """Keep what is known of a file; on a full disk in memory alone."""
        self._known[key] = meta
        if meta.get("full"):
            return
        place = self._folder.cache / key
        try:
            place.mkdir(parents=True, exist_ok=True)
            write_whole(place / "meta.json", meta)
        except OSError as fault:
            if not is_full(fault):
                raise

    def _has_room_for(self, size: int) -> bool:
        """Tell whether what a full disk stopped may be tried again."""
        return shutil.disk_usage(self._folder.cache).free > 4 * size + _ROOM
