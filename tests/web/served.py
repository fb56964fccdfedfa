"""Servers for tests: a process on a free port, or an application that is called without a socket."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from anyio.from_thread import start_blocking_portal
from starlette.types import ASGIApp, Message

from tests.support.pace import within_reach
from tests.support.rigs import command

Json = dict[str, Any]
FOLDER_MARK = "MRDAMPER_TEST_FOLDER"  # This environment variable identifies a server and its processes.
TOKENS: dict[str, str] = {}
"""Tokens of the running servers by address."""


@dataclass(frozen=True)
class Answer:
    """HTTP response of an application."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Json:
        found = json.loads(self.body)
        assert isinstance(found, dict)
        return found


@contextmanager
def started(app: ASGIApp) -> Iterator[Callable[..., Answer]]:
    """Start an application in a thread. Yield a function that sends a request to the application."""
    with start_blocking_portal() as portal, portal.wrap_async_context_manager(_lifespan(app)):
        yield lambda *request, **options: portal.call(partial(_call, app, *request, **options))


@asynccontextmanager
async def _lifespan(app: ASGIApp) -> AsyncIterator[None]:
    inbox: asyncio.Queue[Message] = asyncio.Queue()
    outbox: asyncio.Queue[Message] = asyncio.Queue()
    running = asyncio.ensure_future(app({"type": "lifespan", "asgi": {}, "state": {}}, inbox.get, outbox.put))
    await inbox.put({"type": "lifespan.startup"})
    assert (await outbox.get())["type"] == "lifespan.startup.complete"
    yield
    await inbox.put({"type": "lifespan.shutdown"})
    assert (await outbox.get())["type"] == "lifespan.shutdown.complete"
    await running


async def _call(
    app: ASGIApp,
    method: str,
    path: str,
    *,
    headers: Mapping[str, str] | None = None,
    body: bytes = b"",
    query: str = "",
    pieces: int = 1,
) -> Answer:
    """Send a request to an application. Path and headers stay unchanged, which a client would normalise."""
    sent = {"host": "127.0.0.1:8765", **(headers or {})}
    step = max(1, -(-len(body) // pieces))
    parts = [body[k : k + step] for k in range(0, len(body), step)] or [b""]
    inbox: list[Message] = [
        {"type": "http.request", "body": part, "more_body": k + 1 < len(parts)}
        for k, part in enumerate(parts)
    ]
    outbox: list[Message] = []

    async def receive() -> Message:
        return inbox.pop(0) if inbox else {"type": "http.disconnect"}

    async def send(message: Message) -> None:
        outbox.append(message)

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "method": method,
        "scheme": "http",
        "path": path,
        "query_string": query.encode(),
        "root_path": "",
        "headers": [(key.lower().encode("latin-1"), value.encode("latin-1")) for key, value in sent.items()],
        "server": ("127.0.0.1", 8765),
    }
    await app(scope, receive, send)
    begin = outbox[0]
    answered = {key.decode("latin-1"): value.decode("latin-1") for key, value in begin["headers"]}
    return Answer(begin["status"], answered, b"".join(m.get("body", b"") for m in outbox[1:]))


def wait_until(condition: Callable[[], bool], longest_s: float) -> None:
    """Wait until a condition is true. Fail after the given time."""
    end = time.monotonic() + within_reach(longest_s)
    while not condition():
        assert time.monotonic() < end, f"not true after {longest_s} s"
        time.sleep(0.05)


class Client:
    """HTTP client of a server process."""

    def __init__(self, process: subprocess.Popen[str], opened: str) -> None:
        self.process = process
        self.address, _, token = opened.partition("?token=")
        TOKENS[self.address] = token
        known = {"authorization": f"Bearer {token}"}
        self.http = httpx.Client(base_url=self.address, timeout=120.0, trust_env=False, headers=known)

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        return self.http.request(method, path, **options)

    def get(self, path: str) -> Any:
        answer = self.ask("GET", path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def job(self, kind: str, **options: Any) -> str:
        answer = self.ask("POST", "/api/jobs", json={"kind": kind, "options": options})
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def ended(self, job_id: str, longest_s: float = 60.0) -> Json:
        return self.until(job_id, {"done", "failed", "cancelled", "interrupted"}, longest_s)

    def until(self, job_id: str, states: set[str], longest_s: float = 60.0) -> Json:
        wait_until(lambda: self.get(f"/api/jobs/{job_id}")["state"] in states, longest_s)
        job: Json = self.get(f"/api/jobs/{job_id}")
        return job

    def read_all(self) -> list[Json]:
        """Wait until the server has read all files; return the runs."""
        wait_until(lambda: not self.get("/api/runs")["reading"], 60.0)
        runs: list[Json] = self.get("/api/runs")["runs"]
        return runs

    def kill(self) -> None:
        """Kill the server without a chance to clean up, as in a power failure."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


@contextmanager
def served(folder: Path, *options: str) -> Iterator[Client]:
    """Yield a client of ``mrdamper serve`` on a free port, after the server has read all files of the folder.

    The server stops at the end of the context.
    """
    process = subprocess.Popen(
        command("serve", "--port", "0", "--folder", folder, *options),
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, FOLDER_MARK: str(folder)},
    )
    assert process.stderr is not None
    line = process.stderr.readline()
    assert " at http://" in line, line
    client = Client(process, line.split(" at ")[1].split(" (")[0])
    try:
        client.read_all()
        yield client
    finally:
        client.http.close()
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=15.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stderr.close()


def series_of(content: bytes) -> tuple[Json, dict[str, np.ndarray[Any, np.dtype[np.float32]]]]:
    """Parse a binary response in the documented series format, and return header and columns."""
    length = int.from_bytes(content[:4], "little")
    assert (4 + length) % 4 == 0
    header = json.loads(content[4 : 4 + length])
    values = np.frombuffer(content, "<f4", offset=4 + length).reshape(len(header["columns"]), header["n"])
    return header, {column["name"]: row for column, row in zip(header["columns"], values, strict=True)}


def is_alive(pid: int) -> bool:
    """Return True if a process is running. A zombie is not running."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def python_processes_of(folder: Path) -> list[int]:
    """Return the IDs of the job and query processes that the server of a folder has started."""
    mark, found = f"{FOLDER_MARK}={folder}".encode(), []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            is_marked = mark in (entry / "environ").read_bytes().split(b"\0")
            words = (entry / "cmdline").read_bytes().split(b"\0")
            if is_marked and (b"mrdamper.web.job_worker" in words or b"anyio.to_process" in words):
                found.append(int(entry.name))
    return [pid for pid in found if is_alive(pid)]


assert sys.platform == "linux", "these tests look into /proc"
