"""Queue of jobs: one server runs two jobs at a time, each in its own process.

The state of a job is in its record on disk. The queue holds only the running processes.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import recover_staging
from mrdamper.web.job_record import GRACE_S, JobRecord, job_ids, new_id
from mrdamper.web.schemas import ORDER_JOBS, Order
from mrdamper.web.workspace import WorkFolder

MOST_AT_ONCE = 2
_KEEPING_S = 20.0  # A fit writes its best result in this time.
_MOST_WAITING = 100


class ConflictError(InputError):
    """A request conflicts with an existing item."""


@dataclass(slots=True)
class _Running:
    """A running job; it has no process while the process is started."""

    process: asyncio.subprocess.Process | None = None
    cancelled: bool = False

    def interrupt(self) -> None:
        """Send the signal of Ctrl-C to the process."""
        if self.process is not None and self.process.returncode is None:
            self.process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Kill the process and its child processes."""
        if self.process is None:
            return
        if hasattr(os, "killpg"):
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        elif self.process.returncode is None:
            self.process.kill()

    def hang_up(self) -> None:
        """Close the standard input of the process, which interrupts the job and kills it a moment later."""
        if self.process is not None and self.process.stdin is not None:
            self.process.stdin.close()


class JobQueue:
    """Start and stop of the processes of a damper's jobs."""

    def __init__(
        self, folder: WorkFolder, changed: Callable[[str], None], beside: JobQueue | None = None
    ) -> None:
        self._folder, self._changed = folder, changed
        self._waiting: deque[str] = deque()
        self._running: dict[str, _Running] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._closing = False
        self.queues: list[JobQueue] = beside.queues if beside else []  # All share the limit.
        self.queues.append(self)

    def recover(self) -> None:
        """Mark the jobs that the previous server left running, and remove its unfinished files."""
        for job_id in job_ids(self._folder.results):
            record = self.record(job_id)
            with suppress(InputError):
                if not record.read().has_ended:
                    record.end("interrupted", _stopped_early(record))
            _clear(record)
        self._folder.clear()

    def record(self, job_id: str) -> JobRecord:
        """Return the record of a job."""
        return JobRecord(self._folder.results, job_id)

    @property
    def busy(self) -> int:
        """Number of running jobs."""
        return len(self._running)

    def submit(self, order: Order) -> str:
        """Queue a job; return its id."""
        if len(self._waiting) >= _MOST_WAITING:
            raise ConflictError(f"{_MOST_WAITING} jobs wait already; wait, or cancel some")
        kind, options = order.kind, order.options
        card = options["card"] if kind == "fit" else None
        if card is not None:
            self._claim(card, replace=options["replace"])
        job_id = new_id(self._folder.results, kind)
        self.record(job_id).open(kind, options, card)
        self._queue(job_id)
        return job_id

    def resume(self, job_id: str) -> None:
        """Queue a job again that ended early; it continues after its finished tasks."""
        record = self.record(job_id)
        job = record.read()
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} is at work")
        if not record.is_resumable(job):
            raise ConflictError(f"{job_id} has left nothing to go on with; ask for it again")
        record.reopen()
        self._queue(job_id)

    async def settled(self, job_id: str) -> None:
        """Wait a moment until the process of an ended job has exited."""
        end = time.monotonic() + GRACE_S
        while job_id in self._running and self.record(job_id).read().has_ended:
            if time.monotonic() > end:
                return
            await asyncio.sleep(0.02)

    def _claim(self, card: str, *, replace: bool) -> None:
        """Raise ConflictError if the name of a card is used."""
        place = self._folder.new(self._folder.cards, card)
        if place.exists() and not replace:
            raise ConflictError(f"there is a card {card!r} already; choose another name, or replace it")
        for job_id in (*self._waiting, *self._running):
            if self.record(job_id).read().card == card:
                raise ConflictError(f"{job_id} is to write the card {card!r}; wait, or choose another name")

    def cancel(self, job_id: str) -> None:
        """Cancel a job: a waiting job at once, a running job by an interrupt and a later kill."""
        record = self.record(job_id)
        if record.read().has_ended:
            return
        if job_id in self._waiting:
            self._waiting.remove(job_id)
            record.end("cancelled", "cancelled before it began")
            self._changed("jobs")
        elif job_id in self._running and not self._running[job_id].cancelled:
            running = self._running[job_id]
            running.cancelled = True
            running.interrupt()
            grace_s = _KEEPING_S if ORDER_JOBS[record.read().kind].ctrl_c else GRACE_S
            asyncio.get_running_loop().call_later(grace_s, running.kill)

    def discard(self, job_id: str) -> str:
        """Move an ended job with its files into the trash; return its name there."""
        folder = self.record(job_id).folder
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} has not ended; cancel it first")
        kept = self._folder.discard(folder)
        self._changed("jobs")
        return kept

    async def close(self) -> None:
        """Stop all processes because the server stops."""
        self._closing = True
        for job_id in self._waiting:
            self.record(job_id).end("interrupted", "the server was stopped before it began; ask for it again")
        self._waiting.clear()
        self.queues.remove(self)
        for running in self._running.values():
            running.hang_up()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=GRACE_S + 2.0)

    def _queue(self, job_id: str) -> None:
        self._waiting.append(job_id)
        self.advance()
        self._changed("jobs")

    @property
    def is_idle(self) -> bool:
        """Return True if no job runs or waits."""
        return not self._waiting and not self._running

    def advance(self) -> None:
        """Start waiting jobs up to the limit."""
        while self._waiting and sum(queue.busy for queue in self.queues) < MOST_AT_ONCE and not self._closing:
            job_id = self._waiting.popleft()
            running = self._running[job_id] = _Running()
            task = asyncio.get_running_loop().create_task(self._run(job_id, running))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _run(self, job_id: str, running: _Running) -> None:
        record, code = self.record(job_id), None
        try:
            # -P: no file in the working folder is imported.
            running.process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-P", "-m", "mrdamper.web.job_worker", str(self._folder.root), job_id),
                stdin=asyncio.subprocess.PIPE,
                start_new_session=True,
            )
            self._changed("jobs")
            if running.cancelled:
                running.interrupt()
            code = await running.process.wait()
        finally:
            running.kill()  # The job may have left processes behind.
            self._settle(record, code, cancelled=running.cancelled)
            del self._running[job_id]
            for queue in self.queues:
                queue.advance()
            for what in ("jobs", "cards", "files"):
                self._changed(what)

    def _settle(self, record: JobRecord, code: int | None, *, cancelled: bool) -> None:
        """Write the end of a job whose process did not write it."""
        with suppress(InputError, OSError):
            if record.read().has_ended:
                pass
            elif self._closing:
                record.end("interrupted", _stopped_early(record))
            elif cancelled:
                record.end("cancelled", f"cancelled; it was ended by force; {_next_step(record)}")
            else:
                record.end(
                    "failed",
                    f"the job's process ended by itself (exit code {code}); was there enough memory? "
                    f"Then {_next_step(record)}",
                )
        _clear(record)
        recover_staging(self._folder.cards)


def _stopped_early(record: JobRecord) -> str:
    return f"the server was stopped before it was done; {_next_step(record)}"


def _next_step(record: JobRecord) -> str:
    """Return the advice for a job whose process ended without a message."""
    if not record.is_resumable(replace(record.read(), state="interrupted")):
        return "nothing was written: ask for it again"
    return "its finished parts are kept, and Resume continues after them"


def _clear(record: JobRecord) -> None:
    recover_staging(record.folder)
    for pattern in (".record-*", ".reserve"):
        for left in record.folder.glob(pattern):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)
