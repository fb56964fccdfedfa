"""Access control of every request.

Pages of other sites can make a browser send requests to the server. They are detected by the headers Origin
and Sec-Fetch-Site, which a page cannot forge. DNS rebinding is detected by the header Host. A token excludes
other users of the machine. The size of a request body is limited here; ``workspace`` limits uploads while it
writes them. Every response has strict security headers, and an internal error is reported without its
traceback.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import re
import socket
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders, QueryParams
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from mrdamper.errors import InputError
from mrdamper.web.workspace import FAULT

PAGE_POLICY = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-src 'self'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox allow-popups; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Policy of files in the folder: they are displayed, and scripts in them do not run."""

_NO_TOKEN = "a token is needed: open the address with ?token=... that the server printed"
_NO_TOKEN_PAGE = (
    "<!DOCTYPE html><html lang=en><meta charset=utf-8><title>mrdamper: token missing</title>"
    "<h1>This address needs a token</h1><p>Open the address with <code>?token=...</code> that "
    "<code>mrdamper serve</code> printed when it started. The browser needs it once."
)
_COOKIE = "mrdamper"
_TOKEN_LENGTH_MIN = 16
_BODY_MAX_BYTES = 1 << 20  # Uploads have their own limits.
_DAMPER = re.compile(r"/damper/[^/]+(?=/)")  # Prefix of the paths of one damper.
_UPLOADS = ("/api/files/", "/api/inputs/", "/api/cards/")
_WRITES = frozenset({"POST", "PUT", "PATCH", "DELETE"})
_READS = frozenset({"GET", "HEAD"})
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
_SECURE = (
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("content-security-policy", PAGE_POLICY),
)


@dataclass(frozen=True, slots=True)
class ListenAddress:
    """Host and token of the server; a token may be None only if the host is a loopback address."""

    host: str = "127.0.0.1"
    token: str | None = None

    def __post_init__(self) -> None:
        if not self.is_loopback and self.token is None:
            raise InputError(
                place=f"--host {self.host}",
                found="others could reach the folder",
                expected="a --token with it, or no --host",
            )
        if self.token is not None and (len(self.token) < _TOKEN_LENGTH_MIN or not self.token.isprintable()):
            raise InputError(
                place="--token",
                found=f"has {len(self.token)} characters",
                expected=f"{_TOKEN_LENGTH_MIN} or more printable ones, such as 32 random letters and digits",
            )

    @property
    def is_loopback(self) -> bool:
        """Return True if only this machine can connect."""
        return self.host in _LOOPBACK

    @property
    def cookie_value(self) -> str:
        """Value of the cookie; it replaces the token and does not reveal it."""
        return hmac.new((self.token or "").encode(), b"mrdamper cookie", hashlib.sha256).hexdigest()

    def knows(self, host: str) -> bool:
        """Return True if a Host header names this server."""
        name = _host_name(host)
        if name is None:
            return False
        if name in _LOOPBACK or name == self.host.lower():
            return True
        if self.is_loopback:
            return False
        try:  # DNS rebinding needs a name, so that a numeric address is safe.
            ipaddress.ip_address(name)
        except ValueError:
            return name in {socket.gethostname().lower(), socket.getfqdn().lower()}
        return True

    def admits(self, headers: Headers, cookie: str) -> bool:
        """Return True if a request contains the token or the valid cookie of this name."""
        if self.token is None:
            return True
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and _same(given.strip(), self.token):
            return True
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        return cookie in cookies and _same(cookies[cookie].value, self.cookie_value)

    def is_token(self, given: Sequence[str]) -> bool:
        """Return True if the first token in an address is the token of the server."""
        return self.token is not None and len(given) > 0 and _same(given[0], self.token)


