"""Run the tasks of a sweep on processes of this machine, or on the workers of a Dask cluster.

Both functions generate results in order of completion. If a worker dies, its task is repeated on another
worker. If workers die repeatedly and no task is completed in between, an error is raised.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, as_completed
from concurrent.futures.process import BrokenProcessPool

from mrdamper.errors import InputError, MissingExtraError
from mrdamper.jobs.sweep.plan import Task
from mrdamper.jobs.sweep.tasks import Result, run_task
from mrdamper.runtime.pool import process_pool

DEATHS_MAX = 20
"""Number of worker deaths without a result in between that ends a sweep.

A machine that is short of memory recovers after some deaths, but a task that kills every worker never ends.
"""

CONNECT_MAX_S = 20
WORKERS_WAIT_MAX_S = 600.0  # The scheduler of a cluster may wait for minutes until the first worker starts.


def run_on_processes(tasks: Sequence[Task], workers: int) -> Iterator[tuple[Task, Result]]:
    """Generate (task, result) pairs; the tasks run on processes of this machine.

    Raises
    ------
    InputError
        If workers die ``DEATHS_MAX`` times without a result.
    """
    left = {task.name: task for task in tasks}
    deaths = 0
    while left:
        with process_pool(min(workers, len(left))) as pool:
            futures = {pool.submit(run_task, task): task for task in left.values()}
            try:
                for future in as_completed(futures):
                    result = future.result()
                    task = futures.pop(future)
                    del left[task.name]
                    yield task, result
                    deaths = 0
            except BrokenProcessPool as fault:
                deaths += 1
                if deaths >= DEATHS_MAX:
                    raise InputError(
                        f"workers died {deaths} times without a result, {len(left)} tasks are left",
                        remedy="Use fewer --workers if memory is short; --resume goes on with the rest",
                    ) from fault


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[tuple[Task, Result]]:
    """Generate (task, result) pairs; the tasks run on a Dask cluster.

    The workers need this package, and access to the files of the tasks under the same paths.

    Raises
    ------
    InputError
        If no scheduler answers at the address, the scheduler stops or has no worker, or workers die
        repeatedly during one task.
    MissingExtraError
        If dask.distributed is not installed.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as fault:
        raise MissingExtraError.for_package("a sweep on a cluster", "dask.distributed", "scale") from fault
    # Dask would print messages in addition to the error of this function.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    place = f"scheduler {address!r}"
    try:
        client = Client(address, timeout=CONNECT_MAX_S, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise InputError(
            f"no answer within {CONNECT_MAX_S} s ({fault})",
            place=place,
            expected="the address of a Dask scheduler, such as tcp://host:8786",
        ) from fault
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKERS_WAIT_MAX_S)
        except TimeoutError as fault:
            raise InputError(
                f"has had no worker for {WORKERS_WAIT_MAX_S:g} s",
                place=place,
                remedy="Start workers there; --resume goes on with the rest",
            ) from fault
        futures = {
            future.key: (future, task)
            for task in tasks
            for future in [client.submit(run_task, task, pure=False, retries=DEATHS_MAX)]
        }
        deaths = 0
        ready = as_completed([future for future, _ in futures.values()], loop=client.loop)
        for future in ready:
            _, task = futures.pop(future.key)
            try:
                result = future.result()
            except KilledWorker as fault:
                deaths += 1
                if deaths >= DEATHS_MAX:
                    raise InputError(
                        f"workers died {deaths} times without a result",
                        place=f"task {task.name}",
                        remedy="--resume goes on with the rest",
                    ) from fault
                again = client.submit(run_task, task, pure=False, retries=DEATHS_MAX)
                futures[again.key] = again, task
                ready.add(again)
                continue
            except CancelledError as fault:
                raise InputError(
                    "the scheduler has ended",
                    place=place,
                    remedy="Start it again; --resume goes on with the rest",
                ) from fault
            deaths = 0
            yield task, result
