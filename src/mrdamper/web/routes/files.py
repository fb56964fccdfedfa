"""Routes: measured files, what is in them, their channel maps; and what people write (inputs)."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from mrdamper.schema import Json
from mrdamper.web.context import AppContext, json_response, read_request
from mrdamper.web.query_worker import Query
from mrdamper.web.schemas import Mapping
from mrdamper.web.workspace import INPUT_SUFFIXES, WorkFolder

__all__ = ["file_routes"]

_MOST_INPUT = 4_000_000  # bytes
_LARGE = 2_000_000  # bytes of a file whose beginning is worth a look of its own


def file_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/files, /api/channels and /api/inputs."""
    routes, folder = APIRouter(), context.folder

    @routes.put("/api/files/{name}")
    async def upload(name: str, request: Request) -> Response:
        path = folder.new(folder.runs, name, context.formats)
        stated = request.headers.get("content-length", "")
        if stated.isdigit() and int(stated) >= _LARGE:
            context.previewer.wake()  # it is looked into next, as likely as not
        size = await folder.store(path, request.stream(), context.most_upload, stated or None)
        context.index.files()
        context.events.publish("files")
        return json_response({"name": name, "bytes": size}, 201)

    @routes.delete("/api/files/{name}")
    async def remove(name: str) -> Response:
        path = folder.run_file(name)
        context.index.forget(path)
        folder.remove(folder.map_of(path))
        folder.remove(path)
        context.events.publish("files")
        return json_response({"deleted": name})

    @routes.get("/api/files/{name}/look")
    async def look(name: str, request: Request) -> Response:
        path = folder.run_file(name)
        version = context.index.key_of(path)
        if "head" in request.query_params and not context.index.knows(path):
            beginning = await context.answer(context.previewer, Query("glance", {"path": path}), version)
            if beginning is not None:
                context.index.files()
                return json_response(beginning)
        return json_response(await context.wait(("look", version), lambda: context.index.look(path)))

    @routes.put("/api/channels")
    async def map_channels(request: Request) -> Response:
        order = await read_request(request, Mapping)
        paths = [folder.run_file(name) for name in dict.fromkeys(order.files)]
        if order.head and not order.save:
            previews = await _beginnings(context, paths, order)
            if previews is not None:
                return json_response({"saved": False, "previews": previews})
        key = (
            "channels",
            json.dumps(order.model_dump(), sort_keys=True),
            tuple(map(context.index.key_of, paths)),
        )
        return json_response(await context.wait(key, lambda: _map(context, paths, order)))

    @routes.put("/api/inputs/{name}")
    async def write_input(name: str, request: Request) -> Response:
        path = folder.new(folder.inputs, name, INPUT_SUFFIXES)
        size = await folder.store(path, request.stream(), _MOST_INPUT, request.headers.get("content-length"))
        context.events.publish("inputs")
        return json_response({"name": name, "bytes": size}, 201)

    @routes.get("/api/inputs/{name}")
    async def read_input(name: str) -> Response:
        path = folder.input(name)
        with path.open("rb") as file:
            text = file.read(_MOST_INPUT).decode("utf-8", errors="replace")
        return PlainTextResponse(text)

    @routes.delete("/api/inputs/{name}")
    async def remove_input(name: str) -> Response:
        folder.remove(folder.input(name))
        context.events.publish("inputs")
        return json_response({"deleted": name})

    @routes.get("/api/dampers/{name}")
    async def damper(name: str) -> Response:
        query = Query("damper", values={"damper": drawing_of(context, name), "shown": name})
        return json_response(await context.answer(context.heater, query))

    return routes


def drawing_of(context: AppContext, name: str) -> str:
    """Return a preset's name, or the path of the drawing in the folder."""
    return name if name in context.choices["dampers"] else str(context.folder.input(name))  # type: ignore[operator]  # a list


async def _beginnings(context: AppContext, paths: list[Path], order: Mapping) -> list[Json] | None:
    """Preview the beginnings of files with a map; None when one of them must be read whole."""
    previews = []
    for path in paths:
        query = Query("glance", {"path": path}, {"given": order.map or {}})
        beginning = await context.answer(context.previewer, query, context.index.key_of(path))
        if beginning is None:
            return None
        previews.append(beginning)
    return previews


async def _map(context: AppContext, paths: list[Path], order: Mapping) -> Json:
    """Look into files with a map; write it beside them when all can be read with it."""
    given = order.map or {}
    queries = [Query("look", {"path": path}, {"given": given}) for path in paths]
    previews = [await context.reader.ask(query, urgency=1) for query in queries]
    saved = order.save and (order.map is None or not any(preview["error"] for preview in previews))
    if saved:
        text = None
        if order.map is not None:
            text = await context.reader.ask(Query("channels", values={"document": given}))
        await asyncio.to_thread(_write_maps, context.folder, paths, text)
        context.index.files()
        context.events.publish("files")
    return {"saved": saved, "previews": previews}


def _write_maps(folder: WorkFolder, paths: list[Path], text: str | None) -> None:
    for path in paths:
        if text is None:
            folder.remove(folder.map_of(path))
        else:
            folder.write(folder.map_of(path), text)
