"""A supervised process that answers questions, one after another: readers in isolation, web jobs, sweeps.

A question can crash the process, loop for ever or ask for all memory: that costs the process and this
question, and the next one starts another. ``worker_process`` is the other side, and says how the two talk.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock, RLock
from typing import IO

from mrdamper import errors
from mrdamper.errors import MrdamperError
from mrdamper.runtime.limits import ONE_THREAD
from mrdamper.runtime.worker_process import ErrorRecord, WorkerOptions
from mrdamper.schema import Json

__all__ = ["Answer", "Worker", "WorkerEndedError", "WorkerFaultError", "WorkerLateError", "WorkerOptions"]

_READABLE, _WRITABLE = getattr(select, "POLLIN", 0), getattr(select, "POLLOUT", 0)
_COMMAND = (sys.executable, "-P", "-m", "mrdamper.runtime")  # -P: no file in the working folder is imported
_PIECE = 1 << 16  # bytes that are taken at once: what a pipe holds
_LONGEST_LINE = 1 << 30  # bytes
_LOOK_S = 0.05

Room = Callable[[int], memoryview]


class WorkerEndedError(MrdamperError):
    """The process ended, or wrote what is no answer, before it had answered."""

    def __init__(self, returncode: int | None) -> None:
        super().__init__(f"the process of a worker has ended (exit code {returncode})")
        self.returncode = returncode


class WorkerLateError(MrdamperError):
    """No answer came in time."""

    def __init__(self, deadline_s: float) -> None:
        super().__init__(f"the process of a worker has given no answer within {deadline_s:g} s")
        self.deadline_s = deadline_s


class WorkerFaultError(MrdamperError):
    """A fault of the program in the process; the message is its traceback."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to one question, with the raw bytes that came after it."""

    value: Json
    parts: tuple[memoryview, ...]


