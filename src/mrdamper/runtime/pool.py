"""Run the same function on many items in parallel processes or threads; the results are in order.

>>> from mrdamper.runtime.pool import Pool
>>> list(Pool(2).map(abs, [-1, 2, -3]))
[1, 2, 3]

On Linux, the processes are forks of the calling process. A fork sees the memory of the calling process.
Therefore the function can be a closure, and its inputs are not copied. The results are pickled and sent back.
Other changes of memory in a fork are lost. Threads start faster than processes. Use ``threads`` if the
function mostly runs without the global interpreter lock (C kernel, linear algebra). Operating systems other
than Linux always use threads, because they cannot fork safely.

The results do not depend on the number of jobs if the result for an item depends only on this item. A nested
call of ``map`` runs serially.
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

from threadpoolctl import threadpool_limits

try:
    import resource
except ImportError:  # Windows has no module resource.
    resource = None  # type: ignore[assignment]

Item = TypeVar("Item")
Found = TypeVar("Found")

_CAN_FORK = sys.platform == "linux"
_PR_SET_PDEATHSIG = 1
_INSIDE: ContextVar[bool] = ContextVar("inside the work of a pool", default=False)
_THREADS: ContextVar[int] = ContextVar("number of threads of a computation", default=1)
_JOBS_MAX: ContextVar[int | None] = ContextVar("maximum number of jobs of a pool", default=None)
_shared: list[Any] = []  # arguments ``shared`` of ``process_pool``, in each process of the pool


def usable_cores() -> int:
    """Return the number of processor cores that this process may use, at least 1."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cpu_seconds() -> float:
    """Return the CPU time [s] of this process and of its finished child processes."""
    spent = time.process_time()
    if resource is not None:
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent += ended.ru_utime + ended.ru_stime
    return spent


@dataclass(frozen=True, slots=True)
class Pool:
    """A pool with a maximum number of parallel jobs. Processes and threads exist only during ``map``.

    Attributes
    ----------
    jobs : maximum number of parallel jobs, 1 or more; None: the number of ``limit_jobs``, or of usable cores
    """

    jobs: int | None = None

    def map(
        self, work: Callable[[Item], Found], items: Sequence[Item], *, threads: bool = False
    ) -> Generator[Found, None, None]:
        """Generate ``work(item)`` for each item, in order. Closing the generator stops all jobs.

        Parameters
        ----------
        work : any function, also a closure; its results must be picklable if processes are used
        threads : True: use threads instead of processes. ``work`` must not change shared objects, and should
            release the global interpreter lock

        Raises
        ------
        BrokenProcessPool
            If a process dies, most likely because the memory is full.
        """
        count = min(self.jobs or _JOBS_MAX.get() or usable_cores(), len(items))
        if count <= 1 or _INSIDE.get():
            return (work(item) for item in items)
        return (_by_threads if threads or not _CAN_FORK else _by_processes)(work, items, count)


@contextmanager
def limit_jobs(jobs: int | None) -> Iterator[None]:
    """Limit the jobs of all pools without an own number in a ``with`` block; None: no limit."""
    token = _JOBS_MAX.set(jobs)
    try:
        yield
    finally:
        _JOBS_MAX.reset(token)


@contextmanager
def parallel_computations(jobs: int | None) -> Iterator[None]:
    """Allow each computation in a ``with`` block to use ``jobs`` threads; None: one per usable core.

    Linear algebra uses one thread: its matrices are small, and its waiting threads would occupy all cores.
    """
    token = _THREADS.set(jobs or usable_cores())
    try:
        with threadpool_limits(1, user_api="blas"):
            yield
    finally:
        _THREADS.reset(token)


def thread_count() -> int:
    """Return the number of threads that a computation may use. It is 1 inside the work of a pool."""
    return 1 if _INSIDE.get() else _THREADS.get()


ONE_CORE = Pool(1)
"""Pool that runs everything serially in the present process."""


@contextmanager
def process_pool(count: int, *shared: object) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes for a ``with`` statement.

    The processes are killed if the code in the ``with`` statement raises an exception. They find the objects
    ``shared`` in the list ``_shared``.
    """
    executor = ProcessPoolExecutor(
        count,
        mp_context=get_context("fork" if _CAN_FORK else None),
        initializer=_begin_process,
        initargs=shared,
    )
    try:
        yield executor
    except BaseException:
        # Python 3.14 has the public method kill_workers instead.
        for process in list((executor._processes or {}).values()):  # noqa: SLF001
            process.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _begin_process(*shared: object) -> None:
    """Ignore signals that the parent handles, and request a kill when the parent ends."""
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
            # Newer Python versions warn about a fork while threads run. The warning is ignored because the
            # forks use neither the threads of the parent nor their locks.
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
        _INSIDE.set(True)  # set in each thread, because a new thread has the default value
        return work(item)

    executor = ThreadPoolExecutor(count)
    try:
        yield from executor.map(inside, items)
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
