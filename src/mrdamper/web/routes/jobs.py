"""Routes for jobs, answers and output files, and for the state of the work folder."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from mrdamper.jobs.previews.card import card_line
from mrdamper.jobs.previews.choices import kind_of_input
from mrdamper.schema import Json
from mrdamper.web.context import AppContext, Context, read_body, send_file
from mrdamper.web.forms import all_forms
from mrdamper.web.job_record import job_ids
from mrdamper.web.schemas import read_order
from mrdamper.web.security import JsonAnswer
from mrdamper.web.workspace import INPUT_SUFFIXES, NotThereError, WorkFolder, timestamp

_JOBS_MAX_COUNT = 200  # max number of jobs in a list
Item = TypeVar("Item")
routes = APIRouter()


@routes.post("/api/jobs")
async def _start_job(request: Request, context: Context) -> Response:
    body = await read_body(request)
    order = read_order(body.get("kind"), body.get("options", {}))
    if order.kind in {"fit", "evaluate"} and order.options["files"] is None:
        order.options["files"] = context.index.usable() or None
    _require_items(context.folder, order.options)
    return JsonAnswer({"id": context.queue.submit(order)}, 201)


@routes.get("/api/jobs/{job_id}")
def _job(job_id: str, context: Context) -> Response:
    record = context.queue.record(job_id)
    return JsonAnswer({**record.shown(), "answer": record.content("answer.json")})


@routes.post("/api/jobs/{job_id}/cancel")
async def _cancel_job(job_id: str, context: Context) -> Response:
    context.queue.cancel(job_id)
    return JsonAnswer(context.queue.record(job_id).shown())


@routes.post("/api/jobs/{job_id}/resume")
async def _resume_job(job_id: str, context: Context) -> Response:
    await context.queue.resume(job_id)
    return JsonAnswer(context.queue.record(job_id).shown())


@routes.delete("/api/jobs/{job_id}")
async def _delete_job(job_id: str, context: Context) -> Response:
    return JsonAnswer({"trash": await context.queue.discard(job_id)})


@routes.get("/api/jobs/{job_id}/files/{path:path}")
async def _job_file(job_id: str, path: str, context: Context) -> Response:
    record = context.queue.record(job_id)
    record.read()
    return send_file(context.folder.there(record.folder, *path.split("/")))


@routes.get("/api/state")
async def _state(context: Context) -> Response:
    files = context.index.files()  # This call starts asyncio tasks, which a worker thread cannot do.
    return JsonAnswer({**await asyncio.to_thread(_read_state, context), "files": files})


@routes.get("/api/forms")
def _forms(context: Context) -> Response:
    return JsonAnswer(all_forms(context.choices))


@routes.get("/api/changes")
def _changes(context: Context) -> Response:
    return JsonAnswer(context.change_numbers())


def _require_items(folder: WorkFolder, options: Json) -> None:
    """Raise NotThereError if an item that a request names is missing."""
    for name in options.get("files") or ():
        folder.run_file(name)
    finders = {"first": folder.card, "second": folder.card}
    if "replace" not in options:  # A fit writes the card, which need not exist.
        finders["card"] = folder.card
    if "record" in options:
        finders |= {"record": folder.record, "channels": folder.channel_map, "model": folder.card}
    for key, find in finders.items():
        if options.get(key) is not None:
            find(options[key])


def _job_rows(context: AppContext) -> Iterator[Json]:
    """Generate the rows of the job list, newest first.

    The names of run files are omitted because there may be thousands.
    """
    for job_id in job_ids(context.folder.results)[:_JOBS_MAX_COUNT]:
        with suppress(NotThereError):
            row = context.queue.record(job_id).shown()
            row["options"].pop("files", None)
            yield row


def _read_state(context: AppContext) -> Json:
    folder = context.folder

    def card(name: str) -> Json:
        path = folder.card(name)
        report = path.with_name("report.html").is_file()
        return {
            "name": name,
            **card_line(path),
            "report": report,
            "modified": timestamp(path.stat().st_mtime),
        }

    return {
        "version": version("mrdamper"),
        "folder": str(folder.root) if context.local else None,
        "folder_name": folder.root.name,
        "most_upload_bytes": context.most_upload,
        "formats": list(context.formats),
        "unnamed": folder.unnamed(),
        "records": _rows(folder.listed(folder.records, context.formats), _file),
        "inputs": _rows(folder.listed(folder.inputs, INPUT_SUFFIXES), _file),
        "cards": _rows(folder.card_names(), card),
        "jobs": list(_job_rows(context)),
        "choices": context.choices,
    }


def _rows(items: Iterable[Item], row_of: Callable[[Item], Json]) -> list[Json]:
    """Return a row for each item. Items that were deleted or cannot be read are omitted."""
    rows = []
    for item in items:
        with suppress(OSError, NotThereError):
            rows.append(row_of(item))
    return rows


def _file(path: Path) -> Json:
    found = path.stat()
    kind = kind_of_input(path, found.st_size, found.st_mtime_ns)
    return {"name": path.name, "bytes": found.st_size, "modified": timestamp(found.st_mtime), "kind": kind}
