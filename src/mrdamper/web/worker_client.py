"""Processes that stand by for queries, and answers that a request waits for.

A process is started by the first query and ends when nobody has asked for a while, so that an idle server is
small. A query that takes too long, or breaks it, costs that process and nothing else. ``PendingAnswers`` lets
a request wait a moment for an answer, and find it again when it asks once more.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.runtime.async_worker import AsyncWorker
from mrdamper.runtime.worker import WorkerEndedError, WorkerFaultError, WorkerLateError, WorkerOptions
from mrdamper.web.query_worker import Query
from mrdamper.web.workspace import FAULT, NoSpaceError, is_full

_LONGEST_S = 120.0  # of one query
_IDLE_S = 60.0
_MOST_MEMORY = 12 << 30  # bytes
_PATIENCE_S = 0.7
_KEPT_S = 30.0  # an answer that nobody has fetched
_MOST_KEPT = 64


class NotYetError(MrdamperError):
    """The answer is being made: ask again."""


@dataclass(frozen=True, slots=True, order=True)
class _Waiting:
    """A query in the queue: the most urgent first, then the oldest."""

    urgency: int
    number: int
    query: Query = field(compare=False)
    answer: asyncio.Future[Any] = field(compare=False)


class WorkerClient:
    """One process for queries; a lower ``urgency`` comes first."""

    def __init__(self, root: Path, *, nice: int = 0, idle_s: float = _IDLE_S) -> None:
        self.worker = AsyncWorker(
            WorkerOptions(
                handler="mrdamper.web.query_worker:query_handler",
                label=str(root),
                nice=nice,
                memory_bytes=_MOST_MEMORY,
            )
        )
        self._idle_s = idle_s
        self._queue: asyncio.PriorityQueue[_Waiting] = asyncio.PriorityQueue()
        self._count = 0
        self._task: asyncio.Task[None] | None = None

    async def ask(self, query: Query, *, urgency: int = 0) -> Any:  # noqa: ANN401 - whatever JSON holds
        """Return the answer to a query.

        Raises
        ------
        InputError
            As the query's function raised it; the process could not answer at all.
        NoSpaceError
            The disk is full.
        """
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._count += 1
        self._queue.put_nowait(_Waiting(urgency, self._count, query, answer))
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._serve())
        return await answer

    def wake(self) -> None:
        """Start the process where there is none: a query is to be expected."""
        if self.worker.pid is None and not self._queue.qsize():
            waking = asyncio.ensure_future(self.ask(Query("ready")))
            waking.add_done_callback(lambda done: done.cancelled() or done.exception())

    async def close(self) -> None:
        """End the process; who waits for an answer is told that there is none."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        await self.worker.stop()

    async def _serve(self) -> None:
        while True:
            try:
                # not wait_for, which loses a cancellation that comes with the result
                async with asyncio.timeout(self._idle_s):
                    waiting = await self._queue.get()
            except TimeoutError:
                await self.worker.stop()
                if self._queue.empty():
                    return
                continue
            try:
                found = await self.worker.ask(waiting.query.to_dict(), deadline_s=_LONGEST_S)
            except asyncio.CancelledError:
                waiting.answer.cancel()
                raise
            except Exception as fault:
                if not waiting.answer.done():
                    waiting.answer.set_exception(_as_told(fault))
            else:
                if not waiting.answer.done():
                    waiting.answer.set_result(found["found"])


def _as_told(fault: Exception) -> MrdamperError:
    """Return what is told of a query that failed; the trace of a fault of ours goes to the terminal."""
    if isinstance(fault, WorkerLateError):
        return InputError(f"took more than {fault.deadline_s:g} s", remedy="use a shorter file")
    if isinstance(fault, WorkerEndedError):
        return InputError(
            "could not be read: the reader stopped on it", remedy="The file is damaged, or too large"
        )
    if isinstance(fault, OSError) and is_full(fault):
        return NoSpaceError(str(fault.strerror))
    if isinstance(fault, MrdamperError) and not isinstance(fault, WorkerFaultError):
        return fault
    print(fault, *getattr(fault, "__notes__", ()), sep="\n", file=sys.stderr)
    return InputError(FAULT)


class PendingAnswers:
    """Answers that are being made, by what was asked: who asks again joins."""

    def __init__(self) -> None:
        self._tasks: dict[object, tuple[asyncio.Task[Any], float]] = {}

    async def wait(
        self, key: object, make: Callable[[], Awaitable[Any]], *, longest_s: float = _PATIENCE_S
    ) -> Any:  # noqa: ANN401 - what make makes
        """Return the answer, or raise ``NotYetError`` when it takes longer than a request should."""
        self._drop_unclaimed()
        if key not in self._tasks:
            self._tasks[key] = (asyncio.ensure_future(make()), time.monotonic())
        task = self._tasks[key][0]
        done, _ = await asyncio.wait({task}, timeout=longest_s)
        if not done:
            raise NotYetError("working")
        self._tasks.pop(key, None)
        return task.result()

    def _drop_unclaimed(self) -> None:
        old = time.monotonic() - _KEPT_S
        for key, (task, begun) in list(self._tasks.items()):
            if task.done() and (begun < old or len(self._tasks) > _MOST_KEPT):
                del self._tasks[key]
                if not task.cancelled():
                    task.exception()  # nobody came for it
