"""Queue of jobs: a server runs up to two jobs at a time, each in a separate process.

The state of a job is stored on disk in the record of the job. The queue contains only the asyncio tasks of
waiting and running jobs.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from contextlib import suppress
from dataclasses import dataclass, field, replace

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import recover_staging
from mrdamper.web.job_record import GRACE_S, SERVER_STOPPED, JobRecord, job_ids, new_id
from mrdamper.web.schemas import ORDER_JOBS, Order
from mrdamper.web.workspace import ConflictError, WorkFolder

JOBS_AT_ONCE_MAX = 2
# Max time [s] from cancelling to killing a process that first saves its best result, such as a fit.
_KEEPING_S = 20.0


@dataclass(slots=True)
class _Work:
    """A waiting or running job. ``process`` is None until a slot is free and the process has been started."""

    task: asyncio.Task[None] = field(init=False)
    waiting: bool = True
    cancelled: bool = False
    process: asyncio.subprocess.Process | None = None

    def interrupt(self) -> None:
        """Send the signal of Ctrl-C to the process."""
        if self.process is not None and self.process.returncode is None:
            self.process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Kill the process and its child processes."""
        if self.process is not None and hasattr(os, "killpg"):
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        elif self.process is not None and self.process.returncode is None:
            self.process.kill()


class JobQueue:
    """Starts and stops the processes of a damper's jobs. All dampers share the slots for running jobs."""

    def __init__(self, folder: WorkFolder, slots: asyncio.Semaphore) -> None:
        self._folder, self._slots = folder, slots
        self._jobs: dict[str, _Work] = {}
        self._closing = False

    @property
    def is_busy(self) -> bool:
        """Return True if a job runs or waits."""
        return bool(self._jobs)

    def recover(self) -> None:
        """Mark unfinished jobs of a stopped server; remove their incomplete files."""
        for job_id in job_ids(self._folder.results):
            record = self.record(job_id)
            with suppress(InputError):
                if not record.read().has_ended:
                    record.end("interrupted", f"{SERVER_STOPPED}; {_next_step(record)}")
            _clear(record)
        self._folder.clear()

    def record(self, job_id: str) -> JobRecord:
        """Return the record of a job."""
        return JobRecord(self._folder.results, job_id)

    def submit(self, order: Order) -> str:
        """Queue a job; return its id."""
        kind, options = order.kind, order.options
        card = options["card"] if kind == "fit" else None
        if card is not None:
            self._check_card_name(card, replace=options["replace"])
        job_id = new_id(self._folder.results, kind)
        self.record(job_id).open(kind, options, card)
        self._start(job_id)
        return job_id

    async def resume(self, job_id: str) -> None:
        """Queue an interrupted job again. The job continues after its finished tasks."""
        record = await self._ended(job_id)
        if not record.is_resumable(record.read()):
            raise ConflictError(f"{job_id} has left nothing to go on with; ask for it again")
        record.reopen()
        self._start(job_id)

    async def _ended(self, job_id: str) -> JobRecord:
        """Wait until the process of an ended job has exited; return the record of the job."""
        record = self.record(job_id)
        if job_id in self._jobs and record.read().has_ended:
            await asyncio.wait([self._jobs[job_id].task], timeout=GRACE_S)
        if job_id in self._jobs:
            raise ConflictError(f"{job_id} has not ended; cancel it first")
        return record

    def _check_card_name(self, card: str, *, replace: bool) -> None:
        """Raise ConflictError if a card exists or will be written by a queued job."""
        place = self._folder.new(self._folder.cards, card)
        if place.exists() and not replace:
            raise ConflictError(f"there is a card {card!r} already; choose another name, or replace it")
        for job_id in self._jobs:
            if self.record(job_id).read().card == card:
                raise ConflictError(f"{job_id} is to write the card {card!r}; wait, or choose another name")

    def cancel(self, job_id: str) -> None:
        """Cancel a job. A running job is interrupted and, if it does not end in time, killed."""
        record, work = self.record(job_id), self._jobs.get(job_id)
        job = record.read()
        if work is None or work.cancelled or job.has_ended:
            return
        work.cancelled = True
        if work.waiting:
            record.end("cancelled", "cancelled before it began")
            work.task.cancel()
        else:
            work.interrupt()
            grace_s = _KEEPING_S if ORDER_JOBS[job.kind].ctrl_c else GRACE_S
            asyncio.get_running_loop().call_later(grace_s, work.kill)

    async def discard(self, job_id: str) -> str:
        """Move an ended job with its files into the trash; return the name of the trash entry."""
        return self._folder.discard((await self._ended(job_id)).folder)

    async def close(self) -> None:
        """Stop all processes because the server stops."""
        self._closing = True
        for job_id, work in self._jobs.items():
            if work.waiting:
                self.record(job_id).end("interrupted", f"{SERVER_STOPPED}; ask for it again")
                work.task.cancel()
            elif work.process is not None and work.process.stdin is not None:
                work.process.stdin.close()  # The process then stops.
        if self._jobs:
            await asyncio.wait([work.task for work in self._jobs.values()], timeout=GRACE_S + 2.0)

    def _start(self, job_id: str) -> None:
        work = self._jobs[job_id] = _Work()
        work.task = asyncio.create_task(self._run(job_id, work))
        work.task.add_done_callback(lambda _: self._jobs.pop(job_id))

    async def _run(self, job_id: str, work: _Work) -> None:
        """Wait for a slot, run the process of a job, and complete the record of the job."""
        async with self._slots:
            work.waiting, code = False, None
            try:
                # Option -P: Python imports no file from the current folder.
                work.process = await asyncio.create_subprocess_exec(
                    *(sys.executable, "-P", "-m", "mrdamper.web.job_worker", str(self._folder.root), job_id),
                    stdin=asyncio.subprocess.PIPE,
                    start_new_session=True,
                )
                if work.cancelled:
                    work.interrupt()
                code = await work.process.wait()
            finally:
                work.kill()  # Child processes of the job may still run.
                self._settle(self.record(job_id), code, cancelled=work.cancelled)

    def _settle(self, record: JobRecord, code: int | None, *, cancelled: bool) -> None:
        """Write the final state of a job into its record if the process has not done so."""
        with suppress(InputError, OSError):
            if not record.read().has_ended:
                next_step = _next_step(record)
                if self._closing:
                    record.end("interrupted", f"{SERVER_STOPPED}; {next_step}")
                elif cancelled:
                    record.end("cancelled", f"cancelled; it was ended by force; {next_step}")
                else:
                    words = f"the job's process ended by itself (exit code {code})"
                    record.end("failed", f"{words}; was there enough memory? Then {next_step}")
        _clear(record)
        recover_staging(self._folder.cards)


def _next_step(record: JobRecord) -> str:
    """Return advice for the user after the process of a job stopped unexpectedly."""
    if not record.is_resumable(replace(record.read(), state="interrupted")):
        return "nothing was written: ask for it again"
    return "its finished parts are kept, and Resume continues after them"


def _clear(record: JobRecord) -> None:
    """Remove the unfinished files of a job."""
    recover_staging(record.folder)
    for path in (*record.folder.glob(".upload-*"), *record.folder.glob(".reserve")):
        path.unlink(missing_ok=True)