class Guard:
    """ASGI layer in front of the application."""

    def __init__(self, app: ASGIApp, address: ListenAddress) -> None:
        self._app, self._address = app, address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        answer = _Strict(send, scope["path"])
        try:
            refusal = await self._refuse(scope, answer)
            if refusal is None:
                body = await _bounded(scope, receive)
                if body is None:
                    refusal = (
                        413,
                        f"the request is larger than {_BODY_MAX_BYTES} bytes; expected a shorter one",
                    )
                else:
                    await self._app(scope, body, answer)
            if refusal is not None and not answer.started:
                await answer.refuse(*refusal)
        except ClientDisconnect:
            pass  # The client closed the connection during an upload.
        except asyncio.CancelledError:  # The server stops during an upload.
            if not answer.started:
                await answer.refuse(503, "the server is ending; send it again when it is back")
        except Exception:  # Internal errors must not reach the browser.
            traceback.print_exc(file=sys.stderr)
            if answer.started and not answer.finished:
                raise  # The connection breaks, so that the client detects the incomplete response.
            if not answer.started:
                await answer.refuse(500, FAULT)

    async def _refuse(self, scope: Scope, send: _Strict) -> tuple[int, str] | None:
        """Return status and reason of a refusal; None admits the request."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if len(headers.getlist("host")) != 1 or not self._address.knows(host):
            return 403, "the request names another host; open the page by the address that the server printed"
        method, path = scope["method"], scope["path"]
        if method not in _WRITES | _READS:
            return 405, f"{method} is not answered here"
        if not _is_own(headers, host, write=method in _WRITES, api=_inner(path).startswith("/api/")):
            return 403, "the request comes from another site; open the page itself"
        own = f"{_COOKIE}-{(scope.get('server') or ('', 0))[1]}"  # A cookie is sent to all ports of a host.
        query = QueryParams(scope["query_string"])
        is_page = not _inner(path).startswith("/api/")
        admitted = self._address.admits(headers, own)
        with_token = method == "GET" and self._address.is_token(query.getlist("token")[:1])
        if with_token and (
            is_page or not admitted
        ):  # The token must not stay in the address and the history.
            rest = urlencode([(key, value) for key, value in query.multi_items() if key != "token"])
            place = "/" + path.lstrip("/\\") + (f"?{rest}" if rest else "")
            cookie = f"{own}={self._address.cookie_value}; HttpOnly; SameSite=Strict; Path=/"
            await send.refuse(303, "see the page", {"location": _ascii(place), "set-cookie": cookie})
            return 303, ""
        if admitted:
            return None
        if is_page and "text/html" in headers.get("accept", ""):
            await send.show(401, _NO_TOKEN_PAGE)
            return 401, ""
        return 401, _NO_TOKEN


class _Strict:
    """Send function that adds the security headers."""

    def __init__(self, send: Send, path: str) -> None:
        self._send, self._path = send, path
        self.started = self.finished = False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.started = True
            headers = MutableHeaders(scope=message)
            stored = "no-store" if _inner(self._path).startswith("/api/") else "no-cache"
            for name, value in (*_SECURE, ("cache-control", stored)):
                headers.setdefault(name, value)
        else:
            self.finished = not message.get("more_body", False)
        await self._send(message)

    async def show(self, status: int, page: str) -> None:
        """Send a page."""
        response = HTMLResponse(page, status)
        await self({"type": "http.response.start", "status": status, "headers": response.raw_headers})
        await self({"type": "http.response.body", "body": response.body})

    async def refuse(self, status: int, why: str, headers: Mapping[str, str] | None = None) -> None:
        """Send a message as JSON."""
        response = JSONResponse({"error": why, "status": status}, status, headers)
        await self({"type": "http.response.start", "status": status, "headers": response.raw_headers})
        await self({"type": "http.response.body", "body": response.body})


async def _bounded(scope: Scope, receive: Receive) -> Receive | None:
    """Return the receive function of a limited body; None if the body is too large."""
    if scope["method"] not in _WRITES or _inner(scope["path"]).startswith(_UPLOADS):
        return receive
    pieces, size, more = [], 0, True
    while more:
        message = await receive()
        if message["type"] != "http.request":
            break
        pieces.append(message.get("body", b""))
        size, more = size + len(pieces[-1]), message.get("more_body", False)
        if size > _BODY_MAX_BYTES:
            return None
    whole: list[Message] = [{"type": "http.request", "body": b"".join(pieces), "more_body": False}]

    async def again() -> Message:
        return whole.pop() if whole else await receive()

    return again


def _inner(path: str) -> str:
    """Return a path without the prefix of a damper."""
    found = _DAMPER.match(path)
    return path[found.end() :] if found else path


def _is_own(headers: Headers, host: str, *, write: bool, api: bool) -> bool:
    """Return True if a request comes from a page of this server, from the user, or from another program."""
    site = headers.get("sec-fetch-site")
    if write or api:
        if site not in {None, "same-origin", "none"}:
            return False
        origin = headers.get("origin")
        if origin is not None:
            parts = urlsplit(origin) if origin != "null" else None
            return parts is not None and parts.scheme in {"http", "https"} and parts.netloc == host
    return True


def _host_name(host: str) -> str | None:
    """Return the host name of a Host header in lower case; None if the header is invalid."""
    try:
        parts = urlsplit(f"//{host}")
        _ = parts.port
    except ValueError:
        return None
    if not host or parts.netloc != host or "@" in host:
        return None
    return parts.hostname


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())


def _ascii(text: str) -> str:
    return text.encode("ascii", "ignore").decode()
