"""Routes: runs, their samples, the modelled force of a card, and quick heating curves."""

from __future__ import annotations

import hashlib
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatOptions
from mrdamper.schema import write_record
from mrdamper.web.context import AppContext, Context, read_request
from mrdamper.web.routes.items import geometry_of
from mrdamper.web.run_index import CachedRun
from mrdamper.web.schemas import HeatCurve
from mrdamper.web.security import JsonAnswer

_SAMPLES_MAX_COUNT = 2_000_000

routes = APIRouter()


@routes.get("/api/runs")
async def _runs(context: Context) -> Response:
    return JsonAnswer(context.index.runs())


@routes.get("/api/runs/{name}/series")
async def _series(name: str, request: Request, context: Context) -> Response:
    window = _window(request)
    run = await context.index.find(name, request.query_params.get("file"))
    if window == (None, None, None):
        return _binary(run.series)
    place = run.place / f"{run.number}-{_digest(window)}.window"
    return await _part(context, run, run.series, place, window)


@routes.get("/api/runs/{name}/model")
async def _model(name: str, request: Request, context: Context) -> Response:
    window = _window(request)
    card_name = request.query_params.get("card", "")
    card = context.folder.card(card_name)
    run = await context.index.find(name, request.query_params.get("file"))
    version = (card_name, card.stat().st_mtime_ns)
    whole = run.place / f"{run.number}-{_digest(version)}.model"
    if not whole.is_file():
        files = {"card": card, "path": run.file, "place": whole}
        await context.reader.ask("model", {**files, "number": run.number, "shown": card_name})
        run.trim()
    if window == (None, None, None):
        return _binary(whole)
    place = run.place / f"{run.number}-{_digest((*version, *window))}.window"
    return await _part(context, run, whole, place, window)


@routes.post("/api/heat/curve")
async def _heat_curve(request: Request, context: Context) -> Response:
    order = await read_request(request, HeatCurve)
    asked = write_record(order, defaults=True, nulls=True)
    options = {one.name: asked.pop(one.name) for one in fields(HeatOptions)}
    files = {
        "card": context.folder.card(asked.pop("card")),
        "damper": geometry_of(context, asked.pop("damper")),
    }
    return JsonAnswer(await context.heater.ask("heat_curve", {**files, **asked, "options": options}))


async def _part(
    context: AppContext, run: CachedRun, series: Path, place: Path, window: tuple[Any, ...]
) -> Response:
    """Return the samples in a time range of a series. The result is cached in ``place``."""
    if not place.is_file():
        most, from_s, to_s = window
        samples_of = None if series == run.series else run.series
        files = {"series": series, "place": place, "samples_of": samples_of}
        await context.reader.ask("window", {**files, "most": most, "from_s": from_s, "to_s": to_s})
        run.trim()
    return _binary(place)


def _window(request: Request) -> tuple[int | None, float | None, float | None]:
    """Return the requested number of samples (maximum), first time and last time [s]."""
    asked = request.query_params
    try:
        most = int(asked["max"]) if "max" in asked else None
        ends = [float(asked[key]) if key in asked else None for key in ("from_s", "to_s")]
    except ValueError as fault:
        raise InputError(place="max, from_s, to_s", found="expected numbers") from fault
    if most is not None and not 64 <= most <= _SAMPLES_MAX_COUNT:
        raise InputError(found=f"max is {most}", expected=f"64 to {_SAMPLES_MAX_COUNT}")
    if any(end is not None and not math.isfinite(end) for end in ends):
        raise InputError(place="from_s, to_s", found="expected finite numbers")
    return most, ends[0], ends[1]


def _digest(parts: tuple[Any, ...]) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def _binary(path: Path) -> Response:
    response = FileResponse(path, media_type="application/octet-stream")
    response.chunk_size = 1 << 20
    return response
