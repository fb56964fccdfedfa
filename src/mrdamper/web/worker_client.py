"""The desk: a process that stands by for questions that should take no time, and answers one after another.

It is started by the first question and ends when nobody has asked for a while, so that an idle server is
small. A question that takes too long, or breaks it, costs that process and nothing else. ``Patience`` lets a
request wait a moment for an answer, and find it again when it asks once more.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.schema import Json
from mrdamper.web.workspace import NoSpaceError

__all__ = ["Desk", "NotYetError", "Patience"]

_LONGEST_S = 120.0  # of one question
_IDLE_S = 60.0
_MOST_ANSWER = 64 << 20  # bytes
_PATIENCE_S = 0.7
_KEPT_S = 30.0  # an answer that nobody has fetched
_MOST_KEPT = 64


class NotYetError(MrdamperError):
    """The answer is being made: ask again."""


class Desk:
    """One process for questions of ``clerk``; a lower ``urgency`` comes first."""

    def __init__(self, root: Path, *, nice: int = 0, idle_s: float = _IDLE_S) -> None:
        self._root, self._nice, self._idle_s = root, nice, idle_s
        self._process: Process | None = None
        self._queue: asyncio.PriorityQueue[tuple[int, int, Json, asyncio.Future[Json]]] = (
            asyncio.PriorityQueue()
        )
        self._count = 0
        self._closed = False
        self._task: asyncio.Task[None] | None = None

    @property
    def waiting(self) -> int:
        return self._queue.qsize()

    async def ask(self, question: Json, *, urgency: int = 0) -> Json:
        """Return the answer to a question.

        Raises
        ------
        InputError
            What the clerk says is wrong, or that it could not answer at all.
        """
        answer: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._count += 1
        self._queue.put_nowait((urgency, self._count, question, answer))
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._serve())
        return await answer

    def wake(self) -> None:
        """Start the process where there is none: a question is to be expected."""
        if self._process is None and not self._queue.qsize():
            waking = asyncio.ensure_future(self.ask({"ask": "ready"}))
            waking.add_done_callback(lambda done: done.cancelled() or done.exception())

    async def close(self) -> None:
        self._closed = True
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        await self._end()

    async def _serve(self) -> None:
        while not self._closed:
            try:
                # not wait_for, which loses a cancellation that comes with the result
                async with asyncio.timeout(self._idle_s):
                    _, _, question, answer = await self._queue.get()
            except TimeoutError:
                await self._end()
                if self._queue.empty():
                    return
                continue
            try:
                async with asyncio.timeout(_LONGEST_S):
                    found = await self._talk(question)
            except asyncio.CancelledError:
                answer.cancel()
                raise
            except TimeoutError:
                await self._end()
                _fail(answer, f"took more than {_LONGEST_S:g} s; use a shorter file")
            except (OSError, ValueError, EOFError):
                await self._end()
                _fail(
                    answer, "could not be read: the reader stopped on it. The file is damaged, or too large"
                )
            else:
                if found.get("full"):
                    _refuse(answer, NoSpaceError(found["refused"]))
                elif "refused" in found:
                    _fail(answer, found["refused"])
                elif not answer.done():
                    answer.set_result(found["answer"])

    async def _talk(self, question: Json) -> Json:
        process = self._process
        if process is None or process.returncode is not None:
            process = self._process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-P", "-m", "mrdamper.web.query_worker", str(self._root), str(self._nice)),
                stdin=PIPE,
                stdout=PIPE,
                limit=_MOST_ANSWER,
                start_new_session=True,
            )
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(question).encode() + b"\n")
        await process.stdin.drain()
        line = await process.stdout.readline()
        if not line.endswith(b"\n"):
            raise EOFError
        found = json.loads(line)
        assert isinstance(found, dict)
        return found

    async def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            await process.wait()


class Patience:
    """Answers that are being made, by what was asked: who asks again joins."""

    def __init__(self) -> None:
        self._tasks: dict[object, tuple[asyncio.Task[Any], float]] = {}

    async def wait(
        self, key: object, make: Callable[[], Awaitable[Any]], *, longest_s: float = _PATIENCE_S
    ) -> Any:  # noqa: ANN401 - what make makes
        """Return the answer, or raise ``NotYetError`` when it takes longer than a request should."""
        self._sweep()
        if key not in self._tasks:
            self._tasks[key] = (asyncio.ensure_future(make()), time.monotonic())
        task = self._tasks[key][0]
        done, _ = await asyncio.wait({task}, timeout=longest_s)
        if not done:
            raise NotYetError("working")
        self._tasks.pop(key, None)
        return task.result()

    def _sweep(self) -> None:
        old = time.monotonic() - _KEPT_S
        for key, (task, begun) in list(self._tasks.items()):
            if task.done() and (begun < old or len(self._tasks) > _MOST_KEPT):
                del self._tasks[key]
                if not task.cancelled():
                    task.exception()  # nobody came for it


def _fail(answer: asyncio.Future[Json], said: str) -> None:
    _refuse(answer, InputError(said))


def _refuse(answer: asyncio.Future[Json], fault: MrdamperError) -> None:
    if not answer.done():
        answer.set_exception(fault)
