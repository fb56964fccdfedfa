"""A worker for programs with an event loop: each question waits in a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TypeVar

from mrdamper.runtime.worker import Worker, WorkerOptions
from mrdamper.schema import Json

Found = TypeVar("Found")


class AsyncWorker:
    """The coroutines of one ``Worker``."""

    def __init__(self, options: WorkerOptions) -> None:
        self._worker = Worker(options)
        self.start = self._worker.start
        self.interrupt, self.hang_up, self.kill = (
            self._worker.interrupt,
            self._worker.hang_up,
            self._worker.kill,
        )

    @property
    def pid(self) -> int | None:
        """The process's id; None where none runs."""
        return self._worker.pid

    async def ask(self, question: Json, *, deadline_s: float | None = None) -> Json:
        """Return the answer to a question; raise what ``Worker.ask`` raises.

        When the coroutine is cancelled the process goes on: ``stop`` ends it.
        """
        answer = await _in_thread(partial(self._worker.ask, question, deadline_s=deadline_s))
        return answer.value

    async def stop(self) -> None:
        """End the process; the next question starts another."""
        await _in_thread(self._worker.stop)


async def _in_thread(work: Callable[[], Found]) -> Found:
    """Do what blocks in a thread that does not keep the program from ending.

    A pool's threads do, and a few long questions would take all of the event loop's own.
    """
    loop = asyncio.get_running_loop()
    found: asyncio.Future[Found] = loop.create_future()

    def settle(finish: Callable[[], None]) -> None:
        if not found.done():  # else nobody waits any more
            finish()

    def do() -> None:
        try:
            finish = partial(found.set_result, work())
        except BaseException as fault:
            finish = partial(found.set_exception, fault)
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(settle, finish)

    threading.Thread(target=do, daemon=True).start()
    return await found
