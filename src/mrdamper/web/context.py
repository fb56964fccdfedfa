"""Work folders and processes of the dampers that one server manages."""

from __future__ import annotations

import asyncio
import json
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any, TypeVar

from fastapi import Depends
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from mrdamper.errors import InputError
from mrdamper.jobs.previews.choices import choices, run_formats
from mrdamper.schema import read_record
from mrdamper.web.job_queue import JOBS_AT_ONCE_MAX, JobQueue
from mrdamper.web.queries import QueryLine
from mrdamper.web.run_index import RunIndex
from mrdamper.web.security import REPORT_POLICY
from mrdamper.web.workspace import ConflictError, TooLargeError, WorkFolder

UPLOAD_MAX_BYTES = 200_000_000
_BODY_MAX_BYTES = 1 << 20  # max size of a JSON request; file uploads have separate limits

Wanted = TypeVar("Wanted")

_TEXTS = frozenset({".c", ".h", ".md", ".toml", ".txt"})  # Browsers display these files.
_DOWNLOADS = frozenset({".fmu", ".zip"})


class AppContext:
    """Work folder and processes of one damper; ``slots`` limits jobs of all dampers."""

    def __init__(self, root: Path, *, most_upload: int, local: bool, slots: asyncio.Semaphore) -> None:
        self.folder = WorkFolder(root)
        self.most_upload, self.local = most_upload, local
        self.formats = tuple(run_formats())
        self.choices = choices()
        self.queue = JobQueue(self.folder, slots)
        self.reader = QueryLine()  # process that reads whole files for a page
        self.previewer = QueryLine()  # process that reads the first lines of large files
        self.heater = QueryLine()  # process that computes quick heating curves
        self.index = RunIndex(self.folder, self.formats)

    def open(self) -> None:
        """Recover the jobs of the previous server, and clean the cache."""
        self.queue.recover()
        self.index.sweep()

    async def close(self) -> None:
        """End all processes."""
        await self.index.close()
        await self.queue.close()

    def change_numbers(self) -> dict[str, str]:
        """Return a text that changes with the measured files, and one for other files."""
        folder = self.folder
        others = (folder.records, folder.inputs, folder.cards, folder.results)
        files = f"{self.index.changes}-{_signature(folder.runs)}"
        return {"files": files, "others": str(list(map(_signature, others)))}


def _signature(place: Path) -> int:
    """Return a hash of the names and modification times of the items in a folder."""
    found = []
    with suppress(OSError):
        for path in place.glob("[!.]*"):
            with suppress(OSError):
                found.append((path.name, path.stat().st_mtime_ns))
    return hash(tuple(sorted(found)))


class Dampers:
    """Dampers of a server. The folder of a damper is the root or is in ``dampers/``."""

    def __init__(self, root: Path, *, most_upload: int, local: bool) -> None:
        self._options: dict[str, Any] = {
            "most_upload": most_upload,
            "local": local,
            "slots": asyncio.Semaphore(JOBS_AT_ONCE_MAX),
        }
        self.main = AppContext(root, **self._options)
        self._opened: dict[str, tuple[AppContext, ExitStack]] = {}  # contexts and folder locks

    def find(self, name: str | None) -> AppContext:
        """Return the context of a damper (None: root); the first call opens the context."""
        if name is None:
            return self.main
        if name not in self._opened:
            place = self._place(name)
            with ExitStack() as claim:  # If the context cannot be opened, the folder is unlocked again.
                claim.enter_context(WorkFolder(place).claim())
                context = AppContext(place, **self._options)
                context.open()
                self._opened[name] = context, claim.pop_all()
        return self._opened[name][0]

    def folders(self) -> dict[str, Path]:
        """Return the folders in ``dampers/`` by name."""
        place = self.main.folder.dampers
        paths = sorted(place.iterdir()) if place.is_dir() else []
        return {
            path.name: path
            for path in paths
            if not path.name.startswith(".") and self.main.folder.has(place, path.name, folder=True)
        }

    def add(self, name: str) -> None:
        """Create the empty work folder of a new damper."""
        path = self.main.folder.new(self.main.folder.dampers, name)
        try:
            path.mkdir(parents=True)
        except FileExistsError as fault:
            raise ConflictError(f"there is a damper {name!r} already; choose another name") from fault

    async def discard(self, name: str) -> str:
        """Move a damper with all files into the trash of the work folder; return the name of the entry."""
        path = self._place(name)
        if name in self._opened:
            if self._opened[name][0].queue.is_busy:
                raise ConflictError(f"jobs of {name!r} have not ended; cancel them first")
            context, claim = self._opened.pop(name)
            await context.close()
            claim.close()
        return self.main.folder.discard(path)

    async def close(self) -> None:
        """End the processes of all dampers."""
        await asyncio.gather(self.main.close(), *(context.close() for context, _ in self._opened.values()))
        for _, claim in self._opened.values():
            claim.close()

    def _place(self, name: str) -> Path:
        return self.main.folder.there(self.main.folder.dampers, name, folder=True)


async def dampers_of(request: Request) -> Dampers:
    """Return the dampers of the server."""
    dampers: Dampers = request.app.state.dampers
    return dampers


async def context_of(request: Request) -> AppContext:
    """Return the context of the damper in the URL of the request."""
    return (await dampers_of(request)).find(request.path_params.get("damper"))


All = Annotated[Dampers, Depends(dampers_of)]
Context = Annotated[AppContext, Depends(context_of)]


async def read_body(request: Request) -> dict[str, Any]:
    """Return the JSON object in the body of a request."""
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > _BODY_MAX_BYTES:
            raise TooLargeError(f"the request is larger than {_BODY_MAX_BYTES} bytes; expected a shorter one")
    try:
        found = json.loads(body)
    except (ValueError, RecursionError) as fault:
        raise InputError(found="the request is not JSON", expected="an object") from fault
    if not isinstance(found, dict):
        raise InputError(found=f"the request is a {type(found).__name__}", expected="an object")
    return found


async def read_request(request: Request, kind: type[Wanted]) -> Wanted:
    """Return the validated body of a request as an object of the class ``kind``."""
    return read_record(kind, await read_body(request), "the request")


def send_file(path: Path) -> Response:
    """Return the response that sends a file, with a content security policy that forbids scripts."""
    suffix = path.suffix.lower()
    return FileResponse(
        path,
        media_type="text/plain" if suffix in _TEXTS else None,
        filename=path.name if suffix in _DOWNLOADS else None,
        headers={"content-security-policy": REPORT_POLICY},
    )
