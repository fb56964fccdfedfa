"""Routes: measured files with their channel maps, inputs, geometries, cards, the trash, and dampers."""

from __future__ import annotations

import asyncio
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from mrdamper.errors import InputError
from mrdamper.schema import Json, write_record
from mrdamper.web.context import All, AppContext, Context, read_request, send_file
from mrdamper.web.schemas import DrawingRequest, MapRequest, NewDamper
from mrdamper.web.security import JsonAnswer
from mrdamper.web.workspace import INPUT_SUFFIXES, ConflictError, write_whole

_INPUT_MAX_BYTES = 4_000_000
_CARD_MAX_BYTES = 8_000_000

routes = APIRouter()


@routes.put("/api/files/{name}")
async def _put_file(name: str, request: Request, context: Context) -> Response:
    folder = context.folder
    path = folder.new(folder.runs, name, context.formats)
    size = await folder.store(path, request.stream(), context.most_upload)
    context.index.files()
    return JsonAnswer({"name": name, "bytes": size}, 201)


@routes.delete("/api/files/{name}")
async def _delete_file(name: str, context: Context) -> Response:
    path = context.folder.run_file(name)
    context.index.forget(path)
    return JsonAnswer({"trash": context.folder.discard(path, context.folder.map_of(path))})


@routes.get("/api/files/{name}/look")
async def _look(name: str, request: Request, context: Context) -> Response:
    path = context.folder.run_file(name)
    if "head" in request.query_params and not context.index.has_read(path):
        beginning = await context.previewer.ask("preview_head", {"path": path})
        if beginning is not None:
            context.index.files()
            return JsonAnswer(beginning)
    return JsonAnswer(await context.index.preview(path))


@routes.put("/api/channels")
async def _map_channels(request: Request, context: Context) -> Response:
    order = await read_request(request, MapRequest)
    paths = [context.folder.run_file(name) for name in dict.fromkeys(order.files)]
    given = order.map or {}
    if order.head and not order.save:
        previews = [
            await context.previewer.ask("preview_head", {"path": path, "given": given}) for path in paths
        ]
        if None not in previews:  # None: the file must be read completely.
            return JsonAnswer({"saved": False, "previews": previews})
    previews = [await context.reader.ask("preview", {"path": path, "given": given}) for path in paths]
    is_saved = order.save and (order.map is None or not any(preview["error"] for preview in previews))
    if is_saved:
        await _save_map(context, paths, order.map)
    return JsonAnswer({"saved": is_saved, "previews": previews})


async def _save_map(context: AppContext, paths: list[Path], document: Mapping[str, Any] | None) -> None:
    """Write a channel map for each file. If ``document`` is None, remove the maps."""
    maps = [context.folder.map_of(path) for path in paths]
    if document is None:
        for path in maps:
            path.unlink(missing_ok=True)
    else:
        text = await context.reader.ask("channels", {"document": document})
        for path in maps:
            write_whole(path, text)
    context.index.files()


@routes.put("/api/inputs/{name}")
async def _put_input(name: str, request: Request, context: Context) -> Response:
    path = context.folder.new(context.folder.inputs, name, INPUT_SUFFIXES)
    size = await context.folder.store(path, request.stream(), _INPUT_MAX_BYTES)
    return JsonAnswer({"name": name, "bytes": size}, 201)


@routes.get("/api/inputs/{name}")
async def _read_input(name: str, context: Context) -> Response:
    with context.folder.input(name).open("rb") as file:
        return PlainTextResponse(file.read(_INPUT_MAX_BYTES).decode("utf-8", errors="replace"))


@routes.delete("/api/inputs/{name}")
async def _delete_input(name: str, context: Context) -> Response:
    return JsonAnswer({"trash": context.folder.discard(context.folder.input(name))})


@routes.get("/api/dampers/{name}")
async def _geometry(name: str, context: Context) -> Response:
    return JsonAnswer(
        await context.heater.ask("damper", {"damper": geometry_of(context, name), "shown": name})
    )


