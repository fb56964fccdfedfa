"""Shared state of the routes, reading of requests, and responses."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse

from mrdamper.errors import InputError
from mrdamper.jobs.previews.choices import choices, run_formats
from mrdamper.schema import read_record
from mrdamper.web.events import EventBus
from mrdamper.web.job_queue import JobQueue
from mrdamper.web.query_worker import Query
from mrdamper.web.run_index import RunIndex
from mrdamper.web.security import REPORT_POLICY
from mrdamper.web.worker_client import PendingAnswers, WorkerClient
from mrdamper.web.workspace import WorkFolder

MOST_UPLOAD = 200_000_000  # bytes

Wanted = TypeVar("Wanted")

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".svg": "image/svg+xml",
    ".zip": "application/zip",
    ".fmu": "application/zip",
    **dict.fromkeys((".toml", ".c", ".h", ".md", ".txt"), "text/plain; charset=utf-8"),
}


class AppContext:
    """Folder and processes of one damper.

    Parameters
    ----------
    beside : context of the server's own folder, if this damper is in its ``dampers/``
    name : name of this damper there
    """

    def __init__(
        self,
        root: Path,
        *,
        most_upload: int = MOST_UPLOAD,
        local: bool = True,
        beside: AppContext | None = None,
        name: str = "",
    ) -> None:
        self.folder = WorkFolder(root)
        self.most_upload, self.local = most_upload, local
        self.formats = tuple(run_formats())
        self.choices = choices()
        events, queue = (beside.events, beside.queue) if beside is not None else (None, None)
        self.events: EventBus = EventBus(self.folder, name, events)
        self.queue: JobQueue = JobQueue(self.folder, self.events.publish, queue)
        self.reader = WorkerClient()  # Reads whole files for a page.
        self.previewer = WorkerClient()  # Reads the beginning of large files.
        self.heater = WorkerClient()  # Computes heating curves for sliders.
        self.index = RunIndex(self.folder, self.formats, WorkerClient(), self.events.publish)
        self._pending = PendingAnswers()
        self.closing = False

    async def answer(self, client: WorkerClient, query: Query, *version: object) -> Any:  # noqa: ANN401 - any JSON value
        """Return the answer to a query, or raise ``NotYetError`` while it is computed.

        Parameters
        ----------
        version : further parts of the cache key, such as the modification time of a file
        """
        return await self.wait((query.key, *version), lambda: client.ask(query))

    async def wait(self, key: object, make: Callable[[], Awaitable[Any]]) -> Any:  # noqa: ANN401 - the result of make
        """Return a result, or raise ``NotYetError`` while it is computed; equal keys share the work."""
        return await self._pending.wait(key, make)

    def open(self) -> None:
        """Recover the jobs of the previous server, clean the cache, and watch the folder."""
        self.queue.recover()
        self.index.sweep()
        self.events.watch()

    async def close(self) -> None:
        """End all processes."""
        self.closing = True
        self.events.leave()
        await self.index.close()
        await self.queue.close()
        self._pending.close()

    def is_closing(self) -> bool:
        """Return True if the server is stopping."""
        return self.closing


async def read_body(request: Request) -> dict[str, Any]:
    """Return the JSON object in a request."""
    try:
        found = json.loads(await request.body())
    except (ValueError, RecursionError) as fault:
        raise InputError(found="the request is not JSON", expected="an object") from fault
    if not isinstance(found, dict):
        raise InputError(found=f"the request is a {type(found).__name__}", expected="an object")
    return found


async def read_request(request: Request, kind: type[Wanted]) -> Wanted:
    """Return the validated record of a request."""
    return read_record(kind, await read_body(request), "the request")


def send_file(path: Path, *, download: bool = False) -> Response:
    """Return a file of the folder with a policy that forbids scripts."""
    kind = _TYPES.get(path.suffix.lower(), "application/octet-stream")
    download = download or kind in {"application/zip", "application/octet-stream"}
    return FileResponse(
        path,
        media_type=kind,
        filename=path.name if download else None,
        headers={"content-security-policy": REPORT_POLICY},
    )


def json_response(answer: dict[str, Any], status: int = 200) -> Response:
    """Return an answer as JSON."""
    return JsonAnswer(answer, status)


class JsonAnswer(JSONResponse):
    """JSON response. Lone surrogates in texts are replaced by question marks."""

    def render(self, content: Any) -> bytes:  # noqa: ANN401 - as Starlette has it
        text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        return text.encode(errors="replace")


def stream(events: AsyncIterator[str]) -> Response:
    """Return server-sent events."""
    return StreamingResponse(events, media_type="text/event-stream", headers={"x-accel-buffering": "no"})
