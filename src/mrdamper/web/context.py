"""Shared state of the routes, reading of requests, and responses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from mrdamper.errors import InputError
from mrdamper.jobs.previews.choices import choices, run_formats
from mrdamper.schema import read_record
from mrdamper.web.changes import Changes
from mrdamper.web.job_queue import JobQueue
from mrdamper.web.run_index import RunIndex
from mrdamper.web.security import REPORT_POLICY
from mrdamper.web.worker_client import WorkerClient
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
    """

    def __init__(
        self,
        root: Path,
        *,
        most_upload: int = MOST_UPLOAD,
        local: bool = True,
        beside: AppContext | None = None,
    ) -> None:
        self.folder = WorkFolder(root)
        self.most_upload, self.local = most_upload, local
        self.formats = tuple(run_formats())
        self.choices = choices()
        self.changes = Changes(self.folder)
        self.queue: JobQueue = JobQueue(self.folder, self.changes.publish, beside.queue if beside else None)
        self.reader = WorkerClient()  # Reads whole files for a page.
        self.previewer = WorkerClient()  # Reads the beginning of large files.
        self.heater = WorkerClient()  # Computes heating curves for sliders.
        self.index = RunIndex(self.folder, self.formats, WorkerClient(), self.changes.publish)

    def open(self) -> None:
        """Recover the jobs of the previous server, and clean the cache."""
        self.queue.recover()
        self.index.sweep()

    async def close(self) -> None:
        """End all processes."""
        await self.index.close()
        await self.queue.close()


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
