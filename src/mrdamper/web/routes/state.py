"""Routes: state of the folder and its changes."""

from __future__ import annotations

import asyncio
import platform
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

from fastapi import APIRouter
from starlette.responses import Response

from mrdamper.jobs.previews.card import card_line
from mrdamper.schema import Json
from mrdamper.web.context import AppContext, json_response
from mrdamper.web.forms import all_forms
from mrdamper.web.inputs import kind_of_input
from mrdamper.web.query_worker import Query
from mrdamper.web.routes.jobs import job_rows
from mrdamper.web.workspace import NotThereError, WorkFolder, timestamp

Item = TypeVar("Item")


def state_routes(context: AppContext) -> APIRouter:
    """Return the routes /api/state, /api/forms, /api/data and /api/changes."""
    routes = APIRouter()

    @routes.get("/api/state")
    async def state() -> Response:
        files = [asdict(row) for row in context.index.files()]
        rest = await asyncio.to_thread(_state, context)
        return json_response({**rest, "files": files})

    @routes.get("/api/forms")
    async def forms() -> Response:
        return json_response(all_forms(context.choices))

    @routes.get("/api/data")
    async def public_data() -> Response:
        return json_response({"sets": await context.reader.ask(Query("catalogue"))})

    @routes.get("/api/changes")
    async def changes() -> Response:
        return json_response(await asyncio.to_thread(context.changes.numbers))

    return routes


def _state(context: AppContext) -> Json:
    folder = context.folder
    return {
        "versions": {"mrdamper": version("mrdamper"), "python": platform.python_version()},
        "folder": str(folder.root) if context.local else None,
        "folder_name": folder.root.name,
        "most_upload_bytes": context.most_upload,
        "formats": list(context.formats),
        "unnamed": folder.unnamed(),
        "records": _rows(folder.record_files(context.formats), partial(_record, folder)),
        "inputs": _rows(folder.input_files(), _input),
        "cards": _rows(folder.card_names(), partial(_card, folder)),
        "jobs": job_rows(context),
        "choices": context.choices,
    }


def _rows(items: Iterable[Item], row_of: Callable[[Item], Json]) -> list[Json]:
    """Return a row for each item; an item that was deleted is omitted."""
    rows = []
    for item in items:
        with suppress(FileNotFoundError, NotThereError):
            rows.append(row_of(item))
    return rows


def _record(folder: WorkFolder, path: Path) -> Json:
    return {**_file(path), "mapped": folder.map_of(path).is_file()}


def _input(path: Path) -> Json:
    return {**_file(path), "kind": kind_of_input(path)}


def _file(path: Path) -> Json:
    found = path.stat()
    return {"name": path.name, "bytes": found.st_size, "modified": timestamp(found.st_mtime)}


def _card(folder: WorkFolder, name: str) -> Json:
    path = folder.card(name)
    report = folder.cards / name / "report.html"
    return {
        "name": name,
        **card_line(path),
        "report": f"/api/cards/{name}/files/report.html" if report.is_file() else None,
        "modified": timestamp(path.stat().st_mtime),
    }
