"""The queue of jobs: at most two at a time on one server, each in its own process; the others wait.

How a job stands is in its record on disk. Here are only the processes that run now.
"""

from __future__ import annotations

import asyncio
import shutil
import time
import traceback
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from mrdamper.errors import InputError
from mrdamper.runtime.async_worker import AsyncWorker
from mrdamper.runtime.outputs import recover_staging
from mrdamper.runtime.worker import WorkerEndedError, WorkerOptions
from mrdamper.web.job_record import JobRecord, job_ids, new_id
from mrdamper.web.schemas import Order, job_of
from mrdamper.web.workspace import WorkFolder

MOST_AT_ONCE = 2
_GRACE_S = 3.0  # for an interrupted job, to end
_KEEPING_S = 20.0  # for one that writes what it has found so far
_NICE = 10  # pages come before jobs
_MOST_WAITING = 100


class ConflictError(InputError):
    """Something that cannot be while something else is."""


@dataclass(slots=True)
class _Running:
    """A job at work."""

    worker: AsyncWorker
    cancelled: bool = False


class JobQueue:
    """Starts and stops the processes of a damper's jobs."""

    def __init__(
        self, folder: WorkFolder, changed: Callable[[str], None], beside: JobQueue | None = None
    ) -> None:
        self._folder, self._changed = folder, changed
        self._waiting: deque[str] = deque()
        self._running: dict[str, _Running] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._closing = False
        self.queues: list[JobQueue] = beside.queues if beside else []  # those that share the two places
        self.queues.append(self)

    def recover(self) -> None:
        """Mark what ran when the server before this one ended, and clear what it left half-written."""
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
        """How many jobs run."""
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
        """Queue a job that ended early again; it goes on with what it has finished."""
        record = self.record(job_id)
        job = record.read()
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} is at work")
        if record.left(job) is None:
            raise ConflictError(f"{job_id} has left nothing to go on with; ask for it again")
        record.reopen()
        self._queue(job_id)

    async def settled(self, job_id: str) -> None:
        """Wait a moment for the process of a job that has ended to be gone."""
        end = time.monotonic() + _GRACE_S
        while job_id in self._running and self.record(job_id).read().has_ended:
            if time.monotonic() > end:
                return
            await asyncio.sleep(0.02)

    def _claim(self, card: str, *, replace: bool) -> None:
        """Refuse a card's name that is taken."""
        place = self._folder.new(self._folder.cards, card)
        if place.exists() and not replace:
            raise ConflictError(f"there is a card {card!r} already; choose another name, or replace it")
        for job_id in (*self._waiting, *self._running):
            if self.record(job_id).read().card == card:
                raise ConflictError(f"{job_id} is to write the card {card!r}; wait, or choose another name")

    def cancel(self, job_id: str) -> None:
        """Stop a job: at once when it waits; else by an interrupt, and for good some seconds later."""
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
            running.worker.interrupt()
            grace_s = _KEEPING_S if job_of(record.read().kind).ctrl_c else _GRACE_S
            asyncio.get_running_loop().call_later(grace_s, running.worker.kill)

    def discard(self, job_id: str) -> str:
        """Move a job that has ended into the trash, with its files; return its name there."""
        belongings = self.record(job_id).belongings()
        if job_id in self._waiting or job_id in self._running:
            raise ConflictError(f"{job_id} has not ended; cancel it first")
        kept = self._folder.discard(*belongings)
        self._changed("jobs")
        return kept

    async def close(self) -> None:
        """Stop all processes: the server ends."""
        self._closing = True
        for job_id in self._waiting:
            self.record(job_id).end("interrupted", "the server was stopped before it began; ask for it again")
        self._waiting.clear()
        self.queues.remove(self)
        for running in self._running.values():
            running.worker.hang_up()  # as if this process had died: the job is interrupted, and then killed
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=_GRACE_S + 2.0)

    def _queue(self, job_id: str) -> None:
        self._waiting.append(job_id)
        self.advance()
        self._changed("jobs")

    @property
    def is_idle(self) -> bool:
        """Whether no job runs or waits."""
        return not self._waiting and not self._running

    def advance(self) -> None:
        """Begin the next jobs, as long as there is a place for them."""
        while self._waiting and sum(queue.busy for queue in self.queues) < MOST_AT_ONCE and not self._closing:
            job_id = self._waiting.popleft()
            options = WorkerOptions(
                handler="mrdamper.web.job_worker:job_handler",
                label=str(self._folder.root),
                nice=_NICE,
                grace_s=_GRACE_S,
            )
            running = self._running[job_id] = _Running(AsyncWorker(options))
            task = asyncio.get_running_loop().create_task(self._run(job_id, running))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _run(self, job_id: str, running: _Running) -> None:
        record, code = self.record(job_id), None
        try:
            running.worker.start()
            self._changed("jobs")
            if running.cancelled:
                running.worker.interrupt()
            await running.worker.ask({"folder": str(self._folder.root), "job": job_id})
        except WorkerEndedError as fault:
            code = fault.returncode
        except Exception as fault:
            traceback.print_exception(fault)
        finally:
            await running.worker.stop()  # and what it may have started itself
            self._settle(record, code, cancelled=running.cancelled)
            del self._running[job_id]
            for queue in self.queues:
                queue.advance()
            for what in ("jobs", "cards", "files"):
                self._changed(what)

    def _settle(self, record: JobRecord, code: int | None, *, cancelled: bool) -> None:
        """Write the end of a job whose process could not."""
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
    """Say what to do about a job whose process has ended without a word."""
    if record.left(replace(record.read(), state="interrupted")) is None:
        return "nothing was written: ask for it again"
    return "what it had finished is kept: Resume goes on with it"


def _clear(record: JobRecord) -> None:
    recover_staging(record.folder)
    for pattern in (".record-*", ".reserve"):
        for left in record.folder.glob(pattern):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)
