"""What the routes share: the folder, the processes, and the small things that answers need."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse

from mrdamper.errors import InputError
from mrdamper.jobs.choices import choices, run_formats
from mrdamper.web.events import Bell
from mrdamper.web.job_queue import Crew
from mrdamper.web.run_index import RunIndex
from mrdamper.web.schemas import Order, told
from mrdamper.web.security import REPORT_POLICY
from mrdamper.web.words import spoken
from mrdamper.web.worker_client import Desk, Patience
from mrdamper.web.workspace import WorkFolder

__all__ = ["MOST_UPLOAD", "Shop", "body_of", "order_in", "say", "send_file", "stream"]

MOST_UPLOAD = 200_000_000  # bytes

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".svg": "image/svg+xml",
    ".zip": "application/zip",
    ".fmu": "application/zip",
    **dict.fromkeys((".toml", ".c", ".h", ".md", ".txt"), "text/plain; charset=utf-8"),
}


class Shop:
    """One server's folder and processes."""

    def __init__(self, root: Path, *, most_upload: int = MOST_UPLOAD, local: bool = True) -> None:
        self.folder = WorkFolder(root)
        self.most_upload, self.local = most_upload, local
        self.formats = tuple(run_formats())
        self.choices = choices()
        self.bell = Bell(self.folder)
        self.crew = Crew(self.folder, self.bell.ring)
        self.desk = Desk(self.folder.root, nice=2)  # reads files
        self.glances = Desk(self.folder.root)  # looks at their beginnings, behind nobody
        self.quick = Desk(self.folder.root, idle_s=300.0)  # draws curves under a slider
        self.checking = Desk(self.folder.root, nice=10)
        self.index = RunIndex(self.folder, self.formats, (self.desk, self.checking), self.bell.ring)
        self.patience = Patience()
        self.closing = False

    def open(self) -> None:
        self.crew.recover()
        self.index.sweep()

    async def close(self) -> None:
        self.closing = True
        await self.index.close()
        await self.crew.close()
        for desk in (self.desk, self.glances, self.quick, self.checking):
            await desk.close()

    def is_closing(self) -> bool:
        return self.closing


async def body_of(request: Request) -> dict[str, Any]:
    """Return the JSON object in a request."""
    try:
        found = json.loads(await request.body())
    except (ValueError, RecursionError) as fault:
        raise InputError("the request is not JSON; expected an object") from fault
    if not isinstance(found, dict):
        raise InputError(f"the request is a {type(found).__name__}; expected an object")
    return found


async def order_in(request: Request, kind: type[Order]) -> Any:  # noqa: ANN401 - an instance of kind
    """Return what a request asks for, checked."""
    try:
        return kind.model_validate(await body_of(request))
    except ValidationError as fault:
        raise InputError(told("the request", fault)) from fault


def send_file(path: Path, *, download: bool = False) -> Response:
    """Return a file from the folder, which may be shown and never runs."""
    kind = _TYPES.get(path.suffix.lower(), "application/octet-stream")
    download = download or kind in {"application/zip", "application/octet-stream"}
    return FileResponse(
        path,
        media_type=kind,
        filename=path.name if download else None,
        headers={"content-security-policy": REPORT_POLICY},
    )


def say(answer: dict[str, Any], status: int = 200) -> Response:
    """Return an answer as JSON, its sentences in the words of the pages."""
    return JSONResponse(spoken(answer), status)


def stream(events: AsyncIterator[str]) -> Response:
    """Return server-sent events."""
    return StreamingResponse(events, media_type="text/event-stream", headers={"x-accel-buffering": "no"})
