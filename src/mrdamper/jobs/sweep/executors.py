"""Where a sweep's tasks run: processes of this machine, or the workers of a Dask cluster.

Both give results in the order in which they are ready, and both survive a worker that dies: its tasks are
given to another. A task at which workers keep dying is an error of its own.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait

from mrdamper.errors import InputError, MissingExtraError, option
from mrdamper.jobs.sweep.plan import Task, What
from mrdamper.jobs.sweep.tasks import run_task
from mrdamper.runtime.worker import Answer, Worker, WorkerEndedError, WorkerOptions

_MOST_DEATHS = 20  # of workers, one after the other, without a result in between
_CONNECT_S = 20
_LOOK_S = 0.05  # between two looks at what is ready
_ALONE_S = 600.0  # how long a cluster may be without workers
_WORKER = WorkerOptions(handler="mrdamper.jobs.sweep.tasks:task_handler", one_thread=True)


def run_on_processes(tasks: Sequence[Task], workers: int) -> Iterator[tuple[Task, What]]:
    """Run tasks on processes of this machine; give each with its result.

    Raises
    ------
    InputError
        Workers die again and again without a result.
    """
    left, idle = deque(tasks), [Worker(_WORKER) for _ in range(min(workers, len(tasks)))]
    every = tuple(idle)
    running: dict[Future[Answer], tuple[Task, Worker]] = {}
    deaths = 0
    with ThreadPoolExecutor(max(len(every), 1)) as threads:
        try:
            while left or running:
                while left and idle:
                    task, worker = left.popleft(), idle.pop()
                    question = {"kind": task.kind, "seed": task.seed, "what": task.what}
                    running[threads.submit(worker.ask, question)] = task, worker
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    task, worker = running.pop(future)
                    idle.append(worker)
                    try:
                        result = future.result().value
                    except WorkerEndedError as fault:
                        left.appendleft(task)
                        deaths += 1
                        if deaths >= _MOST_DEATHS:
                            raise InputError(
                                f"workers died {deaths} times in a row, the last at {task.name}",
                                remedy=f"Is there enough memory? Use fewer {option('workers')}; "
                                f"{option('resume')} keeps what is done",
                            ) from fault
                        continue
                    yield task, result
                    deaths = 0
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            while any(not future.done() for future in running):
                for worker in every:
                    worker.kill()
                time.sleep(_LOOK_S)
            for worker in every:
                worker.stop()


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
        raise MissingExtraError.of("a sweep on a cluster", "dask.distributed", "scale") from fault
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we tell it, once
    try:
        client = Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise InputError(
            f"no answer within {_CONNECT_S} s ({fault})",
            place=f"scheduler {address!r}",
            expected="the address of a Dask scheduler, such as tcp://host:8786",
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
                            f"{tried[task.name]} x the workers died at it",
                            place=f"task {task.name}",
                            remedy=f"{option('resume')} keeps what is done",
                        ) from fault
                    ready.add(submit(task))
                    continue
                except CancelledError as fault:
                    raise InputError(
                        "has gone away",
                        place=f"scheduler {address!r}",
                        remedy=f"start it again, {option('resume')} keeps what is done",
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
                    f"has had no worker for {_ALONE_S:g} s",
                    place=f"scheduler {address!r}",
                    expected="one at least",
                    remedy=f"Start workers there; {option('resume')} keeps what is done",
                )
    finally:
        client.close()
