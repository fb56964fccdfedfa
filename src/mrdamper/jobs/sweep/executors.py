"""Where a sweep's tasks run: processes of this machine, or the workers of a Dask cluster.

Both give results in the order in which they are ready, and both survive a worker that dies: its tasks are
given to another. A task at which workers keep dying is an error of its own.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process

from mrdamper.errors import InputError, MissingExtraError
from mrdamper.jobs.sweep.plan import Task, What
from mrdamper.jobs.sweep.tasks import run_task

__all__ = ["run_on_cluster", "run_on_processes"]

_MOST_DEATHS = 20  # of workers, one after the other, without a result in between
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_CONNECT_S = 20
_LOOK_S = 0.05  # between two looks at what is ready
_ALONE_S = 600.0  # how long a cluster may be without workers


def run_on_processes(tasks: Sequence[Task], workers: int) -> Iterator[tuple[Task, What]]:
    """Run tasks on processes of this machine; give each with its result.

    Raises
    ------
    InputError
        Workers die again and again without a result.
    """
    left = deque(tasks)
    deaths = 0
    for name in _ONE_THREAD:  # what a worker inherits: one process, one core
        os.environ.setdefault(name, "1")
    while left:
        running: dict[Future[What], Task] = {}
        with _deaf_children():  # the first pool starts the process that keeps its locks
            pool = ProcessPoolExecutor(
                workers, mp_context=get_context("spawn"), initializer=_end_with_the_sweep
            )
        with pool:
            try:
                while left or running:
                    while left and len(running) < 2 * workers:
                        task = left.popleft()
                        with _deaf_children():
                            running[pool.submit(run_task, task.kind, task.seed, task.what)] = task
                    ready, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in ready:
                        result = future.result()
                        yield running.pop(future), result
                        deaths = 0
            except BrokenProcessPool as fault:
                deaths += 1
                left.extendleft(reversed(running.values()))
                if deaths >= _MOST_DEATHS:
                    names = ", ".join(task.name for task in running.values())
                    raise InputError(
                        f"workers died {deaths} times in a row at one of: {names}. Is there enough memory? "
                        "Pass fewer --workers; --resume keeps what is done"
                    ) from fault
            except BaseException:
                for future in running:
                    future.cancel()
                _stop(pool)
                raise


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Give a block in which processes are started that do not hear a terminal's Ctrl-C, nor its end.

    The sweep ends them. A fit of theirs would keep the best so far, and that is no result. What this process
    is sent inside the block reaches it after.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_the_sweep() -> None:
    """End this worker when the sweep's process is gone, killed perhaps: nobody waits for it any more."""
    sweep = parent_process()
    if sweep is None:  # not a worker
        return

    def watch() -> None:
        sweep.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _stop(pool: ProcessPoolExecutor) -> None:
    """End a pool's processes without waiting for what they do."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[tuple[Task, What]]:
    """Run tasks on a Dask cluster; give each with its result.

    The workers need this package, and the files that the tasks name under the same paths.

    Raises
    ------
    InputError
        No scheduler answers at the address, it goes away or has no workers for a long time, or workers die
        again and again at one task.
    MissingExtraError
        dask.distributed is not installed.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as fault:
        raise MissingExtraError(
            "a sweep on a cluster needs dask.distributed, which is not installed; "
            "pip install 'mrdamper[scale]'"
        ) from fault
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we tell it, once
    try:
        client = Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise InputError(
            f"scheduler {address!r}: no answer within {_CONNECT_S} s ({fault}); expected the address of a "
            "Dask scheduler, such as tcp://host:8786"
        ) from fault
    try:
        tried = dict.fromkeys((task.name for task in tasks), 0)
        running = {}

        def submit(task: Task) -> object:
            tried[task.name] += 1
            future = client.submit(
                run_task, task.kind, task.seed, task.what, pure=False, retries=_MOST_DEATHS
            )
            running[future.key] = task
            return future

        ready = as_completed([submit(task) for task in tasks], loop=client.loop)
        alone_since: float | None = None
        while running:
            batch = ready.next_batch(block=False)
            for future in batch:
                task = running.pop(future.key)
                try:
                    result = future.result()
                except KilledWorker as fault:
                    if tried[task.name] >= _MOST_DEATHS:
                        raise InputError(
                            f"task {task.name}: {tried[task.name]} x the workers died at it; "
                            "--resume keeps what is done"
                        ) from fault
                    ready.add(submit(task))
                    continue
                except CancelledError as fault:
                    raise InputError(
                        f"scheduler {address!r}: has gone away; start it again, --resume keeps what is done"
                    ) from fault
                future.release()
                yield task, result
            if batch:
                alone_since = None
                continue
            time.sleep(_LOOK_S)
            if client.scheduler_info(n_workers=-1)["workers"]:
                alone_since = None
                continue
            alone_since = alone_since or time.monotonic()
            if time.monotonic() - alone_since > _ALONE_S:
                raise InputError(
                    f"scheduler {address!r}: has had no worker for {_ALONE_S:g} s; expected one at least. "
                    "Start workers there; --resume keeps what is done"
                )
    finally:
        client.close()
