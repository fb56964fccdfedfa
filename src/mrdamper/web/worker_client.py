"""Queries in processes of their own, which ``anyio.to_process`` starts, reuses, limits and kills.

A query that takes too long or breaks its process affects that process only. ``PendingAnswers`` lets a request
wait for a moment; a later request with the same key gets the finished answer.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

import anyio
from anyio import BrokenWorkerProcess, to_process

from mrdamper.errors import InputError, MrdamperError
from mrdamper.web.query_worker import Query, answer_query

QUERY_MAX_S = 120.0
_PATIENCE_S = 0.7  # A request waits this long; then the page asks again.
_UNCLAIMED_MAX_S = 30.0  # An answer that no request has fetched is dropped.
_PENDING_MAX_COUNT = 64


class NotYetError(MrdamperError):
    """The answer is not ready; the page repeats the request."""


class WorkerClient:
    """Client that answers queries one after another in processes of the pool."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    async def ask(self, query: Query) -> Any:  # noqa: ANN401 - any JSON
        """Return the answer to a query.

        Raises
        ------
        InputError
            As the query's function raised it, or the process could not answer.
        NoSpaceError
            The disk is full.
        """
        async with self._turn:
            try:
                with anyio.fail_after(QUERY_MAX_S):
                    return await to_process.run_sync(answer_query, query, cancellable=True)
            except TimeoutError as fault:
                raise InputError(f"took more than {QUERY_MAX_S:g} s", remedy="Use a shorter file") from fault
            except (BrokenWorkerProcess, ProcessLookupError) as fault:  # The process died.
                raise InputError(
                    "could not be read: the reader stopped on it", remedy="The file is damaged, or too large"
                ) from fault


class PendingAnswers:
    """Unfinished answers by key; equal requests share one answer."""

    def __init__(self) -> None:
        self._tasks: dict[object, tuple[asyncio.Task[Any], float]] = {}

    async def wait(
        self, key: object, make: Callable[[], Awaitable[Any]], *, longest_s: float = _PATIENCE_S
    ) -> Any:  # noqa: ANN401 - what make makes
        """Return the answer, or raise ``NotYetError`` if it takes longer than a request may wait."""
        self._drop_unclaimed()
        if key not in self._tasks:
            self._tasks[key] = (asyncio.ensure_future(make()), time.monotonic())
        task = self._tasks[key][0]
        done, _ = await asyncio.wait({task}, timeout=longest_s)
        if not done:
            raise NotYetError("working")
        self._tasks.pop(key, None)
        return task.result()

    def close(self) -> None:
        """Cancel all answers because the server stops."""
        for task, _ in self._tasks.values():
            task.cancel()

    def _drop_unclaimed(self) -> None:
        old = time.monotonic() - _UNCLAIMED_MAX_S
        for key, (task, begun) in list(self._tasks.items()):
            if task.done() and (begun < old or len(self._tasks) > _PENDING_MAX_COUNT):
                del self._tasks[key]
                if not task.cancelled():
                    task.exception()  # Marks the exception as retrieved.
