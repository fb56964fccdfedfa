"""Process of one job: ``python -P -m mrdamper.web.job_worker FOLDER JOB``, started by the queue.

The process reads the job record and runs the job. Progress, answer and final state are written into the
folder of the job. Therefore no result is lost if the server stops. SIGINT has the effect of Ctrl-C on the
command line: a fit keeps the best result, a sweep keeps its finished tasks, and any other job writes nothing.
The standard input of the process is a pipe from the server. If the pipe closes, the server has stopped, and
the process interrupts the job.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from mrdamper.errors import MrdamperError
from mrdamper.interrupts import Interrupted
from mrdamper.runtime.progress import Progress, ProgressUpdate
from mrdamper.web.adapters import do
from mrdamper.web.job_record import GRACE_S, SERVER_STOPPED, EndState, JobRecord, write_object
from mrdamper.web.workspace import FAULT, NoSpaceError, WorkFolder, is_full

_NICENESS = 10  # Jobs run at low priority so that the pages stay responsive.
_INTERVAL_MIN_S = 0.2  # shortest time between two writes of the progress

_server_is_gone = threading.Event()


def _progress_file(path: Path) -> Progress:
    """Return a function that stores progress, at most every ``_INTERVAL_MIN_S``."""
    written_s = -math.inf

    def write(now: ProgressUpdate) -> None:
        nonlocal written_s
        if time.monotonic() - written_s >= _INTERVAL_MIN_S:
            written_s = time.monotonic()
            with suppress(OSError):  # A full disk must not stop the job.
                write_object(path, {"done": now.done, "of": now.total or 0, "text": now.text})

    return write


def main() -> None:
    """Run the job that the command-line arguments (work folder and job id) specify."""
    folder, job_id = sys.argv[1:]
    os.environ.setdefault("MPLBACKEND", "Agg")
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # Background processes may ignore SIGINT.
    threading.Thread(target=_end_with_server, daemon=True).start()
    run_job(WorkFolder(Path(folder)), job_id)


def _end_with_server() -> None:
    """Wait until standard input closes, interrupt the job, and kill this process group after ``GRACE_S``."""
    os.read(0, 1)
    _server_is_gone.set()
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE_S)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def run_job(folder: WorkFolder, job_id: str) -> None:
    """Run one job and record its end."""
    record = JobRecord(folder.results, job_id)
    try:
        record.begin()
        progress = _progress_file(record.folder / "progress.json")
        job = record.read()
        answer = do(job.kind, job.options, folder, record.folder, progress, resume=job.resumed > 0)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # The job has finished and cannot be cancelled.
        write_object(record.folder / "answer.json", answer)
        if not answer.get("cancelled"):
            record.end("done")
        elif job.kind == "fit":
            record.end(*_stopped("the card contains the best result so far and is marked as cancelled"))
        else:
            record.end(*_stopped("finished parts are kept"))
    except (KeyboardInterrupt, Interrupted):
        if record.is_resumable(replace(record.read(), state="cancelled")):
            record.end(*_stopped("the job had no result; its finished parts are kept for Resume"))
        else:
            record.end(*_stopped("the job had no result; no files were written"))
    except BaseException as fault:
        _fail(record, fault)


def _fail(record: JobRecord, fault: BaseException) -> None:
    """Write the reason of a failure into the record. The traceback of a programming error is omitted."""
    if is_full(fault) or is_full(fault.__cause__ or fault):
        record.end("failed", str(NoSpaceError(f"{record.id} could not write its files")))
    elif isinstance(fault, MrdamperError):
        below = f"{record.folder.parent.parent}{os.sep}"  # Messages show paths relative to the work folder.
        record.end("failed", f"{fault}".replace(below, ""))
    elif isinstance(fault, MemoryError):
        traceback.print_exception(fault)
        record.end("failed", "the job needs more memory than there is; use fewer or shorter runs")
    else:
        traceback.print_exception(fault)
        record.end("failed", FAULT)


def _stopped(kept: str) -> tuple[EndState, str]:
    if _server_is_gone.is_set():
        return "interrupted", f"{SERVER_STOPPED}; {kept}"
    return "cancelled", f"cancelled; {kept}"


if __name__ == "__main__":
    main()