class Worker:
    """One process, started when it is needed; one question at a time.

    ``ask`` and ``stop`` wait for each other; ``interrupt``, ``hang_up`` and ``kill`` are for other threads.
    """

    def __init__(self, options: WorkerOptions) -> None:
        self.options = options
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._ahead = b""  # what came with the last line, and belongs to the next
        self._lock, self._writing = RLock(), Lock()

    @property
    def pid(self) -> int | None:
        """The process's id; None where none runs for this process."""
        process = self._process
        if process is None or self._owner != os.getpid() or process.poll() is not None:
            return None
        return process.pid

    def start(self) -> None:
        """Start the process, where none is running.

        Raises
        ------
        WorkerEndedError
            The system has no room for another process.
        """
        with self._lock:
            if self.pid is not None:
                return
            self.stop()
            try:
                self._process = start_process(self.options)
            except OSError as fault:
                raise WorkerEndedError(None) from fault
            self._owner, self._ahead = os.getpid(), b""

    def ask(self, question: Json, *, deadline_s: float | None = None, room: Room | None = None) -> Answer:
        """Return the answer to a question; ``room`` makes the memory for a part of so many bytes.

        Raises
        ------
        MrdamperError
            As the handler raised it; an OSError and a MemoryError likewise.
        WorkerEndedError, WorkerLateError, WorkerFaultError
            There is no answer.
        """
        with self._lock:
            self.start()
            assert self._process is not None
            until = None if deadline_s is None else time.monotonic() + deadline_s
            try:
                self._put(json.dumps({"question": question, "seconds": deadline_s}).encode() + b"\n", until)
                found = json.loads(self._line(until))
                if "error" not in found:
                    parts = tuple(map(room or _plain_room, found["parts"]))
                    for part in parts:
                        self._fill(part, until)
                    return Answer(found["answer"], parts)
            except TimeoutError as fault:
                self.stop()
                raise WorkerLateError(deadline_s or 0.0) from fault
            except (OSError, EOFError, ValueError, TypeError, KeyError) as fault:
                process = self._process
                with suppress(subprocess.TimeoutExpired):
                    process.wait(_LOOK_S)  # with its own exit code, where it has ended
                self.stop()
                raise WorkerEndedError(process.returncode) from fault
            except BaseException:  # an interrupt: what is still to come would answer the next question
                self.stop()
                raise
        raise _raised(ErrorRecord(**found["error"]))

    def interrupt(self) -> None:
        """Send the process what Ctrl-C sends."""
        process = self._process
        if process is not None:
            process.send_signal(signal.SIGINT)

    def hang_up(self) -> None:
        """Close the process's standard input, as if this process had ended."""
        with self._writing:
            process = self._process
            if process is not None and process.stdin is not None:
                process.stdin.close()

    def kill(self) -> None:
        """Kill the process, and what it has started when it leads a group; a waiting ``ask`` ends."""
        process = self._process
        if process is None or self._owner != os.getpid():  # a fork's copy is not ours to end
            return
        if self.options.own_group and hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        process.kill()

    def stop(self) -> None:
        """End the process; the next question starts another."""
        while not self._lock.acquire(timeout=_LOOK_S):
            self.kill()
        try:
            self.kill()
            process, self._process = self._process, None
            if process is None or self._owner != os.getpid():
                return
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()
            process.wait()
        finally:
            self._lock.release()

    def _put(self, line: bytes, until: float | None) -> None:
        with self._writing:
            assert self._process is not None
            pipe = self._process.stdin
            if pipe is None or pipe.closed:
                raise EOFError
            left = memoryview(line)
            while left:
                _wait(pipe, _WRITABLE, until)
                left = left[os.write(pipe.fileno(), left[:_PIECE]) :]

    def _line(self, until: float | None) -> bytes:
        """Return the next line."""
        pieces, size = [self._ahead], len(self._ahead)
        while b"\n" not in pieces[-1]:
            pieces.append(os.read(self._ready(until), _PIECE))
            size += len(pieces[-1])
            if not pieces[-1] or size > _LONGEST_LINE:
                raise EOFError
        line, _, self._ahead = b"".join(pieces).partition(b"\n")
        return line

    def _fill(self, room: memoryview, until: float | None) -> None:
        """Take as many bytes as there is room for."""
        at = min(len(self._ahead), len(room))
        room[:at], self._ahead = self._ahead[:at], self._ahead[at:]
        while at < len(room):
            count = os.readv(self._ready(until), [room[at:]])
            if not count:
                raise EOFError
            at += count

    def _ready(self, until: float | None) -> int:
        """Return the handle of standard output when something can be read there, be it the end."""
        assert self._process is not None
        assert self._process.stdout is not None
        _wait(self._process.stdout, _READABLE, until)
        return self._process.stdout.fileno()


def start_process(options: WorkerOptions) -> subprocess.Popen[bytes]:
    """Start a worker's process."""
    process = subprocess.Popen(
        (*_COMMAND, *options.words()),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if options.quiet else None,
        bufsize=0,
        env={**ONE_THREAD, **os.environ} if options.one_thread else None,
        start_new_session=options.own_group,
    )
    assert process.stdin is not None
    if hasattr(select, "poll"):
        os.set_blocking(process.stdin.fileno(), False)  # a process that does not listen is late, too
    return process


def _plain_room(size: int) -> memoryview:
    return memoryview(bytearray(size))


def _wait(pipe: IO[bytes], event: int, until: float | None) -> None:
    """Wait until a pipe can be read or written, or has come to its end."""
    if not hasattr(select, "poll"):  # Windows: reading waits by itself, without a deadline
        return
    poll = select.poll()
    poll.register(pipe.fileno(), event)
    if not poll.poll(None if until is None else 1e3 * max(until - time.monotonic(), 0.0)):
        raise TimeoutError


def _raised(record: ErrorRecord) -> Exception:
    """Return the exception that was described."""
    kind = getattr(errors, record.type, None)
    if isinstance(kind, type) and issubclass(kind, MrdamperError):
        fault = kind.__new__(kind, *record.args)  # its fields are those that were sent
        vars(fault).update(record.fields)
        fault.faults = tuple(_raised(ErrorRecord(**each)) for each in record.faults)  # type: ignore[misc]
        return fault
    if record.type == "OSError":
        found = OSError(record.errno, record.said, record.filename)
        found.add_note(record.trace)
        return found
    if record.type == "MemoryError":
        return MemoryError()
    return WorkerFaultError(record.trace)
