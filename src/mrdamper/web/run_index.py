"""Index of the runs in the work folder. Each file is read once, in a separate process, and cached.

The cache key of a file consists of name, size and modification time of the file and of its channel map. If
one of these values changes, the file is read again. The cache (folder ``.cache``) may be deleted at any time.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import shutil
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError
from mrdamper.jobs.previews.compare import compare_rows
from mrdamper.schema import Json, read_record
from mrdamper.web.job_record import write_object
from mrdamper.web.queries import QueryLine
from mrdamper.web.workspace import ConflictError, NoSpaceError, NotThereError, WorkFolder, is_full, timestamp

_CACHE_FORMAT = "5"  # If this number changes, all files are read again.
_RIG_LINE = re.compile(rb"# simulated: virtual damper ([\w-]+), seed ")
_WINDOWS_MAX_COUNT = 64  # max number of cached plots (time ranges, model forces) of a file
_RETRY_S = 30.0  # If the disk is full, the attempt to read a file is repeated after this time.


@dataclass(frozen=True, slots=True)
class CachedRun:
    """Run of a measured file, with its index in the file and its cache folder."""

    file: Path
    number: int
    place: Path

    @property
    def series(self) -> Path:
        """Path of the cached samples of the run, which are used for plots."""
        return self.place / f"{self.number}.series"

    def trim(self) -> None:
        """Delete the older half of the cached plots of the file if there are too many."""
        windows = [*self.place.glob("*.window"), *self.place.glob("*.model")]
        if len(windows) > _WINDOWS_MAX_COUNT:
            for old in sorted(windows, key=lambda path: path.stat().st_mtime)[: len(windows) // 2]:
                old.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contents:
    """Description of a measured file and its runs: ``meta.json`` in the cache folder of the file."""

    file: str
    preview: dict[str, Any]  # result of ``jobs.previews.series.keep_runs``
    findings: list[list[dict[str, Any]]] | None = None  # None until the runs have been checked
    rig: str | None = None  # preset of the virtual rig that simulated the file

    @property
    def names(self) -> list[str]:
        """Names of the runs."""
        return [run["name"] for run in self.preview["runs"]]

    @property
    def is_usable(self) -> bool:
        """Return True if all runs can be fitted."""
        is_good = all(run["usable"] and run["worst"] != "fault" for run in self.runs())
        return is_good and not self.preview["error"]

    def runs(self) -> list[Json]:
        """Return the runs as JSON for the pages, each with its findings (worst finding first)."""
        runs = self.preview["runs"]
        findings = [*(self.findings or ()), *([] for _ in runs)]
        checked = self.findings is not None
        return [
            {**run, "findings": own, "worst": own[0]["severity"] if own else None, "checked": checked}
            for run, own in zip(runs, findings, strict=False)
        ]


class RunIndex:
    """Index of the runs of one folder. ``changes`` increases whenever a file has been read or checked."""

    def __init__(self, folder: WorkFolder, formats: tuple[str, ...]) -> None:
        self._folder, self._formats = folder, formats
        self._queries = QueryLine()
        self._contents: dict[str, _Contents] = {}  # The keys are cache keys.
        self._pending: dict[str, asyncio.Task[None]] = {}
        self.changes = 0

    def files(self) -> list[Json]:
        """Start reading new files; return one row per file with the state of the file."""
        rows = []
        for file in self._run_files():
            with suppress(FileNotFoundError):  # The file was deleted.
                rows.append(self._row(file))
        return rows

    def runs(self) -> Json:
        """Return the runs of all files read so far, and the number of files that are still being read."""
        contents = self._read_contents()
        runs = [run for one in contents.values() if one is not None for run in one.runs()]
        return {"runs": compare_rows(runs), "reading": sum(one is None for one in contents.values())}

    def usable(self) -> list[str] | None:
        """Return the names of the files whose runs can all be fitted; None while files are being read."""
        contents = self._read_contents()
        if None in contents.values():
            return None
        return [file.name for file, one in contents.items() if one is not None and one.is_usable]

    def has_read(self, file: Path) -> bool:
        """Return True if a file has been read since its last change."""
        return self._look_up(self._key_of(file)) is not None

    async def preview(self, file: Path) -> Json:
        """Return the preview of a file after it has been read."""
        while (contents := self._read(file)) is None:
            await asyncio.wait(self._pending.values(), return_when=asyncio.FIRST_COMPLETED)
        runs = contents.runs()
        findings = [finding for run in runs for finding in run["findings"]]
        return {**contents.preview, "name": file.name, "runs": runs, "findings": findings}

    async def find(self, name: str, file: str | None) -> CachedRun:
        """Return the run with this name. If necessary, wait until all files have been read."""
        self.files()
        run = self._find(name, file)
        if run is None and self._pending:
            await asyncio.gather(*self._pending.values(), return_exceptions=True)
            run = self._find(name, file)
        if run is None:
            raise NotThereError(place=f"{name[:60]!r}", found="no run of that name")
        if not run.series.is_file():
            words = "its channels are of different lengths, and cannot be drawn"
            raise InputError(words, place=f"{name[:60]!r}")
        return run

    def forget(self, file: Path) -> None:
        """Delete the cached content of a file."""
        key = self._key_of(file)
        self._contents.pop(key, None)
        shutil.rmtree(self._folder.cache / key, ignore_errors=True)

    def sweep(self) -> None:
        """Delete the cached content of files that were removed or changed."""
        current = {self._key_of(file) for file in self._run_files()} | set(self._pending)
        for place in self._folder.cache.iterdir():
            if place.is_dir() and place.name not in current:
                shutil.rmtree(place, ignore_errors=True)
        self._contents = {key: contents for key, contents in self._contents.items() if key in current}

    async def close(self) -> None:
        for task in self._pending.values():
            task.cancel()
        await asyncio.gather(*self._pending.values(), return_exceptions=True)

    def _run_files(self) -> list[Path]:
        return self._folder.run_files(self._formats)

    def _key_of(self, file: Path) -> str:
        """Return the cache key of a file, which changes if the file or its channel map changes."""
        parts = [_CACHE_FORMAT, file.name]
        for path in (file, self._folder.map_of(file)):
            with suppress(OSError):
                found = path.stat()
                parts += [str(found.st_size), str(found.st_mtime_ns)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]

    def _row(self, file: Path) -> Json:
        contents = self._read(file)
        found = file.stat()
        return {
            "name": file.name,
            "bytes": found.st_size,
            "modified": timestamp(found.st_mtime),
            "state": "reading"
            if contents is None
            else "unreadable"
            if contents.preview["error"]
            else "ready",
            "runs": contents and contents.names,
            "error": contents and contents.preview["error"],
            "rig": contents and contents.rig,
            "mapped": self._folder.map_of(file).is_file(),
        }

    def _read_contents(self) -> dict[Path, _Contents | None]:
        return {file: self._read(file) for file in self._run_files()}

    def _find(self, name: str, file: str | None) -> CachedRun | None:
        runs = []
        for path in self._run_files():
            key = self._key_of(path)
            contents = self._look_up(key)
            if contents is not None and file in {None, path.name}:
                place = self._folder.cache / key
                runs += [CachedRun(path, k, place) for k, own in enumerate(contents.names) if own == name]
        if len(runs) > 1:
            files = ", ".join(run.file.name for run in runs)
            words = f"runs of several files have this name ({files}); state the file"
            raise ConflictError(words, place=f"{name[:60]!r}")
        return runs[0] if runs else None

    def _look_up(self, key: str) -> _Contents | None:
        """Return the content of a file from memory or from the disk cache; None if it is in neither."""
        if key not in self._contents:
            try:
                document = json.loads((self._folder.cache / key / "meta.json").read_text(encoding="utf-8"))
                self._contents[key] = read_record(_Contents, document, key)
            except (OSError, ValueError, InputError):
                return None
        return self._contents[key]

    def _read(self, file: Path) -> _Contents | None:
        """Return the content of a file. If it is not cached, start reading the file and return None."""
        key = self._key_of(file)
        contents = self._look_up(key)
        if contents is None:
            self._begin(self._read_file, key, file)
        elif contents.findings is None and not contents.preview["error"]:
            self._begin(self._check, key, file)
        return contents

    def _begin(self, work: Callable[[str, Path], Awaitable[None]], key: str, file: Path) -> None:
        """Start to read or check a file, unless the file is already being read or checked."""

        async def run() -> None:
            try:
                await work(key, file)
            finally:
                del self._pending[key]
                self.changes += 1

        if key not in self._pending:
            self._pending[key] = asyncio.create_task(run())

    async def _read_file(self, key: str, file: Path) -> None:
        place, rig = self._folder.cache / key, None
        try:
            preview = await self._queries.ask("runs", {"path": file, "place": place})
            rig = _rig_of(file)
        except (InputError, NoSpaceError) as fault:
            preview = {"runs": [], "columns": [], "error": f"{file.name}: {fault}"}
            if isinstance(fault, NoSpaceError):
                shutil.rmtree(place, ignore_errors=True)
                asyncio.get_running_loop().call_later(_RETRY_S, self.forget, file)
        if self._key_of(file) != key:  # The file changed while it was read.
            shutil.rmtree(place, ignore_errors=True)
            return
        self._write(key, _Contents(file=file.name, preview=preview, rig=rig))
        if len(self._pending) == 1:
            self.sweep()

    async def _check(self, key: str, file: Path) -> None:
        findings: list[list[Json]] = []
        with suppress(InputError, NoSpaceError):
            findings = (await self._queries.ask("findings", {"path": file}))["findings"]
        if self._key_of(file) == key and key in self._contents:
            self._write(key, replace(self._contents[key], findings=findings))

    def _write(self, key: str, contents: _Contents) -> None:
        """Cache the content of a file in memory and, unless the disk is full, on the disk."""
        self._contents[key] = contents
        place = self._folder.cache / key
        try:
            place.mkdir(parents=True, exist_ok=True)
            write_object(place / "meta.json", asdict(contents))
        except OSError as fault:
            if not is_full(fault):
                raise


def _rig_of(file: Path) -> str | None:
    """Return the preset from the first line of a file of the virtual rig; None for a measured file."""
    with file.open("rb") as lines:
        found = _RIG_LINE.match(lines.readline(200))
    return None if found is None else found[1].decode()
