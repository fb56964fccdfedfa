"""Routes: measured files, what is in them, their channel maps; and what people write (inputs)."""

from __future__ import annotations

import asyncio
import json
from functools import partial
from pathlib import Path

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from mrdamper.schema import Json
from mrdamper.web.context import Shop, order_in, say
from mrdamper.web.schemas import Mapping
from mrdamper.web.workspace import WorkFolder

__all__ = ["file_routes"]

_MOST_INPUT = 4_000_000  # bytes
_INPUTS = (".toml", ".csv", ".json")
_LARGE = 2_000_000  # bytes of a file whose beginning is worth a look of its own


def file_routes(shop: Shop) -> APIRouter:
    """Return the routes below /api/files, /api/channels and /api/inputs."""
    routes, folder = APIRouter(), shop.folder

    @routes.put("/api/files/{name}")
    async def upload(name: str, request: Request) -> Response:
        path = folder.new(folder.runs, name, shop.formats)
        stated = request.headers.get("content-length", "")
        if stated.isdigit() and int(stated) >= _LARGE:
            shop.glances.wake()  # it is looked into next, as likely as not
        size = await folder.store(path, request.stream(), shop.most_upload, stated or None)
        shop.index.files()
        shop.bell.ring("files")
        return say({"name": name, "bytes": size}, 201)

    @routes.delete("/api/files/{name}")
    async def remove(name: str) -> Response:
        path = folder.run_file(name)
        shop.index.forget(path)
        folder.remove(folder.map_of(path))
        folder.remove(path)
        shop.bell.ring("files")
        return say({"deleted": name})

    @routes.get("/api/files/{name}/look")
    async def look(name: str, request: Request) -> Response:
        path = folder.run_file(name)
        version = shop.index.key_of(path)
        if "head" in request.query_params and not shop.index.knows(path):
            question = {"ask": "glance", "file": str(path)}
            seen = await shop.patience.wait(("glance", version), lambda: shop.glances.ask(question))
            if not seen.get("whole"):
                shop.index.files()
                return say(seen)
        return say(await shop.patience.wait(("look", version), lambda: shop.index.look(path)))

    @routes.put("/api/channels")
    async def map_channels(request: Request) -> Response:
        order: Mapping = await order_in(request, Mapping)
        paths = [folder.run_file(name) for name in dict.fromkeys(order.files)]
        if order.head and not order.save:
            previews = await _glances(shop, paths, order)
            if previews is not None:
                return say({"saved": False, "previews": previews})
        key = (
            "channels",
            json.dumps(order.model_dump(), sort_keys=True),
            tuple(map(shop.index.key_of, paths)),
        )
        return say(await shop.patience.wait(key, lambda: _map(shop, paths, order)))

    @routes.put("/api/inputs/{name}")
    async def write_input(name: str, request: Request) -> Response:
        path = folder.new(folder.inputs, name, _INPUTS)
        size = await folder.store(path, request.stream(), _MOST_INPUT, request.headers.get("content-length"))
        shop.bell.ring("inputs")
        return say({"name": name, "bytes": size}, 201)

    @routes.get("/api/inputs/{name}")
    async def read_input(name: str) -> Response:
        path = folder.input(name)
        with path.open("rb") as file:
            text = file.read(_MOST_INPUT).decode("utf-8", errors="replace")
        return PlainTextResponse(text)

    @routes.delete("/api/inputs/{name}")
    async def remove_input(name: str) -> Response:
        folder.remove(folder.input(name))
        shop.bell.ring("inputs")
        return say({"deleted": name})

    @routes.get("/api/dampers/{name}")
    async def damper(name: str) -> Response:
        question = {"ask": "damper", "damper": drawing_of(shop, name), "name": name}
        return say(await shop.patience.wait(("damper", str(question)), lambda: shop.quick.ask(question)))

    return routes


def drawing_of(shop: Shop, name: str) -> str:
    """Return a preset's name, or the path of the drawing in the folder."""
    return name if name in shop.choices["dampers"] else str(shop.folder.input(name))  # type: ignore[operator]  # a list


async def _glances(shop: Shop, paths: list[Path], order: Mapping) -> list[Json] | None:
    """Look at the beginnings of files with a map; None when one of them must be read whole."""
    previews = []
    for path in paths:
        question = {"ask": "glance", "file": str(path), "map": order.map or {}}
        key = ("glance", json.dumps(question, sort_keys=True), shop.index.key_of(path))
        seen = await shop.patience.wait(key, partial(shop.glances.ask, question))
        if seen.get("whole"):
            return None
        previews.append(seen)
    return previews


async def _map(shop: Shop, paths: list[Path], order: Mapping) -> Json:
    """Look into files with a map; write it beside them when all can be read with it."""
    given = order.map or {}
    previews = [
        await shop.desk.ask({"ask": "look", "file": str(path), "map": given}, urgency=1) for path in paths
    ]
    saved = order.save and (order.map is None or not any(preview["error"] for preview in previews))
    if saved:
        text = None
        if order.map is not None:
            text = (await shop.desk.ask({"ask": "map", "map": given}))["toml"]
        await asyncio.to_thread(_write_maps, shop.folder, paths, text)
        shop.index.files()
        shop.bell.ring("files")
    return {"saved": saved, "previews": previews}


def _write_maps(folder: WorkFolder, paths: list[Path], text: str | None) -> None:
    for path in paths:
        if text is None:
            folder.remove(folder.map_of(path))
        else:
            folder.write(folder.map_of(path), text)
