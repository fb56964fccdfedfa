"""Routes: measured files, their contents, and their channel maps."""

from __future__ import annotations

import asyncio
from pathlib import Path

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from mrdamper.schema import Json
from mrdamper.web.context import AppContext, json_response, read_request
from mrdamper.web.query_worker import Query
from mrdamper.web.schemas import MapRequest
from mrdamper.web.workspace import WorkFolder


def file_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/files, and /api/channels."""
    routes, folder = APIRouter(), context.folder

    @routes.put("/api/files/{name}")
    async def upload(name: str, request: Request) -> Response:
        path = folder.new(folder.runs, name, context.formats)
        stated = request.headers.get("content-length")
        size = await folder.store(path, request.stream(), context.most_upload, stated)
        context.index.files()
        context.changes.publish("files")
        return json_response({"name": name, "bytes": size}, 201)

    @routes.delete("/api/files/{name}")
    async def remove(name: str) -> Response:
        path = folder.run_file(name)
        context.index.forget(path)
        kept = folder.discard(path, folder.map_of(path))
        context.changes.publish("files")
        return json_response({"deleted": name, "trash": kept})

    @routes.get("/api/trash")
    async def trash() -> Response:
        rows = [
            {"id": name, "names": [each.as_posix() for each in what]} for name, what in folder.discarded()
        ]
        return json_response({"trash": rows})

    @routes.post("/api/trash/{name}/restore")
    async def restore(name: str) -> Response:
        places = folder.restore(name)
        for what in ("files", "inputs", "cards", "jobs"):
            context.changes.publish(what)
        return json_response({"restored": [path.name for path in places]})

    @routes.delete("/api/trash")
    async def empty_trash() -> Response:
        for name, _ in folder.discarded():
            await asyncio.to_thread(folder.remove, folder.trash / name)
        return json_response({"trash": []})

    @routes.get("/api/files/{name}/look")
    async def preview(name: str, request: Request) -> Response:
        path = folder.run_file(name)
        if "head" in request.query_params and not context.index.knows(path):
            beginning = await context.previewer.ask(Query("preview_head", {"path": path}))
            if beginning is not None:
                context.index.files()
                return json_response(beginning)
        return json_response(await context.index.preview(path))

    @routes.put("/api/channels")
    async def map_channels(request: Request) -> Response:
        order = await read_request(request, MapRequest)
        paths = [folder.run_file(name) for name in dict.fromkeys(order.files)]
        if order.head and not order.save:
            previews = await _beginnings(context, paths, order)
            if previews is not None:
                return json_response({"saved": False, "previews": previews})
        return json_response(await _map(context, paths, order))

    return routes


async def _beginnings(context: AppContext, paths: list[Path], order: MapRequest) -> list[Json] | None:
    """Return previews of the beginnings of files with a map; None if one file must be read completely."""
    previews = []
    for path in paths:
        query = Query("preview_head", {"path": path}, {"given": order.map or {}})
        beginning = await context.previewer.ask(query)
        if beginning is None:
            return None
        previews.append(beginning)
    return previews


async def _map(context: AppContext, paths: list[Path], order: MapRequest) -> Json:
    """Return previews of files with a map; save the map if all files can be read with it."""
    given = order.map or {}
    queries = [Query("preview", {"path": path}, {"given": given}) for path in paths]
    previews = [await context.reader.ask(query) for query in queries]
    saved = order.save and (order.map is None or not any(preview["error"] for preview in previews))
    if saved:
        text = None
        if order.map is not None:
            text = await context.reader.ask(Query("channels", values={"document": given}))
        await asyncio.to_thread(_write_maps, context.folder, paths, text)
        context.index.files()
        context.changes.publish("files")
    return {"saved": saved, "previews": previews}


def _write_maps(folder: WorkFolder, paths: list[Path], text: str | None) -> None:
    for path in paths:
        if text is None:
            folder.remove(folder.map_of(path))
        else:
            folder.write(folder.map_of(path), text)
