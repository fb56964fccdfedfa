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
from mrdamper.web.context import AppContext, json_response, read_request
from mrdamper.web.query_worker import Query
from mrdamper.web.routes.inputs import drawing_of
from mrdamper.web.run_index import Kept
from mrdamper.web.schemas import HeatCurve

_MOST_SAMPLES = 2_000_000


def run_routes(context: AppContext) -> APIRouter:
    """Return the routes below /api/runs and /api/heat."""
    routes = APIRouter()

    @routes.get("/api/runs")
    async def runs() -> Response:
        return json_response(context.index.runs())

    @routes.get("/api/runs/{name}/series")
    async def series(name: str, request: Request) -> Response:
        window = _window(request)
        kept = await _kept(context, name, request)
        if window == (None, None, None):
            return _binary(kept.series)
        place = kept.place / f"{kept.number}-{_digest(window)}.window"
        if not place.is_file():
            await _ask(context, kept, kept.series, place, window)
        return _binary(place)

    @routes.get("/api/runs/{name}/model")
    async def model(name: str, request: Request) -> Response:
        window = _window(request)
        card_name = request.query_params.get("card", "")
        card = context.folder.card(card_name)
        kept = await _kept(context, name, request)
        version = (card_name, card.stat().st_mtime_ns)
        whole = kept.place / f"{kept.number}-{_digest(version)}.model"
        if not whole.is_file():
            files = {"card": card, "path": kept.file, "place": whole}
            query = Query("model", files, {"number": kept.number, "shown": card_name})
            await context.reader.ask(query)
            context.index.trim(kept)
        if window == (None, None, None):
            return _binary(whole)
        place = kept.place / f"{kept.number}-{_digest((*version, *window))}.window"
        if not place.is_file():
            await _ask(context, kept, whole, place, window)
        return _binary(place)

    @routes.post("/api/heat/curve")
    async def curve(request: Request) -> Response:
        order = await read_request(request, HeatCurve)
        asked = write_record(order, defaults=True, nulls=True)
        del asked["card"]
        options = {each.name: asked.pop(each.name) for each in fields(HeatOptions)}
        query = Query(
            "heat_curve",
            {"card": context.folder.card(order.card_name)},
            {**asked, "damper": drawing_of(context, order.damper), "options": options},
        )
        return json_response(await context.heater.ask(query))

    return routes


async def _kept(context: AppContext, name: str, request: Request) -> Kept:
    file = request.query_params.get("file")
    return await context.index.find(name, file)


async def _ask(context: AppContext, kept: Kept, series: Path, place: Path, window: tuple[Any, ...]) -> None:
    most, from_s, to_s = window
    files = {"series": series, "place": place}
    if series != kept.series:
        files["samples_of"] = kept.series
    query = Query("window", files, {"most": most, "from_s": from_s, "to_s": to_s})
    await context.reader.ask(query)
    context.index.trim(kept)


def _window(request: Request) -> tuple[int | None, float | None, float | None]:
    """Return the maximum number of samples, begin and end of a request."""
    asked = request.query_params
    try:
        most = int(asked["max"]) if "max" in asked else None
        ends = [float(asked[key]) if key in asked else None for key in ("from_s", "to_s")]
    except ValueError as fault:
        raise InputError(place="max, from_s, to_s", found="expected numbers") from fault
    if most is not None and not 64 <= most <= _MOST_SAMPLES:
        raise InputError(found=f"max is {most}", expected=f"64 to {_MOST_SAMPLES}")
    if any(end is not None and not math.isfinite(end) for end in ends):
        raise InputError(place="from_s, to_s", found="expected finite numbers")
    return most, ends[0], ends[1]


def _digest(parts: tuple[Any, ...]) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def _binary(path: Path) -> Response:
    response = FileResponse(path, media_type="application/octet-stream")
    response.chunk_size = 1 << 20
    return response
