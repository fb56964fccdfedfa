"""The process of one job: ``python -m mrdamper.web.job_worker FOLDER ID``.

It reads the job's record, does the job, and writes its progress, its answer and its end into the job's
folder, so that nothing is lost when the server is gone by then. An interrupt (SIGINT) is what Ctrl-C is to
the command line: a fit keeps the best it has, any other job leaves nothing. The server holds the other end of
standard input; when that end closes, the server has died, and the job ends itself.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from mrdamper.runtime.signals import Interrupted
from mrdamper.web.job_record import JobRecord, write_whole
from mrdamper.web.workspace import FAULT, NoSpaceError, WorkFolder, is_full

__all__ = ["GRACE_S", "main"]

GRACE_S = 3.0
"""How long an interrupted job may take to keep what it has [s]."""

_LEAST_INTERVAL_S, _MOST_INTERVAL_S = 0.02, 2.0  # between two lines of progress
_NICE = 10  # pages come before jobs


_KEPT = {
    "identify": "what was written is the best so far, marked as cancelled",
    "cycles": "what was counted until then is kept",
}
"""What a job that was interrupted leaves, by kind."""


class _Sayer:
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


def main(root: str, job_id: str) -> int:
    """Do one job; return the exit code of the command line."""
    folder = WorkFolder(Path(root))
    record = JobRecord(folder.results, job_id)
    orphaned = threading.Event()
    try:
        _end_with_the_server(orphaned)
        signal.signal(signal.SIGINT, signal.default_int_handler)  # even where it was ignored when we began
        record.begin()
        sayer = _Sayer(record.folder / "progress.jsonl")
        sayer.message("started")
        answer = _do(record, folder, sayer)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is done is done
        sayer.flush()
        write_whole(record.folder / "answer.json", answer)
        if answer.get("cancelled"):
            kept = _KEPT.get(record.read()["kind"], "what was finished is kept")
            record.end(*_stopped(orphaned, kept))
            return 4
        record.end("done")
        return 0
    except (KeyboardInterrupt, Interrupted):
        record.end(*_stopped(orphaned, _without_result(record)))
        return 4
    except BaseException as fault:
        return _fail(record, orphaned, fault)


def _do(record: JobRecord, folder: WorkFolder, sayer: _Sayer) -> dict[str, Any]:
    from mrdamper.web.adapters import do

    asked = record.read()
    return do(
        asked["kind"],
        asked["options"],
        folder,
        record.folder,
        sayer.progress,
        resume=bool(asked.get("resumed")),
    )


def _fail(record: JobRecord, orphaned: threading.Event, fault: BaseException) -> int:
    """Write down why a job failed: what was wrong in the data's words, a fault of ours without its inside."""
    from mrdamper.errors import MrdamperError

    if is_full(fault) or is_full(fault.__cause__ or fault):
        record.end("failed", str(NoSpaceError(f"{record.id} could not write its files")))
        return 1
    if isinstance(fault, MrdamperError):
        record.end("failed", record_words(str(fault), record.folder))
        return fault.exit_code
    traceback.print_exception(fault)
    if isinstance(fault, MemoryError):
        record.end("failed", "the job needs more memory than there is; use fewer or shorter runs")
    else:
        record.end("failed", FAULT)
    return 1


def record_words(message: str, folder: Path) -> str:
    """Return a message with the paths of the work folder cut short to what is below it."""
    root = str(folder.parent.parent) + os.sep
    return message.replace(root, "")


def _without_result(record: JobRecord) -> str:
    left = record.left(record.read() | {"state": "cancelled"})
    return (
        "there was no result yet; nothing was written"
        if left is None
        else "there was no result yet; what was finished is kept to go on from"
    )


def _stopped(orphaned: threading.Event, what: str) -> tuple[str, str]:
    if orphaned.is_set():
        return "interrupted", f"the server was stopped while it ran; {what}"
    return "cancelled", f"cancelled; {what}"


def _end_with_the_server(orphaned: threading.Event) -> None:
    def watch() -> None:
        # not through sys.stdin: its lock would be held by this thread at the interpreter's end
        while os.read(0, 64):
            pass
        orphaned.set()
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(GRACE_S)
        os.killpg(os.getpgid(0), signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()


def _run() -> NoReturn:
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.nice(_NICE)
    sys.exit(main(sys.argv[1], sys.argv[2]))


if __name__ == "__main__":
    _run()
