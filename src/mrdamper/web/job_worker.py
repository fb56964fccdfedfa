"""Does one job in a process of its own (``runtime.worker``).

The process reads the job's record, does the job, and writes its progress, its answer and its end into the
job's folder, so that nothing is lost when the server is gone by then. An interrupt (SIGINT) is what Ctrl-C is
to the command line: a fit keeps the best it has, any other job leaves nothing. When the server has died, the
job is interrupted, too.
"""

from __future__ import annotations

import json
import os
import signal
import time
import traceback
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from mrdamper.errors import MrdamperError
from mrdamper.runtime.signals import Interrupted
from mrdamper.runtime.worker_process import Handler, Reply, supervisor_is_gone
from mrdamper.schema import Json
from mrdamper.web.adapters import do
from mrdamper.web.job_record import EndState, JobRecord, write_object
from mrdamper.web.workspace import FAULT, NoSpaceError, WorkFolder, is_full

_LEAST_INTERVAL_S, _MOST_INTERVAL_S = 0.02, 2.0  # between two lines of progress

_KEPT = {
    "fit": "what was written is the best so far, marked as cancelled",
    "cycles": "what was counted until then is kept",
}
"""What a job that was interrupted leaves, by kind."""


class _ProgressFile:
    """Appends progress to the job's file: often at first, more seldom later, the last in any case."""

    def __init__(self, path: Path) -> None:
        self._path, self._begin, self._next = path, time.monotonic(), 0.0
        self._held: dict[str, object] | None = None

    def progress(self, **told: object) -> None:
        spent = time.monotonic() - self._begin
        self._held = {"event": "progress", "t_s": round(spent, 3), **told}
        if spent >= self._next:
            self._next = spent + min(_LEAST_INTERVAL_S + spent / 500.0, _MOST_INTERVAL_S)
            self.flush()

    def message(self, text: str) -> None:
        self.flush()
        self._write({"event": "message", "t_s": round(time.monotonic() - self._begin, 3), "text": text})

    def flush(self) -> None:
        """Write what was held back."""
        if self._held is not None:
            self._write(self._held)
            self._held = None

    def _write(self, line: dict[str, object]) -> None:
        # what a job says is not worth stopping it for: on a full disk it goes on in silence
        with suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n")


def job_handler() -> Handler:
    """Prepare this process; return what does a job."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # even where it was ignored when we began

    def run(question: Json) -> Reply:
        run_job(WorkFolder(Path(question["folder"])), question["job"])
        return Reply({})

    return run


def run_job(folder: WorkFolder, job_id: str) -> None:
    """Do one job; how it ends stands in its record."""
    record = JobRecord(folder.results, job_id)
    try:
        record.begin()
        progress = _ProgressFile(record.folder / "progress.jsonl")
        progress.message("started")
        answer = _do(record, folder, progress)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is done is done
        progress.flush()
        write_object(record.folder / "answer.json", answer)
        if answer.get("cancelled"):
            kept = _KEPT.get(record.read().kind, "what was finished is kept")
            record.end(*_stopped(kept))
        else:
            record.end("done")
    except (KeyboardInterrupt, Interrupted):
        record.end(*_stopped(_without_result(record)))
    except BaseException as fault:
        _fail(record, fault)


def _do(record: JobRecord, folder: WorkFolder, progress: _ProgressFile) -> dict[str, Any]:
    job = record.read()
    return do(job.kind, job.options, folder, record.folder, progress.progress, resume=job.resumed > 0)


def _fail(record: JobRecord, fault: BaseException) -> None:
    """Write down why a job failed: what was wrong in the data's words, a fault of ours without its inside."""
    if is_full(fault) or is_full(fault.__cause__ or fault):
        record.end("failed", str(NoSpaceError(f"{record.id} could not write its files")))
    elif isinstance(fault, MrdamperError):
        below = f"{record.folder.parent.parent}{os.sep}"  # paths are those in the work folder
        record.end("failed", f"{fault}".replace(below, ""))
    elif isinstance(fault, MemoryError):
        traceback.print_exception(fault)
        record.end("failed", "the job needs more memory than there is; use fewer or shorter runs")
    else:
        traceback.print_exception(fault)
        record.end("failed", FAULT)


def _without_result(record: JobRecord) -> str:
    if record.left(replace(record.read(), state="cancelled")) is None:
        return "there was no result yet; nothing was written"
    return "there was no result yet; what was finished is kept to go on from"


def _stopped(kept: str) -> tuple[EndState, str]:
    if supervisor_is_gone():
        return "interrupted", f"the server was stopped while it ran; {kept}"
    return "cancelled", f"cancelled; {kept}"
