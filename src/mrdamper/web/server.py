"""Server: application with all routes and access control, and ``mrdamper serve``.

One process answers requests and runs no long computation. It serves one folder and the dampers in it. A
second server cannot use the same folder.
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from mrdamper.errors import InputError, MrdamperError
from mrdamper.interrupts import on_interrupt
from mrdamper.web.context import MOST_UPLOAD, AppContext, JsonAnswer
from mrdamper.web.job_queue import ConflictError
from mrdamper.web.routes.cards import card_routes
from mrdamper.web.routes.files import file_routes
from mrdamper.web.routes.inputs import input_routes
from mrdamper.web.routes.jobs import job_routes
from mrdamper.web.routes.runs import run_routes
from mrdamper.web.routes.state import state_routes
from mrdamper.web.routes.workspaces import Workspaces, workspace_routes
from mrdamper.web.run_index import SameNameError
from mrdamper.web.security import Guard, ListenAddress
from mrdamper.web.workspace import FAULT, NoSpaceError, NotThereError, TooLargeError, WorkFolder, is_full

DEFAULT_PORT = 8765

_STATIC = Path(__file__).parent / "static"
_CONNECTIONS_MAX_COUNT = 200  # A browser has six; further ones get status 503.
_TOKEN_SIGNS = 32
_STATUS: tuple[tuple[type[Exception], int], ...] = (
    (NotThereError, 404),
    (ConflictError, 409),
    (SameNameError, 409),
    (TooLargeError, 413),
    (NoSpaceError, 507),
    (MrdamperError, 422),
)


def build(root: Path, address: ListenAddress | None = None, *, most_upload: int = MOST_UPLOAD) -> ASGIApp:
    """Return the server of a folder as an ASGI application; its lifespan starts and ends its processes."""
    address = address or ListenAddress()
    context = AppContext(root, most_upload=most_upload, local=address.is_loopback)
    workspaces = Workspaces(context, _app_of)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        context.open()
        yield
        await workspaces.close()

    app = _app_of(context, workspaces, lifespan)
    return Guard(app, address)


def _app_of(
    context: AppContext,
    workspaces: Workspaces,
    lifespan: Callable[[FastAPI], AbstractAsyncContextManager[None]] | None = None,
) -> FastAPI:
    """Return the application of a damper; the one of the server's folder contains the other dampers."""
    app = FastAPI(lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    for routes in (state_routes, file_routes, input_routes, run_routes, card_routes, job_routes):
        app.include_router(routes(context))
    app.include_router(workspace_routes(workspaces))
    if lifespan is not None:
        app.mount("/damper", workspaces)
    app.mount("/static", StaticFiles(directory=_STATIC, check_dir=False))
    app.add_api_route("/{path:path}", _page, methods=["GET"], response_model=None)
    for kind, status in _STATUS:
        app.add_exception_handler(kind, _error_handler(status))
    app.add_exception_handler(OSError, _no_space)
    app.add_exception_handler(FileNotFoundError, _gone)
    app.add_exception_handler(HTTPException, _plain)
    app.add_exception_handler(Exception, _fault)
    return app


def serve(
    root: Path,
    *,
    port: int = DEFAULT_PORT,
    host: str = "127.0.0.1",
    token: str | None = None,
    open_browser: bool = False,
    announce: Callable[[str], None] = print,
) -> None:
    """Serve a folder until interrupted.

    Parameters
    ----------
    port : 0: any free port
    host : other than a loopback address only with a token
    token : token of the browsers; None: a random token, stored in the folder and readable by its owner only
    announce : function that prints the address

    Raises
    ------
    InputError
        The port is in use, another server has the folder, or a host without a token.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # Processes of queries import no file of the working folder.
    own = ListenAddress(host, token).token or _kept_token(WorkFolder(root).cache / "token")
    app = build(root, ListenAddress(host, own))
    with WorkFolder(root).claim(), _listening(host, port) as listener:
        bound = listener.getsockname()[1]
        shown = f"[{host}]" if ":" in host else socket.gethostname() if host == "0.0.0.0" else host
        address = f"http://{shown}:{bound}/?token={own}"
        announce(address)
        if open_browser:
            opener = threading.Timer(0.5, webbrowser.open, (address,))
            opener.daemon = True
            opener.start()
        config = uvicorn.Config(
            app,
            http="h11",
            limit_concurrency=_CONNECTIONS_MAX_COUNT,
            log_level="warning",
            access_log=False,
            server_header=False,
            date_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=2,
            lifespan="on",
            ws="none",
        )
        server = uvicorn.Server(config)

        def close() -> None:
            server.should_exit = True

        with on_interrupt(close):  # Also before and after uvicorn handles signals itself, and for SIGHUP.
            server.run(sockets=[listener])


def _kept_token(place: Path) -> str:
    """Return the stored token of the folder; it is reused, so that open pages work after a restart."""
    with suppress(OSError, UnicodeDecodeError):
        kept = place.read_text(encoding="ascii")
        if len(kept) == _TOKEN_SIGNS and kept.isprintable() and not place.stat().st_mode & 0o077:
            return kept
    place.unlink(missing_ok=True)
    token = secrets.token_urlsafe(_TOKEN_SIGNS)[:_TOKEN_SIGNS]
    with os.fdopen(
        os.open(place, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii"
    ) as file:
        file.write(token)
    return token


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # The protocol is given, because otherwise asyncio keeps Nagle's delay of 40 ms for each response.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()  # The port accepts connections before the address is printed.
    except (OSError, OverflowError) as fault:
        listener.close()
        raise InputError(
            place=f"--host {host} --port {port}",
            found=f"cannot be listened on ({fault}); choose another --port, or 0",
        ) from fault
    return listener


async def _page(path: str) -> Response:
    """Send the page for each address that is not a file."""
    if path.startswith("api/") or "." in path:
        raise HTTPException(404)
    return FileResponse(_STATIC / "index.html", media_type="text/html; charset=utf-8")


def _error_handler(status: int) -> Callable[[Request, Exception], Response]:
    """Return the handler that sends message and parts of an error."""

    def answer(_: Request, fault: Exception) -> Response:
        if not isinstance(fault, MrdamperError):
            return JsonAnswer({"error": str(fault), "status": status}, status)
        return JsonAnswer({"error": str(fault), "status": status, **fault.parts()}, status)

    return answer


def _no_space(request: Request, fault: Exception) -> Response:
    """Report a full disk; raise any other OSError again."""
    if not is_full(fault):
        raise fault
    return _error_handler(507)(request, NoSpaceError("nothing was written"))


def _gone(request: Request, fault: Exception) -> Response:
    """Report that a listed file was deleted or moved."""
    name = Path(str(getattr(fault, "filename", None) or "a file")).name
    return _error_handler(404)(request, NotThereError(place=f"{name!r}", found="is no longer there"))


def _fault(_: Request, _fault: Exception) -> Response:
    return JSONResponse({"error": FAULT, "status": 500}, 500)


def _plain(_: Request, fault: Exception) -> Response:
    assert isinstance(fault, HTTPException)
    said = {404: "nothing is at this address", 405: "this is not answered here"}
    status = fault.status_code
    return JSONResponse(
        {"error": said.get(status, "the request cannot be answered"), "status": status}, status
    )
