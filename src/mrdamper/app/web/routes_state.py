"""Routes: the state of all, and that it has changed."""

from __future__ import annotations

import asyncio
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from mrdamper.app.card_line import card_line
from mrdamper.app.web.folder import WorkFolder, stamp
from mrdamper.app.web.inputs import kind_of_input
from mrdamper.app.web.routes_jobs import job_rows
from mrdamper.app.web.shop import Shop, say, stream

__all__ = ["state_routes"]

Json = dict[str, Any]


def state_routes(shop: Shop) -> APIRouter:
    """Return the routes /api/state and /api/events."""
    routes = APIRouter()

    @routes.get("/api/state")
    async def state() -> Response:
        files = shop.index.files()
        rest = await asyncio.to_thread(_state, shop)
        return say({**rest, "files": files})

    @routes.get("/api/data")
    async def public_data() -> Response:
        return say(await shop.patience.wait("data", lambda: shop.desk.ask({"ask": "catalogue"})))

    @routes.get("/api/events")
    async def events() -> Response:
        return stream(shop.bell.listen(shop.is_closing))

    return routes


def _state(shop: Shop) -> Json:
    folder = shop.folder
    return {
        "versions": {"mrdamper": version("mrdamper"), "python": platform.python_version()},
        "folder": str(folder.root) if shop.local else None,
        "folder_name": folder.root.name,
        "most_upload_bytes": shop.most_upload,
        "formats": list(shop.formats),
        "records": [_record(folder, path) for path in folder.record_files(shop.formats)],
        "inputs": [_input(path) for path in folder.input_files()],
        "cards": [_card(folder, name) for name in folder.card_names()],
        "jobs": job_rows(shop),
        "choices": shop.choices,
    }


def _record(folder: WorkFolder, path: Path) -> Json:
    found = path.stat()
    return {
        "name": path.name,
        "bytes": found.st_size,
        "modified": stamp(found.st_mtime),
        "mapped": folder.map_of(path).is_file(),
    }


def _input(path: Path) -> Json:
    found = path.stat()
    return {
        "name": path.name,
        "bytes": found.st_size,
        "modified": stamp(found.st_mtime),
        "kind": kind_of_input(path),
    }


def _card(folder: WorkFolder, name: str) -> Json:
    path = folder.card(name)
    report = folder.cards / name / "report.html"
    return {
        "name": name,
        **card_line(path),
        "report": f"/api/cards/{name}/files/report.html" if report.is_file() else None,
        "modified": stamp(path.stat().st_mtime),
    }
