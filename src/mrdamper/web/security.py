"""Access control of every request.

Pages of other sites can make a browser send requests to the server. Such requests are detected by the headers
Origin and Sec-Fetch-Site, which a page cannot forge. DNS rebinding is detected by the header Host. A token
excludes other users of the machine. Every response has strict security headers, and the message of an
internal error does not contain the traceback.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import json
import re
import socket
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from mrdamper.errors import InputError

PAGE_POLICY = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-src 'self'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox allow-popups; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Content security policy of files in the folder: a browser displays them but runs no scripts in them."""

_NO_TOKEN = "a token is needed: open the address with ?token=... that the server printed"
_NO_TOKEN_PAGE = (
    "<!DOCTYPE html><html lang=en><meta charset=utf-8><title>mrdamper: token missing</title>"
    "<h1>This address needs a token</h1><p>Open the address with <code>?token=...</code> that "
    "<code>mrdamper serve</code> printed when it started. The browser needs it once."
)
_TOKEN_LENGTH_MIN = 16
_DAMPER = re.compile(r"^/damper/[^/]+(?=/)")  # prefix of all URL paths of a damper in ``dampers/``
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
_SECURE = (
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("content-security-policy", PAGE_POLICY),
)


class JsonAnswer(JSONResponse):
    """JSON response. Lone surrogates in texts are replaced by question marks."""

    def render(self, content: Any) -> bytes:  # noqa: ANN401 - as Starlette has it
        text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        return text.encode(errors="replace")


def refusal(status: int, why: str, parts: Mapping[str, str] | None = None) -> Response:
    """Return the JSON error response to a request that is refused."""
    return JsonAnswer({"error": why, "status": status, **(parts or {})}, status)


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
        """Return the value of the login cookie: a hash that does not reveal the token."""
        return hmac.new((self.token or "").encode(), b"mrdamper cookie", hashlib.sha256).hexdigest()

    def is_named_by(self, host: str) -> bool:
        """Return True if the value of a Host header is a name or address of this server."""
        try:
            parts = urlsplit(f"//{host}")
            name = parts.hostname
            is_valid = parts.netloc == host and parts.username is None and (parts.port or 1) > 0
        except ValueError:
            return False
        if name is None or not is_valid:
            return False
        if name in _LOOPBACK or name == self.host.lower():
            return True
        if self.is_loopback:
            return False
        try:  # DNS rebinding requires a host name. A numeric address is therefore safe.
            ipaddress.ip_address(name)
        except ValueError:
            return name in {socket.gethostname().lower(), socket.getfqdn().lower()}
        return True

    def is_token(self, given: str) -> bool:
        """Return True if a text is the token of the server."""
        return self.token is not None and _is_same(given, self.token)


class Guard:
    """ASGI middleware that checks every request before the application receives it."""

    def __init__(self, app: ASGIApp, address: ListenAddress) -> None:
        self._app, self._address = app, address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_strictly(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                stored = "no-store" if is_api(scope["path"]) else "no-cache"
                for name, value in (*_SECURE, ("cache-control", stored)):
                    headers.setdefault(name, value)
            await send(message)

        answer = self._refuse(Request(scope)) or self._app
        try:
            await answer(scope, receive, send_strictly)
        except asyncio.CancelledError:
            pass  # The server was stopped during a request.
        except Exception:  # The application has answered with status 500.
            traceback.print_exc()

    def _refuse(self, request: Request) -> Response | None:
        """Return the response that refuses or redirects a request; None if the request is admitted."""
        headers, path, host = request.headers, request.scope["path"], request.headers.get("host", "")
        if len(headers.getlist("host")) != 1 or not self._address.is_named_by(host):
            return refusal(
                403, "the request names another host; open the page by the address that the server printed"
            )
        is_page = not is_api(path)
        is_reading = request.method in {"GET", "HEAD"}
        if not (is_page and is_reading) and not _is_own(headers, host):
            return refusal(403, "the request comes from another site; open the page itself")
        # The name contains the port, because a browser sends a cookie to all ports of a host.
        cookie = f"mrdamper-{(request.scope.get('server') or ('', 0))[1]}"
        scheme, _, bearer = headers.get("authorization", "").partition(" ")
        is_admitted = (
            self._address.token is None
            or (scheme.lower() == "bearer" and self._address.is_token(bearer.strip()))
            or _is_same(request.cookies.get(cookie, ""), self._address.cookie_value)
        )
        query = request.query_params
        has_token = request.method == "GET" and self._address.is_token(query.get("token", ""))
        if has_token and (is_page or not is_admitted):
            # Redirect, so that the token does not stay in the address bar and the history of the browser.
            rest = urlencode([(key, value) for key, value in query.multi_items() if key != "token"])
            answer = RedirectResponse("/" + path.lstrip("/\\") + (f"?{rest}" if rest else ""), 303)
            answer.set_cookie(cookie, self._address.cookie_value, httponly=True, samesite="strict")
            return answer
        if is_admitted:
            return None
        if is_page and "text/html" in headers.get("accept", ""):
            return HTMLResponse(_NO_TOKEN_PAGE, 401)
        return refusal(401, _NO_TOKEN)


def is_api(path: str) -> bool:
    """Return True if a URL path belongs to the API, and False if it belongs to a page."""
    return _DAMPER.sub("", path).startswith("/api/")


def _is_own(headers: Headers, host: str) -> bool:
    """Return False if a request comes from a page of another site.

    Requests from pages of this server, from the address bar and from other programs are accepted.
    """
    is_same_site = headers.get("sec-fetch-site") in {None, "same-origin", "none"}
    return is_same_site and headers.get("origin") in {None, f"http://{host}", f"https://{host}"}


def _is_same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())
