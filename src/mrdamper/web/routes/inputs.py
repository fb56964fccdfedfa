"""Routes: inputs (geometry, sinks, plans, tables), and the content of a geometry."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from mrdamper.schema import write_record
from mrdamper.web.context import AppContext, json_response, read_request
from mrdamper.web.job_queue import ConflictError
from mrdamper.web.query_worker import Query
from mrdamper.web.schemas import DrawingRequest
from mrdamper.web.workspace import INPUT_SUFFIXES

_INPUT_MAX_BYTES = 4_000_000


def input_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/inputs and /api/dampers."""
    routes, folder = APIRouter(), context.folder

    @routes.put("/api/inputs/{name}")
    async def write_input(name: str, request: Request) -> Response:
        path = folder.new(folder.inputs, name, INPUT_SUFFIXES)
        size = await folder.store(
            path, request.stream(), _INPUT_MAX_BYTES, request.headers.get("content-length")
        )
        context.changes.publish("inputs")
        return json_response({"name": name, "bytes": size}, 201)

    @routes.get("/api/inputs/{name}")
    async def read_input(name: str) -> Response:
        path = folder.input(name)
        with path.open("rb") as file:
            text = file.read(_INPUT_MAX_BYTES).decode("utf-8", errors="replace")
        return PlainTextResponse(text)

    @routes.delete("/api/inputs/{name}")
    async def remove_input(name: str) -> Response:
        kept = folder.discard(folder.input(name))
        context.changes.publish("inputs")
        return json_response({"deleted": name, "trash": kept})

    @routes.get("/api/dampers/{name}")
    async def damper(name: str) -> Response:
        query = Query("damper", values={"damper": drawing_of(context, name), "shown": name})
        return json_response(await context.heater.ask(query))

    @routes.post("/api/dampers/{name}")
    async def draw(name: str, request: Request) -> Response:
        order = await read_request(request, DrawingRequest)
        file = f"{order.name}.toml"
        path = folder.new(folder.inputs, file) if order.name is not None else None
        if path is not None and path.exists() and not order.replace:
            raise ConflictError(f"there is a drawing {file!r} already; choose another name, or replace it")
        asked = write_record(order, defaults=True, nulls=True)
        values = {"damper": drawing_of(context, name), "shown": file if path else name}
        query = Query("drawn", values={**values, "tables": asked["tables"], "fins": asked["fins"]})
        found = await context.heater.ask(query)
        if path is not None:
            folder.write(path, found["text"])
            context.changes.publish("inputs")
        return json_response({**found["facts"], "name": values["shown"]}, 201 if path else 200)

    return routes


def drawing_of(context: AppContext, name: str) -> str:
    """Return the name of a preset, or the path of a geometry in the folder."""
    return name if name in context.choices["dampers"] else str(context.folder.input(name))  # type: ignore[operator]  # a list