@routes.post("/api/dampers/{name}")
async def _derive_geometry(name: str, request: Request, context: Context) -> Response:
    order = await read_request(request, DrawingRequest)
    file = f"{order.name}.toml"
    path = context.folder.new(context.folder.inputs, file) if order.name is not None else None
    if path is not None and path.exists() and not order.replace:
        raise ConflictError(f"there is a geometry file {file!r} already; choose another name, or replace it")
    asked, shown = write_record(order, defaults=True, nulls=True), file if path else name
    changes = {"tables": asked["tables"], "fins": asked["fins"]}
    drawn = await context.heater.ask(
        "drawn", {"damper": geometry_of(context, name), "shown": shown, **changes}
    )
    if path is not None:
        write_whole(path, drawn["text"])
    return JsonAnswer({**drawn["facts"], "name": shown}, 201 if path else 200)


def geometry_of(context: AppContext, name: str) -> str:
    """Return the name of a preset, or the path of a geometry in the folder."""
    return name if name in context.choices["dampers"] else str(context.folder.input(name))  # type: ignore[operator]  # a list


@routes.get("/api/cards/{name}")
async def _card(name: str, context: Context) -> Response:
    return send_file(context.folder.card(name))


@routes.get("/api/cards/{name}/files/{path:path}")
async def _card_file(name: str, path: str, context: Context) -> Response:
    folder = context.folder.card(name).parent
    return send_file(context.folder.there(folder, *path.split("/")))


@routes.put("/api/cards/{name}")
async def _put_card(name: str, request: Request, context: Context) -> Response:
    folder = context.folder
    place = folder.new(folder.cards, name)
    if place.exists():
        raise ConflictError(f"there is a card {name!r} already; choose another name, or delete it")
    unchecked = folder.cards / f".upload-{secrets.token_hex(8)}.json"
    try:
        await folder.store(unchecked, request.stream(), _CARD_MAX_BYTES)
        await context.reader.ask("card", {"path": unchecked})
        place.mkdir()
        unchecked.replace(place / "card.json")
    except InputError as fault:
        raise fault.renamed(str(unchecked), name) from fault
    finally:
        unchecked.unlink(missing_ok=True)
    return JsonAnswer({"name": name}, 201)


@routes.delete("/api/cards/{name}")
async def _delete_card(name: str, context: Context) -> Response:
    return JsonAnswer({"trash": context.folder.discard(context.folder.card(name).parent)})


@routes.get("/api/trash")
async def _trash(context: Context) -> Response:
    entries = context.folder.discarded().items()
    return JsonAnswer(
        {"trash": [{"id": name, "names": [path.as_posix() for path in paths]} for name, paths in entries]}
    )


@routes.post("/api/trash/{name}/restore")
async def _restore(name: str, context: Context) -> Response:
    return JsonAnswer({"restored": [path.name for path in context.folder.restore(name)]})


@routes.delete("/api/trash")
async def _empty_trash(context: Context) -> Response:
    for name in context.folder.discarded():
        await asyncio.to_thread(shutil.rmtree, context.folder.trash / name, ignore_errors=True)
    return JsonAnswer({"trash": []})


@routes.get("/api/workspaces")
async def _dampers(every: All) -> Response:
    root = every.main.folder.root
    rows = [
        _damper(None, root.name, root),
        *(_damper(name, name, path) for name, path in every.folders().items()),
    ]
    return JsonAnswer({"dampers": rows})


@routes.post("/api/workspaces")
async def _add_damper(request: Request, every: All) -> Response:
    name = (await read_request(request, NewDamper)).name
    every.add(name)
    return JsonAnswer({"name": name}, 201)


@routes.delete("/api/workspaces/{name}")
async def _delete_damper(name: str, every: All) -> Response:
    return JsonAnswer({"trash": await every.discard(name)})


def _damper(name: str | None, shown: str, root: Path) -> Json:
    """Return the name of a damper and the numbers of files and cards in its folder."""
    files = [path for path in root.glob("runs/[!.]*") if path.suffix != ".toml"]
    cards = list(root.glob("cards/[!.]*/card.json"))
    return {"name": name, "shown": shown, "files": len(files), "cards": len(cards)}
