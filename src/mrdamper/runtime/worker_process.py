"""The process side of a worker: it answers questions until they end; ``worker`` is the side that asks.

The protocol, one for all workers: a question is a line of JSON on standard input, ``{"question": {...},
"seconds": most or null}``. An answer is a line of JSON on standard output, ``{"answer": {...}, "parts":
[bytes, ...]}``, followed by that many bytes of each part; or ``{"error": {...}}`` (``error_record``).

What a library prints is no answer: it goes to standard error. When standard input ends, whoever asked is
gone: an idle process ends, one at work is interrupted and, ``grace_s`` later, killed with all that it has
started. It takes neither more memory than it may, nor more processor time for a question than its
``seconds``: what loops for ever ends, even where a library holds the interpreter. It leaves no core.
"""

from __future__ import annotations

import importlib
import json
import os
import select
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import IO, Any, NoReturn

from mrdamper.errors import MrdamperError
from mrdamper.runtime.limits import leave_no_core, limit_memory, limit_processor, lower_priority
from mrdamper.schema import Json


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer to one question: an object of JSON, and raw bytes that follow it."""

    answer: Json
    parts: Sequence[memoryview] = ()


Handler = Callable[[Json], Reply]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerOptions:
    """What a worker's process is, and what it may take.

    Parameters
    ----------
    handler : ``module:function``; the function takes nothing, prepares the process, and returns what answers
        questions
    label : shown by ``ps``
    nice : added to the process's niceness, 0 to 19
    memory_bytes : most memory for data, and three quarters of the machine's at most; None: no limit
    grace_s : time an interrupted question has to come to its end when the supervisor is gone; 0: none
    own_group : the process leads a group of its own, does not hear a terminal's Ctrl-C, and is killed with
        all that it has started; else it belongs to its supervisor's group
    quiet : what it writes on standard error is dropped
    one_thread : linear algebra uses one thread, because there is a worker for each core
    """

    handler: str
    label: str = ""
    nice: int = 0
    memory_bytes: int | None = None
    grace_s: float = 0.0
    own_group: bool = True
    quiet: bool = False
    one_thread: bool = False

    def words(self) -> tuple[str, str, str]:
        """Return the arguments of the process."""
        return self.handler, self.label, json.dumps(asdict(self))


_gone = threading.Event()
_busy = threading.Event()


def supervisor_is_gone() -> bool:
    """Tell a handler that was interrupted whether the process that asked has ended, or closed its pipe."""
    return _gone.is_set()


def main() -> NoReturn:
    """Be the worker that the process's arguments describe."""
    run(WorkerOptions(**json.loads(sys.argv[3])))


def run(options: WorkerOptions) -> NoReturn:
    """Answer questions on standard input until they end."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    lower_priority(options.nice)
    leave_no_core()
    if options.memory_bytes is not None:
        limit_memory(options.memory_bytes)
    threading.Thread(target=_watch, args=(options.grace_s,), daemon=True).start()
    module, _, name = options.handler.partition(":")
    _serve(getattr(importlib.import_module(module), name)(), os.fdopen(0, "rb", closefd=False), answers)
    os._exit(0)  # closing what libraries have left open may crash


def _serve(handler: Handler, questions: Iterable[bytes], answers: IO[bytes]) -> None:
    """Answer questions until they end."""
    for line in questions:
        asked = json.loads(line)
        _busy.set()
        limit_processor(asked["seconds"])
        try:
            reply = handler(asked["question"])
            head = {"answer": reply.answer, "parts": [part.nbytes for part in reply.parts]}
            told = json.dumps(head, ensure_ascii=False, allow_nan=False)
        except Exception as fault:
            reply, told = Reply({}), json.dumps({"error": asdict(error_record(fault))}, default=str)
        with suppress(BrokenPipeError):  # nobody waits for it any more
            answers.write(told.encode() + b"\n")
            for part in reply.parts:
                answers.write(part)
            answers.flush()
        _busy.clear()


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorRecord:
    """An exception as JSON has it: its class's name, its arguments and its fields; of a fault its trace."""

    type: str
    args: Sequence[str] = ()
    fields: Mapping[str, Any] = field(default_factory=dict)
    faults: Sequence[Json] = ()  # those that were gathered into it
    errno: int | None = None
    said: str = ""
    filename: str | None = None
    trace: str = ""


def error_record(fault: Exception) -> ErrorRecord:
    """Return what an exception was, for the process that asked."""
    kind = type(fault).__name__
    if isinstance(fault, MrdamperError):
        fields = {name: value for name, value in vars(fault).items() if name != "faults"}
        faults = [asdict(error_record(each)) for each in fault.faults]
        return ErrorRecord(type=kind, args=fault.args, fields=fields, faults=faults)
    if isinstance(fault, MemoryError):
        return ErrorRecord(type="MemoryError")
    if isinstance(fault, OSError):
        said, name = fault.strerror or str(fault), fault.filename
        return ErrorRecord(
            type="OSError",
            errno=fault.errno,
            said=said,
            filename=None if name is None else os.fsdecode(name),
            trace=traceback.format_exc(),
        )
    return ErrorRecord(type="Exception", trace="".join(traceback.format_exception(fault)))


def _watch(grace_s: float) -> None:
    """Wait until the other end of standard input is closed; end what is at work then."""
    if not hasattr(select, "poll"):  # Windows: an idle process ends, one at work first ends its work
        return
    poll = select.poll()
    poll.register(0, 0)  # hang-ups alone: questions are for the main thread
    poll.poll()
    _gone.set()
    if _busy.is_set() and grace_s > 0.0:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(grace_s)
    if _busy.is_set():
        if os.getpgid(0) == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os.kill(os.getpid(), signal.SIGKILL)
