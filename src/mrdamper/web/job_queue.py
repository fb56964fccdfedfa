"""The crew: at most two jobs at a time, each in a process of its own; the others wait their turn.

How a job stands is in its record on disk. Here are only the processes that run now.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import recover_staging
from mrdamper.schema import Json
from mrdamper.web.job_record import ENDED, JobRecord, job_ids, new_id
from mrdamper.web.schemas import Order
from mrdamper.web.workspace import NotThereError, WorkFolder, stamp

__all__ = ["MOST_AT_ONCE", "ConflictError", "Crew"]

MOST_AT_ONCE = 2
_GRACE_S = 3.0
_MOST_WAITING = 100


class ConflictError(InputError):
    """Something that cannot be while something else is."""


class Crew:
    """Starts and stops the processes of jobs."""

    def __init__(self, folder: WorkFolder, changed: Callable[[str], None]) -> None:
        self._folder, self._changed = folder, changed
        self._waiting: deque[str] = deque()
        self._running: dict[str, Process | None] = {}  # None: being started
        self._cancelled: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._closing = False

    def recover(self) -> None:
        """Mark what ran when the server before this one ended, and clear what it left half-written."""
        for job_id in job_ids(self._folder.results):
            record = self.record(job_id)
            with suppress(InputError):
                if record.read()["state"] not in ENDED:
                    record.end(
                        "interrupted", f"the server was stopped before it was done; {_next_step(record)}"
                    )
            _clear(record)
        self._folder.clear()

    def record(self, job_id: str) -> JobRecord:
        return JobRecord(self._folder.results, job_id)

    @property
    def busy(self) -> int:
        """How many jobs run."""
        return len(self._running)

    def ask(self, kind: str, order: Order) -> str:
        """Queue a job; return its id."""
        if len(self._waiting) >= _MOST_WAITING:
            raise ConflictError(f"{_MOST_WAITING} jobs wait already; wait, or cancel some")
        options = order.model_dump()
        card = options["card"] if kind == "identify" else None
        if card is not None:
            self._claim(card, replace=options["replace"])
        job_id = new_id(self._folder.results, kind)
        self.record(job_id).open(kind, options, card)
        self._waiting.append(job_id)
        self._next()
        self._changed("jobs")
        return job_id

    def resume(self, job_id: str) -> None:
        """Queue a job that ended early again; it goes on with what it has finished."""
        record = self.record(job_id)
        found = record.read()
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} is at work")
        if record.left(found) is None:
            raise ConflictError(f"{job_id} has left nothing to go on with; ask for it again")
        card = found.get("card")
        if card is not None:
            self._claim(card, replace=found["options"]["replace"] or self._is_own(card, found))
        record.reopen()
        self._waiting.append(job_id)
        self._next()
        self._changed("jobs")

    async def settled(self, job_id: str) -> None:
        """Wait a moment for the process of a job that has ended to be gone."""
        end = time.monotonic() + _GRACE_S
        while job_id in self._running and self.record(job_id).read()["state"] in ENDED:
            if time.monotonic() > end:
                return
            await asyncio.sleep(0.02)

    def _claim(self, card: str, *, replace: bool) -> None:
        """Refuse a card's name that is taken."""
        place = self._folder.new(self._folder.cards, card)
        if place.exists() and not replace:
            raise ConflictError(f"there is a card {card!r} already; choose another name, or replace it")
        for job_id in (*self._waiting, *self._running):
            if self.record(job_id).read().get("card") == card:
                raise ConflictError(f"{job_id} is to write the card {card!r}; wait, or choose another name")

    def _is_own(self, card: str, found: Json) -> bool:
        """Tell whether the card that is there is what an ended job has written: the best it had."""
        try:
            written = stamp(self._folder.card(card).stat().st_mtime)
        except NotThereError:
            return False
        return written <= str(found["ended_at"])

    def cancel(self, job_id: str) -> None:
        """Stop a job: at once when it waits; else by an interrupt, and for good three seconds later."""
        record = self.record(job_id)
        if record.read()["state"] in ENDED:
            return
        if job_id in self._waiting:
            self._waiting.remove(job_id)
            record.end("cancelled", "cancelled before it began")
            self._changed("jobs")
        elif job_id in self._running and job_id not in self._cancelled:
            self._cancelled.add(job_id)
            process = self._running[job_id]
            if process is not None:
                self._keep(self._stop(process))

    def forget(self, job_id: str) -> None:
        """Delete a job that has ended, with its files."""
        record = self.record(job_id)
        record.read()
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} has not ended; cancel it first")
        record.forget()
        self._changed("jobs")

    async def close(self) -> None:
        """Stop all processes: the server ends."""
        self._closing = True
        for job_id in self._waiting:
            self.record(job_id).end("interrupted", "the server was stopped before it began; ask for it again")
        self._waiting.clear()
        for process in self._running.values():
            if process is not None and process.stdin is not None:
                process.stdin.close()  # the worker then knows
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=_GRACE_S + 2.0)

    def _next(self) -> None:
        while self._waiting and len(self._running) < MOST_AT_ONCE and not self._closing:
            job_id = self._waiting.popleft()
            self._running[job_id] = None
            self._keep(self._run(job_id))

    def _keep(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        task: asyncio.Task[None] = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _run(self, job_id: str) -> None:
        record, code = self.record(job_id), -1
        try:
            # -P: a file in the working folder is never imported
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-P", "-m", "mrdamper.web.job_worker", str(self._folder.root), job_id),
                stdin=PIPE,
                stdout=DEVNULL,
                start_new_session=True,
            )
            self._running[job_id] = process
            self._changed("jobs")
            if job_id in self._cancelled:
                self._keep(self._stop(process))
            code = await process.wait()
            _kill(process)  # what it may have started itself
        finally:
            self._settle(record, code)
            self._running.pop(job_id, None)
            self._cancelled.discard(job_id)
            self._next()
            for what in ("jobs", "cards", "files"):
                self._changed(what)

    def _settle(self, record: JobRecord, code: int) -> None:
        """Write the end of a job whose process could not."""
        with suppress(InputError, OSError):
            if record.read()["state"] not in ENDED:
                if self._closing:
                    record.end(
                        "interrupted", f"the server was stopped before it was done; {_next_step(record)}"
                    )
                elif record.id in self._cancelled:
                    record.end("cancelled", f"cancelled; it was ended by force; {_next_step(record)}")
                else:
                    record.end(
                        "failed",
                        f"the job's process ended by itself (exit code {code}); was there enough memory? "
                        f"Then {_next_step(record)}",
                    )
        _clear(record)
        recover_staging(self._folder.cards)

    async def _stop(self, process: Process) -> None:
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)
        try:
            await asyncio.wait_for(asyncio.shield(process.wait()), _GRACE_S)
        except TimeoutError:
            _kill(process)


def _kill(process: Process) -> None:
    """End a job's process and whatever it started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _next_step(record: JobRecord) -> str:
    """Say what to do about a job whose process has ended without a word."""
    if record.left(record.read() | {"state": "interrupted"}) is None:
        return "nothing was written: ask for it again"
    return "what it had finished is kept: Resume goes on with it"


def _clear(record: JobRecord) -> None:
    recover_staging(record.folder)
    for pattern in (".record-*", ".reserve"):
        for left in record.folder.glob(pattern):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)
