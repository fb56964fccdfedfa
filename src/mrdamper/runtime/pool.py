"""The machine's cores at one step of a job: the same work on many items, results in the items' order.

>>> from mrdamper.runtime.pool import Pool
>>> list(Pool(2).map(abs, [-1, 2, -3]))
[1, 2, 3]

Work is done in forks of this process: they see all that it has in memory, so that nothing is sent to them,
and only results come back, pickled. What work changes in memory, files or progress is lost with the fork;
what is to be kept it returns. Work that spends its time where the interpreter's lock is free (the C kernel,
linear algebra) may run in ``threads`` instead: it starts at once, and must share nothing that it changes.

The results do not depend on the number of jobs, as long as work on an item depends on that item alone. Work
inside work is done one after the other. An error comes up in its item's turn. An interrupt, an error, or a
caller who asks for no more results ends all that is under way: forks are killed, threads finish the item that
they are at. Where a process cannot be forked safely (only Linux does), threads do the work.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from contextvars import ContextVar
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, NoReturn, TypeVar

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

Item = TypeVar("Item")
Found = TypeVar("Found")

_FORKS = sys.platform == "linux"
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_INSIDE: ContextVar[bool] = ContextVar("inside the work of a pool", default=False)


def usable_cores() -> int:
    """Return how many cores this process may use, at least 1."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cpu_seconds() -> float:
    """Return the processor time [s] of this process and of all processes that it has started and seen end."""
    spent = time.process_time()
    if resource is not None:
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent += ended.ru_utime + ended.ru_stime
    return spent


@dataclass(frozen=True, slots=True)
class Pool:
    """So many jobs at a time; it holds nothing between two calls.

    Attributes
    ----------
    jobs : 1 or more; None: as many as there are usable cores
    """

    jobs: int | None = None

    def map(
        self, work: Callable[[Item], Found], items: Sequence[Item], *, threads: bool = False
    ) -> Generator[Found, None, None]:
        """Yield ``work(item)`` for each item, in the items' order, as soon as it is there.

        Parameters
        ----------
        work : any function, closures included; in a fork its result must be one that can be pickled
        threads : work is done with the interpreter's lock free, and shares nothing that it changes

        Raises
        ------
        ChildProcessError
            A fork died (killed for want of memory, most likely).
        """
        count = min(self.jobs or usable_cores(), len(items))
        if count <= 1 or _INSIDE.get():
            return (work(item) for item in items)
        return (_by_threads if threads or not _FORKS else _by_forks)(work, items, count)


ONE_CORE = Pool(1)
"""Does all work one after the other, in this process."""


def _by_threads(
    work: Callable[[Item], Found], items: Sequence[Item], count: int
) -> Generator[Found, None, None]:
    def inside(item: Item) -> Found:
        _INSIDE.set(True)  # a thread has a context of its own
        return work(item)

    executor = ThreadPoolExecutor(count)
    try:
        for future in [executor.submit(inside, item) for item in items]:
            yield future.result()
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@dataclass(frozen=True, slots=True)
class _Fork:
    """A process that answers places of items with results."""

    pid: int
    pipe: Connection[Any, Any]


def _by_forks(
    work: Callable[[Item], Found], items: Sequence[Item], count: int
) -> Generator[Found, None, None]:
    forks: list[_Fork] = []
    found: dict[int, tuple[bool, Any]] = {}
    left = iter(range(len(items)))
    try:
        for _ in range(count):
            forks.append(_forked(work, items, forks))
            forks[-1].pipe.send(next(left))
        for due in range(len(items)):
            while due not in found:
                ready = wait([each.pipe for each in forks])
                for pipe in (each.pipe for each in forks if each.pipe in ready):
                    _take(pipe, found)
                    if (place := next(left, None)) is not None:
                        pipe.send(place)
            good, value = found.pop(due)
            if not good:
                raise value
            yield value
    finally:
        for each in forks:
            each.pipe.close()
            os.kill(each.pid, signal.SIGKILL)
        for each in forks:
            with suppress(ChildProcessError):  # somebody else has seen it end
                os.waitpid(each.pid, 0)


def _take(pipe: Connection[Any, Any], found: dict[int, tuple[bool, Any]]) -> None:
    try:
        place, good, value = pipe.recv()
    except (EOFError, ConnectionResetError) as fault:
        raise ChildProcessError("a process of the pool has died; is there enough memory?") from fault
    found[place] = good, value


def _forked(work: Callable[[Item], Found], items: Sequence[Item], before: Sequence[_Fork]) -> _Fork:
    ours, theirs = Pipe()
    with warnings.catch_warnings():
        # Newer Pythons warn where a thread runs (one that shows progress): the fork touches nothing of it.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        theirs.close()
        return _Fork(pid, ours)
    try:
        for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(each, signal.SIG_IGN)  # the process that has forked ends all
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
        for pipe in (ours, *(each.pipe for each in before)):
            pipe.close()
        _serve(work, items, theirs)
    finally:
        os._exit(0)  # nothing of the process that has forked may be flushed or tidied up twice


def _serve(work: Callable[[Item], Found], items: Sequence[Item], pipe: Connection[Any, Any]) -> NoReturn:
    """Answer places of items until the pipe closes."""
    _INSIDE.set(True)
    while True:
        place = pipe.recv()
        try:
            answer = pickle.dumps((place, True, work(items[place])), pickle.HIGHEST_PROTOCOL)
        except Exception as fault:  # raised again in the item's turn
            answer = _failed(place, fault)
        pipe.send_bytes(answer)


def _failed(place: int, fault: Exception) -> bytes:
    """Return the answer for an error; one that cannot be pickled is told by its text."""
    try:
        answer = pickle.dumps((place, False, fault))
        pickle.loads(answer)
    except Exception:
        answer = pickle.dumps((place, False, RuntimeError(f"{type(fault).__name__}: {fault}")))
    return answer
