"""Pools of processes and threads for one step of a job: the same work on many items, results in order.

>>> from mrdamper.runtime.pool import Pool
>>> list(Pool(2).map(abs, [-1, 2, -3]))
[1, 2, 3]

Processes are forks of this one: they share its memory, so that work may be a closure and nothing is sent to
them. Only results come back, pickled. Changes of memory in a fork are lost. Work that mostly runs without
the interpreter's lock (C kernel, linear algebra) may run in ``threads``, which start faster than processes.
Systems other than Linux cannot fork safely and use threads for everything.

Results do not depend on the number of jobs if work on an item depends on that item alone. Work inside work
is done serially.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, TypeVar

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

Item = TypeVar("Item")
Found = TypeVar("Found")

_CAN_FORK = sys.platform == "linux"
_PR_SET_PDEATHSIG = 1
_INSIDE: ContextVar[bool] = ContextVar("inside the work of a pool", default=False)
_shared: list[Any] = []  # Work and items of a process of the pool.


def usable_cores() -> int:
    """Return the number of cores that this process may use, at least 1."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cpu_seconds() -> float:
    """Return the processor time [s] of this process and of its child processes that have ended."""
    spent = time.process_time()
    if resource is not None:
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent += ended.ru_utime + ended.ru_stime
    return spent


@dataclass(frozen=True, slots=True)
class Pool:
    """A number of jobs at a time; processes and threads live during one call of ``map`` only.

    Attributes
    ----------
    jobs : 1 or more; None: the number of usable cores
    """

    jobs: int | None = None

    def map(
        self, work: Callable[[Item], Found], items: Sequence[Item], *, threads: bool = False
    ) -> Generator[Found, None, None]:
        """Generate ``work(item)`` for each item, in order. Closing the generator ends all work.

        Parameters
        ----------
        work : any function, closures included; the result of a fork must be possible to pickle
        threads : True: use threads. ``work`` must release the interpreter's lock, and must not change
            shared objects

        Raises
        ------
        BrokenProcessPool
            A process died, most likely because memory was short.
        """
        count = min(self.jobs or usable_cores(), len(items))
        if count <= 1 or _INSIDE.get():
            return (work(item) for item in items)
        return (_by_threads if threads or not _CAN_FORK else _by_processes)(work, items, count)


ONE_CORE = Pool(1)
"""Does all work serially, in this process."""


@contextmanager
def process_pool(count: int, *shared: object) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes that see ``shared``; kill them if the block does not complete."""
    executor = ProcessPoolExecutor(
        count,
        mp_context=get_context("fork" if _CAN_FORK else None),
        initializer=_begin_process,
        initargs=shared,
    )
    try:
        yield executor
    except BaseException:
        # Python 3.14 has a public method for this, kill_workers.
        for process in list((executor._processes or {}).values()):  # noqa: SLF001
            process.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _begin_process(*shared: object) -> None:
    """Prepare a process of a pool: the parent alone handles signals, and it ends with the parent."""
    _INSIDE.set(True)
    _shared[:] = shared
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_IGN)
    if _CAN_FORK:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _by_processes(
    work: Callable[[Item], Found], items: Sequence[Item], count: int
) -> Generator[Found, None, None]:
    with process_pool(count, work, items) as executor:
        with warnings.catch_warnings():
            # Newer Pythons warn if a thread runs. A fork does not use the parent's threads or their locks.
            warnings.simplefilter("ignore", DeprecationWarning)
            results = executor.map(_work_on, range(len(items)))
        yield from results


def _work_on(index: int) -> Any:  # noqa: ANN401 - the result of any work
    work, items = _shared
    return work(items[index])


def _by_threads(
    work: Callable[[Item], Found], items: Sequence[Item], count: int
) -> Generator[Found, None, None]:
    def inside(item: Item) -> Found:
        _INSIDE.set(True)  # A thread has a context of its own.
        return work(item)

    executor = ThreadPoolExecutor(count)
    try:
        yield from executor.map(inside, items)
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
