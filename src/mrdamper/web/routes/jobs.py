"""Routes: jobs with their answers and files."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from mrdamper.schema import Json
from mrdamper.web.context import AppContext, json_response, read_body, send_file
from mrdamper.web.job_record import job_ids
from mrdamper.web.schemas import read_order
from mrdamper.web.workspace import NotThereError, WorkFolder

_JOBS_MAX_COUNT = 200  # Longest list.


def job_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/jobs."""
    routes, queue = APIRouter(), context.queue

    @routes.post("/api/jobs")
    async def ask(request: Request) -> Response:
        body = await read_body(request)
        order = read_order(body.get("kind"), body.get("options", {}))
        if order.needs_runs:
            order.options["files"] = context.index.usable() or None
        _names_are_there(context.folder, order.options)
        return json_response({"id": queue.submit(order)}, 201)

    @routes.get("/api/jobs")
    async def listed() -> Response:
        return json_response({"jobs": await asyncio.to_thread(job_rows, context)})

    @routes.get("/api/jobs/{job_id}")
    async def one(job_id: str) -> Response:
        record = queue.record(job_id)
        return json_response({**record.shown(), "answer": await asyncio.to_thread(record.answer)})

    @routes.post("/api/jobs/{job_id}/cancel")
    async def cancel(job_id: str) -> Response:
        queue.cancel(job_id)
        return json_response(queue.record(job_id).shown())

    @routes.post("/api/jobs/{job_id}/resume")
    async def resume(job_id: str) -> Response:
        await queue.settled(job_id)
        queue.resume(job_id)
        return json_response(queue.record(job_id).shown())

    @routes.delete("/api/jobs/{job_id}")
    async def forget(job_id: str) -> Response:
        await queue.settled(job_id)
        return json_response({"deleted": job_id, "trash": queue.discard(job_id)})

    @routes.get("/api/jobs/{job_id}/files/{path:path}")
    async def file(job_id: str, path: str, request: Request) -> Response:
        record = queue.record(job_id)
        record.read()
        found = context.folder.there(record.folder, *path.split("/"))
        return send_file(found, download="download" in request.query_params)

    return routes


def _names_are_there(folder: WorkFolder, options: Json) -> None:
    """Raise NotThereError if a request names a missing item."""
    for key in ("files",):
        for name in options.get(key) or ():
            folder.run_file(name)
    if "record" in options:
        finders = {"record": folder.record, "channels": folder.channel_map, "model": folder.card}
        for key, find in finders.items():
            if options[key] is not None:
                find(options[key])
    keys = ["first", "second"]
    if "replace" not in options:  # A fit writes its card.
        keys.append("card")
    for key in keys:
        if options.get(key) is not None:
            folder.card(options[key])


def job_rows(context: AppContext) -> list[Json]:
    """Return the jobs for the pages, newest first."""
    found = []
    for job_id in job_ids(context.folder.results)[:_JOBS_MAX_COUNT]:
        try:
            found.append(context.queue.record(job_id).row())
        except NotThereError:
            continue
    return found
