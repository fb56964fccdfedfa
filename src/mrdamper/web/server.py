"""Server: application with all routes and access control, and ``mrdamper serve``.

The server process answers requests for one work folder and runs no long computation. A second server cannot
use the same folder.
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from mrdamper.errors import InputError, MrdamperError
from mrdamper.interrupts import on_interrupt
from mrdamper.web.context import UPLOAD_MAX_BYTES, Context, Dampers
from mrdamper.web.routes import items, jobs, runs
from mrdamper.web.security import Guard, ListenAddress, refusal
from mrdamper.web.workspace import FAULT, NoSpaceError, NotThereError, WorkFolder, is_full

DEFAULT_PORT = 8765

_STATIC = Path(__file__).parent / "static"
_CONNECTIONS_MAX_COUNT = 200  # A browser opens six. Connections beyond this number get status 503.
_TOKEN_SIGNS = 32


def build(
    root: Path, address: ListenAddress | None = None, *, most_upload: int = UPLOAD_MAX_BYTES
) -> ASGIApp:
    """Return the server of a folder as an ASGI application."""
    address = address or ListenAddress()
    dampers = Dampers(root, most_upload=most_upload, local=address.is_loopback)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        dampers.main.open()
        yield
        await dampers.close()

    app = FastAPI(lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    app.state.dampers = dampers
    for routes in (items.routes, runs.routes, jobs.routes):
        app.include_router(routes)
        app.include_router(routes, prefix="/damper/{damper}")
    app.mount("/static", StaticFiles(directory=_STATIC))
    app.add_api_route("/damper/{damper}/{path:path}", _damper_page)
    app.add_api_route("/{path:path}", _page)
    for kind in (MrdamperError, OSError, HTTPException, ClientDisconnect, Exception):
        app.add_exception_handler(kind, _answer)
    return Guard(app, address)


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
    host : host name or address; if this is not a loopback address, a token is required
    token : token that browsers need; None: a random token in a file that only its owner can read
    announce : function that prints the address

    Raises
    ------
    InputError
        If the port is in use, another server uses the folder, or a host that is not a loopback address is
        given without a token.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # Query processes must not import files of the folder.
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

        with on_interrupt(close):  # Uvicorn itself ignores SIGHUP, and all signals during startup.
            server.run(sockets=[listener])


def _kept_token(place: Path) -> str:
    """Read or create the file with the token, which stays valid after a restart."""
    with suppress(OSError, UnicodeDecodeError):
        kept = place.read_text(encoding="ascii")
        if len(kept) == _TOKEN_SIGNS and kept.isprintable() and not place.stat().st_mode & 0o077:
            return kept
    place.unlink(missing_ok=True)
    place.touch(0o600, exist_ok=False)
    place.write_text(secrets.token_urlsafe(_TOKEN_SIGNS)[:_TOKEN_SIGNS], encoding="ascii")
    return place.read_text(encoding="ascii")


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # An explicit protocol makes asyncio disable Nagle's algorithm, which would delay responses by 40 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()  # The port must accept connections before the address is printed.
    except (OSError, OverflowError) as fault:
        listener.close()
        raise InputError(
            place=f"--host {host} --port {port}",
            found=f"cannot be listened on ({fault}); choose another --port, or 0",
        ) from fault
    return listener


async def _damper_page(path: str, _: Context) -> Response:
    """Send the page of a damper; raise NotThereError if there is no such damper."""
    return await _page(path)


async def _page(path: str) -> Response:
    """Send the single HTML page for every URL path that is not a file."""
    if path.startswith("api/") or "." in path:
        raise HTTPException(404)
    return FileResponse(_STATIC / "index.html", media_type="text/html; charset=utf-8")


def _answer(_: Request, fault: Exception) -> Response:
    """Return the response to an error, without internal details of the server."""
    name = Path(str(getattr(fault, "filename", None) or "a file")).name
    if is_full(fault):
        fault = NoSpaceError("nothing was written")
    elif isinstance(fault, FileNotFoundError):
        fault = NotThereError(place=f"{name!r}", found="is no longer there")
    elif isinstance(fault, OSError):
        fault = InputError(place=f"{name!r}", found=f"cannot be used ({fault.strerror})")
    if isinstance(fault, MrdamperError):
        return refusal(getattr(fault, "status", 422), str(fault), fault.parts())
    if isinstance(fault, ClientDisconnect):  # The client closed the connection during an upload.
        return Response(status_code=400)
    if isinstance(fault, HTTPException):
        reasons = {404: "nothing is at this address", 405: "this is not answered here"}
        return refusal(fault.status_code, reasons.get(fault.status_code, "the request cannot be answered"))
    return refusal(500, FAULT)
