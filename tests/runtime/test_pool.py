"""Pools of processes and threads compute the parts of a job in order and end with the job."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool

import pytest

from mrdamper.errors import InputError
from mrdamper.runtime.pool import Pool, cpu_seconds, limit_jobs

pytestmark = pytest.mark.system
FORKS = pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks")


def _slow_first(k: int) -> int:
    time.sleep(0.02 if k == 0 else 0.0)
    return k * k


@pytest.mark.parametrize("threads", [False, True])
@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_process_pool_results_keep_order_of_items(jobs: int, *, threads: bool):
    """The order of the results does not depend on the number of processes or threads."""
    assert list(Pool(jobs).map(_slow_first, range(7), threads=threads)) == [k * k for k in range(7)]


@FORKS
def test_limit_of_jobs_applies_to_pools_without_number():
    with limit_jobs(1):
        assert set(Pool().map(lambda _: os.getpid(), range(3))) == {os.getpid()}
        assert os.getpid() not in set(Pool(2).map(lambda _: os.getpid(), range(3)))


@FORKS
def test_nested_process_pool_works_in_same_process():
    """A pool runs work in child processes. A pool inside this work runs in the same child process."""

    def process(_: int) -> tuple[int, ...]:
        return os.getpid(), *Pool(2).map(lambda _: os.getpid(), range(2))

    pids = list(Pool(2).map(process, range(4)))
    assert os.getpid() not in {pid for pid, *_ in pids}
    assert all(len(set(each)) == 1 for each in pids)


@pytest.mark.parametrize("threads", [False, True])
def test_process_pool_raises_error_after_earlier_results(*, threads: bool):
    """The results before the error are returned. The error keeps its fields, for example ``expected``."""

    def work(k: int) -> int:
        if k == 2:
            raise InputError(place="run 2", found="is too short", expected="a longer one")
        return k

    results = Pool(2).map(work, range(5), threads=threads)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(InputError) as caught:
        next(results)
    assert caught.value.expected == "a longer one"


@FORKS
def test_interrupt_ends_all_pool_processes():
    """The interrupt ends workers immediately, although their work would take 60 s."""
    pids: list[int] = []

    def work(k: int) -> int:
        if k > 1:
            time.sleep(60.0)
        return os.getpid()

    with pytest.raises(KeyboardInterrupt):  # noqa: PT012 - the interrupt occurs between two results
        for pid in Pool(2).map(work, range(6)):
            pids.append(pid)
            if len(pids) == 2:
                threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
    for pid in set(pids):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


@FORKS
def test_killed_pool_process_raises_error():
    """The error is BrokenProcessPool. The operating system kills a process if memory is short."""

    def work(_: int) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(BrokenProcessPool):
        list(Pool(2).map(work, range(2)))


@FORKS
def test_cpu_time_includes_pool_processes():
    def work(_: int) -> float:
        begun = time.process_time()
        while time.process_time() < begun + 0.05:
            pass
        return time.process_time() - begun

    before = cpu_seconds()
    spent = sum(Pool(2).map(work, range(4)))
    assert spent <= cpu_seconds() - before < spent + 0.5
