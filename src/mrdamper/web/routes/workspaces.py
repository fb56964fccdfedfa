"""Routes: the dampers of a server and their applications.

The server's folder is a damper, and each folder in its ``dampers/`` is another one with the same structure.
The application of a damper starts with the first request below ``/damper/NAME``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from mrdamper.schema import Json
from mrdamper.web.context import AppContext, json_response, read_request
from mrdamper.web.job_queue import ConflictError
from mrdamper.web.schemas import NewDamper
from mrdamper.web.workspace import NotThereError, WorkFolder


@dataclass(frozen=True, slots=True)
class _Opened:
    """An open damper: its application, its context, and the lock on its folder."""

    app: ASGIApp
    context: AppContext
    claim: TextIO


class Workspaces:
    """ASGI application that passes each request to its damper in ``dampers/``."""

    def __init__(self, main: AppContext, app_of: Callable[[AppContext, Workspaces], ASGIApp]) -> None:
        self.main = main
        self._app_of = app_of
        self._opened: dict[str, _Opened] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        before = scope["root_path"]
        name = scope["path"].removeprefix(before).lstrip("/").partition("/")[0]
        await self._open(name).app({**scope, "root_path": f"{before}/{name}"}, receive, send)

    def names(self) -> list[str]:
        """Return the names of the dampers in ``dampers/``."""
        found = []
        with suppress(FileNotFoundError):
            for path in sorted(self.main.folder.dampers.iterdir()):
                with suppress(NotThereError):
                    found.append(self._place(path.name).name)
        return [name for name in found if not name.startswith(".")]

    def add(self, name: str) -> None:
        """Create an empty damper."""
        path = self.main.folder.new(self.main.folder.dampers, name)
        try:
            path.mkdir(parents=True)
        except FileExistsError as fault:
            raise ConflictError(f"there is a damper {name!r} already; choose another name") from fault

    def is_at_work(self, name: str) -> bool:
        """Return True if a job of a damper runs or waits."""
        return name in self._opened and not self._opened[name].context.queue.is_idle

    async def discard(self, name: str) -> str:
        """Move a damper with its files into the trash of the server's folder; return the entry's name."""
        path = self._place(name)
        if self.is_at_work(name):
            raise ConflictError(f"jobs of {name!r} have not ended; cancel them first")
        if name in self._opened:
            await self._close(self._opened.pop(name))
        kept = self.main.folder.discard(path)
        return kept

    async def close(self) -> None:
        """End the processes of all dampers."""
        await asyncio.gather(*map(self._close, self._opened.values()))
        await self.main.close()

    def _place(self, name: str) -> Path:
        return self.main.folder.there(self.main.folder.dampers, name, folder=True)

    def _open(self, name: str) -> _Opened:
        if name not in self._opened:
            main, place = self.main, self._place(name)
            claim = WorkFolder(place).claim()  # The lock fails before the application starts.
            context = AppContext(place, most_upload=main.most_upload, local=main.local, beside=main)
            opened = _Opened(self._app_of(context, self), context, claim)
            context.open()
            self._opened[name] = opened
        return self._opened[name]

    async def _close(self, opened: _Opened) -> None:
        await opened.context.close()
        opened.claim.close()


def workspace_routes(workspaces: Workspaces) -> APIRouter:
    """Return the routes below /api/workspaces, which every damper has."""
    routes, main = APIRouter(), workspaces.main

    @routes.get("/api/workspaces")
    async def listed() -> Response:
        own = {"name": None, "shown": main.folder.root.name, **_figures(main.folder.root)}
        rows = [
            {"name": name, "shown": name, **_figures(main.folder.dampers / name)}
            for name in workspaces.names()
        ]
        return json_response({"dampers": [own, *rows]})

    @routes.post("/api/workspaces")
    async def add(request: Request) -> Response:
        name = (await read_request(request, NewDamper)).name
        workspaces.add(name)
        return json_response({"name": name}, 201)

    @routes.delete("/api/workspaces/{name}")
    async def remove(name: str) -> Response:
        return json_response({"deleted": name, "trash": await workspaces.discard(name)})

    return routes


def _figures(root: Path) -> Json:
    """Return the numbers of files and cards of a damper without opening it."""
    files = [each for each in root.glob("runs/[!.]*") if each.suffix != ".toml"]
    return {"files": len(files), "cards": len(list(root.glob("cards/[!.]*/card.json")))}
