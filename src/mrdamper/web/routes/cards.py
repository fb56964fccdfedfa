"""Routes: cards."""

from __future__ import annotations

import secrets

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from mrdamper.errors import InputError
from mrdamper.web.context import AppContext, json_response, send_file
from mrdamper.web.job_queue import ConflictError
from mrdamper.web.query_worker import Query

_CARD_MAX_BYTES = 8_000_000


def card_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/cards."""
    routes, folder = APIRouter(), context.folder

    @routes.get("/api/cards/{name}")
    async def card(name: str) -> Response:
        return send_file(folder.card(name))

    @routes.get("/api/cards/{name}/files/{path:path}")
    async def card_file(name: str, path: str, request: Request) -> Response:
        folder.card(name)
        found = folder.there(folder.cards / name, *path.split("/"))
        return send_file(found, download="download" in request.query_params)

    @routes.put("/api/cards/{name}")
    async def put_card(name: str, request: Request) -> Response:
        place = folder.new(folder.cards, name)
        if place.exists():
            raise ConflictError(f"there is a card {name!r} already; choose another name, or delete it")
        beside = folder.cards / f".upload-{secrets.token_hex(8)}.json"
        try:
            await folder.store(
                beside, request.stream(), _CARD_MAX_BYTES, request.headers.get("content-length")
            )
            try:
                await context.reader.ask(Query("card", {"path": beside}))
            except InputError as fault:
                raise fault.renamed(str(beside), name) from fault
            place.mkdir()
            folder.move(beside, place / "card.json")
        finally:
            beside.unlink(missing_ok=True)
        context.changes.publish("cards")
        return json_response({"name": name}, 201)

    @routes.delete("/api/cards/{name}")
    async def remove_card(name: str) -> Response:
        folder.card(name)
        kept = folder.discard(folder.cards / name)
        context.changes.publish("cards")
        return json_response({"deleted": name, "trash": kept})

    return routes
